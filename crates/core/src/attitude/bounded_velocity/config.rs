//! Settings of the bounded-velocity filter: every noise, prior and threshold, with its default.

use nalgebra::Vector3;

use crate::attitude::config::{AttitudeConfig, ConfigError};
use crate::scalar::{Scalar, lit};

/// Which errors of the gyroscope's scale are estimated beside its bias.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "kebab-case")
)]
pub enum ScaleStates {
    /// None: two thirds of the cost, worse in fast motion.
    Off,
    /// The scale of each axis: three states.
    Diagonal,
    /// Scale and misalignment: nine states.
    #[default]
    Full,
}

/// Settings of the bounded-velocity filter. [`Default`] is a device in a hand or on a body whose
/// magnetometer is calibrated and whose sensors are prompt ([`Self::hand_held`] has those of phones
/// and wearables); a phone's raw magnetometer needs
/// [`Self::initial_hard_iron_std_ut`] (2 with an ellipsoid calibration, 3 for the stream that the
/// operating system calibrated, 12 for the raw one less the offset that the system knows).
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
pub struct BoundedVelocityConfig<T> {
    /// Interval of covariance propagation and updates, s, default 0.02; the attitude follows every
    /// gyroscope sample. Raising it costs less and corrects later.
    pub update_interval_s: T,
    /// White noise of the gyroscope, rad/s/sqrt(Hz), default 1.3e-3 (0.075 deg/sqrt(s), much above
    /// the sensor's own). Raising it trusts the gyroscope less.
    pub gyroscope_noise_density: T,
    /// Extra angle noise per rate, rad/(rad/s)/sqrt(s), default 1.5e-3. Raising it widens the
    /// covariance in fast motion; zero makes it too small there.
    pub gyroscope_scale_noise: T,
    /// Random walk of the gyroscope bias, rad/s/sqrt(s), default 1e-5. Raising it lets the bias
    /// follow faster, and be fooled faster.
    pub gyroscope_bias_random_walk: T,
    /// Standard deviation of the initial bias per axis, rad/s, default 0.0175 (1 deg/s; it learns
    /// six). Raising it learns large biases sooner and starts slower.
    pub initial_gyroscope_bias_std: T,
    /// The same without a magnetometer, where nothing but a rest tells the bias about the vertical,
    /// rad/s, default 8.7e-3 (0.5 deg/s). Raising it learns large biases sooner and lets the heading
    /// wander further; a calibration at rest says better.
    pub initial_gyroscope_bias_without_magnetometer_std: T,
    /// Which errors of the gyroscope's scale are estimated, default `full`.
    pub scale_states: ScaleStates,
    /// Standard deviation of the scale of each axis, default 0.004; it does not change in time.
    pub initial_scale_std: T,
    /// Standard deviation of each misalignment (rad) and skewness, default 0.001.
    pub initial_misalignment_std: T,
    /// White noise of the accelerometer, m/s^2/sqrt(Hz), default 0.05. Raising it lets the velocity
    /// forget faster, which trusts gravity less.
    pub accelerometer_noise_density: T,
    /// Extra of it per acceleration, 1/sqrt(Hz), default 0.01: scale errors.
    pub accelerometer_scale_noise: T,
    /// Standard deviation of the accelerometer's bias per axis, m/s^2, default 0: calibrated. It is no state: the
    /// stated covariance of the tilt has `(bias / gravity)^2` beside the filter's own, and nothing else changes.
    pub accelerometer_bias_std: T,
    /// Standard deviation of the initial velocity per axis, m/s, default 1; also after a pause of
    /// the accelerometer.
    pub initial_velocity_std: T,
    /// Power spectral density of the pseudo-measurement "velocity is zero" without acceleration, m^2/s, default
    /// 0.02. Raising it trusts gravity less.
    pub velocity_psd: T,
    /// Adds `gain * (mean square acceleration)` to it, s^3, default 0.025. Raising it trusts
    /// gravity less while the device is accelerated.
    pub velocity_psd_gain: T,
    /// Time over which the square of the acceleration is averaged, s, default 1.5.
    pub acceleration_average_s: T,
    /// Error of the magnetometer per axis, microtesla, default 2.5: mostly the field's own unevenness.
    /// Raising it trusts the field less.
    pub magnetometer_std_ut: T,
    /// How long such errors stay alike, s, default 1: one independent look per this time. Raising
    /// it lets the heading follow the field less.
    pub magnetometer_correlation_time_s: T,
    /// Deviation of the field's strength that doubles the magnetometer's variance, microtesla,
    /// default 8. Raising it trusts disturbed fields more.
    pub field_strength_scale_ut: T,
    /// Deviation of the field's dip that doubles it, rad, default 0.07 (4 deg).
    pub field_dip_scale: T,
    /// Degrees of freedom of Student's t for the magnetometer's errors, default 2; 0 takes them as
    /// normal. Raising it lets outliers weigh more.
    pub magnetometer_student_freedom: T,
    /// Standard deviation of the hard iron per axis, microtesla, default 0: calibrated, no states
    /// for it. Raising it learns larger offsets, and takes a field's unevenness for one.
    pub initial_hard_iron_std_ut: T,
    /// Random walk of the hard iron, microtesla/sqrt(s), default 0.02.
    pub hard_iron_random_walk_ut: T,
    /// Standard deviation of the reference field's horizontal and vertical strength, microtesla,
    /// default 5; 0 keeps the field of the start and has no states for it.
    pub initial_field_std_ut: T,
    /// Random walk of these strengths, microtesla/sqrt(s), default 0.05.
    pub field_random_walk_ut: T,
    /// Deviation of the angular rate from its low-pass below which the device may rest, rad/s,
    /// default 0.035 (2 deg/s).
    pub rest_angular_rate: T,
    /// The same for the specific force, m/s^2, default 0.5.
    pub rest_specific_force: T,
    /// Time constant of both low-passes, s, default 0.5.
    pub rest_average_s: T,
    /// So long must both stay below, s, default 1.5; raising it finds fewer rests.
    pub rest_duration_s: T,
    /// At rest the rate is the bias with this noise, rad/s/sqrt(Hz), default 1.75e-3
    /// (0.1 deg/s/sqrt(Hz)).
    pub rest_rate_noise_density: T,
    /// At rest `velocity_psd` and its gain give at most this, m^2/s, default 9e-4.
    pub rest_velocity_psd: T,
    /// Magnitude of a rate at which an axis of the gyroscope is saturated, rad/s (99 % of its full
    /// scale), default 0: unknown, never.
    pub gyroscope_saturation: T,
    /// Angle noise while an axis is, rad/sqrt(s), default 0.5.
    pub saturation_angle_random_walk: T,
    /// Magnitude of a force at which an axis of the accelerometer is saturated, m/s^2, default 0:
    /// unknown, never.
    pub accelerometer_saturation: T,
    /// Velocity noise while an axis is, m/s/sqrt(s), default 5.
    pub saturation_velocity_random_walk: T,
    /// The attitude is given so much ahead of its samples, at the present rate, s, default 0: makes
    /// up for a sensor's group delay. At most 0.1.
    pub prediction_s: T,
    /// Standard deviation of the initial tilt per axis, rad, default 0.14 (8 deg).
    pub initial_tilt_std: T,
    /// Standard deviation of the initial heading, rad, default 0.35 (20 deg).
    pub initial_heading_std: T,
    /// Largest attitude standard deviation per axis, rad, default 1.8: beyond it nothing is known.
    pub maximum_attitude_std: T,
    /// Smallest standard deviation of a compass heading, rad, default 0.17; what the device states
    /// counts where it is larger.
    pub compass_std: T,
    /// How long errors of a compass stay alike, s, default 5.
    pub compass_correlation_time_s: T,
}

