//! Student-t measurement update: the noise of a fix is divided by a weight that falls with how far the fix is off.
//!
//! *Read first:* `docs/derivations/in_motion_alignment.md`, section 4 (W13-W15).
//!
//! Rows are divided by their standard deviation first, so that the noise is the identity: the weight is then one number
//! on its diagonal, and single precision keeps its digits whatever the units are.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::{Covariance, ErrorVector};
use crate::kalman::covariance::cholesky;
use crate::kalman::covariance::{resolvable_variance, rounding_reserve};
use crate::kalman::sparse_update::add_scaled;
use crate::kalman::{Innovation, Outcome};
use crate::navigation::error_state::SparseMeasurement;
use crate::scalar::{Scalar, lit};

use super::ALIGNMENT_ERRORS;

/// Iterations of weight and posterior.
const ITERATIONS: usize = 3;
/// Log odds of a gross error against any other: one fix in a hundred.
pub(super) const GROSS_LOG_ODDS: f64 = -4.6;
/// A first weight as small as this share of the one found may lead to another.
const ANOTHER_WEIGHT: f64 = 0.2;

/// What an update said.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Weighted<T: Scalar> {
    /// Innovation with the noise as stated.
    pub(super) innovation: Innovation<T>,
    /// Weight, above 0 up to 1: its noise was divided by it.
    pub(super) weight: T,
    /// Share of the stated noise in what was expected of the residual, mean of the components: near one where the state is
    /// known well.
    pub(super) noise_share: T,
    /// Log likelihood of the measurement, but for a constant.
    pub(super) log_likelihood: T,
}

/// Inverse of a lower triangle.
fn inverse_lower<T: Scalar, const M: usize>(l: &SMatrix<T, M, M>) -> SMatrix<T, M, M> {
    let mut inverse = SMatrix::<T, M, M>::zeros();
    for j in 0..M {
        inverse[(j, j)] = T::one() / l[(j, j)];
        for i in (j + 1)..M {
            let mut sum = T::zero();
            for k in j..i {
                sum += l[(i, k)] * inverse[(k, j)];
            }
            inverse[(i, j)] = -sum / l[(i, i)];
        }
    }
    inverse
}

/// Inverse of the lower factor of `predicted` and noise of one variance.
fn factor<T: Scalar, const M: usize>(
    predicted: &SMatrix<T, M, M>,
    variance: T,
) -> Option<SMatrix<T, M, M>> {
    let s = predicted + SMatrix::<T, M, M>::from_diagonal_element(variance);
    cholesky(&s).map(|l| inverse_lower(&l))
}

/// The weight at which it agrees with the residual that is expected after the update (W13, W14). Where there are two, one
/// that believes the fix and one that believes the samples, and gross errors happen, that of the likelier state.
fn weight_of<T: Scalar, const M: usize>(
    predicted: &SMatrix<T, M, M>,
    residual: &SVector<T, M>,
    dof: T,
    has_gross_errors: bool,
) -> Option<T> {
    let m = lit::<T>(M as f64);
    let (trusting, cost) = settled(predicted, residual, dof, T::one())?;
    let unmoved = (dof + m) / (dof + residual.norm_squared());
    let mut weight = trusting;
    if has_gross_errors && unmoved < trusting * lit(ANOTHER_WEIGHT) {
        let (doubting, less) = settled(predicted, residual, dof, unmoved)?;
        if less < cost {
            weight = doubting;
        }
    }
    (weight > T::zero()).then_some(weight)
}

/// The weight that is reached from `weight`, and the negative log density of the state that belongs to it (W14a).
fn settled<T: Scalar, const M: usize>(
    predicted: &SMatrix<T, M, M>,
    residual: &SVector<T, M>,
    dof: T,
    mut weight: T,
) -> Option<(T, T)> {
    let m = lit::<T>(M as f64);
    let mut cost = T::zero();
    for _ in 0..ITERATIONS {
        let inverse = factor(predicted, T::one() / weight)?;
        // S^-1 = L^-T L^-1: the residual after the update is S^-1 r / w, its covariance (I - S^-1 / w) / w.
        let solved = inverse.transpose() * (inverse * residual);
        let after = solved / weight;
        let spread = (m - inverse.norm_squared() / weight).max(T::zero()) / weight;
        weight = ((dof + m) / (dof + after.norm_squared() + spread)).min(T::one());
        let moved = solved.dot(&(predicted * solved));
        let student = (after.norm_squared() / dof).ln_1p() * (dof + m) * lit(0.5);
        // Nobody knows how far a gross error is off: its size is as probable as any other.
        let gross = after.norm_squared().max(T::one()).ln() * m * lit(0.5) - lit(GROSS_LOG_ODDS);
        cost = moved * lit(0.5) + student.min(gross);
    }
    Some((weight, cost))
}

