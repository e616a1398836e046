//! A set of parameters: the attitude filters' and the position observer's, under one flat list of names.

use northing_core::attitude::AttitudeConfig;
use northing_core::attitude::bounded_velocity::BoundedVelocityConfig;
use northing_core::attitude::config::ConfigError;
use northing_core::navigation::cascade::CascadeConfig;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::bounded_velocity::{self, BOUNDED};
use crate::attitude::kinds::EstimatorKind;

/// Every parameter of every estimator. As text it is one flat list of names, those of
/// [`AttitudeConfig`], of [`BoundedVelocityConfig`] after `bounded_`, and of [`CascadeSettings`]; what is left out has its default, and unknown
/// names are refused.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(into = "Map<String, Value>", try_from = "Map<String, Value>")]
pub struct Parameters {
    /// Of the attitude filters.
    pub attitude: AttitudeConfig<f64>,
    /// Of the bounded-velocity filter.
    pub bounded_velocity: BoundedVelocityConfig<f64>,
    /// Of the position observer behind them.
    pub cascade: CascadeSettings,
}

/// Which rotation the position observer of a cascade is fed with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CascadeRotation {
    /// That of the attitude observer.
    #[default]
    Estimated,
    /// The one that the EKF reconstructs, before the observer behind it smooths it.
    Reconstructed,
}

/// Parameters of the position observer. Names are those of the command line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CascadeSettings {
    /// The triple pole, 1/s, default 1. See [`CascadeConfig::pole`].
    #[serde(rename = "cascade_pole")]
    pub pole: f64,
    /// Standard deviation of a position per axis, m, default 0.1. See [`CascadeConfig::position_std`].
    #[serde(rename = "cascade_position_std_m")]
    pub position_std_m: f64,
    /// The rotation, default `estimated`. Only an estimator that reconstructs one has a choice.
    #[serde(rename = "cascade_rotation")]
    pub rotation: CascadeRotation,
}

impl Default for CascadeSettings {
    /// Positions good to a decimetre ten times a second, as a laboratory has them.
    fn default() -> Self {
        let core = CascadeConfig::<f64>::lab();
        Self {
            pole: core.pole,
            position_std_m: core.position_std,
            rotation: CascadeRotation::default(),
        }
    }
}

impl CascadeSettings {
    /// Positions of a satellite receiver: one a second, good to a few metres.
    #[must_use]
    pub fn satellite() -> Self {
        Self {
            pole: 0.25,
            position_std_m: 3.0,
            ..Self::default()
        }
    }

    /// As the observer takes them.
    #[must_use]
    pub fn config(&self) -> CascadeConfig<f64> {
        CascadeConfig {
            pole: self.pole,
            position_std: self.position_std_m,
            ..CascadeConfig::lab()
        }
    }
}

impl Parameters {
    /// What the driver's alignment takes for an estimator.
    #[must_use]
    pub fn alignment(&self, kind: EstimatorKind) -> AttitudeConfig<f64> {
        match kind {
            EstimatorKind::BoundedVelocity => self.bounded_velocity.alignment_settings(),
            _ => self.attitude,
        }
    }

    /// Checks every value.
    ///
    /// # Errors
    /// The first that makes no sense, and what was expected.
    pub fn validate(&self) -> Result<(), ConfigError> {
        self.attitude.validate()?;
        self.bounded_velocity
            .validate()
            .map_err(|error| ConfigError {
                field: full_name(error.field),
                ..error
            })?;
        let (field, expected) = match self.cascade.config().senseless() {
            None => return Ok(()),
            Some("pole") => ("cascade_pole", "a number from 0.001 to 100"),
            Some(_) => ("cascade_position_std_m", "a number from 1e-6 to 1e6"),
        };
        Err(ConfigError { field, expected })
    }
}

/// The command line's name of a field of the bounded-velocity filter.
fn full_name(field: &'static str) -> &'static str {
    let names = bounded_velocity::TABLE.iter().map(|row| row.0);
    let mut found = names.filter(|name| name.strip_prefix(BOUNDED) == Some(field));
    found.next().unwrap_or(field)
}

/// The fields of a structure by name.
fn fields(of: &impl Serialize) -> Map<String, Value> {
    match serde_json::to_value(of) {
        Ok(Value::Object(map)) => map,
        _ => Map::new(),
    }
}

/// Every parameter as name and value.
impl From<Parameters> for Map<String, Value> {
    fn from(parameters: Parameters) -> Self {
        let bounded = bounded_velocity::prefixed(fields(&parameters.bounded_velocity));
        let parts = [
            fields(&parameters.attitude),
            bounded,
            fields(&parameters.cascade),
        ];
        parts.into_iter().flatten().collect()
    }
}

impl TryFrom<Map<String, Value>> for Parameters {
    type Error = serde_json::Error;

    fn try_from(map: Map<String, Value>) -> Result<Self, serde_json::Error> {
        let starts = |start| move |(name, _): &(String, Value)| name.starts_with(start);
        let (cascade, rest): (Map<_, _>, Map<_, _>) =
            map.into_iter().partition(starts(super::CASCADE));
        let (bounded, attitude): (Map<_, _>, Map<_, _>) =
            rest.into_iter().partition(starts(BOUNDED));
        let bounded = bounded_velocity::unprefixed(bounded);
        Ok(Self {
            attitude: serde_json::from_value(Value::Object(attitude))?,
            bounded_velocity: serde_json::from_value(Value::Object(bounded))?,
            cascade: serde_json::from_value(Value::Object(cascade))?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_set_is_one_flat_list_of_names_and_comes_back_from_it() {
        let mut set = Parameters::default();
        set.attitude.accelerometer_std = 1.0 / 3.0;
        set.bounded_velocity.velocity_psd = 1.0 / 7.0;
        set.cascade.pole = 0.123_456_789_012_345_67;
        set.cascade.rotation = CascadeRotation::Reconstructed;
        let text = serde_json::to_string(&set).unwrap();
        assert!(
            text.contains("\"cascade_rotation\":\"reconstructed\""),
            "{text}"
        );
        assert_eq!(serde_json::from_str::<Parameters>(&text).unwrap(), set);
        assert_eq!(
            serde_json::from_str::<Parameters>("{}").unwrap(),
            Parameters::default()
        );
        for unknown in [
            "{\"acc_std\":1}",
            "{\"cascade_poles\":1}",
            "{\"bounded_vel\":1}",
        ] {
            let error = serde_json::from_str::<Parameters>(unknown).unwrap_err();
            assert!(error.to_string().contains("unknown field"), "{error}");
        }
    }

    #[test]
    fn values_of_the_observer_are_checked() {
        let message = |pole, position_std_m| {
            let cascade = CascadeSettings {
                pole,
                position_std_m,
                ..CascadeSettings::default()
            };
            let set = Parameters {
                cascade,
                ..Parameters::default()
            };
            set.validate().unwrap_err().to_string()
        };
        assert_eq!(
            message(0.0, 1.0),
            "cascade_pole: expected a number from 0.001 to 100"
        );
        let mut set = Parameters::default();
        set.bounded_velocity.velocity_psd = 0.0;
        let error = set.validate().unwrap_err().to_string();
        assert_eq!(
            error,
            "bounded_velocity_psd: expected a finite number above 0"
        );
        assert!(message(f64::NAN, 1.0).contains("cascade_pole"));
        assert!(message(1.0, -1.0).contains("cascade_position_std_m"));
    }
}
