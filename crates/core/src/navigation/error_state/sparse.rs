//! Fusing measurements of few states: gate, scalar updates in place, and the augmented states with them.
//!
//! *Read first:* `docs/derivations/error_state.md`, section 7 (E15-E17).
//!
//! A row has elements for the 15 errors (0 to 14) and for the [`AugmentedStates`] (from [`SIDE`] on). The gate looks
//! at all rows at once; then they are fused one after the other, which equals the joint update exactly. When the
//! gate has refused too often, the states that the measurement sees directly are set free first (E17): the
//! filter was wrong, not the sensor.

mod expected;
mod shrink;

use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

use self::expected::{Expected, Projected, Used};
use self::shrink::{column_of_lower, mirror_lower, scaled, shrink, shrink_side};

use super::ErrorStateFilter;
use crate::geometry::{rotation, so3};
use crate::kalman::covariance::cap_variance;
use crate::kalman::feedback::ScaledState;
use crate::kalman::sparse_update::SparseRow;
use crate::kalman::{
    CountedGate, ErrorListener, GateDecision, Innovation, Outcome, ScalarCorrection, SkipReason,
};
use crate::navigation::augmented_states::{AUGMENTED_STATES, AugmentedStates};
use crate::navigation::gauss_markov_bias::{BiasAtRest, GaussMarkovBias};
use crate::navigation::{ACCELEROMETER_BIAS, ATTITUDE, ERRORS, GYROSCOPE_BIAS, STATES};
use crate::scalar::{Scalar, lit};

/// Most elements of a row: velocity, attitude, gyroscope bias, two mount angles, and one to spare.
pub const ROW_ELEMENTS: usize = 12;
/// Index of the first augmented state in a row.
pub const SIDE: usize = STATES;
/// How many measurements in a row a gate refuses before it accepts them.
pub const REJECTIONS_ACCEPTED: u8 = 5;

/// What becomes of a measurement that is far off.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::navigation) enum Weighting {
    /// It is fused like any other.
    None,
    /// It is fused with a smaller gain, and very far off left out.
    Robust,
    /// It is left out.
    AllOrNothing,
}

/// The 97 % points of chi-square, by degrees of freedom: up to them a measurement has its full weight.
pub(in crate::navigation) const NOMINAL_NIS: [f64; 3] = [4.71, 7.01, 8.95];
/// Degrees of freedom of Student's t distribution, which the weight follows beyond.
const STUDENT_FREEDOM: f64 = 4.0;
/// Below this weight a measurement is left out.
pub const LEAST_WEIGHT: f64 = 0.1;

/// Largest variances of attitude (rad^2), velocity, position, accelerometer and gyroscope bias: beyond them
/// nothing is known.
const LARGEST_VARIANCES: [f64; 5] = [10.0, 1e5, 1e8, 1e2, 1.0];

/// A row over the 15 errors and the augmented states.
pub type Row<T> = SparseRow<T, ROW_ELEMENTS>;

/// A measurement of up to three components, ready to be fused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SparseMeasurement<T: Scalar, const M: usize> {
    /// What each component sees.
    pub rows: [Row<T>; M],
    /// Measured minus predicted.
    pub residual: SVector<T, M>,
    /// Variance of each component's noise, above zero.
    pub variance: SVector<T, M>,
    /// The state, of the 15 errors or beside them, that is set free when the gate has refused too often, a component each.
    pub freed: [usize; M],
}

impl<T: Scalar> ErrorStateFilter<T> {
    /// Fuses a measurement whose NIS is below `threshold` (zero: no gate). The covariance must have
    /// [caught up](Self::catch_up). What it does to the errors goes to `listener`; with `()` to nobody.
    // Not inlined: on a chip its memory is then free again for what follows.
    #[inline(never)]
    pub fn fuse_sparse<const M: usize>(
        &mut self,
        side: &mut AugmentedStates<T>,
        measurement: &SparseMeasurement<T, M>,
        gate: &mut CountedGate,
        threshold: T,
        listener: &mut impl ErrorListener<T, ERRORS>,
    ) -> Innovation<T> {
        let (used, mut expected) = match self.expect(side, measurement) {
            Ok(expected) => expected,
            Err(reason) => return Innovation::skipped(reason),
        };
        let outcome = match gate.decide(expected.nis, threshold, REJECTIONS_ACCEPTED) {
            GateDecision::Accept => Outcome::Fused,
            GateDecision::Inflate(_) => Outcome::Inflated,
            GateDecision::Reject => Outcome::Gated,
        };
        let record = record(&measurement.residual, &expected, outcome);
        if outcome == Outcome::Fused {
            self.fuse_expected(side, used, measurement, &mut expected, listener);
        } else if outcome == Outcome::Inflated {
            self.accept(side, used, measurement, listener);
        }
        record
    }

