//! Streaming statistics of one three-axis sensor: mean, covariance, drift, resolution, rate.
//!
//! Welford's recursion; all sums are taken about the first sample, so that single precision keeps
//! the small noise on top of a large gravity.

use nalgebra::{Matrix3, Vector3};

use crate::scalar::{Scalar, lit};

/// Differences below this share of the value are rounding of a stored `f32`, not resolution.
const ROUNDING: f64 = 5e-7;

/// A step below this share of the known one shows that the samples are not rounded to that.
const FINER: f64 = 0.6;

/// Number of blocks of consecutive samples, a power of two.
const BLOCKS: usize = 8;

/// Statistics of one sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Statistics<T: Scalar> {
    count: u32,
    first: Vector3<T>,
    last: Vector3<T>,
    /// Mean of the deviations from the first sample.
    mean: Vector3<T>,
    /// Sum of the products of deviations from the mean.
    products: Matrix3<T>,
    /// Smallest step seen between consecutive samples per axis; zero before the first.
    step: Vector3<T>,
    /// Step to which the samples are known to be rounded; zero where nothing is known.
    known_step: T,
    blocks: Blocks<T>,
    elapsed: T,
    intervals: u32,
}

/// Sums over blocks of equal length; when they are full, neighbours merge and the length doubles.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Blocks<T: Scalar> {
    sums: [Vector3<T>; BLOCKS],
    full: usize,
    length: u32,
    pending: Vector3<T>,
    pending_count: u32,
}

impl<T: Scalar> Statistics<T> {
    pub(super) fn new() -> Self {
        Self {
            count: 0,
            first: Vector3::zeros(),
            last: Vector3::zeros(),
            mean: Vector3::zeros(),
            products: Matrix3::zeros(),
            step: Vector3::zeros(),
            known_step: T::zero(),
            blocks: Blocks::new(),
            elapsed: T::zero(),
            intervals: 0,
        }
    }

    /// Adds a sample, unless it is not finite or the counter is full.
    pub(super) fn add(&mut self, sample: &Vector3<T>, dt: Option<T>) -> bool {
        if !sample.norm_squared().is_finite() || self.count == u32::MAX {
            return false;
        }
        if self.count == 0 {
            self.first = *sample;
        } else {
            self.note_step(sample);
        }
        self.last = *sample;
        self.count += 1;
        let value = sample - self.first;
        let before = value - self.mean;
        self.mean += before / lit::<T>(f64::from(self.count));
        self.products += before * (value - self.mean).transpose();
        self.blocks.add(&value);
        if let Some(dt) = dt.filter(|dt| *dt > T::zero() && dt.is_finite()) {
            self.elapsed += dt;
            self.intervals += 1;
        }
        true
    }

    fn note_step(&mut self, sample: &Vector3<T>) {
        for axis in 0..3 {
            let step = (sample[axis] - self.last[axis]).abs();
            let rounding = lit::<T>(ROUNDING) * sample[axis].abs();
            let smallest = self.step[axis];
            if step > rounding && (step < smallest || smallest <= T::zero()) {
                self.step[axis] = step;
            }
        }
    }

    pub(super) fn count(&self) -> u32 {
        self.count
    }

    pub(super) fn mean(&self) -> Vector3<T> {
        self.first + self.mean
    }

    /// Mean time between samples, s.
    pub(super) fn interval(&self) -> Option<T> {
        (self.intervals > 0).then(|| self.elapsed / lit::<T>(f64::from(self.intervals)))
    }

    /// Says that the samples are rounded to multiples of `step`; anything but a positive number
    /// means that nothing is known.
    pub(super) fn know_step(&mut self, step: T) {
        let usable = step > T::zero() && step.is_finite();
        self.known_step = if usable { step } else { T::zero() };
    }

    /// Whether every sample was the same.
    pub(super) fn is_constant(&self) -> bool {
        self.step.amax() <= T::zero()
    }

    /// Whether every sample was the same for want of life: rounding does not explain it, or the
    /// value is one that the sensor cannot have at rest.
    pub(super) fn is_dead(&self, zero_is_possible: bool) -> bool {
        let rounded = self.known_step > T::zero();
        let possible = zero_is_possible || self.first.amax() > T::zero();
        self.is_constant() && !(rounded && possible)
    }

