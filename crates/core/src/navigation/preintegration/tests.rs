use super::*;
use approx::assert_relative_eq;
use nalgebra::{Quaternion, SVector};
use num_dual::{DualSVec64, jacobian};
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

type Dual = DualSVec64<6>;

const DT: f64 = 0.01;
const NOISE: SampleNoise<f64> = SampleNoise {
    gyroscope_noise_density: 2.5e-3,
    accelerometer_noise_density: 0.03,
};

/// A drone in gusts.
fn sample(t: f64) -> (Vector3<f64>, Vector3<f64>) {
    let rate = Vector3::new(0.6 * (4.0 * t).sin(), 0.5 * (3.1 * t).cos(), 0.4);
    let force = Vector3::new(
        1.5 * (2.0 * t).sin(),
        -1.0 + t,
        -9.8 + 2.0 * (5.0 * t).cos(),
    );
    (rate, force)
}

fn integrated(samples: usize) -> Preintegration<f64> {
    let mut made = Preintegration::new(Vector3::zeros(), Vector3::zeros());
    for k in 0..samples {
        let (rate, force) = sample((k as f64 + 0.5) * DT);
        made.add(&rate, &force, DT, &NOISE).unwrap();
    }
    made
}

#[test]
fn a_steady_turn_with_a_steady_force_has_a_closed_form() {
    // Rate w about the vertical and force f ahead: the force turns, dv = f/w (sin, 1 - cos), dp its integral.
    let (w, f, t): (f64, f64, f64) = (0.7, 2.0, 1.5);
    let mut made = Preintegration::new(Vector3::zeros(), Vector3::zeros());
    for _ in 0..150 {
        made.add(&(Vector3::z() * w), &(Vector3::x() * f), DT, &NOISE)
            .unwrap();
    }
    let Increment {
        rotation: turned,
        velocity,
        position,
    } = made.increment();
    assert_relative_eq!(so3::log(&turned), Vector3::z() * (w * t), epsilon = 1e-12);
    let (sin, cos) = (w * t).sin_cos();
    let expected = Vector3::new(sin, 1.0 - cos, 0.0) * (f / w);
    assert_relative_eq!(velocity, expected, epsilon = 2e-5);
    let expected = Vector3::new(1.0 - cos, w * t - sin, 0.0) * (f / (w * w));
    assert_relative_eq!(position, expected, epsilon = 2e-5);
    assert_relative_eq!(made.duration_s(), t, epsilon = 1e-12);
}

#[test]
fn an_interval_equals_a_thousand_times_finer_integration() {
    let made = integrated(100).increment();
    let fine = 1e-5;
    let (mut attitude, mut velocity, mut position) = (
        UnitQuaternion::identity(),
        Vector3::zeros(),
        Vector3::zeros(),
    );
    for k in 0..100_000 {
        let (rate, force) = sample((f64::from(k / 1000) + 0.5) * DT);
        let turn = so3::exp(&(rate * (0.5 * fine)));
        let acceleration = attitude * turn * force;
        position += (velocity + acceleration * (0.5 * fine)) * fine;
        velocity += acceleration * fine;
        attitude = attitude * turn * turn;
    }
    assert!(rotation::angle_between(&made.rotation, &attitude) < 1e-9);
    assert!((made.velocity - velocity).norm() < 2e-5);
    // The force turns within a sample: w f dt^2 / 12.
    assert!((made.position - position).norm() < 1e-4);
}

