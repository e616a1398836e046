//! The own phone page's batches: raw browser readings, converted here and nowhere else.
//!
//! Read first: `docs/wire_formats.md`, section "Phone page". [`Batch::parse`] reads the envelope
//! (who, which number), [`PhonePage::decode`] the readings of one page load. Generic Sensor readings
//! (stamped by the sensor, rad/s) are preferred to DeviceMotion's (stamped by the browser, deg/s)
//! while they come. The compass of an iPhone, and elsewhere the heading of an absolute orientation,
//! gives a heading of the top edge ten times a second. Rotation rates alpha, beta, gamma are about x, y, z. iOS writes the opposite
//! sign of specific force.

mod readings;

use nalgebra::{UnitQuaternion, Vector3};
use serde_json::Value;

use super::force_sign::{ForceSign, SignRule};
use super::preference::Preference;
use super::rounding::Rounding;
use super::stream::Stream;
use super::{Decoded, MOST_READINGS, WireError, json};
use crate::event::{CompassHeading, SensorKind, quaternion_from_file};
use readings::{Motion, Orientation, heading_of};

/// The version of the batches that is read.
const VERSION: u64 = 1;
/// What to do about a low rate.
const ADVICE: &str =
    "keep the page in front and the screen on, and switch the phone's power saving off";
/// A sensor and the step to which browsers round it.
const FORCE: [&str; 2] = ["accelerometer", "0.1 m/s^2"];
const RATE: [&str; 2] = ["gyroscope", "0.1 deg/s"];
/// Longest name or identifier that is kept, characters.
const LONGEST_NAME: usize = 60;

/// One batch: its envelope, and its readings as yet unconverted.
#[derive(Debug, Clone, PartialEq)]
pub struct Batch {
    /// The device's random identifier.
    pub device: String,
    /// The name that the person gave the device; may be empty.
    pub name: String,
    /// Random identifier of the page load; stamps of one page load share a clock.
    pub session: String,
    /// Number of the batch in its session, from 0.
    pub seq: u64,
    /// `ios`, `android` or something else.
    pub platform: String,
    /// The page's clock when it sent the batch, ms.
    pub sent_ms: Option<f64>,
    /// What happened on the page.
    pub page_events: Vec<PageEvent>,
    user_agent: String,
    motion: Vec<Value>,
    accelerometer: Vec<Value>,
    gyroscope: Vec<Value>,
    magnetometer: Vec<Value>,
    quaternion: Vec<Value>,
    orientation: Vec<Value>,
    /// Readings beyond [`MOST_READINGS`], which were dropped.
    left_out: usize,
}

/// Something that happened on the page: hidden, visible, a permission.
#[derive(Debug, Clone, PartialEq)]
pub struct PageEvent {
    /// When, by the page's clock, ns.
    pub time_ns: Option<i64>,
    /// A word: `hidden`, `visible`, `permission`, ...
    pub kind: String,
    /// More about it; may be empty.
    pub text: String,
}

impl Batch {
    /// Reads a batch.
    ///
    /// # Errors
    /// A line for the page when the bytes are too many, no JSON object, of another version, or
    /// without `device`, `session` or `seq`.
    pub fn parse(bytes: &[u8]) -> Result<Self, WireError> {
        let mut object = json::object(bytes)?;
        if object.get("v").and_then(Value::as_u64) != Some(VERSION) {
            return Err(WireError::new(format!(
                "`v` must be {VERSION}: the page and the lab are of different versions, load the page anew"
            )));
        }
        let required = |key: &str| {
            let text: String = json::text(object.get(key));
            if text.is_empty() {
                return Err(WireError::new(format!("`{key}` is missing")));
            }
            Ok(text)
        };
        let (device, session) = (required("device")?, required("session")?);
        let seq = object
            .get("seq")
            .and_then(Value::as_u64)
            .ok_or_else(|| WireError::new("`seq` must be an integer from 0"))?;
        let name = json::text(object.get("name"));
        let platform = json::text(object.get("platform"));
        let user_agent = object.get("ua").and_then(Value::as_str).unwrap_or_default();
        let user_agent = user_agent.chars().take(4 * LONGEST_NAME).collect();
        let sent_ms = object.get("sent_ms").and_then(Value::as_f64);
        let page_events = json::array(object.get("events"))
            .iter()
            .take(MOST_READINGS)
            .map(page_event)
            .collect();
        let motion = taken(object.get_mut("dm"));
        let orientation = taken(object.get_mut("do"));
        let mut generic = |key: &str| taken(object.get_mut("gs").and_then(|gs| gs.get_mut(key)));
        let mut batch = Self {
            device,
            name,
            session,
            seq,
            platform,
            sent_ms,
            page_events,
            user_agent,
            motion,
            accelerometer: generic("a"),
            gyroscope: generic("g"),
            magnetometer: generic("m"),
            quaternion: generic("q"),
            orientation,
            left_out: 0,
        };
        batch.truncate();
        Ok(batch)
    }

