//! Parameters of the bounded-velocity filter: every noise, prior and threshold.

use nalgebra::Vector3;

use crate::attitude::config::AttitudeConfig;
use crate::parameters::{Choice, choices, parameters};
use crate::scalar::Scalar;

choices! {
    /// Which errors of the gyroscope's scale are estimated beside its bias.
    pub enum ScaleStates {
        /// None: two thirds of the cost, worse in fast motion.
        Off = "off",
        /// The scale of each axis: three states.
        Diagonal = "diagonal",
        /// Scale and misalignment: nine states.
        #[default]
        Full = "full",
    }
}

parameters! {
    /// Parameters of the bounded-velocity filter: a device in a hand or on a body whose magnetometer is calibrated; a
    /// phone's raw magnetometer needs [`Self::initial_hard_iron_std_ut`] (2 with an ellipsoid calibration, 3 for
    /// the stream that the operating system calibrated, 12 for the raw one less the offset that the system knows).
    /// [`Default`] is [`Self::hand_held`].
    pub struct BoundedVelocityConfig, profiles {
        /// The sensors of a phone or wearable: their low-pass filters delay them by a few milliseconds,
        /// of which 2.5 are predicted, and nobody calibrated the accelerometer.
        hand_held = 0,
        /// Prompt sensors, and a calibrated accelerometer.
        lab = 1,
    };

    update_interval_s: T, "s", From(1e-4, 10.0), [0.04],
        "interval of covariance and updates; the attitude follows every sample",
        "Raising it costs less and corrects later.";
    gyroscope_noise_density: T, "rad/s/sqrt(Hz)", From(1e-9, 10.0), [1.3e-3],
        "white noise of the gyroscope, unmodelled errors included",
        "0.075 deg/sqrt(s), much above the sensor's own. Raising it trusts the gyroscope less.";
    gyroscope_noise_gain: T, "-", From(0.0, 1e6), [1.0],
        "how much white noise that the gyroscope's samples show counts where it is more than that",
        "Of its standard deviation; 0: not at all.";
    gyroscope_scale_noise: T, "rad/(rad/s)/sqrt(s)", From(0.0, 10.0), [1.5e-3],
        "extra angle noise per rate",
        "Raising it widens the covariance in fast motion; zero makes it too small there.";
    gyroscope_bias_random_walk: T, "rad/s/sqrt(s)", From(0.0, 1.0), [1e-5],
        "random walk of the gyroscope bias",
        "Raising it lets the bias follow faster, and be fooled faster.";
    initial_gyroscope_bias_std: T, "rad/s", From(0.0, 10.0), [0.0175],
        "standard deviation of the gyroscope bias at the start, per axis",
        "1 deg/s; it learns six. Raising it learns large biases sooner and starts slower.";
    initial_gyroscope_bias_without_magnetometer_std: T, "rad/s", From(0.0, 10.0), [8.7e-3],
        "the same where there is no magnetometer",
        "0.5 deg/s: there nothing but a rest shows the bias about the vertical. Raising it learns large biases sooner",
        "and lets the heading drift further; a calibration at rest says better.";
    gyroscope_bias_freedom: T, "-", From(0.0, 1e6), [0.25],
        "degrees of freedom of the standard deviation that is assumed of the bias; 0 takes it as it is",
        "Where no rest measured the bias, the axes that show theirs say how large those of this gyroscope are. Raising it keeps nearer to what was assumed.";
    scale_states: ScaleStates, "-", Words(ScaleStates::WORDS), [ScaleStates::Full],
        "which errors of the gyroscope's scale are estimated";
    initial_scale_std: T, "-", From(0.0, 1e6), [0.004],
        "standard deviation of the scale of each axis",
        "It does not change in time.";
    initial_misalignment_std: T, "rad", From(0.0, 10.0), [0.001],
        "standard deviation of each misalignment and skewness";
    initial_misalignment_without_magnetometer_std: T, "rad", From(0.0, 10.0), [0.004],
        "the same where there is no magnetometer",
        "With one, a field that is not the same everywhere would be taken for a misalignment. Raising it takes less for a bias.";
    accelerometer_noise_density: T, "m/s^2/sqrt(Hz)", From(1e-6, 100.0), [0.05],
        "white noise of the accelerometer",
        "Raising it lets the velocity forget faster, which trusts gravity less.";
    accelerometer_scale_noise: T, "1/sqrt(Hz)", From(0.0, 10.0), [0.01],
        "extra of it per acceleration",
        "Scale errors.";
    accelerometer_bias_std: T, "m/s^2", From(0.0, 10.0), [0.05, 0.0],
        "standard deviation of an uncalibrated accelerometer's bias, per axis; widens the stated tilt",
        "0: calibrated. It is no state: the stated covariance of the tilt has `(bias / gravity)^2` beside the filter's",
        "own, and nothing else changes.";
    initial_velocity_std: T, "m/s", From(1e-4, 1e4), [1.0],
        "standard deviation of the velocity at the start, per axis",
        "Also after a pause of the accelerometer.";
    velocity_psd: T, "m^2/s", From(1e-12, 1e4), [0.02],
        "noise of `velocity is zero` without acceleration",
        "The power spectral density of that pseudo-measurement. Raising it trusts gravity less.";
    velocity_psd_gain: T, "s^3", From(0.0, 1e4), [0.025],
        "adds gain * (mean square acceleration) to it",
        "Raising it trusts gravity less while the device is accelerated.";
    initial_velocity_psd: T, "m^2/s", From(0.0, 1e4), [1.0],
        "noise of `velocity is zero` while nothing is known of the motion yet",
        "It fades with `velocity_correlation_time_s`. Raising it finds the tilt later, and a vehicle that is moving already sooner.";
    largest_velocity_psd: T, "m^2/s", From(0.0, 1e4), [10.0],
        "largest noise of `velocity is zero` that is learnt from velocities that last; 0 learns nothing",
        "Raising it follows vehicles better, and a tilt that is wrong for another reason longer.";
    velocity_correlation_time_s: T, "s", From(1e-4, 1e9), [10.0],
        "so long a velocity is expected to last until it is seen how long";
    velocity_memory_s: T, "s", From(1e-4, 1e9), [60.0],
        "so long a velocity that lasted is expected again";
    velocity_excess: T, "-", From(0.0, 1e6), [4.0],
        "variances of the filter's own velocity that its square must exceed to be one";
    hand_velocity_std: T, "m/s", From(1e-3, 1e4), [0.7],
        "standard deviation of the velocity of a hand; a vehicle may be 5 or 25 times faster",
        "Which of the three it is is found by their likelihood. Raising it takes fewer walkers for vehicles, and finds vehicles later.";
    drifting_bias_weight: T, "-", From(0.0, 0.3), [0.01],
        "how likely it is, before anything is known, that the bias of the gyroscope drifts",
        "Weighed against a hand and a vehicle. Raising it finds steps of the bias sooner, and takes more motions for one; 0: never.";
    drifting_bias_time_s: T, "s", From(1e-2, 1e9), [100.0],
        "so long it then takes to drift as far as `initial_gyroscope_bias_std`";
    acceleration_average_s: T, "s", From(1e-4, 1e9), [1.5],
        "time over which that square is averaged";
    magnetometer_std_ut: T, "microtesla", From(1e-4, 1e6), [2.5],
        "magnetometer error per look and axis, the field's unevenness included",
        "Raising it trusts the field less.";
    magnetometer_correlation_time_s: T, "s", From(0.0, 1e9), [1.0],
        "correlation time of such errors",
        "One independent look per this time. Raising it lets the heading follow the field less.";
    field_strength_scale_ut: T, "microtesla", From(1e-4, 1e6), [8.0],
        "deviation of the field's strength that doubles the variance",
        "Raising it trusts disturbed fields more.";
    field_dip_scale: T, "rad", From(1e-6, 10.0), [0.07],
        "deviation of its dip that doubles the variance",
        "4 degrees.";
    magnetometer_student_freedom: T, "-", From(0.0, 1e6), [2.0],
        "degrees of freedom of Student's t for its errors; 0 takes them as normal",
        "Raising it lets outliers weigh more.";
    initial_hard_iron_std_ut: T, "microtesla", From(0.0, 1e6), [0.0],
        "standard deviation of the hard iron; unless set, it follows from the magnetometer: 0 calibrated, 2 by a file, 3 by a phone's system, 12 uncalibrated",
        "0: calibrated, no states for it. Raising it learns larger offsets, and takes a field's unevenness for one.";
    unexpected_hard_iron: T, "-", From(0.0, 1e6), [3.0],
        "hard iron of a calibrated magnetometer, in standard deviations of the magnetometer, that is estimated where the turns of the device show it; 0: never",
        "Raising it leaves larger offsets in the heading.";
    hard_iron_random_walk_ut: T, "microtesla/sqrt(s)", From(0.0, 1e4), [0.02],
        "random walk of the hard iron";
    initial_field_std_ut: T, "microtesla", From(0.0, 1e6), [5.0],
        "standard deviation of the reference field; 0 keeps that of the start",
        "Of its horizontal and vertical strength; 0 has no states for it.";
    field_random_walk_ut: T, "microtesla/sqrt(s)", From(0.0, 1e4), [0.05],
        "random walk of the reference field";
    rest_angular_rate: T, "rad/s", From(1e-6, 1e3), [0.035],
        "deviation of the rate from its low-pass below which the device may rest",
        "2 deg/s.";
    rest_specific_force: T, "m/s^2", From(1e-6, 1e4), [0.5],
        "the same for the specific force";
    rest_average_s: T, "s", From(1e-4, 1e9), [0.5],
        "time constant of both low-passes";
    rest_duration_s: T, "s", From(0.0, 1e9), [1.5],
        "so long must both stay below",
        "Raising it finds fewer rests.";
    rest_smoothing_s: T, "s", From(1e-6, 1e9), [0.1],
        "time constant of a low-pass on rate and force before they are compared",
        "Noise and vibration are no motion. Raising it finds rests that are none.";
    rest_slow_motion_gain: T, "-", From(0.0, 1e6), [1.0],
        "factor on the noise that a slow turn or push adds at rest; 0 takes every rest as one";
    rest_rate_noise_density: T, "rad/s/sqrt(Hz)", From(1e-9, 10.0), [8e-4],
        "noise of `the rate is the bias` at rest",
        "0.05 deg/s/sqrt(Hz), or what the gyroscope's samples show where that is more.";
    rest_bias_doubt: T, "-", From(0.0, 1e6), [3.0],
        "standard deviations of the rate at a rest from the bias beyond which the bias is doubted",
        "Raising it follows steps of the bias later; 0: never.";
    rest_velocity_psd: T, "m^2/s", From(1e-9, 1e4), [9e-4],
        "most noise of `velocity is zero` at rest";
    gyroscope_saturation: T, "rad/s", From(0.0, 1e4), [0.0],
        "rate at which an axis of the gyroscope is at its limit; 0 is unknown",
        "99 % of its full scale.";
    saturation_angle_random_walk: T, "rad/sqrt(s)", From(0.0, 100.0), [0.5],
        "angle noise while an axis is";
    accelerometer_saturation: T, "m/s^2", From(0.0, 1e4), [0.0],
        "force at which an axis of the accelerometer is at its limit; 0 is unknown";
    saturation_velocity_random_walk: T, "m/s/sqrt(s)", From(0.0, 1e3), [5.0],
        "velocity noise while an axis is";
    prediction_s: T, "s", From(-0.1, 0.1), [0.0025, 0.0],
        "how far ahead of its samples the attitude is given: the sensors' group delay",
        "At the present rate.";
    initial_tilt_std: T, "rad", From(1e-6, 10.0), [0.14],
        "standard deviation of the tilt at the start, per axis",
        "8 degrees.";
    initial_heading_std: T, "rad", From(1e-6, 10.0), [0.35],
        "standard deviation of the heading at the start",
        "20 degrees.";
    maximum_attitude_std: T, "rad", From(1e-3, 10.0), [1.8],
        "largest standard deviation per axis: beyond it nothing is known";
    compass_std: T, "rad", From(1e-6, 10.0), [0.17],
        "smallest standard deviation of a compass heading; what the device states counts where it is larger";
    compass_correlation_time_s: T, "s", From(0.0, 1e9), [5.0],
        "correlation time of compass errors";
}

