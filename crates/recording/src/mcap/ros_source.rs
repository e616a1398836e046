//! The events of `sensor_msgs/Imu` and `MagneticField` in an MCAP file of ROS 2.

use std::collections::VecDeque;
use std::sync::Arc;

use ::mcap::{Channel, Message};

use super::file::{End, Messages};
use super::lab_source::{cut_remark, several};
use super::ros::{IMU, Imu, MAGNETIC_FIELD, MagneticField};
use super::ros_writer::{DEVICE_ORIENTATION, REFERENCE};
use crate::error::{RecordingError, Result};
use crate::event::{Event, Reference, Sample, SensorKind};
use crate::issues::Issues;
use crate::recording::EventSource;

/// The topics that are read.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Topics {
    imu: String,
    field: Option<String>,
}

/// Chooses the topics: of several `Imu` the raw one, with the field of the same namespace.
/// `None` when there is no `Imu` at all.
///
/// # Errors
/// There are several to choose from, or the one asked for is not there.
pub(crate) fn choose(
    channels: &[Arc<Channel<'static>>],
    wanted: Option<&str>,
    file: &str,
) -> Result<Option<Topics>> {
    let of = |kind: &str| -> Vec<String> {
        let mut topics: Vec<String> = channels
            .iter()
            .filter(|channel| is(channel, kind))
            .map(|channel| channel.topic.clone())
            .filter(|topic| topic != DEVICE_ORIENTATION && topic != REFERENCE)
            .collect();
        topics.sort();
        topics.dedup();
        topics
    };
    let imus = of(IMU);
    if imus.is_empty() {
        return Ok(None);
    }
    let raw: Vec<&String> = imus.iter().filter(|t| t.ends_with("data_raw")).collect();
    let imu = match (wanted, imus.as_slice(), raw.as_slice()) {
        (Some(wanted), ..) => imus.iter().find(|topic| *topic == wanted).ok_or_else(|| {
            RecordingError::unsupported(
                file,
                format!(
                    "there is no topic `{}` of sensor_msgs/Imu; it has {}",
                    crate::error::shown(wanted),
                    crate::error::join(imus.iter().map(String::as_str))
                ),
            )
        })?,
        (None, [only], _) => only,
        (None, _, [raw]) => raw,
        _ => return Err(several(file, &imus)),
    };
    let namespace = imu.rsplit_once('/').map_or("", |(namespace, _)| namespace);
    let fields = of(MAGNETIC_FIELD);
    let beside = fields.iter().find(|topic| {
        let of = topic
            .rsplit_once('/')
            .map_or("", |(namespace, _)| namespace);
        of == namespace
    });
    let field = match fields.as_slice() {
        [only] => Some(only.clone()),
        _ => beside.cloned(),
    };
    Ok(Some(Topics {
        imu: imu.clone(),
        field,
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
    ended: bool,
}

impl RosSource {
    pub(crate) fn new(messages: Messages, topics: Topics) -> Self {
        Self {
            messages,
            topics,
            ready: VecDeque::new(),
            unreadable: 0,
            ended: false,
        }
    }

    /// Reads everything once: which sensors come.
    pub(crate) fn sensors(mut self) -> (Vec<SensorKind>, Messages) {
        let mut seen = [false; SensorKind::ALL.len()];
        while let Some(event) = self.next() {
            seen[event.sample.kind().order()] = true;
        }
        let sensors = SensorKind::ALL
            .into_iter()
            .filter(|kind| seen[kind.order()]);
        (sensors.collect(), self.messages)
    }

    fn next(&mut self) -> Option<Event> {
        loop {
            if let Some(event) = self.ready.pop_front() {
                return Some(event);
            }
            if self.ended {
                return None;
            }
            match self.messages.next() {
                Some(message) => {
                    if self.take(&message).is_none() {
                        self.unreadable += 1;
                    }
                }
                None => self.ended = true,
            }
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
        let of_orientation = topic == DEVICE_ORIENTATION || topic == REFERENCE;
        if (topic != self.topics.imu && !of_orientation) || !is(&message.channel, IMU) {
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

impl EventSource for RosSource {
    fn next_event(&mut self, issues: &mut Issues) -> Option<Result<Event>> {
        let was_ended = self.ended;
        let event = self.next();
        if self.ended && !was_ended {
            if let Some(End::Cut(why)) = self.messages.end() {
                issues.notes.push(cut_remark(why));
            }
            if self.unreadable > 0 {
                issues.notes.push(format!(
                    "Messages that could not be decoded: {}.",
                    self.unreadable
                ));
            }
        }
        event.map(Ok)
    }
}
