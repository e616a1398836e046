use super::*;
use crate::kalman::Outcome;
use crate::kalman::covariance::cholesky;
use approx::assert_relative_eq;
use nalgebra::{Matrix3, Matrix6, SVector, UnitQuaternion};
use num_dual::{DualSVec64, jacobian};
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

type M15 = SMatrix<f64, 15, 15>;
type V15 = SVector<f64, 15>;
type Dual = DualSVec64<15>;

const DT: f64 = 0.01;

/// A ship in a seaway: turning, rolling, surging.
fn sample(k: usize) -> (Vector3<f64>, Vector3<f64>) {
    let t = k as f64 * DT;
    let rate = Vector3::new(0.1 * (0.8 * t).sin(), 0.05 * (1.1 * t).cos(), 0.04);
    let force = Vector3::new(0.3 * (0.5 * t).sin(), 0.4, -9.7 + 0.2 * (0.9 * t).cos());
    (rate, force)
}

fn spread(i: usize, j: usize) -> f64 {
    ((i * 7 + j * 3) as f64).sin()
}

fn start() -> NavigationState<f64> {
    let a = M15::from_fn(spread);
    let scale = V15::from_fn(|i, _| [0.05, 0.5, 1.5, 0.02, 0.0004][i / 3]);
    let d = M15::from_diagonal(&scale);
    NavigationState {
        ned_from_body: rotation::from_yaw_pitch_roll([0.7, 0.1, -0.2]),
        velocity: Vector3::new(8.0, 5.0, 0.1),
        position: Vector3::new(100.0, -50.0, 1.0),
        accelerometer_bias: Vector3::new(0.02, -0.01, 0.03),
        gyroscope_bias: Vector3::new(1e-3, -2e-3, 5e-4),
        covariance: d * (a * a.transpose() * 0.05 + M15::identity()) * d,
        pending: ErrorTransition::default(),
        skipped: 0,
    }
}

fn filter() -> ErrorStateFilter<f64> {
    let config = ErrorStateConfig {
        accelerometer_noise_density: 0.07,
        gyroscope_noise_density: 7e-4,
        accelerometer_bias_random_walk: 1e-3,
        gyroscope_bias_random_walk: 1e-4,
        ..ErrorStateConfig::default()
    };
    ErrorStateFilter::new(config, start()).unwrap()
}

fn run(filter: &mut ErrorStateFilter<f64>, samples: core::ops::Range<usize>) {
    for k in samples {
        let (rate, force) = sample(k);
        filter.propagate(&rate, &force, DT).unwrap();
    }
}

fn fix() -> GnssCompassFix<f64> {
    GnssCompassFix {
        position: Vector3::new(101.7, -48.0, 0.2),
        position_std: Vector3::new(1.5, 1.0, 3.0),
        ned_from_body: rotation::from_yaw_pitch_roll([0.75, 0.11, -0.21]),
        attitude_std: Vector3::new(0.02, 0.03, 0.05),
    }
}