impl<T: Scalar> Default for BoundedVelocityConfig<T> {
    fn default() -> Self {
        Self {
            update_interval_s: lit(0.02),
            gyroscope_noise_density: lit(1.3e-3),
            gyroscope_scale_noise: lit(1.5e-3),
            gyroscope_bias_random_walk: lit(1e-5),
            initial_gyroscope_bias_std: lit(0.0175),
            initial_gyroscope_bias_without_magnetometer_std: lit(8.7e-3),
            scale_states: ScaleStates::Full,
            initial_scale_std: lit(0.004),
            initial_misalignment_std: lit(0.001),
            accelerometer_noise_density: lit(0.05),
            accelerometer_scale_noise: lit(0.01),
            accelerometer_bias_std: T::zero(),
            initial_velocity_std: T::one(),
            velocity_psd: lit(0.02),
            velocity_psd_gain: lit(0.025),
            acceleration_average_s: lit(1.5),
            magnetometer_std_ut: lit(2.5),
            magnetometer_correlation_time_s: T::one(),
            field_strength_scale_ut: lit(8.0),
            field_dip_scale: lit(0.07),
            magnetometer_student_freedom: lit(2.0),
            initial_hard_iron_std_ut: T::zero(),
            hard_iron_random_walk_ut: lit(0.02),
            initial_field_std_ut: lit(5.0),
            field_random_walk_ut: lit(0.05),
            rest_angular_rate: lit(0.035),
            rest_specific_force: lit(0.5),
            rest_average_s: lit(0.5),
            rest_duration_s: lit(1.5),
            rest_rate_noise_density: lit(1.75e-3),
            rest_velocity_psd: lit(9e-4),
            gyroscope_saturation: T::zero(),
            saturation_angle_random_walk: lit(0.5),
            accelerometer_saturation: T::zero(),
            saturation_velocity_random_walk: lit(5.0),
            prediction_s: T::zero(),
            initial_tilt_std: lit(0.14),
            initial_heading_std: lit(0.35),
            maximum_attitude_std: lit(1.8),
            compass_std: lit(0.17),
            compass_correlation_time_s: lit(5.0),
        }
    }
}

