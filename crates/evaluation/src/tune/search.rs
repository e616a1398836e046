//! The search for the values that fit best: the simplex of Nelder and Mead (1965) over the logarithms of the parameters.

use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use argmin::core::{CostFunction, Executor, State as _};
use argmin::solver::neldermead::NelderMead;
use rayon::prelude::*;

use super::likelihood::Judgement;
use crate::error::EvaluationError;

/// A run over the recording with these parameters.
pub(super) type Judge<'a> =
    &'a (dyn Fn(&[(&str, f64)]) -> Result<Judgement, EvaluationError> + Sync);

/// First step of each parameter: a factor of two, as logarithm.
const FIRST_STEP: f64 = std::f64::consts::LN_2;
/// The search ends when the likelihoods in the simplex scatter by less, an innovation.
const SCATTER: f64 = 1e-5;

/// A search that is ready.
pub(super) struct Search<'a> {
    names: Vec<&'a str>,
    start: &'a [f64],
    judge: Judge<'a>,
    /// With the values at the start.
    pub(super) before: Judgement,
    runs: AtomicUsize,
}

/// The best values, and what they are worth.
pub(super) struct Found {
    pub(super) values: Vec<f64>,
    pub(super) judgement: Judgement,
}

impl<'a> Search<'a> {
    pub(super) fn new(
        names: &'a [String],
        start: &'a [f64],
        judge: Judge<'a>,
    ) -> Result<Self, EvaluationError> {
        let mut search = Self {
            names: names.iter().map(String::as_str).collect(),
            start,
            judge,
            before: Judgement {
                likelihood: super::NegativeLogLikelihood {
                    fitted: 0.0,
                    held_out: 0.0,
                },
                innovations: 0,
            },
            runs: AtomicUsize::new(0),
        };
        search.before = search.run(start)?;
        Ok(search)
    }

    /// Runs over the recording so far.
    pub(super) fn runs(&self) -> usize {
        self.runs.load(Ordering::Relaxed)
    }

    fn run(&self, values: &[f64]) -> Result<Judgement, EvaluationError> {
        self.runs.fetch_add(1, Ordering::Relaxed);
        let named: Vec<_> = self
            .names
            .iter()
            .copied()
            .zip(values.iter().copied())
            .collect();
        (self.judge)(&named)
    }

    /// For each parameter the better of its first two steps, as logarithm; `None` where neither makes a difference.
    pub(super) fn probe(&self) -> Result<Vec<Option<f64>>, EvaluationError> {
        let stepped = |i: usize, step: f64| {
            let mut values = self.start.to_vec();
            values[i] *= step.exp();
            match self.run(&values) {
                Err(EvaluationError::Interrupted) => Err(EvaluationError::Interrupted),
                // Beyond what a parameter can be, there is nothing to find.
                judged => Ok(judged.map_or(f64::INFINITY, |j| j.likelihood.fitted)),
            }
        };
        let better = |i: usize| {
            let [up, down] = [stepped(i, FIRST_STEP)?, stepped(i, -FIRST_STEP)?];
            let before = self.before.likelihood.fitted;
            let alike = |cost: f64| cost.total_cmp(&before).is_eq() || cost.is_infinite();
            Ok((!(alike(up) && alike(down))).then_some(match up <= down {
                true => FIRST_STEP,
                false => -FIRST_STEP,
            }))
        };
        (0..self.start.len()).into_par_iter().map(better).collect()
    }

    /// The smallest cost over the parameters that make a difference.
    pub(super) fn minimise(
        &self,
        probed: &[Option<f64>],
        steps_per_parameter: u64,
    ) -> Result<Found, EvaluationError> {
        let seen: Vec<(usize, f64)> = (0..)
            .zip(probed)
            .filter_map(|(i, p)| Some((i, (*p)?)))
            .collect();
        let problem = Problem {
            search: self,
            seen: seen.iter().map(|(i, _)| *i).collect(),
            best: Mutex::new(Found {
                values: self.start.to_vec(),
                judgement: self.before,
            }),
            stopped: Mutex::new(None),
        };
        if !seen.is_empty() {
            let n = seen.len();
            let corner = |k: usize| {
                (0..n)
                    .map(|i| if i + 1 == k { seen[i].1 } else { 0.0 })
                    .collect()
            };
            let simplex: Vec<Vec<f64>> = (0..=n).map(corner).collect();
            let solver = NelderMead::new(simplex).with_sd_tolerance(SCATTER);
            let ended = solver.and_then(|solver| {
                Executor::new(&problem, solver)
                    .configure(|state| state.max_iters(steps_per_parameter * n as u64))
                    .run()
            });
            debug_assert!(ended.is_ok_and(|ended| ended.state().get_iter() > 0));
        }
        if let Some(error) = problem.stopped.into_inner().ok().flatten() {
            return Err(error);
        }
        problem
            .best
            .into_inner()
            .map_err(|_| EvaluationError::Interrupted)
    }
}

/// The cost that is minimised: of steps of the parameters seen, as logarithms.
struct Problem<'a> {
    search: &'a Search<'a>,
    seen: Vec<usize>,
    best: Mutex<Found>,
    /// Why the rest of the search need not run any more.
    stopped: Mutex<Option<EvaluationError>>,
}

impl CostFunction for &Problem<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    /// Never an error: what cannot be run is infinitely bad.
    fn cost(&self, steps: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        let Ok(mut stopped) = self.stopped.lock() else {
            return Ok(f64::INFINITY);
        };
        if stopped.is_some() {
            return Ok(f64::INFINITY);
        }
        let mut values = self.search.start.to_vec();
        for (i, step) in self.seen.iter().zip(steps) {
            values[*i] *= step.exp();
        }
        let judgement = match self.search.run(&values) {
            Ok(judgement) => judgement,
            Err(error) => {
                if matches!(error, EvaluationError::Interrupted) {
                    *stopped = Some(error);
                }
                return Ok(f64::INFINITY);
            }
        };
        let cost = judgement.likelihood.fitted;
        if let Ok(mut best) = self.best.lock()
            && cost < best.judgement.likelihood.fitted
        {
            *best = Found { values, judgement };
        }
        Ok(cost)
    }
}
