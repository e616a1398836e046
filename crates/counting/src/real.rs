//! What linear algebra asks of a real number: every function is that of `f64`, counted by its kind.

use approx::{AbsDiffEq, RelativeEq, UlpsEq};
use simba::scalar::{ComplexField, Field, RealField};
use simba::simd::SimdValue;

use crate::{Counting, count};

impl AbsDiffEq for Counting {
    type Epsilon = Self;
    fn default_epsilon() -> Self {
        Self(f64::default_epsilon())
    }
    fn abs_diff_eq(&self, other: &Self, epsilon: Self) -> bool {
        self.0.abs_diff_eq(&other.0, epsilon.0)
    }
}

impl RelativeEq for Counting {
    fn default_max_relative() -> Self {
        Self(f64::default_max_relative())
    }
    fn relative_eq(&self, other: &Self, epsilon: Self, max_relative: Self) -> bool {
        self.0.relative_eq(&other.0, epsilon.0, max_relative.0)
    }
}

impl UlpsEq for Counting {
    fn default_max_ulps() -> u32 {
        f64::default_max_ulps()
    }
    fn ulps_eq(&self, other: &Self, epsilon: Self, max_ulps: u32) -> bool {
        self.0.ulps_eq(&other.0, epsilon.0, max_ulps)
    }
}

// The trait has `unsafe` in two signatures; the methods do what the safe ones do.
#[allow(unsafe_code)]
impl SimdValue for Counting {
    const LANES: usize = 1;
    type Element = Self;
    type SimdBool = bool;

    fn splat(value: Self) -> Self {
        value
    }
    fn extract(&self, _: usize) -> Self {
        *self
    }
    unsafe fn extract_unchecked(&self, _: usize) -> Self {
        *self
    }
    fn replace(&mut self, _: usize, value: Self) {
        *self = value;
    }
    unsafe fn replace_unchecked(&mut self, _: usize, value: Self) {
        *self = value;
    }
    fn select(self, condition: bool, other: Self) -> Self {
        if condition { self } else { other }
    }
}

impl Field for Counting {}

/// Functions of one number, counted as `functions`.
macro_rules! functions {
    ($($name:ident)*) => {$(
        fn $name(self) -> Self {
            count(|done| done.functions += 1);
            Self(ComplexField::$name(self.0))
        }
    )*};
}

/// Functions of one number that cost no arithmetic worth counting.
macro_rules! free {
    ($($name:ident)*) => {$(
        fn $name(self) -> Self {
            Self(ComplexField::$name(self.0))
        }
    )*};
}

impl ComplexField for Counting {
    type RealField = Self;

    functions! {
        sin cos tan asin acos atan sinh cosh tanh asinh acosh atanh
        log2 log10 ln ln_1p exp exp2 exp_m1 cbrt
    }
    free! { real imaginary modulus norm1 argument floor ceil round trunc fract abs signum conjugate }

    fn from_real(value: Self) -> Self {
        value
    }
    fn modulus_squared(self) -> Self {
        self * self
    }
    fn scale(self, factor: Self) -> Self {
        self * factor
    }
    fn unscale(self, factor: Self) -> Self {
        self / factor
    }
    fn mul_add(self, a: Self, b: Self) -> Self {
        count(|done| {
            done.multiplications += 1;
            done.additions += 1;
        });
        Self(ComplexField::mul_add(self.0, a.0, b.0))
    }
    fn hypot(self, other: Self) -> Self {
        count(|done| {
            done.multiplications += 2;
            done.additions += 1;
            done.square_roots += 1;
        });
        Self(ComplexField::hypot(self.0, other.0))
    }
    fn recip(self) -> Self {
        Self(1.0) / self
    }
    fn sin_cos(self) -> (Self, Self) {
        count(|done| done.functions += 2);
        let (sin, cos) = ComplexField::sin_cos(self.0);
        (Self(sin), Self(cos))
    }
    fn log(self, base: Self) -> Self {
        count(|done| done.functions += 1);
        Self(ComplexField::log(self.0, base.0))
    }
    fn sqrt(self) -> Self {
        count(|done| done.square_roots += 1);
        Self(ComplexField::sqrt(self.0))
    }
    fn try_sqrt(self) -> Option<Self> {
        (self >= Self(0.0)).then(|| ComplexField::sqrt(self))
    }
    fn powi(self, n: i32) -> Self {
        count(|done| done.functions += 1);
        Self(ComplexField::powi(self.0, n))
    }
    fn powf(self, n: Self) -> Self {
        count(|done| done.functions += 1);
        Self(ComplexField::powf(self.0, n.0))
    }
    fn powc(self, n: Self) -> Self {
        ComplexField::powf(self, n)
    }
    fn is_finite(&self) -> bool {
        self.0.is_finite()
    }
}

