//! Maximum-likelihood fit of noise parameters to a recording: the innovations of an estimator shall be as likely as
//! possible.
//!
//! | I look for | file |
//! |---|---|
//! | the fit of a navigation estimator | [`navigation`] |
//! | the fit of an attitude estimator | [`attitude`] |
//! | the likelihood of an innovation | `likelihood` |
//! | the search | `search` |
//!
//! The likelihood of one innovation is Gaussian with the covariance that the filter states, so neither small
//! residuals nor large covariances win by themselves. The fit sees the first part of the recording alone; the
//! rest is held out, and a fit that makes it less likely has learnt the recording instead of the sensors. Errors
//! that last count once a sample (a composite likelihood): what they add to the noise is found, how long they
//! last is not.

pub mod attitude;
mod likelihood;
pub mod navigation;
mod search;

use serde::Serialize;

use northing_core::parameters::Value;

use crate::by_name::{self, Row};
use crate::error::EvaluationError;
pub use likelihood::NegativeLogLikelihood;
use search::{Judge, Search};

/// Ends of the names of parameters that are noises ...
const NOISES: [&str; 5] = [
    "_noise_density",
    "_random_walk",
    "_random_walk_ut",
    "_std",
    "_std_ut",
];
/// ... unless they contain one of these: what is known at the start, and a bound.
const NO_NOISES: [&str; 2] = ["initial_", "maximum_"];
/// A parameter that moves by more than this factor is not seen by the recording.
const FURTHEST: f64 = 1e3;
/// A held-out part that is less likely by so much an innovation speaks of over-fitting.
const NOISE_OF_LIKELIHOOD: f64 = 0.005;

/// What a fit is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct TuneOptions {
    /// Parameters to fit; empty: every noise of the estimator that is above zero and makes a difference.
    pub parameters: Vec<String>,
    /// Share of the recording that the fit sees, default 0.6; the rest is held out.
    pub fitted_share: f64,
    /// Of an attitude estimator: seconds of gyroscope alone before an innovation that is judged, default 3; 0 judges
    /// every sample.
    pub prediction_s: f64,
    /// Steps of the search for each parameter at most, default 25; a step takes one run over the recording or two.
    pub steps_per_parameter: u64,
}

impl Default for TuneOptions {
    fn default() -> Self {
        Self {
            parameters: Vec::new(),
            fitted_share: 0.6,
            prediction_s: 3.0,
            steps_per_parameter: 25,
        }
    }
}

/// A parameter before and after.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TunedParameter {
    /// Its name.
    pub name: String,
    /// What it was.
    pub before: f64,
    /// What fits best.
    pub after: f64,
    /// Whether that is more than a thousandfold away: the recording then says nothing about it.
    pub ran_off: bool,
}

impl TunedParameter {
    fn new(name: &str, before: f64, after: f64) -> Self {
        let moved = (after / before).abs();
        Self {
            name: name.to_owned(),
            before,
            after,
            // Also what began at zero, or ended there.
            ran_off: !(1.0 / FURTHEST..=FURTHEST).contains(&moved),
        }
    }
}

/// The outcome of a fit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TuneOutcome {
    /// The estimator.
    pub estimator: &'static str,
    /// Parameters, before and after.
    pub parameters: Vec<TunedParameter>,
    /// Parameters that were not fitted, for doubled or halved they change no innovation of the recording.
    pub without_effect: Vec<String>,
    /// With the parameters from before.
    pub before: NegativeLogLikelihood,
    /// With the fitted ones.
    pub after: NegativeLogLikelihood,
    /// Runs over the recording that it took.
    pub runs: usize,
    /// Whether the held-out part got less likely.
    pub over_fits: bool,
    /// Root mean square of the attitude error, deg, before and after, of an attitude estimator over a recording with
    /// a reference. The fit does not see it.
    pub reference_error_deg: Option<[f64; 2]>,
    /// Root mean square of the horizontal position error, m, before and after, of a navigation estimator over a recording with
    /// reference positions. The fit does not see them.
    pub reference_error_m: Option<[f64; 2]>,
}

