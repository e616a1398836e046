//! The events of the chosen topics in a bag of ROS.

use std::collections::{BTreeMap, VecDeque};

use ::mcap::Message;

use super::file::Messages;
use super::measured::{Role, measured};
use super::tf_static::Mounting;
use super::topics::schema;
use crate::error::{Result, shown};
use crate::event::{Event, SensorKind};
use crate::issues::Issues;
use crate::local_place::LocalPlace;
use crate::recording::Pieces;

/// A topic that is read, and what of it.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Read {
    pub(super) topic: String,
    pub(super) role: Role,
    /// Of what its messages measure, these; `None`: everything.
    pub(super) only: Option<Vec<SensorKind>>,
    /// Of [`Role::LocalPosition`]: where positions count from.
    pub(super) place: Option<LocalPlace>,
}

impl Read {
    /// Everything that is measured on a topic.
    pub(super) fn all(topic: &str, role: Role) -> Self {
        Self {
            topic: topic.to_owned(),
            role,
            only: None,
            place: None,
        }
    }

    fn takes(&self, event: &Event) -> bool {
        let kind = event.sample.kind();
        self.only.as_ref().is_none_or(|only| only.contains(&kind))
    }
}

/// The stream of these topics.
pub(crate) struct RosSource {
    messages: Messages,
    reads: Vec<Read>,
    mounting: Mounting,
    ready: VecDeque<Event>,
    /// Messages that could not be decoded, by topic.
    unreadable: BTreeMap<String, u64>,
}

impl RosSource {
    pub(crate) fn new(messages: Messages, reads: &[Read], mounting: &Mounting) -> Self {
        Self {
            messages,
            reads: reads.to_vec(),
            mounting: mounting.clone(),
            ready: VecDeque::new(),
            unreadable: BTreeMap::new(),
        }
    }

    fn take(&mut self, message: &Message<'_>) {
        let topic = message.channel.topic.as_str();
        let Some(schema) = schema(&message.channel) else {
            return;
        };
        let mut reads = self.reads.iter();
        while let Some(read) = reads.find(|read| read.topic == topic) {
            if !read.role.takes(schema) {
                continue;
            }
            let place = read.place.as_ref();
            let log_time_ns = i64::try_from(message.log_time).ok();
            let measured =
                log_time_ns.and_then(|ns| measured(read.role, schema, &message.data, ns, place));
            match measured {
                Some(measured) => {
                    let events = measured.filter(|event| read.takes(event));
                    let turned = events.map(|event| self.mounting.turned(topic, event));
                    self.ready.extend(turned);
                }
                None => *self.unreadable.entry(topic.to_owned()).or_default() += 1,
            }
        }
    }

    fn report(&self, issues: &mut Issues) {
        self.messages.report(issues);
        for (topic, count) in &self.unreadable {
            issues.notes.push(format!(
                "Messages on {} that could not be decoded: {count}.",
                shown(topic)
            ));
        }
    }
}

impl Pieces for RosSource {
    fn ready(&mut self) -> Option<Event> {
        self.ready.pop_front()
    }

    fn read(&mut self, issues: &mut Issues) -> Result<bool> {
        let Some(message) = self.messages.next() else {
            self.report(issues);
            return Ok(false);
        };
        self.take(&message);
        Ok(true)
    }
}
