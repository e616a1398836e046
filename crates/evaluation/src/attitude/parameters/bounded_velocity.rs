//! The bounded-velocity filter's parameters under the names of the command line: those of its
//! configuration, after `bounded_`.

use serde_json::{Map, Value};

/// Names of the bounded-velocity filter's parameters begin so.
pub(crate) const BOUNDED: &str = "bounded_";

/// Name, unit and meaning of each.
pub(super) const TABLE: [(&str, &str, &str); 41] = [
    (
        "bounded_update_interval_s",
        "s",
        "interval of covariance and updates; the attitude follows every sample",
    ),
    (
        "bounded_gyroscope_noise_density",
        "rad/s/sqrt(Hz)",
        "white noise of the gyroscope, unmodelled errors included",
    ),
    (
        "bounded_gyroscope_scale_noise",
        "rad/(rad/s)/sqrt(s)",
        "extra angle noise per rate",
    ),
    (
        "bounded_gyroscope_bias_random_walk",
        "rad/s/sqrt(s)",
        "how fast the gyroscope bias wanders",
    ),
    (
        "bounded_initial_gyroscope_bias_std",
        "rad/s",
        "uncertainty of the bias at the start, per axis",
    ),
    (
        "bounded_initial_gyroscope_bias_without_magnetometer_std",
        "rad/s",
        "the same where there is no magnetometer",
    ),
    (
        "bounded_scale_states",
        "off | diagonal | full",
        "which errors of the gyroscope's scale are estimated",
    ),
    (
        "bounded_initial_scale_std",
        "-",
        "uncertainty of the scale of each axis",
    ),
    (
        "bounded_initial_misalignment_std",
        "rad",
        "uncertainty of each misalignment",
    ),
    (
        "bounded_accelerometer_noise_density",
        "m/s^2/sqrt(Hz)",
        "white noise of the accelerometer",
    ),
    (
        "bounded_accelerometer_scale_noise",
        "1/sqrt(Hz)",
        "extra of it per acceleration",
    ),
    (
        "bounded_accelerometer_bias_std",
        "m/s^2",
        "bias of the accelerometer that nobody calibrated; widens what is stated of the tilt",
    ),
    (
        "bounded_initial_velocity_std",
        "m/s",
        "uncertainty of the velocity at the start",
    ),
    (
        "bounded_velocity_psd",
        "m^2/s",
        "noise of `velocity is zero` without acceleration; more trusts gravity less",
    ),
    (
        "bounded_velocity_psd_gain",
        "s^3",
        "adds gain * (mean square acceleration) to it",
    ),
    (
        "bounded_acceleration_average_s",
        "s",
        "time over which that square is averaged",
    ),
    (
        "bounded_magnetometer_std_ut",
        "microtesla",
        "magnetometer error per look and axis, the field's unevenness included",
    ),
    (
        "bounded_magnetometer_correlation_time_s",
        "s",
        "how long such errors stay alike",
    ),
    (
        "bounded_field_strength_scale_ut",
        "microtesla",
        "deviation of the field's strength that doubles the variance",
    ),
    (
        "bounded_field_dip_scale",
        "rad",
        "deviation of its dip that doubles the variance",
    ),
    (
        "bounded_magnetometer_student_freedom",
        "-",
        "degrees of freedom of Student's t; 0 takes errors as normal",
    ),
    (
        "bounded_initial_hard_iron_std_ut",
        "microtesla",
        "uncertainty of the hard iron; unless set, it follows from the magnetometer: 0 calibrated, \
         2 by a file, 3 by a phone's system, 12 uncalibrated",
    ),
    (
        "bounded_hard_iron_random_walk_ut",
        "microtesla/sqrt(s)",
        "how fast the hard iron wanders",
    ),
    (
        "bounded_initial_field_std_ut",
        "microtesla",
        "uncertainty of the reference field; 0 keeps that of the start",
    ),
    (
        "bounded_field_random_walk_ut",
        "microtesla/sqrt(s)",
        "how fast the reference field wanders",
    ),
    (
        "bounded_rest_angular_rate",
        "rad/s",
        "deviation of the rate below which the device may rest",
    ),
    (
        "bounded_rest_specific_force",
        "m/s^2",
        "the same for the specific force",
    ),
    (
        "bounded_rest_average_s",
        "s",
        "time constant of the low-passes they deviate from",
    ),
    (
        "bounded_rest_duration_s",
        "s",
        "so long must both stay below",
    ),
    (
        "bounded_rest_rate_noise_density",
        "rad/s/sqrt(Hz)",
        "noise of `the rate is the bias` at rest",
    ),
    (
        "bounded_rest_velocity_psd",
        "m^2/s",
        "most noise of `velocity is zero` at rest",
    ),
    (
        "bounded_gyroscope_saturation",
        "rad/s",
        "rate at which an axis of the gyroscope is at its limit; 0 is unknown",
    ),
    (
        "bounded_saturation_angle_random_walk",
        "rad/sqrt(s)",
        "angle noise while an axis is",
    ),
    (
        "bounded_accelerometer_saturation",
        "m/s^2",
        "force at which an axis of the accelerometer is at its limit; 0 is unknown",
    ),
    (
        "bounded_saturation_velocity_random_walk",
        "m/s/sqrt(s)",
        "velocity noise while an axis is",
    ),
    (
        "bounded_prediction_s",
        "s",
        "how far ahead of its samples the attitude is given: the sensors' group delay",
    ),
    (
        "bounded_initial_tilt_std",
        "rad",
        "uncertainty of the tilt at the start, per axis",
    ),
    (
        "bounded_initial_heading_std",
        "rad",
        "uncertainty of the heading at the start",
    ),
    (
        "bounded_maximum_attitude_std",
        "rad",
        "largest uncertainty per axis: beyond it nothing is known",
    ),
    (
        "bounded_compass_std",
        "rad",
        "smallest error of a compass heading",
    ),
    (
        "bounded_compass_correlation_time_s",
        "s",
        "how long compass errors stay alike",
    ),
];

/// The configuration's names as those of the command line.
pub(super) fn prefixed(map: Map<String, Value>) -> Map<String, Value> {
    let rename = |(name, value)| (format!("{BOUNDED}{name}"), value);
    map.into_iter().map(rename).collect()
}

/// And back.
pub(super) fn unprefixed(map: Map<String, Value>) -> Map<String, Value> {
    let rename = |(name, value): (String, Value)| {
        let short = name.strip_prefix(BOUNDED).map(str::to_owned);
        (short.unwrap_or(name), value)
    };
    map.into_iter().map(rename).collect()
}
