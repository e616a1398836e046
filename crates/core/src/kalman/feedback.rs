//! Error-state feedback and reset of a closed-loop filter, handed to whatever is correlated with its error.
//!
//! A filter that feeds its corrections back into its state (an error-state filter) maps its error
//! in steps: `e <- Phi e + noise` when it propagates, `e <- G (I - K H) e + noise` when it
//! corrects itself. The noises are independent of everything outside, so the covariance of that
//! error with anything outside is multiplied by exactly these maps
//! (`docs/derivations/schmidt_kalman.md`, S5-S7). A tracker keeps the cross-covariance as a matrix
//! with one row for each state of the filter and hands it to [`ErrorPropagation::map_rows`] and
//! [`ErrorFeedback::map_rows`]; no square matrix is ever formed.

use nalgebra::{Matrix2, SMatrix, SVector, Vector3};

use super::shear::mirror;
use crate::scalar::{Scalar, lit};

/// Most scalar corrections in one update: a position and an attitude.
pub const MOST_CORRECTIONS: usize = 6;

/// The transition of a filter's error over some time, `e <- Phi e`.
pub trait ErrorPropagation<T: Scalar, const N: usize> {
    /// `rows <- Phi rows`, in place.
    fn map_rows<const C: usize>(&self, rows: &mut SMatrix<T, N, C>);
}

/// One scalar measurement of a single error state, as a filter fused it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScalarCorrection<T: Scalar, const N: usize> {
    /// Index of the state that was measured: the row `H` is one there and zero elsewhere.
    pub state: usize,
    /// The gain `K`.
    pub gain: SVector<T, N>,
    /// Measured minus predicted, after the corrections before this one.
    pub residual: T,
    /// Variance of the residual, `S = H P H^T + R`.
    pub variance: T,
}

impl<T: Scalar, const N: usize> ScalarCorrection<T, N> {
    /// `rows <- (I - K H) rows`, in place.
    #[inline]
    pub fn map_rows<const C: usize>(&self, rows: &mut SMatrix<T, N, C>) {
        for mut column in rows.column_iter_mut() {
            let measured = column[self.state];
            column.axpy(-measured, &self.gain, T::one());
        }
    }
}

/// All that one update did to the error of a filter: up to [`MOST_CORRECTIONS`] scalar
/// corrections, then the reset of the attitude error (states 0 to 2) at the corrected attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorFeedback<T: Scalar, const N: usize> {
    corrections: [ScalarCorrection<T, N>; MOST_CORRECTIONS],
    count: usize,
    reset: Vector3<T>,
}

impl<T: Scalar, const N: usize> Default for ErrorFeedback<T, N> {
    /// Nothing was corrected.
    fn default() -> Self {
        let none = ScalarCorrection {
            state: 0,
            gain: SVector::zeros(),
            residual: T::zero(),
            variance: T::one(),
        };
        Self {
            corrections: [none; MOST_CORRECTIONS],
            count: 0,
            reset: Vector3::zeros(),
        }
    }
}

impl<T: Scalar, const N: usize> ErrorFeedback<T, N> {
    /// The scalar corrections in their order.
    #[inline]
    pub fn corrections(&self) -> &[ScalarCorrection<T, N>] {
        self.corrections.get(..self.count).unwrap_or_default()
    }

    /// The attitude correction (rad, reference frame) whose reset Jacobian was applied; zero when
    /// the filter leaves that Jacobian out.
    #[inline]
    pub fn reset_angle(&self) -> &Vector3<T> {
        &self.reset
    }

    /// Adds one; beyond [`MOST_CORRECTIONS`] nothing is added and the answer is `false`.
    #[inline]
    pub(crate) fn push(&mut self, correction: ScalarCorrection<T, N>) -> bool {
        match self.corrections.get_mut(self.count) {
            Some(place) => {
                *place = correction;
                self.count += 1;
                true
            }
            None => false,
        }
    }

    /// Sets the reset.
    #[inline]
    pub(crate) fn set_reset(&mut self, angle: Vector3<T>) {
        self.reset = angle;
    }

    /// `rows <- G (I - K H) rows`, in place.
    #[inline]
    pub fn map_rows<const C: usize>(&self, rows: &mut SMatrix<T, N, C>) {
        for correction in self.corrections() {
            correction.map_rows(rows);
        }
        reset_rows(rows, &self.reset);
    }
}

/// `rows <- G rows` with the reset Jacobian of a reference-frame attitude error in states 0 to 2:
/// `G = I + [d]x / 2` for the correction `d` (rad) that was injected
/// (`docs/derivations/error_state.md`, E12).
#[inline]
pub fn reset_rows<T: Scalar, const N: usize, const C: usize>(
    rows: &mut SMatrix<T, N, C>,
    d: &Vector3<T>,
) {
    const { assert!(N >= 3) };
    let half = d * lit::<T>(0.5);
    for mut column in rows.column_iter_mut() {
        let (x, y, z) = (column[0], column[1], column[2]);
        column[0] = x + (half.y * z - half.z * y);
        column[1] = y + (half.z * x - half.x * z);
        column[2] = z + (half.x * y - half.y * x);
    }
}

/// `P <- G P G^T` with the `G` of [`reset_rows`]; a symmetric matrix stays symmetric to the bit.
#[inline]
pub fn reset_covariance<T: Scalar, const N: usize>(p: &mut SMatrix<T, N, N>, d: &Vector3<T>) {
    const { assert!(N >= 3) };
    let half = d * lit::<T>(0.5);
    let [first, second, third, ..] = p.data.0.as_mut_slice() else {
        return;
    };
    let turn = |x: &mut T, y: &mut T, z: &mut T| {
        let (a, b, c) = (*x, *y, *z);
        *x += half.y * c - half.z * b;
        *y += half.z * a - half.x * c;
        *z += half.x * b - half.y * a;
    };
    for ((x, y), z) in first
        .iter_mut()
        .zip(second.iter_mut())
        .zip(third.iter_mut())
    {
        turn(x, y, z);
    }
    // So far the block of the three has been turned from the right only.
    for column in [&mut *first, &mut *second, &mut *third] {
        if let [x, y, z, ..] = column.as_mut_slice() {
            turn(x, y, z);
        }
    }
    if let ([_, xy, xz, ..], [yx, _, yz, ..], [zx, zy, ..]) = (
        first.as_slice(),
        second.as_mut_slice(),
        third.as_mut_slice(),
    ) {
        (*yx, *zx, *zy) = (*xy, *xz, *yz);
    }
    mirror(&mut p.data.0, 0);
}

/// What an observer outside has learnt about a filter's error: a joint estimator's correction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OutsideCorrection<T: Scalar, const N: usize> {
    /// The correction of the error state, `K nu`.
    pub correction: SVector<T, N>,
    /// Its gain `K` for the two components of the measurement.
    pub gain: SMatrix<T, N, 2>,
    /// Covariance `S` of the innovation: the filter's covariance shrinks by `K S K^T`.
    pub innovation_covariance: Matrix2<T>,
}
