//! Whether a device is heard, whether samples come from it, and, when none do, why and what to do.

use std::time::{Duration, Instant};

use crate::session::waiting::WHAT_TO_DO;

/// Without anything for so long a device counts as gone, and without samples as silent.
const SILENCE: Duration = Duration::from_secs(3);

/// When a device was heard last, by the computer's clock.
#[derive(Debug)]
pub(crate) struct Heard {
    /// When the device came.
    came: Instant,
    last: Instant,
    /// When samples came last, if ever.
    samples: Option<Instant>,
    /// Samples received by then.
    received: u64,
}

impl Heard {
    /// A device that has just come.
    pub(crate) fn new(now: Instant) -> Self {
        Self {
            came: now,
            last: now,
            samples: None,
            received: 0,
        }
    }

    /// Something came; it has delivered so many samples so far.
    pub(crate) fn note(&mut self, received: u64, now: Instant) {
        self.last = now;
        if received != self.received {
            self.received = received;
            self.samples = Some(now);
        }
    }

    /// Whether something came during the last seconds.
    pub(crate) fn is_connected(&self, now: Instant) -> bool {
        now.saturating_duration_since(self.last) < SILENCE
    }

    /// Whether samples came during the last seconds.
    pub(crate) fn delivers(&self, now: Instant) -> bool {
        self.samples
            .is_some_and(|last| now.saturating_duration_since(last) < SILENCE)
    }

    /// For how long no samples have come, s; `None` while they do.
    pub(crate) fn silent_s(&self, now: Instant) -> Option<f64> {
        let since = self.samples.unwrap_or(self.came);
        let silent = now.saturating_duration_since(since);
        (!self.delivers(now)).then_some(silent.as_secs_f64())
    }

    /// Why no samples come, and what to do, in sentences; empty while they do.
    pub(crate) fn in_words(&self, source: &str, now: Instant) -> String {
        if self.delivers(now) {
            return String::new();
        }
        let is_page = source == "page" && self.is_connected(now);
        let what = match self.samples {
            _ if source == "replay" => return "The recording has ended.".to_owned(),
            None if is_page => "Its page is connected, but its sensors give no readings.",
            None => "No sample has come yet.",
            Some(_) if is_page => "Its page is connected, but its sensors have stopped.",
            Some(_) => "It has stopped sending.",
        };
        let since = self.samples.map_or_else(String::new, |last| {
            let seconds = now.saturating_duration_since(last).as_secs();
            format!(" Nothing for {seconds} s.")
        });
        format!("{what}{since} {WHAT_TO_DO}")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_silent_is_said_with_its_reason() {
        let start = Instant::now();
        let at = |s: u64| start + Duration::from_secs(s);
        let mut heard = Heard::new(start);
        assert!(heard.is_connected(at(1)) && !heard.delivers(at(1)));
        assert!(
            heard
                .in_words("virtual", at(1))
                .starts_with("No sample has come yet.")
        );
        // A page whose sensors are locked goes on sending batches.
        heard.note(0, at(10));
        let text = heard.in_words("page", at(11));
        assert!(
            text.contains("give no readings") && text.contains("Unlock"),
            "{text}"
        );
        assert_eq!(heard.silent_s(at(11)), Some(11.0), "since it came");
        heard.note(5, at(20));
        assert_eq!(heard.in_words("page", at(21)), "");
        assert_eq!(heard.silent_s(at(21)), None);
        heard.note(5, at(29));
        let text = heard.in_words("page", at(30));
        assert!(text.contains("have stopped. Nothing for 10 s."), "{text}");
        assert_eq!(heard.silent_s(at(30)), Some(10.0));
        assert!(
            heard
                .in_words("page", at(60))
                .starts_with("It has stopped sending.")
        );
        assert_eq!(heard.in_words("replay", at(60)), "The recording has ended.");
    }
}
