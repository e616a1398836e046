//! Parameters of the attitude estimators by name: the rows of core's tables, their values in each profile, and
//! `NAME=VALUE`.

mod set;

use northing_core::attitude::AttitudeConfig;
use northing_core::attitude::bounded_velocity::BoundedVelocityConfig;
use northing_core::navigation::cascade::CascadeConfig;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::attitude::EstimatorKind;
use crate::by_name;
pub(crate) use crate::by_name::Row;
use crate::error::EvaluationError;
use crate::registry::ParameterInfo;
pub(crate) use set::rows;
pub use set::{CascadeRotation, Parameters};

crate::named! {
    /// A named set of parameters, the default first.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
    #[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
    #[serde(rename_all = "kebab-case")]
    pub enum Profile {
        /// A phone or wearable in real use: the default for recordings.
        #[default]
        HandHeld = "hand-held",
        /// A device moved gently in a laboratory, its sensors as good as at rest.
        Lab = "lab",
    }
}

impl Profile {
    /// What it is for, in a sentence.
    #[must_use]
    pub const fn summary(self) -> &'static str {
        match self {
            Self::HandHeld => "a phone or wearable in real use: accelerations, indoor fields",
            Self::Lab => "a device moved gently, its sensors as good as at rest",
        }
    }

    /// The estimator that is the first choice for it: on what people carry the bounded-velocity filter
    /// is by far the most accurate; what a device on a bench does, the simpler MEKF explains as well.
    #[must_use]
    pub const fn estimator(self) -> EstimatorKind {
        match self {
            Self::HandHeld => EstimatorKind::BoundedVelocity,
            Self::Lab => EstimatorKind::Mekf,
        }
    }

    /// Its parameters.
    #[must_use]
    pub fn config(self) -> Parameters {
        match self {
            Self::HandHeld => Parameters::default(),
            Self::Lab => Parameters {
                attitude: AttitudeConfig::lab(),
                bounded_velocity: BoundedVelocityConfig::lab(),
                cascade: CascadeConfig::lab(),
                rotation: CascadeRotation::default(),
            },
        }
    }
}

impl std::str::FromStr for Profile {
    type Err = EvaluationError;

    fn from_str(name: &str) -> Result<Self, EvaluationError> {
        Self::named(name).ok_or_else(|| EvaluationError::UnknownProfile {
            name: name.to_owned(),
            valid: Self::names(),
        })
    }
}

fn info(row: &Row) -> ParameterInfo {
    let name = row.name();
    let default = |profile: Profile| {
        let value = profile.config().value(&name);
        (profile.name(), value.map_or(Value::Null, by_name::json))
    };
    let defaults = Profile::ALL.map(default).to_vec();
    ParameterInfo::new(name, row.parameter, defaults)
}

/// Every parameter, with its value in each profile.
#[must_use]
pub fn parameters() -> Vec<ParameterInfo> {
    rows().map(|row| info(&row)).collect()
}

/// The parameters that make a difference to one estimator.
#[must_use]
pub fn parameters_of(kind: EstimatorKind) -> Vec<ParameterInfo> {
    let read = rows().filter(|row| row.is_read_by(kind));
    read.map(|row| info(&row)).collect()
}

/// Applies one setting such as `accelerometer_std=0.3` and returns the name of the parameter.
///
/// # Errors
/// The text is no setting, the name is unknown (the nearest one is named), or the value does not
/// fit; the configuration is then unchanged.
pub fn apply_setting(config: &mut Parameters, setting: &str) -> Result<String, EvaluationError> {
    by_name::set(config.tables(), setting)
}

#[cfg(test)]
mod tests;
