//! Sensor Logger exports (iOS and Android): a folder of CSV files, a zip of it, or one JSON file.
//!
//! Read first: `docs/formats.md`. One table a sensor, each with its own stamps in UTC nanoseconds;
//! columns are found by name. Specific force is `TotalAcceleration` where the phone gives it
//! (Android), else `Accelerometer + Gravity` at equal stamps. An iPhone without "Standardise Units &
//! Frames" has the opposite sign of both, gives uncalibrated acceleration in g, and an orientation
//! whose world x axis points north; all that is turned here into specific force, m/s^2 and ENU.

mod channels;
mod csv_tables;
mod entries;
mod folder;
mod json;
mod zip;

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::sync::Arc;

pub(crate) use channels::TABLES;

use crate::error::{RecordingError, Result};
use crate::metadata::Metadata;
use crate::phyphox;
use crate::recording::Opened;

use csv_tables::CsvTables;
use folder::Folder;
use json::{Json, Store};
use zip::Zip;

/// Opens a folder of CSV files.
pub(crate) fn open_folder(path: &Path, file: &str, metadata: Metadata) -> Result<Opened> {
    let folder = Folder::list(path, file)?;
    open_tables(&folder, file, metadata)
}

/// Opens a zip or a JSON file.
pub(crate) fn open_file(path: &Path, file: &str, metadata: Metadata) -> Result<Opened> {
    let failed = |error| RecordingError::io(file, "open it", error);
    let mut input = File::open(path).map_err(failed)?;
    let mut head = [0; 2];
    let head_length = input.read(&mut head).map_err(failed)?;
    if head[..head_length] == *b"PK" {
        let tables = Zip::list(Store::File(path.to_owned()), input, file)?;
        return open_tables(&tables, file, metadata);
    }
    let json = Json::index(Store::File(path.to_owned()), file)?;
    channels::open(&json, file, metadata)
}

/// Opens a zip or a JSON file in memory.
pub(crate) fn open_bytes(bytes: Vec<u8>, file: &str, metadata: Metadata) -> Result<Opened> {
    let bytes: Arc<[u8]> = Arc::from(bytes);
    let store = Store::Bytes(Arc::clone(&bytes));
    if bytes.starts_with(b"PK") {
        let tables = Zip::list(store, std::io::Cursor::new(bytes), file)?;
        return open_tables(&tables, file, metadata);
    }
    let json = Json::index(store, file)?;
    channels::open(&json, file, metadata)
}

/// Tables of CSV: phyphox's where their headers say so, or Sensor Logger's.
fn open_tables(tables: &impl CsvTables, file: &str, metadata: Metadata) -> Result<Opened> {
    match csv_tables::of_phyphox(tables)? {
        Some(found) => phyphox::open_tables(found, file, metadata),
        None => channels::open(tables, file, metadata),
    }
}

/// A table's name as it is compared: letters and digits, small (`Total Acceleration` is
/// `TotalAcceleration` is `totalacceleration`).
fn plain(name: &str) -> String {
    name.chars()
        .filter(char::is_ascii_alphanumeric)
        .map(|c| c.to_ascii_lowercase())
        .collect()
}
