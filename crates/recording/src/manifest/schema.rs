//! The keys of a manifest.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Deserialize;
use toml::Spanned;
use toml::de::{DeTable, Deserializer};

use super::navigation::{
    EcefColumns, HeadingColumn, LocalColumns, PositionColumns, SpeedUnit, VelocityColumns,
    WaterColumns,
};
use crate::error::{RecordingError, Result};
use crate::event::SensorKind;
use crate::metadata::{BodyAxes, WorldFrame};
use crate::options::{FieldUnit, Format, RateUnit};
use crate::text::toml_problem;

/// A manifest file: what is told of the whole recording, and its sources. Unknown keys are refused.
#[derive(Debug, Clone)]
pub struct Manifest {
    /// What holds for all sources.
    pub general: General,
    /// The files. A manifest of one file has its keys at the top.
    pub sources: Vec<Source>,
}

/// The keys that hold for the whole recording.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct General {
    /// Name of the recording; default: the stem of the data file, of several files that of the
    /// manifest.
    pub name: Option<String>,
    /// Device name.
    pub device: Option<String>,
    /// World frame of orientations, reference and positions; default that of a file that describes itself, of tables ENU.
    pub world_frame: Option<WorldFrame>,
    /// What the axes of the sensors are; default those of a file that describes itself, of tables those that belong to the world.
    pub body_axes: Option<BodyAxes>,
    /// Where the antenna is; default what the file says.
    pub lever_arm: Option<LeverArm>,
    /// How late the receiver's numbers are.
    pub latency: Option<Latency>,
    /// Anything else worth knowing, kept in the metadata.
    pub extra: BTreeMap<String, String>,
}

/// The names of [`General`]'s keys.
const GENERAL: [&str; 7] = [
    "name",
    "device",
    "world_frame",
    "body_axes",
    "lever_arm",
    "latency",
    "extra",
];

/// From the inertial sensor to the antenna.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LeverArm {
    /// Forward, right, down in body axes, m.
    pub frd_m: [f64; 3],
}

/// How long before its time stamp a measurement of the receiver was true.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Latency {
    /// Of positions, s.
    pub gnss_position_s: f64,
    /// Of velocities, s.
    pub gnss_velocity_s: f64,
}

/// One file of a recording: how it is read and what its columns are.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Source {
    /// The data file, relative to the folder of data or else to the manifest.
    pub file: Option<PathBuf>,
    /// Its format, where it is no table of columns; with neither this nor `time` it is told by content.
    pub format: Option<Format>,
    /// Whether it is something to score against: positions, velocities and device orientations
    /// become references.
    #[serde(default)]
    pub role: Role,
    /// Of a file that is no table: the sensors to take, or of a bag the topic of each; default all.
    #[serde(rename = "use")]
    pub taken: Option<Use>,
    /// Added to every time stamp, s. Default 0.
    #[serde(default)]
    pub time_offset_s: f64,
    /// One character between cells, e.g. `,` (default), `;`, `\t`, or ` ` for runs of blanks.
    #[serde(default = "comma")]
    pub delimiter: char,
    /// Whether the first row (after `skip_rows`) names the columns. Default true.
    #[serde(default = "yes")]
    pub header: bool,
    /// Lines to skip before the header or the first row. Default 0.
    #[serde(default)]
    pub skip_rows: u64,
    /// Lines that start with this character are skipped everywhere.
    pub comment: Option<char>,
    /// Which rows to take, of a file that has rows of several kinds; default all.
    pub rows: Option<RowFilter>,
    /// Whether numbers are written `0,5`.
    #[serde(default)]
    pub decimal_comma: bool,
    /// The time stamps, which every table has.
    pub time: Option<TimeColumn>,
    /// Angular rate; default unit `rad-per-s`.
    pub gyroscope: Option<VectorColumns<RateColumnUnit>>,
    /// Specific force; default unit `m-per-s2`.
    pub accelerometer: Option<VectorColumns<ForceColumnUnit>>,
    /// Magnetic field as the device calibrated it; default unit `microtesla`.
    pub magnetometer: Option<VectorColumns<FieldUnit>>,
    /// Magnetic field without the device's calibration; default unit `microtesla`.
    pub magnetometer_uncalibrated: Option<VectorColumns<FieldUnit>>,
    /// The device's own gyroscope bias; default unit `rad-per-s`.
    pub device_gyroscope_bias: Option<VectorColumns<RateUnit>>,
    /// Position in the world frame, m.
    pub position: Option<VectorColumns<Metre>>,
    /// Velocity in the world frame, m/s.
    pub velocity: Option<VectorColumns<MetrePerSecond>>,
    /// The device's own orientation.
    pub device_orientation: Option<QuaternionColumns>,
    /// A reference orientation to score against.
    pub reference: Option<QuaternionColumns>,
    /// Static pressure.
    pub pressure: Option<NumberColumn<PressureUnit>>,
    /// Fixes of a satellite receiver.
    pub gnss_position: Option<PositionColumns>,
    /// Positions in metres from a place, as fixes.
    pub local_position: Option<LocalColumns>,
    /// Velocity over ground of a satellite receiver.
    pub gnss_velocity: Option<VelocityColumns>,
    /// Speed over ground along the body's x axis (wheels).
    pub forward_speed: Option<NumberColumn<SpeedUnit>>,
    /// Velocity through the water (a ship's log).
    pub water_velocity: Option<WaterColumns>,
    /// Heading of the bow from true north (a gyrocompass).
    pub true_heading: Option<HeadingColumn>,
    /// A reference track in Earth-centred coordinates.
    pub ecef_reference: Option<EcefColumns>,
}

