//! Numbers as decimal text with a fixed count of digits after the point, for tables of millions of rows.
//!
//! The general formatter of floating point numbers is exact for hundreds of digits and takes ten times as long. Here
//! a number is scaled to an integer, and the integer is written: right to half a unit of the last digit, and to rounding.

/// Scaled numbers below this are exact integers, and the half that is added to round is exact too.
const LARGEST: f64 = (1_u64 << 52) as f64;

/// Powers of ten that are exact.
const POWERS: [f64; 10] = [1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9];

/// Appends `value` with `digits` after the point (at most 9), as `{:.digits}` does but for ties, which go away from zero,
/// and for zero, which has no sign. Not finite: `NaN`, `inf`, `-inf`.
pub fn push_fixed(out: &mut Vec<u8>, value: f64, digits: usize) {
    let digits = digits.min(POWERS.len() - 1);
    let scaled = value.abs() * POWERS[digits];
    // Also false for NaN.
    if scaled < LARGEST {
        push_scaled(out, value < 0.0, (scaled + 0.5) as u64, digits);
    } else {
        out.extend_from_slice(format!("{value:.digits$}").as_bytes());
    }
}

/// Appends a time stamp (ns) as seconds with all nine digits after the point, exactly.
pub fn push_seconds(out: &mut Vec<u8>, time_ns: i64) {
    push_scaled(out, time_ns < 0, time_ns.unsigned_abs(), 9);
}

/// Appends `scaled / 10^digits`.
fn push_scaled(out: &mut Vec<u8>, negative: bool, scaled: u64, digits: usize) {
    if negative && scaled > 0 {
        out.push(b'-');
    }
    let mut buffer = itoa::Buffer::new();
    let text = buffer.format(scaled).as_bytes();
    if digits == 0 {
        out.extend_from_slice(text);
        return;
    }
    let (whole, fraction) = text.split_at(text.len().saturating_sub(digits));
    out.extend_from_slice(if whole.is_empty() { b"0" } else { whole });
    out.push(b'.');
    out.extend_from_slice(&b"000000000"[..digits - fraction.len()]);
    out.extend_from_slice(fraction);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn fixed(value: f64, digits: usize) -> String {
        let mut out = Vec::new();
        push_fixed(&mut out, value, digits);
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn numbers_look_as_the_standard_library_writes_them() {
        for (value, digits, expected) in [
            (0.0, 4, "0.0000"),
            (-0.0, 4, "0.0000"),
            (-0.000_01, 4, "0.0000"),
            (0.000_06, 4, "0.0001"),
            (-0.000_06, 4, "-0.0001"),
            (0.999_96, 4, "1.0000"),
            (12.5, 0, "13"),
            (-105.147_448_3, 9, "-105.147448300"),
            (1601.474, 3, "1601.474"),
            (f64::NAN, 4, "NaN"),
            (f64::INFINITY, 4, "inf"),
            (f64::NEG_INFINITY, 4, "-inf"),
            (1e18, 4, "1000000000000000000.0000"),
            (4_503_599_627_370_497.0, 1, "4503599627370497.0"),
        ] {
            assert_eq!(fixed(value, digits), expected, "{value} to {digits}");
        }
        assert_eq!(fixed(0.25, 40), "0.250000000", "no more than nine digits");
    }

    #[test]
    fn stamps_are_exact() {
        for (time_ns, expected) in [
            (0, "0.000000000"),
            (1, "0.000000001"),
            (-1_500_000_000, "-1.500000000"),
            (1_763_590_172_750_467_501, "1763590172.750467501"),
            (i64::MIN, "-9223372036.854775808"),
        ] {
            let mut out = Vec::new();
            push_seconds(&mut out, time_ns);
            assert_eq!(String::from_utf8(out).unwrap(), expected);
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(17), ..ProptestConfig::default() })]
        #[test]
        fn what_is_written_is_within_half_a_digit(
            value in prop_oneof![-400.0..400.0f64, -1e7..1e7f64, prop::num::f64::ANY], digits in 0_usize..10,
        ) {
            let text = fixed(value, digits);
            let standard = format!("{value:.digits$}");
            let point = |text: &str| text.find('.').map(|at| text.len() - at);
            prop_assert_eq!(point(&text), point(&standard));
            if value.is_finite() {
                let error = (text.parse::<f64>().unwrap() - value).abs();
                let rounding = value.abs() * f64::EPSILON;
                prop_assert!(error <= 0.5 * 10_f64.powi(-(digits as i32)) * (1.0 + 1e-6) + rounding, "{text} for {value}");
            } else {
                prop_assert_eq!(text, standard);
            }
        }
    }
}
