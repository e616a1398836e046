//! Rows of delimited text, none of them endless.

use std::io::{self, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use csv::{ByteRecord, Position, ReaderBuilder, StringRecord};

use crate::error::{RecordingError, Result};
use crate::limits::LINE;
use crate::text::Input;

/// Bytes that the csv reader takes at once, among them parts of rows to come.
const BUFFER: usize = 1 << 16;

/// The rows of a file, with errors that name file and line.
pub(crate) struct Rows {
    file: String,
    reader: csv::Reader<Rationed>,
    ration: Arc<AtomicU64>,
    /// Lines of the file before the part that is read here.
    lines_before: u64,
}

impl Rows {
    pub(crate) fn new(
        file: String,
        builder: &mut ReaderBuilder,
        input: Input,
        lines_before: u64,
    ) -> Self {
        let ration = Arc::new(AtomicU64::new(RATION));
        let input = Rationed {
            input,
            ration: Arc::clone(&ration),
        };
        let reader = builder.buffer_capacity(BUFFER).from_reader(input);
        Self {
            file,
            reader,
            ration,
            lines_before,
        }
    }

    /// The first row, whether it is read again as a row or not.
    pub(crate) fn first(&mut self) -> Result<ByteRecord> {
        self.ration.store(RATION, Ordering::Relaxed);
        let first = self.reader.byte_headers().cloned();
        first.map_err(|error| self.problem(None, &error))
    }

    /// Reads the next row; false at the end.
    pub(crate) fn read(&mut self, row: &mut ByteRecord) -> Result<bool> {
        self.ration.store(RATION, Ordering::Relaxed);
        let more = self.reader.read_byte_record(row);
        more.map_err(|error| self.problem(row.position(), &error))
    }

    /// Reads the next row as text; false at the end.
    pub(crate) fn read_text(&mut self, row: &mut StringRecord) -> Result<bool> {
        self.ration.store(RATION, Ordering::Relaxed);
        let more = self.reader.read_record(row);
        more.map_err(|error| self.problem(row.position(), &error))
    }

    /// The line of a row in the file.
    pub(crate) fn line(&self, row: Option<&Position>) -> u64 {
        self.lines_before + row.map_or(0, Position::line)
    }

    pub(crate) fn file(&self) -> &str {
        &self.file
    }

    /// An error of the csv crate as ours.
    fn problem(&self, row: Option<&Position>, error: &csv::Error) -> RecordingError {
        match error.kind() {
            csv::ErrorKind::UnequalLengths {
                pos,
                expected_len,
                len,
            } => RecordingError::bad_line(
                &self.file,
                self.line(pos.as_ref()),
                format!("{len} cells where the first row has {expected_len}; is the line cut off?"),
            ),
            csv::ErrorKind::Io(cause) if is_endless(cause) => {
                let line = self.line(row).max(self.lines_before + 1);
                let place = format!(", line {line}");
                LINE.exceeded(format!("more than {}", LINE.most), &self.file, &place)
            }
            // Of compressed files.
            csv::ErrorKind::Io(cause)
                if matches!(
                    cause.kind(),
                    io::ErrorKind::InvalidData | io::ErrorKind::InvalidInput
                ) =>
            {
                RecordingError::damaged(&self.file, cause.to_string())
            }
            csv::ErrorKind::Io(cause) => {
                // The csv crate lends its error, io::Error is not Clone.
                let cause = io::Error::new(cause.kind(), cause.to_string());
                RecordingError::io(&self.file, "read it", cause)
            }
            _ => {
                let line = self.line(error.position());
                RecordingError::bad_line(&self.file, line, error.to_string())
            }
        }
    }
}

/// Bytes that may be read for one row: the row and what is read ahead.
const RATION: u64 = LINE.most + 2 * BUFFER as u64;

/// An input that gives no more than the ration, which is renewed for each row.
struct Rationed {
    input: Input,
    ration: Arc<AtomicU64>,
}

impl Read for Rationed {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let read = self.input.read(out)?;
        let left = self.ration.load(Ordering::Relaxed);
        let Some(left) = left.checked_sub(read as u64) else {
            return Err(io::Error::new(io::ErrorKind::InvalidData, Endless));
        };
        self.ration.store(left, Ordering::Relaxed);
        Ok(read)
    }
}

/// A row that does not end.
#[derive(Debug, thiserror::Error)]
#[error("a row that does not end")]
struct Endless;

fn is_endless(error: &io::Error) -> bool {
    error.get_ref().is_some_and(|inner| inner.is::<Endless>())
}
