//! Text lines of a Razor 9DOF board (`#osct`, `#osrt`), in integers: acceleration, field, rate.
//!
//! The board's axes are forward, right, down, its accelerations point along gravity (ours are specific
//! forces), and 256 counts are 1 g, one count 0.06957 deg/s, ten counts 1 microtesla: the same scales
//! with which `northing` reads it. The lines have no checksum, so they are taken only whole and within
//! what the sensors can measure. Its binary frames have not even marks; they are not read here.

use crate::number::scaled;

/// Sends the calibrated sensors as text, continuously.
pub const START_COMMAND: &[u8] = b"#osct#o1";
/// Longest line, bytes.
pub const LONGEST_LINE: usize = 48;
/// Bits a second on the line.
pub const BAUD: u32 = 57_600;

/// Most counts that a sensor gives, in hundredths: 16 bits, with room for the board's calibration.
const MOST_HUNDREDTHS: i32 = 4_000_000;

/// What a line says, in the units of [`crate::sentences`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Line {
    /// Specific force, forward, right, down, 0.1 mm/s^2.
    Force([i32; 3]),
    /// Magnetic field, forward, right, down, 0.01 microtesla.
    Field([i32; 3]),
    /// Angular rate, forward, right, down, 1e-5 rad/s.
    Rate([i32; 3]),
    /// Synchronisation, or an answer: nothing is missing.
    Other,
}

/// Reads a line; `None` when it is damaged.
#[must_use]
pub fn read(line: &[u8]) -> Option<Line> {
    let values = |prefix: &[u8]| line.strip_prefix(prefix).map(three);
    if let Some(counts) = values(b"#A-C=").or_else(|| values(b"#A-R=")) {
        // 9.80665 m/s^2 are 25600 hundredths of counts, and the sign turns.
        Some(Line::Force(counts?.map(|c| rescaled(c, -980_665, 256_000))))
    } else if let Some(counts) = values(b"#M-C=").or_else(|| values(b"#M-R=")) {
        Some(Line::Field(counts?.map(|c| rescaled(c, 1, 10))))
    } else if let Some(counts) = values(b"#G-C=").or_else(|| values(b"#G-R=")) {
        // 0.06957 deg/s are 0.00121422556 rad/s.
        Some(Line::Rate(
            counts?.map(|c| rescaled(c, 1_214_226, 1_000_000)),
        ))
    } else if line.starts_with(b"#SYNCH") {
        Some(Line::Other)
    } else {
        None
    }
}

/// Three numbers with two decimals each, as the board always writes them (a lost point would make a
/// number a hundred times larger), in hundredths, and nothing behind them.
fn three(text: &[u8]) -> Option<[i32; 3]> {
    let mut fields = text.split(|byte| *byte == b',');
    let mut value = || match fields.next()? {
        field @ [.., b'.', _, _] => scaled(field, 2).filter(|v| v.abs() <= MOST_HUNDREDTHS),
        _ => None,
    };
    let three = [value()?, value()?, value()?];
    fields.next().is_none().then_some(three)
}

/// `value * numerator / denominator`, rounded to the nearest; the results here fit.
fn rescaled(value: i32, numerator: i32, denominator: i32) -> i32 {
    let product = i64::from(value) * i64::from(numerator);
    let half = i64::from(denominator / 2);
    let shifted = if product < 0 {
        product - half
    } else {
        product + half
    };
    shifted.checked_div(i64::from(denominator)).unwrap_or(0) as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_board_at_rest_reads_as_a_host_reads_it() {
        assert_eq!(
            read(b"#A-C=-0.00,-0.00,256.00"),
            Some(Line::Force([0, 0, -98_067]))
        );
        assert_eq!(
            read(b"#M-C=220.00,0.00,-420.15"),
            Some(Line::Field([2200, 0, -4202]))
        );
        assert_eq!(
            read(b"#G-C=100.00,-0.50,0.00"),
            Some(Line::Rate([12_142, -61, 0]))
        );
        assert_eq!(
            read(b"#A-R=1.00,2.00,3.00"),
            Some(Line::Force([-383, -766, -1149]))
        );
        assert_eq!(read(b"#SYNCH00"), Some(Line::Other));
    }

    #[test]
    fn damaged_lines_are_refused() {
        let damaged: [&[u8]; 10] = [
            b"#A-C=1.00,2.00",
            b"#A-C=1.00,2.00,",
            b"#A-C=1.00,2.00,3.00,4.00",
            b"#A-C=1.00,2.00,3.0\xb00",
            b"#A-C=1.00,2.00,99999999.00",
            b"#A-C=1.00,40000.01,0.00",
            b"#G-C=1.00,13552,3.00",
            b"#A-X=1.00,2.00,3.00",
            b"A-C=1.00,2.00,3.00",
            b"#YPR=1.00,2.00,3.00",
        ];
        for line in damaged {
            assert_eq!(read(line), None, "{}", line.escape_ascii());
        }
    }
}
