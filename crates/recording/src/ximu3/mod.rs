//! x-IMU3 of x-io Technologies: files of its data logger (`.ximu3`), and the tables that its software makes of them.
//!
//! Read first: `docs/formats.md`, section "x-IMU3"; the device's user manual, "communication protocol". A file is messages that end with LF:
//! settings as JSON, and measurements, in text (`I,1000000,0.0,...`) or in bytes (the letter plus 0x80, the stamp and single-precision numbers,
//! little-endian, LF within them escaped as SLIP does). Stamps are microseconds. Axes are taken as forward, left, up.

mod tables;
#[cfg(test)]
mod tests;

use std::io::{BufRead, BufReader};

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::geometry::frames::enu_from_ned_rotation;
use serde_json::Value as Json;

use crate::error::{RecordingError, Result};
use crate::event::{Sample, SensorKind, quaternion_from_file};
use crate::hold::Hold;
use crate::issues::Issues;
use crate::limits::LOG_LINE;
use crate::metadata::{BodyAxes, Metadata};
use crate::options::{DEGREE, STANDARD_GRAVITY_M_S2};
use crate::recording::{Opened, Pieces};
use crate::text::{Input, read_line};

pub(crate) use tables::open_folder;

/// What one unit of the magnetometer is taken for, uT: the device counts in the field of the place where it was calibrated.
const FIELD_UT: f64 = 50.0;
const FIELD_NOTE: &str = "The magnetometer counts in the strength of the field where it was calibrated, which the file does not tell: \
     1 is taken as 50 uT.";
/// Messages of one sensor stand behind those of another by no more, ns.
const LATEST_NS: i64 = 1_000_000_000;
/// Messages that are looked at to tell the format.
const LINES: usize = 3;
/// Settings in front of the first measurement: some hundred.
const MOST_SETTINGS: usize = 10_000;
/// Differences of two stamps fit in nanoseconds.
const LARGEST_US: i64 = i64::MAX / 2000;
const LF: u8 = b'\n';
const ESCAPE: u8 = 0xdb;
const ESCAPED_LF: u8 = 0xdc;
const ESCAPED_ESCAPE: u8 = 0xdd;
/// Added to the letter of a message in bytes.
const BINARY: u8 = 0x80;

const DAMAGED: &str = "message(s) of an x-IMU3 that are damaged";
const OTHER_ORIENTATION: &str =
    "orientation(s) of an x-IMU3 as matrices or angles (set its AHRS message type to quaternion)";

/// A measurement: its letter, its stamp, its numbers.
#[derive(Debug, Clone, PartialEq)]
struct Message {
    kind: u8,
    time_us: i64,
    numbers: Vec<f64>,
}

/// How many numbers a message of this letter has; `None` of those that are not read.
const fn count(kind: u8) -> Option<usize> {
    Some(match kind {
        b'I' => 6,
        b'M' => 3,
        b'Q' => 4,
        b'R' => 9,
        b'A' => 3,
        // A quaternion, and an acceleration without gravity.
        b'L' | b'E' => 7,
        _ => return None,
    })
}

/// Whether a file begins as the data logger makes it, with its answer to a ping or with measurements, or is a table of an
/// inertial sensor.
pub(crate) fn recognises(head: &[u8]) -> bool {
    if head.starts_with(b"{\"ping\":") || tables::recognises(head) {
        return true;
    }
    let mut lines = head.split_inclusive(|byte| *byte == LF).take(LINES);
    // The last one may be cut off.
    let mut whole = lines
        .by_ref()
        .filter(|line| line.ends_with(&[LF]))
        .peekable();
    whole.peek().is_some() && whole.all(|line| matches!(message(line), Some(Ok(_))))
}

