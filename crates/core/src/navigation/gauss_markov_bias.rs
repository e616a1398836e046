//! First-order Gauss-Markov biases about a value at rest that hardly moves: offsets that come and go.
//!
//! *Read first:* `docs/derivations/error_state.md`, section 10 (E28-E30).
//!
//! Vibration that a sensor samples below twice its frequency returns as a slow offset: on a car with a cheap unit
//! 0.1 deg/s and 0.2 m/s^2 for some ten seconds while the engine holds a speed. A random walk wide enough for that
//! carries the last offset on through an outage, and its variance grows without bound. Here the bias relaxes to
//! its value at rest instead, which is averaged over a longer time, and its variance stays within what was seen.
//! Cost: 60 multiplications a catch-up.

use nalgebra::{SMatrix, Vector3};

use super::STATES;
use crate::scalar::{Scalar, lit};

/// The first-order Gauss-Markov bias of a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct GaussMarkovBias<T> {
    /// Standard deviation about the value at rest; zero: none, the bias only walks.
    pub(super) std: T,
    /// Correlation time, s.
    pub(super) time_s: T,
    /// Random walk of the value at rest, a square root of a second.
    pub(super) walk: T,
}

/// The value at rest of one sensor's bias.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct BiasAtRest<T: Scalar> {
    value: Vector3<T>,
    variance: Vector3<T>,
    /// Whether a step of the bias has left it unknown.
    has_stepped: bool,
}

impl<T: Scalar> BiasAtRest<T> {
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        self.value.iter().chain(&self.variance)
    }

    /// Known to these variances.
    pub(super) fn new(value: Vector3<T>, variance: Vector3<T>) -> Self {
        Self {
            value,
            variance,
            has_stepped: false,
        }
    }

    /// The bias has stepped: so has its value at rest, known to these variances.
    pub(super) fn shift(&mut self, step: &Vector3<T>, variances: &Vector3<T>) {
        self.value += step;
        self.variance += variances;
        self.has_stepped |= variances.max() > T::zero();
    }

    /// Lets `dt` seconds pass for the bias whose errors are the states from `first` on.
    pub(super) fn relax<const C: usize>(
        &mut self,
        settings: &GaussMarkovBias<T>,
        dt: T,
        (first, bias): (usize, &mut Vector3<T>),
        covariance: &mut SMatrix<T, STATES, STATES>,
        cross: &mut SMatrix<T, STATES, C>,
    ) {
        if settings.std <= T::zero() {
            return;
        }
        let stationary = settings.std * settings.std;
        let share = dt / settings.time_s;
        let kept = (-share).exp();
        for i in 0..3 {
            let state = first + i;
            // The mean of many independent offsets (E29): one a correlation time.
            let one = covariance[(state, state)].max(T::zero()) + stationary;
            let gain = self.variance[i] / (self.variance[i] + one) * share.min(lit(1.0));
            // Behind a step it is known no worse than by the offset of now, whose deviation from it is stationary.
            let gain = if self.has_stepped {
                gain.max(T::one() - one / self.variance[i].max(one))
            } else {
                gain
            };
            let rest = self.value[i] + (bias[i] - self.value[i]) * gain;
            let left = self.variance[i] * (T::one() - gain) + settings.walk * settings.walk * dt;
            (self.value[i], self.variance[i]) = (rest, left);
            // b <- r + (b - r) e^(-dt/tau) (E28), and what keeps its variance (E30).
            bias[i] = rest + (bias[i] - rest) * kept;
            covariance.row_mut(state).scale_mut(kept);
            covariance.column_mut(state).scale_mut(kept);
            cross.row_mut(state).scale_mut(kept);
            covariance[(state, state)] += (stationary + left) * (T::one() - kept * kept);
        }
    }
}
