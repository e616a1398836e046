//! What the batch smoother knows of the first node before any measurement.

use northing_core::navigation::augmented_states::{
    BAROMETER_OFFSET, MAGNETIC_OFFSET, MOUNT_PITCH, MOUNT_YAW, TIME_OFFSET,
};
use northing_core::navigation::gnss_ins::GnssInsConfig;
use northing_core::navigation::{
    ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS, POSITION, STATES, VELOCITY,
};

use super::pass::Attached;
use super::recorder::Measured;
use super::{BIAS_AT_REST, Covariance, LEVER_ARM, SPEED_SCALE, VELOCITY_OFFSET};

/// Standard deviations of the first node: tilt, heading (rad), velocity (m/s), position (m); of a barometer's offset (m).
const TILT_STD: f64 = 0.2;
const HEADING_STD: f64 = 1.8;
const VELOCITY_STD: f64 = 100.0;
const POSITION_STD: f64 = 1e3;
const BAROMETER_STD: f64 = 100.0;
/// Of the scale of a wheel speed: tyres wear, and have the pressure they have.
const SPEED_SCALE_STD: f64 = 0.02;

/// Covariance of the first node before any measurement; states that nothing measures have none.
pub(super) fn prior_covariance(c: &GnssInsConfig<f64>, attached: &[Attached]) -> Covariance {
    let has = |of: fn(&Measured) -> bool| attached.iter().any(|one| of(&one.measurement.measured));
    let mut p = Covariance::zeros();
    let mut set = |first: usize, count: usize, std: f64| {
        for i in first..first + count {
            p[(i, i)] = std * std;
        }
    };
    set(ATTITUDE, 2, TILT_STD);
    set(ATTITUDE + 2, 1, HEADING_STD);
    set(VELOCITY, 3, VELOCITY_STD);
    set(POSITION, 3, POSITION_STD);
    set(STATES + TIME_OFFSET, 1, c.time_offset_std_s);
    set(LEVER_ARM, 3, c.lever_arm_uncertainty_m());
    if has(|m| matches!(m, Measured::Height(_))) {
        set(STATES + BAROMETER_OFFSET, 1, BAROMETER_STD);
    }
    if has(|m| matches!(m, Measured::Speed(..) | Measured::NonHolonomic)) {
        set(STATES + MOUNT_PITCH, 1, c.mount_std);
        set(STATES + MOUNT_YAW, 1, c.mount_std);
    }
    if has(|m| matches!(m, Measured::Velocity(_))) {
        set(VELOCITY_OFFSET, 1, c.time_offset_std_s);
    }
    if has(|m| matches!(m, Measured::Speed(..))) {
        set(SPEED_SCALE, 1, SPEED_SCALE_STD);
    }
    if has(|m| matches!(m, Measured::MagneticField(..))) {
        set(STATES + MAGNETIC_OFFSET, 3, c.magnetic_offset_std_ut);
    }
    let biases = [
        (
            ACCELEROMETER_BIAS,
            BIAS_AT_REST,
            c.accelerometer_bias_std,
            c.accelerometer_gauss_markov_std,
        ),
        (
            GYROSCOPE_BIAS,
            BIAS_AT_REST + 3,
            c.gyroscope_bias_std,
            c.gyroscope_gauss_markov_std,
        ),
    ];
    for (now, rest, std, about) in biases {
        for i in 0..3 {
            let at_rest = std * std;
            p[(now + i, now + i)] = at_rest + about * about;
            p[(rest + i, rest + i)] = at_rest;
            p[(now + i, rest + i)] = at_rest;
            p[(rest + i, now + i)] = at_rest;
        }
    }
    p
}
