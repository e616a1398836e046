//! Settings of the tracker and of the sensors it listens to.

use crate::parameters::{ConfigError, Range, parameters};
use crate::scalar::{Scalar, lit};
use crate::tracking::association::ipda::ExistenceModel;
use crate::tracking::coordinated_turn::{Motion, TurnRate};
use crate::tracking::detection::DetectionNoise;
use crate::tracking::imm::Models;
use crate::tracking::own_ship::{PoseErrorCorrelation, PoseLimits};

parameters! {
    /// Settings of the tracker beside the motion models.
    pub struct MultiTargetSettings, groups {
        existence: ExistenceModel, [ExistenceModel::default()], "Appearing, hiding, disappearing";
        pose_limits: PoseLimits, [PoseLimits::default()], "How fast the own ship can move";
        pose_error_correlation: PoseErrorCorrelation, [PoseErrorCorrelation::default()], "How long errors of the own ship's pose last";
    };

    learn_pose_error_correlation: bool, "-", Flag, [true],
        "whether errors of the own ship's pose last as long as targets seen together show, where they refute `pose_error_correlation`",
        "Of a time of 0 nothing is learnt, nor from one target alone.";
    learn_visibility: bool, "-", Flag, [true],
        "whether targets hide as rarely, or as often, as their tracks show; `existence.visible_s` is where that begins",
        "Nothing is learnt where `existence.hidden_s` is 0.";
    learn_manoeuvres: bool, "-", Flag, [true],
        "whether a target manoeuvres as rarely, or as often, as its own track, and those of the others, show; `motion.straight_dwell_s` is where that begins";
    gate_sigmas: T, "-", From(1e-3, 1e6), [3.5],
        "radius of the gate, standard deviations",
        "Raising it loses fewer manoeuvring targets and lets in more clutter.";
    birth_existence: T, "-", Above(0.0, 1.0), [0.1],
        "existence of a new track",
        "Raising it confirms sooner, and more false tracks.";
    birth_speed_std_m_s: T, "m/s", From(1e-4, 1e4), [8.0],
        "standard deviation of a new target's velocity on each axis";
    birth_speed_tail: T, "-", From(1.0, 100.0), [3.0],
        "the last of several motion models begins with so many times that standard deviation, for targets that are faster than usual",
        "Raising it finds faster targets, and more false tracks.";
    confirm_existence: T, "-", From(0.0, 1.0), [0.99],
        "existence at which a track is confirmed";
    report_existence: T, "-", From(0.0, 1.0), [0.5],
        "existence below which a confirmed track is kept, but not reported; below 0.5 its target is more likely gone than there",
        "Raising it reports fewer targets that have left, and fewer that hide.";
    delete_existence: T, "-", From(0.0, 1.0), [0.02],
        "existence below which a tentative track is removed";
    delete_confirmed_existence: T, "-", From(0.0, 1.0), [0.02],
        "existence below which a confirmed track is removed",
        "A known target may be hidden for a while: no higher than for tentative tracks.";
    largest_position_std_m: T, "m", From(1e-3, 1e6), [100.0],
        "standard deviation of the position beyond which a track is removed, beside what the own ship's pose adds to it";
    merge_sigmas: T, "-", From(0.0, 1e6), [1.0],
        "distance of two tracks, standard deviations, below which they are one target";
    longest_gap_s: T, "s", From(1e-4, 1e9), [3600.0],
        "longest plausible time between two scans: what lies further ahead has a wrong stamp";
}

/// How a tracker is configured.
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
    /// Everything else.
    pub settings: MultiTargetSettings<T>,
}

impl<T: Scalar, const M: usize> MultiTargetConfig<T, M> {
    /// Checks every setting.
    ///
    /// # Errors
    /// The first one outside its permitted range.
    pub fn validate(&self) -> Result<(), ConfigError> {
        for motion in &self.models.motions {
            let density = motion.acceleration_noise_density;
            Range::From(0.0, 1e3).check("models.motions.acceleration_noise_density", density)?;
        }
        for dwell in self.models.dwell_s {
            Range::From(1e-4, 1e9).check("models.dwell_s", dwell)?;
        }
        let turn = &self.models.turn;
        Range::From(0.0, 10.0).check("models.turn.std_rad_s", turn.std_rad_s)?;
        Range::From(1e-4, 1e9).check("models.turn.time_s", turn.time_s)?;
        self.settings.validate()
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

impl<T: Scalar> ScanSensor<T> {
    /// Whether a sensor can be like that: standard deviations from 0 to 1e6 m and 10 rad, a probability from 0 to 1, clutter
    /// from 0 to 1e6, a range of 0 or above.
    pub fn is_valid(&self) -> bool {
        let within = |x: T, most: f64| x >= T::zero() && x <= lit(most);
        let noise = &self.noise;
        within(noise.range_std_m, 1e6)
            && within(noise.extent_std_m, 1e6)
            && within(noise.bearing_std_rad, 10.0)
            && within(self.detection_probability, 1.0)
            && within(self.clutter_density, 1e6)
            && self.largest_range_m >= T::zero()
    }
}

parameters! {
    /// Motion models of boats and small ships seen by radar: straight, turning, and manoeuvring hard.
    pub struct MotionModels;

    straight_acceleration_noise_density: T, "m/s^2/sqrt(Hz)", From(0.0, 1e3), [0.15],
        "white acceleration noise of the straight model on each axis",
        "Raising it follows small changes of course and speed faster and smooths less.";
    turning_acceleration_noise_density: T, "m/s^2/sqrt(Hz)", From(0.0, 1e3), [0.5],
        "the same of the coordinated turn";
    manoeuvring_acceleration_noise_density: T, "m/s^2/sqrt(Hz)", From(0.0, 1e3), [1.5],
        "the same of the model for hard manoeuvres, which goes straight";
    straight_dwell_s: T, "s", From(1e-4, 1e9), [40.0],
        "mean time that a target stays in the straight model",
        "Raising it switches later to the other models.";
    turning_dwell_s: T, "s", From(1e-4, 1e9), [30.0],
        "the same of the coordinated turn";
    manoeuvring_dwell_s: T, "s", From(1e-4, 1e9), [20.0],
        "the same of the model for hard manoeuvres";
    turn_rate_std_rad_s: T, "rad/s", From(0.0, 10.0), [0.1],
        "stationary standard deviation of the turn rate, a first-order Gauss-Markov process";
    turn_rate_time_s: T, "s", From(1e-4, 1e9), [15.0],
        "correlation time of the turn rate: how long a turn lasts";
}

impl<T: Scalar> From<MotionModels<T>> for Models<T, 3> {
    fn from(models: MotionModels<T>) -> Self {
        let motion = |turns, acceleration_noise_density| Motion {
            turns,
            acceleration_noise_density,
        };
        Self {
            motions: [
                motion(false, models.straight_acceleration_noise_density),
                motion(true, models.turning_acceleration_noise_density),
                motion(false, models.manoeuvring_acceleration_noise_density),
            ],
            dwell_s: [
                models.straight_dwell_s,
                models.turning_dwell_s,
                models.manoeuvring_dwell_s,
            ],
            turn: TurnRate {
                std_rad_s: models.turn_rate_std_rad_s,
                time_s: models.turn_rate_time_s,
            },
        }
    }
}

impl<T: Scalar> Default for MultiTargetConfig<T, 3> {
    fn default() -> Self {
        Self {
            models: MotionModels::default().into(),
            settings: MultiTargetSettings::default(),
        }
    }
}
