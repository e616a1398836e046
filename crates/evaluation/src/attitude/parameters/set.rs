//! A set of parameters: the attitude filters' and the position observer's, under one flat list of names.

use northing_core::attitude::AttitudeConfig;
use northing_core::attitude::bounded_velocity::BoundedVelocityConfig;
use northing_core::navigation::cascade::CascadeConfig;
use northing_core::parameters::{Choice, ConfigError, Parameter, Range, Value};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value as Json};

use crate::attitude::EstimatorKind;
use crate::by_name::{self, Configuration, Row, Tables};
use crate::error::EvaluationError;

/// Names of the bounded-velocity filter's parameters begin so ...
pub(super) const BOUNDED: &str = "bounded_";
/// ... and those of the position observer behind an attitude filter so.
pub(super) const CASCADE: &str = "cascade_";

/// Every parameter of every estimator. As text it is one flat list of names, those of [`AttitudeConfig`], of
/// [`BoundedVelocityConfig`] after `bounded_`, and of [`CascadeConfig`] after `cascade_`; what is left out has its
/// default, and unknown names are refused.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(into = "Map<String, Json>", try_from = "Map<String, Json>")]
pub struct Parameters {
    /// Of the attitude filters.
    pub attitude: AttitudeConfig<f64>,
    /// Of the bounded-velocity filter.
    pub bounded_velocity: BoundedVelocityConfig<f64>,
    /// Of the position observer behind them.
    pub cascade: CascadeConfig<f64>,
    /// The rotation that the position observer is fed with. Only an estimator that reconstructs one has a choice.
    pub rotation: CascadeRotation,
}

/// Which rotation the position observer of a cascade is fed with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum CascadeRotation {
    /// That of the attitude observer.
    #[default]
    Estimated,
    /// The one that the EKF reconstructs, before the observer behind it smooths it.
    Reconstructed,
}

impl Choice for CascadeRotation {
    const ALL: &'static [(&'static str, Self)] = &[
        ("estimated", Self::Estimated),
        ("reconstructed", Self::Reconstructed),
    ];
    const WORDS: &'static [&'static str] = &["estimated", "reconstructed"];
}

const ROTATION: Parameter = Parameter {
    name: "rotation",
    formerly: None,
    unit: "-",
    range: Range::Words(CascadeRotation::WORDS),
    meaning: "which rotation the position observer takes: the observer's or the EKF's",
    note: "",
    read_by: &["cascade-ekf"],
};

/// Parameters of the start, which every estimator that is brought along has from the driver.
const START: [&str; 5] = [
    "initial_tilt_std",
    "initial_heading_std",
    "maximum_attitude_std",
    "initial_gyroscope_bias_std",
    "compass_std",
];

impl Row {
    /// Whether it makes a difference to an estimator.
    pub(crate) fn is_read_by(&self, kind: EstimatorKind) -> bool {
        if matches!(kind, EstimatorKind::Own(_)) {
            return self.prefix.is_empty() && START.contains(&self.parameter.name);
        }
        let of_this_table = match self.prefix {
            BOUNDED => kind == EstimatorKind::BoundedVelocity,
            CASCADE => kind.uses_positions(),
            _ => true,
        };
        let named = self.parameter.read_by;
        let by_all = named.is_empty() && !self.prefix.is_empty();
        of_this_table && (by_all || named.contains(&kind.name()))
    }
}

/// Every row, in the order of the tables.
pub(crate) fn rows() -> impl Iterator<Item = Row> {
    by_name::rows(&Parameters::default().tables()).into_iter()
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

    /// The tables, each with what the names of its parameters begin with.
    pub(super) fn tables(&mut self) -> Tables<'_> {
        vec![
            ("", &mut self.attitude),
            (BOUNDED, &mut self.bounded_velocity),
            (CASCADE, &mut self.cascade),
            (CASCADE, &mut self.rotation),
        ]
    }

    /// The value of a parameter; `None`: there is none of that name.
    #[must_use]
    pub fn value(mut self, name: &str) -> Option<Value<f64>> {
        by_name::value(&self.tables(), name)
    }

    /// Sets a parameter; on an error nothing is changed.
    ///
    /// # Errors
    /// There is none of that name, or the value is outside the permitted range.
    pub fn set(&mut self, name: &str, value: Value<f64>) -> Result<(), ConfigError> {
        by_name::put(self.tables(), name, value)
    }

    /// Checks every value.
    ///
    /// # Errors
    /// The first that is outside its range, and the range.
    pub fn validate(mut self) -> Result<(), EvaluationError> {
        by_name::check(&self.tables())
    }
}

/// The choice as a table of one row.
impl Configuration for CascadeRotation {
    fn rows(&self) -> &'static [Parameter] {
        std::slice::from_ref(&ROTATION)
    }

    fn value(&self, name: &str) -> Option<Value<f64>> {
        (name == ROTATION.name).then(|| Value::Word(self.word()))
    }

    fn put(&mut self, field: &str, value: Value<f64>) -> Result<(), ConfigError> {
        let chosen = match value {
            Value::Word(word) if field == ROTATION.name => Self::from_word(word),
            _ => None,
        };
        *self = chosen.ok_or(ConfigError {
            field: ROTATION.name,
            range: ROTATION.range,
        })?;
        Ok(())
    }

    fn check(&self) -> Result<(), ConfigError> {
        Ok(())
    }
}

/// Every parameter as name and value.
impl From<Parameters> for Map<String, Json> {
    fn from(mut parameters: Parameters) -> Self {
        let rows = by_name::rows(&parameters.tables()).into_iter();
        rows.map(|row| (row.name(), by_name::json(row.value)))
            .collect()
    }
}

impl TryFrom<Map<String, Json>> for Parameters {
    type Error = EvaluationError;

    fn try_from(map: Map<String, Json>) -> Result<Self, EvaluationError> {
        let mut parameters = Self::default();
        for (name, value) in map {
            let old = rows().find(|row| row.formerly().is_some_and(|old| old == name));
            let name = old.map_or(name, |row| row.name());
            let setting = format!("{name}={}", by_name::text(&value));
            super::apply_setting(&mut parameters, &setting)?;
        }
        Ok(parameters)
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
        set.rotation = CascadeRotation::Reconstructed;
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
            assert!(error.to_string().contains("unknown parameter"), "{error}");
        }
    }

    #[test]
    fn every_parameter_is_checked_under_its_name_on_the_command_line() {
        for (name, range) in [
            ("cascade_pole", "from 0.001 to 100"),
            ("bounded_velocity_psd", "from 1e-12 to 10000"),
            ("accelerometer_std", "from 1e-6 to 10000"),
        ] {
            let mut set = Parameters::default();
            match name {
                "cascade_pole" => set.cascade.pole = 0.0,
                "bounded_velocity_psd" => set.bounded_velocity.velocity_psd = f64::NAN,
                _ => set.attitude.accelerometer_std = -1.0,
            }
            let message = set.validate().unwrap_err().to_string();
            assert_eq!(message, format!("configuration: {name} must be {range}"));
        }
    }

    #[test]
    fn tables_name_estimators_that_there_are() {
        let named = rows().flat_map(|row| row.parameter.read_by);
        for name in named {
            assert!(name.parse::<EstimatorKind>().is_ok(), "{name}");
        }
    }

    #[test]
    fn values_that_were_renamed_are_read_from_files() {
        let set: Parameters = serde_json::from_str("{\"cascade_position_std\":2}").unwrap();
        assert_eq!(
            set.value("cascade_position_std_m"),
            Some(Value::Number(2.0))
        );
    }
}
