//! The samples of a rest: gathered with their stamps, put on a regular grid, checked for motion.

use nalgebra::Vector3;
use northing_recording::{Event, Sample, SensorKind};

use super::AllanConfig;
use super::error::AllanError;
use crate::statistics::seconds_between;

/// Share of samples that may be missing and filled in.
const MISSING_LIMIT: f64 = 0.05;

/// A second scatters this many times more than usual: the device was shaken.
const SHAKEN_FACTOR: f64 = 4.0;

/// Standard deviations of chance that the mean of one second may show on top of the limit.
const CHANCE: f64 = 6.0;

/// The samples of one sensor at rest, with their stamps.
#[derive(Debug, Clone, PartialEq)]
pub struct RestSamples {
    sensor: SensorKind,
    times_ns: Vec<i64>,
    values: Vec<Vector3<f64>>,
    ignored: usize,
}

/// Samples on a regular grid, one list an axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Regular {
    pub(super) interval_s: f64,
    pub(super) axes: [Vec<f64>; 3],
    /// Samples that were missing and are filled in.
    pub(super) filled: usize,
    /// Pieces between gaps, and where the longest begins and ends, s after the first sample.
    pub(super) pieces: usize,
    pub(super) span_s: [f64; 2],
}

impl RestSamples {
    /// Nothing gathered yet.
    #[must_use]
    pub fn new(sensor: SensorKind) -> Self {
        Self {
            sensor,
            times_ns: Vec::new(),
            values: Vec::new(),
            ignored: 0,
        }
    }

    /// Adds a sample; one that is not finite or not later than the last is ignored and counted.
    pub fn add(&mut self, time_ns: i64, value: &Vector3<f64>) -> bool {
        let later = self.times_ns.last().is_none_or(|last| time_ns > *last);
        if !later || !value.iter().all(|x| x.is_finite()) {
            self.ignored += 1;
            return false;
        }
        self.times_ns.push(time_ns);
        self.values.push(*value);
        true
    }

    /// Adds an event if it is one of the sensor.
    pub fn add_event(&mut self, event: &Event) -> bool {
        if event.sample.kind() != self.sensor {
            return false;
        }
        match event.sample {
            Sample::AngularRate(v)
            | Sample::SpecificForce(v)
            | Sample::MagneticField(v)
            | Sample::MagneticFieldUncalibrated(v) => self.add(event.time_ns, &v),
            _ => false,
        }
    }

    /// The sensor.
    #[must_use]
    pub fn sensor(&self) -> SensorKind {
        self.sensor
    }

    /// Samples gathered.
    #[must_use]
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Whether nothing was gathered.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Samples ignored: not finite, or not later than the one before.
    #[must_use]
    pub fn ignored(&self) -> usize {
        self.ignored
    }

    /// Stamps (ns) and values.
    #[cfg(test)]
    pub(super) fn parts(&self) -> (&[i64], &[Vector3<f64>]) {
        (&self.times_ns, &self.values)
    }

    /// The longest piece without a long gap, on a regular grid, checked to be a rest.
    pub(super) fn regular(&self, config: &AllanConfig) -> Result<Regular, AllanError> {
        let sensor = self.sensor;
        if self.is_empty() {
            return Err(AllanError::NoSamples(sensor));
        }
        if self.values.iter().all(|value| *value == self.values[0]) {
            let samples = self.len();
            return Err(AllanError::Constant { sensor, samples });
        }
        let typical = median(self.intervals_s());
        let longest_gap = config.longest_filled_gap_s.max(1.5 * typical);
        let (from, to, pieces) = self.longest_piece(longest_gap);
        let regular = self.filled(from, to, pieces, typical);
        let seconds = regular.interval_s * regular.axes[0].len() as f64;
        let required = config.minimum_duration_s;
        if seconds < required || regular.axes[0].len() < 100 {
            return Err(AllanError::TooShort {
                sensor,
                seconds,
                required,
            });
        }
        let share = regular.filled as f64 / regular.axes[0].len() as f64;
        if share > MISSING_LIMIT {
            let limit = MISSING_LIMIT;
            return Err(AllanError::TooManyMissing {
                sensor,
                share,
                limit,
            });
        }
        regular.check_rest(sensor, config.motion_limit(sensor))?;
        Ok(regular)
    }

