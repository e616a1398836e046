//! Sums, differences, products, quotients and comparisons in single precision for chips without a floating
//! point unit, in half the instructions of the compiler's own.
//!
//! On a Cortex-M3 two thirds of a filter's instructions are these. An image that names this crate
//! (`use northing_firmware_soft_float as _;`) links them in place of the compiler's, whose symbols are
//! weak. Results are those of IEEE 754, round to nearest, ties to even, to the bit: what is not between
//! two normal numbers with a normal result, or zero, is left to the compiler's functions.
#![cfg_attr(target_os = "none", no_std)]

#[cfg(all(target_arch = "arm", target_abi = "eabi"))]
mod symbols;

/// Bits of a sign, of an exponent all ones, and of the hidden bit.
const SIGN: u32 = 0x8000_0000;
const HIDDEN: u32 = 0x0080_0000;
const MANTISSA: u32 = HIDDEN - 1;
/// Infinity, and twice it: beyond, but for the sign, is no number.
const INFINITY: u32 = 0x7f80_0000;
const TWICE_INFINITY: u32 = INFINITY << 1;

/// The product of two numbers by their bits; `None` where neither number nor result is ordinary.
#[inline(always)]
#[must_use]
pub fn multiplied(a: u32, b: u32) -> Option<u32> {
    let sign = (a ^ b) & SIGN;
    let [ea, eb] = [a, b].map(|x| (x >> 23) & 0xff);
    // 1 to 254 are normal numbers.
    if ea.wrapping_sub(1) >= 254 || eb.wrapping_sub(1) >= 254 {
        let zero_times_finite = (a << 1 == 0 && eb < 255) || (b << 1 == 0 && ea < 255);
        return zero_times_finite.then_some(sign);
    }
    // Hidden bits at 30 and 31: the upper word of the product begins at bit 29 or 30, and its last bit stands
    // for the lower word.
    let product =
        u64::from((HIDDEN | (a & MANTISSA)) << 7) * u64::from((HIDDEN | (b & MANTISSA)) << 8);
    let upper = (product >> 32) as u32 | u32::from(product as u32 != 0);
    let exponent = (ea + eb).wrapping_sub(126);
    let with = |exponent: u32, mantissa: u32| {
        (exponent.wrapping_sub(1) < 254).then(|| packed(sign, exponent, mantissa))
    };
    if upper < 1 << 30 {
        with(exponent.wrapping_sub(1), upper << 1)
    } else {
        with(exponent, upper)
    }
}

/// The number with the larger magnitude first.
#[inline(always)]
#[must_use]
pub fn larger_first(a: u32, b: u32) -> [u32; 2] {
    let exchange = if a << 1 < b << 1 { a ^ b } else { 0 };
    [a ^ exchange, b ^ exchange]
}

/// The sum of two numbers by their bits, the larger first; `None` where neither number nor result is ordinary.
#[inline(always)]
#[must_use]
pub fn added([a, b]: [u32; 2]) -> Option<u32> {
    let [ea, eb] = [a, b].map(|x| (x >> 23) & 0xff);
    if eb == 0 {
        // To a normal number zero adds nothing; the rest is for the compiler's.
        return (b << 1 == 0 && ea.wrapping_sub(1) < 254).then_some(a);
    }
    if ea == 255 {
        return None;
    }
    let distance = ea - eb;
    if distance > 25 {
        return Some(a);
    }
    // Hidden bits at 30: seven bits below the mantissa, one to carry, six to round by; the last stands for all
    // beyond.
    let larger = (HIDDEN | (a & MANTISSA)) << 7;
    let whole = (HIDDEN | (b & MANTISSA)) << 7;
    let shifted = whole >> distance;
    let smaller = shifted | u32::from(shifted << distance != whole);
    if ((a ^ b) as i32) >= 0 {
        let sum = larger + smaller;
        if (sum as i32) >= 0 {
            return Some(packed(a, ea, sum));
        }
        return (ea < 254).then(|| packed(a, ea + 1, (sum >> 1) | (sum & 1)));
    }
    let difference = larger - smaller;
    if difference == 0 {
        return Some(0);
    }
    let shift = difference.leading_zeros() - 1;
    (shift < ea).then(|| packed(a, ea - shift, difference << (shift & 31)))
}

/// The number with the sign of another and an exponent from 1 to 254, whose mantissa begins at bit 30 and is still to
/// be rounded.
#[inline(always)]
fn packed(sign: u32, exponent: u32, mantissa: u32) -> u32 {
    // To the nearest, ties to even. The hidden bit carries into the exponent, and so does a rounding that
    // overflows.
    let rounded = (mantissa + 0x3f + ((mantissa >> 7) & 1)) >> 7;
    (sign & SIGN) | (((exponent - 1) << 23) + rounded)
}

