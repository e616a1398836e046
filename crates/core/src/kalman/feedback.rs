//! Error-state feedback and reset of a closed-loop filter, handed to whatever is correlated with its error.
//!
//! A filter that feeds its corrections back into its state (an error-state filter) maps its error
//! in steps: `e <- Phi e + noise` when it propagates, `e <- G (I - K H) e + noise` when it
//! corrects itself. The noises are independent of everything outside, so the covariance of that
//! error with anything outside is multiplied by exactly these maps
//! (`docs/derivations/schmidt_kalman.md`, S5-S7). A tracker keeps the cross-covariance as a matrix
//! with one row for each state of the filter and hands it to [`ErrorPropagation::map_rows`] and
//! [`ErrorFeedback::map_rows`]; no square matrix is ever formed.
//!
//! A filter with one kind of update hands out its feedback with the update ([`ErrorFeedback`]). One with many kinds,
//! which also corrects itself between them, has an [`ErrorListener`] built in: nothing can be missed, and with `()` it
//! costs nothing.

use nalgebra::{Matrix2, SMatrix, SVector, Vector3};

use super::shear::mirror;
use super::sparse_update::SparseRow;
use crate::scalar::{Scalar, lit};

/// Most scalar corrections in one update: a position and an attitude.
pub const MOST_CORRECTIONS: usize = 6;

/// The transition of a filter's error over some time, `e <- Phi e`.
pub trait ErrorPropagation<T: Scalar, const N: usize> {
    /// `rows <- Phi rows`, in place.
    fn map_rows<const C: usize>(&self, rows: &mut SMatrix<T, N, C>);
}

/// One state's error becomes `factor` times what it was, and noise may be added: a variance held at its limit, or with
/// factor zero a state that starts anew.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScaledState<T> {
    /// Index of the state.
    pub state: usize,
    /// What is left of its error, 0 to 1.
    pub factor: T,
}

impl<T: Scalar, const N: usize> ErrorPropagation<T, N> for ScaledState<T> {
    #[inline]
    fn map_rows<const C: usize>(&self, rows: &mut SMatrix<T, N, C>) {
        for column in &mut rows.data.0 {
            if let Some(value) = column.get_mut(self.state) {
                *value *= self.factor;
            }
        }
    }
}

/// One scalar measurement, as a filter fused it: `E` elements of its row `H` can differ from zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScalarCorrection<T: Scalar, const N: usize, const E: usize = 1> {
    /// The row `H`.
    pub row: SparseRow<T, E>,
    /// The gain `K`.
    pub gain: SVector<T, N>,
    /// Measured minus predicted, after the corrections before this one.
    pub residual: T,
    /// Variance of the residual, `S = H P H^T + R`.
    pub variance: T,
}

impl<T: Scalar, const N: usize, const E: usize> ScalarCorrection<T, N, E> {
    /// `(H rows)^T`: covariance of what was measured with each column's quantity.
    #[inline]
    pub fn measured<const C: usize>(&self, rows: &SMatrix<T, N, C>) -> SVector<T, C> {
        SVector::from(rows.data.0.each_ref().map(|column| self.row.dot(column)))
    }

    /// `rows <- (I - K H) rows`, in place.
    #[inline]
    pub fn map_rows<const C: usize>(&self, rows: &mut SMatrix<T, N, C>) {
        for mut column in rows.column_iter_mut() {
            let measured = self.row.dot(column.as_slice());
            column.axpy(-measured, &self.gain, T::one());
        }
    }
}

/// Follows the error of a filter through everything that the filter does to it.
///
/// The filter calls it by itself. Who carries a cross-covariance (rows: the filter's `N` states) maps it each time:
/// by `map_rows` of what it is given, by [`reset_rows`], and by zero at a restart.
pub trait ErrorListener<T: Scalar, const N: usize> {
    /// Whether anybody is there: for nobody nothing is prepared.
    const LISTENS: bool = true;
    /// `e <- Phi e + noise`.
    fn propagated(&mut self, transition: &impl ErrorPropagation<T, N>);
    /// `e <- (I - K H) e - K n`. The measurements of one update follow one another, then comes [`Self::recentred`].
    fn corrected<const E: usize>(&mut self, correction: &ScalarCorrection<T, N, E>);
    /// `e <- G e`: the attitude error (states 0 to 2) is counted from the attitude turned by `angle` (rad).
    fn recentred(&mut self, angle: &Vector3<T>);
    /// The error is another one now, independent of all before: the filter has started again.
    fn restarted(&mut self);
}

/// Nobody listens.
impl<T: Scalar, const N: usize> ErrorListener<T, N> for () {
    const LISTENS: bool = false;

