//! Addition, subtraction and multiplication in single precision for chips without a floating point
//! unit, in half the instructions of the compiler's own.
//!
//! On a Cortex-M3 two thirds of a filter's instructions are these three. An image that names this crate
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
    // 24 bits by 24 bits, the first shifted to the top: the product's upper word has 23 or 24 of its bits.
    let product = u64::from((a << 8) | SIGN) * u64::from((b & MANTISSA) | HIDDEN);
    let (mut high, mut low) = ((product >> 32) as u32, product as u32);
    let mut exponent = (ea + eb).wrapping_sub(127);
    if high < HIDDEN {
        high = (high << 1) | (low >> 31);
        low <<= 1;
        exponent = exponent.wrapping_sub(1);
    }
    // `high` is the mantissa with its hidden bit, `low` what is cut off.
    exponent = exponent.wrapping_add(1);
    if exponent.wrapping_sub(1) >= 254 {
        return None;
    }
    // The hidden bit carries into the exponent, and so does a rounding that overflows.
    let cut = ((exponent - 1) << 23) + high;
    let up = low > SIGN || (low == SIGN && high & 1 == 1);
    Some(sign | (cut + u32::from(up)))
}

/// The sum of two numbers by their bits; `None` where neither number nor result is ordinary.
#[inline(always)]
#[must_use]
pub fn added(a: u32, b: u32) -> Option<u32> {
    // The larger first.
    let (a, b) = if a << 1 < b << 1 { (b, a) } else { (a, b) };
    let [ea, eb] = [a, b].map(|x| (x >> 23) & 0xff);
    if ea.wrapping_sub(1) >= 254 || eb == 0 {
        // To a normal number zero adds nothing; the rest is for the compiler's.
        return (b << 1 == 0 && ea.wrapping_sub(1) < 254).then_some(a);
    }
    let distance = ea - eb;
    if distance > 25 {
        return Some(a);
    }
    // Seven bits below the mantissa: one to carry, six to round by; the last stands for all beyond.
    let larger = ((a & MANTISSA) | HIDDEN) << 7;
    let whole = ((b & MANTISSA) | HIDDEN) << 7;
    let shifted = whole >> distance;
    let smaller = shifted | u32::from(shifted << distance != whole);
    let (sum, exponent) = if (a ^ b) & SIGN == 0 {
        let sum = larger + smaller;
        if sum >= SIGN {
            ((sum >> 1) | (sum & 1), ea + 1)
        } else {
            (sum, ea)
        }
    } else {
        let sum = larger - smaller;
        if sum == 0 {
            return Some(0);
        }
        let shift = sum.leading_zeros() - 1;
        if shift >= ea {
            return None;
        }
        (sum << shift, ea - shift)
    };
    if exponent >= 255 {
        return None;
    }
    let mantissa = sum >> 7;
    let cut = sum & 0x7f;
    let up = cut > 0x40 || (cut == 0x40 && mantissa & 1 == 1);
    Some((a & SIGN) | (((exponent - 1) << 23) + mantissa + u32::from(up)))
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

    fn check(a: u32, b: u32) -> [bool; 2] {
        let [x, y] = [a, b].map(f32::from_bits);
        let ours = [multiplied(a, b), added(a, b)];
        for ((ours, hosts), sign) in ours.into_iter().zip([x * y, x + y]).zip(['*', '+']) {
            if let Some(bits) = ours {
                assert_eq!(bits, hosts.to_bits(), "{a:08x} {sign} {b:08x}");
            }
        }
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
        let mut given = [0_u32; 2];
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
