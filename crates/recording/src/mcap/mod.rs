//! MCAP: the lab's own recordings of everything as it arrived, and ROS 2 messages in and out.
//!
//! | I look for | file |
//! |---|---|
//! | the messages of a file, up to where it is cut | `file.rs` |
//! | what the lab records: channels, writer, records | `lab.rs` |
//! | the events of one device of such a recording | `lab_source.rs` |
//! | making an unfinished recording whole | `recover.rs` |
//! | `sensor_msgs/Imu`, `MagneticField` as bytes | `ros.rs`, `cdr.rs` |
//! | reading and writing them | `ros_source.rs`, `ros_writer.rs` |
//!
//! Read first: `docs/formats.md`, section "MCAP", and the specification at <https://mcap.dev/spec>.

mod cdr;
mod file;
mod lab;
mod lab_source;
pub(crate) mod nav_sat_fix;
pub(crate) mod output;
mod recover;
mod ros;
mod ros_source;
mod ros_writer;

use std::path::Path;
use std::sync::Arc;

use ::mcap::Channel;

use crate::error::{RecordingError, Result};
use crate::metadata::Metadata;
use crate::recording::Opened;
pub(crate) use file::Input;
use file::{End, Messages, contents};
use lab_source::LabSource;
use ros_source::RosSource;

pub use lab::{LabRecord, LabWriter, RecordKind};
pub use recover::{Recovered, is_complete, recover};
pub use ros_writer::{RosWriter, has_topic};

/// Opens a recording of the lab or of ROS 2; `device` is the device or topic where there are several.
pub(crate) fn open(
    input: Box<dyn Input>,
    file: &str,
    mut metadata: Metadata,
    device: Option<&str>,
) -> Result<Opened> {
    let mut messages = Messages::new(input, file)?;
    let contents = contents(&mut messages);
    if let (true, End::Cut(why)) = (contents.channels.is_empty(), &contents.end) {
        return Err(RecordingError::damaged(
            file,
            format!("{why}; nothing in it can be read"),
        ));
    }
    metadata.format = "mcap".to_owned();
    let devices = devices(&contents.channels);
    let messages = messages.again(file)?;
    let (sensors, source): (_, Box<dyn crate::recording::EventSource>) = if devices.is_empty() {
        let Some(topics) = ros_source::choose(&contents.channels, device, file)? else {
            return Err(nothing(file, &contents));
        };
        let (sensors, messages) = RosSource::new(messages, topics.clone()).sensors();
        let source = RosSource::new(messages.again(file)?, topics);
        (sensors, Box::new(source))
    } else {
        let device = choose(&devices, device, file)?;
        metadata.device = Some(device.to_owned());
        let (sensors, messages) = LabSource::new(messages, device).sensors();
        (
            sensors,
            Box::new(LabSource::new(messages.again(file)?, device)),
        )
    };
    Ok(Opened {
        metadata,
        sensors,
        source,
        notes: Vec::new(),
        units_applied: false,
    })
}

/// The devices of a recording of the lab.
fn devices<'a>(channels: impl IntoIterator<Item = &'a Arc<Channel<'static>>>) -> Vec<String> {
    let mut devices: Vec<String> = channels
        .into_iter()
        .filter_map(|channel| match lab::channel_of(&channel.metadata)? {
            (device, RecordKind::Payload(_)) => Some(device.to_owned()),
            _ => None,
        })
        .collect();
    devices.sort();
    devices.dedup();
    devices
}

fn choose<'a>(devices: &'a [String], wanted: Option<&str>, file: &str) -> Result<&'a str> {
    match (wanted, devices) {
        (None, [only]) => Ok(only),
        (None, _) => Err(lab_source::several(file, devices)),
        (Some(wanted), _) => devices
            .iter()
            .find(|device| *device == wanted)
            .map(String::as_str)
            .ok_or_else(|| {
                RecordingError::unsupported(
                    file,
                    format!(
                        "there is no device `{}`; it holds {}",
                        crate::error::shown(wanted),
                        crate::error::join(devices.iter().map(String::as_str))
                    ),
                )
            }),
    }
}

fn nothing(file: &str, contents: &file::Contents) -> RecordingError {
    let topics = contents.channels.iter().map(|c| c.topic.as_str());
    RecordingError::not_a_recording(
        file,
        format!(
            "MCAP with the topics {}, of which none is a device of the lab or sensor_msgs/msg/Imu",
            crate::error::join(topics)
        ),
    )
}

/// The records of a recording of the lab in the order in which they were written, for a replay.
///
/// # Errors
/// The file cannot be opened, or is no MCAP.
pub fn lab_records(path: &Path) -> Result<LabRecords> {
    let file = path.display().to_string();
    let failed = |error| RecordingError::io(&file, "open it", error);
    let input = std::fs::File::open(path).map_err(failed)?;
    Ok(LabRecords {
        messages: Messages::new(Box::new(input), &file)?,
    })
}

/// See [`lab_records`].
pub struct LabRecords {
    messages: Messages,
}

impl LabRecords {
    /// Why it ended before its end, once it has.
    #[must_use]
    pub fn cut(&self) -> Option<&str> {
        match self.messages.end() {
            Some(End::Cut(why)) => Some(why),
            _ => None,
        }
    }
}

impl Iterator for LabRecords {
    type Item = LabRecord;

    fn next(&mut self) -> Option<LabRecord> {
        self.messages.by_ref().find_map(LabRecord::of)
    }
}

impl std::fmt::Debug for LabRecords {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("LabRecords").finish_non_exhaustive()
    }
}

/// What a file holds, without its samples.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Description {
    /// The devices of a recording of the lab; none of other files.
    pub devices: Vec<String>,
    /// The time of its first message, ns since 1970.
    pub start_ns: Option<i64>,
}

/// Looks what a file holds: in its list of contents, or in all of it when it is unfinished.
///
/// # Errors
/// It cannot be opened or is no MCAP.
pub fn describe(path: &Path) -> Result<Description> {
    let file = path.display().to_string();
    let failed = |error| RecordingError::io(&file, "open it", error);
    let mut input = std::fs::File::open(path).map_err(failed)?;
    if is_complete(path).map_err(failed)?
        && let Some(summary) = file::summary(&mut input)
    {
        let start = summary.stats.as_ref().map(|stats| stats.message_start_time);
        return Ok(Description {
            devices: devices(summary.channels.values()),
            start_ns: start.and_then(|ns| i64::try_from(ns).ok()),
        });
    }
    let mut messages = Messages::new(Box::new(input), &file)?;
    let first = messages.next();
    let start_ns = first.and_then(|message| i64::try_from(message.log_time).ok());
    let contents = contents(&mut messages.again(&file)?);
    Ok(Description {
        devices: devices(&contents.channels),
        start_ns,
    })
}
