//! SensorServer (Android): WebSocket text frames, one reading each.
//!
//! Read first: `docs/wire_formats.md`, section "SensorServer". The frames follow Android's sensor
//! API: SI units, specific force, stamps in nanoseconds since the phone started. The app's default
//! period of 200 ms is too slow for attitude; the decoder says so.

use serde_json::Value;

use super::preference::Preference;
use super::stream::Stream;
use super::{Decoded, json};
use crate::error::shown;
use crate::event::SensorKind;

const ADVICE: &str =
    "set the sampling rate to 10000 microseconds in SensorServer's settings and connect again";
const PREFIX: &str = "android.sensor.";

/// The path, with its query, under which the app serves the sensors that this decoder uses;
/// percent-encoded.
pub const CONNECT_PATH: &str = "/sensors/connect?types=%5B%22android.sensor.accelerometer%22,%22android.sensor.gyroscope%22,%22android.sensor.magnetic_field%22,%22android.sensor.rotation_vector%22%5D";

/// The decoder of one connection.
#[derive(Debug, Clone, Default)]
pub struct SensorServer {
    /// The sensor of frames that do not name theirs, as Android names it.
    only_sensor: Option<String>,
    force: Preference,
    rate: Preference,
    attitude: Preference,
    stream: Stream,
}

impl SensorServer {
    /// A decoder for the connection to one sensor, e.g. `android.sensor.gyroscope`, whose frames do
    /// not name it.
    #[must_use]
    pub fn for_sensor(name: &str) -> Self {
        Self {
            only_sensor: Some(name.to_owned()),
            ..Self::default()
        }
    }

    /// Decodes one text frame.
    pub fn push(&mut self, frame: &[u8]) -> Decoded {
        let object = match json::object(frame) {
            Ok(object) => object,
            Err(error) => return Decoded::refused(&error),
        };
        let mut out = Decoded::default();
        if object.contains_key("latitude") {
            out.info("The position is not used.");
            return out;
        }
        let named = object.get("type").and_then(Value::as_str);
        let Some(sensor) = named.or(self.only_sensor.as_deref()) else {
            out.bad("A frame was left out: it does not name its sensor (`type`).");
            return out;
        };
        let sensor = sensor.strip_prefix(PREFIX).unwrap_or(sensor).to_owned();
        let Some(time_ns) = json::stamp_ns(object.get("timestamp")) else {
            out.bad("A frame was left out: its `timestamp` is not a count of nanoseconds.");
            return out;
        };
        let values = json::array(object.get("values"));
        self.reading(&sensor, time_ns, values, &mut out);
        self.stream.settle(ADVICE, &mut out);
        out
    }

    fn reading(&mut self, sensor: &str, time_ns: i64, values: &[Value], out: &mut Decoded) {
        let v = json::vector(values, 0);
        match sensor {
            "accelerometer" => {
                self.force.better(time_ns);
                out.vector(time_ns, SensorKind::Accelerometer, v);
            }
            "accelerometer_uncalibrated" => {
                if self.force.take_worse_after_wait(time_ns) {
                    out.vector(time_ns, SensorKind::Accelerometer, v);
                }
            }
            "gyroscope" => {
                self.rate.better(time_ns);
                out.vector(time_ns, SensorKind::Gyroscope, v);
            }
            "gyroscope_uncalibrated" => {
                if self.rate.take_worse_after_wait(time_ns) {
                    out.vector(time_ns, SensorKind::Gyroscope, v);
                }
                let bias = json::vector(values, 3);
                out.vector(time_ns, SensorKind::DeviceGyroscopeBias, bias);
            }
            "magnetic_field" => out.vector(time_ns, SensorKind::Magnetometer, v),
            "magnetic_field_uncalibrated" => {
                out.vector(time_ns, SensorKind::MagnetometerUncalibrated, v);
            }
            "rotation_vector" => {
                self.attitude.better(time_ns);
                rotation_vector(time_ns, values, out);
            }
            // Without the magnetometer its heading has an arbitrary zero.
            "game_rotation_vector" => {
                if self.attitude.take_worse_after_wait(time_ns) {
                    rotation_vector(time_ns, values, out);
                }
            }
            // Android gives hectopascal.
            "pressure" => out.pressure(time_ns, 100.0 * json::number(values.first())),
            _ => out.info(format!("The sensor {} is not used.", shown(sensor))),
        }
    }
}

/// x, y, z of the unit quaternion, then w; old phones leave w out.
fn rotation_vector(time_ns: i64, values: &[Value], out: &mut Decoded) {
    let [x, y, z] = json::numbers::<3>(values, 0);
    let w = if values.len() > 3 {
        json::number(values.get(3))
    } else {
        (1.0 - (x * x + y * y + z * z)).max(0.0).sqrt()
    };
    out.orientation(time_ns, [w, x, y, z]);
}
