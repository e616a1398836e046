//! What the lab page and the program tell each other, apart from frames.

use std::collections::BTreeMap;

use northing_evaluation::attitude::alterations::Alterations;
use northing_evaluation::attitude::options::{CompassUse, SensorSelection};
use northing_evaluation::{EstimatorKind, Profile};
use northing_simulation::virtual_phone::{Disturbance, Motion};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::inputs::InputKind;
use crate::persistence::CalibrationTimes;
use crate::session::frame::{Estimate, SessionStatus};
use crate::session::magnetometer::MagnetometerAction;
use crate::to_page::RestNumbers;

/// What a page can ask for.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(optional_fields = nullable))]
#[serde(tag = "type", rename_all = "snake_case")]
pub enum Request {
    /// A virtual phone comes or goes.
    VirtualPhone {
        /// What to do.
        action: Action,
        /// How it is moved.
        #[serde(default)]
        #[cfg_attr(test, ts(as = "Option<_>", optional))]
        motion: Motion,
        /// What disturbs it.
        #[serde(default)]
        #[cfg_attr(test, ts(as = "Option<_>", optional))]
        disturbance: Disturbance,
        /// Determines everything random; the same seed is the same phone.
        #[serde(default)]
        seed: Option<u64>,
        /// Hard iron of its magnetometer, microtesla, body axes.
        #[serde(default)]
        #[cfg_attr(test, ts(as = "Option<_>", optional))]
        hard_iron_ut: [f64; 3],
        /// Which one goes; without it the newest.
        #[serde(default)]
        device: Option<String>,
    },
    /// Calibrate at rest.
    Calibrate {
        /// The device.
        device: String,
        /// For how long, s.
        seconds: f64,
    },
    /// Begin an experiment.
    Experiment {
        /// The device.
        device: String,
        /// For how long, s.
        seconds: f64,
        /// What people call it.
        #[serde(default)]
        name: String,
    },
    /// End what is under way.
    Stop {
        /// The device.
        device: String,
    },
    /// Calibrate every device at rest.
    CalibrateAll {
        /// For how long, s.
        seconds: f64,
    },
    /// Begin an experiment with every device.
    ExperimentAll {
        /// For how long, s.
        seconds: f64,
        /// What people call it.
        #[serde(default)]
        name: String,
    },
    /// End what is under way on every device.
    StopAll,
    /// Change parameters.
    Settings {
        /// The device.
        device: String,
        /// Parameters by name.
        #[serde(default)]
        #[cfg_attr(test, ts(type = "Settings"))]
        settings: Map<String, Value>,
        /// Start from this profile.
        #[serde(default)]
        profile: Option<String>,
    },
    /// Choose sensors.
    Sensors {
        /// The device.
        device: String,
        /// Which are used.
        #[serde(rename = "use")]
        used: SensorUse,
    },
    /// Choose estimators.
    Estimators {
        /// The device.
        device: String,
        /// Which run.
        #[serde(rename = "use")]
        used: Vec<EstimatorKind>,
    },
    /// Choose the estimator that lamps, innovations, results and reports are about.
    Subject {
        /// The device.
        device: String,
        /// One that runs.
        estimator: EstimatorKind,
    },
    /// How many frames a second this page wants.
    DisplayRate {
        /// Frames a second.
        hz: f64,
    },
    /// The device of which this page wants everything, its samples too; of the others it gets what a wall shows.
    Watch {
        /// It; none for a wall.
        #[serde(default)]
        device: Option<String>,
    },
    /// Run an experiment again with a change.
    WhatIf {
        /// The experiment.
        id: String,
        /// What is other than it was.
        #[serde(flatten)]
        change: Box<Change>,
        /// A parameter to run over a range.
        #[serde(default)]
        curve: Option<String>,
    },
    /// Fit parameters of the subject to an experiment with a change.
    Tune {
        /// The experiment.
        id: String,
        /// What is other than it was.
        #[serde(flatten)]
        change: Box<Change>,
        /// Which; every noise that makes a difference where none is named.
        #[serde(default)]
        #[cfg_attr(test, ts(as = "Option<_>", optional))]
        parameters: Vec<String>,
    },
    /// Calibrate the magnetometer.
    CalibrateMagnetometer {
        /// The device.
        device: String,
        /// What to do.
        action: MagnetometerAction,
    },
    /// Analyse an experiment at rest.
    Allan {
        /// The experiment.
        id: String,
        /// Of this sensor.
        #[serde(default = "gyroscope")]
        sensor: String,
    },
    /// Delete an experiment, from the disk, too.
    DeleteExperiment {
        /// It.
        id: String,
    },
    /// Hide an experiment from the table, or bring it back; on the disk it stays.
    ArchiveExperiment {
        /// It.
        id: String,
        /// Whether it is to be hidden.
        archived: bool,
    },
    /// Take a device away that has gone.
    Remove {
        /// The device.
        device: String,
    },
    /// An input comes or goes.
    Input {
        /// What to do.
        action: Action,
        /// What it is.
        #[serde(default)]
        kind: Option<InputKind>,
        /// Where it is.
        #[serde(default)]
        #[cfg_attr(test, ts(as = "Option<_>", optional))]
        address: String,
        /// Which one goes; without it the one of this kind and address.
        #[serde(default)]
        id: Option<String>,
    },
    /// Give a device a name.
    Rename {
        /// The device.
        device: String,
        /// Its name.
        name: String,
    },
}

