//! What was odd about a recording although it could be read: counters, and sentences for people.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::event::SensorKind;

/// Fewer intervals say nothing about their unit.
const FEWEST_INTERVALS: u64 = 10;

/// Counters filled while a recording is read; final when the recording has ended.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Issues {
    /// Samples dropped because the same sensor already had one with that stamp.
    pub duplicate_stamps: BTreeMap<SensorKind, u64>,
    /// Samples dropped because their stamp is earlier than one already delivered.
    pub stamps_going_back: BTreeMap<SensorKind, u64>,
    /// Stamps that cannot be, whose samples are dropped; [`Self::notes`] has the first ones.
    pub false_stamps: u64,
    /// Rows dropped because they have no usable time stamp.
    pub rows_without_stamp: u64,
    /// Samples with NaN or infinity in them. They are delivered; filters skip them.
    pub non_finite_samples: BTreeMap<SensorKind, u64>,
    /// Samples dropped because their second half is missing (Sensor Logger: an acceleration
    /// without gravity at the same stamp).
    pub incomplete_samples: u64,
    /// Fixes dropped because the receiver itself calls them invalid.
    pub invalid_fixes: BTreeMap<SensorKind, u64>,
    /// What was left out and why, in words that complete "Left out: 3 ...".
    pub rejected: BTreeMap<&'static str, u64>,
    /// Pauses of the gyroscope longer than `gap_limit_s`.
    pub gaps: u64,
    /// Stamps of the gyroscope, and the time from the first to the last of them, s.
    pub gyroscope_stamps: u64,
    /// See [`Self::gyroscope_stamps`].
    pub gyroscope_span_s: f64,
    /// Whether the gyroscope's stamps are dates of our time in their own unit: then no other unit is theirs.
    #[serde(skip)]
    pub stamps_are_dates: bool,
    /// The limit above which a pause counts as a gap, s.
    pub gap_limit_s: f64,
    /// The longest gap, s; 0 without gaps.
    pub longest_gap_s: f64,
    /// Where the longest gap starts, s since the recording's first stamp.
    pub longest_gap_start_s: f64,
    /// Remarks of the reader that are not counts, each a sentence.
    pub notes: Vec<String>,
}

