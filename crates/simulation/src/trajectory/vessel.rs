//! Trajectory of a vessel that carries out manoeuvres: straight legs, turns of constant rate, changes of speed; on
//! request rolling and pitching. World axes are north, east, down; body axes forward, right, down.
//!
//! Everything is in closed form, so rates and accelerations are analytic. A turn begins and ends at
//! once: the rate steps, the heading does not.

use nalgebra::{UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::{Trajectory, Truth};
use crate::rotation::{exp, sin_cos};

/// One manoeuvre.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Manoeuvre {
    /// Ahead with constant speed and heading.
    Straight {
        /// How long, s.
        duration_s: f64,
    },
    /// A turn with constant speed and rate.
    Turn {
        /// Rate, deg/s; positive to the right.
        rate_deg_s: f64,
        /// By how much, deg; its sign does not matter, that of the rate does.
        angle_deg: f64,
    },
    /// A constant acceleration ahead.
    SpeedChange {
        /// Acceleration, m/s^2.
        acceleration_m_s2: f64,
        /// How long, s.
        duration_s: f64,
    },
}

impl Manoeuvre {
    /// Length (s), turn rate (rad/s) and acceleration (m/s^2).
    fn parameters(&self) -> (f64, f64, f64) {
        match *self {
            Self::Straight { duration_s } => (duration_s, 0.0, 0.0),
            Self::Turn {
                rate_deg_s,
                angle_deg,
            } => ((angle_deg / rate_deg_s).abs(), rate_deg_s.to_radians(), 0.0),
            Self::SpeedChange {
                acceleration_m_s2,
                duration_s,
            } => (duration_s, 0.0, acceleration_m_s2),
        }
    }

    /// What is wrong with it, if anything.
    #[must_use]
    pub fn problem(&self) -> Option<&'static str> {
        let (duration, rate, acceleration) = self.parameters();
        let finite = duration.is_finite() && rate.is_finite() && acceleration.is_finite();
        (!finite || duration < 0.0).then_some(
            "a manoeuvre needs finite numbers, a duration of zero or more, and a turn a rate",
        )
    }
}

/// A swing of roll or pitch: `amplitude * sin(2 pi t / period)`.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Swing {
    /// Amplitude, rad.
    pub amplitude_rad: f64,
    /// Period, s; not used while the amplitude is zero.
    pub period_s: f64,
}

impl Swing {
    /// Angle (rad) and its rate (rad/s).
    fn at(&self, t_s: f64) -> (f64, f64) {
        if self.amplitude_rad.abs() <= 0.0 {
            return (0.0, 0.0);
        }
        let omega = std::f64::consts::TAU / self.period_s;
        let (sin, cos) = sin_cos(omega * t_s);
        (self.amplitude_rad * sin, self.amplitude_rad * omega * cos)
    }
}

/// The motion of the hull's centre at one instant, in the plane.
#[derive(Debug, Clone, Copy)]
struct Leg {
    start_s: f64,
    position: [f64; 2],
    heading_rad: f64,
    speed: f64,
    turn_rate: f64,
    acceleration: f64,
}

impl Leg {
    /// Position, heading and speed after `t` seconds of the leg.
    fn after(&self, t: f64) -> ([f64; 2], f64, f64) {
        let (sin0, cos0) = sin_cos(self.heading_rad);
        let heading = self.heading_rad + self.turn_rate * t;
        let [north, east] = self.position;
        if self.turn_rate.abs() > 0.0 {
            let (sin, cos) = sin_cos(heading);
            let radius = self.speed / self.turn_rate;
            let moved = [north + radius * (sin - sin0), east + radius * (cos0 - cos)];
            return (moved, heading, self.speed);
        }
        let distance = self.speed * t + 0.5 * self.acceleration * t * t;
        let moved = [north + distance * cos0, east + distance * sin0];
        (moved, heading, self.speed + self.acceleration * t)
    }
}

/// The vessel.
#[derive(Debug, Clone)]
pub struct Vessel {
    legs: Vec<Leg>,
    down_m: f64,
    roll: Swing,
    pitch: Swing,
}

impl Vessel {
    /// Starts at `position_m` (north, east, down) with this heading (rad, clockwise from north) and
    /// speed (m/s), and carries out the manoeuvres; after the last it goes straight on.
    #[must_use]
    pub fn new(
        position_m: [f64; 3],
        heading_rad: f64,
        speed_m_s: f64,
        manoeuvres: &[Manoeuvre],
    ) -> Self {
        let [north, east, down_m] = position_m;
        let mut leg = Leg {
            start_s: 0.0,
            position: [north, east],
            heading_rad,
            speed: speed_m_s,
            turn_rate: 0.0,
            acceleration: 0.0,
        };
        let mut legs = Vec::with_capacity(manoeuvres.len() + 1);
        for manoeuvre in manoeuvres {
            let (duration_s, turn_rate, acceleration) = manoeuvre.parameters();
            if duration_s <= 0.0 {
                continue;
            }
            leg = Leg {
                turn_rate,
                acceleration,
                ..leg
            };
            legs.push(leg);
            let (position, heading_rad, speed) = leg.after(duration_s);
            leg = Leg {
                start_s: leg.start_s + duration_s,
                position,
                heading_rad,
                speed,
                turn_rate: 0.0,
                acceleration: 0.0,
            };
        }
        legs.push(leg);
        Self {
            legs,
            down_m,
            roll: Swing::default(),
            pitch: Swing::default(),
        }
    }

