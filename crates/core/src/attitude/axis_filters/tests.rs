use core::f64::consts::PI;

use super::*;
use approx::assert_relative_eq;
use proptest::prelude::*;

const DT: f64 = 0.02;

fn filters(config: AxisFiltersConfig<f64>, start_deg: [f64; 3]) -> AxisFilters<f64> {
    AxisFilters::new(config, start_deg.map(f64::to_radians)).unwrap()
}

/// Specific force at rest at an attitude.
fn at_rest(roll_deg: f64, pitch_deg: f64) -> Vector3<f64> {
    let q = UnitQuaternion::from_euler_angles(roll_deg.to_radians(), pitch_deg.to_radians(), 0.0);
    q.inverse() * Vector3::new(0.0, 0.0, -GRAVITY)
}

/// Gain of the pitch in the steady state: into the angle, into the bias.
fn steady_gain(config: AxisFiltersConfig<f64>) -> [f64; 2] {
    let config = AxisFiltersConfig {
        euler_rates: false,
        norm_gain: 0.0,
        ..config
    };
    let mut f = filters(config, [0.0; 3]);
    for _ in 0..200_000 {
        f.propagate(&Vector3::zeros(), DT).unwrap();
        f.update_accelerometer(&at_rest(0.0, 0.0));
    }
    f.propagate(&Vector3::zeros(), DT).unwrap();
    let [a, b, _] = f.axes()[1].covariance;
    let r = f.config.noise(DT)[2];
    [a / (a + r), b / (a + r)]
}

#[test]
fn steady_gains_are_those_of_the_riccati_equation() {
    let (rate, angle) = (0.2_f64.to_radians(), 2.0_f64.to_radians());
    let of = |noise, angle_std| {
        steady_gain(AxisFiltersConfig {
            gyroscope_std: rate,
            angle_std,
            noise,
            ..AxisFiltersConfig::default()
        })
    };
    for (gain, expected) in [
        (of(AxisNoise::Printed, angle), [0.487, -7.16]),
        (of(AxisNoise::PrintedNamesSwapped, angle), [0.0613, -0.0969]),
        (
            of(AxisNoise::Physical, 10.0_f64.to_radians()),
            [1.06e-3, -2.4e-5],
        ),
    ] {
        assert_relative_eq!(gain[0], expected[0], max_relative = 0.01);
        // The last one is given to two digits.
        assert_relative_eq!(gain[1], expected[1], max_relative = 0.02);
    }
}

#[test]
fn tilt_is_read_off_gravity_in_all_quadrants() {
    for roll in [-170.0, -80.0, -20.0, 0.0, 28.65, 45.0, 120.0] {
        for pitch in [-70.0, -17.19, 0.0, 20.0, 80.0] {
            let (r, p) = tilt_of(&at_rest(roll, pitch), AxisAngles::Exact);
            assert_relative_eq!(r.unwrap().to_degrees(), roll, epsilon = 1e-9);
            assert_relative_eq!(p.to_degrees(), pitch, epsilon = 1e-9);
        }
    }
    // On its nose there is no roll.
    assert_eq!(tilt_of(&at_rest(0.0, -90.0), AxisAngles::Exact).0, None);
}

/// The signs of the paper's eqs 36 and 37 contradict its own rotation matrix, and the pitch lacks a
/// cosine: 20 degrees read 21.2, 27.2 and 36.1 at a roll of 20, 45 and 60.
#[test]
fn the_printed_angles_have_the_wrong_sign_and_a_pitch_that_depends_on_the_roll() {
    let printed = |roll, pitch| {
        let (r, p) = tilt_of(&at_rest(roll, pitch), AxisAngles::Printed);
        [r.unwrap().to_degrees(), p.to_degrees()]
    };
    let [roll, pitch] = printed(28.65, 17.19);
    assert!(
        (roll + 28.65).abs() < 0.01 && (pitch + 19.42).abs() < 0.01,
        "{roll} {pitch}"
    );
    for (roll, expected) in [(20.0, 21.2), (45.0, 27.2), (60.0, 36.1)] {
        assert!((printed(roll, 20.0)[1] + expected).abs() < 0.05);
    }
}

