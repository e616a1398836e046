//! Kalman measurement updates one scalar at a time, in place.
//!
//! For measurements with independent components the sequence of scalar updates equals the joint
//! update exactly, without a matrix inverse and without temporaries: on a Cortex-M3 it needs a
//! tenth of the instructions of the dense form. The dense Joseph form lives in the tests, as the
//! oracle. Corrections are collected in `correction` relative to the state at which the rows `h`
//! were computed, and are injected once at the end.

use nalgebra::{SMatrix, SVector, Vector3};

use super::covariance::{mirror_upper, resolvable_variance, rounding_reserve};
use super::feedback::ScalarCorrection;
use super::sparse_update::SparseRow;
use crate::scalar::Scalar;

/// One scalar measurement of the first three states: `residual = h . x[0..3] + noise`.
///
/// `residual` is relative to the state before any of the pending `correction`. Returns `false`
/// and changes nothing when the innovation variance is not positive.
#[inline]
pub fn update_leading3<T: Scalar, const N: usize>(
    covariance: &mut SMatrix<T, N, N>,
    correction: &mut SVector<T, N>,
    h: &Vector3<T>,
    residual: T,
    variance: T,
) -> bool {
    const { assert!(N >= 3) };
    let mut ph = SVector::<T, N>::zeros();
    for i in 0..N {
        ph[i] = covariance[(i, 0)] * h.x + covariance[(i, 1)] * h.y + covariance[(i, 2)] * h.z;
    }
    let p = |i: usize| covariance[(i, i)];
    let spread = h.x * h.x * p(0) + h.y * h.y * p(1) + h.z * h.z * p(2);
    let Some(variance) = resolvable_variance(variance, spread) else {
        return false;
    };
    let s = ph[0] * h.x + ph[1] * h.y + ph[2] * h.z + variance;
    let expected = correction[0] * h.x + correction[1] * h.y + correction[2] * h.z;
    apply(covariance, correction, &ph, s, residual - expected)
}

/// One scalar measurement with a full row: `residual = h . x + noise`.
///
/// As [`update_leading3`], for rows without known zeros.
///
/// ```
/// use northing_core::kalman::scalar_update::update_full;
/// use northing_core::nalgebra::{Matrix2, Vector2};
///
/// // Position and velocity with variances 4 and 1; the sum of both is measured as 3, variance 1.
/// let mut covariance = Matrix2::new(4.0_f64, 0.0, 0.0, 1.0);
/// let mut correction = Vector2::zeros();
/// let h = Vector2::new(1.0, 1.0);
/// assert!(update_full(&mut covariance, &mut correction, &h, 3.0, 1.0));
/// assert_eq!(correction, Vector2::new(2.0, 0.5)); // gain 4/6 and 1/6
/// assert!((covariance[(0, 0)] - 4.0 / 3.0).abs() < 1e-12);
/// ```
#[inline]
pub fn update_full<T: Scalar, const N: usize>(
    covariance: &mut SMatrix<T, N, N>,
    correction: &mut SVector<T, N>,
    h: &SVector<T, N>,
    residual: T,
    variance: T,
) -> bool {
    let ph = *covariance * h;
    let spread = (0..N).fold(T::zero(), |sum, i| sum + h[i] * h[i] * covariance[(i, i)]);
    let Some(variance) = resolvable_variance(variance, spread) else {
        return false;
    };
    let s = ph.dot(h) + variance;
    let expected = correction.dot(h);
    apply(covariance, correction, &ph, s, residual - expected)
}

/// One scalar measurement of a single state: `residual = x[state] + noise`. The cheapest update
/// there is: its `P H^T` is a column of `P`.
///
/// As [`update_leading3`]; gives back what was done, for whoever carries a cross-covariance with
/// these states, or `None` when nothing was: the innovation variance is not positive, or there is
/// no such state.
#[inline]
pub fn update_one_state<T: Scalar, const N: usize>(
    covariance: &mut SMatrix<T, N, N>,
    correction: &mut SVector<T, N>,
    state: usize,
    residual: T,
    variance: T,
) -> Option<ScalarCorrection<T, N>> {
    if state >= N {
        return None;
    }
    let ph: SVector<T, N> = covariance.column(state).into_owned();
    let s = ph[state] + resolvable_variance(variance, ph[state])?;
    let nu = residual - correction[state];
    apply(covariance, correction, &ph, s, nu).then(|| ScalarCorrection {
        row: SparseRow::of_state(state),
        gain: ph * (T::one() / s),
        residual: nu,
        variance: s,
    })
}

