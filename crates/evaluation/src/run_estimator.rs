//! What `run --estimator` can name: an attitude estimator or a navigation estimator.

use std::fmt;
use std::str::FromStr;

use northing_recording::SensorKind;

use crate::attitude::EstimatorKind;
use crate::error::EvaluationError;
use crate::navigation::NavigationKind;

/// An estimator by name, whatever it estimates. `device` is read as one of the attitude; of a recording whose
/// device tells its position, too, [`Self::of_recording`] makes the other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RunEstimator {
    /// Which way does it point?
    Attitude(EstimatorKind),
    /// Where is it?
    Navigation(NavigationKind),
}

impl FromStr for RunEstimator {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.parse() {
            Ok(kind) => return Ok(Self::Attitude(kind)),
            // What is wrong with the file is said, and not that it is no name.
            Err(error @ EvaluationError::OwnEstimator { .. }) => return Err(error.to_string()),
            Err(_) => {}
        }
        text.parse().map(Self::Navigation).map_err(|_| {
            let attitude = EstimatorKind::ALL.map(EstimatorKind::name);
            let navigation = NavigationKind::ALL.map(NavigationKind::name);
            let navigation = navigation.iter().filter(|name| !attitude.contains(name));
            let names: Vec<&str> = attitude.iter().chain(navigation).copied().collect();
            format!(
                "unknown estimator `{text}`; expected one of: {}",
                names.join(", ")
            )
        })
    }
}

impl RunEstimator {
    /// Whether what was asked for, if anything, means another estimator where the device tells its position.
    #[must_use]
    pub const fn depends_on_recording(asked: Option<Self>) -> bool {
        matches!(asked, None | Some(Self::Attitude(EstimatorKind::Device)))
    }

    /// What runs over a recording with these sensors: asked for the device's own estimates, or for nothing, all
    /// of what the device itself estimated is taken; asked for nothing, the position where there are fixes alone.
    #[must_use]
    pub fn of_recording(asked: Option<Self>, sensors: &[SensorKind]) -> Option<Self> {
        if Self::depends_on_recording(asked) && sensors.contains(&SensorKind::DeviceNavigation) {
            return Some(Self::Navigation(NavigationKind::Device));
        }
        let has_rates = sensors.contains(&SensorKind::Gyroscope);
        if asked.is_none() && !has_rates && sensors.contains(&SensorKind::GnssPosition) {
            return Some(Self::Navigation(NavigationKind::DeadReckoning));
        }
        asked
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
    fn without_a_choice_the_sensors_decide() {
        let device = Some(RunEstimator::Attitude(EstimatorKind::Device));
        let mekf = Some(RunEstimator::Attitude(EstimatorKind::Mekf));
        let whole = Some(RunEstimator::Navigation(NavigationKind::Device));
        let board = [SensorKind::Gyroscope, SensorKind::DeviceNavigation];
        let phone = [SensorKind::Gyroscope, SensorKind::DeviceOrientation];
        let receiver = [SensorKind::GnssPosition, SensorKind::GnssVelocity];
        let reckoned = Some(RunEstimator::Navigation(NavigationKind::DeadReckoning));
        for (asked, sensors, expected) in [
            (None, board, whole),
            (device, board, whole),
            (mekf, board, mekf),
            (None, phone, None),
            (device, phone, device),
            (None, receiver, reckoned),
            (mekf, receiver, mekf),
        ] {
            assert_eq!(RunEstimator::of_recording(asked, &sensors), expected);
        }
    }

    #[test]
    fn both_kinds_are_named_and_an_unknown_one_is_told_all_of_them() {
        for name in ["mekf", "error-state", "axis-filters", "dead-reckoning"] {
            assert_eq!(name.parse::<RunEstimator>().unwrap().to_string(), name);
        }
        let message = "ins".parse::<RunEstimator>().unwrap_err();
        assert!(message.contains("usque") && message.contains("error-state"));
        assert_eq!(message.matches("device").count(), 1, "{message}");
    }
}