    /// The resolution of each axis: the step that is known, unless finer ones were seen, else the
    /// smallest seen; an axis that never moved takes that of the coarsest of the others.
    pub(super) fn resolution(&self) -> Vector3<T> {
        let known = self.known_step;
        let finer = |own: &T| *own > T::zero() && *own < known * lit(FINER);
        if known > T::zero() && !self.step.iter().any(finer) {
            return Vector3::repeat(known);
        }
        let coarsest = self.step.amax();
        self.step
            .map(|own| if own > T::zero() { own } else { coarsest })
    }

    /// Unbiased covariance, its diagonal not below what the resolution allows to know (M21).
    pub(super) fn covariance(&self) -> Matrix3<T> {
        let mut covariance = self.sample_covariance();
        for (axis, step) in self.resolution().iter().enumerate() {
            let floor = *step * *step * lit(1.0 / 12.0);
            covariance[(axis, axis)] = covariance[(axis, axis)].max(floor);
        }
        covariance
    }

    /// Unbiased covariance of the samples as they are.
    fn sample_covariance(&self) -> Matrix3<T> {
        let degrees = lit::<T>(f64::from(self.count.max(2) - 1));
        (self.products + self.products.transpose()) / (degrees + degrees)
    }

    /// Standard deviation of what rounding hides in the mean (M21c): no number of samples averages
    /// it away, because without noise every sample is rounded to the same side.
    pub(super) fn mean_rounding_std(&self) -> Vector3<T> {
        let covariance = self.sample_covariance();
        let resolution = self.resolution();
        Vector3::from_fn(|axis, _| {
            let step = resolution[axis];
            if step <= T::zero() {
                return T::zero();
            }
            let ratio = covariance[(axis, axis)] / (step * step);
            step * hidden_by_rounding(ratio).sqrt()
        })
    }

    /// Standard deviation of the mean: that of noise, averaged, that of rounding, which is not, and that of a bias that
    /// drifts, which is not either (M21b).
    pub(super) fn mean_std(&self) -> Vector3<T> {
        let samples = lit::<T>(f64::from(self.count.max(1)));
        let covariance = self.sample_covariance();
        let rounding = self.mean_rounding_std();
        let drift_variance = self.blocks.drift_variance(&covariance.diagonal());
        Vector3::from_fn(|axis, _| {
            let hidden = rounding[axis] * rounding[axis];
            (covariance[(axis, axis)] / samples + hidden + drift_variance[axis]).sqrt()
        })
    }

    /// Standard deviations of one sample.
    pub(super) fn std(&self) -> Vector3<T> {
        self.covariance().diagonal().map(|v| v.sqrt())
    }

    /// Mean of the second half minus mean of the first, and the standard deviation that noise
    /// alone gives this difference; `None` before there are two blocks.
    pub(super) fn drift(&self) -> Option<(Vector3<T>, Vector3<T>)> {
        let (difference, half) = self.blocks.second_minus_first()?;
        let noise = self.std() * (lit::<T>(2.0) / lit::<T>(f64::from(half))).sqrt();
        Some((difference, noise))
    }
}

/// Variance that rounding hides in a mean, in squared steps, where the samples scatter by `ratio`
/// squared steps (M21c).
///
/// Below a quarter, the most that two neighbouring numbers scatter, there may be no noise at all:
/// then the truth lies anywhere between two steps (1/12), or, where the samples jump between two
/// numbers, within `sqrt(1/4 - ratio)` of their mean. Above, noise shakes the rounding loose, and
/// the first harmonic of the rounding error is left.
fn hidden_by_rounding<T: Scalar>(ratio: T) -> T {
    let quiet = (lit::<T>(0.25) - ratio).clamp(T::zero(), lit(1.0 / 12.0));
    let noise = (ratio - lit(1.0 / 12.0)).max(T::zero());
    let square = T::pi() * T::pi();
    let shaken = (-noise * square * lit(4.0)).exp() / (square * lit(2.0));
    quiet.max(shaken)
}

impl<T: Scalar> Blocks<T> {
    fn new() -> Self {
        Self {
            sums: [Vector3::zeros(); BLOCKS],
            full: 0,
            length: 1,
            pending: Vector3::zeros(),
            pending_count: 0,
        }
    }

