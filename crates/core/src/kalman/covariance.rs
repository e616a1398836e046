//! Covariance hygiene: symmetry, positivity, limits, and quadratic forms (NIS, NEES).

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use crate::scalar::{Scalar, lit};

/// The part of `R` rows and `C` columns that begins at this row and column, as a matrix of its own; the matrix must hold it. Compilers inline this
/// more readily than `fixed_view(..).into_owned()`, which costs a call and a copy element by element.
pub fn part<T: Scalar, const R: usize, const C: usize, const N: usize, const M: usize>(
    matrix: &SMatrix<T, N, M>,
    row: usize,
    column: usize,
) -> SMatrix<T, R, C> {
    SMatrix::from_fn(|i, j| matrix[(row + i, column + j)])
}

/// Copies the upper triangle over the lower one.
#[inline]
pub fn mirror_upper<T: Scalar, const N: usize>(p: &mut SMatrix<T, N, N>) {
    for j in 0..N {
        for i in 0..j {
            p[(j, i)] = p[(i, j)];
        }
    }
}

/// Replaces `p` by `(p + p^T) / 2`.
#[inline]
pub fn symmetrize<T: Scalar, const N: usize>(p: &mut SMatrix<T, N, N>) {
    let half = lit::<T>(0.5);
    for j in 0..N {
        for i in 0..j {
            let mean = half * (p[(i, j)] + p[(j, i)]);
            p[(i, j)] = mean;
            p[(j, i)] = mean;
        }
    }
}

/// `A^T P A` of a symmetric matrix of three states, and symmetric to the bit: of its nine elements six are computed.
#[inline]
#[must_use]
pub fn turned3<T: Scalar>(p: &Matrix3<T>, a: &Matrix3<T>) -> Matrix3<T> {
    let product = |i, j| p[(i, 0)] * a[(0, j)] + p[(i, 1)] * a[(1, j)] + p[(i, 2)] * a[(2, j)];
    let mut turned = Matrix3::zeros();
    for j in 0..3 {
        let [x, y, z] = [product(0, j), product(1, j), product(2, j)];
        for i in 0..=j {
            let value = a[(0, i)] * x + a[(1, i)] * y + a[(2, i)] * z;
            turned[(i, j)] = value;
            turned[(j, i)] = value;
        }
    }
    turned
}

/// Lower Cholesky factor, or `None` when the matrix is not positive definite or not finite.
#[inline]
pub fn cholesky<T: Scalar, const N: usize>(p: &SMatrix<T, N, N>) -> Option<SMatrix<T, N, N>> {
    let mut l = SMatrix::<T, N, N>::zeros();
    for j in 0..N {
        let mut d = p[(j, j)];
        for k in 0..j {
            d -= l[(j, k)] * l[(j, k)];
        }
        if !(d > T::zero() && d.is_finite()) {
            return None;
        }
        let root = d.sqrt();
        l[(j, j)] = root;
        for i in (j + 1)..N {
            let mut s = p[(i, j)];
            for k in 0..j {
                s -= l[(i, k)] * l[(j, k)];
            }
            l[(i, j)] = s / root;
        }
    }
    Some(l)
}

/// Whether a matrix is finite, symmetric and positive semidefinite, each up to `tolerance` as a correlation: with so
/// much added to the unit diagonal of the correlation matrix it has a Cholesky factor. Variances of zero pass,
/// and correlations are those of standard deviations of at least 1e-18: the squares of smaller ones have lost digits.
pub fn is_covariance<T: Scalar, const N: usize>(p: &SMatrix<T, N, N>, tolerance: T) -> bool {
    let variances = p.diagonal();
    if !variances.iter().all(|v| v.is_finite() && *v >= T::zero()) {
        return false;
    }
    let least = lit(LEAST_STD);
    let std = variances.map(|v| v.sqrt().max(least));
    let inverse = std.map(|s| T::one() / s);
    let mut correlation = SMatrix::<T, N, N>::from_diagonal_element(T::one() + tolerance);
    for i in 0..N {
        for j in 0..i {
            let lower = p[(i, j)];
            // Not below: what is not a number must not pass.
            let asymmetry = (lower - p[(j, i)]).abs();
            // Not finite is not symmetric either.
            if !asymmetry.is_finite() || asymmetry > tolerance * (std[i] * std[j]) {
                return false;
            }
            correlation[(i, j)] = lower * inverse[i] * inverse[j];
        }
    }
    has_positive_pivots(correlation)
}

