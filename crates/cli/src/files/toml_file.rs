//! Files of calibrations: TOML, one value a line, read with messages that name the line.

use std::path::Path;

use anyhow::{Context, Result, anyhow};
use northing_evaluation::calibration::set::CalibrationSet;
use northing_recording::limits::read_description;
use serde::de::DeserializeOwned;

/// Reads such a file; `command` is what writes it.
///
/// # Errors
/// It cannot be read, is no TOML, or does not hold what is expected; the message names the line.
pub(crate) fn read<T: DeserializeOwned>(path: &Path, command: &str) -> Result<T> {
    let file = path.display().to_string();
    let text = read_description(path)?;
    parse(&text, &file, command)
}

/// Reads the files of a folder that have this key, by their names without ending.
///
/// # Errors
/// As [`read`]; the folder cannot be read, or has no such file.
pub(crate) fn read_folder<C>(
    folder: &Path,
    key: &str,
    command: &str,
    read: impl Fn(&Path) -> Result<C>,
) -> Result<CalibrationSet<C>> {
    let place = folder.display().to_string();
    let entries = std::fs::read_dir(folder).and_then(Iterator::collect::<Result<Vec<_>, _>>);
    let entries = entries.with_context(|| format!("{place}: cannot search it"))?;
    let mut paths: Vec<_> = entries.into_iter().map(|entry| entry.path()).collect();
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "toml"));
    paths.sort();
    let mut named = Vec::new();
    for path in paths {
        // Both kinds of calibration may lie in one folder.
        let text = read_description(&path)?;
        let other = text
            .parse::<toml::Table>()
            .is_ok_and(|table| !table.contains_key(key));
        if !other {
            let name = path.file_stem().unwrap_or_default().to_string_lossy();
            named.push((name.into_owned(), read(&path)?));
        }
    }
    if named.is_empty() {
        return Err(anyhow!(
            "{place}: no calibrations in this folder; expected files written by `{command} RECORDING --out FILE.toml`"
        ));
    }
    Ok(CalibrationSet { place, named })
}

/// As [`read`], from a text.
pub(crate) fn parse<T: DeserializeOwned>(text: &str, file: &str, command: &str) -> Result<T> {
    toml::from_str(text).map_err(|error| {
        let start = error.span().map_or(0, |span| span.start.min(text.len()));
        let line = text.as_bytes()[..start]
            .iter()
            .filter(|byte| **byte == b'\n')
            .count()
            + 1;
        anyhow!(
            "{file}, line {line}: {}; expected a file written by `{command} RECORDING --out FILE`",
            error.message()
        )
    })
}

/// A name within a comment: without line breaks.
pub(crate) fn in_comment(name: &str) -> String {
    name.replace(char::is_control, "?")
}
