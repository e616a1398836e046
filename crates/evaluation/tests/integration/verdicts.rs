//! Whole diagnoses: a filter over simulated samples with one thing wrong.

#![allow(clippy::unwrap_used)]

use std::cell::Cell;

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::geometry::so3;
use northing_recording::{Event, RecordingError, Sample, SensorKind};
use northing_simulation::random::{normal_vector, stream};

use northing_evaluation::attitude::kinds::EstimatorKind;
use northing_evaluation::attitude::options::RunOptions;
use northing_evaluation::attitude::parameters::Profile;
use northing_evaluation::attitude::runner::run;
use northing_evaluation::statistics::consistency::{NoiseVerdict, SensorVerdict};
use northing_evaluation::statistics::verdict::findings::{Cause, Finding};

/// Noise of gyroscope, accelerometer and magnetometer, as the tests state it to the filter.
const STD: [f64; 3] = [0.002, 0.05, 0.5];

/// A device that is turned about changing axes at up to 1.5 rad/s, at 100 Hz, for 40 s; `change` makes the fault.
fn samples(change: impl Fn(i64, f64, &mut [Vector3<f64>; 3]) -> bool) -> Vec<Event> {
    let mut noise = stream(21, "verdict");
    let mut attitude = UnitQuaternion::identity();
    let mut events = Vec::new();
    for k in 0..4000_i64 {
        let t = k as f64 * 0.01;
        let ease = (0.5 * (t - 2.0)).clamp(0.0, 1.0);
        let rate = Vector3::new(
            (0.7 * t).sin(),
            0.8 * (0.43 * t).cos(),
            0.7 * (0.31 * t).sin(),
        ) * 1.5
            * ease;
        attitude *= so3::exp(&(rate * 0.01));
        let down = attitude.inverse();
        let mut three = [
            rate,
            down * Vector3::new(0.0, 0.0, 9.81),
            down * Vector3::new(0.0, 20.0, -44.0),
        ];
        for (v, std) in three.iter_mut().zip(STD) {
            *v += normal_vector(&mut noise, std);
        }
        if !change(k, t, &mut three) {
            continue;
        }
        let time_ns = k * 10_000_000;
        let [rate, force, field] = three;
        events.extend(
            [
                Sample::AngularRate(rate),
                Sample::SpecificForce(force),
                Sample::MagneticField(field),
            ]
            .map(|sample| Event { time_ns, sample }),
        );
    }
    events
}

fn diagnosed(events: Vec<Event>) -> (Vec<Finding>, Vec<SensorVerdict>) {
    diagnosed_with(STD, events)
}

fn diagnosed_with(
    [rate, force, field]: [f64; 3],
    events: Vec<Event>,
) -> (Vec<Finding>, Vec<SensorVerdict>) {
    let mut options = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
    let stated = [
        ("gyroscope_noise_density", rate * 0.1),
        ("accelerometer_std", force),
        ("magnetometer_std_ut", field),
    ];
    for (name, value) in stated {
        options.set(&format!("{name}={value}")).unwrap();
    }
    let events = events.into_iter().map(Ok::<_, RecordingError>);
    let summary = run(events, &options, &mut ()).unwrap();
    (summary.findings, summary.verdicts)
}

fn first(findings: &[Finding]) -> Option<Cause> {
    findings.first().map(|finding| finding.cause)
}

fn verdict_of(verdicts: &[SensorVerdict], index: usize) -> NoiseVerdict {
    verdicts[index].verdict
}

#[test]
fn a_good_recording_has_no_findings() {
    let (findings, verdicts) = diagnosed(samples(|_, _, _| true));
    assert_eq!(findings, []);
    assert!(
        verdicts
            .iter()
            .all(|v| v.verdict == NoiseVerdict::Consistent),
        "{verdicts:?}"
    );
}

#[test]
fn a_hole_in_a_turn_is_named_with_its_time_and_r_is_not_blamed() {
    let (findings, verdicts) = diagnosed(samples(|k, _, _| !(1640..1680).contains(&k)));
    assert_eq!(first(&findings), Some(Cause::Hole), "{findings:?}");
    let sentence = &findings[0].sentence;
    assert!(
        sentence.contains("a hole of 0.41 s at 16.4 s"),
        "{sentence}"
    );
    assert!(
        verdicts
            .iter()
            .all(|v| v.verdict == NoiseVerdict::Consistent),
        "{verdicts:?}"
    );
    assert!(
        findings.iter().all(|f| f.cause != Cause::Noise),
        "{findings:?}"
    );
}

