//! VectorNav's ASCII lines `$VNYMR`: attitude, magnetic field, specific force and angular rate of a VN-100 or its like.
//!
//! Read first: `docs/formats.md`; the sensor's user manual, "yaw, pitch, roll, magnetic, acceleration, and angular rates".
//! Fields: yaw, pitch, roll (deg), field (gauss), specific force (m/s^2), rate (rad/s), each x, y, z; body axes forward,
//! right, down; the checksum is the XOR of what stands between `$` and `*`.
//!
//! The lines have no time. What stands before one, or in the first cell of a table that quotes them, is its time of
//! arrival; a log without any is counted at the rate at which the sensor sends unless told otherwise.

use std::io::BufReader;

use nalgebra::Vector3;
use northing_core::geometry::rotation::from_yaw_pitch_roll;

use crate::error::Result;
use crate::event::{Event, Sample, SensorKind};
use crate::issues::Issues;
use crate::limits::LOG_LINE;
use crate::metadata::Metadata;
use crate::nmea::arrival;
use crate::options::FieldUnit;
use crate::recording::{Opened, Pieces};
use crate::text::{Input, read_line};

/// How a line begins.
const ADDRESS: &[u8] = b"$VNYMR,";
/// Numbers in a line.
const FIELDS: usize = 12;
/// From line to line where nothing says when they came, ns: 40 a second.
const INTERVAL_NS: i64 = 25_000_000;
/// Lines that are looked at to tell the format.
const LINES: usize = 20;

/// What every line has in it.
const SENSORS: [SensorKind; 4] = [
    SensorKind::Gyroscope,
    SensorKind::Accelerometer,
    SensorKind::Magnetometer,
    SensorKind::DeviceOrientation,
];

/// Why a line was left out, in words that complete "Left out: 3 ...".
mod reason {
    pub(super) const CHECKSUM: &str =
        "VectorNav line(s) with a wrong checksum; the line was disturbed";
    pub(super) const LONG_CHECKSUM: &str =
        "VectorNav line(s) with a checksum of 16 bits; set the sensor to 8 bits (its default)";
    pub(super) const CUT_OFF: &str = "VectorNav line(s) cut off before their checksum";
    pub(super) const GARBLED: &str = "VectorNav line(s) that do not have twelve numbers";
    pub(super) const NO_TIME: &str =
        "VectorNav line(s) without a time of arrival, where others have one";
}

/// A line: when it came, if it says so, and its numbers.
type Line = (Option<i64>, [f64; FIELDS]);

/// Whether a text has a whole line among its first ones.
pub(crate) fn recognises(head: &str) -> bool {
    let mut lines = head.lines().take(LINES);
    lines.any(|text| matches!(line(text.as_bytes()), Some(Ok(_))))
}

/// Opens a log.
pub(crate) fn open(input: Input, file: &str, metadata: Metadata) -> Opened {
    let source = Box::new(Source {
        file: file.to_owned(),
        input: BufReader::with_capacity(1 << 16, input),
        text: Vec::new(),
        times: Times::Unknown,
        waiting: Vec::new(),
    });
    Opened {
        units_applied: false,
        ..Opened::ned("vectornav", metadata, &SENSORS, source)
    }
}

struct Source {
    file: String,
    input: BufReader<Input>,
    text: Vec<u8>,
    times: Times,
    /// Events of a line, the next one last.
    waiting: Vec<Event>,
}

/// Where the times come from.
enum Times {
    /// No line has been seen.
    Unknown,
    /// From what stands before each.
    Arrival,
    /// From their count: lines so far.
    Counted(i64),
}

impl Source {
    fn take_line(&mut self, issues: &mut Issues) {
        let (arrival_ns, numbers) = match line(&self.text) {
            None => return,
            Some(Ok(line)) => line,
            Some(Err(reason)) => {
                // It took its time all the same.
                if let Times::Counted(lines) = &mut self.times {
                    *lines += 1;
                }
                return issues.reject(reason);
            }
        };
        match self.time(arrival_ns, issues) {
            Some(time_ns) => self.waiting.extend(events(time_ns, &numbers)),
            None => issues.reject(reason::NO_TIME),
        }
    }