    fn add(&mut self, value: &Vector3<T>) {
        self.pending += value;
        self.pending_count += 1;
        if self.pending_count < self.length {
            return;
        }
        if let Some(slot) = self.sums.get_mut(self.full) {
            *slot = self.pending;
            self.full += 1;
        }
        self.pending = Vector3::zeros();
        self.pending_count = 0;
        if self.full == BLOCKS {
            self.merge();
        }
    }

    fn merge(&mut self) {
        for i in 0..BLOCKS / 2 {
            self.sums[i] = self.sums[2 * i] + self.sums[2 * i + 1];
        }
        self.full = BLOCKS / 2;
        self.length = self.length.saturating_mul(2);
    }

    /// Variance of the means of blocks beyond what the variance of a sample explains, where that is no chance: the mean of all
    /// is the bias of no moment then, and no number of samples makes it that.
    fn drift_variance(&self, of_a_sample: &Vector3<T>) -> Vector3<T> {
        // The 99.9 % bound of chi-square, by degrees of freedom: of three to seven there are blocks.
        const BOUNDS: [f64; 5] = [16.27, 18.47, 20.52, 22.46, 24.32];
        let sums = self.sums.get(..self.full).unwrap_or_default();
        let freedom = sums.len().saturating_sub(1);
        let Some(bound) = freedom.checked_sub(3).and_then(|at| BOUNDS.get(at)) else {
            return Vector3::zeros();
        };
        let length = lit::<T>(f64::from(self.length));
        let mean = sums.iter().sum::<Vector3<T>>() / (length * lit(sums.len() as f64));
        let squares = sums.iter().map(|sum| {
            let off = sum / length - mean;
            off.component_mul(&off)
        });
        let scatter: Vector3<T> = squares.sum::<Vector3<T>>() / lit::<T>(freedom as f64);
        scatter.zip_map(of_a_sample, |scatter, sample| {
            let noise = sample / length;
            if scatter > noise * lit(bound / freedom as f64) {
                // Of a random walk the end is off from the mean by twice the variance about that mean.
                (scatter - noise) * lit(2.0)
            } else {
                T::zero()
            }
        })
    }

