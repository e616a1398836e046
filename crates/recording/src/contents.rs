//! What a recording holds: for each sensor how many samples, at which rate, with which pauses, how long its vectors are.

use serde::Serialize;

use crate::error::Result;
use crate::event::{Event, SensorKind};
use crate::watched::Watched;

/// Most intervals that are kept of a sensor, evenly over the recording; the median is taken of them.
const MOST_INTERVALS: usize = 4096;

/// What one sensor gave.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SensorContents {
    /// The sensor.
    pub sensor: SensorKind,
    /// Samples, those with numbers that are not finite among them.
    pub samples: u64,
    /// Samples with numbers that are not finite.
    pub not_finite: u64,
    /// Its first sample, s after the recording's first.
    pub from_s: f64,
    /// Its last sample, s after the recording's first.
    pub to_s: f64,
    /// Inverse of the median interval, Hz; `None` of fewer than two samples at different times.
    pub rate_hz: Option<f64>,
    /// The longest interval, s.
    pub longest_pause_s: f64,
    /// Where it began, s after the recording's first sample.
    pub longest_pause_at_s: f64,
    /// Mean length of the vectors, in the unit of the sensor, where it measures vectors.
    pub mean_length: Option<f64>,
}

/// Gathers while events pass by, in constant memory.
#[derive(Debug, Clone, Default)]
pub struct Contents {
    first_ns: Option<i64>,
    last_ns: i64,
    sensors: Vec<(SensorKind, Gathered)>,
}

#[derive(Debug, Clone, Default)]
struct Gathered {
    samples: u64,
    not_finite: u64,
    first_ns: i64,
    last_ns: i64,
    longest_ns: i64,
    longest_at_ns: i64,
    lengths: f64,
    vectors: u64,
    intervals: Intervals,
}

impl Contents {
    /// Takes one event.
    pub fn add(&mut self, event: &Event) {
        self.first_ns.get_or_insert(event.time_ns);
        self.last_ns = event.time_ns;
        let kind = event.sample.kind();
        let known = self.sensors.iter().position(|(sensor, _)| *sensor == kind);
        let at = known.unwrap_or_else(|| {
            self.sensors.push((kind, Gathered::default()));
            self.sensors.len() - 1
        });
        if let Some((_, gathered)) = self.sensors.get_mut(at) {
            gathered.add(event);
        }
    }

    /// Takes all that are still to come.
    ///
    /// # Errors
    /// What ends them early.
    pub fn read(&mut self, events: &mut Watched<'_>) -> Result<()> {
        for event in events {
            self.add(&event?);
        }
        Ok(())
    }

    /// Seconds from the first to the last sample.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.first_ns
            .map_or(0.0, |first_ns| seconds(first_ns, self.last_ns))
    }

    /// Sensor by sensor, in the order of [`SensorKind::ALL`].
    #[must_use]
    pub fn sensors(&self) -> Vec<SensorContents> {
        let first_ns = self.first_ns.unwrap_or_default();
        let mut sensors: Vec<_> = self
            .sensors
            .iter()
            .map(|(sensor, gathered)| gathered.contents(*sensor, first_ns))
            .collect();
        sensors.sort_by_key(|contents| contents.sensor.order());
        sensors
    }
}

impl Gathered {
    fn add(&mut self, event: &Event) {
        if self.samples == 0 {
            self.first_ns = event.time_ns;
        } else {
            let interval_ns = event.time_ns.saturating_sub(self.last_ns);
            self.intervals.add(interval_ns);
            if interval_ns > self.longest_ns {
                (self.longest_ns, self.longest_at_ns) = (interval_ns, self.last_ns);
            }
        }
        self.last_ns = event.time_ns;
        self.samples += 1;
        if !event.sample.is_finite() {
            self.not_finite += 1;
        } else if let Some(length) = event.sample.vector().map(|vector| vector.norm())
            && length.is_finite()
        {
            self.lengths += length;
            self.vectors += 1;
        }
    }

