//! Sensor error models: what a real device makes of the true value, and when.
//!
//! A sensor is two independent parts: a [`SampleClock`] (rate, offset, jitter, delay, dropouts) and
//! [`SensorErrors`] (scale, bias, noise, quantisation, range). The configurations of the three
//! inertial sensors say the unit in each name; inside there is one [`ErrorModel`] for all.

mod clock;
mod config;
mod errors;

pub use clock::{SampleClock, Sampling, Tick};
pub use config::{AccelerometerConfig, GyroscopeConfig, MagnetometerConfig};
pub use errors::{ErrorModel, SensorErrors};