    /// Fuses a measurement with a weight that falls with how far it is off (E37): noise comes to it so that its gain is
    /// that much smaller, and where less than a tenth would be left it is left out; or as `how` says. The record has the noise as stated. The
    /// covariance must have [caught up](Self::catch_up).
    #[inline(never)]
    pub(in crate::navigation) fn fuse_weighted<const M: usize>(
        &mut self,
        side: &mut AugmentedStates<T>,
        measurement: &SparseMeasurement<T, M>,
        how: Weighting,
        listener: &mut impl ErrorListener<T, ERRORS>,
    ) -> Innovation<T> {
        let (used, mut expected) = match self.expect(side, measurement) {
            Ok(expected) => expected,
            Err(reason) => return Innovation::skipped(reason),
        };
        let weight = weight_of::<T, M>(expected.nis);
        let outcome = if weight >= T::one() || how == Weighting::None {
            Outcome::Fused
        } else if weight > T::zero() && how == Weighting::Robust {
            Outcome::Inflated
        } else {
            Outcome::Gated
        };
        let record = record(&measurement.residual, &expected, outcome);
        if outcome == Outcome::Inflated {
            let mut weighted = *measurement;
            for i in 0..M {
                let added = expected.covariance[(i, i)] * (T::one() / weight - T::one());
                weighted.variance[i] += added;
            }
            match Expected::of(&self.state.covariance, side, used, &weighted) {
                Some(inflated) => expected = inflated,
                None => return Innovation::skipped(SkipReason::Numerical),
            }
        }
        if outcome.is_fused() {
            self.fuse_expected(side, used, measurement, &mut expected, listener);
        }
        record
    }

    /// Which augmented states are in use, and what is expected of a measurement.
    #[inline(always)]
    fn expect<const M: usize>(
        &mut self,
        side: &AugmentedStates<T>,
        measurement: &SparseMeasurement<T, M>,
    ) -> Result<(Used, Expected<T, M>), SkipReason> {
        const { assert!(M <= 3) };
        let used = Used::of_states(side);
        let expected = Expected::of(&self.state.covariance, side, used, measurement);
        if expected.is_none() {
            self.count_skipped();
        }
        Ok((used, expected.ok_or(SkipReason::Numerical)?))
    }

    /// Fuses a measurement that the gate would still refuse, with the states that it sees set free (E17).
    // Not inlined, for the same reason.
    #[inline(never)]
    fn accept<const M: usize>(
        &mut self,
        side: &mut AugmentedStates<T>,
        used: Used,
        measurement: &SparseMeasurement<T, M>,
        listener: &mut impl ErrorListener<T, ERRORS>,
    ) {
        // Noise of its own: who is correlated with the states stays so.
        self.set_free(side, measurement);
        let expected = Expected::of(&self.state.covariance, side, used, measurement);
        if let Some(mut expected) = expected {
            self.fuse_expected(side, used, measurement, &mut expected, listener);
        }
    }

    /// Scalar updates, one row after the other (E16), and the correction into the state.
    fn fuse_expected<const M: usize, L: ErrorListener<T, ERRORS>>(
        &mut self,
        side: &mut AugmentedStates<T>,
        used: Used,
        measurement: &SparseMeasurement<T, M>,
        expected: &mut Expected<T, M>,
        listener: &mut L,
    ) {
        let p = &mut self.state.covariance;
        let mut correction = Projected::zeros();
        for (i, row) in measurement.rows.iter().enumerate() {
            let Some((before, [known, ..])) = expected.rows.split_at_mut_checked(i) else {
                return;
            };
            let ph = &mut known.projected;
            match row.elements() {
                // A column of the covariance, which has taken in the rows before.
                [(state, h)] if *state < STATES && i > 0 && !used.any => {
                    ph.error = scaled(&column_of_lower(p, *state), *h);
                }
                // What the rows before have told is known.
                _ => {
                    for (before, l) in before.iter().zip(&known.factor) {
                        ph.add_scaled(&before.projected, -*l, used);
                    }
                }
            }
            let gain = ph.times(known.weight, used);
            correction.add_scaled(&gain, known.residual, used);
            shrink(p, ph, &gain);
            if used.any {
                shrink_side(side, used, ph, &gain);
            }
            if L::LISTENS {
                listener.corrected(&ScalarCorrection {
                    row: *row,
                    gain: gain.joint(),
                    residual: known.residual,
                    variance: T::one() / known.weight,
                });
            }
        }
        mirror_lower(p);
        if used.any {
            side.values += SVector::from(correction.side);
        }
        let angle = self.inject(&SVector::from(correction.error));
        if used.any {
            side.reset(&angle);
        }
        listener.recentred(&angle);
    }