/// Opens such a file, or a table of an inertial sensor.
pub(crate) fn open_any(input: Input, file: &str, metadata: Metadata) -> Result<Opened> {
    let mut input = BufReader::with_capacity(1 << 16, input);
    let head = input.fill_buf();
    let head = head.map_err(|error| RecordingError::io(file, "read it", error))?;
    if tables::recognises(head) {
        return tables::open_table(Box::new(input), file, metadata);
    }
    open(input, file, metadata)
}

fn open(input: BufReader<Input>, file: &str, metadata: Metadata) -> Result<Opened> {
    let mut source = Source {
        file: file.to_owned(),
        input,
        line: Vec::new(),
        is_read: false,
        earth: Some(earth(0)),
        hold: Hold::new(LATEST_NS),
        ended: false,
    };
    let mut device = None;
    for _ in 0..MOST_SETTINGS {
        source.is_read = read_line(&mut source.input, LOG_LINE, &mut source.line, file)?;
        if !source.is_read || !source.line.starts_with(b"{") {
            break;
        }
        source.setting(&mut device);
    }
    let sensors = [
        SensorKind::Gyroscope,
        SensorKind::Accelerometer,
        SensorKind::Magnetometer,
        SensorKind::DeviceOrientation,
    ];
    Ok(opened(metadata, device, sensors.to_vec(), Box::new(source)))
}

fn opened(
    metadata: Metadata,
    device: Option<String>,
    sensors: Vec<SensorKind>,
    source: Box<dyn crate::recording::EventSource>,
) -> Opened {
    let has_field = sensors.contains(&SensorKind::Magnetometer);
    let metadata = Metadata {
        format: "x-imu3".to_owned(),
        body_axes: Some(BodyAxes::Flu),
        device,
        ..metadata
    };
    Opened {
        notes: has_field
            .then(|| FIELD_NOTE.to_owned())
            .into_iter()
            .collect(),
        units_applied: true,
        ..Opened::new(metadata, sensors, source)
    }
}

/// `enu_from_earth` of the device's setting `ahrs_axes_convention`.
fn earth(convention: i64) -> UnitQuaternion<f64> {
    match convention {
        1 => UnitQuaternion::identity(),
        2 => enu_from_ned_rotation(),
        // North, west, up.
        _ => UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2),
    }
}

struct Source {
    file: String,
    input: BufReader<Input>,
    line: Vec<u8>,
    /// Whether there is a line that is not taken yet.
    is_read: bool,
    /// `enu_from_earth` of orientations; `None` where the device says what is not known here.
    earth: Option<UnitQuaternion<f64>>,
    hold: Hold,
    ended: bool,
}

impl Source {
    /// Takes a setting, or an answer of the device.
    fn setting(&mut self, device: &mut Option<String>) {
        let Ok(Json::Object(setting)) = serde_json::from_slice::<Json>(&self.line) else {
            return;
        };
        if let Some(number) = setting.get("ping").and_then(|ping| ping["sn"].as_str()) {
            *device = Some(format!("x-IMU3 {}", crate::error::shown(number)));
        }
        if let Some(convention) = setting.get("ahrs_axes_convention") {
            let known = convention
                .as_i64()
                .filter(|number| (0..=2).contains(number));
            self.earth = known.map(earth);
        }
    }

    fn take(&mut self, issues: &mut Issues) {
        let Message {
            kind,
            time_us,
            numbers,
        } = match message(&self.line) {
            None => return,
            Some(Err(())) => return issues.reject(DAMAGED),
            Some(Ok(message)) => message,
        };
        let time_ns = time_us.saturating_mul(1000);
        let vector = |at: usize| Vector3::new(numbers[at], numbers[at + 1], numbers[at + 2]);
        match (kind, self.earth) {
            (b'I', _) => {
                let (rate, force) = (vector(0) * DEGREE, vector(3) * STANDARD_GRAVITY_M_S2);
                self.hold.put(time_ns, Sample::AngularRate(rate));
                self.hold.put(time_ns, Sample::SpecificForce(force));
            }
            (b'M', _) => {
                let field = vector(0) * FIELD_UT;
                self.hold.put(time_ns, Sample::MagneticField(field));
            }
            (b'Q' | b'L' | b'E', Some(earth)) => {
                let [w, x, y, z] = [0, 1, 2, 3].map(|at: usize| numbers[at]);
                let attitude = earth * quaternion_from_file(w, x, y, z);
                self.hold.put(time_ns, Sample::DeviceOrientation(attitude));
            }
            (b'R' | b'A', _) => issues.reject(OTHER_ORIENTATION),
            _ => {}
        }
    }
}