    fn time(&mut self, arrival_ns: Option<i64>, issues: &mut Issues) -> Option<i64> {
        if matches!(self.times, Times::Unknown) {
            self.times = match arrival_ns {
                Some(_) => Times::Arrival,
                None => Times::Counted(0),
            };
            if arrival_ns.is_none() {
                issues.notes.push(
                    "The lines have no times of arrival; they are taken as 40 a second, as a VN-100 sends them unless \
                     told otherwise. If yours are not, write the time in seconds before each."
                        .to_owned(),
                );
            }
        }
        match &mut self.times {
            Times::Counted(lines) => {
                let time_ns = lines.saturating_mul(INTERVAL_NS);
                *lines += 1;
                Some(time_ns)
            }
            _ => arrival_ns,
        }
    }
}

impl Pieces for Source {
    fn ready(&mut self) -> Option<Event> {
        self.waiting.pop()
    }

    fn read(&mut self, issues: &mut Issues) -> Result<bool> {
        let more = read_line(&mut self.input, LOG_LINE, &mut self.text, &self.file)?;
        if more {
            self.take_line(issues);
        }
        Ok(more)
    }
}

/// The samples of a line, the first one last.
fn events(time_ns: i64, numbers: &[f64; FIELDS]) -> [Event; 4] {
    let [yaw, pitch, roll, mx, my, mz, fx, fy, fz, wx, wy, wz] = *numbers;
    let field = Vector3::new(mx, my, mz) * FieldUnit::Gauss.to_microtesla();
    [
        Sample::DeviceOrientation(from_yaw_pitch_roll([yaw, pitch, roll].map(f64::to_radians))),
        Sample::MagneticField(field),
        Sample::SpecificForce(Vector3::new(fx, fy, fz)),
        Sample::AngularRate(Vector3::new(wx, wy, wz)),
    ]
    .map(|sample| Event { time_ns, sample })
}

/// Takes a line apart; `None` where no sentence begins.
fn line(text: &[u8]) -> Option<std::result::Result<Line, &'static str>> {
    // Where two lines ran into each other the second one is whole.
    let start = text.windows(ADDRESS.len()).rposition(|w| w == ADDRESS)?;
    let (before, sentence) = text.split_at(start);
    let numbers = numbers(sentence);
    // In a table the time is the first cell.
    let first = before
        .split(|byte| matches!(byte, b',' | b';' | b'\t'))
        .next();
    Some(numbers.map(|numbers| (first.and_then(arrival), numbers)))
}

