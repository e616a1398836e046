//! phyphox (iOS and Android): the answers of its remote access to `/get`.
//!
//! Read first: `docs/wire_formats.md`, section "phyphox". The app keeps one buffer a quantity and
//! names them by experiment; `/config` says which buffer belongs to which sensor. The caller asks
//! for [`Phyphox::request_path`] again and again and passes the answers on; each holds the values since
//! the answer before. Stamps are seconds of the experiment.

use serde_json::{Map, Value};

use super::stream::Stream;
use super::{Decoded, WireError, json};
use crate::error::{join, shown};
use crate::event::SensorKind;
use crate::stamp;

/// Longest answer that is read, bytes: the first one holds the experiment so far.
pub const LONGEST_ANSWER_BYTES: usize = 16 << 20;
/// Most values of a buffer that are used.
const MOST_VALUES: usize = 200_000;
/// Most sensors of an experiment.
const MOST_SENSORS: usize = 8;

/// The buffers of one sensor.
#[derive(Debug, Clone, PartialEq)]
struct Channel {
    kind: SensorKind,
    time: String,
    /// x, y, z; of the pressure one.
    values: Vec<String>,
    /// Newest stamp so far, s.
    newest_s: Option<f64>,
}

/// The decoder of one experiment on one phone.
#[derive(Debug, Clone)]
pub struct Phyphox {
    channels: Vec<Channel>,
    session: Option<String>,
    stream: Stream,
}

impl Default for Phyphox {
    fn default() -> Self {
        Self::of(
            [
                (SensorKind::Accelerometer, "acc"),
                (SensorKind::Gyroscope, "gyr"),
                (SensorKind::Magnetometer, "mag"),
            ]
            .map(|(kind, prefix)| Channel {
                kind,
                time: format!("{prefix}_time"),
                values: ["X", "Y", "Z"]
                    .map(|axis| format!("{prefix}{axis}"))
                    .to_vec(),
                newest_s: None,
            })
            .to_vec(),
        )
    }
}

impl Phyphox {
    /// A decoder for the experiment that the app's answer to `/config` describes.
    ///
    /// # Errors
    /// A line when the answer is no such description or no sensor in it can be used.
    pub fn from_config(answer: &[u8]) -> Result<Self, WireError> {
        let config = json::limited_object(answer, LONGEST_ANSWER_BYTES)?;
        let inputs = json::array(config.get("inputs"));
        let channels: Vec<Channel> = inputs
            .iter()
            .filter_map(channel)
            .take(MOST_SENSORS)
            .collect();
        if channels.is_empty() {
            let names = inputs
                .iter()
                .filter_map(|input| input.get("source")?.as_str());
            return Err(WireError::new(format!(
                "the phyphox experiment has no sensor that can be used with its time (it has: {}); open one with accelerometer and gyroscope",
                join(names)
            )));
        }
        Ok(Self::of(channels))
    }

    fn of(channels: Vec<Channel>) -> Self {
        Self {
            channels,
            session: None,
            stream: Stream::default(),
        }
    }

    /// Path and query of the next request: everything at first, then what is newer.
    #[must_use]
    pub fn request_path(&self) -> String {
        let mut queries = Vec::new();
        for channel in &self.channels {
            let time = encoded(&channel.time);
            match channel.newest_s {
                None => {
                    queries.push(format!("{time}=full"));
                    queries.extend(
                        channel
                            .values
                            .iter()
                            .map(|name| format!("{}=full", encoded(name))),
                    );
                }
                Some(newest) => {
                    queries.push(format!("{time}={newest}"));
                    let newer = |name: &String| format!("{}={newest}%7C{time}", encoded(name));
                    queries.extend(channel.values.iter().map(newer));
                }
            }
        }
        format!("/get?{}", queries.join("&"))
    }

