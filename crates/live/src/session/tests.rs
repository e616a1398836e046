//! The lab on virtual phones, whose truth is known.

use super::*;
use crate::experiments::run_over;
use northing_evaluation::run;
use northing_recording::RecordingError;
use northing_simulation::virtual_phone::Motion;
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use serde_json::json;

fn phone(seed: u64) -> VirtualPhone {
    VirtualPhone::new(VirtualPhoneConfig {
        seed,
        rest_before_s: 8.0,
        motion_s: 12.0,
        rest_after_s: 4.0,
        ..VirtualPhoneConfig::default()
    })
    .unwrap()
}

fn session() -> DeviceSession {
    DeviceSession::new(RunOptions::new(EstimatorKind::Mekf, Profile::Lab)).unwrap()
}

fn error_deg(session: &DeviceSession, name: &str) -> f64 {
    let truth = session.truth.unwrap();
    session
        .attitude(name)
        .unwrap()
        .angle_to(&truth)
        .to_degrees()
}

/// The live filter and the runner over files are one: equal to the bit, however it is cut in batches.
#[test]
fn live_estimates_equal_those_of_a_run() {
    live_equals_run(&phone(3));
    live_equals_run(&compass_phone(3, true));
    live_equals_run(&compass_phone(3, false));
}

/// A phone with a compass, and with a magnetometer that comes a second late or not at all.
fn compass_phone(seed: u64, magnetometer: bool) -> VirtualPhone {
    let mut config = phone(seed).config().clone();
    config.compass.sampling.rate_hz = 10.0;
    config.magnetometer.sampling.start_offset_s = 1.0;
    if !magnetometer {
        config.magnetometer.sampling.rate_hz = 0.0;
    }
    VirtualPhone::new(config).unwrap()
}

#[test]
fn without_a_magnetometer_the_compass_gives_the_heading_and_has_its_lamp() {
    let mut live = session();
    live.take(&mut compass_phone(2, false).events().collect::<Vec<_>>());
    assert!(
        error_deg(&live, "mekf") < 6.0,
        "{}",
        error_deg(&live, "mekf")
    );
    let lit = |live: &mut DeviceSession| {
        let lamps = live.frame("d").lamp;
        let is_lit = |l: &&northing_evaluation::statistics::lamp::Lamp| l.tone != Tone::Idle;
        let mut lit = lamps.iter().filter(is_lit);
        lit.any(|l| l.sensor == SensorKind::CompassHeading)
    };
    assert!(lit(&mut live));
    let health = serde_json::to_string(&live.status(0).health).unwrap();
    assert!(health.contains("own compass gives the heading"), "{health}");
    let mut off = session();
    off.use_sensors("gyro,acc,mag".parse().unwrap());
    off.take(&mut compass_phone(2, false).events().collect::<Vec<_>>());
    assert!(!lit(&mut off));
    let mut with_field = session();
    with_field.take(&mut phone(2).events().collect::<Vec<_>>());
    assert!(!lit(&mut with_field));
}

fn live_equals_run(phone: &VirtualPhone) {
    let events: Vec<Event> = phone.events().collect();
    let options = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
    let mut last = LastEstimate(None);
    let stream = events.iter().map(|e| Ok::<_, RecordingError>(*e));
    run(stream, &options, &mut last).unwrap();
    for size in [1, 7, 1000] {
        let mut live = DeviceSession::new(options.clone()).unwrap();
        for batch in events.chunks(size) {
            live.take(&mut batch.to_vec());
        }
        let live = live.attitude("mekf").unwrap();
        assert_eq!(Some(live), last.0, "batches of {size}");
    }
}

struct LastEstimate(Option<UnitQuaternion<f64>>);

impl northing_evaluation::RunObserver for LastEstimate {
    fn estimate(&mut self, record: &northing_evaluation::EstimateRecord) {
        self.0 = Some(record.attitude);
    }
}

