//! What arrives from each sensor: which samples are taken, at which rate, how finely quantised.

use std::collections::VecDeque;

use northing_recording::{Event, Sample, SensorKind};

use super::aside::Aside;
use northing_evaluation::statistics::verdict::resolution::Resolution;
use northing_evaluation::statistics::verdict::timing::{Timing, TimingSummary};

const SENSORS: usize = SensorKind::ALL.len();
/// Rates are means over this long, ns.
const RATE_WINDOW_NS: i64 = 2_000_000_000;
/// A rate never needs more stamps than this.
const MOST_STAMPS: usize = 2048;
/// A stamp this far from the newest ones is not accepted at first, ns.
const JUMP_NS: i64 = 2_000_000_000;

/// What became of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Admission {
    /// In order: it goes to the filters.
    Taken,
    /// Its stamp repeats the last one of its sensor.
    Duplicate,
    /// Older than the last one of its sensor: too late for the live filters, good for a recording.
    Late,
    /// Not finite, or larger than any sensor measures.
    Refused,
    /// Stamped seconds ahead of all others, which then went on without it: left out.
    Unbelieved,
    /// The device's clock has started again; the sample itself follows with a verdict of its own.
    NewStart,
}

#[derive(Debug, Clone, Default)]
struct Channel {
    received: u64,
    last_ns: Option<i64>,
    stamps: VecDeque<i64>,
    resolution: Resolution,
}

/// Counts and orders the samples of one device.
///
/// One wrong stamp must not move the device's time: a sample that is seconds ahead of all sensors,
/// or seconds behind its own, is put aside until several agree with it (a pause, a clock that
/// started again) or a sample in order contradicts it.
#[derive(Debug, Clone, Default)]
pub struct Intake {
    channels: [Channel; SENSORS],
    newest_ns: Option<i64>,
    aside: Aside,
    new_clock: bool,
    duplicated: u64,
    late: u64,
    refused: u64,
}

/// Where a stamp lies among the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    Among,
    Ahead,
    Behind,
}

impl Intake {
    /// Looks at one sample and counts it. Appends what is to be done: often one verdict, none when
    /// the sample is put aside, several when those put aside are released.
    pub fn admit(&mut self, event: &Event, out: &mut Vec<(Admission, Event)>) {
        let kind = event.sample.kind().order();
        self.channels[kind].received += 1;
        if !is_plausible(&event.sample) {
            self.refused += 1;
            out.push((Admission::Refused, *event));
            return;
        }
        match (self.place(event), std::mem::take(&mut self.new_clock)) {
            (Place::Among, _) => {
                if self.channels[kind].last_ns.is_some() {
                    self.contradict(out);
                }
                self.order(event, out);
            }
            (place, announced) => {
                let ahead = place == Place::Ahead;
                if !self.aside.agrees(event, ahead) {
                    self.contradict(out);
                }
                if self.aside.add(event, ahead) || announced {
                    self.release(out);
                }
            }
        }
    }

    /// The next sample may have a clock of its own: a page was loaded anew.
    pub fn expect_new_clock(&mut self) {
        self.new_clock = true;
    }

    fn place(&self, event: &Event) -> Place {
        let last = self.channels[event.sample.kind().order()].last_ns;
        let ahead = |newest: i64| event.time_ns > newest.saturating_add(JUMP_NS);
        let behind = |last: i64| event.time_ns < last.saturating_sub(JUMP_NS);
        if self.newest_ns.is_some_and(ahead) {
            Place::Ahead
        } else if last.is_some_and(behind) {
            Place::Behind
        } else {
            Place::Among
        }
    }

    /// Judges an accepted stamp by the last of its sensor.
    fn order(&mut self, event: &Event, out: &mut Vec<(Admission, Event)>) {
        let channel = &mut self.channels[event.sample.kind().order()];
        let admission = match channel.last_ns {
            Some(last) if event.time_ns == last => {
                self.duplicated += 1;
                Admission::Duplicate
            }
            Some(last) if event.time_ns < last => {
                self.late += 1;
                Admission::Late
            }
            _ => {
                channel.take(event);
                self.newest_ns = self.newest_ns.max(Some(event.time_ns));
                Admission::Taken
            }
        };
        out.push((admission, *event));
    }

    /// The device goes on where it was: what was put aside was late, or wrong.
    fn contradict(&mut self, out: &mut Vec<(Admission, Event)>) {
        let aside = std::mem::take(&mut self.aside);
        let (admission, count) = match aside.ahead {
            true => (Admission::Unbelieved, &mut self.refused),
            false => (Admission::Late, &mut self.late),
        };
        *count += aside.events.len() as u64;
        out.extend(aside.events.into_iter().map(|event| (admission, event)));
    }