impl Request {
    /// Whether only a page with a WebSocket can ask for it: it is about this page, or its answer takes a while.
    #[must_use]
    pub const fn needs_socket(&self) -> bool {
        matches!(
            self,
            Self::DisplayRate { .. }
                | Self::Watch { .. }
                | Self::WhatIf { .. }
                | Self::Tune { .. }
                | Self::Allan { .. }
                | Self::Input { .. }
        )
    }

    /// Whether it cannot be begun with a device from which no gyroscope sample has come.
    #[must_use]
    pub const fn needs_samples(&self) -> bool {
        matches!(self, Self::Calibrate { .. } | Self::Experiment { .. })
    }
}

/// What a what-if changes; what is not said is as it was.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS), ts(optional_fields))]
#[serde(default)]
pub struct Change {
    /// Parameters by name.
    #[cfg_attr(test, ts(type = "Settings"))]
    pub settings: Map<String, Value>,
    /// The sensors that are used.
    #[serde(rename = "use")]
    pub used: Option<SensorUse>,
    /// The estimators that run.
    pub estimators: Option<Vec<EstimatorKind>>,
    /// The one of them that plots and curve are about.
    pub subject: Option<EstimatorKind>,
    /// What is done to the samples first.
    #[cfg_attr(test, ts(as = "Option<_>", optional))]
    pub alterations: Alterations,
}

/// What happens to a virtual phone or an input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum Action {
    /// It comes.
    Add,
    /// It goes.
    Remove,
}

/// The sensors that the filters use.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct SensorUse {
    /// Always needed.
    #[serde(default = "yes")]
    pub gyroscope: bool,
    /// Whether the accelerometer is used.
    #[serde(default = "yes")]
    pub accelerometer: bool,
    /// Whether the magnetometer is used.
    #[serde(default = "yes")]
    pub magnetometer: bool,
    /// Whether headings of the device's own compass are used; unsaid, where there is no magnetometer.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[cfg_attr(test, ts(optional))]
    pub compass: Option<bool>,
}

fn gyroscope() -> String {
    "gyroscope".to_owned()
}

fn yes() -> bool {
    true
}

