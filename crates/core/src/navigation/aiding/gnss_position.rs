//! Position of a GNSS antenna: lever arm, late or early stamps, and the receiver's slow error.
//!
//! *Read first:* `docs/derivations/error_state.md`, (E21).

use nalgebra::{SVector, Vector3};

use super::with_turned;
use crate::navigation::augmented_states::{GNSS_OFFSET, TIME_OFFSET};
use crate::navigation::error_state::{Row, SIDE, SparseMeasurement};
use crate::navigation::history::Instant;
use crate::navigation::{POSITION, VELOCITY};
use crate::scalar::{Scalar, lit};

/// A position as a receiver gives it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GnssPosition<T: Scalar> {
    /// Position of the antenna, m, north, east and down of the origin.
    pub ned: Vector3<T>,
    /// Standard deviations as the receiver states them, m, north, east, down.
    pub std: Vector3<T>,
    /// Whether the height is measured; `false` for a two-dimensional fix.
    pub has_height: bool,
}

/// Rows of a position that was valid at `then` (E21). `offset` is the receiver's correlated error, NED; `variance` is that of what changes from fix to fix;
/// `components` are those measured: 0 north, 1 east, 2 down.
pub fn measurement<T: Scalar, const M: usize>(
    then: &Instant<T>,
    offset: &Vector3<T>,
    lever_arm: &Vector3<T>,
    ned: &Vector3<T>,
    variance: &Vector3<T>,
    components: [usize; M],
) -> SparseMeasurement<T, M> {
    let axes = then.ned_from_body;
    let arm = axes * lever_arm;
    let antenna_velocity = then.velocity + axes * then.angular_rate.cross(lever_arm);
    let predicted = then.position + arm + offset;
    // p_then = p - v t + ...: what the attitude did to the specific force since, twice integrated.
    let turned = arm + then.force_integral * (then.age_s * lit::<T>(0.5));
    let row = |i: usize| {
        let row = Row::of_state(POSITION + i)
            .with(VELOCITY + i, -then.age_s)
            .with(SIDE + GNSS_OFFSET + i, T::one())
            .with(SIDE + TIME_OFFSET, -antenna_velocity[i]);
        with_turned(row, &turned, i)
    };
    SparseMeasurement {
        rows: components.map(row),
        residual: SVector::from(components.map(|i| ned[i] - predicted[i])),
        variance: SVector::from(components.map(|i| variance[i])),
        freed: components.map(|i| POSITION + i),
    }
}
