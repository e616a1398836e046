//! What phones and boards send while they measure: bytes in, events and remarks out.
//!
//! Read first: `docs/wire_formats.md`. One file a format. A decoder is a plain structure: it does no
//! input or output and reads no clock, so a live run and its replay give the same events. It never
//! panics, and one bad reading never costs the others: what cannot be used is left out, counted,
//! and said in words for the person who can act on it ([`Notice`]).
//!
//! All decoders give the events of the crate: SI and radians, field in microtesla, body axes x to
//! the right edge, y to the top edge, z out of the screen, specific force +9.81 on the axis that
//! points up at rest, orientations `enu_from_body`. Events of one [`Decoded`] are in time order;
//! those of two consecutive ones may overlap by as much as the device's batches do.
//! [`WireDecoder`] is one decoder for all of them, with their messages put in order.
//!
//! ```
//! use northing_recording::wire::sensorserver::SensorServer;
//!
//! let frame = br#"{"values":[0,0,9.81],"timestamp":5,"accuracy":3,"type":"android.sensor.accelerometer"}"#;
//! let decoded = SensorServer::default().push(frame);
//! assert_eq!(decoded.events[0].time_ns, 5);
//! assert!(decoded.notices.is_empty());
//! ```

mod decoder;
pub mod events;
mod force_sign;
pub mod hyperimu;
mod json;
mod lines;
pub mod linkoping;
pub mod northing_serial;
pub mod phone_page;
pub mod phyphox;
mod preference;
pub mod razor;
mod resequencer;
mod rounding;
pub mod sensor_logger_push;
pub mod sensorserver;
pub mod sensorstreamer;
mod stream;
#[cfg(test)]
mod tests;

use nalgebra::{UnitQuaternion, Vector3};

use crate::event::{CompassHeading, Event, Sample, SensorKind, quaternion_from_file};

pub use decoder::{WireDecoder, WireFormat};
pub use force_sign::ForceSign;
pub use resequencer::{Placed, Resequencer};

/// Longest batch that is read, bytes.
pub const LONGEST_BATCH_BYTES: usize = 256 * 1024;
/// Most readings of one batch that are used.
pub const MOST_READINGS: usize = 2000;
/// Most distinct remarks on one batch.
pub const MOST_NOTICES: usize = 32;

/// What came out of some bytes.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Decoded {
    /// Measurements in time order.
    pub events: Vec<Event>,
    /// Measurements of messages that had been given up before they came: whoever keeps a recording
    /// wants them, an estimate that has gone on does not.
    pub late: Vec<Event>,
    /// Remarks, each once, with how often it applies to these bytes.
    pub notices: Vec<Notice>,
}

/// A remark for people: what happened and what to do about it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Notice {
    /// How much it matters.
    pub tone: Tone,
    /// One sentence or two.
    pub text: String,
    /// How often it applied since the remark before.
    pub count: u64,
}

/// How much a remark matters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Tone {
    /// Good to know.
    Info,
    /// The results suffer.
    Warning,
    /// Something was left out.
    Bad,
}

/// Bytes of which nothing can be used: one line for whoever sent them.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{problem}")]
pub struct WireError {
    /// What is wrong and what was expected.
    pub problem: String,
}

impl WireError {
    pub(crate) fn new(problem: impl Into<String>) -> Self {
        Self {
            problem: problem.into(),
        }
    }
}

impl Decoded {
    /// Adds a remark; an equal one is counted instead. Beyond [`MOST_NOTICES`] distinct ones the
    /// last stands for the rest.
    pub fn note(&mut self, tone: Tone, text: impl Into<String>) {
        self.note_many(tone, text, 1);
    }

    /// A remark that is good to know.
    pub fn info(&mut self, text: impl Into<String>) {
        self.note(Tone::Info, text);
    }

    /// A remark on what makes the results suffer.
    pub fn warn(&mut self, text: impl Into<String>) {
        self.note(Tone::Warning, text);
    }

    /// A remark on what was left out.
    pub fn bad(&mut self, text: impl Into<String>) {
        self.note(Tone::Bad, text);
    }

    /// The same of `count` things that were left out; none is no remark.
    fn bad_many(&mut self, text: impl Into<String>, count: u64) {
        if count > 0 {
            self.note_many(Tone::Bad, text, count);
        }
    }