    /// The same vessel in a seaway.
    #[must_use]
    pub fn swinging(self, roll: Swing, pitch: Swing) -> Self {
        Self {
            roll,
            pitch,
            ..self
        }
    }

    /// Heading at an instant, rad, not wrapped.
    #[must_use]
    pub fn heading_rad(&self, t_s: f64) -> f64 {
        let leg = self.leg(t_s);
        leg.after(t_s - leg.start_s).1
    }

    fn leg(&self, t_s: f64) -> Leg {
        let next = self.legs.partition_point(|leg| leg.start_s <= t_s);
        self.legs[next.saturating_sub(1)]
    }
}

impl Trajectory for Vessel {
    fn at(&self, t_s: f64) -> Truth {
        let leg = self.leg(t_s);
        let ([north, east], heading, speed) = leg.after(t_s - leg.start_s);
        let (roll, roll_rate) = self.roll.at(t_s);
        let (pitch, pitch_rate) = self.pitch.at(t_s);
        let (sin, cos) = sin_cos(heading);
        let turn = |x, y, z| exp(&Vector3::new(x, y, z));
        let ned_from_body: UnitQuaternion<f64> =
            turn(0.0, 0.0, heading) * turn(0.0, pitch, 0.0) * turn(roll, 0.0, 0.0);
        let across = speed * leg.turn_rate;
        let ahead = leg.acceleration;
        Truth {
            world_from_body: ned_from_body,
            angular_rate_body: euler_rate([roll, pitch], [roll_rate, pitch_rate, leg.turn_rate]),
            position: Vector3::new(north, east, self.down_m),
            velocity: Vector3::new(speed * cos, speed * sin, 0.0),
            acceleration_world: Vector3::new(
                ahead * cos - across * sin,
                ahead * sin + across * cos,
                0.0,
            ),
        }
    }
}

/// Body rate from the rates of roll, pitch and heading.
fn euler_rate([roll, pitch]: [f64; 2], [p, q, r]: [f64; 3]) -> Vector3<f64> {
    let ((sin_roll, cos_roll), (sin_pitch, cos_pitch)) = (sin_cos(roll), sin_cos(pitch));
    Vector3::new(
        p - r * sin_pitch,
        q * cos_roll + r * cos_pitch * sin_roll,
        r * cos_pitch * cos_roll - q * sin_roll,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::tests::assert_derivatives;

    fn vessel() -> Vessel {
        let manoeuvres = [
            Manoeuvre::Straight { duration_s: 20.0 },
            Manoeuvre::Turn {
                rate_deg_s: 2.0,
                angle_deg: 60.0,
            },
            Manoeuvre::SpeedChange {
                acceleration_m_s2: 0.1,
                duration_s: 10.0,
            },
            Manoeuvre::Turn {
                rate_deg_s: -3.0,
                angle_deg: 30.0,
            },
        ];
        Vessel::new([100.0, -50.0, 2.0], 0.3, 10.0, &manoeuvres)
    }

    #[test]
    fn rates_and_accelerations_are_the_derivatives() {
        assert_derivatives(&vessel(), 90.0, &[20.0, 50.0, 60.0, 70.0], 1e-5);
        let roll = Swing {
            amplitude_rad: 0.09,
            period_s: 8.0,
        };
        let pitch = Swing {
            amplitude_rad: 0.04,
            period_s: 6.0,
        };
        assert_derivatives(
            &vessel().swinging(roll, pitch),
            90.0,
            &[20.0, 50.0, 60.0, 70.0],
            1e-5,
        );
    }

    #[test]
    fn manoeuvres_join_without_a_jump_and_do_what_they_say() {
        let vessel = vessel();
        for joint in [20.0, 50.0, 60.0, 70.0] {
            let (before, after) = (vessel.at(joint - 1e-7), vessel.at(joint + 1e-7));
            assert!((before.position - after.position).norm() < 1e-5);
            assert!((before.velocity - after.velocity).norm() < 1e-5);
        }
        assert!(
            (vessel.heading_rad(50.0) - vessel.heading_rad(20.0) - 60_f64.to_radians()).abs()
                < 1e-12
        );
        assert!((vessel.at(65.0).velocity.norm() - 11.0).abs() < 1e-12);
        assert!((vessel.heading_rad(200.0) - 0.3 - 30_f64.to_radians()).abs() < 1e-12);
        assert!(
            Manoeuvre::Turn {
                rate_deg_s: 0.0,
                angle_deg: 10.0
            }
            .problem()
            .is_some()
        );
        assert!(Manoeuvre::Straight { duration_s: -1.0 }.problem().is_some());
    }

    #[test]
    fn at_rest_the_specific_force_points_up() {
        let moored = Vessel::new([0.0; 3], 1.0, 0.0, &[]);
        let force = moored
            .at(5.0)
            .specific_force_in(9.81 * Vector3::new(0.0, 0.0, -1.0));
        assert!((force - Vector3::new(0.0, 0.0, -9.81)).norm() < 1e-12);
    }
}