impl Issues {
    /// Whether there is nothing to tell.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.sentences().is_empty()
    }

    /// That many samples of the gyroscope share a stamp.
    fn shared_stamps(&self) -> Option<String> {
        let repeated = self.duplicate_stamps.get(&SensorKind::Gyroscope).copied();
        let (stamps, repeated) = (self.gyroscope_stamps, repeated.unwrap_or(0));
        // Where stamps are near each other a table has rows of others between those of the gyroscope.
        if stamps < 2 || repeated < stamps || 2 * self.gaps < stamps - 1 {
            return None;
        }
        let samples = stamps + repeated;
        let interval_s = self.gyroscope_span_s / (stamps - 1) as f64;
        let rate_hz = (100.0 * samples as f64 / (stamps as f64 * interval_s)).round() / 100.0;
        Some(format!(
            "{samples} samples of the gyroscope share {stamps} stamps, which are {interval_s:.3} s apart, as where times are cut off. \
             If the samples come steadily, let them be counted: a table by a manifest whose time is rate_hz = {rate_hz} in place of \
             its column (`northing describe FILE --rate {rate_hz}`)."
        ))
    }

    /// What stamps may be that are too far apart for any gyroscope.
    fn unit_of_stamps(&self) -> Option<String> {
        let intervals = self.gyroscope_stamps.saturating_sub(1);
        if intervals < FEWEST_INTERVALS || 2 * self.gaps < intervals {
            return None;
        }
        let interval_s = self.gyroscope_span_s / intervals as f64;
        let slow = format!(
            "The gyroscope has one sample every {interval_s:.3} s, too few to follow any turn"
        );
        if self.stamps_are_dates {
            return Some(format!("{slow}. Record it more often."));
        }
        // Gyroscopes sample with 5 Hz to 1 kHz.
        let units = [
            ("milliseconds", "ms", 1e3),
            ("microseconds", "us", 1e6),
            ("nanoseconds", "ns", 1e9),
        ];
        let (name, unit, factor) = units
            .into_iter()
            .find(|(_, _, factor)| (1e-3..=0.2).contains(&(interval_s / factor)))?;
        Some(format!(
            "{slow}; the stamps look like {name} under the name of seconds ({:.0} samples a second then). If so, divide them by \
             {factor:.0}, or describe the file with a manifest whose time has unit = \"{unit}\".",
            factor / interval_s
        ))
    }

    /// The issues for people, one sentence each, the gravest first; empty when all is well.
    #[must_use]
    pub fn sentences(&self) -> Vec<String> {
        let mut sentences = Vec::new();
        let shared = self.shared_stamps();
        sentences.extend(shared.or_else(|| self.unit_of_stamps()));
        if self.gaps > 0 {
            sentences.push(format!(
                "The gyroscope pauses for more than {} s {}; the longest gap lasts {:.3} s and starts {:.3} s into the recording.",
                self.gap_limit_s,
                times(self.gaps),
                self.longest_gap_s,
                self.longest_gap_start_s,
            ));
        }
        for (kind, count) in &self.stamps_going_back {
            let name = kind.name();
            sentences.push(format!(
                "The time of {name} goes back {}; those samples are dropped.",
                times(*count)
            ));
        }
        for (kind, count) in &self.duplicate_stamps {
            let name = kind.name();
            sentences.push(format!(
                "The time of {name} repeats itself {}; only the first sample of each stamp is kept.",
                times(*count)
            ));
        }
        if self.false_stamps > 1 {
            sentences.push(format!(
                "Left out for their time stamps, which are far from those around them: the samples of {} stamps.",
                self.false_stamps
            ));
        }
        if self.rows_without_stamp > 0 {
            sentences.push(format!(
                "Dropped for want of a time stamp: {} row(s).",
                self.rows_without_stamp
            ));
        }
        for (kind, count) in &self.non_finite_samples {
            let name = kind.name();
            sentences.push(format!(
                "The {name} has {count} sample(s) with NaN or infinity; estimators skip them."
            ));
        }
        if self.incomplete_samples > 0 {
            sentences.push(format!(
                "Dropped for want of their other half at the same stamp: {} sample(s).",
                self.incomplete_samples
            ));
        }
        for (kind, count) in &self.invalid_fixes {
            let name = kind.name();
            sentences.push(format!(
                "Left out: {count} sample(s) of {name} that the receiver itself calls invalid."
            ));
        }
        for (what, count) in &self.rejected {
            sentences.push(format!("Left out: {count} {what}."));
        }
        sentences.extend(self.notes.iter().cloned());
        sentences
    }

    /// Counts something that was left out; `what` completes "Left out: 3 ...".
    pub(crate) fn reject(&mut self, what: &'static str) {
        *self.rejected.entry(what).or_default() += 1;
    }

    pub(crate) fn count(counters: &mut BTreeMap<SensorKind, u64>, kind: SensorKind) {
        *counters.entry(kind).or_default() += 1;
    }
}

fn times(count: u64) -> String {
    match count {
        1 => "once".to_owned(),
        2 => "twice".to_owned(),
        _ => format!("{count} times"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stamps_that_are_no_seconds_are_named() {
        let every = |interval_s: f64| {
            let issues = Issues {
                gaps: 99,
                gyroscope_stamps: 100,
                gyroscope_span_s: 99.0 * interval_s,
                ..Issues::default()
            };
            issues.sentences()[0].clone()
        };
        let text = every(10.0);
        assert!(text.contains("one sample every 10.000 s"), "{text}");
        assert!(
            text.contains("look like milliseconds") && text.contains("(100 samples a second then)"),
            "{text}"
        );
        assert!(
            text.contains("divide them by 1000, or") && text.contains("unit = \"ms\""),
            "{text}"
        );
        assert!(every(5000.0).contains("microseconds"));
        assert!(every(1e7).contains("nanoseconds"));
        // Whole seconds with many samples each are no milliseconds.
        let mut cut = Issues {
            gaps: 59,
            gyroscope_stamps: 60,
            gyroscope_span_s: 59.0,
            ..Issues::default()
        };
        cut.duplicate_stamps.insert(SensorKind::Gyroscope, 60 * 99);
        let text = cut.sentences()[0].clone();
        assert!(
            text.starts_with(
                "6000 samples of the gyroscope share 60 stamps, which are 1.000 s apart"
            ) && text.contains("rate_hz = 100 in place"),
            "{text}"
        );
        // Slow, but seconds: a sample each half second.
        assert!(!every(0.6).contains("look like"), "{}", every(0.6));
    }
}