    fn note_many(&mut self, tone: Tone, text: impl Into<String>, count: u64) {
        let text = text.into();
        if let Some(known) = self
            .notices
            .iter_mut()
            .find(|notice| notice.tone == tone && notice.text == text)
        {
            known.count = known.count.saturating_add(count);
            return;
        }
        if self.notices.len() + 1 < MOST_NOTICES {
            self.notices.push(Notice { tone, text, count });
            return;
        }
        let rest = "There are further remarks that are not shown.";
        match self.notices.last_mut() {
            Some(last) if last.text == rest => last.count = last.count.saturating_add(count),
            _ => self.notices.push(Notice {
                tone: Tone::Warning,
                text: rest.to_owned(),
                count,
            }),
        }
    }

    /// Takes over the events and remarks of `later` behind its own.
    pub fn append(&mut self, later: Self) {
        self.events.extend(later.events);
        self.late.extend(later.late);
        for notice in later.notices {
            self.note_many(notice.tone, notice.text, notice.count);
        }
    }

    /// The answer to bytes of which nothing can be used.
    fn refused(error: &WireError) -> Self {
        let mut decoded = Self::default();
        decoded.bad(error.to_string());
        decoded
    }

    /// Adds a vector reading unless it is not finite or absurd.
    fn vector(&mut self, time_ns: i64, kind: SensorKind, v: Vector3<f64>) {
        if let Some(sample) = Sample::from_vector(kind, v) {
            self.sample(time_ns, kind, sample, v.amax(), &v);
        }
    }

    /// Adds a static pressure, Pa.
    fn pressure(&mut self, time_ns: i64, pascal: f64) {
        let kind = SensorKind::Pressure;
        self.sample(time_ns, kind, Sample::Pressure(pascal), pascal, &[pascal]);
    }

    /// Adds a heading of the device.
    fn compass(&mut self, time_ns: i64, heading: CompassHeading) {
        let kind = SensorKind::CompassHeading;
        let numbers = [heading.heading_rad, heading.std_rad];
        let sample = Sample::CompassHeading(heading);
        self.sample(time_ns, kind, sample, heading.std_rad, &numbers);
    }

    /// Adds the device's orientation from the numbers as they stand in the message.
    fn orientation(&mut self, time_ns: i64, [w, x, y, z]: [f64; 4]) {
        let q = quaternion_from_file(w, x, y, z);
        self.attitude(time_ns, q);
    }

    fn attitude(&mut self, time_ns: i64, q: UnitQuaternion<f64>) {
        let kind = SensorKind::DeviceOrientation;
        let q = if q.w < 0.0 {
            UnitQuaternion::new_unchecked(-q.into_inner())
        } else {
            q
        };
        let sample = Sample::DeviceOrientation(q);
        self.sample(time_ns, kind, sample, 1.0, q.as_vector().as_slice());
    }

    fn sample<'a>(
        &mut self,
        time_ns: i64,
        kind: SensorKind,
        sample: Sample,
        size: f64,
        numbers: impl IntoIterator<Item = &'a f64>,
    ) {
        let name = kind.name();
        if !numbers.into_iter().all(|x| x.is_finite()) {
            self.bad(format!(
                "A reading of the {name} was left out: a number is missing or not finite."
            ));
            return;
        }
        let (largest, unit) = plausible(kind);
        if size.abs() > largest {
            self.bad(format!(
                "A reading of the {name} was left out: more than {largest} {unit} is not plausible."
            ));
            return;
        }
        self.events.push(Event { time_ns, sample });
    }
}

/// The largest plausible number of a sensor, and its unit: far beyond what such sensors
/// can measure.
fn plausible(kind: SensorKind) -> (f64, &'static str) {
    match kind {
        SensorKind::Gyroscope | SensorKind::DeviceGyroscopeBias => (200.0, "rad/s"),
        SensorKind::Accelerometer => (2000.0, "m/s^2"),
        SensorKind::Magnetometer | SensorKind::MagnetometerUncalibrated => (20_000.0, "uT"),
        SensorKind::Pressure => (200_000.0, "Pa"),
        SensorKind::CompassHeading => (10.0, "rad of uncertainty"),
        _ => (1e9, ""),
    }
}