#[test]
fn a_gyroscope_at_the_end_of_its_range_is_named() {
    let clip = |_: i64, _: f64, v: &mut [Vector3<f64>; 3]| {
        v[0] = v[0].map(|w| w.clamp(-1.0, 1.0));
        true
    };
    let (findings, _) = diagnosed(samples(clip));
    assert_eq!(first(&findings), Some(Cause::Saturation), "{findings:?}");
    assert!(
        findings[0].sentence.contains("end of its range, 57 deg/s"),
        "{}",
        findings[0].sentence
    );
}

/// A good sensor, rounded as browsers do, with the R that a calibration at rest finds: the step's own noise.
#[test]
fn values_rounded_to_a_tenth_do_not_make_r_too_large() {
    let round = |_: i64, _: f64, v: &mut [Vector3<f64>; 3]| {
        v[1] = v[1].map(|f| (f * 10.0).round() / 10.0);
        true
    };
    let (findings, verdicts) = diagnosed_with([STD[0], 0.058, STD[2]], samples(round));
    assert_eq!(findings, []);
    assert_eq!(
        verdict_of(&verdicts, 0),
        NoiseVerdict::Consistent,
        "{verdicts:?}"
    );
    // An R below what the steps alone are is a fault, and the steps are its cause.
    let (findings, _) = diagnosed_with([STD[0], 0.01, STD[2]], samples(round));
    assert_eq!(first(&findings), Some(Cause::Rounding), "{findings:?}");
    // At rest, with less noise than a step, the same value comes again and again.
    let rest = |k: i64, t: f64, v: &mut [Vector3<f64>; 3]| {
        let noise = Vector3::new((37.0 * t).sin(), (51.0 * t).cos(), (43.0 * t).sin()) * 0.01;
        *v = [
            noise * 0.1 + Vector3::repeat(1e-4 * (k % 3) as f64),
            (Vector3::new(0.31, -0.12, 9.81) + noise).map(|f| (f * 10.0).round() / 10.0),
            Vector3::new(0.0, 20.0, -44.0) + noise * 20.0,
        ];
        true
    };
    let (_, verdicts) = diagnosed_with([STD[0], 0.029, STD[2]], samples(rest));
    assert_eq!(
        verdict_of(&verdicts, 0),
        NoiseVerdict::Undetermined,
        "{verdicts:?}"
    );
}

#[test]
fn a_magnet_that_passes_is_named_and_r_is_not_blamed() {
    let magnet = |_: i64, t: f64, v: &mut [Vector3<f64>; 3]| {
        if (20.0..24.0).contains(&t) {
            v[2] += Vector3::new(12.0, -9.0, 7.0);
        }
        true
    };
    let (findings, verdicts) = diagnosed(samples(magnet));
    assert_eq!(
        first(&findings),
        Some(Cause::MagneticDisturbance),
        "{findings:?}"
    );
    assert!(
        findings[0].sentence.contains("T at 20.0 s"),
        "{}",
        findings[0].sentence
    );
    assert_eq!(
        verdict_of(&verdicts, 1),
        NoiseVerdict::Consistent,
        "{verdicts:?}"
    );
}

#[test]
fn a_magnetometer_that_is_all_one_value_is_named_first() {
    let stuck = |_: i64, _: f64, v: &mut [Vector3<f64>; 3]| {
        v[2] = Vector3::new(10.0, 20.0, -40.0);
        true
    };
    let (findings, _) = diagnosed(samples(stuck));
    assert_eq!(first(&findings), Some(Cause::Stuck), "{findings:?}");
    assert_eq!(findings[0].sensor, SensorKind::Magnetometer);
}

/// A minute on a table: rounded values repeat, the gyroscope shows its bias, and nothing is stuck.
#[test]
fn a_device_at_rest_has_no_stuck_sensor() {
    let rest = |k: i64, _: f64, v: &mut [Vector3<f64>; 3]| {
        *v = [
            Vector3::new(0.06, -0.05, 0.07 + 1e-4 * (k % 3) as f64),
            Vector3::new(0.3, -0.1, 9.8),
            Vector3::new(0.0, 20.0, -44.0),
        ];
        true
    };
    let (findings, _) = diagnosed(samples(rest));
    assert!(
        findings.iter().all(|f| f.cause != Cause::Stuck),
        "{findings:?}"
    );
}

