//! The joint estimator: target and navigation correct each other. The bound on what can be had.
//!
//! It needs a navigation filter of its own, which the radar may move: after each update the
//! correction is handed to that filter, and the angle at which it re-centred comes back. Who
//! navigates by that filter steers by a target's echo; that is why the one-way trackers exist.

use nalgebra::{SMatrix, Vector3};

use super::line_of_sight::SeenTrack;
use super::schmidt_kalman::SchmidtKalmanState;
use super::{
    Coupling, NavigationPose, RadarDetection, SchmidtKalman, TrackEstimate, TrackerConfig,
};
use crate::kalman::{
    ErrorListener, ErrorPropagation, Innovation, OutsideCorrection, ScalarCorrection, SkipReason,
};
use crate::parameters::ConfigError;
use crate::restorable::{InvalidState, Restorable};
use crate::scalar::Scalar;

/// The tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointEkf<T: Scalar, const N: usize> {
    inner: SchmidtKalman<T, N>,
}

impl<T: Scalar, const N: usize> Restorable for JointEkf<T, N> {
    type State = SchmidtKalmanState<T, N>;

    fn save(&self) -> Self::State {
        self.inner.save()
    }

    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState> {
        self.inner.restore(state)
    }
}

impl<T: Scalar, const N: usize> JointEkf<T, N> {
    /// As [`SchmidtKalman::new`].
    ///
    /// # Errors
    /// The first setting outside its permitted range.
    pub fn new(
        config: TrackerConfig<T>,
        track: impl Into<SeenTrack<T>>,
        cross: SMatrix<T, N, 4>,
    ) -> Result<Self, ConfigError> {
        let inner = SchmidtKalman::new(config, Coupling::FeedForward, track, cross)?;
        Ok(Self { inner })
    }

    /// The target.
    pub fn track(&self) -> TrackEstimate<T> {
        self.inner.track()
    }

    /// Moves the target on by `dt` seconds.
    ///
    /// # Errors
    /// Why the step was refused; nothing has changed then.
    pub fn predict(&mut self, dt: T) -> Result<(), SkipReason> {
        self.inner.predict(dt)
    }

    /// Fuses a detection. What it says about the navigation must be given to that filter, and the
    /// angle at which it re-centred to [`ErrorListener::recentred`].
    pub fn update(
        &mut self,
        detection: &RadarDetection<T>,
        own: &NavigationPose<'_, T, N>,
    ) -> (Innovation<T>, Option<OutsideCorrection<T, N>>) {
        let (innovation, told) = self.inner.update_and_tell(detection, own);
        let outside = told.map(|told| {
            let gain = told.covariance * told.inverse;
            let residual = innovation.residual.fixed_rows::<2>(0).into_owned();
            OutsideCorrection {
                correction: gain * residual,
                gain,
                innovation_covariance: told.innovation_covariance,
            }
        });
        (innovation, outside)
    }
}

/// Its own navigation filter tells it what it does, also when it takes in what the radar has taught it.
impl<T: Scalar, const N: usize> ErrorListener<T, N> for JointEkf<T, N> {
    fn propagated(&mut self, transition: &impl ErrorPropagation<T, N>) {
        self.inner.propagated(transition);
    }

    fn corrected<const E: usize>(&mut self, correction: &ScalarCorrection<T, N, E>) {
        self.inner.corrected(correction);
    }

    fn recentred(&mut self, angle: &Vector3<T>) {
        self.inner.recentred(angle);
    }

    fn restarted(&mut self) {
        self.inner.restarted();
    }
}
