//! Sensor Logger's HTTP push (iOS and Android): one JSON object a message.
//!
//! Read first: `docs/wire_formats.md`, section "Sensor Logger push". Messages carry a number and
//! overtake each other; [`SensorLoggerPush::push`] puts them in order by it, waiting at most a
//! second of the readings' own time, so a replay gives the same events. Specific force is
//! `totalacceleration` where it comes, else `accelerometer` + `gravity` of equal stamps, else
//! `accelerometeruncalibrated`. An iPhone without "Standardise Units & Frames" inverts all three
//! and gives the last in g; the messages do not say so, the readings do.

mod channels;

use std::collections::BTreeSet;

use serde_json::Value;

use super::force_sign::{ForceSign, SignRule};
use super::resequencer::{Placed, Resequencer};
use super::stream::Stream;
use super::{Decoded, MOST_READINGS, WireError, json};
use crate::error::shown;
use crate::event::quaternion_from_file;
use crate::options::STANDARD_GRAVITY_M_S2;
use channels::Pairs;

/// A gap in the numbers is waited for so long, in the readings' own time, ns.
const LONGEST_WAIT_NS: i64 = 1_000_000_000;
/// Messages that may wait for a gap.
const MOST_HELD: usize = 64;
/// So many uncalibrated accelerations of norm 1 in a row are in g: nobody falls so evenly.
const ONES_IN_A_ROW: u32 = 5;
/// Distinct sensor names that are remembered.
const MOST_NAMES: usize = 64;

/// One message: its envelope, and its readings as yet unconverted.
#[derive(Debug, Clone, PartialEq)]
pub struct Push {
    /// Number in the session; `None` when the message has none.
    pub message_id: Option<u64>,
    /// The app's identifier of this recording.
    pub session_id: String,
    /// The app's identifier of the device.
    pub device_id: String,
    payload: Vec<Value>,
}

impl Push {
    /// Reads a message.
    ///
    /// # Errors
    /// A line for the app's user when the bytes are too many, no JSON object, or without `payload`.
    pub fn parse(bytes: &[u8]) -> Result<Self, WireError> {
        let mut object = json::object(bytes)?;
        let Some(Value::Array(payload)) = object.get_mut("payload").map(Value::take) else {
            return Err(WireError::new(
                "there is no list `payload`: this is not a message of Sensor Logger's HTTP push",
            ));
        };
        Ok(Self {
            message_id: object.get("messageId").and_then(Value::as_u64),
            session_id: json::text(object.get("sessionId")),
            device_id: json::text(object.get("deviceId")),
            payload,
        })
    }

    /// The latest stamp of the readings, UTC ns.
    #[must_use]
    pub fn latest_ns(&self) -> Option<i64> {
        self.readings().filter_map(|reading| reading.time_ns).max()
    }

    fn readings(&self) -> impl Iterator<Item = Reading<'_>> {
        self.payload.iter().map(Reading::of)
    }
}

/// One entry of the payload.
struct Reading<'a> {
    name: &'a str,
    time_ns: Option<i64>,
    values: &'a Value,
}

impl<'a> Reading<'a> {
    fn of(entry: &'a Value) -> Self {
        Self {
            name: entry.get("name").and_then(Value::as_str).unwrap_or(""),
            time_ns: json::stamp_ns(entry.get("time")),
            values: entry.get("values").unwrap_or(&Value::Null),
        }
    }
}

/// The decoder of one device.
#[derive(Debug, Clone)]
pub struct SensorLoggerPush {
    session_id: String,
    order: Resequencer<Push>,
    /// Names of the sensors seen in this session.
    seen: BTreeSet<String>,
    sign: SignRule,
    /// The uncalibrated acceleration is in g: an iPhone's default.
    in_g: bool,
    /// How many uncalibrated accelerations in a row had a norm of 1.
    ones: u32,
    pairs: Pairs,
    forced: Option<ForceSign>,
    stream: Stream,
    /// Newest stamp of any message, ns.
    newest_ns: i64,
    /// Of sessions that are over.
    lost_before: u64,
    duplicated_before: u64,
}

impl Default for SensorLoggerPush {
    fn default() -> Self {
        Self {
            session_id: String::new(),
            order: Resequencer::new(LONGEST_WAIT_NS, MOST_HELD),
            seen: BTreeSet::new(),
            sign: SignRule::default(),
            in_g: false,
            ones: 0,
            pairs: Pairs::default(),
            forced: None,
            stream: Stream::default(),
            newest_ns: i64::MIN,
            lost_before: 0,
            duplicated_before: 0,
        }
    }
}

impl SensorLoggerPush {
    /// A decoder that takes the sign from the user instead of finding it out:
    /// [`ForceSign::Opposite`] is an iPhone without "Standardise Units & Frames".
    #[must_use]
    pub fn with_sign(sign: ForceSign) -> Self {
        Self {
            forced: Some(sign),
            ..Self::default()
        }
    }

    /// Reads a message and decodes what is next in order; bytes that are no message give a remark.
    pub fn push(&mut self, bytes: &[u8]) -> Decoded {
        match Push::parse(bytes) {
            Ok(push) => self.accept(push),
            Err(error) => Decoded::refused(&error),
        }
    }

