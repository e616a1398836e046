//! Schmidt-Kalman tracker beside a black-box navigation: only its pose and covariance are known.
//!
//! The error of the pose is taken as a Gauss-Markov process with a stated correlation time for
//! position and heading (S11, [`PoseErrorCorrelation`]). While the navigation converges its error shrinks faster than that;
//! so the correlation over a scan is `min(exp(-dt / tau), variance now / variance before)`. With the
//! right times this equals the exact tracker within a part in a thousand; a wrong heading time
//! costs consistency.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::line_of_sight::SeenTrack;
use super::own_ship::PoseErrorCorrelation;
use super::schmidt_kalman::SchmidtKalmanState;
use super::{
    Coupling, NavigationPose, RadarDetection, SchmidtKalman, TrackEstimate, TrackerConfig,
    check_step,
};
use crate::kalman::covariance::is_resolved;
use crate::kalman::{ErrorListener as _, ErrorPropagation, Innovation, SkipReason};
use crate::parameters::ConfigError;
use crate::restorable::{InvalidState, Restorable, covariance, not_negative};
use crate::scalar::Scalar;

/// The tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BlackBoxSchmidt<T: Scalar> {
    inner: SchmidtKalman<T, 3>,
    memory: PoseErrorCorrelation<T>,
    before: Matrix3<T>,
    since_update: T,
}

/// Everything that the tracker remembers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BlackBoxState<T: Scalar> {
    /// Target, and its covariance with the pose error.
    pub tracker: SchmidtKalmanState<T, 3>,
    /// Covariance of the pose at the last scan.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub pose_covariance: Matrix3<T>,
    /// Seconds since the last scan.
    pub since_update_s: T,
}

impl<T: Scalar> Restorable for BlackBoxSchmidt<T> {
    type State = BlackBoxState<T>;

    fn save(&self) -> Self::State {
        BlackBoxState {
            tracker: self.inner.save(),
            pose_covariance: self.before,
            since_update_s: self.since_update,
        }
    }

    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState> {
        covariance("covariance of the pose", &state.pose_covariance)?;
        not_negative("time since the last scan", [&state.since_update_s])?;
        self.inner.restore(state.tracker)?;
        self.before = state.pose_covariance;
        self.since_update = state.since_update_s;
        Ok(())
    }
}

/// What remains of each pose error.
struct Remains<T: Scalar>(Vector3<T>);

impl<T: Scalar> ErrorPropagation<T, 3> for Remains<T> {
    fn map_rows<const C: usize>(&self, rows: &mut SMatrix<T, 3, C>) {
        for mut column in rows.column_iter_mut() {
            column.component_mul_assign(&self.0);
        }
    }
}

impl<T: Scalar> BlackBoxSchmidt<T> {
    /// Starts from a track and its covariance with the pose error (rows `[north, east, heading]`),
    /// at a moment when the pose has this covariance.
    ///
    /// # Errors
    /// The first setting outside its permitted range.
    pub fn new(
        config: TrackerConfig<T>,
        memory: PoseErrorCorrelation<T>,
        track: impl Into<SeenTrack<T>>,
        cross: SMatrix<T, 3, 4>,
        pose_covariance: &Matrix3<T>,
    ) -> Result<Self, ConfigError> {
        memory.validate()?;
        Ok(Self {
            inner: SchmidtKalman::new(config, Coupling::Exact, track, cross)?,
            memory,
            before: *pose_covariance,
            since_update: T::zero(),
        })
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
        check_step(dt)?;
        self.inner.predict(dt)?;
        self.since_update += dt;
        Ok(())
    }

    /// Fuses a detection from a pose with this covariance.
    pub fn update(
        &mut self,
        detection: &RadarDetection<T>,
        pose: &Vector3<T>,
        pose_covariance: &Matrix3<T>,
    ) -> Innovation<T> {
        let variances = pose_covariance.diagonal();
        if !variances.norm_squared().is_finite() {
            return Innovation::skipped(SkipReason::NotFinite);
        }
        if variances.iter().any(|v| *v < T::zero()) || !is_resolved(pose_covariance) {
            return Innovation::skipped(SkipReason::Numerical);
        }
        let remains = self
            .memory
            .factors(&self.before, pose_covariance, self.since_update);
        self.inner.propagated(&Remains(remains));
        self.before = *pose_covariance;
        self.since_update = T::zero();
        let own = NavigationPose {
            pose: *pose,
            covariance: pose_covariance,
            pose_from_error: Matrix3::identity(),
        };
        self.inner.update(detection, &own)
    }
}
