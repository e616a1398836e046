//! What one device does, without a clock and without sockets: inputs in, estimates and events out.
//!
//! The inputs are payloads with their time of arrival, the passing of time where something waited for
//! it, and commands. The same inputs in the same order give the same numbers to the bit, which is
//! why a recording of the inputs ([`crate::recorder`]) replays a live run exactly.

use northing_evaluation::{EvaluationError, RunOptions};
use northing_recording::wire::{Decoded, Tone as WireTone, WireDecoder, WireError, WireFormat};

use crate::messages::Command;
use crate::persistence::SavedDevice;
use crate::session::{DeviceSession, Happening};
use northing_evaluation::statistics::lamp::{Remark, Tone};

/// Remarks of decoders that are kept for the list of devices.
const MOST_REMARKS: usize = 8;

/// One device. See the [module](self).
#[derive(Debug)]
pub struct DeviceEngine {
    session: DeviceSession,
    decoder: Option<WireDecoder>,
    /// Of decoders before: batches lost, batches that came again.
    before: [u64; 2],
    /// Whether commands are taken without samples and wait for them, however long.
    waits_for_ever: bool,
    remarks: Vec<Remark>,
}

impl DeviceEngine {
    /// A device from which nothing has come yet.
    ///
    /// # Errors
    /// The options are invalid.
    pub fn new(options: RunOptions) -> Result<Self, EvaluationError> {
        Ok(Self {
            session: DeviceSession::new(options)?,
            decoder: None,
            before: [0; 2],
            waits_for_ever: false,
            remarks: Vec::new(),
        })
    }

    /// As the lab was when it recorded without time-outs: commands are taken before the first sample, and
    /// wait for ever.
    #[must_use]
    pub fn without_time_outs(mut self) -> Self {
        self.waits_for_ever = true;
        self
    }

    /// Takes a payload that arrived at `arrival_ns`. Times of arrival must not go back.
    ///
    /// # Errors
    /// A line for whoever sent it when nothing of it can be used; nothing has changed then.
    pub fn payload(
        &mut self,
        format: WireFormat,
        bytes: &[u8],
        arrival_ns: i64,
    ) -> Result<Vec<Happening>, WireError> {
        if self.decoder.as_ref().is_none_or(|d| d.format() != format) {
            let old = self.decoder.replace(WireDecoder::new(format));
            if let Some(old) = old {
                self.before[0] += old.lost();
                self.before[1] += old.duplicated();
            }
        }
        let Some(decoder) = &mut self.decoder else {
            return Ok(Vec::new());
        };
        let sessions = decoder.sessions();
        let decoded = decoder.accept(bytes, arrival_ns)?;
        if decoder.sessions() > sessions {
            self.session.expect_new_clock();
        }
        self.session
            .read_by_browser(format == WireFormat::PhonePage);
        Ok(self.decoded(decoded, arrival_ns))
    }

    /// Takes what has waited long enough for its predecessors, and ends what has waited too long for
    /// samples; `None` when there is neither.
    pub fn poll(&mut self, now_ns: i64) -> Option<Vec<Happening>> {
        let decoded = self.decoder.as_mut().and_then(|d| d.poll(now_ns));
        let released = decoded.map(|decoded| self.decoded(decoded, now_ns));
        let ended = match self.waits_for_ever {
            true => Vec::new(),
            false => self.session.time_passes(now_ns),
        };
        if released.is_none() && ended.is_empty() {
            return None;
        }
        let mut happenings = released.unwrap_or_default();
        happenings.extend(ended);
        Some(happenings)
    }

