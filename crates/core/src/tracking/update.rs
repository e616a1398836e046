//! The measurement update that all trackers share: two components, gain from `a = cov(x, nu)`.

use nalgebra::{Matrix2, Matrix3, Matrix4, SMatrix, Vector2, Vector3};

use super::TrackEstimate;
use super::line_of_sight::{LineOfSight, SeenTrack, Turn};
use crate::kalman::covariance::{rounding_reserve, symmetrize};
use crate::kalman::{Innovation, Outcome, SkipReason};
use crate::scalar::{Scalar, lit};

/// What a measurement is to a target: residual, its covariance `S`, and `a = cov(x, nu)`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Measured<T: Scalar> {
    pub(super) residual: Vector2<T>,
    pub(super) covariance: Matrix2<T>,
    pub(super) target: SMatrix<T, 4, 2>,
}

/// What a measurement that was used has done to a target.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fused<T: Scalar> {
    /// `K`.
    pub(super) gain: SMatrix<T, 4, 2>,
    /// What the arc has done to its errors, where it is one.
    pub(super) turn: Option<Turn<T>>,
}

/// The inverse of a positive definite 2 by 2 matrix.
#[inline]
pub(super) fn inverse2<T: Scalar>(s: &Matrix2<T>) -> Option<Matrix2<T>> {
    let (a, b, d) = (s[(0, 0)], s[(0, 1)], s[(1, 1)]);
    let determinant = a * d - b * b;
    if !(a > T::zero() && determinant > T::zero() && determinant.is_finite()) {
        return None;
    }
    let i = T::one() / determinant;
    i.is_finite()
        .then(|| Matrix2::new(d * i, -b * i, -b * i, a * i))
}

impl<T: Scalar> Measured<T> {
    /// The record of this measurement, whatever became of it.
    fn innovation(&self, nis: T, outcome: Outcome) -> Innovation<T> {
        let (r, s) = (&self.residual, &self.covariance);
        let zero = T::zero();
        Innovation {
            residual: Vector3::new(r.x, r.y, zero),
            covariance: Matrix3::new(
                s[(0, 0)],
                s[(0, 1)],
                zero,
                s[(1, 0)],
                s[(1, 1)],
                zero,
                zero,
                zero,
                zero,
            ),
            nis,
            degrees_of_freedom: 2,
            outcome,
        }
    }

    /// Numerics do not bear the update: correlations are forgotten, so that they bear the next one.
    fn refuse(&self, track: &mut TrackEstimate<T>) -> Innovation<T> {
        track.covariance = Matrix4::from_diagonal(&track.covariance.diagonal());
        Innovation::skipped(SkipReason::Numerical)
    }

    /// `x <- x + K nu`, `P <- P - K S K^T` with `K = a S^-1` (S9). Gives the record, and what was done when the measurement was used.
    /// With a line of sight the step goes along the arc about the own ship (S19). A NIS above a positive `gate_nis` refuses it.
    #[inline]
    pub(super) fn fuse(
        &self,
        track: &mut SeenTrack<T>,
        gate_nis: T,
        sight: Option<LineOfSight<T>>,
    ) -> (Innovation<T>, Option<Fused<T>>) {
        let Some(inverse) = inverse2(&self.covariance) else {
            return (self.refuse(&mut track.tangent), None);
        };
        let weighted = inverse * self.residual;
        let nis = self.residual.dot(&weighted);
        if !nis.is_finite() {
            return (Innovation::skipped(SkipReason::NotFinite), None);
        }
        if nis < T::zero() {
            return (self.refuse(&mut track.tangent), None);
        }
        if gate_nis > T::zero() && nis > gate_nis {
            return (self.innovation(nis, Outcome::Gated), None);
        }
        let gain = self.target * inverse;
        let before = track.tangent.covariance;
        let mut covariance = before - gain * self.target.transpose();
        symmetrize(&mut covariance);
        for i in 0..4 {
            let removed = (before[(i, i)] - covariance[(i, i)]).max(T::zero());
            covariance[(i, i)] += rounding_reserve(removed);
        }
        let state = track.tangent.state;
        let tangent = TrackEstimate { state, covariance };
        let mut after = SeenTrack { tangent, sight };
        let turn = after.step(&(self.target * weighted));
        if !after.tangent.is_usable() {
            return (self.refuse(&mut track.tangent), None);
        }
        *track = after;
        let fused = Fused { gain, turn };
        (self.innovation(nis, Outcome::Fused), Some(fused))
    }

    /// The same for a form that is no recursion of a covariance as printed: nothing is mended, and what is not finite is
    /// not taken.
    pub(super) fn fuse_as_printed(
        &self,
        track: &mut TrackEstimate<T>,
        gate_nis: T,
    ) -> (Innovation<T>, Option<Fused<T>>) {
        let Some(inverse) = inverse2(&self.covariance) else {
            return (Innovation::skipped(SkipReason::Numerical), None);
        };
        let weighted = inverse * self.residual;
        let nis = self.residual.dot(&weighted);
        let gain = self.target * inverse;
        let mut after = TrackEstimate {
            state: track.state + self.target * weighted,
            covariance: track.covariance - gain * self.target.transpose(),
        };
        symmetrize(&mut after.covariance);
        let finite = after.covariance.norm_squared().is_finite();
        if !(nis.is_finite() && finite && after.is_within_limits()) {
            return (Innovation::skipped(SkipReason::NotFinite), None);
        }
        if gate_nis > T::zero() && nis > gate_nis {
            return (self.innovation(nis, Outcome::Gated), None);
        }
        *track = after;
        let turn = None;
        (
            self.innovation(nis, Outcome::Fused),
            Some(Fused { gain, turn }),
        )
    }
}

/// Half of `m + m^T`.
#[inline]
pub(super) fn symmetric2<T: Scalar>(m: &Matrix2<T>) -> Matrix2<T> {
    (m + m.transpose()) * lit::<T>(0.5)
}
