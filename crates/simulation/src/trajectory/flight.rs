//! A flight: bounded accelerations made of sines, with the attitude free of them or thrust-aligned.
//!
//! Position, velocity and acceleration are sums of the same sines, so they stay bounded for ever.
//! The attitude is given by angles of its own (a hand that turns a device while it walks), or the
//! body's z axis stands along the specific force, as a multicopter's does.

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use rand::RngExt as _;
use serde::{Deserialize, Serialize};

use super::sine::Sine;
use super::{Trajectory, Truth};
use crate::random::Stream;
use crate::rotation::sin_cos;
use crate::world::specific_force_at_rest;

/// Sines of the acceleration per axis.
const SINES: usize = 4;
/// Their frequencies are drawn between these, Hz.
const FREQUENCIES_HZ: [f64; 2] = [0.05, 0.25];
/// Share of the horizontal acceleration that the vertical has.
const VERTICAL_SHARE: f64 = 0.4;
/// Amplitude (rad) and frequency (Hz) of the sines of yaw, roll and pitch.
const YAW: [(f64, f64); 2] = [(1.5, 0.03), (0.8, 0.11)];
const ROLL: [(f64, f64); 3] = [(0.35, 0.07), (0.25, 0.23), (0.1, 0.6)];
const PITCH: [(f64, f64); 3] = [(0.35, 0.05), (0.25, 0.19), (0.1, 0.5)];

/// How the attitude goes with the acceleration.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FlightAttitude {
    /// Independent of it.
    Free,
    /// The body's z axis along the specific force; only the yaw is free.
    ThrustAligned,
}

fn sum(sines: &[Sine], t_s: f64) -> [f64; 2] {
    sines.iter().fold([0.0; 2], |[value, slope], sine| {
        let [v, s] = sine.at(t_s);
        [value + v, slope + s]
    })
}

/// Where the body is, four times over: position, velocity, acceleration, jerk.
#[derive(Default)]
struct Course {
    position: Vector3<f64>,
    velocity: Vector3<f64>,
    acceleration: Vector3<f64>,
    jerk: Vector3<f64>,
}

/// The flight. World axes are east, north, up; body axes forward, left, up.
#[derive(Debug, Clone, PartialEq)]
pub struct Flight {
    attitude: FlightAttitude,
    acceleration: [[Sine; SINES]; 3],
    yaw: [Sine; 2],
    roll: [Sine; 3],
    pitch: [Sine; 3],
}

impl Flight {
    /// Draws frequencies, phases and shares from `stream`. `acceleration_rms` (m/s^2) is that of each
    /// horizontal axis; the vertical has 0.4 of it.
    #[must_use]
    pub fn random(stream: &mut Stream, attitude: FlightAttitude, acceleration_rms: f64) -> Self {
        let mut acceleration = [[Sine::default(); SINES]; 3];
        for (axis, sines) in acceleration.iter_mut().enumerate() {
            for sine in sines.iter_mut() {
                let span = FREQUENCIES_HZ[1] - FREQUENCIES_HZ[0];
                let frequency_hz = FREQUENCIES_HZ[0] + span * stream.random::<f64>();
                let share = 0.5 + 0.5 * stream.random::<f64>();
                *sine = Sine::drawn((share, frequency_hz), stream);
            }
            let power: f64 = sines.iter().map(|s| s.amplitude.powi(2)).sum::<f64>() / 2.0;
            let wanted = acceleration_rms * if axis == 2 { VERTICAL_SHARE } else { 1.0 };
            for sine in sines {
                sine.amplitude *= wanted / power.sqrt();
            }
        }
        Self {
            attitude,
            acceleration,
            yaw: YAW.map(|s| Sine::drawn(s, stream)),
            roll: ROLL.map(|s| Sine::drawn(s, stream)),
            pitch: PITCH.map(|s| Sine::drawn(s, stream)),
        }
    }

    fn course(&self, t_s: f64) -> Course {
        let mut course = Course::default();
        for (axis, sines) in self.acceleration.iter().enumerate() {
            for sine in sines {
                let [value, slope] = sine.at(t_s);
                let square = sine.angular_frequency_rad_s.powi(2);
                course.position[axis] -= value / square;
                course.velocity[axis] -= slope / square;
                course.acceleration[axis] += value;
                course.jerk[axis] += slope;
            }
        }
        course
    }

