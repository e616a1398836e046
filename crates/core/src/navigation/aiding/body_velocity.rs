//! Non-holonomic constraint and wheel speed, velocity in the axes of a vehicle: none sideways and up (non-holonomic constraint), and its speed from wheels
//! or a ship's log.
//!
//! *Read first:* `docs/derivations/error_state.md`, (E26).
//!
//! The unit is never mounted quite straight: 2 degrees of pitch are 0.5 m/s of false climb at 15 m/s, and pushed
//! the height of a drive by 12 m. Pitch and yaw of the mount are therefore augmented states, learnt on the way.

use nalgebra::{SVector, Vector3};

use crate::navigation::augmented_states::{AugmentedStates, MOUNT_PITCH, MOUNT_YAW};
use crate::navigation::error_state::{Row, SIDE, SparseMeasurement};
use crate::navigation::history::Instant;
use crate::navigation::{ATTITUDE, GYROSCOPE_BIAS, VELOCITY};
use crate::scalar::Scalar;

/// An axis of the vehicle in body axes, and its derivatives by mount pitch and mount yaw.
struct Axis<T: Scalar> {
    direction: Vector3<T>,
    by_pitch: Vector3<T>,
    by_yaw: Vector3<T>,
}

/// Forward, right and down of the vehicle in body axes: `body_from_vehicle = Rz(yaw) Ry(pitch)`.
fn axes<T: Scalar>(side: &AugmentedStates<T>) -> [Axis<T>; 3] {
    let (sp, cp) = side.values[MOUNT_PITCH].sin_cos();
    let (sy, cy) = side.values[MOUNT_YAW].sin_cos();
    let zero = T::zero();
    [
        Axis {
            direction: Vector3::new(cy * cp, sy * cp, -sp),
            by_pitch: Vector3::new(-cy * sp, -sy * sp, -cp),
            by_yaw: Vector3::new(-sy * cp, cy * cp, zero),
        },
        Axis {
            direction: Vector3::new(-sy, cy, zero),
            by_pitch: Vector3::zeros(),
            by_yaw: Vector3::new(-cy, -sy, zero),
        },
        Axis {
            direction: Vector3::new(cy * sp, sy * sp, cp),
            by_pitch: Vector3::new(cy * cp, sy * cp, -sp),
            by_yaw: Vector3::new(-sy * sp, cy * sp, zero),
        },
    ]
}

/// Rows of a vehicle that neither slips nor jumps at the point `reference_arm` (m, body axes from the unit: the
/// middle of the rear axle of a car): nothing to the right, nothing down.
pub fn non_holonomic<T: Scalar>(
    then: &Instant<T>,
    side: &AugmentedStates<T>,
    reference_arm: &Vector3<T>,
    variance: T,
) -> SparseMeasurement<T, 2> {
    let [_, right, down] = axes(side);
    let (right_row, right_speed) = along(then, &right, reference_arm);
    let (down_row, down_speed) = along(then, &down, reference_arm);
    SparseMeasurement {
        rows: [right_row, down_row],
        residual: SVector::<T, 2>::new(-right_speed, -down_speed),
        variance: SVector::<T, 2>::repeat(variance),
        // There is no one state to blame: a long slide is accepted as it is.
        freed: [usize::MAX; 2],
    }
}

/// Row of a speed (m/s) along the vehicle's forward axis, negative backwards.
pub fn speed<T: Scalar>(
    then: &Instant<T>,
    side: &AugmentedStates<T>,
    reference_arm: &Vector3<T>,
    forward: T,
    variance: T,
) -> SparseMeasurement<T, 1> {
    let [axis, _, _] = axes(side);
    let (row, predicted) = along(then, &axis, reference_arm);
    SparseMeasurement {
        rows: [row],
        residual: SVector::<T, 1>::new(forward - predicted),
        variance: SVector::<T, 1>::new(variance),
        freed: [usize::MAX],
    }
}

/// The speed of the reference point along an axis, and its row (E26).
fn along<T: Scalar>(then: &Instant<T>, axis: &Axis<T>, reference_arm: &Vector3<T>) -> (Row<T>, T) {
    let body_from_ned = then.ned_from_body.inverse();
    let velocity = body_from_ned * then.velocity + then.angular_rate.cross(reference_arm);
    let in_ned = then.ned_from_body * axis.direction;
    let by_attitude = in_ned.cross(&then.velocity);
    let by_rate_bias = axis.direction.cross(reference_arm);
    let mut row = Row::default()
        .with(SIDE + MOUNT_PITCH, axis.by_pitch.dot(&velocity))
        .with(SIDE + MOUNT_YAW, axis.by_yaw.dot(&velocity));
    for j in 0..3 {
        row = row
            .with(VELOCITY + j, in_ned[j])
            .with(ATTITUDE + j, by_attitude[j])
            .with(GYROSCOPE_BIAS + j, by_rate_bias[j]);
    }
    (row, axis.direction.dot(&velocity))
}
