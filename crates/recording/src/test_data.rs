//! Where tests find recordings that are too large for the repository, and how they say that they
//! found none.
//!
//! `NORTHING_DATA` names the folder of recordings, `NORTHING_FIXTURES` the folder of exports in
//! the formats of phone applications. A test that finds none passes after a line
//! `skipped (NORTHING_DATA is not set): NAME`, which also goes into the file `NORTHING_SKIP_LOG`
//! so that `scripts/test` can count it; with `NORTHING_REQUIRE_DATA=1` it fails instead.

use std::env;
use std::ffi::OsString;
use std::fs::OpenOptions;
use std::io::Write as _;
use std::path::PathBuf;

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
            say_skipped(&format!("skipped ({variable} is not set): {test}\n"));
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

/// One write of one line: tests run side by side and append to the same file.
fn say_skipped(line: &str) {
    eprint!("{line}");
    let Some(log) = env::var_os("NORTHING_SKIP_LOG") else {
        return;
    };
    if let Ok(mut file) = OpenOptions::new().create(true).append(true).open(log) {
        // A log that cannot be written must not fail the test that only wanted to be skipped.
        let _ = file.write_all(line.as_bytes());
    }
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