/// Whether a symmetric matrix, of which the lower triangle is given, is positive definite and finite: `L D L^T` without roots,
/// one division a column.
fn has_positive_pivots<T: Scalar, const N: usize>(mut p: SMatrix<T, N, N>) -> bool {
    for j in 0..N {
        let pivot = p[(j, j)];
        if !(pivot > T::zero() && pivot.is_finite()) {
            return false;
        }
        let inverse = T::one() / pivot;
        for k in (j + 1)..N {
            let weight = p[(k, j)] * inverse;
            for i in k..N {
                let product = p[(i, j)] * weight;
                p[(i, k)] -= product;
            }
        }
    }
    true
}

/// `x^T P^-1 x` for a positive definite `P` (NIS, NEES); `None` when `P` is not.
#[inline]
pub fn normalized_square<T: Scalar, const N: usize>(
    x: &SVector<T, N>,
    p: &SMatrix<T, N, N>,
) -> Option<T> {
    let l = cholesky(p)?;
    let mut sum = T::zero();
    let mut y = SVector::<T, N>::zeros();
    for i in 0..N {
        let mut v = x[i];
        for k in 0..i {
            v -= l[(i, k)] * y[k];
        }
        y[i] = v / l[(i, i)];
        sum += y[i] * y[i];
    }
    sum.is_finite().then_some(sum)
}

/// `x^T S^-1 x` for a symmetric 3 by 3 matrix by cofactors: no square roots, for the sample path.
///
/// `None` when the determinant is not positive, which a positive definite `S` never shows.
#[inline]
pub fn normalized_square3<T: Scalar>(x: &Vector3<T>, s: &Matrix3<T>) -> Option<T> {
    let (a, b, c) = (s[(0, 0)], s[(0, 1)], s[(0, 2)]);
    let (d, e, f) = (s[(1, 1)], s[(1, 2)], s[(2, 2)]);
    let (c00, c01, c02) = (d * f - e * e, c * e - b * f, b * e - c * d);
    let (c11, c12, c22) = (a * f - c * c, b * c - a * e, a * d - b * b);
    let determinant = a * c00 + b * c01 + c * c02;
    if !(determinant > T::zero() && determinant.is_finite()) {
        return None;
    }
    let two = lit::<T>(2.0);
    let sum = x.x * x.x * c00
        + x.y * x.y * c11
        + x.z * x.z * c22
        + two * (x.x * x.y * c01 + x.x * x.z * c02 + x.y * x.z * c12);
    let nis = sum / determinant;
    nis.is_finite().then_some(nis.max(T::zero()))
}

/// Standard deviations below have squares of few digits in single precision.
const LEAST_STD: f64 = 1e-18;
/// Determinants of a correlation matrix from here on are far from singular, and products of variances between this and its
/// inverse lose no digits.
const LEAST_DETERMINANT: f64 = 1e-2;
const LEAST_PRODUCT: f64 = 1e-24;
/// Rounding units of the state's own share that the noise of a measurement is at least taken for.
const LEAST_NOISE_ROUNDINGS: f64 = 64.0;
/// Rounding units of what an update takes off a variance that it leaves there.
const KEPT_ROUNDINGS: f64 = 64.0;

/// What is left of the correlations of a matrix that is nearly a covariance.
const KEPT_CORRELATION: f64 = 0.996;