/// The numbers of a sentence whose checksum is right.
fn numbers(sentence: &[u8]) -> std::result::Result<[f64; FIELDS], &'static str> {
    let star = sentence.iter().position(|byte| *byte == b'*');
    let (body, behind) = star
        .map(|star| (&sentence[1..star], &sentence[star + 1..]))
        .ok_or(reason::CUT_OFF)?;
    let digits = behind.iter().take_while(|byte| byte.is_ascii_hexdigit());
    let written = match digits.count() {
        2 => std::str::from_utf8(&behind[..2]).map_err(|_| reason::CHECKSUM)?,
        4 => return Err(reason::LONG_CHECKSUM),
        _ => return Err(reason::CUT_OFF),
    };
    let sum = body.iter().fold(0, |sum, byte| sum ^ byte);
    if u8::from_str_radix(written, 16) != Ok(sum) {
        return Err(reason::CHECKSUM);
    }
    let fields = &body[ADDRESS.len() - 1..];
    let fields = std::str::from_utf8(fields).map_err(|_| reason::GARBLED)?;
    let mut fields = fields.split(',');
    let mut numbers = [0.0; FIELDS];
    for number in &mut numbers {
        let field = fields.next().and_then(|field| field.trim().parse().ok());
        *number = field
            .filter(|x: &f64| x.is_finite())
            .ok_or(reason::GARBLED)?;
    }
    match fields.next() {
        None => Ok(numbers),
        Some(_) => Err(reason::GARBLED),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Format, OpenOptions, Recording, read_bytes};

    /// A line with its checksum.
    fn made(numbers: &str) -> String {
        let body = format!("VNYMR,{numbers}");
        let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
        format!("${body}*{sum:02X}")
    }

    const NUMBERS: &str = "+090.000,-010.000,+000.000,+00.2500,-00.0800,+00.3500,+00.100,+00.200,-09.800,+00.010000,-00.020000,+00.300000";

    fn open(text: &str) -> Recording {
        read_bytes(
            text.as_bytes().to_vec(),
            "made.log",
            &OpenOptions::default(),
        )
        .unwrap()
    }

    #[test]
    fn a_line_is_an_attitude_a_field_a_force_and_a_rate_at_its_arrival() {
        for before in [
            "1763590172.75 ",
            "2025-11-19T22:09:32.750Z ",
            "1763590172.75,imu1,0.3,\"",
        ] {
            let recording = open(&format!("{before}{}\r\n\"\r\n", made(NUMBERS)));
            assert_eq!(recording.metadata().format, "vectornav");
            let events: Vec<Event> = recording.map(Result::unwrap).collect();
            assert!(
                events
                    .iter()
                    .all(|e| e.time_ns == 1_763_590_172_750_000_000),
                "{before}"
            );
            let [
                Sample::AngularRate(rate),
                Sample::SpecificForce(force),
                Sample::MagneticField(field),
                Sample::DeviceOrientation(attitude),
            ] = [0, 1, 2, 3].map(|i: usize| events[i].sample)
            else {
                panic!("{events:?}")
            };
            assert_eq!(
                (rate, force),
                (Vector3::new(0.01, -0.02, 0.3), Vector3::new(0.1, 0.2, -9.8))
            );
            approx::assert_relative_eq!(field, Vector3::new(25.0, -8.0, 35.0), epsilon = 1e-12);
            // Forward is east, and 10 degrees down.
            let forward = attitude * Vector3::x();
            approx::assert_relative_eq!(forward.y, 10_f64.to_radians().cos(), epsilon = 1e-12);
            approx::assert_relative_eq!(forward.z, 10_f64.to_radians().sin(), epsilon = 1e-12);
        }
    }

    #[test]
    fn without_times_the_lines_are_counted_and_it_is_told() {
        let bad = made(NUMBERS).replace("+090", "+091");
        let text = [made(NUMBERS), bad, made(NUMBERS)].join("\r\n") + "\r\n";
        let mut recording = open(&text);
        let times: Vec<i64> = recording.by_ref().map(|e| e.unwrap().time_ns).collect();
        assert_eq!(
            times,
            [[0; 4], [50_000_000; 4]].concat(),
            "the disturbed line took its time"
        );
        let told = recording.issues().sentences().join(" ");
        assert!(
            told.contains("40 a second") && told.contains("wrong checksum"),
            "{told}"
        );
        // Beside lines with a time one without is left out.
        let text = format!("5.0 {0}\n{0}\n6.0 {0}\n", made(NUMBERS));
        let mut recording = open(&text);
        assert_eq!(recording.by_ref().count(), 8);
        assert_eq!(recording.issues().rejected.get(reason::NO_TIME), Some(&1));
    }

    #[test]
    fn every_kind_of_damage_has_its_reason() {
        let good = made(NUMBERS);
        let crc = format!("{good}AB");
        for (text, expected) in [
            (good.replace("+090", "+091"), reason::CHECKSUM),
            (good[..good.len() - 1].to_owned(), reason::CUT_OFF),
            (good[..good.len() - 3].to_owned(), reason::CUT_OFF),
            (good[..40].to_owned(), reason::CUT_OFF),
            (crc, reason::LONG_CHECKSUM),
            (made("1,2,3"), reason::GARBLED),
            (made(&format!("{NUMBERS},1")), reason::GARBLED),
            (made(&NUMBERS.replace("+00.100", "nan")), reason::GARBLED),
            (made(&NUMBERS.replace("+00.100", "")), reason::GARBLED),
        ] {
            assert_eq!(line(text.as_bytes()), Some(Err(expected)), "{text}");
            assert!(!recognises(&text), "{text}");
        }
        assert_eq!(line(b"$VNRRG,01,VN-100*58"), None);
        // The first line lost its end.
        let merged = format!("{}{good}", &good[..40]);
        assert!(matches!(line(merged.as_bytes()), Some(Ok(_))));
    }

    #[test]
    fn what_is_cut_off_anywhere_is_read_up_to_there() {
        let whole = format!("1.0 {0}\n1.025 {0}\n", made(NUMBERS));
        let options = OpenOptions {
            format: Some(Format::VectorNav),
            ..OpenOptions::default()
        };
        for end in 0..whole.len() {
            let bytes = whole.as_bytes()[..end].to_vec();
            let read = read_bytes(bytes, "cut.log", &options).unwrap();
            let events = read.map_while(Result::ok).count();
            assert!(
                events == 0 || events == 4 || end + 1 == whole.len(),
                "{events} at {end}"
            );
        }
    }
}
