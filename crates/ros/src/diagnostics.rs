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
use northing_recording::{RecordingError, SensorKind};

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
/// What becomes of a message without a stamp.
const UNSTAMPED: &str = "a stamp of 0, taken at the time of arrival by this computer's clock";
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
    /// Without a stamp.
    unstamped: u64,
    /// What cannot be right of its numbers, by sensor.
    doubts: BTreeMap<&'static str, String>,
}

/// What the updates of a sensor did since the last diagnostics.
#[derive(Debug, Clone, Default)]
struct Updates {
    fused: u64,
    gated: u64,
    /// By the reason in words.
    skipped: BTreeMap<&'static str, (SkipReason, u64)>,
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
                unstamped: 0,
                doubts: BTreeMap::new(),
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

    /// A message came without a stamp; a sentence, the first time.
    pub(crate) fn unstamped(&mut self, role: Role) -> Option<String> {
        let input = self.inputs.get_mut(&role)?;
        input.unstamped += 1;
        (input.unstamped == 1).then(|| format!("{}: {UNSTAMPED}.", input.topic))
    }

    /// The numbers of a sensor cannot be what its messages say; a sentence, the first time.
    pub(crate) fn doubt(&mut self, doubt: &RecordingError) -> Option<String> {
        let RecordingError::ImplausibleUnit {
            sensor, evidence, ..
        } = doubt
        else {
            return None;
        };
        let (role, unit) = of_message(sensor)?;
        let input = self.inputs.get_mut(&role)?;
        if input.doubts.contains_key(sensor) {
            return None;
        }
        let sentence = format!(
            "the numbers of the {sensor} do not fit their messages, which have {unit}: {evidence}. What is estimated from them is \
             wrong then; put it right where they are published"
        );
        let told = format!("{}: {sentence}.", input.topic);
        input.doubts.insert(sensor, sentence);
        Some(told)
    }