/// The error (eq E1) of a truth that starts `x` away from the estimate, after the same samples.
fn true_error_after(x: &SVector<Dual, 15>, samples: usize) -> SVector<Dual, 15> {
    let part = |i: usize| x.fixed_rows::<3>(i).into_owned();
    let real = |v: &Vector3<f64>| v.map(Dual::from);
    let s = start();
    let q = s.ned_from_body.as_ref();
    let q = UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(
        Dual::from(q.w),
        Dual::from(q.i),
        Dual::from(q.j),
        Dual::from(q.k),
    ));
    let dt = Dual::from(DT);
    let half = Dual::from(0.5);
    let mut truth = [so3::exp(&part(0)) * q, q];
    let mut v = [real(&s.velocity) + part(3), real(&s.velocity)];
    let mut p = [real(&s.position) + part(6), real(&s.position)];
    let ba = [
        real(&s.accelerometer_bias) + part(9),
        real(&s.accelerometer_bias),
    ];
    let bg = [real(&s.gyroscope_bias) + part(12), real(&s.gyroscope_bias)];
    for k in 0..samples {
        let (rate, force) = sample(k);
        for i in 0..2 {
            let turn = (real(&rate) - bg[i]) * dt;
            let middle = truth[i] * so3::exp(&(turn * half));
            let down = Vector3::z() * Dual::from(9.806_65);
            let step = (middle * (real(&force) - ba[i]) + down) * dt;
            p[i] += (v[i] + step * half) * dt;
            v[i] += step;
            truth[i] *= so3::exp(&turn);
        }
    }
    let mut e = SVector::<Dual, 15>::zeros();
    e.fixed_rows_mut::<3>(0)
        .copy_from(&so3::log(&(truth[0] * truth[1].inverse())));
    e.fixed_rows_mut::<3>(3).copy_from(&(v[0] - v[1]));
    e.fixed_rows_mut::<3>(6).copy_from(&(p[0] - p[1]));
    e.fixed_rows_mut::<3>(9).copy_from(&(ba[0] - ba[1]));
    e.fixed_rows_mut::<3>(12).copy_from(&(bg[0] - bg[1]));
    e
}

#[test]
fn the_transition_equals_dual_numbers_of_the_true_error() {
    for samples in [1, 20] {
        let (_, exact): (_, M15) = jacobian(|x| true_error_after(&x, samples), &V15::zeros());
        let mut filter = filter();
        run(&mut filter, 0..samples);
        let phi = filter.catch_up().to_matrix();
        // What is left is the turn within a sample, w dt / 12 = 1e-4 of a 3 by 3 block.
        for (i, j) in (0..5).flat_map(|i| (0..5).map(move |j| (3 * i, 3 * j))) {
            let block = |m: &M15| m.fixed_view::<3, 3>(i, j).into_owned();
            let off = (block(&phi) - block(&exact)).norm();
            assert!(
                off <= 2e-4 * block(&exact).norm() + 1e-12,
                "{i} {j}: {off:e}"
            );
        }
    }
}

#[test]
fn transitions_chain() {
    let mut one = filter();
    run(&mut one, 0..13);
    let mut two = one;
    let first = one.catch_up();
    run(&mut one, 13..40);
    run(&mut two, 13..40);
    let second = one.catch_up();
    let both = first.then(&second);
    assert_relative_eq!(
        both.to_matrix(),
        second.to_matrix() * first.to_matrix(),
        epsilon = 1e-12
    );
    let whole = two.catch_up();
    assert_relative_eq!(both.to_matrix(), whole.to_matrix(), epsilon = 1e-12);
    assert_relative_eq!(both.duration_s(), 0.4, epsilon = 1e-12);
}

/// `Q` for a constant specific force by many small steps.
fn van_loan(filter: &ErrorStateFilter<f64>, duration: f64, force_ned: &Vector3<f64>) -> M15 {
    let c = filter.config();
    let mut f = M15::zeros();
    f.fixed_view_mut::<3, 3>(3, 0)
        .copy_from(&(-so3::skew(force_ned)));
    f.fixed_view_mut::<3, 3>(6, 3)
        .copy_from(&Matrix3::identity());
    let square = |x: f64| x * x;
    let g = M15::from_diagonal(&V15::from_fn(|i, _| match i / 3 {
        0 => square(c.gyroscope_noise_density),
        1 => square(c.accelerometer_noise_density),
        _ => 0.0,
    }));
    let steps = 2000;
    let h = duration / f64::from(steps);
    let mut q = M15::zeros();
    for k in 0..steps {
        let t = duration - (f64::from(k) + 0.5) * h;
        let phi = M15::identity() + f * t + f * f * (0.5 * t * t);
        q += phi * g * phi.transpose() * h;
    }
    q
}

