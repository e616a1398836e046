//! What a pass is made of, against dual numbers and dense matrices.

use super::super::estimate::{Mean, Triangle, propagate};
use super::super::robust_update::fuse;
use super::super::window::position_variance;
use super::super::*;
use crate::geometry::rotation;
use crate::kalman::covariance::mirror_upper;
use crate::navigation::aiding::gnss_position;
use crate::navigation::error_state::{Row, SparseMeasurement};
use crate::navigation::history::Instant;
use crate::navigation::preintegration::Preintegration;
use crate::navigation::{ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS, POSITION, VELOCITY};
use approx::assert_relative_eq;
use nalgebra::{Quaternion, RowSVector};
use num_dual::{DualSVec64, jacobian};

const N: usize = ALIGNMENT_ERRORS;
type M19 = SMatrix<f64, N, N>;
type Dual = DualSVec64<N>;

fn spread(i: usize, j: usize) -> f64 {
    ((i * 7 + j * 3) as f64).sin()
}

fn covariance() -> M19 {
    let a = M19::from_fn(spread);
    let scale = |i: usize, _| [0.1, 0.5, 1.5, 0.1, 0.02, 0.3, 0.03][i / 3];
    let d = M19::from_diagonal(&SVector::<f64, N>::from_fn(scale));
    let mut p = d * (a * a.transpose() * 0.05 + M19::identity()) * d;
    mirror_upper(&mut p);
    p
}

fn mean() -> Mean<f64> {
    Mean {
        ned_from_body: rotation::from_yaw_pitch_roll([0.7, 0.1, -0.2]),
        velocity: Vector3::new(8.0, 5.0, 0.1),
        position: Vector3::new(100.0, -50.0, 1.0),
        accelerometer_bias: Vector3::new(0.02, -0.01, 0.03),
        gyroscope_bias: Vector3::new(1e-3, -2e-3, 5e-4),
        gnss_offset: Vector3::new(0.3, -0.2, 0.5),
        lateness: 0.02,
    }
}

fn inertial() -> Preintegration<f64> {
    let mut made = Preintegration::new(Vector3::zeros(), Vector3::zeros());
    let noise = SampleNoise {
        gyroscope_noise_density: 2.5e-3,
        accelerometer_noise_density: 0.03,
    };
    for k in 0..100 {
        let t = f64::from(k) * 0.01;
        let rate = Vector3::new(0.1 * (3.0 * t).sin(), 0.05, 0.2);
        let force = Vector3::new((2.0 * t).sin(), 1.0, -9.8);
        made.add(&rate, &force, 0.01, &noise).unwrap();
    }
    made
}

fn real(v: &Vector3<f64>) -> Vector3<Dual> {
    v.map(Dual::from)
}

fn dual_rotation(q: &UnitQuaternion<f64>) -> UnitQuaternion<Dual> {
    let [w, i, j, k] = [q.w, q.i, q.j, q.k].map(Dual::from);
    UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k))
}

/// The states that are off by `x`, as dual numbers.
fn truth(mean: &Mean<f64>, x: &SVector<Dual, N>) -> Mean<Dual> {
    let at = Mean {
        ned_from_body: dual_rotation(&mean.ned_from_body),
        velocity: real(&mean.velocity),
        position: real(&mean.position),
        accelerometer_bias: real(&mean.accelerometer_bias),
        gyroscope_bias: real(&mean.gyroscope_bias),
        gnss_offset: real(&mean.gnss_offset),
        lateness: Dual::from(mean.lateness),
    };
    at.corrected(x)
}

fn dual_config() -> InMotionAlignmentConfig<Dual> {
    InMotionAlignmentConfig::default()
}

