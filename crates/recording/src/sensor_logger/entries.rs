//! Splits a JSON array into its objects, with their places in the file.

use std::io::BufRead;

use serde::Deserialize;

use crate::error::{RecordingError, Result, shown};
use crate::limits::ENTRY;

/// One object of the array as text.
pub(super) struct Entry<'a> {
    text: &'a [u8],
    pub(super) start: u64,
    pub(super) end: u64,
    pub(super) line: u64,
}

impl<'a> Entry<'a> {
    pub(super) fn parse<T: Deserialize<'a>>(&self, file: &str) -> Result<T> {
        serde_json::from_slice(self.text).map_err(|error| {
            RecordingError::bad_line(
                file,
                self.line,
                format!(
                    "{}; expected a flat object with `sensor`, `time` and the sensor's values",
                    shown(&error.to_string())
                ),
            )
        })
    }
}

/// Splits the array into its objects.
pub(super) struct Entries {
    file: String,
    input: Box<dyn BufRead + Send>,
    /// Place and line of the next byte.
    pub(super) offset: u64,
    line: u64,
    text: Vec<u8>,
}

impl Entries {
    pub(super) fn new(input: Box<dyn BufRead + Send>, file: &str, offset: u64, line: u64) -> Self {
        Self {
            file: file.to_owned(),
            input,
            offset,
            line,
            text: Vec::new(),
        }
    }

    fn byte(&mut self) -> Result<Option<u8>> {
        let available = self
            .input
            .fill_buf()
            .map_err(|error| RecordingError::io(&self.file, "read it", error))?;
        let Some(&byte) = available.first() else {
            return Ok(None);
        };
        self.input.consume(1);
        self.offset += 1;
        self.line += u64::from(byte == b'\n');
        Ok(Some(byte))
    }

    /// The next byte that is neither blank nor comma.
    fn visible(&mut self) -> Result<Option<u8>> {
        loop {
            match self.byte()? {
                Some(b' ' | b'\t' | b'\r' | b'\n' | b',') => {}
                other => return Ok(other),
            }
        }
    }

    pub(super) fn expect_array(&mut self) -> Result<()> {
        let mut first = self.visible()?;
        if first == Some(0xef) {
            // A byte order mark.
            self.byte()?;
            self.byte()?;
            first = self.visible()?;
        }
        if first == Some(b'[') {
            return Ok(());
        }
        Err(RecordingError::not_a_recording(
            &self.file,
            "JSON that is not Sensor Logger's array of objects",
        ))
    }

    /// The next object; `None` at the end of the array.
    pub(super) fn next(&mut self) -> Result<Option<Entry<'_>>> {
        match self.visible()? {
            Some(b'{') => {}
            Some(b']') => return Ok(None),
            Some(other) => {
                let found = char::from(other).escape_default();
                return Err(self.bad(format!("`{found}` where an entry {{...}} was expected")));
            }
            None => return Err(self.cut_off()),
        }
        let (start, line) = (self.offset - 1, self.line);
        self.text.clear();
        self.text.push(b'{');
        let (mut depth, mut in_string, mut escaped) = (1_u32, false, false);
        while depth > 0 {
            let Some(byte) = self.byte()? else {
                return Err(self.cut_off());
            };
            self.text.push(byte);
            if self.text.len() as u64 > ENTRY.most {
                let found = format!("more than {}", ENTRY.most);
                return Err(ENTRY.exceeded(found, &self.file, &format!(", line {line}")));
            }
            match byte {
                _ if escaped => escaped = false,
                b'\\' if in_string => escaped = true,
                b'"' => in_string = !in_string,
                b'{' | b'[' if !in_string => depth += 1,
                b'}' | b']' if !in_string => depth -= 1,
                _ => {}
            }
        }
        Ok(Some(Entry {
            text: &self.text,
            start,
            end: self.offset,
            line,
        }))
    }

    fn bad(&self, problem: String) -> RecordingError {
        RecordingError::bad_line(&self.file, self.line, problem)
    }

    fn cut_off(&self) -> RecordingError {
        RecordingError::damaged(
            &self.file,
            format!(
                "the array is not closed at the end of the file, line {}",
                self.line
            ),
        )
    }
}
