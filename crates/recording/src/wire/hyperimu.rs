//! HyperIMU (Android): comma-separated lines over UDP or TCP, or a JSON object a line.
//!
//! Read first: `docs/wire_formats.md`, section "HyperIMU". A line is
//! `timestamp_ms,v1,v2,...`, three values a sensor in the order in which the user switched them on;
//! the JSON names them. Android's units and axes.

use nalgebra::Vector3;
use serde_json::Value;

use super::lines::Lines;
use super::stream::Stream;
use super::{Decoded, json};
use crate::event::SensorKind;
use crate::stamp;

/// Decimal exponent that turns milliseconds into nanoseconds.
const MILLISECONDS: i32 = 6;

/// The decoder of one device.
#[derive(Debug, Clone)]
pub struct HyperImu {
    order: Vec<SensorKind>,
    lines: Lines,
    stream: Stream,
}

impl HyperImu {
    /// A decoder for vector sensors in the order of the app's list.
    #[must_use]
    pub fn with_order(order: &[SensorKind]) -> Self {
        Self {
            order: order.to_vec(),
            lines: Lines::default(),
            stream: Stream::default(),
        }
    }

    /// Decodes one datagram, whether or not its last line is ended.
    pub fn push_datagram(&mut self, bytes: &[u8]) -> Decoded {
        let mut ended = bytes.to_vec();
        ended.push(b'\n');
        self.push(&ended)
    }

    /// Decodes the next bytes of a stream of lines, cut anywhere.
    pub fn push(&mut self, bytes: &[u8]) -> Decoded {
        let mut out = Decoded::default();
        let order = &self.order;
        let too_long = self.lines.push(bytes, |text| {
            if text.starts_with(b"{") {
                object(text, &mut out);
            } else {
                line(text, order, &mut out);
            }
        });
        out.bad_many("A line that does not end was left out.", too_long);
        self.stream
            .settle("set the sampling rate to 10 ms in the app", &mut out);
        out
    }
}

impl Default for HyperImu {
    fn default() -> Self {
        Self::with_order(&[
            SensorKind::Accelerometer,
            SensorKind::Gyroscope,
            SensorKind::Magnetometer,
        ])
    }
}

fn line(text: &[u8], order: &[SensorKind], out: &mut Decoded) {
    let mut fields = text.split(|&byte| byte == b',');
    let Some(time_ns) = fields.next().and_then(|f| stamp::parse_ns(f, MILLISECONDS)) else {
        out.bad("A line was left out: it does not start with a time in ms and a comma.");
        return;
    };
    let mut value = || {
        let text = std::str::from_utf8(fields.next()?).ok()?;
        text.trim().parse().ok()
    };
    for &kind in order {
        let [x, y, z] = [value(), value(), value()].map(|v| v.unwrap_or(f64::NAN));
        out.vector(time_ns, kind, Vector3::new(x, y, z));
    }
}

fn object(text: &[u8], out: &mut Decoded) {
    let object = match json::object(text) {
        Ok(object) => object,
        Err(error) => return out.bad(error.to_string()),
    };
    let Some(time_ns) = json::stamp_ms(object.get("Timestamp")) else {
        out.bad("A message was left out: it has no `Timestamp`.");
        return;
    };
    for (name, kind) in [
        ("Accelerometer", SensorKind::Accelerometer),
        ("Gyroscope", SensorKind::Gyroscope),
        ("Magnetometer", SensorKind::Magnetometer),
    ] {
        if let Some(Value::Array(values)) = object.get(name) {
            out.vector(time_ns, kind, json::vector(values, 0));
        }
    }
}