/// The error after an interval of a truth that begins `x` away from the estimate.
fn error_after(x: &SVector<Dual, N>) -> SVector<Dual, N> {
    let made = inertial();
    let mut ends = [truth(&mean(), x), truth(&mean(), &SVector::zeros())];
    let noise = SampleNoise {
        gyroscope_noise_density: Dual::from(0.0),
        accelerometer_noise_density: Dual::from(0.0),
    };
    // The same samples again: those of `inertial`.
    let mut samples = Preintegration::<Dual>::new(Vector3::zeros(), Vector3::zeros());
    for k in 0..100 {
        let t = f64::from(k) * 0.01;
        let rate = Vector3::new(0.1 * (3.0 * t).sin(), 0.05, 0.2);
        let force = Vector3::new((2.0 * t).sin(), 1.0, -9.8);
        samples
            .add(&real(&rate), &real(&force), Dual::from(0.01), &noise)
            .unwrap();
    }
    assert_relative_eq!(made.duration_s(), samples.duration_s().re, epsilon = 1e-12);
    for end in &mut ends {
        let (mut error, mut p) = (SVector::zeros(), SMatrix::zeros());
        let none = Vector3::zeros();
        propagate(
            end,
            &mut error,
            &mut p,
            &samples,
            &none,
            Dual::from(0.0),
            &dual_config(),
        );
    }
    let [a, b] = ends;
    let mut out = SVector::<Dual, N>::zeros();
    let turn = so3::log(&(a.ned_from_body * b.ned_from_body.inverse()));
    for (first, part) in [
        (ATTITUDE, turn),
        (VELOCITY, a.velocity - b.velocity),
        (POSITION, a.position - b.position),
        (
            ACCELEROMETER_BIAS,
            a.accelerometer_bias - b.accelerometer_bias,
        ),
        (GYROSCOPE_BIAS, a.gyroscope_bias - b.gyroscope_bias),
        (CORRELATED, a.gnss_offset - b.gnss_offset),
    ] {
        out.fixed_rows_mut::<3>(first).copy_from(&part);
    }
    out[LATE] = a.lateness - b.lateness;
    out
}

/// An acceleration that tilt and biases can have feigned shows no heading: an error of the heading then moves nothing else.
#[test]
fn what_is_feigned_shows_no_heading() {
    let (made, config) = (inertial(), InMotionAlignmentConfig::default());
    let slow = Vector3::repeat(0.7);
    let heading = SVector::<f64, N>::from_fn(|i, _| f64::from(u8::from(i == ATTITUDE + 2)));
    let moved = |feigned: f64| {
        let (mut mean, mut error, mut p) = (mean(), heading, M19::zeros());
        propagate(
            &mut mean, &mut error, &mut p, &made, &slow, feigned, &config,
        );
        (error - heading).norm()
    };
    // It accelerates by more than 1 m/s^2.
    assert!(moved(0.1) > 0.5 && moved(10.0) < 1e-12);
}

/// What `propagate` does to the error is the derivative of what it does to the states, and what it does to the
/// covariance is that matrix on both sides, with the noise of the interval.
#[test]
fn an_interval_carries_error_and_covariance_as_dual_numbers_say() {
    let (_, exact): (_, M19) = jacobian(|x| error_after(&x), &SVector::zeros());
    let (made, config, slow) = (
        inertial(),
        InMotionAlignmentConfig::default(),
        Vector3::repeat(0.7),
    );
    let map = |x: &SVector<f64, N>| {
        let (mut mean, mut error, mut p) = (mean(), *x, M19::zeros());
        propagate(&mut mean, &mut error, &mut p, &made, &slow, 0.0, &config);
        error
    };
    for state in 0..N {
        let column = map(&SVector::from_fn(|i, _| f64::from(u8::from(i == state))));
        let off = (column - exact.column(state)).norm();
        // The correction for biases is linear about those subtracted, 0.02 m/s^2 and 2e-3 rad/s away.
        assert!(off < 3e-3 * column.norm(), "{state}: {off:e}");
    }

    let phi = M19::from_columns(&core::array::from_fn::<_, N, _>(|state| {
        map(&SVector::from_fn(|i, _| f64::from(u8::from(i == state))))
    }));
    let (mut at, mut none, mut p) = (mean(), SVector::zeros(), covariance());
    propagate(&mut at, &mut none, &mut p, &made, &slow, 0.0, &config);
    let axes = rotation::to_matrix(&mean().ned_from_body);
    let mut turn = SMatrix::<f64, 9, 9>::zeros();
    for first in [0, 3, 6] {
        turn.fixed_view_mut::<3, 3>(first, first).copy_from(&axes);
    }
    let mut q = M19::zeros();
    q.fixed_view_mut::<9, 9>(0, 0)
        .copy_from(&(turn * made.covariance() * turn.transpose()));
    let kept = (-1.0_f64 / 60.0).exp();
    for i in 0..3 {
        q[(9 + i, 9 + i)] = config.accelerometer_bias_random_walk.powi(2);
        q[(12 + i, 12 + i)] = config.gyroscope_bias_random_walk.powi(2);
        q[(15 + i, 15 + i)] = 0.49 * (1.0 - kept * kept);
    }
    let expected = phi * covariance() * phi.transpose() + q;
    assert!((p - expected).abs().max() < 1e-10);
    assert_eq!(p, p.transpose());
}

