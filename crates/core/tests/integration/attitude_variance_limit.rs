//! Nobody looks at the heading for an hour, or everybody says that nothing is known: the variance of an attitude stops
//! at its largest, and the covariance stays one.

#![allow(clippy::unwrap_used)]

use nalgebra::{Matrix3, Vector3};
use northing_core::attitude::bounded_velocity::{BoundedVelocity, BoundedVelocityConfig};
use northing_core::attitude::mekf::Mekf;
use northing_core::attitude::mekf3::Mekf3;
use northing_core::attitude::quaternion_ekf::QuaternionEkf;
use northing_core::attitude::usque::Usque;
use northing_core::attitude::{AttitudeConfig, AttitudeEstimator};

const LARGEST_STD: f64 = 0.4;

fn settings() -> AttitudeConfig<f64> {
    AttitudeConfig {
        maximum_attitude_std: LARGEST_STD,
        gyroscope_noise_density: 0.05,
        ..AttitudeConfig::default()
    }
}

fn check(name: &str, mut filter: impl AttitudeEstimator<f64> + Clone) {
    let limit = LARGEST_STD * LARGEST_STD;
    let at_limit = |what: &str, p: Option<Matrix3<f64>>| {
        let p = p.unwrap();
        // The sum over the axes: not all filters keep them in the same frame.
        let ratio = p.trace() / (3.0 * limit);
        assert!((0.99..=1.0 + 1e-9).contains(&ratio), "{name}, {what}: {p}");
        assert!(p.cholesky().is_some(), "{name}, {what}: {p}");
    };
    let mut told = filter.clone();
    told.add_attitude_variance(100.0);
    at_limit("told so", told.attitude_covariance());
    // 0.05 rad/sqrt(s) of noise: 3 rad in an hour, and the bias beside it.
    for k in 0..36_000 {
        let t = f64::from(k) * 0.1;
        let rate = Vector3::new(0.3 * t.sin(), 0.2 * (0.7 * t).cos(), 0.1);
        filter.propagate(&rate, 0.1);
    }
    at_limit("after an hour", filter.attitude_covariance());
}

#[test]
fn the_variance_of_an_attitude_that_nothing_measures_stops_at_its_largest() {
    check("mekf", Mekf::new(settings()).unwrap());
    check("mekf3", Mekf3::new(settings()).unwrap());
    check("usque", Usque::new(settings()).unwrap());
    check("quaternion-ekf", QuaternionEkf::new(settings()).unwrap());
    let bounded = BoundedVelocityConfig {
        maximum_attitude_std: LARGEST_STD,
        gyroscope_noise_density: 0.05,
        ..BoundedVelocityConfig::default()
    };
    check("bounded-velocity", BoundedVelocity::new(bounded).unwrap());
}
