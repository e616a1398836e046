//! The models of the samples and of the fixes, each against physics or a dense update of its own.

use super::*;
use crate::navigation::augmented_states::{AUGMENTED_STATES, GNSS_OFFSET};
use crate::navigation::{STATES, VELOCITY};
use approx::assert_relative_eq;
use nalgebra::SMatrix;

/// A GNSS/INS under way at this position and velocity, tilted and turned.
fn under_way(
    config: GnssInsConfig<f64>,
    position: Vector3<f64>,
    velocity: Vector3<f64>,
) -> GnssIns<f64, 64> {
    let (mut ins, _) = drive(config, &Drive::default(), |_, _, _| ());
    let state = NavigationState {
        ned_from_body: rotation::from_yaw_pitch_roll([2.0, 0.3, -0.4]),
        position,
        velocity,
        ..*ins.filter.state()
    };
    assert!(ins.filter.start(state));
    ins
}

/// Far from the origin gravity points to the centre of the Earth, and falls with the square of the distance to it.
#[test]
fn a_body_at_rest_anywhere_feels_the_gravity_of_a_round_earth() {
    let radius = 6.371e6;
    let round = GnssInsConfig {
        earth_curvature: true,
        ..config()
    };
    for place in [
        Vector3::new(4000.0, 0.0, 0.0),
        Vector3::new(0.0, -3000.0, 0.0),
        Vector3::new(0.0, 0.0, -2000.0),
        Vector3::new(-2000.0, 1500.0, 800.0),
    ] {
        let ins = under_way(round, place, Vector3::zeros());
        let to_centre = Vector3::z() * radius - place;
        let gravity = to_centre * (GRAVITY * radius.powi(2) / to_centre.norm().powi(3));
        let body_from_ned = ins.state().unwrap().ned_from_body.inverse();
        let (_, force) = ins.on_the_earth(&Vector3::zeros(), &(body_from_ned * -gravity));
        // In the filter's plane, where gravity points down everywhere, it must not accelerate.
        let acceleration = body_from_ned.inverse() * force + Vector3::z() * GRAVITY;
        assert!(
            acceleration.norm() < 0.01 * (gravity - Vector3::z() * GRAVITY).norm(),
            "at {place}: {acceleration}"
        );
    }
}

/// What no force acts on and does not turn moves straight in space; seen from the turning Earth it curves and turns.
#[test]
fn a_free_body_curves_and_turns_as_seen_from_the_turning_earth() {
    let earth = Vector3::new(4.5e-5, 1e-6, -5.7e-5);
    let (velocity, h) = (Vector3::new(60.0, -80.0, 30.0), 10.0);
    let turning = GnssInsConfig {
        gravity: 0.0,
        earth_curvature: false,
        earth_rate_rad_s: earth.into(),
        ..config()
    };
    let ins = under_way(turning, Vector3::zeros(), velocity);
    let seen_at = |t: f64| UnitQuaternion::from_scaled_axis(earth * -t) * (velocity * t);
    let expected = (seen_at(h) + seen_at(-h)) / (h * h);
    let attitude = ins.state().unwrap().ned_from_body;
    let (rate, force) = ins.on_the_earth(&Vector3::zeros(), &Vector3::zeros());
    assert!(expected.norm() > 5e-3);
    assert_relative_eq!(attitude * force, expected, epsilon = 1e-7);
    let turned = UnitQuaternion::from_scaled_axis(earth * -h) * attitude;
    let integrated = attitude * UnitQuaternion::from_scaled_axis(rate * h);
    assert!(rotation::angle_between(&turned, &integrated) < 1e-12);
}

