//! The navigation estimators by name.

use std::str::FromStr;

use serde::Serialize;

use super::parameters::parameters_of;
use crate::error::EvaluationError;

crate::named::estimators! {
    /// A navigation estimator that can be asked for by name.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum NavigationKind for Navigation, "run --estimator", parameters_of {
        /// Fifteen error states: the filter that people want today.
        ErrorState = "error-state", 25,
            "GNSS/INS: 15-state error-state Kalman filter of attitude, velocity, position and biases",
            "docs/derivations/error_state.md", "car, drone, boat, phone in a car";
        /// The paper's six small filters.
        AxisFilters = "axis-filters", 15,
            "GNSS/INS of the microcontroller paper: three angle filters and three position filters",
            "Romaniuk & Gosiewski (2014)", "the smallest chips";
        /// A ship's log and compass, no inertial sensors.
        DeadReckoning = "dead-reckoning", 4,
            "a ship's compass, log and fixes, the current estimated; no inertial sensors",
            "docs/derivations/dead_reckoning.md", "a ship without inertial unit";
        /// What the device itself said.
        Device = "device", 0,
            "the position and orientation that the device itself reported, such as a board with our firmware",
            "firmware/README.md", "to compare with";
    }
}

impl FromStr for NavigationKind {
    type Err = EvaluationError;

    fn from_str(name: &str) -> Result<Self, EvaluationError> {
        Self::named(name).ok_or_else(|| EvaluationError::UnknownEstimator {
            name: name.to_owned(),
            valid: Self::names(),
        })
    }
}
