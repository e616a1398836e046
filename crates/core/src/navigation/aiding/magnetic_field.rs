//! Magnetic heading, from a magnetometer that also feels the iron of what carries it.
//!
//! *Read first:* `docs/derivations/error_state.md`, (E23) and (E36).
//!
//! The iron of a car or of a phone's holder turns with the body: it adds a constant to the field in body axes (hard
//! iron). Uncalibrated it is as large as the horizontal field itself, and turns the heading by tens of degrees. Here it is
//! three of the [`AugmentedStates`], learnt as the body turns while satellites tell the heading.
//!
//! The residual is the component of the levelled field across magnetic north, not its angle: it is linear in the offset
//! however large that is. Only where the field points backwards by more than the iron can explain is it the angle.

use nalgebra::{Vector1, Vector3};

use crate::geometry::rotation;
use crate::kalman::SkipReason;
use crate::navigation::ATTITUDE;
use crate::navigation::augmented_states::{AugmentedStates, MAGNETIC_OFFSET};
use crate::navigation::error_state::{Row, SIDE, SparseMeasurement};
use crate::navigation::history::Instant;
use crate::scalar::{Scalar, lit};

/// Horizontal share of the field below which there is no magnetic north: 84 degrees of dip.
const LEAST_HORIZONTAL: f64 = 0.1;
/// Share of the whole field that the horizontal one is taken to have at least, while its offset is not known better.
const HORIZONTAL_FLOOR: f64 = 0.25;

/// Row of a magnetic field (microtesla, body axes) less its offset, whose horizontal part points to magnetic north,
/// `declination` (rad) east of north; `std` (rad) is that of the heading it tells (E36).
///
/// # Errors
/// [`SkipReason::Unobservable`] when the field is almost vertical, [`SkipReason::NotFinite`] when it is none.
pub fn measurement<T: Scalar>(
    then: &Instant<T>,
    side: &AugmentedStates<T>,
    field: &Vector3<T>,
    declination: T,
    std: T,
) -> Result<SparseMeasurement<T, 1>, SkipReason> {
    let axes = rotation::to_matrix(&then.ned_from_body);
    let offset = side.values.fixed_rows::<3>(MAGNETIC_OFFSET);
    let m = axes * (field - offset);
    let total = m.norm();
    if !total.is_finite() {
        return Err(SkipReason::NotFinite);
    }
    let horizontal = m.xy().norm();
    if horizontal <= total * lit(LEAST_HORIZONTAL) {
        return Err(SkipReason::Unobservable);
    }
    let (sin, cos) = (declination.sin(), declination.cos());
    let measured = m.x * cos + m.y * sin;
    let east = m.y * cos - m.x * sin;
    let iron = (0..3).fold(T::zero(), |largest, i| {
        let state = MAGNETIC_OFFSET + i;
        side.covariance[(state, state)].max(largest)
    });
    let iron = iron.sqrt();
    // While the iron is not known the levelled field may point anywhere; known, it is what it is.
    let floor = iron
        .min(total * lit(HORIZONTAL_FLOOR))
        .max(total * lit(LEAST_HORIZONTAL));
    // Iron does not turn a field about: then it is the heading that looks the other way, and the whole angle counts.
    let is_behind = measured < -(iron + iron);
    let (north, residual) = if is_behind {
        (horizontal, -east.atan2(measured))
    } else {
        let north = measured.max(floor);
        (north, -east / north)
    };
    // Along where north is, not where this sample says: the noise that is in the residual must not be in the row.
    let tangent = m.z / north;
    let mut row = Row::of_state(ATTITUDE + 2)
        .with(ATTITUDE, -tangent * cos)
        .with(ATTITUDE + 1, -tangent * sin);
    let seen = (axes.row(0) * sin - axes.row(1) * cos) / north;
    for (i, h) in seen.iter().enumerate() {
        row = row.with(SIDE + MAGNETIC_OFFSET + i, *h);
    }
    Ok(SparseMeasurement {
        rows: [row],
        residual: Vector1::new(residual),
        variance: Vector1::new(std * std),
        // What persists against the gate is more iron and not another heading, unless that looks backwards.
        freed: [if is_behind {
            ATTITUDE + 2
        } else {
            SIDE + MAGNETIC_OFFSET + seen.transpose().iamax()
        }],
    })
}
