//! The orientation a phone reports of itself: the truth with an error that drifts slowly.

use nalgebra::{UnitQuaternion, Vector3};

use super::config::DeviceOrientationConfig;
use super::slow_error::SlowError;
use crate::rotation::exp;

/// A first-order Gauss-Markov error, as a rotation vector in world axes.
#[derive(Debug, Clone)]
pub(super) struct DeviceOrientation {
    error: SlowError,
    error_std_rad: Vector3<f64>,
}

impl DeviceOrientation {
    pub(super) fn new(seed: u64, config: &DeviceOrientationConfig) -> Self {
        let time_s = config.correlation_time_s;
        let tilt_rad = config.inclination_error_std_deg.to_radians();
        let heading_rad = config.heading_error_std_deg.to_radians();
        Self {
            error: SlowError::new(seed, "device-orientation", &config.sampling, time_s),
            error_std_rad: Vector3::new(tilt_rad, tilt_rad, heading_rad),
        }
    }

    /// The next report, given the true attitude.
    pub(super) fn report(&mut self, world_from_body: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        exp(&self.error.next().component_mul(&self.error_std_rad)) * world_from_body
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotation::log;

    #[test]
    fn the_error_has_its_size_and_its_memory() {
        let config = DeviceOrientationConfig {
            correlation_time_s: 2.0,
            ..DeviceOrientationConfig::default()
        };
        let mut device = DeviceOrientation::new(1, &config);
        let n = 400_000;
        let errors: Vec<Vector3<f64>> = (0..n)
            .map(|_| log(&device.report(&UnitQuaternion::identity())))
            .collect();
        let std_deg = |axis: usize| {
            let sum: f64 = errors.iter().map(|e| e[axis] * e[axis]).sum();
            (sum / f64::from(n)).sqrt().to_degrees()
        };
        // About 2000 independent values: 2 % standard deviation.
        assert!((std_deg(2) / 3.0 - 1.0).abs() < 0.08, "{}", std_deg(2));
        assert!((std_deg(0) / 0.7 - 1.0).abs() < 0.08, "{}", std_deg(0));
        // After one correlation time, 100 reports, 1/e of it is left.
        let lagged: f64 = errors.windows(101).map(|w| w[0].z * w[100].z).sum();
        let all: f64 = errors.iter().map(|e| e.z * e.z).sum();
        assert!(
            (lagged / all - (-1.0_f64).exp()).abs() < 0.06,
            "{}",
            lagged / all
        );
    }
}
