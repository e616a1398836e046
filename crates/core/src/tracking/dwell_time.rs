//! How long a target stays in the first motion model, the straight one, learnt from its own track.
//!
//! Read first: Jilkov and Li, *Online Bayesian Estimation of Transition Probabilities for Markovian Jump Systems*, IEEE Transactions on
//! Signal Processing 52 (2004), the estimator by numerical integration; `docs/derivations/association.md`, section 2, (M3).
//!
//! Targets of one scene differ: one turns all the time, another goes straight for an hour. A buoy that has not moved for long is not
//! going to, and is known better for it.

use crate::restorable::{InvalidState, not_negative};
use crate::scalar::{Scalar, lit};

/// Mean times that are weighed, in multiples of the setting; their mean rate is its rate.
const MULTIPLES: [f64; 4] = [1.0 / 3.0, 4.0 / 3.0, 16.0 / 3.0, 64.0 / 3.0];

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
    /// Likelihoods of the mean times, in shares.
    weights: [T; MULTIPLES.len()],
    /// Probability of the first model before the last prediction, the seconds of that, and the probability of staying over them.
    before: T,
    dt: T,
    #[cfg_attr(feature = "serde", serde(default = "T::one"))]
    stay: T,
}

/// How the mean times are distributed among the targets of a scene (M4).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct DwellTimes<T> {
    /// Shares of the mean times.
    shares: [T; MULTIPLES.len()],
    /// Sums of the probabilities of the tracks that have ended.
    ended: [T; MULTIPLES.len()],
}

impl<T: Scalar> Default for DwellTimes<T> {
    fn default() -> Self {
        Self {
            shares: [lit(1.0 / MULTIPLES.len() as f64); MULTIPLES.len()],
            ended: [T::zero(); MULTIPLES.len()],
        }
    }
}

impl<T: Scalar> DwellTimes<T> {
    /// Takes in a track that has ended.
    pub(super) fn end(&mut self, track: &DwellTime<T>) {
        let its = track.posterior(self);
        self.ended.iter_mut().zip(its).for_each(|(sum, w)| *sum += w);
    }

    /// One step of expectation and maximisation over the tracks that are there (M4).
    pub(super) fn learn<'a>(&mut self, tracks: impl Iterator<Item = &'a DwellTime<T>>) {
        let mut sums = self.ended.map(|sum| sum + lit(ALPHA));
        for track in tracks {
            let its = track.posterior(self);
            sums.iter_mut().zip(its).for_each(|(sum, w)| *sum += w);
        }
        let total = sums.iter().fold(T::zero(), |a, b| a + *b);
        self.shares = sums.map(|sum| sum / total);
    }

    /// The numbers, for checks of a saved state.
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        self.shares.iter().chain(&self.ended)
    }
}
const ALPHA: f64 = 1.0;

impl<T: Scalar> Default for DwellTime<T> {
    fn default() -> Self {
        Self {
            weights: [lit(1.0 / MULTIPLES.len() as f64); MULTIPLES.len()],
            before: T::zero(),
            dt: T::zero(),
            stay: T::one(),
        }
    }
}

impl<T: Scalar> DwellTime<T> {
    /// Mean time in the model for a prediction over `dt` seconds from now on, where the setting is `usual_s`; `straight` is the
    /// probability of the model now.
    pub(super) fn predict(&mut self, usual_s: T, scene: &DwellTimes<T>, straight: T, dt: T) -> T {
        (self.before, self.dt) = (straight, dt);
        let each = self.each(usual_s);
        let weighted = each.iter().zip(self.posterior(scene));
        self.stay = weighted.fold(T::zero(), |sum, (stay, weight)| sum + *stay * weight);
        let stay = self.stay;
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
        let each = self.each(usual_s);
        let stay = self.stay;
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

    /// Probabilities of the mean times.
    fn posterior(&self, scene: &DwellTimes<T>) -> [T; MULTIPLES.len()] {
        let mut weights = self.weights;
        let mut total = T::zero();
        for (weight, share) in weights.iter_mut().zip(&scene.shares) {
            *weight *= *share;
            total += *weight;
        }
        if total > T::zero() { weights.map(|w| w / total) } else { scene.shares }
    }

    /// Whether a saved one can be continued from.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        let numbers = self.weights.iter().chain([&self.before, &self.dt, &self.stay]);
        not_negative("dwell time of a track", numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_pcg::Pcg64Mcg;

    /// The mean time at the end for a target that leaves the first of two models every so many seconds on average, stays in the other for
    /// 10 s, and shows each second which it is in with odds of 19 to 1.
    fn learnt(mean_s: f64, seed: u64) -> f64 {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let (usual_s, other_s, odds) = (40.0, 10.0, [0.95, 0.05]);
        let mut dwell = DwellTime::default();
        let (mut straight, mut is_straight, mut found) = (0.5, true, usual_s);
        for _ in 0..600 {
            let mean = if is_straight { mean_s } else { other_s };
            is_straight ^= rng.random::<f64>() < 1.0 - f64::exp(-1.0 / mean);
            found = dwell.predict(usual_s, straight, 1.0);
            let stay = f64::exp(-1.0 / found);
            let predicted = straight * stay + (1.0 - straight) * (1.0 - f64::exp(-1.0 / other_s));
            let shows_straight = is_straight == (rng.random::<f64>() < odds[0]);
            let [fits, not] = if shows_straight {
                odds
            } else {
                [odds[1], odds[0]]
            };
            let total = predicted * fits + (1.0 - predicted) * not;
            dwell.learn(usual_s, &[fits / total, not / total]);
            straight = predicted * fits / total;
        }
        found
    }

    #[test]
    fn a_target_that_turns_often_is_told_from_one_that_never_does() {
        for seed in 0..20 {
            let [often, seldom] = [15.0, 1e9].map(|mean_s| learnt(mean_s, seed));
            assert!(often < 40.0, "seed {seed}: {often} s");
            assert!(seldom > 80.0, "seed {seed}: {seldom} s");
        }
    }

    #[test]
    fn a_scan_that_tells_the_models_not_apart_changes_nothing() {
        let mut dwell = DwellTime::<f64>::default();
        let first = dwell.predict(40.0, 0.7, 2.0);
        for _ in 0..1000 {
            dwell.learn(40.0, &[1.0, 1.0, 1.0]);
            dwell.predict(40.0, 0.7, 2.0);
        }
        let last = dwell.predict(40.0, 0.7, 2.0);
        assert!((last - first).abs() < 1e-9 * first, "{first} {last}");
    }

    #[test]
    fn nothing_that_is_no_number_enters() {
        let mut dwell = DwellTime::<f64>::default();
        let usual = dwell.predict(40.0, 0.9, 2.0);
        for bad in [[f64::NAN, 1.0], [f64::INFINITY, 0.0], [1.0, -f64::INFINITY]] {
            dwell.learn(40.0, &bad);
            assert!(dwell.check().is_ok());
            assert!(dwell.predict(40.0, 0.9, 2.0) > 0.0);
        }
        assert!((dwell.predict(40.0, 0.9, 2.0) - usual).abs() < 1e-9);
        dwell.learn(40.0, &[1.0]);
        dwell.learn(40.0, &[]);
        for zero in [0.0, 1e-300, 1e300] {
            assert!(dwell.predict(40.0, 0.9, zero) > 0.0);
        }
    }
}
