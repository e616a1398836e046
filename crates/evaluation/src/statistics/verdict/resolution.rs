//! Finds the grid on which coarse values lie: browsers round, converters have few bits.

use nalgebra::Vector3;
use northing_recording::{Sample, SensorKind};

/// Steps that must have been seen before a grid is accepted.
const ENOUGH: u32 = 60;
/// Share of the steps that must be whole multiples of the smallest.
const SHARE: f64 = 0.97;
/// After so many steps the search starts again, so that it follows a change of the device.
const RENEW: u32 = 2000;

/// Watches the changes from one sample to the next.
#[derive(Debug, Clone, Default)]
pub struct Resolution {
    last: Option<Vector3<f64>>,
    smallest: f64,
    steps: u32,
    on_grid: u32,
    /// By the search before this one.
    found: Option<f64>,
}

impl Resolution {
    /// Takes the next sample; only vectors have a grid.
    pub fn add(&mut self, sample: &Sample) {
        let (Sample::AngularRate(v)
        | Sample::SpecificForce(v)
        | Sample::MagneticField(v)
        | Sample::MagneticFieldUncalibrated(v)) = sample
        else {
            return;
        };
        if let Some(last) = self.last.replace(*v) {
            for step in (v - last).iter().map(|d| d.abs()) {
                self.add_step(step, v.amax());
            }
        }
    }

    fn add_step(&mut self, step: f64, size: f64) {
        // A difference of equal numbers is zero or rounding.
        if step <= size * 1e-9 {
            return;
        }
        if self.steps == 0 || step < self.smallest * 0.6 {
            self.found = self.found();
            (self.smallest, self.steps, self.on_grid) = (step, 0, 0);
        }
        let multiple = step / self.smallest;
        self.steps += 1;
        self.on_grid += u32::from((multiple - multiple.round()).abs() < 0.05);
        if self.steps >= RENEW {
            self.found = self.found();
            self.steps = 0;
        }
    }

    /// The smallest step, where the others are multiples of it; what the search before found, while there are too few.
    fn found(&self) -> Option<f64> {
        if self.steps < ENOUGH {
            return self.found;
        }
        let share = f64::from(self.on_grid) / f64::from(self.steps);
        (share >= SHARE).then_some(self.smallest)
    }

    /// The step of the grid, where it is coarse enough to matter for this sensor.
    #[must_use]
    pub fn step(&self, kind: SensorKind) -> Option<f64> {
        let matters = match kind {
            SensorKind::Gyroscope => 5e-4,
            SensorKind::Accelerometer => 5e-3,
            SensorKind::Magnetometer | SensorKind::MagnetometerUncalibrated => 0.05,
            _ => return None,
        };
        self.found().filter(|step| *step >= matters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step_of(values: impl Iterator<Item = f64>) -> Option<f64> {
        let mut resolution = Resolution::default();
        for x in values {
            resolution.add(&Sample::SpecificForce(Vector3::new(x, 2.0, 9.8)));
        }
        resolution.step(SensorKind::Accelerometer)
    }

    #[test]
    fn rounding_to_a_tenth_is_found_and_smooth_values_have_no_grid() {
        let smooth = || (0..900).map(|k| (f64::from(k) * 0.37).sin() + f64::from(k % 13) * 0.0173);
        let step = step_of(smooth().map(|x| (x * 10.0).round() / 10.0)).unwrap();
        assert!((step - 0.1).abs() < 1e-6, "{step}");
        assert_eq!(step_of(smooth()), None);
    }

    #[test]
    fn nothing_is_claimed_of_a_sensor_that_stands_still() {
        assert_eq!(step_of((0..500).map(|_| 1.0)), None);
    }
}
