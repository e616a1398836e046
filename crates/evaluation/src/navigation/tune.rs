//! Maximum-likelihood fit of noise parameters of a navigation estimator to a recording: the innovations that it makes
//! shall be as likely as possible.
//!
//! The likelihood of one innovation is Gaussian with the covariance that the filter states, so neither small
//! residuals nor large covariances win by themselves. The fit sees the first part of the recording alone; the
//! rest is held out, and a fit that makes it less likely has learnt the recording instead of the sensors. The
//! search goes along one parameter after the other in factors, which halve (in logarithm) when no step helps.

use nalgebra::{Matrix3, Vector3};
use northing_core::kalman::{Innovation, Outcome};
use northing_core::parameters::Value;
use northing_recording::{Event, WorldFrame};
use rayon::prelude::*;
use serde::Serialize;

use super::kinds::NavigationKind;
use super::navigator::AidKind;
use super::observer::NavigationObserver;
use super::options::NavigationOptions;
use super::parameters::NavigationParameters;
use super::runner::run_navigation;
use crate::by_name::{self, Row};
use crate::error::EvaluationError;

/// Ends of the names of parameters that are noises.
const NOISES: [&str; 4] = ["_noise_density", "_random_walk", "_std", "_std_ut"];
/// What an outlier costs at most: its normalised square counts up to here.
const OUTLIER_NIS: f64 = 30.0;
/// First factor of a step, and the one below which the search ends.
const STEPS: [f64; 2] = [4.0, 1.15];
/// A parameter that moves by more than this factor is not seen by the recording.
const FURTHEST: f64 = 1e3;
/// A held-out part that is less likely by so much an innovation speaks of over-fitting.
const NOISE_OF_LIKELIHOOD: f64 = 0.005;

/// What a fit is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct TuneOptions {
    /// Parameters to fit; empty: every noise of the estimator that is above zero.
    pub parameters: Vec<String>,
    /// Share of the recording that the fit sees, default 0.6; the rest is held out.
    pub fitted_share: f64,
    /// Passes over all parameters at most, default 12.
    pub passes: usize,
}

impl Default for TuneOptions {
    fn default() -> Self {
        Self {
            parameters: Vec::new(),
            fitted_share: 0.6,
            passes: 12,
        }
    }
}

/// Mean negative logarithm of the likelihood of an innovation: lower is better.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NegativeLogLikelihood {
    /// Over the part that the fit sees.
    pub fitted: f64,
    /// Over the part that is held out.
    pub held_out: f64,
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
    pub estimator: NavigationKind,
    /// Parameters, before and after.
    pub parameters: Vec<TunedParameter>,
    /// With the parameters from before.
    pub before: NegativeLogLikelihood,
    /// With the fitted ones.
    pub after: NegativeLogLikelihood,
    /// Runs over the recording that it took.
    pub runs: usize,
    /// Whether the held-out part got less likely.
    pub over_fits: bool,
}

/// Fits parameters of `options` to a recording's events.
///
/// `on_run` is told of each run.
///
/// # Errors
/// A parameter that the estimator does not have, or a run that cannot be made.
pub fn tune(
    events: &[Event],
    world: WorldFrame,
    options: &NavigationOptions,
    asked: &TuneOptions,
    on_run: &(dyn Fn() + Sync),
) -> Result<TuneOutcome, EvaluationError> {
    let names = names(options, asked)?;
    let task = Task {
        events,
        world,
        options,
        split_ns: split(events, asked.fitted_share),
        on_run,
    };
    let start: Vec<f64> = names
        .iter()
        .map(|name| value_of(&options.parameters, options.estimator, name))
        .collect();
    let before = task.judge(&names, &start)?;
    let mut search = Search {
        values: start.clone(),
        best: before,
        runs: 1,
    };
    let mut factor = STEPS[0];
    for _ in 0..asked.passes {
        if factor < STEPS[1] {
            break;
        }
        if !search.pass(&task, &names, factor)? {
            factor = factor.sqrt();
        }
    }
    let parameters = names.iter().zip(start).zip(&search.values);
    Ok(TuneOutcome {
        estimator: options.estimator,
        parameters: parameters
            .map(|((name, before), after)| TunedParameter::new(name, before, *after))
            .collect(),
        before,
        after: search.best,
        runs: search.runs,
        over_fits: search.best.held_out > before.held_out + NOISE_OF_LIKELIHOOD,
    })
}