    /// Carries out a command that came at `arrival_ns`. A name is for whoever shows it.
    ///
    /// # Errors
    /// Why it cannot be done, in a sentence; nothing has changed then.
    pub fn command(
        &mut self,
        command: &Command,
        arrival_ns: i64,
    ) -> Result<Vec<Happening>, String> {
        let text = |error: EvaluationError| error.to_string();
        if matches!(command, Command::Calibrate(_) | Command::Experiment(..)) {
            if !self.waits_for_ever {
                self.session.has_samples()?;
            }
            self.session.asked(arrival_ns);
        }
        match command {
            Command::Calibrate(seconds) => self.session.calibrate(*seconds)?,
            Command::Experiment(seconds, name) => self.session.start_experiment(*seconds, name)?,
            Command::Stop => {
                let ended = self.session.stop().into_iter().collect();
                return Ok(self.noted(ended));
            }
            Command::Settings(profile, settings) => {
                self.session.set(*profile, settings).map_err(text)?;
            }
            Command::Sensors(selection) => self.session.use_sensors(*selection),
            Command::Estimators(kinds) => self.session.use_estimators(kinds).map_err(text)?,
            Command::Subject(kind) => self.session.use_subject(*kind)?,
            Command::CalibrateMagnetometer(action) => {
                let remark = self.session.calibrate_magnetometer(*action)?;
                return Ok(vec![Happening::Magnetometer(*action, remark)]);
            }
            Command::Rename(_) => {}
        }
        Ok(Vec::new())
    }

    /// Goes on with settings and calibrations of an earlier start.
    ///
    /// # Errors
    /// They are not permitted; nothing has changed then.
    pub fn restore(&mut self, saved: &SavedDevice) -> Result<(), EvaluationError> {
        saved.restore(&mut self.session)
    }

    fn decoded(&mut self, decoded: Decoded, arrival_ns: i64) -> Vec<Happening> {
        for notice in decoded.notices {
            let tone = match notice.tone {
                WireTone::Info => Tone::Info,
                WireTone::Warning => Tone::Warn,
                WireTone::Bad => Tone::Bad,
            };
            self.remark(Remark::new(tone, notice.text));
        }
        let mut events = decoded.events;
        let before = self.session.newest_gyroscope_ns();
        let happenings = self.session.take(&mut events);
        if self.session.newest_gyroscope_ns() != before {
            self.session.heard(arrival_ns);
        }
        self.session.take_late(&decoded.late);
        self.noted(happenings)
    }

    /// Keeps the notes and hands out the rest.
    fn noted(&mut self, happenings: Vec<Happening>) -> Vec<Happening> {
        let mut rest = Vec::new();
        for happening in happenings {
            match happening {
                Happening::Note(remark) => self.remark(remark),
                Happening::Over(text) => self.remarks.retain(|remark| remark.text != text),
                other => rest.push(other),
            }
        }
        rest
    }

    fn remark(&mut self, remark: Remark) {
        if self.remarks.contains(&remark) {
            return;
        }
        if self.remarks.len() >= MOST_REMARKS {
            self.remarks.remove(0);
        }
        self.remarks.push(remark);
    }

    /// Its estimates, calibration and experiment.
    #[must_use]
    pub fn session(&self) -> &DeviceSession {
        &self.session
    }

    /// For frames, which take the innovations with them.
    pub fn session_mut(&mut self) -> &mut DeviceSession {
        &mut self.session
    }

    /// What decoders and session remarked, the oldest first.
    #[must_use]
    pub fn remarks(&self) -> &[Remark] {
        &self.remarks
    }

    /// The name that its payloads give it; empty while unknown.
    #[must_use]
    pub fn name(&self) -> &str {
        self.decoder.as_ref().map_or("", WireDecoder::name)
    }

