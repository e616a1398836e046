//! Error metrics against a reference: total, heading and inclination error, RMS, NEES.
//!
//! The metric of the BROAD benchmark (Laidig et al., 2021). The error rotation in the world frame
//! is `e = q_est * conj(q_ref)`; its angle is the total error, its part about the vertical the
//! heading error, the rest the inclination error. A wrong north counts, unless nothing said where north is: then the
//! heading counts from an arbitrary direction, its constant part is removed, and NEES is that of the tilt.

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector2};
use northing_core::geometry::so3;
use northing_core::kalman::covariance::normalized_square;
use serde::Serialize;

use crate::statistics::attitude_std::tilt_covariance;
use crate::statistics::consistency::nees_in_words;
use crate::statistics::heading_errors::HeadingErrors;

/// Error of one estimate, rad.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeError {
    /// Angle of the whole error rotation, `2 acos |e_w|`, 0 to pi.
    pub total: f64,
    /// Part about the vertical, `2 atan(e_z / e_w)`, signed, -pi to pi; positive where the estimate
    /// is turned counter-clockwise seen against the third world axis.
    pub heading: f64,
    /// Part about a horizontal axis, `2 acos sqrt(e_w^2 + e_z^2)`, 0 to pi.
    pub inclination: f64,
}

impl AttitudeError {
    /// The error of `estimate` against `reference`, both `world_from_body`.
    #[must_use]
    pub fn between(estimate: &UnitQuaternion<f64>, reference: &UnitQuaternion<f64>) -> Self {
        let e = estimate * reference.inverse();
        // An error and its negative quaternion are the same rotation: take the one with w >= 0.
        let sign = 1.0_f64.copysign(e.w);
        // Arc tangents say the same as the arc cosines of the definition, but exactly near zero.
        Self {
            total: 2.0 * e.imag().norm().atan2(e.w.abs()),
            heading: 2.0 * (sign * e.k).atan2(e.w.abs()),
            inclination: 2.0 * e.i.hypot(e.j).atan2(e.w.hypot(e.k)),
        }
    }

    /// Whether all parts are finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        (self.total + self.heading + self.inclination).is_finite()
    }
}

crate::named! {
    /// What says where north is; it decides what of an attitude can be judged.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
    #[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
    #[serde(rename_all = "kebab-case")]
    pub enum HeadingReference {
        /// A magnetometer or a compass was fused.
        Measured = "measured",
        /// The state at the start knew north, and nothing was fused since.
        Initial = "initial",
        /// Nothing: the heading counts from an arbitrary direction.
        Arbitrary = "arbitrary",
        /// The device that reported the attitude.
        Device = "device",
    }
}

impl HeadingReference {
    /// Whether a heading error can be judged as it is.
    #[must_use]
    pub const fn is_known(self) -> bool {
        !matches!(self, Self::Arbitrary)
    }
}

/// RMS errors over the scored samples, deg: the `error_deg` of a summary.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct ErrorSummary {
    /// RMS of the total error, deg. Where the heading is arbitrary, after the constant `heading_offset` is removed.
    pub total_rmse: f64,
    /// RMS of the heading error, deg. Where the heading is arbitrary, after the constant `heading_offset` is removed.
    pub heading_rmse: f64,
    /// RMS of the inclination (tilt) error, deg.
    pub inclination_rmse: f64,
    /// Mean direction of the heading errors, deg: their constant part.
    pub heading_offset: f64,
    /// Whether it is removed from `total_rmse` and `heading_rmse`: where nothing said where north is.
    pub heading_offset_removed: bool,
    /// RMS of the heading error after `heading_offset` is removed, deg.
    pub heading_aligned_rmse: f64,
    /// RMS of the change of the heading error since the first scored sample, deg.
    pub heading_drift_rmse: f64,
    /// That change at the last scored sample, deg, signed; beyond 180 it counts on.
    pub heading_drift_end: f64,
    /// Samples that count in them.
    pub scored_samples: u64,
    /// Estimates that are not finite and therefore do not count; left out of JSON when 0.
    #[serde(skip_serializing_if = "is_zero")]
    #[cfg_attr(feature = "typescript", ts(as = "Option<u64>", optional))]
    pub not_finite_samples: u64,
}

#[expect(
    clippy::trivially_copy_pass_by_ref,
    reason = "serde asks for a reference"
)]
fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// Mean NEES of an attitude: the `nees` of a summary.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct NeesSummary {
    /// Over the components that can be judged, per degree of freedom: 1 when the covariance is consistent.
    pub mean: f64,
    /// How many these are: 3, or 2 (tilt alone) where the heading is arbitrary.
    pub degrees_of_freedom: u8,
    /// Of the tilt alone, per degree of freedom (2).
    pub tilt_mean: f64,
}

impl NeesSummary {
    /// Whether the covariance is consistent, in words, with what it is judged over.
    #[must_use]
    pub fn in_words(&self) -> String {
        let words = nees_in_words(self.mean);
        match self.degrees_of_freedom {
            2 => format!("{words}; of the tilt alone, as nothing said where north is"),
            _ => words,
        }
    }
}

