//! Calibration: what sensors tell about themselves, and when their word is not to be taken.
//!
//! | question | file |
//! |---|---|
//! | bias, noise and references of a device at rest | [`rest`] |

pub mod rest;

pub use rest::{RestCalibration, RestCalibrator, RestError, RestLimits};