    /// Several agree: there was a pause, or the clock started again.
    fn release(&mut self, out: &mut Vec<(Admission, Event)>) {
        let aside = std::mem::take(&mut self.aside);
        if let (false, Some(first)) = (aside.ahead, aside.events.first()) {
            self.restart();
            out.push((Admission::NewStart, *first));
        }
        for event in &aside.events {
            self.order(event, out);
        }
    }

    /// Counts a sample of a message that had been given up. Returns whether it is a measurement.
    pub fn admit_late(&mut self, event: &Event) -> bool {
        self.channels[event.sample.kind().order()].received += 1;
        let plausible = is_plausible(&event.sample);
        if plausible {
            self.late += 1;
        } else {
            self.refused += 1;
        }
        plausible
    }

    /// Forgets stamps and rates after a new start; the counts go on.
    fn restart(&mut self) {
        self.newest_ns = None;
        for channel in &mut self.channels {
            let received = channel.received;
            *channel = Channel {
                received,
                ..Channel::default()
            };
        }
    }

    /// Samples received of all sensors, refused and repeated ones included. A compass heading comes
    /// with the orientation that it is part of and is not counted again.
    #[must_use]
    pub fn received(&self) -> u64 {
        let kinds = SensorKind::ALL.into_iter();
        let counted = kinds.filter(|kind| *kind != SensorKind::CompassHeading);
        counted.map(|kind| self.received_of(kind)).sum()
    }

    /// Samples of one sensor.
    #[must_use]
    pub fn received_of(&self, kind: SensorKind) -> u64 {
        self.channels[kind.order()].received
    }

    /// Samples with the stamp of the one before.
    #[must_use]
    pub fn duplicated(&self) -> u64 {
        self.duplicated
    }

    /// Samples too late for the live filters.
    #[must_use]
    pub fn late(&self) -> u64 {
        self.late
    }

    /// Samples that were no measurement: not finite, absurdly large, or from the future.
    #[must_use]
    pub fn refused(&self) -> u64 {
        self.refused
    }

    /// Samples a second of each sensor that delivers, by sensor time.
    pub fn rates_hz(&self) -> impl Iterator<Item = (SensorKind, f64)> + use<'_> {
        SensorKind::ALL.into_iter().filter_map(|kind| {
            let rate = self.channels[kind.order()].rate_hz()?;
            Some((kind, rate))
        })
    }

    /// The intervals between the samples of one sensor in the last two seconds.
    #[must_use]
    pub fn timing_of(&self, kind: SensorKind) -> TimingSummary {
        let mut timing = Timing::default();
        for stamp in &self.channels[kind.order()].stamps {
            timing.add(*stamp);
        }
        timing.summary()
    }

    /// Stamp of the newest sample of one sensor.
    #[must_use]
    pub fn last_ns(&self, kind: SensorKind) -> Option<i64> {
        self.channels[kind.order()].last_ns
    }

    /// Sensors whose newest sample is more than `seconds` older than `now_ns`.
    #[must_use]
    pub fn stopped(&self, now_ns: i64, seconds: f64) -> Vec<SensorKind> {
        let silent = |kind: &SensorKind| {
            let last = self.channels[kind.order()].last_ns;
            last.is_some_and(|last| now_ns.saturating_sub(last) as f64 * 1e-9 > seconds)
        };
        SensorKind::ALL.into_iter().filter(silent).collect()
    }

    /// Smallest step of each sensor whose values lie on a coarse grid, in the sensor's unit.
    pub fn resolutions(&self) -> impl Iterator<Item = (SensorKind, f64)> + use<'_> {
        SensorKind::ALL
            .into_iter()
            .filter_map(|kind| Some((kind, self.resolution_of(kind)?)))
    }

    /// Smallest step of one sensor, if its values lie on a coarse grid.
    #[must_use]
    pub fn resolution_of(&self, kind: SensorKind) -> Option<f64> {
        self.channels[kind.order()].resolution.step(kind)
    }
}

impl Channel {
    fn take(&mut self, event: &Event) {
        self.last_ns = Some(event.time_ns);
        self.resolution.add(&event.sample);
        self.stamps.push_back(event.time_ns);
        let old = event.time_ns.saturating_sub(RATE_WINDOW_NS);
        while self.stamps.len() > MOST_STAMPS || self.stamps.front().is_some_and(|t| *t < old) {
            self.stamps.pop_front();
        }
    }