/// Three scalar measurements of the first three states whose rows are those of `[v]x`:
/// `residual = v x x[0..3] + noise`, equal variances. What a vector measurement of a local
/// attitude error is; uses the zeros of `[v]x` and the symmetry of the covariance.
///
/// Returns `false` when an innovation variance is not positive; the components before it are
/// then in, each of them a valid measurement by itself.
#[inline]
pub fn update_cross_product<T: Scalar, const N: usize>(
    covariance: &mut SMatrix<T, N, N>,
    correction: &mut SVector<T, N>,
    v: &Vector3<T>,
    residual: &Vector3<T>,
    variance: T,
) -> bool {
    const { assert!(N >= 3) };
    let done = update_pair(
        covariance,
        correction,
        [1, 2],
        [-v.z, v.y],
        residual.x,
        variance,
    ) && update_pair(
        covariance,
        correction,
        [0, 2],
        [v.z, -v.x],
        residual.y,
        variance,
    ) && update_pair(
        covariance,
        correction,
        [0, 1],
        [-v.y, v.x],
        residual.z,
        variance,
    );
    mirror_upper(covariance);
    done
}

/// One scalar measurement with two non-zero elements `h` at the states `at`; reads and writes the
/// upper triangle of the covariance only.
#[inline(always)]
fn update_pair<T: Scalar, const N: usize>(
    covariance: &mut SMatrix<T, N, N>,
    correction: &mut SVector<T, N>,
    at: [usize; 2],
    h: [T; 2],
    residual: T,
    variance: T,
) -> bool {
    let [a, b] = at;
    let mut ph = SVector::<T, N>::zeros();
    for i in 0..N {
        ph[i] = covariance[(i.min(a), i.max(a))] * h[0] + covariance[(i.min(b), i.max(b))] * h[1];
    }
    let spread = h[0] * h[0] * covariance[(a, a)] + h[1] * h[1] * covariance[(b, b)];
    let Some(variance) = resolvable_variance(variance, spread) else {
        return false;
    };
    let s = ph[a] * h[0] + ph[b] * h[1] + variance;
    let nu = residual - (correction[a] * h[0] + correction[b] * h[1]);
    if !(s > T::zero() && s.is_finite() && nu.is_finite()) {
        return false;
    }
    let inverse = T::one() / s;
    for j in 0..N {
        let k = ph[j] * inverse;
        correction[j] += k * nu;
        for i in 0..=j {
            covariance[(i, j)] -= ph[i] * k;
        }
        covariance[(j, j)] += rounding_reserve(ph[j] * k);
    }
    true
}

