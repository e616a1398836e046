//! What can be wrong with a recording: every error names the file, the place in it, what was
//! expected and what to do.

use std::io;

use crate::event::SensorKind;

/// Shorthand of this crate.
pub type Result<T> = std::result::Result<T, RecordingError>;

/// A recording that cannot be read or written. `file` is the path as the user gave it, or
/// `standard input`.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordingError {
    /// The operating system refused.
    #[error("{file}: cannot {action}: {source}")]
    Io {
        /// The file or folder.
        file: String,
        /// What was attempted, e.g. `open it`.
        action: &'static str,
        /// The system's answer.
        source: io::Error,
    },
    /// The content is none of the formats.
    #[error(
        "{file}: not a recording: {found}; expected Parquet, MCAP, a bag of ROS, CSV with a `t_s` or `t_ns` column, \
         NMEA 0183, UBX, ULog, ArduPilot's .bin, KF-GINS, RTKLIB, EuRoC, KITTI, GPX, VectorNav, a Sensor Logger folder, .zip or .json, or a manifest (.toml) that describes another text file, which `northing describe` drafts"
    )]
    NotARecording {
        /// The file.
        file: String,
        /// What was found instead.
        found: String,
    },
    /// There is nothing in it.
    #[error("{file}: empty: {found}; expected {expected}")]
    Empty {
        /// The file.
        file: String,
        /// What little was found.
        found: String,
        /// What was expected.
        expected: &'static str,
    },
    /// Columns are missing or do not make a complete sensor.
    #[error("{file}: missing {missing}; the file has {present}; {advice}")]
    MissingColumns {
        /// The file.
        file: String,
        /// The columns that are missing.
        missing: String,
        /// The columns that are there.
        present: String,
        /// What to do.
        advice: String,
    },
    /// One column name stands twice.
    #[error("{file}: column `{column}` is there twice; keep one of them")]
    RepeatedColumn {
        /// The file.
        file: String,
        /// The name.
        column: String,
    },
    /// A cell does not hold what its column promises.
    #[error("{file}, line {line}, column `{column}`: `{text}` is not {expected}")]
    BadCell {
        /// The file.
        file: String,
        /// Line (in Parquet: row), counted from 1.
        line: u64,
        /// Column name.
        column: String,
        /// What stands there.
        text: String,
        /// What was expected.
        expected: &'static str,
    },
    /// A line that cannot be used as a whole.
    #[error("{file}, line {line}: {problem}")]
    BadLine {
        /// The file.
        file: String,
        /// Line, counted from 1.
        line: u64,
        /// What is wrong and what was expected.
        problem: String,
    },
    /// A binary file that is cut off or damaged.
    #[error("{file}: damaged or cut off: {detail}; get a fresh copy of the file")]
    Damaged {
        /// The file.
        file: String,
        /// What the decoder says.
        detail: String,
    },
    /// More than any recording has ([`crate::limits`]).
    #[error("{file}: {what}: {found} {unit}; at most {most} are read; {advice}")]
    TooLarge {
        /// The file, and where in it.
        file: String,
        /// What is too large.
        what: &'static str,
        /// How much it has; `more than ...` where the rest was not looked at.
        found: String,
        /// How much it may have.
        most: u64,
        /// What is counted.
        unit: &'static str,
        /// What to do.
        advice: &'static str,
    },
    /// No estimator can run without angular rates.
    #[error(
        "{file}: no gyroscope: it has {present}; estimators need angular rates, or fixes of a satellite receiver \
         (for CSV the columns gyro_x_rad_s, gyro_y_rad_s, gyro_z_rad_s, or gnss_latitude_rad, gnss_longitude_rad)"
    )]
    NoGyroscope {
        /// The file.
        file: String,
        /// What is there instead.
        present: String,
    },
    /// The time stamps do not run forward.
    #[error(
        "{file}: time runs backwards: {back} of {total} {sensor} stamps are earlier than one before them; {advice}"
    )]
    TimeGoesBack {
        /// The file.
        file: String,
        /// The sensor where it was seen.
        sensor: &'static str,
        /// Stamps that go back.
        back: u64,
        /// Stamps looked at.
        total: u64,
        /// What to do.
        advice: String,
    },
    /// The numbers contradict the unit.
    #[error("{file}: {sensor}: {evidence}; {hint}")]
    ImplausibleUnit {
        /// The file.
        file: String,
        /// The sensor.
        sensor: &'static str,
        /// What was measured.
        evidence: String,
        /// Which option to use.
        hint: &'static str,
    },
    /// The manifest is wrong.
    #[error("{file}: {problem}")]
    Manifest {
        /// The manifest file.
        file: String,
        /// What is wrong, with the line where TOML knows it.
        problem: String,
    },
    /// The format is known, but not in this way or not in this build.
    #[error("{file}: {problem}")]
    Unsupported {
        /// The file.
        file: String,
        /// Why, and what to do instead.
        problem: String,
    },
    /// An output that exists already.
    #[error("{file}: exists already and is not overwritten; choose another name or use --force")]
    Exists {
        /// The path.
        file: String,
    },
    /// A writer got an event for which it has no column.
    #[error("{file}: the writer has no column for {sensor}; name it when the file is created")]
    NoColumnFor {
        /// The output.
        file: String,
        /// The sensor.
        sensor: &'static str,
    },
}