    /// Keeps at most [`MOST_READINGS`] readings of all lists together, and no memory for more.
    fn truncate(&mut self) {
        let mut room = MOST_READINGS;
        let mut left_out = 0;
        for list in self.lists() {
            left_out += list.len().saturating_sub(room);
            list.truncate(room);
            list.shrink_to_fit();
            room -= list.len();
        }
        self.left_out = left_out;
    }

    pub(super) fn lists(&mut self) -> [&mut Vec<Value>; 6] {
        [
            &mut self.accelerometer,
            &mut self.gyroscope,
            &mut self.magnetometer,
            &mut self.quaternion,
            &mut self.motion,
            &mut self.orientation,
        ]
    }
}

fn taken(value: Option<&mut Value>) -> Vec<Value> {
    match value.map(Value::take) {
        Some(Value::Array(rows)) => rows,
        _ => Vec::new(),
    }
}

fn page_event(value: &Value) -> PageEvent {
    PageEvent {
        time_ns: json::stamp_ms(value.get("t_ms")),
        kind: json::text(value.get("kind")),
        text: json::text(value.get("text")),
    }
}

/// The decoder of one page load.
#[derive(Debug, Clone, Default)]
pub struct PhonePage {
    sign: SignRule,
    force: Preference,
    rate: Preference,
    attitude: Preference,
    /// Turn about the vertical that takes orientations with an arbitrary zero to north.
    north: Option<UnitQuaternion<f64>>,
    last_heading_ns: Option<i64>,
    force_rounding: Rounding,
    rate_rounding: Rounding,
    stream: Stream,
}

impl PhonePage {
    /// Reads and decodes one batch; bytes that are no batch give a remark.
    pub fn push(&mut self, bytes: &[u8]) -> Decoded {
        match Batch::parse(bytes) {
            Ok(batch) => self.decode(&batch),
            Err(error) => Decoded::refused(&error),
        }
    }

    /// Decodes one batch of this page load, in the order of their numbers.
    pub fn decode(&mut self, batch: &Batch) -> Decoded {
        let mut out = Decoded::default();
        if batch.left_out > 0 {
            out.bad_many(
                format!("A batch has more than {MOST_READINGS} readings; the rest was left out."),
                batch.left_out as u64,
            );
        }
        self.sign.platform = platform_sign(batch);
        let rows: Vec<Motion> = batch.motion.iter().map(Motion::read).collect();
        self.see_sign(batch, &rows);
        self.generic_sensors(batch, &mut out);
        self.device_motion(&rows, &mut out);
        for row in &batch.orientation {
            self.device_orientation(row, &mut out);
        }
        self.stream.settle(ADVICE, &mut out);
        out
    }

    /// Looks for the sign of gravity in the whole batch before anything is converted.
    fn see_sign(&mut self, batch: &Batch, rows: &[Motion]) {
        let mut attitudes = batch
            .orientation
            .iter()
            .filter_map(Orientation::read)
            .peekable();
        for row in rows {
            let Some(time_ns) = row.time_ns else { continue };
            while let Some(attitude) = attitudes.next_if(|next| next.time_ns <= time_ns) {
                self.sign
                    .see_orientation(attitude.time_ns, &attitude.world_from_body());
            }
            self.sign.see_force(time_ns, &row.with_gravity);
        }
        for attitude in attitudes {
            self.sign
                .see_orientation(attitude.time_ns, &attitude.world_from_body());
        }
    }

    fn generic_sensors(&mut self, batch: &Batch, out: &mut Decoded) {
        for row in &batch.accelerometer {
            let Some((time_ns, force)) = stamped_vector(row, out) else {
                continue;
            };
            self.force.better(time_ns);
            self.force_rounding.see(FORCE, &force, out);
            // Only Chromium has these sensors, and it writes them as the standard says.
            out.vector(time_ns, SensorKind::Accelerometer, force);
        }
        for row in &batch.gyroscope {
            let Some((time_ns, rate)) = stamped_vector(row, out) else {
                continue;
            };
            self.rate.better(time_ns);
            self.rate_rounding
                .see(RATE, &rate.map(f64::to_degrees), out);
            out.vector(time_ns, SensorKind::Gyroscope, rate);
        }
        for row in &batch.magnetometer {
            if let Some((time_ns, field)) = stamped_vector(row, out) {
                out.vector(time_ns, SensorKind::Magnetometer, field);
            }
        }
        for row in &batch.quaternion {
            let Some((time_ns, row)) = stamped(row, out) else {
                continue;
            };
            self.attitude.better(time_ns);
            let [x, y, z, w] = json::numbers::<4>(row, 1);
            out.orientation(time_ns, [w, x, y, z]);
            let heading = heading_of(&quaternion_from_file(w, x, y, z));
            self.compass(time_ns, heading, out);
        }
    }