#[test]
fn the_heading_is_levelled_before_it_is_read() {
    let field = Vector3::new(20.0, 0.0, 40.0);
    for (roll, pitch, yaw) in [(0.3, -0.4, 1.0), (-1.2, 0.9, -2.5), (2.8, 0.1, 3.0)] {
        let q = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
        let heading = tilt_compensated_heading(&(q.inverse() * field), roll, pitch);
        assert_relative_eq!(heading.unwrap(), yaw, epsilon = 1e-12);
    }
    let straight_down = Vector3::new(0.0, 0.0, 40.0);
    assert_eq!(tilt_compensated_heading(&straight_down, 0.0, 0.0), None);
}

/// A tilt error leaks into the heading as the tangent of the dip: 1.9 times at 62 degrees.
#[test]
fn a_tilt_error_leaks_into_the_heading_with_the_tangent_of_the_dip() {
    let dip = 62.0_f64.to_radians();
    let field = Vector3::new(dip.cos(), 0.0, dip.sin());
    let off = 1e-4;
    let heading = tilt_compensated_heading(&field, off, 0.0).unwrap();
    assert_relative_eq!(heading.abs() / off, dip.tan(), max_relative = 1e-3);
}

#[test]
fn yaw_crosses_half_a_turn_without_a_jump() {
    let mut f = filters(AxisFiltersConfig::default(), [0.0, 0.0, 170.0]);
    let field = Vector3::new(20.0, 0.0, 40.0);
    let rate = 10.0_f64.to_radians();
    let mut truth = 170.0_f64.to_radians();
    for _ in 0..500 {
        truth += rate * DT;
        f.propagate(&Vector3::new(0.0, 0.0, rate), DT).unwrap();
        f.update_accelerometer(&at_rest(0.0, 0.0));
        let body = UnitQuaternion::from_euler_angles(0.0, 0.0, truth).inverse() * field;
        let innovation = f.update_magnetometer(&body);
        assert_eq!(innovation.degrees_of_freedom, 1);
        let error = wrap(f.axes()[2].angle - truth);
        assert!(error.abs() < 1e-6, "{error} rad at {truth}");
    }
    assert!(f.axes()[2].angle < 0.0);
}

/// Body rates are no rates of the angles: a roll of 60 degrees turns half of them round.
#[test]
fn coordinated_rates_keep_the_angles_and_raw_ones_do_not() {
    let error_after_a_turn = |euler_rates| {
        let config = AxisFiltersConfig {
            euler_rates,
            ..AxisFiltersConfig::default()
        };
        let mut f = filters(config, [60.0, 0.0, 0.0]);
        let roll = 60.0_f64.to_radians();
        let turn = 0.2;
        let rate = Vector3::new(0.0, turn * roll.sin(), turn * roll.cos());
        for _ in 0..500 {
            f.propagate(&rate, DT).unwrap();
        }
        let truth = UnitQuaternion::from_euler_angles(roll, 0.0, turn * 10.0);
        f.attitude().angle_to(&truth)
    };
    assert!(error_after_a_turn(true) < 1e-9);
    assert!(error_after_a_turn(false) > 1.0);
}

#[test]
fn biases_are_found_and_the_pole_is_survived() {
    let mut f = filters(AxisFiltersConfig::default(), [5.0, -5.0, 20.0]);
    let field = Vector3::new(20.0, 0.0, 40.0);
    let bias = Vector3::new(0.01, -0.008, 0.005);
    for _ in 0..60_000 {
        f.propagate(&bias, DT).unwrap();
        f.update_accelerometer(&at_rest(0.0, 0.0));
        f.update_magnetometer(&field);
    }
    for (axis, expected) in f.axes().iter().zip(bias.iter()) {
        assert!((axis.bias - expected).abs() < 1e-4, "{axis:?}");
        assert!(axis.angle.abs() < 1e-2);
    }
    let mut f = filters(AxisFiltersConfig::default(), [0.0, 85.0, 30.0]);
    for _ in 0..100 {
        f.propagate(&Vector3::new(0.3, 0.1, 0.5), DT).unwrap();
        let force = at_rest(0.0, f.axes()[1].angle.to_degrees());
        let innovation = f.update_accelerometer(&force);
        assert!(innovation.nis.is_finite());
        f.update_magnetometer(&field);
    }
    assert!(f.attitude().angle().is_finite());
}