#[test]
fn calibration_then_experiment_end_near_the_truth() {
    let mut live = session();
    live.calibrate(6.0).unwrap();
    let events: Vec<Event> = phone(1).events().collect();
    let (mut calibrated, mut experiment) = (false, None);
    for batch in events.chunks(40) {
        for happening in live.take(&mut batch.to_vec()) {
            match happening {
                Happening::Calibrated(run, made) => {
                    assert!(made.is_ok(), "{made:?}");
                    assert!(run.samples()["gyroscope"].t_s.len() > 100);
                    calibrated = true;
                    live.start_experiment(60.0, "turn and return").unwrap();
                }
                Happening::Experimented(done) => experiment = Some(done),
                other => panic!("{other:?}"),
            }
        }
    }
    assert!(calibrated && experiment.is_none());
    let Some(Happening::Experimented(done)) = live.stop() else {
        panic!("no experiment to stop");
    };
    assert!(
        (done.duration_s() - 18.0).abs() < 0.3,
        "{}",
        done.duration_s()
    );
    assert!(
        error_deg(&live, "mekf") < 0.5,
        "{}",
        error_deg(&live, "mekf")
    );
    assert!(error_deg(&live, "integration") < 2.0);
    let frame = live.frame("phone");
    assert!(
        frame.between_deg.contains_key("mekf|integration"),
        "{:?}",
        frame.between_deg
    );
    assert_eq!(frame.lamp.len(), 2);
    assert!(
        live.frame("phone").innovations.is_empty(),
        "each innovation is told once"
    );
}

#[test]
fn a_calibration_in_motion_is_refused_with_a_reason() {
    let mut live = session();
    let events: Vec<Event> = phone(1).events().collect();
    live.calibrate(5.0).unwrap();
    let moving = events.iter().filter(|e| e.time_ns > 9_000_000_000);
    let happenings = live.take(&mut moving.copied().collect::<Vec<_>>());
    let Some(Happening::Calibrated(_, Err(reason))) = happenings.first() else {
        panic!("{happenings:?}");
    };
    assert!(!reason.is_empty());
    assert!(live.options().calibration.is_none());
    assert!(live.calibrate(0.0).is_err() && live.calibrate(f64::NAN).is_err());
}

#[test]
fn parameters_change_without_a_jump_and_mistakes_change_nothing() {
    let mut live = session();
    live.take(&mut phone(2).events().take(4000).collect::<Vec<_>>());
    let before = live.attitude("mekf").unwrap();
    let settings = json!({"accelerometer_std": 0.3, "magnetometer_use": "heading"});
    live.set(None, settings.as_object().unwrap()).unwrap();
    assert_eq!(live.attitude("mekf").unwrap(), before);
    assert!((live.config().attitude.accelerometer_std - 0.3).abs() < 1e-12);
    let wrong = json!({"accelerometer_std": 0.5, "gyro": 1.0});
    let error = live.set(None, wrong.as_object().unwrap()).unwrap_err();
    assert!(
        error.to_string().contains("unknown parameter `gyro`"),
        "{error}"
    );
    assert!((live.config().attitude.accelerometer_std - 0.3).abs() < 1e-12);
    live.use_estimators(&[EstimatorKind::Mekf, EstimatorKind::Usque])
        .unwrap();
    assert_eq!(live.attitude("mekf").unwrap(), before);
    assert_eq!(
        live.estimators(),
        [EstimatorKind::Mekf, EstimatorKind::Usque]
    );
}

#[test]
fn a_clock_that_goes_back_and_a_long_pause_start_anew_and_say_so() {
    let mut live = session();
    let events: Vec<Event> = phone(2).events().take(2000).collect();
    let shifted = |by_s: i64| -> Vec<Event> {
        let shift = |e: &Event| Event {
            time_ns: e.time_ns + by_s * 1_000_000_000,
            ..*e
        };
        events.iter().map(shift).collect()
    };
    assert!(live.take(&mut shifted(100)).is_empty());
    let pause = live.take(&mut shifted(200));
    assert!(matches!(&pause[..], [Happening::Note(n)] if n.text.contains("time stamps leap")));
    let back = live.take(&mut shifted(0));
    assert!(
        matches!(&back[..], [Happening::Note(n)] if n.text.contains("clock went back")),
        "{back:?}"
    );
    assert!(live.attitude("mekf").is_some());
}

#[test]
fn health_says_what_is_missing() {
    let mut live = session();
    let only_gyroscope = phone(1)
        .events()
        .take(3000)
        .filter(|e| e.sample.kind() == SensorKind::Gyroscope);
    live.take(&mut only_gyroscope.collect::<Vec<_>>());
    let status = live.status(0);
    let words: String = status.health.iter().map(|r| r.text.as_str()).collect();
    assert!(
        words.contains("No accelerometer") && words.contains("No magnetometer"),
        "{words}"
    );
}

