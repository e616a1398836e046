//! Cost of one attitude step, beside VQF on the same samples in the same run.
//!
//! `cargo bench -p northing-core --bench attitude` prints, per estimator, the median time of one
//! sample with gyroscope, accelerometer and magnetometer, and its ratio to `vqf-rs`, to the
//! Mahony filter of the `ahrs` crate, and to our explicit complementary filter. The kernels are timed in turns, so that a busy machine slows
//! all of them alike. With valgrind installed,
//! `scripts/count-instructions` prints instruction counts as well.

#![allow(clippy::print_stdout)] // a benchmark's output is its purpose

use std::hint::black_box;
use std::time::Instant;

use ahrs::Ahrs as _;
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use northing_core::attitude::bounded_velocity::{
    BoundedVelocity, BoundedVelocityConfig, ScaleStates,
};
use northing_core::attitude::complementary::{Complementary, ComplementaryForm};
use northing_core::attitude::driver::{AttitudeDriver, DriverConfig};
use northing_core::attitude::ekf_reconstruction::EkfReconstruction;
use northing_core::attitude::mekf::Mekf;
use northing_core::attitude::mekf3::Mekf3;
use northing_core::attitude::quaternion_ekf::QuaternionEkf;
use northing_core::attitude::usque::Usque;
use northing_core::attitude::{AttitudeConfig, AttitudeEstimator, InitialState, References};
use northing_core::geometry::so3;
use northing_core::navigation::cascade::{Cascade, CascadeConfig};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

const RATE_HZ: f64 = 285.7;

struct Samples {
    gyroscope: Vec<Vector3<f64>>,
    accelerometer: Vec<Vector3<f64>>,
    magnetometer: Vec<Vector3<f64>>,
}

/// A minute of a wearable in motion, noise included.
fn samples() -> Samples {
    let mut rng = Pcg64Mcg::seed_from_u64(20);
    let mut noise = |std: f64| Vector3::from_fn(|_, _| std * rng.sample::<f64, _>(StandardNormal));
    let dt = 1.0 / RATE_HZ;
    let mut truth = UnitQuaternion::identity();
    let mut out = Samples {
        gyroscope: vec![],
        accelerometer: vec![],
        magnetometer: vec![],
    };
    for k in 0..(60.0 * RATE_HZ) as u32 {
        let t = f64::from(k) * dt;
        let rate = Vector3::new(
            2.0 * (1.7 * t).sin(),
            1.5 * (1.1 * t).cos(),
            (0.4 * t).sin(),
        );
        truth *= so3::exp(&(rate * dt));
        let sway = Vector3::new((5.0 * t).sin(), (4.0 * t).cos(), 0.5 * (6.0 * t).sin());
        out.gyroscope.push(rate + noise(0.005));
        out.accelerometer
            .push(truth.inverse() * (Vector3::new(0.0, 0.0, 9.81) + sway) + noise(0.05));
        out.magnetometer
            .push(truth.inverse() * Vector3::new(0.0, 20.0, -40.0) + noise(0.5));
    }
    out
}

fn start<E: AttitudeEstimator<f64>>(mut estimator: E) -> E {
    estimator.initialize(&InitialState {
        attitude: UnitQuaternion::identity(),
        attitude_covariance: Matrix3::identity() * 0.01,
        gyroscope_bias: Vector3::zeros(),
        gyroscope_bias_std: 0.02,
        north_known: false,
        references: References {
            specific_force: Vector3::new(0.0, 0.0, 9.81),
            magnetic_field: Some(Vector3::new(0.0, 20.0, -40.0)),
        },
    });
    estimator
}

/// Nanoseconds per sample of one pass over all samples.
#[inline(never)] // instruction counts are taken by the name of the function
fn pass<E: AttitudeEstimator<f64>>(estimator: E, s: &Samples) -> f64 {
    let mut estimator = start(estimator);
    let dt = 1.0 / RATE_HZ;
    let begin = Instant::now();
    for k in 0..s.gyroscope.len() {
        estimator.propagate(black_box(&s.gyroscope[k]), dt);
        black_box(estimator.update_accelerometer(&s.accelerometer[k]));
        black_box(estimator.update_magnetometer(&s.magnetometer[k]));
        black_box(estimator.attitude());
    }
    begin.elapsed().as_nanos() as f64 / s.gyroscope.len() as f64
}

