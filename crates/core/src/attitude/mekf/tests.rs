//! Closed forms, untouched states, save and restore, observability, single precision.

use super::*;
use crate::attitude::{MagnetometerUse, References};
use crate::geometry::frames::TangentFrame;
use crate::kalman::covariance::cholesky;
use crate::kalman::{Outcome, SkipReason};
use crate::restorable::Restorable as _;
use approx::assert_relative_eq;
use num_dual::{DualSVec64, jacobian};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

fn references<T: Scalar>() -> References<T> {
    let frame = TangentFrame::Enu;
    References {
        specific_force: frame.specific_force_at_rest(nalgebra::convert(9.806_65)),
        magnetic_field: Some(
            frame.magnetic_field(nalgebra::convert(27.0), nalgebra::convert(33.0)),
        ),
    }
}

fn filter<T: Scalar>(config: AttitudeConfig<T>, attitude: UnitQuaternion<T>) -> Mekf<T> {
    let mut filter = Mekf::new(config).unwrap();
    let tilt = config.initial_tilt_std;
    filter.initialize(&InitialState {
        attitude,
        attitude_covariance: Matrix3::identity() * (tilt * tilt),
        gyroscope_bias: Vector3::zeros(),
        gyroscope_bias_std: config.initial_gyroscope_bias_std,
        north_known: false,
        references: references(),
    });
    filter
}

/// A device that turns all the time, with noisy sensors; calls `step` with each sample.
fn drive(seconds: u32, seed: u64, mut step: impl FnMut(&UnitQuaternion<f64>, [Vector3<f64>; 3])) {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut noise = |std: f64| Vector3::from_fn(|_, _| std * rng.sample::<f64, _>(StandardNormal));
    let references = references::<f64>();
    let field = references.magnetic_field.unwrap();
    let mut truth = UnitQuaternion::identity();
    for k in 0..seconds * 100 {
        let t = f64::from(k) * 0.01;
        let rate = Vector3::new(
            (0.7 * t).sin(),
            0.8 * (1.1 * t).cos(),
            0.5 * (0.4 * t).sin(),
        );
        truth = rotation::renormalize(&(truth * so3::exp(&(rate * 0.01))));
        let bias = Vector3::new(0.02, -0.01, 0.015);
        step(
            &truth,
            [
                rate + bias + noise(0.005),
                truth.inverse() * references.specific_force + noise(0.05),
                truth.inverse() * field + noise(0.5),
            ],
        );
    }
}

#[test]
fn learns_attitude_and_bias_from_half_a_radian_off() {
    let config = AttitudeConfig {
        initial_tilt_std: 0.5,
        ..AttitudeConfig::<f64>::lab()
    };
    let mut f = filter(config, so3::exp(&Vector3::new(0.4, -0.3, 0.5)));
    let mut error = f64::NAN;
    drive(30, 1, |truth, [w, a, m]| {
        f.propagate(&w, 0.01);
        f.update_accelerometer(&a);
        f.update_magnetometer(&m);
        error = rotation::angle_between(truth, &f.attitude());
    });
    assert!(error.to_degrees() < 0.4, "{} deg", error.to_degrees());
    let (bias, _) = f.gyroscope_bias().unwrap();
    assert!(
        (bias - Vector3::new(0.02, -0.01, 0.015)).norm() < 0.003,
        "{bias}"
    );
}

#[test]
fn reset_equals_the_dense_product() {
    let m = Matrix6::from_fn(|i, j| ((3 * i + 5 * j) as f64).cos());
    let p0 = m * m.transpose() + Matrix6::identity();
    let a = Vector3::new(0.3, -0.2, 0.4);
    let mut g = Matrix6::identity();
    g.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&so3::gibbs_reset_jacobian(&a));
    let mut p = p0;
    reset(&mut p, &a);
    assert_relative_eq!(p, g * p0 * g.transpose(), epsilon = 1e-13);
    assert_relative_eq!(p, p.transpose());
}

/// The whole step, propagate and inject, as the true error sees it.
#[test]
fn transition_at_a_bias_equals_dual_numbers() {
    let mut f = filter(AttitudeConfig::<f64>::lab(), UnitQuaternion::identity());
    f.state.gyroscope_bias = Vector3::new(0.1, -0.2, 0.3);
    let (w, dt) = (Vector3::new(1.0, 2.0, -1.5), 0.02);
    let (_, j) = jacobian(
        |x: nalgebra::SVector<DualSVec64<6>, 6>| {
            let (a, db) = (
                x.fixed_rows::<3>(0).into_owned(),
                x.fixed_rows::<3>(3).into_owned(),
            );
            let b = f.state.gyroscope_bias.map(DualSVec64::<6>::from);
            let (w, dt) = (w.map(DualSVec64::<6>::from), DualSVec64::<6>::from(dt));
            let truth = so3::from_gibbs(&a) * so3::exp(&((w - b - db) * dt));
            so3::to_gibbs(&(so3::exp(&((w - b) * dt)).inverse() * truth))
        },
        &Vector6::zeros(),
    );
    assert_relative_eq!(
        j,
        f.transition(&w, dt).fixed_rows::<3>(0).into_owned(),
        epsilon = 1e-12
    );
}

