//! Calibrations of sensors: at rest, turned about, and over hours.
//!
//! | I look for | file |
//! |---|---|
//! | bias, noise and references of a device at rest | [`rest`] |
//! | hard and soft iron of a magnetometer | [`magnetometer`] |
//! | noise over averaging time, Allan deviation | [`allan`] |
//! | calibrations of several devices and days, and which belongs to a recording | [`set`] |

pub mod allan;
pub mod magnetometer;
pub mod rest;
pub mod set;