/// As [`pass`], with stamped samples through the driver, which checks them for faults.
#[inline(never)]
fn pass_driver<E: AttitudeEstimator<f64>>(estimator: E, s: &Samples) -> f64 {
    let mut driver = AttitudeDriver::new(estimator, DriverConfig::default());
    let begin = Instant::now();
    for k in 0..s.gyroscope.len() {
        let time_ns = (k as f64 * (1e9 / RATE_HZ)) as i64;
        black_box(driver.gyroscope(time_ns, black_box(&s.gyroscope[k])));
        black_box(driver.accelerometer(time_ns, &s.accelerometer[k]));
        black_box(driver.magnetometer(time_ns, &s.magnetometer[k]));
        black_box(driver.attitude());
    }
    begin.elapsed().as_nanos() as f64 / s.gyroscope.len() as f64
}

/// As [`pass`], with the position observer behind the estimator and a position every tenth sample.
#[inline(never)]
fn pass_cascade<E: AttitudeEstimator<f64>>(estimator: E, s: &Samples) -> f64 {
    let mut estimator = start(estimator);
    let at_rest = Vector3::new(0.0, 0.0, 9.81);
    let mut observer = Cascade::new(CascadeConfig::lab(), at_rest).expect("valid settings");
    let dt = 1.0 / RATE_HZ;
    let begin = Instant::now();
    for k in 0..s.gyroscope.len() {
        estimator.propagate(black_box(&s.gyroscope[k]), dt);
        black_box(estimator.update_accelerometer(&s.accelerometer[k]));
        black_box(estimator.update_magnetometer(&s.magnetometer[k]));
        let attitude = estimator.attitude();
        black_box(observer.propagate(&attitude, &s.accelerometer[k], dt)).expect("good samples");
        if k % 10 == 0 {
            let rate = s.gyroscope[k] - estimator.rate_at_rest();
            black_box(observer.update_position(&Vector3::zeros(), 0.0, &attitude, &rate));
        }
    }
    black_box((estimator.attitude(), observer));
    begin.elapsed().as_nanos() as f64 / s.gyroscope.len() as f64
}

#[inline(never)]
fn pass_vqf(s: &Samples) -> f64 {
    let ts = 1.0 / RATE_HZ;
    let mut filter = vqf_rs::VQF::new(ts, None, None, None);
    let begin = Instant::now();
    for k in 0..s.gyroscope.len() {
        let (g, a, m) = (
            black_box(&s.gyroscope[k]),
            &s.accelerometer[k],
            &s.magnetometer[k],
        );
        filter.update((*g).into(), (*a).into(), Some((*m).into()));
        black_box(filter.quat_9d());
    }
    begin.elapsed().as_nanos() as f64 / s.gyroscope.len() as f64
}

#[inline(never)]
fn pass_ahrs(s: &Samples) -> f64 {
    let mut filter = ahrs::Mahony::new(1.0 / RATE_HZ, 1.0, 0.3);
    // Its nalgebra is another version.
    let array = |v: &Vector3<f64>| -> [f64; 3] { (*v).into() };
    let begin = Instant::now();
    for k in 0..s.gyroscope.len() {
        let [g, a, m] = [&s.gyroscope[k], &s.accelerometer[k], &s.magnetometer[k]].map(array);
        let updated = filter.update(&black_box(g).into(), &a.into(), &m.into());
        black_box(updated.ok().copied());
    }
    begin.elapsed().as_nanos() as f64 / s.gyroscope.len() as f64
}

/// A name and what to time: nanoseconds per sample.
type Kernel<'a> = (&'a str, Box<dyn Fn() -> f64 + 'a>);

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

