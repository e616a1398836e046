//! Error metrics against a reference: total, heading and inclination error, RMS, NEES.
//!
//! The metric of the BROAD benchmark (Laidig et al., 2021). The error rotation in the world frame
//! is `e = q_est * conj(q_ref)`; its angle is the total error, its part about the vertical the
//! heading error, the rest the inclination error. No alignment of any kind: a wrong north counts.

use nalgebra::{Matrix3, UnitQuaternion};
use northing_core::geometry::so3;
use northing_core::kalman::covariance::normalized_square;
use serde::Serialize;

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

/// RMS errors over the scored samples, deg: the `error_deg` of a summary.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct ErrorSummary {
    /// RMS of the total error, deg.
    pub total_rmse: f64,
    /// RMS of the heading error, deg.
    pub heading_rmse: f64,
    /// RMS of the inclination error, deg.
    pub inclination_rmse: f64,
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

/// Gathers errors and their normalised squares in constant memory.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ErrorStatistics {
    squares: [f64; 3],
    samples: u64,
    not_finite: u64,
    nees: f64,
    nees_samples: u64,
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
        if let Some(nees) = covariance.and_then(|p| attitude_nees(estimate, p, reference)) {
            self.nees += nees;
            self.nees_samples += 1;
        }
    }

    /// The RMS errors; `None` when nothing was scored.
    #[must_use]
    pub fn summary(&self) -> Option<ErrorSummary> {
        let rms_deg = |sum: f64| (sum / self.samples as f64).sqrt().to_degrees();
        (self.samples > 0).then(|| ErrorSummary {
            total_rmse: rms_deg(self.squares[0]),
            heading_rmse: rms_deg(self.squares[1]),
            inclination_rmse: rms_deg(self.squares[2]),
            scored_samples: self.samples,
            not_finite_samples: self.not_finite,
        })
    }

    /// Estimates that were to be scored and are not finite.
    #[must_use]
    pub fn not_finite(&self) -> u64 {
        self.not_finite
    }

    /// Mean NEES per degree of freedom: 1 when the covariance is consistent, above when it is too
    /// small. `None` for estimators without covariance.
    #[must_use]
    pub fn nees_per_degree_of_freedom(&self) -> Option<f64> {
        (self.nees_samples > 0).then(|| self.nees / (3.0 * self.nees_samples as f64))
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

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use nalgebra::{Quaternion, Vector3};

    fn turn(x: f64, y: f64, z: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(Vector3::new(x, y, z))
    }

    #[test]
    fn a_turn_about_the_vertical_is_heading_and_any_other_is_inclination() {
        let reference = turn(0.4, -1.0, 2.0);
        let heading = AttitudeError::between(&(turn(0.0, 0.0, -0.3) * reference), &reference);
        assert_relative_eq!(heading.heading, -0.3, epsilon = 1e-12);
        assert_relative_eq!(heading.total, 0.3, epsilon = 1e-12);
        assert_relative_eq!(heading.inclination, 0.0, epsilon = 1e-12);
        let tilted = AttitudeError::between(&(turn(0.1, -0.2, 0.0) * reference), &reference);
        assert_relative_eq!(tilted.inclination, 0.05_f64.sqrt(), epsilon = 1e-12);
        assert_relative_eq!(tilted.heading, 0.0, epsilon = 1e-12);
    }

    /// The definition with its arc cosines, on an error with all parts, for both signs of it.
    #[test]
    fn the_parts_are_those_of_the_definition() {
        let (reference, error) = (turn(1.0, 0.3, -0.2), turn(0.5, -0.7, 1.9));
        for sign in [1.0, -1.0] {
            let flipped = Quaternion::from(error.coords * sign);
            let e = UnitQuaternion::new_unchecked(flipped);
            let got = AttitudeError::between(&(e * reference), &reference);
            assert_relative_eq!(got.total, 2.0 * error.w.abs().acos(), epsilon = 1e-9);
            assert_relative_eq!(
                got.heading,
                2.0 * (error.k / error.w).atan(),
                epsilon = 1e-9
            );
            let level = error.w.hypot(error.k);
            assert_relative_eq!(got.inclination, 2.0 * level.acos(), epsilon = 1e-9);
        }
    }

    #[test]
    fn rms_is_in_degrees_and_counts_only_finite_estimates() {
        let identity = UnitQuaternion::identity();
        let mut statistics = ErrorStatistics::default();
        assert_eq!(statistics.summary(), None);
        statistics.add(&turn(0.0, 0.0, 3_f64.to_radians()), None, &identity);
        statistics.add(&turn(0.0, 0.0, -4_f64.to_radians()), None, &identity);
        let nan = UnitQuaternion::new_unchecked(Quaternion::new(f64::NAN, 0.0, 0.0, 0.0));
        statistics.add(&nan, None, &identity);
        let summary = statistics.summary().unwrap();
        assert_relative_eq!(summary.heading_rmse, 12.5_f64.sqrt(), epsilon = 1e-9);
        assert_eq!(summary.scored_samples, 2);
        assert_eq!(statistics.nees_per_degree_of_freedom(), None);
    }

    #[test]
    fn nees_is_one_per_degree_of_freedom_at_one_sigma_on_each_axis() {
        let (estimate, std) = (turn(0.2, 0.9, -0.5), Vector3::new(0.01, 0.02, 0.05));
        let p = Matrix3::from_diagonal(&std.component_mul(&std));
        let reference = estimate * turn(std.x, -std.y, std.z);
        assert_relative_eq!(
            attitude_nees(&estimate, &p, &reference).unwrap(),
            3.0,
            epsilon = 1e-9
        );
        let mut statistics = ErrorStatistics::default();
        statistics.add(&estimate, Some(&p), &reference);
        let mean = statistics.nees_per_degree_of_freedom().unwrap();
        assert_relative_eq!(mean, 1.0, epsilon = 1e-9);
        assert_eq!(
            attitude_nees(&estimate, &Matrix3::zeros(), &reference),
            None
        );
    }
}
