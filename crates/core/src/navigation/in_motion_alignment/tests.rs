mod bias_step;
mod kernels;
mod outlier;

use super::estimate::Estimate;
use super::*;
use crate::geometry::rotation;
use crate::navigation::{GnssPosition, GnssVelocity};
use crate::restorable::Restorable as _;

fn started() -> InMotionAlignment<f64, 4, 8> {
    let config = InMotionAlignmentConfig::default();
    let mut made = InMotionAlignment::new(config).unwrap();
    drive(&mut made, 0, 450);
    made
}

/// Circles without turning, the forward axis to the north.
fn drive<T: Scalar, const K: usize, const W: usize>(
    made: &mut InMotionAlignment<T, K, W>,
    from: usize,
    to: usize,
) {
    let convert = |v: Vector3<f64>| v.map(lit::<T>);
    for k in from..to {
        let t = k as f64 * 0.01;
        if k % 100 == 0 {
            let ned = Vector3::new(-t.cos(), -t.sin(), 0.0) * 4.0;
            let fix = GnssPosition {
                ned: convert(ned),
                std: Vector3::repeat(lit(0.02)),
                has_height: true,
            };
            made.gnss_position(&fix);
        }
        let t = t + 0.005;
        let force = Vector3::new(4.0 * t.cos(), 4.0 * t.sin(), -9.806_65);
        made.propagate(&Vector3::zeros(), &convert(force), lit(0.01))
            .unwrap();
    }
}

#[test]
fn a_heading_chooses_among_the_hypotheses_of_a_body_at_rest() {
    let mut made = InMotionAlignment::<f64>::new(InMotionAlignmentConfig::default()).unwrap();
    let force = Vector3::new(0.0, 0.0, -9.806_65);
    let fix = GnssPosition {
        ned: Vector3::zeros(),
        std: Vector3::repeat(0.02),
        has_height: true,
    };
    assert_eq!(
        made.heading(2.0, 0.05).outcome,
        crate::kalman::Outcome::Skipped(SkipReason::NotInitialized)
    );
    for k in 0..1200 {
        if k % 100 == 0 {
            made.gnss_position(&fix);
        }
        if k % 100 == 50 && k > 200 {
            made.heading(2.0, 0.05);
        }
        made.propagate(&Vector3::zeros(), &force, 0.01).unwrap();
    }
    let solution = made.solution().unwrap();
    let [yaw, ..] = rotation::to_yaw_pitch_roll(&solution.ned_from_body);
    assert!((yaw - 2.0).abs() < 0.03, "{yaw}");
    assert!(solution.heading_std < 0.05);
    assert_eq!(made.status(), AlignmentStatus::Aligned);
}

#[test]
fn a_velocity_of_the_first_instant_is_the_first_velocity() {
    let mut made = InMotionAlignment::<f64>::new(InMotionAlignmentConfig::default()).unwrap();
    drive(&mut made, 0, 200);
    let before = made.save();
    // Not at the instant of a position.
    let velocity = GnssVelocity {
        ned: Vector3::new(0.0, 4.0, 0.0),
        std: Vector3::repeat(0.05),
        has_vertical: true,
    };
    made.gnss_velocity(&velocity);
    assert_eq!(made.save(), before);

    let mut made = InMotionAlignment::<f64>::new(InMotionAlignmentConfig::default()).unwrap();
    drive(&mut made, 1, 200);
    let fix = GnssPosition {
        ned: Vector3::zeros(),
        std: Vector3::repeat(0.02),
        has_height: true,
    };
    made.gnss_position(&fix);
    made.gnss_velocity(&velocity);
    let solution = made.solution().unwrap();
    assert_eq!(solution.velocity, velocity.ned);
    // Not below the floor.
    assert!((solution.velocity_covariance[(1, 1)] - 0.01).abs() < 1e-12);
}

