//! What waits for samples: a calibration or an experiment is not begun without them, and ends when they stay away.

use super::{DeviceSession, Happening};

/// Without a gyroscope sample for so long a calibration ends, s.
pub const CALIBRATION_PATIENCE_S: f64 = 10.0;
/// Without a gyroscope sample for so long an experiment ends, s: a network that was gone brings them later.
pub const EXPERIMENT_PATIENCE_S: f64 = 30.0;

/// What to do when nothing comes.
pub const WHAT_TO_DO: &str = "Unlock the phone, bring its page or app to the front, allow motion sensors, and see \
     that phone and computer share a network.";

/// No gyroscope sample has come, and what to do.
#[must_use]
pub fn nothing_received() -> String {
    format!("Nothing received: no gyroscope sample has come from this device. {WHAT_TO_DO}")
}

/// Times of arrival, ns: the lab's clock, or that of a recording.
#[derive(Debug, Clone, Copy)]
pub(super) struct Waiting {
    /// When the last gyroscope sample came.
    heard_ns: i64,
    /// When the calibration or experiment under way was asked for.
    asked_ns: i64,
}

impl Default for Waiting {
    fn default() -> Self {
        Self {
            heard_ns: i64::MIN,
            asked_ns: i64::MIN,
        }
    }
}

impl Waiting {
    fn seconds(&self, now_ns: i64) -> f64 {
        let since = self.heard_ns.max(self.asked_ns);
        now_ns.saturating_sub(since) as f64 * 1e-9
    }
}

impl DeviceSession {
    /// Whether a gyroscope sample has come, without which nothing can be measured.
    ///
    /// # Errors
    /// None has, in sentences.
    pub fn has_samples(&self) -> Result<(), String> {
        match self.last_gyroscope_ns {
            Some(_) => Ok(()),
            None => Err(nothing_received()),
        }
    }

    /// Something was asked for that waits for samples from now on.
    pub fn asked(&mut self, arrival_ns: i64) {
        self.waiting.asked_ns = arrival_ns;
    }

    /// Stamp of the newest gyroscope sample that was taken.
    pub(crate) fn newest_gyroscope_ns(&self) -> Option<i64> {
        self.last_gyroscope_ns
    }

    /// Gyroscope samples came.
    pub fn heard(&mut self, arrival_ns: i64) {
        self.waiting.heard_ns = self.waiting.heard_ns.max(arrival_ns);
    }

    /// Ends what has waited for samples for too long. An experiment keeps what it has.
    pub fn time_passes(&mut self, now_ns: i64) -> Vec<Happening> {
        let waited_s = self.waiting.seconds(now_ns);
        let reason = |what: &str| {
            format!(
                "No gyroscope sample came for {waited_s:.0} s: the {what} was ended. {WHAT_TO_DO}"
            )
        };
        let mut happenings = Vec::new();
        if waited_s > CALIBRATION_PATIENCE_S
            && let Some(run) = self.calibration.take()
        {
            let refused = Err(reason("calibration"));
            happenings.push(Happening::Calibrated(Box::new(run), refused));
        }
        if waited_s > EXPERIMENT_PATIENCE_S && self.experiment.is_some() {
            happenings.push(Happening::GaveUp(reason("experiment")));
            happenings.extend(self.stop());
        }
        happenings
    }
}
