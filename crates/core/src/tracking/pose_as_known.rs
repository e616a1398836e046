//! Extended Kalman filter that takes the own pose as exact.
//!
//! Given the true pose it is the bound of what is possible; given the navigation's pose it is
//! the *uncompensated* tracker, which is overconfident whenever the heading is in error.

use super::initiation::one_point;
use super::line_of_sight::SeenTrack;
use super::linearization::Linearized;
use super::update::{Measured, symmetric2};
use super::{RadarDetection, TrackEstimate, TrackerConfig, check_step};
use crate::kalman::{Innovation, NavigationPose, SkipReason};
use crate::parameters::ConfigError;
use crate::restorable::restorable;
use crate::scalar::Scalar;
use nalgebra::{Matrix3, Vector3};

/// The tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseAsKnown<T: Scalar> {
    config: TrackerConfig<T>,
    track: SeenTrack<T>,
}

restorable!(PoseAsKnown<T>, track: SeenTrack<T>);

impl<T: Scalar> PoseAsKnown<T> {
    /// Starts from a track, such as [`super::initiation::one_point`] gives.
    ///
    /// # Errors
    /// The first setting outside its permitted range, or `"track"`.
    pub fn new(
        config: TrackerConfig<T>,
        track: impl Into<SeenTrack<T>>,
    ) -> Result<Self, ConfigError> {
        config.validate()?;
        let track = track.into().checked()?;
        Ok(Self { config, track })
    }

    /// Starts a track from its first detection ([`super::initiation::one_point`]), seen from this pose: it stands where
    /// it was seen, give or take a speed of `velocity_std` (m/s) on each axis.
    ///
    /// # Errors
    /// Why detection, pose or standard deviation is refused.
    pub fn from_detection(
        config: TrackerConfig<T>,
        detection: &RadarDetection<T>,
        velocity_std: T,
        pose: &Vector3<T>,
    ) -> Result<Self, SkipReason> {
        let exact = Matrix3::zeros();
        let own = NavigationPose::new(*pose, &exact);
        let (track, _) = one_point(detection, &config.radar, velocity_std, &own)?;
        Self::new(config, track).map_err(|_| SkipReason::OutOfRange)
    }

    /// Moves the target on by `dt` seconds and fuses a detection.
    pub fn scan(
        &mut self,
        dt: T,
        detection: &RadarDetection<T>,
        pose: &Vector3<T>,
    ) -> Innovation<T> {
        match self.predict(dt) {
            Ok(()) => self.update(detection, pose),
            Err(reason) => Innovation::skipped(reason),
        }
    }

    /// The target. Its covariance is the mean square error in north and east: that of the arc on which it may be (S22).
    pub fn track(&self) -> TrackEstimate<T> {
        self.track.estimate()
    }

    /// Moves the target on by `dt` seconds.
    ///
    /// # Errors
    /// Why the step was refused; nothing has changed then.
    pub fn predict(&mut self, dt: T) -> Result<(), SkipReason> {
        check_step(dt)?;
        self.config.motion.predict(&mut self.track.tangent, dt)
    }

    /// Fuses a detection from this pose: `[north, east, heading]`, m and rad.
    pub fn update(&mut self, detection: &RadarDetection<T>, pose: &Vector3<T>) -> Innovation<T> {
        if let Err(reason) = detection.check() {
            return Innovation::skipped(reason);
        }
        if !pose.norm_squared().is_finite() {
            return Innovation::skipped(SkipReason::NotFinite);
        }
        let (track, noise) = (&self.track.tangent, &self.config.radar);
        let seen = Linearized::new(detection, track, pose, noise);
        let h = &seen.by_target;
        let target = track.covariance * h.transpose();
        let measured = Measured {
            residual: seen.residual,
            covariance: symmetric2(&(h * target + noise.covariance())),
            target,
        };
        measured
            .fuse(&mut self.track, self.config.gate_nis, seen.sight)
            .0
    }
}
