//! Runs on the virtual phone and on events made by hand.

use super::*;
use crate::attitude::reference::simulated::Turned;
use crate::attitude::{Profile, ScoredRecord};
use crate::statistics::metrics::HeadingReference;
use nalgebra::Vector3;
use northing_recording::{RecordingError, Reference, Sample};
use northing_simulation::virtual_phone::{Disturbance, Motion};
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

type Events = Vec<Result<Event, RecordingError>>;

fn phone(seed: u64) -> Events {
    let config = VirtualPhoneConfig {
        seed,
        motion: Motion::Gentle,
        ..VirtualPhoneConfig::default()
    };
    VirtualPhone::new(config)
        .unwrap()
        .events()
        .map(Ok)
        .collect()
}

fn lab(estimator: EstimatorKind) -> RunOptions {
    RunOptions {
        calibrate_first_s: Some(9.0),
        ..RunOptions::new(estimator, Profile::Lab)
    }
}

fn summary_of(options: &RunOptions) -> RunSummary {
    run(phone(1), options, &mut ()).unwrap()
}

#[test]
fn the_lab_on_the_virtual_phone_ranks_the_estimators() {
    let integration = summary_of(&lab(EstimatorKind::Integration));
    let mekf = summary_of(&lab(EstimatorKind::Mekf));
    let total = |s: &RunSummary| s.error_deg.unwrap().total_rmse;
    assert!(total(&mekf) < 1.5, "{:?}", mekf.error_deg);
    assert!(
        total(&mekf) < total(&integration),
        "{:?}",
        integration.error_deg
    );
    assert!(integration.nees_mean.is_none() && mekf.nees_mean.is_some());
    let last = mekf.final_test.unwrap();
    assert!(
        last.calculated_error_deg < 1.5 && last.verdict.is_some(),
        "{last:?}"
    );
    assert!(integration.final_test.unwrap().verdict.is_none());
}

#[test]
fn counts_add_up_to_the_samples() {
    let summary = summary_of(&lab(EstimatorKind::Mekf));
    let counts = |c: &crate::statistics::nis::UpdateCounts| c.fused + c.gated + c.skipped;
    let of = |kind| summary.samples_per_sensor[&kind];
    assert_eq!(
        counts(&summary.updates.gyroscope),
        of(SensorKind::Gyroscope)
    );
    assert_eq!(
        counts(&summary.updates.accelerometer),
        of(SensorKind::Accelerometer)
    );
    assert_eq!(
        counts(&summary.updates.magnetometer),
        of(SensorKind::Magnetometer)
    );
    let all: u64 = summary.samples_per_sensor.values().sum();
    assert_eq!(summary.samples, all - of(SensorKind::Reference));
    assert!((summary.duration_s - 75.0).abs() < 0.1);
    assert!((summary.first_estimate_s.unwrap() - 9.0).abs() < 0.1);
    assert_eq!(summary.estimates, summary.updates.gyroscope.fused);
    assert!(summary.updates.gyroscope.skipped_because["used for the calibration"] > 0);
}

#[test]
fn a_summary_has_the_keys_that_scripts_read() {
    let json = serde_json::to_value(summary_of(&lab(EstimatorKind::Mekf))).unwrap();
    assert_eq!(json["estimator"], "mekf");
    for sensor in ["gyroscope", "accelerometer", "magnetometer"] {
        for outcome in ["fused", "gated", "skipped"] {
            assert!(
                json["updates"][sensor][outcome].is_u64(),
                "{sensor} {outcome}"
            );
        }
    }
    for key in ["total_rmse", "heading_rmse", "inclination_rmse"] {
        assert!(json["error_deg"][key].is_f64(), "{key}");
    }
    assert!(json["error_deg"]["scored_samples"].is_u64());
    assert!(json["nees_mean"].is_f64() && json["nis_mean"]["accelerometer"].is_f64());
    for key in ["calculated_error_deg", "estimated_error_deg"] {
        assert!(json["final"][key].is_f64(), "{key}");
    }
    assert!(json["final"]["verdict"].is_string());
    assert!(json["recording"].is_string() && json["samples"].is_u64());
    assert!(json["duration_s"].is_f64());

    let options = RunOptions::new(EstimatorKind::Integration, Profile::Lab);
    let without: Events = phone(1)
        .into_iter()
        .filter(|e| e.as_ref().unwrap().sample.kind() != SensorKind::Reference)
        .collect();
    let json = serde_json::to_value(run(without, &options, &mut ()).unwrap()).unwrap();
    for key in ["error_deg", "nees_mean"] {
        assert!(json[key].is_null(), "{key}");
    }
    assert!(json["nis_mean"]["accelerometer"].is_null());
}

