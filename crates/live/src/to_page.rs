//! What the program sends to a page. `web/lab/messages.ts` is made from these types and from those of
//! [`messages`](crate::messages): see `protocol.rs`.

use std::collections::BTreeMap;

use northing_core::calibration::RestCalibration;
use northing_core::calibration::magnetometer::{MagnetometerCalibration, MagnetometerModel};
use northing_evaluation::attitude::final_test::{FinalSummary, FinalVerdict};
use northing_evaluation::attitude::parameters::Parameters;
use northing_evaluation::calibration::allan::AllanReport;
use northing_evaluation::{EstimatorKind, RunSummary};
use northing_recording::SensorKind;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::board::Standing;
use crate::everyone::Everyone;
use crate::inputs::{InputKind, InputStatus};
use crate::messages::{DeviceStatus, SensorUse};
use crate::recorder::RecordingStatus;
use crate::roles::RoleName;
use crate::session::frame::Frame;
use crate::tune::Tuned;
use northing_evaluation::statistics::lamp::Remark;

/// A message to a page.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum ToPage {
    /// Comes first, and again when the addresses have changed.
    Hello(Box<Hello>),
    /// Every device as it is now.
    Devices {
        /// One row each.
        devices: Vec<DeviceStatus>,
    },
    /// What is drawn of one device.
    Frame(Box<Frame>),
    /// A calibration at rest goes on or has ended.
    Calibration(Box<Calibration>),
    /// An experiment goes on or has ended.
    Experiment(Box<Experiment>),
    /// The table of finished experiments.
    Experiments {
        /// One row each, the oldest first.
        rows: Vec<ExperimentRow>,
        /// The newest experiment of each device, the most consistent first.
        board: Vec<Standing>,
    },
    /// What became of a request to every device.
    Everyone(Everyone),
    /// The answer to a what-if.
    WhatIf(WhatIf),
    /// The curve of a what-if; it comes after the answer.
    Curve(Curve),
    /// How far a fit of Q and R is, or what came out.
    Tuned(Tuned),
    /// A magnetometer calibration goes on or has ended.
    Magnetometer(Box<Magnetometer>),
    /// An Allan deviation, or why there is none.
    Allan(Box<Allan>),
    /// How the recording is.
    Recording(RecordingStatus),
    /// Every input as it is now.
    Inputs {
        /// One row each.
        inputs: Vec<InputStatus>,
    },
    /// Something could not be done.
    Error {
        /// What, and what to do, in a sentence.
        text: String,
        /// The number of the request that it answers.
        #[cfg_attr(test, ts(type = "unknown"))]
        request: Value,
    },
}

impl ToPage {
    /// Something went wrong that no request asked for.
    pub fn error(text: impl Into<String>) -> Self {
        Self::Error {
            text: text.into(),
            request: Value::Null,
        }
    }

    /// As it travels.
    #[must_use]
    pub fn json(&self) -> String {
        // Keys are strings and numbers that are not finite become null, so nothing can fail.
        serde_json::to_string(self).unwrap_or_default()
    }
}

/// What there is.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Hello {
    /// Of the program.
    pub version: &'static str,
    /// Addresses of the phone page.
    pub phone_urls: Vec<String>,
    /// Address by name for laptops, where the lab answers for a name on the network.
    pub named_url: Option<String>,
    /// Addresses for apps.
    pub ingest_urls: Vec<String>,
    /// Address of the picture of the first phone address.
    pub qr_svg: String,
    /// The estimators of attitude.
    pub estimators: Vec<EstimatorLine>,
    /// Their parameters.
    pub parameters: Vec<Parameter>,
    /// The sensors that correct the attitude.
    pub aids: Vec<AidLine>,
    /// SHA-256 of the certificate.
    pub fingerprint: String,
    /// What this program can do beyond the path itself.
    pub features: &'static [&'static str],
    /// What people call this lab; may be empty.
    pub name: String,
    /// Who the page is open for.
    pub role: RoleName,
    /// The kinds of inputs.
    pub input_kinds: Vec<InputKindLine>,
    /// Every input as it is now.
    pub inputs: Vec<InputStatus>,
}

/// An estimator.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct EstimatorLine {
    /// Its name.
    pub name: EstimatorKind,
    /// What it is, in a sentence.
    pub summary: &'static str,
    /// The parameters that it reads.
    pub reads: Vec<String>,
}

