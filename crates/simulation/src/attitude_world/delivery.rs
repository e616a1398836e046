//! How samples reach a filter: jitter of their stamps, bursts, holes.

use serde::Serialize;

use crate::signals::Draws;

/// Samples that are delivered several at once.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Bursts {
    /// How many.
    pub samples: usize,
    /// Whether all of a burst have one stamp, that of the last; else those of their arrival, a tenth of a millisecond
    /// apart.
    pub one_stamp: bool,
}

/// What happens to samples on their way.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Delivery {
    /// Standard deviation of stamps, as a part of the interval between samples.
    pub jitter: f64,
    /// Samples that are delivered together.
    pub bursts: Option<Bursts>,
    /// From when until when no sensor delivers, s.
    pub holes: Vec<[f64; 2]>,
}

impl Bursts {
    pub(super) fn draw(draws: &mut Draws) -> Self {
        Self {
            samples: draws.one_of(&[2, 3, 4, 5, 6, 8]),
            one_stamp: draws.chance(0.5),
        }
    }
}

impl Delivery {
    /// A benign one.
    pub(super) fn draw(draws: &mut Draws) -> Self {
        Self {
            jitter: draws.log_uniform(1e-4, 0.02),
            bursts: None,
            holes: Vec::new(),
        }
    }

    /// Stamps (ns) of samples that were taken at these instants (s), in order.
    pub(super) fn stamps(&self, times_s: &[f64], interval_s: f64, draws: &mut Draws) -> Vec<i64> {
        let jittered = |time_s: &f64| {
            // Stamps stay in order, whatever is drawn.
            let jitter = (self.jitter * draws.normal()).clamp(-0.48, 0.48);
            time_s + jitter * interval_s
        };
        let mut stamps: Vec<f64> = times_s.iter().map(jittered).collect();
        if let Some(bursts) = self.bursts {
            for burst in stamps.chunks_mut(bursts.samples) {
                let arrival = burst.last().copied().unwrap_or_default();
                for (k, stamp) in burst.iter_mut().enumerate() {
                    let apart = if bursts.one_stamp { 0.0 } else { 1e-4 };
                    *stamp = arrival + apart * k as f64;
                }
            }
        }
        stamps.iter().map(|s| (s * 1e9).round() as i64).collect()
    }
}