/// The parameters to fit.
fn names(options: &NavigationOptions, asked: &TuneOptions) -> Result<Vec<String>, EvaluationError> {
    let known = options.parameters.rows(options.estimator);
    if known.is_empty() {
        return Err(EvaluationError::NothingToFit {
            estimator: options.estimator.name(),
        });
    }
    let is_noise = |name: &str| NOISES.iter().any(|end| name.ends_with(end));
    let noises: Vec<String> = known
        .iter()
        .filter(|row| is_noise(row.parameter.name))
        .filter(|row| number(row).is_some_and(|value| value > 0.0))
        .map(Row::name)
        .collect();
    if asked.parameters.is_empty() {
        return Ok(noises);
    }
    for name in &asked.parameters {
        let row = by_name::find(name, &known)?;
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

fn value_of(parameters: &NavigationParameters, kind: NavigationKind, name: &str) -> f64 {
    let rows = parameters.rows(kind);
    let row = rows.iter().find(|row| row.parameter.name == name);
    row.and_then(number).unwrap_or(f64::NAN)
}

/// The value, where it is a number.
fn number(row: &Row) -> Option<f64> {
    match row.value {
        Value::Number(number) => Some(number),
        _ => None,
    }
}

/// The time at which the held-out part begins.
fn split(events: &[Event], share: f64) -> i64 {
    let first = events.first().map_or(0, |event| event.time_ns);
    let last = events.last().map_or(0, |event| event.time_ns);
    first.saturating_add((last.saturating_sub(first) as f64 * share) as i64)
}

/// What stays the same over all runs.
struct Task<'a> {
    events: &'a [Event],
    world: WorldFrame,
    options: &'a NavigationOptions,
    split_ns: i64,
    on_run: &'a (dyn Fn() + Sync),
}

impl Task<'_> {
    /// Negative log-likelihood of the innovations with these values.
    fn judge(
        &self,
        names: &[String],
        values: &[f64],
    ) -> Result<NegativeLogLikelihood, EvaluationError> {
        let mut options = self.options.clone();
        for (name, value) in names.iter().zip(values) {
            let setting = format!("{name}={value:e}");
            options.parameters.set(options.estimator, &setting)?;
        }
        let mut observer = Likelihood {
            split_ns: self.split_ns,
            sums: [0.0; 2],
            counts: [0; 2],
        };
        let events = self
            .events
            .iter()
            .map(|event| Ok::<_, std::convert::Infallible>(*event));
        run_navigation(events, "", self.world, &options, &mut observer)?;
        (self.on_run)();
        let mean = |part: usize| observer.sums[part] / observer.counts[part].max(1) as f64;
        Ok(NegativeLogLikelihood {
            fitted: mean(0),
            held_out: mean(1),
        })
    }
}

/// Where the search stands.
struct Search {
    values: Vec<f64>,
    best: NegativeLogLikelihood,
    runs: usize,
}

impl Search {
    /// Tries each parameter up and down by a factor; whether anything helped.
    fn pass(
        &mut self,
        task: &Task<'_>,
        names: &[String],
        factor: f64,
    ) -> Result<bool, EvaluationError> {
        let mut helped = false;
        for i in 0..names.len() {
            let candidates = [factor, 1.0 / factor].map(|factor| {
                let mut values = self.values.clone();
                values[i] *= factor;
                values
            });
            let judged: Vec<_> = candidates
                .into_par_iter()
                // Beyond what a parameter can be, there is nothing to find.
                .map(|values| task.judge(names, &values).ok().map(|j| (j, values)))
                .collect();
            self.runs += judged.len();
            let found = judged
                .into_iter()
                .flatten()
                .min_by(|a, b| a.0.fitted.total_cmp(&b.0.fitted));
            if let Some((judgement, values)) = found
                && judgement.fitted < self.best.fitted
            {
                (self.best, self.values, helped) = (judgement, values, true);
            }
        }
        Ok(helped)
    }
}

/// Sums the likelihood of innovations while a run goes on.
struct Likelihood {
    split_ns: i64,
    sums: [f64; 2],
    counts: [u64; 2],
}

impl NavigationObserver for Likelihood {
    fn interval_ns(&self) -> i64 {
        i64::MAX
    }

    fn innovation(&mut self, time_ns: i64, aid: AidKind, innovation: &Innovation<f64>) {
        // Constraints that the estimator makes itself are no measurements.
        if matches!(aid, AidKind::ZeroVelocity | AidKind::NonHolonomic) {
            return;
        }
        if let Some(value) = negative_log_likelihood(innovation) {
            let part = usize::from(time_ns >= self.split_ns);
            self.sums[part] += value;
            self.counts[part] += 1;
        }
    }
}

/// Negative logarithm of the likelihood of an innovation, an outlier cut short.
fn negative_log_likelihood(innovation: &Innovation<f64>) -> Option<f64> {
    if matches!(innovation.outcome, Outcome::Skipped(_)) {
        return None;
    }
    let n = usize::from(innovation.degrees_of_freedom);
    let determinant = leading_determinant(&innovation.covariance, n)?;
    let value = 0.5 * (innovation.nis.min(OUTLIER_NIS) + determinant.ln());
    value.is_finite().then_some(value)
}

