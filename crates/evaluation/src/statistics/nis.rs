//! NIS statistics of one sensor, gathered in constant memory while a filter runs.

use nalgebra::Vector3;
use northing_core::kalman::{Innovation, Outcome, SkipReason};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF as _};
use std::collections::BTreeMap;

/// How often a sensor was used: the entry of `updates` in a summary.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct UpdateCounts {
    /// Samples that changed the state, the inflated ones among them.
    pub fused: u64,
    /// Samples that the gate refused.
    pub gated: u64,
    /// Samples that were not looked at.
    pub skipped: u64,
    /// Fused with inflated noise: far off, or after the gate had refused everything for its time-out.
    pub inflated: u64,
    /// Why samples were skipped, in words.
    pub skipped_because: BTreeMap<&'static str, u64>,
}

impl UpdateCounts {
    /// Counts one outcome.
    pub fn add(&mut self, outcome: Outcome) {
        match outcome {
            Outcome::Fused => self.fused += 1,
            Outcome::Inflated => {
                self.fused += 1;
                self.inflated += 1;
            }
            Outcome::Gated => self.gated += 1,
            Outcome::Skipped(reason) => self.skip(reason),
        }
    }

    /// Counts one skipped sample.
    pub fn skip(&mut self, reason: SkipReason) {
        self.skip_because(reason.description());
    }

    /// Counts one that was skipped for a reason beside those of the filters.
    pub(crate) fn skip_because(&mut self, reason: &'static str) {
        self.skipped += 1;
        *self.skipped_because.entry(reason).or_default() += 1;
    }

    /// Share of the samples looked at that the gate refused, 0 to 1.
    #[must_use]
    pub fn gated_share(&self) -> f64 {
        self.gated as f64 / (self.fused + self.gated).max(1) as f64
    }
}

/// What the NIS of one sensor says, over all samples that were looked at (the refused ones too).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct NisSummary {
    /// Mean NIS; the degrees of freedom when the tuning is consistent.
    pub mean: f64,
    /// Median NIS: says the same of the bulk, whatever outliers do.
    pub median: f64,
    /// Components a sample has: 3 for a vector, 1 for a heading.
    pub degrees_of_freedom: u8,
    /// Samples that were looked at.
    pub samples: u64,
    /// Share above the 95 % bound of chi-square, 0.05 when consistent.
    pub share_above_95: f64,
    /// Share above the 99 % bound, 0.01 when consistent.
    pub share_above_99: f64,
    /// Correlation of one residual with the next, -1 to 1; 0 when they are white.
    pub lag1_autocorrelation: f64,
    /// Independent samples that the mean NIS is worth: fewer than `samples` where NIS values are alike from one to the
    /// next, over however many samples that goes on.
    pub effective_samples: f64,
}

/// Gathers the NIS of one sensor.
#[derive(Debug, Clone, Default)]
pub struct NisStatistics {
    degrees_of_freedom: u8,
    bounds: [f64; 2],
    samples: u64,
    sum: f64,
    above: [u64; 2],
    histogram: Histogram,
    last: Option<Vector3<f64>>,
    products: f64,
    squares: f64,
    blocks: Blocks,
}

impl NisStatistics {
    /// Adds an innovation; a skipped one does not count, nor one of which nothing was expected.
    pub fn add(&mut self, innovation: &Innovation<f64>) {
        let is_stated = innovation.degrees_of_freedom > 0 && innovation.nis.is_finite();
        if matches!(innovation.outcome, Outcome::Skipped(_)) || !is_stated {
            return;
        }
        if self.degrees_of_freedom != innovation.degrees_of_freedom {
            self.degrees_of_freedom = innovation.degrees_of_freedom;
            self.bounds = [0.95, 0.99].map(|p| chi_square_quantile(self.degrees_of_freedom, p));
        }
        self.samples += 1;
        self.sum += innovation.nis;
        for (count, bound) in self.above.iter_mut().zip(self.bounds) {
            *count += u64::from(innovation.nis > bound);
        }
        self.histogram.add(innovation.nis);
        self.blocks.add(innovation.nis);
        self.correlate(innovation);
    }

    /// Residuals in units of what was expected of them, times the ones before.
    fn correlate(&mut self, innovation: &Innovation<f64>) {
        let std = innovation.residual_std();
        let white = innovation
            .residual
            .zip_map(&std, |r, s| if s > 0.0 { r / s } else { 0.0 });
        if let Some(last) = self.last {
            self.products += white.dot(&last);
            self.squares += 0.5 * (white.norm_squared() + last.norm_squared());
        }
        self.last = Some(white);
    }