#[test]
fn bad_samples_leave_the_state_untouched_and_say_why() {
    let mut f = filter(AttitudeConfig::<f64>::lab(), UnitQuaternion::identity());
    let before = f;
    let nan = Vector3::new(f64::NAN, 0.0, 0.0);
    assert_eq!(
        f.propagate(&nan, 0.01),
        Propagation::Skipped(SkipReason::NotFinite)
    );
    assert_eq!(
        f.propagate(&Vector3::x(), f64::NAN),
        Propagation::Skipped(SkipReason::NotFinite)
    );
    assert_eq!(
        f.update_accelerometer(&nan).outcome,
        Outcome::Skipped(SkipReason::NotFinite)
    );
    assert_eq!(
        f.update_accelerometer(&Vector3::zeros()).outcome,
        Outcome::Skipped(SkipReason::ZeroNorm)
    );
    let reach = [1e4, 1e160, f64::MAX].map(|x| f.propagate(&Vector3::new(x, x, 0.0), 1e3));
    assert!(
        reach.iter().all(|p| matches!(p, Propagation::Skipped(_))),
        "{reach:?}"
    );
    assert_eq!(
        f.propagate(&Vector3::x(), 1e30),
        Propagation::Skipped(SkipReason::OutOfRange)
    );
    let far = Vector3::new(1e4, 0.0, 9.81);
    assert_eq!(
        f.update_accelerometer(&far).outcome,
        Outcome::Skipped(SkipReason::OutOfRange)
    );
    let huge = Vector3::new(f64::MAX, f64::MAX, 0.0);
    assert_eq!(
        f.update_magnetometer(&huge).outcome,
        Outcome::Skipped(SkipReason::NotFinite)
    );
    f.add_attitude_variance(f64::NAN);
    f.initialize(&InitialState {
        attitude: UnitQuaternion::identity(),
        attitude_covariance: Matrix3::identity() * f64::NAN,
        gyroscope_bias: Vector3::zeros(),
        gyroscope_bias_std: 0.1,
        north_known: false,
        references: references(),
    });
    assert_eq!(f, before);
    let mut blank = Mekf::new(AttitudeConfig::<f64>::lab()).unwrap();
    assert_eq!(
        blank.update_magnetometer(&Vector3::x()).outcome,
        Outcome::Skipped(SkipReason::NotInitialized)
    );
}

#[test]
fn a_saved_state_continues_exactly() {
    let mut whole = filter(AttitudeConfig::<f64>::lab(), UnitQuaternion::identity());
    let mut split = whole;
    let mut count = 0;
    drive(4, 7, |_, [w, a, m]| {
        for f in [&mut whole, &mut split] {
            f.propagate(&w, 0.01);
            f.update_accelerometer(&a);
            f.update_magnetometer(&m);
        }
        count += 1;
        if count == 200 {
            let saved = *split.state();
            split = Mekf::new(*whole.config()).unwrap();
            split.restore(saved).unwrap();
        }
    });
    assert_eq!(whole.state(), split.state());
}

/// With one vector only, the variance about that vector must grow (acceptance test f). The bias
/// is known here: an unknown one is learnt while the device turns, and takes back what it did.
#[test]
fn with_one_sensor_the_variance_about_its_vector_grows_monotonically() {
    let up = Vector3::z();
    let variance_up = |f: &Mekf<f64>| {
        let body = f.attitude().inverse() * up;
        body.dot(&(f.attitude_covariance().unwrap() * body))
    };
    // Small initial errors: large ones move the linearisation point and with it the axis.
    let config = AttitudeConfig {
        initial_tilt_std: 0.02,
        initial_gyroscope_bias_std: 0.0,
        gyroscope_bias_random_walk: 0.0,
        gyroscope_noise_density: 5e-3,
        ..AttitudeConfig::lab()
    };
    let mut f = filter(config, UnitQuaternion::identity());
    let (mut last, mut count) = (variance_up(&f), 0);
    drive(20, 3, |_, [w, a, _]| {
        f.propagate(&w, 0.01);
        f.update_accelerometer(&a);
        // From second to second: within one, the up direction itself moves with each correction.
        count += 1;
        if count % 100 == 0 {
            let now = variance_up(&f);
            assert!(now > last, "{now} after {last}");
            last = now;
        }
    });
    assert!(last > 8e-4, "grew to {last}");
    let mut f = filter(config, UnitQuaternion::identity());
    drive(20, 3, |_, [w, _, m]| {
        f.propagate(&w, 0.01);
        f.update_magnetometer(&m);
    });
    let north = f.attitude().inverse() * references::<f64>().magnetic_field.unwrap().normalize();
    let about_field = north.dot(&(f.attitude_covariance().unwrap() * north));
    assert!(about_field > 8e-4, "grew to {about_field}");
}

