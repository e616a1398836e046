//! The messages in the order in which an estimator takes them.
//!
//! Messages of different topics come when they come: a magnetometer's a little behind the inertial sensor's, a receiver's a
//! tenth of a second and more, and drivers send bursts. A fix keeps its stamp, for which the filter remembers where it was; the others
//! are put in order with the inertial sensor's (`order.rs`). A clock that jumps back ends the run, and the next one begins anew. What
//! readers of files refuse is said of messages, which nobody can refuse.

use std::time::Duration;

use nalgebra::Vector3;
use northing_recording::mcap::Role;
use northing_recording::plausibility::Plausibility;
use northing_recording::{Event, RecordingError, Sample};

use crate::diagnostics::Diagnostics;
use crate::node::{Heard, Node};
use crate::order::{OTHER_CLOCK, OTHER_CLOCK_NS, Order};

/// How often it is looked whether to stop.
const LOOK: Duration = Duration::from_millis(100);
/// Inertial stamps further back than this are not late but of another time, ...
const BACK_NS: i64 = 1_000_000_000;
/// ... once so many come in a row.
const BACK_MESSAGES: u32 = 5;

/// A message that was heard.
#[derive(Debug, Clone)]
pub struct Message {
    /// What is taken from its topic.
    pub role: Role,
    /// The frame in its header.
    pub frame: Option<String>,
    /// Its samples, all of one stamp; `None` where its bytes are not such a message.
    pub events: Option<Vec<Event>>,
    /// Whether it came without a stamp, and has that of its arrival.
    pub is_unstamped: bool,
}

/// Why there are no more messages.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Ended {
    /// The user stopped it.
    Stopped,
    /// The clock of the inertial sensor went back by so many nanoseconds.
    ClockWentBack(i64),
    /// Static transforms, or the frame of a sensor, tell another mounting than before.
    Mounted,
    /// Parameters were set: `NAME=VALUE`.
    Set(Vec<String>),
}

/// What an inertial sensor measured last.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(crate) struct Measured {
    pub(crate) time_ns: i64,
    pub(crate) angular_rate: Option<Vector3<f64>>,
    pub(crate) specific_force: Option<Vector3<f64>>,
}

/// The messages of a run, each as its events.
pub struct Messages<'a> {
    node: &'a Node,
    is_stopped: &'a dyn Fn() -> bool,
    /// The newest inertial stamp.
    newest_ns: Option<i64>,
    back: u32,
    order: Order,
    /// Until the run ends.
    plausibility: Option<Plausibility>,
    tell: &'a dyn Fn(&str),
    ended: Option<Ended>,
}

impl std::fmt::Debug for Messages<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Messages").finish_non_exhaustive()
    }
}

/// What becomes of a message.
#[derive(Debug, Clone, PartialEq)]
enum Taken {
    /// It is given to the estimator.
    Given(Vec<Event>),
    /// It is left out; why.
    LeftOut(&'static str),
    /// The run ends before it.
    End(Ended),
}

impl<'a> Messages<'a> {
    /// Those of a node, until `is_stopped`.
    pub fn new(node: &'a Node, is_stopped: &'a dyn Fn() -> bool) -> Self {
        Self {
            node,
            is_stopped,
            newest_ns: None,
            back: 0,
            order: Order::default(),
            plausibility: Some(Plausibility::of_ros()),
            tell: &|_| (),
            ended: None,
        }
    }

    /// Says by `tell` once what is wrong with the messages of a topic.
    #[must_use]
    pub fn telling(self, tell: &'a dyn Fn(&str)) -> Self {
        Self { tell, ..self }
    }

    /// Why there are no more.
    #[must_use]
    pub fn ended(&self) -> Option<Ended> {
        self.ended.clone()
    }

    /// The parameters that were set, all that wait.
    fn set(&mut self, first: String) -> Ended {
        let mut settings = vec![first];
        while let Some(heard) = self.node.next(Duration::ZERO) {
            match heard {
                Heard::Setting(setting) => settings.push(setting),
                other => {
                    self.node.unread(other);
                    break;
                }
            }
        }
        Ended::Set(settings)
    }

    /// The next message of a sensor; `None` where the run ends, or there is none yet.
    fn message(&mut self) -> Option<Message> {
        match self.node.next(LOOK)? {
            Heard::Transforms(bytes) => {
                let is_another = self.node.mounted().transforms(&bytes);
                self.ended = is_another.then_some(Ended::Mounted);
                None
            }
            Heard::Setting(setting) => {
                self.ended = Some(self.set(setting));
                None
            }
            Heard::Message(message) => {
                if self.node.mounted().frame(&message) {
                    self.node.unread(Heard::Message(message));
                    self.ended = Some(Ended::Mounted);
                    return None;
                }
                Some(message)
            }
        }
    }
}

/// What becomes of a message, where `newest_ns` is the newest inertial stamp and `back` counts those that went back.
fn take(message: &Message, newest_ns: &mut Option<i64>, back: &mut u32) -> Taken {
    let Some(events) = &message.events else {
        return Taken::LeftOut("not readable");
    };
    let Some(time_ns) = events.first().map(|event| event.time_ns) else {
        return Taken::LeftOut("nothing measured");
    };
    let Some(newest) = *newest_ns else {
        if message.role == Role::Inertial {
            *newest_ns = Some(time_ns);
        }
        return Taken::Given(events.clone());
    };
    let behind = newest.saturating_sub(time_ns);
    match message.role {
        Role::Inertial if behind > BACK_NS => {
            *back += 1;
            match *back >= BACK_MESSAGES {
                true => Taken::End(Ended::ClockWentBack(behind)),
                false => Taken::LeftOut("stamp went back"),
            }
        }
        Role::Inertial if behind >= 0 => Taken::LeftOut("stamp not newer"),
        Role::Inertial => {
            (*newest_ns, *back) = (Some(time_ns), 0);
            Taken::Given(events.clone())
        }
        _ if behind.saturating_abs() > OTHER_CLOCK_NS => Taken::LeftOut(OTHER_CLOCK),
        _ => Taken::Given(events.clone()),
    }
}

impl Messages<'_> {
    /// Takes a message of a sensor.
    fn put(&mut self, message: &Message) {
        match take(message, &mut self.newest_ns, &mut self.back) {
            Taken::Given(mut events) => {
                self.check(message, &events);
                let mounted = self.node.mounted();
                for event in &mut events {
                    *event = mounted.mounting.turned_of(message.role, *event);
                }
                drop(mounted);
                self.told(|told| told.heard(message, measured_of(&events)));
                self.order.put(message.role, events);
            }
            Taken::LeftOut(why) => self.told(|told| told.left_out(message.role, why)),
            Taken::End(ended) => self.ended = Some(ended),
        }
        for (role, why) in self.order.left_out() {
            self.told(|told| told.left_out(role, why));
        }
    }

