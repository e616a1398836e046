//! Allan deviation of a sensor at rest: which noise rules at which averaging time, in numbers and
//! in words, and what a filter's Q should be.
//!
//! Read first: `docs/derivations/allan_deviation.md` (A1-A8); IEEE Std 952 for gyroscopes; Riley &
//! Howe (2008, NIST SP 1065) for the estimator and its confidence.
//!
//! Use it on a recording of a device that lies still: ten minutes show the white noise well and the
//! floor roughly, an hour shows how the bias walks. Do not use it on a device in the hand.
//!
//! ```text
//! variance(tau) = 1/2 mean((mean of tau - mean of the tau before)^2), overlapping          (A2)
//! variance(tau) = 3 Q^2/tau^2 + N^2/tau + (2 ln 2/pi) B^2 + K^2 tau/3                      (A3)
//! ```
//!
//! Samples are put on a regular grid: short gaps are filled on a straight line, a long one cuts the
//! record, and both are said.

use nalgebra::Vector3;
use northing_core::attitude::AttitudeConfig;
use northing_recording::SensorKind;
use serde::Serialize;

mod config;
mod deviation;
mod error;
mod fit;
mod samples;
mod words;

pub use config::AllanConfig;
pub use deviation::NoiseKind;
use deviation::{cluster_sizes, integral, interval, overlapping_variance};
pub use error::AllanError;
use fit::Measured;
pub use fit::{Coefficient, NoiseCoefficients};
pub use samples::RestSamples;

/// A deviation is trusted while its upper bound is at most this many times the value.
const TRUSTED_RATIO: f64 = 1.5;

/// The unit of a sensor; empty for what is not analysed.
pub(crate) const fn unit(sensor: SensorKind) -> &'static str {
    match sensor {
        SensorKind::Gyroscope => "rad/s",
        SensorKind::Accelerometer => "m/s^2",
        SensorKind::Magnetometer | SensorKind::MagnetometerUncalibrated => "uT",
        _ => "",
    }
}

/// One point of the curve: root mean square of the three axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct AllanPoint {
    /// Averaging time, s.
    pub tau_s: f64,
    /// Samples averaged.
    pub cluster_samples: usize,
    /// Allan deviation, unit of the sensor.
    pub deviation: f64,
    /// Lower bound of the true deviation.
    pub lower: f64,
    /// Upper bound.
    pub upper: f64,
    /// The deviation of each axis.
    pub axis_deviations: [f64; 3],
    /// Equivalent degrees of freedom: of how many independent squares it is the mean.
    pub degrees_of_freedom: f64,
    /// What rules at this averaging time.
    pub kind: NoiseKind,
}

/// The lowest point of the part of the curve that can be trusted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Floor {
    /// Averaging time, s.
    pub tau_s: f64,
    /// Allan deviation there, unit of the sensor.
    pub deviation: f64,
    /// Whether the curve rises, or stays, after it; otherwise the record only ends there.
    pub is_reached: bool,
}

/// What a rest tells about a sensor's noise.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct AllanReport {
    /// The sensor.
    pub sensor: SensorKind,
    /// Its unit: that of deviations and of the bias instability.
    pub unit: &'static str,
    /// Length of the piece analysed, s.
    pub duration_s: f64,
    /// Its mean sample rate, Hz.
    pub rate_hz: f64,
    /// Samples analysed, those filled in included.
    pub samples: usize,
    /// Samples that were missing and are filled in.
    pub filled_samples: usize,
    /// Samples ignored: not finite, or not later than the one before.
    pub ignored_samples: usize,
    /// The curve.
    pub curve: Vec<AllanPoint>,
    /// The noises, root mean square of the axes.
    pub coefficients: NoiseCoefficients,
    /// The noises of each axis.
    pub axis_coefficients: [NoiseCoefficients; 3],
    /// The lowest trusted point.
    pub floor: Floor,
    /// Longest averaging time at which the curve can be trusted, s: the upper bound is at most 1.5
    /// times the value.
    pub trusted_tau_s: f64,
    /// Largest factor by which curve and model differ where the curve is trusted.
    pub worst_misfit: f64,
    /// All of this in words, the most important first.
    pub sentences: Vec<String>,
}

