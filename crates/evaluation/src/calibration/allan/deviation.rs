//! The overlapping Allan variance of a regular series, and how certain it is.

use statrs::distribution::{ChiSquared, ContinuousCDF as _};

/// Numbers of samples to average over, evenly spaced on a log scale, up to a quarter of the record.
pub(super) fn cluster_sizes(samples: usize, per_decade: usize) -> Vec<usize> {
    let longest = samples / 4;
    let step = 10_f64.powf(1.0 / per_decade as f64);
    let mut sizes = Vec::new();
    let mut size = 1.0_f64;
    while size.round() as usize <= longest {
        sizes.push(size.round() as usize);
        size *= step;
    }
    sizes.dedup();
    sizes
}

/// The running sum of the deviations from the mean, one more than there are values: the angle, if
/// the values are rates, in units of the sample interval.
pub(super) fn integral(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    let mut sum = 0.0;
    let mut sums = Vec::with_capacity(values.len() + 1);
    sums.push(0.0);
    for value in values {
        sum += value - mean;
        sums.push(sum);
    }
    sums
}

/// The overlapping Allan variance of averages over `m` samples (A2), from their [`integral`].
pub(super) fn overlapping_variance(integral: &[f64], m: usize) -> f64 {
    let squares = integral
        .windows(2 * m + 1)
        .map(|x| (x[2 * m] - 2.0 * x[m] + x[0]).powi(2));
    let count = integral.len() - 2 * m;
    squares.sum::<f64>() / (2.0 * (m * m * count) as f64)
}

/// What kind of noise the curve shows at one averaging time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
#[serde(rename_all = "kebab-case")]
pub enum NoiseKind {
    /// The integral is rounded: slope -1.
    Quantisation,
    /// White noise: slope -1/2.
    White,
    /// Flicker of the bias: flat.
    BiasInstability,
    /// The bias walks: slope +1/2.
    RandomWalk,
}

impl NoiseKind {
    /// The kind whose slope on the log-log plot is nearest.
    pub(super) fn of_slope(slope: f64) -> Self {
        match slope {
            s if s < -0.75 => Self::Quantisation,
            s if s < -0.25 => Self::White,
            s if s < 0.25 => Self::BiasInstability,
            _ => Self::RandomWalk,
        }
    }

    /// Equivalent degrees of freedom of the overlapping variance of `samples` values averaged over
    /// `m` (A5; Stein 1985, in NIST SP 1065 table 5).
    pub(super) fn degrees_of_freedom(self, samples: usize, m: usize) -> f64 {
        let (n, m) = ((samples + 1) as f64, m as f64);
        let degrees = match self {
            Self::Quantisation => (n + 1.0) * (n - 2.0 * m) / (2.0 * (n - m)),
            Self::White => {
                (1.5 * (n - 1.0) / m - 2.0 * (n - 2.0) / n) * 4.0 * m * m / (4.0 * m * m + 5.0)
            }
            Self::BiasInstability if m < 1.5 => 2.0 * (n - 2.0).powi(2) / (2.3 * n - 4.9),
            Self::BiasInstability => 5.0 * n * n / (4.0 * m * (n + 3.0 * m)),
            Self::RandomWalk => {
                let shape = (n - 1.0).powi(2) - 3.0 * m * (n - 1.0) + 4.0 * m * m;
                (n - 2.0) / m * shape / (n - 3.0).powi(2)
            }
        };
        degrees.max(1.0)
    }
}

/// Factors by which a deviation with these degrees of freedom may be too high and too low: its
/// interval of the given confidence is `[deviation * low, deviation * high]` (A4).
pub(super) fn interval(degrees: f64, confidence: f64) -> [f64; 2] {
    let tail = (1.0 - confidence) / 2.0;
    ChiSquared::new(degrees).map_or([0.0, f64::INFINITY], |chi| {
        [1.0 - tail, tail].map(|p| (degrees / chi.inverse_cdf(p)).sqrt())
    })
}