impl SensorUse {
    /// As the options have it.
    ///
    /// # Errors
    /// Without gyroscope nothing can be estimated.
    pub fn selection(self) -> Result<SensorSelection, String> {
        if !self.gyroscope {
            return Err("the gyroscope cannot be left out: every estimator needs it".to_owned());
        }
        Ok(SensorSelection {
            accelerometer: self.accelerometer,
            magnetometer: self.magnetometer,
            compass: match self.compass {
                None => CompassUse::WithoutMagnetometer,
                Some(true) => CompassUse::Always,
                Some(false) => CompassUse::Never,
            },
            ..SensorSelection::default()
        })
    }

    /// Of the options.
    #[must_use]
    pub fn of(selection: &SensorSelection) -> Self {
        Self {
            gyroscope: true,
            accelerometer: selection.accelerometer,
            magnetometer: selection.magnetometer,
            compass: match selection.compass {
                CompassUse::WithoutMagnetometer => None,
                CompassUse::Always => Some(true),
                CompassUse::Never => Some(false),
            },
        }
    }
}

/// A command for one device. Recordings hold it as JSON.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// Calibrate for so many seconds.
    Calibrate(f64),
    /// Experiment for so many seconds under a name.
    Experiment(f64, String),
    /// End what is under way.
    Stop,
    /// Change profile and parameters.
    Settings(Option<Profile>, Map<String, Value>),
    /// Choose sensors.
    Sensors(SensorSelection),
    /// Choose estimators.
    Estimators(Vec<EstimatorKind>),
    /// Choose the one of them that lamps, innovations, results and reports are about.
    Subject(EstimatorKind),
    /// Calibrate the magnetometer.
    CalibrateMagnetometer(MagnetometerAction),
    /// Give it a name.
    Rename(String),
}

impl Command {
    /// As it is recorded: whoever replays does not have the estimators that somebody brought along. `None`: nothing is left.
    #[must_use]
    pub fn recorded(&self) -> Option<Self> {
        match self {
            Self::Estimators(kinds) => {
                let ours = |kind: &&EstimatorKind| !matches!(kind, EstimatorKind::Own(_));
                Some(Self::Estimators(
                    kinds.iter().filter(ours).copied().collect(),
                ))
            }
            Self::Subject(EstimatorKind::Own(_)) => None,
            other => Some(other.clone()),
        }
    }
}

/// What a device is doing for a while.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(tag = "what", rename_all = "kebab-case")]
pub enum UnderWay {
    /// A calibration at rest.
    Calibration {
        /// Until it ends, s.
        remaining_s: f64,
    },
    /// An experiment.
    Experiment {
        /// Until it ends, s.
        remaining_s: f64,
    },
}

/// One row of the list of devices.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct DeviceStatus {
    /// What it is addressed by.
    pub id: String,
    /// What people call it.
    pub name: String,
    /// How it delivers: `page`, `sensor-logger`, `virtual`, `replay`.
    pub source: &'static str,
    /// Whether something came during the last seconds.
    pub connected: bool,
    /// Whether samples were among it.
    pub delivers: bool,
    /// Why there are none, and what to do, in sentences; empty while it delivers.
    pub silence: String,
    /// For how long no samples have come, s; null while it delivers.
    pub silent_s: Option<f64>,
    /// How it is.
    #[serde(flatten)]
    pub session: SessionStatus,
    /// A calibration or an experiment.
    pub under_way: Option<UnderWay>,
    /// Batches that never came.
    pub lost: u64,
    /// Batches that came again.
    pub duplicated_batches: u64,
    /// The parameters in force; null before the first sample.
    #[cfg_attr(test, ts(type = "Settings | null"))]
    pub settings: Value,
    /// The sensors in use.
    #[serde(rename = "use")]
    pub used: Option<SensorUse>,
    /// The calibration at rest in force, of this start or an earlier one.
    pub rest: Option<RestNumbers>,
    /// When the calibrations in force were made.
    pub calibrated: CalibrationTimes,
    /// The estimates of this moment.
    pub estimates: BTreeMap<&'static str, Estimate>,
}
