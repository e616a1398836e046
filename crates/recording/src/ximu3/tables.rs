//! The tables of CSV that the x-IMU3's software makes: a folder of a device with `Inertial.csv` and others, or one table.

use std::io::Read;
use std::path::{Path, PathBuf};

use nalgebra::UnitQuaternion;
use serde_json::Value as Json;

use super::{FIELD_UT, earth, opened};
use crate::delimited::{Channel, DelimitedSource, Layout, Rows, TimeForm};
use crate::error::{RecordingError, Result, join};
use crate::event::{Event, Sample, SensorKind};
use crate::false_stamps::FalseStamps;
use crate::issues::Issues;
use crate::limits::read_description;
use crate::merge::Merged;
use crate::metadata::Metadata;
use crate::options::{DEGREE, STANDARD_GRAVITY_M_S2};
use crate::recording::{EventSource, Opened};
use crate::stamp::MICROSECONDS;
use crate::text::{Input, open_file};

const TIME: &str = "Timestamp (us)";
const INERTIAL: &str = "Inertial.csv";
/// Tables of a folder, and their columns: the first names that are all there.
const TABLES: [(&str, &[Columns]); 3] = [
    (INERTIAL, &[RATE, FORCE]),
    (
        "Magnetometer.csv",
        &[
            Columns(
                SensorKind::Magnetometer,
                &["X (a.u.)", "Y (a.u.)", "Z (a.u.)"],
                FIELD_UT,
            ),
            FIELD,
        ],
    ),
    (
        "Quaternion.csv",
        &[Columns(
            SensorKind::DeviceOrientation,
            &["W", "X", "Y", "Z"],
            1.0,
        )],
    ),
];

/// A sensor, what its columns are called, and what a number is multiplied by.
struct Columns(SensorKind, &'static [&'static str], f64);

const RATE: Columns = Columns(
    SensorKind::Gyroscope,
    &[
        "Gyroscope X (deg/s)",
        "Gyroscope Y (deg/s)",
        "Gyroscope Z (deg/s)",
    ],
    DEGREE,
);
const FORCE: Columns = Columns(
    SensorKind::Accelerometer,
    &[
        "Accelerometer X (g)",
        "Accelerometer Y (g)",
        "Accelerometer Z (g)",
    ],
    STANDARD_GRAVITY_M_S2,
);
const FIELD: Columns = Columns(
    SensorKind::Magnetometer,
    &[
        "Magnetometer X (a.u.)",
        "Magnetometer Y (a.u.)",
        "Magnetometer Z (a.u.)",
    ],
    FIELD_UT,
);

/// Whether a text begins with the header of a table of an inertial sensor.
pub(super) fn recognises(head: &[u8]) -> bool {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    let header = head.split(|byte| *byte == b'\n').next();
    let header = String::from_utf8_lossy(header.unwrap_or_default());
    header.starts_with(TIME) && header.contains(RATE.1[0])
}

/// Opens a table of an inertial sensor, which may have a field, too.
pub(super) fn open_table(input: Input, file: &str, metadata: Metadata) -> Result<Opened> {
    let (sensors, source) = table(input, file, &[RATE, FORCE, FIELD])?;
    RecordingError::check_sensors(file, &sensors)?;
    Ok(opened(metadata, None, sensors, source))
}

/// Opens the folder of a device, or one with the folder of one device; `None` when it is none.
pub(crate) fn open_folder(path: &Path, file: &str, metadata: &Metadata) -> Result<Option<Opened>> {
    let mut devices = Vec::new();
    if is_device(path)? {
        devices.push(path.to_owned());
    } else if let Ok(entries) = std::fs::read_dir(path) {
        for entry in entries.flatten().take(1000) {
            if entry.path().is_dir() && is_device(&entry.path())? {
                devices.push(entry.path());
            }
        }
    }
    devices.sort();
    match &devices[..] {
        [] => Ok(None),
        [only] => open_device(only, metadata).map(Some),
        several => {
            let names: Vec<String> = several
                .iter()
                .map(|path| path.display().to_string())
                .collect();
            let names = join(names.iter().map(String::as_str));
            let problem =
                format!("it has the folders of several devices: {names}; open one of them");
            Err(RecordingError::unsupported(file, problem))
        }
    }
}

