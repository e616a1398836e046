//! Aiding measurements of inertial navigation, one file each: the measurement and the rows of its Jacobian.
//!
//! Each file has a function from the state at the instant of validity ([`Instant`](super::history::Instant)) to a
//! [`SparseMeasurement`](super::error_state::SparseMeasurement), free of side effects, so that its Jacobian can be held
//! against dual numbers. [`ErrorStateFilter::fuse_sparse`](super::ErrorStateFilter::fuse_sparse) does the rest.
//!
//! | file | measures |
//! |---|---|
//! | `gnss_position.rs` | position of an antenna off the unit |
//! | `gnss_velocity.rs` | its velocity |
//! | `heading.rs` | heading from a gyrocompass, a dual antenna or a magnetometer |
//! | `magnetic_field.rs` | magnetic north, up to the iron that the body carries |
//! | `barometer.rs` | height, up to a slow offset |
//! | `zero_velocity.rs` | that the body stands |
//! | `body_velocity.rs` | that a vehicle does not move sideways; its speed from wheels or a log |

pub mod barometer;
pub mod body_velocity;
pub mod gnss_position;
pub mod gnss_velocity;
pub mod heading;
pub mod magnetic_field;
pub mod zero_velocity;

#[cfg(test)]
mod tests;

use nalgebra::Vector3;

use super::error_state::Row;
use crate::scalar::Scalar;

/// Adds the elements of row `i` of `-[v]x` for the attitude error: what turning a vector `v` (NED) does to its
/// component `i`.
fn with_turned<T: Scalar>(row: Row<T>, v: &Vector3<T>, i: usize) -> Row<T> {
    match i {
        0 => row.with(1, v.z).with(2, -v.y),
        1 => row.with(0, -v.z).with(2, v.x),
        _ => row.with(0, v.y).with(1, -v.x),
    }
}
