//! The test on rests and motions made by hand.

use super::*;

fn instant(k: i64, rate: f64, attitude: &UnitQuaternion<f64>) -> Instant {
    Instant {
        time_ns: k * 10_000_000,
        angular_rate: Some(Vector3::new(rate, 0.02, 0.0)),
        specific_force: Some(attitude.inverse() * Vector3::new(0.0, 0.0, 9.81)),
        magnetic_field: Some(attitude.inverse() * Vector3::new(0.0, 22.0, -42.0)),
        ..Instant::default()
    }
}

/// Rest, motion, rest; the sensors see `end` in the last rest, where the rate is `end_rate`.
fn test_after(end: &UnitQuaternion<f64>, end_rate: impl Fn(i64) -> f64) -> FinalTest {
    let mut test = FinalTest::default();
    let start = UnitQuaternion::identity();
    for k in 0..1000 {
        let rested = instant(k, 0.01, &start);
        let now = match k {
            0..200 => rested,
            200..800 => instant(k, (k as f64 * 0.1).sin(), &so3::exp(&Vector3::x())),
            _ => instant(k, end_rate(k), end),
        };
        test.measured(&now, now.magnetic_field);
    }
    test.estimated(&start, None);
    test
}

fn verdict(error_rad: f64, std_rad: f64) -> FinalSummary {
    let mut test = test_after(&UnitQuaternion::identity(), |_| 0.01);
    let last = so3::exp(&Vector3::new(0.0, error_rad, 0.0));
    test.estimated(&last, Some(Matrix3::identity() * std_rad * std_rad));
    test.summary(true).unwrap()
}

#[test]
fn the_verdict_follows_the_bounds_of_chi_square() {
    let consistent = verdict(0.01, 0.01);
    assert_eq!(consistent.verdict, Some(FinalVerdict::Consistent));
    approx::assert_relative_eq!(
        consistent.calculated_error_deg,
        0.01_f64.to_degrees(),
        epsilon = 1e-9
    );
    let expected = (3.0_f64.sqrt() * 0.01).to_degrees();
    approx::assert_relative_eq!(
        consistent.estimated_error_deg.unwrap(),
        expected,
        epsilon = 1e-9
    );
    approx::assert_relative_eq!(consistent.normalised_square.unwrap(), 1.0, epsilon = 1e-9);
    assert!(
        consistent
            .sentence
            .contains("Repositioning by hand is repeatable to about 0.5 to 1 deg")
    );
    assert_eq!(
        verdict(0.04, 0.01).verdict,
        Some(FinalVerdict::Overconfident)
    );
    assert_eq!(
        verdict(0.004, 0.01).verdict,
        Some(FinalVerdict::Conservative)
    );
}

/// Both quaternions turn by the angles beside them, the calculated one about the axis of the error.
#[test]
fn the_error_quaternions_turn_by_the_errors() {
    let summary = verdict(0.02, 0.01);
    let angle = |q: [f64; 4]| rotation::from_wxyz(q).unwrap().angle().to_degrees();
    let calculated = summary.calculated_error_wxyz;
    approx::assert_relative_eq!(
        angle(calculated),
        summary.calculated_error_deg,
        epsilon = 1e-9
    );
    approx::assert_relative_eq!(calculated[2], 0.01_f64.sin(), epsilon = 1e-12);
    let estimated = summary.estimated_error_wxyz.unwrap();
    approx::assert_relative_eq!(
        angle(estimated),
        summary.estimated_error_deg.unwrap(),
        epsilon = 1e-9
    );
    approx::assert_relative_eq!(estimated[1], estimated[3], epsilon = 1e-12);
}

#[test]
fn without_covariance_there_is_an_error_and_no_verdict() {
    let mut test = test_after(&UnitQuaternion::identity(), |_| 0.01);
    test.estimated(&so3::exp(&Vector3::new(0.1, 0.0, 0.0)), None);
    let summary = test.summary(true).unwrap();
    assert_eq!((summary.verdict, summary.estimated_error_deg), (None, None));
    assert!(
        summary
            .sentence
            .contains("this estimator has no covariance")
    );
}

#[test]
fn it_applies_only_to_a_device_that_rests_where_it_rested() {
    let here = UnitQuaternion::identity();
    assert!(test_after(&here, |_| 0.01).summary(true).is_some());
    let tilted = so3::exp(&Vector3::new(0.1, 0.0, 0.0));
    assert_eq!(
        test_after(&tilted, |_| 0.01).summary(true),
        None,
        "tilted by 6 deg"
    );
    let turned = so3::exp(&Vector3::new(0.0, 0.0, 0.5));
    assert_eq!(
        test_after(&turned, |_| 0.01).summary(true),
        None,
        "turned by 29 deg"
    );
    let shaking = |k: i64| if k % 2 == 0 { 0.3 } else { -0.3 };
    assert_eq!(test_after(&here, shaking).summary(true), None, "shaken");
    assert_eq!(
        test_after(&here, |_| 0.5).summary(true),
        None,
        "turning steadily"
    );
}

