//! Motions of the worlds, from a desk to running: what is drawn of each, as a chain of joints.

use core::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use super::WorldMotion;
use super::chain::{Chain, Joint, Signal};
use crate::signals::{Draws, Schedule, Waves};
use crate::world::STANDARD_GRAVITY_M_S2;

/// The quintic between two held values is so many times as steep in the middle as on average.
const STEEPEST: f64 = 1.875;

/// A motion of this kind for so long.
pub(super) fn draw(motion: WorldMotion, seconds: f64, draws: &mut Draws) -> Chain {
    match motion {
        WorldMotion::Desk => desk(draws),
        WorldMotion::PutDown => put_down(seconds, draws),
        WorldMotion::Walking => on_foot(&Gait::walking(draws), seconds, draws),
        WorldMotion::Running => on_foot(&Gait::running(draws), seconds, draws),
        WorldMotion::Swinging => swinging(seconds, draws),
        WorldMotion::Driving => driving(seconds, draws),
        WorldMotion::Drone => drone(seconds, draws),
        WorldMotion::SlowTurns => turns(seconds, [5.0, 30.0], draws),
        WorldMotion::FastTurns => turns(seconds, [200.0, 900.0], draws),
    }
}

/// Zero at rest and one in motion: three quarters of the worlds rest for some seconds first.
fn beginning(draws: &mut Draws) -> Schedule {
    let mut strength = Schedule::starting_at(if draws.chance(0.75) { 0.0 } else { 1.0 });
    if strength.last() < 0.5 {
        strength.then(draws.uniform(2.0, 8.0), draws.uniform(0.5, 2.0), 1.0);
    }
    strength
}

/// The same, with rests in between.
fn now_and_then(seconds: f64, draws: &mut Draws) -> Schedule {
    let mut strength = beginning(draws);
    while strength.end() < seconds {
        strength.then(draws.uniform(3.0, 15.0), draws.uniform(0.5, 1.5), 0.0);
        strength.then(draws.uniform(3.0, 15.0), draws.uniform(0.3, 1.0), 1.0);
    }
    strength
}

fn free_joint(draws: &mut Draws, angle: Signal, arm_m: f64) -> Joint {
    Joint {
        axis: draws.direction(),
        angle,
        arm: draws.direction() * draws.uniform(0.0, arm_m),
    }
}

fn desk(draws: &mut Draws) -> Chain {
    // Mostly flat, face up; sometimes leaning anyhow.
    let level = draws.chance(0.7);
    let tilt = if level {
        draws.small_rotation(0.05)
    } else {
        draws.rotation()
    };
    let mut chain = Chain::at_rest(tilt);
    chain.course = Signal::held(Schedule::starting_at(draws.uniform(-PI, PI)));
    chain
}

fn put_down(seconds: f64, draws: &mut Draws) -> Chain {
    let strength = now_and_then(seconds, draws);
    let mut chain = Chain::at_rest(draws.rotation());
    for _ in 0..3 {
        let rms = draws.uniform(0.2, 0.7);
        let waves = Waves::draw(draws, 4, rms, [0.1, 1.0]);
        // It is put down in another pose than it was taken from.
        let mut held = Schedule::starting_at(draws.uniform(-PI, PI));
        while held.end() < seconds {
            let to = held.last() + draws.uniform(-1.5, 1.5);
            held.then(draws.uniform(3.0, 15.0), draws.uniform(1.0, 3.0), to);
        }
        let angle = Signal {
            held,
            ..Signal::waves(waves, &strength)
        };
        chain.joints.push(free_joint(draws, angle, 0.3));
    }
    for axis in &mut chain.shake {
        let rms = draws.uniform(0.05, 0.3);
        *axis = Signal::waves(Waves::draw(draws, 4, rms, [0.2, 2.0]), &strength);
    }
    chain
}

/// How somebody goes.
struct Gait {
    step_hz: f64,
    speed_m_s: f64,
    /// Amplitude of the vertical acceleration, m/s^2.
    bounce_m_s2: f64,
    /// Amplitude of the swing of leg or arm, rad.
    swing_rad: f64,
    arm_m: f64,
}

impl Gait {
    fn walking(draws: &mut Draws) -> Self {
        Self {
            step_hz: draws.uniform(1.6, 2.2),
            speed_m_s: draws.uniform(0.9, 1.7),
            bounce_m_s2: draws.uniform(1.5, 4.0),
            swing_rad: draws.uniform(0.02, 0.45),
            arm_m: draws.uniform(0.1, 0.5),
        }
    }