/// The increment, as a rotation vector against that of no bias, for biases `x`.
fn increment_for(x: &SVector<Dual, 6>, samples: usize) -> SVector<Dual, 9> {
    let real = |v: &Vector3<f64>| v.map(Dual::from);
    let mut made =
        Preintegration::<Dual>::new(x.fixed_rows::<3>(0).into(), x.fixed_rows::<3>(3).into());
    let noise = SampleNoise {
        gyroscope_noise_density: Dual::from(0.0),
        accelerometer_noise_density: Dual::from(0.0),
    };
    for k in 0..samples {
        let (rate, force) = sample((k as f64 + 0.5) * DT);
        made.add(&real(&rate), &real(&force), Dual::from(DT), &noise)
            .unwrap();
    }
    let nominal = integrated(samples).increment().rotation;
    let q = nominal.as_ref();
    let [w, i, j, k] = [q.w, q.i, q.j, q.k].map(Dual::from);
    let increment = made.increment();
    let turn =
        increment.rotation * UnitQuaternion::new_unchecked(Quaternion::new(w, i, j, k)).inverse();
    let mut out = SVector::<Dual, 9>::zeros();
    out.fixed_rows_mut::<3>(0).copy_from(&so3::log(&turn));
    out.fixed_rows_mut::<3>(3).copy_from(&increment.velocity);
    out.fixed_rows_mut::<3>(6).copy_from(&increment.position);
    out
}

#[test]
fn the_bias_jacobian_equals_dual_numbers() {
    for samples in [1, 2, 100] {
        let (_, exact): (_, SMatrix<f64, 9, 6>) =
            jacobian(|x| increment_for(&x, samples), &SVector::zeros());
        let made = integrated(samples).bias_jacobian();
        for (row, column) in (0..3).flat_map(|i| [(3 * i, 0), (3 * i, 3)]) {
            let of = |m: &SMatrix<f64, 9, 6>| m.fixed_view::<3, 3>(row, column).into_owned();
            let off = (of(&made) - of(&exact)).norm();
            // What is left is the turn within a sample, w dt / 6.
            assert!(
                off <= 1.5e-3 * of(&exact).norm() + 1e-13,
                "{samples}, {row} {column}: {off:e}"
            );
        }
    }
}

#[test]
fn a_correction_for_biases_is_right_to_second_order() {
    let (force, rate) = (
        Vector3::new(0.1, -0.05, 0.08),
        Vector3::new(0.01, 0.02, -0.015),
    );
    let error = |scale: f64| {
        let (force, rate) = (force * scale, rate * scale);
        let mut again = Preintegration::new(force, rate);
        for k in 0..100 {
            let (w, f) = sample((f64::from(k) + 0.5) * DT);
            again.add(&w, &f, DT, &NOISE).unwrap();
        }
        let (made, exact) = (integrated(100).corrected(&force, &rate), again.increment());
        [
            rotation::angle_between(&made.rotation, &exact.rotation),
            (made.velocity - exact.velocity).norm(),
            (made.position - exact.position).norm(),
        ]
    };
    let (whole, half) = (error(1.0), error(0.5));
    for (whole, half) in whole.into_iter().zip(half) {
        assert!(whole < 2e-3 && whole < 4.4 * half, "{whole:e} {half:e}");
    }
}

/// With a constant force and no turn the covariance over many samples is that of one long one (E9).
#[test]
fn the_covariance_of_a_constant_force_has_a_closed_form() {
    let force = Vector3::new(1.0, -2.0, -9.5);
    let mut made = Preintegration::new(Vector3::zeros(), Vector3::zeros());
    for _ in 0..200 {
        made.add(&Vector3::zeros(), &force, DT, &NOISE).unwrap();
    }
    let (q, t, a) = (made.covariance(), 2.0_f64, so3::skew(&force));
    let (sg, sa) = (
        NOISE.gyroscope_noise_density.powi(2),
        NOISE.accelerometer_noise_density.powi(2),
    );
    let (one, aat) = (Matrix3::<f64>::identity(), a * a.transpose());
    let expected = [
        (0, 0, one * (sg * t)),
        (3, 0, a * (-0.5 * sg * t.powi(2))),
        (6, 0, a * (-sg * t.powi(3) / 6.0)),
        (3, 3, one * (sa * t) + aat * (sg * t.powi(3) / 3.0)),
        (
            6,
            3,
            one * (0.5 * sa * t.powi(2)) + aat * (0.125 * sg * t.powi(4)),
        ),
        (
            6,
            6,
            one * (sa * t.powi(3) / 3.0) + aat * (sg * t.powi(5) / 20.0),
        ),
    ];
    for (row, column, block) in expected {
        let off = (q.fixed_view::<3, 3>(row, column) - block).norm();
        assert!(off < 1e-12 + 1e-9 * block.norm(), "{row} {column}: {off:e}");
    }
}

