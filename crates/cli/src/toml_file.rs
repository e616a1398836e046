//! Files of calibrations: TOML, one value a line, read with messages that name the line.

use std::path::Path;

use anyhow::{Context, Result, anyhow};
use serde::de::DeserializeOwned;

/// Reads such a file; `command` is what writes it.
///
/// # Errors
/// It cannot be read, is no TOML, or does not hold what is expected; the message names the line.
pub(crate) fn read<T: DeserializeOwned>(path: &Path, command: &str) -> Result<T> {
    let file = path.display().to_string();
    let text = std::fs::read_to_string(path).with_context(|| format!("{file}: cannot read it"))?;
    parse(&text, &file, command)
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
