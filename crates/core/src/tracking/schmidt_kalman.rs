//! The Schmidt-Kalman tracker: the own ship's navigation error is considered, not estimated.
//!
//! *Read first:* Wilthil & Brekke, *Compensation of Navigation Uncertainty for Target Tracking on a
//! Moving Platform* (2016), eqs 13-22; Schmidt, *Application of state-space methods to navigation
//! problems* (1966); `docs/derivations/schmidt_kalman.md`, whose equation numbers (S..) stand at the
//! lines below.
//!
//! Use it when the own pose comes from a filter that can be listened to, and the statement about the
//! target has to be true. When the navigation shows nothing but its pose, see
//! [`super::BlackBoxSchmidt`].
//!
//! # What it carries
//!
//! | symbol | here | |
//! |---|---|---|
//! | `x`, `P_t` | `track` | target |
//! | `X^T` | `cross` (`N` by 4) | covariance of navigation error and target |
//! | `P_o`, `T` | [`NavigationPose`] | from the navigation, never touched |
//!
//! Between scans the cross-covariance follows the navigation error wherever that filter takes it:
//! `X <- F X M^T`, with `M` the product of all that it hears as an [`ErrorListener`]: built into a
//! [`GnssIns`](crate::navigation::GnssIns) it hears everything by itself, and an
//! [`ErrorStateFilter`](crate::navigation::ErrorStateFilter) hands it out step by step
//! ([`GnssCompassUpdate::tell`](crate::navigation::GnssCompassUpdate::tell)). The paper multiplies by the open-loop
//! transition alone ([`Coupling::OpenLoop`]): it believes that a heading error persists which the
//! navigation has long corrected, and the joint covariance loses its sign. [`Coupling::FeedForward`]
//! goes further than the exact recursion: what the compass tells about the heading moves the target,
//! which was seen under that heading; the target never moves the navigation.
//!
//! Cost: one update of 15 navigation states is about 1,500 multiplications. Limits: one target;
//! several targets share the navigation error, and the covariance between them is not kept.

use nalgebra::{Matrix2, SMatrix, Vector3};

use super::constant_velocity::predict_columns;
use super::initiation::one_point;
use super::line_of_sight::SeenTrack;
use super::linearization::Linearized;
use super::radar::PredictedDetection;
use super::update::{Fused, Measured, symmetric2};
use super::{NavigationPose, RadarDetection, TrackEstimate, TrackerConfig, check_step};
use crate::kalman::covariance::symmetrize;
use crate::kalman::feedback::reset_rows;
use crate::kalman::{
    ErrorListener, ErrorPropagation, Innovation, Outcome, ScalarCorrection, SkipReason,
};
use crate::parameters::ConfigError;
use crate::restorable::{InvalidState, Restorable, finite};
use crate::scalar::Scalar;

/// What the cross-covariance follows between scans.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum Coupling {
    /// The closed loop of the navigation: exact.
    Exact,
    /// The closed loop, and the navigation's corrections move the target too: exact, and better.
    FeedForward,
    /// The open-loop transition only, as printed in the paper. For comparison: this is not a
    /// recursion of a covariance.
    OpenLoop,
}

/// The tracker. `examples/schmidt_tracking.rs` connects it to a navigation filter.
///
/// ```
/// use northing_core::kalman::NavigationPose;
/// use northing_core::nalgebra::{Matrix3, Vector3};
/// use northing_core::tracking::{ConstantVelocity, RadarDetection, RadarNoise, SchmidtKalman, TrackerConfig};
///
/// // The own ship's north (m), east (m) and heading (rad), and their covariance.
/// let covariance = Matrix3::from_diagonal(&Vector3::new(4.0, 4.0, 1e-4));
/// let own = NavigationPose::new(Vector3::zeros(), &covariance);
/// let config = TrackerConfig::new(ConstantVelocity::new(0.05), RadarNoise::new(5.0, 0.005));
/// let seen = RadarDetection::new(1000.0, 0.5);
/// let mut tracker = SchmidtKalman::from_detection(config, &seen, 5.0, &own)?;
/// for _ in 0..200 {
///     let innovation = tracker.scan(2.0, &seen, &own);
///     assert!(innovation.outcome.is_fused());
/// }
/// // However often it is seen: 0.01 rad of heading are 10 m at this range, and stay.
/// assert!(tracker.track().std()[2] > 7.0);
/// # Ok::<(), northing_core::kalman::SkipReason>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SchmidtKalman<T: Scalar, const N: usize> {
    config: TrackerConfig<T>,
    coupling: Coupling,
    state: SchmidtKalmanState<T, N>,
}