#[test]
fn the_covariance_is_that_of_many_noisy_runs() {
    let runs = 4000;
    let mut random = Pcg64Mcg::seed_from_u64(16);
    let mut draw = |density: f64| {
        Vector3::from_fn(|_, _| random.sample::<f64, _>(StandardNormal)) * (density / DT.sqrt())
    };
    let (made, mut sum) = (integrated(100), SMatrix::<f64, 9, 9>::zeros());
    let exact = made.increment();
    for _ in 0..runs {
        let mut noisy = Preintegration::new(Vector3::zeros(), Vector3::zeros());
        for k in 0..100 {
            let (rate, force) = sample((f64::from(k) + 0.5) * DT);
            let rate = rate + draw(NOISE.gyroscope_noise_density);
            let force = force + draw(NOISE.accelerometer_noise_density);
            noisy.add(&rate, &force, DT, &NOISE).unwrap();
        }
        let noisy = noisy.increment();
        let mut error = SVector::<f64, 9>::zeros();
        let turn = so3::log(&(noisy.rotation * exact.rotation.inverse()));
        error.fixed_rows_mut::<3>(0).copy_from(&turn);
        error
            .fixed_rows_mut::<3>(3)
            .copy_from(&(noisy.velocity - exact.velocity));
        error
            .fixed_rows_mut::<3>(6)
            .copy_from(&(noisy.position - exact.position));
        sum += error * error.transpose() / f64::from(runs);
    }
    let q = made.covariance();
    let std = q.diagonal().map(f64::sqrt);
    for (i, j) in (0..9).flat_map(|i| (0..9).map(move |j| (i, j))) {
        let off = (sum[(i, j)] - q[(i, j)]) / (std[i] * std[j]);
        // Five standard deviations of a correlation from so many runs.
        assert!(
            off.abs() < 5.0 * (2.0 / f64::from(runs)).sqrt(),
            "{i} {j}: {off}"
        );
    }
}

#[test]
fn single_precision_agrees() {
    let (made, mut single) = (
        integrated(100),
        Preintegration::<f32>::new(Vector3::zeros(), Vector3::zeros()),
    );
    let noise = SampleNoise {
        gyroscope_noise_density: 2.5e-3,
        accelerometer_noise_density: 0.03,
    };
    for k in 0..100 {
        let (rate, force) = sample((f64::from(k) + 0.5) * DT);
        let (rate, force) = (rate.map(|x| x as f32), force.map(|x| x as f32));
        single.add(&rate, &force, DT as f32, &noise).unwrap();
    }
    let (a, b) = (made.increment(), single.increment());
    assert!((a.velocity - b.velocity.map(f64::from)).norm() < 2e-5);
    assert!((a.position - b.position.map(f64::from)).norm() < 2e-5);
    let turn = |q: &UnitQuaternion<f64>| so3::log(q);
    let off = turn(&a.rotation) - so3::log(&b.rotation).map(f64::from);
    assert!(off.norm() < 2e-6);
    let (q, single) = (made.covariance(), single.covariance().map(f64::from));
    assert!((q - single).norm() < 1e-5 * q.norm());
}

#[test]
fn what_cannot_be_a_sample_changes_nothing() {
    let before = integrated(10);
    let (mut made, zero, nan) = (before, Vector3::zeros(), Vector3::repeat(f64::NAN));
    for (rate, force, dt, reason) in [
        (nan, zero, DT, SkipReason::NotFinite),
        (zero, nan, DT, SkipReason::NotFinite),
        (zero, zero, f64::NAN, SkipReason::NotFinite),
        (zero, zero, 0.0, SkipReason::NotNewer),
        (zero, zero, -DT, SkipReason::NotNewer),
        (zero, zero, 11.0, SkipReason::TooLate),
        (Vector3::x() * 101.0, zero, DT, SkipReason::OutOfRange),
        (zero, Vector3::x() * 1e4, DT, SkipReason::OutOfRange),
    ] {
        assert_eq!(made.add(&rate, &force, dt, &NOISE), Err(reason));
        assert_eq!(made, before);
    }
}