    pub(crate) fn updated(&mut self, sensor: &'static str, innovation: &Innovation<f64>) {
        let updates = self.updates.entry(sensor).or_default();
        match innovation.outcome {
            Outcome::Fused | Outcome::Inflated => updates.fused += 1,
            Outcome::Gated => updates.gated += 1,
            // It waits for the next one, with which it is fused.
            Outcome::Skipped(SkipReason::Accumulated) => {}
            Outcome::Skipped(why) => {
                updates
                    .skipped
                    .entry(why.description())
                    .or_insert((why, 0))
                    .1 += 1;
            }
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
        let inputs = self.inputs.values().filter(|input| {
            input.heard > 0 || !input.left_out.is_empty() || !input.doubts.is_empty()
        });
        let heard = inputs.map(|input| {
            let mut text = format!("{}: {} messages taken", input.topic, input.heard);
            for (why, count) in &input.left_out {
                text.push_str(&format!(", {count} left out ({why})"));
            }
            if input.unstamped > 0 {
                text.push_str(&format!(", {} of them with {UNSTAMPED}", input.unstamped));
            }
            text.push('.');
            for doubt in input.doubts.values() {
                text.push_str(&format!("\n{}: {doubt}.", input.topic));
            }
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

/// The topic on which a sensor is, and what its messages have.
fn of_message(sensor: &str) -> Option<(Role, &'static str)> {
    let kind = SensorKind::ALL
        .into_iter()
        .find(|kind| kind.name() == sensor)?;
    Some(match kind {
        SensorKind::Gyroscope => (Role::Inertial, "rad/s about right-handed axes"),
        SensorKind::Accelerometer => (Role::Inertial, "m/s^2, gravity included"),
        SensorKind::Magnetometer => (Role::Field, "tesla"),
        SensorKind::GnssPosition => (Role::Fix, "degrees, north and east positive"),
        SensorKind::GnssVelocity => (Role::Velocity, "m/s east, north and up"),
        _ => return None,
    })
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
        let mut message = message;
        if self.unstamped > 0 {
            message.push_str(&format!("; {UNSTAMPED}"));
            values.push(("with a stamp of 0".to_owned(), self.unstamped.to_string()));
        }
        for doubt in self.doubts.values() {
            message.push_str(&format!("; {doubt}"));
        }
        let level = match silence {
            _ if !self.doubts.is_empty() => Level::Error,
            Level::Ok if self.unstamped > 0 => Level::Warn,
            silence => silence,
        };
        self.heard_now = 0;
        Status {
            level,
            name: format!("{node}: {}", self.topic),
            message,
            values,
        }
    }
}

/// Whether measurements that are skipped for this reason, all of a second, are to be looked at.
const fn is_fault(why: SkipReason) -> bool {
    !matches!(
        why,
        SkipReason::NotUsed
            | SkipReason::NotInitialized
            | SkipReason::NotDue
            | SkipReason::Accumulated
            | SkipReason::Unobservable
    )
}

impl Updates {
    fn status(&self, name: &str) -> Status {
        let refused = self.gated > self.fused;
        let skipped: u64 = self.skipped.values().map(|(_, count)| count).sum();
        let mut values = vec![
            ("fused".to_owned(), self.fused.to_string()),
            ("gated".to_owned(), self.gated.to_string()),
            ("skipped".to_owned(), skipped.to_string()),
        ];
        for (why, (_, count)) in &self.skipped {
            values.push((format!("skipped: {why}"), count.to_string()));
        }
        // The reason of most.
        let most = self.skipped.values().max_by_key(|(_, count)| *count);
        let unused = most.filter(|_| self.fused + self.gated == 0);
        let is_fault = unused.is_some_and(|(why, _)| is_fault(*why));
        if self.components > 0.0 {
            let ratio = self.nis / self.components;
            values.push(("NIS by its expectation".to_owned(), format!("{ratio:.2}")));
        }
        Status {
            level: if refused || is_fault {
                Level::Warn
            } else {
                Level::Ok
            },
            name: name.to_owned(),
            message: match (self.fused + self.gated, refused) {
                (0, _) => match unused {
                    Some((why, _)) => {
                        format!("no update: {skipped} measurements skipped, most because: {why}")
                    }
                    None => "no update".to_owned(),
                },
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
    use nalgebra::Vector3;
    use northing_recording::plausibility::Plausibility;
    use northing_recording::{Event, Sample};

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

    /// A field in microtesla: an error on its topic, said once, and at the end.
    #[test]
    fn numbers_that_do_not_fit_their_messages_are_an_error_and_said_once() {
        let mut told = Diagnostics::new("/northing", &NodeConfig::default());
        let mut checks = Plausibility::of_ros();
        let mut said = Vec::new();
        for k in 0..500_i64 {
            let event = Event {
                time_ns: k * 20_000_000,
                // Of 22 and 43 tesla.
                sample: Sample::MagneticField(Vector3::new(0.0, 22e6, -43e6)),
            };
            said.extend(checks.check(&event, "").err().and_then(|e| told.doubt(&e)));
        }
        let wanted = "imu/mag: the numbers of the magnetometer do not fit their messages, which have tesla: the median norm of its first \
                      seconds is 4.830e1, expected 2e-5 to 7e-5 tesla; this looks like microtesla.";
        assert!(said.len() == 1 && said[0].starts_with(wanted), "{said:?}");
        let input = told.inputs.get_mut(&Role::Field).unwrap();
        let status = input.status(Role::Field, "/northing", 1.0);
        assert_eq!(status.level, Level::Error);
        assert!(
            status.message.contains("looks like microtesla"),
            "{status:?}"
        );
        let told = told.sentences();
        assert!(told.iter().any(|text| text.contains(wanted)), "{told:?}");
    }

    #[test]
    fn a_message_without_a_stamp_is_a_warning_and_said_once() {
        let mut told = Diagnostics::new("/northing", &NodeConfig::default());
        let said: Vec<String> = (0..3)
            .filter_map(|_| told.unstamped(Role::Inertial))
            .collect();
        let wanted =
            "imu/data_raw: a stamp of 0, taken at the time of arrival by this computer's clock.";
        assert_eq!(said, [wanted]);
        let message = Message {
            role: Role::Inertial,
            frame: None,
            events: None,
            is_unstamped: true,
        };
        told.heard(&message, None);
        let input = told.inputs.get_mut(&Role::Inertial).unwrap();
        assert_eq!(input.status(Role::Inertial, "", 1.0).level, Level::Warn);
    }

    #[test]
    fn measurements_that_are_all_skipped_have_their_reason() {
        let status = |why: SkipReason| {
            let skipped = [(why.description(), (why, 50))].into();
            let updates = Updates {
                skipped,
                ..Updates::default()
            };
            updates.status("magnetometer")
        };
        let broken = status(SkipReason::OutOfRange);
        assert_eq!(broken.level, Level::Warn);
        assert!(broken.message.contains("far out of range"), "{broken:?}");
        let unused = status(SkipReason::NotUsed);
        assert_eq!(unused.level, Level::Ok);
        assert!(unused.message.contains("sensor not used"), "{unused:?}");
    }
}