#[test]
fn heading_update_never_tips_the_tilt() {
    let config = AttitudeConfig {
        magnetometer_use: MagnetometerUse::Heading,
        ..AttitudeConfig::<f64>::lab()
    };
    let mut f = filter(config, UnitQuaternion::identity());
    for _ in 0..50 {
        let record = f.update_magnetometer(&Vector3::new(20.0, 20.0, 5.0));
        assert_eq!(record.degrees_of_freedom, 1);
    }
    let up = f.attitude() * Vector3::z();
    assert!((up - Vector3::z()).norm() < 1e-12, "{up}");
}

/// GIVEN a filter sure of a wrong heading WHEN its gate refuses everything THEN after the
/// time-out it lets measurements in again and recovers.
#[test]
fn gate_does_not_lock_out_for_ever() {
    let config = AttitudeConfig {
        initial_tilt_std: 0.01,
        initial_gyroscope_bias_std: 1e-4,
        ..AttitudeConfig::<f64>::lab()
    };
    let mut f = filter(config, so3::exp(&Vector3::new(0.0, 0.0, 1.0)));
    let field = references::<f64>().magnetic_field.unwrap();
    let mut outcomes = [0_usize; 3];
    for _ in 0..2000 {
        f.propagate(&Vector3::zeros(), 0.01);
        f.update_accelerometer(&Vector3::new(0.0, 0.0, 9.806_65));
        match f.update_magnetometer(&field).outcome {
            Outcome::Gated => outcomes[0] += 1,
            Outcome::Inflated => outcomes[1] += 1,
            Outcome::Fused => outcomes[2] += 1,
            Outcome::Skipped(reason) => panic!("{reason:?}"),
        }
    }
    assert!(
        outcomes[0] >= 299 && outcomes[1] > 0 && outcomes[2] > 0,
        "{outcomes:?}"
    );
    assert!(
        f.attitude().angle().to_degrees() < 1.0,
        "{}",
        f.attitude().angle().to_degrees()
    );
}

/// Acceptance test (h): a million single-precision updates keep P symmetric and positive.
#[test]
fn single_precision_stays_positive_over_a_million_updates() {
    let mut f = filter(AttitudeConfig::<f32>::lab(), UnitQuaternion::identity());
    let up = Vector3::new(0.0, 0.0, 9.806_65_f32);
    let field = references::<f32>().magnetic_field.unwrap();
    let mut truth = UnitQuaternion::<f32>::identity();
    for k in 0..500_000_u32 {
        let t = (k % 100_000) as f32 * 0.01;
        let rate = Vector3::new((0.7 * t).sin(), 0.8 * (1.1 * t).cos(), 0.2);
        truth = rotation::renormalize(&(truth * so3::exp(&(rate * 0.01))));
        f.propagate(&rate, 0.01);
        f.update_accelerometer(&(truth.inverse() * up));
        // Half of the time gravity alone, so that the heading variance grows and shrinks.
        if (k / 50_000).is_multiple_of(2) {
            f.update_magnetometer(&(truth.inverse() * field));
        } else {
            f.update_accelerometer(&(truth.inverse() * up));
        }
        if k.is_multiple_of(1000) {
            let p = f.state.covariance;
            assert_eq!(p, p.transpose());
            assert!(cholesky(&p.cast::<f64>()).is_some(), "step {k}: {p}");
        }
    }
    assert!(rotation::angle_between(&truth, &f.attitude()) < 0.02);
}

#[test]
fn single_and_double_precision_agree() {
    let mut f64s = filter(AttitudeConfig::<f64>::lab(), UnitQuaternion::identity());
    let mut f32s = filter(AttitudeConfig::<f32>::lab(), UnitQuaternion::identity());
    drive(20, 11, |_, [w, a, m]| {
        f64s.propagate(&w, 0.01);
        f64s.update_accelerometer(&a);
        f64s.update_magnetometer(&m);
        f32s.propagate(&w.cast(), 0.01);
        f32s.update_accelerometer(&a.cast());
        f32s.update_magnetometer(&m.cast());
    });
    let difference = rotation::angle_between(&f64s.attitude(), &f32s.attitude().cast::<f64>());
    assert!(
        difference.to_degrees() < 0.01,
        "{} deg",
        difference.to_degrees()
    );
}

#[test]
fn a_compass_finds_and_keeps_the_heading() {
    crate::attitude::test_world::check_compass(|config| Mekf::new(config).unwrap());
}

#[test]
fn resumes_with_what_a_bias_has_turned() {
    let make = || Mekf::new(AttitudeConfig::<f64>::default()).unwrap();
    crate::attitude::test_world::resumes_as_if_it_had_turned(make, |f| f.state.covariance);
}
