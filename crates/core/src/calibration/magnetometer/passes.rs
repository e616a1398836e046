//! Calibration of samples that are kept: passes that leave out what the pass before found far off.

use nalgebra::Vector3;

use super::{
    MagnetometerCalibration, MagnetometerCalibrator, MagnetometerError, MagnetometerLimits,
    RANGE_UT,
};
use crate::scalar::{Scalar, lit};

/// Standard deviations from the surface beyond which a sample is left out.
const REJECTION: f64 = 3.5;

/// Calibrates in three passes over samples that are kept: the second and third leave out what lies
/// more than 3.5 standard deviations from the surface of the pass before, and count it.
///
/// The first pass must not refuse the samples, so a disturbance may spoil a few of them, not half;
/// it is given twice the residual that the last pass must keep.
///
/// # Errors
/// As [`MagnetometerCalibrator::finish`].
pub fn calibrate<T: Scalar, I>(
    samples_ut: &I,
    limits: &MagnetometerLimits<T>,
) -> Result<MagnetometerCalibration<T>, MagnetometerError<T>>
where
    I: Iterator<Item = Vector3<T>> + Clone,
{
    let first_limits = MagnetometerLimits {
        residual_std_ut: limits.residual_std_ut * lit(2.0),
        ..*limits
    };
    let mut calibrator = MagnetometerCalibrator::new();
    for sample in samples_ut.clone() {
        calibrator.add(&sample);
    }
    let mut calibration = calibrator.finish(&first_limits)?;
    for pass_limits in [&first_limits, limits] {
        let bound = calibration.residual_std_ut * lit(REJECTION);
        let mut calibrator = MagnetometerCalibrator::with_expected(calibration.hard_iron());
        let mut rejected = 0_u32;
        for sample in samples_ut.clone() {
            // The residual is that of the calibrated field; back to what the sensor shows.
            let scale = calibration.radius_ut / calibration.field_strength_ut;
            let residual = calibration.residual(&sample).abs() * scale;
            if residual > bound && residual < lit(RANGE_UT) {
                rejected = rejected.saturating_add(1);
            } else {
                calibrator.add(&sample);
            }
        }
        calibration = calibrator.finish(pass_limits)?;
        calibration.rejected_samples = rejected;
    }
    Ok(calibration)
}