/// Gathers errors and their normalised squares in constant memory.
#[derive(Debug, Clone, Default)]
pub struct ErrorStatistics {
    squares: [f64; 3],
    samples: u64,
    not_finite: u64,
    headings: HeadingErrors,
    nees: Mean,
    tilt_nees: Mean,
}

#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    sum: f64,
    count: u64,
}

impl Mean {
    fn add(&mut self, value: Option<f64>) {
        if let Some(value) = value {
            self.sum += value;
            self.count += 1;
        }
    }

    fn per(self, degrees_of_freedom: u8) -> Option<f64> {
        let count = self.count as f64 * f64::from(degrees_of_freedom);
        (self.count > 0).then(|| self.sum / count)
    }
}

impl ErrorStatistics {
    /// Adds one scored estimate with the covariance it claims, if it claims one. An estimate that
    /// is not finite does not count in the errors, and is counted by itself.
    pub fn add(
        &mut self,
        estimate: &UnitQuaternion<f64>,
        covariance: Option<&Matrix3<f64>>,
        reference: &UnitQuaternion<f64>,
    ) {
        let error = AttitudeError::between(estimate, reference);
        if !error.is_finite() {
            self.not_finite += 1;
            return;
        }
        let parts = [error.total, error.heading, error.inclination];
        for (sum, part) in self.squares.iter_mut().zip(parts) {
            *sum += part * part;
        }
        self.samples += 1;
        self.headings.add(error.heading, error.inclination);
        if let Some(p) = covariance {
            self.nees.add(attitude_nees(estimate, p, reference));
            self.tilt_nees.add(tilt_nees(estimate, p, reference));
        }
    }

    /// The RMS errors; `None` when nothing was scored.
    #[must_use]
    pub fn summary(&self, heading: HeadingReference) -> Option<ErrorSummary> {
        let rms_deg = |sum: f64| (sum / self.samples as f64).sqrt().to_degrees();
        let aligned = self.headings.aligned()?;
        let removed = !heading.is_known();
        let [total, heading] = match removed {
            true => [
                aligned.total_rms.to_degrees(),
                aligned.heading_rms.to_degrees(),
            ],
            false => [rms_deg(self.squares[0]), rms_deg(self.squares[1])],
        };
        Some(ErrorSummary {
            total_rmse: total,
            heading_rmse: heading,
            inclination_rmse: rms_deg(self.squares[2]),
            heading_offset: aligned.offset.to_degrees(),
            heading_offset_removed: removed,
            heading_aligned_rmse: aligned.heading_rms.to_degrees(),
            heading_drift_rmse: self.headings.drift_rms().to_degrees(),
            heading_drift_end: self.headings.drift().to_degrees(),
            scored_samples: self.samples,
            not_finite_samples: self.not_finite,
        })
    }

    /// Estimates that were to be scored and are not finite.
    #[must_use]
    pub fn not_finite(&self) -> u64 {
        self.not_finite
    }

    /// Mean NEES; `None` for estimators without covariance.
    #[must_use]
    pub fn nees(&self, heading: HeadingReference) -> Option<NeesSummary> {
        let tilt_mean = self.tilt_nees.per(2)?;
        let (mean, degrees_of_freedom) = match heading.is_known() {
            true => (self.nees.per(3)?, 3),
            false => (tilt_mean, 2),
        };
        Some(NeesSummary {
            mean,
            degrees_of_freedom,
            tilt_mean,
        })
    }
}

/// Normalised estimation error squared of an attitude: `a^T P^-1 a` with the local error `a` of
/// `q_ref = q_est * Exp(a)` in body axes; chi-square with 3 degrees of freedom when `covariance`
/// (rad^2) is consistent. `None` where the covariance is not positive definite.
#[must_use]
pub fn attitude_nees(
    estimate: &UnitQuaternion<f64>,
    covariance: &Matrix3<f64>,
    reference: &UnitQuaternion<f64>,
) -> Option<f64> {
    let a = so3::log(&(estimate.inverse() * reference));
    normalized_square(&a, covariance)
}

/// Normalised error squared of the tilt alone: chi-square with 2 degrees of freedom when `covariance` (rad^2, local error
/// in body axes) is consistent, whatever the heading and its variance. `None` where the covariance is not positive definite.
#[must_use]
pub fn tilt_nees(
    estimate: &UnitQuaternion<f64>,
    covariance: &Matrix3<f64>,
    reference: &UnitQuaternion<f64>,
) -> Option<f64> {
    let tilt = tilt_covariance(estimate, covariance);
    normalized_square(&tilt_error(estimate, reference), &tilt)
}

/// The turn (rad) about the two horizontal axes of the world that takes the tilt of `estimate` to that of `reference`
/// once their headings agree. Its length is the inclination error.
#[must_use]
pub fn tilt_error(estimate: &UnitQuaternion<f64>, reference: &UnitQuaternion<f64>) -> Vector2<f64> {
    let error = estimate * reference.inverse();
    // The twist about the vertical, and what is left of the error without it; upside down there is none.
    let twist = Quaternion::new(error.w, 0.0, 0.0, error.k);
    let twist = UnitQuaternion::try_new(twist, f64::MIN_POSITIVE).unwrap_or_default();
    so3::log(&(twist * error.inverse())).xy()
}

#[cfg(test)]
mod tests;
