//! Any other delimited text file, described by a small TOML manifest.
//!
//! Read first: `docs/formats.md`, which has an example. Opening the manifest opens the recording.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Cursor, Read};
use std::path::{Path, PathBuf};

use serde::Deserialize;

use crate::delimited::{Channel, DelimitedSource, Layout, csv_error};
use crate::error::{RecordingError, Result, join};
use crate::event::SensorKind;
use crate::metadata::{Metadata, WorldFrame};
use crate::open::named;
use crate::options::{FieldUnit, ForceUnit, OpenOptions, RateUnit};
use crate::recording::{Opened, Recording};

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
/// [`RecordingError::Manifest`] with the line and what was expected.
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

/// Reads delimited text in memory through a manifest in memory; `name` stands for both in messages.
///
/// # Errors
/// As [`crate::open`].
pub fn read_bytes(
    manifest: &str,
    data: Vec<u8>,
    name: &str,
    options: &OpenOptions,
) -> Result<Recording> {
    let manifest = parse(manifest, name)?;
    let opened = open_data(
        &manifest,
        name,
        Cursor::new(data),
        name,
        named(name.to_owned()),
        options,
    )?;
    Ok(Recording::new(name.to_owned(), opened, options))
}

/// Opens the data file that the manifest names.
pub(crate) fn open(path: &Path, options: &OpenOptions) -> Result<Opened> {
    let (manifest, file) = load(path)?;
    let Some(data) = &manifest.file else {
        return Err(problem(
            &file,
            "missing key `file`: the data file, relative to the manifest".to_owned(),
        ));
    };
    let data = path.parent().unwrap_or(Path::new("")).join(data);
    open_loaded(&manifest, &file, &data, options)
}

/// Opens `data` as the manifest at `path` describes, whatever file that names.
pub(crate) fn open_with_data(path: &Path, data: &Path, options: &OpenOptions) -> Result<Opened> {
    let (manifest, file) = load(path)?;
    open_loaded(&manifest, &file, data, options)
}

/// Reads a stream as the manifest at `path` describes.
pub(crate) fn open_stream(
    input: impl Read + Send + 'static,
    name: &str,
    path: &Path,
    options: &OpenOptions,
) -> Result<Opened> {
    let (manifest, file) = load(path)?;
    open_data(
        &manifest,
        &file,
        input,
        name,
        named(name.to_owned()),
        options,
    )
}

/// Whether there is a manifest at `path` which names `data`.
pub(crate) fn describes(path: &Path, data: &Path) -> bool {
    let Ok((manifest, _)) = load(path) else {
        return false;
    };
    let named = manifest.file.as_deref().and_then(Path::file_name);
    named.is_some() && named == data.file_name()
}

fn load(path: &Path) -> Result<(Manifest, String)> {
    /// A manifest is a page; anything longer is another file.
    const LONGEST: u64 = 1 << 20;
    let file = path.display().to_string();
    let mut text = String::new();
    File::open(path)
        .and_then(|input| input.take(LONGEST).read_to_string(&mut text))
        .map_err(|error| RecordingError::io(&file, "read the manifest", error))?;
    Ok((parse(&text, &file)?, file))
}

fn open_loaded(
    manifest: &Manifest,
    manifest_file: &str,
    data: &Path,
    options: &OpenOptions,
) -> Result<Opened> {
    let file = data.display().to_string();
    let input = File::open(data).map_err(|error| RecordingError::io(&file, "open it", error))?;
    let stem = data
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned();
    open_data(manifest, manifest_file, input, &file, named(stem), options)
}

fn open_data(
    manifest: &Manifest,
    manifest_file: &str,
    input: impl Read + Send + 'static,
    file: &str,
    mut metadata: Metadata,
    options: &OpenOptions,
) -> Result<Opened> {
    "manifest".clone_into(&mut metadata.format);
    metadata.world_frame = manifest.world_frame;
    metadata.device.clone_from(&manifest.device);
    metadata.extra.clone_from(&manifest.extra);
    if let Some(name) = &manifest.name {
        metadata.name.clone_from(name);
    }
    let mut input = BufReader::with_capacity(1 << 16, input);
    skip(&mut input, manifest.skip_rows, file)?;
    let blanks = manifest.delimiter == ' ';
    let input: Box<dyn Read + Send> = if blanks {
        Box::new(Blanks::new(input))
    } else {
        Box::new(input)
    };
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(manifest.delimiter as u8)
        .comment(manifest.comment.map(|c| c as u8))
        .has_headers(manifest.header)
        .buffer_capacity(1 << 16)
        .from_reader(input);
    // Without a header this is the first row, which stays to be read.
    let first = reader
        .byte_headers()
        .map_err(|error| csv_error(file, manifest.skip_rows, &error))?;
    if first.is_empty() {
        return Err(RecordingError::Empty {
            file: file.to_owned(),
            found: format!("nothing after {} skipped lines", manifest.skip_rows),
            expected: "rows of numbers",
        });
    }
    let names = if manifest.header {
        first
            .iter()
            .map(|name| {
                String::from_utf8_lossy(name.trim_ascii())
                    .trim_start_matches('\u{feff}')
                    .to_owned()
            })
            .collect()
    } else {
        (1..=first.len()).map(|number| number.to_string()).collect()
    };
    let layout = LayoutBuilder {
        manifest,
        manifest_file,
        file,
        names,
        options,
    }
    .build()?;
    Ok(Opened {
        metadata,
        sensors: layout.sensors(),
        source: Box::new(DelimitedSource::new(
            file.to_owned(),
            reader,
            layout,
            manifest.skip_rows,
        )),
        notes: Vec::new(),
        units_applied: true,
    })
}

