//! Sensor Logger's zip: its tables are unpacked into a temporary folder and read from there, so that
//! they can be merged without holding any of them in memory.

use std::fs::File;
use std::io::{self, Read, Seek};

use zip::ZipArchive;
use zip::result::ZipError;

use super::folder::Folder;
use super::{TABLES, plain};
use crate::error::{RecordingError, Result, join};

/// Unpacks the tables that are used.
pub(super) fn unpack(input: impl Read + Seek, file: &str) -> Result<Folder> {
    let damaged = |error: &ZipError| RecordingError::damaged(file, error.to_string());
    let failed = |error| RecordingError::io(file, "unpack it to a temporary folder", error);
    let mut archive = ZipArchive::new(input).map_err(|error| damaged(&error))?;
    let folder = tempfile::tempdir().map_err(failed)?;
    let (mut seen, mut found) = (Vec::new(), false);
    for index in 0..archive.len() {
        let mut entry = archive.by_index(index).map_err(|error| damaged(&error))?;
        let name = entry.name().map_err(|error| damaged(&error))?.into_owned();
        // The base name alone: nothing in the archive decides where files go.
        let table = name.rsplit(['/', '\\']).next().unwrap_or_default();
        let Some(stem) = table.to_ascii_lowercase().strip_suffix(".csv").map(plain) else {
            seen.push(name);
            continue;
        };
        if TABLES.contains(&stem.as_str()) && !name.contains("__MACOSX") {
            // Named as in the archive, so that messages speak of that; `table` has no separator.
            let target = folder.path().join(table);
            let mut output = File::create_new(target).map_err(failed)?;
            io::copy(&mut entry, &mut output).map_err(|error| damaged(&ZipError::Io(error)))?;
            found = true;
        }
        seen.push(name);
    }
    if !found {
        return Err(RecordingError::not_a_recording(
            file,
            format!("a zip of {}", join(seen.iter().map(String::as_str))),
        ));
    }
    let mut tables = Folder::list(folder.path(), file)?;
    tables.unpacked = Some(folder);
    Ok(tables)
}
