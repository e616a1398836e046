//! How long a target stays in the first motion model, the straight one, learnt from its own track.
//!
//! Read first: Jilkov and Li, *Online Bayesian Estimation of Transition Probabilities for Markovian Jump Systems*, IEEE Transactions on
//! Signal Processing 52 (2004), the estimator by numerical integration; `docs/derivations/association.md`, section 2, (M3).
//!
//! Targets of one scene differ: one turns all the time, another goes straight for an hour. A buoy that has not moved for long is not
//! going to, and is known better for it. How many of either kind a scene has is learnt from all its tracks (M4): a new one among moored
//! boats is likely to be moored, too, until it shows otherwise.

use crate::restorable::{InvalidState, not_negative};
use crate::scalar::{Scalar, lit};

/// Mean times that are weighed, in multiples of the setting; their mean rate is its rate.
const MULTIPLES: [f64; COUNT] = [1.0 / 3.0, 4.0 / 3.0, 16.0 / 3.0, 64.0 / 3.0];
const COUNT: usize = 4;

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
    /// What the track says of each mean time: its likelihood, of all together one.
    likelihoods: [T; COUNT],
    /// Before the last prediction, the probability of the first model; for it, its seconds and the probability to stay in that model.
    before: T,
    dt: T,
    stay: T,
}

impl<T: Scalar> Default for DwellTime<T> {
    fn default() -> Self {
        Self {
            likelihoods: [lit(1.0 / COUNT as f64); COUNT],
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
        let weighted = self.each(usual_s).into_iter().zip(scene.of(self));
        self.stay = weighted.fold(T::zero(), |sum, (stay, weight)| sum + stay * weight);
        if dt > T::zero() && self.stay < T::one() && self.stay > T::zero() {
            -dt / self.stay.ln()
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
        let mut likelihoods = self.likelihoods;
        for (likelihood, stay) in likelihoods.iter_mut().zip(each) {
            *likelihood *= (T::one() + (stay - self.stay) * favours).max(T::zero());
        }
        match in_shares(likelihoods) {
            Some(shares) => self.likelihoods = shares,
            None => *self = Self::default(),
        }
    }

    /// Probabilities of staying over the last prediction, one for each mean time.
    fn each(&self, usual_s: T) -> [T; COUNT] {
        MULTIPLES.map(|multiple| (-self.dt / (usual_s * lit(multiple))).exp())
    }

    /// Whether a saved one can be continued from.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        let numbers = self
            .likelihoods
            .iter()
            .chain([&self.before, &self.dt, &self.stay]);
        not_negative("dwell time of a track", numbers)
    }
}

/// How many targets of a scene stay how long.
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
    /// Shares of the mean times among targets: the prior of each track.
    shares: [T; COUNT],
    /// Targets that have ended, each counted where it belonged by its probability.
    ended: [T; COUNT],
}

impl<T: Scalar> Default for DwellTimes<T> {
    fn default() -> Self {
        Self {
            shares: [lit(1.0 / COUNT as f64); COUNT],
            ended: [T::zero(); COUNT],
        }
    }
}

impl<T: Scalar> DwellTimes<T> {
    /// Probabilities of the mean times for one track.
    fn of(&self, track: &DwellTime<T>) -> [T; COUNT] {
        let joint = core::array::from_fn(|g| self.shares[g] * track.likelihoods[g]);
        in_shares(joint).unwrap_or(self.shares)
    }

    /// Learns the shares from the tracks that are there and those that have ended (M4). To begin with, every mean time has one target.
    pub(super) fn learn<'a>(&mut self, tracks: impl Iterator<Item = &'a DwellTime<T>>)
    where
        T: 'a,
    {
        let mut counts = self.ended.map(|count| count + T::one());
        for track in tracks {
            add(&mut counts, self.of(track));
        }
        self.shares = in_shares(counts).unwrap_or(self.shares);
    }

    /// Takes in a track that has ended.
    pub(super) fn end(&mut self, track: &DwellTime<T>) {
        let its = self.of(track);
        add(&mut self.ended, its);
    }

    /// The numbers, for checks of a saved state.
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        self.shares.iter().chain(&self.ended)
    }
}

/// The same, divided by their sum; `None` where that is no positive number.
fn in_shares<T: Scalar>(numbers: [T; COUNT]) -> Option<[T; COUNT]> {
    let sum = numbers.iter().fold(T::zero(), |sum, x| sum + *x);
    (sum > T::zero() && sum.is_finite()).then(|| numbers.map(|x| x / sum))
}