/// The noise variance of a measurement, and at least what the precision resolves beside `predicted`, the sum of squares of
/// the row's elements times the variances they see: below it `P - K S K^T` is a difference of roundings. That is a
/// standard deviation 360 times smaller than the prediction's in single precision, and eight million times in double.
///
/// `None` when the variance is negative or not a number.
#[inline(always)]
pub fn resolvable_variance<T: Scalar>(variance: T, predicted: T) -> Option<T> {
    let least = predicted * (T::default_epsilon() * lit(LEAST_NOISE_ROUNDINGS));
    if variance >= least && variance >= T::zero() {
        Some(variance)
    } else {
        (variance >= T::zero() && least >= T::zero()).then_some(least)
    }
}

/// What comes back to a variance of which an update takes `removed`: more than its rounding, so that the covariance stays
/// positive semidefinite.
#[inline(always)]
pub fn rounding_reserve<T: Scalar>(removed: T) -> T {
    removed * (T::default_epsilon() * lit(KEPT_ROUNDINGS))
}

/// Whether a matrix is a covariance as well as the precision allows: within half the square root of the rounding unit.
#[inline]
pub fn is_resolved<T: Scalar, const N: usize>(p: &SMatrix<T, N, N>) -> bool {
    is_covariance(p, T::default_epsilon().sqrt() * lit(0.5))
}

/// Makes a symmetric matrix of one unit positive semidefinite again after it was turned into other axes: where its largest
/// variance has drowned its smallest in rounding, the diagonal grows by that rounding. A matrix that is a covariance stays
/// as it is, to the bit.
pub fn undrown<T: Scalar, const N: usize>(p: &mut SMatrix<T, N, N>) {
    if is_well_conditioned3(p) {
        return;
    }
    let mut added = p.diagonal().amax() * T::default_epsilon() * lit(4.0 * N as f64);
    // At most until it is the largest variance itself.
    for _ in 0..64 {
        if is_resolved(p) || !added.is_finite() {
            return;
        }
        for i in 0..N {
            p[(i, i)] += added;
        }
        added *= lit(2.0);
    }
}

/// Whether a matrix is a symmetric one of three states whose correlations are far from dependent: [`is_resolved`] then holds,
/// and neither a root nor a division is needed to know it. Most covariances of an attitude are so.
#[inline]
fn is_well_conditioned3<T: Scalar, const N: usize>(p: &SMatrix<T, N, N>) -> bool {
    if N != 3 {
        return false;
    }
    let (a, b, c) = (p[(0, 0)], p[(0, 1)], p[(0, 2)]);
    let (d, e, f) = (p[(1, 1)], p[(1, 2)], p[(2, 2)]);
    let is_symmetric = b == p[(1, 0)] && c == p[(2, 0)] && e == p[(2, 1)];
    let (pair, all) = (a * d, a * d * f);
    let minor = pair - b * b;
    let determinant = f * minor - (a * e * e - lit::<T>(2.0) * b * c * e + d * c * c);
    let share: T = lit(LEAST_DETERMINANT);
    // What is not a number is none of these.
    is_symmetric
        && a > T::zero()
        && d > T::zero()
        && minor > pair * share
        && determinant > all * share
        && all > lit(LEAST_PRODUCT)
        && all < lit(1.0 / LEAST_PRODUCT)
}

/// [`cap_variance`] of the first three states, an attitude error. Where that was needed, much has grown at once: the
/// matrix is then made a covariance again if rounding was too much for it.
#[inline]
pub fn cap_attitude<T: Scalar, const N: usize>(p: &mut SMatrix<T, N, N>, limit: T) {
    const { assert!(N >= 3) };
    if (0..3).all(|i| p[(i, i)] <= limit) {
        return;
    }
    for i in 0..3 {
        cap_variance(p, i, limit);
    }
    let unknown = p.diagonal().map(|own| own.max(limit));
    forget_correlations_unless_resolved(p, &unknown);
}