#[test]
fn a_sensor_that_changes_its_rate_has_no_holes() {
    let slower = |k: i64, _: f64, _: &mut [Vector3<f64>; 3]| k < 2000 || k % 8 == 0;
    let (findings, _) = diagnosed(samples(slower));
    assert!(
        findings.iter().all(|f| f.cause != Cause::Hole),
        "{findings:?}"
    );
}

#[test]
fn a_device_that_is_shaken_is_accelerated() {
    let shaken = |_: i64, t: f64, v: &mut [Vector3<f64>; 3]| {
        if (10.0..25.0).contains(&t) {
            v[1] += Vector3::new((17.0 * t).sin(), (13.0 * t).cos(), (11.0 * t).sin()) * 3.0;
        }
        true
    };
    let (findings, _) = diagnosed(samples(shaken));
    assert_eq!(first(&findings), Some(Cause::Acceleration), "{findings:?}");
}

#[test]
fn noise_that_is_three_times_larger_is_blamed_on_r_and_nothing_else() {
    let mut noise = stream(4, "more");
    let more: Vec<_> = (0..4000)
        .map(|_| normal_vector(&mut noise, 0.05 * 8.0_f64.sqrt()))
        .collect();
    let louder = |k: i64, _: f64, v: &mut [Vector3<f64>; 3]| {
        v[1] += more[k as usize];
        true
    };
    let (findings, verdicts) = diagnosed(samples(louder));
    assert_eq!(findings.len(), 1, "{findings:?}");
    assert_eq!(first(&findings), Some(Cause::Noise));
    let factor = verdicts[0].variance_factor.unwrap();
    assert!((7.0..11.0).contains(&factor), "{factor}");
}

#[test]
fn noise_of_the_gyroscope_is_named_with_its_size() {
    let mut noise = stream(5, "more");
    let more: Vec<_> = (0..4000)
        .map(|_| normal_vector(&mut noise, 0.006))
        .collect();
    let louder = |k: i64, _: f64, v: &mut [Vector3<f64>; 3]| {
        v[0] += more[k as usize];
        true
    };
    let (findings, _) = diagnosed(samples(louder));
    assert_eq!(first(&findings), Some(Cause::Noise), "{findings:?}");
    assert_eq!(findings[0].sensor, SensorKind::Gyroscope);
    // sqrt(0.006^2 + 0.002^2) / 0.002 = 3.16
    let times = &findings[0].sentence;
    assert!(
        ["3.0 times", "3.1 times", "3.2 times", "3.3 times"]
            .iter()
            .any(|t| times.contains(t)),
        "{times}"
    );
}

/// A filter that takes the mean of four fields is told of the noise of that mean, and only where that is more than it expects.
#[test]
fn noise_of_the_magnetometer_is_that_of_what_the_filter_takes() {
    // Of a logger that holds each field for so many samples.
    let finding_at = |std_ut: f64, held: i64| {
        let mut noise = stream(6, "more");
        let more: Vec<_> = (0..4000)
            .map(|_| normal_vector(&mut noise, std_ut))
            .collect();
        let field = Cell::new(Vector3::zeros());
        let events = samples(|k, _, v| {
            if k % held == 0 {
                field.set(v[2] + more[k as usize]);
            }
            v[2] = field.get();
            true
        });
        let options = RunOptions::new(EstimatorKind::BoundedVelocity, Profile::HandHeld);
        let events = events.into_iter().map(Ok::<_, RecordingError>);
        let summary = run(events, &options, &mut ()).unwrap();
        let mut findings = summary.findings.into_iter();
        findings
            .find(|found| (found.cause, found.sensor) == (Cause::Noise, SensorKind::Magnetometer))
    };
    // 16 microtesla of a sample are 8 of four, 3.2 times the 2.5 that are stated; 6 are 3.
    let sentence = finding_at(16.0, 1).unwrap().sentence;
    assert!(
        sentence.contains("in the mean of the 4 samples that the filter takes at a time")
            && ["3.1 times", "3.2 times", "3.3 times"]
                .iter()
                .any(|t| sentence.contains(t)),
        "{sentence}"
    );
    let quiet = finding_at(6.0, 1);
    assert!(quiet.is_none_or(|found| !found.sentence.contains("white noise is")));
    let held = finding_at(16.0, 2).unwrap().sentence;
    assert!(held.contains("in the mean of the 2 samples"), "{held}");
}

