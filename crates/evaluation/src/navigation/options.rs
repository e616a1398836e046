//! Options of a navigation run: estimator, thinning, outages, aids, smoothing.

use std::str::FromStr;

use northing_recording::Metadata;

use super::kinds::NavigationKind;
use super::navigator::AidKind;
use super::parameters::NavigationParameters;
use crate::error::EvaluationError;
use crate::used_parameters::{Origin, Origins, UsedParameter, used};

/// A time in which the filter gets no fixes, made to see how it does without.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outage {
    /// Its start, s after the first fix.
    pub start_s: f64,
    /// How long it lasts, s.
    pub duration_s: f64,
}

impl Outage {
    /// Whether it covers this time, s after the first fix.
    #[must_use]
    pub fn covers(&self, since_first_fix_s: f64) -> bool {
        (self.start_s..self.start_s + self.duration_s).contains(&since_first_fix_s)
    }
}

/// `START:DURATION`, both in seconds.
impl FromStr for Outage {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let expected = || {
            format!(
                "`{text}` is no outage; expected START:DURATION in seconds after the first fix, e.g. 120:30"
            )
        };
        let (start, duration) = text.split_once(':').ok_or_else(expected)?;
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|x| x.is_finite());
        match (number(start), number(duration)) {
            (Some(start_s), Some(duration_s)) if start_s >= 0.0 && duration_s > 0.0 => Ok(Self {
                start_s,
                duration_s,
            }),
            _ => Err(expected()),
        }
    }
}

/// Options of a navigation run.
#[derive(Debug, Clone, PartialEq)]
pub struct NavigationOptions {
    /// The estimator.
    pub estimator: NavigationKind,
    /// Its parameters (and those of the others).
    pub parameters: NavigationParameters,
    /// Origins of those that are not the defaults.
    pub origins: Origins,
    /// One of so many fixes is used, the others are held out and scored at; default 1: all are used.
    pub gnss_every: u32,
    /// Times without fixes; those of the receiver are scored at.
    pub outages: Vec<Outage>,
    /// Aids that are left out.
    pub without: Vec<AidKind>,
    /// Scores count from so many seconds after the first fix, default 60: alignment and biases have
    /// settled.
    pub score_from_s: f64,
    /// Whether the estimate is smoothed over the whole recording.
    pub smooth: bool,
}

impl Default for NavigationOptions {
    fn default() -> Self {
        Self {
            estimator: NavigationKind::ErrorState,
            parameters: NavigationParameters::default(),
            origins: Origins::new(),
            gnss_every: 1,
            outages: Vec::new(),
            without: Vec::new(),
            score_from_s: 60.0,
            smooth: false,
        }
    }
}

impl NavigationOptions {
    /// The defaults of an estimator, with what the recording knows about its receiver.
    #[must_use]
    pub fn of_recording(estimator: NavigationKind, metadata: &Metadata) -> Self {
        let mut options = Self {
            estimator,
            ..Self::default()
        };
        let config = &mut options.parameters.error_state;
        let mut stated = Vec::new();
        if let Some(arm) = metadata.gnss_lever_arm_m {
            config.lever_arm_m = arm;
            stated.push("lever_arm_m");
        }
        for (name, latency, stated_s) in [
            (
                "position_latency_s",
                &mut config.position_latency_s,
                metadata.gnss_position_latency_s,
            ),
            (
                "velocity_latency_s",
                &mut config.velocity_latency_s,
                metadata.gnss_velocity_latency_s,
            ),
        ] {
            *latency = stated_s;
            if stated_s != 0.0 {
                stated.push(name);
            }
        }
        let stated = stated.into_iter().map(str::to_owned);
        options.origins = stated.map(|name| (name, Origin::Recording)).collect();
        options
    }

    /// Sets one parameter of the estimator from `NAME=VALUE` and remembers where it comes from.
    ///
    /// # Errors
    /// As [`NavigationParameters::set`].
    pub fn set_from(&mut self, setting: &str, origin: Origin) -> Result<(), EvaluationError> {
        let name = self.parameters.set(self.estimator, setting)?;
        self.origins.insert(name, origin);
        Ok(())
    }

    /// Every parameter of the estimator with its value and origin.
    #[must_use]
    pub fn used_parameters(&self) -> Vec<UsedParameter> {
        let usual = NavigationParameters::default().rows(self.estimator);
        used(self.parameters.rows(self.estimator), &usual, &self.origins)
    }

    /// Refuses what is invalid.
    ///
    /// # Errors
    /// The option, and what was expected.
    pub fn check(&self) -> Result<(), EvaluationError> {
        let bad = |name: &str, value: String, problem: &str| EvaluationError::BadValue {
            name: name.to_owned(),
            value,
            problem: problem.to_owned(),
        };
        if self.gnss_every == 0 {
            return Err(bad("gnss_every", "0".to_owned(), "expected 1 or more"));
        }
        if !(self.score_from_s >= 0.0 && self.score_from_s.is_finite()) {
            let value = self.score_from_s.to_string();
            return Err(bad("score_from_s", value, "expected seconds, 0 or above"));
        }
        if self.smooth && self.estimator != NavigationKind::ErrorState {
            return Err(EvaluationError::NoSmoother {
                estimator: self.estimator.name(),
            });
        }
        let held_out = self.gnss_every > 1 || !self.outages.is_empty() || !self.without.is_empty();
        if self.estimator == NavigationKind::Device && held_out {
            return Err(EvaluationError::DeviceHadEverything);
        }
        self.parameters.check(self.estimator)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outages_are_read_and_bad_ones_are_told_what_was_expected() {
        let outage: Outage = "75:30".parse().unwrap();
        assert!(outage.covers(75.0) && outage.covers(104.9) && !outage.covers(105.0));
        for bad in ["75", "75:", ":30", "75:0", "-1:30", "a:b", "75:nan"] {
            let message = bad.parse::<Outage>().unwrap_err();
            assert!(message.contains("expected START:DURATION"), "{message}");
        }
    }

    #[test]
    fn nothing_can_be_kept_from_a_device_afterwards() {
        let device = NavigationOptions {
            estimator: NavigationKind::Device,
            ..NavigationOptions::default()
        };
        assert!(device.check().is_ok());
        for bad in [
            NavigationOptions {
                gnss_every: 2,
                ..device.clone()
            },
            NavigationOptions {
                outages: vec!["10:5".parse().unwrap()],
                ..device.clone()
            },
            NavigationOptions {
                without: vec![AidKind::Magnetometer],
                ..device
            },
        ] {
            let message = bad.check().unwrap_err().to_string();
            assert!(message.contains("while it ran"), "{message}");
        }
    }

    #[test]
    fn names_come_back() {
        for kind in NavigationKind::ALL {
            assert_eq!(kind.name().parse::<NavigationKind>().unwrap(), kind);
        }
        let message = "ins".parse::<NavigationKind>().unwrap_err().to_string();
        assert!(message.contains("error-state, axis-filters"), "{message}");
    }
}
