//! Generalised Rodrigues parameters with `a = 1`, `f = 4` (M23, M23b), and their re-centring.
//!
//! `p` is four times the tangent of a quarter of the angle, along the axis: the rotation vector
//! for small errors, singular only at a full turn.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

use crate::geometry::so3;
use crate::scalar::{Scalar, lit};

/// The rotation of Rodrigues parameters with `a = 1`, `f = 4` (M23b).
pub(super) fn from_rodrigues<T: Scalar>(p: &Vector3<T>) -> UnitQuaternion<T> {
    let (n2, sixteen) = (p.norm_squared(), lit::<T>(16.0));
    let scale = T::one() / (sixteen + n2);
    let q = Quaternion::from_parts((sixteen - n2) * scale, p * (lit::<T>(8.0) * scale));
    UnitQuaternion::new_unchecked(q)
}

/// Its inverse (M23), for the sign of the quaternion as it is: errors beyond half a turn stay
/// where they are instead of jumping to the other side.
pub(super) fn to_rodrigues<T: Scalar>(q: &UnitQuaternion<T>) -> Vector3<T> {
    q.imag() * (lit::<T>(4.0) / (T::one() + q.w))
}

/// Jacobian of re-centring the error at the correction `p` just applied: with `s = p/4`,
/// `G = ((1 - s^2) I - 2 [s]x + 2 s s^T) / (1 + s^2)^2`.
pub(super) fn reset_jacobian<T: Scalar>(p: &Vector3<T>) -> Matrix3<T> {
    let (s, one, two) = (p * lit::<T>(0.25), T::one(), lit::<T>(2.0));
    let n2 = s.norm_squared();
    let sum =
        Matrix3::from_diagonal_element(one - n2) - so3::skew(&s) * two + s * s.transpose() * two;
    sum / ((one + n2) * (one + n2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::attitude::test_world::constant;
    use approx::assert_relative_eq;
    use nalgebra::SVector;
    use num_dual::{DualSVec64, jacobian};

    /// (M23b) in its general form, at `a = 1`, `f = 4`.
    #[test]
    fn parameters_are_those_of_the_paper_and_invert_up_to_a_full_turn() {
        for angle in [0.0, 1e-9, 0.3, 1.5, 3.0, 3.3, 4.5, 6.0_f64] {
            let (half, axis) = (angle / 2.0, Vector3::new(0.36, -0.48, 0.8));
            let q = Quaternion::from_parts(half.cos(), axis * half.sin());
            let q = UnitQuaternion::new_unchecked(q);
            let (a, f) = (1.0, 4.0);
            let p = to_rodrigues(&q);
            assert_relative_eq!(p, q.imag() * (f / (a + q.w)), epsilon = 1e-12);
            assert_relative_eq!(p.norm(), 4.0 * (angle / 4.0).tan(), epsilon = 1e-12);
            let n2 = p.norm_squared();
            let w = (-a * n2 + f * (f * f + (1.0 - a * a) * n2).sqrt()) / (f * f + n2);
            let back = from_rodrigues(&p);
            assert_relative_eq!(back.w, w, epsilon = 1e-13);
            assert_relative_eq!(back.coords, q.coords, epsilon = 1e-12);
        }
    }

    #[test]
    fn small_parameters_are_the_rotation_vector() {
        let (value, j) = jacobian(
            |p: SVector<DualSVec64<3>, 3>| so3::log(&from_rodrigues(&p)),
            &Vector3::zeros(),
        );
        assert_relative_eq!(value, Vector3::zeros());
        assert_relative_eq!(j, Matrix3::identity(), epsilon = 1e-14);
        let (_, j) = jacobian(
            |p: SVector<DualSVec64<3>, 3>| to_rodrigues(&so3::exp(&p)),
            &Vector3::zeros(),
        );
        assert_relative_eq!(j, Matrix3::identity(), epsilon = 1e-14);
    }

    /// `dq(p + d) = dq(p) * dq(G d)` to first order, for corrections up to two radians.
    #[test]
    fn reset_jacobian_equals_dual_numbers() {
        for p in [
            Vector3::zeros(),
            Vector3::new(0.3, -0.2, 0.1),
            Vector3::new(1.5, -1.0, 0.9),
        ] {
            let (_, j) = jacobian(
                |d: SVector<DualSVec64<3>, 3>| {
                    let p = p.map(constant::<3>);
                    to_rodrigues(&(from_rodrigues(&p).inverse() * from_rodrigues(&(p + d))))
                },
                &Vector3::zeros(),
            );
            assert_relative_eq!(reset_jacobian(&p), j, epsilon = 1e-13);
        }
    }
}
