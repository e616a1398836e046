//! Pages about calibrations: Allan deviation, magnetometer.

pub(crate) mod allan;
pub(crate) mod magnetometer;