    fn rate_hz(&self) -> Option<f64> {
        let (first, last) = (self.stamps.front()?, self.stamps.back()?);
        let seconds = last.saturating_sub(*first) as f64 * 1e-9;
        (seconds > 0.0).then(|| (self.stamps.len() - 1) as f64 / seconds)
    }
}

/// Whether a sensor could have measured this.
fn is_plausible(sample: &Sample) -> bool {
    let largest = |v: &nalgebra::Vector3<f64>, limit: f64| v.amax() <= limit;
    sample.is_finite()
        && match sample {
            // 100 rad/s is three times what phones measure; 1000 m/s^2 is a hundred g.
            Sample::AngularRate(v) | Sample::DeviceGyroscopeBias(v) => largest(v, 100.0),
            Sample::SpecificForce(v) => largest(v, 1000.0),
            Sample::MagneticField(v) | Sample::MagneticFieldUncalibrated(v) => largest(v, 1e5),
            _ => true,
        }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn rate(time_ms: i64, x: f64) -> Event {
        Event {
            time_ns: time_ms * 1_000_000,
            sample: Sample::AngularRate(Vector3::new(x, 0.0, 0.0)),
        }
    }

    fn told(intake: &mut Intake, events: impl IntoIterator<Item = Event>) -> Vec<Admission> {
        let mut out = Vec::new();
        for event in events {
            intake.admit(&event, &mut out);
        }
        out.into_iter().map(|(admission, _)| admission).collect()
    }

    use Admission::{Duplicate, Late, NewStart, Refused, Taken, Unbelieved};

    #[test]
    fn each_sample_is_taken_once_and_in_order() {
        let mut intake = Intake::default();
        let events = [
            rate(5000, 0.1),
            rate(5010, 0.1),
            rate(5010, 0.1),
            rate(5000, 0.1),
            rate(5020, f64::NAN),
            rate(5020, 1e9),
            rate(5020, 0.2),
        ];
        assert_eq!(
            told(&mut intake, events),
            [Taken, Taken, Duplicate, Late, Refused, Refused, Taken]
        );
        assert_eq!(
            (intake.received(), intake.duplicated(), intake.late()),
            (7, 1, 1)
        );
        assert_eq!(intake.refused(), 2);
    }

    #[test]
    fn one_stamp_from_the_future_or_the_past_moves_nothing() {
        let mut intake = Intake::default();
        let events = [
            rate(5000, 0.1),
            rate(605_000, 0.1),
            rate(5010, 0.1),
            rate(10, 0.1),
            rate(20, 0.1),
            rate(5020, 0.1),
        ];
        assert_eq!(
            told(&mut intake, events),
            [Taken, Unbelieved, Taken, Late, Late, Taken]
        );
        assert_eq!((intake.refused(), intake.late()), (1, 2));
    }

    #[test]
    fn stamps_that_agree_are_a_pause_or_a_new_start_and_none_is_lost() {
        let mut intake = Intake::default();
        assert_eq!(told(&mut intake, [rate(5000, 0.1)]), [Taken]);
        let later = (0..5).map(|k| rate(20_000 + k * 10, 0.1));
        assert_eq!(told(&mut intake, later), [Taken; 5]);
        // Four stamps, one of them twice, are not enough.
        let few = [0, 10, 20, 20, 30].map(|k| rate(90_000 + k, 0.1));
        assert_eq!(told(&mut intake, few), []);
        // A clock that started again must go on for a second: a late batch does not.
        let batch = (0..20).map(|k| rate(k * 10, 0.1));
        assert_eq!(told(&mut intake, batch), [Unbelieved; 5]);
        let on = (20..=100).map(|k| rate(k * 10, 0.1));
        let told = told(&mut intake, on);
        assert_eq!((told[0], told.len()), (NewStart, 102));
        assert!(told[1..].iter().all(|admission| *admission == Taken));
    }

    #[test]
    fn a_page_that_was_loaded_anew_has_a_new_clock() {
        let mut intake = Intake::default();
        told(&mut intake, [rate(90_000, 0.1)]);
        intake.expect_new_clock();
        assert_eq!(
            told(&mut intake, [rate(100, 0.1), rate(110, 0.1)]),
            [NewStart, Taken, Taken]
        );
    }

    #[test]
    fn rates_come_from_sensor_time() {
        let mut intake = Intake::default();
        for k in 0..1000 {
            intake.admit(&rate(k * 8, 0.0), &mut Vec::new());
        }
        let rates: Vec<_> = intake.rates_hz().collect();
        assert_eq!(rates.len(), 1);
        assert!((rates[0].1 - 125.0).abs() < 1e-9, "{rates:?}");
    }
}