#[test]
fn a_stated_accelerometer_noise_three_times_too_small_is_found_out() {
    let mut options = lab(EstimatorKind::Mekf);
    let consistent = summary_of(&options);
    let sensor = |s: &RunSummary| s.verdicts[0].clone();
    let fair = sensor(&consistent).variance_factor.unwrap();
    let stated = calibrated_std(&options) / 3.0;
    options.set(&format!("accelerometer_std={stated}")).unwrap();
    let found = sensor(&summary_of(&options)).variance_factor.unwrap();
    assert!((found / fair / 9.0 - 1.0).abs() < 0.25, "{fair} {found}");
}

/// The accelerometer noise that the phone's own rest shows.
fn calibrated_std(options: &RunOptions) -> f64 {
    let mut phase = CalibrationPhase::new(9.0, options.sensors);
    for instant in Instants::new(phone(1)).map(Result::unwrap) {
        if instant.time_ns < 9_000_000_000 {
            phase.add(&instant);
        }
    }
    phase.finish().unwrap().accelerometer_std().unwrap()
}

#[test]
fn smoothing_scores_better_than_filtering() {
    for kind in [EstimatorKind::Mekf, EstimatorKind::BoundedVelocity] {
        let filtered = summary_of(&lab(kind));
        let smoothed = summary_of(&RunOptions {
            smooth: true,
            ..lab(kind)
        });
        let total = |s: &RunSummary| s.error_deg.unwrap().total_rmse;
        let errors = (total(&smoothed), total(&filtered));
        println!("{kind}: smoothed and filtered {errors:?} deg");
        assert!(errors.0 < errors.1, "{kind}: {errors:?}");
        assert!(smoothed.smoothed && !filtered.smoothed);
        assert_eq!(smoothed.estimates, filtered.estimates);
        assert_eq!(smoothed.nis_mean, filtered.nis_mean);
    }
}

#[test]
fn the_device_is_scored_where_the_estimators_are() {
    let device = summary_of(&RunOptions::new(EstimatorKind::Device, Profile::Lab));
    let error = device.error_deg.unwrap();
    assert!(
        error.total_rmse > 0.1 && error.total_rmse < 15.0,
        "{error:?}"
    );
    assert!(device.profile.is_none() && device.verdicts.is_empty());
    let mekf = summary_of(&RunOptions::new(EstimatorKind::Mekf, Profile::Lab));
    let scored = mekf.error_deg.unwrap().scored_samples;
    assert!(scored - error.scored_samples < 50, "{scored} {error:?}");
}

#[test]
fn without_sensors_it_runs_and_says_what_is_unobservable() {
    let mut options = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
    options.sensors = "gyro,acc".parse().unwrap();
    let summary = summary_of(&options);
    assert!(summary.unobservable[0].starts_with("The magnetometer is left out"));
    assert_eq!(summary.updates.magnetometer.fused, 0);
    assert_eq!(summary.nis_mean.magnetometer, None);
    // The phone's bias drifts: so does the heading, from where it began.
    let error = summary.error_deg.unwrap();
    assert!(
        error.inclination_rmse < 1.5 && error.heading_drift_rmse > 5.0,
        "{error:?}"
    );
}

