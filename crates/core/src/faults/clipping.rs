//! Clipping of a gyroscope at any level: below the largest value that was seen, too.
//!
//! [`SampleCheck`] knows the end of a range by the largest value ever. A range that is switched, or a driver that limits what it
//! passes on, clips below. What shows it is the largest component of the samples, which stands still, sample after sample, while
//! others move (docs/derivations/faults.md, section 4). A specific force is not judged so: gravity stands still by itself.

use nalgebra::Vector3;

use super::sample_check::{HELD_RUN, Held, SampleCheck};
use crate::scalar::{Scalar, lit, to_f64};

/// So many steps of the resolution a clipped component is large. A rate near zero stands still by its rounding alone.
const LARGE_STEPS: f64 = 64.0;
/// It comes to its level by changes of so many steps. The peak of a smooth motion is reached by smaller and smaller ones.
const ARRIVAL_STEPS: f64 = 8.0;
/// A known level is there again once so many samples repeat it: one alone may lie there by chance.
const AGAIN_RUN: u16 = 2;

/// A sample that is clipped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clipped<T> {
    /// The level, rad/s.
    pub level: T,
    /// Stamp of the first sample at it, as far as the usual interval tells.
    pub from_ns: i64,
}

/// The level at which a gyroscope is clipped, zero where it is not known to be.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Clipping<T> {
    level: T,
}

impl<T: Scalar> Default for Clipping<T> {
    fn default() -> Self {
        Self { level: T::zero() }
    }
}

impl<T: Scalar> Clipping<T> {
    /// Looks at an angular rate (rad/s) that the check has just seen and called good.
    #[inline]
    pub fn look(
        &mut self,
        check: &SampleCheck<T>,
        time_ns: i64,
        sample: &Vector3<T>,
    ) -> Option<Clipped<T>> {
        let held = check.held();
        // Nearly always nothing is.
        if held.is_none() && self.level == T::zero() {
            return None;
        }
        self.look_at(held, check, time_ns, sample)
    }

    fn look_at(
        &mut self,
        held: Option<Held<T>>,
        check: &SampleCheck<T>,
        time_ns: i64,
        sample: &Vector3<T>,
    ) -> Option<Clipped<T>> {
        let largest = sample.amax();
        if largest > self.level * lit(1.001) {
            // It measures beyond: that was no end.
            self.level = T::zero();
        }
        let held = held?;
        let arrival = check.resolution() * lit(ARRIVAL_STEPS);
        let is_large = largest > check.resolution() * lit(LARGE_STEPS);
        if held.run >= HELD_RUN && is_large && held.change2 > arrival * arrival {
            self.level = largest;
        }
        let is_clipped = self.level > T::zero() && largest >= self.level;
        (is_clipped && held.run >= AGAIN_RUN).then(|| {
            let interval = check.interval_s().map_or(0.0, to_f64);
            let held_ns = (interval * f64::from(held.run) * 1e9) as i64;
            Clipped {
                level: self.level,
                from_ns: time_ns.saturating_sub(held_ns),
            }
        })
    }

    /// The numbers, for checks of a saved state.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = &T> {
        core::iter::once(&self.level)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::sample_check::Checked;
    use std::vec::Vec;

    const DT_NS: i64 = 10_000_000;

    /// Which of the samples are clipped, and since when.
    fn clipped(samples: &[Vector3<f64>]) -> Vec<Option<Clipped<f64>>> {
        let mut check = SampleCheck::of_gyroscope();
        let mut clipping = Clipping::default();
        let stamped = samples.iter().zip(0..);
        let look = stamped.map(|(sample, k)| {
            let good = matches!(check.check(k * DT_NS, sample), Checked::Good);
            let clipped = clipping.look(&check, k * DT_NS, sample);
            clipped.filter(|_| good)
        });
        look.collect()
    }

    fn motion(k: i32) -> Vector3<f64> {
        let t = f64::from(k) * 0.01;
        Vector3::new(
            3.0 * (3.0 * t).sin(),
            0.5 * (7.0 * t).cos(),
            0.4 * (5.0 * t).sin(),
        )
    }

    fn rounded(v: Vector3<f64>, step: f64) -> Vector3<f64> {
        v.map(|x| (x / step).round() * step)
    }

    /// GIVEN a motion of 3 rad/s WHEN a limit of 1.5 begins in its midst THEN two thirds of the samples are clipped there, and known to
    /// be once it was seen; none before, none after.
    #[test]
    fn a_limit_below_the_largest_value_is_found() {
        let samples: Vec<_> = (0..2000)
            .map(|k| match k {
                1000..1600 => motion(k).map(|x| x.clamp(-1.5, 1.5)),
                _ => motion(k),
            })
            .map(|v| rounded(v, 1e-3))
            .collect();
        let said = clipped(&samples);
        let at_limit = |k: usize| samples[k].amax() >= 1.5 && (1000..1600).contains(&k);
        let found: Vec<_> = (0..2000).filter(|k| said[*k].is_some()).collect();
        assert!(found.iter().all(|k| at_limit(*k)));
        let all = (1000..1600).filter(|k| at_limit(*k)).count();
        assert!(
            all > 300 && found.len() > all * 17 / 20,
            "{} of {all}",
            found.len()
        );
        for k in found {
            let clipped = said[k].unwrap();
            let from = usize::try_from((clipped.from_ns + DT_NS / 2) / DT_NS).unwrap();
            assert!(
                (clipped.level - 1.5).abs() < 1e-9 && at_limit(from + 1) && !at_limit(from - 1),
                "{k} {from}"
            );
        }
    }

    /// Rest, rounding, a turntable, and the peaks of a slow motion that is sampled often are no clipping.
    #[test]
    fn what_stands_still_by_itself_is_not_clipped() {
        for step in [1e-4, 1e-3, 0.01, 0.1] {
            let rest = (0..500).map(|_| Vector3::new(0.02, -0.01, 0.0));
            let moving = (500..3000).map(motion);
            let turning = (3000..3500).map(|_| Vector3::new(0.0, 0.0, 1.0));
            let slow = (0..12_000).map(|k| f64::from(k) * 0.0025);
            let slow = slow.map(|t| Vector3::new((2.0 * t).sin(), 0.3 * (5.0 * t).cos(), 0.0));
            let samples: Vec<_> = (rest.chain(moving).chain(turning).chain(slow))
                .map(|v| rounded(v, step))
                .collect();
            assert_eq!(clipped(&samples).iter().flatten().count(), 0, "{step}");
        }
    }
}
