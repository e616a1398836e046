//! The events of `sensor_msgs/Imu`, `MagneticField` and `NavSatFix` in an MCAP file of ROS 2.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

use ::mcap::{Channel, Message};

use super::file::Messages;
use super::nav_sat_fix;
use super::ros::{IMU, Imu, MAGNETIC_FIELD, MagneticField};
use super::ros_writer::{DEVICE_ORIENTATION, REFERENCE};
use super::{OfMessages, one_of};
use crate::error::Result;
use crate::event::{Event, Reference, Sample};
use crate::issues::Issues;
use crate::recording::Pieces;

/// The topics that are read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Topics {
    imu: Option<String>,
    field: Option<String>,
    fix: Option<String>,
}

/// Chooses the topics: of several `Imu` the raw one, with the field of the same namespace; the only one with fixes, or
/// of several the one of that namespace. `None` when there is neither `Imu` nor `NavSatFix`.
///
/// # Errors
/// There are several to choose from, or the one asked for is not there.
pub(crate) fn choose(
    channels: &[Arc<Channel<'static>>],
    wanted: Option<&str>,
    file: &str,
) -> Result<Option<Topics>> {
    let of = |kind: &str| -> Vec<String> {
        let topics = channels.iter().filter(|channel| is(channel, kind));
        let topics: BTreeSet<_> = topics
            .map(|channel| channel.topic.clone())
            .filter(|topic| topic != DEVICE_ORIENTATION && topic != REFERENCE)
            .collect();
        topics.into_iter().collect()
    };
    let (imus, fixes) = (of(IMU), of(nav_sat_fix::NAME));
    if imus.is_empty() {
        if fixes.is_empty() {
            return Ok(None);
        }
        let words = ["topic", " of sensor_msgs/NavSatFix; it has"];
        return Ok(Some(Topics {
            imu: None,
            field: None,
            fix: Some(one_of(&fixes, wanted, words, file)?.clone()),
        }));
    }
    let raw: Vec<&String> = imus.iter().filter(|t| t.ends_with("data_raw")).collect();
    let imu = match (wanted, raw.as_slice()) {
        (None, [raw]) => raw,
        _ => one_of(
            &imus,
            wanted,
            ["topic", " of sensor_msgs/Imu; it has"],
            file,
        )?,
    };
    let namespace = |topic: &str| {
        topic
            .rsplit_once('/')
            .map_or("", |(name, _)| name)
            .to_owned()
    };
    let beside = |topics: &[String]| match topics {
        [only] => Some(only.clone()),
        _ => {
            let mut topics = topics.iter();
            let near = topics.find(|topic| namespace(topic) == namespace(imu));
            near.cloned()
        }
    };
    Ok(Some(Topics {
        imu: Some(imu.clone()),
        field: beside(&of(MAGNETIC_FIELD)),
        fix: beside(&fixes),
    }))
}

fn is(channel: &Channel<'_>, kind: &str) -> bool {
    let schema = channel.schema.as_ref().map(|schema| schema.name.as_str());
    // ROS 1 names have no `msg` and other bytes.
    channel.message_encoding == "cdr" && schema == Some(kind)
}

/// The stream of these topics.
pub(crate) struct RosSource {
    messages: Messages,
    topics: Topics,
    ready: VecDeque<Event>,
    unreadable: u64,
}

impl RosSource {
    pub(crate) fn new(messages: Messages, topics: Topics) -> Self {
        Self {
            messages,
            topics,
            ready: VecDeque::new(),
            unreadable: 0,
        }
    }

    /// `None` when the message is one of ours and cannot be read.
    fn take(&mut self, message: &Message<'_>) -> Option<()> {
        let topic = message.channel.topic.as_str();
        let log_time_ns = i64::try_from(message.log_time).ok()?;
        if self.topics.field.as_deref() == Some(topic) {
            if is(&message.channel, MAGNETIC_FIELD) {
                let field = MagneticField::decode(&message.data, log_time_ns)?;
                self.add(field.time_ns, Sample::MagneticField(field.field_ut));
            }
            return Some(());
        }
        if self.topics.fix.as_deref() == Some(topic) {
            if is(&message.channel, nav_sat_fix::NAME) {
                let (time_ns, fix) = nav_sat_fix::decode(&message.data, log_time_ns)?;
                self.add(time_ns, Sample::GnssPosition(fix));
            }
            return Some(());
        }
        let of_orientation = topic == DEVICE_ORIENTATION || topic == REFERENCE;
        let is_imu = self.topics.imu.as_deref() == Some(topic);
        if !(is_imu || of_orientation) || !is(&message.channel, IMU) {
            return Some(());
        }
        let imu = Imu::decode(&message.data, log_time_ns)?;
        if let Some(rate) = imu.angular_rate {
            self.add(imu.time_ns, Sample::AngularRate(rate));
        }
        if let Some(force) = imu.specific_force {
            self.add(imu.time_ns, Sample::SpecificForce(force));
        }
        if let Some((attitude, _)) = imu.orientation {
            let sample = if topic == REFERENCE {
                Sample::Reference(Reference {
                    attitude,
                    scored: true,
                })
            } else {
                Sample::DeviceOrientation(attitude)
            };
            self.add(imu.time_ns, sample);
        }
        Some(())
    }

    fn add(&mut self, time_ns: i64, sample: Sample) {
        self.ready.push_back(Event { time_ns, sample });
    }
}

impl Pieces for RosSource {
    fn ready(&mut self) -> Option<Event> {
        self.ready.pop_front()
    }

    fn read(&mut self, issues: &mut Issues) -> Result<bool> {
        let Some(message) = self.messages.next() else {
            self.messages.report(self.unreadable, issues);
            return Ok(false);
        };
        self.unreadable += u64::from(self.take(&message).is_none());
        Ok(true)
    }
}

impl OfMessages for RosSource {
    fn into_messages(self) -> Messages {
        self.messages
    }
}