/// Without anything that says where north is, the heading counts from an arbitrary direction: that is neither an error
/// nor too small an uncertainty.
#[test]
fn an_arbitrary_heading_is_no_error() {
    let turned = Turned {
        imu_hz: 40.0,
        magnetometer: false,
        ..Turned::default()
    };
    let elsewhere = UnitQuaternion::from_scaled_axis(Vector3::z() * 1.5);
    let mut events = turned.events();
    for event in events.iter_mut().flatten() {
        if let Sample::Reference(reference) = &mut event.sample {
            reference.attitude = elsewhere * reference.attitude;
        }
    }
    let options = RunOptions::new(EstimatorKind::Mekf, Profile::HandHeld);
    let summary = run(events, &options, &mut ()).unwrap();
    assert_eq!(summary.heading, HeadingReference::Arbitrary);
    let error = summary.error_deg.unwrap();
    assert!(
        error.heading_offset_removed && error.heading_offset.abs() > 60.0,
        "{error:?}"
    );
    assert!(
        error.total_rmse < 5.0 && error.inclination_rmse < 2.0,
        "{error:?}"
    );
    let nees = summary.nees.unwrap();
    assert_eq!(nees.degrees_of_freedom, 2);
    assert_eq!(summary.nees_mean, Some(nees.tilt_mean));
    assert!(nees.mean < 1.7, "{nees:?}");

    let fused = run(Turned::default().events(), &options, &mut ()).unwrap();
    assert_eq!(fused.heading, HeadingReference::Measured);
    assert!(!fused.error_deg.unwrap().heading_offset_removed);
    assert_eq!(fused.nees.unwrap().degrees_of_freedom, 3);
    let integration = RunOptions::new(EstimatorKind::Integration, Profile::HandHeld);
    let integrated = run(Turned::default().events(), &integration, &mut ()).unwrap();
    assert_eq!(integrated.heading, HeadingReference::Initial);
}

/// Motion capture at 30 Hz beside an inertial unit at 40 Hz: every sample counts, and the error is that of the estimate,
/// not of the time between the two.
#[test]
fn a_reference_on_its_own_clock_is_scored_at_its_own_instants() {
    struct Scored(Vec<i64>);
    impl RunObserver for Scored {
        fn scored(&mut self, record: &ScoredRecord) {
            self.0.push(record.time_ns);
        }
    }
    let turned = Turned {
        imu_hz: 40.0,
        ..Turned::default()
    };
    let shared = Turned {
        reference_hz: 40.0,
        reference_phase: 0.0,
        ..turned
    };
    for smooth in [false, true] {
        let options = RunOptions {
            smooth,
            ..RunOptions::new(EstimatorKind::Mekf, Profile::HandHeld)
        };
        let mut seen = Scored(Vec::new());
        let summary = run(turned.events(), &options, &mut seen).unwrap();
        let reference = summary.reference.unwrap();
        let error = summary.error_deg.unwrap();
        assert_eq!(reference.samples, 1800);
        // All but the first five seconds, and the last ones after the last gyroscope sample.
        assert!((1645..=1650).contains(&error.scored_samples), "{error:?}");
        assert_eq!(
            (reference.scored, reference.in_gaps),
            (error.scored_samples, 0)
        );
        // A device that turns by 60 deg/s is off by half a degree between two samples of the gyroscope.
        let expected = run(shared.events(), &options, &mut ())
            .unwrap()
            .error_deg
            .unwrap();
        let difference = error.total_rmse - expected.total_rmse;
        assert!(
            difference.abs() < 0.02,
            "smoothed {smooth}: {error:?} and {expected:?}"
        );
        assert!(seen.0.is_sorted() && seen.0.len() > 1700);
    }
}

