//! Stamps that cannot be: one that leaps away from those before it and is taken back by those behind it.
//!
//! A row with a false stamp costs that row. A leap forward after which the stamps go on is a pause, a leap back after
//! which they go on is another clock; both are left to [`crate::timeline`]. Between the streams of a recording that
//! are merged by time, each is looked at for itself.

use std::collections::VecDeque;

use crate::error::{RecordingError, Result};
use crate::event::Event;
use crate::issues::Issues;
use crate::recording::EventSource;
use crate::stamp::format_s;

/// A stamp further than this from the one before is suspect, ns.
const LEAP_NS: i64 = 5_000_000_000;
/// In a slow stream: a stamp that is further away than so many of its intervals.
const INTERVALS: i64 = 10;
/// So many stamps that go on from a suspect one are a pause or another clock.
const ENOUGH_STAMPS: usize = 10;
/// No more events than this are suspect at once.
const MOST_EVENTS: usize = 1000;
/// In a recording with more false stamps than this the stamps of two clocks are mixed.
const MOST_FALSE: u64 = 100;
/// False stamps that are told one by one.
const TOLD: u64 = 5;

/// A source without the events whose stamps are false.
pub(crate) struct FalseStamps<S> {
    source: S,
    /// The stamp that others are compared with, and the last interval between two.
    latest_ns: Option<i64>,
    interval_ns: i64,
    suspects: VecDeque<Suspect>,
    /// Events that are known to be true.
    ready: VecDeque<Event>,
    /// An error that comes behind the events before it.
    failed: Option<RecordingError>,
    found: u64,
}

struct Suspect {
    event: Event,
    /// Where it stands in the file; of the first event of its stamp.
    place: Option<String>,
}

impl<S: EventSource> FalseStamps<S> {
    pub(crate) fn new(source: S) -> Self {
        Self {
            source,
            latest_ns: None,
            interval_ns: 0,
            suspects: VecDeque::new(),
            ready: VecDeque::new(),
            failed: None,
            found: 0,
        }
    }

    /// How far a stamp lies from the latest one, ns; `None` where that is near enough.
    fn leap(&self, time_ns: i64) -> Option<i64> {
        let leap = time_ns.saturating_sub(self.latest_ns?);
        let usual = LEAP_NS.max(self.interval_ns.saturating_mul(INTERVALS));
        (leap.saturating_abs() > usual).then_some(leap)
    }

    fn take(&mut self, event: Event, issues: &mut Issues) {
        let time_ns = event.time_ns;
        if self.found > MOST_FALSE {
            return self.ready.push_back(event);
        }
        if self.suspects.is_empty() {
            match self.leap(time_ns) {
                None if self.latest_ns.is_some() => self.accept(event),
                // The first one of all is suspect too.
                _ => self.suspect(event),
            }
        } else if self.goes_on(time_ns) {
            let since = self.suspects.back().map(|last| last.event.time_ns);
            if self.latest_ns.is_none()
                && since.is_some_and(|last| time_ns.saturating_sub(last) > LEAP_NS)
            {
                // One of the two may be false: the later one is suspect, since most that is false is later.
                self.trust();
            }
            self.suspect(event);
            self.judge();
        } else {
            self.refuse(issues);
            self.take(event, issues);
        }
    }

    /// Whether a stamp goes on from the suspect ones instead of taking them back.
    fn goes_on(&self, time_ns: i64) -> bool {
        let Some(last) = self.suspects.back() else {
            return false;
        };
        let since = time_ns.saturating_sub(last.event.time_ns);
        let suspect_leap = self.leap(last.event.time_ns);
        match suspect_leap {
            // Ahead, or the very first: whatever lies further ahead goes on, or what is hardly earlier.
            Some(1..) | None => since >= -LEAP_NS && (since >= 0 || self.is_away(time_ns)),
            Some(_) => self.leap(time_ns).is_some_and(|leap| leap < 0),
        }
    }

    fn is_away(&self, time_ns: i64) -> bool {
        self.latest_ns.is_none() || self.leap(time_ns).is_some()
    }

    fn suspect(&mut self, event: Event) {
        let is_new = self
            .suspects
            .back()
            .is_none_or(|last| last.event.time_ns != event.time_ns);
        let place = is_new.then(|| self.source.place()).flatten();
        self.suspects.push_back(Suspect { event, place });
    }

    /// Trusts the suspects once enough stamps go on from them; without anything before them, two.
    fn judge(&mut self) {
        let enough = match self.latest_ns {
            Some(_) => ENOUGH_STAMPS,
            None => 2,
        };
        if self.stamps().count() >= enough || self.suspects.len() > MOST_EVENTS {
            self.trust();
        }
    }

    /// The suspect stamps, each once.
    fn stamps(&self) -> impl Iterator<Item = &Suspect> {
        let mut last = None;
        self.suspects.iter().filter(move |suspect| {
            last.replace(suspect.event.time_ns) != Some(suspect.event.time_ns)
        })
    }

    fn trust(&mut self) {
        self.latest_ns = None;
        for suspect in std::mem::take(&mut self.suspects) {
            self.accept(suspect.event);
        }
    }

    fn accept(&mut self, event: Event) {
        let latest = self.latest_ns.get_or_insert(event.time_ns);
        let interval = event.time_ns.saturating_sub(*latest);
        if interval > 0 {
            (*latest, self.interval_ns) = (event.time_ns, interval);
        }
        self.ready.push_back(event);
    }

    /// Leaves the suspects out, and tells of each stamp.
    fn refuse(&mut self, issues: &mut Issues) {
        let mut sentences = Vec::new();
        let mut found = self.found;
        for suspect in self.stamps() {
            found += 1;
            if found <= TOLD {
                sentences.push(self.sentence(suspect));
            }
        }
        issues.false_stamps += found - self.found;
        issues.notes.extend(sentences);
        self.found = found;
        self.suspects.clear();
    }

