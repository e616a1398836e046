//! The heading a phone reports: where its top edge points, with an error that drifts slowly.

use nalgebra::{UnitQuaternion, Vector3};
use northing_recording::CompassHeading;

use super::config::CompassConfig;
use crate::random::{Stream, normal_vector, stream};

/// A first-order Gauss-Markov error about the vertical.
#[derive(Debug, Clone)]
pub(super) struct Compass {
    /// The error in units of its standard deviation.
    unit_error: f64,
    error_std_rad: f64,
    /// Correlation of the error from one report to the next.
    keeps: f64,
    noise: Stream,
}

impl Compass {
    pub(super) fn new(seed: u64, config: &CompassConfig) -> Self {
        let mut noise = stream(seed, "compass");
        let interval_s = config.sampling.interval_s();
        Self {
            unit_error: normal_vector(&mut noise, 1.0).x,
            error_std_rad: config.error_std_deg.to_radians(),
            keeps: nalgebra::ComplexField::exp(-interval_s / config.correlation_time_s),
            noise,
        }
    }

    /// The next report, given the true attitude. Phones report something in every posture.
    pub(super) fn report(&mut self, enu_from_body: &UnitQuaternion<f64>) -> CompassHeading {
        let top = enu_from_body * Vector3::y();
        let error = self.unit_error * self.error_std_rad;
        let fresh = (1.0 - self.keeps * self.keeps).sqrt();
        self.unit_error = self.unit_error * self.keeps + normal_vector(&mut self.noise, fresh).x;
        CompassHeading {
            heading_rad: (top.x.atan2(top.y) + error).rem_euclid(std::f64::consts::TAU),
            std_rad: self.error_std_rad,
        }
    }
}
