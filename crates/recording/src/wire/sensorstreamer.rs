//! SensorStreamer (Android): a JSON object a line over TCP, the sensors side by side.
//!
//! Read first: `docs/wire_formats.md`, section "SensorStreamer". Every sensor has its own stamp in
//! nanoseconds since the phone started; Android's units and axes.

use super::lines::Lines;
use super::stream::Stream;
use super::{Decoded, json};
use crate::error::shown;
use crate::event::SensorKind;

/// The decoder of one connection.
#[derive(Debug, Clone, Default)]
pub struct SensorStreamer {
    lines: Lines,
    stream: Stream,
}

impl SensorStreamer {
    /// Decodes the next bytes of the stream, cut anywhere.
    pub fn push(&mut self, bytes: &[u8]) -> Decoded {
        let mut out = Decoded::default();
        let too_long = self.lines.push(bytes, |text| object(text, &mut out));
        out.bad_many("A line that does not end was left out.", too_long);
        self.stream
            .settle("set the sampling period to 10 ms in the app", &mut out);
        out
    }
}

fn object(text: &[u8], out: &mut Decoded) {
    let object = match json::object(text) {
        Ok(object) => object,
        Err(error) => return out.bad(error.to_string()),
    };
    for (name, reading) in &object {
        let values = json::array(reading.get("value"));
        let Some(time_ns) = json::stamp_ns(reading.get("timestamp")) else {
            out.bad(format!(
                "A reading of {} was left out: it has no `timestamp`.",
                shown(name)
            ));
            continue;
        };
        match name.as_str() {
            "accelerometer" => {
                out.vector(time_ns, SensorKind::Accelerometer, json::vector(values, 0));
            }
            "gyroscope" => out.vector(time_ns, SensorKind::Gyroscope, json::vector(values, 0)),
            "magneticField" => {
                out.vector(time_ns, SensorKind::Magnetometer, json::vector(values, 0));
            }
            "rotationVector" => {
                let [x, y, z, w] = json::numbers::<4>(values, 0);
                out.orientation(time_ns, [w, x, y, z]);
            }
            _ => out.info(format!("The sensor {} is not used.", shown(name))),
        }
    }
}
