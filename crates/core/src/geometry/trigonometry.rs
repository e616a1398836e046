//! Sine, cosine and arc tangent that a chip without double precision can afford; angles within half a turn.
//!
//! In single precision libraries compute these in double precision, which a Cortex-M3 or M4F does in software:
//! 1600 instructions a call. Here they are polynomials in single precision, a fifth of that. The same operations
//! run on hosts, so that both agree to the bit. Types with more digits take the library's functions.
//!
//! | function | for | largest error in single precision |
//! |---|---|---|
//! | [`sin_cos`] | angles within a turn | 1.1e-7; 2.5e-7 within a thousand turns; zero turn where no digit is left |
//! | [`atan2`] | finite numbers below 1e38 | 2.5e-7 rad, and 2e-7 of the angle below 45 degrees |
//!
//! The polynomials are minimax in the relative error, by Remez' exchange, and then rounded: sine to 4e-9 on
//! `[0, pi/4]`, arc tangent to 2e-8 on `[0, tan(pi/8)]`.

use core::f64::consts::PI;

use crate::scalar::{Scalar, lit};

/// What rounding to single precision adds to pi; half of it to a quarter of a turn.
const PI_ROUNDED_UP: f64 = 8.742_277_657_347_586e-8;
/// A turn in two parts: whole turns times the first are exact.
const TURN: [f64; 2] = [6.281_25, 1.935_307_179_586_477e-3];
/// Tangent of an eighth of half a turn.
const TAN_PI_8: f64 = 0.414_213_562_373_095_05;
/// Of `(sin(x)/x - 1) / x^2` by powers of `x^2`.
const SINE: [f64; 3] = [-0.166_666_55, 8.332_173e-3, -1.951_665_6e-4];
/// Of `(atan(x)/x - 1) / x^2` by powers of `x^2`.
const ARC_TANGENT: [f64; 4] = [-0.333_329_53, 0.199_778_08, -0.138_784_53, 0.080_554_456];

// Literals one by one below: a loop over a table of them, and so `map`, converts at run time where code is to be
// small.

/// Whether `T` has the digits of single precision; folds at compile time.
#[inline(always)]
fn is_single<T: Scalar>() -> bool {
    T::default_epsilon() > lit(1e-10)
}

/// Sine and cosine of an angle (rad).
#[inline]
pub fn sin_cos<T: Scalar>(angle: T) -> (T, T) {
    if is_single::<T>() {
        sin_cos_single(angle)
    } else {
        angle.sin_cos()
    }
}

/// The angle (rad, in `[-pi, pi]`) of the direction `(x, y)` from the first axis; zero for no direction.
#[inline]
pub fn atan2<T: Scalar>(y: T, x: T) -> T {
    if is_single::<T>() {
        atan2_single(y, x)
    } else {
        y.atan2(x)
    }
}

/// An angle (rad) in `[-pi, pi)`.
#[inline]
pub fn wrap<T: Scalar>(angle: T) -> T {
    if angle.abs() < T::pi() {
        return angle;
    }
    // Angles that have just left it come back by one turn.
    let back = angle - T::two_pi().copysign(angle);
    if back.abs() < T::pi() {
        return back;
    }
    let turns = (angle / T::two_pi() + lit(0.5)).floor();
    angle - turns * T::two_pi()
}

#[inline(never)]
fn sin_cos_single<T: Scalar>(angle: T) -> (T, T) {
    let mut angle = angle;
    if angle.abs() > lit(1.25 * PI) {
        let turns = (angle / T::two_pi()).round();
        angle = (angle - turns * lit(TURN[0])) - turns * lit(TURN[1]);
        // Of so many turns no digit of the angle is left.
        let has_digits = angle.abs() <= lit(1.25 * PI);
        angle = if has_digits { angle } else { angle * T::zero() };
    }
    // The sine is odd, the cosine even.
    let x = angle.abs();
    // Before the branches, or a compiler that joins them converts at run time.
    let [half_pi_low, pi_low] = [lit::<T>(PI_ROUNDED_UP / 2.0), lit::<T>(PI_ROUNDED_UP)];
    let (sin, cos) = if x <= T::frac_pi_4() {
        sin_cos_below_45_deg(x)
    } else if x <= lit(0.75 * PI) {
        let (sin, cos) = sin_cos_below_45_deg((T::frac_pi_2() - x) - half_pi_low);
        (cos, sin)
    } else {
        let (sin, cos) = sin_cos_below_45_deg((T::pi() - x) - pi_low);
        (sin, -cos)
    };
    (if angle.is_sign_negative() { -sin } else { sin }, cos)
}

#[inline(always)]
fn sin_cos_below_45_deg<T: Scalar>(x: T) -> (T, T) {
    let x2 = x * x;
    let sin = x + x * x2 * (lit::<T>(SINE[0]) + x2 * (lit::<T>(SINE[1]) + x2 * lit(SINE[2])));
    // The cosine is above 0.7, so nothing is lost; a root is a third of another polynomial.
    (sin, (T::one() - sin * sin).sqrt())
}

