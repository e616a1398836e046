//! Solution status: aligning, aided, dead reckoning, or invalid.
//!
//! A filter can always say where it believes to be. Whether anybody should act on it is a matter of how long
//! nothing has confirmed it and of how uncertain it says it is; both limits are settings.

use crate::parameters::parameters;
use crate::scalar::Scalar;

/// What a position is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum Validity {
    /// There is no position yet.
    Aligning,
    /// Fixes come, and position and velocity are good; the heading is not known yet, or the fixes disagree with it.
    HeadingUnknown,
    /// Fixes come.
    Aided,
    /// None for longer than [`ValidityLimits::dead_reckoning_after_s`]: inertial sensors, and whatever else aids.
    DeadReckoning,
    /// None for longer than [`ValidityLimits::invalid_after_s`], or the stated error is above
    /// [`ValidityLimits::invalid_above_m`].
    Invalid,
}

parameters! {
    /// When a position is dead reckoning, and when it is invalid.
    pub struct ValidityLimits, profiles {
        /// Inertial sensors that soon drift.
        inertial = 0,
        /// A ship's log, which drifts with the current alone.
        log = 1,
    };

    dead_reckoning_after_s: T, "s", From(1e-3, 1e9), [2.0],
        "time without a fix after which a position is dead reckoning",
        "Raising it hides short outages.";
    invalid_after_s: T, "s", From(1e-3, 1e9), [30.0, 1800.0],
        "time without a fix after which a position is invalid",
        "Raising it trusts inertial sensors for longer than cheap ones deserve.";
    invalid_above_m: T, "m", From(1e-4, 1e9), [50.0, 500.0],
        "standard deviation of the less certain horizontal axis above which a position is invalid";
}

impl<T: Scalar> ValidityLimits<T> {
    /// The worth of a position `since_fix` seconds after its last fix (`None`: there was none) whose larger
    /// horizontal variance is `variance` (m^2). What is not a number is not valid.
    pub fn judge(&self, since_fix: Option<T>, variance: T) -> Validity {
        let Some(since) = since_fix else {
            return Validity::Aligning;
        };
        let above = self.invalid_above_m * self.invalid_above_m;
        if !(since <= self.invalid_after_s && variance <= above) {
            Validity::Invalid
        } else if since > self.dead_reckoning_after_s {
            Validity::DeadReckoning
        } else {
            Validity::Aided
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_position_ages_and_what_is_not_a_number_is_not_valid() {
        let limits = ValidityLimits::<f64>::default();
        let worth = [None, Some(0.0), Some(2.5), Some(31.0)].map(|since| limits.judge(since, 4.0));
        use Validity::{Aided, Aligning, DeadReckoning, Invalid};
        assert_eq!(worth, [Aligning, Aided, DeadReckoning, Invalid]);
        assert_eq!(limits.judge(Some(0.0), 51.0 * 51.0), Invalid);
        assert_eq!(limits.judge(Some(0.0), f64::NAN), Invalid);
        assert_eq!(limits.judge(Some(f64::NAN), 1.0), Invalid);
    }
}