/// Determinant of the first `n` rows and columns, if positive.
fn leading_determinant(s: &Matrix3<f64>, n: usize) -> Option<f64> {
    let mut padded = Matrix3::from_diagonal(&Vector3::repeat(1.0));
    for row in 0..n.min(3) {
        for column in 0..n.min(3) {
            padded[(row, column)] = s[(row, column)];
        }
    }
    Some(padded.determinant()).filter(|d| n > 0 && *d > 0.0)
}

#[cfg(test)]
mod tests {
    use northing_recording::{GnssPosition, GnssQuality, Sample};
    use northing_simulation::random::{standard_normal, stream};

    use super::*;

    /// A ship on a straight course, positions of 4 m, no log.
    fn events(seed: u64, std_m: f64) -> Vec<Event> {
        let mut random = stream(seed, "tune");
        let at = |k: u32, east: f64, north: f64| Event {
            time_ns: i64::from(k) * 1_000_000_000,
            sample: Sample::GnssPosition(GnssPosition {
                latitude_rad: 0.9 + (5.0 * f64::from(k) + north) / 6.37e6,
                longitude_rad: 0.1 + east / 4e6,
                height_m: Some(0.0),
                std_m: Some([std_m; 3]),
                hdop: None,
                satellites: None,
                quality: GnssQuality::Autonomous,
            }),
        };
        (0..900)
            .map(|k| {
                at(
                    k,
                    4.0 * standard_normal(&mut random),
                    4.0 * standard_normal(&mut random),
                )
            })
            .collect()
    }

    #[test]
    fn a_walk_that_is_set_far_too_large_comes_down_and_the_held_out_part_agrees() {
        let mut options = NavigationOptions {
            estimator: NavigationKind::DeadReckoning,
            ..NavigationOptions::default()
        };
        options.parameters.dead_reckoning.velocity_random_walk = 3.0;
        let asked = TuneOptions {
            parameters: vec!["velocity_random_walk".to_owned()],
            ..TuneOptions::default()
        };
        let outcome = tune(&events(7, 4.0), WorldFrame::Ned, &options, &asked, &|| ()).unwrap();
        let [walk] = &outcome.parameters[..] else {
            panic!("one parameter");
        };
        assert!(walk.after < 0.3, "{walk:?}");
        assert!(outcome.after.fitted < outcome.before.fitted - 0.1);
        assert!(outcome.after.held_out < outcome.before.held_out - 0.1);
        assert!(!outcome.over_fits && outcome.runs > 4);
    }

    #[test]
    fn what_moves_a_thousandfold_ran_off() {
        let ran_off = |before, after| TunedParameter::new("noise", before, after).ran_off;
        assert!(!ran_off(0.1, 0.1) && !ran_off(0.1, 99.0) && !ran_off(0.1, 2e-4));
        assert!(ran_off(0.1, 101.0) && ran_off(3e-5, 5e-10) && ran_off(0.1, 0.0));
    }

    #[test]
    fn what_cannot_be_fitted_is_refused() {
        let mut options = NavigationOptions {
            estimator: NavigationKind::DeadReckoning,
            ..NavigationOptions::default()
        };
        let asked = TuneOptions {
            parameters: vec!["colour".to_owned()],
            ..TuneOptions::default()
        };
        let all = events(1, 4.0);
        let tuned = tune(&all, WorldFrame::Ned, &options, &asked, &|| ());
        let message = tuned.unwrap_err().to_string();
        assert!(message.contains("`colour`") && message.contains("current_random_walk"));
        options.estimator = NavigationKind::AxisFilters;
        let asked = TuneOptions {
            parameters: vec!["euler_rates".to_owned()],
            ..TuneOptions::default()
        };
        let tuned = tune(&all, WorldFrame::Ned, &options, &asked, &|| ());
        assert!(
            tuned
                .unwrap_err()
                .to_string()
                .contains("only numbers above 0")
        );
    }

    #[test]
    fn the_likelihood_is_that_of_a_gaussian() {
        let mut covariance = Matrix3::zeros();
        (covariance.m11, covariance.m22) = (4.0, 9.0);
        let innovation = Innovation {
            residual: Vector3::new(2.0, 3.0, 0.0),
            covariance,
            nis: 2.0,
            degrees_of_freedom: 2,
            outcome: Outcome::Fused,
        };
        let expected = 0.5 * (2.0 + 36.0_f64.ln());
        approx::assert_relative_eq!(negative_log_likelihood(&innovation).unwrap(), expected);
    }
}