#[test]
fn what_cannot_be_measured_changes_nothing() {
    let mut made = started();
    let before = made.save();
    let good = GnssPosition {
        ned: Vector3::zeros(),
        std: Vector3::repeat(1.0),
        has_height: true,
    };
    let nan = Vector3::repeat(f64::NAN);
    for fix in [
        GnssPosition { ned: nan, ..good },
        GnssPosition { std: nan, ..good },
        GnssPosition {
            std: -good.std,
            ..good
        },
        GnssPosition {
            std: good.std * 1e6,
            ..good
        },
        GnssPosition {
            ned: good.std * 1e9,
            ..good
        },
    ] {
        let update = made.gnss_position(&fix);
        assert!(!update.position.outcome.is_fused());
        assert_eq!(made.save(), before, "{fix:?}");
    }
    for (heading, std) in [
        (f64::NAN, 0.1),
        (1.0, f64::NAN),
        (1.0, 0.0),
        (1.0, -1.0),
        (100.0, 0.1),
    ] {
        made.heading(heading, std);
        assert_eq!(made.save(), before);
    }
    let zero = Vector3::zeros();
    for (rate, force, dt) in [
        (nan, zero, 0.01),
        (zero, nan, 0.01),
        (zero, zero, 0.0),
        (zero, zero, f64::NAN),
    ] {
        assert!(made.propagate(&rate, &force, dt).is_err());
        assert_eq!(made.save(), before);
    }
}

#[test]
fn a_state_goes_on_exactly_and_a_broken_one_is_refused() {
    for at in [0, 50, 150, 450, 950, 1550] {
        let mut whole =
            InMotionAlignment::<f64, 4, 8>::new(InMotionAlignmentConfig::default()).unwrap();
        drive(&mut whole, 0, at);
        let mut again =
            InMotionAlignment::<f64, 4, 8>::new(InMotionAlignmentConfig::default()).unwrap();
        again.restore(whole.save()).unwrap();
        drive(&mut whole, at, at + 500);
        drive(&mut again, at, at + 500);
        assert_eq!(whole, again, "{at}");
    }
}

#[test]
fn the_hand_over_is_the_mixture() {
    let mut made = InMotionAlignment::<f64>::new(InMotionAlignmentConfig::default()).unwrap();
    assert!(made.hand_over().is_none());
    drive(&mut made, 0, 150);
    let (early, _) = made.hand_over().unwrap();
    let heading_std = early.covariance[(2, 2)].sqrt();
    assert!(heading_std > 1.5, "anywhere: {heading_std}");
    drive(&mut made, 150, 1550);
    let (solution, (state, side)) = (made.solution().unwrap(), made.hand_over().unwrap());
    assert!(state.is_usable() && side.is_used(TIME_OFFSET) && side.is_used(GNSS_OFFSET));
    let turn = rotation::angle_between(&state.ned_from_body, &solution.ned_from_body);
    assert!(turn < 1e-9);
    assert!((state.position - solution.position).norm() < 0.05);
    assert!(state.covariance[(2, 2)].sqrt() > 0.999 * solution.heading_std);
    let [_, _, yaw] = state.roll_pitch_yaw_deg();
    assert!(yaw.abs() < 2.0, "{yaw}");
}

#[test]
fn a_gap_makes_uncertain_and_a_long_one_is_the_end() {
    let mut made = started();
    let mut whole = made;
    drive(&mut whole, 450, 480);
    let force = Vector3::new(0.0, 0.0, -9.806_65);
    made.propagate(&Vector3::zeros(), &force, 0.3).unwrap();
    let [gap, whole] = [made, whole].map(|m| m.solution().unwrap().velocity_covariance.trace());
    assert!(gap > whole + 0.95 * 3.0 * 0.3 * 4.0, "{gap} {whole}");
    assert!(made.propagate(&Vector3::zeros(), &force, 11.0).is_err());
    assert_eq!(
        (made.status(), made.restarts()),
        (AlignmentStatus::Aligning, 1)
    );
}

#[test]
fn a_tilt_that_is_lost_is_found_anew_from_the_force() {
    let mut made = started();
    let c = InMotionAlignmentConfig::<f64>::default();
    made.set_noise_densities([5.0, 20.0]);
    drive(&mut made, 450, 500);
    made.set_noise_densities([c.gyroscope_noise_density, c.accelerometer_noise_density]);
    drive(&mut made, 500, 2500);
    assert_eq!(
        (made.restarts(), made.status()),
        (1, AlignmentStatus::Aligned)
    );
    let [yaw, pitch, roll] = rotation::to_yaw_pitch_roll(&made.solution().unwrap().ned_from_body);
    assert!(
        yaw.abs().max(pitch.abs()).max(roll.abs()) < 0.05,
        "{yaw} {pitch} {roll}"
    );
}

/// Bytes in single precision: what a microcontroller pays.
#[test]
fn memory_is_bounded_and_stated() {
    let size = size_of::<InMotionAlignment<f32, 4, 8>>();
    assert!(size < 11_900, "{size}");
    assert!(size_of::<hypothesis::Hypothesis<f32>>() < 1_800);
    assert!(size_of::<window::Interval<f32>>() < 490);
    assert!(size_of::<Estimate<f32>>() < 860);
}
