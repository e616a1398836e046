//! Angles out of what the sensors say, and the sines and cosines that the filters share.

use nalgebra::Vector3;

use super::AxisAngles;
use crate::geometry::trigonometry::{atan2, sin_cos};
use crate::scalar::{Scalar, lit};

/// Below this force (m/s^2) across the pitch axis, a tenth of gravity, roll is not defined.
const LEAST_ACROSS: f64 = 0.980_665;
/// Below this cosine of the pitch roll and yaw are held: three degrees from the pole.
const LEAST_COSINE: f64 = 0.052;
/// Below this share of the squared field the horizontal part has no direction.
const LEAST_HORIZONTAL: f64 = 1e-8;

/// Yaw, pitch and roll (rad) by gravity alone, from the specific force in forward, right, down.
/// `None` for the roll where the device stands on its nose or tail.
pub fn tilt_of<T: Scalar>(specific_force: &Vector3<T>, angles: AxisAngles) -> (Option<T>, T) {
    let f = specific_force;
    match angles {
        AxisAngles::Exact => {
            let across = (f.y * f.y + f.z * f.z).sqrt();
            let roll = (across >= lit(LEAST_ACROSS)).then(|| atan2(-f.y, -f.z));
            (roll, atan2(f.x, across))
        }
        AxisAngles::Printed => {
            // The quotients of the paper; a z of zero is what it cannot take.
            let usable = f.z.abs() >= lit(1e-6);
            let z = if usable { f.z } else { lit(1e-6) };
            let atan = |quotient: T| atan2(quotient, T::one());
            (usable.then(|| -atan(f.y / z)), atan(f.x / z))
        }
    }
}

/// Magnetic heading (rad, clockwise from magnetic north) of a body at this roll and pitch, from its
/// field in forward, right, down (A5). `None` for a field without horizontal part.
pub fn tilt_compensated_heading<T: Scalar>(field: &Vector3<T>, roll: T, pitch: T) -> Option<T> {
    Tilt::at(roll, pitch).heading(field, field.norm_squared())
}

/// Sines and cosines of roll and pitch: computed once for rates, heading and attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Tilt<T> {
    pub(super) sin_roll: T,
    pub(super) cos_roll: T,
    pub(super) sin_pitch: T,
    pub(super) cos_pitch: T,
}

impl<T: Scalar> Tilt<T> {
    pub(super) fn at(roll: T, pitch: T) -> Self {
        let (sin_roll, cos_roll) = sin_cos(roll);
        let (sin_pitch, cos_pitch) = sin_cos(pitch);
        Self {
            sin_roll,
            cos_roll,
            sin_pitch,
            cos_pitch,
        }
    }

    /// Whether roll and yaw are no longer told apart.
    #[inline]
    pub(super) fn is_at_a_pole(&self) -> bool {
        self.cos_pitch.abs() < lit(LEAST_COSINE)
    }

    /// A vector of the body in level axes, ahead, to the right, down: `Ry(pitch) Rx(roll) v`.
    #[inline(always)]
    pub(super) fn levelled(&self, v: &Vector3<T>) -> Vector3<T> {
        let below = v.y * self.sin_roll + v.z * self.cos_roll;
        Vector3::new(
            v.x * self.cos_pitch + below * self.sin_pitch,
            v.y * self.cos_roll - v.z * self.sin_roll,
            below * self.cos_pitch - v.x * self.sin_pitch,
        )
    }

    /// Heading from a field with this squared norm (A5), `None` without horizontal part.
    #[inline(always)]
    pub(super) fn heading(&self, field: &Vector3<T>, norm_squared: T) -> Option<T> {
        let level = self.levelled(field);
        let horizontal = level.x * level.x + level.y * level.y;
        let defined = horizontal > norm_squared * lit(LEAST_HORIZONTAL);
        defined.then(|| atan2(-level.y, level.x))
    }
}