#[test]
fn the_covariance_propagates_as_the_dense_form_with_van_loan_noise() {
    // Level, not turning, without biases: the specific force is constant in NED.
    let mut filter = filter();
    filter.state.ned_from_body = UnitQuaternion::identity();
    filter.state.accelerometer_bias.fill(0.0);
    filter.state.gyroscope_bias.fill(0.0);
    let force = Vector3::new(0.8, -0.3, -9.6);
    for _ in 0..20 {
        filter.propagate(&Vector3::zeros(), &force, DT).unwrap();
    }
    let before = filter.state().covariance;
    let pending = filter.state().pending;
    let ahead = filter.predicted_covariance(&pending);
    let phi = filter.catch_up().to_matrix();
    let c = *filter.config();
    let mut expected = phi * before * phi.transpose() + van_loan(&filter, 0.2, &force);
    for i in 0..3 {
        expected[(9 + i, 9 + i)] += c.accelerometer_bias_random_walk.powi(2) * 0.2;
        expected[(12 + i, 12 + i)] += c.gyroscope_bias_random_walk.powi(2) * 0.2;
    }
    let after = filter.state().covariance;
    for i in 0..15 {
        for j in 0..15 {
            let size = (expected[(i, i)] * expected[(j, j)]).sqrt();
            let off = (after[(i, j)] - expected[(i, j)]).abs() / size;
            assert!(off < 1e-8, "{i} {j}: {off:e}");
        }
    }
    assert_eq!(after, ahead);
    assert_eq!(after, after.transpose());
}

/// The oracle: both parts at once, dense, in Joseph form, with the reset.
fn joseph(filter: &ErrorStateFilter<f64>, fix: &GnssCompassFix<f64>) -> (V15, M15, M15) {
    let state = filter.state();
    let mut h = SMatrix::<f64, 6, 15>::zeros();
    h.fixed_view_mut::<3, 3>(0, 6)
        .copy_from(&Matrix3::identity());
    h.fixed_view_mut::<3, 3>(3, 0)
        .copy_from(&Matrix3::identity());
    let mut nu = SVector::<f64, 6>::zeros();
    nu.fixed_rows_mut::<3>(0)
        .copy_from(&(fix.position - state.position));
    let turn = so3::log(&(fix.ned_from_body * state.ned_from_body.inverse()));
    nu.fixed_rows_mut::<3>(3).copy_from(&turn);
    let std = SVector::<f64, 6>::from_fn(|i, _| {
        if i < 3 {
            fix.position_std[i]
        } else {
            fix.attitude_std[i - 3]
        }
    });
    let r = Matrix6::from_diagonal(&std.component_mul(&std));
    let p = state.covariance;
    let s = h * p * h.transpose() + r;
    let k = p * h.transpose() * s.try_inverse().unwrap();
    let d: V15 = k * nu;
    let mut g = M15::identity();
    let half = so3::skew(&d.fixed_rows::<3>(0).into_owned()) * 0.5;
    g.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&(Matrix3::identity() + half));
    let left = M15::identity() - k * h;
    let map = g * left;
    let plus = left * p * left.transpose() + k * r * k.transpose();
    (d, map, g * plus * g.transpose())
}

#[test]
fn an_update_equals_the_dense_joseph_form_and_tells_what_it_did() {
    let mut filter = filter();
    run(&mut filter, 0..20);
    let mut ready = filter;
    let _ = ready.catch_up();
    let (d, map, covariance) = joseph(&ready, &fix());
    let before = *ready.state();

    let update = filter.update_gnss_compass(&fix());
    let after = filter.state();
    assert_eq!(update.position.outcome, Outcome::Fused);
    assert_eq!(update.attitude.outcome, Outcome::Fused);
    let scale = covariance.diagonal().map(f64::sqrt);
    let weights = M15::from_diagonal(&scale.map(|x| 1.0 / x));
    assert_relative_eq!(
        weights * after.covariance * weights,
        weights * covariance * weights,
        epsilon = 1e-9
    );
    let turn = so3::log(&(after.ned_from_body * before.ned_from_body.inverse()));
    assert_relative_eq!(turn, d.fixed_rows::<3>(0).into_owned(), epsilon = 1e-12);
    assert_relative_eq!(
        after.velocity - before.velocity,
        d.fixed_rows::<3>(3).into_owned(),
        epsilon = 1e-10
    );
    assert_relative_eq!(
        after.position - before.position,
        d.fixed_rows::<3>(6).into_owned(),
        epsilon = 1e-10
    );
    assert_relative_eq!(
        after.gyroscope_bias - before.gyroscope_bias,
        d.fixed_rows::<3>(12).into_owned(),
        epsilon = 1e-14
    );
    // A tracker's cross-covariance goes through the same map.
    let mut rows = SMatrix::<f64, 15, 4>::from_fn(spread);
    let dense = map * rows;
    update.feedback.map_rows(&mut rows);
    assert_relative_eq!(rows, dense, epsilon = 1e-10);
    assert_relative_eq!(*update.feedback.reset_angle(), turn, epsilon = 1e-12);
}

