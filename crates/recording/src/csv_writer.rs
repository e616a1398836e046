//! Writes our CSV: one row per instant, streaming. See `docs/formats.md`.

use std::path::Path;

use crate::atomic_file::AtomicFile;
use crate::csv::{
    DEVICE_ORIENTATION, PRESSURE, REFERENCE, SCORED, TIME_S, VECTORS, vector_columns,
};
use crate::error::{RecordingError, Result};
use crate::event::{Event, Sample, SensorKind};
use crate::metadata::Metadata;
use crate::stamp;
use crate::writer::{EventWriter, Row, in_order, numbers};

/// A CSV being written. Numbers are written so that they read back exactly.
#[derive(Debug)]
pub struct CsvWriter {
    output: AtomicFile,
    sensors: Vec<SensorKind>,
    row: Row,
}

impl CsvWriter {
    /// Starts the file with metadata and header. `sensors` are the kinds that may come; each gets
    /// its columns.
    ///
    /// # Errors
    /// As [`AtomicFile::create`].
    pub fn create(
        path: &Path,
        metadata: &Metadata,
        sensors: &[SensorKind],
        force: bool,
    ) -> Result<Self> {
        let mut output = AtomicFile::create(path, force)?;
        write_metadata(&mut output, metadata)?;
        let sensors = in_order(sensors);
        let mut header = vec![TIME_S.to_owned()];
        header.extend(sensors.iter().flat_map(|kind| columns(*kind)));
        output.print(format_args!("{}\n", header.join(",")))?;
        Ok(Self {
            output,
            sensors,
            row: Row::new(),
        })
    }

    fn write_row(&mut self) -> Result<()> {
        if self.row.is_empty() {
            return Ok(());
        }
        self.output
            .print(format_args!("{}", stamp::format_s(self.row.time_ns)))?;
        for &kind in &self.sensors {
            match self.row.get(kind) {
                Some(sample) => {
                    let (values, count) = numbers(sample);
                    for value in &values[..count] {
                        self.output.print(format_args!(",{value}"))?;
                    }
                    if let Sample::Reference(reference) = sample {
                        self.output
                            .print(format_args!(",{}", u8::from(reference.scored)))?;
                    }
                }
                None => self
                    .output
                    .print(format_args!("{:,<1$}", "", columns(kind).len()))?,
            }
        }
        self.row.clear();
        self.output.print(format_args!("\n"))
    }
}

impl EventWriter for CsvWriter {
    fn write(&mut self, event: &Event) -> Result<()> {
        let kind = event.sample.kind();
        if !self.sensors.contains(&kind) {
            return Err(RecordingError::NoColumnFor {
                file: self.output.path().display().to_string(),
                sensor: kind.name(),
            });
        }
        if !self.row.takes(event) {
            self.write_row()?;
        }
        self.row.put(event);
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        self.write_row()?;
        self.output.commit()
    }
}

/// The columns of a sensor.
fn columns(kind: SensorKind) -> Vec<String> {
    let fixed = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect();
    match kind {
        SensorKind::DeviceOrientation => fixed(&DEVICE_ORIENTATION),
        SensorKind::Pressure => fixed(&[PRESSURE]),
        SensorKind::Reference => fixed(&[&REFERENCE[..], &[SCORED]].concat()),
        _ => VECTORS
            .iter()
            .filter(|(vector, ..)| *vector == kind)
            .flat_map(|(_, prefix, suffix)| vector_columns(prefix, suffix))
            .collect(),
    }
}

fn write_metadata(output: &mut AtomicFile, metadata: &Metadata) -> Result<()> {
    let mut line = |key: &str, value: &str| {
        let value = value.replace(['\n', '\r'], " ");
        output.print(format_args!("# {key}: {value}\n"))
    };
    line("name", &metadata.name)?;
    if let Some(device) = &metadata.device {
        line("device", device)?;
    }
    line("world_frame", metadata.world_frame.name())?;
    for (key, value) in &metadata.extra {
        // A colon or a line break in a key would read back as another key.
        line(&key.replace([':', '\n', '\r'], "_"), value)?;
    }
    Ok(())
}