/// Analyses what was gathered from a device at rest.
///
/// # Errors
/// [`AllanError`]: too short, moved, shaken, constant, too many samples missing, bad settings.
pub fn analyze(samples: &RestSamples, config: &AllanConfig) -> Result<AllanReport, AllanError> {
    config.check()?;
    let regular = samples.regular(config)?;
    let count = regular.axes[0].len();
    let sizes = cluster_sizes(count, config.points_per_decade);
    let integrals = regular.axes.each_ref().map(|axis| integral(axis));
    let variances: Vec<[f64; 3]> = sizes
        .iter()
        .map(|m| integrals.each_ref().map(|x| overlapping_variance(x, *m)))
        .collect();
    let series = Series {
        interval_s: regular.interval_s,
        count,
        sizes,
        variances,
    };
    let axis_coefficients = [0, 1, 2].map(|axis| series.fit(|v| v[axis], 1.0));
    let coefficients = series.fit(mean, 3.0);
    let curve = series.curve(&coefficients, config.confidence);
    let trusted_tau_s = trusted_tau(&curve);
    let mut report = AllanReport {
        sensor: samples.sensor(),
        unit: unit(samples.sensor()),
        duration_s: regular.interval_s * count as f64,
        rate_hz: 1.0 / regular.interval_s,
        samples: count,
        filled_samples: regular.filled,
        ignored_samples: samples.ignored(),
        floor: floor(&curve, trusted_tau_s),
        worst_misfit: worst_misfit(&curve, &coefficients, trusted_tau_s),
        curve,
        coefficients,
        axis_coefficients,
        trusted_tau_s,
        sentences: Vec::new(),
    };
    report.sentences = words::sentences(&report, &regular);
    Ok(report)
}

impl AllanReport {
    /// Writes the noise into a filter's settings and says in words what was written, or why not.
    ///
    /// A gyroscope's N becomes `gyroscope_noise_density`. The bias walk is K where the curve rises;
    /// where it only flattens, the walk whose line meets the floor where the floor begins (A8): a
    /// filter knows no flicker. Where the record ends before either, the setting is left alone.
    pub fn fill(&self, config: &mut AttitudeConfig<f64>) -> Vec<String> {
        if self.sensor != SensorKind::Gyroscope {
            return vec![format!(
                "The settings are unchanged: Q comes from a gyroscope, not from the {}.",
                self.sensor.name()
            )];
        }
        let mut said = Vec::new();
        if let Some(n) = self.coefficients.noise_density {
            config.gyroscope_noise_density = n.value;
            said.push(format!(
                "gyroscope_noise_density = {:.3e} rad/s/sqrt(Hz), from the white noise.",
                n.value
            ));
        } else {
            said.push("gyroscope_noise_density is unchanged: no white noise is seen.".to_owned());
        }
        match self.bias_random_walk() {
            Some(walk) => {
                config.gyroscope_bias_random_walk = walk;
                let source = if self.coefficients.random_walk.is_some() {
                    "from the rise of the curve"
                } else {
                    "the walk that meets the flat part where it begins"
                };
                said.push(format!(
                    "gyroscope_bias_random_walk = {walk:.3e} rad/s/sqrt(s), {source}."
                ));
            }
            None => said.push(format!(
                "gyroscope_bias_random_walk is unchanged ({:.3e} rad/s/sqrt(s)): the record ends before the \
                 bias shows.",
                config.gyroscope_bias_random_walk
            )),
        }
        said
    }

    /// Random walk of the bias for a filter, unit/sqrt(s) (A8).
    #[must_use]
    pub fn bias_random_walk(&self) -> Option<f64> {
        if let Some(k) = self.coefficients.random_walk {
            return Some(k.value);
        }
        self.coefficients.bias_instability?;
        let begins = self
            .curve
            .iter()
            .find(|point| point.kind == NoiseKind::BiasInstability)?;
        Some(begins.deviation * (3.0 / begins.tau_s).sqrt())
    }

