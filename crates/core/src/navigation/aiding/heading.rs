//! Heading of the body's forward axis: from a gyrocompass, two antennas, or a magnetometer.
//!
//! *Read first:* `docs/derivations/error_state.md`, (E13) and (E23).
//!
//! A magnetometer's heading is measured in the horizontal plane of the *estimate*: what the tilt is wrong by
//! leaks into it by the tangent of the dip (1.9 fold at 62 degrees). The row says so; without it the filter
//! would take tilt for heading.

use nalgebra::{Vector1, Vector3};

use crate::geometry::rotation;
use crate::geometry::trigonometry::{atan2, sin_cos, wrap};
use crate::kalman::SkipReason;
use crate::navigation::ATTITUDE;
use crate::navigation::error_state::{Row, SparseMeasurement};
use crate::navigation::history::Instant;
use crate::scalar::{Scalar, lit};

/// Squared cosine of the pitch, and square of the horizontal share of a field, below which there is no heading.
const LEAST_HORIZONTAL: f64 = 0.01;

/// Row of a true heading (rad, clockwise from north) of the forward axis (E13).
///
/// # Errors
/// [`SkipReason::Unobservable`] when the body points almost straight up or down.
pub fn measurement<T: Scalar>(
    then: &Instant<T>,
    heading: T,
    variance: T,
) -> Result<SparseMeasurement<T, 1>, SkipReason> {
    let forward = rotation::forward(&then.ned_from_body);
    let horizontal = forward.x * forward.x + forward.y * forward.y;
    if horizontal < lit(LEAST_HORIZONTAL) {
        return Err(SkipReason::Unobservable);
    }
    let tangent = -forward.z / horizontal;
    let row = Row::of_state(ATTITUDE + 2)
        .with(ATTITUDE, tangent * forward.x)
        .with(ATTITUDE + 1, tangent * forward.y);
    let residual = wrap(heading - atan2(forward.y, forward.x));
    Ok(one(row, residual, variance))
}

/// Row of a magnetic field (body axes, calibrated, any unit) whose horizontal part points to magnetic north,
/// `declination` (rad) east of north (E23).
///
/// # Errors
/// [`SkipReason::Unobservable`] when the field is almost vertical, [`SkipReason::NotFinite`] when it is none.
pub fn magnetic<T: Scalar>(
    then: &Instant<T>,
    field: &Vector3<T>,
    declination: T,
    variance: T,
) -> Result<SparseMeasurement<T, 1>, SkipReason> {
    let m = then.ned_from_body * field;
    let total = m.norm_squared();
    let horizontal = m.x * m.x + m.y * m.y;
    if !total.is_finite() {
        return Err(SkipReason::NotFinite);
    }
    if horizontal <= total * lit(LEAST_HORIZONTAL) {
        return Err(SkipReason::Unobservable);
    }
    // Along where north is, not where this sample says: the noise that is in the residual must not be in the row, or
    // every sample pulls the tilt the same way.
    let tangent = m.z / horizontal.sqrt();
    let (sin, cos) = sin_cos(declination);
    let row = Row::of_state(ATTITUDE + 2)
        .with(ATTITUDE, -tangent * cos)
        .with(ATTITUDE + 1, -tangent * sin);
    let residual = wrap(declination - atan2(m.y, m.x));
    Ok(one(row, residual, variance))
}

fn one<T: Scalar>(row: Row<T>, residual: T, variance: T) -> SparseMeasurement<T, 1> {
    SparseMeasurement {
        rows: [row],
        residual: Vector1::new(residual),
        variance: Vector1::new(variance),
        freed: [ATTITUDE + 2],
    }
}
