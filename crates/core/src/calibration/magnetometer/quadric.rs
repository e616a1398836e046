//! Taubin's fit of an ellipsoid or a sphere to moments, its residual and its covariance.
//!
//! Minimises mean(value^2) / mean(|gradient|^2) over all quadrics: to first order the mean square
//! distance of the points from the surface (C5). Nothing forces the result to be an ellipsoid; that
//! is checked, because a fit that must be bent into one has no business being used.

use nalgebra::{Matrix3, Matrix4, SMatrix, SVector, SymmetricEigen, Vector3};

use super::moments::{self, FeatureMatrix, LINEAR, PAIRS};
use crate::kalman::covariance::cholesky;
use crate::scalar::{Scalar, lit};

/// Iterations allowed to an eigenvalue decomposition; it needs two or three an eigenvalue.
const ITERATIONS: usize = 300;

/// Standard deviation of the entries of `shape` in units of the radius, where soft iron cannot be
/// seen: semi-axes that differ by three percent, as those of phones do.
const UNSEEN_SOFT_IRON: f64 = 0.06;

type Matrix9<T> = SMatrix<T, 9, 9>;

/// An ellipsoid `(x - centre)^T shape (x - centre) = 1`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Surface<T: Scalar> {
    pub(super) centre: Vector3<T>,
    pub(super) shape: Matrix3<T>,
    /// Geometric mean of the semi-axes.
    pub(super) radius: T,
    /// Longest over shortest semi-axis.
    pub(super) axis_ratio: T,
    /// Mean square distance of the points from the surface.
    pub(super) mean_square: T,
}

/// What the data say about the precision of a surface (C8).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Precision<T: Scalar> {
    /// Variance of the centre per component, for unit noise and one sample.
    pub(super) centre_variance: Vector3<T>,
    /// Variance of the centre that soft iron gives which the surface cannot show, in units of the
    /// radius squared; zero for an ellipsoid (C8c).
    pub(super) soft_iron_variance: Vector3<T>,
    /// Condition number of the design matrix, 1.0 or more.
    pub(super) condition: T,
}

/// The best sphere; `None` when the points do not determine one.
pub(super) fn fit_sphere<T: Scalar>(means: &FeatureMatrix<T>) -> Option<Surface<T>> {
    let (centred, origin, unit) = centred(means)?;
    let (value, gradient) = forms(&centred);
    let basis = sphere_basis::<T>();
    let (v, mean_square) = smallest4(
        &(basis.transpose() * value * basis),
        &(basis.transpose() * gradient * basis),
    )?;
    surface(&(basis * v), &centred, mean_square)?.moved(&origin, unit)
}

/// The best quadric, if it is an ellipsoid. `near` is a sphere about which to compute.
pub(super) fn fit_ellipsoid<T: Scalar>(
    means: &FeatureMatrix<T>,
    near: &Surface<T>,
) -> Option<Surface<T>> {
    let centred = moments::translated(means, &near.centre, near.radius);
    let (value, gradient) = forms(&centred);
    let (v, mean_square) = smallest9(&value, &gradient)?;
    surface(&v, &centred, mean_square)?.moved(&near.centre, near.radius)
}

impl<T: Scalar> Surface<T> {
    /// The surface of the points `origin + unit * x`.
    fn moved(&self, origin: &Vector3<T>, unit: T) -> Option<Self> {
        let moved = Self {
            centre: origin + self.centre * unit,
            shape: self.shape / (unit * unit),
            radius: self.radius * unit,
            axis_ratio: self.axis_ratio,
            mean_square: self.mean_square * unit * unit,
        };
        let finite = moved
            .centre
            .iter()
            .chain(moved.shape.iter())
            .all(|x| x.is_finite());
        (finite && moved.radius > T::zero() && moved.mean_square.is_finite()).then_some(moved)
    }

    /// Precision of the nine parameters of an ellipsoid; `None` when the points leave one open.
    pub(super) fn ellipsoid_precision(&self, means: &FeatureMatrix<T>) -> Option<Precision<T>> {
        let information = self.information(means);
        let half = inverse_root(&information)?;
        let variance = Vector3::from_fn(|i, _| half.column(LINEAR + i).norm_squared());
        let eigenvalues =
            SymmetricEigen::try_new(information, T::default_epsilon(), ITERATIONS)?.eigenvalues;
        let none = Vector3::zeros();
        precision(variance, none, eigenvalues.max(), eigenvalues.min())
    }

    /// Precision of the four parameters of a sphere.
    pub(super) fn sphere_precision(&self, means: &FeatureMatrix<T>) -> Option<Precision<T>> {
        let basis = sphere_basis::<T>();
        let all = self.information(means);
        let information: Matrix4<T> = basis.transpose() * all * basis;
        let half = inverse_root(&information)?;
        let variance = Vector3::from_fn(|i, _| half.column(1 + i).norm_squared());
        let eigenvalues =
            SymmetricEigen::try_new(information, T::default_epsilon(), ITERATIONS)?.eigenvalues;
        // What each entry of a shape that is no sphere does to the four parameters.
        let seen = basis.transpose() * all.fixed_columns::<LINEAR>(0);
        let moved = half.transpose() * (half * seen);
        let prior = lit::<T>(UNSEEN_SOFT_IRON * UNSEEN_SOFT_IRON);
        let soft = Vector3::from_fn(|i, _| moved.row(1 + i).norm_squared() * prior);
        precision(variance, soft, eigenvalues.max(), eigenvalues.min())
    }

