//! White noise of a gyroscope, learnt from the fourth differences of its samples.
//!
//! Motion is smooth from sample to sample, noise is not: four times differenced, white noise of variance `s^2` has `70 s^2`, a
//! motion of frequency `f` only the share `(2 sin(pi f / rate))^8` of its square (`docs/derivations/faults.md`, F19). The quietest of the last
//! stretches of samples says how much noise there is at most. What is left of a motion that is too fast for the rate is an error of the
//! integral, too.

use nalgebra::Vector3;

use crate::scalar::{Scalar, lit};

/// Sum of the squares of the coefficients 1, -4, 6, -4, 1.
const SQUARES: f64 = 70.0;
/// Samples of a stretch, and stretches of which the quietest counts.
const STRETCH: u16 = 64;
const STRETCHES: usize = 4;

/// Learns the noise of a gyroscope.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RateNoise<T: Scalar> {
    /// The last sample and its first three differences.
    last: [Vector3<T>; 4],
    /// How many of these are known.
    known: u8,
    /// Of the stretch under way: samples, and squares of their fourth differences.
    samples: u16,
    sum: T,
    /// Power spectral densities of the last stretches, (rad/s)^2/Hz, the newest last; how many there were.
    stretches: [T; STRETCHES],
    count: u8,
}

impl<T: Scalar> Default for RateNoise<T> {
    fn default() -> Self {
        Self {
            last: [Vector3::zeros(); 4],
            known: 0,
            samples: 0,
            sum: T::zero(),
            stretches: [T::zero(); STRETCHES],
            count: 0,
        }
    }
}

impl<T: Scalar> RateNoise<T> {
    /// Takes a sample (rad/s) and the usual interval (s). Whether there is something new to be known.
    #[inline]
    pub fn add(&mut self, rate: &Vector3<T>, interval: T) -> bool {
        let mut difference = *rate;
        for (k, last) in self.last.iter_mut().enumerate() {
            let before = core::mem::replace(last, difference);
            if k >= usize::from(self.known) {
                self.known += 1;
                return false;
            }
            difference -= before;
        }
        self.sum += difference.norm_squared();
        self.samples = self.samples.saturating_add(1);
        if self.samples < STRETCH {
            return false;
        }
        let psd = self.sum * interval * lit(1.0 / (3.0 * SQUARES * STRETCH as f64));
        self.samples = 0;
        self.sum = T::zero();
        if psd.is_finite() {
            self.stretches.rotate_left(1);
            self.stretches[STRETCHES - 1] = psd;
            self.count = self.count.saturating_add(1).min(STRETCHES as u8);
        }
        true
    }

    /// The samples before the next one are others than those just before it in time: a hole, a fault.
    pub fn interrupt(&mut self) {
        self.known = 0;
    }

    /// Its power spectral density, (rad/s)^2/Hz; zero before it is known.
    pub fn psd(&self) -> T {
        if usize::from(self.count) < STRETCHES {
            return T::zero();
        }
        self.stretches
            .iter()
            .copied()
            .fold(self.stretches[0], T::min)
    }

    /// The numbers, for checks of a saved state.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = &T> {
        let vectors = self.last.iter().flatten();
        vectors.chain(&self.stretches).chain([&self.sum])
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt as _;
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64;

    use super::*;

    /// Density that is learnt from noise of this density on a motion, rad/s/sqrt(Hz).
    fn learnt(density: f64, rate_hz: f64, motion: impl Fn(f64) -> f64) -> f64 {
        let mut draws = Pcg64::new(1, 2);
        let mut noise = RateNoise::default();
        let std = density * rate_hz.sqrt();
        for k in 0..1000 {
            let mut normal = || std * draws.sample::<f64, _>(StandardNormal);
            let white = Vector3::new(normal(), normal(), normal());
            let moved = Vector3::new(1.0, -0.5, 0.2) * motion(f64::from(k) / rate_hz);
            noise.add(&(white + moved), 1.0 / rate_hz);
        }
        noise.psd().sqrt()
    }

    #[test]
    fn noise_is_found_under_motion() {
        for rate_hz in [60.0, 100.0, 500.0] {
            for density in [1e-3, 1e-2] {
                let still = learnt(density, rate_hz, |_| 0.0);
                assert!((still / density - 1.0).abs() < 0.3, "{still}");
                // Two turns a second, to and fro.
                let moved = learnt(density, rate_hz, |t| 3.0 * (12.0 * t).sin());
                assert!((moved / density - 1.0).abs() < 0.5, "{rate_hz}: {moved}");
            }
        }
    }

    #[test]
    fn nothing_is_known_early_and_a_hole_is_no_noise() {
        let mut noise = RateNoise::<f64>::default();
        for k in 0..1000 {
            if k % 50 == 0 {
                noise.interrupt();
            }
            let rate = Vector3::repeat(f64::from(k / 50));
            noise.add(&rate, 0.01);
            assert!(noise.psd() <= 0.0);
        }
    }
}