    /// Puts a message in order and decodes what is next in order.
    pub fn accept(&mut self, push: Push) -> Decoded {
        let mut out = Decoded::default();
        if push.session_id != self.session_id {
            let rest = self.order.flush();
            self.decode_all(&rest, &mut out);
            *self = Self {
                session_id: push.session_id.clone(),
                forced: self.forced,
                lost_before: self.lost(),
                duplicated_before: self.duplicated(),
                ..Self::default()
            };
        }
        let Some(number) = push.message_id else {
            out.warn("A message has no `messageId`; it is taken in the order of arrival.");
            self.decode_all(&[push], &mut out);
            return out;
        };
        let lost_before = self.order.lost();
        // A message without stamps neither ends a wait nor prolongs it.
        self.newest_ns = push.latest_ns().unwrap_or(i64::MIN).max(self.newest_ns);
        let now_ns = self.newest_ns;
        match self.order.push(number, now_ns, push) {
            Placed::Ready(pushes) => self.decode_all(&pushes, &mut out),
            Placed::Duplicate => {
                out.info("A message came twice; the second was dropped.");
            }
            Placed::Late(push) => {
                out.warn("A message came more than a second after its successors; its readings stand behind theirs.",
                );
                let mut late = Decoded::default();
                self.decode_all(&[push], &mut late);
                late.late = std::mem::take(&mut late.events);
                out.append(late);
            }
        }
        let lost = self.order.lost().saturating_sub(lost_before);
        out.bad_many("A message did not come and was given up.", lost);
        out
    }

    /// Whether a message begins another session than the one under way.
    pub(super) fn is_other_session(&self, push: &Push) -> bool {
        !self.seen.is_empty() && push.session_id != self.session_id
    }

    /// Messages that wait for their predecessors.
    pub(super) fn waiting(&self) -> usize {
        self.order.waiting()
    }

    /// Messages that never came.
    #[must_use]
    pub const fn lost(&self) -> u64 {
        self.lost_before + self.order.lost()
    }

    /// Messages that came more than once.
    #[must_use]
    pub const fn duplicated(&self) -> u64 {
        self.duplicated_before + self.order.duplicated()
    }

    /// Decodes what still waits for its predecessors: the stream has ended.
    pub fn flush(&mut self) -> Decoded {
        let mut out = Decoded::default();
        let rest = self.order.flush();
        self.decode_all(&rest, &mut out);
        out
    }

    fn decode_all(&mut self, pushes: &[Push], out: &mut Decoded) {
        for push in pushes {
            let mut one = Decoded::default();
            self.decode(push, &mut one);
            self.stream
                .settle("set the sampling period to 10 ms in the app", &mut one);
            out.append(one);
        }
    }

    fn decode(&mut self, push: &Push, out: &mut Decoded) {
        self.learn(push, out);
        let sign = self.sign(out);
        let too_many = push.payload.len().saturating_sub(MOST_READINGS);
        if too_many > 0 {
            out.bad_many(format!(
                    "A message has more than {MOST_READINGS} readings; the rest was left out: shorten the batch period in the app."
                ),
                too_many as u64,
            );
        }
        for reading in push.readings().take(MOST_READINGS) {
            match reading.time_ns {
                Some(time_ns) => self.reading(&reading, time_ns, sign, out),
                None => out.bad(format!(
                    "A reading of {} was left out: its `time` is not a count of nanoseconds.",
                    shown(reading.name)
                )),
            }
        }
        self.pairs.report(out);
    }

    /// What the whole message says about the sensors and about signs, before anything is converted.
    fn learn(&mut self, push: &Push, out: &mut Decoded) {
        for reading in push.readings().take(MOST_READINGS) {
            if !self.seen.contains(reading.name) && self.seen.len() < MOST_NAMES {
                self.seen.insert(shown(reading.name));
                channels::remark_on(reading.name, out);
            }
        }
        // A message may hold sensor after sensor; evidence belongs together by time.
        let mut evidence: Vec<_> = push.readings().take(MOST_READINGS).collect();
        evidence.sort_by_key(|reading| (reading.time_ns, reading.name != "orientation"));
        for reading in evidence {
            let Some(time_ns) = reading.time_ns else {
                continue;
            };
            match reading.name {
                "totalacceleration" => self.sign.platform = Some(ForceSign::Standard),
                "gravity" => self.sign.see_force(time_ns, &json::xyz(reading.values)),
                "accelerometeruncalibrated" => {
                    let written = json::xyz(reading.values);
                    // One g is 1 in an iPhone's default units and 9.8 in all others.
                    let is_one = (written.norm() - 1.0).abs() < 0.1;
                    self.ones = if is_one {
                        self.ones.saturating_add(1)
                    } else {
                        0
                    };
                    if self.ones >= ONES_IN_A_ROW && !self.seen.contains("totalacceleration") {
                        self.in_g = true;
                        self.sign.platform = Some(ForceSign::Opposite);
                    }
                    let unit = if self.in_g {
                        STANDARD_GRAVITY_M_S2
                    } else {
                        1.0
                    };
                    self.sign.see_force(time_ns, &(written * unit));
                }
                "orientation" => {
                    let [w, x, y, z] = channels::quaternion(reading.values);
                    self.sign
                        .see_orientation(time_ns, &quaternion_from_file(w, x, y, z));
                }
                _ => {}
            }
        }
    }

    fn sign(&mut self, out: &mut Decoded) -> ForceSign {
        self.forced.unwrap_or_else(|| self.sign.decide(out))
    }

    fn has(&self, name: &str) -> bool {
        self.seen.contains(name)
    }
}
