//! Settings shared by the attitude filters: noise, gates, initial uncertainty.
//!
//! One structure for MEKF, USQUE and quaternion EKF, so that a comparison compares filters and
//! not settings. Every field says what raising it does.

use core::fmt;

use nalgebra::Vector3;

use crate::kalman::Gate;
use crate::scalar::{Scalar, lit};

/// How a filter uses the magnetometer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "kebab-case")
)]
pub enum MagnetometerUse {
    /// All three components against the reference field (the paper): a wrong field tilts the
    /// estimate too.
    #[default]
    Vector,
    /// Only the direction of its horizontal part: a wrong field can turn the heading, never the
    /// tilt.
    Heading,
}

/// How the gyroscope's noise becomes process noise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "kebab-case")
)]
pub enum ProcessNoise {
    /// The density is the density: `Q_d = density^2 dt`.
    #[default]
    Discrete,
    /// The paper's eq (21) read literally, with the sample covariance of the gyroscope as the
    /// continuous `Q`: `Q_d = (density^2 / sample interval) dt`. It overstates the noise by one
    /// over the sample interval (100 times at 100 Hz); for comparison only.
    PaperLiteral,
}

/// What the additive quaternion EKF does about the norm of its four components.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "kebab-case")
)]
pub enum QuaternionNorm {
    /// The covariance is projected as the quaternion is normalised: nothing along it is uncertain.
    #[default]
    Projected,
    /// The textbook's, and the paper's on the cascade: the quaternion is normalised, the covariance is
    /// not told. It keeps a fifth uncertain direction, which swallows errors of length; for comparison.
    Free,
}