impl Pieces for Source {
    fn ready(&mut self) -> Option<crate::event::Event> {
        self.hold.take(self.ended)
    }

    fn read(&mut self, issues: &mut Issues) -> Result<bool> {
        if !std::mem::take(&mut self.is_read) {
            let more = read_line(&mut self.input, LOG_LINE, &mut self.line, &self.file)?;
            if !more {
                // What waits is handed out.
                return Ok(!std::mem::replace(&mut self.ended, true));
            }
        }
        if self.line.starts_with(b"{") {
            self.setting(&mut None);
        } else {
            self.take(issues);
        }
        Ok(true)
    }
}

/// Takes a line apart; `None` where it is no measurement that is read.
fn message(line: &[u8]) -> Option<std::result::Result<Message, ()>> {
    let (first, body) = line.split_first()?;
    let is_binary = *first >= BINARY;
    let kind = if is_binary { first - BINARY } else { *first };
    let count = count(kind).filter(|_| is_binary || body.starts_with(b","))?;
    // Without its end a message is cut off.
    let body = body.strip_suffix(&[LF]);
    let parse = if is_binary { binary } else { text };
    let read = body.and_then(|body| parse(body, count));
    Some(
        read.map(|(time_us, numbers)| Message {
            kind,
            time_us,
            numbers,
        })
        .ok_or(()),
    )
}

/// `,STAMP,NUMBER,...`
fn text(body: &[u8], count: usize) -> Option<(i64, Vec<f64>)> {
    let body = std::str::from_utf8(body).ok()?.trim_end_matches('\r');
    let mut fields = body.split(',').skip(1);
    let time_us = fields.next()?.trim().parse().ok()?;
    let mut numbers = Vec::with_capacity(count);
    for field in fields {
        let number = field.trim().parse().ok().filter(|x: &f64| x.is_finite())?;
        if numbers.len() == count {
            return None;
        }
        numbers.push(number);
    }
    let is_whole = numbers.len() == count && (0..=LARGEST_US).contains(&time_us);
    is_whole.then_some((time_us, numbers))
}

/// The stamp in eight bytes and the numbers in four each, behind the escapes.
fn binary(body: &[u8], count: usize) -> Option<(i64, Vec<f64>)> {
    let length = 8 + 4 * count;
    let mut plain = Vec::with_capacity(length);
    let mut bytes = body.iter().copied();
    while let Some(byte) = bytes.next() {
        plain.push(match byte {
            ESCAPE => match bytes.next()? {
                ESCAPED_LF => LF,
                ESCAPED_ESCAPE => ESCAPE,
                _ => return None,
            },
            byte => byte,
        });
        if plain.len() > length {
            return None;
        }
    }
    let (stamp, rest) = plain.split_first_chunk::<8>()?;
    let time_us = i64::try_from(u64::from_le_bytes(*stamp)).ok();
    let time_us = time_us.filter(|stamp| *stamp <= LARGEST_US)?;
    let number = |bytes: &[u8]| bytes.try_into().ok().map(f32::from_le_bytes);
    let numbers = rest.chunks(4).map(|bytes| number(bytes).map(f64::from));
    let numbers: Vec<f64> = numbers.collect::<Option<_>>()?;
    let is_whole = numbers.len() == count && numbers.iter().all(|x| x.is_finite());
    is_whole.then_some((time_us, numbers))
}
