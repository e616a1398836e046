//! What the program hands out: text and JSON on standard output, and files that must not exist yet.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use northing_recording::atomic_file::write_whole;
use northing_recording::limits::read_description;
use northing_recording::{AtomicFile, has_extension};
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

/// Refuses an output that is the recording being read, a file of it or of its folder, or a file that it names where it is a
/// manifest or a scenario: not even `--force` means that. `data` is where the manifest's files are, beside it without.
pub(crate) fn check_not_input(output: &Path, input: &Path, data: Option<&Path>) -> Result<()> {
    let is_part = if input.is_dir() {
        let folder = output
            .parent()
            .filter(|folder| !folder.as_os_str().is_empty());
        output.exists() && same_file(folder.unwrap_or(Path::new(".")), input)
    } else {
        files_named_in(input, data)
            .iter()
            .any(|file| same_file(output, file))
    };
    if same_file(output, input) || is_part {
        bail!(
            "{}: it is {} being read; name another file to write",
            output.display(),
            match (is_part, input.is_dir()) {
                (true, true) => "in the folder",
                (true, false) => "a file of the recording",
                _ => "the recording",
            }
        );
    }
    Ok(())
}

/// The files that exist among the texts of a description in TOML; none of what is no such description.
fn files_named_in(input: &Path, data: Option<&Path>) -> Vec<PathBuf> {
    if !has_extension(input, "toml") {
        return Vec::new();
    }
    let Ok(text) = read_description(input) else {
        return Vec::new();
    };
    let Ok(table) = text.parse::<toml::Table>() else {
        return Vec::new();
    };
    let folder = data.or(input.parent()).unwrap_or(Path::new(""));
    let mut files = Vec::new();
    gather_files(&toml::Value::Table(table), folder, &mut files);
    files
}

fn gather_files(value: &toml::Value, folder: &Path, files: &mut Vec<PathBuf>) {
    match value {
        toml::Value::String(name) => {
            let file = folder.join(name);
            files.extend(file.is_file().then_some(file));
        }
        toml::Value::Array(all) => all.iter().for_each(|one| gather_files(one, folder, files)),
        toml::Value::Table(table) => table
            .iter()
            .for_each(|(_, one)| gather_files(one, folder, files)),
        _ => {}
    }
}

/// Refuses an output whose ending, if it has one, is that of another format.
pub(crate) fn check_ending(output: &Path, ending: &str, what: &str) -> Result<()> {
    if output.extension().is_some() && !has_extension(output, ending) {
        bail!(
            "{}: {what}; name a file that ends in .{ending}",
            output.display()
        );
    }
    Ok(())
}

/// Whether two paths lead to the same file, whatever they are spelt like; the files need not exist.
pub(crate) fn same_file(a: &Path, b: &Path) -> bool {
    let place = |path: &Path| {
        path.canonicalize().ok().or_else(|| {
            let folder = path
                .parent()
                .filter(|folder| !folder.as_os_str().is_empty());
            let folder = folder.unwrap_or(Path::new(".")).canonicalize().ok()?;
            Some(folder.join(path.file_name()?))
        })
    };
    a == b || place(a).is_some_and(|a| Some(a) == place(b))
}

/// The report that a command writes when it is asked for one.
#[derive(Debug, Clone, Args)]
pub(crate) struct ReportArgs {
    /// Write a report with plots: one HTML file for a browser
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Overwrite the report if it exists
    #[arg(long)]
    force: bool,
}

impl ReportArgs {
    /// Refuses one that exists already.
    pub(crate) fn check_free(&self) -> Result<()> {
        let report = self.report.as_deref();
        report.map_or(Ok(()), |path| check_free(path, self.force))
    }

    /// Writes the page.
    pub(crate) fn write(&self, html: impl FnOnce() -> String) -> Result<()> {
        match &self.report {
            Some(path) => Ok(write_whole(path, html().as_bytes(), self.force)?),
            None => Ok(()),
        }
    }
}

/// A line about a report that was written.
pub(crate) fn report_written(path: &Path) -> String {
    format!("Report: {} (open it in a browser)", path.display())
}

/// A number of a table; `-` where there is none.
pub(crate) fn number(value: Option<f64>, decimals: usize) -> String {
    value.map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
}

#[cfg(test)]
mod tests {
    use super::{check_free, check_not_input, same_file};

    #[test]
    fn one_file_under_two_names_is_one_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let detour = folder.path().join(".").join("a.csv");
        assert!(same_file(&path, &detour), "before it exists");
        std::fs::write(&path, "x").unwrap();
        assert!(same_file(&path, &detour) && check_not_input(&detour, &path, None).is_err());
        assert!(check_not_input(&folder.path().join("b.csv"), &path, None).is_ok());
    }

    #[test]
    fn what_a_manifest_names_or_a_folder_holds_is_being_read() {
        let folder = tempfile::tempdir().unwrap();
        let [manifest, fixes, data, other] =
            ["m.toml", "fixes.csv", "data", "other.csv"].map(|name| folder.path().join(name));
        std::fs::create_dir(&data).unwrap();
        std::fs::write(&manifest, "[[sensors]]\ndetections = 'fixes.csv'\n").unwrap();
        for file in [&fixes, &data.join("fixes.csv"), &other] {
            std::fs::write(file, "x").unwrap();
        }
        let said = check_not_input(&fixes, &manifest, None).unwrap_err();
        assert!(
            said.to_string().contains("a file of the recording"),
            "{said}"
        );
        assert!(check_not_input(&other, &manifest, None).is_ok());
        assert!(check_not_input(&data.join("fixes.csv"), &manifest, Some(&data)).is_err());
        assert!(check_not_input(&fixes, &manifest, Some(&data)).is_ok());
        assert!(check_not_input(&other, folder.path(), None).is_err());
        assert!(check_not_input(&folder.path().join("new.csv"), folder.path(), None).is_ok());
    }

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
