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

/// A scalar as `f64`, for stamps and places on the Earth; zero for types that have none.
#[inline]
pub(crate) fn to_f64<T: Scalar>(x: T) -> f64 {
    nalgebra::try_convert(x).unwrap_or(0.0)
}

/// The lesser of two numbers, as [`RealField::min`] has it. That one minds what is not a number, which costs five instructions
/// instead of one; these two are for where every sample passes and everything is finite.
#[inline(always)]
pub(crate) fn lesser<T: Scalar>(a: T, b: T) -> T {
    if a < b { a } else { b }
}

/// The greater of two finite numbers: see [`lesser`].
#[inline(always)]
pub(crate) fn greater<T: Scalar>(a: T, b: T) -> T {
    if a > b { a } else { b }
}

/// Seconds from one stamp (ns) to another.
#[inline]
pub(crate) fn seconds<T: Scalar>(from_ns: i64, to_ns: i64) -> T {
    lit(to_ns.saturating_sub(from_ns) as f64 * 1e-9)
}

/// Evaluates a polynomial with up to eight `f64` coefficients, lowest power first. In pairs (Estrin):
/// the sums do not wait for one another, which halves the time of a Horner chain.
#[inline(always)]
pub(crate) fn polynomial<T: Scalar, const N: usize>(x: T, coefficients: [f64; N]) -> T {
    const { assert!(N <= 8) };
    let pair = |i: usize| match coefficients.get(i..) {
        Some([low, high, ..]) => lit::<T>(*low) + lit::<T>(*high) * x,
        Some([low]) => lit(*low),
        _ => T::zero(),
    };
    let x2 = x * x;
    let first = pair(0) + pair(2) * x2;
    if N > 4 {
        first + (pair(4) + pair(6) * x2) * (x2 * x2)
    } else {
        first
    }
}