    /// Attitude and body rate from yaw, pitch and roll.
    fn free(&self, t_s: f64) -> (UnitQuaternion<f64>, Vector3<f64>) {
        let [yaw, yaw_rate] = sum(&self.yaw, t_s);
        let [roll, roll_rate] = sum(&self.roll, t_s);
        let [pitch, pitch_rate] = sum(&self.pitch, t_s);
        let ((sin_roll, cos_roll), (sin_pitch, cos_pitch)) = (sin_cos(roll), sin_cos(pitch));
        let rate = Vector3::new(
            roll_rate - yaw_rate * sin_pitch,
            pitch_rate * cos_roll + yaw_rate * sin_roll * cos_pitch,
            -pitch_rate * sin_roll + yaw_rate * cos_roll * cos_pitch,
        );
        (UnitQuaternion::from_euler_angles(roll, pitch, yaw), rate)
    }

    /// Attitude and body rate with z along the specific force and x towards the yaw.
    fn thrust_aligned(&self, t_s: f64, course: &Course) -> (UnitQuaternion<f64>, Vector3<f64>) {
        let [yaw, yaw_rate] = sum(&self.yaw, t_s);
        let (sin_yaw, cos_yaw) = sin_cos(yaw);
        let ahead = Vector3::new(cos_yaw, sin_yaw, 0.0);
        let ahead_slope = Vector3::new(-sin_yaw, cos_yaw, 0.0) * yaw_rate;
        let (z, z_slope) = direction(course.acceleration + specific_force_at_rest(), course.jerk);
        let left_slope = z_slope.cross(&ahead) + z.cross(&ahead_slope);
        let (y, y_slope) = direction(z.cross(&ahead), left_slope);
        let (x, x_slope) = (y.cross(&z), y_slope.cross(&z) + y.cross(&z_slope));
        // The rate of a frame is half the sum of each axis crossed with its derivative.
        let turning = x.cross(&x_slope) + y.cross(&y_slope) + z.cross(&z_slope);
        let rotation = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[x, y, z]));
        let attitude = UnitQuaternion::from_rotation_matrix(&rotation);
        (attitude, attitude.inverse() * turning * 0.5)
    }
}

/// The unit vector along `v`, and its derivative.
fn direction(v: Vector3<f64>, slope: Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let length = v.norm();
    let unit = v / length;
    (unit, (slope - unit * unit.dot(&slope)) / length)
}

impl Trajectory for Flight {
    fn at(&self, t_s: f64) -> Truth {
        let course = self.course(t_s);
        let (world_from_body, angular_rate_body) = match self.attitude {
            FlightAttitude::Free => self.free(t_s),
            FlightAttitude::ThrustAligned => self.thrust_aligned(t_s, &course),
        };
        Truth {
            world_from_body,
            angular_rate_body,
            position: course.position,
            velocity: course.velocity,
            acceleration_world: course.acceleration,
        }
    }
}

/// A body that spins about the vertical at the origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spin {
    /// Rate about up, rad/s.
    pub rate_rad_s: f64,
}

impl Trajectory for Spin {
    fn at(&self, t_s: f64) -> Truth {
        let rate = Vector3::new(0.0, 0.0, self.rate_rad_s);
        Truth {
            angular_rate_body: rate,
            ..Truth::at_rest(UnitQuaternion::from_scaled_axis(rate * t_s))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream;
    use crate::trajectory::tests::assert_derivatives;

    #[test]
    fn rates_velocities_and_accelerations_are_derivatives() {
        for seed in 0..3 {
            for attitude in [FlightAttitude::Free, FlightAttitude::ThrustAligned] {
                let flight = Flight::random(&mut stream(seed, "motion"), attitude, 2.0);
                assert_derivatives(&flight, 60.0, &[], 1e-6);
            }
        }
        assert_derivatives(&Spin { rate_rad_s: 3.0 }, 10.0, &[], 1e-6);
    }

    #[test]
    fn thrust_aligned_means_that_only_the_z_axis_feels_anything() {
        let aligned = FlightAttitude::ThrustAligned;
        let flight = Flight::random(&mut stream(4, "motion"), aligned, 3.0);
        for t in 0..120 {
            let force = flight.at(f64::from(t)).specific_force_body();
            assert!(force.xy().norm() < 1e-12 && force.z > 3.0, "{force}");
        }
    }

    #[test]
    fn the_acceleration_is_as_large_as_asked() {
        let (mut squares, mut count) = (Vector3::zeros(), 0.0);
        for seed in 0..20 {
            let flight = Flight::random(&mut stream(seed, "motion"), FlightAttitude::Free, 1.5);
            for t in 0..1200 {
                let a = flight.at(0.1 * f64::from(t)).acceleration_world;
                squares += a.component_mul(&a);
                count += 1.0;
            }
        }
        let rms = (squares / count).map(f64::sqrt);
        assert!((rms - Vector3::new(1.5, 1.5, 0.6)).norm() < 0.06, "{rms}");
    }
}