/// Stamps that are times of arrival vary, or come in bunches; those of a sensor do neither.
#[test]
fn intervals_that_vary_are_told_while_they_do() {
    let heard = |stamp_ns: &dyn Fn(i64) -> i64| {
        let mut live = session();
        let mut events: Vec<Event> = phone(1).events().take(3000).filter(is_rate).collect();
        let start = events[0].time_ns;
        for (k, event) in (0..).zip(&mut events) {
            event.time_ns = start + stamp_ns(k);
        }
        live.take(&mut events);
        let told = live.status(0).health.into_iter().map(|r| r.text);
        told.collect::<Vec<_>>().join(" ")
    };
    let regular = heard(&|k| k * 10_000_000);
    let varying = heard(&|k| k * 10_000_000 + (k * 7919 % 13) * 500_000);
    let bunched = heard(&|k| (k / 4) * 40_000_000 + (k % 4) * 100_000);
    assert!(
        !regular.contains("interval") && !regular.contains("bunches"),
        "{regular}"
    );
    assert!(
        varying.contains("intervals between gyroscope samples vary"),
        "{varying}"
    );
    assert!(bunched.contains("come in bunches"), "{bunched}");
}

/// Whatever came before: an experiment's result is what was live when it ended, to the bit.
#[test]
fn the_result_of_an_experiment_is_the_live_estimate() {
    for calibrated in [false, true] {
        let mut live = session();
        live.use_estimators(&EstimatorKind::ALL).unwrap();
        if calibrated {
            live.calibrate(5.0).unwrap();
        }
        let events: Vec<Event> = phone(4).events().collect();
        let cut = |s: f64| events.partition_point(|e| (e.time_ns as f64) < s * 1e9);
        live.take(&mut events[..cut(7.0)].to_vec());
        live.start_experiment(60.0, "").unwrap();
        live.take(&mut events[cut(7.0)..cut(18.0)].to_vec());
        let Some(Happening::Experimented(done)) = live.stop() else {
            panic!("no experiment to stop");
        };
        for kind in live.estimators() {
            let mut last = LastEstimate(None);
            run_over(&done, live.options(), kind, &mut last).unwrap();
            let now = live.attitude(kind.name());
            // The run tells its estimates with gyroscope samples, the last of which is not the end.
            let off = last.0.unwrap().angle_to(&now.unwrap());
            assert!(off < 1e-3, "{}: {off} rad", kind.name());
        }
        // Up to and including a gyroscope sample: nothing at all differs.
        let last_rate = done.events.iter().rposition(is_rate).unwrap();
        let mut until = *done;
        until.events.truncate(last_rate + 1);
        let mut last = LastEstimate(None);
        run_over(&until, live.options(), EstimatorKind::Mekf, &mut last).unwrap();
        let mut again = session();
        again.use_estimators(&[EstimatorKind::Mekf]).unwrap();
        if calibrated {
            again.calibrate(5.0).unwrap();
        }
        again.take(&mut events[..cut(7.0)].to_vec());
        again.start_experiment(60.0, "").unwrap();
        let end = until.events.last().unwrap().time_ns;
        let is_of_it = |e: &&Event| {
            e.time_ns < end || (e.time_ns == end && e.sample.kind() == SensorKind::Gyroscope)
        };
        let rest = events[cut(7.0)..].iter().filter(is_of_it);
        again.take(&mut rest.copied().collect::<Vec<_>>());
        assert_eq!(last.0, again.attitude("mekf"), "calibrated: {calibrated}");
    }
}

fn is_rate(event: &Event) -> bool {
    event.sample.kind() == SensorKind::Gyroscope
}

#[test]
fn changes_during_an_experiment_are_remembered() {
    let mut live = session();
    let events: Vec<Event> = phone(2).events().take(3000).collect();
    live.take(&mut events[..1000].to_vec());
    live.start_experiment(60.0, "").unwrap();
    live.take(&mut events[1000..2000].to_vec());
    let settings = json!({"accelerometer_std": 0.3});
    live.set(None, settings.as_object().unwrap()).unwrap();
    assert!(
        live.calibrate(5.0).is_err(),
        "it would change the estimates"
    );
    assert!(
        live.calibrate_magnetometer(MagnetometerAction::Start)
            .is_err()
    );
    let Some(Happening::Experimented(done)) = live.stop() else {
        panic!("no experiment to stop");
    };
    assert_eq!(done.changed, ["Q, R or another parameter"]);
    assert_eq!(done.starts.len(), 2);
}

