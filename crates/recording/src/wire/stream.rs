//! What every decoder does last: order in time, stamps that cannot be, rates that are too low.

use super::Decoded;
use crate::event::{Event, SensorKind};

/// A stamp this far from the newest one is not accepted at first, ns (an hour).
const FARTHEST_NS: u64 = 3_600_000_000_000;
/// So many unbelieved stamps that agree among themselves are a clock that was set.
const AGREE: u32 = 50;
/// Stamps of a clock that was set agree within this, ns (a minute).
const AGREE_NS: u64 = 60_000_000_000;
/// Over so long a rate is judged, ns.
const WINDOW_NS: u64 = 2_000_000_000;
/// Below this rate attitude estimates suffer, Hz.
const LOWEST_RATE_HZ: f64 = 20.0;

/// Sensors whose rates are judged.
const JUDGED: [SensorKind; 2] = [SensorKind::Gyroscope, SensorKind::Accelerometer];

/// One device's stream, across its messages.
#[derive(Debug, Clone, Default)]
pub(super) struct Stream {
    newest_ns: Option<i64>,
    /// Stamps that were not accepted: the last of them and how many agreed.
    unbelieved: Option<(i64, u32)>,
    rates: [RateWatch; JUDGED.len()],
}

#[derive(Debug, Clone, Default)]
struct RateWatch {
    /// First and last stamp of the window and how many there were.
    window: Option<(i64, i64, u32)>,
    low: bool,
}

impl Stream {
    /// Puts the events in order, leaves out those whose stamp cannot be, and judges the rates;
    /// `advice` is what the person at the device can do about a low one.
    pub(super) fn settle(&mut self, advice: &str, out: &mut Decoded) {
        let before = out.events.len();
        // Judged in the order of arrival, so that a stamp far in the past cannot hide behind the sorting.
        out.events.retain(|event| self.believes(event.time_ns));
        let left_out = (before - out.events.len()) as u64;
        out.bad_many("Readings whose time stamp is more than an hour away from the others' were left out: check the device's clock.", left_out);
        out.events.sort_by_key(Event::place);
        let mut low = Vec::new();
        for event in &out.events {
            let kind = event.sample.kind();
            for (_, watch) in JUDGED
                .iter()
                .zip(&mut self.rates)
                .filter(|(k, _)| **k == kind)
            {
                if let Some(rate_hz) = watch.judge(event.time_ns) {
                    low.push(format!(
                        "The {} comes only {rate_hz:.0} times a second: {advice}.",
                        kind.name(),
                    ));
                }
            }
        }
        for text in low {
            out.warn(text);
        }
    }

    fn believes(&mut self, time_ns: i64) -> bool {
        let Some(newest) = self.newest_ns else {
            self.newest_ns = Some(time_ns);
            return true;
        };
        if newest.abs_diff(time_ns) <= FARTHEST_NS {
            self.newest_ns = Some(newest.max(time_ns));
            self.unbelieved = None;
            return true;
        }
        let agreed = match self.unbelieved {
            Some((last, agreed)) if last.abs_diff(time_ns) <= AGREE_NS => agreed + 1,
            _ => 1,
        };
        self.unbelieved = Some((time_ns, agreed));
        if agreed < AGREE {
            return false;
        }
        self.newest_ns = Some(time_ns);
        self.unbelieved = None;
        true
    }
}

impl RateWatch {
    /// The rate when it has just been found to be too low, Hz.
    fn judge(&mut self, time_ns: i64) -> Option<f64> {
        let (first, last, count) = match self.window {
            Some((first, last, count)) => (first.min(time_ns), last.max(time_ns), count + 1),
            None => (time_ns, time_ns, 1),
        };
        let span = last.abs_diff(first);
        if span < WINDOW_NS {
            self.window = Some((first, last, count));
            return None;
        }
        self.window = None;
        // A pause is not a low rate.
        if span > 2 * WINDOW_NS {
            return None;
        }
        let rate_hz = f64::from(count - 1) / (span as f64 * 1e-9);
        let was_low = self.low;
        self.low = rate_hz < LOWEST_RATE_HZ;
        (self.low && !was_low).then_some(rate_hz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn decoded(stamps: impl IntoIterator<Item = i64>) -> Decoded {
        let mut out = Decoded::default();
        for time_ns in stamps {
            out.vector(time_ns, SensorKind::Gyroscope, Vector3::zeros());
        }
        out
    }

    fn stamps(out: &Decoded) -> Vec<i64> {
        out.events.iter().map(|event| event.time_ns).collect()
    }

    #[test]
    fn events_come_out_in_order() {
        let mut stream = Stream::default();
        let mut out = decoded([3, 1, 2]);
        stream.settle("", &mut out);
        assert_eq!(stamps(&out), [1, 2, 3]);
        assert!(out.notices.is_empty());
    }

    #[test]
    fn a_stamp_from_another_day_is_left_out_and_a_clock_that_was_set_is_followed() {
        const DAY: i64 = 86_400_000_000_000;
        let mut stream = Stream::default();
        let mut out = decoded([0, 1, DAY, 2, -DAY, 3]);
        stream.settle("", &mut out);
        assert_eq!(stamps(&out), [0, 1, 2, 3]);
        assert_eq!(out.notices[0].count, 2);
        let mut out = decoded(DAY..DAY + 60);
        stream.settle("", &mut out);
        assert_eq!(stamps(&out), Vec::from_iter(DAY + 49..DAY + 60));
    }

    #[test]
    fn a_low_rate_is_said_once() {
        let mut stream = Stream::default();
        let mut said = Vec::new();
        for index in 0..50_i64 {
            let mut out = decoded([index * 200_000_000]);
            stream.settle("set the period to 10 ms", &mut out);
            said.extend(out.notices);
        }
        assert_eq!(said.len(), 1);
        assert_eq!(
            said[0].text,
            "The gyroscope comes only 5 times a second: set the period to 10 ms."
        );
    }

    #[test]
    fn a_good_rate_and_a_pause_are_not_remarked_on() {
        let mut stream = Stream::default();
        let fast = (0..500_i64).map(|index| index * 10_000_000);
        let late = (0..500_i64).map(|index| 60_000_000_000 + index * 10_000_000);
        let mut out = decoded(fast.chain(late));
        stream.settle("", &mut out);
        assert!(out.notices.is_empty(), "{:?}", out.notices);
    }
}