#[test]
fn pose_rows_equal_dual_numbers() {
    for [yaw, pitch, roll] in [[0.3, 0.0, 0.0], [2.9, 0.4, -0.3], [-1.0, -1.2, 2.0]] {
        let mut filter = filter();
        filter.state.ned_from_body = rotation::from_yaw_pitch_roll([yaw, pitch, roll]);
        let forward = filter.state.ned_from_body * Vector3::x();
        let (heading, exact): (_, SMatrix<f64, 1, 3>) = jacobian(
            |e: SVector<DualSVec64<3>, 3>| {
                let turned = so3::exp(&e) * forward.map(DualSVec64::<3>::from);
                nalgebra::Vector1::new(nalgebra::RealField::atan2(turned.y, turned.x))
            },
            &Vector3::zeros(),
        );
        assert_relative_eq!(filter.pose().z, heading[0], epsilon = 1e-14);
        let rows = filter.pose_from_error();
        assert_relative_eq!(
            rows.fixed_view::<1, 3>(2, 0).into_owned(),
            exact,
            epsilon = 1e-12
        );
        assert_relative_eq!(rows[(0, 6)] + rows[(1, 7)], 2.0);
    }
    let mut vertical = filter();
    vertical.state.ned_from_body =
        rotation::from_yaw_pitch_roll([0.0, core::f64::consts::FRAC_PI_2, 0.0]);
    assert!(vertical.pose_from_error().norm().is_finite());
}

#[test]
fn what_is_not_finite_is_refused_and_counted() {
    let mut filter = filter();
    run(&mut filter, 0..5);
    let before = *filter.state();
    let (rate, force) = sample(0);
    let nan = Vector3::new(0.0, f64::NAN, 0.0);
    let refusals = [
        filter.propagate(&nan, &force, DT),
        filter.propagate(&rate, &nan, DT),
        filter.propagate(&rate, &force, f64::NAN),
        filter.propagate(&rate, &(force * 1e4), DT),
        filter.propagate(&rate, &force, 0.0),
        filter.propagate(&rate, &force, 60.0),
    ];
    let reasons = refusals.map(Result::unwrap_err);
    assert_eq!(reasons[..3], [SkipReason::NotFinite; 3]);
    assert_eq!(
        reasons[3..],
        [
            SkipReason::OutOfRange,
            SkipReason::NotNewer,
            SkipReason::OutOfRange
        ]
    );
    assert_eq!(filter.state().skipped, 6);
    assert_eq!(
        NavigationState {
            skipped: 0,
            ..*filter.state()
        },
        before
    );

    let _ = filter.catch_up();
    let before = filter.state().covariance;
    for bad in [
        GnssCompassFix {
            position: nan,
            ..fix()
        },
        GnssCompassFix {
            position_std: Vector3::new(1.0, 0.0, 1.0),
            ..fix()
        },
        GnssCompassFix {
            attitude_std: Vector3::new(0.1, -0.1, 0.1),
            ..fix()
        },
    ] {
        let update = filter.update_gnss_compass(&bad);
        assert!(!update.position.outcome.is_fused() && update.feedback.corrections().is_empty());
    }
    assert_eq!(
        (filter.state().skipped, filter.state().covariance),
        (9, before)
    );
    let broken = NavigationState {
        velocity: nan,
        ..*filter.state()
    };
    assert_eq!(filter.restore(broken).unwrap_err().part, "velocity");
    let config = ErrorStateConfig {
        gravity: f64::NAN,
        ..ErrorStateConfig::default()
    };
    let refused = ErrorStateFilter::new(config, start()).unwrap_err();
    assert_eq!(refused.field, "gravity");
}