impl TuneOutcome {
    /// Whether the error against the reference is larger with the fitted parameters than with those from before.
    #[must_use]
    pub fn is_worse_at_reference(&self) -> bool {
        let errors = [self.reference_error_deg, self.reference_error_m];
        let mut errors = errors.into_iter().flatten();
        errors.any(|[before, after]| after > before)
    }
}

/// An estimator to be fitted: its parameters with their values, and runs with other values.
struct Fit<'a> {
    estimator: &'static str,
    rows: &'a [Row],
    judge: Judge<'a>,
}

impl Fit<'_> {
    fn make(&self, asked: &TuneOptions) -> Result<TuneOutcome, EvaluationError> {
        let names = self.names(asked)?;
        let start: Vec<f64> = names.iter().filter_map(|name| self.value(name)).collect();
        let search = Search::new(&names, &start, self.judge)?;
        if search.before.innovations == 0 {
            return Err(EvaluationError::NoLikelihood {
                estimator: self.estimator,
            });
        }
        let probed = search.probe()?;
        let found = search.minimise(&probed, asked.steps_per_parameter)?;
        let [before, after] = [search.before, found.judgement].map(|j| j.likelihood);
        let named = |seen: bool| {
            let all = names.iter().zip(&start).zip(&found.values).zip(&probed);
            all.filter(move |(_, probe)| probe.is_some() == seen)
                .map(|(parameter, _)| parameter)
        };
        Ok(TuneOutcome {
            estimator: self.estimator,
            parameters: named(true)
                .map(|((name, before), after)| TunedParameter::new(name, *before, *after))
                .collect(),
            without_effect: named(false).map(|((name, _), _)| name.clone()).collect(),
            before,
            after,
            runs: search.runs(),
            over_fits: after.held_out > before.held_out + NOISE_OF_LIKELIHOOD,
            reference_error_deg: None,
            reference_error_m: None,
        })
    }

    /// The parameters to fit.
    fn names(&self, asked: &TuneOptions) -> Result<Vec<String>, EvaluationError> {
        let noises: Vec<String> = self
            .rows
            .iter()
            .filter(|row| is_noise(row.parameter.name))
            .filter(|row| number(row).is_some_and(|value| value > 0.0))
            .map(Row::name)
            .collect();
        if noises.is_empty() {
            return Err(EvaluationError::NothingToFit {
                estimator: self.estimator,
            });
        }
        if asked.parameters.is_empty() {
            return Ok(noises);
        }
        for name in &asked.parameters {
            let row = by_name::find(name, self.rows)?;
            if number(row).is_none_or(|value| value <= 0.0) {
                return Err(EvaluationError::BadValue {
                    name: name.clone(),
                    value: by_name::json(row.value).to_string(),
                    problem: "only numbers above 0 can be fitted; set one to start from".to_owned(),
                });
            }
        }
        Ok(asked.parameters.clone())
    }

    fn value(&self, name: &str) -> Option<f64> {
        number(self.rows.iter().find(|row| row.name() == name)?)
    }
}

fn is_noise(name: &str) -> bool {
    NOISES.iter().any(|end| name.ends_with(end)) && !NO_NOISES.iter().any(|no| name.contains(no))
}

/// The value, where it is a number.
fn number(row: &Row) -> Option<f64> {
    match row.value {
        Value::Number(number) => Some(number),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::{TunedParameter, is_noise};

    #[test]
    fn what_moves_a_thousandfold_ran_off() {
        let ran_off = |before, after| TunedParameter::new("noise", before, after).ran_off;
        assert!(!ran_off(0.1, 0.1) && !ran_off(0.1, 99.0) && !ran_off(0.1, 2e-4));
        assert!(ran_off(0.1, 101.0) && ran_off(3e-5, 5e-10) && ran_off(0.1, 0.0));
    }

    #[test]
    fn a_start_and_a_bound_are_no_noises() {
        assert!(is_noise("accelerometer_std") && is_noise("field_random_walk_ut"));
        assert!(!is_noise("initial_tilt_std") && !is_noise("maximum_attitude_std"));
        assert!(!is_noise("gate_timeout_s"));
    }
}
