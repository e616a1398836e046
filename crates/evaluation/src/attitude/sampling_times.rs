//! When samples were taken that arrived in bunches: each sensor's stamps through a [`SamplingClock`], and back in order of time.
//!
//! A look at the first samples tells whether a sensor's stamps come in bunches, before any of them is used. Where none does,
//! events are passed on as they are. Memory is that look, and then what arrives within a bunch.

use std::cmp::{Ordering, Reverse};
use std::collections::{BinaryHeap, VecDeque};

use northing_core::faults::sampling_clock::SamplingClock;
use northing_recording::{Event, SensorKind};

/// Samples of the gyroscope that are looked at, and events where it has few.
const LOOK: usize = 96;
const LONGEST_LOOK: usize = 2048;

/// An event at the time when it was measured, and the stamp it came with.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Arrived {
    pub(crate) event: Event,
    pub(crate) arrived_ns: i64,
}

/// One that waits for those that may have been measured before it.
#[derive(Debug, Clone, Copy)]
struct Waiting {
    /// Of events of one instant the sensor's place, then the order in which they came.
    place: (i64, usize, u64),
    arrived: Arrived,
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        self.place.cmp(&other.place)
    }
}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Waiting {
    fn eq(&self, other: &Self) -> bool {
        self.place == other.place
    }
}

impl Eq for Waiting {}

/// How events are passed on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Passing {
    /// Not before the first have been looked at.
    Looks,
    /// As they come.
    AsTheyCome,
    /// At the instants of the sensors' clocks.
    ByClock,
}

/// Events in order of the times at which they were measured.
#[derive(Debug)]
pub(crate) struct SamplingTimes<I, X> {
    events: I,
    passing: Passing,
    looked_at: VecDeque<Event>,
    clocks: [SamplingClock<f64>; SensorKind::ALL.len()],
    waiting: BinaryHeap<Reverse<Waiting>>,
    /// Events that came, and the time of the last that was passed on.
    count: u64,
    passed_ns: i64,
    /// What ended the events, behind those before it.
    failed: Option<X>,
    over: bool,
}

impl<I, X> SamplingTimes<I, X>
where
    I: Iterator<Item = Result<Event, X>>,
{
    /// Of these events, which must be in order of their stamps.
    pub(crate) fn new(events: I) -> Self {
        Self {
            events,
            passing: Passing::Looks,
            looked_at: VecDeque::new(),
            clocks: [SamplingClock::default(); SensorKind::ALL.len()],
            waiting: BinaryHeap::new(),
            count: 0,
            passed_ns: i64::MIN,
            failed: None,
            over: false,
        }
    }

    /// Reads ahead until it is known how samples come.
    fn look(&mut self) {
        let mut rates = 0;
        while rates < LOOK && self.looked_at.len() < LONGEST_LOOK {
            match self.events.next() {
                Some(Ok(event)) => {
                    let kind = event.sample.kind();
                    rates += usize::from(kind == SensorKind::Gyroscope);
                    self.clocks[kind.order()].arrived(event.time_ns);
                    self.looked_at.push_back(event);
                }
                Some(Err(error)) => {
                    self.failed = Some(error);
                    self.over = true;
                    break;
                }
                None => {
                    self.over = true;
                    break;
                }
            }
        }
        self.passing = if self.clocks.iter().any(SamplingClock::is_bunched) {
            self.clocks = self.clocks.map(|clock| clock.rewound());
            Passing::ByClock
        } else {
            Passing::AsTheyCome
        };
    }

    fn read(&mut self) -> Option<Event> {
        if let Some(event) = self.looked_at.pop_front() {
            return Some(event);
        }
        if self.over {
            return None;
        }
        match self.events.next() {
            Some(Ok(event)) => return Some(event),
            Some(Err(error)) => self.failed = Some(error),
            None => {}
        }
        self.over = true;
        None
    }

    /// The next event as it comes, unless the gyroscope's samples come in bunches from now on.
    fn as_it_comes(&mut self) -> Option<Arrived> {
        let was_looked_at = !self.looked_at.is_empty();
        let event = self.read()?;
        if !was_looked_at && event.sample.kind() == SensorKind::Gyroscope {
            let clock = &mut self.clocks[SensorKind::Gyroscope.order()];
            clock.arrived(event.time_ns);
            if clock.is_bunched() {
                self.passing = Passing::ByClock;
            }
        }
        self.passed_ns = event.time_ns;
        Some(Arrived {
            event,
            arrived_ns: event.time_ns,
        })
    }

    /// The next event of those that wait for their turn.
    fn by_clock(&mut self) -> Option<Arrived> {
        loop {
            if let Some(Reverse(first)) = self.waiting.peek()
                && (self.over || first.place.0 < self.earliest_ns())
            {
                let Reverse(Waiting { mut arrived, .. }) = self.waiting.pop()?;
                // A sensor that stayed away for longer than it usually does comes too late for its instant.
                self.passed_ns = self.passed_ns.max(arrived.event.time_ns);
                arrived.event.time_ns = self.passed_ns;
                return Some(arrived);
            }
            match self.read() {
                Some(event) => self.wait(event),
                None if self.waiting.is_empty() => return None,
                None => {}
            }
        }
    }

    fn wait(&mut self, mut event: Event) {
        let arrived_ns = event.time_ns;
        let order = event.sample.kind().order();
        // What is no newer than the sample before it is no sample of the clock; those who use it have their rules for it.
        if let Some(instant_ns) = self.clocks[order].arrived(arrived_ns) {
            event.time_ns = instant_ns;
        }
        self.count += 1;
        self.waiting.push(Reverse(Waiting {
            place: (event.time_ns, order, self.count),
            arrived: Arrived { event, arrived_ns },
        }));
    }

    /// Nothing that is still to come was measured before this.
    fn earliest_ns(&self) -> i64 {
        let clocks = self.clocks.iter().filter(|clock| clock.is_bunched());
        let arrived_ns = self.clocks.iter().filter_map(SamplingClock::arrived_ns);
        let now_ns = arrived_ns.max().unwrap_or(i64::MIN);
        let next_ns = clocks.map(|clock| clock.earliest_next_ns(now_ns));
        next_ns.fold(now_ns, i64::min)
    }
}

