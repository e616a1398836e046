//! An error that drifts slowly: a first-order Gauss-Markov process.

use nalgebra::Vector3;

use crate::random::{Stream, normal_vector, stream};
use crate::sensors::Sampling;

/// The error in units of its standard deviation, from one report to the next.
#[derive(Debug, Clone)]
pub(super) struct SlowError {
    value: Vector3<f64>,
    /// Correlation of the error from one report to the next.
    keeps: f64,
    noise: Stream,
}

impl SlowError {
    pub(super) fn new(seed: u64, name: &str, sampling: &Sampling, correlation_time_s: f64) -> Self {
        let mut noise = stream(seed, name);
        Self {
            value: normal_vector(&mut noise, 1.0),
            keeps: nalgebra::ComplexField::exp(-sampling.interval_s() / correlation_time_s),
            noise,
        }
    }

    /// The error of this report.
    pub(super) fn next(&mut self) -> Vector3<f64> {
        let fresh = (1.0 - self.keeps * self.keeps).sqrt();
        let next = self.value * self.keeps + normal_vector(&mut self.noise, fresh);
        std::mem::replace(&mut self.value, next)
    }
}
