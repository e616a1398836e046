//! The navigation estimators by name.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use super::parameters::NavigationParameters;
use crate::error::EvaluationError;
use crate::registry::{EstimatorInfo, ParameterInfo, Question, Registered};

/// A navigation estimator that can be asked for by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum NavigationKind {
    /// Fifteen error states: the filter that people want today.
    ErrorState,
    /// The paper's six small filters.
    AxisFilters,
    /// A ship's log and compass, no inertial sensors.
    DeadReckoning,
    /// What the device itself said.
    Device,
}

impl NavigationKind {
    /// Every one, the recommended first.
    pub const ALL: [Self; 4] = [
        Self::ErrorState,
        Self::AxisFilters,
        Self::DeadReckoning,
        Self::Device,
    ];

    /// What there is to know about it.
    #[must_use]
    pub const fn info(self) -> EstimatorInfo {
        match self {
            Self::ErrorState => EstimatorInfo {
                name: "error-state",
                summary: "GNSS/INS: 15-state error-state Kalman filter of attitude, velocity, position and biases",
                error_states: 25,
                has_covariance: true,
                paper: "docs/derivations/error_state.md",
                when: "car, drone, boat, phone in a car",
            },
            Self::AxisFilters => EstimatorInfo {
                name: "axis-filters",
                summary: "GNSS/INS of the microcontroller paper: three angle filters and three position filters",
                error_states: 15,
                has_covariance: true,
                paper: "Romaniuk & Gosiewski (2014)",
                when: "the smallest chips",
            },
            Self::DeadReckoning => EstimatorInfo {
                name: "dead-reckoning",
                summary: "a ship's compass, log and fixes, the current estimated; no inertial sensors",
                error_states: 4,
                has_covariance: true,
                paper: "docs/derivations/dead_reckoning.md",
                when: "a ship without inertial unit",
            },
            Self::Device => EstimatorInfo {
                name: "device",
                summary: "the position and orientation that the device itself reported, such as a board with our firmware",
                error_states: 0,
                has_covariance: false,
                paper: "firmware/README.md",
                when: "to compare with",
            },
        }
    }

    /// The name on the command line and in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.info().name
    }
}

impl Registered for NavigationKind {
    const QUESTION: Question = Question::Navigation;
    const COMMAND: &'static str = "run --estimator";
    const EVERY: &'static [Self] = &Self::ALL;

    fn info(self) -> EstimatorInfo {
        Self::info(self)
    }

    fn parameters(self) -> Vec<ParameterInfo> {
        let settings = NavigationParameters::default().settings(self).into_iter();
        let info = settings.map(|setting| {
            let (row, default) = (setting.parameter, setting.json());
            ParameterInfo::new(row.name.to_owned(), row, vec![("default", default)])
        });
        info.collect()
    }
}

impl fmt::Display for NavigationKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for NavigationKind {
    type Err = EvaluationError;

    fn from_str(text: &str) -> Result<Self, EvaluationError> {
        let found = Self::ALL.into_iter().find(|kind| kind.name() == text);
        found.ok_or_else(|| EvaluationError::UnknownEstimator {
            name: text.to_owned(),
            valid: Self::ALL.map(Self::name).join(", "),
        })
    }
}
