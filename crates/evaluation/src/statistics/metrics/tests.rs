//! Errors and their normalised squares on attitudes made by hand.

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
    assert_eq!(statistics.summary(HeadingReference::Measured), None);
    statistics.add(&turn(0.0, 0.0, 3_f64.to_radians()), None, &identity);
    statistics.add(&turn(0.0, 0.0, -4_f64.to_radians()), None, &identity);
    let nan = UnitQuaternion::new_unchecked(Quaternion::new(f64::NAN, 0.0, 0.0, 0.0));
    statistics.add(&nan, None, &identity);
    let summary = statistics.summary(HeadingReference::Measured).unwrap();
    assert_relative_eq!(summary.heading_rmse, 12.5_f64.sqrt(), epsilon = 1e-9);
    assert_eq!(summary.scored_samples, 2);
    assert_eq!(statistics.nees(HeadingReference::Measured), None);
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
    let nees = statistics.nees(HeadingReference::Measured).unwrap();
    assert_relative_eq!(nees.mean, 1.0, epsilon = 1e-9);
    assert_eq!(nees.degrees_of_freedom, 3);
    assert_eq!(
        attitude_nees(&estimate, &Matrix3::zeros(), &reference),
        None
    );
}

/// Estimates whose heading counts from elsewhere and drifts by 8 deg: the tilt's error is as stated, and neither the
/// offset nor the variance of the heading changes what is said of it.
#[test]
fn an_arbitrary_heading_leaves_tilt_and_drift() {
    let std = Vector3::new(0.01, 0.02, 3.0);
    let level = Matrix3::from_diagonal(&std.component_mul(&std));
    let mut statistics = ErrorStatistics::default();
    for k in 0..=800 {
        let reference = turn(0.3, -0.8, 0.01 * f64::from(k));
        let drift = 1.5 + (0.01 * f64::from(k)).to_radians();
        let estimate = turn(0.0, 0.0, drift) * turn(0.01, 0.0, 0.0) * reference;
        let axes = estimate.to_rotation_matrix().into_inner();
        // The error is along the first axis before the estimate's heading is turned.
        let heading = turn(0.0, 0.0, drift).to_rotation_matrix().into_inner();
        let world = heading * level * heading.transpose();
        let body = axes.transpose() * world * axes;
        statistics.add(&estimate, Some(&body), &reference);
    }
    let heading = HeadingReference::Arbitrary;
    let summary = statistics.summary(heading).unwrap();
    assert!(summary.heading_offset_removed);
    assert_relative_eq!(
        summary.inclination_rmse,
        0.01_f64.to_degrees(),
        epsilon = 1e-9
    );
    assert_relative_eq!(
        summary.heading_offset,
        1.5_f64.to_degrees() + 4.0,
        epsilon = 1e-6
    );
    assert_relative_eq!(summary.heading_drift_end, 8.0, epsilon = 1e-9);
    // Of a line from 0 to 8: 8 / sqrt 3 from its start, 8 / sqrt 12 about its middle.
    assert_relative_eq!(
        summary.heading_drift_rmse,
        8.0 / 3.0_f64.sqrt(),
        epsilon = 0.01
    );
    assert_relative_eq!(summary.heading_rmse, 8.0 / 12.0_f64.sqrt(), epsilon = 0.01);
    assert_relative_eq!(
        summary.heading_aligned_rmse,
        summary.heading_rmse,
        epsilon = 1e-12
    );
    let total = summary.heading_rmse.hypot(summary.inclination_rmse);
    assert_relative_eq!(summary.total_rmse, total, epsilon = 1e-3);
    let nees = statistics.nees(heading).unwrap();
    assert_eq!(nees.degrees_of_freedom, 2);
    assert_relative_eq!(nees.mean, 0.5, epsilon = 1e-6);
    let known = statistics.summary(HeadingReference::Measured).unwrap();
    assert!(
        known.total_rmse > 80.0 && known.heading_rmse > 80.0,
        "{known:?}"
    );
    assert_relative_eq!(
        known.heading_aligned_rmse,
        summary.heading_rmse,
        epsilon = 1e-12
    );
}

#[test]
fn the_tilt_error_is_the_inclination_with_its_axis() {
    for (estimate, reference) in [
        (turn(0.4, -1.0, 2.0), turn(-0.2, 0.5, -1.0)),
        (turn(3.0, 0.1, 0.0), turn(0.0, 0.0, 0.4)),
    ] {
        let tilt = tilt_error(&estimate, &reference);
        let error = AttitudeError::between(&estimate, &reference);
        assert_relative_eq!(tilt.norm(), error.inclination, epsilon = 1e-9);
        let turned = turn(tilt.x, tilt.y, 0.0) * estimate;
        let left = AttitudeError::between(&turned, &reference);
        assert!(left.inclination < 1e-7, "{left:?}");
    }
}
