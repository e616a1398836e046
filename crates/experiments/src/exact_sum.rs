//! A sum that is the same to the last bit in whatever order its terms are added.
//!
//! Floating-point addition is not associative, so a campaign split over threads, shards or machines
//! would end in other digits each time. Here every term is rounded to a multiple of 2^-40 and added
//! as an integer, which is associative. The rounding of 1e-12 is far below what any statistic of
//! metres can show; terms beyond 2^60 count as 2^60, and a million of them still fit.

use serde::{Deserialize, Serialize};

/// Units in one.
const SCALE: f64 = (1_u64 << 40) as f64;
/// Largest term.
const LARGEST: f64 = (1_u64 << 60) as f64;

/// The sum.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ExactSum {
    /// The sum in units of 2^-40.
    pub units: i128,
    /// Terms that were not finite; they are left out.
    pub not_finite: u64,
}

impl ExactSum {
    /// Adds a term.
    pub fn add(&mut self, term: f64) {
        if term.is_finite() {
            self.units += (term.clamp(-LARGEST, LARGEST) * SCALE).round() as i128;
        } else {
            self.not_finite += 1;
        }
    }

    /// Adds all terms of another.
    pub fn merge(&mut self, other: &Self) {
        self.units += other.units;
        self.not_finite += other.not_finite;
    }

    /// The mean over `terms`; infinite when a term was not finite, for then there is no mean.
    #[must_use]
    pub fn mean(&self, terms: u64) -> f64 {
        if self.not_finite > 0 || terms == 0 {
            return f64::INFINITY;
        }
        self.units as f64 / SCALE / terms as f64
    }
}

#[cfg(test)]
mod tests {
    use super::ExactSum;
    use northing_simulation::random::{standard_normal, stream};

    #[test]
    fn the_order_of_adding_does_not_matter() {
        let mut draws = stream(1, "terms");
        let terms: Vec<f64> = (0..1000)
            .map(|k| standard_normal(&mut draws) * 10_f64.powi(k % 12))
            .collect();
        let mut forward = ExactSum::default();
        terms.iter().for_each(|term| forward.add(*term));
        let mut halves = [ExactSum::default(), ExactSum::default()];
        for (k, term) in terms.iter().rev().enumerate() {
            halves[k % 2].add(*term);
        }
        let [mut merged, other] = halves;
        merged.merge(&other);
        assert_eq!(merged, forward);
        let plain: f64 = terms.iter().sum::<f64>() / 1000.0;
        assert!((forward.mean(1000) / plain - 1.0).abs() < 1e-9);
    }

    #[test]
    fn what_is_not_finite_is_counted_and_spoils_the_mean() {
        let mut sum = ExactSum::default();
        sum.add(1.0);
        sum.add(f64::NAN);
        assert_eq!(sum.not_finite, 1);
        assert!(sum.mean(2).is_infinite());
        let mut huge = ExactSum::default();
        (0..1000).for_each(|_| huge.add(1e300));
        assert!(huge.mean(1000) > 1e18);
    }
}
