//! Parameters of the navigation estimators, each by its name in core's tables.

use northing_core::attitude::axis_filters::AxisFiltersConfig;
use northing_core::navigation::axis_filters::PositionAxisConfig;
use northing_core::navigation::{DeadReckoningConfig, GnssInsConfig};
use serde::{Deserialize, Serialize};

use super::kinds::NavigationKind;
use crate::by_name::{self, Row, Tables};
use crate::error::EvaluationError;
use crate::registry::ParameterInfo;

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

impl NavigationParameters {
    /// The tables of an estimator.
    pub(super) fn tables(&mut self, kind: NavigationKind) -> Tables<'_> {
        match kind {
            NavigationKind::ErrorState => vec![("", &mut self.error_state)],
            NavigationKind::AxisFilters => {
                vec![("", &mut self.attitude_axes), ("", &mut self.position_axes)]
            }
            NavigationKind::DeadReckoning => vec![("", &mut self.dead_reckoning)],
            NavigationKind::Device => Vec::new(),
        }
    }

    /// Every parameter of an estimator with its value.
    pub(crate) fn rows(mut self, kind: NavigationKind) -> Vec<Row> {
        by_name::rows(&self.tables(kind))
    }

    /// Sets one parameter of an estimator from `NAME=VALUE` and returns its name; on an error nothing is changed.
    ///
    /// # Errors
    /// It is no setting, no parameter of this estimator has the name, or the value does not fit.
    pub fn set(&mut self, kind: NavigationKind, setting: &str) -> Result<String, EvaluationError> {
        by_name::set(self.tables(kind), setting)
    }

    /// Checks the parameters of an estimator.
    ///
    /// # Errors
    /// The first one outside its permitted range.
    pub fn check(mut self, kind: NavigationKind) -> Result<(), EvaluationError> {
        by_name::check(&self.tables(kind))
    }
}

/// The parameters of an estimator with their defaults.
pub(super) fn parameters_of(kind: NavigationKind) -> Vec<ParameterInfo> {
    let info = |row: Row| {
        let default = vec![("default", by_name::json(row.value))];
        ParameterInfo::new(row.name(), row.parameter, default)
    };
    let rows = NavigationParameters::default().rows(kind);
    rows.into_iter().map(info).collect()
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
