//! Parameters of the estimators by name: units, meanings, defaults, profiles, and `NAME=VALUE`.
//!
//! Names and defaults come from the configuration structures themselves; the table here adds unit
//! and meaning. A test holds the two together.

mod bounded_velocity;
mod set;

use northing_core::attitude::AttitudeConfig;
use northing_core::attitude::bounded_velocity::BoundedVelocityConfig;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::attitude::kinds::EstimatorKind;
use crate::error::EvaluationError;
pub(crate) use bounded_velocity::BOUNDED;
pub use set::{CascadeRotation, CascadeSettings, Parameters};

/// A named set of parameters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Profile {
    /// A phone or wearable in real use: the default for recordings.
    #[default]
    HandHeld,
    /// A device moved gently in a laboratory, its sensors as good as at rest.
    Lab,
}

impl Profile {
    /// Every profile, the default first.
    pub const ALL: [Self; 2] = [Self::HandHeld, Self::Lab];

    /// The name on the command line and in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::HandHeld => "hand-held",
            Self::Lab => "lab",
        }
    }

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
            Self::HandHeld => Parameters {
                attitude: AttitudeConfig::hand_held(),
                bounded_velocity: BoundedVelocityConfig::hand_held(),
                cascade: CascadeSettings::satellite(),
            },
            Self::Lab => Parameters::default(),
        }
    }
}

impl std::str::FromStr for Profile {
    type Err = EvaluationError;

    fn from_str(name: &str) -> Result<Self, EvaluationError> {
        let known = Self::ALL.into_iter().find(|profile| profile.name() == name);
        known.ok_or_else(|| EvaluationError::UnknownProfile {
            name: name.to_owned(),
            valid: Self::ALL.map(Self::name).join(", "),
        })
    }
}

/// One parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterInfo {
    /// Its name in `--set NAME=VALUE` and in configuration files.
    pub name: String,
    /// Its unit; `-` for numbers without one, otherwise the words it can be.
    pub unit: &'static str,
    /// What it is.
    pub meaning: &'static str,
    /// Its value in each profile, in the order of [`Profile::ALL`].
    pub defaults: Vec<(Profile, Value)>,
}

/// Unit and meaning of each parameter, in the order of the configuration.
const TABLE: [(&str, &str, &str); 32] = [
    (
        "gyroscope_noise_density",
        "rad/s/sqrt(Hz)",
        "white noise of the gyroscope",
    ),
    (
        "process_noise",
        "discrete | paper-literal",
        "how that noise enters the covariance",
    ),
    (
        "gyroscope_sample_interval_s",
        "s",
        "interval of gyroscope samples; only for paper-literal",
    ),
    (
        "gyroscope_scale_noise",
        "rad/(rad/s)/sqrt(s)",
        "extra angle noise per rate: scale and misalignment errors; 0 is off",
    ),
    (
        "gyroscope_bias_random_walk",
        "rad/s/sqrt(s)",
        "how fast the gyroscope bias wanders",
    ),
    (
        "accelerometer_std",
        "m/s^2",
        "accelerometer error per sample and axis",
    ),
    (
        "accelerometer_gate_nis",
        "-",
        "NIS above which a sample is refused; 0 is no gate",
    ),
    (
        "accelerometer_correlation_time_s",
        "s",
        "how long accelerometer errors stay alike; 0 is white",
    ),
    (
        "accelerometer_norm_gain",
        "-",
        "adds gain * (|f| - g)^2 to the accelerometer variance; 0 is off",
    ),
    (
        "magnetometer_std_ut",
        "microtesla",
        "magnetometer error per sample and axis",
    ),
    (
        "magnetometer_gate_nis",
        "-",
        "NIS above which a sample is refused; 0 is no gate",
    ),
    (
        "magnetometer_correlation_time_s",
        "s",
        "how long magnetometer errors stay alike; 0 is white",
    ),
    (
        "magnetometer_norm_gain",
        "-",
        "adds gain * (deviation of the field)^2 to the magnetometer variance; 0 is off",
    ),
    (
        "magnetometer_use",
        "vector | heading",
        "whole field, or only its direction on the horizon",
    ),
    (
        "compass_std",
        "rad",
        "smallest error of a compass heading; the device's own word where it is larger",
    ),
    (
        "compass_gate_nis",
        "-",
        "NIS above which a heading is refused; 0 is no gate",
    ),
    (
        "compass_correlation_time_s",
        "s",
        "how long compass errors stay alike; 0 is white",
    ),
    (
        "gate_timeout_s",
        "s",
        "after so long of rejections only a gate lets samples through again",
    ),
    (
        "initial_tilt_std",
        "rad",
        "uncertainty of the tilt at the start, per axis",
    ),
    (
        "initial_heading_std",
        "rad",
        "uncertainty of the heading at the start",
    ),
    (
        "initial_gyroscope_bias_std",
        "rad/s",
        "uncertainty of the bias at the start, per axis",
    ),
    (
        "maximum_attitude_std",
        "rad",
        "largest uncertainty per axis: beyond it nothing is known",
    ),
    (
        "quaternion_norm",
        "projected | free",
        "whether the quaternion EKF projects its covariance as it normalises; free: the textbook's",
    ),
    (
        "complementary_attitude_gain",
        "1/s",
        "how fast a complementary filter follows its vectors (k_P)",
    ),
    (
        "complementary_bias_gain",
        "1/s^2",
        "how fast its gyroscope bias follows (k_I); 0 keeps the bias",
    ),
    (
        "complementary_accelerometer_weight",
        "-",
        "weight of the accelerometer in a complementary filter",
    ),
    (
        "complementary_magnetometer_weight",
        "-",
        "weight of magnetometer or compass in a complementary filter",
    ),
    (
        "complementary_field_tolerance",
        "-",
        "share by which a field's strength may be off and still count in a complementary filter",
    ),
    (
        "complementary_bias_limit",
        "rad/s",
        "largest gyroscope bias per axis in a complementary filter",
    ),
    (
        "cascade_pole",
        "1/s",
        "how fast the position observer of a cascade follows positions (its triple pole)",
    ),
    (
        "cascade_position_std_m",
        "m",
        "position error per sample and axis; five times as much is an outlier",
    ),
    (
        "cascade_rotation",
        "estimated | reconstructed",
        "which rotation the position observer takes: the observer's or the EKF's",
    ),
];