fn is_device(path: &Path) -> Result<bool> {
    let table = path.join(INERTIAL);
    if !table.is_file() {
        return Ok(false);
    }
    let mut head = Vec::new();
    let input = open_file(&table, &table.display().to_string())?;
    let read = input.take(4096).read_to_end(&mut head);
    Ok(read.is_ok() && recognises(&head))
}

fn open_device(path: &Path, metadata: &Metadata) -> Result<Opened> {
    let (device, earth) = commands(&path.join("Command.json"));
    let (mut sensors, mut streams): (Vec<SensorKind>, Vec<Box<dyn EventSource>>) =
        Default::default();
    for (name, columns) in TABLES {
        let table_path: PathBuf = path.join(name);
        if !table_path.is_file() {
            continue;
        }
        let file = table_path.display().to_string();
        let (kinds, source) = table(Box::new(open_file(&table_path, &file)?), &file, columns)?;
        sensors.extend(kinds);
        streams.push(Box::new(OfEarth(source, earth)));
    }
    sensors.sort_unstable_by_key(|kind| kind.order());
    let source = Box::new(Merged::new(streams));
    Ok(opened(metadata.clone(), device, sensors, source))
}

/// The device's name, and `enu_from_earth`, where its answers say so.
fn commands(path: &Path) -> (Option<String>, UnitQuaternion<f64>) {
    let read = path.is_file().then(|| read_description(path));
    let text = read.and_then(Result::ok).unwrap_or_default();
    let Ok(Json::Array(answers)) = serde_json::from_str::<Json>(&text) else {
        return (None, earth(0));
    };
    let find = |key: &str| answers.iter().rev().find_map(|answer| answer.get(key));
    let number = find("ping").and_then(|ping| ping["sn"].as_str());
    let convention = find("ahrs_axes_convention").and_then(Json::as_i64);
    let name = number.map(|number| format!("x-IMU3 {}", crate::error::shown(number)));
    (name, earth(convention.unwrap_or(0)))
}

/// A table whose orientations are those of the device's own Earth frame.
struct OfEarth(Box<dyn EventSource>, UnitQuaternion<f64>);

impl EventSource for OfEarth {
    fn next_event(&mut self, issues: &mut Issues) -> Result<Option<Event>> {
        let mut event = self.0.next_event(issues)?;
        if let Some(Event {
            sample: Sample::DeviceOrientation(attitude),
            ..
        }) = &mut event
        {
            *attitude = self.1 * *attitude;
        }
        Ok(event)
    }

    fn place(&self) -> Option<String> {
        self.0.place()
    }
}

/// The sensors of a table, and its events.
fn table(
    input: Input,
    file: &str,
    columns: &[Columns],
) -> Result<(Vec<SensorKind>, Box<dyn EventSource>)> {
    let mut rows = Rows::new(file.to_owned(), &mut csv::ReaderBuilder::new(), input, 0);
    let header = rows.first()?;
    let name = |name: &[u8]| String::from_utf8_lossy(name.trim_ascii()).into_owned();
    let names: Vec<String> = header.iter().map(name).collect();
    let place = |wanted: &str| names.iter().position(|name| name == wanted);
    let Some(time) = place(TIME) else {
        return Err(RecordingError::MissingColumns {
            file: file.to_owned(),
            missing: format!("column {TIME}"),
            present: join(names.iter().map(String::as_str)),
            advice: "a table of an x-IMU3 begins with it".to_owned(),
        });
    };
    let channel = |Columns(kind, names, factor): &Columns| {
        let places: Option<Vec<usize>> = names.iter().map(|name| place(name)).collect();
        Some(Channel::new(*kind, &places?).times(*factor))
    };
    let layout = Layout {
        time,
        time_form: TimeForm::Decimal(MICROSECONDS),
        channels: columns.iter().filter_map(channel).collect(),
        decimal_comma: false,
        rows: None,
        names,
    };
    let sensors = layout.sensors();
    let source = FalseStamps::new(DelimitedSource::new(rows, layout));
    Ok((sensors, Box::new(source)))
}