/// Settings of an attitude filter. Public, serialisable; [`Default`] is a phone in a lab that is
/// moved gently, [`AttitudeConfig::hand_held`] is a phone or wearable in real use.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(
        default,
        deny_unknown_fields,
        bound(
            serialize = "T: serde::Serialize",
            deserialize = "T: Scalar + serde::Deserialize<'de>"
        )
    )
)]
pub struct AttitudeConfig<T> {
    /// White noise of the gyroscope, rad/s/sqrt(Hz), default 5e-4 (0.005 rad/s per sample at
    /// 100 Hz). Raising it trusts the gyroscope less: faster corrections, noisier attitude.
    pub gyroscope_noise_density: T,
    /// How that noise enters the covariance, default `discrete`; `paper-literal` reproduces the
    /// paper's reading and its pessimism.
    pub process_noise: ProcessNoise,
    /// Interval between gyroscope samples, s, default 0.01. Only `paper-literal` needs it.
    pub gyroscope_sample_interval_s: T,
    /// Extra angle noise per rate, rad/(rad/s)/sqrt(s), default 0: stands for scale and
    /// misalignment errors. Raising it widens the covariance during fast motion only.
    pub gyroscope_scale_noise: T,
    /// Random walk of the gyroscope bias, rad/s/sqrt(s), default 2e-4. Raising it lets the bias
    /// follow faster, and be fooled faster by accelerations and magnetic disturbance.
    pub gyroscope_bias_random_walk: T,
    /// Accelerometer error per sample and axis, m/s^2, default 0.05 (rest noise; a hand-held
    /// device accelerates: 0.3 to 0.5 and more). Raising it trusts gravity less.
    pub accelerometer_std: T,
    /// NIS above which an accelerometer sample is refused, default 11.34 (99 % of 3 degrees of
    /// freedom); 0 turns the gate off. Raising it lets more disturbed samples in.
    pub accelerometer_gate_nis: T,
    /// Time over which accelerometer errors stay correlated, s, default 0 (white). A sample that
    /// comes sooner after the last is worth only that share of an independent one. Raising it
    /// smooths over longer accelerations.
    pub accelerometer_correlation_time_s: T,
    /// Adds `gain * (|f| - g)^2` to the accelerometer variance, default 0 (off). Raising it
    /// trusts samples whose length is not g less.
    pub accelerometer_norm_gain: T,
    /// Magnetometer error per sample and axis, microtesla, default 0.5 (rest noise; 2 to 3 with
    /// soft iron and indoor fields). Raising it trusts the field less.
    pub magnetometer_std_ut: T,
    /// NIS above which a magnetometer sample is refused, default 11.34 (99 % of 3 degrees of
    /// freedom; 6.63 is 99 % for `heading`); 0 turns the gate off.
    pub magnetometer_gate_nis: T,
    /// As for the accelerometer, default 0 s.
    pub magnetometer_correlation_time_s: T,
    /// Adds `gain * deviation^2` to the magnetometer variance, default 0 (off). The deviation is
    /// that of the field's strength, for `heading` that of its strength and dip.
    pub magnetometer_norm_gain: T,
    /// Whether the whole field vector or only its heading is used, default `vector`.
    pub magnetometer_use: MagnetometerUse,
    /// Smallest standard deviation of a compass heading, rad, default 0.1; what the device states
    /// counts where it is larger. Raising it trusts the compass less.
    pub compass_std: T,
    /// NIS above which a compass heading is refused, default 6.63 (99 % of 1 degree of freedom); 0
    /// turns the gate off.
    pub compass_gate_nis: T,
    /// As for the accelerometer, default 1 s: a compass is slow and filtered. Raising it lets the
    /// heading follow the compass less.
    pub compass_correlation_time_s: T,
    /// Seconds of nothing but rejections after which a gate inflates instead, default 3. Raising
    /// it survives longer disturbances and recovers later from a wrong state.
    pub gate_timeout_s: T,
    /// Standard deviation of the initial tilt per axis, rad, default 0.1.
    pub initial_tilt_std: T,
    /// Standard deviation of the initial heading, rad, default 0.1.
    pub initial_heading_std: T,
    /// Standard deviation of the initial gyroscope bias per axis, rad/s, default 0.02. Raising it
    /// lets the filter learn a large bias, at the price of a slower start.
    pub initial_gyroscope_bias_std: T,
    /// Largest attitude standard deviation per axis, rad, default 1.8: beyond it nothing is known
    /// anyway, and single precision fails. A quaternion EKF of free norm has no axes and keeps none.
    pub maximum_attitude_std: T,
    /// What the additive quaternion EKF does about the norm, default `projected`; `free` is the
    /// textbook's. No other filter has the choice.
    pub quaternion_norm: QuaternionNorm,
    /// Gain `k_P` of a complementary filter, 1/s, default 1: errors go as `exp(-k_P t)`. Raising it
    /// follows the vectors faster, noise and accelerations included. At most 10.
    pub complementary_attitude_gain: T,
    /// Gain `k_I` of its gyroscope bias, 1/s^2, default 0.3 (damping `k_P / (2 sqrt(k_I))`).
    /// Raising it learns the bias faster, and accelerations as a bias; 0 keeps the bias.
    pub complementary_bias_gain: T,
    /// Weight of the accelerometer in a complementary filter, default 1.
    pub complementary_accelerometer_weight: T,
    /// Weight of the magnetometer, or compass, in a complementary filter, default 1.
    pub complementary_magnetometer_weight: T,
    /// A field whose strength is off by more than this share of the reference's is left out of a
    /// complementary filter, default 0.3. Raising it lets more disturbed samples in.
    pub complementary_field_tolerance: T,
    /// Largest bias per axis in a complementary filter, rad/s, default 0.2: what winds up beyond is
    /// no bias.
    pub complementary_bias_limit: T,
}

impl<T: Scalar> Default for AttitudeConfig<T> {
    fn default() -> Self {
        Self {
            gyroscope_noise_density: lit(5e-4),
            process_noise: ProcessNoise::Discrete,
            gyroscope_sample_interval_s: lit(0.01),
            gyroscope_scale_noise: T::zero(),
            gyroscope_bias_random_walk: lit(2e-4),
            accelerometer_std: lit(0.05),
            accelerometer_gate_nis: lit(11.34),
            accelerometer_correlation_time_s: T::zero(),
            accelerometer_norm_gain: T::zero(),
            magnetometer_std_ut: lit(0.5),
            magnetometer_gate_nis: lit(11.34),
            magnetometer_correlation_time_s: T::zero(),
            magnetometer_norm_gain: T::zero(),
            magnetometer_use: MagnetometerUse::Vector,
            compass_std: lit(0.1),
            compass_gate_nis: lit(6.63),
            compass_correlation_time_s: T::one(),
            gate_timeout_s: lit(3.0),
            initial_tilt_std: lit(0.1),
            initial_heading_std: lit(0.1),
            initial_gyroscope_bias_std: lit(0.02),
            maximum_attitude_std: lit(1.8),
            quaternion_norm: QuaternionNorm::Projected,
            complementary_attitude_gain: T::one(),
            complementary_bias_gain: lit(0.3),
            complementary_accelerometer_weight: T::one(),
            complementary_magnetometer_weight: T::one(),
            complementary_field_tolerance: lit(0.3),
            complementary_bias_limit: lit(0.2),
        }
    }
}