/// `x += K nu`, `P -= Ph Ph^T / s`, with the upper triangle computed and mirrored, so that the
/// covariance stays symmetric to the bit.
#[inline]
fn apply<T: Scalar, const N: usize>(
    covariance: &mut SMatrix<T, N, N>,
    correction: &mut SVector<T, N>,
    ph: &SVector<T, N>,
    s: T,
    nu: T,
) -> bool {
    if !(s > T::zero() && s.is_finite() && nu.is_finite()) {
        return false;
    }
    let inverse = T::one() / s;
    let gain_nu = nu * inverse;
    for j in 0..N {
        correction[j] += ph[j] * gain_nu;
        let k = ph[j] * inverse;
        for i in 0..=j {
            let value = covariance[(i, j)] - ph[i] * k;
            covariance[(i, j)] = value;
            covariance[(j, i)] = value;
        }
        covariance[(j, j)] += rounding_reserve(ph[j] * k);
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::{Matrix3, SMatrix};
    use proptest::prelude::*;

    type M6 = SMatrix<f64, 6, 6>;

    /// Oracle: the joint update in Joseph form.
    fn joseph(
        p: &M6,
        h: &SMatrix<f64, 3, 6>,
        r: &Matrix3<f64>,
        z: &Vector3<f64>,
    ) -> (M6, SVector<f64, 6>) {
        let s = h * p * h.transpose() + r;
        let k = p * h.transpose() * s.try_inverse().unwrap();
        let a = M6::identity() - k * h;
        (a * p * a.transpose() + k * r * k.transpose(), k * z)
    }

    proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(22), ..ProptestConfig::default() })]
            #[test]
            fn three_scalars_equal_the_joint_joseph_update(
                a in prop::collection::vec(-1.0..1.0f64, 36), rows in prop::collection::vec(-5.0..5.0f64, 9),
                r in prop::array::uniform3(0.01..2.0f64), z in prop::array::uniform3(-3.0..3.0f64),
            ) {
                let a = M6::from_column_slice(&a);
                let p = a * a.transpose() + M6::identity() * 0.01;
                let h3 = Matrix3::from_row_slice(&rows);
                let mut h = SMatrix::<f64, 3, 6>::zeros();
                h.fixed_columns_mut::<3>(0).copy_from(&h3);
                let z = Vector3::from(z);
                let (expected_p, expected_x) = joseph(&p, &h, &Matrix3::from_diagonal(&Vector3::from(r)), &z);

                let (mut p3, mut x3) = (p, SVector::<f64, 6>::zeros());
                let (mut pf, mut xf) = (p, SVector::<f64, 6>::zeros());
                for i in 0..3 {
                    prop_assert!(update_leading3(&mut p3, &mut x3, &h3.row(i).transpose(), z[i], r[i]));
                    prop_assert!(update_full(&mut pf, &mut xf, &h.row(i).transpose(), z[i], r[i]));
                }
                prop_assert!((p3 - expected_p).abs().max() < 1e-9);
                prop_assert!((x3 - expected_x).abs().max() < 1e-9);
                prop_assert!((pf - p3).abs().max() < 1e-10 && (xf - x3).abs().max() < 1e-10);

                // A single state is a row with a single one.
                let (mut p1, mut x1) = (p, SVector::<f64, 6>::zeros());
                let (mut pf, mut xf) = (p, SVector::<f64, 6>::zeros());
                for i in [4, 0, 2] {
                    let row = SVector::<f64, 6>::from_fn(|k, _| if k == i { 1.0 } else { 0.0 });
                    let before = p1;
                    let done = update_one_state(&mut p1, &mut x1, i, z[0], r[i % 3]).unwrap();
                    prop_assert!(update_full(&mut pf, &mut xf, &row, z[0], r[i % 3]));
                    // What is told about the step is what was done: P+ = (I - K H) P-.
                    let mut told = before;
                    done.map_rows(&mut told);
                    prop_assert!((told - p1).abs().max() < 1e-12);
                }
                prop_assert!((pf - p1).abs().max() < 1e-12 && (xf - x1).abs().max() < 1e-12);
                prop_assert!(update_one_state(&mut p1, &mut x1, 6, 0.0, 1.0).is_none());
                prop_assert_eq!(p3, p3.transpose());
            }

            #[test]
            fn cross_product_update_equals_its_three_rows(
                a in prop::collection::vec(-1.0..1.0f64, 36), v in prop::array::uniform3(-10.0..10.0f64),
                r in 0.01..2.0f64, z in prop::array::uniform3(-3.0..3.0f64),
            ) {
                let a = M6::from_column_slice(&a);
                let p = a * a.transpose() + M6::identity() * 0.01;
                let (v, z) = (Vector3::from(v), Vector3::from(z));
                let (mut pr, mut xr) = (p, SVector::<f64, 6>::zeros());
                let (mut pc, mut xc) = (p, SVector::<f64, 6>::zeros());
                let h = crate::geometry::so3::skew(&v);
                for i in 0..3 {
                    prop_assert!(update_leading3(&mut pr, &mut xr, &h.row(i).transpose(), z[i], r));
                }
                prop_assert!(update_cross_product(&mut pc, &mut xc, &v, &z, r));
                prop_assert!((pr - pc).abs().max() < 1e-10 && (xr - xc).abs().max() < 1e-10);
                prop_assert_eq!(pc, pc.transpose());
            }
        }

    #[test]
    fn bad_innovation_variance_changes_nothing() {
        let (mut p, mut x) = (M6::identity(), SVector::<f64, 6>::zeros());
        for (residual, variance) in [
            (1.0, -5.0),
            (1.0, f64::NAN),
            (f64::NAN, 1.0),
            (f64::INFINITY, 1.0),
        ] {
            assert!(!update_leading3(
                &mut p,
                &mut x,
                &Vector3::x(),
                residual,
                variance
            ));
        }
        assert_relative_eq!(p, M6::identity());
        assert_relative_eq!(x, SVector::zeros());
    }
}
