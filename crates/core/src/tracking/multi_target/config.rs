//! Settings of the tracker and of the sensors it listens to.

use crate::parameters::{ConfigError, Range};
use crate::scalar::{Scalar, lit};
use crate::tracking::association::ipda::ExistenceModel;
use crate::tracking::coordinated_turn::{Motion, TurnRate};
use crate::tracking::detection::DetectionNoise;
use crate::tracking::imm::Models;
use crate::tracking::own_ship::{PoseErrorCorrelation, PoseLimits};

/// Settings of the tracker.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct MultiTargetConfig<T, const M: usize> {
    /// Motion models and how targets switch between them.
    pub models: Models<T, M>,
    /// Appearing, hiding, disappearing.
    pub existence: ExistenceModel<T>,
    /// Radius of the gate, standard deviations. Raising it loses fewer manoeuvring targets and lets in
    /// more clutter.
    pub gate_sigmas: T,
    /// Existence of a new track. Raising it confirms sooner, and more false tracks.
    pub birth_existence: T,
    /// Standard deviation of a new target's velocity on each axis, m/s.
    pub birth_speed_std_m_s: T,
    /// Existence at which a track is confirmed.
    pub confirm_existence: T,
    /// Existence below which a tentative track is removed.
    pub delete_existence: T,
    /// Existence below which a confirmed track is removed. Lower than for tentative tracks: a known
    /// target may be hidden for a while.
    pub delete_confirmed_existence: T,
    /// Standard deviation of the position beyond which a track says nothing any more, m.
    pub largest_position_std_m: T,
    /// Distance of two tracks in standard deviations below which they are one target.
    pub merge_sigmas: T,
    /// Longest believable time between two scans, s: what lies further ahead has a wrong stamp.
    pub longest_gap_s: T,
    /// How fast the own ship can move.
    pub pose_limits: PoseLimits<T>,
    /// How long errors of the own ship's pose last.
    pub pose_error_correlation: PoseErrorCorrelation<T>,
}

impl<T: Scalar, const M: usize> MultiTargetConfig<T, M> {
    /// Checks every setting.
    ///
    /// # Errors
    /// The first one outside its permitted range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        for motion in &self.models.motions {
            let density = motion.acceleration_noise_density;
            Range::NotNegative.check("models.motions.acceleration_noise_density", density)?;
        }
        if !self.models.dwell_s.iter().all(|dwell| *dwell > T::zero()) {
            let (field, range) = ("models.dwell_s", Range::Described("above 0"));
            return Err(ConfigError { field, range });
        }
        let (turn, existence) = (&self.models.turn, &self.existence);
        let probability = Range::From(0.0, 1.0);
        for (field, value, range) in [
            ("models.turn.std_rad_s", turn.std_rad_s, Range::NotNegative),
            ("models.turn.time_s", turn.time_s, Range::Positive),
            (
                "existence.lifetime_s",
                existence.lifetime_s,
                Range::Positive,
            ),
            ("existence.visible_s", existence.visible_s, Range::Positive),
            ("existence.hidden_s", existence.hidden_s, Range::NotNegative),
            ("gate_sigmas", self.gate_sigmas, Range::Positive),
            (
                "birth_existence",
                self.birth_existence,
                Range::Above(0.0, 1.0),
            ),
            (
                "birth_speed_std_m_s",
                self.birth_speed_std_m_s,
                Range::Positive,
            ),
            ("confirm_existence", self.confirm_existence, probability),
            ("delete_existence", self.delete_existence, probability),
            (
                "delete_confirmed_existence",
                self.delete_confirmed_existence,
                probability,
            ),
            (
                "largest_position_std_m",
                self.largest_position_std_m,
                Range::Positive,
            ),
            ("merge_sigmas", self.merge_sigmas, Range::NotNegative),
            ("longest_gap_s", self.longest_gap_s, Range::Positive),
        ] {
            range.check(field, value)?;
        }
        let named = |error: ConfigError, [first, second]: [&'static str; 2]| ConfigError {
            field: if first.ends_with(error.field) {
                first
            } else {
                second
            },
            ..error
        };
        let limits = ["pose_limits.speed_m_s", "pose_limits.turn_rad_s"];
        let memory = [
            "pose_error_correlation.position_s",
            "pose_error_correlation.heading_s",
        ];
        self.pose_limits.validate().map_err(|e| named(e, limits))?;
        self.pose_error_correlation
            .validate()
            .map_err(|e| named(e, memory))
    }
}

/// What a sensor is like.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(deny_unknown_fields))]
pub struct ScanSensor<T> {
    /// Noise of a detection.
    pub noise: DetectionNoise<T>,
    /// Probability that a visible target is detected in a scan.
    pub detection_probability: T,
    /// False detections per square metre (per radian for bearings) and scan.
    pub clutter_density: T,
    /// Range beyond which the sensor detects nothing, m.
    pub largest_range_m: T,
    /// Whether a target that is not among the detections was missed. Not so for AIS, where a report
    /// speaks of one ship.
    pub covers_all: bool,
    /// Whether a detection may start a track.
    pub initiates: bool,
}

/// One setting for boats and small ships seen by radar: straight, turning, and manoeuvring hard.
impl<T: Scalar> Default for MultiTargetConfig<T, 3> {
    fn default() -> Self {
        Self {
            models: Models {
                motions: [
                    Motion {
                        turns: false,
                        acceleration_noise_density: lit(0.15),
                    },
                    Motion {
                        turns: true,
                        acceleration_noise_density: lit(0.5),
                    },
                    Motion {
                        turns: false,
                        acceleration_noise_density: lit(1.5),
                    },
                ],
                dwell_s: [lit(40.0), lit(30.0), lit(20.0)],
                turn: TurnRate {
                    std_rad_s: lit(0.1),
                    time_s: lit(15.0),
                },
            },
            existence: ExistenceModel {
                lifetime_s: lit(600.0),
                visible_s: lit(60.0),
                hidden_s: lit(15.0),
            },
            gate_sigmas: lit(3.5),
            birth_existence: lit(0.1),
            birth_speed_std_m_s: lit(8.0),
            confirm_existence: lit(0.99),
            delete_existence: lit(0.02),
            delete_confirmed_existence: lit(0.02),
            largest_position_std_m: lit(100.0),
            merge_sigmas: lit(1.0),
            longest_gap_s: lit(3600.0),
            pose_limits: PoseLimits::default(),
            pose_error_correlation: PoseErrorCorrelation::default(),
        }
    }
}