impl<T: Scalar> AttitudeConfig<T> {
    /// A phone or wearable in real use: accelerations and indoor fields whose errors last for
    /// seconds, and a gyroscope whose bias nobody calibrated.
    ///
    /// Samples under acceleration keep their full weight on purpose: the accelerations of a hand
    /// average to zero over seconds, and weighing samples by their length spoils that average
    /// (it favours those whose length happens to be right while their direction is wrong).
    pub fn hand_held() -> Self {
        Self {
            gyroscope_noise_density: lit(1.3e-3),
            process_noise: ProcessNoise::Discrete,
            gyroscope_sample_interval_s: lit(0.01),
            gyroscope_scale_noise: lit(1.5e-3),
            gyroscope_bias_random_walk: lit(1e-5),
            accelerometer_std: lit(1.0),
            accelerometer_gate_nis: T::zero(),
            accelerometer_correlation_time_s: lit(0.5),
            accelerometer_norm_gain: T::zero(),
            magnetometer_std_ut: lit(3.0),
            magnetometer_gate_nis: T::zero(),
            magnetometer_correlation_time_s: lit(1.0),
            magnetometer_norm_gain: lit(1.0),
            magnetometer_use: MagnetometerUse::Heading,
            compass_std: lit(0.17),
            compass_gate_nis: T::zero(),
            compass_correlation_time_s: lit(5.0),
            gate_timeout_s: lit(3.0),
            initial_tilt_std: lit(0.14),
            initial_heading_std: lit(0.35),
            initial_gyroscope_bias_std: lit(0.02),
            maximum_attitude_std: lit(1.8),
            quaternion_norm: QuaternionNorm::Projected,
            complementary_attitude_gain: lit(0.8),
            complementary_bias_gain: T::zero(),
            complementary_accelerometer_weight: T::one(),
            complementary_magnetometer_weight: T::one(),
            complementary_field_tolerance: lit(0.3),
            complementary_bias_limit: lit(0.2),
        }
    }

    /// Checks every field.
    ///
    /// # Errors
    /// [`ConfigError`] names the first field that is not finite, or is negative or zero where
    /// that makes no sense.
    pub fn validate(&self) -> Result<(), ConfigError> {
        let positive = [
            ("gyroscope_noise_density", self.gyroscope_noise_density),
            (
                "gyroscope_sample_interval_s",
                self.gyroscope_sample_interval_s,
            ),
            ("accelerometer_std", self.accelerometer_std),
            ("magnetometer_std_ut", self.magnetometer_std_ut),
            ("compass_std", self.compass_std),
            ("initial_tilt_std", self.initial_tilt_std),
            ("initial_heading_std", self.initial_heading_std),
            ("maximum_attitude_std", self.maximum_attitude_std),
        ];
        let not_negative = [
            ("gyroscope_scale_noise", self.gyroscope_scale_noise),
            (
                "gyroscope_bias_random_walk",
                self.gyroscope_bias_random_walk,
            ),
            ("accelerometer_gate_nis", self.accelerometer_gate_nis),
            (
                "accelerometer_correlation_time_s",
                self.accelerometer_correlation_time_s,
            ),
            ("accelerometer_norm_gain", self.accelerometer_norm_gain),
            ("magnetometer_gate_nis", self.magnetometer_gate_nis),
            (
                "magnetometer_correlation_time_s",
                self.magnetometer_correlation_time_s,
            ),
            ("magnetometer_norm_gain", self.magnetometer_norm_gain),
            ("compass_gate_nis", self.compass_gate_nis),
            (
                "compass_correlation_time_s",
                self.compass_correlation_time_s,
            ),
            ("gate_timeout_s", self.gate_timeout_s),
            (
                "initial_gyroscope_bias_std",
                self.initial_gyroscope_bias_std,
            ),
            (
                "complementary_accelerometer_weight",
                self.complementary_accelerometer_weight,
            ),
            (
                "complementary_magnetometer_weight",
                self.complementary_magnetometer_weight,
            ),
        ];
        // Together with the longest step of a correction: below one, or it overshoots.
        let gains = [
            (
                "complementary_attitude_gain",
                self.complementary_attitude_gain,
            ),
            ("complementary_bias_gain", self.complementary_bias_gain),
        ];
        for (field, value) in positive {
            // Its square enters covariances: that must be a number above zero too.
            if !(value > T::zero() && value * value > T::zero() && (value * value).is_finite()) {
                return Err(ConfigError {
                    field,
                    expected: "a finite number above 0",
                });
            }
        }
        for (field, value) in not_negative {
            if !(value >= T::zero() && (value * value).is_finite()) {
                return Err(ConfigError {
                    field,
                    expected: "a finite number, 0 or above",
                });
            }
        }
        let limits = [
            (
                "complementary_field_tolerance",
                self.complementary_field_tolerance,
            ),
            ("complementary_bias_limit", self.complementary_bias_limit),
        ];
        for (field, value) in limits {
            if !(value >= T::zero() && value <= lit(1e3)) {
                return Err(ConfigError {
                    field,
                    expected: "a number from 0 to 1000",
                });
            }
        }
        for (field, value) in gains {
            if !(value >= T::zero() && value <= lit(10.0)) {
                return Err(ConfigError {
                    field,
                    expected: "a number from 0 to 10",
                });
            }
        }
        Ok(())
    }

