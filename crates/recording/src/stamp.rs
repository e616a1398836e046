//! Time stamps between text and integer nanoseconds, exactly: never through a floating-point number.

use chrono::{DateTime, NaiveDateTime};

/// Decimal exponent that turns seconds into nanoseconds.
pub(crate) const SECONDS: i32 = 9;
/// Decimal exponent that turns microseconds into nanoseconds.
pub(crate) const MICROSECONDS: i32 = 3;
/// Decimal exponent that turns nanoseconds into nanoseconds.
pub(crate) const NANOSECONDS: i32 = 0;

/// Largest stamp magnitude that is accepted, s: differences of two such stamps fit in `i64` nanoseconds.
const LIMIT_S: f64 = 4.6e9;

/// Nanoseconds of the decimal number `text` times `10^exponent`, rounded to the nearest.
/// `None` when it is not a number or does not fit.
pub(crate) fn parse_ns(text: &[u8], exponent: i32) -> Option<i64> {
    let text = text.trim_ascii();
    let (negative, digits) = match text.first()? {
        b'-' => (true, &text[1..]),
        b'+' => (false, &text[1..]),
        _ => (false, text),
    };
    let decimal = Decimal::parse(digits)?;
    let magnitude = decimal.scaled(exponent)?;
    // Stamps beyond this could overflow a difference of two of them.
    if magnitude > i64::MAX as u64 / 2 {
        return None;
    }
    let value = i64::try_from(magnitude).ok()?;
    Some(if negative { -value } else { value })
}

/// How dates and times of day are written without a zone. Years stand first or months are named, so that no day can be
/// taken for a month; with points between them the day does (`01.08.2014`).
const DATES: [&str; 4] = [
    "%Y-%m-%dT%H:%M:%S%.f",
    "%Y/%m/%dT%H:%M:%S%.f",
    "%d-%b-%YT%H:%M:%S%.f",
    "%d.%m.%YT%H:%M:%S%.f",
];

/// Nanoseconds since 1970 of a date and a time of day: `2014-08-01T00:00:00.186Z`, with a blank for the
/// `T`, with another zone or without one (UTC), `2014/08/01 00:00:00.186`, `01-Aug-2014 00:00:00.186` or `01.08.2014 00:00:00.186`.
pub(crate) fn parse_date_time(text: &[u8]) -> Option<i64> {
    /// More characters have no part in a time.
    const LONGEST: usize = 48;
    let text = std::str::from_utf8(text).ok()?.trim();
    if text.len() > LONGEST {
        return None;
    }
    let text = text.replacen(' ', "T", 1);
    let ns = DateTime::parse_from_rfc3339(&text).map_or_else(
        |_| {
            let read = |form| NaiveDateTime::parse_from_str(&text, form).ok();
            let plain = DATES.into_iter().find_map(read)?;
            plain.and_utc().timestamp_nanos_opt()
        },
        |date| date.timestamp_nanos_opt(),
    )?;
    (ns.unsigned_abs() <= i64::MAX as u64 / 2).then_some(ns)
}

/// Nanoseconds since midnight of a time of day: `23:59:59.5`.
pub(crate) fn parse_time_of_day(text: &[u8]) -> Option<i64> {
    let text = text.trim_ascii();
    if !text.contains(&b':') {
        return None;
    }
    parse_date_time(&[b"1970-01-01 ", text].concat())
}

/// `mantissa * 10^exponent`; digits beyond the nineteenth are cut, which is below a nanosecond for
/// any stamp that fits.
struct Decimal {
    mantissa: u64,
    exponent: i32,
}

impl Decimal {
    fn parse(text: &[u8]) -> Option<Self> {
        const ROOM: u64 = (u64::MAX - 9) / 10;
        let (mut mantissa, mut exponent) = (0_u64, 0_i32);
        let (mut seen_digit, mut seen_point) = (false, false);
        for (index, &byte) in text.iter().enumerate() {
            match byte {
                b'0'..=b'9' => {
                    seen_digit = true;
                    if mantissa <= ROOM {
                        mantissa = mantissa * 10 + u64::from(byte - b'0');
                        exponent -= i32::from(seen_point);
                    } else {
                        exponent = exponent.checked_add(i32::from(!seen_point))?;
                    }
                }
                b'.' if !seen_point => seen_point = true,
                b'e' | b'E' if seen_digit => {
                    let written: i32 =
                        std::str::from_utf8(&text[index + 1..]).ok()?.parse().ok()?;
                    exponent = exponent.checked_add(written)?;
                    return Some(Self { mantissa, exponent });
                }
                _ => return None,
            }
        }
        seen_digit.then_some(Self { mantissa, exponent })
    }

    /// `self * 10^shift`, rounded half away from zero.
    fn scaled(&self, shift: i32) -> Option<u64> {
        if self.mantissa == 0 {
            return Some(0);
        }
        let exponent = self.exponent.checked_add(shift)?;
        let power = 10_u64.checked_pow(exponent.unsigned_abs());
        if exponent >= 0 {
            return self.mantissa.checked_mul(power?);
        }
        // 10^20 and more: smaller than half a nanosecond whatever the mantissa.
        let Some(power) = power else { return Some(0) };
        let (quotient, rest) = (self.mantissa / power, self.mantissa % power);
        Some(quotient + u64::from(rest >= power - rest))
    }
}

