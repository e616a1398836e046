//! The Linköping Sensor Fusion app (Android): tab-separated lines over TCP; the phone connects to
//! port 3400 of the computer.
//!
//! Read first: `docs/wire_formats.md`, section "Sensor Fusion app". A line is
//! `time_ms TAG v1 v2 ...`: `ACC` m/s^2, `GYR` rad/s, `MAG` uT, `ORI` w, x, y, z, `PRS` hPa.

use nalgebra::Vector3;

use super::Decoded;
use super::lines::Lines;
use super::stream::Stream;
use crate::error::shown;
use crate::event::SensorKind;
use crate::stamp;

/// The port to which the app connects unless told otherwise.
pub const PORT: u16 = 3400;
/// Decimal exponent that turns milliseconds into nanoseconds.
const MILLISECONDS: i32 = 6;
/// Most values of a line.
const MOST_VALUES: usize = 4;

/// The decoder of one connection.
#[derive(Debug, Clone, Default)]
pub struct Linkoping {
    lines: Lines,
    stream: Stream,
}

impl Linkoping {
    /// Decodes the next bytes of the stream, cut anywhere.
    pub fn push(&mut self, bytes: &[u8]) -> Decoded {
        let mut out = Decoded::default();
        let too_long = self.lines.push(bytes, |text| line(text, &mut out));
        out.bad_many(
            "A line that does not end was left out: is this the Sensor Fusion app?",
            too_long,
        );
        self.stream
            .settle("choose the fastest sensor rate in the app", &mut out);
        out
    }
}

fn line(text: &[u8], out: &mut Decoded) {
    let mut fields = text.split(|&byte| byte == b'\t');
    let (time, tag) = (fields.next().unwrap_or(b""), fields.next());
    let (Some(time_ns), Some(tag)) = (stamp::parse_ns(time, MILLISECONDS), tag) else {
        out.bad("A line was left out: it does not start with a time in ms, a tab and a tag.");
        return;
    };
    let mut values = [f64::NAN; MOST_VALUES];
    let mut count = 0;
    for (value, field) in values.iter_mut().zip(fields) {
        *value = number(field);
        count += 1;
    }
    let [a, b, c, d] = values;
    let v = Vector3::new(a, b, c);
    match tag {
        b"ACC" => out.vector(time_ns, SensorKind::Accelerometer, v),
        b"GYR" => out.vector(time_ns, SensorKind::Gyroscope, v),
        b"MAG" => out.vector(time_ns, SensorKind::Magnetometer, v),
        b"RAWMAG" => out.vector(time_ns, SensorKind::MagnetometerUncalibrated, v),
        b"ORI" if count == 3 => {
            let w = (1.0 - v.norm_squared()).max(0.0).sqrt();
            out.orientation(time_ns, [w, a, b, c]);
        }
        b"ORI" => out.orientation(time_ns, [a, b, c, d]),
        // The app gives hectopascal.
        b"PRS" => out.pressure(time_ns, 100.0 * a),
        b"GPS" | b"LGT" | b"PRX" | b"TMP" | b"BAT" | b"RAWGYR" | b"RSSWIFI" | b"RSSCELL"
        | b"RSSBLE" => {}
        _ => {
            let tag = String::from_utf8_lossy(tag);
            out.info(format!("The tag {} is not used.", shown(&tag)));
        }
    }
}

/// A number; phones of some countries write a decimal comma.
fn number(field: &[u8]) -> f64 {
    std::str::from_utf8(field).map_or(f64::NAN, |text| {
        let text = text.trim();
        text.parse()
            .or_else(|_| text.replace(',', ".").parse())
            .unwrap_or(f64::NAN)
    })
}
