//! The rows of every aid against dual numbers of what it measures, including the way back to a late fix.

use super::*;
use crate::geometry::so3;
use crate::navigation::augmented_states::{
    AUGMENTED_STATES, AugmentedStates, BAROMETER_OFFSET, GNSS_OFFSET, MAGNETIC_OFFSET, MOUNT_PITCH,
    MOUNT_YAW, TIME_OFFSET,
};
use crate::navigation::error_state::{SIDE, SparseMeasurement};
use crate::navigation::history::{HeldSample, ImuHistory, Instant};
use crate::navigation::{ErrorTransition, NavigationState, STATES};
use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector1, Vector3};
use num_dual::{DualSVec64, jacobian};

const ALL: usize = STATES + AUGMENTED_STATES;
const DT: f64 = 0.01;
const GRAVITY: f64 = 9.806_65;
/// What states are uncertain by, in threes: attitude, velocity, position, biases, augmented states.
const UNCERTAIN: [f64; 9] = [0.05, 0.5, 1.0, 0.1, 0.003, 1.0, 0.05, 5.0, 5.0];
type Dual = DualSVec64<ALL>;
type Errors = SVector<Dual, ALL>;

fn state() -> NavigationState<f64> {
    NavigationState {
        ned_from_body: crate::geometry::rotation::from_yaw_pitch_roll([2.1, 0.15, -0.3]),
        velocity: Vector3::new(8.0, -5.0, 0.4),
        position: Vector3::new(100.0, -50.0, 1.0),
        accelerometer_bias: Vector3::new(0.02, -0.01, 0.03),
        gyroscope_bias: Vector3::new(1e-3, -2e-3, 5e-4),
        covariance: SMatrix::identity(),
        pending: ErrorTransition::default(),
        skipped: 0,
    }
}

fn side() -> AugmentedStates<f64> {
    let mut side = AugmentedStates::default();
    for (i, value) in [0.3, -0.2, 0.5, 0.02, 12.0, 0.1, -0.08, 14.0, -21.0, 9.0]
        .into_iter()
        .enumerate()
    {
        side.start(i, value, 1.0);
    }
    side
}

/// A turning, accelerating vehicle.
fn sample() -> (Vector3<f64>, Vector3<f64>) {
    (Vector3::new(0.1, -0.05, 0.4), Vector3::new(1.5, 2.0, -9.9))
}

fn real(v: &Vector3<f64>) -> Vector3<Dual> {
    v.map(Dual::from)
}

fn quaternion(q: &UnitQuaternion<f64>) -> UnitQuaternion<Dual> {
    let [w, i, j, k] = [q.w, q.i, q.j, q.k].map(Dual::from);
    UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(w, i, j, k))
}

/// The true instant `age` ago if the errors are `x` (E1), by the same history of samples.
fn true_instant(x: &Errors, age: Dual) -> Instant<Dual> {
    let part = |i: usize| x.fixed_rows::<3>(i).into_owned();
    let s = state();
    let truth = NavigationState {
        ned_from_body: so3::exp(&part(0)) * quaternion(&s.ned_from_body),
        velocity: real(&s.velocity) + part(3),
        position: real(&s.position) + part(6),
        accelerometer_bias: real(&s.accelerometer_bias) + part(9),
        gyroscope_bias: real(&s.gyroscope_bias) + part(12),
        covariance: SMatrix::zeros(),
        pending: ErrorTransition::default(),
        skipped: 0,
    };
    let mut history = ImuHistory::<Dual, 32>::default();
    let (rate, force) = sample();
    for _ in 0..32 {
        history.push(&HeldSample {
            angular_rate: real(&rate),
            specific_force: real(&force),
            dt: Dual::from(DT),
            unseen: [Dual::from(0.0); 2],
        });
    }
    history.at(&truth, Dual::from(GRAVITY), age)
}

fn instant(age: f64) -> Instant<f64> {
    let mut history = ImuHistory::<f64, 32>::default();
    let (rate, force) = sample();
    for _ in 0..32 {
        history.push(&HeldSample {
            angular_rate: rate,
            specific_force: force,
            dt: DT,
            unseen: [0.0; 2],
        });
    }
    history.at(&state(), GRAVITY, age)
}

fn side_value(x: &Errors, i: usize) -> Dual {
    x[SIDE + i] + Dual::from(side().values[i])
}

