//! Writing recordings: what all writers share.

use std::path::Path;

use crate::csv_writer::CsvWriter;
use crate::error::{RecordingError, Result};
use crate::event::{Event, Reference, Sample, SensorKind};
use crate::metadata::Metadata;
use crate::numbers;
use crate::watched::Watched;

/// Takes events in time order and makes a file of them. Nothing appears under the file's name
/// before [`EventWriter::finish`].
pub trait EventWriter {
    /// Takes the next event. Events of equal stamps that follow each other share a row.
    ///
    /// # Errors
    /// [`RecordingError::NoColumnFor`] for a sensor not named at creation; [`RecordingError::Io`].
    fn write(&mut self, event: &Event) -> Result<()>;

    /// Completes the file.
    ///
    /// # Errors
    /// [`RecordingError::Io`], or [`RecordingError::Exists`] when the name has been taken meanwhile.
    fn finish(self: Box<Self>) -> Result<()>;
}

/// Writes all events that are still to come, and completes the file; how many they were.
///
/// # Errors
/// What ends the events early, and as [`EventWriter`]; there is no file then.
pub fn write_events(mut writer: Box<dyn EventWriter>, events: &mut Watched<'_>) -> Result<u64> {
    let mut count = 0;
    for event in events {
        writer.write(&event?)?;
        count += 1;
    }
    writer.finish()?;
    Ok(count)
}

/// Creates a recording at `path`: `.parquet`, `.csv` or `.mcap` (messages of ROS 2) by its extension,
/// with columns for `sensors`.
///
/// # Errors
/// [`RecordingError::Unsupported`] for other extensions, and as [`crate::AtomicFile::create`].
pub fn create(
    path: &Path,
    metadata: &Metadata,
    sensors: &[SensorKind],
    force: bool,
) -> Result<Box<dyn EventWriter>> {
    let unsupported =
        |problem: &str| RecordingError::unsupported(path.display().to_string(), problem);
    let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("csv") => Ok(Box::new(CsvWriter::create(path, metadata, sensors, force)?)),
        #[cfg(feature = "parquet")]
        Some("parquet") => Ok(Box::new(crate::parquet_writer::ParquetWriter::create(
            path, metadata, sensors, force,
        )?)),
        #[cfg(not(feature = "parquet"))]
        Some("parquet") => Err(unsupported(
            "this build cannot write Parquet; build with `--features parquet`, or write .csv",
        )),
        #[cfg(feature = "mcap")]
        Some("mcap") => Ok(Box::new(crate::mcap::RosWriter::create(
            path, metadata, force,
        )?)),
        #[cfg(not(feature = "mcap"))]
        Some("mcap") => Err(unsupported(
            "this build cannot write MCAP; build with `--features mcap`, or write .csv",
        )),
        _ => Err(unsupported(
            "recordings are written as .csv, .parquet or .mcap; name the output so",
        )),
    }
}

/// Gathers the events of one instant: at most one a sensor.
#[derive(Debug, Default)]
pub(crate) struct Row {
    pub(crate) time_ns: i64,
    samples: [Option<Sample>; SensorKind::ALL.len()],
    empty: bool,
}

impl Row {
    pub(crate) fn new() -> Self {
        Self {
            empty: true,
            ..Self::default()
        }
    }

    /// Whether the event still belongs to this row.
    pub(crate) fn takes(&self, event: &Event) -> bool {
        self.empty || (self.time_ns == event.time_ns && self.get(event.sample.kind()).is_none())
    }

    pub(crate) fn put(&mut self, event: &Event) {
        self.time_ns = event.time_ns;
        self.samples[event.sample.kind().order()] = Some(event.sample);
        self.empty = false;
    }

    pub(crate) fn get(&self, kind: SensorKind) -> Option<&Sample> {
        self.samples[kind.order()].as_ref()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.empty
    }

    pub(crate) fn clear(&mut self) {
        *self = Self::new();
    }
}

/// The sensors a file gets columns for, in [`SensorKind::ALL`] order and each once.
pub(crate) fn in_order(sensors: &[SensorKind]) -> Vec<SensorKind> {
    SensorKind::ALL
        .into_iter()
        .filter(|kind| sensors.contains(kind))
        .collect()
}

/// The numbers of a sample in the order of its columns; quaternions w, x, y, z with w >= 0, NaN where
/// one is absent.
pub(crate) fn numbers(sample: &Sample) -> ([f64; numbers::MOST], usize) {
    let (mut row, count) = numbers::numbers(sample);
    if let Sample::DeviceOrientation(q) | Sample::Reference(Reference { attitude: q, .. }) = sample
    {
        row[..4].copy_from_slice(&quaternion_to_file(q));
    }
    (row, count)
}

/// w, x, y, z with w >= 0.
pub(crate) fn quaternion_to_file(q: &nalgebra::UnitQuaternion<f64>) -> [f64; 4] {
    let sign = if q.w < 0.0 { -1.0 } else { 1.0 };
    [q.w * sign, q.i * sign, q.j * sign, q.k * sign]
}