/// All rows: the table above, then the bounded-velocity filter's.
fn rows() -> impl Iterator<Item = &'static (&'static str, &'static str, &'static str)> {
    TABLE.iter().chain(&bounded_velocity::TABLE)
}

/// Parameters of complementary filters begin so; besides those only this one matters to them.
const COMPLEMENTARY: &str = "complementary_";
const COMPLEMENTARY_TOO: &str = "magnetometer_use";
/// Those among them that a filter behind an EKF has of its own: it sees no vectors.
const COMPLEMENTARY_BEHIND: [&str; 3] = [
    "complementary_attitude_gain",
    "complementary_bias_gain",
    "complementary_bias_limit",
];

/// Parameters of the position observer begin so.
const CASCADE: &str = "cascade_";
/// This one is for those who have a choice.
const CASCADE_ROTATION: &str = "cascade_rotation";

/// Parameters that a filter without gyroscope bias has no use for.
const BIAS_ONLY: [&str; 2] = ["gyroscope_bias_random_walk", "initial_gyroscope_bias_std"];

/// Every parameter, with its value in each profile.
#[must_use]
pub fn parameters() -> Vec<ParameterInfo> {
    let configs = Profile::ALL.map(|profile| (profile, Map::from(profile.config())));
    let rows = rows().map(|(name, unit, meaning)| ParameterInfo {
        name: (*name).to_owned(),
        unit,
        meaning,
        defaults: configs
            .iter()
            .map(|(profile, map)| (*profile, map.get(*name).cloned().unwrap_or_default()))
            .collect(),
    });
    rows.collect()
}

/// The parameters that make a difference to one estimator.
#[must_use]
pub fn parameters_of(kind: EstimatorKind) -> Vec<ParameterInfo> {
    let mut all = parameters();
    all.retain(|parameter| matters(kind, &parameter.name));
    all
}

/// Only a quaternion of four free numbers has a norm to speak of.
const NORM: &str = "quaternion_norm";

/// Whether a parameter makes a difference to an estimator.
fn matters(kind: EstimatorKind, name: &str) -> bool {
    let complementary = name.starts_with(COMPLEMENTARY);
    let position = name.starts_with(CASCADE);
    let bounded = name.starts_with(BOUNDED);
    let of_ekf = !complementary && !position && !bounded;
    match kind {
        EstimatorKind::Integration | EstimatorKind::Device => false,
        EstimatorKind::BoundedVelocity => bounded,
        EstimatorKind::Mekf3 => of_ekf && name != NORM && !BIAS_ONLY.contains(&name),
        EstimatorKind::Mekf | EstimatorKind::Usque => of_ekf && name != NORM,
        EstimatorKind::QuaternionEkf => of_ekf,
        EstimatorKind::Complementary
        | EstimatorKind::ComplementaryPassive
        | EstimatorKind::ComplementaryDirect => complementary || name == COMPLEMENTARY_TOO,
        EstimatorKind::Cascade => {
            complementary || name == COMPLEMENTARY_TOO || (position && name != CASCADE_ROTATION)
        }
        EstimatorKind::CascadeEkf => of_ekf || position || COMPLEMENTARY_BEHIND.contains(&name),
    }
}

/// Applies one setting such as `accelerometer_std=0.3` and returns the name of the parameter.
///
/// # Errors
/// The text is no setting, the name is unknown (the valid ones are listed), or the value does not
/// fit; the configuration is then unchanged.
pub fn apply_setting(config: &mut Parameters, setting: &str) -> Result<String, EvaluationError> {
    let (name, text) = setting
        .split_once('=')
        .ok_or_else(|| EvaluationError::NotASetting {
            text: setting.to_owned(),
        })?;
    let (name, text) = (name.trim(), text.trim());
    let mut map = Map::from(*config);
    let Some(slot) = map.get_mut(name) else {
        return Err(EvaluationError::UnknownParameter {
            name: name.to_owned(),
            valid: rows().map(|row| row.0).collect::<Vec<_>>().join(", "),
        });
    };
    let bad = |problem: String| EvaluationError::BadValue {
        name: name.to_owned(),
        value: text.to_owned(),
        problem,
    };
    *slot = match slot {
        Value::Number(_) => {
            let number: f64 = text
                .parse()
                .map_err(|_| bad("expected a number".to_owned()))?;
            serde_json::Number::from_f64(number)
                .map(Value::Number)
                .ok_or_else(|| bad("expected a finite number".to_owned()))?
        }
        _ => Value::String(text.to_owned()),
    };
    let changed = Parameters::try_from(map).map_err(|error| bad(error.to_string()))?;
    changed.validate().map_err(|error| bad(error.to_string()))?;
    *config = changed;
    Ok(name.to_owned())
}

#[cfg(test)]
mod tests;
