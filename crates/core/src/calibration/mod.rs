//! Sensor calibration at rest and of magnetometers, and when it is refused.
//!
//! | question | file |
//! |---|---|
//! | bias, noise and references of a device at rest | [`rest`] |
//! | hard and soft iron of a magnetometer that is turned | [`magnetometer`] |

pub mod magnetometer;
pub mod rest;

pub use magnetometer::{
    MagnetometerCalibration, MagnetometerCalibrator, MagnetometerError, MagnetometerLimits,
};
pub use rest::{RestCalibration, RestCalibrator, RestError, RestLimits, Sensor};
