//! The state of inputs and estimator, once a second on `/diagnostics`.
//!
//! Each sentence states what was heard and counted since the one before; what that means for a robot is its own affair. A
//! level above OK has its reason in the sentence.

use std::collections::BTreeMap;
use std::time::Instant;

use northing_core::kalman::{Innovation, Outcome, SkipReason};
use northing_core::navigation::Validity;
use northing_evaluation::statistics::lamp::{Remark, Tone};
use northing_recording::mcap::{EstimateTopic, Level, Role, Status, diagnostics};

use crate::messages::{Measured, Message};
use crate::node::NodeConfig;

/// The topic, in every namespace the same.
pub(crate) const TOPIC: &str = "/diagnostics";
/// The type of its messages.
pub(crate) const SCHEMA: &str = "diagnostic_msgs/msg/DiagnosticArray";

/// An inertial sensor that is silent for longer pauses; an estimate is not carried over it (`--gap-limit`).
const PAUSE_S: f64 = 0.5;
/// Why a message is not sent: the middleware says no more.
const REFUSED: &str = "the middleware refused them";
/// An input is missed after so many of its mean intervals.
const MISSED_INTERVALS: f64 = 10.0;

/// A topic that is listened to.
#[derive(Debug, Clone)]
struct Input {
    topic: String,
    heard: u64,
    /// Since the last diagnostics.
    heard_now: u64,
    /// When the first and the last were heard.
    span: Option<[Instant; 2]>,
    left_out: BTreeMap<&'static str, u64>,
}

/// What the updates of a sensor did since the last diagnostics.
#[derive(Debug, Clone, Copy, Default)]
struct Updates {
    fused: u64,
    gated: u64,
    skipped: u64,
    nis: f64,
    components: f64,
}

/// What diagnostics are made of.
#[derive(Debug, Clone)]
pub struct Diagnostics {
    name: String,
    inputs: BTreeMap<Role, Input>,
    updates: BTreeMap<&'static str, Updates>,
    estimates: u64,
    estimates_now: u64,
    /// Messages that the middleware did not take.
    refused: BTreeMap<EstimateTopic, u64>,
    refused_now: u64,
    validity: Option<Validity>,
    measured: Measured,
    frame: Option<String>,
    since: Instant,
}

impl Diagnostics {
    pub(crate) fn new(name: &str, config: &NodeConfig) -> Self {
        let input = |(role, topic): &(Role, String)| {
            let input = Input {
                topic: topic.clone(),
                heard: 0,
                heard_now: 0,
                span: None,
                left_out: BTreeMap::new(),
            };
            (*role, input)
        };
        Self {
            name: name.to_owned(),
            inputs: config.inputs.iter().map(input).collect(),
            updates: BTreeMap::new(),
            estimates: 0,
            estimates_now: 0,
            refused: BTreeMap::new(),
            refused_now: 0,
            validity: None,
            measured: Measured::default(),
            frame: None,
            since: Instant::now(),
        }
    }

    pub(crate) fn heard(&mut self, message: &Message, measured: Option<Measured>) {
        let now = Instant::now();
        if let Some(input) = self.inputs.get_mut(&message.role) {
            input.heard += 1;
            input.heard_now += 1;
            let [first, _] = input.span.unwrap_or([now; 2]);
            input.span = Some([first, now]);
        }
        if let Some(measured) = measured {
            self.measured = measured;
            if self.frame != message.frame {
                self.frame.clone_from(&message.frame);
            }
        }
    }

    pub(crate) fn left_out(&mut self, role: Role, why: &'static str) {
        if let Some(input) = self.inputs.get_mut(&role) {
            *input.left_out.entry(why).or_default() += 1;
        }
    }

