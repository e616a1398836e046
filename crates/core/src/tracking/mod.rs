//! Where are the others: targets seen by radar from a platform whose own pose is uncertain.
//!
//! A radar measures range and bearing from the own ship. Where the own ship is, and above all where
//! it points, comes from a navigation filter and is in error; that error is the same from scan to
//! scan for a while, so it cannot be treated as more radar noise. The trackers here differ in
//! what they make of it:
//!
//! | tracker | file | own pose | when |
//! |---|---|---|---|
//! | [`PoseAsKnown`] | `pose_as_known.rs` | taken as exact | the baselines: true pose, and uncompensated |
//! | [`ConvertedMeasurement`] | `converted_measurement.rs` | its covariance inflates the noise | only pose covariance, no correlation wanted |
//! | [`SchmidtKalman`] | `schmidt_kalman.rs` | cross-covariance carried along | the default: exact, or with feed-forward |
//! | [`BlackBoxSchmidt`] | `black_box.rs` | cross-covariance with an assumed correlation time | the navigation shows its pose only |
//! | [`JointEkf`] | `joint.rs` | estimated together | the bound: the radar corrects the navigation too |
//!
//! Those follow one target whose detections are known to be its own. For many targets in clutter:
//!
//! | file | what is in it |
//! |---|---|
//! | [`own_ship`] | the own ship's pose with its covariance, and how fast its errors are forgotten |
//! | [`pose_error`] | how long those errors last, learnt from targets seen together |
//! | [`echo`] | how long echoes stay where they are on their targets, learnt from looks in a row |
//! | [`detection`] | what radar, camera and AIS report; predicted measurement and Jacobians |
//! | [`coordinated_turn`] | motion in a circle, its Jacobian; constant velocity in the same states |
//! | [`imm`] | several motion models at once, with the cross-covariance to the own ship |
//! | [`association`] | gates, PDA, IPDA, JIPDA |
//! | [`multi_target`] | the tracker: initiation, existence, confirmation, deletion |
//!
//! How close they will come, and how likely too close: [`collision`].
//!
//! # States of a target
//!
//! Trackers of one target, on a straight course: `[north, v_north, east, v_east]` (m, m/s; [`TrackEstimate`]).
//! Those of many targets, which turn: the same four and the turn rate (rad/s, clockwise as a heading;
//! [`coordinated_turn::TargetState`], [`imm::Mode`]), so the first four mean the same in both. Pose of the own ship: `[north,
//! east, heading]`, heading clockwise from north, rad. Derivation of it all:
//! `docs/derivations/schmidt_kalman.md`.

pub mod association;
pub mod black_box;
pub mod body_frame;
pub mod collision;
pub mod constant_velocity;
pub mod converted_measurement;
pub mod coordinated_turn;
pub mod detection;
pub mod dwell_time;
pub mod echo;
mod expected_detection;
pub mod imm;
pub mod initiation;
pub mod joint;
pub mod line_of_sight;
mod linearization;
pub mod multi_target;
pub mod own_ship;
pub mod pose_as_known;
pub mod pose_error;
pub mod radar;
pub mod schmidt_kalman;
mod seen;
mod update;
pub mod visibility;

pub use crate::kalman::NavigationPose;
pub use black_box::BlackBoxSchmidt;
pub use body_frame::BodyFrameTracker;
pub use collision::ClosestApproach;
pub use constant_velocity::ConstantVelocity;
pub use converted_measurement::{Conversion, ConvertedMeasurement};
pub use detection::{Detection, DetectionNoise};
pub use joint::JointEkf;
pub use line_of_sight::SeenTrack;
pub use multi_target::{
    EndedTrack, MultiTargetConfig, MultiTargetTracker, Scan, ScanSensor, SensorScale, Track,
    TrackEnd, TrackStatus,
};
pub use own_ship::{OwnShip, PoseErrorCorrelation};
pub use pose_as_known::PoseAsKnown;
pub use radar::{RadarDetection, RadarNoise};
pub use schmidt_kalman::{Coupling, SchmidtKalman};

use nalgebra::{Matrix2, Matrix4, Vector4};

use crate::kalman::SkipReason;
use crate::kalman::covariance::{cap_variance, forget_correlations_unless_resolved, is_resolved};
use crate::parameters::{ConfigError, Range};
use crate::restorable::{InvalidState, covariance, finite};
use crate::scalar::{Scalar, lit};

/// Where a target is and how it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TrackEstimate<T: Scalar> {
    /// `[north, v_north, east, v_east]`, m and m/s.
    pub state: Vector4<T>,
    /// Covariance of the state.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub covariance: Matrix4<T>,
}

impl<T: Scalar> TrackEstimate<T> {
    /// Whether position (m), velocity (m/s) and their standard deviations are at most 1e8, and the covariance is one.
    pub fn is_usable(&self) -> bool {
        let limit = lit::<T>(FARTHEST);
        self.is_within_limits()
            && self
                .covariance
                .diagonal()
                .iter()
                .all(|v| *v <= limit * limit)
            && is_resolved(&self.covariance)
    }

    fn is_within_limits(&self) -> bool {
        self.state.iter().all(|x| x.abs() <= lit(FARTHEST))
    }