    /// What it comes to; `None` when no sample was looked at.
    #[must_use]
    pub fn summary(&self) -> Option<NisSummary> {
        let share = |count: u64| count as f64 / self.samples as f64;
        (self.samples > 0).then(|| NisSummary {
            mean: self.sum / self.samples as f64,
            median: self.histogram.median(),
            degrees_of_freedom: self.degrees_of_freedom,
            samples: self.samples,
            share_above_95: share(self.above[0]),
            share_above_99: share(self.above[1]),
            lag1_autocorrelation: if self.squares > 0.0 {
                self.products / self.squares
            } else {
                0.0
            },
            effective_samples: self.blocks.effective_samples(),
        })
    }
}

/// Means over blocks of 1, 2, 4, ... values, in constant memory: where values are alike over many samples, the means of long
/// blocks scatter more than those of independent values would (Flyvbjerg & Petersen 1989).
#[derive(Debug, Clone, Copy, Default)]
struct Blocks {
    levels: [Level; Blocks::LEVELS],
}

#[derive(Debug, Clone, Copy, Default)]
struct Level {
    waiting: Option<f64>,
    count: u64,
    mean: f64,
    squares: f64,
}

impl Level {
    /// Takes a block's mean; gives that of two.
    fn add(&mut self, value: f64) -> Option<f64> {
        self.count += 1;
        let before = value - self.mean;
        self.mean += before / self.count as f64;
        self.squares += before * (value - self.mean);
        match self.waiting.take() {
            Some(first) => Some(0.5 * (first + value)),
            None => {
                self.waiting = Some(value);
                None
            }
        }
    }

    /// Variance of the mean of all.
    fn variance_of_mean(&self) -> f64 {
        let n = self.count as f64;
        self.squares / (n * (n - 1.0).max(1.0))
    }
}

impl Blocks {
    const LEVELS: usize = 24;
    /// With fewer blocks their scatter says nothing.
    const FEWEST: u64 = 8;
    /// A level whose scatter is within this many standard deviations of independent values' is taken to be theirs.
    const BY_CHANCE: f64 = 3.0;

    fn add(&mut self, value: f64) {
        // One wild value must not decide how many samples the others are worth.
        let mut mean = value.min(1e3);
        for level in &mut self.levels {
            match level.add(mean) {
                Some(next) => mean = next,
                None => return,
            }
        }
    }

    fn effective_samples(&self) -> f64 {
        let single = &self.levels[0];
        let n = single.count as f64;
        let known = self
            .levels
            .iter()
            .filter(|level| level.count >= Self::FEWEST);
        let ratios = known.filter_map(|level| {
            let ratio = level.variance_of_mean() / single.variance_of_mean();
            let chance = 1.0 + Self::BY_CHANCE * (2.0 / level.count as f64).sqrt();
            (ratio > chance).then_some(ratio)
        });
        (n / ratios.fold(1.0, f64::max)).max(1.0)
    }
}

/// The value that a chi-square variable stays below with probability `p`.
#[must_use]
pub fn chi_square_quantile(degrees_of_freedom: u8, p: f64) -> f64 {
    ChiSquared::new(f64::from(degrees_of_freedom.max(1)))
        .map_or(f64::NAN, |distribution| distribution.inverse_cdf(p))
}

/// Counts in logarithmic bins: a median to 2 % in constant memory.
#[derive(Debug, Clone, Default)]
struct Histogram {
    counts: Vec<u64>,
    total: u64,
}

impl Histogram {
    const PER_DECADE: f64 = 64.0;
    /// An R that is far too large gives a tiny NIS, which must not look like a larger one.
    const LOWEST_DECADE: f64 = -16.0;
    const BINS: usize = 24 * 64;

    fn add(&mut self, value: f64) {
        let bin = (value.max(1e-300).log10() - Self::LOWEST_DECADE) * Self::PER_DECADE;
        self.counts.resize(Self::BINS, 0);
        self.counts[(bin.max(0.0) as usize).min(Self::BINS - 1)] += 1;
        self.total += 1;
    }

