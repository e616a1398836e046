//! DataFlash, the logs of ArduPilot (`.bin`, feature `ardupilot`).
//!
//! Read first: ArduPilot documentation, *Onboard Message Log Messages*. Messages: `IMU` (rates and forces), `MAG`, `BARO`, `GPS`
//! with the accuracies of `GPA`, `ATT` (the autopilot's own orientation). Body axes are forward, right, down, the world is
//! north, east, down. Of several sensors of a kind the first is taken; stamps count from power-on.

use std::io::Read;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, PoisonError};

use ardupilot_binlog::{Entry, FieldValue, Reader};
use nalgebra::{UnitQuaternion, Vector3};

use crate::error::{RecordingError, Result};
use crate::event::{Event, Sample, SensorKind};
use crate::gnss::{GnssPosition, GnssQuality, GnssVelocity};
use crate::hold::Hold;
use crate::issues::Issues;
use crate::metadata::Metadata;
use crate::recording::{Opened, Pieces};
use crate::text::{Input, read_piece};

/// Messages are logged by turns: some come late.
const HOLD_NS: i64 = 1_000_000_000;
const UT_PER_MILLIGAUSS: f64 = 0.1;

/// Opens a log.
pub(crate) fn open(input: Input, file: &str, metadata: Metadata) -> Result<Opened> {
    let sensors = [
        SensorKind::Gyroscope,
        SensorKind::Accelerometer,
        SensorKind::Magnetometer,
        SensorKind::DeviceOrientation,
        SensorKind::Pressure,
        SensorKind::GnssPosition,
        SensorKind::GnssVelocity,
    ];
    let state = Arc::new(Mutex::new(State::default()));
    let watched = Watched {
        input,
        state: Arc::clone(&state),
    };
    let source = ArduPilotSource {
        file: file.to_owned(),
        log: Some(Reader::new(watched)),
        hold: Hold::new(HOLD_NS),
        fix: None,
        has_height: false,
        state,
    };
    Ok(Opened::ned(
        "ardupilot",
        metadata,
        &sensors,
        Box::new(source),
    ))
}

/// How the reading of the bytes went, which the parser does not tell.
#[derive(Debug, Default)]
struct State {
    bytes: u64,
    is_at_end: bool,
    error: Option<std::io::Error>,
}

/// The bytes of a log.
struct Watched {
    input: Input,
    state: Arc<Mutex<State>>,
}

impl Read for Watched {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        let read = read_piece(&mut self.input, out);
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        match &read {
            Ok(0) if !out.is_empty() => state.is_at_end = true,
            Ok(count) => state.bytes += *count as u64,
            Err(error) => {
                state.error = Some(std::io::Error::new(error.kind(), error.to_string()));
            }
        }
        read
    }
}

/// A fix that waits for its accuracies.
struct Fix {
    time_us: u64,
    position: GnssPosition,
    velocity: Option<GnssVelocity>,
}

struct ArduPilotSource {
    file: String,
    /// Until it ends or fails.
    log: Option<Reader<Watched>>,
    hold: Hold,
    fix: Option<Fix>,
    has_height: bool,
    state: Arc<Mutex<State>>,
}

impl Pieces for ArduPilotSource {
    fn ready(&mut self) -> Option<Event> {
        self.hold.take(self.log.is_none())
    }

    fn read(&mut self, issues: &mut Issues) -> Result<bool> {
        let Some(log) = &mut self.log else {
            return Ok(false);
        };
        // A panic on garbage must not take the program down; the parser is not used again after one.
        let next = catch_unwind(AssertUnwindSafe(|| log.next()));
        if let Ok(Some(Ok(entry))) = next {
            self.entry(&entry);
            return Ok(true);
        }
        self.log = None;
        self.release_fix();
        if self.has_height {
            let text = "Heights are above the geoid, as ArduPilot logs them.";
            issues.notes.push(text.to_owned());
        }
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(error) = state.error.take() {
            return Err(RecordingError::io(&self.file, "read it", error));
        }
        if next.is_err() || !state.is_at_end {
            issues.notes.push(format!(
                "The log is damaged: nothing is read beyond its first {} bytes.",
                state.bytes
            ));
        }
        Ok(true)
    }
}