    fn contents(&self, sensor: SensorKind, first_ns: i64) -> SensorContents {
        SensorContents {
            sensor,
            samples: self.samples,
            not_finite: self.not_finite,
            from_s: seconds(first_ns, self.first_ns),
            to_s: seconds(first_ns, self.last_ns),
            rate_hz: self.intervals.median_ns().map(|median| 1e9 / median as f64),
            longest_pause_s: seconds(0, self.longest_ns),
            longest_pause_at_s: match self.longest_ns {
                0 => 0.0,
                _ => seconds(first_ns, self.longest_at_ns),
            },
            mean_length: (self.vectors > 0).then(|| self.lengths / self.vectors as f64),
        }
    }
}

/// Every k-th interval; k doubles when there are too many.
#[derive(Debug, Clone, Default)]
struct Intervals {
    kept_ns: Vec<i64>,
    seen: u64,
    doublings: u32,
}

impl Intervals {
    fn add(&mut self, interval_ns: i64) {
        if self.seen.trailing_zeros() >= self.doublings {
            self.kept_ns.push(interval_ns);
        }
        self.seen += 1;
        if self.kept_ns.len() >= MOST_INTERVALS {
            let mut index = 0_usize;
            self.kept_ns.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.doublings += 1;
        }
    }

    /// The median, if it is above zero.
    fn median_ns(&self) -> Option<i64> {
        let mut sorted = self.kept_ns.clone();
        sorted.sort_unstable();
        sorted.get(sorted.len() / 2).copied().filter(|ns| *ns > 0)
    }
}

fn seconds(from_ns: i64, to_ns: i64) -> f64 {
    to_ns.saturating_sub(from_ns) as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;

    use super::*;
    use crate::event::Sample;

    fn event(time_ns: i64, sample: Sample) -> Event {
        Event { time_ns, sample }
    }

    #[test]
    fn rates_pauses_and_lengths_are_those_of_the_samples() {
        let mut contents = Contents::default();
        for k in 0..20_000_i64 {
            // 100 Hz, two seconds missing after the first hundred seconds.
            let pause = if k > 10_000 { 2_000_000_000 } else { 0 };
            let time_ns = 5_000 + k * 10_000_000 + pause;
            let turn = match k {
                7 => Vector3::new(f64::NAN, 0.0, 0.0),
                _ => Vector3::new(0.0, 3.0, 4.0),
            };
            contents.add(&event(time_ns, Sample::AngularRate(turn)));
            if k % 4 == 1 {
                contents.add(&event(time_ns, Sample::Pressure(101_325.0)));
            }
        }
        let [gyroscope, barometer] = &contents.sensors()[..] else {
            panic!("two sensors");
        };
        assert_eq!((gyroscope.samples, gyroscope.not_finite), (20_000, 1));
        approx::assert_relative_eq!(gyroscope.rate_hz.unwrap(), 100.0);
        approx::assert_relative_eq!(gyroscope.longest_pause_s, 2.01);
        approx::assert_relative_eq!(gyroscope.longest_pause_at_s, 100.0);
        approx::assert_relative_eq!(gyroscope.mean_length.unwrap(), 5.0);
        approx::assert_relative_eq!(contents.duration_s(), 201.99);
        assert_eq!(barometer.sensor, SensorKind::Pressure);
        approx::assert_relative_eq!(barometer.rate_hz.unwrap(), 25.0);
        approx::assert_relative_eq!(barometer.from_s, 0.01);
        assert_eq!(barometer.mean_length, None);
    }

    /// The median of a stream whose rate changes is that of the longer part, however long the stream is.
    #[test]
    fn thinned_intervals_stand_for_the_whole() {
        let mut intervals = Intervals::default();
        for k in 0..300_000 {
            intervals.add(if k < 100_000 { 1 } else { 7 });
        }
        assert!(intervals.kept_ns.len() < MOST_INTERVALS);
        assert_eq!(intervals.median_ns(), Some(7));
        let few = intervals.kept_ns.iter().filter(|ns| **ns == 1).count();
        let share = few as f64 / intervals.kept_ns.len() as f64;
        assert!((share - 1.0 / 3.0).abs() < 0.01, "{share}");
    }

    #[test]
    fn of_nothing_and_of_one_sample_there_is_no_rate() {
        assert!(Contents::default().sensors().is_empty());
        let mut contents = Contents::default();
        contents.add(&event(i64::MIN, Sample::Pressure(1.0)));
        contents.add(&event(i64::MAX, Sample::SpecificForce(Vector3::x())));
        assert_eq!(contents.sensors()[0].rate_hz, None);
        assert!(contents.duration_s().is_finite());
    }
}
