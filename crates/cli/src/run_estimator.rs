//! What `run --estimator` can name: an attitude estimator or a navigation estimator.

use std::fmt;
use std::str::FromStr;

use northing_evaluation::estimators::EstimatorKind;
use northing_evaluation::navigation::NavigationKind;

/// An estimator by name, whatever it estimates.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum RunEstimator {
    /// Which way does it point?
    Attitude(EstimatorKind),
    /// Where is it?
    Navigation(NavigationKind),
}

impl FromStr for RunEstimator {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if let Ok(kind) = text.parse() {
            return Ok(Self::Attitude(kind));
        }
        text.parse().map(Self::Navigation).map_err(|_| {
            let attitude = EstimatorKind::ALL.map(EstimatorKind::name);
            let navigation = NavigationKind::ALL.map(NavigationKind::name);
            format!(
                "unknown estimator `{text}`; expected one of: {}, {}",
                attitude.join(", "),
                navigation.join(", ")
            )
        })
    }
}

impl fmt::Display for RunEstimator {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Attitude(kind) => kind.fmt(f),
            Self::Navigation(kind) => kind.fmt(f),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_kinds_are_named_and_an_unknown_one_is_told_all_of_them() {
        for name in ["mekf", "error-state", "axis-filters", "dead-reckoning"] {
            assert_eq!(name.parse::<RunEstimator>().unwrap().to_string(), name);
        }
        let message = "ins".parse::<RunEstimator>().unwrap_err();
        assert!(message.contains("usque") && message.contains("error-state"));
    }
}