    pub(crate) fn updated(&mut self, sensor: &'static str, innovation: &Innovation<f64>) {
        let updates = self.updates.entry(sensor).or_default();
        match innovation.outcome {
            Outcome::Fused | Outcome::Inflated => updates.fused += 1,
            Outcome::Gated => updates.gated += 1,
            // It waits for the next one, with which it is fused.
            Outcome::Skipped(SkipReason::Accumulated) => {}
            Outcome::Skipped(_) => updates.skipped += 1,
        }
        if !matches!(innovation.outcome, Outcome::Skipped(_)) && innovation.nis.is_finite() {
            updates.nis += innovation.nis;
            updates.components += f64::from(innovation.degrees_of_freedom);
        }
    }

    pub(crate) fn estimated(&mut self) {
        self.estimates += 1;
        self.estimates_now += 1;
    }

    /// The middleware did not take a message of this topic.
    pub(crate) fn refused(&mut self, topic: EstimateTopic) {
        *self.refused.entry(topic).or_default() += 1;
        self.refused_now += 1;
    }

    pub(crate) fn validity(&mut self, validity: Validity) {
        self.validity = Some(validity);
    }

    /// What was measured at this stamp, if it is the newest.
    pub(crate) fn measured_at(&self, time_ns: i64) -> Option<Measured> {
        Some(self.measured).filter(|measured| measured.time_ns == time_ns)
    }

    /// The frame of the inertial sensor's messages.
    pub(crate) fn frame(&self) -> Option<&str> {
        self.frame.as_deref().filter(|frame| !frame.is_empty())
    }

    /// How many messages were heard of an input.
    #[must_use]
    pub fn heard_of(&self, role: Role) -> u64 {
        self.inputs.get(&role).map_or(0, |input| input.heard)
    }

    /// What was heard of each topic and left out, and what could not be sent, one sentence each.
    #[must_use]
    pub fn sentences(&self) -> Vec<String> {
        let inputs = self
            .inputs
            .values()
            .filter(|input| input.heard > 0 || !input.left_out.is_empty());
        let heard = inputs.map(|input| {
            let mut text = format!("{}: {} messages taken", input.topic, input.heard);
            for (why, count) in &input.left_out {
                text.push_str(&format!(", {count} left out ({why})"));
            }
            text.push('.');
            text
        });
        let refused = self.refused.iter().map(|(topic, count)| {
            format!("{}: {count} messages not sent: {REFUSED}.", topic.name())
        });
        heard.chain(refused).collect()
    }

    /// The message; what is counted a second begins anew.
    pub(crate) fn message(&mut self) -> Option<Vec<u8>> {
        let seconds = self.since.elapsed().as_secs_f64().max(1e-3);
        self.since = Instant::now();
        let mut statuses: Vec<Status> = Vec::new();
        for (role, input) in &mut self.inputs {
            statuses.push(input.status(*role, &self.name, seconds));
        }
        statuses.push(self.estimate_status(seconds));
        for (sensor, updates) in &mut self.updates {
            statuses.push(updates.status(&format!("{}: {sensor}", self.name)));
            *updates = Updates::default();
        }
        self.estimates_now = 0;
        self.refused_now = 0;
        diagnostics(self.measured.time_ns, &self.name, &statuses)
    }

    fn estimate_status(&self, seconds: f64) -> Status {
        let (level, message) = match (self.estimates, self.validity) {
            (0, _) => (Level::Stale, "no estimate yet".to_owned()),
            (_, None) => (Level::Ok, "attitude is estimated".to_owned()),
            (_, Some(validity)) => of_validity(validity),
        };
        let is_less = self.estimates_now == 0 || self.refused_now > 0;
        let level = match level {
            Level::Ok if is_less => Level::Warn,
            _ => level,
        };
        let mut message = message;
        if self.estimates > 0 && self.estimates_now == 0 {
            message.push_str("; none since the last diagnostics");
        }
        if self.refused_now > 0 {
            message.push_str(&format!(
                "; {} messages not sent: {REFUSED}",
                self.refused_now
            ));
        }
        let each_second = format!("{:.1}", self.estimates_now as f64 / seconds);
        let mut values = vec![("estimates in a second".to_owned(), each_second)];
        for (topic, count) in &self.refused {
            values.push((format!("not sent: {}", topic.name()), count.to_string()));
        }
        Status {
            level,
            name: format!("{}: estimate", self.name),
            message,
            values,
        }
    }
}