/// Nanoseconds of a stamp in floating-point seconds, rounded to the nearest; `None` when it is not
/// finite or too large.
#[cfg_attr(not(feature = "parquet"), allow(dead_code))]
pub(crate) fn from_seconds(seconds: f64) -> Option<i64> {
    // `as` is exact here: the product is far inside i64.
    (seconds.abs() <= LIMIT_S).then(|| (seconds * 1e9).round() as i64)
}

/// `nanoseconds` as decimal seconds, exact, without trailing zeros (at least one decimal place).
pub(crate) fn format_s(nanoseconds: i64) -> String {
    let sign = if nanoseconds < 0 { "-" } else { "" };
    let magnitude = nanoseconds.unsigned_abs();
    let (whole, fraction) = (magnitude / 1_000_000_000, magnitude % 1_000_000_000);
    let digits = format!("{fraction:09}");
    let trimmed = digits.trim_end_matches('0');
    format!(
        "{sign}{whole}.{}",
        if trimmed.is_empty() { "0" } else { trimmed }
    )
}

#[cfg(test)]
mod tests {
    use super::{
        NANOSECONDS, SECONDS, format_s, from_seconds, parse_date_time, parse_ns, parse_time_of_day,
    };
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    #[test]
    fn decimal_seconds_are_exact_where_a_float_is_not() {
        let text = b"1763697600.123456789";
        assert_eq!(parse_ns(text, SECONDS), Some(1_763_697_600_123_456_789));
        assert_eq!(
            parse_ns(b"1763697600000000001", NANOSECONDS),
            Some(1_763_697_600_000_000_001)
        );
    }

    #[test]
    fn all_decimal_notations() {
        for (text, expected) in [
            ("0", Some(0)),
            ("-1.5", Some(-1_500_000_000)),
            ("+2", Some(2_000_000_000)),
            (" .25 ", Some(250_000_000)),
            ("3.", Some(3_000_000_000)),
            ("1e-3", Some(1_000_000)),
            ("1.5E+1", Some(15_000_000_000)),
            ("0.0000000005", Some(1)),
            ("0.00000000049", Some(0)),
            ("1.00000000000000000000000000000", Some(1_000_000_000)),
            ("0e99999", Some(0)),
            ("1e-99999", Some(0)),
            ("", None),
            (".", None),
            ("-", None),
            ("nan", None),
            ("inf", None),
            ("1e", None),
            ("e5", None),
            ("1.2.3", None),
            ("12:00", None),
            ("1e30", None),
            ("99999999999999999999", None),
            ("1e99999999999", None),
        ] {
            assert_eq!(parse_ns(text.as_bytes(), SECONDS), expected, "{text}");
        }
    }

    #[test]
    fn dates_with_and_without_a_zone() {
        for text in [
            "2014-08-01T00:00:00.186Z",
            "2014-08-01 00:00:00.186",
            "2014-08-01T02:00:00.186+02:00",
            "2014-08-01 00:00:00.186000+00:00",
            "2014/08/01 00:00:00.186",
            "01-Aug-2014 00:00:00.186",
            "01.08.2014 00:00:00.186",
        ] {
            let ns = parse_date_time(text.as_bytes());
            assert_eq!(ns, Some(1_406_851_200_186_000_000), "{text}");
        }
        for text in [
            "",
            "2014-08-01",
            "00:00:00",
            "2014-13-01T00:00:00Z",
            "9999-01-01T00:00:00Z",
            "01/08/2014 00:00:00",
        ] {
            assert_eq!(parse_date_time(text.as_bytes()), None, "{text}");
        }
        assert_eq!(parse_time_of_day(b" 23:59:59.5 "), Some(86_399_500_000_000));
        for text in ["", "12", "24:00:00", "01.08.2014 12:00:00"] {
            assert_eq!(parse_time_of_day(text.as_bytes()), None, "{text}");
        }
    }

    #[test]
    fn floating_stamps_round_to_the_nearest_nanosecond() {
        assert_eq!(from_seconds(0.1), Some(100_000_000));
        assert_eq!(from_seconds(f64::NAN), None);
        assert_eq!(from_seconds(f64::INFINITY), None);
        assert_eq!(from_seconds(1e18), None);
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(0x71),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        #[test]
        fn written_stamps_read_back(ns in -(i64::MAX / 2)..(i64::MAX / 2)) {
            prop_assert_eq!(parse_ns(format_s(ns).as_bytes(), SECONDS), Some(ns));
        }

        #[test]
        fn arbitrary_bytes_never_panic(text in proptest::collection::vec(any::<u8>(), 0..40), exponent in -3..10_i32) {
            let _ = parse_ns(&text, exponent);
            let _ = parse_date_time(&text);
        }
    }
}