#[test]
fn a_saved_state_continues_exactly() {
    let mut one = filter();
    run(&mut one, 0..33);
    let saved = *one.state();
    let mut other = ErrorStateFilter::new(*one.config(), start()).unwrap();
    other.restore(saved).unwrap();
    for filter in [&mut one, &mut other] {
        run(filter, 33..60);
        let _ = filter.update_gnss_compass(&fix());
    }
    assert_eq!(one, other);
}

#[test]
fn single_precision_follows_double() {
    let mut double = filter();
    let s = start();
    let single = |v: Vector3<f64>| v.map(|x| x as f32);
    let c = double.config();
    let mut short = ErrorStateFilter::new(
        ErrorStateConfig {
            accelerometer_noise_density: c.accelerometer_noise_density as f32,
            gyroscope_noise_density: c.gyroscope_noise_density as f32,
            accelerometer_bias_random_walk: c.accelerometer_bias_random_walk as f32,
            gyroscope_bias_random_walk: c.gyroscope_bias_random_walk as f32,
            ..ErrorStateConfig::default()
        },
        NavigationState {
            ned_from_body: s.ned_from_body.cast(),
            velocity: single(s.velocity),
            position: single(s.position),
            accelerometer_bias: single(s.accelerometer_bias),
            gyroscope_bias: single(s.gyroscope_bias),
            covariance: s.covariance.map(|x| x as f32),
            pending: ErrorTransition::default(),
            skipped: 0,
        },
    )
    .unwrap();
    let f = fix();
    for k in 0..500 {
        let (rate, force) = sample(k);
        double.propagate(&rate, &force, DT).unwrap();
        short
            .propagate(&single(rate), &single(force), DT as f32)
            .unwrap();
        if k % 20 == 19 {
            let _ = double.update_gnss_compass(&f);
            let _ = short.update_gnss_compass(&GnssCompassFix {
                position: single(f.position),
                position_std: single(f.position_std),
                ned_from_body: f.ned_from_body.cast(),
                attitude_std: single(f.attitude_std),
            });
        }
    }
    let (d, s) = (double.state(), short.state());
    assert!((d.position - s.position.map(f64::from)).norm() < 1e-2);
    assert!(rotation::angle_between(&d.ned_from_body, &s.ned_from_body.cast()) < 1e-4);
    let ratio = s
        .covariance
        .diagonal()
        .map(f64::from)
        .component_div(&d.covariance.diagonal());
    assert!(ratio.iter().all(|r| (r - 1.0).abs() < 1e-2), "{ratio}");
}

#[test]
fn the_covariance_stays_positive_over_a_long_run() {
    let mut filter = filter();
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut noise = |std: f64| Vector3::from_fn(|_, _| std * rng.sample::<f64, _>(StandardNormal));
    for k in 0..60_000 {
        let (rate, force) = sample(k);
        filter
            .propagate(&(rate + noise(0.02)), &(force + noise(0.5)), DT)
            .unwrap();
        if k % 20 == 19 {
            let state = filter.state();
            let fix = GnssCompassFix {
                position: state.position + noise(2.0),
                ned_from_body: so3::exp(&noise(0.05)) * state.ned_from_body,
                ..fix()
            };
            let _ = filter.update_gnss_compass(&fix);
            let p = filter.state().covariance;
            let scale = M15::from_diagonal(&p.diagonal().map(|v| 1.0 / v.sqrt()));
            assert!(cholesky(&(scale * p * scale)).is_some(), "at sample {k}");
        }
    }
    assert!(filter.state().is_usable());
}
