//! The heading a phone reports: where its top edge points, with an error that drifts slowly.

use nalgebra::{UnitQuaternion, Vector3};
use northing_recording::CompassHeading;

use super::config::CompassConfig;
use super::slow_error::SlowError;

/// A first-order Gauss-Markov error about the vertical.
#[derive(Debug, Clone)]
pub(super) struct Compass {
    error: SlowError,
    error_std_rad: f64,
}

impl Compass {
    pub(super) fn new(seed: u64, config: &CompassConfig) -> Self {
        let time_s = config.correlation_time_s;
        Self {
            error: SlowError::new(seed, "compass", &config.sampling, time_s),
            error_std_rad: config.error_std_deg.to_radians(),
        }
    }

    /// The next report, given the true attitude. Phones report something in every posture.
    pub(super) fn report(&mut self, enu_from_body: &UnitQuaternion<f64>) -> CompassHeading {
        let top = enu_from_body * Vector3::y();
        let error = self.error.next().x * self.error_std_rad;
        CompassHeading {
            heading_rad: (top.x.atan2(top.y) + error).rem_euclid(std::f64::consts::TAU),
            std_rad: self.error_std_rad,
        }
    }
}
