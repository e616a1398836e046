//! How far it turned while the gyroscope was not seen: a Gauss-Markov model of the rate, learnt from the samples.
//!
//! The angular rate of a device is taken for a first-order Gauss-Markov process with the mean square and the rate of change
//! that the samples had before (F3). Its integral over a hole has closed forms: with the rate known before it only
//! (F4), and with that on both sides (F5), where short holes give the trapezoidal rule.

use nalgebra::Vector3;

use crate::scalar::{Scalar, greater, lesser, lit};

/// Memory of the motion just before, and of the whole, s. The larger mean square of the two counts.
const MEMORY_S: f64 = 10.0;
const LONG_MEMORY_S: f64 = 600.0;
/// The prior counts as much as so many seconds of samples, and has this correlation time, s.
const PRIOR_S: f64 = 0.5;
const PRIOR_TIME_S: f64 = 0.2;

/// What is known of the rate as a process.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct UnseenRotation<T: Scalar> {
    /// Mean squares of the rate and of its derivative, of the motion just before and of the whole, by axis.
    recent: [Vector3<T>; 2],
    whole: [Vector3<T>; 2],
    seen_s: T,
}

/// A turn that was not measured.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unseen<T> {
    /// What is left of a rate, or of the sum of both rates at the ends: times it, it is the turn to be expected, s.
    pub held_s: T,
    /// Variance of the turn about each axis, rad^2.
    pub variance: T,
}

impl<T: Scalar> UnseenRotation<T> {
    /// Before the first sample: an attitude would drift by this random walk, rad/sqrt(s).
    pub fn new(angle_random_walk: T) -> Self {
        // Over long times the variance grows by 2 s^2 tau a second (F4).
        let variance = angle_random_walk * angle_random_walk / lit(2.0 * PRIOR_TIME_S);
        let derivative = variance * lit(2.0 / (PRIOR_TIME_S * PRIOR_TIME_S));
        let prior = [Vector3::repeat(variance), Vector3::repeat(derivative)];
        Self {
            recent: prior,
            whole: prior,
            seen_s: T::zero(),
        }
    }

    /// Learns from two samples (rad/s) that follow each other by `dt` (s).
    #[inline]
    pub fn learn(&mut self, last: &Vector3<T>, rate: &Vector3<T>, dt: T) {
        if dt <= T::zero() {
            return;
        }
        let derivative = (rate - last) * (T::one() / dt);
        let squares = [
            rate.component_mul(rate),
            derivative.component_mul(&derivative),
        ];
        self.seen_s = lesser(self.seen_s + dt, lit(LONG_MEMORY_S));
        let known = self.seen_s + lit(PRIOR_S);
        let short = dt / greater(lesser(known, lit(MEMORY_S)), dt);
        let long = dt / greater(known, dt);
        for (i, square) in squares.iter().enumerate() {
            self.recent[i] += (square - self.recent[i]) * short;
            self.whole[i] += (square - self.whole[i]) * long;
        }
    }

    /// Mean square (rad/s)^2 of the liveliest axis, no smaller than that of a rate that is known, and correlation time, s.
    fn process(&self, known: T) -> (T, T) {
        let [squares, derivatives] = if self.recent[0].max() >= self.whole[0].max() {
            &self.recent
        } else {
            &self.whole
        };
        let learnt = squares.max();
        let tiny = T::default_epsilon();
        let time2 = (learnt + learnt + tiny) / (derivatives.max() + tiny);
        (learnt.max(known), time2.sqrt())
    }

    /// The turn in a time (s) since the rate was last seen, about the liveliest axis (F4).
    pub fn since(&self, rate: &Vector3<T>, time: T) -> Unseen<T> {
        let (variance, tau) = self.process(rate.component_mul(rate).max());
        let x = time / tau;
        let decay = (-x).exp();
        let shape = if x < lit(0.05) {
            x * x * x * lit(2.0 / 3.0)
        } else {
            x + x - lit(3.0) + decay * lit(4.0) - decay * decay
        };
        Unseen {
            held_s: tau * (T::one() - decay),
            variance: variance * tau * tau * shape.max(T::zero()),
        }
    }

    /// The turn between two samples that are a time (s) apart (F5).
    pub fn between(&self, before: &Vector3<T>, after: &Vector3<T>, time: T) -> Unseen<T> {
        let known = before.component_mul(before).max();
        let known = known.max(after.component_mul(after).max());
        let (variance, tau) = self.process(known);
        let half = time / (tau + tau);
        let tanh = half.tanh();
        let shape = if half < lit(0.05) {
            half * half * half * lit(1.0 / 3.0)
        } else {
            half - tanh
        };
        let four = variance * tau * tau * lit(4.0);
        Unseen {
            held_s: tau * tanh,
            variance: four * shape.max(T::zero()),
        }
    }

    /// The numbers, for checks of a saved state.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = &T> {
        let vectors = self.recent.iter().chain(&self.whole).flatten();
        vectors.chain([&self.seen_s])
    }
}

#[cfg(test)]
mod tests;
