//! Fusing measurements of few states: gate, scalar updates in place, and the side states with them.
//!
//! *Read first:* `docs/derivations/error_state.md`, section 7 (E15-E17).
//!
//! A row has elements for the 15 errors (0 to 14) and for the [`SideStates`] (from [`SIDE`] on). The gate looks
//! at all rows at once; then they are fused one after the other, which equals the joint update exactly. When the
//! gate has refused too often, the states that the measurement sees directly are set free first (E17): the
//! filter was wrong, not the sensor.

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use super::ErrorStateFilter;
use crate::geometry::{rotation, so3};
use crate::kalman::covariance::{cap_variance, mirror_upper, normalized_square};
use crate::kalman::sparse_update::SparseRow;
use crate::kalman::{CountedGate, GateDecision, Innovation, Outcome, SkipReason};
use crate::navigation::bias_wander::{BiasAtRest, WanderSettings};
use crate::navigation::side_states::{SIDE_STATES, SideStates};
use crate::navigation::{ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS, STATES};
use crate::scalar::{Scalar, lit};

/// Most elements of a row: velocity, attitude, gyroscope bias, two mount angles, and one to spare.
pub const ROW_ELEMENTS: usize = 12;
/// Index of the first side state in a row.
pub const SIDE: usize = STATES;
/// How many measurements in a row a gate refuses before it believes them.
pub const REJECTIONS_BELIEVED: u8 = 5;

/// Least variance of a side state in use.
const LEAST_SIDE_VARIANCE: f64 = 1e-14;

/// Largest variances of attitude (rad^2), velocity, position, accelerometer and gyroscope bias: beyond them
/// nothing is known.
const LARGEST_VARIANCES: [f64; 5] = [10.0, 1e5, 1e8, 1e2, 1.0];

/// A row over the 15 errors and the side states.
pub type Row<T> = SparseRow<T, ROW_ELEMENTS>;

/// A measurement of up to three components, ready to be fused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Measurement<T: Scalar, const M: usize> {
    /// What each component sees.
    pub rows: [Row<T>; M],
    /// Measured minus predicted.
    pub residual: SVector<T, M>,
    /// Variance of each component's noise, above zero.
    pub variance: SVector<T, M>,
    /// The state, of the 15 errors or beside them, that is set free when the gate has refused too often, a component each.
    pub freed: [usize; M],
}

/// `P H^T` for one row.
struct Projected<T: Scalar> {
    error: SVector<T, STATES>,
    side: SVector<T, SIDE_STATES>,
}

impl<T: Scalar> Projected<T> {
    fn of(row: &Row<T>, p: &SMatrix<T, STATES, STATES>, side: &SideStates<T>) -> Self {
        let mut error = SVector::<T, STATES>::zeros();
        let mut beside = SVector::<T, SIDE_STATES>::zeros();
        for (state, h) in row.elements() {
            if *state < SIDE {
                // The upper triangle alone is kept up between the rows of a measurement.
                for (i, sum) in error.iter_mut().enumerate() {
                    let element = p.get((i.min(*state), i.max(*state)));
                    *sum += *h * element.copied().unwrap_or_else(T::zero);
                }
                for j in (0..SIDE_STATES).filter(|j| side.is_used(*j)) {
                    beside[j] += *h * side.cross.get((*state, j)).copied().unwrap_or_else(T::zero);
                }
            } else if side.is_used(state - SIDE) && state - SIDE < SIDE_STATES {
                error.axpy(*h, &side.cross.column(state - SIDE), T::one());
                beside.axpy(*h, &side.covariance.column(state - SIDE), T::one());
            }
        }
        Self {
            error,
            side: beside,
        }
    }

    /// `H (P H^T)`, or `H x` for a correction.
    fn dot(&self, row: &Row<T>) -> T {
        let mut sum = T::zero();
        for (state, h) in row.elements() {
            let value = if *state < SIDE {
                self.error.get(*state)
            } else {
                self.side.get(state - SIDE)
            };
            sum += *h * value.copied().unwrap_or_else(T::zero);
        }
        sum
    }
}