    /// Decodes one answer to [`Phyphox::request_path`].
    pub fn push(&mut self, answer: &[u8]) -> Decoded {
        let object = match json::limited_object(answer, LONGEST_ANSWER_BYTES) {
            Ok(object) => object,
            Err(error) => return Decoded::refused(&error),
        };
        let mut out = Decoded::default();
        self.status(object.get("status"), &mut out);
        match object.get("buffer") {
            Some(Value::Object(buffers)) => {
                for channel in &mut self.channels {
                    channel.read(buffers, &mut out);
                }
            }
            _ => {
                out.bad(
                    "There is no `buffer` in phyphox's answer: is remote access on in the app?",
                );
            }
        }
        let advice = "choose the fastest sensor rate in the phyphox experiment";
        self.stream.settle(advice, &mut out);
        out
    }

    fn status(&mut self, status: Option<&Value>, out: &mut Decoded) {
        let get = |key: &str| status.and_then(|status| status.get(key));
        if get("measuring").and_then(Value::as_bool) == Some(false) {
            out.warn("phyphox is not measuring: press the play button in the app.");
        }
        let session = json::text(get("session"));
        if session.is_empty() || self.session.as_ref() == Some(&session) {
            return;
        }
        if self.session.replace(session).is_some() {
            out.info("Another phyphox experiment was started.");
            for channel in &mut self.channels {
                channel.newest_s = None;
            }
        }
    }
}

impl Channel {
    fn read(&mut self, buffers: &Map<String, Value>, out: &mut Decoded) {
        let buffer = |name: &String| json::array(buffers.get(name).and_then(|b| b.get("buffer")));
        let times = buffer(&self.time);
        let values: Vec<&[Value]> = self.values.iter().map(buffer).collect();
        // The app fills the buffers one after the other while it answers: the last values may be
        // incomplete and come again.
        let complete = values
            .iter()
            .map(|v| v.len())
            .min()
            .unwrap_or(0)
            .min(times.len());
        if complete > MOST_VALUES {
            out.bad_many(format!("A buffer has more than {MOST_VALUES} values; the rest was left out: clear the experiment."),
                (complete - MOST_VALUES) as u64,
            );
        }
        for row in 0..complete.min(MOST_VALUES) {
            let time_s = json::number(times.get(row));
            if self.newest_s.is_some_and(|newest| time_s <= newest) {
                continue;
            }
            let Some(time_ns) = stamp::from_seconds(time_s) else {
                out.bad("A reading was left out: it has no time.");
                continue;
            };
            self.newest_s = Some(time_s);
            let value = |axis: usize| json::number(values.get(axis).and_then(|v| v.get(row)));
            if self.kind == SensorKind::Pressure {
                // The app gives hectopascal.
                out.pressure(time_ns, 100.0 * value(0));
            } else {
                out.vector(time_ns, self.kind, [value(0), value(1), value(2)].into());
            }
        }
    }
}

/// The sensor of one entry of the configuration's `inputs`, when it can be used.
fn channel(input: &Value) -> Option<Channel> {
    let (kind, axes): (_, &[&str]) = match input.get("source")?.as_str()? {
        "accelerometer" => (SensorKind::Accelerometer, &["x", "y", "z"]),
        "gyroscope" => (SensorKind::Gyroscope, &["x", "y", "z"]),
        "magnetic_field" => (SensorKind::Magnetometer, &["x", "y", "z"]),
        "pressure" => (SensorKind::Pressure, &["x"]),
        _ => return None,
    };
    let output = |component: &str| {
        json::array(input.get("outputs"))
            .iter()
            .find_map(|output| Some(output.get(component)?.as_str()?.to_owned()))
    };
    Some(Channel {
        kind,
        time: output("t")?,
        values: axes
            .iter()
            .map(|axis| output(axis))
            .collect::<Option<_>>()?,
        newest_s: None,
    })
}

/// A buffer's name in a query: what is not a letter, a digit, `_` or `-` as `%XX`.
fn encoded(name: &str) -> String {
    let mut text = String::new();
    for byte in shown(name).bytes() {
        if byte.is_ascii_alphanumeric() || byte == b'_' || byte == b'-' {
            text.push(char::from(byte));
        } else {
            text.push_str(&format!("%{byte:02X}"));
        }
    }
    text
}
