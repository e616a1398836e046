//! Trajectories: attitude, angular rate, position and acceleration as closed forms of time.
//!
//! A trajectory is anything that can say where the body is at any instant. Rates and accelerations
//! are analytic, never differenced, so sensors can be sampled at any instant and any rate.

mod blend;
mod bursts;
mod coning;
mod flight;
mod multi_sine;
mod sequence;
mod sine;
pub mod vessel;

use std::fmt;

use nalgebra::{UnitQuaternion, Vector3};

pub use bursts::{AccelerationBursts, BurstSchedule, Shaken};
pub use coning::Coning;
pub use flight::{Flight, FlightAttitude, Spin};
pub use multi_sine::{MultiSine, MultiSineConfig};
pub use sequence::{Repeated, Sequence};

use crate::rotation;
use crate::world::specific_force_at_rest;

/// What is true of the body at one instant. World axes are east, north, up, unless the trajectory
/// says otherwise ([`vessel`]: north, east, down).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Truth {
    /// Attitude, `world_from_body`.
    pub world_from_body: UnitQuaternion<f64>,
    /// Angular rate of the body with respect to the world, in body axes, rad/s.
    pub angular_rate_body: Vector3<f64>,
    /// Position in the world, m.
    pub position: Vector3<f64>,
    /// Velocity in the world, m/s.
    pub velocity: Vector3<f64>,
    /// Acceleration in the world (without gravity: zero at rest), m/s^2.
    pub acceleration_world: Vector3<f64>,
}

impl Truth {
    /// At rest at the origin with this attitude.
    #[must_use]
    pub fn at_rest(world_from_body: UnitQuaternion<f64>) -> Self {
        Self {
            world_from_body,
            ..Self::default()
        }
    }

    /// What an ideal accelerometer measures, in body axes, m/s^2; world axes are east, north, up.
    #[must_use]
    pub fn specific_force_body(&self) -> Vector3<f64> {
        self.specific_force_in(specific_force_at_rest())
    }

    /// What an ideal accelerometer measures, in body axes, m/s^2, in a world in which it shows
    /// `at_rest` when it rests in the reference pose.
    #[must_use]
    pub fn specific_force_in(&self, at_rest: Vector3<f64>) -> Vector3<f64> {
        self.world_from_body
            .inverse_transform_vector(&(self.acceleration_world + at_rest))
    }
}

/// A motion in closed form.
pub trait Trajectory: fmt::Debug + Send + Sync {
    /// The truth at `t_s` seconds. Defined for every finite time, also before zero and after the
    /// end of the motion.
    fn at(&self, t_s: f64) -> Truth;

    /// The mean rate over an interval, in body axes, rad/s: the constant rate that turns the
    /// attitude at `from_s` into the one at `to_s`, `Log(q(from)^-1 q(to)) / (to - from)`. This is
    /// what an ideal integrating gyroscope reports for the interval. The body must turn by less
    /// than half a revolution in it.
    fn mean_rate(&self, from_s: f64, to_s: f64) -> Vector3<f64> {
        let from = self.at(from_s).world_from_body;
        let to = self.at(to_s).world_from_body;
        mean_rate(&from, &to, to_s - from_s)
    }
}

/// The constant body rate, rad/s, that turns `from` into `to` within `dt_s`.
#[must_use]
pub fn mean_rate(from: &UnitQuaternion<f64>, to: &UnitQuaternion<f64>, dt_s: f64) -> Vector3<f64> {
    rotation::log(&(from.inverse() * to)) / dt_s
}

/// No motion: a fixed attitude at the origin; by default body axes equal to world axes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Rest {
    /// The attitude, `world_from_body`.
    pub world_from_body: UnitQuaternion<f64>,
}

impl Trajectory for Rest {
    fn at(&self, _t_s: f64) -> Truth {
        Truth::at_rest(self.world_from_body)
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Checks rate, velocity and acceleration of a trajectory against central differences at
    /// instants spread over `[0, duration_s]`, keeping clear of the instants in `kinks_s`.
    pub(crate) fn assert_derivatives(
        trajectory: &dyn Trajectory,
        duration_s: f64,
        kinks_s: &[f64],
        tolerance: f64,
    ) {
        let h = 1e-4;
        for i in 0..=500 {
            let t = duration_s * f64::from(i) / 500.0;
            if kinks_s.iter().any(|kink| (t - kink).abs() <= 2.0 * h) {
                continue;
            }
            let (before, now, after) =
                (trajectory.at(t - h), trajectory.at(t), trajectory.at(t + h));
            let rate = trajectory.mean_rate(t - h, t + h);
            let velocity = (after.position - before.position) / (2.0 * h);
            let acceleration = (after.velocity - before.velocity) / (2.0 * h);
            for (what, numerical, analytic) in [
                ("rate", rate, now.angular_rate_body),
                ("velocity", velocity, now.velocity),
                ("acceleration", acceleration, now.acceleration_world),
            ] {
                let error = (numerical - analytic).norm();
                assert!(error < tolerance, "{what} at {t} s: {error:e}");
            }
        }
    }

    #[test]
    fn at_rest_the_accelerometer_shows_gravity_on_the_axis_that_points_up() {
        let level = Rest::default().at(3.0);
        assert!((level.specific_force_body() - Vector3::new(0.0, 0.0, 9.80665)).norm() < 1e-14);
        // Rolled a quarter turn to the right about the body x axis, the y axis points up.
        let rolled = Rest {
            world_from_body: UnitQuaternion::from_axis_angle(
                &Vector3::x_axis(),
                std::f64::consts::FRAC_PI_2,
            ),
        };
        let force = rolled.at(0.0).specific_force_body();
        assert!((force - Vector3::new(0.0, 9.80665, 0.0)).norm() < 1e-14);
    }

    #[test]
    fn accelerating_north_adds_to_the_specific_force() {
        let truth = Truth {
            acceleration_world: Vector3::new(0.0, 2.0, 0.0),
            ..Truth::at_rest(UnitQuaternion::identity())
        };
        assert!((truth.specific_force_body() - Vector3::new(0.0, 2.0, 9.80665)).norm() < 1e-14);
    }
}