/// A sensor that corrects the attitude: its lamp, slider and switch.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct AidLine {
    /// The sensor.
    pub sensor: SensorKind,
    /// What people call it.
    pub title: &'static str,
    /// Its name among the sensors in use.
    pub switch: &'static str,
    /// The parameters that make up its `R`; an estimator reads at most one.
    pub noise: &'static [&'static str],
    /// Its gate.
    pub gate: &'static str,
    /// Unit of its innovations.
    pub unit: &'static str,
    /// Whether it is missed where it is missing.
    pub is_usual: bool,
}

/// A parameter of the estimators.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// What is permitted, such as `from 0 to 10`.
    pub range: String,
    /// What it is.
    pub meaning: &'static str,
    /// Its value in each profile.
    #[cfg_attr(test, ts(type = "Record<string, SettingValue>"))]
    pub default: BTreeMap<&'static str, Value>,
}

/// A kind of input.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct InputKindLine {
    /// Its name.
    pub kind: InputKind,
    /// What people call it.
    pub title: &'static str,
    /// What to enter as its address.
    pub hint: &'static str,
    /// An address as an example.
    pub example: &'static str,
}

/// A calibration at rest.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Calibration {
    /// The device.
    pub device: String,
    /// Whether it goes on.
    pub state: CalibrationState,
    /// 0 to 1.
    pub progress: f64,
    /// Until it ends, s.
    pub remaining_s: f64,
    /// How good it is.
    pub verdict: Option<Remark>,
    /// What was found.
    pub result: Option<RestNumbers>,
    /// The samples, thinned, by sensor.
    pub samples: Option<BTreeMap<&'static str, Series>>,
}

/// Whether a calibration at rest goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "lowercase")]
pub enum CalibrationState {
    /// It does.
    Running,
    /// It is in force.
    Done,
    /// The device moved, or sent too little.
    Refused,
}

/// A thinned series of one sensor with three axes.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[allow(missing_docs)]
pub struct Series {
    /// Seconds.
    pub t_s: Vec<f64>,
    pub x: Vec<f64>,
    pub y: Vec<f64>,
    pub z: Vec<f64>,
}

/// The numbers of a [`RestCalibration`] that a page shows, body axes.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct RestNumbers {
    /// Samples of the gyroscope.
    pub gyroscope_samples: u32,
    /// Bias, rad/s.
    pub gyroscope_bias_rad_s: [f64; 3],
    /// Standard deviation of the bias, rad/s.
    pub gyroscope_bias_std_rad_s: [f64; 3],
    /// Standard deviation of one sample, rad/s.
    pub gyroscope_std_rad_s: [f64; 3],
    /// Samples of the accelerometer.
    pub accelerometer_samples: u32,
    /// Mean specific force, m/s^2.
    pub specific_force_m_s2: Option<[f64; 3]>,
    /// Standard deviation of one sample, m/s^2.
    pub accelerometer_std_m_s2: Option<[f64; 3]>,
    /// Samples of the magnetometer.
    pub magnetometer_samples: u32,
    /// Mean field, microtesla.
    pub magnetic_field_ut: Option<[f64; 3]>,
    /// Standard deviation of one sample, microtesla.
    pub magnetometer_std_ut: Option<[f64; 3]>,
}

impl From<&RestCalibration<f64>> for RestNumbers {
    fn from(rest: &RestCalibration<f64>) -> Self {
        Self {
            gyroscope_samples: rest.gyroscope_samples,
            gyroscope_bias_rad_s: rest.gyroscope_bias_rad_s,
            gyroscope_bias_std_rad_s: rest.gyroscope_bias_std_rad_s,
            gyroscope_std_rad_s: rest.gyroscope_std_rad_s,
            accelerometer_samples: rest.accelerometer_samples,
            specific_force_m_s2: rest.specific_force_m_s2,
            accelerometer_std_m_s2: rest.accelerometer_std_m_s2,
            magnetometer_samples: rest.magnetometer_samples,
            magnetic_field_ut: rest.magnetic_field_ut,
            magnetometer_std_ut: rest.magnetometer_std_ut,
        }
    }
}

/// A magnetometer calibration.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Magnetometer {
    /// The device.
    pub device: String,
    /// Whether it goes on.
    pub state: MagnetometerState,
    /// How good it is.
    pub verdict: Option<Remark>,
    /// The calibration, or what is known of it so far.
    pub fit: Option<MagnetometerFit>,
    /// What has been seen; only while it goes on.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, ts(optional))]
    pub coverage: Option<Coverage>,
    /// Samples to draw, microtesla, the newest first; only while it goes on.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, ts(optional))]
    pub points: Option<Vec<[f64; 3]>>,
    /// Samples taken; only while it goes on.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, ts(optional))]
    pub samples: Option<u32>,
    /// Where to turn next, in words; only while it goes on.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, ts(optional))]
    pub hint: Option<String>,
}

