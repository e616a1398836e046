//! MCAP: the lab's own recordings of everything as it arrived, and ROS 2 messages in and out.
//!
//! | I look for | file |
//! |---|---|
//! | the messages of a file, up to where it is cut | `file.rs`, of records `records.rs`, `definitions.rs` |
//! | what the lab records: channels, writer, records | `lab.rs` |
//! | the events of one device of such a recording | `lab_source.rs` |
//! | making an unfinished recording whole | `recover.rs` |
//! | `sensor_msgs/Imu`, `MagneticField` as bytes | `ros.rs`, `cdr.rs` |
//! | other messages | `nav_sat_fix.rs`, `pose_twist.rs`, `fluid_pressure.rs`, `diagnostics.rs` |
//! | whether a type is laid out as that of ROS | `message_definition.rs` |
//! | which topics are read, and in which order | `topics.rs`, `named_topics.rs`, `order.rs` |
//! | a file that several readers read | `shared.rs` |
//! | how sensors are mounted (`/tf_static`) | `tf_static.rs` |
//! | a folder of such files | `bag.rs`, `bag_file.rs` |
//! | bags in SQLite (`.db3`), bags of ROS 1 | `sqlite.rs`, `ros_1.rs` |
//! | estimates: odometry, transforms | `estimate_messages.rs`, `estimate_writer.rs` |
//! | what a message measures | `measured.rs` |
//! | reading and writing them | `ros_source.rs`, `ros_writer.rs` |
//!
//! Read first: `docs/formats.md`, section "MCAP", and the specification at <https://mcap.dev/spec>.

pub(crate) mod bag;
mod bag_file;
mod cdr;
mod definitions;
mod diagnostics;
pub(crate) mod estimate_messages;
mod estimate_writer;
mod file;
mod fluid_pressure;
mod lab;
mod lab_source;
mod measured;
mod message_definition;
mod named_topics;
pub(crate) mod nav_sat_fix;
mod order;
pub(crate) mod output;
mod pose_twist;
mod records;
mod recover;
mod ros;
mod ros_1;
mod ros_source;
mod ros_writer;
mod shared;
#[cfg(feature = "sqlite")]
mod sqlite;
mod tf_static;
mod topics;

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use ::mcap::Channel;

use crate::error::{RecordingError, Result, join, shown};
use crate::event::SensorKind;
use crate::issues::Issues;
use crate::metadata::{BODY_AXES, BodyAxes, Metadata};
use crate::recording::{EventSource, Opened};
use crate::text::open_file;
pub(crate) use bag_file::open_database;
pub(crate) use file::Input;
use file::{End, Messages, contents};
use lab_source::LabSource;
use order::in_order;
use ros_source::RosSource;
use topics::Topics;
pub(crate) use topics::Wanted;

pub use diagnostics::{Level, Status, diagnostics};
pub use estimate_messages::{EstimateTopic, FrameNames, messages};
pub use estimate_writer::EstimateWriter;
pub use lab::{LabRecord, LabWriter, RecordKind};
pub use measured::{Role, measured};
pub use recover::{Recovered, is_complete, recover};
pub use ros::frame as frame_id;
pub use ros_writer::{RosWriter, has_topic};
pub use tf_static::{Mounting, StaticTransforms};

/// Opens a recording of the lab, of ROS 2 in MCAP, or a bag of ROS 1; `wanted` is what the user said of devices
/// and topics.
pub(crate) fn open(
    input: Box<dyn Input>,
    file: &str,
    metadata: Metadata,
    wanted: Wanted<'_>,
) -> Result<Opened> {
    open_messages(Messages::new(input, file)?, file, metadata, wanted)
}

/// Opens the messages of one file.
fn open_messages(
    mut messages: Messages,
    file: &str,
    mut metadata: Metadata,
    wanted: Wanted<'_>,
) -> Result<Opened> {
    let contents = contents(&mut messages, file)?;
    contents.format.clone_into(&mut metadata.format);
    if let (true, Some(why)) = (contents.channels.is_empty(), contents.end.why()) {
        return Err(RecordingError::damaged(
            file,
            format!("{why}; nothing in it can be read"),
        ));
    }
    let devices = devices(&contents.channels);
    if !devices.is_empty() {
        let device = one_of(&devices, wanted.device, ["device", "; it holds"], file)?;
        metadata.device = Some(device.clone());
        return of_lab(&messages, device, file, metadata);
    }
    let Some((topics, mut notes)) = topics::choose(&contents, wanted, file)? else {
        return Err(nothing(file, &contents));
    };
    let mounting = mounted(&contents, &topics, &mut metadata);
    notes.extend_from_slice(mounting.notes());
    let ordered = in_order(topics.reads(), |reads| {
        Ok(RosSource::new(messages.another(file)?, reads, &mounting))
    })?;
    notes.extend(ordered.note);
    Ok(Opened {
        notes,
        ..Opened::new(metadata, ordered.sensors, ordered.source)
    })
}

