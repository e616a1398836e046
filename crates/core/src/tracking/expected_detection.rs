//! What a scan should show of a target under one motion model: computed once, then compared with every detection of the scan.
//!
//! Equations: `docs/derivations/association.md`, sections 1 and 3.

use nalgebra::{Matrix2, Matrix3x2, SMatrix, Vector2};

use super::association::gate::AssociationGate;
use super::coordinated_turn::{STATES, TargetCovariance};
use super::detection::{CrossCovariance, Detection, DetectionKind, Prediction, SchmidtInnovation};
use super::echo::{Echo, EchoCovariance};
use super::imm::Mode;
use super::multi_target::Scan;
use super::own_ship::OwnShip;
use crate::kalman::innovation::SkipReason;
use crate::scalar::{Scalar, lit};

/// The detection expected of a target, and the scale of what is seen instead.
#[derive(Debug, Clone, Copy)]
pub(super) struct ExpectedDetection<T> {
    expected: Vector2<T>,
    scale: ResidualScale<T>,
}

impl<T: Scalar> ExpectedDetection<T> {
    /// What `scan` should show of a target, or why nothing can be said.
    pub(super) fn new(
        kind: DetectionKind,
        mode: &Mode<T>,
        scan: &Scan<'_, T>,
        echo: &Echo<T>,
    ) -> Result<Self, SkipReason> {
        let (expected, prediction) = kind
            .predict(&mode.state, scan.own_ship, &echo.noise)
            .ok_or(SkipReason::Unobservable)?;
        let scale = prediction
            .scale(
                &mode.covariance,
                &mode.cross,
                scan.own_ship,
                (&mode.echo, echo.lasting),
            )
            .ok_or(SkipReason::Numerical)?;
        Ok(Self { expected, scale })
    }

    /// Whether a detection can lie in the gate, told from range or north alone: the normalised square of one component is never
    /// more than that of both. Cheap, and never wrong about one that lies inside: a thousandth is left for rounding.
    pub(super) fn can_contain(&self, detection: &Detection<T>, gate: &AssociationGate<T>) -> bool {
        let away = match *detection {
            Detection::RangeBearing { range_m, .. } => range_m - self.expected.x,
            Detection::Position { north_m, .. } => north_m - self.expected.x,
            Detection::Bearing { .. } => return true,
        };
        let reach = gate.sigmas * gate.sigmas * self.scale.covariance[(0, 0)];
        away * away <= reach * lit(1.001)
    }

    /// NIS and density of a detection, or why it cannot be weighed.
    pub(super) fn weigh(&self, detection: &Detection<T>) -> Result<(T, T), SkipReason> {
        let nis = self.scale.nis(&detection.minus(&self.expected));
        let likelihood = self.scale.likelihood(nis);
        if nis.is_finite() && likelihood.is_finite() {
            Ok((nis, likelihood))
        } else {
            Err(SkipReason::Numerical)
        }
    }

    /// A detection with all that an update needs; `None` when it cannot be weighed.
    pub(super) fn innovation(&self, detection: &Detection<T>) -> Option<SchmidtInnovation<T>> {
        self.scale.innovation(detection.minus(&self.expected))
    }
}

impl<T: Scalar> Prediction<T> {
    /// What residuals are weighed with, which does not depend on them; `None` when their covariance is not positive. `echo` is the
    /// covariance of the target's error with the echo's place that stays, and the variance of that (m^2; 0 where none does).
    pub(super) fn scale(
        &self,
        p: &TargetCovariance<T>,
        x: &CrossCovariance<T>,
        own: &OwnShip<T>,
        (echo, lasting): (&EchoCovariance<T>, T),
    ) -> Option<ResidualScale<T>> {
        let (ht, ho) = (&self.target_jacobian, &self.pose_jacobian);
        // (D4)
        let mut a = p * ht.transpose() + x * ho.transpose();
        let o = x.transpose() * ht.transpose() + own.covariance * ho.transpose();
        let mut s = ht * a + ho * o + self.noise;
        let mut echo_covariance = None;
        if lasting > T::zero() {
            // (N4): an echo's place moves a detection as the target's own does.
            let he = Matrix2::from_columns(&[ht.column(0), ht.column(2)]);
            let of_echo = echo * he.transpose();
            let e = echo.transpose() * ht.transpose() + he.transpose() * lasting;
            a += of_echo;
            s += ht * of_echo + he * e;
            echo_covariance = Some(e);
        }
        let off = (s[(0, 1)] + s[(1, 0)]) * lit(0.5);
        let determinant = s[(0, 0)] * s[(1, 1)] - off * off;
        if !(s[(0, 0)] > T::zero() && determinant > T::zero() && determinant.is_finite()) {
            return None;
        }
        let inverse = Matrix2::new(s[(1, 1)], -off, -off, s[(0, 0)]) / determinant;
        let dimension = if self.degrees_of_freedom == 2 {
            T::two_pi()
        } else {
            T::two_pi().sqrt()
        };
        Some(ResidualScale {
            covariance: Matrix2::new(s[(0, 0)], off, off, s[(1, 1)]),
            inverse,
            volume: dimension * determinant.sqrt(),
            gain: a * inverse,
            pose_covariance: o,
            echo_covariance,
            degrees_of_freedom: self.degrees_of_freedom,
        })
    }
}

/// What every residual of one target and kind of detection is weighed with (D4).
#[derive(Debug, Clone, Copy)]
pub(super) struct ResidualScale<T> {
    /// `S`.
    pub covariance: Matrix2<T>,
    inverse: Matrix2<T>,
    /// One over the density of a residual of zero.
    volume: T,
    gain: SMatrix<T, STATES, 2>,
    pose_covariance: Matrix3x2<T>,
    echo_covariance: Option<Matrix2<T>>,
    degrees_of_freedom: u8,
}

impl<T: Scalar> ResidualScale<T> {
    /// Normalised innovation squared.
    pub(super) fn nis(&self, residual: &Vector2<T>) -> T {
        residual.dot(&(self.inverse * residual))
    }

    /// The density of a residual with this NIS.
    pub(super) fn likelihood(&self, nis: T) -> T {
        (nis * lit(-0.5)).exp() / self.volume
    }

    /// The residual with all that an update needs; `None` when a number overflows.
    pub(super) fn innovation(&self, residual: Vector2<T>) -> Option<SchmidtInnovation<T>> {
        let nis = self.nis(&residual);
        Some(SchmidtInnovation {
            residual,
            covariance: self.covariance,
            nis,
            likelihood: self.likelihood(nis),
            gain: self.gain,
            pose_covariance: self.pose_covariance,
            echo_covariance: self.echo_covariance,
            degrees_of_freedom: self.degrees_of_freedom,
        })
        .filter(|i| i.nis.is_finite() && i.likelihood.is_finite())
    }
}
