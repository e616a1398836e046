//! Conversions of rotations: arrays in w, x, y, z order, Euler angles, matrices, angle between two.
//!
//! nalgebra stores quaternions as x, y, z, w. [`to_wxyz`] and [`from_wxyz`] are the only places
//! where that order is turned; nothing else may touch `coords` at a border.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use crate::scalar::{Scalar, lit};

/// The quaternion as `[w, x, y, z]` with `w >= 0`.
#[inline]
pub fn to_wxyz<T: Scalar>(q: &UnitQuaternion<T>) -> [T; 4] {
    if q.w < T::zero() {
        [-q.w, -q.i, -q.j, -q.k]
    } else {
        [q.w, q.i, q.j, q.k]
    }
}

/// The unit quaternion of `[w, x, y, z]`, normalised.
///
/// `None` when an element is not finite or the norm is below 0.1 (all zeros: no rotation at all).
#[inline]
pub fn from_wxyz<T: Scalar>(wxyz: [T; 4]) -> Option<UnitQuaternion<T>> {
    let [w, x, y, z] = wxyz;
    let q = Quaternion::new(w, x, y, z);
    let norm = q.norm();
    if !norm.is_finite() || norm < lit(0.1) {
        return None;
    }
    Some(UnitQuaternion::new_unchecked(q / norm))
}

/// `serde(with)` for a quaternion at a border: w, x, y, z.
///
/// A state continues to the bit, so the numbers are those of the filter: the sign stays (a covariance of the four
/// components depends on it), and nothing is normalised. What is no unit quaternion is refused.
#[cfg(feature = "serde")]
pub mod wxyz {
    use nalgebra::{Quaternion, UnitQuaternion};
    use serde::{Deserialize, Deserializer, Serialize, Serializer, de::Error};

    use crate::scalar::{Scalar, lit};

    /// Writes w, x, y, z.
    ///
    /// # Errors
    /// Those of the format.
    pub fn serialize<T, S>(q: &UnitQuaternion<T>, serializer: S) -> Result<S::Ok, S::Error>
    where
        T: Scalar + Serialize,
        S: Serializer,
    {
        [q.w, q.i, q.j, q.k].serialize(serializer)
    }

    /// Reads w, x, y, z.
    ///
    /// # Errors
    /// Those of the format, and a norm that is more than a thousandth from one.
    pub fn deserialize<'de, T, D>(deserializer: D) -> Result<UnitQuaternion<T>, D::Error>
    where
        T: Scalar + Deserialize<'de>,
        D: Deserializer<'de>,
    {
        let [w, x, y, z] = <[T; 4]>::deserialize(deserializer)?;
        let q = Quaternion::new(w, x, y, z);
        if (q.norm() - T::one()).abs() <= lit(1e-3) {
            Ok(UnitQuaternion::new_unchecked(q))
        } else {
            Err(D::Error::custom("not a unit quaternion w, x, y, z"))
        }
    }
}

/// Angle in `[0, pi]` (rad) of the rotation between two attitudes.
#[inline]
pub fn angle_between<T: Scalar>(a: &UnitQuaternion<T>, b: &UnitQuaternion<T>) -> T {
    super::so3::log(&(a.inverse() * b)).norm()
}

/// Yaw, pitch and roll (rad) of `ref_from_body`, aerospace order: the body is reached from the
/// reference by turning about z (yaw), then y (pitch), then x (roll).
///
/// In a NED frame yaw is the heading, clockwise from north. In an ENU frame it counts
/// counter-clockwise from east. At pitch +-90 degrees roll is set to zero.
#[inline]
pub fn to_yaw_pitch_roll<T: Scalar>(ref_from_body: &UnitQuaternion<T>) -> [T; 3] {
    let m = ref_from_body.to_rotation_matrix().into_inner();
    let sin_pitch = -m[(2, 0)];
    let one = T::one();
    if sin_pitch.abs() > lit(0.999_999_9) {
        let pitch = if sin_pitch > T::zero() {
            T::frac_pi_2()
        } else {
            -T::frac_pi_2()
        };
        return [(-m[(0, 1)]).atan2(m[(1, 1)]), pitch, T::zero()];
    }
    let pitch = sin_pitch.max(-one).min(one).asin();
    [
        m[(1, 0)].atan2(m[(0, 0)]),
        pitch,
        m[(2, 1)].atan2(m[(2, 2)]),
    ]
}