    /// Refuses one that is not [usable](Self::is_usable), as an argument.
    fn checked(self) -> Result<Self, ConfigError> {
        let range = Range::Described("at most 1e8 in each component, with a covariance");
        let field = "track";
        self.is_usable()
            .then_some(self)
            .ok_or(ConfigError { field, range })
    }

    /// Keeps variances where numbers still mean something: correlations stay, or are forgotten where rounding has made
    /// them more than one.
    fn hold(&mut self) {
        let limit = lit::<T>(FARTHEST * FARTHEST);
        for i in 0..4 {
            cap_variance(&mut self.covariance, i, limit);
        }
        forget_correlations_unless_resolved(&mut self.covariance, &Vector4::repeat(limit));
    }

    /// Standard deviations of `[north, v_north, east, v_east]`, m and m/s.
    pub fn std(&self) -> Vector4<T> {
        self.covariance.diagonal().map(|v| v.max(T::zero()).sqrt())
    }

    /// Covariance of the position, north and east, m^2.
    pub fn position_covariance(&self) -> Matrix2<T> {
        let p = &self.covariance;
        Matrix2::new(p[(0, 0)], p[(0, 2)], p[(2, 0)], p[(2, 2)])
    }

    /// The ellipse about the position that holds the target with this probability, from 0 to below 1: both semi-axes (m),
    /// the longer one first, and the direction of the longer one, rad clockwise from north.
    pub fn position_ellipse(&self, probability: T) -> ([T; 2], T) {
        let p = self.position_covariance();
        let (mean, half) = (
            (p[(0, 0)] + p[(1, 1)]) * lit(0.5),
            (p[(0, 0)] - p[(1, 1)]) * lit(0.5),
        );
        let spread = half.hypot(p[(0, 1)]);
        // The quantile of chi-square with two degrees of freedom in closed form.
        let quantile = (T::one() - probability).ln() * lit(-2.0);
        let semi_axis = |variance: T| (variance.max(T::zero()) * quantile).sqrt();
        let azimuth = p[(0, 1)].atan2(half) * lit(0.5);
        (
            [semi_axis(mean + spread), semi_axis(mean - spread)],
            azimuth,
        )
    }

    /// Whether a saved one can be continued from.
    fn check(&self) -> Result<(), InvalidState> {
        finite("track", &self.state)?;
        covariance("covariance of the track", &self.covariance)
    }
}

/// What all trackers of one target need to know.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(deny_unknown_fields)
)]
pub struct TrackerConfig<T: Scalar> {
    /// How the target moves.
    pub motion: ConstantVelocity<T>,
    /// Noise of the radar.
    pub radar: RadarNoise<T>,
    /// NIS (two degrees of freedom) above which a detection is refused; default 0: none is.
    /// Lowering it keeps out wild detections, and true ones after a jump of the own pose.
    pub gate_nis: T,
}

impl<T: Scalar> TrackerConfig<T> {
    /// Without a gate.
    pub fn new(motion: ConstantVelocity<T>, radar: RadarNoise<T>) -> Self {
        Self {
            motion,
            radar,
            gate_nis: T::zero(),
        }
    }

    /// Checks every setting.
    ///
    /// # Errors
    /// The first one outside its permitted range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let acceleration = self.motion.acceleration_std;
        Range::From(0.0, 1e3).check("motion.acceleration_std", acceleration)?;
        Range::From(1e-3, 1e6).check("radar.range_std", self.radar.range_std)?;
        Range::From(1e-6, 10.0).check("radar.bearing_std", self.radar.bearing_std)?;
        Range::From(0.0, 1e6).check("gate_nis", self.gate_nis)
    }
}

/// Largest position (m) and velocity (m/s) of a target, and their largest standard deviations.
const FARTHEST: f64 = 1e8;
/// Longest prediction in one go, s.
const LONGEST_STEP_S: f64 = 3600.0;

/// Refuses a step in time that is not finite, not forward, or absurdly long.
fn check_step<T: Scalar>(dt: T) -> Result<(), SkipReason> {
    if !dt.is_finite() {
        Err(SkipReason::NotFinite)
    } else if dt <= T::zero() {
        Err(SkipReason::NotNewer)
    } else if dt > lit(LONGEST_STEP_S) {
        Err(SkipReason::OutOfRange)
    } else {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ellipse_of_a_position_has_its_axes_its_direction_and_its_probability() {
        // Standard deviations of 30 m towards 20 degrees east of north and of 10 m across.
        let turn = nalgebra::Rotation2::new(20_f64.to_radians());
        let p = turn * Matrix2::new(900.0, 0.0, 0.0, 100.0) * turn.inverse();
        let mut covariance = Matrix4::zeros();
        for (i, row) in [0, 2].into_iter().enumerate() {
            for (j, column) in [0, 2].into_iter().enumerate() {
                covariance[(row, column)] = p[(i, j)];
            }
        }
        let state = Vector4::zeros();
        let ([long, short], azimuth) = TrackEstimate { state, covariance }.position_ellipse(0.95);
        let quantile = 5.991_464_547_107_98_f64.sqrt();
        assert!((long - 30.0 * quantile).abs() < 1e-9 && (short - 10.0 * quantile).abs() < 1e-9);
        assert!((azimuth.to_degrees() - 20.0).abs() < 1e-9);
    }
}

#[cfg(test)]
mod test_scene;
