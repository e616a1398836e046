//! Running the program in a folder of its own.

use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use serde_json::Value;
use tempfile::TempDir;

/// A folder that vanishes with the test, and the program in it.
pub(crate) struct Lab(TempDir);

impl Lab {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    /// A folder with `phone.csv`, a virtual phone's recording of 75 s.
    pub(crate) fn with_phone() -> Self {
        let lab = Self::new();
        lab.succeeds(&["demo", "--record-only", "phone.csv"]);
        lab
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), content).unwrap();
    }

    pub(crate) fn read(&self, name: &str) -> String {
        std::fs::read_to_string(self.path(name)).unwrap()
    }

    /// Names of everything in the folder.
    pub(crate) fn names(&self) -> Vec<String> {
        names(self.0.path())
    }

    pub(crate) fn program(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_northing"));
        command.current_dir(self.0.path()).args(arguments);
        command
    }

    /// Runs, expects success and a silent standard error, returns standard output.
    pub(crate) fn succeeds(&self, arguments: &[&str]) -> String {
        let output = self.program(arguments).output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(
            output.status.success() && errors.is_empty(),
            "{arguments:?}: {errors}"
        );
        String::from_utf8(output.stdout).unwrap()
    }

    /// As [`Lab::succeeds`], reading standard output as one JSON document.
    pub(crate) fn json(&self, arguments: &[&str]) -> Value {
        serde_json::from_str(&self.succeeds(arguments)).unwrap()
    }

    /// Runs, expects exit code 2, one line on standard error that begins with `northing: `, nothing
    /// on standard output and no new file; returns the line without the beginning.
    pub(crate) fn refuses(&self, arguments: &[&str]) -> String {
        let before = self.names();
        let output = self.program(arguments).output().unwrap();
        assert_eq!(self.names(), before, "{arguments:?} left something behind");
        refusal(&output, &format!("{arguments:?}"))
    }
}

/// The message of a run that was refused as it should be.
pub(crate) fn refusal(output: &Output, what: &str) -> String {
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{what}: {errors}");
    assert!(
        output.stdout.is_empty(),
        "{what}: {}",
        String::from_utf8_lossy(&output.stdout)
    );
    assert_eq!(errors.lines().count(), 1, "{what}: {errors}");
    let message = errors.trim_end().strip_prefix("northing: ");
    message
        .unwrap_or_else(|| panic!("{what}: {errors}"))
        .to_owned()
}

fn names(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<_> = entries
        .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    names
}

/// Asserts that a text contains each of these, wherever its lines are broken.
pub(crate) fn contains(text: &str, parts: &[&str]) {
    let words = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
    let text = words(text);
    for part in parts {
        assert!(
            text.contains(&words(part)),
            "`{part}` is missing in: {text}"
        );
    }
}

/// A CSV recording at 100 Hz from a function of the sample's number.
pub(crate) fn csv(header: &str, rows: usize, row: impl Fn(usize) -> String) -> String {
    let mut text = format!("{header}\n");
    for k in 0..rows {
        text += &format!("{:.2},{}\n", k as f64 * 0.01, row(k));
    }
    text
}

/// Columns of gyroscope and accelerometer.
pub(crate) const IMU: &str =
    "t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2";
