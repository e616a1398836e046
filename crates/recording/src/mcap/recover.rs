//! Makes an unfinished recording whole: everything up to the cut, with an index.

use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

use ::mcap::McapError;
use tempfile::NamedTempFile;

use super::file::{Messages, has_end};
use super::output::{io_error, options};
use crate::error::{RecordingError, Result};

/// What was found in an unfinished recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Recovered {
    /// Messages up to the cut.
    pub messages: u64,
    /// The file's length now, bytes.
    pub bytes: u64,
}

/// Whether a recording was closed as it should be.
///
/// # Errors
/// It cannot be read.
pub fn is_complete(path: &Path) -> std::io::Result<bool> {
    has_end(&mut File::open(path)?)
}

/// Rewrites an unfinished recording with what can be read of it. The old file stays until the new one
/// is complete on the disk, and stays altogether when nothing can be read or written.
///
/// # Errors
/// Nothing could be read, or the disk refuses.
pub fn recover(path: &Path) -> Result<Recovered> {
    let file = path.display().to_string();
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let refused = |error| RecordingError::io(&file, "recover it", error);
    let input = File::open(path).map_err(refused)?;
    let messages = Messages::new(Box::new(input), &file)?;
    let temporary = NamedTempFile::new_in(folder).map_err(refused)?;
    let (temporary, messages) =
        copy(messages, temporary).map_err(|error| refused(io_error(error)))?;
    if messages == 0 {
        return Err(RecordingError::damaged(file, "nothing in it can be read"));
    }
    let output = temporary.as_file();
    output.sync_all().map_err(refused)?;
    let bytes = output.metadata().map_err(refused)?.len();
    temporary
        .persist(path)
        .map_err(|error| refused(error.error))?;
    Ok(Recovered { messages, bytes })
}

fn copy(
    input: Messages,
    output: NamedTempFile,
) -> std::result::Result<(NamedTempFile, u64), McapError> {
    let mut output = options().create(BufWriter::new(output))?;
    let mut messages = 0;
    for message in input {
        output.write(&message)?;
        messages += 1;
    }
    output.finish()?;
    let mut output = output.into_inner();
    output.flush()?;
    let output = output
        .into_inner()
        .map_err(|error| McapError::Io(error.into_error()))?;
    Ok((output, messages))
}
