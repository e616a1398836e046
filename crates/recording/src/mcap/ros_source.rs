//! The events of the chosen topics in an MCAP file of ROS 2.

use std::collections::VecDeque;

use ::mcap::Message;

use super::OfMessages;
use super::file::Messages;
use super::nav_sat_fix;
use super::pose_twist::{self, ODOMETRY, POSE, TWIST, TWIST_WITH_COVARIANCE};
use super::ros::{IMU, Imu, MAGNETIC_FIELD, MagneticField};
use super::ros_writer::{DEVICE_ORIENTATION, REFERENCE};
use super::topics::{Topics, is};
use crate::error::Result;
use crate::event::{Event, Reference, Sample};
use crate::issues::Issues;
use crate::recording::Pieces;

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
        if self.topics.velocity.as_deref() == Some(topic) {
            let has_covariance = is(&message.channel, TWIST_WITH_COVARIANCE);
            if has_covariance || is(&message.channel, TWIST) {
                let velocity = pose_twist::velocity(&message.data, log_time_ns, has_covariance);
                let (time_ns, velocity) = velocity?;
                self.add(time_ns, Sample::GnssVelocity(velocity));
            }
            return Some(());
        }
        if self.topics.pose.as_deref() == Some(topic) {
            let is_odometry = is(&message.channel, ODOMETRY);
            if is_odometry || is(&message.channel, POSE) {
                let pose = pose_twist::attitude(&message.data, log_time_ns, is_odometry);
                let (time_ns, attitude) = pose?;
                let reference = Reference {
                    attitude,
                    scored: true,
                };
                self.add(time_ns, Sample::Reference(reference));
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
