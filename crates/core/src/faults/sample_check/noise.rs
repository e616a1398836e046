//! White-noise detection: a sensor whose samples have nothing to do with each other any more.
//!
//! Motion is smooth: the change between two samples is smaller than the motion. White noise is not: its changes have
//! twice its variance. A sensor is noise where that is so, its changes are many times what they were before, and what is
//! steady in it, such as gravity, is smaller (F7).

use nalgebra::Vector3;

use crate::scalar::{Scalar, lesser, lit};

/// Memory of the noise of now, and of what was before, samples.
const MEMORY: f64 = 16.0;
const LONG_MEMORY: f64 = 1024.0;
/// Samples before anything is called noise.
const FEWEST: u16 = 64;
/// Strong changes, each against the one before, less those that are not: a spike has one.
const FEWEST_STRONG: u8 = 8;
const MOST_STRONG: u8 = 16;
/// It is over after so many samples that are none.
const CALM: u8 = 4;
/// What is stronger counts as so much of what was before: it takes minutes to become the usual.
const MOST_GROWTH: f64 = 1.5;
/// Changes of so many times the variance are white: noise has two, a motion well below one.
const WHITE: f64 = 1.4;
/// Mean square of the changes, against that of before: noise from the first on; and what a strong change is.
const STRONGER: f64 = 400.0;
const STRONG: f64 = 100.0;

/// Mean squares of samples and changes.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct WhiteNoise<T: Scalar> {
    samples: u16,
    mean: Vector3<T>,
    last_change: Vector3<T>,
    spread2: T,
    change2: T,
    before2: T,
    /// Strong changes against the one before, less the others.
    strong: u8,
    /// Samples since it was noise.
    calm: u8,
    since_ns: Option<i64>,
}

impl<T: Scalar> Default for WhiteNoise<T> {
    fn default() -> Self {
        Self {
            samples: 0,
            mean: Vector3::zeros(),
            last_change: Vector3::zeros(),
            spread2: T::zero(),
            change2: T::zero(),
            before2: T::zero(),
            strong: 0,
            calm: 0,
            since_ns: None,
        }
    }
}

impl<T: Scalar> WhiteNoise<T> {
    /// Takes a sample and its change; since when it is noise whose integral walks more than a limit (its square a second, and the
    /// usual interval, s), if it is.
    #[inline]
    pub(super) fn since(
        &mut self,
        last_ns: i64,
        sample: &Vector3<T>,
        (change, change2): (&Vector3<T>, T),
        (limit2, interval): (T, T),
    ) -> Option<i64> {
        self.samples = self.samples.saturating_add(1);
        let [weight, long_weight] = self.weights();
        let off = sample - self.mean;
        self.mean += off * weight;
        self.spread2 += (off.norm_squared() - self.spread2) * weight;
        self.change2 += (change2 - self.change2) * weight;
        let most = if self.samples < FEWEST {
            change2
        } else {
            self.before2 * lit(MOST_GROWTH)
        };
        self.before2 += (lesser(change2, most) - self.before2) * long_weight;
        // A motion, however strong, goes on the way it went; noise comes back.
        let comes_back = change.dot(&self.last_change) < T::zero();
        self.last_change = *change;
        self.strong = if comes_back && change2 > self.before2 * lit(STRONG) {
            (self.strong + 1).min(MOST_STRONG)
        } else {
            self.strong.saturating_sub(1)
        };
        // Once it is noise it stays so while the changes are strong: the means remember it for longer than it lasts.
        let is_noise = match self.since_ns {
            Some(_) => self.strong > 0,
            None => {
                self.samples >= FEWEST
                    && self.strong >= FEWEST_STRONG
                    && self.before2 > T::zero()
                    && self.change2 > self.before2 * lit(STRONGER)
                    && self.change2 > self.spread2 * lit(WHITE)
                    && self.spread2 > self.mean.norm_squared()
                    && self.spread2 * interval > limit2
            }
        };
        if is_noise {
            self.since_ns.get_or_insert(last_ns);
            self.calm = 0;
        } else if self.since_ns.is_some() {
            self.calm = self.calm.saturating_add(1);
            if self.calm >= CALM {
                self.since_ns = None;
            }
        }
        self.since_ns
    }

    /// Weights of a sample in the means of now, and of what was before.
    #[inline]
    fn weights(&self) -> [T; 2] {
        if self.samples >= LONG_MEMORY as u16 {
            return [lit(1.0 / MEMORY), lit(1.0 / LONG_MEMORY)];
        }
        let known: T = lit(f64::from(self.samples));
        [MEMORY, LONG_MEMORY].map(|memory| T::one() / known.min(lit(memory)))
    }

    /// Nothing is known of the samples between.
    pub(super) fn interrupt(&mut self) {
        self.since_ns = None;
    }

    /// The numbers, for checks of a saved state.
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let own = [&self.spread2, &self.change2, &self.before2];
        self.mean.iter().chain(&self.last_change).chain(own)
    }
}
