//! Noise coefficients from an Allan curve: weighted least squares that knows no negative variance.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;

use super::deviation::NoiseKind;

/// `2 ln 2 / pi`: the square of 0.664, by which the flat part of the curve is divided.
const FLICKER: f64 = 2.0 * std::f64::consts::LN_2 / std::f64::consts::PI;

/// Relative error of a variance that is allowed to the model: no sensor is quite its four terms.
const MODEL_ERROR: f64 = 0.05;

/// A coefficient must lower the weighted sum of squares by this much to be accepted (two standard
/// deviations).
const SIGNIFICANCE: f64 = 4.0;

/// One point of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Measured {
    pub(super) tau_s: f64,
    pub(super) variance: f64,
    pub(super) degrees_of_freedom: f64,
}

/// A coefficient and its standard deviation, in the same unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Coefficient {
    /// The value.
    pub value: f64,
    /// Its standard deviation.
    pub std: f64,
}

/// The four noises of a sensor at rest (A3), in its unit; `None` where the curve does not show one.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct NoiseCoefficients {
    /// Q, unit s: rounding of the integral; falls with slope -1.
    pub quantisation: Option<Coefficient>,
    /// N, unit/sqrt(Hz): white noise, a gyroscope's angle random walk; slope -1/2, read at 1 s.
    pub noise_density: Option<Coefficient>,
    /// B, unit: flicker of the bias; the flat part divided by 0.664.
    pub bias_instability: Option<Coefficient>,
    /// K, unit/sqrt(s): random walk of the bias; slope +1/2, read at 3 s.
    pub random_walk: Option<Coefficient>,
}

/// What each coefficient squared adds to the variance at `tau` (A3).
fn shapes(tau: f64) -> [f64; 4] {
    [3.0 / (tau * tau), 1.0 / tau, FLICKER, tau / 3.0]
}

impl NoiseCoefficients {
    fn squares(&self) -> [f64; 4] {
        let all = [
            self.quantisation,
            self.noise_density,
            self.bias_instability,
            self.random_walk,
        ];
        all.map(|c| c.map_or(0.0, |c| c.value * c.value))
    }

    /// The variance that the coefficients predict for averages over `tau` (s).
    #[must_use]
    pub fn variance(&self, tau_s: f64) -> f64 {
        dot(&self.squares(), tau_s)
    }

    /// The kind of noise that rules at `tau` (s), by the slope of the model.
    #[must_use]
    pub fn kind_at(&self, tau_s: f64) -> NoiseKind {
        let step = 1.01;
        let ratio = self.variance(tau_s * step) / self.variance(tau_s / step);
        let slope = ratio.ln() / (4.0 * f64::ln(step));
        if slope.is_finite() {
            NoiseKind::of_slope(slope)
        } else {
            NoiseKind::White
        }
    }
}

fn dot(squares: &[f64; 4], tau: f64) -> f64 {
    squares.iter().zip(shapes(tau)).map(|(c, s)| c * s).sum()
}

/// Fits the four noises to a curve; those that it does not show are `None`.
pub(super) fn fit(points: &[Measured]) -> NoiseCoefficients {
    // Weights by what the model says, not by what was measured: a value that came out low by
    // chance must not count more.
    let mut model: Vec<f64> = points.iter().map(|p| p.variance).collect();
    let mut best = NoiseCoefficients::default();
    for _ in 0..12 {
        let weights = weights(points, &model);
        let Some(found) = best_subset(points, &weights) else {
            break;
        };
        best = found;
        model = points.iter().map(|p| best.variance(p.tau_s)).collect();
    }
    best
}

/// Octaves that the curve spans: about as many independent values it has.
fn octaves(points: &[Measured]) -> f64 {
    match (points.first(), points.last()) {
        (Some(first), Some(last)) => 1.0 + (last.tau_s / first.tau_s).log2(),
        _ => 0.0,
    }
}

/// One over the standard deviation of each variance; neighbours closer than an octave share what
/// they say, as overlapping averages do.
fn weights(points: &[Measured], model: &[f64]) -> Vec<f64> {
    let octaves = |from: usize, to: usize| (points[to].tau_s / points[from].tau_s).log2();
    (0..points.len())
        .map(|i| {
            let before = if i > 0 { octaves(i - 1, i) } else { 1.0 };
            let relative = 2.0 / points[i].degrees_of_freedom + MODEL_ERROR * MODEL_ERROR;
            let variance = model[i] * model[i] * relative;
            (before.min(1.0) / variance).sqrt()
        })
        .collect()
}

/// The subset of noises that explains the curve best without a negative one (exact: there are
/// only fifteen), each worth its place.
fn best_subset(points: &[Measured], weights: &[f64]) -> Option<NoiseCoefficients> {
    let mut best = None;
    let mut least = f64::INFINITY;
    for mask in 1..16_u8 {
        let active: Vec<usize> = (0..4).filter(|i| mask & (1 << i) != 0).collect();
        let Some((coefficients, cost)) = solve(points, weights, &active) else {
            continue;
        };
        let total = cost + SIGNIFICANCE * active.len() as f64;
        if total < least {
            (best, least) = (Some(coefficients), total);
        }
    }
    best
}

/// Weighted least squares for the squares of the active coefficients; `None` when one comes out
/// negative. With the weighted sum of squares.
fn solve(
    points: &[Measured],
    weights: &[f64],
    active: &[usize],
) -> Option<(NoiseCoefficients, f64)> {
    // Columns are scaled to length one: the shapes differ by many powers of ten.
    let mut design = DMatrix::from_fn(points.len(), active.len(), |i, j| {
        shapes(points[i].tau_s)[active[j]] * weights[i]
    });
    let scales: Vec<f64> = design.column_iter().map(|c| c.norm()).collect();
    for (mut column, scale) in design.column_iter_mut().zip(&scales) {
        column /= *scale;
    }
    let target = DVector::from_iterator(
        points.len(),
        points.iter().zip(weights).map(|(p, w)| p.variance * w),
    );
    let inverse = (design.transpose() * &design).cholesky()?.inverse();
    let solution = &inverse * design.transpose() * &target;
    let cost = (&design * &solution - &target).norm_squared();
    // Where the four noises explain the curve badly, their coefficients are less certain (A7).
    let independent = (octaves(points) - active.len() as f64).max(1.0);
    let misfit = (cost / independent).max(1.0).sqrt();
    let mut found = [None; 4];
    for (j, index) in active.iter().enumerate() {
        let square = solution[j] / scales[j];
        if !(square > 0.0 && cost.is_finite()) {
            return None;
        }
        let value = square.sqrt();
        let std = misfit * inverse[(j, j)].sqrt() / scales[j] / (2.0 * value);
        found[*index] = Some(Coefficient { value, std });
    }
    let [quantisation, noise_density, bias_instability, random_walk] = found;
    let coefficients = NoiseCoefficients {
        quantisation,
        noise_density,
        bias_instability,
        random_walk,
    };
    Some((coefficients, cost))
}