/// Opens what the lab recorded of a device; for its sensors everything is read once.
fn of_lab(messages: &Messages, device: &str, file: &str, metadata: Metadata) -> Result<Opened> {
    let open = || Ok(LabSource::new(messages.another(file)?, device));
    let (mut source, mut issues) = (open()?, Issues::default());
    let mut seen = [false; SensorKind::ALL.len()];
    while let Some(event) = source.next_event(&mut issues)? {
        seen[event.sample.kind().order()] = true;
    }
    let sensors = SensorKind::ALL.into_iter();
    let sensors = sensors.filter(|kind| seen[kind.order()]).collect();
    Ok(Opened::new(metadata, sensors, Box::new(open()?)))
}

/// How the sensors of a bag are mounted; what is known of their axes and of the antenna goes into the metadata.
fn mounted(contents: &file::Contents, topics: &Topics, metadata: &mut Metadata) -> Mounting {
    let axes = body_axes(&contents.channels);
    metadata.body_axes = Some(axes);
    let mut mounting = Mounting::of(&contents.transforms, topics, &contents.frames);
    if metadata.gnss_lever_arm_m.is_none() {
        metadata.gnss_lever_arm_m = mounting.lever_arm_m(axes);
    }
    mounting
}

/// The axes of the sensors of a bag: REP 103 has them forward, left, up, unless its writer says another thing of a channel.
fn body_axes<'a>(channels: impl IntoIterator<Item = &'a Arc<Channel<'static>>>) -> BodyAxes {
    let mut told = channels
        .into_iter()
        .filter_map(|channel| channel.metadata.get(BODY_AXES)?.parse().ok());
    told.next().unwrap_or(BodyAxes::Flu)
}

/// The devices of a recording of the lab.
fn devices<'a>(channels: impl IntoIterator<Item = &'a Arc<Channel<'static>>>) -> Vec<String> {
    let name = |channel: &'a Arc<Channel<'static>>| match lab::channel_of(&channel.metadata)? {
        (device, RecordKind::Payload(_)) => Some(device.to_owned()),
        _ => None,
    };
    let devices: BTreeSet<_> = channels.into_iter().filter_map(name).collect();
    devices.into_iter().collect()
}

/// The wanted one of several devices or topics, or the only one.
fn one_of<'a>(
    names: &'a [String],
    wanted: Option<&str>,
    [what, others]: [&str; 2],
    file: &str,
) -> Result<&'a String> {
    let list = || join(names.iter().map(String::as_str));
    let problem = match (wanted, names) {
        (None, [only]) => return Ok(only),
        (None, _) => format!(
            "it holds several devices: {}; say which one with --device NAME",
            list()
        ),
        (Some(wanted), _) => match names.iter().find(|name| *name == wanted) {
            Some(found) => return Ok(found),
            None => format!("there is no {what} `{}`{others} {}", shown(wanted), list()),
        },
    };
    Err(RecordingError::unsupported(file, problem))
}

fn nothing(file: &str, contents: &file::Contents) -> RecordingError {
    let topics = contents.channels.iter().map(|channel| {
        let kind = channel.schema.as_ref().map(|schema| schema.name.as_str());
        let kind = kind.filter(|kind| !kind.is_empty());
        match kind {
            Some(kind) => format!("{} ({})", shown(&channel.topic), shown(kind)),
            None => shown(&channel.topic),
        }
    });
    let topics: Vec<String> = topics.collect();
    RecordingError::not_a_recording(
        file,
        format!(
            "{} with the topics {}, of which none is a device of the lab, sensor_msgs/msg/Imu or NavSatFix",
            if contents.format == file::MCAP {
                "MCAP"
            } else {
                "a bag"
            },
            join(topics.iter().map(String::as_str))
        ),
    )
}

/// The records of a recording of the lab in the order in which they were written, for a replay.
///
/// # Errors
/// The file cannot be opened, or is no MCAP.
pub fn lab_records(path: &Path) -> Result<LabRecords> {
    let file = path.display().to_string();
    Ok(LabRecords {
        messages: Messages::new(Box::new(open_file(path, &file)?), &file)?,
    })
}

/// See [`lab_records`].
pub struct LabRecords {
    messages: Messages,
}

impl LabRecords {
    /// Why it ended before its end, once it has.
    #[must_use]
    pub fn cut(&self) -> Option<String> {
        self.messages.end().and_then(End::why)
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
    let input = || open_file(path, &file);
    if is_complete(path).map_err(failed)?
        && let Some(summary) = file::summary(Box::new(input()?))
    {
        return Ok(Description {
            devices: devices(&summary.channels),
            start_ns: summary.start_ns.and_then(|ns| i64::try_from(ns).ok()),
        });
    }
    let mut messages = Messages::new(Box::new(input()?), &file)?;
    let first = messages.next();
    let start_ns = first.and_then(|message| i64::try_from(message.log_time).ok());
    let contents = contents(&mut messages.another(&file)?, &file)?;
    Ok(Description {
        devices: devices(&contents.channels),
        start_ns,
    })
}
