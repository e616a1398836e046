//! The navigation estimators by name.

use std::fmt;
use std::str::FromStr;

use serde::Serialize;

use crate::error::EvaluationError;

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

/// What people want to know before they choose.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct NavigationInfo {
    /// The name on the command line and in files.
    pub name: &'static str,
    /// What it is, in a sentence.
    pub summary: &'static str,
    /// Where to read about it.
    pub paper: &'static str,
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
    pub const fn info(self) -> NavigationInfo {
        match self {
            Self::ErrorState => NavigationInfo {
                name: "error-state",
                summary: "GNSS/INS: 15-state error-state Kalman filter of attitude, velocity, position and biases",
                paper: "docs/derivations/error_state.md",
            },
            Self::AxisFilters => NavigationInfo {
                name: "axis-filters",
                summary: "GNSS/INS of the microcontroller paper: three angle filters and three position filters",
                paper: "Romaniuk & Gosiewski (2014)",
            },
            Self::DeadReckoning => NavigationInfo {
                name: "dead-reckoning",
                summary: "a ship's compass, log and fixes, the current estimated; no inertial sensors",
                paper: "docs/derivations/dead_reckoning.md",
            },
            Self::Device => NavigationInfo {
                name: "device",
                summary: "the position and orientation that the device itself reported, such as a board with our firmware",
                paper: "firmware/README.md",
            },
        }
    }

    /// The name on the command line and in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        self.info().name
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