    /// Looks whether the numbers of a message can be what they are said to be, and whether it has a stamp.
    fn check(&mut self, message: &Message, events: &[Event]) {
        if message.is_unstamped {
            self.remark(|told| told.unstamped(message.role));
        }
        let Some(plausibility) = &mut self.plausibility else {
            return;
        };
        let checked = events.iter().map(|event| plausibility.check(event, ""));
        let doubts: Vec<RecordingError> = checked.filter_map(Result::err).collect();
        for doubt in doubts {
            self.remark(|told| told.doubt(&doubt));
        }
    }

    /// The verdict on messages too few for the running checks.
    fn finish(&mut self) {
        let plausibility = self.plausibility.take();
        if let Some(Err(doubt)) = plausibility.map(|mut checks| checks.finish("")) {
            self.remark(|told| told.doubt(&doubt));
        }
    }

    fn told(&self, tell: impl FnOnce(&mut Diagnostics)) {
        tell(&mut self.node.told());
    }

    /// Says what is remarked for the first time.
    fn remark(&self, remark: impl FnOnce(&mut Diagnostics) -> Option<String>) {
        let new = remark(&mut self.node.told());
        if let Some(sentence) = new {
            (self.tell)(&sentence);
        }
    }
}

impl Iterator for Messages<'_> {
    type Item = Vec<Event>;

    fn next(&mut self) -> Option<Vec<Event>> {
        loop {
            if let Some(events) = self.order.next() {
                return Some(events);
            }
            if self.ended.is_some() {
                self.finish();
                return None;
            }
            if (self.is_stopped)() {
                self.ended = Some(Ended::Stopped);
                continue;
            }
            if let Some(message) = self.message() {
                self.put(&message);
            }
        }
    }
}

fn measured_of(events: &[Event]) -> Option<Measured> {
    let mut measured = Measured::default();
    for event in events {
        match event.sample {
            Sample::AngularRate(rate) => measured.angular_rate = Some(rate),
            Sample::SpecificForce(force) => measured.specific_force = Some(force),
            _ => {}
        }
        measured.time_ns = event.time_ns;
    }
    let is_inertial = measured.angular_rate.is_some() || measured.specific_force.is_some();
    is_inertial.then_some(measured)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND: i64 = 1_000_000_000;

    fn message(role: Role, time_ns: i64) -> Message {
        let sample = match role {
            Role::Inertial => Sample::AngularRate(Vector3::zeros()),
            _ => Sample::MagneticField(Vector3::x()),
        };
        Message {
            role,
            frame: None,
            events: Some(vec![Event { time_ns, sample }]),
            is_unstamped: false,
        }
    }

    #[test]
    fn messages_keep_their_stamps_unless_these_are_of_another_clock() {
        let (mut newest, mut back) = (None, 0);
        let mut take = |message: Message| take(&message, &mut newest, &mut back);
        let stamp = |taken: Taken| match taken {
            Taken::Given(events) => Some(events[0].time_ns),
            _ => None,
        };
        assert_eq!(
            stamp(take(message(Role::Fix, 7))),
            Some(7),
            "before any Imu"
        );
        let now = 100 * SECOND;
        assert_eq!(stamp(take(message(Role::Inertial, now))), Some(now));
        assert_eq!(stamp(take(message(Role::Inertial, now))), None);
        assert_eq!(stamp(take(message(Role::Inertial, now - 1))), None);
        assert_eq!(stamp(take(message(Role::Field, now - 3))), Some(now - 3));
        let late = now - SECOND / 5;
        assert_eq!(stamp(take(message(Role::Fix, late))), Some(late));
        let other = take(message(Role::Fix, now - 3600 * SECOND));
        assert_eq!(other, Taken::LeftOut(OTHER_CLOCK));
        let unreadable = Message {
            events: None,
            ..message(Role::Inertial, 0)
        };
        assert_eq!(take(unreadable), Taken::LeftOut("not readable"));
    }

    #[test]
    fn a_clock_that_jumps_back_ends_the_run_and_single_wrong_stamps_do_not() {
        let (mut newest, mut back) = (Some(100 * SECOND), 0);
        let mut take = |time_ns| take(&message(Role::Inertial, time_ns), &mut newest, &mut back);
        for k in 1..=20 {
            assert_eq!(take(5), Taken::LeftOut("stamp went back"));
            assert!(matches!(take(100 * SECOND + k), Taken::Given(_)));
        }
        for k in 0..4 {
            assert_eq!(take(k), Taken::LeftOut("stamp went back"));
        }
        let end = Taken::End(Ended::ClockWentBack(100 * SECOND + 20 - 4));
        assert_eq!(take(4), end);
    }
}
