//! What a run used: every parameter of its estimator with its value and origin, and the calibrations.
//!
//! The run fills it in when it configures its estimator; reports, the lab and `--json` read only this.

use std::collections::BTreeMap;

use northing_core::calibration::RestCalibration;
use northing_core::parameters::{Parameter, Value};
use serde::Serialize;
use serde_json::Value as Json;

use crate::by_name;
use crate::calibration::magnetometer::MagnetometerStreamCalibration;

/// Program and version, as outcomes and pages name it.
pub const PROGRAM: &str = concat!("northing ", env!("CARGO_PKG_VERSION"));

/// Version of the program, as outcomes state it.
pub const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Where the value of a parameter comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum Origin {
    /// The table of the estimator.
    Default,
    /// A profile whose value differs from the default.
    Profile,
    /// A file (`--config`).
    File,
    /// Whoever asked for the run (`--set`).
    Set,
    /// The setup of another run (`--setup`), where somebody had asked for the value.
    Setup,
    /// The setup of another run, where nobody had: its profile's then, or learnt.
    SetupDefault,
    /// The metadata of the recording.
    Recording,
    /// A calibration at rest.
    Calibration,
    /// The recording itself, or a model of its place: the hard iron's prior, the magnetic declination.
    Learnt,
}

impl Origin {
    /// The name for people and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Default => "default",
            Self::Profile => "profile",
            Self::File => "file",
            Self::Set => "set",
            Self::Setup => "setup",
            Self::SetupDefault => "setup-default",
            Self::Recording => "recording",
            Self::Calibration => "calibration",
            Self::Learnt => "learnt",
        }
    }

    /// Whether somebody asked for the value: nothing that a run finds out by itself replaces it.
    #[must_use]
    pub const fn is_explicit(self) -> bool {
        matches!(self, Self::File | Self::Set | Self::Setup)
    }
}

/// Origins of parameters by name; those that are not in it have their profile's value.
pub type Origins = BTreeMap<String, Origin>;

/// A parameter as a run used it.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct UsedParameter {
    /// Its name in `--set NAME=VALUE` and in configuration files.
    pub name: String,
    /// Its unit; `-` where it has none.
    pub unit: &'static str,
    /// Its value.
    #[cfg_attr(feature = "typescript", ts(type = "unknown"))]
    pub value: Json,
    /// Where the value comes from.
    pub origin: Origin,
    /// What it is.
    #[serde(skip)]
    pub meaning: &'static str,
}

impl UsedParameter {
    /// A row of a table with its value; `name` is that of the command line.
    pub(crate) fn new(name: String, row: &Parameter, value: Value<f64>, origin: Origin) -> Self {
        Self {
            name,
            unit: row.unit,
            value: by_name::json(value),
            origin,
            meaning: row.meaning,
        }
    }

    /// The value as people and `--set` write it.
    #[must_use]
    pub fn value_text(&self) -> String {
        by_name::text(&self.value)
    }
}

/// Parameters in use and where their values come from, beside the usual ones.
pub(crate) fn used(
    rows: Vec<by_name::Row>,
    usual: &[by_name::Row],
    origins: &Origins,
) -> Vec<UsedParameter> {
    let used = rows.into_iter().zip(usual).map(|(row, usual)| {
        let name = row.name();
        let own = match row.value == usual.value {
            true => Origin::Default,
            false => Origin::Set,
        };
        let origin = origins.get(&name).copied().unwrap_or(own);
        UsedParameter::new(name, row.parameter, row.value, origin)
    });
    used.collect()
}

/// The calibrations that a run used.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct UsedCalibrations {
    /// At rest: of a file, or of the recording's start.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub rest: Option<Named<RestCalibration<f64>>>,
    /// Of the magnetometer.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub magnetometer: Option<Named<MagnetometerStreamCalibration>>,
}

/// A calibration with its name.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Named<C> {
    /// Its file; `None` where it has none, as one of the recording's start.
    pub name: Option<String>,
    /// What it measured.
    pub values: C,
}