impl<T: Scalar> ErrorStateFilter<T> {
    /// Fuses a measurement whose NIS is below `threshold` (zero: no gate). The covariance must have
    /// [caught up](Self::catch_up).
    pub fn fuse_sparse<const M: usize>(
        &mut self,
        side: &mut SideStates<T>,
        measurement: &Measurement<T, M>,
        gate: &mut CountedGate,
        threshold: T,
    ) -> Innovation<T> {
        const { assert!(M <= 3) };
        let Some((expected, nis)) = self.expect(side, measurement) else {
            self.count_skipped();
            return Innovation::skipped(SkipReason::Numerical);
        };
        let outcome = match gate.decide(nis, threshold, REJECTIONS_BELIEVED) {
            GateDecision::Accept => Outcome::Fused,
            GateDecision::Inflate(_) => Outcome::Inflated,
            GateDecision::Reject => Outcome::Gated,
        };
        let record = record(&measurement.residual, &expected, nis, outcome);
        if outcome == Outcome::Inflated {
            self.set_free(side, measurement);
        }
        if outcome.is_fused() {
            self.fuse_rows(side, measurement);
        }
        record
    }

    /// `S = H P H^T + R` and the NIS (E15).
    fn expect<const M: usize>(
        &self,
        side: &SideStates<T>,
        measurement: &Measurement<T, M>,
    ) -> Option<(SMatrix<T, M, M>, T)> {
        let mut s = SMatrix::<T, M, M>::from_diagonal(&measurement.variance);
        for (j, row) in measurement.rows.iter().enumerate() {
            let projected = Projected::of(row, &self.state.covariance, side);
            for (i, row) in measurement.rows.iter().enumerate().take(j + 1) {
                let value = projected.dot(row);
                for at in [(i, j), (j, i)].into_iter().take(1 + usize::from(i != j)) {
                    if let Some(element) = s.get_mut(at) {
                        *element += value;
                    }
                }
            }
        }
        let positive = measurement.variance.iter().all(|r| *r > T::zero());
        let nis = normalized_square(&measurement.residual, &s).filter(|_| positive)?;
        Some((s, nis))
    }

    /// Scalar updates, one row after the other (E16), and the correction into the state.
    fn fuse_rows<const M: usize>(
        &mut self,
        side: &mut SideStates<T>,
        measurement: &Measurement<T, M>,
    ) {
        let mut correction = Projected {
            error: SVector::zeros(),
            side: SVector::zeros(),
        };
        for (i, row) in measurement.rows.iter().enumerate() {
            let ph = Projected::of(row, &self.state.covariance, side);
            let s = ph.dot(row) + measurement.variance[i];
            let nu = measurement.residual[i] - correction.dot(row);
            if !(s > T::zero() && s.is_finite() && nu.is_finite()) {
                continue;
            }
            let inverse = T::one() / s;
            correction.error.axpy(nu * inverse, &ph.error, T::one());
            correction.side.axpy(nu * inverse, &ph.side, T::one());
            self.shrink(side, &ph, inverse);
        }
        mirror_upper(&mut self.state.covariance);
        side.values += correction.side;
        let angle = self.inject(&correction.error);
        side.reset(&angle);
    }

    /// `P -= (P H^T)(P H^T)^T / S`, over the joint covariance; of the filter's the upper triangle.
    fn shrink(&mut self, side: &mut SideStates<T>, ph: &Projected<T>, inverse: T) {
        let p = &mut self.state.covariance;
        let columns = p.as_mut_slice().chunks_exact_mut(STATES);
        for (j, (column, b)) in columns.zip(&ph.error).enumerate() {
            let k = *b * inverse;
            for (value, a) in column.iter_mut().zip(&ph.error).take(j + 1) {
                *value -= *a * k;
            }
        }
        for j in 0..SIDE_STATES {
            if !side.is_used(j) {
                continue;
            }
            let k = ph.side[j] * inverse;
            side.cross.column_mut(j).axpy(-k, &ph.error, T::one());
            for i in 0..=j {
                let value = side.covariance[(i, j)] - ph.side[i] * k;
                side.covariance[(i, j)] = value;
                side.covariance[(j, i)] = value;
            }
            // A side state does not go out of use by being known well.
            let variance = &mut side.covariance[(j, j)];
            *variance = variance.max(lit(LEAST_SIDE_VARIANCE));
        }
    }