/// A hole of 0.4 s in the inertial samples of a device that turns.
#[test]
fn references_in_a_hole_are_counted_and_said() {
    let mut events = Turned::default().events();
    let hole = 30_000_000_000..30_400_000_000;
    events.retain(|event| {
        let event = event.as_ref().unwrap();
        event.sample.kind() == SensorKind::Reference || !hole.contains(&event.time_ns)
    });
    let options = RunOptions::new(EstimatorKind::Mekf, Profile::HandHeld);
    let summary = run(events, &options, &mut ()).unwrap();
    assert_eq!(summary.reference.unwrap().in_gaps, 12);
    let said = |text: &str| summary.issues.iter().any(|issue| issue.starts_with(text));
    assert!(
        said("12 of the 1800 reference samples are not scored"),
        "{:?}",
        summary.issues
    );
}

#[test]
fn calibrating_while_moving_is_refused() {
    let options = RunOptions {
        calibrate_first_s: Some(25.0),
        ..lab(EstimatorKind::Mekf)
    };
    let error = run(phone(1), &options, &mut ()).unwrap_err().to_string();
    assert!(
        error.starts_with("calibration from the first 25 s: the device"),
        "{error}"
    );
}

#[test]
fn a_calibration_made_before_gives_bias_and_field() {
    let mut phase = CalibrationPhase::new(9.0, lab(EstimatorKind::Mekf).sensors);
    let instants: Vec<_> = Instants::new(phone(1)).map(Result::unwrap).collect();
    for instant in instants.iter().filter(|i| i.time_ns < 9_000_000_000) {
        phase.add(instant);
    }
    let calibration = phase.finish().unwrap();
    let plain = RunOptions::new(EstimatorKind::Integration, Profile::Lab);
    let calibrated = RunOptions {
        calibration: Some(calibration),
        ..plain.clone()
    };
    let total = |o: &RunOptions| summary_of(o).error_deg.unwrap().total_rmse;
    assert!(
        total(&calibrated) < 0.5 * total(&plain),
        "the bias is what integration suffers from"
    );
    let both = RunOptions {
        calibrate_first_s: Some(5.0),
        ..calibrated
    };
    assert!(matches!(
        run(phone(1), &both, &mut ()),
        Err(EvaluationError::TwoCalibrations)
    ));
}

/// A device at rest, 100 Hz, from `from_s` to `to_s`.
fn rest(from_s: f64, to_s: f64) -> Events {
    let mut events = Vec::new();
    for k in (from_s * 100.0) as i64..(to_s * 100.0) as i64 {
        let samples = [
            Sample::AngularRate(Vector3::zeros()),
            Sample::SpecificForce(Vector3::new(0.0, 0.0, 9.81)),
            Sample::MagneticField(Vector3::new(0.0, 22.0, -42.0)),
            Sample::Reference(Reference {
                attitude: UnitQuaternion::identity(),
                scored: true,
            }),
        ];
        events.extend(samples.map(|sample| {
            Ok(Event {
                time_ns: k * 10_000_000,
                sample,
            })
        }));
    }
    events
}

#[test]
fn a_gap_is_counted_and_widens_the_covariance() {
    struct Widest(f64);
    impl RunObserver for Widest {
        fn estimate(&mut self, record: &EstimateRecord) {
            self.0 = self
                .0
                .max(record.attitude_covariance.unwrap()[(2, 2)].sqrt());
        }
    }
    let mut events = rest(0.0, 6.0);
    events.extend(rest(9.0, 12.0));
    let options = RunOptions::new(EstimatorKind::Mekf, Profile::HandHeld);
    let mut late = Widest(0.0);
    let summary = run(events, &options, &mut late).unwrap();
    assert_eq!(summary.gaps.count, 1);
    approx::assert_relative_eq!(summary.gaps.longest_s, 3.01, epsilon = 1e-9);
    approx::assert_relative_eq!(summary.gaps.longest_start_s, 5.99, epsilon = 1e-9);
    assert_eq!(summary.error_deg.unwrap().scored_samples, 400);
    assert_eq!(summary.reference.unwrap().in_gaps, 0);
}

