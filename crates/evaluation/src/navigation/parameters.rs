//! Parameters of the navigation estimators, each by its name in core's tables.

use northing_core::attitude::axis_filters::AxisFiltersConfig;
use northing_core::navigation::axis_filters::PositionAxisConfig;
use northing_core::navigation::{DeadReckoningConfig, GnssInsConfig};
use northing_core::parameters::{ConfigError, Parameter, Table, Value};
use serde::{Deserialize, Serialize};

use super::kinds::NavigationKind;
use crate::by_name::{self, Row};
use crate::error::EvaluationError;

/// Everything that can be set.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NavigationParameters {
    /// Of `error-state`.
    pub error_state: GnssInsConfig<f64>,
    /// Of the angles of `axis-filters`.
    pub attitude_axes: AxisFiltersConfig<f64>,
    /// Of the positions of `axis-filters`.
    pub position_axes: PositionAxisConfig<f64>,
    /// Of `dead-reckoning`.
    pub dead_reckoning: DeadReckoningConfig<f64>,
}

/// A parameter as it stands: its group, its name, its value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NavigationSetting {
    /// `error_state`, `attitude_axes`, `position_axes` or `dead_reckoning`.
    pub group: &'static str,
    /// Its row of the table.
    pub parameter: &'static Parameter,
    /// Its value.
    pub value: Value<f64>,
}

impl NavigationSetting {
    pub(crate) const fn row(&self) -> Row {
        Row {
            prefix: "",
            parameter: self.parameter,
        }
    }

    /// The value as JSON.
    #[must_use]
    pub fn json(&self) -> serde_json::Value {
        by_name::json(self.value)
    }

    /// The value, where it is a number.
    #[must_use]
    pub const fn number(&self) -> Option<f64> {
        match self.value {
            Value::Number(number) => Some(number),
            _ => None,
        }
    }
}

/// Settings of a table.
fn list<C: Table<Number = f64>>(group: &'static str, config: &C) -> Vec<NavigationSetting> {
    let setting = |parameter: &'static Parameter| {
        let value = config.parameter(parameter.name)?;
        Some(NavigationSetting {
            group,
            parameter,
            value,
        })
    };
    C::PARAMETERS.iter().filter_map(setting).collect()
}

impl NavigationParameters {
    /// Groups of an estimator.
    #[must_use]
    pub const fn groups(kind: NavigationKind) -> &'static [&'static str] {
        match kind {
            NavigationKind::ErrorState => &["error_state"],
            NavigationKind::AxisFilters => &["attitude_axes", "position_axes"],
            NavigationKind::DeadReckoning => &["dead_reckoning"],
            NavigationKind::Device => &[],
        }
    }

    /// Every parameter of an estimator with its value.
    #[must_use]
    pub fn settings(&self, kind: NavigationKind) -> Vec<NavigationSetting> {
        let of_group = |group: &&'static str| match *group {
            "error_state" => list(group, &self.error_state),
            "attitude_axes" => list(group, &self.attitude_axes),
            "position_axes" => list(group, &self.position_axes),
            _ => list(group, &self.dead_reckoning),
        };
        Self::groups(kind).iter().flat_map(of_group).collect()
    }

    /// Sets one parameter of an estimator from `NAME=VALUE` and returns its name; on an error nothing is changed.
    ///
    /// # Errors
    /// It is no setting, no parameter of this estimator has the name, or the value does not fit.
    pub fn set(&mut self, kind: NavigationKind, text: &str) -> Result<String, EvaluationError> {
        let known = self.settings(kind);
        let rows = known.iter().map(NavigationSetting::row);
        by_name::set(text, rows, |name, value| {
            let meant = known.iter().find(|s| s.parameter.name == name);
            self.put(meant.map_or("", |setting| setting.group), name, value)
        })
    }

    fn put(&mut self, group: &str, name: &str, value: Value<f64>) -> Result<(), ConfigError> {
        match group {
            "error_state" => self.error_state.set_parameter(name, value),
            "attitude_axes" => self.attitude_axes.set_parameter(name, value),
            "position_axes" => self.position_axes.set_parameter(name, value),
            _ => self.dead_reckoning.set_parameter(name, value),
        }
    }

    /// Checks the parameters of an estimator.
    ///
    /// # Errors
    /// The first one outside its permitted range.
    pub fn check(&self, kind: NavigationKind) -> Result<(), EvaluationError> {
        match kind {
            NavigationKind::ErrorState => self.error_state.validate()?,
            NavigationKind::AxisFilters => {
                self.attitude_axes.validate()?;
                self.position_axes.validate()?;
            }
            NavigationKind::DeadReckoning => self.dead_reckoning.validate()?,
            NavigationKind::Device => {}
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parameters_are_set_by_name_and_bad_ones_are_refused() {
        let mut parameters = NavigationParameters::default();
        let kind = NavigationKind::AxisFilters;
        parameters.set(kind, "acceleration_std=3").unwrap();
        parameters.set(kind, "noise=printed").unwrap();
        parameters.set(kind, "euler_rates=false").unwrap();
        let ins = NavigationKind::ErrorState;
        parameters.set(ins, "validity.invalid_after_s=90").unwrap();
        parameters.set(ins, "lever_arm_m=0,-0.05,0").unwrap();
        parameters.set(ins, "initial_heading=1.5,0.1").unwrap();
        parameters.set(ins, "declination=0.05").unwrap();
        assert_eq!(parameters.error_state.declination, Some(0.05));
        parameters.set(ins, "declination=none").unwrap();
        assert_eq!(parameters.error_state.declination, None);
        let renamed = parameters.set(ins, "position_white_share=1").unwrap_err();
        let now = "it is now called `position_uncorrelated_fraction`";
        assert!(renamed.to_string().contains(now), "{renamed}");
        assert_eq!(parameters.error_state.initial_heading, Some([1.5, 0.1]));
        assert!((parameters.error_state.validity.invalid_after_s - 90.0).abs() < 1e-12);
        assert!((parameters.position_axes.acceleration_std - 3.0).abs() < 1e-12);
        assert!(!parameters.attitude_axes.euler_rates);
        let before = parameters;
        for (text, expected) in [
            ("acceleration_std", "not a setting"),
            ("acceleration=3", "unknown parameter `acceleration`"),
            ("acceleration_std=three", "expected a number"),
            ("acceleration_std=-1", "does not fit"),
            (
                "noise=loud",
                "expected physical | printed | printed-names-swapped",
            ),
            ("aceleration_std=3", "did you mean `acceleration_std`?"),
        ] {
            let message = parameters.set(kind, text).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
        assert_eq!(parameters, before);
    }
}
