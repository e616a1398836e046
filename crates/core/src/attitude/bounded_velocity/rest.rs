//! Rest detection: rate and specific force stay near their own averages for long enough; what they do slowly limits how
//! much a rest says.
//!
//! At rest the rate is the bias and the velocity is zero (B13, B14).

use nalgebra::Vector3;

use super::config::BoundedVelocityConfig;
use crate::scalar::{Scalar, lesser, lit};

/// The slow averages are so many times slower than those that find a rest.
const SLOWER: f64 = 4.0;
/// They are by this much, at least, in times of the faster ones, before the two are compared.
const LEAST_LAG: f64 = 0.2;

/// Exponential averages of a sensor's vector over three times.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Averages<T: Scalar> {
    /// Over [`BoundedVelocityConfig::rest_smoothing_s`]: noise and vibration are no motion.
    smooth: Vector3<T>,
    /// Over [`BoundedVelocityConfig::rest_average_s`].
    average: Vector3<T>,
    /// Over all that was still until now, and at most [`SLOWER`] times that.
    slow: Vector3<T>,
    /// Since when it is still, and how old the samples of `slow` are on average, s.
    still_for: T,
    slow_lag: T,
}

/// The detector's memory.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RestDetector<T: Scalar> {
    angular_rate: Option<Averages<T>>,
    specific_force: Option<Averages<T>>,
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

impl<T: Scalar> Averages<T> {
    /// The averages after a sample that stood for `dt` seconds; the first sample is its own average.
    #[inline]
    fn with(
        before: Option<Self>,
        sample: &Vector3<T>,
        dt: T,
        config: &BoundedVelocityConfig<T>,
    ) -> Self {
        let before = before.unwrap_or(Self {
            smooth: *sample,
            average: *sample,
            slow: *sample,
            still_for: T::zero(),
            slow_lag: T::zero(),
        });
        let share = |time: T| lesser(dt / time, T::one());
        let towards = |mean: Vector3<T>, share: T| mean + (sample - mean) * share;
        let still_for = before.still_for + dt;
        let slowest = config.rest_average_s * lit(SLOWER);
        // A sample that stood for no time is the first of all.
        let of_slow = match still_for > T::zero() {
            true => share(lesser(still_for, slowest)),
            false => T::one(),
        };
        Self {
            smooth: towards(before.smooth, share(config.rest_smoothing_s)),
            average: towards(before.average, share(config.rest_average_s)),
            slow: towards(before.slow, of_slow),
            still_for,
            slow_lag: (before.slow_lag + dt) * (T::one() - of_slow),
        }
    }

    /// Whether it stays nearer to its average than `limit`.
    #[inline]
    fn is_still(&self, limit: T) -> bool {
        (self.smooth - self.average).norm_squared() < limit * limit
    }

    /// Square of how far the average is from the slow one, as if that had its full length already: what changes steadily moves the
    /// two apart by as much as they lag.
    #[inline]
    fn drift2(&self, config: &BoundedVelocityConfig<T>) -> T {
        let average = config.rest_average_s;
        let lag = (self.slow_lag - average).max(average * lit(LEAST_LAG));
        let factor = average * lit(SLOWER - 1.0) / lag;
        (self.average - self.slow).norm_squared() * (factor * factor)
    }

    /// It is not still: the slow average begins anew with the next sample.
    fn wake(&mut self) {
        self.still_for = T::zero();
        self.slow_lag = T::zero();
    }

    fn numbers(&self) -> impl Iterator<Item = &T> {
        let vectors = self.smooth.iter().chain(&self.average).chain(&self.slow);
        vectors.chain([&self.still_for, &self.slow_lag])
    }
}

