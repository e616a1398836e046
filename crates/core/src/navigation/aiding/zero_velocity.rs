//! Zero-velocity and zero-rate update: at rest the velocity is zero, and what the gyroscope shows is its bias.
//!
//! *Read first:* `docs/derivations/error_state.md`, (E25).

use nalgebra::{Vector2, Vector3};

use crate::navigation::error_state::{Row, SparseMeasurement};
use crate::navigation::history::Instant;
use crate::navigation::{GYROSCOPE_BIAS, VELOCITY};
use crate::scalar::Scalar;

/// Rows of a velocity that is zero.
pub fn velocity<T: Scalar>(then: &Instant<T>, variance: T) -> SparseMeasurement<T, 3> {
    of_states(VELOCITY, &-then.velocity, variance)
}

/// Rows of an angular rate that is zero: `mean_rate` (rad/s, as measured, averaged while the body stood) is bias
/// and noise of `variance`. `bias` is the present estimate.
pub fn rate<T: Scalar>(
    mean_rate: &Vector3<T>,
    bias: &Vector3<T>,
    variance: T,
) -> SparseMeasurement<T, 3> {
    of_states(GYROSCOPE_BIAS, &(mean_rate - bias), variance)
}

/// Rows of a prior: horizontally the velocity is zero, give or take `variance` (E31).
pub fn damping<T: Scalar>(velocity: &Vector3<T>, variance: T) -> SparseMeasurement<T, 2> {
    SparseMeasurement {
        rows: core::array::from_fn(|i| Row::of_state(VELOCITY + i)),
        residual: -velocity.xy(),
        variance: Vector2::repeat(variance),
        freed: [usize::MAX; 2],
    }
}

fn of_states<T: Scalar>(
    first: usize,
    residual: &Vector3<T>,
    variance: T,
) -> SparseMeasurement<T, 3> {
    SparseMeasurement {
        rows: core::array::from_fn(|i| Row::of_state(first + i)),
        residual: *residual,
        variance: Vector3::repeat(variance),
        freed: core::array::from_fn(|i| first + i),
    }
}
