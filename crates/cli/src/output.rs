//! What the program hands out: text and JSON on standard output, and files that must not exist yet.

use std::io::{self, Write};
use std::path::Path;

use anyhow::{Context, Result};
use northing_recording::AtomicFile;
use serde::Serialize;

/// Writes text to standard output.
///
/// # Errors
/// The reader has gone away, or the disk behind it is full.
pub(crate) fn print(text: &str) -> Result<()> {
    let mut out = io::stdout().lock();
    out.write_all(text.as_bytes())
        .and_then(|()| out.flush())
        .context("standard output")
}

/// Writes one JSON document to standard output, and nothing else.
pub(crate) fn print_json(value: &impl Serialize) -> Result<()> {
    let mut text = serde_json::to_string_pretty(value).context("JSON")?;
    text.push('\n');
    print(&text)
}

/// Refuses an output that exists already or cannot be written, before any work is done for it.
pub(crate) fn check_free(path: &Path, force: bool) -> Result<()> {
    // Starting the file is the test; dropped, it leaves nothing behind.
    AtomicFile::create(path, force)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::check_free;

    #[test]
    fn a_free_name_in_a_folder_that_exists_is_accepted_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.csv");
        assert!(check_free(&path, false).is_ok());
        assert!(!path.exists());
        std::fs::write(&path, "x").unwrap();
        let message = check_free(&path, false).unwrap_err().to_string();
        assert!(
            message.contains("exists already") && message.contains("--force"),
            "{message}"
        );
        assert!(check_free(&path, true).is_ok());
        assert!(check_free(folder.path(), true).is_err());
        let message = check_free(&folder.path().join("no/out.csv"), true)
            .unwrap_err()
            .to_string();
        assert!(message.contains("does not exist"), "{message}");
    }
}
