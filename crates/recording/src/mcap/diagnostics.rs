//! The ROS 2 message `diagnostic_msgs/DiagnosticArray` as bytes.
//!
//! Read first: REP 107.

use super::cdr::CdrWriter;
use super::ros::header;

/// How well something is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Level {
    /// Well.
    Ok = 0,
    /// To be looked at.
    Warn = 1,
    /// Broken.
    Error = 2,
    /// Nothing is known of it.
    Stale = 3,
}

/// The state of one thing.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Status {
    /// How well it is.
    pub level: Level,
    /// What it is: `/northing: imu/data_raw`.
    pub name: String,
    /// A sentence.
    pub message: String,
    /// Names and values.
    pub values: Vec<(String, String)>,
}

/// The message; `None` when the stamp is beyond what ROS can hold.
#[must_use]
pub fn diagnostics(time_ns: i64, hardware: &str, statuses: &[Status]) -> Option<Vec<u8>> {
    let mut out = CdrWriter::new();
    header(&mut out, time_ns, "")?;
    out.u32(statuses.len() as u32);
    for status in statuses {
        out.bytes(&[status.level as u8]);
        out.string(&status.name);
        out.string(&status.message);
        out.string(hardware);
        out.u32(status.values.len() as u32);
        for (key, value) in &status.values {
            out.string(key);
            out.string(value);
        }
    }
    Some(out.into_bytes())
}