impl<T: Scalar> BoundedVelocityConfig<T> {
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

    /// Power spectral density ((rad/s)^2/Hz) of the angle noise: white, of which the samples show `learnt`, per rate, and where
    /// axes of the rate as measured are saturated (B6).
    #[inline]
    pub(super) fn angle_noise_psd(&self, rate: &Vector3<T>, measured: &Vector3<T>, learnt: T) -> T {
        let (white, scale) = (self.gyroscope_noise_density, self.gyroscope_scale_noise);
        let saturated = saturated_axes(measured, self.gyroscope_saturation);
        let walk = self.saturation_angle_random_walk;
        (white * white).max(learnt)
            + scale * scale * rate.norm_squared()
            + saturated * (walk * walk)
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
    fn the_settings_that_alignment_shares_are_valid() {
        let shared = BoundedVelocityConfig::<f64>::lab().alignment_settings();
        assert_eq!(shared.validate(), Ok(()));
    }

    #[test]
    fn saturation_widens_the_noise_only_where_a_limit_is_known() {
        let mut config = BoundedVelocityConfig::<f64>::lab();
        let fast = Vector3::new(7.3, -7.3, 0.0);
        let free = config.angle_noise_psd(&fast, &fast, 0.0);
        config.gyroscope_saturation = 7.2;
        assert!((config.angle_noise_psd(&fast, &fast, 0.0) - free - 2.0 * 0.25).abs() < 1e-12);
        let hard = Vector3::new(0.0, 0.0, 19.6);
        let free = config.velocity_noise_psd(100.0, &hard);
        assert!((free - 0.0125).abs() < 1e-12);
        config.accelerometer_saturation = 19.5;
        assert!((config.velocity_noise_psd(100.0, &hard) - free - 25.0).abs() < 1e-9);
    }
}
