//! Rows of delimited text, none of them endless.

use std::io::{self, Read};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};

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
    /// Whether lines end in CR LF: the csv crate has not yet counted that of the row before when it says where a row begins.
    has_crlf: Arc<AtomicBool>,
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
        let has_crlf = Arc::new(AtomicBool::new(false));
        let input = Rationed {
            input,
            ration: Arc::clone(&ration),
            has_crlf: Arc::clone(&has_crlf),
            is_begun: false,
        };
        let reader = builder.buffer_capacity(BUFFER).from_reader(input);
        Self {
            file,
            reader,
            ration,
            has_crlf,
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
        let late = |row: &Position| row.byte() > 0 && self.has_crlf.load(Ordering::Relaxed);
        self.lines_before + row.map_or(0, |row| row.line() + u64::from(late(row)))
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
    has_crlf: Arc<AtomicBool>,
    /// Whether something was read: the first part says how lines end.
    is_begun: bool,
}

impl Read for Rationed {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let read = self.input.read(out)?;
        if !self.is_begun {
            self.is_begun = true;
            let first = out.get(..read).unwrap_or_default();
            let end = first.iter().position(|byte| *byte == b'\n');
            let is_crlf = end.is_some_and(|end| end > 0 && first[end - 1] == b'\r');
            self.has_crlf.store(is_crlf, Ordering::Relaxed);
        }
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
