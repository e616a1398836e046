//! What a step costs, counted: multiplications and additions, held to the table of the block form.
//!
//! `cargo test -p northing-core --lib operations -- --nocapture` prints the table of `docs/results/navigation.md`.

use super::*;
use crate::kalman::{CountedGate, Outcome};
use crate::navigation::SideStates;
use crate::navigation::aiding::{gnss_position, gnss_velocity, heading};
use crate::navigation::history::{self, ImuHistory};
use counting_scalar::{Counting, Operations, counted};
use nalgebra::SVector;

type M15 = SMatrix<f64, 15, 15>;

const GRAVITY: f64 = 9.806_65;

fn vector(x: f64, y: f64, z: f64) -> Vector3<Counting> {
    Vector3::new(x, y, z).map(Counting::new)
}

/// A filter in the middle of its work, all of whose covariance is filled.
fn filter() -> ErrorStateFilter<Counting> {
    let a = M15::from_fn(|i, j| ((i * 7 + j * 3) as f64).sin());
    let scale = SVector::<f64, 15>::from_fn(|i, _| [0.05, 0.5, 1.5, 0.02, 0.0004][i / 3]);
    let d = M15::from_diagonal(&scale);
    let covariance = d * (a * a.transpose() * 0.05 + M15::identity()) * d;
    let state = NavigationState {
        ned_from_body: rotation::from_yaw_pitch_roll([0.7, 0.1, -0.2].map(Counting::new)),
        velocity: vector(8.0, 5.0, 0.1),
        position: vector(100.0, -50.0, 1.0),
        accelerometer_bias: vector(0.02, -0.01, 0.03),
        gyroscope_bias: vector(1e-3, -2e-3, 5e-4),
        covariance: covariance.map(Counting::new),
        pending: ErrorTransition::default(),
        skipped: 0,
    };
    let config = ErrorStateConfig {
        accelerometer_bias_random_walk: lit(1e-3),
        gyroscope_bias_random_walk: lit(3e-5),
        ..ErrorStateConfig::default()
    };
    ErrorStateFilter::new(config, state).unwrap()
}

fn sample(filter: &mut ErrorStateFilter<Counting>) {
    let (rate, force) = (vector(0.1, 0.2, -0.3), vector(0.5, 0.2, -9.7));
    filter.propagate(&rate, &force, lit(0.02)).unwrap();
}

fn fuse<const M: usize>(
    filter: &mut ErrorStateFilter<Counting>,
    measurement: &SparseMeasurement<Counting, M>,
) {
    let (mut side, mut gate) = (SideStates::default(), CountedGate::default());
    let innovation = filter.fuse_sparse(&mut side, measurement, &mut gate, lit(16.3));
    assert_eq!(innovation.outcome, Outcome::Fused);
}

/// Three rows of one element each, as the prototype has them.
fn of_states(first: usize) -> SparseMeasurement<Counting, 3> {
    SparseMeasurement {
        rows: [0, 1, 2].map(|i| Row::of_state(first + i)),
        residual: vector(0.1, -0.2, 0.3),
        variance: Vector3::repeat(lit(1.0)),
        freed: [0, 1, 2].map(|i| first + i),
    }
}

fn instant(filter: &ErrorStateFilter<Counting>, age_s: f64) -> history::Instant<Counting> {
    let mut history = ImuHistory::<Counting, 2>::default();
    history.push(&vector(0.1, 0.2, -0.3), &vector(0.5, 0.2, -9.7), lit(0.2));
    history.at(filter.state(), lit(GRAVITY), lit(age_s))
}

/// Prints a line of the table and holds it to its bound: multiplications and additions.
fn line(what: &str, done: Operations, [multiplications, additions]: [u32; 2]) {
    let others = done.divisions + done.square_roots + done.functions;
    std::println!(
        "| {what} | {} | {} | {others} | {multiplications} | {additions} |",
        done.multiplications,
        done.additions
    );
    assert!(
        done.multiplications <= multiplications && done.additions <= additions,
        "{what}: {done:?}"
    );
}

/// The first three bounds are those of the prototype's block form with symmetry (846, 1052 and 1952
/// multiplications), which leaves out that a correction goes into the state and that the covariance is re-centred
/// there (E11, E12). The filter does both; they are counted apart, and in the step as it is.
#[test]
fn a_step_takes_no_more_operations_than_the_table_says() {
    std::println!("| | multiplications | additions | others | at most | at most |");
    std::println!("|---|---|---|---|---|---|");
    let mut filter = filter();
    let ((), sampled) = counted(|| sample(&mut filter));
    let mut many = filter;
    let (_, moved) = counted(|| filter.catch_up());
    let predicted = sampled + moved;
    line(
        "prediction: a sample and the covariance over it",
        predicted,
        [846, 758],
    );

    let correction = SVector::repeat(Counting::new(1e-3));
    let mut copy = filter;
    let (_, injected) = counted(|| copy.inject(&correction));
    let then = instant(&filter, 0.0);
    let mut copy = filter;
    let ((), headed) = counted(|| {
        let made = heading::measurement(&then, lit(0.72), lit(0.01)).unwrap();
        fuse(&mut copy, &made);
    });
    let with_heading = predicted + (headed - injected);
    line("the same, and a heading", with_heading, [1052, 930]);

    let ((), position) = counted(|| fuse(&mut filter, &of_states(POSITION)));
    let ((), velocity) = counted(|| fuse(&mut filter, &of_states(VELOCITY)));
    let worst = with_heading + (position - injected) + (velocity - injected);
    line(
        "the same, and a position and a velocity: the worst step",
        worst,
        [1952, 1746],
    );

    line(
        "a correction into the state, and the covariance re-centred",
        injected,
        [151, 146],
    );
    let whole = worst + injected + injected + injected;
    line(
        "the worst step with its three corrections",
        whole,
        [2325, 2181],
    );

    line("one inertial sample", sampled, [158, 90]);
    let ((), second) = counted(|| sample(&mut many));
    line("one more before the covariance follows", second, [149, 154]);
    let (_, moved) = counted(|| many.catch_up());
    line("the covariance over several samples", moved, [954, 1026]);

    // An antenna off the unit, a late fix: rows of up to nine elements.
    let then = instant(&filter, 0.1);
    let (arm, one) = (vector(0.5, 0.2, -1.0), Vector3::repeat(lit(1.0)));
    let mut copy = filter;
    let ((), position) = counted(|| {
        let side = SideStates::default();
        let ned = then.position + arm;
        fuse(
            &mut copy,
            &gnss_position::measurement(&then, &side, &arm, &ned, &one, [0, 1, 2]),
        );
    });
    line(
        "a late position of an antenna off the unit",
        position,
        [879, 819],
    );
    let ((), velocity) = counted(|| {
        let ned = then.velocity;
        fuse(
            &mut copy,
            &gnss_velocity::measurement(&then, &arm, &ned, &one, [0, 1, 2]),
        );
    });
    line(
        "a late velocity of an antenna off the unit",
        velocity,
        [1178, 1077],
    );
}
