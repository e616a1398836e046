//! What the program reads and writes beside recordings.

pub(crate) mod baseline_errors;
pub(crate) mod magnetometer_calibration;
pub(crate) mod output;
pub(crate) mod rest_calibration;
pub(crate) mod setup;
pub(crate) mod toml_file;

use std::path::Path;

/// Whether a path ends in `.extension`, in any case.
pub(crate) fn has_extension(path: &Path, extension: &str) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case(extension))
}

/// What stands for standard input in place of a file.
pub(crate) const STDIN: &str = "-";

/// A file name for messages.
pub(crate) fn shown(path: &Path) -> String {
    if path == Path::new(STDIN) {
        "standard input".to_owned()
    } else {
        path.display().to_string()
    }
}