impl RecordingError {
    pub(crate) fn unsupported(file: impl Into<String>, problem: impl Into<String>) -> Self {
        let (file, problem) = (file.into(), problem.into());
        Self::Unsupported { file, problem }
    }

    pub(crate) fn damaged(file: impl Into<String>, detail: impl Into<String>) -> Self {
        let (file, detail) = (file.into(), detail.into());
        Self::Damaged { file, detail }
    }

    pub(crate) fn not_a_recording(file: impl Into<String>, found: impl Into<String>) -> Self {
        let (file, found) = (file.into(), found.into());
        Self::NotARecording { file, found }
    }

    pub(crate) fn manifest(file: impl Into<String>, problem: impl Into<String>) -> Self {
        let (file, problem) = (file.into(), problem.into());
        Self::Manifest { file, problem }
    }

    pub(crate) fn empty(
        file: impl Into<String>,
        found: impl Into<String>,
        expected: &'static str,
    ) -> Self {
        let (file, found) = (file.into(), found.into());
        Self::Empty {
            file,
            found,
            expected,
        }
    }

    pub(crate) fn bad_line(file: impl Into<String>, line: u64, problem: impl Into<String>) -> Self {
        let (file, problem) = (file.into(), problem.into());
        Self::BadLine {
            file,
            line,
            problem,
        }
    }

    pub(crate) fn no_column_for(file: impl Into<String>, sensor: &'static str) -> Self {
        let file = file.into();
        Self::NoColumnFor { file, sensor }
    }

    /// Reading was given up half way, as by Ctrl-C.
    #[must_use]
    pub fn interrupted() -> Self {
        Self::io("recording", "finish it", io::ErrorKind::Interrupted.into())
    }

    pub(crate) fn io(file: impl Into<String>, action: &'static str, source: io::Error) -> Self {
        let file = file.into();
        Self::Io {
            file,
            action,
            source,
        }
    }

    /// Refuses a file without any sensor that an estimate could begin with: a gyroscope or a satellite receiver.
    pub(crate) fn check_sensors(file: &str, sensors: &[SensorKind]) -> Result<()> {
        let enough = [SensorKind::Gyroscope, SensorKind::GnssPosition];
        if enough.iter().any(|kind| sensors.contains(kind)) {
            return Ok(());
        }
        Err(Self::no_gyroscope(file, sensors))
    }

    pub(crate) fn no_gyroscope(file: &str, sensors: &[SensorKind]) -> Self {
        let present = if sensors.is_empty() {
            "no sensor at all".to_owned()
        } else {
            join(sensors.iter().map(|kind| kind.name()))
        };
        let file = file.to_owned();
        Self::NoGyroscope { file, present }
    }
}

/// `a, b, c` for messages; long lists are cut.
pub(crate) fn join<'a>(names: impl IntoIterator<Item = &'a str>) -> String {
    const MOST: usize = 40;
    let mut text = String::new();
    for (index, name) in names.into_iter().enumerate() {
        if index == MOST {
            text.push_str(", ...");
            break;
        }
        if index > 0 {
            text.push_str(", ");
        }
        text.push_str(&shown(name));
    }
    if text.is_empty() {
        text.push_str("none");
    }
    text
}

/// A piece of the file as it may stand in a message: one line, printable, not endless.
pub(crate) fn shown(text: &str) -> String {
    const MOST: usize = 60;
    let mut short: String = text
        .chars()
        .take(MOST)
        .map(|c| if c.is_control() { '?' } else { c })
        .collect();
    if text.chars().nth(MOST).is_some() {
        short.push_str("...");
    }
    short
}
