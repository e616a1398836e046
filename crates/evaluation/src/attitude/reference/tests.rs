//! Clocks and mountings of simulated references, found and refused.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use northing_core::geometry::frames::enu_from_ned_rotation;

use super::simulated::Turned;
use super::{Order, Reading, ReferenceAlignment, ReferenceProblem, ReferenceUse, fit};
use crate::attitude::runner::run;
use crate::attitude::{EstimatorKind, Profile, RunOptions, RunSummary};
use crate::error::EvaluationError;

fn mounted() -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(Vector3::new(0.05, -0.1, 0.02))
}

fn found(turned: &Turned) -> ReferenceAlignment {
    fit(turned.events()).unwrap()
}

fn problem(turned: &Turned) -> ReferenceProblem {
    match fit(turned.events()) {
        Err(EvaluationError::Reference(problem)) => *problem.downcast().unwrap(),
        other => panic!("{other:?}"),
    }
}

fn scored(turned: &Turned, reference: ReferenceUse) -> Result<RunSummary, EvaluationError> {
    let options = RunOptions {
        reference,
        ..RunOptions::new(EstimatorKind::Mekf, Profile::HandHeld)
    };
    run(turned.events(), &options, &mut ())
}

/// Offset and misalignment of many references lie within what is stated of them, as often as they should.
#[test]
fn offset_and_misalignment_are_found_with_their_uncertainty() {
    type Stamp = fn(f64) -> f64;
    let stamps: [(f64, Stamp); 3] = [(0.217, |t| t - 0.217), (-1.7, |t| t + 1.7), (0.0, |t| t)];
    let (mut squares, mut count) = ([0.0; 2], 0.0);
    for seed in 1..=6 {
        for (offset, stamp) in stamps {
            let turned = Turned {
                seed,
                reference_seed: seed,
                stamp,
                mounting: mounted(),
                ..Turned::default()
            };
            let got = found(&turned);
            let error = got.clock_offset_s - offset;
            assert!(error.abs() < 0.002, "{got:?}");
            let left = got.misalignment() * mounted().inverse();
            // The reference's attitude is sensor * mounting: its body turned into the sensor's.
            assert!(
                left.angle().to_degrees() < 0.3,
                "{got:?}, {:?}",
                mounted().scaled_axis()
            );
            assert!(got.correlation > 0.98, "{got:?}");
            squares[0] += (error / got.clock_offset_std_s).powi(2);
            let std = Vector3::from(got.misalignment_std_deg);
            let left = left.scaled_axis().map(f64::to_degrees).component_div(&std);
            squares[1] += left.norm_squared() / 3.0;
            count += 1.0;
        }
    }
    println!("mean squares {:?}", squares.map(|s| s / count));
    for square in squares {
        assert!((0.3..3.0).contains(&(square / count)), "{}", square / count);
    }
}

/// Whatever the rates of the samples, aligned with cells and windows or not: no offset is made up.
#[test]
fn no_offset_is_made_up_at_any_rates() {
    for (imu_hz, reference_hz) in [(285.7, 285.7), (40.0, 30.0), (104.0, 12.0), (200.0, 119.88)] {
        let turned = Turned {
            imu_hz,
            reference_hz,
            ..Turned::default()
        };
        let got = found(&turned);
        let expected = 5.0 * got.clock_offset_std_s;
        assert!(
            got.clock_offset_s.abs() < expected.min(0.001),
            "{imu_hz}, {reference_hz}: {got:?}"
        );
    }
}

/// On a turntable the rates say nothing of the rotation about its axis: none is made up, and that it is unknown is stated.
#[test]
fn a_turn_about_one_axis_shows_the_clock_and_leaves_the_rest_unknown() {
    let turned = Turned {
        stamp: |t| t - 0.3,
        axes: 1,
        ..Turned::default()
    };
    let got = found(&turned);
    assert!((got.clock_offset_s - 0.3).abs() < 0.003, "{got:?}");
    assert!(got.misalignment_angle_deg() < 2.0, "{got:?}");
    let [x, y, z] = got.misalignment_std_deg;
    assert!(z > 20.0 && x < 2.0 && y < 2.0, "{got:?}");
}

#[test]
fn an_offset_is_taken_out_when_asked_and_said_otherwise() {
    let turned = Turned {
        stamp: |t| t - 0.12,
        mounting: mounted(),
        ..Turned::default()
    };
    let good = scored(&Turned::default(), ReferenceUse::AsIs).unwrap();
    assert!(good.issues.is_empty(), "{:?}", good.issues);
    let plain = scored(&turned, ReferenceUse::AsIs).unwrap();
    let remark = plain
        .issues
        .iter()
        .find(|issue| issue.contains("--align-reference"));
    let remark = remark.unwrap();
    assert!(
        remark.contains("0.1200 s behind") && remark.contains("turned by 6.5 deg"),
        "{remark}"
    );
    let fitted = found(&turned);
    let aligned = scored(&turned, ReferenceUse::Aligned(fitted)).unwrap();
    assert_eq!(aligned.reference.as_ref().unwrap().alignment, Some(fitted));
    assert!(
        aligned.issues.iter().any(|issue| issue.contains("+0.120")),
        "{:?}",
        aligned.issues
    );
    let total = |summary: &RunSummary| summary.error_deg.unwrap().total_rmse;
    assert!(total(&plain) > 6.0, "{}", total(&plain));
    assert!(
        (total(&aligned) - total(&good)).abs() < 0.1,
        "{} {}",
        total(&aligned),
        total(&good)
    );
}

