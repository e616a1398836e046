//! Sampling clock of a sensor: rate, jitter, latency, lost samples.

use rand::RngExt as _;
use serde::{Deserialize, Serialize};

use crate::random::{Stream, standard_normal, stream};

/// The timing of a sensor. A file that has this table must say the rate; the rest defaults to a
/// perfect clock.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sampling {
    /// Samples per second, Hz. Zero switches the sensor off.
    pub rate_hz: f64,
    /// Instant of the first sample, s. Default 0.
    #[serde(default)]
    pub start_offset_s: f64,
    /// Scatter of the sampling instants about the regular ones, standard deviation, s; at most 45 %
    /// of an interval is used, so that samples stay in order. Stamps tell the true instant.
    /// Default 0.
    #[serde(default)]
    pub jitter_std_s: f64,
    /// How much later than the measured instant the stamp is, s: what a device does that filters
    /// its samples or stamps them on arrival. Default 0.
    #[serde(default)]
    pub delay_s: f64,
    /// Probability that a sample is lost. Default 0.
    #[serde(default)]
    pub dropout_probability: f64,
}

impl Sampling {
    /// Perfectly regular samples at this rate, Hz.
    #[must_use]
    pub const fn at_rate(rate_hz: f64) -> Self {
        Self {
            rate_hz,
            start_offset_s: 0.0,
            jitter_std_s: 0.0,
            delay_s: 0.0,
            dropout_probability: 0.0,
        }
    }

    /// Time between two samples, s.
    #[must_use]
    pub fn interval_s(&self) -> f64 {
        1.0 / self.rate_hz
    }
}

/// One sampling instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tick {
    /// When the quantity is measured, s.
    pub measured_s: f64,
    /// What the stamp says, s.
    pub stamp_s: f64,
    /// Whether the sample gets lost.
    pub dropped: bool,
}

/// The endless row of sampling instants of one sensor. Two clocks of the same seed, name and
/// sampling tick together. Jitter and dropouts have random streams of their own: turning them on
/// leaves the sensor's noise as it was.
#[derive(Debug, Clone)]
pub struct SampleClock {
    sampling: Sampling,
    jitter: Stream,
    dropout: Stream,
    count: u64,
}

impl SampleClock {
    /// The clock of the sensor called `name`. The rate must be positive.
    #[must_use]
    pub fn new(seed: u64, name: &str, sampling: &Sampling) -> Self {
        Self {
            sampling: *sampling,
            jitter: stream(seed, &format!("{name}/timing/jitter")),
            dropout: stream(seed, &format!("{name}/timing/dropout")),
            count: 0,
        }
    }

    /// The next instant.
    pub fn tick(&mut self) -> Tick {
        let sampling = &self.sampling;
        // Counted, not summed: no drift over long recordings.
        let mut measured_s = sampling.start_offset_s + self.count as f64 / sampling.rate_hz;
        self.count += 1;
        if sampling.jitter_std_s > 0.0 {
            let most = 0.45 / sampling.rate_hz;
            let scatter = sampling.jitter_std_s * standard_normal(&mut self.jitter);
            measured_s += scatter.clamp(-most, most);
        }
        let dropped = sampling.dropout_probability > 0.0
            && self.dropout.random::<f64>() < sampling.dropout_probability;
        Tick {
            measured_s,
            stamp_s: measured_s + sampling.delay_s,
            dropped,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ticks(sampling: &Sampling, n: usize) -> Vec<Tick> {
        let mut clock = SampleClock::new(1, "gyroscope", sampling);
        (0..n).map(|_| clock.tick()).collect()
    }

    #[test]
    fn a_regular_clock_is_regular_late_by_its_delay_and_does_not_drift() {
        let sampling = Sampling {
            start_offset_s: 0.25,
            delay_s: 0.03,
            ..Sampling::at_rate(100.0)
        };
        let ticks = ticks(&sampling, 1_000_001);
        assert!((ticks[0].measured_s - 0.25).abs() < 1e-15);
        assert!((ticks[1_000_000].measured_s - 10_000.25).abs() < 1e-9);
        assert!((ticks[7].stamp_s - ticks[7].measured_s - 0.03).abs() < 1e-15);
        assert!(ticks.iter().all(|tick| !tick.dropped));
    }

    #[test]
    fn jitter_scatters_as_asked_and_keeps_the_order() {
        let sampling = Sampling {
            jitter_std_s: 0.001,
            ..Sampling::at_rate(100.0)
        };
        let few = ticks(&sampling, 20_000);
        let squares = few.iter().enumerate();
        let sum: f64 = squares
            .map(|(i, tick)| (tick.measured_s - i as f64 / 100.0).powi(2))
            .sum();
        let std = (sum / 20_000.0).sqrt();
        assert!((std / 0.001 - 1.0).abs() < 0.03, "{std}");

        let wild = Sampling {
            jitter_std_s: 0.1,
            ..sampling
        };
        let wild = ticks(&wild, 20_000);
        assert!(wild.windows(2).all(|w| w[0].measured_s < w[1].measured_s));
    }

    #[test]
    fn dropouts_happen_as_often_as_asked_and_move_nothing() {
        let lossy = Sampling {
            dropout_probability: 0.05,
            jitter_std_s: 0.001,
            ..Sampling::at_rate(100.0)
        };
        let whole = Sampling {
            dropout_probability: 0.0,
            ..lossy
        };
        let (lossy, whole) = (ticks(&lossy, 100_000), ticks(&whole, 100_000));
        let dropped = lossy.iter().filter(|tick| tick.dropped).count();
        // Standard deviation sqrt(n p (1 - p)) = 69.
        assert!(dropped.abs_diff(5000) < 280, "{dropped}");
        assert!(
            lossy
                .iter()
                .zip(&whole)
                .all(|(a, b)| a.stamp_s.to_bits() == b.stamp_s.to_bits())
        );
    }
}