#[test]
fn hard_iron_is_named_with_its_size_and_is_no_disturbance() {
    let iron = |_: i64, _: f64, v: &mut [Vector3<f64>; 3]| {
        v[2] += Vector3::new(8.0, -6.0, 0.0);
        true
    };
    let (findings, _) = diagnosed(samples(iron));
    assert_eq!(first(&findings), Some(Cause::HardIron), "{findings:?}");
    let sentence = &findings[0].sentence;
    let near = ["9.8", "9.9", "10.0", "10.1", "10.2"].map(|ut| format!("hard iron of {ut} "));
    assert!(
        near.iter().any(|text| sentence.contains(text)),
        "{sentence}"
    );
    let magnet = |f: &Finding| f.cause == Cause::MagneticDisturbance;
    assert!(!findings.iter().any(magnet), "{findings:?}");
}

#[test]
fn a_magnet_that_comes_and_stays_is_named_where_it_came() {
    // Fixed in the room: its field goes through the body's axes as the Earth's does.
    let mut attitude = UnitQuaternion::identity();
    let mut there = Vec::new();
    for event in samples(|_, _, _| true) {
        if let Sample::AngularRate(rate) = event.sample {
            attitude *= so3::exp(&(rate * 0.01));
            there.push(attitude.inverse() * Vector3::new(9.0, 8.0, 3.0));
        }
    }
    let comes = |k: i64, t: f64, v: &mut [Vector3<f64>; 3]| {
        v[2] += there[k as usize] * (t - 22.0).clamp(0.0, 1.0);
        true
    };
    let (findings, _) = diagnosed(samples(comes));
    let magnet = findings
        .iter()
        .find(|f| f.cause == Cause::MagneticDisturbance);
    let sentence = &magnet.unwrap().sentence;
    let seconds: Vec<_> = (19..=23).map(|s| format!("T at {s}.")).collect();
    assert!(
        seconds.iter().any(|s| sentence.contains(s.as_str())),
        "{sentence}"
    );
}

#[test]
fn two_chips_and_a_wrong_scale_are_named_while_the_device_turns() {
    let chip = so3::exp(&Vector3::new(0.03, -0.02, 0.01));
    let turned = |_: i64, _: f64, v: &mut [Vector3<f64>; 3]| {
        v[0] = chip * v[0];
        true
    };
    let (findings, _) = diagnosed(samples(turned));
    assert_eq!(first(&findings), Some(Cause::Misalignment), "{findings:?}");
    // 0.0374 rad
    let sentence = &findings[0].sentence;
    assert!(
        ["2.0 deg", "2.1 deg", "2.2 deg", "2.3 deg"]
            .iter()
            .any(|d| sentence.contains(d)),
        "{sentence}"
    );
    let scaled = |_: i64, _: f64, v: &mut [Vector3<f64>; 3]| {
        v[1] = v[1].component_mul(&Vector3::new(1.03, 0.98, 1.02));
        true
    };
    let (findings, _) = diagnosed(samples(scaled));
    assert_eq!(first(&findings), Some(Cause::Scale), "{findings:?}");
}

#[test]
fn a_bias_that_jumps_in_motion_is_named() {
    let jump = |_: i64, t: f64, v: &mut [Vector3<f64>; 3]| {
        if t > 21.0 {
            v[0] += Vector3::new(0.02, -0.01, 0.015);
        }
        true
    };
    let (findings, _) = diagnosed(samples(jump));
    assert_eq!(first(&findings), Some(Cause::BiasChange), "{findings:?}");
}

/// Pairs of samples, at one stamp or a tenth of a millisecond apart.
#[test]
fn samples_that_arrive_in_pairs_are_bursts_and_no_jitter() {
    for apart_ns in [0, 100_000] {
        let mut events = samples(|_, _, _| true);
        for event in &mut events {
            let k = event.time_ns / 10_000_000;
            event.time_ns = (k / 2) * 20_000_000 + (k % 2) * apart_ns;
        }
        events.sort_by_key(Event::place);
        let (findings, _) = diagnosed(events);
        assert_eq!(first(&findings), Some(Cause::Bursts), "{findings:?}");
        let sentence = &findings[0].sentence;
        assert!(
            sentence.contains("as those of a regular clock;"),
            "{sentence}"
        );
        let jitter = |f: &Finding| f.cause == Cause::Jitter;
        assert!(!findings.iter().any(jitter), "{findings:?}");
    }
}

