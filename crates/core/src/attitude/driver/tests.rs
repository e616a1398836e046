//! Stamps, gaps, mean rates and late sensors.

use super::*;
use crate::attitude::integration::Integration;
use crate::attitude::mekf::Mekf;
use crate::geometry::{rotation, so3};
use crate::kalman::Outcome;
use approx::assert_relative_eq;

const MS: i64 = 1_000_000;

fn mekf() -> AttitudeDriver<f64, Mekf<f64>> {
    let settings = AttitudeConfig::default();
    AttitudeDriver::new(
        Mekf::new(settings).unwrap(),
        settings,
        DriverConfig::default(),
    )
}

fn up() -> Vector3<f64> {
    Vector3::new(0.0, 0.0, 9.806_65)
}

fn north() -> Vector3<f64> {
    Vector3::new(0.0, 22.0, -42.0)
}

/// Feeds rest samples at 100 Hz from `from_ms` to `to_ms`.
fn rest(driver: &mut AttitudeDriver<f64, Mekf<f64>>, from_ms: i64, to_ms: i64, with_field: bool) {
    for t in (from_ms..to_ms).step_by(10) {
        driver.gyroscope(t * MS, &Vector3::zeros());
        driver.accelerometer(t * MS, &up());
        if with_field {
            driver.magnetometer(t * MS, &north());
        }
    }
}

#[test]
fn starts_after_the_alignment_and_not_before() {
    let mut driver = mekf();
    rest(&mut driver, 0, 500, true);
    assert!(!driver.is_started() && driver.attitude().is_none());
    rest(&mut driver, 500, 520, true);
    assert!(driver.is_started());
    assert!(driver.attitude().unwrap().angle() < 1e-9);
}

#[test]
fn without_an_accelerometer_it_starts_blind_after_four_times_as_long() {
    let mut driver = mekf();
    for t in (0..2100).step_by(10) {
        assert_eq!(driver.is_started(), t > 2000, "{t} ms");
        driver.gyroscope(t * MS, &Vector3::zeros());
    }
}

#[test]
fn repeated_and_older_samples_are_skipped() {
    let mut driver = mekf();
    rest(&mut driver, 0, 1000, true);
    let before = driver;
    let skipped = Outcome::Skipped(SkipReason::NotNewer);
    assert_eq!(
        driver.gyroscope(990 * MS, &Vector3::x()),
        Propagation::Skipped(SkipReason::NotNewer)
    );
    assert_eq!(
        driver.gyroscope(10 * MS, &Vector3::x()),
        Propagation::Skipped(SkipReason::NotNewer)
    );
    assert_eq!(driver.accelerometer(990 * MS, &up()).outcome, skipped);
    assert_eq!(driver.magnetometer(500 * MS, &north()).outcome, skipped);
    assert_eq!(driver, before);
}

#[test]
fn an_interval_turns_with_the_mean_of_its_two_rates_whatever_comes_between() {
    let start = InitialState {
        attitude: UnitQuaternion::identity(),
        attitude_covariance: nalgebra::Matrix3::identity(),
        gyroscope_bias: Vector3::zeros(),
        gyroscope_bias_std: 0.0,
        references: crate::attitude::References {
            specific_force: up(),
            magnetic_field: None,
        },
    };
    let turned = |between: &[i64]| {
        let mut driver = AttitudeDriver::new(
            Integration::default(),
            AttitudeConfig::default(),
            DriverConfig::default(),
        );
        driver.start_from(&start);
        driver.gyroscope(0, &Vector3::new(0.0, 0.0, 1.0));
        for t in between {
            driver.accelerometer(*t, &up());
        }
        driver.gyroscope(10 * MS, &Vector3::new(0.0, 0.0, 3.0));
        so3::log(&driver.attitude().unwrap()).z
    };
    assert_relative_eq!(turned(&[]), 0.02, epsilon = 1e-15);
    assert_relative_eq!(turned(&[2 * MS, 7 * MS]), 0.02, epsilon = 1e-15);
    assert_relative_eq!(turned(&[0, 9_999_999]), 0.02, epsilon = 1e-15);
}

#[test]
fn a_gap_holds_the_attitude_and_grows_the_covariance() {
    let mut driver = mekf();
    rest(&mut driver, 0, 3000, true);
    driver.gyroscope(3000 * MS, &Vector3::new(0.0, 0.0, 2.0));
    let before = driver.estimator.attitude_covariance().unwrap();
    let attitude = driver.attitude().unwrap();
    // Five seconds of silence, then the rate is still what it was: nobody knows what happened.
    driver.gyroscope(8000 * MS, &Vector3::new(0.0, 0.0, 2.0));
    let after = driver.estimator.attitude_covariance().unwrap();
    let held_for_the_limit = attitude * so3::exp(&Vector3::new(0.0, 0.0, 2.0 * 0.5));
    assert!(rotation::angle_between(&driver.attitude().unwrap(), &held_for_the_limit) < 0.02);
    assert!(after[(2, 2)] > before[(2, 2)] + 0.5 * 0.5 * 4.0);
}

#[test]
fn a_day_of_silence_ends_at_the_cap_and_in_bounded_time() {
    let mut driver = mekf();
    rest(&mut driver, 0, 1000, true);
    driver.gyroscope(86_400_000 * MS, &Vector3::zeros());
    let p = driver.estimator.attitude_covariance().unwrap();
    assert_relative_eq!(p[(0, 0)].sqrt(), 1.8, epsilon = 1e-6);
}

/// GIVEN a magnetometer that appears after ten seconds WHEN it has been seen for the alignment
/// time THEN the heading is known from then on and the bias is kept.
#[test]
fn a_late_magnetometer_is_aligned_with() {
    let mut driver = mekf();
    let bias = Vector3::new(0.0, 0.01, 0.0);
    let truth = so3::exp(&Vector3::new(0.0, 0.0, 0.6));
    for t in (0..20_000).step_by(10) {
        driver.gyroscope(t * MS, &bias);
        driver.accelerometer(t * MS, &up());
        if t > 10_000 {
            driver.magnetometer(t * MS, &(truth.inverse() * north()));
        }
    }
    let error = rotation::angle_between(&driver.attitude().unwrap(), &truth);
    assert!(error.to_degrees() < 0.5, "{} deg", error.to_degrees());
    let (estimate, _) = driver.estimator.gyroscope_bias().unwrap();
    assert!((estimate - bias).norm() < 1e-3, "{estimate}");
}

#[test]
fn extreme_stamps_do_not_overflow() {
    let mut driver = mekf();
    for t in [i64::MIN, -1, 0, i64::MAX - 1, i64::MAX] {
        driver.gyroscope(t, &Vector3::x());
        driver.accelerometer(t, &up());
        driver.magnetometer(t, &north());
    }
    assert!(driver.attitude().is_none_or(|q| q.norm().is_finite()));
}