impl<T: Scalar> BoundedVelocityConfig<T> {
    /// The sensors of a phone or wearable: their low-pass filters delay them by a few milliseconds,
    /// of which 2.5 are predicted.
    pub fn hand_held() -> Self {
        Self {
            prediction_s: lit(0.0025),
            accelerometer_bias_std: lit(0.05),
            ..Self::default()
        }
    }

    /// Checks every field.
    ///
    /// # Errors
    /// [`ConfigError`] names the first field that is not finite, or is negative, zero or too large
    /// where that makes no sense.
    pub fn validate(&self) -> Result<(), ConfigError> {
        // Squares enter covariances: they must be numbers, and above zero, too.
        let finite = |value: T| (value * value).is_finite();
        for (field, value) in self.positive() {
            if !(value > T::zero() && value * value > T::zero() && finite(value)) {
                let expected = "a finite number above 0";
                return Err(ConfigError { field, expected });
            }
        }
        for (field, value) in self.not_negative() {
            if !(value >= T::zero() && finite(value)) {
                let expected = "a finite number, 0 or above";
                return Err(ConfigError { field, expected });
            }
        }
        if self.prediction_s.abs() > lit(0.1) || !self.prediction_s.is_finite() {
            let (field, expected) = ("prediction_s", "a number from -0.1 to 0.1");
            return Err(ConfigError { field, expected });
        }
        Ok(())
    }

