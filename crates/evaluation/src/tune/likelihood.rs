//! The likelihood of innovations, summed over the part of a recording that a fit sees and the part that is held out.

use nalgebra::{Matrix3, Vector3};
use northing_core::kalman::{Innovation, Outcome};
use northing_recording::Event;
use serde::Serialize;

/// Degrees of freedom of Student's t: tails that an outlier may come from, and a bulk as good as normal. (A normal
/// likelihood that is cut off at some NIS is none: it gains by a covariance so small that everything is an outlier.)
const FREEDOM: f64 = 10.0;

/// Mean negative logarithm of the likelihood of an innovation: lower is better.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct NegativeLogLikelihood {
    /// Over the part that the fit sees.
    pub fitted: f64,
    /// Over the part that is held out.
    pub held_out: f64,
}

/// What one run over the recording says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Judgement {
    pub(super) likelihood: NegativeLogLikelihood,
    /// Innovations of the part that the fit sees.
    pub(super) innovations: u64,
}

/// Sums while a run goes on.
#[derive(Debug)]
pub(super) struct Likelihood {
    split_ns: i64,
    sums: [f64; 2],
    counts: [u64; 2],
}

impl Likelihood {
    /// The part that begins at `split_ns` is held out.
    pub(super) fn new(split_ns: i64) -> Self {
        Self {
            split_ns,
            sums: [0.0; 2],
            counts: [0; 2],
        }
    }

    pub(super) fn add(&mut self, time_ns: i64, innovation: &Innovation<f64>) {
        if let Some(value) = negative_log_likelihood(innovation) {
            let part = usize::from(time_ns >= self.split_ns);
            self.sums[part] += value;
            self.counts[part] += 1;
        }
    }

    /// Both together.
    pub(super) fn with(mut self, other: &Self) -> Self {
        for part in 0..2 {
            self.sums[part] += other.sums[part];
            self.counts[part] += other.counts[part];
        }
        self
    }

    pub(super) fn judgement(&self) -> Judgement {
        let mean = |part: usize| self.sums[part] / self.counts[part].max(1) as f64;
        Judgement {
            likelihood: NegativeLogLikelihood {
                fitted: mean(0),
                held_out: mean(1),
            },
            innovations: self.counts[0],
        }
    }
}

/// The time at which the held-out part begins.
pub(super) fn split_ns(events: &[Event], share: f64) -> i64 {
    let first = events.first().map_or(0, |event| event.time_ns);
    let last = events.last().map_or(0, |event| event.time_ns);
    first.saturating_add((last.saturating_sub(first) as f64 * share) as i64)
}

/// Negative logarithm of the likelihood of an innovation (multivariate t; Lange, Little & Taylor 1989), without the terms
/// that no parameter changes.
fn negative_log_likelihood(innovation: &Innovation<f64>) -> Option<f64> {
    if matches!(innovation.outcome, Outcome::Skipped(_)) {
        return None;
    }
    let n = usize::from(innovation.degrees_of_freedom);
    let determinant = leading_determinant(&innovation.covariance, n)?;
    let tails = (FREEDOM + n as f64) * (innovation.nis / FREEDOM).ln_1p();
    let value = 0.5 * (tails + determinant.ln());
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
    use super::*;

    fn innovation(nis: f64, covariance: Matrix3<f64>) -> Innovation<f64> {
        Innovation {
            residual: Vector3::new(2.0, 3.0, 0.0),
            covariance,
            nis,
            degrees_of_freedom: 2,
            outcome: Outcome::Fused,
        }
    }

    #[test]
    fn the_likelihood_is_that_of_students_t() {
        let mut covariance = Matrix3::zeros();
        (covariance.m11, covariance.m22) = (4.0, 9.0);
        let value = negative_log_likelihood(&innovation(2.0, covariance)).unwrap();
        approx::assert_relative_eq!(value, 0.5 * (12.0 * 1.2_f64.ln() + 36.0_f64.ln()));
    }

    /// Residuals of one size in all directions: the covariance that fits best is theirs, an outlier or not.
    #[test]
    fn the_covariance_that_fits_best_is_that_of_the_bulk() {
        let cost = |variance: f64| {
            let of = |square: f64| {
                let covariance = Matrix3::identity() * variance;
                negative_log_likelihood(&innovation(square / variance, covariance)).unwrap()
            };
            // Chi-square of two degrees of freedom, by its quantiles, and one outlier of 100 sigma.
            let quantile = |k: i32| -2.0 * (1.0 - (f64::from(k) + 0.5) / 500.0).ln();
            (0..500).map(|k| of(quantile(k))).sum::<f64>() + of(1e4)
        };
        let variances = (1..400).map(|k| f64::from(k) * 0.01);
        let best = variances
            .min_by(|a, b| cost(*a).total_cmp(&cost(*b)))
            .unwrap();
        assert!((0.85..1.05).contains(&best), "{best}");
    }
}