fn of_validity(validity: Validity) -> (Level, String) {
    let remark = Remark::of_validity(validity);
    let level = match remark.tone {
        Tone::Good | Tone::Info => Level::Ok,
        Tone::Warn => Level::Warn,
        Tone::Bad => Level::Error,
        Tone::Idle => Level::Stale,
    };
    (level, remark.text)
}

impl Input {
    fn status(&mut self, role: Role, node: &str, seconds: f64) -> Status {
        let silent_s = self.span.map(|[_, last]| last.elapsed().as_secs_f64());
        let mean_s = self.span.map_or(0.0, |[first, last]| {
            (last - first).as_secs_f64() / (self.heard.max(2) - 1) as f64
        });
        let missed_s = match role {
            Role::Inertial => PAUSE_S,
            _ => (MISSED_INTERVALS * mean_s).max(PAUSE_S),
        };
        let silence = match (role, silent_s) {
            (Role::Inertial, Some(silent_s)) if silent_s > missed_s => Level::Error,
            (_, Some(silent_s)) if silent_s > missed_s => Level::Warn,
            (Role::Inertial, None) => Level::Stale,
            _ => Level::Ok,
        };
        let message = match silent_s {
            None => "nothing heard yet".to_owned(),
            Some(silent_s) if silence != Level::Ok => {
                format!("nothing heard for {silent_s:.1} s")
            }
            Some(_) => format!(
                "{:.1} messages in a second",
                self.heard_now as f64 / seconds
            ),
        };
        let mut values = vec![("taken".to_owned(), self.heard.to_string())];
        for (why, count) in &self.left_out {
            values.push((format!("left out: {why}"), count.to_string()));
        }
        self.heard_now = 0;
        Status {
            level: silence,
            name: format!("{node}: {}", self.topic),
            message,
            values,
        }
    }
}

impl Updates {
    fn status(&self, name: &str) -> Status {
        let refused = self.gated > self.fused;
        let mut values = vec![
            ("fused".to_owned(), self.fused.to_string()),
            ("gated".to_owned(), self.gated.to_string()),
            ("skipped".to_owned(), self.skipped.to_string()),
        ];
        if self.components > 0.0 {
            let ratio = self.nis / self.components;
            values.push(("NIS by its expectation".to_owned(), format!("{ratio:.2}")));
        }
        Status {
            level: if refused { Level::Warn } else { Level::Ok },
            name: name.to_owned(),
            message: match (self.fused + self.gated, refused) {
                (0, _) => "no update".to_owned(),
                (all, true) => format!("the gate refused {} of {all} measurements", self.gated),
                (all, false) => format!("{} of {all} measurements fused", self.fused),
            },
            values,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_that_the_middleware_refuses_are_said() {
        let mut told = Diagnostics::new("/northing", &NodeConfig::default());
        told.estimated();
        let good = told.estimate_status(1.0);
        assert_eq!((good.level, good.values.len()), (Level::Ok, 1));
        told.refused(EstimateTopic::Imu);
        told.refused(EstimateTopic::Imu);
        let status = told.estimate_status(1.0);
        assert_eq!(status.level, Level::Warn);
        assert!(
            status
                .message
                .ends_with("; 2 messages not sent: the middleware refused them")
        );
        assert_eq!(
            status.values.last(),
            Some(&("not sent: /imu/data".to_owned(), "2".to_owned()))
        );
        // Counted anew from the next diagnostics on, and all of them at the end.
        let _ = told.message();
        told.estimated();
        assert_eq!(told.estimate_status(1.0).level, Level::Ok);
        let said = told.sentences();
        assert_eq!(
            said,
            ["/imu/data: 2 messages not sent: the middleware refused them."]
        );
    }
}