#[test]
fn bad_samples_leave_the_state_untouched_and_bad_settings_are_named() {
    let mut f = filters(AxisFiltersConfig::default(), [1.0, 2.0, 3.0]);
    let before = f;
    let nan = Vector3::new(f64::NAN, 0.0, 0.0);
    assert_eq!(f.propagate(&nan, DT), Err(SkipReason::NotFinite));
    assert_eq!(
        f.propagate(&Vector3::x(), f64::NAN),
        Err(SkipReason::NotFinite)
    );
    assert_eq!(f.propagate(&Vector3::x(), 1e3), Err(SkipReason::OutOfRange));
    assert_eq!(f.propagate(&Vector3::x(), 0.0), Ok(()));
    for bad in [nan, Vector3::zeros(), Vector3::repeat(f64::MAX)] {
        assert!(matches!(
            f.update_accelerometer(&bad).outcome,
            Outcome::Skipped(_)
        ));
        assert!(matches!(
            f.update_magnetometer(&bad).outcome,
            Outcome::Skipped(_)
        ));
    }
    assert_eq!(f, before);
    let config = AxisFiltersConfig {
        angle_std: 0.0,
        ..AxisFiltersConfig::<f64>::default()
    };
    let refused = AxisFilters::new(config, [0.0; 3]).unwrap_err();
    assert_eq!(refused.field, "angle_std");
    let start = [f64::NAN, 0.0, 0.0];
    let refused = AxisFilters::new(AxisFiltersConfig::default(), start).unwrap_err();
    assert_eq!(refused.field, "start");
}

/// A day of samples in single precision: variances stay above zero, angles within a turn.
#[test]
fn a_day_in_single_precision_stays_positive() {
    let mut f = AxisFilters::<f32>::new(AxisFiltersConfig::default(), [0.0; 3]).unwrap();
    let force = Vector3::new(0.0, 0.0, -9.8_f32);
    for k in 0..4_320_000_u32 {
        let rate = if k % 100 < 50 { 0.3 } else { -0.3 };
        f.propagate(&Vector3::new(0.0, 0.0, rate), 0.02).unwrap();
        f.update_accelerometer(&force);
    }
    for axis in f.axes() {
        let [a, b, c] = axis.covariance;
        assert!(a > 0.0 && c > 0.0 && a * c >= b * b * 0.999, "{axis:?}");
        assert!(axis.angle.abs() <= core::f32::consts::PI);
    }
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(5), ..ProptestConfig::default() })]
    #[test]
    fn any_samples_leave_finite_angles(
        samples in prop::collection::vec((any::<u8>(), prop::array::uniform3(prop_oneof![-60.0..60.0, any::<f64>()]), prop_oneof![0.0..1.0, any::<f64>()]), 0..80)
    ) {
        let mut f = filters(AxisFiltersConfig::default(), [0.0; 3]);
        for (sensor, v, dt) in samples {
            let v = Vector3::from(v);
            match sensor % 3 {
                0 => { let _ = f.propagate(&v, dt); }
                1 => { f.update_accelerometer(&v); }
                _ => { f.update_magnetometer(&v); }
            }
            for axis in f.axes() {
                prop_assert!((-PI..=PI).contains(&axis.angle) && axis.bias.is_finite());
                prop_assert!(axis.covariance.iter().all(|p| p.is_finite()));
            }
        }
    }
}
