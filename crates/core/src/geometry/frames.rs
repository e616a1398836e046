//! Reference and body frames, and the named functions that turn one into another.
//!
//! World frames: **ENU** (east, north, up: phones, ROS, motion capture) and **NED** (north, east,
//! down: aircraft, ships). Body frames: **FLU** (forward, left, up), **FRD** (forward, right,
//! down) and **phone** (x right edge, y top edge, z out of the screen; held level with the top
//! forward, phone axes are right, forward, up).
//!
//! Conversions happen at the edges of the program only, through these functions.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use crate::scalar::{Scalar, lit};

/// Which local tangent frame an attitude refers to; north is magnetic north unless said otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(rename_all = "kebab-case")
)]
pub enum TangentFrame {
    /// East, north, up.
    #[default]
    Enu,
    /// North, east, down.
    Ned,
}

impl TangentFrame {
    /// Specific force of a body at rest in this frame for gravity `g` (m/s^2): it points up.
    #[inline]
    pub fn specific_force_at_rest<T: Scalar>(self, g: T) -> Vector3<T> {
        self.up() * g
    }

    /// Unit vector up.
    #[inline]
    pub fn up<T: Scalar>(self) -> Vector3<T> {
        let (zero, one) = (T::zero(), T::one());
        match self {
            Self::Enu => Vector3::new(zero, zero, one),
            Self::Ned => Vector3::new(zero, zero, -one),
        }
    }

    /// Unit vector north.
    #[inline]
    pub fn north<T: Scalar>(self) -> Vector3<T> {
        let (zero, one) = (T::zero(), T::one());
        match self {
            Self::Enu => Vector3::new(zero, one, zero),
            Self::Ned => Vector3::new(one, zero, zero),
        }
    }

    /// Field vector (microtesla) of horizontal strength `horizontal` (towards magnetic north) and
    /// vertical strength `down`.
    #[inline]
    pub fn magnetic_field<T: Scalar>(self, horizontal: T, down: T) -> Vector3<T> {
        self.north::<T>() * horizontal - self.up::<T>() * down
    }
}

/// Vector in ENU from the same vector in NED (its own inverse).
#[inline]
pub fn enu_from_ned<T: Scalar>(v: &Vector3<T>) -> Vector3<T> {
    Vector3::new(v.y, v.x, -v.z)
}

/// Vector in NED from the same vector in ENU (its own inverse).
#[inline]
pub fn ned_from_enu<T: Scalar>(v: &Vector3<T>) -> Vector3<T> {
    enu_from_ned(v)
}

/// Vector in FLU body axes from FRD body axes (its own inverse).
#[inline]
pub fn flu_from_frd<T: Scalar>(v: &Vector3<T>) -> Vector3<T> {
    Vector3::new(v.x, -v.y, -v.z)
}

/// Vector in FLU body axes from phone axes (right, forward, up when held level).
#[inline]
pub fn flu_from_phone<T: Scalar>(v: &Vector3<T>) -> Vector3<T> {
    Vector3::new(v.y, -v.x, v.z)
}

/// The rotation `enu_from_ned` (a half turn about the axis north-east).
#[inline]
pub fn enu_from_ned_rotation<T: Scalar>() -> UnitQuaternion<T> {
    let s = lit::<T>(core::f64::consts::FRAC_1_SQRT_2);
    UnitQuaternion::new_unchecked(Quaternion::new(T::zero(), s, s, T::zero()))
}

/// The rotation `flu_from_frd` (a half turn about forward).
#[inline]
pub fn flu_from_frd_rotation<T: Scalar>() -> UnitQuaternion<T> {
    let (zero, one) = (T::zero(), T::one());
    UnitQuaternion::new_unchecked(Quaternion::new(zero, one, zero, zero))
}

/// `ned_from_frd` of the attitude `enu_from_flu` (the same physical attitude, the other habit).
#[inline]
pub fn ned_from_frd<T: Scalar>(enu_from_flu: &UnitQuaternion<T>) -> UnitQuaternion<T> {
    enu_from_ned_rotation::<T>().inverse() * enu_from_flu * flu_from_frd_rotation::<T>()
}

/// Covariance of a body-axis error turned into reference axes: `R P R^T`.
#[inline]
pub fn covariance_in_reference<T: Scalar>(
    ref_from_body: &UnitQuaternion<T>,
    covariance_body: &Matrix3<T>,
) -> Matrix3<T> {
    let r = ref_from_body.to_rotation_matrix().into_inner();
    r * covariance_body * r.transpose()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::so3;
    use approx::assert_relative_eq;

    #[test]
    fn rotations_are_the_vector_functions() {
        let v = Vector3::new(1.0, 2.0, 3.0);
        assert_relative_eq!(
            enu_from_ned_rotation::<f64>() * v,
            enu_from_ned(&v),
            epsilon = 1e-15
        );
        assert_relative_eq!(
            flu_from_frd_rotation::<f64>() * v,
            flu_from_frd(&v),
            epsilon = 1e-15
        );
        assert_relative_eq!(ned_from_enu(&enu_from_ned(&v)), v);
    }

    #[test]
    fn attitude_between_habits_keeps_vectors() {
        let enu_from_flu = so3::exp(&Vector3::new(0.3, -0.8, 1.9));
        let v_frd = Vector3::new(0.5, -1.5, 2.5);
        let through_ned = enu_from_ned(&(ned_from_frd(&enu_from_flu) * v_frd));
        assert_relative_eq!(
            through_ned,
            enu_from_flu * flu_from_frd(&v_frd),
            epsilon = 1e-14
        );
    }

    #[test]
    fn level_phone_pointing_north_is_the_identity_in_enu() {
        // Phone axes right, forward, up coincide with east, north, up; in FLU that is yaw 90 deg.
        let forward_flu = flu_from_phone(&Vector3::new(0.0, 1.0, 0.0));
        assert_relative_eq!(forward_flu, Vector3::x());
    }

    #[test]
    fn references_point_the_right_way() {
        assert_relative_eq!(
            TangentFrame::Enu.specific_force_at_rest(9.81),
            Vector3::new(0.0, 0.0, 9.81)
        );
        assert_relative_eq!(
            TangentFrame::Ned.specific_force_at_rest(9.81),
            Vector3::new(0.0, 0.0, -9.81)
        );
        assert_relative_eq!(
            TangentFrame::Enu.magnetic_field(20.0, 40.0),
            Vector3::new(0.0, 20.0, -40.0)
        );
        assert_relative_eq!(
            enu_from_ned(&TangentFrame::Ned.magnetic_field(20.0, 40.0)),
            TangentFrame::Enu.magnetic_field(20.0, 40.0)
        );
    }

    #[test]
    fn heading_variance_is_the_up_component_in_the_reference() {
        let q = so3::exp(&Vector3::new(core::f64::consts::FRAC_PI_2, 0.0, 0.0));
        let p = Matrix3::from_diagonal(&Vector3::new(1.0, 2.0, 3.0));
        assert_relative_eq!(
            covariance_in_reference(&q, &p)[(2, 2)],
            2.0,
            epsilon = 1e-14
        );
    }
}