    /// Information of one sample about the parameters, in units of the radius (C8).
    fn information(&self, means: &FeatureMatrix<T>) -> Matrix9<T> {
        moments::translated(means, &self.centre, self.radius)
            .fixed_view::<9, 9>(0, 0)
            .into_owned()
    }
}

fn precision<T: Scalar>(
    variance: Vector3<T>,
    soft_iron_variance: Vector3<T>,
    largest: T,
    smallest: T,
) -> Option<Precision<T>> {
    let condition = (largest / smallest).sqrt();
    let usable = smallest > T::zero() && condition.is_finite();
    usable.then(|| Precision {
        // The value of a quadric is twice the distance, in units of the radius.
        centre_variance: variance * lit::<T>(4.0),
        soft_iron_variance,
        condition,
    })
}

/// The moments about the mean, in units of the root mean square distance from it; with both.
fn centred<T: Scalar>(means: &FeatureMatrix<T>) -> Option<(FeatureMatrix<T>, Vector3<T>, T)> {
    let origin = moments::mean(means);
    let about = moments::translated(means, &origin, T::one());
    let second = moments::homogeneous(&about);
    let unit = (second[(0, 0)] + second[(1, 1)] + second[(2, 2)]).sqrt();
    if !(unit > T::zero() && unit.is_finite()) {
        return None;
    }
    Some((
        moments::translated(&about, &Vector3::zeros(), unit),
        origin,
        unit,
    ))
}

/// The two quadratic forms of Taubin's quotient in the nine coefficients (C6): the variance of the
/// value, the constant being eliminated, and the mean square of the gradient.
fn forms<T: Scalar>(means: &FeatureMatrix<T>) -> (Matrix9<T>, Matrix9<T>) {
    let mean = means.fixed_view::<9, 1>(0, 9).into_owned();
    let value = means.fixed_view::<9, 9>(0, 0) - mean * mean.transpose();
    let second = moments::homogeneous(means);
    let gradient = Matrix9::from_fn(|p, q| {
        let mut sum = T::zero();
        for component in 0..3 {
            if let (Some(i), Some(j)) = (factor(p, component), factor(q, component)) {
                sum += second[(i, j)];
            }
        }
        sum * lit(4.0)
    });
    (value, gradient)
}

/// The derivative of a feature by a component is twice this one of `(x, y, z, 1)`, or zero.
fn factor(feature: usize, component: usize) -> Option<usize> {
    match PAIRS.get(feature) {
        Some((i, j)) if *i == component => Some(*j),
        Some((i, j)) if *j == component => Some(*i),
        Some(_) => None,
        None => (feature == LINEAR + component).then_some(3),
    }
}

/// Coefficients of a quadric from those of a sphere `a |x|^2 + 2 q^T x`.
fn sphere_basis<T: Scalar>() -> SMatrix<T, 9, 4> {
    let mut basis = SMatrix::zeros();
    for i in 0..3 {
        basis[(i, 0)] = T::one();
        basis[(LINEAR + i, 1 + i)] = T::one();
    }
    basis
}

/// The ellipsoid of nine coefficients; `None` when the quadric is none (C7).
fn surface<T: Scalar>(
    v: &SVector<T, 9>,
    means: &FeatureMatrix<T>,
    mean_square: T,
) -> Option<Surface<T>> {
    let q = Vector3::new(v[6], v[7], v[8]);
    let quadratic = Matrix3::new(v[0], v[3], v[4], v[3], v[1], v[5], v[4], v[5], v[2]);
    let constant = -v.dot(&means.fixed_view::<9, 1>(0, 9));
    let centre = -(quadratic.try_inverse()? * q);
    let shape = quadratic / (-constant - centre.dot(&q));
    if !shape.iter().all(|x| x.is_finite()) {
        return None;
    }
    let eigenvalues = SymmetricEigen::try_new(shape, T::default_epsilon(), ITERATIONS)?.eigenvalues;
    let (longest, shortest) = (eigenvalues.min(), eigenvalues.max());
    if longest <= T::zero() {
        return None;
    }
    let volume = eigenvalues[0] * eigenvalues[1] * eigenvalues[2];
    Some(Surface {
        centre,
        shape,
        radius: T::one() / volume.cbrt().sqrt(),
        axis_ratio: (shortest / longest).sqrt(),
        mean_square: mean_square.max(T::zero()),
    })
}

/// `L^-1` of the Cholesky factor `L`.
fn inverse_root<T: Scalar, const N: usize>(m: &SMatrix<T, N, N>) -> Option<SMatrix<T, N, N>> {
    cholesky(m)?.solve_lower_triangular(&SMatrix::<T, N, N>::identity())
}

/// Makes the function that solves `value v = lambda gradient v` for the smallest `lambda`.
macro_rules! smallest_eigenpair {
    ($name:ident, $n:literal) => {
        fn $name<T: Scalar>(
            value: &SMatrix<T, $n, $n>,
            gradient: &SMatrix<T, $n, $n>,
        ) -> Option<(SVector<T, $n>, T)> {
            let half = inverse_root(gradient)?;
            let whitened = half * value * half.transpose();
            if !whitened.iter().all(|x| x.is_finite()) {
                return None;
            }
            let eigen = SymmetricEigen::try_new(whitened, T::default_epsilon(), ITERATIONS)?;
            let smallest = eigen.eigenvalues.imin();
            let v = half.transpose() * eigen.eigenvectors.column(smallest);
            Some((v, eigen.eigenvalues[smallest]))
        }
    };
}

smallest_eigenpair!(smallest4, 4);
smallest_eigenpair!(smallest9, 9);