/// Fuses a measurement into the error that is estimated so far and its covariance. `None`, and nothing changed, when
/// the innovation covariance is not positive or a number not finite.
// Not inlined: on a chip its memory is then free again for what follows.
#[inline(never)]
pub(super) fn fuse<T: Scalar, const M: usize>(
    covariance: &mut Covariance<T>,
    error: &mut ErrorVector<T>,
    measurement: &SparseMeasurement<T, M>,
    dof: T,
    has_gross_errors: bool,
) -> Option<Weighted<T>> {
    const { assert!(M <= 3) };
    let mut std = measurement.variance;
    for (std, row) in std.iter_mut().zip(&measurement.rows) {
        let spread = row.elements().iter().fold(T::zero(), |sum, (state, h)| {
            let own = covariance.get((*state, *state)).copied();
            sum + *h * *h * own.unwrap_or_else(T::zero)
        });
        *std = resolvable_variance(*std, spread)?.sqrt();
    }
    let mut projected = [[T::zero(); ALIGNMENT_ERRORS]; M];
    let mut off = measurement.residual;
    for (i, (row, out)) in measurement.rows.iter().zip(&mut projected).enumerate() {
        for (state, h) in row.elements() {
            if let Some(column) = covariance.data.0.get(*state) {
                add_scaled(out, column, *h / std[i]);
            }
        }
        off[i] -= row.dot(error.as_slice());
    }
    let residual = off.component_div(&std);
    let predicted = SMatrix::<T, M, M>::from_fn(|i, j| {
        let (row, column) = (i.min(j), i.max(j));
        measurement.rows[row].dot(&projected[column]) / std[row]
    });
    let stated = factor(&predicted, T::one())?;
    let nis = (stated * residual).norm_squared();
    if !nis.is_finite() {
        return None;
    }
    let weight = weight_of(&predicted, &residual, dof, has_gross_errors)?;
    let gain = factor(&predicted, T::one() / weight)?;
    // W = P H^T L^-T: x += W L^-1 r, P -= W W^T.
    let whitened = gain * residual;
    for i in 0..M {
        let mut column = [T::zero(); ALIGNMENT_ERRORS];
        for (k, h) in projected.iter().enumerate().take(i + 1) {
            add_scaled(&mut column, h, gain[(i, k)]);
        }
        let [error] = &mut error.data.0;
        add_scaled(error, &column, whitened[i]);
        for (j, (out, factor)) in covariance.data.0.iter_mut().zip(column).enumerate() {
            add_scaled(out, &column, -factor);
            if let Some(variance) = out.get_mut(j) {
                *variance += rounding_reserve(factor * factor);
            }
        }
    }
    // (W15)
    let mut log_likelihood = T::zero();
    for i in 0..M {
        log_likelihood += stated[(i, i)].ln() - std[i].ln();
    }
    let m = lit::<T>(M as f64);
    log_likelihood -= (dof + m) * lit(0.5) * (nis / dof).ln_1p();
    let share = (0..M).fold(T::zero(), |sum, i| {
        sum + T::one() / (T::one() + predicted[(i, i)])
    });
    Some(Weighted {
        innovation: record(&off, &predicted, &std, nis),
        weight,
        noise_share: share / m,
        log_likelihood,
    })
}

/// The record in the units of the measurement.
fn record<T: Scalar, const M: usize>(
    residual: &SVector<T, M>,
    predicted: &SMatrix<T, M, M>,
    std: &SVector<T, M>,
    nis: T,
) -> Innovation<T> {
    let mut covariance = Matrix3::zeros();
    for (i, j) in (0..M).flat_map(|i| (0..M).map(move |j| (i, j))) {
        let noise = if i == j { T::one() } else { T::zero() };
        covariance[(i, j)] = (predicted[(i, j)] + noise) * std[i] * std[j];
    }
    Innovation {
        residual: Vector3::from_fn(|i, _| residual.get(i).copied().unwrap_or_else(T::zero)),
        covariance,
        nis,
        degrees_of_freedom: M as u8,
        outcome: Outcome::Fused,
    }
}
