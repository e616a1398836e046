//! A device that turns all the time, and what every filter with bias has to do in it.
//!
//! Each check takes a filter made by `make`, so that the same demands hold for all of them.

use nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector3};
use num_dual::DualSVec64;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;

use super::{
    AttitudeConfig, AttitudeEstimator, CompassHeading, InitialState, MagnetometerUse, Propagation,
    References,
};
use crate::faults::bias_step::Resumed;
use crate::geometry::{frames::TangentFrame, rotation, so3};
use crate::kalman::covariance::cholesky;
use crate::kalman::{Outcome, SkipReason};
use crate::scalar::{Scalar, lit};

/// The gyroscope's bias in this world, rad/s.
pub(super) const BIAS: Vector3<f64> = Vector3::new(0.02, -0.01, 0.015);

pub(super) fn references<T: Scalar>() -> References<T> {
    let frame = TangentFrame::Enu;
    References {
        specific_force: frame.specific_force_at_rest(lit(9.806_65)),
        magnetic_field: Some(frame.magnetic_field(lit(27.0), lit(33.0))),
    }
}

/// The start that `config` describes, at `attitude`.
pub(super) fn start<T: Scalar>(
    config: &AttitudeConfig<T>,
    attitude: UnitQuaternion<T>,
) -> InitialState<T> {
    InitialState {
        attitude,
        attitude_covariance: Matrix3::identity() * (config.initial_tilt_std.powi(2)),
        gyroscope_bias: Vector3::zeros(),
        gyroscope_bias_std: config.initial_gyroscope_bias_std,
        north_known: false,
        references: references(),
    }
}

/// Calls `step` at 100 Hz with the truth and the noisy angular rate, specific force and field.
pub(super) fn drive(
    seconds: u32,
    seed: u64,
    mut step: impl FnMut(&UnitQuaternion<f64>, [Vector3<f64>; 3]),
) {
    let mut rng = Pcg64::seed_from_u64(seed);
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
        let samples = [
            rate + BIAS + noise(0.005),
            truth.inverse() * references.specific_force + noise(0.05),
            truth.inverse() * field + noise(0.5),
        ];
        step(&truth, samples);
    }
}

/// Propagates and fuses one sample of each sensor.
pub(super) fn step_all<T: Scalar>(f: &mut impl AttitudeEstimator<T>, [w, a, m]: &[Vector3<T>; 3]) {
    assert_eq!(f.propagate(w, lit(0.01)), Propagation::Done);
    f.update_accelerometer(a);
    f.update_magnetometer(m);
}

fn variance_about<T: Scalar>(f: &impl AttitudeEstimator<T>, reference: &Vector3<T>) -> T {
    let body = f.attitude().inverse() * reference.normalize();
    body.dot(&(f.attitude_covariance().unwrap() * body))
}

/// From 0.5 rad per axis off, attitude and bias are found, with a consistent covariance.
pub(super) fn check_convergence<E: AttitudeEstimator<f64>>(make: fn(AttitudeConfig<f64>) -> E) {
    // Without gates: half a radian is far beyond what the linear innovation covariance expects.
    let config = AttitudeConfig {
        initial_tilt_std: 0.5,
        accelerometer_gate_nis: 0.0,
        magnetometer_gate_nis: 0.0,
        ..AttitudeConfig::lab()
    };
    for (seed, off) in [
        (1, [0.5, -0.5, 0.5]),
        (2, [-0.5, 0.5, 0.5]),
        (3, [0.0, 0.0, -0.5]),
    ] {
        let mut f = make(config);
        f.initialize(&start(&config, so3::exp(&Vector3::from(off))));
        let (mut error, mut at_2s, mut count) = (Vector3::repeat(f64::NAN), f64::NAN, 0);
        drive(30, seed, |truth, samples| {
            step_all(&mut f, &samples);
            error = so3::log(&(f.attitude().inverse() * truth));
            count += 1;
            if count == 200 {
                at_2s = error.norm();
            }
        });
        assert!(
            at_2s.to_degrees() < 3.0,
            "after 2 s {} deg",
            at_2s.to_degrees()
        );
        assert!(
            error.norm().to_degrees() < 0.3,
            "{} deg",
            error.norm().to_degrees()
        );
        let nees = error.dot(&(f.attitude_covariance().unwrap().try_inverse().unwrap() * error));
        assert!(
            nees < 16.3,
            "attitude NEES {nees}, 99.9 % of chi-square(3) is 16.27"
        );
        let (bias, p) = f.gyroscope_bias().unwrap();
        let nees = (bias - BIAS).dot(&(p.try_inverse().unwrap() * (bias - BIAS)));
        assert!(
            (bias - BIAS).norm() < 0.003 && nees < 16.3,
            "bias {bias}, NEES {nees}"
        );
    }
}

