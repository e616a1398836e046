//! The events of the chosen topics in an MCAP file of ROS 2.

use std::collections::VecDeque;

use ::mcap::Message;

use super::OfMessages;
use super::file::Messages;
use super::measured::measured;
use super::tf_static::Mounting;
use super::topics::{Topics, schema};
use crate::error::Result;
use crate::event::Event;
use crate::issues::Issues;
use crate::recording::Pieces;

/// The stream of these topics.
pub(crate) struct RosSource {
    messages: Messages,
    topics: Topics,
    mounting: Mounting,
    ready: VecDeque<Event>,
    unreadable: u64,
}

impl RosSource {
    pub(crate) fn new(messages: Messages, topics: Topics, mounting: Mounting) -> Self {
        Self {
            messages,
            topics,
            mounting,
            ready: VecDeque::new(),
            unreadable: 0,
        }
    }

    /// `None` when the message is one of ours and cannot be read.
    fn take(&mut self, message: &Message<'_>) -> Option<()> {
        let topic = message.channel.topic.as_str();
        let Some(role) = self.topics.role(topic) else {
            return Some(());
        };
        let Some(schema) = schema(&message.channel).filter(|schema| role.takes(schema)) else {
            return Some(());
        };
        let log_time_ns = i64::try_from(message.log_time).ok()?;
        let measured = measured(role, schema, &message.data, log_time_ns)?;
        self.ready
            .extend(measured.map(|event| self.mounting.turned(event)));
        Some(())
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