#[inline(never)]
fn atan2_single<T: Scalar>(y: T, x: T) -> T {
    let (across, along) = (y.abs(), x.abs());
    let is_steep = across > along;
    let (small, large) = if is_steep {
        (along, across)
    } else {
        (across, along)
    };
    if large <= T::zero() {
        return T::zero();
    }
    // atan(t) = pi/4 + atan((t - 1) / (t + 1)), with the quotient of the two numbers put in.
    let is_far = small > large * lit(TAN_PI_8);
    let tangent = if is_far {
        (small - large) / (small + large)
    } else {
        small / large
    };
    let t2 = tangent * tangent;
    let upper = lit::<T>(ARC_TANGENT[2]) + t2 * lit(ARC_TANGENT[3]);
    let series = lit::<T>(ARC_TANGENT[0]) + t2 * (lit::<T>(ARC_TANGENT[1]) + t2 * upper);
    let angle = tangent + tangent * t2 * series;
    let is_behind = x.is_sign_negative();
    // From the nearest of the eight directions half a right angle apart, in its sense.
    let from = match (is_far, is_steep, is_behind) {
        (false, false, false) => return angle.copysign(y),
        (true, _, false) => T::frac_pi_4(),
        (false, true, _) => T::frac_pi_2(),
        (true, _, true) => T::pi() - T::frac_pi_4(),
        (false, false, true) => T::pi(),
    };
    let angle = if is_steep == is_behind {
        from + angle
    } else {
        from - angle
    };
    angle.copysign(y)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Largest errors of sine and cosine over every `stride`-th number up to `largest`.
    fn worst_sin_cos(largest: f32, stride: usize) -> f64 {
        let mut worst = 0.0_f64;
        for bits in (0..=largest.to_bits()).step_by(stride) {
            for x in [f32::from_bits(bits), -f32::from_bits(bits)] {
                let (sin, cos) = sin_cos(x);
                let (true_sin, true_cos) = f64::from(x).sin_cos();
                worst = worst
                    .max((f64::from(sin) - true_sin).abs())
                    .max((f64::from(cos) - true_cos).abs());
            }
        }
        worst
    }

    #[test]
    fn sine_and_cosine_in_single_precision_are_those_of_double_precision() {
        let within_a_turn = worst_sin_cos(2.0 * core::f32::consts::PI, 2_003);
        assert!(within_a_turn < 1.1e-7, "{within_a_turn:e}");
        let far = worst_sin_cos(6_283.0, 2_003);
        assert!(far < 2.5e-7, "{far:e}");
        // Relative, near zero: an angle that hardly differs from zero is its own sine.
        for bits in (0..=0.785_f32.to_bits()).step_by(1_009) {
            let x = f32::from_bits(bits);
            let off = f64::from(sin_cos(x).0) - f64::from(x).sin();
            assert!(off.abs() <= 1.2e-7 * f64::from(x), "{x:e}: {off:e}");
        }
        assert!(sin_cos(f32::NAN).0.is_nan() && sin_cos(f32::INFINITY).1.is_nan());
    }

    #[test]
    fn arc_tangents_in_single_precision_are_those_of_double_precision() {
        let (mut worst, mut worst_relative) = (0.0_f64, 0.0_f64);
        for k in 0..400_000_u32 {
            // All directions, and such as are near an axis, with lengths from 1e-30 to 1e30.
            let turn = f64::from(k) * 0.618_033_988_75 * core::f64::consts::TAU;
            let length = 10.0_f64.powf(f64::from(k % 61) - 30.0);
            let narrow = 10.0_f64.powf(-f64::from(k % 9));
            let (sin, cos) = turn.sin_cos();
            for [y, x] in [[sin, cos], [sin * narrow, cos], [sin, cos * narrow]] {
                let [y, x] = [y, x].map(|v| (v * length) as f32);
                let truth = f64::from(y).atan2(f64::from(x));
                let off = (f64::from(atan2(y, x)) - truth).abs();
                worst = worst.max(off);
                if truth.abs() < PI / 4.0 && truth != 0.0 {
                    worst_relative = worst_relative.max(off / truth.abs());
                }
            }
        }
        assert!(worst < 2.5e-7, "{worst:e}");
        assert!(worst_relative < 2e-7, "{worst_relative:e}");
    }

    #[test]
    fn arc_tangents_of_the_axes_have_the_signs_of_their_zeros() {
        let pi = core::f32::consts::PI;
        for (y, x, expected) in [
            (0.0_f32, 1.0_f32, 0.0_f32),
            (1.0, 0.0, pi / 2.0),
            (0.0, -1.0, pi),
            (-0.0, -1.0, -pi),
            (-1.0, -0.0, -pi / 2.0),
            (1.0, 1.0, pi / 4.0),
            (1.0, -1.0, 3.0 * pi / 4.0),
            (0.0, 0.0, 0.0),
        ] {
            assert_eq!(atan2(y, x).to_bits(), expected.to_bits(), "{y} {x}");
        }
        assert!(atan2(f32::NAN, 1.0).is_nan() && atan2(1.0, f32::NAN).is_nan());
    }

    /// More digits than single precision: the library's functions, to the bit.
    #[test]
    fn double_precision_keeps_its_digits() {
        for k in -700..700 {
            let x = f64::from(k) * 0.01;
            let (sin, cos) = sin_cos(x);
            assert!((sin - x.sin()).abs() < 1e-15 && (cos - x.cos()).abs() < 1e-15);
            assert!((atan2(sin, cos) - sin.atan2(cos)).abs() < 1e-15);
        }
    }

    #[test]
    fn wrapped_angles_lie_within_half_a_turn() {
        let pi = PI;
        for (angle, expected) in [
            (0.0, 0.0),
            (pi, -pi),
            (-pi, -pi),
            (pi + 0.5, 0.5 - pi),
            (-pi - 0.5, pi - 0.5),
            (3.0 * pi, -pi),
            (7.0, 7.0 - 2.0 * pi),
            (-100.0, -100.0 + 32.0 * pi),
        ] {
            assert!((wrap(angle) - expected).abs() < 1e-13, "{angle}");
        }
        // Just outside, in single precision.
        let pi = core::f32::consts::PI;
        for x in [pi.next_up(), (-pi).next_down(), 3.0 * pi, 1e6] {
            assert!((-pi..pi).contains(&wrap(x)), "{x}");
        }
    }
}
