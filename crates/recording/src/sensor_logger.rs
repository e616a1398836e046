//! Sensor Logger exports: folder of CSV files, zip of it, JSON.

use std::path::Path;

use crate::error::{RecordingError, Result};
use crate::metadata::Metadata;
use crate::recording::Opened;

fn unsupported(file: &str) -> Result<Opened> {
    Err(RecordingError::Unsupported {
        file: file.to_owned(),
        problem: "Sensor Logger exports are not read by this version".to_owned(),
    })
}

pub(crate) fn open_folder(_: &Path, file: &str, _: Metadata) -> Result<Opened> {
    unsupported(file)
}

pub(crate) fn open_file(_: &Path, file: &str, _: Metadata) -> Result<Opened> {
    unsupported(file)
}

pub(crate) fn open_bytes(_: Vec<u8>, file: &str, _: Metadata) -> Result<Opened> {
    unsupported(file)
}
