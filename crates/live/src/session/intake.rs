//! What arrives from each sensor: which samples are taken, at which rate, how finely quantised.

use std::collections::VecDeque;

use northing_recording::{Event, Sample, SensorKind};

use super::resolution::Resolution;

const SENSORS: usize = SensorKind::ALL.len();
/// Rates are means over this long, ns.
const RATE_WINDOW_NS: i64 = 2_000_000_000;
/// A rate never needs more stamps than this.
const MOST_STAMPS: usize = 2048;
/// A stamp that goes back further than this starts the device anew, ns.
const NEW_START_NS: i64 = 2_000_000_000;

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
    /// Its stamp goes back by seconds: the device's clock has started again.
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
#[derive(Debug, Clone)]
pub struct Intake {
    channels: [Channel; SENSORS],
    duplicated: u64,
    late: u64,
    refused: u64,
}

impl Default for Intake {
    fn default() -> Self {
        Self {
            channels: std::array::from_fn(|_| Channel::default()),
            duplicated: 0,
            late: 0,
            refused: 0,
        }
    }
}

impl Intake {
    /// Looks at one sample and counts it.
    pub fn admit(&mut self, event: &Event) -> Admission {
        let channel = &mut self.channels[event.sample.kind().order()];
        channel.received += 1;
        if !is_plausible(&event.sample) {
            self.refused += 1;
            return Admission::Refused;
        }
        if let Some(last) = channel.last_ns {
            if event.time_ns == last {
                self.duplicated += 1;
                return Admission::Duplicate;
            }
            if event.time_ns < last.saturating_sub(NEW_START_NS) {
                return Admission::NewStart;
            }
            if event.time_ns < last {
                self.late += 1;
                return Admission::Late;
            }
        }
        channel.take(event);
        Admission::Taken
    }

    /// Forgets stamps and rates after a new start; the counts go on.
    pub fn restart(&mut self) {
        for channel in &mut self.channels {
            let received = channel.received;
            *channel = Channel {
                received,
                ..Channel::default()
            };
        }
    }

    /// Samples received of all sensors, refused and repeated ones included.
    #[must_use]
    pub fn received(&self) -> u64 {
        self.channels.iter().map(|c| c.received).sum()
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

    /// Samples that were no measurement: not finite, or absurdly large.
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
        SensorKind::ALL.into_iter().filter_map(|kind| {
            let step = self.channels[kind.order()].resolution.step(kind)?;
            Some((kind, step))
        })
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

    #[test]
    fn each_sample_is_taken_once_and_in_order() {
        let mut intake = Intake::default();
        let told: Vec<_> = [
            rate(5000, 0.1),
            rate(5010, 0.1),
            rate(5010, 0.1),
            rate(5000, 0.1),
            rate(5020, f64::NAN),
            rate(5020, 1e9),
            rate(5020, 0.2),
            rate(100, 0.2),
        ]
        .iter()
        .map(|event| intake.admit(event))
        .collect();
        use Admission::{Duplicate, Late, NewStart, Refused, Taken};
        assert_eq!(
            told,
            [
                Taken, Taken, Duplicate, Late, Refused, Refused, Taken, NewStart
            ]
        );
        assert_eq!(
            (intake.received(), intake.duplicated(), intake.late()),
            (8, 1, 1)
        );
        assert_eq!(intake.refused(), 2);
    }

    #[test]
    fn rates_come_from_sensor_time() {
        let mut intake = Intake::default();
        for k in 0..1000 {
            intake.admit(&rate(k * 8, 0.0));
        }
        let rates: Vec<_> = intake.rates_hz().collect();
        assert_eq!(rates.len(), 1);
        assert!((rates[0].1 - 125.0).abs() < 1e-9, "{rates:?}");
    }
}
