//! Quantities on the command line: a number and its unit, such as `3deg` or `2.5m`.

/// An angle in rad from `3deg` or `0.05rad`; not negative.
pub(crate) fn angle(text: &str) -> Result<f64, String> {
    quantity(text, &[("deg", 1_f64.to_radians()), ("rad", 1.0)])
}

/// A length in m from `3m` or `0.2km`; not negative.
pub(crate) fn length(text: &str) -> Result<f64, String> {
    quantity(text, &[("km", 1e3), ("m", 1.0)])
}

fn quantity(text: &str, units: &[(&str, f64)]) -> Result<f64, String> {
    let found = units
        .iter()
        .find_map(|(unit, factor)| Some((text.trim().strip_suffix(unit)?, factor)));
    let names: Vec<&str> = units.iter().map(|(unit, _)| *unit).collect();
    let Some((number, factor)) = found else {
        return Err(format!(
            "`{text}` has no unit; write a number and {}",
            names.join(" or ")
        ));
    };
    let value = number.trim().parse::<f64>().ok().filter(|v| v.is_finite());
    match value {
        Some(value) if value >= 0.0 => Ok(value * factor),
        Some(_) => Err(format!("`{text}` is negative; a standard deviation is not")),
        None => Err(format!("`{number}` in `{text}` is not a number")),
    }
}

#[cfg(test)]
mod tests {
    use super::{angle, length};

    #[test]
    fn units_are_read_and_nothing_else() {
        assert!((angle("180deg").unwrap() - std::f64::consts::PI).abs() < 1e-12);
        assert!((angle(" 0.5 rad").unwrap() - 0.5).abs() < 1e-12);
        assert!((length("2.5m").unwrap() - 2.5).abs() < 1e-12);
        assert!((length("1km").unwrap() - 1000.0).abs() < 1e-9);
        for bad in ["3", "deg", "-3deg", "nandeg", "infrad", "3m", "1e999deg"] {
            assert!(angle(bad).is_err(), "{bad}");
        }
        assert!(length("3deg").unwrap_err().contains("km or m"));
    }
}