/// Makes a matrix that is a covariance but for some thousandths of a correlation one that is it altogether: every
/// correlation shrinks by that much. A matrix that is a covariance stays as it is, to the bit.
pub fn shrink_correlations_unless_resolved<T: Scalar, const N: usize>(p: &mut SMatrix<T, N, N>) {
    if is_resolved(p) {
        return;
    }
    for j in 0..N {
        // Not by a filter of the range: a chip's compiler could not prove that it stays within.
        for i in 0..N {
            if i != j {
                p[(i, j)] *= lit(KEPT_CORRELATION);
            }
        }
    }
}

/// [`undrown`] of the first three states, an attitude error that has turned with the body; nothing where their variances
/// are of a size that the precision holds side by side.
#[inline]
pub fn undrown_attitude<T: Scalar, const N: usize>(p: &mut SMatrix<T, N, N>) {
    const { assert!(N >= 3) };
    let (a, b, c) = (p[(0, 0)], p[(1, 1)], p[(2, 2)]);
    let drowned = a.max(b).max(c) * (T::default_epsilon() * lit(16.0));
    if a >= drowned && b >= drowned && c >= drowned {
        return;
    }
    let mut block = Matrix3::from_fn(|i, j| p[(i, j)]);
    undrown(&mut block);
    for i in 0..3 {
        p[(i, i)] = block[(i, i)];
    }
}

/// Keeps the variances of a matrix that is no covariance any more, and forgets the correlations, or only some thousandths
/// of them where that will do; what is no variance becomes `otherwise`. Gives whether they were forgotten.
pub fn forget_correlations_unless_resolved<T: Scalar, const N: usize>(
    p: &mut SMatrix<T, N, N>,
    otherwise: &SVector<T, N>,
) -> bool {
    shrink_correlations_unless_resolved(p);
    if is_resolved(p) {
        return false;
    }
    let variance = |i: usize, _| {
        let own = p[(i, i)];
        if own > T::zero() && own.is_finite() {
            own
        } else {
            otherwise[i]
        }
    };
    *p = SMatrix::from_diagonal(&SVector::from_fn(variance));
    true
}

/// Lower triangular factor of a positive semidefinite matrix: `L L^T` is the matrix but for what the precision does not
/// resolve. A state of no variance of its own beside those before it has a column of zeros.
pub fn semidefinite_factor<T: Scalar, const N: usize>(p: &SMatrix<T, N, N>) -> SMatrix<T, N, N> {
    let mut l = SMatrix::<T, N, N>::zeros();
    for j in 0..N {
        let known = (0..j).fold(T::zero(), |sum, k| sum + l[(j, k)] * l[(j, k)]);
        let own = p[(j, j)] - known;
        // What is not a number is no variance either.
        let has_own = own > p[(j, j)] * T::default_epsilon();
        if !has_own {
            continue;
        }
        let root = own.sqrt();
        l[(j, j)] = root;
        for i in (j + 1)..N {
            let shared = (0..j).fold(T::zero(), |sum, k| sum + l[(i, k)] * l[(j, k)]);
            l[(i, j)] = (p[(i, j)] - shared) / root;
        }
    }
    l
}

