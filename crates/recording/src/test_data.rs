//! Where tests find recordings that are too large for the repository, and how they say that they
//! found none; and how tests compare what they make with committed files.
//!
//! `NORTHING_DATA` names the folder of recordings, `NORTHING_FIXTURES` the folder of exports in
//! the formats of phone applications. A test that finds none passes after a line
//! `skipped (NORTHING_DATA is not set): NAME`, which also goes into the file `NORTHING_SKIP_LOG`
//! so that `scripts/test` can count it; with `NORTHING_REQUIRE_DATA=1` it fails instead.

use std::env;
use std::ffi::OsString;
use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::{Path, PathBuf};

/// Differing lines that are printed.
const MOST_LINES: usize = 40;

/// The folder of recordings (`attitude/broad`, `attitude/smartphone`), or `None` after saying
/// that `test` is skipped.
///
/// # Panics
/// When the variable names no folder, or is unset while `NORTHING_REQUIRE_DATA=1`.
#[must_use]
pub fn data_dir(test: &str) -> Option<PathBuf> {
    folder("NORTHING_DATA", test)
}

/// The folder of phone applications' exports (`sensor_logger`), or `None` after saying that
/// `test` is skipped.
///
/// # Panics
/// When the variable names no folder, or is unset while `NORTHING_REQUIRE_DATA=1`.
#[must_use]
pub fn fixtures_dir(test: &str) -> Option<PathBuf> {
    folder("NORTHING_FIXTURES", test)
}

fn folder(variable: &str, test: &str) -> Option<PathBuf> {
    let required = env::var_os("NORTHING_REQUIRE_DATA").is_some_and(|value| value == "1");
    match find(variable, env::var_os(variable), required) {
        Ok(Some(path)) => Some(path),
        Ok(None) => {
            skipped(&format!("{variable} is not set"), test);
            None
        }
        Err(message) => panic!("{test}: {message}"),
    }
}

fn find(
    variable: &str,
    value: Option<OsString>,
    required: bool,
) -> Result<Option<PathBuf>, String> {
    match value {
        Some(value) => {
            let path = PathBuf::from(value);
            if path.is_dir() {
                Ok(Some(path))
            } else {
                Err(format!("{variable}={} is not a folder", path.display()))
            }
        }
        None if required => Err(format!(
            "{variable} is not set although NORTHING_REQUIRE_DATA=1 asks for it"
        )),
        None => Ok(None),
    }
}

/// Says that `test` is skipped and why, and counts it.
pub fn skipped(why: &str, test: &str) {
    // One write of one line: tests run side by side and append to the same file.
    let line = format!("skipped ({why}): {test}\n");
    eprint!("{line}");
    let Some(log) = env::var_os("NORTHING_SKIP_LOG") else {
        return;
    };
    if let Ok(mut file) = OpenOptions::new().create(true).append(true).open(log) {
        // A log that cannot be written must not fail the test that only wanted to be skipped.
        let _ = file.write_all(line.as_bytes());
    }
}

/// Compares what a test has made with what is committed, line by line, and prints the lines that differ. With
/// `NORTHING_BLESS=1` it writes the file instead: what has changed is then reviewed as a diff.
///
/// # Panics
/// Lines differ, or the file is not there.
pub fn assert_as_committed(path: &Path, made: &str, are_alike: fn(&str, &str) -> bool) {
    if std::env::var("NORTHING_BLESS").as_deref() == Ok("1") {
        let written = path.parent().map_or(Ok(()), std::fs::create_dir_all);
        let written = written.and_then(|()| std::fs::write(path, made));
        assert!(written.is_ok(), "{}: {written:?}", path.display());
        return;
    }
    let committed = std::fs::read_to_string(path).unwrap_or_default();
    let (mut old, mut new) = (committed.lines(), made.lines());
    let (mut diff, mut count) = (String::new(), 0_usize);
    loop {
        let pair = (old.next(), new.next());
        match pair {
            (None, None) => break,
            (Some(old), Some(new)) if are_alike(old, new) => continue,
            _ => count += 1,
        }
        if count <= MOST_LINES {
            for (sign, line) in [('-', pair.0), ('+', pair.1)] {
                if let Some(line) = line {
                    diff.push_str(&format!("{sign} {line}\n"));
                }
            }
        }
    }
    assert!(
        count == 0,
        "{}: {count} lines are no longer as committed:\n{diff}If that is meant, run the test again with NORTHING_BLESS=1 and review the diff.",
        path.display()
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_named_folder_is_found() {
        let here = env!("CARGO_MANIFEST_DIR");
        let found = find("NORTHING_DATA", Some(here.into()), true);
        assert_eq!(found, Ok(Some(PathBuf::from(here))));
    }

    #[test]
    fn unset_is_a_skip_unless_data_is_required() {
        assert_eq!(find("NORTHING_DATA", None, false), Ok(None));
        assert!(find("NORTHING_DATA", None, true).is_err());
    }

    #[test]
    fn a_wrong_path_is_an_error_and_not_a_skip() {
        let wrong = concat!(env!("CARGO_MANIFEST_DIR"), "/no-such-folder");
        let error = find("NORTHING_DATA", Some(wrong.into()), false).unwrap_err();
        assert!(error.contains("no-such-folder is not a folder"), "{error}");
    }
}