/// A magnetised phone turned all over: the calibration brings the field back to its true length,
/// at once and for everything that comes after; discarding it undoes that.
#[test]
fn a_magnetometer_calibration_is_applied_from_then_on() {
    let hard_iron = Vector3::new(25.0, -14.0, 30.0);
    let mut config = VirtualPhoneConfig {
        motion: Motion::Tumble,
        duration_s: Some(150.0),
        ..VirtualPhoneConfig::default()
    };
    config.magnetometer.bias_ut = hard_iron.into();
    let phone = VirtualPhone::new(config).unwrap();
    let events: Vec<Event> = phone.events().collect();
    let cut = |s: f64| events.partition_point(|e| (e.time_ns as f64) < s * 1e9);
    let mut live = session();
    live.calibrate(6.0).unwrap();
    live.take(&mut events[..cut(8.0)].to_vec());
    assert!(
        live.calibrate_magnetometer(MagnetometerAction::Finish)
            .is_err()
    );
    live.calibrate_magnetometer(MagnetometerAction::Start)
        .unwrap();
    live.take(&mut events[cut(8.0)..cut(14.0)].to_vec());
    let early = live
        .calibrate_magnetometer(MagnetometerAction::Finish)
        .unwrap_err();
    assert!(early.contains("more"), "{early}");
    live.take(&mut events[cut(14.0)..cut(72.0)].to_vec());
    live.calibrate_magnetometer(MagnetometerAction::Finish)
        .unwrap();
    let found = live.magnetometer().unwrap().hard_iron();
    assert!((found - hard_iron).norm() < 0.5, "{found}");
    // The rest follows: its field is as strong as the true one.
    let rest = live
        .options()
        .calibration
        .unwrap()
        .magnetic_field_ut()
        .unwrap();
    assert!(
        (rest - phone.magnetic_field_world_ut()).norm() < 1.0,
        "{rest}"
    );
    live.start_experiment(60.0, "").unwrap();
    live.take(&mut events[cut(72.0)..cut(80.0)].to_vec());
    let Some(Happening::Experimented(done)) = live.stop() else {
        panic!("no experiment to stop");
    };
    let lengths = done.events.iter().filter_map(|e| match e.sample {
        Sample::MagneticField(field) => Some(field.norm()),
        _ => None,
    });
    assert!(lengths.clone().count() > 300);
    assert!(
        lengths
            .into_iter()
            .all(|length| (length - 43.0).abs() < 4.0)
    );
    assert!(
        error_deg(&live, "mekf") < 2.0,
        "{}",
        error_deg(&live, "mekf")
    );
    live.calibrate_magnetometer(MagnetometerAction::Discard)
        .unwrap();
    let rest = live
        .options()
        .calibration
        .unwrap()
        .magnetic_field_ut()
        .unwrap();
    assert!((rest - phone.magnetic_field_world_ut() - hard_iron).norm() < 1.0);
    assert!(
        live.calibrate_magnetometer(MagnetometerAction::Discard)
            .is_err()
    );
}

fn at(time_ms: i64, sample: Sample) -> Event {
    Event {
        time_ns: time_ms * 1_000_000,
        sample,
    }
}

/// Gyroscope and accelerometer of a turn about the vertical of 0.1 rad/s, 100 Hz.
fn turning(ms: impl Iterator<Item = i64>) -> Vec<Event> {
    ms.step_by(10)
        .flat_map(|ms| {
            [
                at(ms, Sample::AngularRate(Vector3::new(0.0, 0.0, 0.1))),
                at(ms, Sample::SpecificForce(Vector3::new(0.0, 0.0, 9.81))),
            ]
        })
        .collect()
}

#[test]
fn one_stamp_from_the_future_neither_ends_an_experiment_nor_stops_the_estimate() {
    let run = |wrong: &[Event]| {
        let mut live = session();
        live.take(&mut turning(0..5000));
        live.start_experiment(60.0, "turn").unwrap();
        let happenings = live.take(&mut wrong.to_vec());
        assert!(happenings.is_empty(), "{happenings:?}");
        let notes = live.take(&mut turning(5000..12_000));
        assert!(live.experiment().is_some(), "{notes:?}");
        let clock_went_back =
            |h: &Happening| matches!(h, Happening::Note(n) if n.text.contains("went back"));
        assert!(!notes.iter().any(clock_went_back), "{notes:?}");
        (
            live.attitude("mekf").unwrap(),
            live.duration_s(),
            notes.len(),
        )
    };
    let (undisturbed, duration_s, notes) = run(&[]);
    assert_eq!(notes, 0);
    for wrong_ms in [602_000, 1] {
        let wrong = at(wrong_ms, Sample::AngularRate(Vector3::new(0.0, 0.0, 0.1)));
        let (attitude, seconds, _) = run(&[wrong]);
        assert_eq!(attitude, undisturbed, "stamp {wrong_ms} ms");
        assert!((seconds - duration_s).abs() < 1e-9, "{seconds}");
    }
}