impl<I, X> Iterator for SamplingTimes<I, X>
where
    I: Iterator<Item = Result<Event, X>>,
{
    type Item = Result<Arrived, X>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.passing == Passing::Looks {
            self.look();
        }
        let next = match self.passing {
            Passing::ByClock => self.by_clock(),
            _ => self.as_it_comes(),
        };
        match next {
            Some(event) => Some(Ok(event)),
            None => self.failed.take().map(Err),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use northing_recording::Sample;

    const INTERVAL_NS: i64 = 10_000_000;

    type Failure = Result<Event, &'static str>;

    /// Samples of gyroscope and accelerometer, numbered, taken every 10 ms and 5 ms later and read four at a time from sample `from` on.
    fn events(count: i64, from: i64) -> Vec<Event> {
        let stamp = |k: i64, after: i64| {
            let read = if k < from { k } else { k / 4 * 4 + 3 };
            read * INTERVAL_NS + after
        };
        let mut events: Vec<_> = (0..count)
            .flat_map(|k| {
                let number = Vector3::repeat(k as f64);
                [
                    (stamp(k, 0), Sample::AngularRate(number)),
                    (stamp(k, 5_000_000), Sample::SpecificForce(number)),
                ]
            })
            .map(|(time_ns, sample)| Event { time_ns, sample })
            .collect();
        events.sort_by_key(Event::place);
        events
    }

    fn number(event: &Event) -> (SensorKind, i64) {
        let vector = event.sample.vector().unwrap();
        (event.sample.kind(), vector.x as i64)
    }

    fn passed(events: impl IntoIterator<Item = Failure>) -> (Vec<Arrived>, Option<&'static str>) {
        let (mut passed, mut failed) = (Vec::new(), None);
        for event in SamplingTimes::new(events.into_iter()) {
            match event {
                Ok(event) => passed.push(event),
                Err(error) => failed = Some(error),
            }
        }
        (passed, failed)
    }

    #[test]
    fn bunches_are_put_back_in_the_order_of_measurement_and_nothing_is_lost() {
        let (passed, _) = passed(events(1000, 0).into_iter().map(Ok));
        assert_eq!(passed.len(), 2000);
        assert!(passed.is_sorted_by_key(|arrived| arrived.event.time_ns));
        for (k, Arrived { event, arrived_ns }) in passed.iter().enumerate() {
            let (taken, sensor) = (
                k as i64 / 2,
                [SensorKind::Gyroscope, SensorKind::Accelerometer],
            );
            assert_eq!(number(event), (sensor[k % 2], taken));
            let after = 5_000_000 * (k as i64 % 2);
            let off = event.time_ns - taken * INTERVAL_NS - after;
            assert!(off.abs() < INTERVAL_NS / 10, "{k}: {off}");
            assert_eq!(*arrived_ns, (taken / 4 * 4 + 3) * INTERVAL_NS + after);
        }
    }

    #[test]
    fn what_begins_to_come_in_bunches_is_seen_later() {
        let (passed, _) = passed(events(2000, 600).into_iter().map(Ok));
        assert_eq!(passed.len(), 4000);
        assert!(passed.is_sorted_by_key(|arrived| arrived.event.time_ns));
        for (k, arrived) in passed.iter().enumerate().skip(3000) {
            let (_, taken) = number(&arrived.event);
            assert_eq!(taken, k as i64 / 2);
        }
    }

    #[test]
    fn regular_events_pass_as_they_are_and_an_error_comes_behind_what_is_before_it() {
        for (count, bunched_from) in [(3, 9), (500, 1000), (500, 0)] {
            let events = events(count, bunched_from);
            let failing = events.iter().map(|event| Ok(*event)).chain([Err("broken")]);
            let (passed, failed) = passed(failing);
            assert_eq!(failed, Some("broken"));
            assert_eq!(passed.len(), events.len());
            if bunched_from > 0 {
                assert!(passed.iter().map(|p| &p.event).eq(&events));
            }
        }
    }

    /// A sensor that ends does not hold up the others.
    #[test]
    fn little_waits() {
        let mut events = events(2000, 0);
        events.retain(|event| {
            let (kind, k) = number(event);
            kind == SensorKind::Gyroscope || k < 300
        });
        let mut times = SamplingTimes::new(events.into_iter().map(Failure::Ok));
        let mut most = 0;
        while times.next().is_some() {
            most = most.max(times.waiting.len());
        }
        assert!(most < 60, "{most}");
    }
}
