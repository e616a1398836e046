//! A magnetometer with iron around it: how it starts, and what it learns.

use super::*;
use crate::navigation::augmented_states::MAGNETIC_OFFSET;

#[test]
fn iron_around_the_magnetometer_is_learnt_and_does_not_turn_the_heading() {
    let iron = Vector3::new(18.0, -14.0, 10.0);
    let seen = Drive {
        seconds: 120,
        iron: Some(iron),
        ..Drive::default()
    };
    let heading_error = |config| {
        let (ins, motion) = drive(config, &seen, |_, _, _| ());
        let [yaw, _, _] = rotation::to_yaw_pitch_roll(&ins.state().unwrap().ned_from_body);
        (ins, (yaw - motion.heading).sin().abs())
    };
    let told = GnssInsConfig {
        declination: Some(DECLINATION),
        ..config()
    };
    let (ins, learnt) = heading_error(told);
    let found = ins
        .augmented_states()
        .values
        .fixed_rows::<3>(MAGNETIC_OFFSET);
    assert!(learnt < 0.03, "{learnt}");
    assert!((found.xy() - iron.xy()).norm() < 4.0, "{found}");
    assert!(ins.counts(Aid::Magnetometer).fused > 15);
    let skipped = ins.counts(Aid::Magnetometer).skipped;
    assert!(skipped > 1000, "one in five seconds counts: {skipped}");
    // Taken for the Earth's, ten times a second, it is found out: the fixes say otherwise.
    let accepted = GnssInsConfig {
        magnetic_offset_std_ut: 0.0,
        magnetic_interval_s: 0.0,
        ..told
    };
    let (_, turned) = heading_error(accepted);
    assert!(turned < 0.03, "{turned}");
}

#[test]
fn a_magnetic_start_knows_its_iron_and_the_declination_that_it_is_told() {
    let still = Drive {
        seconds: 4,
        iron: Some(Vector3::zeros()),
        ..Drive::default()
    };
    let calibrated = GnssInsConfig {
        magnetic_offset_std_ut: 1.0,
        ..config()
    };
    let yaw = |config, declination: f64| {
        let mut told = [0.0; 2];
        drive(config, &still, |_, ins, _| {
            ins.set_declination(declination);
            if let Some(state) = ins.state() {
                let [yaw, _, _] = rotation::to_yaw_pitch_roll(&state.ned_from_body);
                told = [yaw, state.covariance[(2, 2)].sqrt()];
            }
        });
        told
    };
    // The nearest of the alignment's headings pulls it by a twentieth of the way.
    let [right, std] = yaw(calibrated, DECLINATION);
    assert!((right - 1.0).abs() < 0.02 && std < 0.12, "{right} {std}");
    let [magnetic, _] = yaw(calibrated, f64::NAN);
    assert!((magnetic - (1.0 - DECLINATION)).abs() < 0.05, "{magnetic}");
    // What may carry iron tells little, and the same iron, however often it is seen, no more.
    let [yaw, std] = standing_start(config(), 20);
    assert!(
        (yaw + DECLINATION).abs() < std && (0.4..1.2).contains(&std),
        "{yaw} {std}"
    );
}

#[test]
fn a_heading_that_looks_backwards_is_found_out() {
    let backwards = GnssInsConfig {
        initial_heading: Some([core::f64::consts::PI - 0.1, 0.1]),
        magnetic_offset_std_ut: 1.0,
        magnetic_interval_s: 0.5,
        declination: Some(DECLINATION),
        ..config()
    };
    let [yaw, _] = standing_start(backwards, 20);
    assert!(yaw.abs() < 0.1, "{yaw}");
}

/// Stands for some seconds, looking north, with a magnetometer and a receiver: heading and its standard deviation then.
fn standing_start(config: GnssInsConfig<f64>, seconds: i64) -> [f64; 2] {
    let mut ins = GnssIns::<f64, 64>::new(config).unwrap();
    let standing = GnssPosition {
        ned: Vector3::zeros(),
        std: Vector3::repeat(1.0),
        has_height: true,
    };
    for k in 1..=seconds * 100 {
        let time_ns = k * 10_000_000;
        let force = Vector3::new(0.0, 0.0, -GRAVITY);
        ins.imu(time_ns, &Vector3::zeros(), &force).unwrap();
        ins.magnetometer(time_ns, &magnetic_field());
        if k % 100 == 0 {
            ins.gnss_position(time_ns, &standing);
        }
    }
    let state = ins.state().expect("it does not wait for ever");
    let [yaw, _, _] = rotation::to_yaw_pitch_roll(&state.ned_from_body);
    [yaw, state.covariance[(2, 2)].sqrt()]
}