    /// The accelerometer's gate.
    #[inline]
    pub fn accelerometer_gate(&self) -> Gate<T> {
        Gate {
            nis_threshold: self.accelerometer_gate_nis,
            timeout_s: self.gate_timeout_s,
        }
    }

    /// The magnetometer's gate.
    #[inline]
    pub fn magnetometer_gate(&self) -> Gate<T> {
        Gate {
            nis_threshold: self.magnetometer_gate_nis,
            timeout_s: self.gate_timeout_s,
        }
    }

    /// The compass's gate.
    #[inline]
    pub fn compass_gate(&self) -> Gate<T> {
        Gate {
            nis_threshold: self.compass_gate_nis,
            timeout_s: self.gate_timeout_s,
        }
    }

    /// Power spectral density ((rad/s)^2/Hz) of the angle noise at the rate `angular_rate` (rad/s).
    #[inline]
    pub fn angle_noise_psd(&self, angular_rate: &Vector3<T>) -> T {
        let density = self.gyroscope_noise_density;
        let white = match self.process_noise {
            ProcessNoise::Discrete => density * density,
            ProcessNoise::PaperLiteral => density * density / self.gyroscope_sample_interval_s,
        };
        let scale = self.gyroscope_scale_noise;
        white + scale * scale * angular_rate.norm_squared()
    }

    /// Power spectral density of the bias random walk, (rad/s)^2/s.
    #[inline]
    pub fn bias_walk_psd(&self) -> T {
        self.gyroscope_bias_random_walk * self.gyroscope_bias_random_walk
    }
}

/// A setting that makes no sense.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConfigError {
    /// Name of the field.
    pub field: &'static str,
    /// What was expected of it.
    pub expected: &'static str,
}

impl fmt::Display for ConfigError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: expected {}", self.field, self.expected)
    }
}

impl core::error::Error for ConfigError {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_named_profiles_are_valid() {
        assert_eq!(AttitudeConfig::<f64>::default().validate(), Ok(()));
        assert_eq!(AttitudeConfig::<f32>::hand_held().validate(), Ok(()));
    }

    #[test]
    fn nonsense_is_named() {
        let bad = AttitudeConfig {
            accelerometer_std: 0.0,
            ..AttitudeConfig::<f64>::default()
        };
        assert_eq!(bad.validate().unwrap_err().field, "accelerometer_std");
        let bad = AttitudeConfig {
            gate_timeout_s: f64::NAN,
            ..AttitudeConfig::default()
        };
        assert_eq!(bad.validate().unwrap_err().field, "gate_timeout_s");
    }
}