impl ArduPilotSource {
    fn entry(&mut self, entry: &Entry) {
        let Some(time_us) = entry.timestamp_usec else {
            return;
        };
        if number(entry, "I").is_some_and(|instance| instance != 0.0) {
            return;
        }
        match entry.name.as_str() {
            "IMU" => {
                self.put(time_us, vector(entry, "Gyr").map(Sample::AngularRate));
                self.put(time_us, vector(entry, "Acc").map(Sample::SpecificForce));
            }
            "MAG" => {
                let field = vector(entry, "Mag").map(|field| field * UT_PER_MILLIGAUSS);
                self.put(time_us, field.map(Sample::MagneticField));
            }
            "BARO" => self.put(time_us, number(entry, "Press").map(Sample::Pressure)),
            "ATT" => self.put(time_us, orientation(entry)),
            "GPS" => {
                self.release_fix();
                self.fix = position(entry).map(|position| Fix {
                    time_us,
                    position,
                    velocity: velocity(entry),
                });
            }
            "GPA" => {
                if let Some(fix) = self.fix.as_mut().filter(|fix| fix.time_us == time_us) {
                    fix.state_accuracy(entry);
                }
            }
            _ => {}
        }
    }

    fn put(&mut self, time_us: u64, sample: Option<Sample>) {
        let time_ns = i64::try_from(time_us)
            .ok()
            .and_then(|us| us.checked_mul(1000));
        if let Some((time_ns, sample)) = time_ns.filter(|ns| *ns <= i64::MAX / 2).zip(sample) {
            self.hold.put(time_ns, sample);
        }
    }

    fn release_fix(&mut self) {
        let Some(fix) = self.fix.take() else {
            return;
        };
        self.has_height |= fix.position.height_m.is_some();
        let is_valid = fix.position.quality != GnssQuality::Invalid;
        self.put(fix.time_us, Some(Sample::GnssPosition(fix.position)));
        let velocity = fix.velocity.filter(|_| is_valid);
        self.put(fix.time_us, velocity.map(Sample::GnssVelocity));
    }
}

impl Fix {
    /// What the receiver says of its accuracy: horizontally of the distance, of which each axis has its part.
    fn state_accuracy(&mut self, entry: &Entry) {
        let positive = |name: &str| number(entry, name).filter(|std| *std > 0.0);
        if let Some((horizontal, vertical)) = positive("HAcc").zip(positive("VAcc")) {
            let axis = horizontal * std::f64::consts::FRAC_1_SQRT_2;
            self.position.std_m = Some([axis, axis, vertical]);
        }
        if let Some(velocity) = &mut self.velocity {
            velocity.std_m_s = positive("SAcc").map(|std| [std; 3]);
            if number(entry, "VV") == Some(0.0) {
                velocity.down_m_s = None;
            }
        }
    }
}

fn number(entry: &Entry, name: &str) -> Option<f64> {
    match entry.get(name)? {
        FieldValue::Int(x) => Some(*x as f64),
        FieldValue::Uint(x) => Some(*x as f64),
        FieldValue::Float(x) => Some(*x),
        _ => None,
    }
}

fn vector(entry: &Entry, name: &str) -> Option<Vector3<f64>> {
    let axis = |axis: &str| number(entry, &format!("{name}{axis}"));
    Some(Vector3::new(axis("X")?, axis("Y")?, axis("Z")?))
}

fn orientation(entry: &Entry) -> Option<Sample> {
    let angle = |name: &str| number(entry, name).map(f64::to_radians);
    let (roll, pitch, yaw) = (angle("Roll")?, angle("Pitch")?, angle("Yaw")?);
    let turned = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
    Some(Sample::DeviceOrientation(turned))
}

fn position(entry: &Entry) -> Option<GnssPosition> {
    // Whole numbers of ten-millionths of a degree.
    let angle = |name: &str| number(entry, name).map(|x| (x * 1e-7).to_radians());
    let status = number(entry, "Status")?;
    let satellites = number(entry, "NSats").map(|count| count as u8);
    Some(GnssPosition {
        latitude_rad: angle("Lat")?,
        longitude_rad: angle("Lng")?,
        height_m: number(entry, "Alt").filter(|_| status >= 3.0),
        std_m: None,
        hdop: number(entry, "HDop").filter(|hdop| *hdop > 0.0),
        satellites,
        quality: match status as u8 {
            2 | 3 => GnssQuality::Autonomous,
            4 => GnssQuality::Differential,
            5 => GnssQuality::RtkFloat,
            6 => GnssQuality::RtkFixed,
            _ => GnssQuality::Invalid,
        },
    })
}

fn velocity(entry: &Entry) -> Option<GnssVelocity> {
    let (speed, course) = (number(entry, "Spd")?, number(entry, "GCrs")?.to_radians());
    Some(GnssVelocity {
        north_m_s: speed * course.cos(),
        east_m_s: speed * course.sin(),
        down_m_s: number(entry, "VZ"),
        std_m_s: None,
    })
}

#[cfg(test)]
mod tests;
