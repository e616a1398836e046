//! The outcome of a run: the object that `run --json` prints.

use std::collections::BTreeMap;

use northing_recording::SensorKind;
use serde::Serialize;

use crate::attitude::final_test::FinalSummary;
use crate::attitude::reference::{ReferenceAlignment, ReferenceProblem};
use crate::attitude::{EstimatorKind, Profile};
use crate::calibration::magnetometer::MagnetometerSource;
use crate::statistics::consistency::SensorVerdict;
use crate::statistics::faults::FaultRecord;
use crate::statistics::metrics::{ErrorSummary, HeadingReference, NeesSummary};
use crate::statistics::nis::{NisSummary, UpdateCounts};
use crate::statistics::verdict::findings::Finding;
use crate::used_parameters::{UsedCalibrations, UsedParameter};

/// The outcome of one estimator on one recording. What does not apply is `None`, `null` in JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct RunSummary {
    /// The estimator.
    pub estimator: EstimatorKind,
    /// Name of the recording.
    pub recording: String,
    /// Time from the first to the last sample, s.
    pub duration_s: f64,
    /// Samples read, of all sensors; the reference is not one.
    pub samples: u64,
    /// What became of the samples of each sensor. During alignment and calibration they are
    /// skipped as updates.
    pub updates: PerSensor<UpdateCounts>,
    /// What said where north is: it decides what of heading and NEES is judged.
    pub heading: HeadingReference,
    /// RMS errors against the reference, deg; `None` without a scored reference.
    pub error_deg: Option<ErrorSummary>,
    /// What became of the samples of the reference; left out of JSON without any.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "typescript", ts(optional))]
    pub reference: Option<ReferenceSummary>,
    /// Mean NEES of the attitude per degree of freedom: 1 when the covariance is consistent. Where the heading is
    /// arbitrary it is that of the tilt.
    pub nees_mean: Option<f64>,
    /// The same with its degrees of freedom, and that of the tilt.
    pub nees: Option<NeesSummary>,
    /// Mean NIS of each sensor, not divided by anything: when consistent it is the sensor's degrees of
    /// freedom (3 for a vector, 1 for a heading), which `nis` states.
    pub nis_mean: NisOf<f64>,
    /// The final test; `None` where the device did not rest in the same pose at both ends.
    #[serde(rename = "final")]
    pub final_test: Option<FinalSummary>,
    /// All NIS statistics of each sensor.
    pub nis: NisOf<NisSummary>,
    /// Whether each sensor's stated noise is consistent, in words.
    pub verdicts: Vec<SensorVerdict>,
    /// Faults of the samples that were found and survived, in the order of their finding.
    pub faults: Vec<FaultRecord>,
    /// What is wrong, the first to act on first: causes, and R last. Empty where nothing is.
    pub findings: Vec<Finding>,
    /// What the sensors used cannot tell, in words.
    pub unobservable: Vec<String>,
    /// The profile of the parameters; `None` for what has no parameters.
    pub profile: Option<Profile>,
    /// The stream of the magnetometer that was used; left out of JSON without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "typescript", ts(optional))]
    pub magnetometer: Option<MagnetometerSource>,
    /// Standard deviation of the hard iron at the start, microtesla, of an estimator that estimates it:
    /// unless set, it follows from the stream of the magnetometer.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "typescript", ts(optional))]
    pub hard_iron_prior_ut: Option<f64>,
    /// Where the calibration came from, in words.
    pub calibration: Option<String>,
    /// The magnetometer calibration that was applied, in words; left out of JSON without one.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "typescript", ts(optional))]
    pub magnetometer_calibration: Option<String>,
    /// Whether the estimates are smoothed.
    pub smoothed: bool,
    /// Estimates made, one for each gyroscope sample after the start.
    pub estimates: u64,
    /// When the first estimate was there, s after the first sample.
    pub first_estimate_s: Option<f64>,
    /// Pauses of the gyroscope.
    pub gaps: Gaps,
    /// What the position observer made of the positions; left out of JSON without any.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(feature = "typescript", ts(optional))]
    pub position: Option<PositionSummary>,
    /// Samples read of each kind.
    pub samples_per_sensor: BTreeMap<SensorKind, u64>,
    /// What was odd about the recording or the run, one sentence each.
    pub issues: Vec<String>,
    /// Every parameter of the estimator as it ran, in the order of the tables.
    pub parameters: Vec<UsedParameter>,
    /// The calibrations that were used.
    #[cfg_attr(feature = "typescript", ts(type = "unknown"))]
    pub calibrations: UsedCalibrations,
    /// Version of the program.
    pub version: &'static str,
}

/// What became of the samples of the reference.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct ReferenceSummary {
    /// Samples read.
    pub samples: u64,
    /// Samples scored.
    pub scored: u64,
    /// Samples that count and were not scored: they lie in a pause of the estimates.
    pub in_gaps: u64,
    /// Clock offset and misalignment that were taken out; null unless that was asked for.
    pub alignment: Option<ReferenceAlignment>,
    /// Those that the angular rates show of the reference as it was scored; null where there is too little motion.
    pub found: Option<ReferenceAlignment>,
    /// Why it cannot be that of the sensors; a run with such a reference is refused.
    #[serde(skip)]
    #[cfg_attr(feature = "typescript", ts(skip))]
    pub problem: Option<ReferenceProblem>,
}

/// What a position observer made of the positions of a recording.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct PositionSummary {
    /// What became of the positions.
    pub updates: UpdateCounts,
    /// RMS of measured minus estimated over the positions used, m; `None` before the second one.
    /// There is seldom a true position to compare with.
    pub innovation_rms_m: Option<PositionRms>,
    /// Accelerometer bias at the end, body axes, m/s^2. A tilt error looks the same.
    pub accelerometer_bias_m_s2: [f64; 3],
}

/// RMS per axis of a vector of the world, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct PositionRms {
    /// Of the two horizontal axes together.
    pub horizontal: f64,
    /// Of the vertical one.
    pub vertical: f64,
}

/// One value for each sensor that a filter takes.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct PerSensor<V> {
    /// Of the gyroscope: `fused` are the propagations.
    pub gyroscope: V,
    /// Of the accelerometer.
    pub accelerometer: V,
    /// Of the magnetometer that is used.
    pub magnetometer: V,
    /// Of the compass headings that are used.
    pub compass: V,
}

/// One value for each sensor that a filter updates with; `None` where nothing was looked at.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct NisOf<V> {
    /// Of the accelerometer.
    pub accelerometer: Option<V>,
    /// Of the magnetometer.
    pub magnetometer: Option<V>,
    /// Of the compass.
    pub compass: Option<V>,
}

/// Pauses between gyroscope samples longer than the limit: the attitude is held and its
/// uncertainty grows.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Gaps {
    /// How many.
    pub count: u64,
    /// The limit, s.
    pub limit_s: f64,
    /// The longest, s; 0 without any.
    pub longest_s: f64,
    /// Where the longest starts, s after the first sample.
    pub longest_start_s: f64,
}
