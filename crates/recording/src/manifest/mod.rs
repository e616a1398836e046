//! Recordings described by a small TOML manifest: any delimited text, and several files as one recording.
//!
//! Read first: `docs/formats.md`, which has examples. Opening the manifest opens the recording.

pub(crate) mod combined;
mod layout;
mod navigation;
mod schema;
mod table;

use std::io::Cursor;
use std::path::{Path, PathBuf};

use crate::error::{RecordingError, Result};
use crate::event::SensorKind;
use crate::local_place::LocalPlace;
use crate::metadata::Metadata;
use crate::numpy;
use crate::open::{has_extension, open_data_file, stem};
use crate::options::{Format, OpenOptions, TopicChoice};
use crate::recording::{Opened, Recording, Scale};
use crate::text::{Input, read_manifest};

pub use navigation::{
    AngleUnit, CoordinateUnit, EcefColumns, HeadingColumn, HeightUnit, LocalColumns, Origin,
    PositionColumns, QualityCode, SpeedUnit, VelocityAxes, VelocityColumns, WaterColumns,
};
pub use schema::{
    Column, ForceColumnUnit, General, Latency, LeverArm, Manifest, Metre, MetrePerSecond,
    NumberColumn, PressureUnit, QuaternionColumns, QuaternionDirection, QuaternionOrder,
    RateColumnUnit, Role, RowFilter, Source, TimeColumn, TimeUnit, Use, VectorColumns, parse,
};

/// Reads delimited text in memory through a manifest in memory; `name` stands for both in messages.
///
/// # Errors
/// As [`crate::open()`].
pub fn read_bytes(
    manifest: &str,
    data: Vec<u8>,
    name: &str,
    options: &OpenOptions,
) -> Result<Recording> {
    let loaded = Loaded {
        manifest: parse(manifest, name)?,
        file: name.to_owned(),
    };
    let opened = loaded.stream(Box::new(Cursor::new(data)), name, name.to_owned(), options)?;
    Ok(Recording::new(name.to_owned(), opened, options))
}

/// Opens the data files that the manifest names.
pub(crate) fn open(path: &Path, options: &OpenOptions) -> Result<Opened> {
    Loaded::read(path)?.open(path, options)
}

/// Opens the data files that the text of a manifest names, which stands for one at `path`.
///
/// # Errors
/// As [`crate::open()`].
pub fn open_text(text: &str, path: &Path, options: &OpenOptions) -> Result<Recording> {
    let file = path.display().to_string();
    let opened = opened_text(text, path, options)?;
    Ok(Recording::new(file, opened, options))
}

pub(crate) fn opened_text(text: &str, path: &Path, options: &OpenOptions) -> Result<Opened> {
    let file = path.display().to_string();
    let manifest = parse(text, &file)?;
    Loaded { manifest, file }.open(path, options)
}

/// Opens `data` as the manifest at `path` describes, whatever file that names.
pub(crate) fn open_with_data(path: &Path, data: &Path, options: &OpenOptions) -> Result<Opened> {
    let loaded = Loaded::read(path)?;
    let source = loaded.only_source()?;
    let opened = loaded.source(source, path, data, options)?;
    loaded.finish(vec![(source, opened)], stem(data), options)
}

/// Reads a stream as the manifest at `path` describes.
pub(crate) fn open_stream(
    input: Input,
    name: &str,
    path: &Path,
    options: &OpenOptions,
) -> Result<Opened> {
    Loaded::read(path)?.stream(input, name, name.to_owned(), options)
}

/// Whether there is a manifest at `path` which names `data` and no other file.
pub(crate) fn describes(path: &Path, data: &Path) -> bool {
    let Ok(loaded) = Loaded::read(path) else {
        return false;
    };
    let [source] = &loaded.manifest.sources[..] else {
        return false;
    };
    let named = source.file.as_deref().and_then(Path::file_name);
    named.is_some() && named == data.file_name()
}

/// A manifest and the file for messages.
struct Loaded {
    manifest: Manifest,
    file: String,
}

impl Loaded {
    fn read(path: &Path) -> Result<Self> {
        let (text, file) = read_manifest(path)?;
        let manifest = parse(&text, &file)?;
        Ok(Self { manifest, file })
    }

    fn problem(&self, problem: impl Into<String>) -> RecordingError {
        RecordingError::manifest(&self.file, problem)
    }

    /// Opens the data files that it names; it is, or stands for one, at `path`.
    fn open(&self, path: &Path, options: &OpenOptions) -> Result<Opened> {
        let folder = match &options.data {
            Some(folder) => folder,
            None => path.parent().unwrap_or(Path::new("")),
        };
        let mut parts = Vec::new();
        let mut name = stem(path);
        let sources = &self.manifest.sources;
        for source in sources {
            let Some(data) = &source.file else {
                return Err(self.problem(
                    "missing key `file`: the data file, relative to the folder of data or to the manifest",
                ));
            };
            let data = folder.join(data);
            if sources.len() == 1 {
                name = stem(&data);
            }
            parts.push((source, self.source(source, path, &data, options)?));
        }
        if parts.is_empty() {
            return Err(self.problem("no [[source]]: each names a `file`"));
        }
        self.finish(parts, name, options)
    }

