//! Bias, axes and scale of boards whose errors are known.

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::geometry::so3;
use northing_recording::{GnssVelocity, Sample};
use northing_simulation::random::{normal_vector, stream};

use super::Diagnosis;
use super::axes::{Axes, AxesFit, Estimated};
use super::rests::Rests;

/// What a board has.
#[derive(Debug, Clone, Copy)]
struct Errors {
    misalignment: Vector3<f64>,
    scale: Vector3<f64>,
    bias: Vector3<f64>,
    /// Of the gyroscope's bias at 17.5 s, about x, rad/s.
    jump: f64,
}

const GOOD: Errors = Errors {
    misalignment: Vector3::new(0.0, 0.0, 0.0),
    scale: Vector3::new(0.0, 0.0, 0.0),
    bias: Vector3::new(0.0, 0.0, 0.0),
    jump: 0.0,
};

/// Eleven poses, 4 s of rest in each, and turns of 2 s between them.
fn board(errors: Errors) -> (Rests, Axes) {
    let mut noise = stream(5, "rests");
    let (mut rests, mut axes) = (Rests::default(), Axes::default());
    let turns = [0, 1, 0, 2, 1, 2, 0, 1, 2, 0].map(|k| Vector3::ith(k, 1.0));
    let mut attitude = UnitQuaternion::identity();
    let chip = so3::exp(&errors.misalignment).inverse();
    let mut bias = Vector3::new(0.01, -0.02, 0.005);
    for k in 0..6400_i64 {
        let (leg, t) = ((k / 600) as usize, (k % 600) as f64 * 0.01);
        let rate = match turns.get(leg) {
            Some(axis) if (4.0..6.0).contains(&t) => axis * 0.8,
            _ => Vector3::zeros(),
        };
        if k == 1750 {
            bias.x += errors.jump;
        }
        attitude *= so3::exp(&(rate * 0.01));
        let up = chip * (attitude.inverse() * Vector3::new(0.0, 0.0, 9.81));
        let force = up.component_mul(&errors.scale.add_scalar(1.0)) + errors.bias;
        let measured = rate + bias + normal_vector(&mut noise, 2e-3);
        let felt = force + normal_vector(&mut noise, 0.02);
        let time_ns = k * 10_000_000;
        rests.rate(time_ns, &measured);
        rests.force(&felt);
        axes.rate(time_ns, &measured, false);
        axes.force(time_ns, &felt, false);
    }
    (rests, axes)
}

fn fit(errors: Errors) -> AxesFit {
    board(errors).1.fit().unwrap()
}

#[test]
fn two_chips_are_found_with_their_angles() {
    let misalignment = Vector3::new(0.03, -0.02, 0.01);
    let found = fit(Errors {
        misalignment,
        ..GOOD
    });
    let off = found.misalignment.value - misalignment;
    assert!(off.norm() < 0.006, "{:?}", found.misalignment);
    let within = Estimated {
        value: off,
        ..found.misalignment
    };
    assert!(within.sigmas() < 4.0, "{:?}", found.misalignment);
    assert!(found.misalignment.sigmas() > 10.0, "{found:?}");
    assert!(found.scale.sigmas() < 5.0 && found.bias.value.norm() < 0.1);
}

#[test]
fn a_good_board_has_nothing_wrong() {
    let found = fit(GOOD);
    assert!(found.misalignment.sigmas() < 4.0, "{found:?}");
    assert!(found.scale.sigmas() < 4.0, "{found:?}");
    assert!(found.bias.sigmas() < 4.0, "{found:?}");
    assert_eq!(board(GOOD).0.bias_change(), None);
}

#[test]
fn a_scale_and_a_bias_of_the_accelerometer_are_told_apart() {
    let scale = Vector3::new(0.03, -0.02, 0.01);
    let found = fit(Errors { scale, ..GOOD });
    assert!((found.scale.value - scale).norm() < 0.008, "{found:?}");
    assert!(found.scale.sigmas() > 8.0 && found.bias.value.norm() < 0.1);
    let bias = Vector3::new(0.3, -0.1, 0.2);
    let found = fit(Errors { bias, ..GOOD });
    assert!((found.bias.value - bias).norm() < 0.06, "{found:?}");
    assert!(
        found.bias.sigmas() > 8.0 && found.scale.sigmas() < 4.0,
        "{found:?}"
    );
}

#[test]
fn a_bias_of_the_gyroscope_that_jumps_is_found_between_two_rests() {
    let jump = board(Errors { jump: 0.03, ..GOOD })
        .0
        .bias_change()
        .unwrap();
    assert!((jump.rad_s - 0.03).abs() < 2e-3, "{jump:?}");
    let between = jump.before_ns..=jump.after_ns;
    assert!(between.contains(&17_500_000_000), "{jump:?}");
}

/// GIVEN a smooth car at 14 m/s that turns steadily to one side, then to the other WHEN a receiver says that it moves THEN these are no
/// rests, and no bias has changed. Inertial samples alone cannot tell.
#[test]
fn a_car_in_a_steady_turn_does_not_rest_where_a_receiver_says_that_it_moves() {
    let found = |has_receiver: bool| {
        let mut noise = stream(6, "car");
        let mut diagnosis = Diagnosis::default();
        for k in 0..4000_i64 {
            let time_ns = k * 10_000_000;
            let rate = Vector3::new(0.0, 0.0, if k < 2000 { -0.1 } else { 0.03 });
            let force = Vector3::new(0.0, 14.0 * rate.z, 9.81);
            if has_receiver && k % 100 == 0 {
                let velocity = GnssVelocity::from_course(14.0, 0.0);
                diagnosis.over_ground(time_ns, None, Some(&velocity));
            }
            let rate = rate + normal_vector(&mut noise, 2e-3);
            diagnosis.sample(time_ns, 0, &Sample::AngularRate(rate));
            let force = force + normal_vector(&mut noise, 0.02);
            diagnosis.sample(time_ns, 0, &Sample::SpecificForce(force));
        }
        diagnosis.rests.bias_change()
    };
    assert!(found(false).is_some());
    assert_eq!(found(true), None);
}