/// Whether a magnetometer calibration goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "lowercase")]
pub enum MagnetometerState {
    /// It does.
    Running,
    /// It is in force.
    Done,
    /// None is under way.
    Idle,
}

/// The cells of the sphere of directions that have been seen.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Coverage {
    /// Whether each was seen, slice by slice.
    pub cells: Vec<bool>,
    /// Slices along the third axis.
    pub slices: usize,
    /// Sectors about it.
    pub sectors: usize,
    /// Share of the cells seen, 0 to 1.
    pub fraction: f64,
}

/// A calibrated field is `soft_iron (measured - hard_iron)`, as long as `field_strength`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct MagnetometerFit {
    /// The surface fitted.
    #[cfg_attr(test, ts(type = "\"ellipsoid\" | \"sphere\""))]
    pub model: MagnetometerModel,
    /// Its centre, microtesla.
    pub hard_iron_ut: [f64; 3],
    /// What turns it into a sphere, rows.
    pub soft_iron: [[f64; 3]; 3],
    /// Length of a calibrated sample, microtesla.
    pub field_strength_ut: f64,
    /// Mean radius as measured, microtesla.
    pub radius_ut: f64,
    /// Standard deviation of the distance from the surface, microtesla; null before there is a fit.
    pub residual_std_ut: Option<f64>,
    /// Standard deviation of the length before calibration, microtesla; null before there is a fit.
    pub uncalibrated_norm_std_ut: Option<f64>,
}

impl From<&MagnetometerCalibration<f64>> for MagnetometerFit {
    fn from(fit: &MagnetometerCalibration<f64>) -> Self {
        Self {
            model: fit.model,
            hard_iron_ut: fit.hard_iron_ut,
            soft_iron: fit.soft_iron,
            field_strength_ut: fit.field_strength_ut,
            radius_ut: fit.radius_ut,
            residual_std_ut: Some(fit.residual_std_ut),
            uncalibrated_norm_std_ut: Some(fit.uncalibrated_norm_std_ut),
        }
    }
}

/// An experiment.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Experiment {
    /// The device.
    pub device: String,
    /// What the experiment is addressed by.
    pub id: String,
    /// Whether it goes on.
    pub state: ExperimentState,
    /// 0 to 1.
    pub progress: f64,
    /// Until it ends, s.
    pub remaining_s: f64,
    /// What came out.
    pub result: Option<ExperimentResult>,
}

/// Whether an experiment goes on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "lowercase")]
pub enum ExperimentState {
    /// It does.
    Running,
    /// It has been evaluated.
    Done,
}

/// What came out of an experiment.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct ExperimentResult {
    /// The estimator that it is about.
    pub subject: EstimatorKind,
    /// The outcome of each estimator.
    pub summary: BTreeMap<&'static str, RunSummary>,
    /// The final test of each estimator.
    #[serde(rename = "final")]
    pub final_tests: BTreeMap<&'static str, Option<FinalSummary>>,
    /// The parameters that ran.
    #[cfg_attr(test, ts(type = "Settings"))]
    pub settings: Parameters,
    /// SHA-256 of the events, in hexadecimal.
    pub hash: String,
    /// Where the numbers come from, in words.
    pub origin: String,
}

/// A row of the table of experiments.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct ExperimentRow {
    /// What it is addressed by.
    pub id: String,
    /// What people called the device.
    pub device: String,
    /// What the device is addressed by.
    pub device_id: String,
    /// What people call it.
    pub name: String,
    /// When it ended, UTC.
    pub at: String,
    /// Its length, s.
    pub duration_s: f64,
    /// How long it was meant to be, s.
    pub asked_s: f64,
    /// The parameters that ran.
    #[cfg_attr(test, ts(type = "Settings"))]
    pub settings: Value,
    /// The estimator that it is about.
    #[cfg_attr(test, ts(as = "EstimatorKind"))]
    pub subject: String,
    /// The sensors that delivered.
    pub sensors: Vec<SensorKind>,
    /// Those that were used.
    #[serde(rename = "use")]
    pub used: SensorUse,
    /// Of each estimator.
    pub results: BTreeMap<String, ResultCell>,
    /// Whether it is of an earlier start of the lab.
    pub is_earlier: bool,
    /// Whether its samples can be run again.
    pub has_samples: bool,
    /// Whether it is hidden from the table.
    pub is_archived: bool,
}

