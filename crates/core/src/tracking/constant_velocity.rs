//! Constant-velocity motion model with white acceleration noise, in axes fixed to the world.
//!
//! Discrete white noise acceleration: constant over each step, independent from step to step, so
//! the noise enters as `G = [dt^2/2, dt]` for each axis and `Q = G G^T sigma^2` (Bar-Shalom, Li &
//! Kirubarajan 2001, section 6.3.2; Wilthil & Brekke, eq 13).

use nalgebra::SMatrix;

use super::{FARTHEST, TrackEstimate};
use crate::kalman::SkipReason;
use crate::kalman::covariance::symmetrize;
use crate::scalar::{Scalar, lit};

/// The motion model.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
pub struct ConstantVelocity<T> {
    /// Standard deviation of the acceleration of each step, m/s^2 per axis. Raising it follows
    /// manoeuvres more quickly and smooths less.
    pub acceleration_std: T,
}

/// `rows <- rows F^T` for rows of the four target states: what `F` does to a cross-covariance that
/// has a column for each of them.
#[inline]
pub(super) fn predict_columns<T: Scalar, const N: usize>(rows: &mut SMatrix<T, N, 4>, dt: T) {
    for i in 0..N {
        let (v_north, v_east) = (rows[(i, 1)], rows[(i, 3)]);
        rows[(i, 0)] += v_north * dt;
        rows[(i, 2)] += v_east * dt;
    }
}

impl<T: Scalar> ConstantVelocity<T> {
    /// With this standard deviation of the acceleration, m/s^2 per axis.
    pub fn new(acceleration_std: T) -> Self {
        Self { acceleration_std }
    }

    /// Moves the target on by `dt` seconds: `x <- F x`, `P <- F P F^T + Q`, each variance at most (1e8)^2.
    ///
    /// # Errors
    /// The target would leave what can be told apart (1e8 m); nothing has changed then.
    #[inline]
    pub fn predict(&self, track: &mut TrackEstimate<T>, dt: T) -> Result<(), SkipReason> {
        self.predict_as_printed(track, dt)?;
        track.hold();
        Ok(())
    }

    /// The same for a form that loses its covariance as printed: nothing is mended.
    #[inline]
    pub(super) fn predict_as_printed(
        &self,
        track: &mut TrackEstimate<T>,
        dt: T,
    ) -> Result<(), SkipReason> {
        let (v_north, v_east) = (track.state[1], track.state[3]);
        let (north, east) = (track.state[0] + v_north * dt, track.state[2] + v_east * dt);
        let limit = lit::<T>(FARTHEST);
        if !(north.abs() <= limit && east.abs() <= limit) {
            return Err(SkipReason::OutOfRange);
        }
        (track.state[0], track.state[2]) = (north, east);
        let p = &mut track.covariance;
        predict_columns(p, dt);
        p.transpose_mut();
        predict_columns(p, dt);
        self.add_noise(track, dt);
        Ok(())
    }

    /// Adds `Q` of a step.
    #[inline]
    pub(super) fn add_noise(&self, track: &mut TrackEstimate<T>, dt: T) {
        let variance = self.acceleration_std * self.acceleration_std;
        let g = [dt * dt * lit(0.5), dt];
        let p = &mut track.covariance;
        for axis in [0, 2] {
            for (i, gi) in g.iter().enumerate() {
                for (j, gj) in g.iter().enumerate() {
                    p[(axis + i, axis + j)] += *gi * *gj * variance;
                }
            }
        }
        symmetrize(p);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::{Matrix4, SMatrix, Vector4};

    #[test]
    fn prediction_equals_the_matrices() {
        let a = Matrix4::from_fn(|i, j| ((3 * i + 7 * j) as f64).sin());
        let p = a * a.transpose();
        let x = Vector4::new(100.0, -3.0, 50.0, 2.0);
        let dt = 2.5;
        let f = Matrix4::new(
            1.0, dt, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, dt, 0.0, 0.0, 0.0, 1.0,
        );
        let g = SMatrix::<f64, 4, 2>::new(dt * dt / 2.0, 0.0, dt, 0.0, 0.0, dt * dt / 2.0, 0.0, dt);
        let mut track = TrackEstimate {
            state: x,
            covariance: p,
        };
        ConstantVelocity {
            acceleration_std: 0.3,
        }
        .predict(&mut track, dt)
        .unwrap();
        assert_relative_eq!(track.state, f * x, epsilon = 1e-12);
        let q = g * g.transpose() * 0.09;
        assert_relative_eq!(track.covariance, f * p * f.transpose() + q, epsilon = 1e-12);
    }
}