#[test]
fn samples_that_are_not_finite_are_skipped_and_counted() {
    let mut events = rest(0.0, 8.0);
    for (n, event) in events.iter_mut().flatten().enumerate() {
        if n % 40 == 0 {
            event.sample = Sample::AngularRate(Vector3::new(f64::NAN, 0.0, 0.0));
        }
        if n % 40 == 1 {
            event.sample = Sample::SpecificForce(Vector3::zeros());
        }
    }
    let options = RunOptions::new(EstimatorKind::Mekf, Profile::HandHeld);
    let summary = run(events, &options, &mut ()).unwrap();
    assert_eq!(
        summary.updates.gyroscope.skipped_because["not a finite number"],
        80
    );
    assert!(summary.updates.accelerometer.skipped_because["zero vector"] >= 70);
    assert!(summary.error_deg.unwrap().total_rmse < 0.01);
}

#[test]
fn errors_of_the_recording_come_through_and_too_little_is_said() {
    let mut events = rest(0.0, 1.0);
    events.push(Err(RecordingError::Damaged {
        file: "a.parquet".into(),
        detail: "cut".into(),
    }));
    let options = RunOptions::default();
    let error = run(events, &options, &mut ()).unwrap_err().to_string();
    assert!(
        error.starts_with("a.parquet: damaged or cut off"),
        "{error}"
    );
    let error = run(rest(0.0, 0.2), &options, &mut ())
        .unwrap_err()
        .to_string();
    assert!(
        error.starts_with("too short: 0.190 s of samples"),
        "{error}"
    );
    let device = RunOptions::new(EstimatorKind::Device, Profile::Lab);
    let error = run(rest(0.0, 8.0), &device, &mut ()).unwrap_err();
    assert!(matches!(error, EvaluationError::NoDeviceOrientation));
}

#[test]
fn a_disturbed_magnetometer_is_gated_and_said() {
    let config = VirtualPhoneConfig {
        disturbance: Disturbance::Magnetic,
        ..VirtualPhoneConfig::default()
    };
    let events: Events = VirtualPhone::new(config)
        .unwrap()
        .events()
        .map(Ok)
        .collect();
    let summary = run(events, &lab(EstimatorKind::Mekf), &mut ()).unwrap();
    assert!(
        summary.updates.magnetometer.gated > 100,
        "{:?}",
        summary.updates.magnetometer
    );
    let verdict = summary
        .verdicts
        .iter()
        .find(|v| v.sensor == SensorKind::Magnetometer)
        .unwrap();
    assert!(
        verdict.sentences.iter().any(|s| s.contains("gate refuses")),
        "{verdict:?}"
    );
}

/// Keeps what it is told, as text: every digit of it.
#[derive(Default)]
struct Told(Vec<String>);

impl RunObserver for Told {
    fn estimate(&mut self, record: &EstimateRecord) {
        self.0.push(format!("{record:?}"));
    }

    fn innovation(&mut self, record: &InnovationRecord) {
        self.0.push(format!("{record:?}"));
    }
}

#[test]
fn estimates_alone_are_those_of_the_whole_run() {
    let smoothed = RunOptions {
        smooth: true,
        ..lab(EstimatorKind::Mekf)
    };
    for options in [
        lab(EstimatorKind::Mekf),
        lab(EstimatorKind::CascadeEkf),
        RunOptions::new(EstimatorKind::BoundedVelocity, Profile::default()),
        smoothed,
    ] {
        let (mut alone, mut whole) = (Told::default(), Told::default());
        let estimates = estimate(phone(2), &options, &mut alone).unwrap();
        let summary = run(phone(2), &options, &mut whole).unwrap();
        assert_eq!(estimates, summary.estimates);
        assert!(alone.0 == whole.0 && alone.0.len() > 5000, "{options:?}");
    }
    // Nothing to estimate is a count here; the whole run says why.
    let options = RunOptions::new(EstimatorKind::Mekf, Profile::default());
    let short: Events = phone(2).into_iter().take(20).collect();
    assert_eq!(estimate(short, &options, &mut ()).unwrap(), 0);
}