/// Constants as `f64` has them.
macro_rules! constants {
    ($($name:ident)*) => {$(
        fn $name() -> Self {
            Self(<f64 as RealField>::$name())
        }
    )*};
}

impl RealField for Counting {
    constants! {
        pi two_pi frac_pi_2 frac_pi_3 frac_pi_4 frac_pi_6 frac_pi_8 frac_1_pi frac_2_pi frac_2_sqrt_pi
        e log2_e log10_e ln_2 ln_10
    }

    fn is_sign_positive(&self) -> bool {
        self.0.is_sign_positive()
    }
    fn is_sign_negative(&self) -> bool {
        self.0.is_sign_negative()
    }
    fn copysign(self, sign: Self) -> Self {
        Self(self.0.copysign(sign.0))
    }
    fn max(self, other: Self) -> Self {
        count(|done| done.comparisons += 1);
        Self(self.0.max(other.0))
    }
    fn min(self, other: Self) -> Self {
        count(|done| done.comparisons += 1);
        Self(self.0.min(other.0))
    }
    fn clamp(self, min: Self, max: Self) -> Self {
        RealField::min(RealField::max(self, min), max)
    }
    fn atan2(self, other: Self) -> Self {
        count(|done| done.functions += 1);
        Self(RealField::atan2(self.0, other.0))
    }
    fn min_value() -> Option<Self> {
        Some(Self(f64::MIN))
    }
    fn max_value() -> Option<Self> {
        Some(Self(f64::MAX))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Operations, counted};

    #[test]
    fn results_are_those_of_a_float_and_each_kind_is_counted() {
        let (x, y) = (Counting::new(0.75), Counting::new(-2.5));
        let work = || (x * y + x - y / x) * ComplexField::sqrt(x) + RealField::atan2(-y, x);
        let (result, done) = counted(work);
        let (x, y) = (0.75_f64, -2.5_f64);
        let expected = (x * y + x - y / x) * x.sqrt() + RealField::atan2(-y, x);
        assert_eq!(result.value().to_bits(), expected.to_bits());
        let all = Operations {
            multiplications: 2,
            additions: 3,
            divisions: 1,
            square_roots: 1,
            functions: 1,
            comparisons: 0,
        };
        assert_eq!(done, all);
    }

    #[test]
    fn comparisons_are_apart_and_nothing_else_is_free_of_charge_by_accident() {
        let (x, y) = (Counting::new(2.0), Counting::new(3.0));
        let (less, done) = counted(|| x < y && RealField::max(x, y) == y);
        assert!(less);
        assert_eq!(done.comparisons, 3);
        assert_eq!(
            done - Operations {
                comparisons: 3,
                ..Operations::default()
            },
            Operations::default()
        );
        let (_, done) = counted(|| (ComplexField::sin_cos(x), ComplexField::abs(-y)));
        assert_eq!(
            done,
            Operations {
                functions: 2,
                ..Operations::default()
            }
        );
        let (_, nothing) = counted(|| 1.0);
        assert_eq!(nothing, Operations::default());
    }
}