/// The row of a position: derivative of where the receiver says that it is.
#[test]
fn a_position_row_equals_dual_numbers() {
    let arm = Vector3::new(0.5, -0.2, 0.8);
    let at = mean();
    let measured = |x: SVector<Dual, N>| {
        let t = truth(&at, &x);
        let before = t.velocity * t.lateness;
        t.position - before + t.ned_from_body * real(&arm) + t.gnss_offset
    };
    let (_, exact): (_, SMatrix<f64, 3, N>) = jacobian(measured, &SVector::zeros());
    let then = Instant {
        ned_from_body: at.ned_from_body,
        velocity: at.velocity,
        position: at.position - at.velocity * at.lateness,
        angular_rate: Vector3::zeros(),
        acceleration: Vector3::zeros(),
        age_s: at.lateness,
        force_integral: Vector3::zeros(),
    };
    let one = Vector3::repeat(1.0);
    let made = gnss_position::measurement(&then, &at.gnss_offset, &arm, &one, &one, [0, 1, 2]);
    for (i, row) in made.rows.iter().enumerate() {
        let mut dense = RowSVector::<f64, N>::zeros();
        for (state, h) in row.elements() {
            dense[*state] += h;
        }
        assert!((dense - exact.row(i)).norm() < 1e-12, "{i}");
    }
}

fn measurement(residual: [f64; 3]) -> SparseMeasurement<f64, 3> {
    SparseMeasurement {
        rows: core::array::from_fn(|i| {
            Row::of_state(POSITION + i)
                .with(CORRELATED + i, 1.0)
                .with(LATE, -8.0)
        }),
        residual: residual.into(),
        variance: Vector3::new(0.04, 0.09, 0.16),
        freed: [0; 3],
    }
}