/// Counts estimates where a source sees them.
struct Counted<'a>(&'a std::cell::Cell<u64>, Told);

impl RunObserver for Counted<'_> {
    fn estimate(&mut self, record: &EstimateRecord) {
        self.0.set(self.0.get() + 1);
        self.1.estimate(record);
    }

    fn innovation(&mut self, record: &InnovationRecord) {
        self.1.innovation(record);
    }
}

#[test]
fn live_messages_give_the_estimates_of_the_recording_each_before_the_next_message() {
    let options = lab(EstimatorKind::Mekf);
    let mut messages: Vec<Vec<Event>> = Vec::new();
    for event in phone(2).into_iter().map(Result::unwrap) {
        match messages.last_mut() {
            Some(last) if last[0].time_ns == event.time_ns => last.push(event),
            _ => messages.push(vec![event]),
        }
    }
    let estimates = std::cell::Cell::new(0);
    let mut late = 0;
    let mut before = 0;
    let mut owed = false;
    let source = messages.into_iter().map(|message| {
        // What the message before gave is there when the next one is asked for.
        late += u64::from(owed && before > 0 && estimates.get() == before);
        before = estimates.get();
        owed = message
            .iter()
            .any(|event| event.sample.kind() == SensorKind::Gyroscope);
        Ok::<_, std::convert::Infallible>(message)
    });
    let mut live = Counted(&estimates, Told::default());
    run_live(source, &options, &mut live).unwrap();
    let mut whole = Told::default();
    run(phone(2), &options, &mut whole).unwrap();
    assert!(live.1.0 == whole.0 && whole.0.len() > 5000);
    assert_eq!(late, 0);
}

/// GIVEN a magnetometer with a hard iron that nobody told WHEN the filter finds it THEN the summary says since when, and how large it is; of one
/// without, and of a filter that does not look for it, nothing is said.
#[test]
fn a_hard_iron_that_the_filter_has_found_is_told() {
    let with_iron = |bias_ut: [f64; 3]| -> Events {
        let mut config = VirtualPhoneConfig {
            motion: Motion::Tumble,
            duration_s: Some(90.0),
            ..VirtualPhoneConfig::default()
        };
        config.magnetometer.bias_ut = bias_ut;
        let phone = VirtualPhone::new(config).unwrap();
        phone.events().map(Ok).collect()
    };
    let told = |events: Events, smooth: bool, settings: &[&str]| -> Vec<String> {
        let mut options = RunOptions::new(EstimatorKind::BoundedVelocity, Profile::Lab);
        options.smooth = smooth;
        for setting in settings {
            options.set(setting).unwrap();
        }
        let issues = run(events, &options, &mut ()).unwrap().issues;
        let of_iron = |sentence: &String| sentence.contains("hard iron");
        issues.into_iter().filter(of_iron).collect()
    };
    let iron = [8.0, -6.0, 0.0];
    for smooth in [false, true] {
        let sentences = told(with_iron(iron), smooth, &[]);
        let [sentence] = &sentences[..] else {
            panic!("{sentences:?}")
        };
        let number = |before: &str| -> f64 {
            let rest = sentence.split(before).nth(1).unwrap();
            rest.split(' ').next().unwrap().parse().unwrap()
        };
        assert!((number("do not expect: ") - 10.0).abs() < 1.5, "{sentence}");
        assert!((2.0..60.0).contains(&number("From ")), "{sentence}");
        assert!(sentence.contains("`bounded-velocity`"), "{sentence}");
    }
    assert_eq!(told(with_iron([0.5, 0.0, -0.5]), false, &[]), [""; 0]);
    let never = told(with_iron(iron), false, &["bounded_unexpected_hard_iron=0"]);
    assert_eq!(never, [""; 0]);
}
