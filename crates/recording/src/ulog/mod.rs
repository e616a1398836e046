//! ULog, the logs of PX4 autopilots (feature `ulog`).
//!
//! Read first: PX4 Guide, *ULog File Format*. Topics: `sensor_combined` (rates and forces; of older logs
//! also field and pressure), `vehicle_magnetometer`, `vehicle_air_data`, `vehicle_gps_position`,
//! `vehicle_attitude` (the autopilot's own orientation). Body axes are forward, right, down, the world is
//! north, east, down. Of several sensors of a kind the first is taken.

mod screen;

use std::collections::BTreeMap;
use std::io::BufReader;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::Vector3;
use yule_log::builder::ULogParserBuilder;
use yule_log::errors::ULogError;
use yule_log::model::inst::{self, FieldValue};
use yule_log::model::msg::{LoggedData, UlogMessage};
use yule_log::parser::ULogParser;

use crate::delimited::standard_pressure;
use crate::error::{RecordingError, Result, shown};
use crate::event::{Event, Sample, SensorKind, quaternion_from_file};
use crate::gnss::{GnssPosition, GnssQuality, GnssVelocity};
use crate::hold::Hold;
use crate::issues::Issues;
use crate::metadata::Metadata;
use crate::recording::{Opened, Pieces};
use crate::text::Input;
use screen::Screen;

const TOPICS: &[&str] = &[
    "sensor_combined",
    "vehicle_magnetometer",
    "vehicle_air_data",
    "vehicle_gps_position",
    "vehicle_attitude",
];
/// Topics are logged by turns: some come late.
const HOLD_NS: i64 = 1_000_000_000;
/// How a relative stamp says that there is no measurement.
const NO_MEASUREMENT: f64 = i32::MAX as f64;
const UT_PER_GAUSS: f64 = 100.0;

type Log = ULogParser<Screen<BufReader<Input>>>;

/// Opens a log.
pub(crate) fn open(input: Input, file: &str, metadata: Metadata) -> Result<Opened> {
    let cut_off = Arc::new(AtomicBool::new(false));
    let input = BufReader::with_capacity(1 << 16, input);
    let screen = Screen::new(input, TOPICS, Arc::clone(&cut_off));
    let log = ULogParserBuilder::new(screen)
        .build()
        .map_err(|error| failed(file, &error))?;
    let sensors = [
        SensorKind::Gyroscope,
        SensorKind::Accelerometer,
        SensorKind::Magnetometer,
        SensorKind::DeviceOrientation,
        SensorKind::Pressure,
        SensorKind::GnssPosition,
        SensorKind::GnssVelocity,
    ];
    let source = Box::new(UlogSource {
        file: file.to_owned(),
        log: Some(log),
        topics: BTreeMap::new(),
        hold: Hold::new(HOLD_NS),
        cut_off,
    });
    Ok(Opened::ned("ulog", metadata, &sensors, source))
}

struct UlogSource {
    file: String,
    /// Until it ends or fails.
    log: Option<Log>,
    /// The topic of each subscription.
    topics: BTreeMap<u16, String>,
    hold: Hold,
    cut_off: Arc<AtomicBool>,
}

impl Pieces for UlogSource {
    fn ready(&mut self) -> Option<Event> {
        self.hold.take(self.log.is_none())
    }

    fn read(&mut self, issues: &mut Issues) -> Result<bool> {
        let Some(log) = &mut self.log else {
            return Ok(false);
        };
        // A panic on garbage must not take the program down; the parser is not used again after one.
        let next = catch_unwind(AssertUnwindSafe(|| log.next()));
        match next {
            Ok(Some(Ok(UlogMessage::AddSubscription(added)))) => {
                self.topics.insert(added.msg_id, added.message_name);
            }
            Ok(Some(Ok(UlogMessage::LoggedData(data)))) => self.data(&data),
            Ok(Some(Ok(_))) => {}
            Ok(Some(Err(error))) => {
                self.log = None;
                return Err(failed(&self.file, &error));
            }
            Ok(None) => {
                self.log = None;
                if self.cut_off.load(Ordering::Relaxed) {
                    let text = "The log is cut off within a message; it is read up to there.";
                    issues.notes.push(text.to_owned());
                }
            }
            Err(_) => {
                self.log = None;
                let detail = "the ULog parser gave up";
                return Err(RecordingError::damaged(&self.file, detail));
            }
        }
        Ok(true)
    }
}

