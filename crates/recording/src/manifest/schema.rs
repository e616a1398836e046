//! The keys of a manifest.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Deserialize;

use super::problem;
use crate::error::Result;
use crate::metadata::WorldFrame;
use crate::options::{FieldUnit, ForceUnit, RateUnit};

/// A manifest file. Unknown keys are refused.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// The data file, relative to the manifest.
    pub file: Option<PathBuf>,
    /// Name of the recording; default: the data file's stem.
    pub name: Option<String>,
    /// Device name.
    pub device: Option<String>,
    /// World frame of orientations, reference and positions.
    #[serde(default)]
    pub world_frame: WorldFrame,
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
    /// Whether numbers are written `0,5`.
    #[serde(default)]
    pub decimal_comma: bool,
    /// The time column.
    pub time: TimeColumn,
    /// Angular rate; default unit `rad-per-s`.
    pub gyroscope: Option<VectorColumns<RateUnit>>,
    /// Specific force; default unit `m-per-s2`.
    pub accelerometer: Option<VectorColumns<ForceUnit>>,
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
    pub pressure: Option<PressureColumn>,
    /// Anything else worth knowing, kept in the metadata.
    #[serde(default)]
    pub extra: BTreeMap<String, String>,
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

/// The time column.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeColumn {
    /// Which column.
    pub column: Column,
    /// Its unit.
    pub unit: TimeUnit,
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
}

/// The three columns of a vector sensor.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VectorColumns<U> {
    /// The file's x, y, z.
    pub columns: [Column; 3],
    /// Unit of the numbers.
    pub unit: Option<U>,
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

/// The column of a pressure sensor.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PressureColumn {
    /// Which column.
    pub column: Column,
    /// Its unit. Default `pa`.
    #[serde(default)]
    pub unit: PressureUnit,
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
    let manifest: Manifest = toml::from_str(text).map_err(|error| {
        let line = error.span().map_or(String::new(), |span| {
            let before = text.get(..span.start).unwrap_or(text);
            format!("line {}: ", before.matches('\n').count() + 1)
        });
        problem(
            file,
            format!("{line}{}", error.message().replace('\n', "; ")),
        )
    })?;
    if !manifest.delimiter.is_ascii() || manifest.comment.is_some_and(|c| !c.is_ascii()) {
        return Err(problem(
            file,
            "delimiter and comment must each be one ASCII character, e.g. \";\"".to_owned(),
        ));
    }
    if manifest.decimal_comma && manifest.delimiter == ',' {
        return Err(problem(
            file,
            "decimal_comma needs a delimiter other than the comma, e.g. delimiter = \";\""
                .to_owned(),
        ));
    }
    Ok(manifest)
}
