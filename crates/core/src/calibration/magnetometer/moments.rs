//! Moments up to the fourth order of a cloud of points: all that a quadric fit needs of the samples.
//!
//! They are those of the ten features of a point `x`,
//! `phi = (x^2, y^2, z^2, 2xy, 2xz, 2yz, 2x, 2y, 2z, 1)`, so that a quadric
//! `x^T Q x + 2 q^T x + c` is a scalar product with `phi` (C3).

use nalgebra::{Matrix4, SMatrix, SVector, Vector3};

use crate::scalar::{Scalar, lit};

/// Number of features, the constant last.
pub(super) const FEATURES: usize = 10;

/// First of the three linear features; before it come the six quadratic ones.
pub(super) const LINEAR: usize = 6;

/// The constant feature.
const CONSTANT: usize = 9;

/// Components that each quadratic feature multiplies.
pub(super) const PAIRS: [(usize, usize); 6] = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)];

/// A symmetric matrix of means of products of features.
pub(super) type FeatureMatrix<T> = SMatrix<T, FEATURES, FEATURES>;

/// Sums of products of features about a fixed origin.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Moments<T: Scalar> {
    count: u32,
    /// Lower triangle.
    sums: FeatureMatrix<T>,
    /// Samples not yet in `sums`: short sums keep single precision exact.
    pending: FeatureMatrix<T>,
    pending_count: u32,
}

/// Samples summed on their own before they join the long sums.
const BLOCK: u32 = 64;

impl<T: Scalar> Moments<T> {
    pub(super) fn new() -> Self {
        Self {
            count: 0,
            sums: FeatureMatrix::zeros(),
            pending: FeatureMatrix::zeros(),
            pending_count: 0,
        }
    }

    pub(super) fn add(&mut self, x: &Vector3<T>) {
        let phi = features(x);
        for j in 0..FEATURES {
            for i in j..FEATURES {
                self.pending[(i, j)] += phi[i] * phi[j];
            }
        }
        self.count = self.count.saturating_add(1);
        self.pending_count += 1;
        if self.pending_count == BLOCK {
            self.sums += self.pending;
            self.pending = FeatureMatrix::zeros();
            self.pending_count = 0;
        }
    }

    pub(super) fn count(&self) -> u32 {
        self.count
    }

    /// Means of the products of features; zero before the first sample.
    pub(super) fn means(&self) -> FeatureMatrix<T> {
        let n = lit::<T>(f64::from(self.count.max(1)));
        let lower = (self.sums + self.pending) / n;
        FeatureMatrix::from_fn(|i, j| lower[(i.max(j), i.min(j))])
    }
}

/// The features of a point.
fn features<T: Scalar>(x: &Vector3<T>) -> SVector<T, FEATURES> {
    let two = lit::<T>(2.0);
    let mut phi = SVector::zeros();
    for (feature, (i, j)) in PAIRS.iter().enumerate() {
        let product = x[*i] * x[*j];
        phi[feature] = if i == j { product } else { two * product };
    }
    for i in 0..3 {
        phi[LINEAR + i] = two * x[i];
    }
    phi[CONSTANT] = T::one();
    phi
}

/// The same moments of the points `(x - origin) / unit` (C4).
pub(super) fn translated<T: Scalar>(
    means: &FeatureMatrix<T>,
    origin: &Vector3<T>,
    unit: T,
) -> FeatureMatrix<T> {
    let (first, second) = (T::one() / unit, T::one() / (unit * unit));
    let two = lit::<T>(2.0);
    let mut map = FeatureMatrix::zeros();
    for (feature, (i, j)) in PAIRS.iter().copied().enumerate() {
        map[(feature, feature)] = second;
        map[(feature, LINEAR + i)] -= origin[j] * second;
        let square = origin[i] * origin[j] * second;
        if i == j {
            map[(feature, CONSTANT)] = square;
        } else {
            map[(feature, LINEAR + j)] -= origin[i] * second;
            map[(feature, CONSTANT)] = two * square;
        }
    }
    for i in 0..3 {
        map[(LINEAR + i, LINEAR + i)] = first;
        map[(LINEAR + i, CONSTANT)] = -two * origin[i] * first;
    }
    map[(CONSTANT, CONSTANT)] = T::one();
    map * means * map.transpose()
}

/// Mean of the points.
pub(super) fn mean<T: Scalar>(means: &FeatureMatrix<T>) -> Vector3<T> {
    let half = lit::<T>(0.5);
    Vector3::from_fn(|i, _| means[(LINEAR + i, CONSTANT)] * half)
}

/// Means of the products of `(x, y, z, 1)`.
pub(super) fn homogeneous<T: Scalar>(means: &FeatureMatrix<T>) -> Matrix4<T> {
    let scale = |k: usize| if k < 3 { lit::<T>(0.5) } else { T::one() };
    Matrix4::from_fn(|i, j| means[(LINEAR + i, LINEAR + j)] * scale(i) * scale(j))
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn points(count: u32) -> impl Iterator<Item = Vector3<f64>> {
        (0..count).map(|k| {
            let t = f64::from(k);
            Vector3::new(
                (0.7 * t).sin(),
                (0.3 * t).cos() * 1.1,
                (1.9 * t).sin() - 0.2,
            )
        })
    }

    fn gathered(points: impl Iterator<Item = Vector3<f64>>) -> Moments<f64> {
        let mut moments = Moments::new();
        points.for_each(|x| moments.add(&x));
        moments
    }

    /// Oracle: sums over the moved points themselves.
    #[test]
    fn moving_the_moments_is_moving_the_points() {
        let (origin, unit) = (Vector3::new(0.4, -1.3, 2.0), 0.8);
        let moved = gathered(points(200).map(|x| (x - origin) / unit)).means();
        let ours = translated(&gathered(points(200)).means(), &origin, unit);
        assert_relative_eq!(ours, moved, epsilon = 1e-11, max_relative = 1e-11);
    }

    #[test]
    fn mean_and_second_moments_are_found_in_them() {
        let means = gathered(points(100)).means();
        let mean_point = points(100).sum::<Vector3<f64>>() / 100.0;
        assert_relative_eq!(mean(&means), mean_point, epsilon = 1e-12);
        let second = points(100)
            .map(|x| x.push(1.0))
            .map(|x| x * x.transpose())
            .sum::<Matrix4<f64>>();
        assert_relative_eq!(homogeneous(&means), second / 100.0, epsilon = 1e-12);
    }
}