#[test]
fn a_clock_that_runs_at_another_rate_is_refused_with_the_number() {
    for (stamp, rate) in [
        ((|t| 0.99 * t) as fn(f64) -> f64, 0.01_f64),
        (|t| 1.003 * t - 0.4, -0.003),
    ] {
        let turned = Turned {
            stamp,
            ..Turned::default()
        };
        let ReferenceProblem::ClockRate { rate: got, .. } = problem(&turned) else {
            panic!("{:?}", problem(&turned));
        };
        assert!((got / rate - 1.0).abs() < 0.1, "{got} for {rate}");
        let refused = scored(&turned, ReferenceUse::AsIs).unwrap_err().to_string();
        assert!(
            refused.contains("its clock runs") && refused.contains('%'),
            "{refused}"
        );
    }
}

#[test]
fn a_clock_that_jumps_is_refused_with_the_number() {
    let turned = Turned {
        stamp: |t| if t < 34.0 { t } else { t + 0.8 },
        ..Turned::default()
    };
    let ReferenceProblem::ClockJump { by_s, at_s } = problem(&turned) else {
        panic!("{:?}", problem(&turned));
    };
    assert!((by_s + 0.8).abs() < 0.02, "{by_s}");
    assert!((at_s - 34.0).abs() <= 6.0, "{at_s}");
}

#[test]
fn a_reference_of_another_recording_is_refused_with_the_correlation() {
    for seed in 2..=6 {
        let turned = Turned {
            seed,
            reference_seed: seed + 100,
            ..Turned::default()
        };
        let ReferenceProblem::OtherMotion { correlation } = problem(&turned) else {
            panic!("{:?}", problem(&turned));
        };
        assert!(correlation < 0.8, "{correlation}");
        let refused = scored(&turned, ReferenceUse::AsIs).unwrap_err().to_string();
        assert!(refused.contains(&format!("{correlation:.2}")), "{refused}");
        let ignored = scored(&turned, ReferenceUse::Ignored).unwrap();
        assert!(ignored.error_deg.is_none() && ignored.reference.is_none());
    }
}

/// x, y, z, w taken for w, x, y, z, the reverse, and the inverse: each is named, and not another recording's. Two of them together are the
/// attitude between two constant rotations, which is a mounting.
#[test]
fn a_quaternion_read_the_wrong_way_is_told_from_another_recording() {
    type Read = fn(UnitQuaternion<f64>) -> UnitQuaternion<f64>;
    let rolled: Read = |q| UnitQuaternion::from_quaternion(Quaternion::new(q.i, q.j, q.k, q.w));
    let back: Read = |q| UnitQuaternion::from_quaternion(Quaternion::new(q.k, q.w, q.i, q.j));
    let cases: [(Read, Order, bool); 3] = [
        (|q| q.inverse(), Order::AsRead, true),
        (rolled, Order::ScalarLast, false),
        (back, Order::ScalarFirst, false),
    ];
    for seed in 1..=4 {
        for (read, order, is_inverse) in cases {
            let turned = Turned {
                seed,
                reference_seed: seed,
                mounting: mounted(),
                stamp: |t| t - 0.217,
                read,
                ..Turned::default()
            };
            let ReferenceProblem::OtherReading {
                reading, reread, ..
            } = problem(&turned)
            else {
                panic!("{:?}", problem(&turned));
            };
            assert_eq!(reading, Reading { order, is_inverse }, "seed {seed}");
            assert!(reread > 0.97, "{reread}");
        }
    }
    let inverse = Turned {
        read: |q| q.inverse(),
        ..Turned::default()
    };
    let refused = scored(&inverse, ReferenceUse::AsIs).unwrap_err();
    let refused = refused.to_string();
    assert!(
        refused.contains("quaternions are read inverted"),
        "{refused}"
    );
}

/// Rates are the same in a world whose z points down, so that only the verticals tell; a heading from any direction does not.
#[test]
fn a_reference_whose_world_is_upside_down_is_refused_as_such() {
    let ned: fn(UnitQuaternion<f64>) -> UnitQuaternion<f64> = |q| enu_from_ned_rotation() * q;
    for (speed, magnetometer) in [(1.0, true), (1.0, false), (0.0, true)] {
        let turned = Turned {
            speed,
            magnetometer,
            ..Turned::default()
        };
        assert!(scored(&turned, ReferenceUse::AsIs).is_ok());
        let down = Turned {
            read: ned,
            ..turned
        };
        let refused = scored(&down, ReferenceUse::AsIs).unwrap_err().to_string();
        assert!(
            refused.contains("up is the estimate's down")
                && refused.contains("`# world_frame: ned`"),
            "{refused}"
        );
        // At rest the order of the numbers is another explanation.
        assert_eq!(
            refused.contains("in another order"),
            speed < 0.5,
            "{refused}"
        );
        assert!(scored(&down, ReferenceUse::Ignored).is_ok());
    }
}

/// Nothing is concluded, and nothing refused, where nothing moves or hardly anything was recorded.
#[test]
fn rest_and_three_seconds_say_nothing_of_the_clock() {
    let rest = Turned {
        speed: 0.0,
        stamp: |t| t - 3.0,
        ..Turned::default()
    };
    let short = Turned {
        duration_s: 3.0,
        ..Turned::default()
    };
    for turned in [rest, short] {
        assert!(matches!(
            fit(turned.events()),
            Err(EvaluationError::ReferenceAtRest)
        ));
        let summary = scored(&turned, ReferenceUse::AsIs).unwrap();
        assert!(
            !summary.issues.iter().any(|issue| issue.contains("clock")),
            "{:?}",
            summary.issues
        );
    }
}
