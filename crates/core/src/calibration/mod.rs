//! Calibration: what sensors tell about themselves, and when their word is not to be taken.
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