/// What is taken of a file: a list of sensors, or a table with the topic of each.
#[derive(Debug, Clone, PartialEq)]
pub enum Use {
    /// These sensors.
    Sensors(Vec<SensorKind>),
    /// Of a bag: each sensor from its topic.
    Topics(BTreeMap<SensorKind, String>),
}

impl<'de> Deserialize<'de> for Use {
    fn deserialize<D: serde::Deserializer<'de>>(
        deserializer: D,
    ) -> std::result::Result<Self, D::Error> {
        struct ListOrTable;

        impl<'de> serde::de::Visitor<'de> for ListOrTable {
            type Value = Use;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str(
                    "a list of sensors, or of a bag a table { gyroscope = \"/imu/data_raw\" }",
                )
            }

            fn visit_seq<A: serde::de::SeqAccess<'de>>(
                self,
                list: A,
            ) -> std::result::Result<Use, A::Error> {
                let list = serde::de::value::SeqAccessDeserializer::new(list);
                Vec::deserialize(list).map(Use::Sensors)
            }

            fn visit_map<A: serde::de::MapAccess<'de>>(
                self,
                table: A,
            ) -> std::result::Result<Use, A::Error> {
                let table = serde::de::value::MapAccessDeserializer::new(table);
                BTreeMap::deserialize(table).map(Use::Topics)
            }
        }

        deserializer.deserialize_any(ListOrTable)
    }
}

/// What a source is for.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Measurements.
    #[default]
    Sensors,
    /// What estimates are scored against; no filter sees it.
    Reference,
}

/// The rows in which a cell holds a text.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RowFilter {
    /// Which column.
    pub column: Column,
    /// What must stand there.
    pub equals: String,
}

/// A column by its name in the header, or by its number from 1.
#[derive(Debug, Clone, Deserialize)]
#[serde(untagged)]
pub enum Column {
    /// Number, counted from 1.
    Number(usize),
    /// Name in the header.
    Name(String),
}

/// Where the time stamps are: in one column, in two, or in none.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeColumn {
    /// The column of the stamps.
    pub column: Option<Column>,
    /// In place of `column`: those of the date and of the time of day.
    pub columns: Option<[Column; 2]>,
    /// Unit of `column`.
    pub unit: Option<TimeUnit>,
    /// In place of columns: how many rows there are in a second, Hz. The first one is at 0 s.
    pub rate_hz: Option<f64>,
}

/// Unit of a time column.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TimeUnit {
    /// Seconds.
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
    /// Nanoseconds.
    Ns,
    /// A date and a time of day, `2014-08-01T00:00:00.186Z`, with a blank for the `T`, `2014/08/01 00:00:00.186` or
    /// `01-Aug-2014 00:00:00.186` or `01.08.2014 00:00:00.186`; without a zone it is UTC.
    #[serde(rename = "date-time")]
    DateTime,
    /// A time of day alone, `23:59:59.5`; behind midnight the next day goes on.
    #[serde(rename = "time-of-day")]
    TimeOfDay,
}

/// Unit of a table's angular rates.
#[derive(Debug, Clone, Copy, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RateColumnUnit {
    /// Radians per second.
    RadPerS,
    /// Degrees per second.
    DegPerS,
    /// Radians turned since the row before: an increment.
    Rad,
    /// Degrees turned since the row before.
    Deg,
}

/// Unit of a table's specific forces.
#[derive(Debug, Clone, Copy, Deserialize)]
pub enum ForceColumnUnit {
    /// Metres per second squared.
    #[serde(rename = "m-per-s2")]
    MPerS2,
    /// Standard gravity.
    #[serde(rename = "g")]
    G,
    /// Velocity gained since the row before, m/s: an increment.
    #[serde(rename = "m-per-s")]
    MPerS,
}

/// The three columns of a vector sensor.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VectorColumns<U> {
    /// The file's x, y, z.
    pub columns: [Column; 3],
    /// Unit of the numbers.
    pub unit: Option<U>,
    /// What a number is multiplied by to be in `unit`, e.g. 0.001 for mg. Default 1.
    pub scale: Option<f64>,
    /// Which axis of the file each body axis is, e.g. `x,-y,z`; default `x,y,z`.
    pub axes: Option<String>,
}

