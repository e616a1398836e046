//! Decimal numbers of text as integers: no floating point, no allocation, nothing that can panic.

/// The value of `text` times `10^places`, rounded to the nearest; `None` unless it is a number (a
/// sign, digits, at most one point) that fits.
#[must_use]
pub fn scaled(text: &[u8], places: u32) -> Option<i32> {
    let (negative, digits) = match text {
        [b'-', rest @ ..] => (true, rest),
        [b'+', rest @ ..] => (false, rest),
        all => (false, all),
    };
    let mut value = 0_i32;
    let mut seen = false;
    // Places still wanted, once the point has come.
    let mut wanted = None;
    for byte in digits {
        match (byte, wanted) {
            (b'0'..=b'9', Some(0)) => {
                // The first digit beyond the last place rounds; those behind it do not count.
                value = value.checked_add(i32::from(*byte >= b'5'))?;
                wanted = Some(u32::MAX);
            }
            (b'0'..=b'9', Some(u32::MAX)) => {}
            (b'0'..=b'9', _) => {
                value = value
                    .checked_mul(10)?
                    .checked_add(i32::from(*byte - b'0'))?;
                wanted = wanted.map(|places| places - 1);
                seen = true;
            }
            (b'.', None) => wanted = Some(places),
            _ => return None,
        }
    }
    let missing = match wanted {
        Some(u32::MAX) => 0,
        Some(missing) => missing,
        None => places,
    };
    for _ in 0..missing {
        value = value.checked_mul(10)?;
    }
    seen.then_some(if negative { -value } else { value })
}

/// A whole number without sign, of at most nine digits.
#[must_use]
pub fn whole(text: &[u8]) -> Option<u32> {
    if text.is_empty() || text.len() > 9 {
        return None;
    }
    text.iter().try_fold(0_u32, |value, byte| {
        let digit = byte.checked_sub(b'0').filter(|digit| *digit < 10)?;
        value.checked_mul(10)?.checked_add(u32::from(digit))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decimals_are_scaled_and_rounded() {
        for (text, places, value) in [
            ("12.34", 2, 1234),
            ("-12.345", 2, -1235),
            ("+0.004", 2, 0),
            ("7", 3, 7000),
            ("7.", 1, 70),
            ("-.5", 1, -5),
            ("0.99999", 2, 100),
            ("214748364.7", 1, i32::MAX),
        ] {
            assert_eq!(scaled(text.as_bytes(), places), Some(value), "{text}");
        }
    }

    #[test]
    fn what_is_no_number_or_too_large_is_none() {
        for text in [
            "",
            "-",
            ".",
            "1.2.3",
            "1e3",
            "1,2",
            "--1",
            " 1",
            "214748364.8",
            "99999999999",
        ] {
            assert_eq!(scaled(text.as_bytes(), 1), None, "{text}");
        }
        assert_eq!(whole(b"0042"), Some(42));
        for text in ["", "-1", "1.0", "1234567890"] {
            assert_eq!(whole(text.as_bytes()), None, "{text}");
        }
    }
}