    /// Batches that never came.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.before[0] + self.decoder.as_ref().map_or(0, WireDecoder::lost)
    }

    /// Batches that came more than once.
    #[must_use]
    pub fn duplicated(&self) -> u64 {
        self.before[1] + self.decoder.as_ref().map_or(0, WireDecoder::duplicated)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_recording::wire::events;
    use northing_recording::{Event, SensorKind};
    use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

    const SECOND: i64 = 1_000_000_000;

    fn samples(from_s: i64, to_s: i64) -> Vec<u8> {
        let phone = VirtualPhone::new(VirtualPhoneConfig::default()).unwrap();
        let due = |e: &Event| (from_s * SECOND..to_s * SECOND).contains(&e.time_ns);
        events::encode(&phone.events().filter(due).collect::<Vec<_>>())
    }

    fn engine() -> DeviceEngine {
        DeviceEngine::new(RunOptions::default()).unwrap()
    }

    fn give(engine: &mut DeviceEngine, from_s: i64, to_s: i64, arrival_ns: i64) -> Vec<Happening> {
        let bytes = samples(from_s, to_s);
        engine
            .payload(WireFormat::Events, &bytes, arrival_ns)
            .unwrap()
    }

    #[test]
    fn nothing_begins_before_the_first_gyroscope_sample() {
        let mut engine = engine();
        let commands = [
            Command::Calibrate(5.0),
            Command::Experiment(5.0, String::new()),
        ];
        for command in &commands {
            let refused = engine.command(command, 0).unwrap_err();
            assert!(refused.starts_with("Nothing received"), "{refused}");
        }
        // Others do not stand in for it.
        let phone = VirtualPhone::new(VirtualPhoneConfig::default()).unwrap();
        let force = |e: &Event| e.sample.kind() == SensorKind::Accelerometer;
        let bytes = events::encode(&phone.events().filter(force).take(100).collect::<Vec<_>>());
        engine.payload(WireFormat::Events, &bytes, SECOND).unwrap();
        assert!(engine.command(&commands[0], SECOND).is_err());
        give(&mut engine, 1, 2, 2 * SECOND);
        engine.command(&commands[0], 2 * SECOND).unwrap();
        assert!(engine.session().calibration().is_some());
    }

    #[test]
    fn what_waits_for_samples_that_stay_away_ends_with_the_reason() {
        let mut engine = engine();
        give(&mut engine, 0, 2, 2 * SECOND);
        engine
            .command(&Command::Calibrate(30.0), 3 * SECOND)
            .unwrap();
        give(&mut engine, 2, 4, 4 * SECOND);
        assert!(engine.poll(14 * SECOND).is_none(), "ten seconds are given");
        let ended = engine.poll(14 * SECOND + SECOND / 2).unwrap();
        let [Happening::Calibrated(_, Err(reason))] = &ended[..] else {
            panic!("{ended:?}");
        };
        assert!(
            reason.contains("No gyroscope sample came for 10 s"),
            "{reason}"
        );
        assert!(engine.session().calibration().is_none());
        assert!(engine.poll(60 * SECOND).is_none(), "once");

        // An experiment that has not begun is dropped; one that has keeps what it has.
        engine
            .command(&Command::Experiment(60.0, String::new()), 70 * SECOND)
            .unwrap();
        let ended = engine.poll(101 * SECOND).unwrap();
        assert!(matches!(&ended[..], [Happening::GaveUp(_)]), "{ended:?}");
        engine
            .command(&Command::Experiment(60.0, String::new()), 102 * SECOND)
            .unwrap();
        give(&mut engine, 4, 5, 103 * SECOND);
        assert!(engine.poll(132 * SECOND).is_none());
        let ended = engine.poll(134 * SECOND).unwrap();
        let [Happening::GaveUp(reason), Happening::Experimented(kept)] = &ended[..] else {
            panic!("{ended:?}");
        };
        assert!(reason.contains("the experiment was ended") && kept.events.len() > 200);
    }

    /// A recording of before says nothing about time-outs: it replays as it was.
    #[test]
    fn a_recording_of_before_waits_for_ever() {
        let mut engine = engine().without_time_outs();
        engine.command(&Command::Calibrate(1.5), 0).unwrap();
        assert!(engine.poll(60 * SECOND).is_none());
        let ended = give(&mut engine, 0, 3, 61 * SECOND);
        assert!(
            matches!(&ended[..], [Happening::Calibrated(_, Ok(_))]),
            "{ended:?}"
        );
        let control = r#"{"event":"device","name":"a","source":"page","profile":"lab"}"#;
        let control: crate::recorder::Control = serde_json::from_str(control).unwrap();
        let crate::recorder::Control::Device { time_outs, .. } = control else {
            panic!("{control:?}");
        };
        assert!(!time_outs);
    }
}