/// Nothing non-finite, zero or unknown touches the state, and the record says why.
pub(super) fn check_bad_samples<E: AttitudeEstimator<f64> + Copy + PartialEq + core::fmt::Debug>(
    make: fn(AttitudeConfig<f64>) -> E,
) {
    let config = AttitudeConfig::lab();
    let mut f = make(config);
    let skipped = |reason| Outcome::Skipped(reason);
    let unknown = f.update_magnetometer(&Vector3::x()).outcome;
    assert_eq!(unknown, skipped(SkipReason::NotInitialized));
    f.initialize(&start(&config, so3::exp(&Vector3::new(0.1, 0.2, 0.3))));
    let before = f;
    let nan = Vector3::new(f64::NAN, 0.0, 0.0);
    let huge = Vector3::new(f64::MAX, f64::MAX, 0.0);
    let not_finite = Propagation::Skipped(SkipReason::NotFinite);
    assert_eq!(f.propagate(&nan, 0.01), not_finite);
    assert_eq!(f.propagate(&huge, 0.01), not_finite);
    assert_eq!(f.propagate(&Vector3::x(), f64::NAN), not_finite);
    assert_eq!(f.propagate(&Vector3::x(), 0.0), Propagation::Done);
    assert_eq!(f.propagate(&Vector3::x(), -1.0), Propagation::Done);
    for (bad, reason) in [
        (nan, SkipReason::NotFinite),
        (huge, SkipReason::NotFinite),
        (Vector3::zeros(), SkipReason::ZeroNorm),
    ] {
        assert_eq!(f.update_accelerometer(&bad).outcome, skipped(reason));
        assert_eq!(f.update_magnetometer(&bad).outcome, skipped(reason));
    }
    for (heading, std, reason) in [
        (f64::NAN, 0.1, SkipReason::NotFinite),
        (0.0, f64::NAN, SkipReason::NotFinite),
        (1e300, 0.1, SkipReason::OutOfRange),
        (0.0, -0.1, SkipReason::OutOfRange),
    ] {
        let record = f.update_compass(&compass(heading, std));
        assert_eq!(record.outcome, skipped(reason));
    }
    for variance in [f64::NAN, f64::INFINITY, -1.0, 0.0] {
        f.add_attitude_variance(variance);
    }
    assert_eq!(f, before);
    f.add_attitude_variance(0.01);
    let grown = f.attitude_covariance().unwrap() - before.attitude_covariance().unwrap();
    assert!(
        (grown - Matrix3::identity() * 0.01).amax() < 1e-12,
        "{grown}"
    );
}

/// A saved copy continues to the bit.
pub(super) fn check_reproducible<
    E: AttitudeEstimator<f64> + Copy + PartialEq + core::fmt::Debug,
>(
    make: fn(AttitudeConfig<f64>) -> E,
    save_and_restore: fn(&E) -> E,
) {
    let config = AttitudeConfig::lab();
    let mut whole = make(config);
    whole.initialize(&start(&config, UnitQuaternion::identity()));
    let (mut split, mut count) = (whole, 0);
    drive(4, 7, |_, samples| {
        step_all(&mut whole, &samples);
        step_all(&mut split, &samples);
        count += 1;
        if count == 200 {
            split = save_and_restore(&split);
        }
    });
    assert_eq!(whole, split);
}

/// With one vector sensor only, the variance about that vector grows.
pub(super) fn check_unobservable_grows<E: AttitudeEstimator<f64>>(
    make: fn(AttitudeConfig<f64>) -> E,
) {
    let config = AttitudeConfig {
        initial_tilt_std: 0.02,
        initial_gyroscope_bias_std: 1e-6,
        gyroscope_bias_random_walk: 0.0,
        gyroscope_noise_density: 5e-3,
        ..AttitudeConfig::lab()
    };
    let (mut tilt, mut field) = (make(config), make(config));
    for f in [&mut tilt, &mut field] {
        f.initialize(&start(&config, UnitQuaternion::identity()));
    }
    let (up, north) = (Vector3::z(), references::<f64>().magnetic_field.unwrap());
    let (mut last, mut count) = ([4e-4; 2], 0);
    drive(20, 3, |_, [w, a, m]| {
        tilt.propagate(&w, 0.01);
        tilt.update_accelerometer(&a);
        field.propagate(&w, 0.01);
        field.update_magnetometer(&m);
        count += 1;
        if count % 100 == 0 {
            let now = [variance_about(&tilt, &up), variance_about(&field, &north)];
            assert!(
                now[0] > last[0] && now[1] > last[1],
                "{now:?} after {last:?}"
            );
            last = now;
        }
    });
    // 20 s of a walk of 5e-3 rad/sqrt(s) on top of 0.02 rad: 4e-4 + 5e-4 rad^2.
    assert!(
        last.iter().all(|v| (v - 9e-4).abs() < 1e-4),
        "grew to {last:?}"
    );
    assert!(
        variance_about(&tilt, &Vector3::x()) < 1e-4,
        "tilt is observed"
    );
}