/// GIVEN a device that a receiver saw travelling WHEN it rests at the end as it did at the start THEN only a field says that it points
/// where it did; and while the receiver says that it moves it does not rest.
#[test]
fn what_has_travelled_is_back_where_a_field_says_so() {
    let here = UnitQuaternion::identity();
    for (moves_until, has_field, applies) in
        [(800, true, true), (800, false, false), (1200, true, false)]
    {
        let mut test = FinalTest::default();
        for k in 0..1200 {
            let mut now = instant(k, 0.01, &here);
            if k > 300 && k < moves_until && k % 100 == 0 {
                let velocity = northing_recording::GnssVelocity::from_course(13.0, 0.5);
                now.ground_velocity = Some(velocity);
            }
            test.measured(&now, now.magnetic_field.filter(|_| has_field));
        }
        test.estimated(&here, None);
        assert_eq!(
            test.summary(has_field).is_some(),
            applies,
            "{moves_until} {has_field}"
        );
    }
}

#[test]
fn a_reference_that_ends_elsewhere_overrules_the_sensors() {
    let mut test = FinalTest::default();
    for k in 0..400_i64 {
        let mut now = instant(k, 0.0, &UnitQuaternion::identity());
        let attitude = so3::exp(&Vector3::new(0.0, 0.0, if k < 200 { 0.0 } else { 0.1 }));
        now.reference = Some(northing_recording::Reference {
            attitude,
            scored: true,
        });
        test.measured(&now, None);
    }
    test.estimated(&UnitQuaternion::identity(), None);
    assert_eq!(test.summary(true), None);
}

/// Rest, motion, rest: estimates with these covariances at the start and at the end, off by `error`.
fn after_rests(error: Vector3<f64>, start: Matrix3<f64>, end: Matrix3<f64>) -> FinalTest {
    let here = UnitQuaternion::identity();
    let mut test = FinalTest::default();
    for k in 0..1000 {
        let moving = instant(k, (k as f64 * 0.1).sin(), &so3::exp(&Vector3::x()));
        let now = match k {
            200..800 => moving,
            _ => instant(k, 0.01, &here),
        };
        test.measured(&now, now.magnetic_field);
        match k {
            0..800 => test.estimated(&here, Some(start)),
            _ => test.estimated(&so3::exp(&error), Some(end)),
        }
    }
    test
}

/// 1.66 deg is more than the 1.10 deg of the end alone, and less than the 30 deg of both ends: the prediction that is
/// stated, in words and in numbers, is the one that judges.
#[test]
fn the_prediction_that_judges_is_the_one_that_is_stated() {
    let isotropic = |total_deg: f64| {
        let std = total_deg.to_radians() / 3.0_f64.sqrt();
        Matrix3::identity() * std * std
    };
    let error = Vector3::new(0.0, 1.66_f64.to_radians(), 0.0);
    let test = after_rests(error, isotropic(30.0), isotropic(1.10));
    let summary = test.summary(true).unwrap();
    assert_eq!(summary.verdict, Some(FinalVerdict::Conservative));
    let both = 30.0_f64.hypot(1.10);
    approx::assert_relative_eq!(summary.estimated_error_deg.unwrap(), both, epsilon = 1e-9);
    let stated = format!("error 1.66 deg, predicted {both:.2} deg: conservative.");
    assert!(summary.sentence.contains(&stated), "{}", summary.sentence);
    let axes = Vector3::from(summary.estimated_std_deg.unwrap());
    approx::assert_relative_eq!(axes.norm(), both, epsilon = 1e-9);
    assert_eq!(
        summary.judged_deg(),
        (summary.calculated_error_deg, summary.estimated_error_deg)
    );
}

/// Where nothing says where north is, the heading has drifted by 40 deg and its covariance is that of an arbitrary start:
/// neither counts.
#[test]
fn an_arbitrary_heading_is_left_out_of_the_verdict() {
    let std = 0.01_f64;
    let tilt_known = Matrix3::from_diagonal(&Vector3::new(std * std, std * std, 3.0));
    let turned = so3::exp(&Vector3::new(0.0, 0.0, 40_f64.to_radians()));
    let error = |tilt: f64| so3::log(&(turned * so3::exp(&Vector3::new(tilt, 0.0, 0.0))));
    let judge = |tilt: f64| {
        let axes = so3::exp(&error(tilt)).to_rotation_matrix().into_inner();
        let at_the_end = axes.transpose() * tilt_known * axes;
        after_rests(error(tilt), tilt_known, at_the_end)
            .summary(false)
            .unwrap()
    };
    let summary = judge(0.014);
    assert_eq!(summary.verdict, Some(FinalVerdict::Consistent));
    approx::assert_relative_eq!(summary.calculated_heading_deg, 40.0, epsilon = 1e-6);
    approx::assert_relative_eq!(
        summary.calculated_tilt_deg,
        0.014_f64.to_degrees(),
        epsilon = 1e-6
    );
    // Two axes, two rests.
    approx::assert_relative_eq!(
        summary.estimated_tilt_deg.unwrap(),
        (2.0 * std).to_degrees(),
        epsilon = 1e-9
    );
    approx::assert_relative_eq!(summary.normalised_square.unwrap(), 0.98, epsilon = 1e-9);
    assert!(
        summary
            .sentence
            .contains("tilt error 0.80 deg, predicted 1.15 deg: consistent."),
        "{}",
        summary.sentence
    );
    assert!(
        summary.sentence.contains("drifted by 40.00 deg"),
        "{}",
        summary.sentence
    );
    assert_eq!(judge(0.05).verdict, Some(FinalVerdict::Overconfident));
    assert_eq!(judge(0.002).verdict, Some(FinalVerdict::Conservative));
}