#[test]
fn values_that_repeat_are_rounded_too_coarsely() {
    let coarse = |_: i64, _: f64, v: &mut [Vector3<f64>; 3]| {
        v[0] = v[0].map(|w| (w / 0.01).round() * 0.01);
        v[1] = v[1].map(|f| (f / 0.3).round() * 0.3);
        true
    };
    let (findings, _) = diagnosed_with([0.01, 0.3, STD[2]], samples(coarse));
    let rounded: Vec<_> = (findings.iter().filter(|f| f.cause == Cause::Rounding))
        .map(|f| f.sensor)
        .collect();
    assert_eq!(
        rounded,
        [SensorKind::Gyroscope, SensorKind::Accelerometer],
        "{findings:?}"
    );
}

/// A device that turns about the vertical with its iron above it: the strength of the field varies by less than a tenth of the offset.
#[test]
fn hard_iron_along_the_axis_that_is_turned_about_is_no_other_axes() {
    let mut events = Vec::new();
    let mut noise = stream(5, "level");
    for k in 0..8000_i64 {
        let t = k as f64 * 0.01;
        let attitude = |t: f64| {
            UnitQuaternion::from_euler_angles(0.15 * (0.31 * t).sin(), 0.0, 1.2 * (0.2 * t).sin())
        };
        let rate = so3::log(&(attitude(t).inverse() * attitude(t + 0.01))) / 0.01;
        let down = attitude(t).inverse();
        let force = down * Vector3::new(0.0, 0.0, 9.81);
        let field = down * Vector3::new(0.0, 13.0, -26.0) + Vector3::new(1.5, -4.0, 20.0);
        let noisy = |v: Vector3<f64>, noise: &mut _, std: f64| v + normal_vector(noise, std);
        let three = [
            Sample::AngularRate(noisy(rate, &mut noise, STD[0])),
            Sample::SpecificForce(noisy(force, &mut noise, STD[1])),
            Sample::MagneticField(noisy(field, &mut noise, STD[2])),
        ];
        let time_ns = k * 10_000_000;
        events.extend(three.map(|sample| Event { time_ns, sample }));
    }
    let (findings, _) = diagnosed(events);
    assert_eq!(first(&findings), Some(Cause::HardIron), "{findings:?}");
}

/// Exchanged axes of a magnetometer are neither iron that turns with the device nor a magnet that came.
#[test]
fn axes_of_a_magnetometer_that_are_others_are_named_and_no_iron_is() {
    let exchanged = |_: i64, _: f64, v: &mut [Vector3<f64>; 3]| {
        v[2] = Vector3::new(v[2].y, v[2].x, -v[2].z);
        true
    };
    for (findings, _) in [
        diagnosed(samples(exchanged)),
        diagnosed(samples(|k, t, v| exchanged(k, t, v) && k >= 300)),
    ] {
        assert_eq!(first(&findings), Some(Cause::Misalignment), "{findings:?}");
        assert_eq!(findings[0].sensor, SensorKind::Magnetometer);
        assert!(
            findings[0].sentence.contains("keeps its strength (48.3"),
            "{findings:?}"
        );
        let false_reason =
            |f: &Finding| matches!(f.cause, Cause::HardIron | Cause::MagneticDisturbance);
        assert!(!findings.iter().any(false_reason), "{findings:?}");
    }
}

/// A vehicle that speeds up and brakes leaves residuals that look like biases, now one and now another.
#[test]
fn forces_of_a_vehicle_are_no_change_of_the_bias() {
    let drives = |_: i64, t: f64, v: &mut [Vector3<f64>; 3]| {
        if t > 10.0 {
            v[1].x += 0.8 * (0.25 * t).sin();
            v[1].y += 0.6 * (0.17 * t).cos();
        }
        true
    };
    let (findings, _) = diagnosed(samples(drives));
    assert!(
        !findings.iter().any(|f| f.cause == Cause::BiasChange),
        "{findings:?}"
    );
}

/// The bias of a cheap gyroscope, which the filter takes out, is not the accelerometer's axes.
#[test]
fn a_large_bias_of_the_gyroscope_is_no_misalignment() {
    for bias in [0.05, 0.1, 0.2] {
        let biased = |_: i64, _: f64, v: &mut [Vector3<f64>; 3]| {
            v[0] += Vector3::new(1.0, -0.5, 0.75) * bias;
            true
        };
        let (findings, _) = diagnosed(samples(biased));
        let axes = |f: &Finding| matches!(f.cause, Cause::Misalignment | Cause::Scale);
        assert!(!findings.iter().any(axes), "{bias}: {findings:?}");
    }
}