    /// The trusted part of the curve.
    pub fn trusted(&self) -> impl Iterator<Item = &AllanPoint> {
        self.curve
            .iter()
            .filter(|point| point.tau_s <= self.trusted_tau_s)
    }
}

/// Variances of the three axes at each cluster size.
struct Series {
    interval_s: f64,
    count: usize,
    sizes: Vec<usize>,
    variances: Vec<[f64; 3]>,
}

impl Series {
    fn tau_s(&self, m: usize) -> f64 {
        m as f64 * self.interval_s
    }

    /// The noises of one axis, or of the mean of `axes` of them: first with the degrees of freedom
    /// of white noise, then with those of what was found.
    fn fit(&self, pick: impl Fn(&[f64; 3]) -> f64, axes: f64) -> NoiseCoefficients {
        let mut coefficients = NoiseCoefficients::default();
        for round in 0..3 {
            let points: Vec<Measured> = self
                .sizes
                .iter()
                .zip(&self.variances)
                .map(|(m, variances)| {
                    let tau_s = self.tau_s(*m);
                    let kind = if round == 0 {
                        NoiseKind::White
                    } else {
                        coefficients.kind_at(tau_s)
                    };
                    Measured {
                        tau_s,
                        variance: pick(variances),
                        degrees_of_freedom: axes * kind.degrees_of_freedom(self.count, *m),
                    }
                })
                .filter(|point| point.variance > 0.0)
                .collect();
            coefficients = fit::fit(&points);
        }
        coefficients
    }

    fn curve(&self, coefficients: &NoiseCoefficients, confidence: f64) -> Vec<AllanPoint> {
        let points = self.sizes.iter().zip(&self.variances);
        points
            .map(|(m, variances)| {
                let tau_s = self.tau_s(*m);
                let kind = coefficients.kind_at(tau_s);
                let one = kind.degrees_of_freedom(self.count, *m);
                // Axes of unequal noise count for fewer than three (A6).
                let squares: f64 = variances.iter().map(|v| v * v).sum();
                let axes = (3.0 * mean(variances)).powi(2) / squares.max(f64::MIN_POSITIVE);
                let degrees_of_freedom = one * axes.max(1.0);
                let deviation = mean(variances).sqrt();
                let [low, high] = interval(degrees_of_freedom, confidence);
                AllanPoint {
                    tau_s,
                    cluster_samples: *m,
                    deviation,
                    lower: deviation * low,
                    upper: deviation * high,
                    axis_deviations: variances.map(f64::sqrt),
                    degrees_of_freedom,
                    kind,
                }
            })
            .collect()
    }
}

fn mean(variances: &[f64; 3]) -> f64 {
    Vector3::from(*variances).mean()
}

fn trusted_tau(curve: &[AllanPoint]) -> f64 {
    let trusted = curve
        .iter()
        .take_while(|point| point.upper <= TRUSTED_RATIO * point.deviation);
    let first = curve.first().map_or(0.0, |point| point.tau_s);
    trusted.last().map_or(first, |point| point.tau_s)
}

fn floor(curve: &[AllanPoint], trusted_tau_s: f64) -> Floor {
    let trusted = || curve.iter().filter(|point| point.tau_s <= trusted_tau_s);
    let lowest = trusted().min_by(|a, b| a.deviation.total_cmp(&b.deviation));
    lowest.map_or(
        Floor {
            tau_s: 0.0,
            deviation: 0.0,
            is_reached: false,
        },
        |lowest| Floor {
            tau_s: lowest.tau_s,
            deviation: lowest.deviation,
            is_reached: trusted().any(|point| {
                matches!(
                    point.kind,
                    NoiseKind::BiasInstability | NoiseKind::RandomWalk
                )
            }),
        },
    )
}

fn worst_misfit(curve: &[AllanPoint], model: &NoiseCoefficients, trusted_tau_s: f64) -> f64 {
    let trusted = curve.iter().filter(|point| point.tau_s <= trusted_tau_s);
    let misfits = trusted.map(|point| {
        let ratio = point.deviation / model.variance(point.tau_s).sqrt();
        ratio.max(1.0 / ratio)
    });
    misfits.fold(1.0, f64::max)
}

#[cfg(test)]
mod tests;