fn add<T: Scalar>(sums: &mut [T; COUNT], numbers: [T; COUNT]) {
    for (sum, number) in sums.iter_mut().zip(numbers) {
        *sum += number;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt as _, SeedableRng as _};
    use rand_pcg::Pcg64Mcg;
    use std::vec::Vec;

    const USUAL_S: f64 = 40.0;

    /// What is learnt in so many seconds from a target that leaves the first of two models every so many seconds on average, stays in the
    /// other for 10 s, and shows each second which it is in with odds of 19 to 1; and the mean time at the end.
    fn track(
        mean_s: f64,
        seconds: usize,
        scene: &DwellTimes<f64>,
        seed: u64,
    ) -> (DwellTime<f64>, f64) {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let (usual_s, other_s, odds) = (USUAL_S, 10.0, [0.95, 0.05]);
        let mut dwell = DwellTime::default();
        let (mut straight, mut is_straight, mut found) = (0.5, true, usual_s);
        for _ in 0..seconds {
            let mean = if is_straight { mean_s } else { other_s };
            is_straight ^= rng.random::<f64>() < 1.0 - f64::exp(-1.0 / mean);
            found = dwell.predict(usual_s, scene, straight, 1.0);
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
        (dwell, found)
    }

    fn learnt(mean_s: f64, seed: u64) -> f64 {
        track(mean_s, 600, &DwellTimes::default(), seed).1
    }

    /// What the tracks of such targets teach, each with its mean time.
    fn scene(means_s: &[f64], seconds: usize) -> DwellTimes<f64> {
        let flat = DwellTimes::default();
        let tracks = (0..).zip(means_s);
        let tracks: Vec<_> = tracks
            .map(|(k, mean_s)| track(*mean_s, seconds, &flat, k).0)
            .collect();
        let mut scene = flat;
        (0..200).for_each(|_| scene.learn(tracks.iter()));
        scene
    }

    fn new_one(scene: &DwellTimes<f64>) -> f64 {
        DwellTime::default().predict(USUAL_S, scene, 0.7, 0.01)
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
    fn a_new_target_among_moored_ones_is_likely_to_be_moored() {
        let flat = new_one(&DwellTimes::default());
        assert!((flat - USUAL_S).abs() < 0.01 * USUAL_S, "{flat}");
        let [moored, turning] = [1e9, 15.0].map(|mean_s| new_one(&scene(&[mean_s; 12], 600)));
        assert!(moored > 2.0 * flat && turning < flat, "{moored} {turning}");
        // Where both kinds are, the odd one out is told from its own track as before.
        let among = scene(&[1e9; 12], 600);
        for seed in 0..20 {
            let (_, turning) = track(15.0, 600, &among, seed);
            assert!(turning < 60.0, "seed {seed}: {turning} s");
        }
    }

    #[test]
    fn shares_are_those_that_are_likeliest() {
        // Two mean times that cannot be confused: three targets of the first kind, five of the last, and one of each to begin with.
        let kind = |g: usize| DwellTime {
            likelihoods: core::array::from_fn(|k| f64::from(u8::from(k == g))),
            ..DwellTime::default()
        };
        let tracks = [0, 0, 0, 3, 3, 3, 3, 3].map(kind);
        let mut all = DwellTimes::default();
        all.learn(tracks.iter());
        let same = |a: &[f64], b: &[f64]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
        assert!(same(&all.shares, &[4.0, 1.0, 1.0, 6.0].map(|n| n / 12.0)));
        // Those that end stay counted.
        let mut left = DwellTimes::default();
        tracks[..4].iter().for_each(|track| left.end(track));
        left.learn(tracks[4..].iter());
        assert!(same(&left.shares, &all.shares));
        // A track that knows nothing changes nothing in the end.
        let unknown = DwellTime::default();
        (0..10_000).for_each(|_| left.learn(tracks[4..].iter().chain([&unknown])));
        assert!(same(&left.shares, &all.shares));
    }

    #[test]
    fn a_scan_that_tells_the_models_not_apart_changes_nothing() {
        let mut dwell = DwellTime::<f64>::default();
        let flat = DwellTimes::default();
        let first = dwell.predict(40.0, &flat, 0.7, 2.0);
        for _ in 0..1000 {
            dwell.learn(40.0, &[1.0, 1.0, 1.0]);
            dwell.predict(40.0, &flat, 0.7, 2.0);
        }
        let last = dwell.predict(40.0, &flat, 0.7, 2.0);
        assert!((last - first).abs() < 1e-9 * first, "{first} {last}");
    }

    #[test]
    fn nothing_that_is_no_number_enters() {
        let mut dwell = DwellTime::<f64>::default();
        let mut scene = DwellTimes::default();
        let usual = dwell.predict(40.0, &scene, 0.9, 2.0);
        for bad in [[f64::NAN, 1.0], [f64::INFINITY, 0.0], [1.0, -f64::INFINITY]] {
            dwell.learn(40.0, &bad);
            assert!(dwell.check().is_ok());
            scene.learn([&dwell].into_iter());
            scene.end(&DwellTime::default());
            assert!(scene.numbers().all(|x| x.is_finite()));
            assert!(dwell.predict(40.0, &scene, 0.9, 2.0) > 0.0);
        }
        assert!((dwell.predict(40.0, &scene, 0.9, 2.0) - usual).abs() < 1e-9);
        dwell.learn(40.0, &[1.0]);
        dwell.learn(40.0, &[]);
        for zero in [0.0, 1e-300, 1e300] {
            assert!(dwell.predict(40.0, &scene, 0.9, zero) > 0.0);
        }
    }
}
