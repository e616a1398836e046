//! What a 50 Hz step of the axis filters costs: operations counted, against those of the recursions written out
//! by hand for the paper's chip.

#![allow(clippy::unwrap_used)]

use counting_scalar::{Counting, Operations, counted};
use nalgebra::Vector3;
use northing_core::attitude::axis_filters::{AxisFilters, AxisFiltersConfig};
use northing_core::navigation::axis_filters::{PositionAxisConfig, PositionAxisFilters};

const DT: f64 = 0.02;

fn vector(v: [f64; 3]) -> Vector3<Counting> {
    Vector3::from(v.map(Counting::new))
}

/// The dearest step of a minute, without and with a fix, with these settings.
fn dearest_steps(config: AxisFiltersConfig<Counting>) -> [Operations; 2] {
    let mut attitude = AxisFilters::new(config, [0.1, -0.2, 0.3].map(Counting::new)).unwrap();
    let mut position = PositionAxisFilters::new(PositionAxisConfig::default()).unwrap();
    let dt = Counting::new(DT);
    let mut dearest = [Operations::default(); 2];
    for k in 0..3000_u32 {
        let t = f64::from(k) * DT;
        let rate = vector([0.3 * t.sin(), 0.2 * (0.7 * t).sin(), 0.4]);
        let force = vector([1.5 * t.sin(), 0.8, -9.8 + 0.5 * t.cos()]);
        let field = vector([20.0 * (0.4 * t).cos(), -20.0 * (0.4 * t).sin(), 45.0]);
        let is_fix = k % 50 == 0;
        let ((), operations) = counted(|| {
            attitude.propagate(&rate, dt).unwrap();
            attitude.update_accelerometer(&force);
            attitude.update_magnetometer(&field);
            let force = attitude.turned_to_ned(&force);
            position
                .propagate_in_ned(&force, Counting::new(9.806_65), dt)
                .unwrap();
            if is_fix {
                position.update_position(u64::from(k), &vector([0.0, 1.0, -0.5]));
            }
        });
        // The first second has the first fix, and the noise of the interval.
        if k > 50 {
            let worst = &mut dearest[usize::from(is_fix)];
            *worst = max(*worst, operations);
        }
    }
    dearest
}

fn max(a: Operations, b: Operations) -> Operations {
    Operations {
        multiplications: a.multiplications.max(b.multiplications),
        additions: a.additions.max(b.additions),
        divisions: a.divisions.max(b.divisions),
        square_roots: a.square_roots.max(b.square_roots),
        functions: a.functions.max(b.functions),
        comparisons: a.comparisons.max(b.comparisons),
    }
}

/// Most multiplications, additions, divisions, square roots and functions of a step without and with a fix: those
/// of the recursions written out by hand, with the body's rates and without a gate for accelerations.
const BY_HAND: [[u32; 5]; 2] = [[108, 117, 3, 1, 13], [144, 150, 6, 1, 13]];

fn assert_within(steps: [Operations; 2], limits: [[u32; 5]; 2]) {
    for (step, limits) in steps.into_iter().zip(limits) {
        let counts = [
            step.multiplications,
            step.additions,
            step.divisions,
            step.square_roots,
            step.functions,
        ];
        let is_within = counts
            .iter()
            .zip(limits)
            .all(|(count, limit)| *count <= limit);
        assert!(is_within, "{counts:?} > {limits:?}");
    }
}

#[test]
fn a_step_costs_no_more_than_one_written_by_hand() {
    let paper = AxisFiltersConfig {
        euler_rates: false,
        norm_gain: Counting::new(0.0),
        ..AxisFiltersConfig::default()
    };
    assert_within(dearest_steps(paper), BY_HAND);
}

/// Rates of the angles divide by the cosine of the pitch, and the gate takes the root of the squared force: one
/// more of each, and nothing else.
#[test]
fn rates_of_angles_and_the_gate_fit_in_beside_it() {
    let [mut without_fix, mut with_fix] = BY_HAND;
    without_fix[2] += 1;
    without_fix[3] += 1;
    with_fix[3] += 1;
    let steps = dearest_steps(AxisFiltersConfig::default());
    assert_within(steps, [without_fix, with_fix]);
    // Sine and cosine of roll, pitch and yaw, and three arc tangents.
    assert_eq!(steps.map(|step| step.functions), [9, 9]);
}
