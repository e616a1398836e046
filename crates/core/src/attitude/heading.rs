//! Heading from a magnetometer, and the heading that a device reports by itself.
//!
//! Read first: `docs/derivations/mekf.md`, sections on the heading-only update (M17) and on the
//! compass (M17e). From a magnetometer only the field's horizontal direction is taken: the measured
//! field is turned into the reference frame with the estimated attitude and projected on the
//! horizontal plane; the angle to the reference field there is the residual. Its row is the up
//! direction in body axes. The coupling with tilt errors, `tan(dip)` times the tilt, is left out
//! on purpose: a wrong field can then turn the heading but never tip the tilt.

use nalgebra::{UnitQuaternion, Vector3};

use super::vector_sensor::{LONGEST_REFERENCE, References, SHORTEST_REFERENCE, VectorSensor};
use crate::geometry::frames::TangentFrame;
use crate::kalman::SkipReason;
use crate::kalman::innovation::check_vector;
use crate::scalar::{Scalar, lit};

/// The reference a heading is measured against.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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

impl<T: Scalar> HeadingReference<T> {
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let strengths = [&self.horizontal_ut, &self.upward_ut];
        self.up.iter().chain(&self.north).chain(strengths)
    }
}

/// The top axis must keep at least this share of its length on the horizon (60 deg of elevation at
/// most): nearer to the vertical a heading says little, and phones change what they mean by it.
pub const LEAST_HORIZONTAL: f64 = 0.5;

/// A heading as phones report it: where the horizontal part of the body's y axis (the top edge of a
/// phone) points, clockwise from north seen from above. Screen up or down makes no difference. It
/// is not defined while that axis stands near the vertical ([`LEAST_HORIZONTAL`]).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CompassHeading<T: Scalar> {
    /// The frame whose north is meant; it is that of the attitude.
    pub frame: TangentFrame,
    /// Clockwise from magnetic north, rad.
    pub heading: T,
    /// Its standard deviation as the device states it, rad.
    pub std: T,
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
        let field = references.magnetic_field?;
        for reference in [&references.specific_force, &field] {
            check_vector(reference, lit(SHORTEST_REFERENCE), lit(LONGEST_REFERENCE)).ok()?;
        }
        let up = references.specific_force.normalize();
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