    fn median(&self) -> f64 {
        let half = 0.5 * self.total as f64;
        let mut below = 0.0;
        for (bin, count) in self.counts.iter().enumerate() {
            let count = *count as f64;
            if count > 0.0 && below + count >= half {
                let place = bin as f64 + (half - below) / count;
                return 10_f64.powf(place / Self::PER_DECADE + Self::LOWEST_DECADE);
            }
            below += count;
        }
        f64::NAN
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use nalgebra::Matrix3;
    use northing_simulation::random::{normal_vector, stream};

    /// An innovation of white noise with the standard deviation `actual`, where 1 was expected.
    pub(crate) fn innovation(residual: Vector3<f64>, outcome: Outcome) -> Innovation<f64> {
        Innovation {
            residual,
            covariance: Matrix3::identity(),
            nis: residual.norm_squared(),
            degrees_of_freedom: 3,
            outcome,
        }
    }

    /// Statistics of residuals that follow a first-order process of unit variance.
    pub(crate) fn of_noise(samples: u32, std: f64, correlation: f64) -> NisStatistics {
        let mut noise = stream(11, "nis");
        let mut statistics = NisStatistics::default();
        let mut residual = normal_vector(&mut noise, std);
        for _ in 0..samples {
            statistics.add(&innovation(residual, Outcome::Fused));
            let fresh = std * (1.0 - correlation * correlation).sqrt();
            residual = residual * correlation + normal_vector(&mut noise, fresh);
        }
        statistics
    }

    #[test]
    fn the_median_of_tiny_values_is_theirs() {
        for scale in [1e-14, 1e-9, 1e-3, 1e6] {
            let mut histogram = Histogram::default();
            (1..=99).for_each(|k| histogram.add(f64::from(k) * scale));
            approx::assert_relative_eq!(histogram.median(), 50.0 * scale, max_relative = 0.04);
        }
    }

    #[test]
    fn quantiles_are_those_of_the_tables() {
        for (dof, quantiles) in northing_core::kalman::gate::CHI_SQUARE {
            for (p, quantile) in [0.95, 0.99, 0.999].into_iter().zip(quantiles) {
                approx::assert_relative_eq!(chi_square_quantile(dof, p), quantile, epsilon = 1e-5);
            }
        }
    }

    /// 20000 vectors: the standard error of the mean NIS is 0.017, of the shares 0.0015.
    #[test]
    fn white_noise_has_the_statistics_of_chi_square() {
        let summary = of_noise(20_000, 1.0, 0.0).summary().unwrap();
        assert!((summary.mean - 3.0).abs() < 0.07, "{summary:?}");
        assert!((summary.median / 2.366 - 1.0).abs() < 0.04, "{summary:?}");
        assert!((summary.share_above_95 - 0.05).abs() < 0.006, "{summary:?}");
        assert!((summary.share_above_99 - 0.01).abs() < 0.003, "{summary:?}");
        assert!(summary.lag1_autocorrelation.abs() < 0.02, "{summary:?}");
        assert_eq!((summary.samples, summary.degrees_of_freedom), (20_000, 3));
    }

    /// An AR(1) process of correlation c has squares that correlate as c^2: n (1 - c^2) / (1 + c^2) of them are independent.
    #[test]
    fn samples_that_are_alike_are_worth_fewer() {
        let worth = |correlation| {
            of_noise(20_000, 1.0, correlation)
                .summary()
                .unwrap()
                .effective_samples
        };
        assert!(worth(0.0) > 8000.0, "{}", worth(0.0));
        let expected = 20_000.0 * (1.0 - 0.95_f64.powi(2)) / (1.0 + 0.95_f64.powi(2));
        assert!(
            (0.4..1.6).contains(&(worth(0.95) / expected)),
            "{} of {expected}",
            worth(0.95)
        );
    }

    #[test]
    fn correlation_is_found() {
        let summary = of_noise(20_000, 1.0, 0.8).summary().unwrap();
        assert!(
            (summary.lag1_autocorrelation - 0.8).abs() < 0.02,
            "{summary:?}"
        );
    }

    #[test]
    fn refused_samples_count_and_skipped_ones_do_not() {
        let mut statistics = NisStatistics::default();
        assert_eq!(statistics.summary(), None);
        statistics.add(&Innovation::skipped(SkipReason::ZeroNorm));
        assert_eq!(statistics.summary(), None);
        statistics.add(&innovation(Vector3::new(4.0, 0.0, 0.0), Outcome::Gated));
        statistics.add(&innovation(Vector3::zeros(), Outcome::Fused));
        let summary = statistics.summary().unwrap();
        approx::assert_relative_eq!(summary.mean, 8.0);
        approx::assert_relative_eq!(summary.share_above_99, 0.5);
    }

    #[test]
    fn outcomes_are_counted_with_their_reasons() {
        let mut counts = UpdateCounts::default();
        for outcome in [Outcome::Fused, Outcome::Inflated, Outcome::Gated] {
            counts.add(outcome);
        }
        counts.add(Outcome::Skipped(SkipReason::NotFinite));
        assert_eq!(
            (counts.fused, counts.gated, counts.skipped, counts.inflated),
            (2, 1, 1, 1)
        );
        assert_eq!(counts.skipped_because["not a finite number"], 1);
        approx::assert_relative_eq!(counts.gated_share(), 1.0 / 3.0);
    }
}
