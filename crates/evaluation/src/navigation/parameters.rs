//! Parameters of the navigation estimators, each by its name.

use northing_core::attitude::axis_filters::AxisFiltersConfig;
use northing_core::navigation::axis_filters::PositionAxisConfig;
use northing_core::navigation::{DeadReckoningConfig, GnssInsConfig};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::kinds::NavigationKind;
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
#[derive(Debug, Clone, PartialEq)]
pub struct NavigationSetting {
    /// `error_state`, `attitude_axes`, `position_axes` or `dead_reckoning`.
    pub group: &'static str,
    /// Its name.
    pub name: String,
    /// Its value, as JSON.
    pub value: Value,
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
        let all = serde_json::to_value(self).unwrap_or_default();
        let of_group = |group: &'static str| {
            let entries = all.get(group).and_then(Value::as_object).cloned();
            let entries = entries.into_iter().flatten();
            entries.flat_map(move |(name, value)| flat(group, name, value))
        };
        let groups = Self::groups(kind).iter().copied();
        groups.flat_map(of_group).collect()
    }

    /// Sets one parameter of an estimator from `NAME=VALUE`.
    ///
    /// # Errors
    /// It is no setting, no parameter of this estimator has the name, or the value does not fit.
    pub fn set(&mut self, kind: NavigationKind, text: &str) -> Result<(), EvaluationError> {
        let (name, value) = text
            .split_once('=')
            .map(|(name, value)| (name.trim(), value.trim()))
            .filter(|(name, value)| !name.is_empty() && !value.is_empty())
            .ok_or_else(|| EvaluationError::NotASetting {
                text: text.to_owned(),
            })?;
        let known = self.settings(kind);
        let setting = known.iter().find(|setting| setting.name == name);
        let setting = setting.ok_or_else(|| EvaluationError::UnknownParameter {
            name: name.to_owned(),
            valid: names(&known),
        })?;
        let bad = |problem: String| EvaluationError::BadValue {
            name: name.to_owned(),
            value: value.to_owned(),
            problem,
        };
        let parsed = parse_like(&setting.value, value).map_err(bad)?;
        let changed = self.with(setting.group, name, parsed).map_err(bad)?;
        changed.check(kind)?;
        *self = changed;
        Ok(())
    }

    /// A copy with one value changed.
    fn with(&self, group: &str, name: &str, value: Value) -> Result<Self, String> {
        let mut all = serde_json::to_value(self).map_err(|error| error.to_string())?;
        let path = format!("/{group}/{}", name.replace('.', "/"));
        if let Some(entry) = all.pointer_mut(&path) {
            *entry = value;
        }
        from_value(all)
    }

    /// Refuses values that make no sense.
    ///
    /// # Errors
    /// The first parameter of this estimator that makes no sense.
    pub fn check(&self, kind: NavigationKind) -> Result<(), EvaluationError> {
        let name = match kind {
            NavigationKind::ErrorState => self.error_state.senseless(),
            NavigationKind::AxisFilters => self
                .attitude_axes
                .senseless()
                .or_else(|| self.position_axes.senseless()),
            NavigationKind::DeadReckoning => self.dead_reckoning.senseless(),
            NavigationKind::Device => None,
        };
        let Some(name) = name else { return Ok(()) };
        let value = self.settings(kind).into_iter().find(|s| s.name == name);
        Err(EvaluationError::BadValue {
            name: name.to_owned(),
            value: value.map_or_else(String::new, |setting| setting.value.to_string()),
            problem: "it must be finite and have a sensible sign and size".to_owned(),
        })
    }
}

/// A parameter, or those within it, as `name.inner`.
fn flat(group: &'static str, name: String, value: Value) -> Vec<NavigationSetting> {
    match value {
        Value::Object(inner) => inner
            .into_iter()
            .flat_map(|(inner, value)| flat(group, format!("{name}.{inner}"), value))
            .collect(),
        value => vec![NavigationSetting { group, name, value }],
    }
}

fn names(settings: &[NavigationSetting]) -> String {
    let names: Vec<&str> = settings.iter().map(|s| s.name.as_str()).collect();
    names.join(", ")
}

/// Text as a value of the kind that the parameter has now.
fn parse_like(now: &Value, text: &str) -> Result<Value, String> {
    match now {
        Value::Bool(_) => text
            .parse::<bool>()
            .map(Value::from)
            .map_err(|_| "expected true or false".to_owned()),
        Value::Number(_) => text
            .parse::<f64>()
            .ok()
            .filter(|x| x.is_finite())
            .map(Value::from)
            .ok_or_else(|| "expected a number".to_owned()),
        Value::Null | Value::Array(_) => {
            // What is not set is a pair: a value and its standard deviation.
            let wanted = now.as_array().map_or(2, Vec::len);
            let numbers: Option<Vec<f64>> =
                text.split(',').map(|x| x.trim().parse().ok()).collect();
            numbers
                .filter(|numbers| numbers.len() == wanted)
                .map(Value::from)
                .ok_or_else(|| format!("expected {wanted} numbers with commas between"))
        }
        _ => Ok(Value::from(text)),
    }
}

fn from_value<T: DeserializeOwned>(value: Value) -> Result<T, String> {
    serde_json::from_value(value).map_err(|error| error.to_string())
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
            ("noise=loud", "unknown variant"),
        ] {
            let message = parameters.set(kind, text).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
        assert_eq!(parameters, before);
    }
}