    fn running(draws: &mut Draws) -> Self {
        Self {
            step_hz: draws.uniform(2.4, 3.2),
            speed_m_s: draws.uniform(2.0, 5.0),
            bounce_m_s2: draws.uniform(8.0, 18.0),
            swing_rad: draws.uniform(0.1, 0.7),
            arm_m: draws.uniform(0.1, 0.4),
        }
    }

    /// Velocity along one axis: the step and two of its harmonics, its acceleration so many times that of the bounce.
    fn bounce(&self, share: f64, first: f64, draws: &mut Draws) -> Waves {
        let wave = |harmonic: f64, part: f64, draws: &mut Draws| {
            let hz = self.step_hz * harmonic;
            let amplitude = share * part * self.bounce_m_s2 / (TAU * hz);
            [amplitude, hz, draws.uniform(0.0, TAU)]
        };
        Waves(vec![
            wave(first, 1.0, draws),
            wave(2.0 * first, 0.4, draws),
            wave(3.0 * first, 0.2, draws),
        ])
    }
}

fn on_foot(gait: &Gait, seconds: f64, draws: &mut Draws) -> Chain {
    let strength = beginning(draws);
    let mut chain = Chain::at_rest(draws.rotation());
    let mut speed = strength.clone();
    speed.scale(gait.speed_m_s);
    chain.speed = Signal::held(speed);
    let mut course = Schedule::starting_at(draws.uniform(-PI, PI));
    course.then(strength.end(), 1.0, course.last());
    while course.end() < seconds {
        let to = course.last() + draws.sign() * draws.uniform(0.3, 3.0);
        course.then(draws.uniform(3.0, 20.0), draws.uniform(1.0, 4.0), to);
    }
    chain.course = Signal::held(course);
    for (axis, [share, first]) in [[0.3, 0.5], [0.4, 1.0], [1.0, 1.0]].into_iter().enumerate() {
        chain.shake[axis] = Signal::waves(gait.bounce(share, first, draws), &strength);
    }
    let leg = vec![[gait.swing_rad, 0.5 * gait.step_hz, draws.uniform(0.0, TAU)]];
    chain.joints.push(Joint {
        axis: Vector3::x(),
        angle: Signal::waves(Waves(leg), &strength),
        arm: Vector3::new(0.0, 0.0, -gait.arm_m),
    });
    for _ in 0..2 {
        let rms = draws.uniform(0.02, 0.15);
        let sway = Waves::draw(draws, 3, rms, [0.3, gait.step_hz]);
        let joint = free_joint(draws, Signal::waves(sway, &strength), 0.05);
        chain.joints.push(joint);
    }
    chain
}

fn swinging(seconds: f64, draws: &mut Draws) -> Chain {
    let strength = now_and_then(seconds, draws);
    let mut chain = Chain::at_rest(draws.rotation());
    chain.course = Signal::held(Schedule::starting_at(draws.uniform(-PI, PI)));
    let swing = vec![[
        draws.uniform(0.3, 1.1),
        draws.uniform(0.4, 0.9),
        draws.uniform(0.0, TAU),
    ]];
    chain.joints.push(Joint {
        axis: Vector3::x(),
        angle: Signal::waves(Waves(swing), &strength),
        arm: Vector3::new(0.0, 0.0, -draws.uniform(0.3, 0.7)),
    });
    for _ in 0..2 {
        let rms = draws.uniform(0.05, 0.4);
        let twist = Waves::draw(draws, 3, rms, [0.2, 1.0]);
        let joint = free_joint(draws, Signal::waves(twist, &strength), 0.1);
        chain.joints.push(joint);
    }
    chain
}

