//! Calibrations of many devices and days: each recording of a run gets its own.

use northing_core::calibration::RestCalibration;
use northing_recording::Metadata;

use super::options::RunOptions;
use crate::calibration::magnetometer::MagnetometerStreamCalibration;
use crate::calibration::set::CalibrationSet;
use crate::error::EvaluationError;

/// The sets that recordings take their calibrations from.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Calibrations {
    /// Of the magnetometer.
    pub field: Option<CalibrationSet<MagnetometerStreamCalibration>>,
    /// At rest.
    pub rest: Option<CalibrationSet<RestCalibration<f64>>>,
}

impl Calibrations {
    /// Gives a recording's options the calibrations that belong to it. That of the magnetometer also
    /// says which stream is used.
    ///
    /// # Errors
    /// [`EvaluationError::NoCalibration`] where a set has none for it.
    pub fn apply(
        &self,
        metadata: &Metadata,
        options: &mut RunOptions,
    ) -> Result<(), EvaluationError> {
        if let Some(set) = &self.field {
            let (name, field) = set.of(metadata)?;
            options.calibration_names[1] = Some(name.clone());
            options.sensors.magnetometer_source = field.magnetometer;
            options.choose_magnetometer = false;
            options.magnetometer_calibration = Some(*field);
        }
        if let Some(set) = &self.rest {
            let (name, calibration) = set.of(metadata)?;
            options.calibration_names[0] = Some(name.clone());
            options.calibration = Some(*calibration);
        }
        Ok(())
    }
}
