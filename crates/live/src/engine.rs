//! What one device does, without a clock and without sockets: inputs in, estimates and events out.
//!
//! The inputs are payloads with their time of arrival, the passing of time where something waited for
//! it, and commands. The same inputs in the same order give the same numbers to the bit, which is
//! why a recording of the inputs ([`crate::recorder`]) replays a live run exactly.

use northing_evaluation::{EvaluationError, RunOptions};
use northing_recording::wire::{Decoded, Tone as WireTone, WireDecoder, WireError, WireFormat};

use crate::messages::Command;
use crate::session::lamp::{Remark, Tone};
use crate::session::{DeviceSession, Happening};

/// Remarks of decoders that are kept for the list of devices.
const MOST_REMARKS: usize = 8;

/// One device. See the [module](self).
#[derive(Debug)]
pub struct DeviceEngine {
    session: DeviceSession,
    decoder: Option<WireDecoder>,
    /// Of decoders before: batches lost, batches that came again.
    before: [u64; 2],
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
            remarks: Vec::new(),
        })
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
        Ok(self.decoded(decoded))
    }

    /// Takes what has waited long enough for its predecessors; `None` when nothing has.
    pub fn poll(&mut self, now_ns: i64) -> Option<Vec<Happening>> {
        let decoded = self.decoder.as_mut()?.poll(now_ns)?;
        Some(self.decoded(decoded))
    }

    /// Carries out a command. A name is for whoever shows it.
    ///
    /// # Errors
    /// Why it cannot be done, in a sentence; nothing has changed then.
    pub fn command(&mut self, command: &Command) -> Result<Vec<Happening>, String> {
        let text = |error: EvaluationError| error.to_string();
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
            Command::CalibrateMagnetometer(action) => {
                let remark = self.session.calibrate_magnetometer(*action)?;
                return Ok(vec![Happening::Magnetometer(*action, remark)]);
            }
            Command::Rename(_) => {}
        }
        Ok(Vec::new())
    }

    fn decoded(&mut self, decoded: Decoded) -> Vec<Happening> {
        for notice in decoded.notices {
            let tone = match notice.tone {
                WireTone::Info => Tone::Info,
                WireTone::Warning => Tone::Warn,
                WireTone::Bad => Tone::Bad,
            };
            self.remark(Remark::new(tone, notice.text));
        }
        let mut events = decoded.events;
        let happenings = self.session.take(&mut events);
        self.session.take_late(&decoded.late);
        self.noted(happenings)
    }

    /// Keeps the notes and hands out the rest.
    fn noted(&mut self, happenings: Vec<Happening>) -> Vec<Happening> {
        let mut rest = Vec::new();
        for happening in happenings {
            match happening {
                Happening::Note(remark) => self.remark(remark),
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
