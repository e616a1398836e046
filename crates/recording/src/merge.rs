//! Streams with stamps of their own into one stream in time order.

use std::cmp::Ordering;

use crate::error::Result;
use crate::event::{Event, Sample, SensorKind};
use crate::issues::Issues;
use crate::recording::EventSource;

/// Streams merged by time; of equal stamps the sensor first in [`SensorKind::ALL`] comes first.
/// Holds one event of each stream.
pub(crate) struct Merged {
    streams: Vec<Stream>,
}

struct Stream {
    source: Box<dyn EventSource>,
    /// The stream's next event, once it has been asked for.
    head: Option<Event>,
    started: bool,
}

impl Merged {
    pub(crate) fn new(sources: Vec<Box<dyn EventSource>>) -> Self {
        let streams = sources
            .into_iter()
            .map(|source| Stream {
                source,
                head: None,
                started: false,
            })
            .collect();
        Self { streams }
    }
}

impl EventSource for Merged {
    fn next_event(&mut self, issues: &mut Issues) -> Result<Option<Event>> {
        for stream in self.streams.iter_mut().filter(|stream| !stream.started) {
            stream.started = true;
            stream.head = stream.source.next_event(issues)?;
        }
        let waiting = self.streams.iter_mut().filter(|s| s.head.is_some());
        let earliest = waiting.min_by_key(|stream| stream.head.map(|event| event.place()));
        Ok(earliest.and_then(|stream| {
            // Refilled when the next event is asked for, so that an error comes after this event.
            stream.started = false;
            stream.head.take()
        }))
    }
}

/// Sums (or differences) of two vector streams at equal stamps, as samples of `kind`. Both streams
/// run forward; a sample without a partner of its stamp is dropped.
pub(crate) struct Paired {
    pub(crate) first: Box<dyn EventSource>,
    pub(crate) second: Box<dyn EventSource>,
    pub(crate) kind: SensorKind,
    /// 1 for sums, -1 for differences.
    pub(crate) sign: f64,
    /// Whether dropped samples are worth telling.
    pub(crate) count_incomplete: bool,
}

impl EventSource for Paired {
    fn next_event(&mut self, issues: &mut Issues) -> Result<Option<Event>> {
        let mut first = self.first.next_event(issues)?;
        // A stream that has ended has no more partners for the other.
        let mut second = match first {
            Some(_) => self.second.next_event(issues)?,
            None => None,
        };
        loop {
            let (Some(one), Some(other)) = (first, second) else {
                return Ok(None);
            };
            match one.time_ns.cmp(&other.time_ns) {
                Ordering::Less => first = self.first.next_event(issues)?,
                Ordering::Greater => second = self.second.next_event(issues)?,
                Ordering::Equal => return Ok(self.pair(&one, &other)),
            }
            issues.incomplete_samples += u64::from(self.count_incomplete);
        }
    }
}

impl Paired {
    fn pair(&self, one: &Event, other: &Event) -> Option<Event> {
        let sum = one.sample.vector()? + other.sample.vector()? * self.sign;
        let sample = Sample::from_vector(self.kind, sum)?;
        Some(Event { sample, ..*one })
    }
}

#[cfg(test)]
mod tests {
    use super::{Merged, Paired};
    use crate::error::{RecordingError, Result};
    use crate::event::{Event, Sample, SensorKind};
    use crate::issues::Issues;
    use crate::recording::EventSource;
    use nalgebra::Vector3;
    use proptest::prelude::*;
    use proptest::test_runner::RngSeed;

    struct List(std::vec::IntoIter<Result<Event>>);

    impl EventSource for List {
        fn next_event(&mut self, _: &mut Issues) -> Result<Option<Event>> {
            self.0.next().transpose()
        }
    }

    fn source(events: Vec<Event>) -> Box<dyn EventSource> {
        Box::new(List(
            events.into_iter().map(Ok).collect::<Vec<_>>().into_iter(),
        ))
    }

    fn rate(time_ns: i64) -> Event {
        let sample = Sample::AngularRate(Vector3::x());
        Event { time_ns, sample }
    }

    fn force(time_ns: i64) -> Event {
        let sample = Sample::SpecificForce(Vector3::z());
        Event { time_ns, sample }
    }

    fn all(mut source: impl EventSource, issues: &mut Issues) -> Vec<Result<Event>> {
        std::iter::from_fn(|| source.next_event(issues).transpose()).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig {
            rng_seed: RngSeed::Fixed(0x3e),
            failure_persistence: None,
            ..ProptestConfig::default()
        })]

        #[test]
        fn merged_streams_are_sorted_and_complete(
            mut a in proptest::collection::vec(0..100_i64, 0..50),
            mut b in proptest::collection::vec(0..100_i64, 0..50),
        ) {
            a.sort_unstable();
            b.sort_unstable();
            let merged = Merged::new(vec![
                source(b.iter().map(|t| force(*t)).collect()),
                source(a.iter().map(|t| rate(*t)).collect()),
            ]);
            let places: Vec<_> = all(merged, &mut Issues::default())
                .into_iter()
                .map(|event| event.map(|event| (event.time_ns, event.sample.kind().order())).unwrap())
                .collect();
            let mut expected: Vec<_> = a.iter().map(|t| (*t, 0)).chain(b.iter().map(|t| (*t, 1))).collect();
            expected.sort_unstable();
            prop_assert_eq!(places, expected);
        }
    }

    #[test]
    fn an_error_of_one_stream_comes_after_the_events_before_it() {
        let broken = RecordingError::Damaged {
            file: "test".to_owned(),
            detail: "made up".to_owned(),
        };
        let bad = List(vec![Ok(force(5)), Err(broken)].into_iter());
        let merged = Merged::new(vec![source(vec![rate(1), rate(6)]), Box::new(bad)]);
        let read = all(merged, &mut Issues::default());
        assert_eq!(read[0].as_ref().unwrap(), &rate(1));
        assert_eq!(read[1].as_ref().unwrap(), &force(5));
        assert!(read[2].is_err());
    }

    #[test]
    fn pairs_need_equal_stamps() {
        let mut issues = Issues::default();
        let paired = Paired {
            first: source(vec![force(0), force(10), force(20), force(40)]),
            second: source(vec![force(10), force(15), force(40)]),
            kind: SensorKind::Accelerometer,
            sign: 1.0,
            count_incomplete: true,
        };
        let read: Vec<_> = all(paired, &mut issues)
            .into_iter()
            .map(Result::unwrap)
            .collect();
        assert_eq!(
            read.iter().map(|event| event.time_ns).collect::<Vec<_>>(),
            [10, 40]
        );
        assert_eq!(read[0].sample, Sample::SpecificForce(Vector3::z() * 2.0));
        assert_eq!(issues.incomplete_samples, 3);
    }
}
