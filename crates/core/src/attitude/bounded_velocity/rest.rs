//! Rest detection: rate and specific force stay near their own low-passes for long enough.
//!
//! At rest the rate is the bias and the velocity is zero (B13, B14).

use nalgebra::Vector3;

use super::config::BoundedVelocityConfig;
use crate::scalar::{Scalar, lit};

/// The detector's memory.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RestDetector<T: Scalar> {
    angular_rate: Option<Vector3<T>>,
    specific_force: Option<Vector3<T>>,
    rate_is_still: bool,
    still_for: T,
    resting: bool,
}

impl<T: Scalar> Default for RestDetector<T> {
    fn default() -> Self {
        Self {
            angular_rate: None,
            specific_force: None,
            rate_is_still: false,
            still_for: T::zero(),
            resting: false,
        }
    }
}

impl<T: Scalar> RestDetector<T> {
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let means = self.angular_rate.iter().chain(&self.specific_force);
        means.flatten().chain([&self.still_for])
    }

    /// Whether the device rests.
    #[inline]
    pub fn is_resting(&self) -> bool {
        self.resting
    }

    /// Takes an angular rate (rad/s, as measured) that held for `dt` seconds. `bias` is what was
    /// known of the gyroscope's at the start: a turn at constant rate is no rest.
    #[inline]
    pub(super) fn rate(
        &mut self,
        config: &BoundedVelocityConfig<T>,
        bias: &Vector3<T>,
        rate: &Vector3<T>,
        dt: T,
    ) {
        let mean = low_pass(&mut self.angular_rate, rate, dt, config.rest_average_s);
        let limit = config.rest_angular_rate;
        let largest_bias = lit::<T>(3.0) * config.initial_gyroscope_bias_std + lit(0.02);
        self.rate_is_still =
            (rate - mean).norm_squared() < limit * limit && (mean - bias).amax() < largest_bias;
        if !self.rate_is_still {
            self.wake();
        }
    }

    /// Takes a specific force (m/s^2) that stood for `dt` seconds.
    #[inline]
    pub(super) fn force(&mut self, config: &BoundedVelocityConfig<T>, force: &Vector3<T>, dt: T) {
        let mean = low_pass(&mut self.specific_force, force, dt, config.rest_average_s);
        let limit = config.rest_specific_force;
        if !(self.rate_is_still && (force - mean).norm_squared() < limit * limit) {
            self.wake();
            return;
        }
        self.still_for += dt;
        self.resting = self.still_for > config.rest_duration_s;
    }

    /// Ends a rest.
    #[inline]
    pub(super) fn wake(&mut self) {
        self.still_for = T::zero();
        self.resting = false;
    }
}

/// Moves the mean towards the sample; the first sample is its own mean.
#[inline]
fn low_pass<T: Scalar>(
    mean: &mut Option<Vector3<T>>,
    sample: &Vector3<T>,
    dt: T,
    time: T,
) -> Vector3<T> {
    let before = mean.unwrap_or(*sample);
    let after = before + (sample - before) * (dt / time).min(T::one());
    *mean = Some(after);
    after
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Feeds `seconds` of samples at 100 Hz; the share of them at rest.
    fn share(seconds: f64, sample: impl Fn(f64) -> (Vector3<f64>, Vector3<f64>)) -> f64 {
        let config = BoundedVelocityConfig::lab();
        let (mut detector, mut resting, mut all) = (RestDetector::default(), 0.0, 0.0);
        for k in 0..(seconds * 100.0) as u32 {
            let (rate, force) = sample(f64::from(k) * 0.01);
            detector.rate(&config, &Vector3::zeros(), &rate, 0.01);
            detector.force(&config, &force, 0.01);
            resting += f64::from(u8::from(detector.is_resting()));
            all += 1.0;
        }
        resting / all
    }

    #[test]
    fn a_table_is_a_rest_and_a_hand_or_a_turntable_is_none() {
        let up = Vector3::new(0.0, 0.0, 9.8);
        let table = share(10.0, |_| (Vector3::new(0.03, -0.02, 0.01), up));
        assert!((table - 0.85).abs() < 0.01, "all but 1.5 s of ten: {table}");
        let sway = |t: f64| Vector3::new(0.3 * (5.0 * t).sin(), 0.0, 0.0);
        assert!(share(10.0, |t| (sway(t), up)) < 0.01);
        assert!(share(10.0, |t| (Vector3::zeros(), up + sway(t) * 5.0)) < 0.01);
        let turntable = Vector3::new(0.0, 0.0, 0.5);
        assert!(share(10.0, |_| (turntable, up)) < 0.01);
    }

    #[test]
    fn a_known_bias_is_no_turn() {
        let config = BoundedVelocityConfig::<f64>::lab();
        let mut detector = RestDetector::default();
        let bias = Vector3::new(0.1, 0.0, 0.0);
        for _ in 0..200 {
            detector.rate(&config, &bias, &bias, 0.01);
            detector.force(&config, &Vector3::z(), 0.01);
        }
        assert!(detector.is_resting());
        detector.rate(&config, &bias, &Vector3::y(), 0.01);
        assert!(!detector.is_resting());
    }
}
