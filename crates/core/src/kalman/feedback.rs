//! What a closed-loop filter does to its own error, told to whoever is correlated with that error.
//!
//! A filter that feeds its corrections back into its state (an error-state filter) maps its error
//! in steps: `e <- Phi e + noise` when it propagates, `e <- G (I - K H) e + noise` when it
//! corrects itself. The noises are independent of everything outside, so the covariance of that
//! error with anything outside is multiplied by exactly these maps
//! (`docs/derivations/schmidt_kalman.md`, S5-S7). A tracker keeps the cross-covariance as a matrix
//! with one row for each state of the filter and hands it to [`ErrorPropagation::map_rows`] and
//! [`ErrorFeedback::map_rows`]; no square matrix is ever formed.

use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector3};

use super::innovation::SkipReason;
use super::shear::mirror;
use crate::scalar::{Scalar, lit};

/// Most scalar corrections in one update: a position and an attitude.
pub const MOST_CORRECTIONS: usize = 6;

/// The transition of a filter's error over some time, `e <- Phi e`.
pub trait ErrorPropagation<T: Scalar, const N: usize> {
    /// `rows <- Phi rows`, in place.
    fn map_rows<const C: usize>(&self, rows: &mut SMatrix<T, N, C>);
}

/// Where a navigation filter says that the own ship is, and the error that it says so with: what a tracker sees of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NavigationPose<'a, T: Scalar, const N: usize> {
    /// `[north, east, heading]`, m and rad.
    pub pose: Vector3<T>,
    /// Covariance of the navigation filter's error states.
    pub covariance: &'a SMatrix<T, N, N>,
    /// The rows that make the pose error from those states.
    pub pose_from_error: SMatrix<T, 3, N>,
}

impl<T: Scalar, const N: usize> NavigationPose<'_, T, N> {
    /// Covariance of the pose.
    pub fn pose_covariance(&self) -> Matrix3<T> {
        self.pose_from_error * self.covariance * self.pose_from_error.transpose()
    }

    /// Refuses what cannot be a pose with its covariance.
    pub(crate) fn check(&self) -> Result<(), SkipReason> {
        if !self.pose.norm_squared().is_finite() || !self.covariance.norm_squared().is_finite() {
            Err(SkipReason::NotFinite)
        } else if self.covariance.diagonal().iter().any(|v| *v < T::zero()) {
            Err(SkipReason::Numerical)
        } else {
            Ok(())
        }
    }
}

/// A closed-loop navigation filter that a tracker can follow.
pub trait FollowedNavigation<T: Scalar, const N: usize> {
    /// How its error goes on while it propagates.
    type Transition: ErrorPropagation<T, N>;

    /// Brings its covariance up to its last inertial sample, and gives the transition that did so.
    fn catch_up(&mut self) -> Self::Transition;

    /// Its pose with the error's covariance, as of the last [`Self::catch_up`].
    fn navigation_pose(&self) -> NavigationPose<'_, T, N>;
}

/// What one aiding update did to a navigation filter's error: the time before it, then the correction.
pub trait FollowedUpdate<T: Scalar, const N: usize> {
    /// How the error went on since the update before.
    type Transition: ErrorPropagation<T, N>;

    /// The time before the correction, and the correction.
    fn error_steps(&self) -> (&Self::Transition, &ErrorFeedback<T, N>);
}

/// One scalar measurement of a single error state, as a filter fused it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
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
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[must_use = "the navigation filter must be given it, or both believe different things"]
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
