//! Aiding of the error-state filter: a GNSS compass, as position and attitude.
//!
//! Each component of a fix measures a single error state in NED axes, so the update is a row of
//! scalar updates ([`crate::kalman::scalar_update::update_one_state`]), equal to the joint update
//! exactly. Other aiding belongs beside this one: make a list of `(state, residual, variance)` and
//! hand it to `fuse`.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::ErrorStateFilter;
use crate::geometry::rotation::is_unit;
use crate::geometry::so3;
use crate::kalman::covariance::{normalized_square3, part};
use crate::kalman::scalar_update::update_one_state;
use crate::kalman::{ErrorFeedback, ErrorListener, Innovation, Outcome, SkipReason};
use crate::navigation::{ATTITUDE, ErrorTransition, POSITION, STATES};
use crate::scalar::{Scalar, lit};

/// A position further away (m) is none, nor a fix whose standard deviations are larger (m, rad).
const FURTHEST_M: f64 = 1e8;
const LARGEST_STD_M: f64 = 1e6;
const LARGEST_STD_RAD: f64 = 10.0;

/// What a GNSS compass says at one instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GnssCompassFix<T: Scalar> {
    /// Position, m, NED.
    pub position: Vector3<T>,
    /// Standard deviations of the position, m, NED; each above zero.
    pub position_std: Vector3<T>,
    /// Attitude, `ned_from_body`.
    pub ned_from_body: UnitQuaternion<T>,
    /// Standard deviations of the rotation about the NED axes, rad; each above zero. The third is
    /// that of the heading.
    pub attitude_std: Vector3<T>,
}

/// What an update did.
#[derive(Debug, Clone, Copy, PartialEq)]
#[must_use = "whoever is correlated with the filter's error must be told, or the joint covariance is wrong"]
pub struct GnssCompassUpdate<T: Scalar> {
    /// Transition of the errors since the update before.
    pub transition: ErrorTransition<T>,
    /// What was then corrected; empty when the fix was skipped.
    pub feedback: ErrorFeedback<T, STATES>,
    /// The position's part, m.
    pub position: Innovation<T>,
    /// The attitude's part, rad, NED axes: what the position had not told yet.
    pub attitude: Innovation<T>,
}

impl<T: Scalar> GnssCompassFix<T> {
    /// A position (m, NED) and an attitude (`ned_from_body`), each with one standard deviation for all axes (m, rad).
    pub fn new(
        position: Vector3<T>,
        position_std: T,
        ned_from_body: UnitQuaternion<T>,
        attitude_std: T,
    ) -> Self {
        Self {
            position,
            position_std: Vector3::repeat(position_std),
            ned_from_body,
            attitude_std: Vector3::repeat(attitude_std),
        }
    }
}

impl<T: Scalar> GnssCompassUpdate<T> {
    /// Gives it all to a listener: the time before the correction, then the correction. None may be left out.
    #[inline]
    pub fn tell(&self, listener: &mut impl ErrorListener<T, STATES>) {
        listener.propagated(&self.transition);
        self.feedback.tell(listener);
    }
}

impl<T: Scalar> ErrorStateFilter<T> {
    /// Fuses a fix (E10). One that holds a number that is not finite, or a standard deviation
    /// that is not positive or absurdly large, is skipped and counted; the covariance still catches up.
    pub fn update_gnss_compass(&mut self, fix: &GnssCompassFix<T>) -> GnssCompassUpdate<T> {
        let transition = self.catch_up();
        if let Err(reason) = fix.check() {
            self.count_skipped();
            return GnssCompassUpdate {
                transition,
                feedback: ErrorFeedback::default(),
                position: Innovation::skipped(reason),
                attitude: Innovation::skipped(reason),
            };
        }
        // nu = [z_p - p ; Log(C_z C^T)], H = [0 0 I 0 0 ; I 0 0 0 0]
        let state = &self.state;
        let off_by = fix.position - state.position;
        let turned_by = so3::log(&(fix.ned_from_body * state.ned_from_body.inverse()));
        let measurements = [
            (POSITION, off_by, fix.position_std),
            (ATTITUDE, turned_by, fix.attitude_std),
        ];
        let mut correction = nalgebra::SVector::zeros();
        let mut feedback = ErrorFeedback::default();
        let [position, attitude] = measurements.map(|(first, residual, std)| {
            self.fuse(first, &residual, &std, &mut correction, &mut feedback)
        });
        let reset = self.inject(&correction);
        feedback.set_reset(reset);
        GnssCompassUpdate {
            transition,
            feedback,
            position,
            attitude,
        }
    }

    /// Three scalar measurements of the states `first..first + 3`.
    fn fuse(
        &mut self,
        first: usize,
        residual: &Vector3<T>,
        std: &Vector3<T>,
        correction: &mut nalgebra::SVector<T, STATES>,
        feedback: &mut ErrorFeedback<T, STATES>,
    ) -> Innovation<T> {
        let variance = std.component_mul(std);
        let p = &mut self.state.covariance;
        let block: Matrix3<T> = part(p, first, first);
        let expected = block + Matrix3::from_diagonal(&variance);
        let unexplained = residual - correction.fixed_rows::<3>(first);
        let nis = normalized_square3(&unexplained, &expected);
        let mut fused = nis.is_some();
        for i in 0..3 {
            let done = update_one_state(p, correction, first + i, residual[i], variance[i]);
            fused &= done.is_some_and(|done| feedback.push(done));
        }
        Innovation {
            residual: unexplained,
            covariance: expected,
            nis: nis.unwrap_or_else(T::zero),
            degrees_of_freedom: 3,
            outcome: if fused {
                Outcome::Fused
            } else {
                Outcome::Skipped(SkipReason::Numerical)
            },
        }
    }
}

impl<T: Scalar> GnssCompassFix<T> {
    fn check(&self) -> Result<(), SkipReason> {
        let finite = [&self.position, &self.position_std, &self.attitude_std]
            .iter()
            .all(|v| v.norm_squared().is_finite())
            && self.ned_from_body.as_ref().norm_squared().is_finite();
        let within = |v: &Vector3<T>, limit: f64| v.iter().all(|x| *x <= lit(limit));
        let stds = self.position_std.iter().chain(self.attitude_std.iter());
        if !finite {
            Err(SkipReason::NotFinite)
        } else if stds.copied().all(|std| std > T::zero())
            && within(&self.position.abs(), FURTHEST_M)
            && within(&self.position_std, LARGEST_STD_M)
            && within(&self.attitude_std, LARGEST_STD_RAD)
            && is_unit(&self.ned_from_body)
        {
            Ok(())
        } else {
            Err(SkipReason::OutOfRange)
        }
    }
}