    /// Keeps variances where numbers still mean something, by shrinking rows and columns alike: the matrix stays a
    /// covariance through any outage, in single precision too.
    pub(in crate::navigation) fn limit_covariance(&mut self, side: &mut SideStates<T>) {
        for state in 0..STATES {
            let variance = self.state.covariance[(state, state)];
            let limit = lit(LARGEST_VARIANCES[state / 3]);
            if variance > limit {
                let scale = (limit / variance).sqrt();
                side.cross.row_mut(state).scale_mut(scale);
                cap_variance(&mut self.state.covariance, state, limit);
            }
        }
    }

    /// Takes the body to be level within `std` (rad): its tilt is then correlated with nothing.
    pub(in crate::navigation) fn hold_level(&mut self, side: &mut SideStates<T>, std: T) {
        let state = &mut self.state;
        let [yaw, _, _] = rotation::to_yaw_pitch_roll(&state.ned_from_body);
        state.ned_from_body = so3::exp(&(Vector3::z() * yaw));
        for tilt in [ATTITUDE, ATTITUDE + 1] {
            state.covariance.row_mut(tilt).fill(T::zero());
            state.covariance.column_mut(tilt).fill(T::zero());
            side.cross.row_mut(tilt).fill(T::zero());
            state.covariance[(tilt, tilt)] = std * std;
        }
    }

    /// Lets accelerometer and gyroscope bias relax to their values at rest over `dt` seconds.
    pub(in crate::navigation) fn relax_biases(
        &mut self,
        at_rest: &mut [BiasAtRest<T>; 2],
        settings: &[WanderSettings<T>; 2],
        dt: T,
        side: &mut SideStates<T>,
    ) {
        let state = &mut self.state;
        let biases = [
            (ACCELEROMETER_BIAS, &mut state.accelerometer_bias),
            (GYROSCOPE_BIAS, &mut state.gyroscope_bias),
        ];
        for ((bias, at_rest), settings) in biases.into_iter().zip(at_rest).zip(settings) {
            let p = &mut state.covariance;
            at_rest.relax(settings, dt, bias, p, &mut side.cross);
        }
    }

    /// Adds the square of each residual to the variance of the state it sees (E17), in that state's unit.
    fn set_free<const M: usize>(
        &mut self,
        side: &mut SideStates<T>,
        measurement: &Measurement<T, M>,
    ) {
        let freed = measurement.freed.iter().zip(&measurement.rows);
        for ((state, row), residual) in freed.zip(measurement.residual.iter()) {
            if *state < SIDE {
                if let Some(variance) = self.state.covariance.get_mut((*state, *state)) {
                    *variance += *residual * *residual;
                }
                continue;
            }
            let seen = row.elements().iter().find(|(seen, _)| seen == state);
            let variance = side.covariance.get_mut((state - SIDE, state - SIDE));
            if let (Some((_, h)), Some(variance)) = (seen, variance)
                && h.abs() > T::zero()
            {
                let error = *residual / *h;
                *variance += error * error;
            }
        }
    }
}

fn record<T: Scalar, const M: usize>(
    residual: &SVector<T, M>,
    expected: &SMatrix<T, M, M>,
    nis: T,
    outcome: Outcome,
) -> Innovation<T> {
    let mut all = Vector3::zeros();
    let mut covariance = Matrix3::zeros();
    for j in 0..M.min(3) {
        all[j] = residual[j];
        for i in 0..M.min(3) {
            covariance[(i, j)] = expected[(i, j)];
        }
    }
    Innovation {
        residual: all,
        covariance,
        nis,
        degrees_of_freedom: M as u8,
        outcome,
    }
}

#[cfg(test)]
mod tests;