    /// Keeps variances where numbers still mean something, by shrinking rows and columns alike: the matrix stays a
    /// covariance through any outage, in single precision too.
    pub(in crate::navigation) fn limit_covariance(
        &mut self,
        side: &mut AugmentedStates<T>,
        listener: &mut impl ErrorListener<T, ERRORS>,
    ) {
        for state in 0..STATES {
            let variance = self.state.covariance[(state, state)];
            let limit = lit(LARGEST_VARIANCES[state / 3]);
            if variance > limit {
                let scale = (limit / variance).sqrt();
                side.cross.row_mut(state).scale_mut(scale);
                cap_variance(&mut self.state.covariance, state, limit);
                listener.propagated(&ScaledState {
                    state,
                    factor: scale,
                });
            }
        }
    }

    /// Takes over errors that were found otherwise, with what is added to the covariance of all: of the 15 and beside them.
    pub(in crate::navigation) fn shift(
        &mut self,
        side: &mut AugmentedStates<T>,
        errors: &SVector<T, ERRORS>,
        covariance: &SMatrix<T, ERRORS, ERRORS>,
        listener: &mut impl ErrorListener<T, ERRORS>,
    ) {
        let p = &mut self.state.covariance;
        for i in 0..STATES {
            for j in 0..=i {
                let sum = p[(i, j)] + covariance[(i, j)];
                (p[(i, j)], p[(j, i)]) = (sum, sum);
            }
        }
        side.cross += covariance.fixed_view::<STATES, AUGMENTED_STATES>(0, SIDE);
        for i in 0..AUGMENTED_STATES {
            for j in 0..=i {
                let sum = side.covariance[(i, j)] + covariance[(SIDE + i, SIDE + j)];
                (side.covariance[(i, j)], side.covariance[(j, i)]) = (sum, sum);
            }
        }
        side.values += errors.fixed_rows::<AUGMENTED_STATES>(SIDE);
        let angle = self.inject(&errors.fixed_rows::<STATES>(0).into_owned());
        side.reset(&angle);
        listener.recentred(&angle);
    }

    /// Takes the body to be level within `std` (rad): its tilt is then correlated with nothing.
    pub(in crate::navigation) fn hold_level(
        &mut self,
        side: &mut AugmentedStates<T>,
        std: T,
        listener: &mut impl ErrorListener<T, ERRORS>,
    ) {
        let state = &mut self.state;
        let [yaw, _, _] = rotation::to_yaw_pitch_roll(&state.ned_from_body);
        state.ned_from_body = so3::exp(&(Vector3::z() * yaw));
        for tilt in [ATTITUDE, ATTITUDE + 1] {
            state.covariance.row_mut(tilt).fill(T::zero());
            state.covariance.column_mut(tilt).fill(T::zero());
            side.cross.row_mut(tilt).fill(T::zero());
            state.covariance[(tilt, tilt)] = std * std;
            listener.propagated(&ScaledState {
                state: tilt,
                factor: T::zero(),
            });
        }
    }

    /// Lets accelerometer and gyroscope bias relax to their values at rest over `dt` seconds.
    pub(in crate::navigation) fn relax_biases(
        &mut self,
        at_rest: &mut [BiasAtRest<T>; 2],
        settings: &[GaussMarkovBias<T>; 2],
        dt: T,
        side: &mut AugmentedStates<T>,
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
        side: &mut AugmentedStates<T>,
        measurement: &SparseMeasurement<T, M>,
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

/// Weight of a measurement by its squared normalised residual: one up to the 97 % point of chi-square of so many degrees of
/// freedom (1 to 3), then as Student's t distribution of four degrees of freedom falls (E37).
pub fn robust_weight<T: Scalar>(squared: T, degrees_of_freedom: usize) -> T {
    let row = NOMINAL_NIS.get(degrees_of_freedom.saturating_sub(1));
    let nominal = lit::<T>(row.copied().unwrap_or(NOMINAL_NIS[2]));
    let freedom = lit::<T>(STUDENT_FREEDOM);
    let weight = (freedom + nominal) / (freedom + squared);
    if weight >= T::one() { T::one() } else { weight }
}

/// The same of `M` components, and nothing where less than a tenth would be left.
fn weight_of<T: Scalar, const M: usize>(nis: T) -> T {
    let weight = robust_weight(nis, M);
    if weight >= lit(LEAST_WEIGHT) {
        weight
    } else {
        T::zero()
    }
}

fn record<T: Scalar, const M: usize>(
    residual: &SVector<T, M>,
    expected: &Expected<T, M>,
    outcome: Outcome,
) -> Innovation<T> {
    let mut all = Vector3::zeros();
    let mut covariance = Matrix3::zeros();
    for j in 0..M.min(3) {
        all[j] = residual[j];
        for i in 0..M.min(3) {
            covariance[(i, j)] = expected.covariance[(i, j)];
        }
    }
    Innovation {
        residual: all,
        covariance,
        nis: expected.nis,
        degrees_of_freedom: M as u8,
        outcome,
    }
}

#[cfg(test)]
mod tests;