impl UlogSource {
    fn data(&mut self, data: &LoggedData) {
        let Some(topic) = self.topics.get(&data.msg_id) else {
            return;
        };
        let Some(time_ns) = i64::try_from(data.timestamp)
            .ok()
            .and_then(|us| us.checked_mul(1000))
            .filter(|ns| *ns <= i64::MAX / 2)
        else {
            return;
        };
        let fields = Fields(&data.data);
        let has = |name: &str| self.topics.values().any(|topic| topic == name);
        let mut put = |relative: Option<f64>, sample: Option<Sample>| {
            // Microseconds after the stamp of the message.
            let relative = relative.unwrap_or(0.0);
            if let Some(sample) = sample.filter(|_| relative < NO_MEASUREMENT) {
                self.hold
                    .put(time_ns.saturating_add((relative * 1e3) as i64), sample);
            }
        };
        match topic.as_str() {
            "sensor_combined" => {
                put(None, fields.vector("gyro_rad").map(Sample::AngularRate));
                let force = fields.vector("accelerometer_m_s2");
                let relative = fields.number("accelerometer_timestamp_relative");
                put(relative, force.map(Sample::SpecificForce));
                if !has("vehicle_magnetometer") {
                    let relative = fields.number("magnetometer_timestamp_relative");
                    put(relative, fields.field());
                }
                if !has("vehicle_air_data") {
                    let height = fields.number("baro_alt_meter").map(standard_pressure);
                    let relative = fields.number("baro_timestamp_relative");
                    put(relative, height.map(Sample::Pressure));
                }
            }
            "vehicle_magnetometer" => put(None, fields.field()),
            "vehicle_air_data" => {
                put(
                    None,
                    fields.number("baro_pressure_pa").map(Sample::Pressure),
                );
            }
            "vehicle_attitude" => put(None, fields.attitude()),
            "vehicle_gps_position" => {
                let fix = fields.position();
                let is_valid = fix.is_some_and(|fix| fix.quality != GnssQuality::Invalid);
                put(None, fix.map(Sample::GnssPosition));
                let velocity = fields.velocity().filter(|_| is_valid);
                put(None, velocity.map(Sample::GnssVelocity));
            }
            _ => {}
        }
    }
}

/// The fields of a message by their names.
struct Fields<'a>(&'a inst::Format);

impl Fields<'_> {
    fn value(&self, name: &str) -> Option<&FieldValue> {
        let mut fields = self.0.fields.iter();
        fields.find(|f| &*f.name == name).map(|f| &f.value)
    }

    fn number(&self, name: &str) -> Option<f64> {
        Some(match self.value(name)? {
            FieldValue::ScalarU8(x) => f64::from(*x),
            FieldValue::ScalarI32(x) => f64::from(*x),
            FieldValue::ScalarU32(x) => f64::from(*x),
            FieldValue::ScalarF32(x) => f64::from(*x),
            FieldValue::ScalarF64(x) => *x,
            _ => return None,
        })
    }

    fn numbers(&self, name: &str) -> Option<Vec<f64>> {
        match self.value(name)? {
            FieldValue::ArrayF32(values) => Some(values.iter().map(|x| f64::from(*x)).collect()),
            _ => None,
        }
    }

    fn vector(&self, name: &str) -> Option<Vector3<f64>> {
        match self.numbers(name)?[..] {
            [x, y, z] => Some(Vector3::new(x, y, z)),
            _ => None,
        }
    }

    /// The magnetic field, from gauss.
    fn field(&self) -> Option<Sample> {
        let gauss = self.vector("magnetometer_ga")?;
        Some(Sample::MagneticField(gauss * UT_PER_GAUSS))
    }

    fn attitude(&self) -> Option<Sample> {
        match self.numbers("q")?[..] {
            [w, x, y, z] => Some(Sample::DeviceOrientation(quaternion_from_file(w, x, y, z))),
            _ => None,
        }
    }

    fn position(&self) -> Option<GnssPosition> {
        let fix_type = self.number("fix_type")?;
        // Integers of ten-millionths of a degree and millimetres; newer logs have degrees and metres.
        let angle = |degrees: &str, integer: &str| {
            let own = self.number(degrees);
            own.or_else(|| self.number(integer).map(|x| x * 1e-7))
        };
        let height = self.number("altitude_ellipsoid_m");
        let height = height.or_else(|| self.number("alt_ellipsoid").map(|x| x * 1e-3));
        let horizontal = self
            .number("eph")
            .map(|x| x * std::f64::consts::FRAC_1_SQRT_2);
        let std = horizontal.zip(self.number("epv")).map(|(h, v)| [h, h, v]);
        Some(GnssPosition {
            latitude_rad: angle("latitude_deg", "lat")?.to_radians(),
            longitude_rad: angle("longitude_deg", "lon")?.to_radians(),
            height_m: height.filter(|_| fix_type >= 3.0),
            std_m: std.filter(|std| std.iter().all(|x| x.is_finite())),
            hdop: self.number("hdop").filter(|x| x.is_finite()),
            satellites: self.number("satellites_used").map(|x| x as u8),
            quality: match fix_type as u8 {
                2 | 3 => GnssQuality::Autonomous,
                4 => GnssQuality::Differential,
                5 => GnssQuality::RtkFloat,
                6 => GnssQuality::RtkFixed,
                8 => GnssQuality::Estimated,
                _ => GnssQuality::Invalid,
            },
        })
    }

    fn velocity(&self) -> Option<GnssVelocity> {
        let is_valid = match self.value("vel_ned_valid") {
            Some(FieldValue::ScalarBool(valid)) => *valid,
            _ => true,
        };
        let std = self.number("s_variance_m_s").filter(|x| x.is_finite());
        is_valid.then_some(GnssVelocity {
            north_m_s: self.number("vel_n_m_s")?,
            east_m_s: self.number("vel_e_m_s")?,
            down_m_s: self.number("vel_d_m_s"),
            // Its name says variance; it is the receiver's accuracy of the speed.
            std_m_s: std.map(|std| [std; 3]),
        })
    }
}

fn failed(file: &str, error: &ULogError) -> RecordingError {
    match error {
        ULogError::Io(error) => RecordingError::io(
            file,
            "read it",
            std::io::Error::new(error.kind(), error.to_string()),
        ),
        other => RecordingError::damaged(file, shown(&other.to_string())),
    }
}

#[cfg(test)]
mod tests;