    fn positive(&self) -> [(&'static str, T); 18] {
        [
            ("update_interval_s", self.update_interval_s),
            ("gyroscope_noise_density", self.gyroscope_noise_density),
            (
                "accelerometer_noise_density",
                self.accelerometer_noise_density,
            ),
            ("initial_velocity_std", self.initial_velocity_std),
            ("velocity_psd", self.velocity_psd),
            ("acceleration_average_s", self.acceleration_average_s),
            ("magnetometer_std_ut", self.magnetometer_std_ut),
            ("field_strength_scale_ut", self.field_strength_scale_ut),
            ("field_dip_scale", self.field_dip_scale),
            ("rest_angular_rate", self.rest_angular_rate),
            ("rest_specific_force", self.rest_specific_force),
            ("rest_average_s", self.rest_average_s),
            ("rest_rate_noise_density", self.rest_rate_noise_density),
            ("rest_velocity_psd", self.rest_velocity_psd),
            ("initial_tilt_std", self.initial_tilt_std),
            ("initial_heading_std", self.initial_heading_std),
            ("maximum_attitude_std", self.maximum_attitude_std),
            ("compass_std", self.compass_std),
        ]
    }

    fn not_negative(&self) -> [(&'static str, T); 21] {
        [
            ("gyroscope_scale_noise", self.gyroscope_scale_noise),
            (
                "gyroscope_bias_random_walk",
                self.gyroscope_bias_random_walk,
            ),
            (
                "initial_gyroscope_bias_std",
                self.initial_gyroscope_bias_std,
            ),
            (
                "initial_gyroscope_bias_without_magnetometer_std",
                self.initial_gyroscope_bias_without_magnetometer_std,
            ),
            ("initial_scale_std", self.initial_scale_std),
            ("initial_misalignment_std", self.initial_misalignment_std),
            ("accelerometer_scale_noise", self.accelerometer_scale_noise),
            ("accelerometer_bias_std", self.accelerometer_bias_std),
            ("velocity_psd_gain", self.velocity_psd_gain),
            (
                "magnetometer_correlation_time_s",
                self.magnetometer_correlation_time_s,
            ),
            (
                "magnetometer_student_freedom",
                self.magnetometer_student_freedom,
            ),
            ("initial_hard_iron_std_ut", self.initial_hard_iron_std_ut),
            ("hard_iron_random_walk_ut", self.hard_iron_random_walk_ut),
            ("initial_field_std_ut", self.initial_field_std_ut),
            ("field_random_walk_ut", self.field_random_walk_ut),
            ("rest_duration_s", self.rest_duration_s),
            ("gyroscope_saturation", self.gyroscope_saturation),
            (
                "saturation_angle_random_walk",
                self.saturation_angle_random_walk,
            ),
            ("accelerometer_saturation", self.accelerometer_saturation),
            (
                "saturation_velocity_random_walk",
                self.saturation_velocity_random_walk,
            ),
            (
                "compass_correlation_time_s",
                self.compass_correlation_time_s,
            ),
        ]
    }

    /// What the driver's alignment and the compass take from it, in the structure that they share
    /// with the other filters.
    pub fn alignment_settings(&self) -> AttitudeConfig<T> {
        AttitudeConfig {
            initial_tilt_std: self.initial_tilt_std,
            initial_heading_std: self.initial_heading_std,
            initial_gyroscope_bias_std: self.initial_gyroscope_bias_std,
            maximum_attitude_std: self.maximum_attitude_std,
            compass_std: self.compass_std,
            compass_correlation_time_s: self.compass_correlation_time_s,
            ..AttitudeConfig::hand_held()
        }
    }

    /// Power spectral density ((rad/s)^2/Hz) of the angle noise: white, per rate, and where axes of
    /// the rate as measured are saturated (B6).
    #[inline]
    pub(super) fn angle_noise_psd(&self, rate: &Vector3<T>, measured: &Vector3<T>) -> T {
        let (white, scale) = (self.gyroscope_noise_density, self.gyroscope_scale_noise);
        let saturated = saturated_axes(measured, self.gyroscope_saturation);
        let walk = self.saturation_angle_random_walk;
        white * white + scale * scale * rate.norm_squared() + saturated * (walk * walk)
    }

    /// Power spectral density ((m/s^2)^2/Hz) of the velocity noise at the squared acceleration
    /// `acceleration2` (B7).
    #[inline]
    pub(super) fn velocity_noise_psd(&self, acceleration2: T, measured: &Vector3<T>) -> T {
        let (white, scale) = (
            self.accelerometer_noise_density,
            self.accelerometer_scale_noise,
        );
        let mut psd = white * white + scale * scale * acceleration2;
        if saturated_axes(measured, self.accelerometer_saturation) > T::zero() {
            psd += self.saturation_velocity_random_walk * self.saturation_velocity_random_walk;
        }
        psd
    }
}

/// How many axes are at the limit; none where there is no limit.
#[inline]
fn saturated_axes<T: Scalar>(measured: &Vector3<T>, limit: T) -> T {
    let mut count = T::zero();
    if limit > T::zero() {
        for axis in measured.iter() {
            if axis.abs() >= limit {
                count += T::one();
            }
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_defaults_are_valid_in_both_precisions() {
        assert_eq!(BoundedVelocityConfig::<f64>::default().validate(), Ok(()));
        assert_eq!(BoundedVelocityConfig::<f32>::hand_held().validate(), Ok(()));
        let shared = BoundedVelocityConfig::<f64>::default().alignment_settings();
        assert_eq!(shared.validate(), Ok(()));
    }

    #[test]
    fn nonsense_is_named() {
        let set = |change: fn(&mut BoundedVelocityConfig<f64>)| {
            let mut config = BoundedVelocityConfig::default();
            change(&mut config);
            config.validate().unwrap_err().field
        };
        assert_eq!(set(|c| c.update_interval_s = 0.0), "update_interval_s");
        assert_eq!(set(|c| c.velocity_psd = f64::NAN), "velocity_psd");
        assert_eq!(set(|c| c.velocity_psd_gain = -1.0), "velocity_psd_gain");
        assert_eq!(set(|c| c.compass_std = 1e200), "compass_std");
        assert_eq!(set(|c| c.prediction_s = 1.0), "prediction_s");
    }

    #[test]
    fn saturation_widens_the_noise_only_where_a_limit_is_known() {
        let mut config = BoundedVelocityConfig::<f64>::default();
        let fast = Vector3::new(7.3, -7.3, 0.0);
        let free = config.angle_noise_psd(&fast, &fast);
        config.gyroscope_saturation = 7.2;
        assert!((config.angle_noise_psd(&fast, &fast) - free - 2.0 * 0.25).abs() < 1e-12);
        let hard = Vector3::new(0.0, 0.0, 19.6);
        let free = config.velocity_noise_psd(100.0, &hard);
        assert!((free - 0.0125).abs() < 1e-12);
        config.accelerometer_saturation = 19.5;
        assert!((config.velocity_noise_psd(100.0, &hard) - free - 25.0).abs() < 1e-9);
    }
}