    #[inline(always)]
    fn propagated(&mut self, _: &impl ErrorPropagation<T, N>) {}
    #[inline(always)]
    fn corrected<const E: usize>(&mut self, _: &ScalarCorrection<T, N, E>) {}
    #[inline(always)]
    fn recentred(&mut self, _: &Vector3<T>) {}
    #[inline(always)]
    fn restarted(&mut self) {}
}

/// Several listen, one after the other; with `[Option<L>; K]` up to `K`.
impl<T: Scalar, const N: usize, L: ErrorListener<T, N>, const K: usize> ErrorListener<T, N>
    for [L; K]
{
    fn propagated(&mut self, transition: &impl ErrorPropagation<T, N>) {
        self.iter_mut().for_each(|one| one.propagated(transition));
    }
    fn corrected<const E: usize>(&mut self, correction: &ScalarCorrection<T, N, E>) {
        self.iter_mut().for_each(|one| one.corrected(correction));
    }
    fn recentred(&mut self, angle: &Vector3<T>) {
        self.iter_mut().for_each(|one| one.recentred(angle));
    }
    fn restarted(&mut self) {
        self.iter_mut().for_each(L::restarted);
    }
}

/// Two listen, one after the other.
impl<T: Scalar, const N: usize, A: ErrorListener<T, N>, B: ErrorListener<T, N>> ErrorListener<T, N>
    for (A, B)
{
    const LISTENS: bool = A::LISTENS || B::LISTENS;

    fn propagated(&mut self, transition: &impl ErrorPropagation<T, N>) {
        self.0.propagated(transition);
        self.1.propagated(transition);
    }
    fn corrected<const E: usize>(&mut self, correction: &ScalarCorrection<T, N, E>) {
        self.0.corrected(correction);
        self.1.corrected(correction);
    }
    fn recentred(&mut self, angle: &Vector3<T>) {
        self.0.recentred(angle);
        self.1.recentred(angle);
    }
    fn restarted(&mut self) {
        self.0.restarted();
        self.1.restarted();
    }
}

/// Somebody else's listener.
impl<T: Scalar, const N: usize, L: ErrorListener<T, N>> ErrorListener<T, N> for &mut L {
    const LISTENS: bool = L::LISTENS;

    fn propagated(&mut self, transition: &impl ErrorPropagation<T, N>) {
        L::propagated(self, transition);
    }
    fn corrected<const E: usize>(&mut self, correction: &ScalarCorrection<T, N, E>) {
        L::corrected(self, correction);
    }
    fn recentred(&mut self, angle: &Vector3<T>) {
        L::recentred(self, angle);
    }
    fn restarted(&mut self) {
        L::restarted(self);
    }
}

/// One who is not always there: a target that has not been seen yet.
impl<T: Scalar, const N: usize, L: ErrorListener<T, N>> ErrorListener<T, N> for Option<L> {
    fn propagated(&mut self, transition: &impl ErrorPropagation<T, N>) {
        if let Some(one) = self {
            one.propagated(transition);
        }
    }
    fn corrected<const E: usize>(&mut self, correction: &ScalarCorrection<T, N, E>) {
        if let Some(one) = self {
            one.corrected(correction);
        }
    }
    fn recentred(&mut self, angle: &Vector3<T>) {
        if let Some(one) = self {
            one.recentred(angle);
        }
    }
    fn restarted(&mut self) {
        if let Some(one) = self {
            one.restarted();
        }
    }
}

/// All that one update did to the error of a filter: up to [`MOST_CORRECTIONS`] scalar
/// corrections, then the reset of the attitude error (states 0 to 2) at the corrected attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
#[must_use = "whoever is correlated with the filter's error must be told, or the joint covariance is wrong"]
pub struct ErrorFeedback<T: Scalar, const N: usize> {
    corrections: [ScalarCorrection<T, N>; MOST_CORRECTIONS],
    count: usize,
    reset: Vector3<T>,
}

impl<T: Scalar, const N: usize> Default for ErrorFeedback<T, N> {
    /// Nothing was corrected.
    fn default() -> Self {
        let none = ScalarCorrection {
            row: SparseRow::default(),
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

    /// Gives it all to a listener.
    #[inline]
    pub fn tell(&self, listener: &mut impl ErrorListener<T, N>) {
        for correction in self.corrections() {
            listener.corrected(correction);
        }
        listener.recentred(&self.reset);
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
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[must_use = "the navigation filter must be given it, or the two disagree from now on"]
pub struct OutsideCorrection<T: Scalar, const N: usize> {
    /// The correction of the error state, `K nu`.
    pub correction: SVector<T, N>,
    /// Its gain `K` for the two components of the measurement.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub gain: SMatrix<T, N, 2>,
    /// Covariance `S` of the innovation: the filter's covariance shrinks by `K S K^T`.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub innovation_covariance: Matrix2<T>,
}
