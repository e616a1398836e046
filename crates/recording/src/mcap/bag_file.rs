//! One file of a bag of ROS 2: MCAP or SQLite, as it is or compressed with zstd as a whole.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;
#[cfg(feature = "sqlite")]
use std::sync::Arc;

use tempfile::NamedTempFile;

use super::Wanted;
use super::file::Messages;
use crate::error::{RecordingError, Result};
use crate::limits;
use crate::metadata::Metadata;
use crate::open::SQLITE;
use crate::recording::Opened;
use crate::text::open_file;

/// What a frame of zstd begins with.
pub(super) const ZSTD: &[u8] = b"\x28\xb5\x2f\xfd";

/// Opens a database of SQLite.
pub(crate) fn open_database(
    path: &Path,
    file: &str,
    metadata: Metadata,
    wanted: Wanted<'_>,
) -> Result<Opened> {
    super::open_messages(messages(path)?, file, metadata, wanted)
}

/// The messages of a file, told by its first bytes.
pub(super) fn messages(path: &Path) -> Result<Messages> {
    let file = path.display().to_string();
    let input = open_file(path, &file)?;
    let (head, input) = head(input).map_err(|error| RecordingError::io(&file, "read it", error))?;
    if head.starts_with(SQLITE) {
        return database(path, None, &file);
    }
    if !head.starts_with(ZSTD) {
        return Messages::new(Box::new(input), &file);
    }
    let unpacked = unpack(input, &file)?;
    let failed = |error| RecordingError::io(&file, "unpack it", error);
    let (head, input) = self::head(unpacked.reopen().map_err(failed)?).map_err(failed)?;
    if head.starts_with(SQLITE) {
        let path = unpacked.path().to_owned();
        return database(&path, Some(unpacked), &file);
    }
    // The file has no name any more and goes with its last handle.
    Messages::new(Box::new(input), &file)
}

fn head(mut input: File) -> io::Result<(Vec<u8>, File)> {
    let mut head = Vec::new();
    let most = SQLITE.len() as u64;
    input.by_ref().take(most).read_to_end(&mut head)?;
    input.seek(SeekFrom::Start(0))?;
    Ok((head, input))
}

/// Unpacks a file of zstd beside the other temporary files.
fn unpack(input: File, file: &str) -> Result<NamedTempFile> {
    let failed = |error| RecordingError::io(file, "unpack it", error);
    let length = input.metadata().map_err(failed)?.len();
    let limit = limits::unpacked(length);
    let mut output = NamedTempFile::new().map_err(failed)?;
    let decoder = zstd::Decoder::new(input).map_err(failed)?;
    let copied = io::copy(&mut decoder.take(limit.most + 1), &mut output);
    // A file that was cut is read up to there, as one that is not compressed.
    match copied {
        Ok(copied) if copied > limit.most => {
            Err(limit.exceeded(format!("more than {}", limit.most), file, ""))
        }
        _ => Ok(output),
    }
}

#[cfg(feature = "sqlite")]
fn database(path: &Path, unpacked: Option<NamedTempFile>, file: &str) -> Result<Messages> {
    let unpacked = unpacked.map(Arc::new);
    let database = super::sqlite::Database::open(path, unpacked, file)?;
    Ok(Messages::of(Box::new(database)))
}

#[cfg(not(feature = "sqlite"))]
fn database(_: &Path, _: Option<NamedTempFile>, file: &str) -> Result<Messages> {
    Err(RecordingError::unsupported(
        file,
        "this build cannot read databases of SQLite, as bags of ROS 2 (.db3) are; build with `--features sqlite`, or \
         convert the bag to MCAP with `ros2 bag convert`, or without ROS with `pip install rosbags` and \
         `rosbags-convert --src BAG --dst NEW --dst-storage mcap`",
    ))
}
