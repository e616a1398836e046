//! White noise of a sensor, from the samples alone: fourth differences in the quietest windows.
//!
//! A motion is smooth from one sample to the next and white noise is not, so differences of a high order leave the noise. Of white
//! noise with variance `v` the difference of order `k` has the variance `v (2k)! / (k!)^2`, whatever `k`: where two orders
//! disagree, what is left is a vibration, and nothing is said of the noise. Nor is it where the samples before
//! predict (`prediction.rs`) the next one better than that: so does a rotor or an engine. Noise is there all the time, a motion
//! is not, so the quietest quarter of the windows tells.

use nalgebra::Vector3;

use super::prediction::Prediction;

/// Differences of a window: few enough to fit between two steps of a walk, enough for a variance within 15 %.
const WINDOW: u32 = 40;
/// Fewer windows say nothing.
const FEWEST: u64 = 12;
/// The quietest share of the windows.
const QUIETEST: f64 = 0.25;
/// The standard deviation that the quietest quarter of windows of pure white noise shows: the mean of the lowest quarter of a normal
/// distribution is 1.27 standard deviations low, and the variance of a window is known to 15 to 20 %.
const QUIETER: f64 = 0.9;
/// Orders agree within this factor of the variance: three standard deviations of what two orders differ by chance in
/// [`FEWEST`] / 4 windows.
const AGREE: f64 = 1.3;
/// Less than this share of the variance is left where a vibration is predicted; of white noise all is.
const PREDICTED: f64 = 0.6;
/// Variances of differences of white noise of orders three and four.
const THIRD: f64 = 20.0;
const FOURTH: f64 = 70.0;

/// The white noise found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseLevel {
    /// Standard deviation of a sample, per axis, in the sensor's unit.
    pub std: f64,
    /// One standard deviation of that, as a share of it.
    pub relative_std: f64,
}

/// Watches the samples of one sensor.
#[derive(Debug, Clone, Default)]
pub struct WhiteNoise {
    last: [Vector3<f64>; 4],
    held: usize,
    third: f64,
    fourth: f64,
    count: u32,
    quiet: Quietest<2>,
    prediction: Prediction,
}

impl WhiteNoise {
    /// Takes the next sample; `broken` after a pause, over which no difference is taken.
    pub fn add(&mut self, v: &Vector3<f64>, broken: bool) {
        if broken {
            self.held = 0;
            self.prediction.begin();
        }
        let [a, b, c, d] = self.last;
        self.last = [b, c, d, *v];
        if self.held < 4 {
            self.held += 1;
            return;
        }
        let third = v - d * 3.0 + c * 3.0 - b;
        self.third += third.norm_squared() / (3.0 * THIRD);
        let fourth = third - (d - c * 3.0 + b * 3.0 - a);
        let square = fourth.norm_squared() / (3.0 * FOURTH);
        self.fourth += square;
        self.prediction.add(v, square);
        self.count += 1;
        if self.count >= WINDOW {
            let n = f64::from(self.count);
            self.quiet.add([self.fourth / n, self.third / n]);
            (self.third, self.fourth, self.count) = (0.0, 0.0, 0);
        }
    }

    /// The noise, where it is white.
    #[must_use]
    pub fn level(&self) -> Option<NoiseLevel> {
        let (windows, [fourth, third]) = self.quiet.mean()?;
        let unpredicted = self.prediction.variance()?;
        let agree = third < AGREE * fourth && fourth < AGREE * third;
        (agree && unpredicted > PREDICTED * fourth)
            .then(|| NoiseLevel::of(fourth, windows, f64::from(WINDOW)))
    }

    /// Standard deviation of what is left in the quietest windows, white or not: no noise is larger.
    #[must_use]
    pub fn most(&self) -> Option<f64> {
        Some(self.quiet.mean()?.1[0].sqrt())
    }
}

impl NoiseLevel {
    /// From the mean variance of so many windows of so many differences.
    pub(super) fn of(variance: f64, windows: f64, each: f64) -> Self {
        // Neighbouring differences share samples: about a third of the squares are independent.
        Self {
            std: variance.sqrt() / QUIETER,
            relative_std: (2.0 * windows * each).sqrt().recip() * 3.0_f64.sqrt(),
        }
    }
}

/// Finest of the bins, and how many to a doubling of the variance.
const LEAST: f64 = 1e-14;
const EACH: f64 = 4.0;
const BINS: usize = 240;

/// The mean of the quietest windows, in constant memory: a histogram of the first value with the sums of all.
#[derive(Debug, Clone)]
pub(super) struct Quietest<const N: usize> {
    bins: Vec<(u64, [f64; N])>,
    windows: u64,
}

impl<const N: usize> Default for Quietest<N> {
    fn default() -> Self {
        Self {
            bins: Vec::new(),
            windows: 0,
        }
    }
}

impl<const N: usize> Quietest<N> {
    pub(super) fn add(&mut self, values: [f64; N]) {
        if self.bins.is_empty() {
            self.bins = vec![(0, [0.0; N]); BINS];
        }
        let at = (EACH * (values[0] / LEAST).max(1.0).log2()) as usize;
        let (count, sums) = &mut self.bins[at.min(BINS - 1)];
        *count += 1;
        for (sum, value) in sums.iter_mut().zip(values) {
            *sum += value;
        }
        self.windows += 1;
    }

    /// How many windows are the quietest ones, and their means.
    pub(super) fn mean(&self) -> Option<(f64, [f64; N])> {
        if self.windows < FEWEST {
            return None;
        }
        let (mut taken, mut means) = (0, [0.0; N]);
        for (count, sums) in &self.bins {
            taken += count;
            for (mean, sum) in means.iter_mut().zip(sums) {
                *mean += sum;
            }
            if taken as f64 >= QUIETEST * self.windows as f64 {
                break;
            }
        }
        Some((taken as f64, means.map(|sum| sum / taken as f64)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_simulation::random::{normal_vector, stream};

    fn level_of(std: f64, motion: impl Fn(f64) -> Vector3<f64>) -> Option<NoiseLevel> {
        let mut noise = stream(9, "white");
        let mut white = WhiteNoise::default();
        for k in 0..6000 {
            let v = motion(f64::from(k) * 0.01) + normal_vector(&mut noise, std);
            white.add(&v, false);
        }
        white.level()
    }

    #[test]
    fn noise_under_a_motion_is_found_with_its_size() {
        let swing = |t: f64| Vector3::new((6.0 * t).sin(), (9.0 * t).cos(), (4.0 * t).sin()) * 4.0;
        for std in [0.003, 0.05, 1.0] {
            let found = level_of(std, swing).unwrap();
            assert!((found.std / std - 1.0).abs() < 0.12, "{std}: {found:?}");
            assert!(found.relative_std < 0.05, "{found:?}");
        }
    }

    #[test]
    fn a_vibration_is_no_white_noise() {
        let rotor = |t: f64| Vector3::new((190.0 * t).sin(), (150.0 * t).cos(), (90.0 * t).sin());
        assert_eq!(level_of(0.02, rotor), None);
        assert_eq!(level_of(0.02, |t| rotor(t) * 5.0), None);
    }
}
