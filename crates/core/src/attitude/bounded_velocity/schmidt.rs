//! Schmidt-Kalman update of the gyroscope bias: considered about one axis, and not corrected there (B12b).

use nalgebra::{Matrix3, Vector3};

use super::layout::{BIAS, Correction, Covariance};
use crate::scalar::Scalar;

/// Makes of an update one that considers the bias about an axis (unit vector, body axes). `before` is the covariance of the
/// bias before the update, rad^2/s^2; `p` and `x` are covariance and correction after it. What that component shares with
/// the others stays as the update made it, its own variance as it was.
#[inline]
pub(super) fn consider_bias_about<T: Scalar>(
    axis: &Vector3<T>,
    before: &Matrix3<T>,
    p: &mut Covariance<T>,
    x: &mut Correction<T>,
) {
    let correction = axis.dot(&x.fixed_rows::<3>(BIAS));
    let removed = before - p.fixed_view::<3, 3>(BIAS, BIAS);
    let variance = axis.dot(&(removed * axis)).max(T::zero());
    for i in 0..3 {
        x[BIAS + i] -= axis[i] * correction;
        for j in 0..3 {
            p[(BIAS + i, BIAS + j)] += axis[i] * axis[j] * variance;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::layout::VELOCITY;
    use super::*;
    use crate::kalman::sparse_update::{Projection, SparseRow};
    use nalgebra::{SMatrix, SVector, Vector2};

    const ACTIVE: usize = 8;
    type Small = SMatrix<f64, ACTIVE, ACTIVE>;

    /// The update of Schmidt and Kalman in full: gain without the considered component, covariance by Joseph's form.
    fn in_full(
        p: &Small,
        axis: &Vector3<f64>,
        residual: &Vector2<f64>,
        r: f64,
    ) -> (Small, SVector<f64, ACTIVE>) {
        let mut h = SMatrix::<f64, 2, ACTIVE>::zeros();
        h[(0, VELOCITY)] = 1.0;
        h[(1, VELOCITY + 1)] = 1.0;
        let s = h * p * h.transpose() + SMatrix::<f64, 2, 2>::identity() * r;
        let mut gain = p * h.transpose() * s.try_inverse().unwrap();
        let of_bias = gain.fixed_rows::<3>(BIAS).into_owned();
        gain.fixed_rows_mut::<3>(BIAS)
            .copy_from(&(of_bias - axis * (axis.transpose() * of_bias)));
        let left = Small::identity() - gain * h;
        let after = left * p * left.transpose() + gain * gain.transpose() * r;
        (after, gain * residual)
    }

    #[test]
    fn equals_the_update_with_the_gain_of_schmidt_and_kalman() {
        let a = Small::from_fn(|i, j| ((3 * i + 5 * j) as f64).sin());
        let small = a * a.transpose() + Small::identity() * 0.1;
        let axis = Vector3::new(0.36, -0.48, 0.8);
        let (residual, r) = (Vector2::new(0.7, -1.1), 0.3);
        let mut p = Covariance::zeros();
        p.fixed_view_mut::<ACTIVE, ACTIVE>(0, 0).copy_from(&small);
        let before = p.fixed_view::<3, 3>(BIAS, BIAS).into_owned();
        let mut x = Correction::zeros();
        let rows = [VELOCITY, VELOCITY + 1].map(SparseRow::of_state);
        let projection: Projection<f64, _, 2> = Projection::new(&p, ACTIVE, rows);
        assert!(projection.fuse(&mut p, &mut x, &residual, r));
        consider_bias_about(&axis, &before, &mut p, &mut x);
        let (expected, correction) = in_full(&small, &axis, &residual, r);
        let off = p.fixed_view::<ACTIVE, ACTIVE>(0, 0) - expected;
        assert!(off.amax() < 1e-9, "{off}");
        for (x, expected) in x.iter().zip(&correction) {
            assert!((x - expected).abs() < 1e-9);
        }
    }
}