fn skip(input: &mut impl BufRead, lines: u64, file: &str) -> Result<()> {
    for _ in 0..lines {
        let skipped = input
            .skip_until(b'\n')
            .map_err(|error| RecordingError::io(file, "read it", error))?;
        if skipped == 0 {
            return Ok(());
        }
    }
    Ok(())
}

/// Turns runs of blanks and tabs into one blank, none at the start and end of lines.
struct Blanks<R> {
    input: R,
    /// A blank is owed before the next visible character of the line.
    owed: bool,
    line_start: bool,
    /// A byte that did not fit into the caller's buffer.
    kept: Option<u8>,
}

impl<R: BufRead> Blanks<R> {
    fn new(input: R) -> Self {
        Self {
            input,
            owed: false,
            line_start: true,
            kept: None,
        }
    }
}

impl<R: BufRead> Read for Blanks<R> {
    fn read(&mut self, out: &mut [u8]) -> std::io::Result<usize> {
        let mut written = 0;
        if let (Some(byte), Some(place)) = (self.kept, out.first_mut()) {
            *place = byte;
            (self.kept, written) = (None, 1);
        }
        while written < out.len() {
            let available = self.input.fill_buf()?;
            if available.is_empty() {
                break;
            }
            let mut used = 0;
            for &byte in available {
                if written == out.len() {
                    break;
                }
                used += 1;
                match byte {
                    b' ' | b'\t' => self.owed = !self.line_start,
                    b'\n' | b'\r' => {
                        (self.owed, self.line_start) = (false, true);
                        out[written] = byte;
                        written += 1;
                    }
                    _ => {
                        self.line_start = false;
                        if std::mem::take(&mut self.owed) {
                            out[written] = b' ';
                            written += 1;
                        }
                        match out.get_mut(written) {
                            Some(place) => {
                                *place = byte;
                                written += 1;
                            }
                            None => self.kept = Some(byte),
                        }
                    }
                }
            }
            self.input.consume(used);
            if written > 0 {
                break;
            }
        }
        Ok(written)
    }
}

/// Finds the manifest's columns in the file.
struct LayoutBuilder<'a> {
    manifest: &'a Manifest,
    manifest_file: &'a str,
    file: &'a str,
    names: Vec<String>,
    options: &'a OpenOptions,
}

