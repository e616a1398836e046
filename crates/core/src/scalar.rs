//! The scalar type of every estimator, and the one place where literals are converted.

use nalgebra::RealField;

/// A real number that estimators compute with: `f32`, `f64`, or a dual number in tests.
pub trait Scalar: RealField + Copy {}

impl<T: RealField + Copy> Scalar for T {}

/// A literal as a scalar of the generic type; folds at compile time for `f32` and `f64`.
#[inline(always)]
pub(crate) fn lit<T: Scalar>(value: f64) -> T {
    nalgebra::convert(value)
}

/// Evaluates a polynomial with `f64` coefficients, lowest power first (Horner).
#[inline(always)]
pub(crate) fn polynomial<T: Scalar, const N: usize>(x: T, coefficients: [f64; N]) -> T {
    let mut sum = T::zero();
    for c in coefficients.iter().rev() {
        sum = sum * x + lit::<T>(*c);
    }
    sum
}
