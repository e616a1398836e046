//! Converted measurements: the detection as a position, the own pose's covariance added to its
//! noise.
//!
//! *Read first:* Wilthil & Brekke, eqs 23-27; Bordonaro, Willett & Bar-Shalom, *Decorrelated
//! unbiased converted measurement Kalman filter* (2014), for the debiased form.
//!
//! A linear filter after a nonlinear conversion. The own ship's error enters as if it were new at
//! each scan; that is right only while its correlation time is far below the scan period. With no
//! pose covariance it is the uncompensated linear filter.

use nalgebra::{Matrix2, Matrix3, SMatrix, Vector2, Vector3};

use super::line_of_sight::SeenTrack;
use super::radar::DetectedPosition;
use super::update::{Measured, symmetric2};
use super::{RadarDetection, TrackEstimate, TrackerConfig, check_step};
use crate::kalman::{Innovation, SkipReason};
use crate::parameters::ConfigError;
use crate::restorable::restorable;
use crate::scalar::{Scalar, lit};

/// How a detection becomes a position.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum Conversion {
    /// Linearised at the measurement, as in the paper.
    Linearized,
    /// Free of the bias that a noisy direction has, with its second moments taken at the predicted
    /// position, so that they do not depend on the noise of the measurement they weigh.
    Debiased,
}

/// The tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConvertedMeasurement<T: Scalar> {
    config: TrackerConfig<T>,
    conversion: Conversion,
    track: SeenTrack<T>,
}

restorable!(ConvertedMeasurement<T>, track: SeenTrack<T>);

impl<T: Scalar> ConvertedMeasurement<T> {
    /// Starts from a track, such as [`super::initiation::one_point`] gives.
    ///
    /// # Errors
    /// The first setting outside its permitted range, or `"track"`.
    pub fn new(
        config: TrackerConfig<T>,
        conversion: Conversion,
        track: TrackEstimate<T>,
    ) -> Result<Self, ConfigError> {
        config.validate()?;
        let track = SeenTrack::from(track.checked()?);
        Ok(Self {
            config,
            conversion,
            track,
        })
    }

    /// The target.
    pub fn track(&self) -> TrackEstimate<T> {
        self.track.tangent
    }

    /// Moves the target on by `dt` seconds.
    ///
    /// # Errors
    /// Why the step was refused; nothing has changed then.
    pub fn predict(&mut self, dt: T) -> Result<(), SkipReason> {
        check_step(dt)?;
        self.config.motion.predict(&mut self.track.tangent, dt)
    }

    /// Fuses a detection from a pose with this covariance. The innovation is a position: north and
    /// east, m.
    pub fn update(
        &mut self,
        detection: &RadarDetection<T>,
        pose: &Vector3<T>,
        pose_covariance: &Matrix3<T>,
    ) -> Innovation<T> {
        if let Err(reason) = detection.check() {
            return Innovation::skipped(reason);
        }
        if !(pose.norm_squared().is_finite() && pose_covariance.norm_squared().is_finite()) {
            return Innovation::skipped(SkipReason::NotFinite);
        }
        if pose_covariance.diagonal().iter().any(|v| *v < T::zero()) {
            return Innovation::skipped(SkipReason::Numerical);
        }
        let (position, noise) = match self.conversion {
            Conversion::Linearized => {
                let seen = DetectedPosition::new(detection, pose);
                let radar = self.config.radar.covariance();
                (seen.position, seen.covariance(&radar, pose_covariance))
            }
            Conversion::Debiased => self.debiased(detection, pose, pose_covariance),
        };
        let p = &self.track.tangent.covariance;
        let target = SMatrix::<T, 4, 2>::from_columns(&[p.column(0), p.column(2)]);
        let state = &self.track.tangent.state;
        let block = Matrix2::new(p[(0, 0)], p[(0, 2)], p[(2, 0)], p[(2, 2)]);
        let measured = Measured {
            residual: position - Vector2::new(state[0], state[2]),
            covariance: symmetric2(&(block + noise)),
            target,
        };
        measured.fuse(&mut self.track, self.config.gate_nis, None).0
    }

    /// The mean of `range * cos` of a direction with variance `s^2` is short by `exp(-s^2 / 2)`:
    /// the range is divided by it (S10). Moments at the predicted position, in axes along and
    /// across the line of sight.
    fn debiased(
        &self,
        detection: &RadarDetection<T>,
        pose: &Vector3<T>,
        pose_covariance: &Matrix3<T>,
    ) -> (Vector2<T>, Matrix2<T>) {
        let (half, one) = (lit::<T>(0.5), T::one());
        let radar = self.config.radar.covariance();
        let direction_variance = radar[(1, 1)] + pose_covariance[(2, 2)];
        let shortening = (-direction_variance * half).exp();
        let direction = detection.bearing + pose[2];
        let range = detection.range / shortening;
        let position = Vector2::new(
            pose[0] + range * direction.cos(),
            pose[1] + range * direction.sin(),
        );

        let state = &self.track.tangent.state;
        let line = Vector2::new(state[0] - pose[0], state[2] - pose[1]);
        let r2 = line.norm_squared();
        let along = if r2 > T::zero() {
            line / r2.sqrt()
        } else {
            Vector2::x()
        };
        let across = Vector2::new(-along.y, along.x);
        let second_moment = (r2 + radar[(0, 0)]) / (shortening * shortening) * half;
        let spread = (-direction_variance * lit(2.0)).exp();
        let variance_along = second_moment * (one + spread) - r2;
        let variance_across = second_moment * (one - spread);
        // Heading and position of the own ship are correlated: linear cross terms.
        let with_heading = Vector2::new(pose_covariance[(0, 2)], pose_covariance[(1, 2)]);
        let by_heading = Vector2::new(-line.y, line.x);
        let cross = with_heading * by_heading.transpose();
        let noise = along * along.transpose() * variance_along
            + across * across.transpose() * variance_across
            + pose_covariance.fixed_view::<2, 2>(0, 0)
            + cross
            + cross.transpose();
        (position, noise)
    }
}
