//! Noise of "velocity is near zero" (B10), learnt from the velocities that the filter is left with: a hand, somebody who
//! walks, a vehicle.

use nalgebra::{Matrix2, Vector2};

use super::config::BoundedVelocityConfig;
use crate::scalar::{Scalar, lit};

/// Averages of the velocity over times each of which is so many times longer than the one before.
const AVERAGES: usize = 3;
const LONGER: f64 = 4.0;
/// The shortest, s.
const SHORTEST_S: f64 = 0.5;

/// What is known of the velocity of whatever carries the device.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct VelocityNoise<T: Scalar> {
    /// Of the velocity, m/s, east and north.
    averages: [Vector2<T>; AVERAGES],
    /// What velocities showed that lasted, m^2/s.
    seen: T,
    /// What the last ones would be if they lasted, m^2/s.
    expected: T,
}

impl<T: Scalar> VelocityNoise<T> {
    /// Before anything is known.
    pub(super) fn new(config: &BoundedVelocityConfig<T>) -> Self {
        Self {
            averages: [Vector2::zeros(); AVERAGES],
            seen: T::zero(),
            expected: (config.initial_velocity_psd).min(config.largest_velocity_psd),
        }
    }

    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let densities = [&self.seen, &self.expected];
        self.averages.iter().flatten().chain(densities)
    }

    /// What velocities showed, m^2/s; [`Self::set_densities`] gives it back.
    pub(super) fn densities(&self) -> [T; 2] {
        [self.seen, self.expected]
    }

    pub(super) fn set_densities(&mut self, [seen, expected]: [T; 2]) {
        *self = Self {
            averages: [Vector2::zeros(); AVERAGES],
            seen,
            expected,
        };
    }

    /// Its power spectral density, m^2/s (B11c).
    #[inline]
    pub fn psd(&self) -> T {
        self.seen.max(self.expected)
    }

    /// Takes a velocity (m/s) in motion before it is corrected, its covariance, and the time since the last one (B11b).
    #[inline]
    pub(super) fn learn(
        &mut self,
        config: &BoundedVelocityConfig<T>,
        velocity: &Vector2<T>,
        covariance: &Matrix2<T>,
        dt: T,
    ) {
        let most = config.largest_velocity_psd;
        let unknown = covariance.trace() * config.velocity_excess;
        let fade = |value: T, time: T| value - value * (dt / time).min(T::one());
        self.seen = fade(self.seen, config.velocity_memory_s);
        self.expected = fade(self.expected, config.velocity_correlation_time_s);
        let mut average_s: T = lit(SHORTEST_S);
        for (k, average) in self.averages.iter_mut().enumerate() {
            *average += (velocity - *average) * (dt / average_s).min(T::one());
            // Mean square of a component, a half, times twice the time that it lasts.
            let square = average.norm_squared() - unknown;
            self.seen = self.seen.max((square * average_s).min(most));
            if k == 0 {
                let lasting = square * config.velocity_correlation_time_s;
                self.expected = self.expected.max(lasting.min(most));
            }
            average_s *= lit(LONGER);
        }
    }

    /// A rest: what moved before has come to its end.
    #[inline]
    pub(super) fn rest(&mut self) {
        self.averages = [Vector2::zeros(); AVERAGES];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn after(seconds: f64, velocity: impl Fn(f64) -> f64) -> VelocityNoise<f64> {
        let config = BoundedVelocityConfig::lab();
        let mut noise = VelocityNoise::new(&config);
        for k in 0..(50.0 * seconds) as u32 {
            let v = Vector2::new(velocity(0.02 * f64::from(k)), 0.0);
            noise.learn(&config, &v, &(Matrix2::identity() * 0.01), 0.02);
        }
        noise
    }

    #[test]
    fn a_velocity_that_lasts_is_learnt_and_remembered_longer_than_one_that_does_not() {
        let config = BoundedVelocityConfig::<f64>::lab();
        let quiet = after(60.0, |_| 0.0).psd();
        assert!(quiet < 0.01 * config.initial_velocity_psd, "{quiet}");
        let swaying = after(60.0, |t| 0.3 * (6.0 * t).sin()).psd();
        assert!(swaying < 0.01 * config.largest_velocity_psd, "{swaying}");
        let driving = after(60.0, |_| 5.0).psd();
        assert!(
            (driving / config.largest_velocity_psd - 1.0).abs() < 1e-9,
            "{driving}"
        );
        let then_quiet = after(60.0, |t| if t < 30.0 { 5.0 } else { 0.0 }).psd();
        assert!(
            then_quiet > 0.3 * config.largest_velocity_psd,
            "{then_quiet}"
        );
    }

    #[test]
    fn a_velocity_that_the_filter_does_not_know_itself_is_none() {
        let config = BoundedVelocityConfig::<f64>::lab();
        let mut noise = VelocityNoise::new(&config);
        for _ in 0..1000 {
            noise.learn(
                &config,
                &Vector2::new(1.0, -1.0),
                &Matrix2::identity(),
                0.02,
            );
        }
        assert!(noise.psd() < 0.3 * config.initial_velocity_psd, "{noise:?}");
    }
}
