//! Heading from a magnetometer: the direction of the field's horizontal part, and nothing else.
//!
//! Read first: `docs/derivations/mekf.md`, section on the heading-only update (M17). The measured
//! field is turned into the reference frame with the estimated attitude and projected on the
//! horizontal plane; the angle to the reference field there is the residual. Its row is the up
//! direction in body axes. The coupling with tilt errors, `tan(dip)` times the tilt, is left out
//! on purpose: a wrong field can then turn the heading but never tip the tilt.

use nalgebra::{UnitQuaternion, Vector3};

use super::vector_sensor::{References, VectorSensor};
use crate::scalar::{Scalar, lit};

/// The reference a heading is measured against.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeadingReference<T: Scalar> {
    /// Unit vector up in the reference frame.
    pub up: Vector3<T>,
    /// Unit vector along the horizontal part of the reference field.
    pub north: Vector3<T>,
    /// Horizontal strength of the field, microtesla.
    pub horizontal_ut: T,
    /// Upward strength of the field, microtesla (negative on the northern hemisphere).
    pub upward_ut: T,
}

/// One measured heading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Heading<T: Scalar> {
    /// Angle about up from the measured to the reference north, rad.
    pub residual: T,
    /// Its noise variance, rad^2.
    pub variance: T,
    /// The measurement row on the local attitude error: up in body axes.
    pub row: Vector3<T>,
}

impl<T: Scalar> HeadingReference<T> {
    /// The heading reference of a field; `None` without a field or where it stands vertical.
    pub fn new(references: &References<T>) -> Option<Self> {
        let up = references.specific_force.try_normalize(lit(1e-6))?;
        let field = references.magnetic_field?;
        let upward_ut = field.dot(&up);
        let horizontal = field - up * upward_ut;
        let horizontal_ut = horizontal.norm();
        let north = horizontal.try_normalize(field.norm() * lit(1e-2))?;
        Some(Self {
            up,
            north,
            horizontal_ut,
            upward_ut,
        })
    }

    /// Measures the heading residual of the field `measured` (body axes) at `attitude`.
    ///
    /// The variance is the sensor's, plus its norm gain times the squared deviation of the field's
    /// horizontal and vertical strength, over the horizontal strength squared. `None` when the
    /// measured field has less than a tenth of the reference's horizontal strength.
    #[inline]
    pub fn measure(
        &self,
        attitude: &UnitQuaternion<T>,
        measured: &Vector3<T>,
        sensor: &VectorSensor<T>,
    ) -> Option<Heading<T>> {
        let in_reference = attitude * measured;
        let upward = in_reference.dot(&self.up);
        let horizontal = in_reference - self.up * upward;
        let strength = horizontal.norm();
        if strength <= self.horizontal_ut * lit(0.1) {
            return None;
        }
        let sine = horizontal.cross(&self.north).dot(&self.up);
        let residual = sine.atan2(horizontal.dot(&self.north));
        let (dh, du) = (strength - self.horizontal_ut, upward - self.upward_ut);
        let field_variance = sensor.variance() + sensor.norm_gain() * (dh * dh + du * du);
        Some(Heading {
            residual,
            variance: field_variance / (self.horizontal_ut * self.horizontal_ut),
            row: attitude.inverse() * self.up,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::AttitudeConfig;
    use crate::geometry::{frames::TangentFrame, so3};
    use approx::assert_relative_eq;
    use nalgebra::{RealField, SVector};
    use num_dual::{DualSVec64, gradient};

    fn reference(frame: TangentFrame) -> (HeadingReference<f64>, Vector3<f64>) {
        let field = frame.magnetic_field(20.0, 40.0);
        let references = References {
            specific_force: frame.specific_force_at_rest(9.81),
            magnetic_field: Some(field),
        };
        (HeadingReference::new(&references).unwrap(), field)
    }

    /// The row, against dual numbers: an error about up turns the residual one to one, an error
    /// about a horizontal axis couples with tan(dip), which the row leaves out.
    #[test]
    fn row_is_up_in_body_axes_and_the_tilt_coupling_is_what_is_left_out() {
        for frame in [TangentFrame::Enu, TangentFrame::Ned] {
            let (heading, field) = reference(frame);
            let attitude = so3::exp(&Vector3::new(0.5, -0.8, 1.1));
            let up = heading.up.map(DualSVec64::<3>::from);
            let north = heading.north.map(DualSVec64::<3>::from);
            let (_, row) = gradient(
                |a: SVector<DualSVec64<3>, 3>| {
                    // What the estimate `attitude` sees of a world whose truth is off by `a`.
                    let truth = attitude.cast::<DualSVec64<3>>() * so3::exp(&a);
                    let measured = truth.inverse() * field.map(DualSVec64::<3>::from);
                    let m = attitude.cast::<DualSVec64<3>>() * measured;
                    let h = m - up * m.dot(&up);
                    RealField::atan2(h.cross(&north).dot(&up), h.dot(&north))
                },
                &Vector3::zeros(),
            );
            let measured = attitude.inverse() * field;
            let sensor = VectorSensor::magnetometer(&AttitudeConfig::default());
            let ours = heading.measure(&attitude, &measured, &sensor).unwrap();
            let in_world = attitude * (row - ours.row);
            assert_relative_eq!(in_world.dot(&heading.up), 0.0, epsilon = 1e-12);
            assert_relative_eq!(in_world.norm(), 2.0, epsilon = 1e-12); // tan(dip) = 40/20
        }
    }

    #[test]
    fn vertical_field_has_no_heading() {
        let up = Vector3::new(0.0, 0.0, 9.81);
        let references = References {
            specific_force: up,
            magnetic_field: Some(Vector3::new(0.0, 0.01, -50.0)),
        };
        assert!(HeadingReference::<f64>::new(&references).is_none());
        let (heading, _) = reference(TangentFrame::Enu);
        let sensor = VectorSensor::magnetometer(&AttitudeConfig::default());
        assert!(
            heading
                .measure(
                    &UnitQuaternion::identity(),
                    &Vector3::new(0.0, 1.0, -44.0),
                    &sensor
                )
                .is_none()
        );
    }
}