/// Everything that the tracker remembers.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SchmidtKalmanState<T: Scalar, const N: usize> {
    /// The target.
    pub track: SeenTrack<T>,
    /// Covariance of the navigation error (rows) with the target's state (columns).
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub cross: SMatrix<T, N, 4>,
}

impl<T: Scalar, const N: usize> Restorable for SchmidtKalman<T, N> {
    type State = SchmidtKalmanState<T, N>;

    fn save(&self) -> Self::State {
        self.state
    }

    fn restore(&mut self, state: Self::State) -> Result<(), InvalidState> {
        state.track.check()?;
        finite("cross-covariance", &state.cross)?;
        self.state = state;
        Ok(())
    }
}

/// What an update did, for a joint estimator: gain of the navigation's states, and `S`.
#[derive(Debug, Clone, Copy)]
pub(super) struct OwnPart<T: Scalar, const N: usize> {
    /// `o = cov(navigation error, nu)`.
    pub(super) covariance: SMatrix<T, N, 2>,
    /// `S`.
    pub(super) innovation_covariance: Matrix2<T>,
    /// `S^-1`.
    pub(super) inverse: Matrix2<T>,
}

impl<T: Scalar, const N: usize> SchmidtKalman<T, N> {
    /// Starts from a track and its covariance with the navigation error (one row for each of the
    /// navigation's states), such as [`super::initiation::one_point`] gives; zero for a track that
    /// knows nothing of the navigation.
    ///
    /// # Errors
    /// The first setting outside its permitted range, or `"track"`.
    pub fn new(
        config: TrackerConfig<T>,
        coupling: Coupling,
        track: impl Into<SeenTrack<T>>,
        cross: SMatrix<T, N, 4>,
    ) -> Result<Self, ConfigError> {
        config.validate()?;
        let mut track = track.into().checked()?;
        if coupling == Coupling::OpenLoop {
            track.sight = None;
        }
        Ok(Self {
            config,
            coupling,
            state: SchmidtKalmanState { track, cross },
        })
    }

    /// Starts a track from its first detection ([`super::initiation::one_point`]): it stands where it was seen, give or
    /// take a speed of `velocity_std` (m/s) on each axis. Its coupling is [`Coupling::Exact`].
    ///
    /// # Errors
    /// Why detection, pose or standard deviation is refused.
    pub fn from_detection(
        config: TrackerConfig<T>,
        detection: &RadarDetection<T>,
        velocity_std: T,
        own: &NavigationPose<'_, T, N>,
    ) -> Result<Self, SkipReason> {
        let (track, cross) = one_point(detection, &config.radar, velocity_std, own)?;
        Self::new(config, Coupling::Exact, track, cross).map_err(|_| SkipReason::OutOfRange)
    }

    /// What the cross-covariance follows.
    pub fn coupling(&self) -> Coupling {
        self.coupling
    }

    /// The target. Its covariance is the mean square error in north and east: that of the arc on which it may be (S22). Of
    /// [`Coupling::OpenLoop`] it is the recursion's own.
    pub fn track(&self) -> TrackEstimate<T> {
        self.state.track.estimate()
    }

    /// Covariance of the navigation error (rows) with the target's state (columns).
    pub fn cross_covariance(&self) -> &SMatrix<T, N, 4> {
        &self.state.cross
    }

    /// Moves the target on by `dt` seconds: `X <- F X` (S8).
    ///
    /// # Errors
    /// Why the step was refused; nothing has changed then.
    pub fn predict(&mut self, dt: T) -> Result<(), SkipReason> {
        check_step(dt)?;
        let (motion, track) = (&self.config.motion, &mut self.state.track.tangent);
        match self.coupling {
            Coupling::OpenLoop => motion.predict_as_printed(track, dt)?,
            Coupling::Exact | Coupling::FeedForward => motion.predict(track, dt)?,
        }
        predict_columns(&mut self.state.cross, dt);
        Ok(())
    }

    /// Takes a detection made `dt` seconds after the last one: moves the target on (S8) and fuses (S9). The
    /// navigation's covariance must have caught up, and the tracker must have been told. A `dt` that is refused changes
    /// nothing.
    pub fn scan(
        &mut self,
        dt: T,
        detection: &RadarDetection<T>,
        own: &NavigationPose<'_, T, N>,
    ) -> Innovation<T> {
        match self.predict(dt) {
            Ok(()) => self.update(detection, own),
            Err(reason) => Innovation::skipped(reason),
        }
    }

    /// Fuses a detection (S9). The navigation stays as it is.
    #[inline]
    pub fn update(
        &mut self,
        detection: &RadarDetection<T>,
        own: &NavigationPose<'_, T, N>,
    ) -> Innovation<T> {
        self.update_and_tell(detection, own).0
    }

