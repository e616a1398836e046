//! Streams with stamps of their own into one stream in time order.

use nalgebra::Vector3;

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
    fn next_event(&mut self, issues: &mut Issues) -> Option<Result<Event>> {
        for stream in &mut self.streams {
            if !stream.started {
                stream.started = true;
                match stream.source.next_event(issues) {
                    Some(Ok(event)) => stream.head = Some(event),
                    Some(Err(error)) => return Some(Err(error)),
                    None => {}
                }
            }
        }
        let earliest = self
            .streams
            .iter_mut()
            .filter(|stream| stream.head.is_some())
            .min_by_key(|stream| {
                stream
                    .head
                    .map(|event| (event.time_ns, event.sample.kind().order()))
            })?;
        let event = earliest.head.take()?;
        // Refilled when the next event is asked for, so that an error comes after this event.
        earliest.started = false;
        Some(Ok(event))
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

impl Paired {
    fn next_pair(&mut self, issues: &mut Issues) -> Option<Result<Event>> {
        let mut first = match self.first.next_event(issues)? {
            Ok(event) => event,
            Err(error) => return Some(Err(error)),
        };
        let mut second = match self.second.next_event(issues)? {
            Ok(event) => event,
            Err(error) => return Some(Err(error)),
        };
        loop {
            let behind = match first.time_ns.cmp(&second.time_ns) {
                std::cmp::Ordering::Equal => break,
                std::cmp::Ordering::Less => (&mut self.first, &mut first),
                std::cmp::Ordering::Greater => (&mut self.second, &mut second),
            };
            issues.incomplete_samples += u64::from(self.count_incomplete);
            match behind.0.next_event(issues)? {
                Ok(event) => *behind.1 = event,
                Err(error) => return Some(Err(error)),
            }
        }
        let sum = vector(&first.sample)? + vector(&second.sample)? * self.sign;
        let sample = Sample::from_vector(self.kind, sum)?;
        Some(Ok(Event {
            time_ns: first.time_ns,
            sample,
        }))
    }
}

impl EventSource for Paired {
    fn next_event(&mut self, issues: &mut Issues) -> Option<Result<Event>> {
        self.next_pair(issues)
    }
}

pub(crate) fn vector(sample: &Sample) -> Option<Vector3<f64>> {
    match sample {
        Sample::AngularRate(v)
        | Sample::SpecificForce(v)
        | Sample::MagneticField(v)
        | Sample::MagneticFieldUncalibrated(v)
        | Sample::DeviceGyroscopeBias(v)
        | Sample::Position(v)
        | Sample::Velocity(v)
        | Sample::ReferenceVelocity(v) => Some(*v),
        _ => None,
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
        fn next_event(&mut self, _: &mut Issues) -> Option<Result<Event>> {
            self.0.next()
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
        std::iter::from_fn(|| source.next_event(issues)).collect()
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
