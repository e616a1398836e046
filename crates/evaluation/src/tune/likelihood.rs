//! The likelihood of innovations, summed over the part of a recording that a fit sees and the part that is held out.

use nalgebra::{Matrix3, Vector3};
use northing_core::kalman::{Innovation, Outcome};
use northing_recording::Event;
use serde::Serialize;

/// What an outlier costs at most: its normalised square counts up to here.
const OUTLIER_NIS: f64 = 30.0;

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
    use super::*;

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