/// A wrong field turns the heading and leaves the tilt alone.
pub(super) fn check_heading_update<E: AttitudeEstimator<f64>>(make: fn(AttitudeConfig<f64>) -> E) {
    let config = AttitudeConfig {
        magnetometer_use: MagnetometerUse::Heading,
        magnetometer_gate_nis: 0.0,
        ..AttitudeConfig::lab()
    };
    let mut f = make(config);
    f.initialize(&start(&config, UnitQuaternion::identity()));
    for _ in 0..50 {
        assert_eq!(
            f.update_magnetometer(&Vector3::new(15.0, 25.0, 5.0))
                .degrees_of_freedom,
            1
        );
    }
    let up = f.attitude() * Vector3::z();
    assert!((up - Vector3::z()).norm() < 1e-12, "{up}");
    let [yaw, ..] = rotation::to_yaw_pitch_roll(&f.attitude());
    assert!((yaw - 15_f64.atan2(25.0)).abs() < 0.02, "yaw {yaw}");
}

/// A heading of the top axis in this world.
pub(super) fn compass(heading: f64, std: f64) -> CompassHeading<f64> {
    CompassHeading {
        frame: TangentFrame::Enu,
        heading,
        std,
    }
}

/// With gravity and a compass the heading is found and its variance bounded; upright the compass is
/// skipped and nothing breaks.
pub(super) fn check_compass<E: AttitudeEstimator<f64>>(make: fn(AttitudeConfig<f64>) -> E) {
    let config = AttitudeConfig {
        initial_tilt_std: 0.3,
        compass_gate_nis: 0.0,
        compass_correlation_time_s: 0.0,
        ..AttitudeConfig::lab()
    };
    let mut f = make(config);
    f.initialize(&start(&config, so3::exp(&Vector3::new(0.0, 0.0, 0.3))));
    let (mut rng, mut count, mut seen) = (Pcg64::seed_from_u64(8), 0, [0; 2]);
    drive(60, 9, |truth, [rate, force, _]| {
        f.propagate(&rate, 0.01);
        f.update_accelerometer(&force);
        count += 1;
        if count % 10 == 0 {
            let top = truth * Vector3::y();
            let noise = 0.1 * rng.sample::<f64, _>(StandardNormal);
            let record = f.update_compass(&compass(top.x.atan2(top.y) + noise, 0.05));
            match record.outcome {
                Outcome::Fused => {
                    assert_eq!(record.degrees_of_freedom, 1);
                    seen[0] += 1;
                }
                Outcome::Skipped(SkipReason::Unobservable) => seen[1] += 1,
                other => panic!("{other:?}"),
            }
        }
        if count > 2000 {
            let error = so3::log(&(f.attitude().inverse() * truth));
            let p = f.attitude_covariance().unwrap();
            let nees = error.dot(&(p.try_inverse().unwrap() * error));
            assert!(nees < 30.0, "NEES {nees} at {count}");
            assert!(error.norm() < 0.12, "{} rad at {count}", error.norm());
        }
    });
    assert!(seen[0] > 300 && seen[1] > 10, "{seen:?}");
}

/// A gate that refuses everything opens after its time-out and the filter recovers.
pub(super) fn check_gate_opens<E: AttitudeEstimator<f64>>(make: fn(AttitudeConfig<f64>) -> E) {
    let config = AttitudeConfig {
        initial_tilt_std: 0.01,
        initial_gyroscope_bias_std: 1e-4,
        ..AttitudeConfig::lab()
    };
    let mut f = make(config);
    f.initialize(&start(&config, so3::exp(&Vector3::new(0.0, 0.0, 1.0))));
    let world = references::<f64>();
    let (mut gated, mut inflated, mut fused) = (0, 0, 0);
    for _ in 0..2000 {
        f.propagate(&Vector3::zeros(), 0.01);
        f.update_accelerometer(&world.specific_force);
        match f
            .update_magnetometer(&world.magnetic_field.unwrap())
            .outcome
        {
            Outcome::Gated => gated += 1,
            Outcome::Inflated => inflated += 1,
            Outcome::Fused => fused += 1,
            Outcome::Skipped(reason) => panic!("{reason:?}"),
        }
    }
    assert!(
        gated >= 299 && inflated > 0 && fused > 0,
        "{gated} {inflated} {fused}"
    );
    assert!(
        f.attitude().angle().to_degrees() < 1.0,
        "{}",
        f.attitude().angle().to_degrees()
    );
}