/// With normal errors (many degrees of freedom) it is the dense Joseph update; with few it is that update with the
/// noise divided by the weight, found by iterating weight and residual after the update.
#[test]
fn an_update_equals_the_dense_one_with_the_noise_of_its_weight() {
    for (residual, dof, has_gross_errors) in [
        ([0.3, -0.2, 0.5], 1e6, true),
        ([9.0, -7.0, 4.0], 4.0, true),
        ([900.0, -700.0, 400.0], 4.0, true),
        ([900.0, -700.0, 400.0], 4.0, false),
        ([0.3, -0.2, 0.5], 4.0, true),
    ] {
        let m = measurement(residual);
        let mut h = SMatrix::<f64, 3, N>::zeros();
        for (i, row) in m.rows.iter().enumerate() {
            for (state, value) in row.elements() {
                h[(i, *state)] += value;
            }
        }
        let x = SVector::<f64, N>::from_fn(|i, _| 0.01 * i as f64);
        let (mut p, mut error) = (covariance(), x);
        let seen = fuse(&mut p, &mut error, &m, dof, has_gross_errors).unwrap();
        let r = Matrix3::from_diagonal(&m.variance);
        let weighted = r / seen.weight;
        let off = m.residual - h * x;
        let s = h * covariance() * h.transpose();
        let k = covariance() * h.transpose() * (s + weighted).try_inverse().unwrap();
        let left = M19::identity() - k * h;
        let expected = left * covariance() * left.transpose() + k * weighted * k.transpose();
        assert!((p - expected).abs().max() < 1e-10);
        assert!((error - (x + k * off)).norm() < 1e-10);
        assert_relative_eq!(seen.innovation.covariance, s + r, epsilon = 1e-10);
        let nis = off.dot(&((s + r).try_inverse().unwrap() * off));
        assert_relative_eq!(seen.innovation.nis, nis, epsilon = 1e-9);
        let likelihood =
            -0.5 * (s + r).determinant().ln() - 0.5 * (dof + 3.0) * (nis / dof).ln_1p();
        assert_relative_eq!(
            seen.log_likelihood,
            likelihood,
            epsilon = 1e-9 * (1.0 + dof)
        );
        let inverse = r.try_inverse().unwrap();
        // From a weight: the one that it leads to, and the negative log density of the state there.
        let settled = |mut weight: f64| {
            let mut cost = 0.0;
            for _ in 0..3 {
                let k = covariance() * h.transpose() * (s + r / weight).try_inverse().unwrap();
                let p = covariance() - k * h * covariance();
                let after = off - h * (k * off);
                let moved = off.dot(&((s + r / weight).try_inverse().unwrap() * (h * (k * off))));
                let e = after.dot(&(inverse * after));
                let student = (dof + 3.0) / 2.0 * (e / dof).ln_1p();
                cost = moved / 2.0 + student.min(4.6 + 1.5 * e.max(1.0).ln());
                let expected = e + (inverse * (h * p * h.transpose())).trace();
                weight = f64::min(1.0, (dof + 3.0) / (dof + expected));
            }
            (weight, cost)
        };
        let unmoved = (dof + 3.0) / (dof + off.dot(&(inverse * off)));
        let (trusting, doubting) = (settled(1.0), settled(unmoved));
        let weight = if has_gross_errors && doubting.1 < trusting.1 {
            doubting.0
        } else {
            trusting.0
        };
        assert_relative_eq!(seen.weight, weight, max_relative = 1e-5);
    }
}

#[test]
fn what_cannot_be_fused_changes_nothing() {
    for (residual, variance) in [
        (f64::NAN, 1.0),
        (1.0, f64::NAN),
        (f64::INFINITY, 1.0),
        (1.0, -1e9),
    ] {
        let mut m = measurement([residual, 0.0, 0.0]);
        m.variance[1] = variance;
        let (mut p, mut error) = (covariance(), SVector::zeros());
        assert!(fuse(&mut p, &mut error, &m, 4.0, true).is_none());
        assert_eq!((p, error), (covariance(), SVector::zeros()));
    }
}

#[test]
fn a_triangle_is_the_whole_matrix() {
    let p = covariance();
    let packed = Triangle::of(&p);
    let variances = SVector::<f64, N>::from_fn(|i, _| packed.variance(i));
    assert_eq!(variances, p.diagonal());
    let lower = |m: &M19| m.lower_triangle();
    assert_eq!(lower(&packed.full()), lower(&p));
    assert_eq!(packed.full(), packed.full().transpose());
}

/// Level from any force: down is down.
#[test]
fn a_level_points_the_force_upwards() {
    for force in [
        Vector3::new(0.0, 0.0, -9.8),
        Vector3::new(0.0, 0.0, 9.8),
        Vector3::new(9.8, 0.0, 0.0),
        Vector3::new(-9.8, 0.0, 0.0),
        Vector3::new(0.3, -6.0, 7.0),
    ] {
        let level: UnitQuaternion<f64> = hypothesis::levelled(&force);
        let up = level * force;
        assert!((up + Vector3::z() * force.norm()).norm() < 1e-9, "{force}");
    }
}

#[test]
fn the_noise_of_a_position_grows_with_speed_and_stated_deviation() {
    let config = InMotionAlignmentConfig::<f64>::default();
    let of = |std: f64, speed: f64| {
        position_variance(&Vector3::repeat(std), &(Vector3::x() * speed), 1.0, &config).y
    };
    assert_relative_eq!(of(1.5, 0.0), 1.2 * 1.2 + 0.01, epsilon = 1e-12);
    assert_relative_eq!(of(1.5, 20.0), 1.2 * 1.2 + 0.02, epsilon = 1e-12);
}
