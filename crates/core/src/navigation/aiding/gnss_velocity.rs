//! Velocity of a GNSS antenna: lever arm, latency of its own.
//!
//! *Read first:* `docs/derivations/error_state.md`, (E22).

use nalgebra::{SVector, Vector3};

use super::with_turned;
use crate::geometry::rotation;
use crate::navigation::augmented_states::TIME_OFFSET;
use crate::navigation::error_state::{Row, SIDE, SparseMeasurement};
use crate::navigation::history::Instant;
use crate::navigation::{ACCELEROMETER_BIAS, GYROSCOPE_BIAS, VELOCITY};
use crate::scalar::Scalar;

/// A velocity as a receiver gives it (NMEA RMC and VTG, UBX NAV-PVT).
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GnssVelocity<T: Scalar> {
    /// Velocity of the antenna, m/s, north, east, down.
    pub ned: Vector3<T>,
    /// Standard deviations, m/s.
    pub std: Vector3<T>,
    /// Whether the vertical component is measured; `false` for speed and course.
    pub has_vertical: bool,
}

/// Rows of a velocity that was valid at `then` (E22); `components` are those measured: 0 north, 1 east, 2 down.
pub fn measurement<T: Scalar, const M: usize>(
    then: &Instant<T>,
    lever_arm: &Vector3<T>,
    ned: &Vector3<T>,
    variance: &Vector3<T>,
    components: [usize; M],
) -> SparseMeasurement<T, M> {
    let axes = rotation::to_matrix(&then.ned_from_body);
    let swinging = then.angular_rate.cross(lever_arm);
    let swing = axes * swinging;
    let predicted = then.velocity + swing;
    let centripetal = axes * then.angular_rate.cross(&swinging);
    let acceleration = then.acceleration + centripetal;
    let turned = swing - then.force_integral;
    let row = |i: usize| {
        let mut row = Row::of_state(VELOCITY + i).with(SIDE + TIME_OFFSET, -acceleration[i]);
        // Of C t, and of C [l]x.
        let axis = axes.row(i).transpose();
        let by_force_bias = axis * then.age_s;
        let by_rate_bias = axis.cross(lever_arm);
        for j in 0..3 {
            row = row
                .with(ACCELEROMETER_BIAS + j, by_force_bias[j])
                .with(GYROSCOPE_BIAS + j, by_rate_bias[j]);
        }
        with_turned(row, &turned, i)
    };
    SparseMeasurement {
        rows: components.map(row),
        residual: SVector::from(components.map(|i| ned[i] - predicted[i])),
        variance: SVector::from(components.map(|i| variance[i])),
        freed: components.map(|i| VELOCITY + i),
    }
}
