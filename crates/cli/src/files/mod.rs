//! What the program reads and writes beside recordings.

pub(crate) mod baseline_errors;
pub(crate) mod magnetometer_calibration;
pub(crate) mod output;
pub(crate) mod rest_calibration;
pub(crate) mod setup;
pub(crate) mod toml_file;

use std::path::Path;

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
