//! Limits of what is taken from a file: lengths, unpacked sizes and counts, so that no file costs more memory or
//! time than a recording of its size.
//!
//! Every reader takes its limits from here. Beyond one of them the file is refused with
//! [`RecordingError::TooLarge`], which says what was found, what is permitted and what to do. Memory of any file of at
//! most 10 MB stays below 300 MB (`crates/cli/tests/program/hostile_files.rs`).

use std::io::Read;
use std::path::Path;

use crate::error::{RecordingError, Result};

/// Something in a file that may not be larger than a number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Limit {
    /// What is limited, with its article: `a line`.
    pub what: &'static str,
    /// The most that is taken.
    pub most: u64,
    /// What is counted: `bytes`.
    pub unit: &'static str,
    /// What to do about a file beyond it.
    pub advice: &'static str,
}

/// A row of a table, its header or a comment. The widest tables have some hundred columns: a few kilobytes.
pub const LINE: Limit = Limit {
    what: "a line",
    most: 1 << 20,
    unit: "bytes",
    advice: "check that the lines end and that every quotation mark is closed",
};

/// Lines of comments at the top of a CSV file: each is kept as metadata.
pub const COMMENTS: Limit = Limit {
    what: "the comments at the top",
    most: 10_000,
    unit: "lines",
    advice: "remove the comments that are not needed",
};

/// A line of a log of sentences or numbers: some hundred bytes. Longer ones are left out and counted, because a log may
/// have other data in it.
pub const LOG_LINE: u64 = 1024;

/// A text file that describes something: a manifest, settings, a calibration, a scenario.
pub const DESCRIPTION: Limit = Limit {
    what: "the file",
    most: 1 << 20,
    unit: "bytes",
    advice: "check that it is the file that was meant",
};

/// An entry of a JSON export: a sample, a few hundred bytes.
pub const ENTRY: Limit = Limit {
    what: "an entry {...}",
    most: 1 << 20,
    unit: "bytes",
    advice: "check that its braces and quotation marks are closed",
};

/// The tables of an export: one a sensor, some dozens.
pub const TABLES: Limit = Limit {
    what: "the export",
    most: 1000,
    unit: "tables",
    advice: "export the recording again, with the sensors alone",
};

/// The members of a zip: its directory is held in memory.
pub const MEMBERS: Limit = Limit {
    what: "the zip",
    most: 10_000,
    unit: "members",
    advice: "zip the folder of one recording alone",
};

/// The files of a bag of ROS 2: recorders begin a new one after minutes or gigabytes.
pub const BAG_FILES: Limit = Limit {
    what: "the bag",
    most: 1000,
    unit: "files",
    advice: "open its files one by one",
};

/// How often a compressed file may be as large when it is unpacked: numbers of sensors reach 3 to 20.
pub const UNPACKED_RATIO: u64 = 100;
/// What may be unpacked from a file however small it is, bytes.
const UNPACKED_BASE: u64 = 64 << 20;

/// A part of a file that is unpacked or read as a whole: a chunk or message of MCAP, a page of Parquet. Writers make
/// them 1 to 4 MB large.
pub const BLOCK: Limit = Limit {
    what: "a block of data",
    most: 32 << 20,
    unit: "bytes",
    advice: "write the file again with chunks or pages of about 1 MB",
};

/// Schemas and channels of an MCAP file: some kilobytes each, held in memory.
pub const DEFINITIONS: Limit = Limit {
    what: "the schemas and channels",
    most: 8 << 20,
    unit: "bytes",
    advice: "write the file again with the topics that are needed",
};

/// Topics of a bag: a robot has hundreds.
pub const TOPICS: Limit = Limit {
    what: "the bag",
    most: 1 << 16,
    unit: "topics",
    advice: "write it again with the topics that are needed",
};

/// The footer of a Parquet file is held in memory, unpacked to many times its size.
pub const FOOTER: Limit = Limit {
    what: "the footer of the file",
    most: 4 << 20,
    unit: "bytes",
    advice: "write the file again with fewer columns and larger row groups",
};

/// Rows of a Parquet file for each of its bytes: stamps alone need more than a byte for some hundred rows.
#[cfg(feature = "parquet")]
const ROWS_PER_BYTE: u64 = 1000;

/// Events of a recording of targets, which is held in memory: days of a harbour's traffic.
pub const TRACKING_EVENTS: Limit = Limit {
    what: "the recording",
    most: 500_000,
    unit: "scans, detections and reports",
    advice: "cut it into shorter recordings",
};

/// Events that wait for earlier ones: seconds of all sensors together. More are handed out as they are.
pub const WAITING: usize = 100_000;

impl Limit {
    /// Refuses `found` where it is more.
    ///
    /// # Errors
    /// [`RecordingError::TooLarge`]; `place` is where, e.g. `, line 3`.
    pub fn check(&self, found: u64, file: &str, place: &str) -> Result<()> {
        if found <= self.most {
            return Ok(());
        }
        Err(self.exceeded(found.to_string(), file, place))
    }

    /// Refuses what is longer than anything that was looked at.
    pub(crate) fn exceeded(&self, found: String, file: &str, place: &str) -> RecordingError {
        RecordingError::TooLarge {
            file: format!("{file}{place}"),
            what: self.what,
            found,
            most: self.most,
            unit: self.unit,
            advice: self.advice,
        }
    }
}

/// The most rows of a Parquet file of this length.
#[cfg(feature = "parquet")]
pub(crate) const fn rows(length: u64) -> Limit {
    Limit {
        what: "the file",
        most: length.saturating_mul(ROWS_PER_BYTE),
        unit: "rows",
        advice: "no recording is packed so tightly; get the file again from where it was recorded",
    }
}

/// The most that may be unpacked from `packed` bytes.
pub(crate) const fn unpacked(packed: u64) -> Limit {
    Limit {
        what: "the unpacked file",
        most: UNPACKED_BASE.saturating_add(packed.saturating_mul(UNPACKED_RATIO)),
        unit: "bytes",
        advice: "recordings unpack to 3 to 20 times their size; get the file again from where it was recorded",
    }
}

/// The text of a file that describes something.
///
/// # Errors
/// It cannot be read, is no UTF-8, or larger than [`DESCRIPTION`].
pub fn read_description(path: &Path) -> Result<String> {
    let file = path.display().to_string();
    let failed = |error| RecordingError::io(&file, "read it", error);
    let input = std::fs::File::open(path).map_err(failed)?;
    let mut text = Vec::new();
    let most = DESCRIPTION.most + 1;
    input.take(most).read_to_end(&mut text).map_err(failed)?;
    if text.len() as u64 == most {
        let found = std::fs::metadata(path).map_or(most, |data| data.len().max(most));
        DESCRIPTION.check(found, &file, "")?;
    }
    String::from_utf8(text).map_err(|_| RecordingError::damaged(&file, "it is no text in UTF-8"))
}
