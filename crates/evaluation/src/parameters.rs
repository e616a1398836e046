//! Parameters of the estimators by name: units, meanings, defaults, profiles, and `NAME=VALUE`.
//!
//! Names and defaults come from the configuration structure itself; the table here adds unit and
//! meaning. A test holds the two together.

use northing_core::attitude::AttitudeConfig;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::error::EvaluationError;
use crate::estimators::EstimatorKind;

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

    /// Its parameters.
    #[must_use]
    pub fn config(self) -> AttitudeConfig<f64> {
        match self {
            Self::HandHeld => AttitudeConfig::hand_held(),
            Self::Lab => AttitudeConfig::default(),
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
const TABLE: [(&str, &str, &str); 29] = [
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
        "projected, free",
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
];

/// Parameters of complementary filters begin so; besides those only this one matters to them.
const COMPLEMENTARY: &str = "complementary_";
const COMPLEMENTARY_TOO: &str = "magnetometer_use";

/// Parameters that a filter without gyroscope bias has no use for.
const BIAS_ONLY: [&str; 2] = ["gyroscope_bias_random_walk", "initial_gyroscope_bias_std"];

/// Every parameter, with its value in each profile.
#[must_use]
pub fn parameters() -> Vec<ParameterInfo> {
    let configs = Profile::ALL.map(|profile| (profile, to_map(&profile.config())));
    let rows = TABLE.iter().map(|(name, unit, meaning)| ParameterInfo {
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
    match kind {
        EstimatorKind::Integration | EstimatorKind::Device => all.clear(),
        EstimatorKind::Mekf3 => all.retain(|p| {
            !BIAS_ONLY.contains(&p.name.as_str()) && !p.name.starts_with(COMPLEMENTARY)
        }),
        EstimatorKind::Mekf | EstimatorKind::Usque | EstimatorKind::QuaternionEkf => {
            all.retain(|p| !p.name.starts_with(COMPLEMENTARY));
        }
        EstimatorKind::Complementary
        | EstimatorKind::ComplementaryPassive
        | EstimatorKind::ComplementaryDirect => {
            all.retain(|p| p.name.starts_with(COMPLEMENTARY) || p.name == COMPLEMENTARY_TOO);
        }
    }
    all
}

/// Applies one setting such as `accelerometer_std=0.3` and returns the name of the parameter.
///
/// # Errors
/// The text is no setting, the name is unknown (the valid ones are listed), or the value does not
/// fit; the configuration is then unchanged.
pub fn apply_setting(
    config: &mut AttitudeConfig<f64>,
    setting: &str,
) -> Result<String, EvaluationError> {
    let (name, text) = setting
        .split_once('=')
        .ok_or_else(|| EvaluationError::NotASetting {
            text: setting.to_owned(),
        })?;
    let (name, text) = (name.trim(), text.trim());
    let mut map = to_map(config);
    let Some(slot) = map.get_mut(name) else {
        return Err(EvaluationError::UnknownParameter {
            name: name.to_owned(),
            valid: TABLE.map(|row| row.0).join(", "),
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
    let changed: AttitudeConfig<f64> =
        serde_json::from_value(Value::Object(map)).map_err(|error| bad(error.to_string()))?;
    changed.validate().map_err(|error| bad(error.to_string()))?;
    *config = changed;
    Ok(name.to_owned())
}

/// The configuration as name and value.
fn to_map(config: &AttitudeConfig<f64>) -> Map<String, Value> {
    match serde_json::to_value(config) {
        Ok(Value::Object(map)) => map,
        _ => Map::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_and_configuration_name_the_same_parameters() {
        let mut named: Vec<_> = TABLE.iter().map(|row| row.0.to_owned()).collect();
        named.sort();
        let mut real: Vec<_> = to_map(&AttitudeConfig::default()).keys().cloned().collect();
        real.sort();
        assert_eq!(named, real);
    }

    #[test]
    fn parameters_carry_the_defaults_of_each_profile() {
        let all = parameters();
        let std = all.iter().find(|p| p.name == "accelerometer_std").unwrap();
        let expected = [AttitudeConfig::hand_held(), AttitudeConfig::default()];
        for ((_, value), config) in std.defaults.iter().zip(expected) {
            assert_eq!(value.as_f64(), Some(config.accelerometer_std));
        }
        let complementary = all.iter().filter(|p| p.name.starts_with(COMPLEMENTARY));
        let complementary = complementary.count();
        assert_eq!(
            parameters_of(EstimatorKind::Mekf3).len() + BIAS_ONLY.len() + complementary,
            all.len()
        );
        assert_eq!(
            parameters_of(EstimatorKind::ComplementaryPassive).len(),
            complementary + 1
        );
        assert!(parameters_of(EstimatorKind::Integration).is_empty());
    }

    #[test]
    fn settings_change_what_they_name_and_nothing_else() {
        let mut config = AttitudeConfig::default();
        assert_eq!(
            apply_setting(&mut config, "accelerometer_std = 0.3").unwrap(),
            "accelerometer_std"
        );
        assert_eq!(
            apply_setting(&mut config, "gate_timeout_s=5").unwrap(),
            "gate_timeout_s"
        );
        assert_eq!(
            apply_setting(&mut config, "magnetometer_use=heading").unwrap(),
            "magnetometer_use"
        );
        let expected = AttitudeConfig {
            accelerometer_std: 0.3,
            gate_timeout_s: 5.0,
            magnetometer_use: northing_core::attitude::MagnetometerUse::Heading,
            ..AttitudeConfig::default()
        };
        assert_eq!(config, expected);
    }

    #[test]
    fn bad_settings_say_what_was_expected_and_change_nothing() {
        let mut config = AttitudeConfig::default();
        let mut error = |text: &str| apply_setting(&mut config, text).unwrap_err().to_string();
        assert!(error("accelerometer_std").contains("expected NAME=VALUE"));
        let unknown = error("acc_std=1");
        assert!(
            unknown.contains("`acc_std`") && unknown.contains("accelerometer_std, "),
            "{unknown}"
        );
        assert!(error("accelerometer_std=a").contains("expected a number"));
        assert!(error("accelerometer_std=inf").contains("finite"));
        assert!(error("accelerometer_std=-1").contains("above 0"));
        let word = error("magnetometer_use=both");
        assert!(
            word.contains("vector") && word.contains("heading"),
            "{word}"
        );
        assert_eq!(config, AttitudeConfig::default());
    }

    #[test]
    fn profiles_are_found_by_name() {
        assert_eq!("lab".parse::<Profile>().unwrap(), Profile::Lab);
        assert_eq!(Profile::default().name(), "hand-held");
        let error = "car".parse::<Profile>().unwrap_err().to_string();
        assert_eq!(
            error,
            "unknown profile `car`; expected one of: hand-held, lab"
        );
    }
}
