//! Gains that are tried, and the choice among them: the least error over one half of the data.

use northing_core::attitude::complementary::ComplementaryForm;
use northing_simulation::scenario::flight_schema::Metric;
use rayon::prelude::*;

use super::data::ObserverData;
use super::schemes::{self, Form, Gains, Score};
use northing_evaluation::EvaluationError;

/// The values of each gain that are tried, all combinations of those that a scheme has.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// `k_P`, 1/s.
    pub attitude_gains: Vec<f64>,
    /// `k_I`, 1/s^2.
    pub bias_gains: Vec<f64>,
    /// Weights of the accelerometer in the explicit form beside 1, tried for the re-weighted original.
    pub accelerometer_weights: Vec<f64>,
    /// Accelerations that the EKF expects, m/s^2.
    pub linear_acceleration_stds: Vec<f64>,
    /// Errors of the field beside its noise, microtesla.
    pub field_stds: Vec<f64>,
}

/// The scheme that is tuned.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scheme {
    /// The explicit filter, both vectors with the same weight.
    Original,
    /// The explicit filter, the accelerometer's weight tuned too.
    OriginalWeighted,
    /// Passive behind the EKF.
    Modified,
    /// The EKF alone.
    Ekf,
}

impl Scheme {
    /// Every scheme.
    pub const ALL: [Self; 4] = [
        Self::Original,
        Self::OriginalWeighted,
        Self::Modified,
        Self::Ekf,
    ];
}

/// How the errors of flights, or recordings, become one number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Aggregate {
    /// Root of the mean square: flights of one condition are alike.
    RootMeanSquare,
    /// Mean: recordings differ, and the worst is not to decide alone.
    Mean,
}

impl Aggregate {
    /// One number of many errors.
    #[must_use]
    pub fn of(self, errors: &[f64]) -> f64 {
        let n = errors.len().max(1) as f64;
        match self {
            Self::RootMeanSquare => (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt(),
            Self::Mean => errors.iter().sum::<f64>() / n,
        }
    }
}

/// All combinations for a scheme; those of the EKF vary slowest.
#[must_use]
pub fn candidates(grid: &Grid, scheme: Scheme) -> Vec<Gains> {
    let one = [1.0];
    let keep = [0.0];
    let (attitude, bias): (&[f64], &[f64]) = match scheme {
        Scheme::Ekf => (&one, &keep),
        _ => (&grid.attitude_gains, &grid.bias_gains),
    };
    let weights: &[f64] = match scheme {
        Scheme::OriginalWeighted => &grid.accelerometer_weights,
        _ => &one,
    };
    let (forces, fields): (&[f64], &[f64]) = match scheme {
        Scheme::Modified | Scheme::Ekf => (&grid.linear_acceleration_stds, &grid.field_stds),
        // They do not matter to a filter of fixed gains.
        _ => (&grid.linear_acceleration_stds[..1], &grid.field_stds[..1]),
    };
    let mut all = Vec::new();
    for &linear_acceleration_std in forces {
        for &field_std in fields {
            for &attitude_gain in attitude {
                for &bias_gain in bias {
                    for &accelerometer_weight in weights {
                        all.push(Gains {
                            attitude_gain,
                            bias_gain,
                            accelerometer_weight,
                            linear_acceleration_std,
                            field_std,
                        });
                    }
                }
            }
        }
    }
    all
}

/// The scores of a scheme with each of several gains over one flight or recording.
///
/// # Errors
/// Gains that are invalid.
pub fn scores(
    data: &ObserverData,
    scheme: Scheme,
    form: Form,
    all: &[Gains],
) -> Result<Vec<Score>, EvaluationError> {
    let mut reconstructed: Option<(Gains, Vec<schemes::Estimate>)> = None;
    let mut scores = Vec::with_capacity(all.len());
    for gains in all {
        let estimates = match scheme {
            Scheme::Original | Scheme::OriginalWeighted => {
                schemes::original(data, ComplementaryForm::Explicit, gains, form)?
            }
            Scheme::Ekf => schemes::ekf(data, gains, form)?,
            Scheme::Modified => {
                let same = |g: &Gains| {
                    g.linear_acceleration_std.to_bits() == gains.linear_acceleration_std.to_bits()
                        && g.field_std.to_bits() == gains.field_std.to_bits()
                };
                let (_, ekf) = match reconstructed.take() {
                    Some(kept) if same(&kept.0) => reconstructed.insert(kept),
                    _ => reconstructed.insert((*gains, schemes::ekf(data, gains, form)?)),
                };
                schemes::modified(data, ekf, gains, form)?
            }
        };
        scores.push(schemes::score(data, &estimates)?);
    }
    Ok(scores)
}

/// The gains with the least error over `data`. Positions do not take part.
///
/// # Errors
/// As [`scores`].
pub fn best(
    data: &[ObserverData],
    scheme: Scheme,
    form: Form,
    grid: &Grid,
    metric: Metric,
    aggregate: Aggregate,
) -> Result<Gains, EvaluationError> {
    let all = candidates(grid, scheme);
    let tables: Result<Vec<Vec<Score>>, _> = data
        .par_iter()
        .map(|one| {
            let attitude_only = ObserverData {
                position: None,
                ..one.clone()
            };
            scores(&attitude_only, scheme, form, &all)
        })
        .collect();
    let tables = tables?;
    let error = |i: usize| {
        let errors: Vec<f64> = tables.iter().map(|t| t[i].of(metric)).collect();
        aggregate.of(&errors)
    };
    let indices = 0..all.len();
    let best = indices.min_by(|a, b| error(*a).total_cmp(&error(*b)));
    Ok(all[best.unwrap_or(0)])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        Grid {
            attitude_gains: vec![0.1, 1.0],
            bias_gains: vec![0.0, 0.1, 0.3],
            accelerometer_weights: vec![0.1, 1.0],
            linear_acceleration_stds: vec![0.5, 1.0, 2.0],
            field_stds: vec![0.0],
        }
    }

    #[test]
    fn each_scheme_tries_what_it_has() {
        let count = |scheme| candidates(&grid(), scheme).len();
        assert_eq!(Scheme::ALL.map(count), [6, 12, 18, 3]);
    }

    #[test]
    fn root_mean_square_and_mean_are_what_they_say() {
        let errors = [3.0, 4.0];
        assert!((Aggregate::RootMeanSquare.of(&errors) - 12.5_f64.sqrt()).abs() < 1e-12);
        assert!((Aggregate::Mean.of(&errors) - 3.5).abs() < 1e-12);
    }
}