impl<T: Scalar> RestDetector<T> {
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let averages = self.angular_rate.iter().chain(&self.specific_force);
        averages
            .flat_map(Averages::numbers)
            .chain([&self.still_for])
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
        let rate = Averages::with(self.angular_rate, rate, dt, config);
        let largest_bias = lit::<T>(3.0) * config.initial_gyroscope_bias_std + lit(0.02);
        self.rate_is_still =
            rate.is_still(config.rest_angular_rate) && (rate.average - bias).amax() < largest_bias;
        self.angular_rate = Some(rate);
        if !self.rate_is_still {
            self.wake();
        }
    }

    /// Takes a specific force (m/s^2) that stood for `dt` seconds.
    #[inline]
    pub(super) fn force(&mut self, config: &BoundedVelocityConfig<T>, force: &Vector3<T>, dt: T) {
        let force = Averages::with(self.specific_force, force, dt, config);
        let still = self.rate_is_still && force.is_still(config.rest_specific_force);
        self.specific_force = Some(force);
        if !still {
            self.wake();
            return;
        }
        self.still_for += dt;
        self.resting = self.still_for > config.rest_duration_s;
    }

    /// Power spectral densities of what may be going on at a rest all the same (B14b, B14c): of a turn, (rad/s)^2/Hz, which
    /// shows in a rate that changes and in a specific force of length `gravity` that turns, and of a velocity, m^2/s, which
    /// shows in a specific force that changes.
    #[inline]
    pub(super) fn slow_motion_psd(&self, config: &BoundedVelocityConfig<T>, gravity: T) -> (T, T) {
        let (Some(rate), Some(force)) = (&self.angular_rate, &self.specific_force) else {
            return (T::zero(), T::zero());
        };
        let lasts = config.rest_average_s * lit(SLOWER);
        let swept = gravity * (lasts - config.rest_average_s);
        let force2 = force.drift2(config);
        let rate2 = rate.drift2(config) + force2 / (swept * swept);
        let twice = config.rest_slow_motion_gain * lasts * lit(2.0);
        (rate2 * twice, force2 * lasts * lasts * twice)
    }

    /// Mean rate of the last moments (rad/s, as measured), over how long it averages white noise, s, and how long a change of it
    /// passes for a slow turn, s.
    #[inline]
    pub(super) fn mean_rate(
        &self,
        config: &BoundedVelocityConfig<T>,
    ) -> Option<(Vector3<T>, [T; 2])> {
        let rate = self.angular_rate.as_ref()?;
        let time = config.rest_average_s * lit(2.0);
        Some((rate.average, [time, time * lit(SLOWER)]))
    }

    /// Ends a rest.
    #[inline]
    pub(super) fn wake(&mut self) {
        let averages = self.angular_rate.iter_mut().chain(&mut self.specific_force);
        averages.for_each(Averages::wake);
        self.still_for = T::zero();
        self.resting = false;
    }
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

    /// What a rest of `seconds` still leaves open of a turn, (rad/s)^2/Hz, and of a velocity, m^2/s.
    fn left_open(seconds: f64, sample: impl Fn(f64) -> (Vector3<f64>, Vector3<f64>)) -> (f64, f64) {
        let config = BoundedVelocityConfig::lab();
        let mut detector = RestDetector::default();
        for k in 0..(seconds * 100.0) as u32 {
            let (rate, force) = sample(f64::from(k) * 0.01);
            detector.rate(&config, &Vector3::zeros(), &rate, 0.01);
            detector.force(&config, &force, 0.01);
        }
        assert!(detector.is_resting());
        detector.slow_motion_psd(&config, 9.8)
    }

    #[test]
    fn a_turn_that_begins_slowly_is_not_taken_for_a_bias() {
        let config = BoundedVelocityConfig::<f64>::lab();
        let density2 = config.rest_rate_noise_density * config.rest_rate_noise_density;
        let up = Vector3::new(0.0, 0.0, 9.8);
        let (table, still) = left_open(10.0, |_| (Vector3::new(0.03, -0.02, 0.01), up));
        assert!(table < 1e-3 * density2 && still < 1e-6, "{table} {still}");
        // About up, faster and faster, by 0.5 deg/s^2: three degrees a second at the end.
        let about_up = left_open(6.0, |t| (Vector3::z() * (0.0087 * t), up));
        assert!(about_up.0 > 100.0 * density2, "{about_up:?}");
        // Steadily, at a rate that a bias could have: gravity turns.
        let turned = |t: f64| Vector3::new(0.0, 9.8 * (0.02 * t).sin(), 9.8 * (0.02 * t).cos());
        let tipping = left_open(6.0, |t| (Vector3::x() * -0.02, turned(t)));
        assert!(tipping.0 > 100.0 * density2, "{tipping:?}");
        assert!(tipping.1 > 100.0 * config.rest_velocity_psd, "{tipping:?}");
    }

    /// GIVEN a device that was turned and put down, and a noisy gyroscope WHEN it has lain for four seconds THEN the motion before
    /// is no slow turn.
    #[test]
    fn what_was_before_a_rest_is_no_slow_turn() {
        let config = BoundedVelocityConfig::<f64>::lab();
        let density2 = config.rest_rate_noise_density * config.rest_rate_noise_density;
        let up = Vector3::new(0.0, 0.0, 9.8);
        let noise = |t: f64| Vector3::x() * (2e-3 * (1e4 * t).sin());
        let turned = |t: f64| if t < 2.0 { 0.6 } else { 0.0 };
        let put_down = left_open(6.0, |t| (Vector3::z() * turned(t) + noise(t), up));
        assert!(put_down.0 < density2, "{put_down:?}");
        // The very first sample is a noisy one, too.
        let first = |t: f64| if t < 0.005 { 0.02 } else { 0.0 };
        let begun = left_open(3.0, |t| (Vector3::z() * first(t), up));
        assert!(begun.0 < density2, "{begun:?}");
    }

    #[test]
    fn noise_and_vibration_are_no_motion() {
        let up = Vector3::new(0.0, 0.0, 9.8);
        let engine = |t: f64| Vector3::new(0.06, 0.05, 0.04) * (190.0 * t).sin();
        let share = share(10.0, |t| (engine(t), up + engine(t) * 10.0));
        assert!(share > 0.8, "{share}");
    }
}
