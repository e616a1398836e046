//! Division of headings that have become too wide to be linear about, into hypotheses around the horizon.
//!
//! *Read first:* `docs/derivations/in_motion_alignment.md`, section 6 (W24).

use super::super::InMotionAlignmentConfig;
use super::super::hypothesis::OVERLAP;
use super::super::window::Interval;
use super::Bank;
use crate::geometry::so3;
use crate::navigation::ATTITUDE;
use crate::scalar::{Scalar, lit};

/// How many times its first standard deviation a heading may have before it is divided anew.
const WIDEST: f64 = 2.0;
/// Whole turns to either side that count in the density of a heading.
const TURNS: i32 = 2;
/// Least density of one, in that of a mixture: no heading is impossible.
const LEAST_DENSITY: f64 = 1e-9;

impl<T: Scalar, const K: usize> Bank<T, K> {
    /// Where no hypothesis knows the heading well enough to be linear about it: the mixture as hypotheses around the horizon
    /// again, narrow as at the start (W24).
    pub(super) fn divide(
        &mut self,
        intervals: &[Interval<T>],
        config: &InMotionAlignmentConfig<T>,
    ) {
        let std = first_heading_std::<T>(K);
        let widest = std * lit(WIDEST);
        let wide = self.in_use().iter().all(|h| h.is_wider_than(widest));
        let (Some(best), true) = (self.best().copied(), wide) else {
            return;
        };
        let step = T::two_pi() / lit(K as f64);
        let odds: [T; K] = core::array::from_fn(|k| {
            let density = self.heading_density(step * lit(k as f64), std, config);
            density.max(lit(LEAST_DENSITY)).ln() / config.evidence_power
        });
        for (k, hypothesis) in self.hypotheses.iter_mut().enumerate() {
            let offset = step * lit(k as f64);
            *hypothesis = best.with_heading([offset, std, odds[k] - odds[0]], intervals);
        }
        self.count = K;
        self.order();
    }

    /// Takes headings around the horizon into the free places, as likely as the best one: what was wrong may have dropped them.
    pub(in super::super) fn refill(&mut self, intervals: &[Interval<T>]) {
        let Some(best) = self.best().copied() else {
            return;
        };
        let free = K - self.count.min(K);
        let step = T::two_pi() / lit((free + 1) as f64);
        let std = first_heading_std::<T>(K);
        for (k, hypothesis) in self.hypotheses.iter_mut().rev().take(free).enumerate() {
            let offset = step * lit((k + 1) as f64);
            *hypothesis = best.with_heading([offset, std, T::zero()], intervals);
        }
        self.count = K;
    }

    /// Density of the mixture's headings before the window, `offset` (rad) from the best one, but for a constant, when each
    /// hypothesis is divided into narrower ones of `std`.
    fn heading_density(&self, offset: T, std: T, config: &InMotionAlignmentConfig<T>) -> T {
        let Some(best) = self.best() else {
            return T::zero();
        };
        let back = best.end.mean.ned_from_body.inverse();
        self.in_use().iter().fold(T::zero(), |sum, hypothesis| {
            let own = so3::log(&(hypothesis.end.mean.ned_from_body * back)).z;
            let left = hypothesis.anchor.covariance.variance(ATTITUDE + 2) - std * std;
            let around = (-TURNS..=TURNS).fold(T::zero(), |sum, turns| {
                let off = offset - own + T::two_pi() * lit(f64::from(turns));
                sum + (-off * off / (left + left)).exp()
            });
            sum + self.weight(hypothesis, config) * around / left.sqrt()
        })
    }
}

/// Standard deviation of each of `count` headings around the horizon, rad.
fn first_heading_std<T: Scalar>(count: usize) -> T {
    T::pi() * lit(OVERLAP) / lit(count as f64)
}
