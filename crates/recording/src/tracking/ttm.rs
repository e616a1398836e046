//! `TTM`, a target that a radar follows: range and bearing from the own ship, as a sentence of NMEA 0183.
//!
//! The `nmea` crate checks the sentence; its angle cannot be read from outside, so the fields are taken here.

use nmea::SentenceType;

/// Metres of a nautical mile, a kilometre and a statute mile.
pub(super) const NAUTICAL_MILE_M: f64 = 1852.0;
const KILOMETRE_M: f64 = 1000.0;
const STATUTE_MILE_M: f64 = 1609.344;

/// Where a radar sees a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct RadarTarget {
    /// Distance from the own ship, m.
    pub(super) range_m: f64,
    /// Clockwise from north, or from the bow, rad.
    pub(super) bearing_rad: f64,
    /// Whether the bearing counts from the bow.
    pub(super) from_bow: bool,
}

/// The target of a sentence; `None` when it is another sentence, or its target was lost. An error is a sentence that says nothing.
pub(super) fn parse(text: &str) -> Result<Option<RadarTarget>, ()> {
    let Ok(sentence) = nmea::parse_nmea_sentence(text) else {
        return Ok(None);
    };
    if sentence.message_id != SentenceType::TTM {
        return Ok(None);
    }
    if sentence.checksum != sentence.calc_checksum() {
        return Err(());
    }
    let fields: Vec<&str> = sentence.data.split(',').map(str::trim).collect();
    let field = |index: usize| fields.get(index).copied().unwrap_or_default();
    if field(11) == "L" {
        return Ok(None);
    }
    let number = |index: usize| field(index).parse::<f64>().map_err(drop);
    let unit_m = match field(9) {
        "N" | "" => NAUTICAL_MILE_M,
        "K" => KILOMETRE_M,
        "S" => STATUTE_MILE_M,
        _ => return Err(()),
    };
    let from_bow = match field(3) {
        "T" => false,
        "R" => true,
        _ => return Err(()),
    };
    let (range_m, bearing_rad) = (number(1)? * unit_m, number(2)?.to_radians());
    if !(range_m.is_finite() && range_m > 0.0 && bearing_rad.is_finite()) {
        return Err(());
    }
    Ok(Some(RadarTarget {
        range_m,
        bearing_rad,
        from_bow,
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_checksum(body: &str) -> String {
        let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
        format!("${body}*{sum:02X}")
    }

    fn parsed(body: &str) -> Result<Option<RadarTarget>, ()> {
        parse(&with_checksum(body))
    }

    #[test]
    fn a_target_in_each_unit_from_north_and_from_the_bow() {
        let seen = parsed("RATTM,01,0.2,190.8,T,12.1,109.7,T,0.1,0.5,N,TGT01,T,,100021.00,A");
        let seen = seen.unwrap().unwrap();
        assert!((seen.range_m - 370.4).abs() < 1e-9 && !seen.from_bow);
        assert!((seen.bearing_rad.to_degrees() - 190.8).abs() < 1e-9);
        let range = |unit: &str| {
            let body = format!("RATTM,01,2,10,R,,,,,,{unit},,Q,,,");
            let seen = parsed(&body).unwrap().unwrap();
            assert!(seen.from_bow);
            seen.range_m
        };
        for (unit, range_m) in [("", 3704.0), ("K", 2000.0), ("S", 3218.688)] {
            assert!((range(unit) - range_m).abs() < 1e-9, "{unit}");
        }
    }

    #[test]
    fn lost_targets_and_other_sentences_say_nothing_and_broken_ones_are_wrong() {
        assert_eq!(parsed("RATTM,01,2,10,T,,,,,,N,,L,,,"), Ok(None));
        assert_eq!(parsed("GPRMC,130211.00,A,,,,,,,120116,,,A"), Ok(None));
        for body in [
            "RATTM,01,-2,10,T,,,,,,N,,T,,,",
            "RATTM,01,inf,10,T,,,,,,N,,T,,,",
            "RATTM,01,2,NaN,T,,,,,,N,,T,,,",
            "RATTM,01,2,10,,,,,,,N,,T,,,",
            "RATTM,01,2,10,T,,,,,,X,,T,,,",
            "RATTM,01,,,T,,,,,,N,,T,,,",
        ] {
            assert_eq!(parsed(body), Err(()), "{body}");
        }
        let good = with_checksum("RATTM,01,2,10,T,,,,,,N,,T,,,");
        assert_eq!(parse(&good.replace(",2,", ",3,")), Err(()));
    }
}