/// The quotient of two numbers by their bits; `None` where neither number nor result is ordinary.
#[inline(always)]
#[must_use]
pub fn divided(a: u32, b: u32) -> Option<u32> {
    let sign = (a ^ b) & SIGN;
    let [ea, eb] = [a, b].map(|x| (x >> 23) & 0xff);
    if ea.wrapping_sub(1) >= 254 || eb.wrapping_sub(1) >= 254 {
        let is_zero_by_normal = a << 1 == 0 && eb.wrapping_sub(1) < 254;
        return is_zero_by_normal.then_some(sign);
    }
    let [whole, divisor] = [a, b].map(|x| (x & MANTISSA) | HIDDEN);
    // A quotient from 1 to 2: 24 bits, in three digits of eight, since the chip divides 32 bits by 32.
    let is_less = u32::from(whole < divisor);
    let exponent = (ea + 127).wrapping_sub(eb + is_less);
    if exponent.wrapping_sub(1) >= 254 {
        return None;
    }
    let first = whole << (7 + is_less);
    let mut quotient = first / divisor;
    let mut rest = first - quotient * divisor;
    for _ in 0..2 {
        rest <<= 8;
        let digit = rest / divisor;
        rest -= digit * divisor;
        quotient = (quotient << 8) | digit;
    }
    // A quotient of two such numbers is never half way between two.
    let up = u32::from(2 * rest > divisor);
    Some(sign | (((exponent - 1) << 23) + quotient + up))
}

/// Whether the first number is less, by their bits; never where one is no number.
#[inline(always)]
#[must_use]
pub fn is_less(a: u32, b: u32) -> bool {
    if (a | b) < SIGN {
        return a < b && b <= INFINITY;
    }
    !is_unordered(a, b) && in_order(a) < in_order(b)
}

/// Whether the first number is less or equal, by their bits; never where one is no number.
#[inline(always)]
#[must_use]
pub fn is_at_most(a: u32, b: u32) -> bool {
    if (a | b) < SIGN {
        return a <= b && b <= INFINITY;
    }
    !is_unordered(a, b) && in_order(a) <= in_order(b)
}

/// Whether two numbers are equal, by their bits: zero has two signs.
#[inline(always)]
#[must_use]
pub fn is_equal(a: u32, b: u32) -> bool {
    (a == b && a << 1 <= TWICE_INFINITY) || (a | b) << 1 == 0
}

/// Whether one of the two is no number, by their bits.
#[inline(always)]
#[must_use]
pub fn is_unordered(a: u32, b: u32) -> bool {
    a << 1 > TWICE_INFINITY || b << 1 > TWICE_INFINITY
}

/// An integer for each number, in their order.
#[inline(always)]
fn in_order(x: u32) -> i32 {
    let magnitude = (x & !SIGN) as i32;
    if x < SIGN { magnitude } else { -magnitude }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of every kind: small, large, zero, subnormal, infinite, none, near powers of two.
    const SPECIAL: [u32; 22] = [
        0,
        1,
        0x007f_ffff,
        0x0080_0000,
        0x0080_0001,
        0x00ff_ffff,
        0x3f7f_ffff,
        0x3f80_0000,
        0x3f80_0001,
        0x3fff_ffff,
        0x4000_0000,
        0x3e80_0000,
        0x3400_0000,
        0x3380_0000,
        0x3300_0000,
        0x7f00_0000,
        0x7f7f_ffff,
        0x7f80_0000,
        0x7fc0_0000,
        0x1f80_0000,
        0x2000_0001,
        0x5f80_0000,
    ];

    fn check(a: u32, b: u32) -> [bool; 3] {
        let [x, y] = [a, b].map(f32::from_bits);
        let ours = [multiplied(a, b), added(larger_first(a, b)), divided(a, b)];
        let hosts = [x * y, x + y, x / y];
        for ((ours, hosts), sign) in ours.into_iter().zip(hosts).zip(['*', '+', '/']) {
            if let Some(bits) = ours {
                assert_eq!(bits, hosts.to_bits(), "{a:08x} {sign} {b:08x}");
            }
        }
        let compared = [is_less(a, b), is_at_most(a, b), is_equal(a, b)];
        assert_eq!(compared, [x < y, x <= y, x.eq(&y)], "{a:08x} {b:08x}");
        assert_eq!(is_unordered(a, b), x.is_nan() || y.is_nan());
        ours.map(|bits| bits.is_some())
    }

    #[test]
    fn what_they_give_is_what_the_host_gives() {
        for a in SPECIAL {
            for b in SPECIAL {
                for signs in 0..4 {
                    check(a ^ ((signs & 1) << 31), b ^ ((signs >> 1) << 31));
                }
            }
        }
        // Weyl's sequence, well mixed.
        let mut state = 0_u64;
        let mut next = || {
            state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
            let mixed = (state ^ (state >> 31)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
            (mixed >> 32) as u32
        };
        let mut given = [0_u32; 3];
        for _ in 0..20_000_000 {
            let (a, b, c) = (next(), next(), next());
            check(a, b);
            // Exponents near each other, and mantissas with few bits: cancellation, carries and ties.
            let near = (a & 0x807f_ffff) | (((c % 64) + 96) << 23);
            let few = (b & 0x80ff_0f00 & c) | 0x3f80_0000;
            for (a, b) in [(near, few), (few, near), (near, near ^ (c & 0x8000_0003))] {
                for (given, one) in given.iter_mut().zip(check(a, b)) {
                    *given += u32::from(one);
                }
            }
        }
        // Nothing ordinary is left to others.
        assert!(given.iter().all(|given| *given > 59_000_000), "{given:?}");
    }
}
