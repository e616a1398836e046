//! The folder of recordings: what is in it, and making unfinished ones whole.

use std::path::{Path, PathBuf};

use northing_recording::mcap::{describe, is_complete, recover};
use serde::Serialize;

/// One recording of the list.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct Listed {
    /// Its file name.
    pub name: String,
    /// Its length.
    pub bytes: u64,
    /// When its first record arrived, UTC; `None` when nothing can be read of it.
    pub start: Option<String>,
    /// The devices.
    pub devices: Vec<String>,
    /// Whether it was completed; one that is being written is not.
    pub finished: bool,
}

/// The recordings of a folder, the newest first. A folder that is not there has none.
#[must_use]
pub fn list(folder: &Path) -> Vec<Listed> {
    let mut all: Vec<Listed> = files(folder)
        .iter()
        .filter_map(|path| listed(path))
        .collect();
    all.sort_by(|a, b| b.name.cmp(&a.name));
    all
}

fn listed(path: &Path) -> Option<Listed> {
    let bytes = path.metadata().ok()?.len();
    let contents = describe(path).ok();
    Some(Listed {
        name: path.file_name()?.to_str()?.to_owned(),
        bytes,
        start: contents
            .as_ref()
            .and_then(|contents| contents.start_ns)
            .map(crate::experiments::utc),
        devices: contents
            .map(|contents| contents.devices)
            .unwrap_or_default(),
        finished: is_complete(path).unwrap_or(false),
    })
}

/// The file of this name in the folder; `None` for anything that is not one of its recordings.
#[must_use]
pub fn path_of(folder: &Path, name: &str) -> Option<PathBuf> {
    // Compared with what is there, so no name can lead elsewhere.
    files(folder)
        .into_iter()
        .find(|path| path.file_name().and_then(|n| n.to_str()) == Some(name))
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return Vec::new();
    };
    entries
        .filter_map(|entry| {
            let entry = entry.ok()?;
            let path = entry.path();
            let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
            (is_file && path.extension().is_some_and(|e| e == "mcap")).then_some(path)
        })
        .collect()
}

/// Makes the unfinished recordings of a folder whole. Returns a sentence about each. One that another
/// program is writing is left alone.
#[must_use]
pub fn recover_all(folder: &Path) -> Vec<String> {
    let mut paths = files(folder);
    paths.sort();
    let sentence = |path: &PathBuf| {
        if is_complete(path).ok()? {
            return None;
        }
        let file = std::fs::File::open(path).ok()?;
        // Whoever writes it holds the lock.
        file.try_lock().ok()?;
        let name = path.file_name()?.to_string_lossy().into_owned();
        Some(match recover(path) {
            Ok(found) => format!(
                "The recording {name} was not finished; it has been recovered up to its last second ({} messages).",
                found.messages
            ),
            Err(error) => {
                format!("The recording {name} was not finished and stays as it is: {error}")
            }
        })
    };
    paths.iter().filter_map(sentence).collect()
}