/// Rows of a measurement against the derivative of what it measures; `loose` is how far first order in the age may
/// be off, relative to what the row sees of the uncertain states.
fn check<const M: usize>(
    made: &SparseMeasurement<f64, M>,
    exact: impl Fn(&Errors) -> SVector<Dual, M>,
    loose: f64,
) {
    let (predicted, expected): (_, SMatrix<f64, M, ALL>) =
        jacobian(|x: Errors| exact(&x), &SVector::zeros());
    for (i, row) in made.rows.iter().enumerate() {
        assert!(
            (made.residual[i] + predicted[i]).abs() < 1e-9,
            "predicted {i}: {} {}",
            made.residual[i],
            predicted[i]
        );
        let mut dense = SVector::<f64, ALL>::zeros();
        for (state, h) in row.elements() {
            dense[*state] += h;
        }
        // In units of what the states are uncertain by, so that elements can be compared.
        let scale = SVector::<f64, ALL>::from_fn(|j, _| UNCERTAIN[j / 3]);
        let off = (dense.transpose() - expected.row(i)).component_mul(&scale.transpose());
        let size = dense.component_mul(&scale).norm();
        assert!(
            off.norm() < 1e-9 + loose * size,
            "{i}: {off:.1e} of {size:.3}"
        );
    }
}

#[test]
fn position_rows_equal_dual_numbers_at_any_latency() {
    let arm = Vector3::new(1.2, -0.4, -0.9);
    for (latency, loose) in [(-0.02, 1e-9), (0.0, 1e-4), (0.1, 1e-3), (-0.05, 1e-3)] {
        let side = side();
        let then = instant(latency + side.values[TIME_OFFSET]);
        let made = gnss_position::measurement(
            &then,
            &side.values.fixed_rows::<3>(GNSS_OFFSET).into(),
            &arm,
            &Vector3::zeros(),
            &Vector3::repeat(1.0),
            [0, 1, 2],
        );
        check(
            &made,
            |x| {
                let then = true_instant(x, side_value(x, TIME_OFFSET) + Dual::from(latency));
                let offset = Vector3::from_fn(|i, _| side_value(x, GNSS_OFFSET + i));
                then.position + then.ned_from_body * real(&arm) + offset
            },
            loose,
        );
    }
}

#[test]
fn velocity_rows_equal_dual_numbers_at_any_latency() {
    let arm = Vector3::new(1.2, -0.4, -0.9);
    for (latency, loose) in [(-0.02, 1e-9), (0.0, 1e-3), (0.12, 3e-3)] {
        let then = instant(latency + side().values[TIME_OFFSET]);
        let (zero, one) = (Vector3::zeros(), Vector3::repeat(1.0));
        let made = gnss_velocity::measurement(&then, &arm, &zero, &one, [0, 1, 2]);
        check(
            &made,
            |x| {
                let then = true_instant(x, side_value(x, TIME_OFFSET) + Dual::from(latency));
                then.velocity + then.ned_from_body * then.angular_rate.cross(&real(&arm))
            },
            loose,
        );
    }
}

#[test]
fn heading_rows_equal_dual_numbers() {
    let made = heading::measurement(&instant(0.0), 0.0, 1.0).unwrap();
    check(
        &made,
        |x| {
            let forward = true_instant(x, Dual::from(0.0)).ned_from_body * Vector3::x();
            Vector1::new(nalgebra::RealField::atan2(forward.y, forward.x))
        },
        0.0,
    );
}

#[test]
fn a_magnetic_heading_tells_tilt_by_the_tangent_of_the_dip() {
    let dip = 62_f64.to_radians();
    let field = Vector3::new(dip.cos(), 0.0, dip.sin()) * 48.0;
    let body = state().ned_from_body.inverse() * field;
    let made = heading::magnetic(&instant(0.0), &body, 0.0, 1.0).unwrap();
    let [row] = &made.rows;
    // Level north: de/dx = -tan(dip), the east tilt does nothing.
    assert_eq!(row.elements()[1].0, 0);
    assert!((row.elements()[1].1 + dip.tan()).abs() < 1e-12);
    check(
        &made,
        |x| {
            // Where the truth would see magnetic north, and the estimate therefore misses.
            let seen = true_instant(x, Dual::from(0.0)).ned_from_body * real(&body);
            Vector1::new(nalgebra::RealField::atan2(seen.y, seen.x))
        },
        0.0,
    );
}