    /// The source of a manifest that has one.
    fn only_source(&self) -> Result<&Source> {
        let [source] = &self.manifest.sources[..] else {
            return Err(self.problem("describes several files; open the manifest itself"));
        };
        Ok(source)
    }

    /// Opens one source on disk.
    fn source(
        &self,
        source: &Source,
        manifest: &Path,
        data: &Path,
        options: &OpenOptions,
    ) -> Result<Opened> {
        if source.time.is_some() || source.format == Some(Format::Manifest) {
            if let Some(Use::Topics(_)) = source.taken {
                return Err(self.problem("`use` has topics, which are of bags; this is a table"));
            }
            let file = data.display().to_string();
            let input = numpy::open_table(data, &file)?;
            return table::open(source, &self.file, input, &file, options);
        }
        if same_file(manifest, data) || has_extension(data, "toml") {
            return Err(self.problem(format!("{} is a manifest, not a data file", data.display())));
        }
        let options = OpenOptions {
            topics: self.topics(source)?,
            ..options.clone()
        };
        open_data_file(data, source.format, &options)
    }

    /// The topics that a source names of a bag.
    fn topics(&self, source: &Source) -> Result<Option<TopicChoice>> {
        let of_sensor = match &source.taken {
            Some(Use::Topics(topics)) => Some(topics.clone()),
            _ => None,
        };
        let local_position = match &source.local_position {
            None => None,
            Some(local) => Some(self.local_topic(local)?),
        };
        let has_topics = of_sensor.is_some() || local_position.is_some();
        Ok(has_topics.then_some(TopicChoice {
            of_sensor,
            local_position,
        }))
    }

    fn local_topic(&self, local: &LocalColumns) -> Result<(String, LocalPlace)> {
        let wrong = |what: &str| Err(self.problem(format!("[local_position] {what}")));
        let Some(topic) = &local.topic else {
            return wrong("needs `topic`, of a bag; of a table the source needs [time], too");
        };
        if local.columns.is_some() || local.std.is_some() {
            return wrong("has `topic`, of a bag, and `columns` or `std`, of a table");
        }
        let place = LocalPlace::new(&local.origin, local.axes, local.std_m, &self.file)?;
        Ok((topic.clone(), place))
    }

    fn stream(
        &self,
        input: Input,
        file: &str,
        name: String,
        options: &OpenOptions,
    ) -> Result<Opened> {
        let source = self.only_source()?;
        let opened = table::open(source, &self.file, input, file, options)?;
        self.finish(vec![(source, opened)], name, options)
    }

    /// The sources together, with what the manifest, or the file of the inertial sensor, says of the whole recording.
    fn finish(
        &self,
        parts: Vec<(&Source, Opened)>,
        name: String,
        options: &OpenOptions,
    ) -> Result<Opened> {
        let told = told(&parts);
        let mut opened = combined::combine(parts, Scale::new(options));
        RecordingError::check_sensors(&self.file, &opened.sensors)?;
        let general = &self.manifest.general;
        let latency = general.latency.unwrap_or(Latency {
            gnss_position_s: told.gnss_position_latency_s,
            gnss_velocity_s: told.gnss_velocity_latency_s,
        });
        opened.metadata = Metadata {
            name: general.name.clone().unwrap_or(name),
            format: "manifest".to_owned(),
            world_frame: general.world_frame.unwrap_or(told.world_frame),
            // Another world has other axes, unless they are said.
            body_axes: general.body_axes.or(match general.world_frame {
                Some(world) if world != told.world_frame => None,
                _ => told.body_axes,
            }),
            device: general.device.clone().or(told.device),
            gnss_lever_arm_m: general
                .lever_arm
                .map(|arm| arm.frd_m)
                .or(told.gnss_lever_arm_m),
            gnss_position_latency_s: latency.gnss_position_s,
            gnss_velocity_latency_s: latency.gnss_velocity_s,
            extra: general.extra.clone(),
        };
        Ok(opened)
    }
}

/// What the first source with an inertial sensor says of itself; nothing where it is a table.
fn told(parts: &[(&Source, Opened)]) -> Metadata {
    let inertial = [SensorKind::Gyroscope, SensorKind::Accelerometer];
    let found = parts.iter().find(|(source, opened)| {
        source.role == Role::Sensors && opened.sensors.iter().any(|kind| inertial.contains(kind))
    });
    found.map_or_else(Metadata::default, |(_, opened)| opened.metadata.clone())
}

fn same_file(one: &Path, other: &Path) -> bool {
    let canonical = |path: &Path| path.canonicalize().unwrap_or(PathBuf::from(path));
    canonical(one) == canonical(other)
}