#[test]
fn a_phone_at_rest_whose_browser_rounds_is_calibrated_and_told_so() {
    let rest = |gyroscope: f64, gravity: f64| {
        let mut live = session();
        live.read_by_browser(true);
        live.calibrate(5.0).unwrap();
        let events = (0..6000).step_by(16).flat_map(|ms| {
            [
                at(
                    ms,
                    Sample::AngularRate(Vector3::new(0.0, 0.0, gyroscope.to_radians())),
                ),
                at(ms, Sample::SpecificForce(Vector3::new(0.0, 0.1, gravity))),
            ]
        });
        let mut happenings = live.take(&mut events.collect::<Vec<_>>());
        let Some(Happening::Calibrated(run, made)) = happenings.pop() else {
            panic!("{happenings:?}");
        };
        made.map(|made| {
            (
                run.accepted(&made),
                live.config().attitude.accelerometer_std,
            )
        })
    };
    for gyroscope in [0.0, 0.1] {
        let (verdict, accelerometer_std) = rest(gyroscope, 9.8).unwrap();
        let text = &verdict.text;
        assert!(text.contains("known to 0.0289 deg/s"), "{text}");
        assert!(
            text.contains("rounds to 0.1 deg/s")
                && text.contains("tilt at the start is known to 0.2 deg"),
            "{text}"
        );
        assert!((accelerometer_std - 0.1 / 12_f64.sqrt()).abs() < 1e-9);
    }
    assert!(rest(0.0, 0.0).unwrap_err().contains("accelerometer"));
}

/// Live and in the stored experiment the filter expects the same hard iron; the page is told what it finds.
#[test]
fn hard_iron_is_expected_as_the_stream_says_live_and_stored() {
    let mut events: Vec<Event> = phone(4).events().collect();
    let prior = |live: &DeviceSession| {
        let bounded = live.options().config.bounded_velocity;
        bounded.initial_hard_iron_std_ut
    };
    let shown = |live: &DeviceSession| {
        let estimates = live.estimates();
        estimates["bounded-velocity"].surroundings.clone().unwrap()
    };
    let mut live = session();
    live.use_estimators(&[EstimatorKind::BoundedVelocity])
        .unwrap();
    live.take(&mut events[..1500].to_vec());
    assert!(prior(&live) <= 0.0 && shown(&live).hard_iron_ut.is_none());
    assert!(shown(&live).is_resting);
    let near_one = shown(&live).field_variance_factor.unwrap();
    assert!((1.0..2.0).contains(&near_one), "{near_one}");
    // A phone whose system calibrates has the uncalibrated stream, too.
    let beside = events.iter().filter_map(|event| match event.sample {
        Sample::MagneticField(field) => Some(Event {
            sample: Sample::MagneticFieldUncalibrated(field.add_scalar(200.0)),
            ..*event
        }),
        _ => None,
    });
    let beside: Vec<Event> = beside.collect();
    events.extend(beside);
    events.sort_by_key(|event| (event.time_ns, event.sample.kind().order()));
    let cut = |s: f64| events.partition_point(|e| (e.time_ns as f64) < s * 1e9);
    let mut live = session();
    live.use_estimators(&[EstimatorKind::BoundedVelocity])
        .unwrap();
    live.take(&mut events[..cut(7.0)].to_vec());
    assert!((prior(&live) - 3.0).abs() < 1e-12);
    assert!(shown(&live).hard_iron_std_ut.unwrap()[0] > 0.1);
    live.start_experiment(60.0, "").unwrap();
    live.take(&mut events[cut(7.0)..cut(18.0)].to_vec());
    let now = live.attitude("bounded-velocity").unwrap();
    let Some(Happening::Experimented(done)) = live.stop() else {
        panic!("no experiment to stop");
    };
    let mut last = LastEstimate(None);
    let kind = EstimatorKind::BoundedVelocity;
    let summary = run_over(&done, live.options(), kind, &mut last).unwrap();
    assert!((summary.hard_iron_prior_ut.unwrap() - 3.0).abs() < 1e-12);
    assert!(last.0.unwrap().angle_to(&now) < 1e-3);
    // What the user sets stays.
    let settings = json!({"bounded_initial_hard_iron_std_ut": 5.0});
    live.set(None, settings.as_object().unwrap()).unwrap();
    live.take(&mut events[cut(18.0)..].to_vec());
    assert!((prior(&live) - 5.0).abs() < 1e-12);
}
