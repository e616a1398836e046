//! How long a target stays in the first motion model, the straight one, learnt from its own track.
//!
//! Read first: Jilkov and Li, *Online Bayesian Estimation of Transition Probabilities for Markovian Jump Systems*, IEEE Transactions on
//! Signal Processing 52 (2004), the estimator by numerical integration; `docs/derivations/association.md`, section 2, (M3).
//!
//! Targets of one scene differ: one turns all the time, another goes straight for an hour. A buoy that has not moved for long is not
//! going to, and is known better for it.

use crate::restorable::{InvalidState, not_negative};
use crate::scalar::{Scalar, lit};

/// Mean times that are weighed, in multiples of the setting.
const MULTIPLES: [f64; 4] = [0.25, 1.0, 4.0, 16.0];

/// What a track shows of how long its target stays in the first model.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct DwellTime<T> {
    /// Probabilities of the mean times.
    weights: [T; MULTIPLES.len()],
    /// Probability of the first model before the last prediction, and the seconds of that.
    before: T,
    dt: T,
}

impl<T: Scalar> Default for DwellTime<T> {
    fn default() -> Self {
        Self {
            weights: [lit(1.0 / MULTIPLES.len() as f64); MULTIPLES.len()],
            before: T::zero(),
            dt: T::zero(),
        }
    }
}

impl<T: Scalar> DwellTime<T> {
    /// Mean time in the model for a prediction over `dt` seconds from now on, where the setting is `usual_s`; `straight` is the
    /// probability of the model now.
    pub(super) fn predict(&mut self, usual_s: T, straight: T, dt: T) -> T {
        (self.before, self.dt) = (straight, dt);
        let stay = self.stay(usual_s);
        if dt > T::zero() && stay < T::one() && stay > T::zero() {
            -dt / stay.ln()
        } else {
            usual_s
        }
    }

    /// Weighs in a scan (M3): how much likelier it made each model, of which the first is the straight one.
    pub(super) fn learn(&mut self, usual_s: T, likelier: &[T]) {
        let [first, others @ ..] = likelier else {
            return;
        };
        let count = lit::<T>(others.len().max(1) as f64);
        let others = others.iter().fold(T::zero(), |sum, x| sum + *x) / count;
        let favours = self.before * (*first - others);
        let (stay, each) = (self.stay(usual_s), self.each(usual_s));
        let mut total = T::zero();
        for (weight, its) in self.weights.iter_mut().zip(each) {
            *weight *= (T::one() + (its - stay) * favours).max(T::zero());
            total += *weight;
        }
        if total > T::zero() && total.is_finite() {
            self.weights.iter_mut().for_each(|weight| *weight /= total);
        } else {
            *self = Self::default();
        }
    }

    /// Probabilities of staying over the last prediction, one for each mean time.
    fn each(&self, usual_s: T) -> [T; MULTIPLES.len()] {
        MULTIPLES.map(|multiple| (-self.dt / (usual_s * lit(multiple))).exp())
    }

    fn stay(&self, usual_s: T) -> T {
        let each = self.each(usual_s).into_iter().zip(&self.weights);
        each.fold(T::zero(), |sum, (stay, weight)| sum + stay * *weight)
    }

    /// Whether a saved one can be continued from.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        let numbers = self.weights.iter().chain([&self.before, &self.dt]);
        not_negative("dwell time of a track", numbers)
    }
}