#[test]
fn a_magnetic_field_tells_heading_tilt_and_iron() {
    let (dip, declination) = (62_f64.to_radians(), -0.25_f64);
    let level = Vector3::new(
        dip.cos() * declination.cos(),
        dip.cos() * declination.sin(),
        dip.sin(),
    );
    let iron = side().values.fixed_rows::<3>(MAGNETIC_OFFSET).into_owned();
    let body = state().ned_from_body.inverse() * (level * 48.0) + iron;
    let then = instant(0.0);
    let made = magnetic_field::measurement(&then, &side(), &body, declination, 0.1).unwrap();
    let (sin, cos) = declination.sin_cos();
    check(
        &made,
        |x| {
            let b = Vector3::from_fn(|i, _| side_value(x, MAGNETIC_OFFSET + i));
            let seen = true_instant(x, Dual::from(0.0)).ned_from_body * (real(&body) - b);
            let east = seen.y * cos - seen.x * sin;
            Vector1::new(east / (48.0 * dip.cos()))
        },
        0.0,
    );
    // What iron the body has, and how the residual falls with it.
    let more = body + Vector3::new(2.0, 1.0, -1.0);
    let off = magnetic_field::measurement(&then, &side(), &more, declination, 0.1).unwrap();
    let [row] = &off.rows;
    let known = row.elements().iter().filter(|(state, _)| *state >= SIDE);
    let explained: f64 = known.zip([2.0, 1.0, -1.0]).map(|((_, h), b)| h * b).sum();
    assert!((off.residual[0] - explained).abs() < 1e-9);
    let [freed] = off.freed;
    assert!((SIDE + MAGNETIC_OFFSET..SIDE + MAGNETIC_OFFSET + 3).contains(&freed));
}

#[test]
fn a_barometer_sees_height_and_offset() {
    let made = barometer::measurement(&instant(0.0), &side(), 0.0, 1.0);
    check(
        &made,
        |x| {
            let then = true_instant(x, Dual::from(0.0));
            Vector1::new(-then.position.z + side_value(x, BAROMETER_OFFSET))
        },
        0.0,
    );
    let height = barometer::pressure_height(89_874.6_f64).unwrap();
    assert!(
        (height - 1000.0).abs() < 0.2,
        "standard atmosphere: {height}"
    );
    assert!(barometer::pressure_height(f64::NAN).is_none());
    assert!(
        barometer::pressure_height(1013.25).is_none(),
        "hectopascals"
    );
}

#[test]
fn velocities_of_the_vehicle_equal_dual_numbers() {
    let arm = Vector3::new(-1.0, 0.3, 0.5);
    let along = |x: &Errors, axis: usize| {
        let then = true_instant(x, Dual::from(0.0));
        let velocity =
            then.ned_from_body.inverse() * then.velocity + then.angular_rate.cross(&real(&arm));
        let zero = Dual::from(0.0);
        let yaw = so3::exp(&Vector3::new(zero, zero, side_value(x, MOUNT_YAW)));
        let pitch = so3::exp(&Vector3::new(zero, side_value(x, MOUNT_PITCH), zero));
        ((yaw * pitch).inverse() * velocity)[axis]
    };
    let made = body_velocity::non_holonomic(&instant(0.0), &side(), &arm, 1.0);
    check(
        &made,
        |x| SVector::<Dual, 2>::new(along(x, 1), along(x, 2)),
        0.0,
    );
    let made = body_velocity::speed(&instant(0.0), &side(), &arm, 0.0, 1.0);
    check(&made, |x| Vector1::new(along(x, 0)), 0.0);
}

#[test]
fn at_rest_velocity_and_bias_are_seen_as_they_are() {
    let then = instant(0.0);
    check(
        &zero_velocity::velocity(&then, 1.0),
        |x| true_instant(x, Dual::from(0.0)).velocity,
        0.0,
    );
    let made = zero_velocity::rate(&Vector3::zeros(), &state().gyroscope_bias, 1.0);
    check(
        &made,
        |x| x.fixed_rows::<3>(12) + real(&state().gyroscope_bias),
        0.0,
    );
}

#[test]
fn what_points_straight_up_has_no_heading() {
    let mut then = instant(0.0);
    then.ned_from_body =
        crate::geometry::rotation::from_yaw_pitch_roll([0.0, core::f64::consts::FRAC_PI_2, 0.0]);
    assert!(heading::measurement(&then, 0.0, 1.0).is_err());
    let down = then.ned_from_body.inverse() * Vector3::z();
    assert!(heading::magnetic(&then, &down, 0.0, 1.0).is_err());
    assert!(heading::magnetic(&then, &(down * f64::NAN), 0.0, 1.0).is_err());
    let clean = AugmentedStates::default();
    assert!(magnetic_field::measurement(&then, &clean, &down, 0.0, 1.0).is_err());
    let broken = down * f64::INFINITY;
    assert!(magnetic_field::measurement(&then, &clean, &broken, 0.0, 1.0).is_err());
}

#[test]
fn a_heading_across_the_half_turn_is_a_small_residual() {
    let mut then = instant(0.0);
    then.ned_from_body = crate::geometry::rotation::from_yaw_pitch_roll([3.13, 0.0, 0.0]);
    let made = heading::measurement(&then, -3.13, 1.0).unwrap();
    assert!((made.residual[0] - (core::f64::consts::TAU - 6.26)).abs() < 1e-9);
}
