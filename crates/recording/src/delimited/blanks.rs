//! Columns separated by runs of blanks.

use std::io::{BufRead, Read};

/// Turns runs of blanks and tabs into one blank, none at the start and end of lines.
pub(crate) struct Blanks<R> {
    input: R,
    /// A blank is owed before the next visible character of the line.
    owed: bool,
    line_start: bool,
    /// A byte that did not fit into the caller's buffer.
    kept: Option<u8>,
}

impl<R: BufRead> Blanks<R> {
    pub(crate) fn new(input: R) -> Self {
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
