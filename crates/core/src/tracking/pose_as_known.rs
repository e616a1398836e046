//! Extended Kalman filter that takes the own pose as exact.
//!
//! Given the true pose it is the bound of what is possible; given the navigation's pose it is
//! the *uncompensated* tracker, which is overconfident whenever the heading is in error.

use super::radar::PredictedDetection;
use super::update::{Measured, symmetric2};
use super::{RadarDetection, TrackEstimate, TrackerConfig, check_step};
use crate::kalman::{Innovation, SkipReason};
use crate::parameters::ConfigError;
use crate::restorable::{InvalidState, Restorable};
use crate::scalar::Scalar;
use nalgebra::Vector3;

/// The tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseAsKnown<T: Scalar> {
    config: TrackerConfig<T>,
    track: TrackEstimate<T>,
}

impl<T: Scalar> Restorable for PoseAsKnown<T> {
    type State = TrackEstimate<T>;

    fn save(&self) -> Self::State {
        self.track
    }

    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState> {
        state.check()?;
        self.track = state;
        Ok(())
    }
}

impl<T: Scalar> PoseAsKnown<T> {
    /// Starts from a track, such as [`super::initiation::one_point`] gives.
    ///
    /// # Errors
    /// The first setting outside its permitted range.
    pub fn new(config: TrackerConfig<T>, track: TrackEstimate<T>) -> Result<Self, ConfigError> {
        config.validate()?;
        Ok(Self { config, track })
    }

    /// The target.
    pub fn track(&self) -> &TrackEstimate<T> {
        &self.track
    }

    /// Moves the target on by `dt` seconds.
    ///
    /// # Errors
    /// Why the step was refused; nothing has changed then.
    pub fn predict(&mut self, dt: T) -> Result<(), SkipReason> {
        check_step(dt)?;
        self.config.motion.predict(&mut self.track, dt);
        Ok(())
    }

    /// Fuses a detection from this pose: `[north, east, heading]`, m and rad.
    pub fn update(&mut self, detection: &RadarDetection<T>, pose: &Vector3<T>) -> Innovation<T> {
        let predicted = detection
            .check()
            .and_then(|()| PredictedDetection::new(&self.track.state, pose));
        let predicted = match predicted {
            Ok(predicted) => predicted,
            Err(reason) => return Innovation::skipped(reason),
        };
        let h = &predicted.by_target;
        let target = self.track.covariance * h.transpose();
        let measured = Measured {
            residual: predicted.residual(detection),
            covariance: symmetric2(&(h * target + self.config.radar.covariance())),
            target,
        };
        measured.fuse(&mut self.track, self.config.gate_nis).0
    }
}