impl LayoutBuilder<'_> {
    fn build(self) -> Result<Layout> {
        let manifest = self.manifest;
        let mut channels = Vec::new();
        let rate = |unit: Option<RateUnit>| {
            self.options
                .gyroscope_unit
                .or(unit)
                .map_or(1.0, RateUnit::to_rad_per_s)
        };
        let force = |unit: Option<ForceUnit>| {
            self.options
                .accelerometer_unit
                .or(unit)
                .map_or(1.0, ForceUnit::to_m_per_s2)
        };
        let field = |unit: Option<FieldUnit>| {
            self.options
                .magnetometer_unit
                .or(unit)
                .map_or(1.0, FieldUnit::to_microtesla)
        };
        channels.extend(self.vector(SensorKind::Gyroscope, manifest.gyroscope.as_ref(), rate)?);
        channels.extend(self.vector(
            SensorKind::Accelerometer,
            manifest.accelerometer.as_ref(),
            force,
        )?);
        channels.extend(self.vector(
            SensorKind::Magnetometer,
            manifest.magnetometer.as_ref(),
            field,
        )?);
        let raw = manifest.magnetometer_uncalibrated.as_ref();
        channels.extend(self.vector(SensorKind::MagnetometerUncalibrated, raw, field)?);
        let bias = manifest.device_gyroscope_bias.as_ref();
        channels.extend(self.vector(SensorKind::DeviceGyroscopeBias, bias, rate)?);
        channels.extend(self.vector(SensorKind::Position, manifest.position.as_ref(), |_| 1.0)?);
        channels.extend(self.vector(SensorKind::Velocity, manifest.velocity.as_ref(), |_| 1.0)?);
        if let Some(device) = &manifest.device_orientation {
            if device.scored.is_some() {
                return Err(problem(
                    self.manifest_file,
                    "[device_orientation] has `scored`, which belongs to [reference]".to_owned(),
                ));
            }
            let (columns, inverse) = self.quaternion(device)?;
            channels.push(Channel::DeviceOrientation { columns, inverse });
        }
        if let Some(pressure) = &manifest.pressure {
            let factor = match pressure.unit {
                PressureUnit::Pa => 1.0,
                PressureUnit::Hpa => 100.0,
                PressureUnit::Kpa => 1000.0,
            };
            let column = self.column(&pressure.column)?;
            channels.push(Channel::Pressure { column, factor });
        }
        if let Some(reference) = &manifest.reference {
            let (columns, inverse) = self.quaternion(reference)?;
            let scored = reference
                .scored
                .as_ref()
                .map(|c| self.column(c))
                .transpose()?;
            channels.push(Channel::Reference {
                columns,
                inverse,
                scored,
            });
        }
        self.finish(channels)
    }

    fn finish(self, channels: Vec<Channel>) -> Result<Layout> {
        let layout = Layout {
            time: self.column(&self.manifest.time.column)?,
            time_exponent: match self.manifest.time.unit {
                TimeUnit::S => 9,
                TimeUnit::Ms => 6,
                TimeUnit::Us => 3,
                TimeUnit::Ns => 0,
            },
            channels,
            decimal_comma: self.manifest.decimal_comma,
            names: self.names,
        };
        if self.manifest.gyroscope.is_none() {
            return Err(RecordingError::no_gyroscope(
                self.manifest_file,
                &layout.sensors(),
            ));
        }
        Ok(layout)
    }

    fn column(&self, column: &Column) -> Result<usize> {
        let missing = |what: String| RecordingError::MissingColumns {
            file: self.file.to_owned(),
            missing: what,
            present: join(self.names.iter().map(String::as_str)),
            advice: format!("correct the column in {}", self.manifest_file),
        };
        match column {
            Column::Number(0) => Err(problem(
                self.manifest_file,
                "column number 0: columns are counted from 1".to_owned(),
            )),
            Column::Number(number) if *number <= self.names.len() => Ok(number - 1),
            Column::Number(number) => Err(missing(format!("column number {number}"))),
            Column::Name(_) if !self.manifest.header => Err(problem(
                self.manifest_file,
                "with header = false columns are given by number, from 1".to_owned(),
            )),
            Column::Name(name) => {
                let mut places = self.names.iter().enumerate().filter(|(_, n)| *n == name);
                let Some((place, _)) = places.next() else {
                    return Err(missing(format!("column {}", join([name.as_str()]))));
                };
                if places.next().is_some() {
                    return Err(RecordingError::RepeatedColumn {
                        file: self.file.to_owned(),
                        column: name.clone(),
                    });
                }
                Ok(place)
            }
        }
    }

    fn vector<U: Copy>(
        &self,
        kind: SensorKind,
        columns: Option<&VectorColumns<U>>,
        factor: impl Fn(Option<U>) -> f64,
    ) -> Result<Option<Channel>> {
        let Some(vector) = columns else {
            return Ok(None);
        };
        let factor = factor(vector.unit);
        let axes = match &vector.axes {
            Some(text) => parse_axes(text).ok_or_else(|| {
                problem(
                    self.manifest_file,
                    format!(
                        "[{}] axes = {text:?}: expected each of x, y, z once, with or without a minus, e.g. \"x,-y,z\"",
                        kind.name().replace('-', "_")
                    ),
                )
            })?,
            None => [(0, 1.0), (1, 1.0), (2, 1.0)],
        };
        let mut places = [0; 3];
        let mut factors = [1.0; 3];
        for (body_axis, (file_axis, sign)) in axes.into_iter().enumerate() {
            places[body_axis] = self.column(&vector.columns[file_axis])?;
            factors[body_axis] = sign * factor;
        }
        Ok(Some(Channel::Vector {
            kind,
            columns: places,
            factors,
        }))
    }

    fn quaternion(&self, quaternion: &QuaternionColumns) -> Result<([usize; 4], bool)> {
        let mut places = [0; 4];
        for (place, column) in places.iter_mut().zip(&quaternion.columns) {
            *place = self.column(column)?;
        }
        if matches!(quaternion.order, QuaternionOrder::Xyzw) {
            places.rotate_right(1);
        }
        Ok((
            places,
            quaternion.direction == QuaternionDirection::WorldToBody,
        ))
    }
}

/// `x,-y,z`: for each body axis the file's axis and its sign.
fn parse_axes(text: &str) -> Option<[(usize, f64); 3]> {
    let mut axes = [(0, 0.0); 3];
    let mut used = [false; 3];
    let mut parts = text.split(',');
    for axis in &mut axes {
        let part = parts.next()?.trim();
        let (name, sign) = part
            .strip_prefix('-')
            .map_or((part, 1.0), |rest| (rest, -1.0));
        let place = ["x", "y", "z"].iter().position(|n| *n == name)?;
        if std::mem::replace(&mut used[place], true) {
            return None;
        }
        *axis = (place, sign);
    }
    parts.next().is_none().then_some(axes)
}

fn problem(file: &str, problem: String) -> RecordingError {
    RecordingError::Manifest {
        file: file.to_owned(),
        problem,
    }
}