    /// As the paper has it for its own recursion, otherwise where the detection is straightest.
    fn linearize(
        &self,
        detection: &RadarDetection<T>,
        own: &NavigationPose<'_, T, N>,
    ) -> Result<Linearized<T>, SkipReason> {
        let track = &self.state.track.tangent;
        if self.coupling != Coupling::OpenLoop {
            return Ok(Linearized::new(
                detection,
                track,
                &own.pose,
                &self.config.radar,
            ));
        }
        let predicted = PredictedDetection::new(&track.state, &own.pose)?;
        Ok(Linearized {
            residual: predicted.residual(detection),
            by_target: predicted.by_target,
            by_pose: predicted.by_pose,
            sight: None,
        })
    }

    /// [`Self::update`], which also tells what the detection says about the navigation.
    #[inline]
    pub(super) fn update_and_tell(
        &mut self,
        detection: &RadarDetection<T>,
        own: &NavigationPose<'_, T, N>,
    ) -> (Innovation<T>, Option<OwnPart<T, N>>) {
        if let Err(reason) = detection.check().and_then(|()| own.check()) {
            return (Innovation::skipped(reason), None);
        }
        let seen = match self.linearize(detection, own) {
            Ok(seen) => seen,
            Err(reason) => return (Innovation::skipped(reason), None),
        };
        let h_t = &seen.by_target;
        let h_o = seen.by_pose * own.pose_from_error;
        // a = P_t H_t^T + X H_o^T,  o = X^T H_t^T + P_o H_o^T,  S = H_t a + H_o o + R
        let target = self.state.track.tangent.covariance * h_t.transpose()
            + self.state.cross.tr_mul(&h_o.transpose());
        let navigation = self.state.cross * h_t.transpose() + own.covariance * h_o.transpose();
        let s = h_t * target + h_o * navigation + self.config.radar.covariance();
        let (track, gate) = (&mut self.state.track, self.config.gate_nis);
        let printed = self.coupling == Coupling::OpenLoop;
        let measured = Measured {
            residual: seen.residual,
            covariance: symmetric2(&s),
            target,
        };
        let (innovation, fused) = if printed {
            measured.fuse_as_printed(&mut track.tangent, gate)
        } else {
            measured.fuse(track, gate, seen.sight)
        };
        let Some(Fused { gain, turn }) = fused else {
            if !printed && innovation.outcome == Outcome::Skipped(SkipReason::Numerical) {
                self.state.cross.fill(T::zero());
            }
            return (innovation, None);
        };
        // X <- X - K o^T, turned
        self.state.cross -= navigation * gain.transpose();
        if let Some(turn) = turn {
            self.state.cross = turn.columns(&self.state.cross);
        }
        let told = super::update::inverse2(&measured.covariance).map(|inverse| OwnPart {
            covariance: navigation,
            innovation_covariance: measured.covariance,
            inverse,
        });
        (innovation, told)
    }
}

/// The cross-covariance goes where the navigation filter takes its errors: exact, as long as nothing is left out.
impl<T: Scalar, const N: usize> ErrorListener<T, N> for SchmidtKalman<T, N> {
    /// The navigation filter has propagated its covariance (S5).
    #[inline]
    fn propagated(&mut self, transition: &impl ErrorPropagation<T, N>) {
        transition.map_rows(&mut self.state.cross);
    }

    /// The navigation filter has corrected itself (S6). With feed-forward the correction moves the target by `K_t nu`,
    /// `K_t = X H^T S^-1` (S12).
    #[inline]
    fn corrected<const E: usize>(&mut self, correction: &ScalarCorrection<T, N, E>) {
        if self.coupling == Coupling::OpenLoop {
            return;
        }
        if self.coupling == Coupling::FeedForward {
            let known = correction.measured(&self.state.cross);
            let gain = known / correction.variance;
            self.state.track.tangent.covariance -= gain * known.transpose();
            if let Some(turn) = self.state.track.step(&(gain * correction.residual)) {
                self.state.cross = turn.columns(&self.state.cross);
            }
        }
        correction.map_rows(&mut self.state.cross);
    }

    #[inline]
    fn recentred(&mut self, angle: &Vector3<T>) {
        if self.coupling == Coupling::FeedForward {
            symmetrize(&mut self.state.track.tangent.covariance);
        }
        if self.coupling != Coupling::OpenLoop {
            reset_rows(&mut self.state.cross, angle);
        }
    }

    /// The new errors have nothing to do with those under which the target was seen (S18).
    fn restarted(&mut self) {
        self.state.cross.fill(T::zero());
    }
}