fn main() {
    let s = samples();
    let settings = AttitudeConfig::<f64>::lab();
    let hand_held = AttitudeConfig::<f64>::hand_held();
    let mut kernels: Vec<Kernel<'_>> = Vec::new();
    let samples = &s;
    kernels.push(("vqf-rs, 9 axes", Box::new(move || pass_vqf(samples))));
    kernels.push(("ahrs, Mahony", Box::new(move || pass_ahrs(samples))));
    for (name, form) in [
        ("complementary", ComplementaryForm::Explicit),
        ("complementary-passive", ComplementaryForm::Passive),
        ("complementary-direct", ComplementaryForm::Direct),
    ] {
        let filter = Complementary::new(form, settings).expect("valid settings");
        kernels.push((name, Box::new(move || pass(filter, samples))));
    }
    let mekf = Mekf::new(settings).expect("valid settings");
    kernels.push(("mekf, field vector", Box::new(move || pass(mekf, samples))));
    let by_heading = Mekf::new(hand_held).expect("valid settings");
    kernels.push((
        "mekf, hand-held (heading)",
        Box::new(move || pass(by_heading, samples)),
    ));
    let mekf3 = Mekf3::new(settings).expect("valid settings");
    kernels.push(("mekf3", Box::new(move || pass(mekf3, samples))));
    let ekf = QuaternionEkf::new(settings).expect("valid settings");
    kernels.push(("quaternion-ekf", Box::new(move || pass(ekf, samples))));
    let usque = Usque::new(settings).expect("valid settings");
    kernels.push(("usque", Box::new(move || pass(usque, samples))));

    let explicit = Complementary::new(ComplementaryForm::Explicit, settings);
    let explicit = explicit.expect("valid settings");
    let behind_ekf = EkfReconstruction::new(settings).expect("valid settings");
    kernels.push((
        "passive behind the EKF",
        Box::new(move || pass(behind_ekf, samples)),
    ));
    kernels.push(("cascade", Box::new(move || pass_cascade(explicit, samples))));
    kernels.push((
        "cascade-ekf",
        Box::new(move || pass_cascade(behind_ekf, samples)),
    ));

    let full = BoundedVelocityConfig {
        initial_hard_iron_std_ut: 12.0,
        ..BoundedVelocityConfig::lab()
    };
    let small = BoundedVelocityConfig {
        scale_states: ScaleStates::Diagonal,
        ..BoundedVelocityConfig::lab()
    };
    for (name, config) in [
        ("bounded-velocity, 22 states", full),
        ("bounded-velocity, 19 states", BoundedVelocityConfig::lab()),
        ("bounded-velocity, 13 states", small),
    ] {
        let filter = BoundedVelocity::new(config).expect("valid settings");
        kernels.push((name, Box::new(move || pass(filter, samples))));
    }

    for (name, config) in [
        ("driver, bounded-velocity, 22", full),
        ("driver, bounded-velocity, 19", BoundedVelocityConfig::lab()),
    ] {
        let filter = BoundedVelocity::new(config).expect("valid settings");
        kernels.push((name, Box::new(move || pass_driver(filter, samples))));
    }
    kernels.push((
        "driver, mekf, field vector",
        Box::new(move || pass_driver(mekf, samples)),
    ));

    let only = std::env::args().skip(1).find(|a| !a.starts_with('-'));
    kernels.retain(|(name, _)| only.as_ref().is_none_or(|o| name.contains(o.as_str())));
    let rounds = if only.is_some() { 1 } else { 41 };
    let mut times = vec![Vec::new(); kernels.len()];
    for _ in 0..rounds {
        for (kernel, out) in kernels.iter().zip(&mut times) {
            out.push((kernel.1)());
        }
    }
    println!(
        "one sample with gyroscope, accelerometer and magnetometer, f64, {rounds} rounds in turns"
    );
    let peers = ["vqf-rs, 9 axes", "ahrs, Mahony", "complementary"];
    println!(
        "  {:<28}{:>9}{:>11}   times vqf-rs, times ahrs, times complementary (medians of the rounds)",
        "", "least", "median"
    );
    for ((name, _), t) in kernels.iter().zip(&times) {
        let ratios = peers.map(|peer| {
            let place = kernels.iter().position(|(name, _)| *name == peer)?;
            let pairs = t.iter().zip(&times[place]);
            Some(median(pairs.map(|(ours, peers)| ours / peers).collect()))
        });
        let least = t.iter().copied().fold(f64::INFINITY, f64::min);
        let ratios = ratios.map(|r| r.map_or_else(|| "-".to_owned(), |r| format!("{r:.2}")));
        let [vqf, ahrs, explicit] = ratios;
        println!(
            "  {name:<28}{least:>6.0} ns{:>8.0} ns{vqf:>8}{ahrs:>8}{explicit:>8}",
            median(t.clone())
        );
    }
}
