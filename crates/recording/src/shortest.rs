//! Numbers as the shortest decimal text that reads back exactly, for tables of millions of rows: what `{}` writes, by a quicker algorithm.

/// Appends `value` as `{}` writes it: without an exponent, and without a point where there is nothing behind it.
pub fn push_shortest(out: &mut Vec<u8>, value: f64) {
    let mut buffer = zmij::Buffer::new();
    let text = buffer.format(value);
    match text.split_once('e') {
        None => out.extend_from_slice(text.strip_suffix(".0").unwrap_or(text).as_bytes()),
        Some((digits, exponent)) => match exponent.parse() {
            Ok(exponent) => push_shifted(out, digits, exponent),
            Err(_) => out.extend_from_slice(format!("{value}").as_bytes()),
        },
    }
}

/// Appends `digits`, one of them before the point, times a power of ten.
fn push_shifted(out: &mut Vec<u8>, digits: &str, exponent: i32) {
    let (sign, digits) = match digits.strip_prefix('-') {
        Some(digits) => ("-", digits),
        None => ("", digits),
    };
    let (first, rest) = digits.split_once('.').unwrap_or((digits, ""));
    let places = exponent.unsigned_abs() as usize;
    out.extend_from_slice(sign.as_bytes());
    if exponent < 0 {
        out.extend_from_slice(b"0.");
        out.resize(out.len() + places - 1, b'0');
        out.extend_from_slice(first.as_bytes());
        out.extend_from_slice(rest.as_bytes());
        return;
    }
    out.extend_from_slice(first.as_bytes());
    let (whole, fraction) = rest.split_at(rest.len().min(places));
    out.extend_from_slice(whole.as_bytes());
    out.resize(out.len() + places - whole.len(), b'0');
    if !fraction.is_empty() {
        out.push(b'.');
        out.extend_from_slice(fraction.as_bytes());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn shortest(value: f64) -> String {
        let mut out = Vec::new();
        push_shortest(&mut out, value);
        String::from_utf8(out).unwrap()
    }

    #[test]
    fn numbers_look_as_the_standard_library_writes_them() {
        let near_one = [1.0, 0.1, 0.5, 123.456, 1e-4, 9.999_999e-5, 1e-5, 1.5e-7];
        let ends = [f64::MAX, f64::MIN_POSITIVE, 5e-324, f64::EPSILON];
        let large = [
            1e15,
            1e16,
            1.234_567_890_123_456_7e16,
            1e17,
            1.5e20,
            1e22,
            1e23,
        ];
        let special = [0.0, f64::NAN, f64::INFINITY];
        for value in near_one.into_iter().chain(ends).chain(large).chain(special) {
            assert_eq!(shortest(value), format!("{value}"));
            assert_eq!(shortest(-value), format!("{}", -value));
        }
        let without_a_point = [
            (3.25e0, 2, "325"),
            (3.25e0, 1, "32.5"),
            (3.25e0, 5, "325000"),
        ];
        for (digits, exponent, expected) in without_a_point {
            let mut out = Vec::new();
            push_shifted(&mut out, &digits.to_string(), exponent);
            assert_eq!(out, expected.as_bytes());
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 4000, rng_seed: proptest::test_runner::RngSeed::Fixed(31), ..ProptestConfig::default() })]

        #[test]
        fn of_any_bits(bits in any::<u64>()) {
            let value = f64::from_bits(bits);
            prop_assert_eq!(shortest(value), format!("{value}"));
        }

        #[test]
        fn of_what_sensors_measure(value in -1e3..1e3_f64, power in -12..4_i32) {
            let value = value * 10_f64.powi(power);
            prop_assert_eq!(shortest(value), format!("{value}"));
        }
    }
}