#[test]
fn a_stamp_that_jitters_adds_the_way_made_meanwhile_to_the_noise_of_a_position() {
    let velocity = Vector3::new(12.0, -5.0, 2.0);
    let steady = GnssInsConfig {
        time_jitter_s: 0.0,
        ..config()
    };
    let mut ins = under_way(steady, Vector3::zeros(), velocity);
    let mut jittering = ins;
    jittering.config.time_jitter_s = 0.05;
    let fix = GnssPosition {
        ned: Vector3::zeros(),
        std: Vector3::repeat(0.5),
        has_height: true,
    };
    let next = ins.time_ns().unwrap() + 1;
    let [without, with] = [&mut ins, &mut jittering].map(|ins| ins.gnss_position(next, &fix));
    let added = (velocity * 0.05).map(|way| way * way);
    let horizontal = with.horizontal.covariance - without.horizontal.covariance;
    for i in 0..2 {
        assert_relative_eq!(horizontal[(i, i)], added[i], epsilon = 1e-12);
    }
    // The height is told after the horizontal position, which was worth more without jitter.
    let vertical = with.vertical.covariance - without.vertical.covariance;
    assert_relative_eq!(vertical[(0, 0)], added.z, epsilon = 1e-3);
}

/// A receiver that states ten times its standard deviation of before has ten times the slow error, from that fix on.
#[test]
fn the_slow_error_widens_as_soon_as_the_receiver_states_a_larger_one() {
    let plain = GnssInsConfig {
        time_offset_std_s: 0.0,
        lever_arm_std_m: Some(0.0),
        ..config()
    };
    let (mut ins, motion) = drive(plain, &Drive::default(), |_, _, _| ());
    ins.memory.noise_scale = [1.0; 3];
    let (white, slow) = (
        ins.config.position_uncorrelated_fraction,
        ins.config.position_correlated_fraction,
    );
    let (before, after) = (Vector3::new(0.05, 0.05, 0.1), Vector3::new(0.5, 0.5, 1.0));
    let time_ns = ins.time_ns().unwrap() + 1;
    ins.config.time_jitter_s = 0.0;
    ins.catch_up();
    // Dense: position and slow error of one axis after the other, which see nothing else.
    let (p, side) = (ins.state().unwrap().covariance, *ins.augmented_states());
    let fix = GnssPosition {
        // Not the very same digits as the last one: that would be a receiver that is frozen.
        ned: motion.position + Vector3::repeat(1e-9),
        std: after,
        has_height: true,
    };
    let update = ins.gnss_position(time_ns, &fix);
    assert!(update.horizontal.outcome.is_fused() && update.vertical.outcome.is_fused());
    let widened = |i: usize| (slow * after[i]).powi(2) - (slow * before[i]).powi(2);
    let mut joint = SMatrix::<f64, 25, 25>::zeros();
    joint.fixed_view_mut::<15, 15>(0, 0).copy_from(&p);
    joint
        .fixed_view_mut::<15, 10>(0, STATES)
        .copy_from(&side.cross);
    joint
        .fixed_view_mut::<10, 15>(STATES, 0)
        .copy_from(&side.cross.transpose());
    joint
        .fixed_view_mut::<10, 10>(STATES, STATES)
        .copy_from(&side.covariance);
    for i in 0..3 {
        let offset = STATES + GNSS_OFFSET + i;
        joint[(offset, offset)] += widened(i);
    }
    for i in 0..3 {
        let mut h = SMatrix::<f64, 1, 25>::zeros();
        h[POSITION + i] = 1.0;
        h[STATES + GNSS_OFFSET + i] = 1.0;
        let s = (h * joint * h.transpose())[0] + (white * after[i]).powi(2);
        let projected = joint * h.transpose();
        joint -= projected * projected.transpose() / s;
    }
    for i in 0..AUGMENTED_STATES {
        let dense = joint[(STATES + i, STATES + i)];
        assert_relative_eq!(
            ins.augmented_states().covariance[(i, i)],
            dense,
            max_relative = 1e-9
        );
    }
    let state = ins.state().unwrap();
    for i in [VELOCITY, POSITION, POSITION + 2] {
        assert_relative_eq!(state.covariance[(i, i)], joint[(i, i)], max_relative = 1e-9);
    }
}