impl<T: Scalar> CompassHeading<T> {
    /// The residual at `attitude` and its complete row (M17e, M17f), with the stated variance.
    ///
    /// # Errors
    /// Why there is nothing to measure: a number that is none, or the top axis near the vertical.
    #[inline]
    pub fn measure(&self, attitude: &UnitQuaternion<T>) -> Result<Heading<T>, SkipReason> {
        if !(self.heading.is_finite() && self.std.is_finite()) {
            return Err(SkipReason::NotFinite);
        }
        // A few turns are a matter of taste, more are no heading; nor is one that is off by more.
        let std_is_one = self.std >= T::zero() && self.std <= lit(100.0);
        if self.heading.abs() > lit(100.0) || !std_is_one {
            return Err(SkipReason::OutOfRange);
        }
        let up_body = attitude.inverse() * self.frame.up::<T>();
        // The top axis is (0, 1, 0) in the body: its part along up, and what is left.
        let along_up = up_body.y;
        let horizontal_squared = T::one() - along_up * along_up;
        if horizontal_squared < lit(LEAST_HORIZONTAL * LEAST_HORIZONTAL) {
            return Err(SkipReason::Unobservable);
        }
        let horizontal_body = Vector3::y() - up_body * along_up;
        let (top, north) = (attitude * horizontal_body, self.frame.north::<T>());
        let east = north.cross(&self.frame.up());
        let predicted = top.dot(&east).atan2(top.dot(&north));
        let difference = predicted - self.heading;
        Ok(Heading {
            residual: difference.sin().atan2(difference.cos()),
            variance: self.std * self.std,
            row: up_body - horizontal_body * (along_up / horizontal_squared),
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
            let sensor = VectorSensor::magnetometer(&AttitudeConfig::lab());
            let ours = heading.measure(&attitude, &measured, &sensor).unwrap();
            let in_world = attitude * (row - ours.row);
            assert_relative_eq!(in_world.dot(&heading.up), 0.0, epsilon = 1e-12);
            assert_relative_eq!(in_world.norm(), 2.0, epsilon = 1e-12); // tan(dip) = 40/20
        }
    }

    fn compass(frame: TangentFrame, heading: f64) -> CompassHeading<f64> {
        let std = 0.1;
        CompassHeading {
            frame,
            heading,
            std,
        }
    }

    /// The complete row, tilt included, against dual numbers.
    #[test]
    fn the_compass_row_equals_dual_numbers() {
        for (frame, turn) in [
            (TangentFrame::Enu, Vector3::new(0.5, -0.8, 1.1)),
            (TangentFrame::Enu, Vector3::new(-0.9, 0.1, -2.0)),
            (TangentFrame::Ned, Vector3::new(2.9, 0.4, 0.3)),
            (TangentFrame::Ned, Vector3::new(0.2, 3.0, 0.6)),
        ] {
            let attitude = so3::exp(&turn);
            let up = frame.up::<DualSVec64<3>>();
            let north = frame.north::<DualSVec64<3>>();
            let (heading, gradient) = gradient(
                |a: SVector<DualSVec64<3>, 3>| {
                    let truth = attitude.cast::<DualSVec64<3>>() * so3::exp(&a);
                    let top = truth * Vector3::y();
                    RealField::atan2(top.dot(&north.cross(&up)), top.dot(&north))
                },
                &Vector3::zeros(),
            );
            let ours = compass(frame, heading).measure(&attitude).unwrap();
            assert_relative_eq!(ours.residual, 0.0, epsilon = 1e-12);
            // Headings run clockwise, residuals about up.
            assert_relative_eq!(ours.row, -gradient, epsilon = 1e-12);
        }
    }

    #[test]
    fn a_heading_is_that_of_the_top_edge_clockwise_from_north() {
        // The top edge to the east, level and raised by 50 deg, screen up and down.
        let level = so3::exp(&Vector3::new(0.0, 0.0, -core::f64::consts::FRAC_PI_2));
        let raised = level * so3::exp(&Vector3::new(0.87, 0.0, 0.0));
        let over = level * so3::exp(&Vector3::new(0.0, core::f64::consts::PI, 0.0));
        for attitude in [level, raised, over] {
            let m = compass(TangentFrame::Enu, core::f64::consts::FRAC_PI_2).measure(&attitude);
            assert_relative_eq!(m.unwrap().residual, 0.0, epsilon = 1e-12);
        }
        // The device reads 30 deg more than estimated: the truth is turned clockwise, so negative.
        let m = compass(TangentFrame::Enu, 2.0 * core::f64::consts::FRAC_PI_3).measure(&level);
        assert_relative_eq!(
            m.unwrap().residual,
            -core::f64::consts::FRAC_PI_6,
            epsilon = 1e-12
        );
        // Across the wrap.
        let north = UnitQuaternion::identity();
        let m = compass(TangentFrame::Enu, 6.2).measure(&north).unwrap();
        assert_relative_eq!(m.residual, core::f64::consts::TAU - 6.2, epsilon = 1e-12);
    }

    #[test]
    fn near_the_vertical_and_without_numbers_there_is_no_compass() {
        for pitch in [1.1, 1.57, 2.0] {
            let upright = so3::exp(&Vector3::new(pitch, 0.0, 0.0));
            let m = compass(TangentFrame::Enu, 0.0).measure(&upright);
            assert_eq!(m.unwrap_err(), SkipReason::Unobservable);
        }
        let level = UnitQuaternion::identity();
        let reason = |heading, std| {
            let frame = TangentFrame::Enu;
            let m = CompassHeading {
                frame,
                heading,
                std,
            };
            m.measure(&level).unwrap_err()
        };
        assert_eq!(reason(f64::NAN, 0.1), SkipReason::NotFinite);
        assert_eq!(reason(0.0, f64::INFINITY), SkipReason::NotFinite);
        assert_eq!(reason(1e9, 0.1), SkipReason::OutOfRange);
        assert_eq!(reason(0.0, -1.0), SkipReason::OutOfRange);
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
        let sensor = VectorSensor::magnetometer(&AttitudeConfig::lab());
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