/// What an estimator made of an experiment, in a few numbers.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct ResultCell {
    /// Of the final test, deg.
    pub calculated_error_deg: Option<f64>,
    /// What the filter expected of it, deg.
    pub estimated_error_deg: Option<f64>,
    /// How many components are judged: 3, or 2 where it is the tilt alone.
    #[serde(default)]
    pub degrees_of_freedom: Option<u8>,
    /// The part of both about horizontal axes, deg.
    #[serde(default)]
    pub calculated_tilt_deg: Option<f64>,
    /// See [`Self::calculated_tilt_deg`].
    #[serde(default)]
    pub estimated_tilt_deg: Option<f64>,
    /// How they fit.
    pub verdict: Option<FinalVerdict>,
    /// Mean NIS of the accelerometer.
    pub nis_acc: Option<f64>,
    /// Mean NIS of the magnetometer.
    pub nis_mag: Option<f64>,
    /// Mean NIS of the compass.
    pub nis_compass: Option<f64>,
    /// RMS error where the truth is known, otherwise that of the final test, deg.
    pub error_deg: Option<f64>,
}

/// An experiment run again with a change.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct WhatIf {
    /// The number of the request that it answers.
    #[cfg_attr(test, ts(type = "unknown"))]
    pub request: Value,
    /// The experiment.
    pub id: String,
    /// The estimator that the trace is of.
    pub subject: EstimatorKind,
    /// How long it took, ms.
    pub elapsed_ms: f64,
    /// The outcome of each estimator.
    pub results: BTreeMap<&'static str, RunSummary>,
    /// What plots need, of the subject.
    pub trace: TraceColumns,
    /// The same of the experiment as it was: its own samples and parameters.
    pub original: TraceColumns,
}

/// A trace, column by column.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct TraceColumns {
    /// Seconds.
    pub t_s: Vec<f64>,
    /// Yaw, pitch, roll, deg.
    pub angles_deg: Vec<[f64; 3]>,
    /// Their standard deviations, deg; null without a covariance.
    pub std_deg: Option<Vec<[f64; 3]>>,
    /// Total error, deg; null without truth.
    pub error_deg: Option<Vec<f64>>,
    /// NIS of each sensor that was used.
    pub nis: BTreeMap<&'static str, NisColumns>,
}

/// Means of a sensor's NIS over spans of the same length, column by column.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct NisColumns {
    /// The middle of each span, s.
    pub t_s: Vec<f64>,
    /// The mean.
    pub mean: Vec<f64>,
}

/// The curve of a what-if.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Curve {
    /// The number of the request that it answers.
    #[cfg_attr(test, ts(type = "unknown"))]
    pub request: Value,
    /// The experiment.
    pub id: String,
    /// The curve.
    pub curve: CurveColumns,
}

/// NIS and error over one parameter, column by column; null where a value is not permitted.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct CurveColumns {
    /// The parameter.
    pub parameter: String,
    /// Its values.
    pub values: Vec<f64>,
    /// Mean NIS of each sensor that was used.
    pub nis: BTreeMap<&'static str, Vec<Option<f64>>>,
    /// RMS error where the truth is known, otherwise that of the final test, deg.
    pub error_deg: Vec<Option<f64>>,
}

/// The Allan deviation of an experiment at rest.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Allan {
    /// The number of the request that it answers.
    #[cfg_attr(test, ts(type = "unknown"))]
    pub request: Value,
    /// The experiment.
    pub id: String,
    /// The sensor.
    pub sensor: SensorKind,
    /// Whether there is one.
    pub state: AllanState,
    /// Why there is none, in a sentence.
    pub text: Option<String>,
    /// Curve, coefficients and words.
    pub report: Option<AllanReport>,
    /// What it would put into Q.
    pub fill: Option<Fill>,
}

/// Whether there is an Allan deviation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "lowercase")]
pub enum AllanState {
    /// There is.
    Done,
    /// The record does not allow it.
    Refused,
}

/// What an Allan deviation would put into Q.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Fill {
    /// The parameters that it changes.
    #[cfg_attr(test, ts(type = "Settings"))]
    pub settings: Map<String, Value>,
    /// The same in words.
    pub said: Vec<String>,
}