/// Single precision: 100 000 updates, half of them without heading; symmetric, positive, right.
pub(super) fn check_single_precision<E: AttitudeEstimator<f32>>(
    make: fn(AttitudeConfig<f32>) -> E,
) {
    let config = AttitudeConfig::lab();
    let mut f = make(config);
    f.initialize(&start(&config, UnitQuaternion::identity()));
    let world = references::<f32>();
    let (up, field) = (world.specific_force, world.magnetic_field.unwrap());
    let mut truth = UnitQuaternion::<f32>::identity();
    for k in 0..50_000_u32 {
        let t = (k % 10_000) as f32 * 0.01;
        let rate = Vector3::new((0.7 * t).sin(), 0.8 * (1.1 * t).cos(), 0.2);
        truth = rotation::renormalize(&(truth * so3::exp(&(rate * 0.01))));
        f.propagate(&rate, 0.01);
        assert!(
            f.update_accelerometer(&(truth.inverse() * up))
                .outcome
                .is_fused()
        );
        if (k / 5_000).is_multiple_of(2) {
            assert!(
                f.update_magnetometer(&(truth.inverse() * field))
                    .outcome
                    .is_fused()
            );
        } else {
            assert!(
                f.update_accelerometer(&(truth.inverse() * up))
                    .outcome
                    .is_fused()
            );
        }
        if k.is_multiple_of(100) {
            let (p, b) = (
                f.attitude_covariance().unwrap(),
                f.gyroscope_bias().unwrap().1,
            );
            assert!((p - p.transpose()).amax() <= 0.0 && (b - b.transpose()).amax() <= 0.0);
            let positive =
                cholesky(&p.cast::<f64>()).is_some() && cholesky(&b.cast::<f64>()).is_some();
            assert!(positive, "step {k}: {p} {b}");
        }
    }
    assert!(rotation::angle_between(&truth, &f.attitude()) < 0.02);
}

/// A dual number that is a constant.
pub(super) fn constant<const N: usize>(x: f64) -> DualSVec64<N> {
    DualSVec64::from(x)
}

/// GIVEN a filter that has turned for three seconds with an uncertain bias WHEN another begins where it is, and is told how attitude and
/// bias hang together THEN both have the same covariance of attitude and bias.
pub(super) fn resumes_as_if_it_had_turned<E: AttitudeEstimator<f64>>(
    make: impl Fn() -> E,
    covariance: impl Fn(&E) -> SMatrix<f64, 6, 6>,
) {
    let config = AttitudeConfig::<f64>::default();
    let (bias_std, dt) = (0.02, 0.01);
    let initial = InitialState {
        attitude: UnitQuaternion::from_euler_angles(0.3, -0.4, 1.2),
        gyroscope_bias_std: bias_std,
        ..start(&config, UnitQuaternion::identity())
    };
    let mut turned = make();
    turned.initialize(&initial);
    let mut drift = Matrix3::zeros();
    let rate = Vector3::new(0.6, -0.9, 0.7);
    let back = so3::exp(&(rate * -dt)).to_rotation_matrix();
    for _ in 0..300 {
        turned.propagate(&rate, dt);
        drift = back * (drift + Matrix3::identity() * dt);
    }
    let bias_covariance = Matrix3::identity() * (bias_std * bias_std);
    let resumed = Resumed {
        attitude: turned.attitude(),
        attitude_covariance: turned.attitude_covariance().unwrap(),
        bias_covariance,
        drift,
        learnt: turned.learnt(),
    };
    let mut other = make();
    other.initialize(&initial);
    let now = InitialState {
        attitude: resumed.attitude,
        attitude_covariance: resumed.attitude_covariance,
        ..initial
    };
    other.resume(&now, &resumed);
    turned.propagate(&rate, dt);
    other.propagate(&rate, dt);
    let (expected, got) = (covariance(&turned), covariance(&other));
    let difference = (expected - got).norm();
    assert!(difference < 0.02 * expected.norm(), "{expected}{got}");
    let cross = |p: &SMatrix<f64, 6, 6>| p.fixed_view::<3, 3>(0, 3).into_owned();
    let difference = (cross(&expected) - cross(&got)).norm();
    assert!(
        difference < 0.02 * cross(&expected).norm(),
        "{expected}{got}"
    );
}