/// Keeps the variance of one state below `limit` by shrinking its row and column alike, so that
/// correlations keep their value and the matrix stays positive.
///
/// An unobservable direction (heading without magnetometer) grows without bound otherwise, until
/// single precision fails.
#[inline]
pub fn cap_variance<T: Scalar, const N: usize>(p: &mut SMatrix<T, N, N>, index: usize, limit: T) {
    let variance = p[(index, index)];
    if !variance.is_finite() {
        // Nothing is left to scale: forget what it was correlated with.
        for k in 0..N {
            p[(index, k)] = T::zero();
            p[(k, index)] = T::zero();
        }
        p[(index, index)] = limit;
    } else if variance > limit {
        let scale = (limit / variance).sqrt();
        for k in 0..N {
            p[(index, k)] *= scale;
            p[(k, index)] *= scale;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(23), ..ProptestConfig::default() })]
            #[test]
            fn quadratic_forms_equal_the_inverse(a in prop::collection::vec(-1.0..1.0f64, 9), x in prop::array::uniform3(-3.0..3.0f64)) {
                let a = Matrix3::from_column_slice(&a);
                let p = a * a.transpose() + Matrix3::identity() * 0.05;
                let x = Vector3::from(x);
                let expected = (x.transpose() * p.try_inverse().unwrap() * x)[0];
                prop_assert!((normalized_square(&x, &p).unwrap() - expected).abs() < 1e-8 * (1.0 + expected));
                prop_assert!((normalized_square3(&x, &p).unwrap() - expected).abs() < 1e-8 * (1.0 + expected));
            }

            #[test]
            fn a_turned_covariance_is_the_product_and_symmetric(a in prop::collection::vec(-1.0..1.0f64, 9), b in prop::collection::vec(-1.0..1.0f64, 9)) {
                let [a, b] = [a, b].map(|elements| Matrix3::from_column_slice(&elements));
                let p = a * a.transpose();
                let turned = turned3(&p, &b);
                prop_assert!((turned - b.transpose() * p * b).abs().max() < 1e-14);
                prop_assert_eq!(turned, turned.transpose());
            }
        }

    #[test]
    fn indefinite_and_non_finite_matrices_have_no_factor() {
        let p = Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, 1.0));
        assert!(cholesky(&p).is_none() && normalized_square3(&Vector3::x(), &p).is_none());
        assert!(cholesky(&(Matrix3::identity() * f64::NAN)).is_none());
    }

    /// The short way is taken only where the long one would change nothing.
    #[test]
    fn what_is_well_conditioned_is_resolved() {
        let mut rng = Pcg64Mcg::seed_from_u64(31);
        let mut number = || rng.random_range(-1.0..1.0_f64);
        let mut short = 0;
        for k in 0..20_000 {
            let scale = Vector3::from_fn(|_, _| 10_f64.powf(6.0 * number()));
            let a = Matrix3::from_fn(|_, _| number()) * if k % 2 == 0 { 1.0 } else { 1e-3 };
            let mut p = a * a.transpose();
            if k % 3 == 0 {
                p -= Matrix3::identity() * (0.2 * number().abs());
            }
            let scale = Matrix3::from_diagonal(&scale);
            let mut p = scale * p * scale;
            symmetrize(&mut p);
            let single = p.map(|x| x as f32);
            short += u32::from(is_well_conditioned3(&p)) + u32::from(is_well_conditioned3(&single));
            assert!(!is_well_conditioned3(&p) || is_resolved(&p), "{p}");
            assert!(
                !is_well_conditioned3(&single) || is_resolved(&single),
                "{single}"
            );
        }
        assert!(short > 5000, "{short}");
        assert!(!is_well_conditioned3(&(Matrix3::identity() * f64::NAN)));
        assert!(!is_well_conditioned3(
            &(Matrix3::identity() * f64::INFINITY)
        ));
    }

    #[test]
    fn capping_keeps_correlations() {
        let mut p = Matrix3::new(100.0, 5.0, 0.0, 5.0, 1.0, 0.1, 0.0, 0.1, 1.0);
        let correlation = 5.0 / (100.0_f64 * 1.0).sqrt();
        cap_variance(&mut p, 0, 4.0);
        assert_relative_eq!(p[(0, 0)], 4.0, epsilon = 1e-12);
        assert_relative_eq!(
            p[(0, 1)] / f64::sqrt(p[(0, 0)] * p[(1, 1)]),
            correlation,
            epsilon = 1e-12
        );
        assert!(cholesky(&p).is_some());
    }

    #[test]
    fn an_infinite_variance_becomes_the_limit_without_correlations() {
        let mut p = Matrix3::new(f64::INFINITY, 5.0, 0.0, 5.0, 1.0, 0.1, 0.0, 0.1, 1.0);
        cap_variance(&mut p, 0, 4.0);
        assert_eq!(p, Matrix3::new(4.0, 0.0, 0.0, 0.0, 1.0, 0.1, 0.0, 0.1, 1.0));
    }
}