fn driving(seconds: f64, draws: &mut Draws) -> Chain {
    let moving = beginning(draws);
    let mut chain = Chain::at_rest(draws.rotation());
    let top = draws.uniform(5.0, 30.0);
    let mut speed = Schedule::starting_at(0.0);
    while speed.end() < seconds {
        let to = if draws.chance(0.2) {
            0.0
        } else {
            top * draws.uniform(0.2, 1.0)
        };
        speed.then_no_steeper(draws.uniform(2.0, 10.0), draws.uniform(1.0, 4.0), to);
    }
    chain.speed = Signal::held(speed);
    let mut course = Schedule::starting_at(draws.uniform(-PI, PI));
    while course.end() < seconds {
        let turn: f64 = draws.sign() * draws.uniform(0.1, 1.6);
        // No more than 4 m/s^2 sideways.
        let ramp = STEEPEST * turn.abs() * top / draws.uniform(1.0, 4.0);
        let to = course.last() + turn;
        course.then(draws.uniform(2.0, 10.0), ramp.max(2.0), to);
    }
    chain.course = Signal::held(course);
    for axis in &mut chain.shake {
        let road = draws.log_uniform(0.1, 1.5) / (TAU * 10.0);
        let engine = draws.log_uniform(0.02, 0.5) / (TAU * 35.0);
        let mut waves = Waves::draw(draws, 3, road, [7.0, 14.0]);
        waves
            .0
            .extend(Waves::draw(draws, 2, engine, [25.0, 50.0]).0);
        *axis = Signal::waves(waves, &moving);
    }
    for axis in [Vector3::x(), Vector3::y()] {
        let rms = draws.uniform(0.005, 0.03);
        let angle = Signal::waves(Waves::draw(draws, 3, rms, [0.2, 2.0]), &moving);
        let arm = Vector3::new(0.0, 0.0, draws.uniform(0.0, 0.5));
        chain.joints.push(Joint { axis, angle, arm });
    }
    chain
}

fn drone(seconds: f64, draws: &mut Draws) -> Chain {
    let flying = Schedule::starting_at(1.0);
    let mut chain = Chain::at_rest(draws.rotation());
    // A multirotor leans into its acceleration: small angles, acceleration over gravity.
    for (k, lean) in [Vector3::y(), -Vector3::x()].into_iter().enumerate() {
        let rms = draws.uniform(0.5, 3.0);
        let velocity = Waves::draw(draws, 4, rms, [0.05, 0.3]);
        let tilt = velocity.derivative(1.0 / STANDARD_GRAVITY_M_S2);
        chain.shake[k] = Signal::waves(velocity, &flying);
        chain.joints.push(Joint {
            axis: lean,
            angle: Signal::waves(tilt, &flying),
            arm: Vector3::zeros(),
        });
    }
    let mut yaw = Schedule::starting_at(draws.uniform(-PI, PI));
    while yaw.end() < seconds {
        let to = yaw.last() + draws.uniform(-2.5, 2.5);
        yaw.then(draws.uniform(1.0, 10.0), draws.uniform(1.5, 6.0), to);
    }
    chain.joints.push(Joint {
        axis: Vector3::z(),
        angle: Signal::held(yaw),
        arm: Vector3::zeros(),
    });
    let rotor_hz = draws.uniform(40.0, 150.0);
    let strength_m_s2 = draws.log_uniform(0.5, 8.0);
    for axis in &mut chain.shake {
        let harmonics = [1.0, 2.0].map(|n| {
            let hz = n * rotor_hz * draws.uniform(0.97, 1.03);
            let size = strength_m_s2 * draws.uniform(0.3, 1.0) / n;
            [size / (TAU * hz), hz, draws.uniform(0.0, TAU)]
        });
        axis.waves.0.extend(harmonics);
    }
    let wobble = vec![[
        draws.log_uniform(0.02, 0.3) / (TAU * rotor_hz),
        rotor_hz,
        draws.uniform(0.0, TAU),
    ]];
    let joint = free_joint(draws, Signal::waves(Waves(wobble), &flying), 0.02);
    chain.joints.push(joint);
    chain
}

/// Turns about three axes one after another, at their fastest between these rates, deg/s.
fn turns(seconds: f64, rate_deg_s: [f64; 2], draws: &mut Draws) -> Chain {
    let mut chain = Chain::at_rest(draws.rotation());
    let fast = rate_deg_s[0] > 100.0;
    let mut from_s = draws.uniform(0.5, 6.0);
    let mut angles: Vec<_> = (0..3)
        .map(|_| Schedule::starting_at(draws.uniform(-PI, PI)))
        .collect();
    while from_s < seconds {
        let angle = &mut angles[draws.one_of(&[0, 1, 2])];
        let turn: f64 = draws.sign() * draws.uniform(0.3, 2.5);
        let fastest = draws.log_uniform(rate_deg_s[0], rate_deg_s[1]).to_radians();
        let (hold, ramp) = (from_s - angle.end(), STEEPEST * turn.abs() / fastest);
        let to = angle.last() + turn;
        angle.then(hold, ramp, to);
        let pause = if fast { [0.05, 2.5] } else { [0.3, 5.0] };
        from_s = angle.end() + draws.uniform(pause[0], pause[1]);
    }
    for angle in angles {
        chain
            .joints
            .push(free_joint(draws, Signal::held(angle), 0.1));
    }
    chain
}
