//! Cost of the GNSS/INS: its block propagation and its scalar updates beside the dense forms, and whole steps.
//!
//! `cargo bench -p northing-core --bench navigation` ends with the ratios, dense over structured, of the same run.

#![allow(clippy::print_stdout, clippy::unwrap_used)]

use std::hint::black_box;
use std::time::Instant as Clock;

use nalgebra::{Matrix3, SMatrix, SVector, UnitQuaternion, Vector3};
use northing_core::kalman::CountedGate;
use northing_core::navigation::aiding::gnss_position::GnssPosition;
use northing_core::navigation::error_state::{Row, SparseMeasurement};
use northing_core::navigation::gnss_ins::{GnssIns, GnssInsConfig};
use northing_core::navigation::validity::Validity;
use northing_core::navigation::{
    AugmentedStates, ErrorStateConfig, ErrorStateFilter, ErrorTransition, NavigationState,
};

type M15 = SMatrix<f64, 15, 15>;

const ROUNDS: usize = 400;
const CALLS: u32 = 500;

fn filter() -> ErrorStateFilter<f64> {
    let stds = [0.05, 0.5, 1.5, 0.02, 0.0004];
    let a = M15::from_fn(|i, j| ((i * 7 + j * 3) as f64).sin());
    let d = M15::from_diagonal(&SVector::from_fn(|i, _| stds[i / 3]));
    let state = NavigationState {
        ned_from_body: UnitQuaternion::from_euler_angles(0.1, -0.2, 0.7),
        velocity: Vector3::new(10.0, 0.0, 0.0),
        position: Vector3::zeros(),
        accelerometer_bias: Vector3::zeros(),
        gyroscope_bias: Vector3::zeros(),
        covariance: d * (a * a.transpose() * 0.05 + M15::identity()) * d,
        pending: ErrorTransition::default(),
        skipped: 0,
    };
    ErrorStateFilter::new(ErrorStateConfig::default(), state).unwrap()
}

/// Nanoseconds a call of one round.
fn round(call: &mut impl FnMut()) -> f64 {
    let start = Clock::now();
    for _ in 0..CALLS {
        call();
    }
    start.elapsed().as_secs_f64() * 1e9 / f64::from(CALLS)
}

/// Nanoseconds a call of two forms: the best of many short rounds, taken in turns, so that whatever else the machine
/// does falls on both.
fn nanoseconds_of_both(mut structured: impl FnMut(), mut dense: impl FnMut()) -> [f64; 2] {
    let mut best = [f64::INFINITY; 2];
    for _ in 0..ROUNDS {
        best[0] = best[0].min(round(&mut structured));
        best[1] = best[1].min(round(&mut dense));
    }
    best
}

fn propagation() -> [f64; 2] {
    let mut moved = filter();
    let (rate, force) = (Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.5, 0.2, -9.7));
    for _ in 0..10 {
        moved.propagate(&rate, &force, 0.01).unwrap();
    }
    let transition = moved.state().pending;
    let phi = transition.to_matrix();
    let covariance = moved.state().covariance;
    let noise = M15::identity() * 1e-6;
    let blocks = || {
        black_box(black_box(&moved).predicted_covariance(black_box(&transition)));
    };
    let dense = || {
        let (phi, p) = (black_box(&phi), black_box(&covariance));
        black_box(phi * p * phi.transpose() + noise);
    };
    nanoseconds_of_both(blocks, dense)
}

fn update() -> [f64; 2] {
    let start = filter();
    let measurement = SparseMeasurement {
        rows: [6, 7, 8].map(Row::of_state),
        residual: Vector3::zeros(),
        variance: Vector3::repeat(1.0),
        freed: [6, 7, 8],
    };
    // In place, as it is used: the variances fall, the work is the same.
    let (mut filter, mut side) = (start, AugmentedStates::default());
    let mut gate = CountedGate::default();
    let scalars = || {
        black_box(filter.fuse_sparse(&mut side, black_box(&measurement), &mut gate, 16.3, &mut ()));
    };
    let mut h = SMatrix::<f64, 3, 15>::zeros();
    h.fixed_view_mut::<3, 3>(0, 6).fill_with_identity();
    let r = Matrix3::identity();
    let p = start.state().covariance;
    let dense = || {
        let (h, p) = (black_box(&h), black_box(&p));
        let s = h * p * h.transpose() + r;
        let gain = p * h.transpose() * s.try_inverse().unwrap();
        let left = M15::identity() - gain * h;
        let plus = left * p * left.transpose() + gain * r * gain.transpose();
        black_box((gain * measurement.residual, plus));
    };
    nanoseconds_of_both(scalars, dense)
}

/// Whole GNSS/INS at 100 Hz with a fix a second on a winding road, once it is aligned, nanoseconds a sample.
fn whole() -> f64 {
    const DT: f64 = 0.01;
    let mut ins = GnssIns::<f64>::new(GnssInsConfig::default()).unwrap();
    let (mut k, mut heading, mut position) = (0_i64, 0.0_f64, Vector3::zeros());
    let mut sample = || {
        k += 1;
        let (time_ns, t) = (k * 10_000_000, k as f64 * DT);
        let (speed, rate) = (10.0 + 3.0 * (0.2 * t).sin(), 0.15 * (0.31 * t).sin());
        let force = Vector3::new(0.6 * (0.2 * t).cos(), speed * rate, -9.806_65);
        heading += rate * DT;
        position += Vector3::new(heading.cos(), heading.sin(), 0.0) * (speed * DT);
        ins.imu(time_ns, &(Vector3::z() * rate), &force).unwrap();
        if k % 100 == 0 {
            let fix = GnssPosition {
                ned: position,
                std: Vector3::repeat(2.0),
                has_height: true,
            };
            ins.gnss_position(time_ns, &fix);
        }
        ins.validity()
    };
    assert!((0..100_000).any(|_| sample() == Validity::Aided));
    (0..ROUNDS)
        .map(|_| {
            round(&mut || {
                black_box(sample());
            })
        })
        .fold(f64::INFINITY, f64::min)
}

fn main() {
    for (what, [structured, dense]) in [
        ("propagation of the covariance", propagation()),
        ("update with a position", update()),
    ] {
        let ratio = dense / structured;
        println!("{what}: {structured:.0} ns, dense {dense:.0} ns, ratio {ratio:.1}");
    }
    let step = whole();
    println!(
        "GNSS/INS, a sample: {step:.0} ns, {:.2} million a second",
        1e3 / step
    );
}
