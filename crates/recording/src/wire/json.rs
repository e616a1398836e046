//! Lenient access to JSON: a value that is not what it should be is a missing number, not an error.

use nalgebra::Vector3;
use serde_json::{Map, Value};

use super::{LONGEST_BATCH_BYTES, WireError};
use crate::error::shown;
use crate::stamp;

/// The object that a message is.
pub(super) fn object(bytes: &[u8]) -> Result<Map<String, Value>, WireError> {
    limited_object(bytes, LONGEST_BATCH_BYTES)
}

/// The object that a message of at most `most` bytes is.
pub(super) fn limited_object(bytes: &[u8], most: usize) -> Result<Map<String, Value>, WireError> {
    if bytes.len() > most {
        return Err(WireError::new(format!(
            "the message has {} bytes; at most {most} are read",
            bytes.len()
        )));
    }
    match serde_json::from_slice(bytes) {
        Ok(Value::Object(object)) => Ok(object),
        Ok(_) => Err(WireError::new(
            "the message is JSON but not an object {...}",
        )),
        Err(error) => Err(WireError::new(format!(
            "the message is not JSON: {}",
            shown(&error.to_string())
        ))),
    }
}

/// A number, NaN when it is missing or something else.
pub(super) fn number(value: Option<&Value>) -> f64 {
    value.and_then(Value::as_f64).unwrap_or(f64::NAN)
}

/// `N` numbers of an array from `start`, NaN where missing.
pub(super) fn numbers<const N: usize>(row: &[Value], start: usize) -> [f64; N] {
    std::array::from_fn(|index| number(row.get(start + index)))
}

/// Three numbers of an array from `start`, NaN where missing.
pub(super) fn vector(row: &[Value], start: usize) -> Vector3<f64> {
    Vector3::from(numbers::<3>(row, start))
}

/// The numbers of an object's `x`, `y`, `z`, NaN where missing.
pub(super) fn xyz(object: &Value) -> Vector3<f64> {
    Vector3::new(
        number(object.get("x")),
        number(object.get("y")),
        number(object.get("z")),
    )
}

/// The elements of an array; of anything else none.
pub(super) fn array(value: Option<&Value>) -> &[Value] {
    value.and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

/// The text of a string or the digits of a number, as it may be shown; empty when missing.
pub(super) fn text(value: Option<&Value>) -> String {
    match value {
        Some(Value::String(text)) => shown(text),
        Some(Value::Number(number)) => number.to_string(),
        _ => String::new(),
    }
}

/// An integer count of nanoseconds, exact beyond 2^53; also as digits in a string.
pub(super) fn stamp_ns(value: Option<&Value>) -> Option<i64> {
    match value? {
        Value::Number(number) => match number.as_i64() {
            Some(ns) => plausible_ns(ns),
            None => stamp::from_seconds(number.as_f64()? * 1e-9),
        },
        Value::String(digits) => stamp::parse_ns(digits.as_bytes(), stamp::NANOSECONDS),
        _ => None,
    }
}

/// Nanoseconds of a stamp in milliseconds, with or without a fraction.
pub(super) fn stamp_ms(value: Option<&Value>) -> Option<i64> {
    let number = value?;
    match number.as_i64() {
        Some(ms) => plausible_ns(ms.checked_mul(1_000_000)?),
        None => stamp::from_seconds(number.as_f64()? * 1e-3),
    }
}

/// Differences of two stamps must fit.
fn plausible_ns(ns: i64) -> Option<i64> {
    (ns.unsigned_abs() <= i64::MAX as u64 / 2).then_some(ns)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn nanoseconds_are_exact_beyond_two_to_the_53() {
        let exact = 1_763_697_600_000_000_001_i64;
        assert_eq!(stamp_ns(Some(&json!(exact))), Some(exact));
        assert_eq!(stamp_ns(Some(&json!(exact.to_string()))), Some(exact));
        assert_eq!(stamp_ns(Some(&json!(1.5e9))), Some(1_500_000_000));
        for bad in [
            json!(u64::MAX),
            json!(i64::MAX),
            json!(1e30),
            json!(null),
            json!([1]),
        ] {
            assert_eq!(stamp_ns(Some(&bad)), None, "{bad}");
        }
    }

    #[test]
    fn milliseconds_may_have_a_fraction() {
        assert_eq!(stamp_ms(Some(&json!(1216.7))), Some(1_216_700_000));
        assert_eq!(
            stamp_ms(Some(&json!(1_763_697_600_000_i64))),
            Some(1_763_697_600_000_000_000)
        );
        assert_eq!(stamp_ms(Some(&json!(i64::MAX))), None);
        assert_eq!(stamp_ms(Some(&json!("12"))), None);
    }

    #[test]
    fn what_is_no_object_is_said() {
        for (bytes, expected) in [
            (&b"[1]"[..], "not an object"),
            (b"{\"a\":", "not JSON"),
            (b"\xff\xfe", "not JSON"),
        ] {
            let error = object(bytes).unwrap_err();
            assert!(error.problem.contains(expected), "{error}");
        }
        let long = vec![b' '; LONGEST_BATCH_BYTES + 1];
        assert!(object(&long).unwrap_err().problem.contains("at most"));
    }
}