/// The four columns of an orientation.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct QuaternionColumns {
    /// The four columns in `order`.
    pub columns: [Column; 4],
    /// Order of the numbers. Default `wxyz`.
    #[serde(default)]
    pub order: QuaternionOrder,
    /// What the quaternion does to a vector. Default `body-to-world`.
    #[serde(default)]
    pub direction: QuaternionDirection,
    /// For the reference: column of 0 (does not count in scores) and 1.
    pub scored: Option<Column>,
}

/// Order of a quaternion's numbers in a file.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum QuaternionOrder {
    /// Scalar first.
    #[default]
    Wxyz,
    /// Scalar last.
    Xyzw,
}

/// Which way a file's quaternion turns vectors.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum QuaternionDirection {
    /// As inside.
    #[default]
    BodyToWorld,
    /// The inverse.
    WorldToBody,
}

/// The column of a number.
#[derive(Debug, Clone, Deserialize)]
#[serde(
    deny_unknown_fields,
    bound(deserialize = "U: Deserialize<'de> + Default")
)]
pub struct NumberColumn<U> {
    /// Which column.
    pub column: Column,
    /// Its unit. Default that of the International System, of pressure `pa`, of speed `m-per-s`.
    #[serde(default)]
    pub unit: U,
}

/// Unit of pressure in a file.
#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum PressureUnit {
    /// Pascal.
    #[default]
    Pa,
    /// Hectopascal (millibar).
    Hpa,
    /// Kilopascal.
    Kpa,
    /// Not a pressure but the height in the standard atmosphere that belongs to it, m.
    M,
}

/// The only unit of positions.
#[derive(Debug, Clone, Copy, Deserialize)]
pub enum Metre {
    /// Metres.
    #[serde(rename = "m")]
    M,
}

/// The only unit of velocities.
#[derive(Debug, Clone, Copy, Deserialize)]
pub enum MetrePerSecond {
    /// Metres per second.
    #[serde(rename = "m-per-s")]
    MPerS,
}

fn comma() -> char {
    ','
}

fn yes() -> bool {
    true
}

/// Reads the text of a manifest; `file` stands for it in messages.
///
/// # Errors
/// [`crate::RecordingError::Manifest`] with the line and what was expected.
pub fn parse(text: &str, file: &str) -> Result<Manifest> {
    let manifest = parse_toml(text).map_err(|error| {
        let problem = toml_problem(text, &error);
        match is_of_targets(text) {
            true => RecordingError::manifest(
                file,
                format!(
                    "it describes detections of targets, which `northing track` follows ({problem})"
                ),
            ),
            false => RecordingError::manifest(file, problem),
        }
    })?;
    manifest
        .sources
        .iter()
        .try_for_each(|source| check(source, file))?;
    Ok(manifest)
}

/// Divides the keys into those of the recording and those of its sources.
fn parse_toml(text: &str) -> std::result::Result<Manifest, toml::de::Error> {
    let mut table = DeTable::parse(text)?;
    let span = table.span();
    let rest = table.get_mut();
    let mut general = DeTable::new();
    for key in GENERAL {
        if let Some((key, value)) = rest.remove_entry(key) {
            general.insert(key, value);
        }
    }
    let general = General::deserialize(Deserializer::from(Spanned::new(span, general)))?;
    let sources = if rest.contains_key("source") {
        Several::deserialize(Deserializer::from(table))?.source
    } else {
        vec![Source::deserialize(Deserializer::from(table))?]
    };
    Ok(Manifest { general, sources })
}

/// Whether it is a manifest of the trackers' recordings.
fn is_of_targets(text: &str) -> bool {
    let table = text.parse::<toml::Table>();
    table.is_ok_and(|table| {
        ["detections", "ais", "scans"]
            .iter()
            .any(|key| table.contains_key(*key))
    })
}

/// What is left of a manifest of several files.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Several {
    source: Vec<Source>,
}

fn check(source: &Source, file: &str) -> Result<()> {
    if !source.delimiter.is_ascii() || source.comment.is_some_and(|c| !c.is_ascii()) {
        return Err(RecordingError::manifest(
            file,
            "delimiter and comment must each be one ASCII character, e.g. \";\"",
        ));
    }
    if source.decimal_comma && source.delimiter == ',' {
        return Err(RecordingError::manifest(
            file,
            "decimal_comma needs a delimiter other than the comma, e.g. delimiter = \";\"",
        ));
    }
    /// Beyond a century an offset is a slip of the unit.
    const LARGEST_OFFSET_S: f64 = 3.2e9;
    if source.time_offset_s.is_nan() || source.time_offset_s.abs() > LARGEST_OFFSET_S {
        return Err(RecordingError::manifest(
            file,
            format!("time_offset_s = {}: expected seconds", source.time_offset_s),
        ));
    }
    Ok(())
}
