//! Writes Parquet with one row per instant, as `docs/formats.md` says (feature `parquet`).
//!
//! Numbers are doubles, so nothing is lost; row groups are bounded, so memory is too.

use std::path::Path;

use parquet::data_type::{DoubleType, Int32Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::writer::SerializedFileWriter;

use crate::atomic_file::AtomicFile;
use crate::error::{RecordingError, Result};
use crate::event::{Event, Sample, SensorKind};
use crate::metadata::Metadata;
use crate::numbers::{MOST, columns, widths};
use crate::parquet::{MOVING, SENSORS, START_NS, TIME};
use crate::parquet_table::{begin, failed};
use crate::writer::{EventWriter, Row, in_order, numbers};

/// Rows of a row group: what is held in memory.
const GROUP_ROWS: usize = 32_768;

/// A Parquet file being written.
pub struct ParquetWriter {
    file: String,
    output: SerializedFileWriter<AtomicFile>,
    sensors: Vec<SensorKind>,
    metadata: Metadata,
    start_ns: Option<i64>,
    row: Row,
    /// The time and every sensor's columns, then the flag of the reference.
    columns: Vec<Vec<f64>>,
    moving: Vec<i32>,
}

impl ParquetWriter {
    /// Starts the file. `sensors` are the kinds that may come; each gets its columns.
    ///
    /// # Errors
    /// As [`AtomicFile::create`].
    pub fn create(
        path: &Path,
        metadata: &Metadata,
        sensors: &[SensorKind],
        force: bool,
    ) -> Result<Self> {
        let file = path.display().to_string();
        let sensors = in_order(sensors);
        let names: Vec<&str> = std::iter::once(TIME)
            .chain(sensors.iter().flat_map(|kind| columns(&SENSORS, *kind)))
            .collect();
        let mut message: String = names
            .iter()
            .map(|name| format!("required double {name}; "))
            .collect();
        if sensors.contains(&SensorKind::Reference) {
            message.push_str(&format!("required int32 {MOVING};"));
        }
        let message = format!("message recording {{ {message} }}");
        let output = begin(path, &message, false, force)?;
        Ok(Self {
            columns: vec![Vec::new(); names.len()],
            file,
            output,
            sensors,
            metadata: metadata.clone(),
            start_ns: None,
            row: Row::new(),
            moving: Vec::new(),
        })
    }

    fn end_row(&mut self) -> Result<()> {
        if self.row.is_empty() {
            return Ok(());
        }
        let start_ns = *self.start_ns.get_or_insert(self.row.time_ns);
        self.columns[0].push(self.row.time_ns.saturating_sub(start_ns) as f64 * 1e-9);
        let mut place = 1;
        for &kind in &self.sensors {
            let width = widths(kind).0;
            let sample = self.row.get(kind);
            let values = sample.map_or([f64::NAN; MOST], |sample| numbers(sample).0);
            for (column, value) in self.columns[place..place + width].iter_mut().zip(values) {
                column.push(value);
            }
            place += width;
        }
        let scored = match self.row.get(SensorKind::Reference) {
            Some(Sample::Reference(reference)) => reference.scored,
            _ => false,
        };
        self.moving.push(i32::from(scored));
        self.row.clear();
        if self.columns[0].len() == GROUP_ROWS {
            self.end_group()?;
        }
        Ok(())
    }

    fn end_group(&mut self) -> Result<()> {
        self.write_group()
            .map_err(|error| failed(&self.file, &error))
    }

    fn write_group(&mut self) -> std::result::Result<(), ParquetError> {
        let mut group = self.output.next_row_group()?;
        for column in &mut self.columns {
            if let Some(mut writer) = group.next_column()? {
                writer
                    .typed::<DoubleType>()
                    .write_batch(column, None, None)?;
                writer.close()?;
            }
            column.clear();
        }
        if let Some(mut writer) = group.next_column()? {
            writer
                .typed::<Int32Type>()
                .write_batch(&self.moving, None, None)?;
            writer.close()?;
        }
        self.moving.clear();
        group.close()?;
        Ok(())
    }

    fn add_metadata(&mut self) {
        let mut pairs = vec![
            ("name".to_owned(), self.metadata.name.clone()),
            (
                "world_frame".to_owned(),
                self.metadata.world_frame.name().to_owned(),
            ),
            (START_NS.to_owned(), self.start_ns.unwrap_or(0).to_string()),
        ];
        if let Some(device) = &self.metadata.device {
            pairs.push(("device".to_owned(), device.clone()));
        }
        let told = self.metadata.body_and_receiver().into_iter();
        pairs.extend(told.map(|(key, value)| (key.to_owned(), value)));
        pairs.extend(self.metadata.extra.clone());
        for (key, value) in pairs {
            self.output
                .append_key_value_metadata(KeyValue::new(key, value));
        }
    }
}

impl EventWriter for ParquetWriter {
    fn write(&mut self, event: &Event) -> Result<()> {
        let kind = event.sample.kind();
        if !self.sensors.contains(&kind) {
            return Err(RecordingError::no_column_for(&self.file, kind.name()));
        }
        if !self.row.takes(event) {
            self.end_row()?;
        }
        self.row.put(event);
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        self.end_row()?;
        if !self.columns[0].is_empty() {
            self.end_group()?;
        }
        self.add_metadata();
        let file = self.file;
        let output = self
            .output
            .into_inner()
            .map_err(|error| failed(&file, &error))?;
        output.commit()
    }
}

impl std::fmt::Debug for ParquetWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("ParquetWriter")
            .field("file", &self.file)
            .field("sensors", &self.sensors)
            .finish_non_exhaustive()
    }
}