/// Standard deviations of yaw, pitch and roll (rad), of an attitude error about the axes of the reference with this
/// covariance (rad^2); large near a pitch of +-90 degrees, where yaw and roll are not defined. To first order:
/// `docs/derivations/error_state.md`, (E13).
pub fn yaw_pitch_roll_std<T: Scalar>(
    ref_from_body: &UnitQuaternion<T>,
    covariance: &Matrix3<T>,
) -> [T; 3] {
    let [yaw, pitch, _] = to_yaw_pitch_roll(ref_from_body);
    let (sin, cos, zero) = (yaw.sin(), yaw.cos(), T::zero());
    let ahead = Vector3::new(cos, sin, zero) / pitch.cos().max(lit(1e-6));
    let by_error = [
        ahead * pitch.sin() + Vector3::z(),
        Vector3::new(-sin, cos, zero),
        ahead,
    ];
    by_error.map(|row| (covariance * row).dot(&row).max(zero).sqrt())
}

/// `ref_from_body` of yaw, pitch and roll (rad); inverse of [`to_yaw_pitch_roll`].
#[inline]
pub fn from_yaw_pitch_roll<T: Scalar>([yaw, pitch, roll]: [T; 3]) -> UnitQuaternion<T> {
    use super::so3::exp;
    let zero = T::zero();
    exp(&Vector3::new(zero, zero, yaw))
        * exp(&Vector3::new(zero, pitch, zero))
        * exp(&Vector3::new(roll, zero, zero))
}

/// The unit quaternion of a rotation matrix (Shepperd 1978: divides by the largest component).
#[inline]
pub fn from_matrix<T: Scalar>(m: &Matrix3<T>) -> UnitQuaternion<T> {
    let one = T::one();
    let half = lit::<T>(0.5);
    let trace = m.trace();
    let diagonal = [m[(0, 0)], m[(1, 1)], m[(2, 2)]];
    let mut largest = 0;
    for axis in 1..3 {
        if diagonal[axis] > diagonal[largest] {
            largest = axis;
        }
    }
    let mut v = [T::zero(); 3];
    let w;
    if trace >= diagonal[largest] {
        let root = (one + trace).sqrt();
        let f = half / root;
        w = half * root;
        for (i, element) in v.iter_mut().enumerate() {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            *element = (m[(k, j)] - m[(j, k)]) * f;
        }
    } else {
        let (i, j, k) = (largest, (largest + 1) % 3, (largest + 2) % 3);
        let root = (one + m[(i, i)] - m[(j, j)] - m[(k, k)]).sqrt();
        let f = half / root;
        v[i] = half * root;
        v[j] = (m[(j, i)] + m[(i, j)]) * f;
        v[k] = (m[(k, i)] + m[(i, k)]) * f;
        w = (m[(k, j)] - m[(j, k)]) * f;
    }
    UnitQuaternion::new_normalize(Quaternion::new(w, v[0], v[1], v[2]))
}

/// The rotation matrix of a quaternion whose norm is one.
#[inline]
pub fn to_matrix<T: Scalar>(q: &UnitQuaternion<T>) -> Matrix3<T> {
    let (w, x, y, z) = (q.w, q.i, q.j, q.k);
    let one = T::one();
    let (x2, y2, z2) = (x + x, y + y, z + z);
    let (xx, yy, zz) = (x * x2, y * y2, z * z2);
    let (xy, xz, yz) = (x * y2, x * z2, y * z2);
    let (wx, wy, wz) = (w * x2, w * y2, w * z2);
    Matrix3::new(
        one - (yy + zz),
        xy - wz,
        xz + wy,
        xy + wz,
        one - (xx + zz),
        yz - wx,
        xz - wy,
        yz + wx,
        one - (xx + yy),
    )
}

/// Where the body's first axis points: `ref_from_body` of a norm of one times (1, 0, 0).
#[inline]
pub fn forward<T: Scalar>(q: &UnitQuaternion<T>) -> Vector3<T> {
    let (w, x, y, z) = (q.w, q.i, q.j, q.k);
    let (y2, z2) = (y + y, z + z);
    Vector3::new(
        T::one() - (y * y2 + z * z2),
        x * y2 + w * z2,
        x * z2 - w * y2,
    )
}

