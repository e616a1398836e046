//! How long a sample takes through the lab: from the arrival of its batch to the page's frame.

use std::sync::Mutex;

use serde::Serialize;

use crate::lab::lock;

/// Bins for each factor of ten, and the shortest time that has one, ms.
const PER_DECADE: f64 = 32.0;
const SHORTEST_MS: f64 = 1e-3;
/// Up to 10^8 ms, in constant memory.
const BINS: usize = 11 * 32;

/// Times, counted in logarithmic bins: quantiles to 4 %.
#[derive(Debug)]
pub struct Latency(Mutex<Counts>);

#[derive(Debug)]
struct Counts {
    bins: [u64; BINS],
    frames: u64,
    longest_ms: f64,
}

/// What the times come to; everything is 0 without frames.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct LatencySummary {
    /// Frames counted.
    pub frames: u64,
    /// Half of them took at most this, ms.
    pub median_ms: f64,
    /// All but one of a hundred took at most this, ms.
    pub p99_ms: f64,
    /// The longest, ms.
    pub longest_ms: f64,
}

impl Default for Latency {
    fn default() -> Self {
        Self(Mutex::new(Counts {
            bins: [0; BINS],
            frames: 0,
            longest_ms: 0.0,
        }))
    }
}

impl Latency {
    /// Counts a frame that was sent so long after the samples in it came.
    pub fn note_ns(&self, ns: i64) {
        let ms = ns.max(0) as f64 * 1e-6;
        let bin = ((ms.max(SHORTEST_MS) / SHORTEST_MS).log10() * PER_DECADE) as usize;
        let mut counts = lock(&self.0);
        if let Some(count) = counts.bins.get_mut(bin.min(BINS - 1)) {
            *count += 1;
        }
        counts.frames += 1;
        counts.longest_ms = counts.longest_ms.max(ms);
    }

    /// What the times come to.
    #[must_use]
    pub fn summary(&self) -> LatencySummary {
        let counts = lock(&self.0);
        let quantile = |share: f64| {
            let wanted = share * counts.frames as f64;
            let mut below = 0.0;
            let bin = counts.bins.iter().position(|count| {
                below += *count as f64;
                below > 0.0 && below >= wanted
            });
            bin.map_or(0.0, |bin| {
                SHORTEST_MS * 10_f64.powf((bin as f64 + 0.5) / PER_DECADE)
            })
        };
        LatencySummary {
            frames: counts.frames,
            median_ms: quantile(0.5),
            p99_ms: quantile(0.99),
            longest_ms: counts.longest_ms,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_those_of_the_times() {
        let latency = Latency::default();
        assert_eq!(latency.summary().frames, 0);
        assert!(latency.summary().median_ms.abs() < 1e-12);
        for k in 1..=1000 {
            latency.note_ns(k * 10_000);
        }
        latency.note_ns(-5);
        let summary = latency.summary();
        assert_eq!(summary.frames, 1001);
        assert!((summary.median_ms / 5.0 - 1.0).abs() < 0.05, "{summary:?}");
        assert!((summary.p99_ms / 9.9 - 1.0).abs() < 0.05, "{summary:?}");
        assert!((summary.longest_ms - 10.0).abs() < 1e-9);
    }
}
