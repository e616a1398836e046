//! Noise of the inertial samples as they show it themselves: what a vehicle shakes, the filter must expect.
//!
//! Second differences see vibration and noise and leave motion out: white noise of variance `s^2` gives them `6 s^2`, a
//! motion of some hertz next to nothing.

use nalgebra::Vector3;

use crate::scalar::{Scalar, lit};

/// Time over which it is averaged, s.
const AVERAGED_OVER_S: f64 = 2.0;
/// What white noise is multiplied by in the variance of a second difference.
const SECOND_DIFFERENCE: f64 = 6.0;

/// The noise of gyroscope and accelerometer.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Vibration<T: Scalar> {
    /// The last two samples of angular rate and specific force, the newest first.
    last: [[Vector3<T>; 2]; 2],
    samples: u32,
    /// Noise power densities, (rad/s)^2/Hz and (m/s^2)^2/Hz, mean of the axes.
    densities: [T; 2],
}

impl<T: Scalar> Default for Vibration<T> {
    fn default() -> Self {
        Self {
            last: [[Vector3::zeros(); 2]; 2],
            samples: 0,
            densities: [T::zero(); 2],
        }
    }
}

impl<T: Scalar> Vibration<T> {
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let last = self.last.iter().flatten().flatten();
        last.chain(&self.densities)
    }

    /// Takes a sample as it was read, `dt` after the one before.
    pub(super) fn add(&mut self, rate: &Vector3<T>, force: &Vector3<T>, dt: T) {
        let before = self.samples;
        self.samples = before.saturating_add(1);
        let taken = lit::<T>(f64::from(before.saturating_sub(1)));
        let share = (dt / lit(AVERAGED_OVER_S)).max(T::one() / taken.max(T::one()));
        let newest = [rate, force];
        for ((last, density), new) in self.last.iter_mut().zip(&mut self.densities).zip(newest) {
            if before >= 2 {
                let second = new - last[0] * lit::<T>(2.0) + last[1];
                let power = second.norm_squared() * dt / lit(3.0 * SECOND_DIFFERENCE);
                *density += (power - *density) * share.min(T::one());
            }
            *last = [*new, last[0]];
        }
    }

    /// Noise densities of gyroscope and accelerometer, (rad/s)/sqrt(Hz) and (m/s^2)/sqrt(Hz), each at least as stated.
    pub(super) fn noise_densities(&self, stated: [T; 2]) -> [T; 2] {
        let [gyroscope, accelerometer] = self.densities.map(|power| power.max(T::zero()).sqrt());
        [stated[0].max(gyroscope), stated[1].max(accelerometer)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};
    use rand_pcg::Pcg64Mcg;

    #[test]
    fn white_noise_is_found_and_a_manoeuvre_is_none() {
        let mut random = Pcg64Mcg::seed_from_u64(3);
        let mut noise = |std: f64| {
            Vector3::from_fn(|_, _| {
                let drawn: f64 = StandardNormal.sample(&mut random);
                drawn * std
            })
        };
        let mut vibration = Vibration::<f64>::default();
        for k in 0..2000 {
            let t = f64::from(k) * 0.01;
            // 3 m/s^2 at half a hertz, and a turn.
            let force = Vector3::new(3.0 * (3.0 * t).sin(), 0.0, -9.8) + noise(0.2);
            let rate = Vector3::z() * t.sin() + noise(0.01);
            vibration.add(&rate, &force, 0.01);
        }
        let [rate, force] = vibration.noise_densities([0.0; 2]);
        assert_relative_eq!(force, 0.02, max_relative = 0.15);
        assert_relative_eq!(rate, 0.001, max_relative = 0.15);
        let stated = vibration.noise_densities([0.1, 0.2]);
        assert_relative_eq!(stated[0], 0.1);
        assert_relative_eq!(stated[1], 0.2);
    }
}