    fn sentence(&self, suspect: &Suspect) -> String {
        let event = &suspect.event;
        let place = match &suspect.place {
            Some(place) => format!("{place}: a false"),
            None => format!("The {} has a false", event.sample.kind().name()),
        };
        let stamp = format_s(event.time_ns);
        let leap = match self.leap(event.time_ns) {
            Some(leap) => format!(
                "{:.3} s {} those around it",
                leap.unsigned_abs() as f64 * 1e-9,
                if leap > 0 { "ahead of" } else { "behind" }
            ),
            None => "later than those behind it".to_owned(),
        };
        format!("{place} time stamp {stamp} s, {leap}; what is stamped with it is left out.")
    }
}

impl<S: EventSource> EventSource for FalseStamps<S> {
    fn next_event(&mut self, issues: &mut Issues) -> Result<Option<Event>> {
        loop {
            if let Some(event) = self.ready.pop_front() {
                return Ok(Some(event));
            }
            if let Some(error) = self.failed.take() {
                return Err(error);
            }
            match self.source.next_event(issues) {
                Ok(Some(event)) => self.take(event, issues),
                // Nothing takes the suspects back any more.
                Ok(None) if !self.suspects.is_empty() => self.trust(),
                Err(error) if !self.suspects.is_empty() => {
                    self.trust();
                    self.failed = Some(error);
                }
                other => return other,
            }
        }
    }

    fn place(&self) -> Option<String> {
        self.source.place()
    }
}

#[cfg(test)]
mod tests {
    use super::FalseStamps;
    use crate::error::Result;
    use crate::event::{Event, Sample};
    use crate::issues::Issues;
    use crate::recording::EventSource;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    struct List<I>(I, u64);

    impl<I: Iterator<Item = i64> + Send> EventSource for List<I> {
        fn next_event(&mut self, _: &mut Issues) -> Result<Option<Event>> {
            self.1 += 1;
            Ok(self.0.next().map(|time_ms| Event {
                time_ns: time_ms * 1_000_000,
                sample: Sample::Pressure(0.0),
            }))
        }

        fn place(&self) -> Option<String> {
            Some(format!("x.csv, line {}", self.1))
        }
    }

    /// What is left of stamps in ms, and what is told.
    fn left(stamps: &[i64]) -> (Vec<i64>, Issues) {
        let mut source = FalseStamps::new(List(stamps.iter().copied(), 1));
        let mut issues = Issues::default();
        let events = std::iter::from_fn(|| source.next_event(&mut issues).unwrap());
        let left = events.map(|event| event.time_ns / 1_000_000).collect();
        (left, issues)
    }

    fn steady(from: i64, count: i64) -> Vec<i64> {
        (0..count).map(|k| from + 10 * k).collect()
    }

    #[test]
    fn a_false_stamp_costs_its_row_wherever_it_is() {
        for place in [0, 1, 50, 98] {
            for false_ms in [3_600_000, 31_000, i64::MAX / 2_000_000] {
                let mut stamps = steady(0, 100);
                stamps[place] = false_ms;
                let (left, issues) = left(&stamps);
                stamps.remove(place);
                assert_eq!(left, stamps, "{false_ms} at {place}");
                assert_eq!(issues.false_stamps, 1);
                let told = &issues.notes[0];
                assert!(
                    told.starts_with(&format!("x.csv, line {}: ", place + 2)),
                    "{told}"
                );
            }
        }
    }

    #[test]
    fn a_stamp_far_behind_costs_its_row_too_and_the_sentence_has_its_value() {
        let mut stamps = steady(100_000, 100);
        stamps[40] = 1500;
        let (left, issues) = left(&stamps);
        stamps.remove(40);
        assert_eq!(left, stamps);
        assert_eq!(
            issues.notes,
            [
                "x.csv, line 42: a false time stamp 1.5 s, 98.890 s behind those around it; what is stamped with it is left out."
            ]
        );
    }

    #[test]
    fn pauses_slow_streams_and_clocks_that_were_set_are_no_false_stamps() {
        let pause = [steady(0, 50), steady(60_000, 50)].concat();
        let at_the_end = [steady(0, 50), vec![60_000, 60_010]].concat();
        let slow: Vec<i64> = (0..50).map(|k| 30_000 * k).collect();
        let set_back = [steady(60_000, 50), steady(0, 50)].concat();
        let jitter = [
            steady(0, 50),
            vec![60_000, 59_990, 60_010],
            steady(60_020, 50),
        ]
        .concat();
        for stamps in [pause, at_the_end, slow, set_back, jitter] {
            let (left, issues) = left(&stamps);
            assert_eq!(left, stamps);
            assert_eq!(issues, Issues::default());
        }
    }

    #[test]
    fn two_clocks_are_left_to_the_timeline() {
        let stamps: Vec<i64> = (0..1000).map(|k| 10 * k + 60_000 * (k % 2)).collect();
        let (left, issues) = left(&stamps);
        assert!(left.len() > 700, "{}", left.len());
        assert_eq!(issues.notes.len(), 5);
        assert!(issues.false_stamps > 100);
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(0x5a),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        #[test]
        fn every_event_is_delivered_or_counted(
            stamps in proptest::collection::vec(-4_000_000_000_000..4_000_000_000_000_i64, 0..300)
        ) {
            let (left, issues) = left(&stamps);
            let distinct = stamps.len() as u64 - left.len() as u64;
            // Equal stamps in a row are counted once.
            prop_assert!(issues.false_stamps <= distinct);
        }
    }
}
