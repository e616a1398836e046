//! Text files: lines of limited length, manifests, and where a TOML text is wrong.

use std::fs::File;
use std::io::{BufRead, ErrorKind, Read};
use std::path::Path;

use crate::error::{RecordingError, Result};
use crate::limits::read_description;

/// What a reader of a format reads from, whatever that is: so each of them is compiled once.
pub(crate) type Input = Box<dyn Read + Send>;

/// Reads on into `piece` however often it is interrupted; 0 at the end.
pub(crate) fn read_piece(input: &mut impl Read, piece: &mut [u8]) -> std::io::Result<usize> {
    loop {
        match input.read(piece) {
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            read => return read,
        }
    }
}

/// Reads a line into `line`, at most `longest` bytes of it; false at the end.
pub(crate) fn read_line(
    input: &mut impl BufRead,
    longest: u64,
    line: &mut Vec<u8>,
    file: &str,
) -> Result<bool> {
    line.clear();
    let read = input.take(longest).read_until(b'\n', line);
    let read = read.map_err(|error| RecordingError::io(file, "read it", error))?;
    Ok(read > 0)
}

/// Opens a file to read it.
pub(crate) fn open_file(path: &Path, file: &str) -> Result<File> {
    File::open(path).map_err(|error| RecordingError::io(file, "open it", error))
}

/// The text of a manifest and its name for messages.
pub(crate) fn read_manifest(path: &Path) -> Result<(String, String)> {
    Ok((read_description(path)?, path.display().to_string()))
}

/// Which line of a TOML text is wrong, and what was expected there.
#[must_use]
pub fn toml_problem(text: &str, error: &toml::de::Error) -> String {
    let line = error.span().map_or(String::new(), |span| {
        let before = text.get(..span.start).unwrap_or(text);
        format!("line {}: ", before.matches('\n').count() + 1)
    });
    format!("{line}{}", error.message().replace('\n', "; "))
}