    fn intervals_s(&self) -> Vec<f64> {
        let pairs = self.times_ns.windows(2);
        pairs
            .map(|pair| seconds_between(pair[0], pair[1]))
            .collect()
    }

    /// First and last index of the longest piece in which no interval is longer than `limit`, and
    /// how many pieces there are.
    fn longest_piece(&self, limit: f64) -> (usize, usize, usize) {
        let (mut best, mut start, mut pieces) = ((0, 0), 0, 1);
        for (k, interval) in self.intervals_s().iter().enumerate() {
            if *interval > limit {
                start = k + 1;
                pieces += 1;
            }
            if self.times_ns[k + 1] - self.times_ns[start]
                > self.times_ns[best.1] - self.times_ns[best.0]
            {
                best = (start, k + 1);
            }
        }
        (best.0, best.1, pieces)
    }

    /// The piece with missing samples filled in on the straight line between their neighbours.
    fn filled(&self, from: usize, to: usize, pieces: usize, typical: f64) -> Regular {
        let mut axes = [const { Vec::new() }; 3];
        let mut filled = 0;
        for k in from..=to {
            if k > from {
                let gap = seconds_between(self.times_ns[k - 1], self.times_ns[k]);
                let missing = ((gap / typical).round() as usize).saturating_sub(1);
                for i in 1..=missing {
                    let part = i as f64 / (missing + 1) as f64;
                    push(&mut axes, &self.values[k - 1].lerp(&self.values[k], part));
                }
                filled += missing;
            }
            push(&mut axes, &self.values[k]);
        }
        let span = [from, to].map(|k| seconds_between(self.times_ns[0], self.times_ns[k]));
        let steps = axes[0].len().saturating_sub(1).max(1) as f64;
        Regular {
            interval_s: (span[1] - span[0]) / steps,
            axes,
            filled,
            pieces,
            span_s: span,
        }
    }
}

impl Regular {
    /// Each second's mean is near the usual one and its scatter no more than usual.
    fn check_rest(&self, sensor: SensorKind, limit: f64) -> Result<(), AllanError> {
        let unit = super::unit(sensor);
        let block = ((1.0 / self.interval_s).round() as usize).max(2);
        for axis in &self.axes {
            let blocks: Vec<_> = axis.chunks_exact(block).map(mean_and_std).collect();
            let usual_mean = median(blocks.iter().map(|b| b.0).collect());
            let usual_std = median(blocks.iter().map(|b| b.1).collect());
            let mean_limit = limit + CHANCE * usual_std / (block as f64).sqrt();
            for (k, (mean, std)) in blocks.iter().enumerate() {
                let time_s = self.span_s[0] + (k * block) as f64 * self.interval_s;
                let deviation = (mean - usual_mean).abs();
                if deviation > mean_limit {
                    return Err(AllanError::Moved {
                        sensor,
                        time_s,
                        deviation,
                        limit: mean_limit,
                        unit,
                    });
                }
                if *std > (SHAKEN_FACTOR * usual_std).max(limit) {
                    return Err(AllanError::Shaken {
                        sensor,
                        time_s,
                        std: *std,
                        usual: usual_std,
                        unit,
                    });
                }
            }
        }
        Ok(())
    }
}

fn push(axes: &mut [Vec<f64>; 3], value: &Vector3<f64>) {
    for (axis, component) in axes.iter_mut().zip(value.iter()) {
        axis.push(*component);
    }
}

fn mean_and_std(block: &[f64]) -> (f64, f64) {
    let n = block.len() as f64;
    let mean = block.iter().sum::<f64>() / n;
    let squares = block.iter().map(|x| (x - mean).powi(2)).sum::<f64>();
    (mean, (squares / (n - 1.0)).sqrt())
}

/// The median; zero of nothing.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(0.0)
}