    /// The difference of the means of the two halves, and the samples in each half.
    fn second_minus_first(&self) -> Option<(Vector3<T>, u32)> {
        let half = self.full / 2;
        let mut difference = Vector3::zeros();
        for (k, sum) in self.sums.iter().take(self.full).enumerate() {
            if k < half {
                difference -= sum;
            } else if k >= self.full - half {
                difference += sum;
            }
        }
        let samples = self.length.saturating_mul(u32::try_from(half).ok()?);
        (samples > 0).then(|| (difference / lit::<T>(f64::from(samples)), samples))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use rand::{RngExt, SeedableRng};
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64;
    use std::vec::Vec;

    fn samples(count: usize) -> Vec<Vector3<f64>> {
        let mut rng = Pcg64::seed_from_u64(0x0CA1_1B01);
        let mix = Matrix3::new(0.05, 0.0, 0.0, 0.02, 0.03, 0.0, -0.01, 0.0, 0.04);
        let noise = |rng: &mut Pcg64| Vector3::from_fn(|_, _| rng.sample(StandardNormal));
        (0..count)
            .map(|_| Vector3::new(9.0, -3.0, 100.0) + mix * noise(&mut rng))
            .collect()
    }

    fn gathered<T: Scalar>(samples: &[Vector3<T>]) -> Statistics<T> {
        let mut statistics = Statistics::new();
        for s in samples {
            assert!(statistics.add(s, Some(lit(0.01))));
        }
        statistics
    }

    /// White noise alone adds nothing; a bias that walks is known as well as it drifts, not as its noise averages.
    #[test]
    fn a_bias_that_drifts_is_known_no_better_than_that() {
        let (mut off, mut wider) = (0.0, 0);
        for seed in 0..40 {
            let mut rng = Pcg64::seed_from_u64(seed);
            let mut normal = || Vector3::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
            let (mut walk, mut samples) = (Vector3::zeros(), Vec::new());
            let mut white = Statistics::new();
            for _ in 0..20_000 {
                walk += normal() * 1e-5;
                let noise = normal() * 1e-3;
                samples.push(walk + noise);
                assert!(white.add(&noise, Some(0.01)));
            }
            let walked = gathered(&samples);
            let error = (walked.mean() - walk).component_div(&walked.mean_std());
            off += error.norm_squared() / 3.0 / 40.0;
            let averaged = 1e-3 / f64::sqrt(20_000.0);
            wider += usize::from(white.mean_std().max() > 1.1 * averaged);
        }
        // The bias of the end: by noise alone it would be 80 standard deviations off.
        assert!((0.2..4.0).contains(&off), "{off}");
        assert!(wider <= 2, "{wider}");
    }

    /// Oracle: the two-pass formulas over the stored samples.
    #[test]
    fn mean_and_covariance_are_those_of_two_passes() {
        for count in [2, 3, 50, 1000, 20_001] {
            let samples = samples(count);
            let mean = samples.iter().sum::<Vector3<f64>>() / count as f64;
            let covariance = samples
                .iter()
                .map(|s| (s - mean) * (s - mean).transpose())
                .sum::<Matrix3<f64>>()
                / (count - 1) as f64;
            let ours = gathered(&samples);
            assert_relative_eq!(ours.mean(), mean, epsilon = 1e-11);
            assert_relative_eq!(ours.covariance(), covariance, epsilon = 1e-13);
            assert_relative_eq!(ours.interval().unwrap(), 0.01, epsilon = 1e-12);
            let single: Vec<_> = samples.iter().map(|s| s.map(|x| x as f32)).collect();
            let single = gathered(&single);
            assert_relative_eq!(
                single.covariance().cast::<f64>(),
                covariance,
                epsilon = 2e-5
            );
        }
    }

    /// Oracle: the means of the stored halves, at counts where the blocks are exact halves.
    #[test]
    fn drift_is_the_difference_of_the_halves() {
        for count in [8, 64, 512, 4096] {
            let samples: Vec<_> = samples(count)
                .iter()
                .enumerate()
                .map(|(k, s)| s + Vector3::new(1e-3, -2e-3, 0.0) * k as f64)
                .collect();
            let (first, second) = samples.split_at(count / 2);
            let mean =
                |half: &[Vector3<f64>]| half.iter().sum::<Vector3<f64>>() / half.len() as f64;
            let (drift, _) = gathered(&samples).drift().unwrap();
            assert_relative_eq!(drift, mean(second) - mean(first), epsilon = 1e-10);
        }
    }

    #[test]
    fn noise_alone_drifts_as_much_as_predicted() {
        let samples = samples(256 * 400);
        let mut square = 0.0;
        for chunk in samples.chunks(256) {
            let (drift, noise) = gathered(chunk).drift().unwrap();
            square += drift.component_div(&noise).norm_squared() / 3.0;
        }
        // 1200 squares of unit normals: mean 1, standard deviation sqrt(2/1200) = 0.041.
        assert!((square / 400.0 - 1.0).abs() < 0.15, "{}", square / 400.0);
    }

    #[test]
    fn resolution_is_found_through_the_rounding_of_single_precision() {
        let step = 0.061_f64;
        let coarse: Vec<_> = samples(400)
            .iter()
            .map(|s| s.map(|x| f64::from(((x / step).round() * step) as f32)))
            .collect();
        let mut ours = gathered(&coarse);
        assert_relative_eq!(ours.step, Vector3::repeat(step), epsilon = 2e-5);
        // One axis falls asleep: its variance is that of the step, not zero.
        ours.products.fill(0.0);
        ours.step.z = 0.0;
        assert_relative_eq!(
            ours.covariance()[(2, 2)],
            step * step / 12.0,
            max_relative = 1e-3
        );
        assert!(!ours.is_constant());
    }

    #[test]
    fn non_finite_samples_and_intervals_change_nothing() {
        let mut ours = gathered(&samples(10));
        let before = ours;
        assert!(!ours.add(&Vector3::new(f64::NAN, 0.0, 0.0), Some(0.01)));
        assert!(!ours.add(&Vector3::new(0.0, f64::INFINITY, 0.0), None));
        assert_eq!(ours, before);
        assert!(
            ours.add(&Vector3::zeros(), Some(f64::NAN)) && ours.add(&Vector3::zeros(), Some(-1.0))
        );
        assert_relative_eq!(ours.interval().unwrap(), 0.01, epsilon = 1e-12);
    }
}