/// Whether a quaternion has a norm of one, within the square root of the rounding unit.
#[inline]
pub fn is_unit<T: Scalar>(q: &UnitQuaternion<T>) -> bool {
    (q.as_ref().norm_squared() - T::one()).abs() <= T::default_epsilon().sqrt()
}

/// Removes the rounding that products of quaternions gather: one Newton step towards unit norm,
/// exact to rounding for a quaternion whose norm is within 1e-4 of one.
#[inline]
pub fn renormalize<T: Scalar>(q: &UnitQuaternion<T>) -> UnitQuaternion<T> {
    let n2 = q.as_ref().norm_squared();
    UnitQuaternion::new_unchecked(q.into_inner() * (lit::<T>(0.5) * (lit::<T>(3.0) - n2)))
}

/// `q` turned by the rotation vector `r` (rad, body axes), and what rounding `q` had gathered removed. As
/// [`renormalize`] of `q * exp(r)`, but the norm is taken of `q`, so that nothing waits for it.
#[inline]
pub fn turned<T: Scalar>(q: &UnitQuaternion<T>, r: &Vector3<T>) -> UnitQuaternion<T> {
    let scale = lit::<T>(0.5) * (lit::<T>(3.0) - q.as_ref().norm_squared());
    UnitQuaternion::new_unchecked((q.into_inner() * scale) * super::so3::exp(r).into_inner())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::so3;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    #[test]
    fn order_at_the_border_is_w_first_and_w_is_not_negative() {
        let q = UnitQuaternion::new_normalize(Quaternion::new(-0.5, 0.1, 0.2, 0.3));
        let [w, x, y, z] = to_wxyz(&q);
        assert!(w > 0.0 && x < 0.0 && y < 0.0 && z < 0.0);
        assert_relative_eq!(w / x, -5.0, epsilon = 1e-12);
        assert_relative_eq!(
            from_wxyz([w, x, y, z]).unwrap().angle_to(&q),
            0.0,
            epsilon = 1e-7
        );
    }

    #[test]
    fn rubbish_is_no_rotation() {
        assert!(from_wxyz([0.0; 4]).is_none());
        assert!(from_wxyz([f64::NAN, 0.0, 0.0, 1.0]).is_none());
        assert!(from_wxyz([f64::INFINITY, 0.0, 0.0, 1.0]).is_none());
    }

    #[test]
    fn heading_east_in_ned_is_yaw_of_a_quarter_turn() {
        let q = from_yaw_pitch_roll([core::f64::consts::FRAC_PI_2, 0.0, 0.0]);
        assert_relative_eq!(q * Vector3::x(), Vector3::y(), epsilon = 1e-15);
    }

    #[test]
    fn gimbal_lock_keeps_the_rotation() {
        for pitch in [core::f64::consts::FRAC_PI_2, -core::f64::consts::FRAC_PI_2] {
            let q = from_yaw_pitch_roll([0.4, pitch, 0.0]);
            let back = from_yaw_pitch_roll(to_yaw_pitch_roll(&q));
            assert!(angle_between(&q, &back) < 1e-7);
        }
    }

    #[test]
    fn renormalize_removes_small_drift() {
        let q = so3::exp(&Vector3::new(0.3, 0.2, -0.4));
        let drifted = UnitQuaternion::new_unchecked(q.into_inner() * 1.00005_f64);
        assert_relative_eq!(renormalize(&drifted).norm(), 1.0, epsilon = 1e-8);
        assert_relative_eq!(
            renormalize(&renormalize(&drifted)).norm(),
            1.0,
            epsilon = 1e-15
        );
    }

    proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(24), ..ProptestConfig::default() })]
            #[test]
            fn conversions_round_trip(r in prop::array::uniform3(-3.1..3.1f64)) {
                let q = so3::exp(&Vector3::from(r));
                prop_assert!(angle_between(&q, &from_yaw_pitch_roll(to_yaw_pitch_roll(&q))) < 1e-6);
                prop_assert!(angle_between(&q, &from_matrix(&q.to_rotation_matrix().into_inner())) < 1e-7);
                prop_assert!(angle_between(&q, &from_wxyz(to_wxyz(&q)).unwrap()) < 1e-7);
            }
        }
}
