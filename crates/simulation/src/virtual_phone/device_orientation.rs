//! The orientation a phone reports of itself: the truth with an error that drifts slowly.

use nalgebra::{UnitQuaternion, Vector3};

use super::config::DeviceOrientationConfig;
use crate::random::{Stream, normal_vector, stream};
use crate::rotation::exp;

/// A first-order Gauss-Markov error, as a rotation vector in world axes.
#[derive(Debug, Clone)]
pub(super) struct DeviceOrientation {
    /// The error in units of its standard deviation, per axis.
    unit_error: Vector3<f64>,
    error_std_rad: Vector3<f64>,
    /// Correlation of the error from one report to the next.
    keeps: f64,
    noise: Stream,
}

impl DeviceOrientation {
    pub(super) fn new(seed: u64, config: &DeviceOrientationConfig) -> Self {
        let mut noise = stream(seed, "device-orientation");
        let tilt_rad = config.inclination_error_std_deg.to_radians();
        let interval_s = config.sampling.interval_s();
        Self {
            unit_error: normal_vector(&mut noise, 1.0),
            error_std_rad: Vector3::new(
                tilt_rad,
                tilt_rad,
                config.heading_error_std_deg.to_radians(),
            ),
            keeps: nalgebra::ComplexField::exp(-interval_s / config.correlation_time_s),
            noise,
        }
    }

    /// The next report, given the true attitude.
    pub(super) fn report(&mut self, world_from_body: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        let error = self.unit_error.component_mul(&self.error_std_rad);
        let fresh = (1.0 - self.keeps * self.keeps).sqrt();
        self.unit_error = self.unit_error * self.keeps + normal_vector(&mut self.noise, fresh);
        exp(&error) * world_from_body
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
