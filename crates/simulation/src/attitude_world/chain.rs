//! Forward kinematics of a board on a chain of joints: attitude, rate, velocity and acceleration as closed forms of time.
//!
//! A base travels and shakes; each joint turns about an axis of the link before it and carries the next link at the end of
//! an arm. Rates and accelerations go outwards from link to link (the outward recursion of Newton and Euler; Craig,
//! *Introduction to Robotics*, section 6.5), so what the gyroscope and what the accelerometer see are one motion.

use nalgebra::{UnitQuaternion, Vector3};

use crate::rotation::{exp, sin_cos};
use crate::signals::{Jet, Schedule, Waves};

/// A value over time: one that is held and goes smoothly to others, and waves on it that come and go.
#[derive(Debug, Clone)]
pub(super) struct Signal {
    pub(super) held: Schedule,
    pub(super) waves: Waves,
    /// What the waves are multiplied with.
    pub(super) strength: Schedule,
}

impl Signal {
    /// One that is held and changes.
    pub(super) fn held(held: Schedule) -> Self {
        Self {
            held,
            ..Self::zero()
        }
    }

    /// Waves that come and go with a strength.
    pub(super) fn waves(waves: Waves, strength: &Schedule) -> Self {
        Self {
            waves,
            strength: strength.clone(),
            ..Self::zero()
        }
    }

    /// Nothing.
    pub(super) fn zero() -> Self {
        Self {
            held: Schedule::starting_at(0.0),
            waves: Waves::default(),
            strength: Schedule::starting_at(1.0),
        }
    }

    fn jet(&self, t: f64) -> Jet {
        let ([h, h1, h2], [w, w1, w2], [s, s1, s2]) =
            (self.held.jet(t), self.waves.jet(t), self.strength.jet(t));
        [
            h + s * w,
            h1 + s1 * w + s * w1,
            h2 + s2 * w + 2.0 * s1 * w1 + s * w2,
        ]
    }
}

/// A joint, and the arm behind it.
#[derive(Debug, Clone)]
pub(super) struct Joint {
    /// Unit axis, in the link before it.
    pub(super) axis: Vector3<f64>,
    /// rad.
    pub(super) angle: Signal,
    /// From the joint to the end of its link, in the link's axes, m.
    pub(super) arm: Vector3<f64>,
}

/// What is true of the board at one instant; world axes are east, north, up.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct State {
    pub(super) enu_from_body: UnitQuaternion<f64>,
    /// Body axes, rad/s.
    pub(super) angular_rate: Vector3<f64>,
    /// Its derivative in body axes, rad/s^2.
    angular_acceleration: Vector3<f64>,
    /// World axes, m/s.
    pub(super) velocity: Vector3<f64>,
    /// World axes, without gravity, m/s^2.
    pub(super) acceleration: Vector3<f64>,
}

/// A base with joints and a board at the end.
#[derive(Debug, Clone)]
pub(super) struct Chain {
    /// Speed along the course, m/s.
    pub(super) speed: Signal,
    /// Course and heading of the base, counter-clockwise from north, rad.
    pub(super) course: Signal,
    /// Velocity beside it along east, north and up, m/s.
    pub(super) shake: [Signal; 3],
    pub(super) joints: Vec<Joint>,
    /// The board at the end of the last link.
    pub(super) link_from_body: UnitQuaternion<f64>,
}

impl Chain {
    /// One that rests.
    pub(super) fn at_rest(link_from_body: UnitQuaternion<f64>) -> Self {
        Self {
            speed: Signal::zero(),
            course: Signal::zero(),
            shake: [Signal::zero(), Signal::zero(), Signal::zero()],
            joints: Vec::new(),
            link_from_body,
        }
    }

    /// The truth at an instant.
    pub(super) fn at(&self, t: f64) -> State {
        let state = (self.joints.iter()).fold(self.base(t), |state, joint| state.beyond(joint, t));
        state.turned(&self.link_from_body)
    }

    fn base(&self, t: f64) -> State {
        let ([v, v1, _], [yaw, yaw1, yaw2]) = (self.speed.jet(t), self.course.jet(t));
        let (sin, cos) = sin_cos(yaw);
        let (along, across) = (Vector3::new(-sin, cos, 0.0), Vector3::new(-cos, -sin, 0.0));
        let shake = self.shake.each_ref().map(|axis| axis.jet(t));
        let shaken = |k: usize| Vector3::new(shake[0][k], shake[1][k], shake[2][k]);
        State {
            enu_from_body: exp(&(Vector3::z() * yaw)),
            angular_rate: Vector3::z() * yaw1,
            angular_acceleration: Vector3::z() * yaw2,
            velocity: along * v + shaken(0),
            acceleration: along * v1 + across * (v * yaw1) + shaken(1),
        }
    }
}

impl State {
    /// At the end of the link behind this joint.
    fn beyond(&self, joint: &Joint, t: f64) -> Self {
        let [angle, rate, acceleration] = joint.angle.jet(t);
        let own = joint.axis * rate;
        let carried = self.turned(&exp(&(joint.axis * angle)));
        let (w, q) = (carried.angular_rate + own, carried.enu_from_body);
        let w1 = carried.angular_acceleration + joint.axis * acceleration
            - own.cross(&carried.angular_rate);
        let swung = w.cross(&joint.arm);
        Self {
            enu_from_body: q,
            angular_rate: w,
            angular_acceleration: w1,
            velocity: carried.velocity + q * swung,
            acceleration: carried.acceleration + q * (w1.cross(&joint.arm) + w.cross(&swung)),
        }
    }

    /// The same in axes that are turned and stay so.
    fn turned(&self, turn: &UnitQuaternion<f64>) -> Self {
        let back = turn.inverse();
        Self {
            enu_from_body: self.enu_from_body * turn,
            angular_rate: back * self.angular_rate,
            angular_acceleration: back * self.angular_acceleration,
            ..*self
        }
    }
}