    fn device_motion(&mut self, rows: &[Motion], out: &mut Decoded) {
        let mut sign = None;
        for row in rows {
            let Some(time_ns) = row.time_ns else {
                out.bad(NO_STAMP);
                continue;
            };
            if self.force.take_worse(time_ns) {
                if row.with_gravity.iter().all(|x| x.is_nan()) {
                    out.bad("The browser gives no acceleration with gravity: the tilt cannot be estimated from it.",
                    );
                } else {
                    let sign = *sign.get_or_insert_with(|| self.sign.decide(out));
                    self.force_rounding.see(FORCE, &row.with_gravity, out);
                    let force = row.with_gravity * sign.factor();
                    out.vector(time_ns, SensorKind::Accelerometer, force);
                }
            }
            if self.rate.take_worse(time_ns) {
                if row.rate_deg_s.iter().all(|x| x.is_nan()) {
                    out.bad(
                        "The browser gives no rotation rate: this phone may have no gyroscope.",
                    );
                } else {
                    self.rate_rounding.see(RATE, &row.rate_deg_s, out);
                    let rate = row.rate_deg_s.map(f64::to_radians);
                    out.vector(time_ns, SensorKind::Gyroscope, rate);
                }
            }
        }
    }

    /// A compass is slow: ten headings a second hold all it knows.
    fn compass(&mut self, time_ns: i64, heading: Option<CompassHeading>, out: &mut Decoded) {
        const INTERVAL_NS: u64 = 95_000_000;
        let soon = |last: i64| last.abs_diff(time_ns) < INTERVAL_NS;
        let Some(heading) = heading.filter(|_| !self.last_heading_ns.is_some_and(soon)) else {
            return;
        };
        self.last_heading_ns = Some(time_ns);
        out.compass(time_ns, heading);
    }

    fn device_orientation(&mut self, row: &Value, out: &mut Decoded) {
        let Some(attitude) = Orientation::read(row) else {
            out.bad("An orientation was left out: its time or an angle is missing.");
            return;
        };
        let time_ns = attitude.time_ns;
        if !self.attitude.take_worse(time_ns) {
            return;
        }
        let world_from_body = attitude.world_from_body();
        self.compass(time_ns, attitude.compass(), out);
        if attitude.absolute {
            out.attitude(time_ns, world_from_body);
            return;
        }
        // One turn for all of the page load: the compass is slower and coarser than the phone's own
        // orientation, and following it would make that jump.
        let north = *self.north.get_or_insert_with(|| {
            attitude.north_from_arbitrary().unwrap_or_else(|| {
                out.info("The phone's own orientation has an arbitrary zero of heading: compare turns, not headings.",
                );
                UnitQuaternion::identity()
            })
        });
        out.attitude(time_ns, north * world_from_body);
    }
}

const NO_STAMP: &str = "A reading was left out: it has no time.";

fn platform_sign(batch: &Batch) -> Option<ForceSign> {
    match batch.platform.as_str() {
        "ios" => Some(ForceSign::Opposite),
        "android" => Some(ForceSign::Standard),
        _ if ["iPhone", "iPad", "iPod"]
            .iter()
            .any(|name| batch.user_agent.contains(name)) =>
        {
            Some(ForceSign::Opposite)
        }
        _ if batch.user_agent.contains("Android") => Some(ForceSign::Standard),
        _ => None,
    }
}

/// A row that starts with its time, ms.
fn stamped<'a>(row: &'a Value, out: &mut Decoded) -> Option<(i64, &'a [Value])> {
    let row = json::array(Some(row));
    let time_ns = json::stamp_ms(row.first());
    if time_ns.is_none() {
        out.bad(NO_STAMP);
    }
    Some((time_ns?, row))
}

fn stamped_vector(row: &Value, out: &mut Decoded) -> Option<(i64, Vector3<f64>)> {
    stamped(row, out).map(|(time_ns, row)| (time_ns, json::vector(row, 1)))
}
