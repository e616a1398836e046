//! The subject of a device: whatever is judged, is judged of it; and sensors that do not deliver.

use super::aids::Delivery;
use super::*;
use crate::experiments::Finished;
use northing_evaluation::statistics::lamp::Lamp;
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use serde_json::json;

const MEKF3: EstimatorKind = EstimatorKind::Mekf3;

/// A virtual phone whose gyroscope has an offset about its vertical axis, deg/s; 8 s of rest, 12 of motion.
fn phone(bias_deg_s: f64) -> Vec<Event> {
    let mut config = VirtualPhoneConfig {
        seed: 3,
        rest_before_s: 8.0,
        motion_s: 12.0,
        rest_after_s: 4.0,
        ..VirtualPhoneConfig::default()
    };
    config.gyroscope.bias_rad_s = [0.0, 0.0, bias_deg_s.to_radians()];
    config.gyroscope.bias_std_rad_s = 0.0;
    VirtualPhone::new(config).unwrap().events().collect()
}

/// The same without magnetometer, with a compass.
fn compass_phone() -> Vec<Event> {
    let mut config = VirtualPhoneConfig {
        duration_s: Some(20.0),
        ..VirtualPhoneConfig::default()
    };
    config.compass.sampling.rate_hz = 10.0;
    config.magnetometer.sampling.rate_hz = 0.0;
    VirtualPhone::new(config).unwrap().events().collect()
}

fn session(kinds: &[EstimatorKind]) -> DeviceSession {
    let mut live = DeviceSession::new(RunOptions::new(EstimatorKind::Mekf, Profile::Lab)).unwrap();
    live.use_estimators(kinds).unwrap();
    live
}

fn cut(events: &[Event], s: f64) -> usize {
    events.partition_point(|e| (e.time_ns as f64) < s * 1e9)
}

fn lamp(live: &mut DeviceSession, sensor: SensorKind) -> Option<Lamp> {
    live.frame("d")
        .lamp
        .into_iter()
        .find(|l| l.sensor == sensor)
}

/// GIVEN a phone in motion WHEN its gyroscope freezes THEN no lamp is green, the lamps say why, and so does a note; and
/// they are as before once it goes on.
#[test]
fn no_lamp_is_green_while_the_gyroscope_repeats_itself() {
    let mut live = session(&[EstimatorKind::Mekf]);
    let mut events = phone(0.0);
    let (from, to) = (cut(&events, 12.0), cut(&events, 14.0));
    let mut frozen = None;
    for event in &mut events[from..to] {
        if let Sample::AngularRate(rate) = &mut event.sample {
            *rate = *frozen.get_or_insert(*rate);
        }
    }
    live.take(&mut events[..from].to_vec());
    let happenings = live.take(&mut events[from..cut(&events, 13.0)].to_vec());
    let told = serde_json::to_string(
        &happenings
            .iter()
            .filter_map(|h| match h {
                Happening::Note(remark) => Some(&remark.text),
                _ => None,
            })
            .collect::<Vec<_>>(),
    )
    .unwrap();
    assert!(
        told.contains("gyroscope repeats the same numbers"),
        "{told}"
    );
    for lamp in live.frame("d").lamp {
        assert!(lamp.tone != Tone::Good, "{lamp:?}");
        if lamp.tone == Tone::Bad {
            assert!(lamp.text.contains("repeats the same numbers"), "{lamp:?}");
        }
    }
    let force = lamp(&mut live, SensorKind::Accelerometer).unwrap();
    assert_eq!(force.tone, Tone::Bad);
    let happenings = live.take(&mut events[cut(&events, 13.0)..cut(&events, 15.0)].to_vec());
    let force = lamp(&mut live, SensorKind::Accelerometer).unwrap();
    assert!(!force.text.contains("repeats"), "{force:?}");
    let over =
        |h: &Happening| matches!(h, Happening::Over(text) if text.contains("gyroscope repeats"));
    assert!(
        happenings.iter().any(over),
        "what is not true any more is withdrawn"
    );
}

#[test]
fn lamps_innovations_and_angles_are_those_of_the_only_estimator_that_runs() {
    let mut live = session(&[MEKF3]);
    let events = phone(0.0);
    live.take(&mut events[..cut(&events, 10.0)].to_vec());
    assert_eq!(live.subject(), Some(MEKF3));
    let first = live.frame("d");
    assert_eq!(first.subject, Some(MEKF3));
    assert!(first.innovations.len() > 500, "{}", first.innovations.len());
    let judged = |l: &Lamp| l.nis_mean.is_some() && l.nis_expected == Some(3);
    assert_eq!(first.lamp.iter().filter(|l| judged(l)).count(), 2);
    assert!(first.between_deg.contains_key("mekf3|truth"));
    live.take(&mut events[cut(&events, 10.0)..].to_vec());
    let second = live.frame("d");
    assert!(!second.innovations.is_empty());
    assert_ne!(first.lamp, second.lamp, "lamps go on");
}

#[test]
fn another_subject_or_other_estimators_begin_with_empty_lamps() {
    let mut live = session(&[EstimatorKind::Mekf, MEKF3, EstimatorKind::Integration]);
    let events = phone(0.0);
    live.take(&mut events[..2000].to_vec());
    assert_eq!(live.subject(), Some(EstimatorKind::Mekf));
    assert!(live.frame("d").lamp.iter().all(|l| l.nis_mean.is_some()));
    live.take(&mut events[2000..2100].to_vec());
    live.use_subject(MEKF3).unwrap();
    let frame = live.frame("d");
    assert!(
        frame.lamp.iter().all(|l| l.tone == Tone::Idle),
        "{:?}",
        frame.lamp
    );
    assert!(frame.innovations.is_empty(), "those were of the other one");
    live.take(&mut events[2100..3000].to_vec());
    let frame = live.frame("d");
    assert!(frame.lamp.iter().all(|l| l.nis_mean.is_some()));
    let keys: Vec<&String> = frame.between_deg.keys().collect();
    assert!(frame.between_deg.contains_key("mekf3|mekf"), "{keys:?}");
    live.use_estimators(&[MEKF3, EstimatorKind::Usque]).unwrap();
    assert!(live.frame("d").lamp.iter().all(|l| l.nis_mean.is_none()));
    assert_eq!(live.subject(), Some(MEKF3), "it still runs");
    let refused = live.use_subject(EstimatorKind::Mekf).unwrap_err();
    assert!(refused.contains("`mekf` does not run"), "{refused}");
    live.use_estimators(&[EstimatorKind::Mekf]).unwrap();
    live.use_estimators(&[EstimatorKind::Mekf, MEKF3]).unwrap();
    assert_eq!(
        live.subject(),
        Some(EstimatorKind::Mekf),
        "a choice ends with what was chosen"
    );
}

/// The paper's filter takes the bias for a constant that was calibrated: with another one and without
/// magnetometer it turns away from the truth while its innovations stay as they should be.
#[test]
fn no_lamp_is_green_while_the_known_truth_is_far_outside_what_is_stated() {
    let mut live = session(&[MEKF3]);
    let aligned = phone(0.0);
    let start = cut(&aligned, 3.5);
    live.take(&mut aligned[..start].to_vec());
    let lamps = live.frame("d").lamp;
    assert!(lamps.iter().any(|l| l.tone == Tone::Good), "{lamps:?}");
    // It has aligned itself by the field, which is switched off; then the bias appears, and the phone rests on.
    live.use_sensors("gyro,acc".parse().unwrap());
    let biased = phone(8.0);
    let (mut far, mut explained) = (0, 0);
    for batch in biased[start..cut(&biased, 8.0)].chunks(50) {
        live.take(&mut batch.to_vec());
        let frame = live.frame("d");
        let error = frame.truth.unwrap().error.unwrap();
        if error.sigmas.unwrap() < 5.0 {
            continue;
        }
        far += 1;
        assert_eq!(error.tone, Tone::Bad);
        let green = frame.lamp.iter().find(|l| l.tone == Tone::Good);
        assert_eq!(green, None, "{error:?}");
        let accelerometer = &frame.lamp[0];
        let consistent = accelerometer.text.contains("R is consistent");
        explained += usize::from(consistent && accelerometer.text.starts_with(&error.text));
    }
    assert!(far > 10 && explained > 10, "{explained} of {far} frames");
    let error = live.frame("d").truth.unwrap().error.unwrap();
    assert!(error.angle_deg > 30.0, "{error:?}");
    let words = format!("{:.0} deg from the truth, ", error.angle_deg);
    let text = &error.text;
    assert!(
        text.starts_with(&words) && text.ends_with(" sigma."),
        "{text}"
    );
}

/// Consistent filters are found consistent: the same phone, calibrated, with the filter that has the bias.
#[test]
fn a_consistent_filter_is_within_five_sigma_of_the_truth() {
    let mut live = session(&[EstimatorKind::Mekf]);
    live.calibrate(6.0).unwrap();
    let events = phone(2.0);
    let (mut seen, mut far) = (0, 0);
    for batch in events.chunks(50) {
        live.take(&mut batch.to_vec());
        if live.options().calibration.is_none() {
            continue;
        }
        if let Some(error) = live.frame("d").truth.and_then(|truth| truth.error) {
            seen += 1;
            far += usize::from(error.sigmas.unwrap() > 5.0);
        }
    }
    assert!(seen > 100 && far == 0, "{far} of {seen} outside 5 sigma");
}

#[test]
fn without_a_covariance_there_is_nothing_to_judge() {
    for kind in [EstimatorKind::Integration, EstimatorKind::Complementary] {
        let mut live = session(&[kind]);
        live.take(&mut phone(0.0));
        assert_eq!(live.subject(), Some(kind));
        let frame = live.frame("d");
        assert_eq!(frame.lamp.len(), 2);
        for lamp in &frame.lamp {
            assert_eq!((lamp.tone, lamp.nis_mean), (Tone::Idle, None));
            assert_eq!(lamp.text, "No covariance: nothing to judge.");
        }
        let error = frame.truth.unwrap().error.unwrap();
        assert_eq!((error.tone, error.sigmas), (Tone::Idle, None));
    }
}

#[test]
fn result_row_what_if_and_curve_are_about_the_subject() {
    let kinds = [EstimatorKind::Integration, EstimatorKind::Mekf, MEKF3];
    let events = phone(1.0);
    let finished = |subject| {
        let mut live = session(&kinds);
        live.take(&mut events[..1000].to_vec());
        live.use_subject(subject).unwrap();
        live.start_experiment(60.0, "Swing").unwrap();
        live.take(&mut events[1000..].to_vec());
        let Some(Happening::Experimented(experiment)) = live.stop() else {
            panic!("no experiment");
        };
        let finished = Finished {
            id: "e1".to_owned(),
            device: "d".to_owned(),
            device_name: "Phone".to_owned(),
            at: String::new(),
            experiment: *experiment,
            options: live.options().clone(),
            estimators: live.estimators(),
            subject: live.subject().unwrap(),
            summaries: Default::default(),
            hash: String::new(),
            originals: Default::default(),
        };
        finished.evaluated().unwrap()
    };
    let (mekf, paper) = (finished(EstimatorKind::Mekf), finished(MEKF3));
    assert_eq!(paper.row().subject, MEKF3.name());
    let of = |made: &Finished| {
        let asked = made
            .what_if(&crate::messages::Change::default(), json!(1))
            .unwrap();
        let curve = made.curve(
            &crate::messages::Change::default(),
            "accelerometer_std",
            &|| true,
        );
        (asked.subject, asked.trace, curve.unwrap().unwrap())
    };
    let (paper_of, mekf_of) = (of(&paper), of(&mekf));
    assert_eq!((paper_of.0, mekf_of.0), (MEKF3, EstimatorKind::Mekf));
    assert_ne!(paper_of.1.angles_deg, mekf_of.1.angles_deg);
    assert_ne!(paper_of.2.nis, mekf_of.2.nis);
    let sensors: Vec<_> = paper_of.2.nis.keys().copied().collect();
    assert_eq!(sensors, ["accelerometer", "magnetometer"]);
    let report = |made: &Finished| {
        let file = crate::export::export(made, "report.html").unwrap().unwrap();
        String::from_utf8(file.bytes).unwrap()
    };
    let (paper_page, mekf_page) = (report(&paper), report(&mekf));
    assert!(
        paper_page.contains("calculated error of mekf<")
            || paper_page.contains("calculated error of mekf\n")
    );
    assert!(mekf_page.contains("calculated error of mekf3"));
}

#[test]
fn an_experiment_is_not_called_one_twice() {
    for (name, title) in [
        ("Experiment 1", "Experiment 1"),
        ("Rest, 10 min", "Rest, 10 min"),
        ("", "Experiment e7"),
    ] {
        let mut live = session(&[EstimatorKind::Mekf]);
        let events = phone(0.0);
        live.take(&mut events[..1000].to_vec());
        live.start_experiment(60.0, name).unwrap();
        live.take(&mut events[1000..3000].to_vec());
        let Some(Happening::Experimented(experiment)) = live.stop() else {
            panic!("no experiment");
        };
        let finished = Finished {
            id: "e7".to_owned(),
            device: "d".to_owned(),
            device_name: "Phone".to_owned(),
            at: String::new(),
            experiment: *experiment,
            options: live.options().clone(),
            estimators: live.estimators(),
            subject: EstimatorKind::Mekf,
            summaries: Default::default(),
            hash: String::new(),
            originals: Default::default(),
        };
        let file = crate::export::export(&finished.evaluated().unwrap(), "report.html");
        let page = String::from_utf8(file.unwrap().unwrap().bytes).unwrap();
        assert!(page.contains(&format!("<h1>{title}</h1>")), "{title}");
        assert!(!page.contains("Experiment Experiment"));
    }
}

#[test]
fn a_sensor_that_stops_greys_its_lamp_and_says_since_when() {
    let mut live = session(&[EstimatorKind::Mekf]);
    let events = phone(0.0);
    let stops =
        |e: &&Event| e.sample.kind() != SensorKind::Magnetometer || e.time_ns < 8_000_000_000;
    live.take(&mut events.iter().filter(stops).copied().collect::<Vec<_>>());
    let magnetometer = lamp(&mut live, SensorKind::Magnetometer).unwrap();
    assert_eq!(
        (magnetometer.tone, magnetometer.nis_mean),
        (Tone::Idle, None)
    );
    assert_eq!(magnetometer.text, "No sample for 16 s: nothing to judge.");
    let accelerometer = lamp(&mut live, SensorKind::Accelerometer).unwrap();
    assert_ne!(accelerometer.tone, Tone::Idle);
    let sensors = live.status(0).sensors;
    let delivery = |kind| sensors.iter().find(|s| s.sensor == kind).unwrap().delivery;
    assert_eq!(delivery(SensorKind::Magnetometer), Delivery::Stopped);
    assert_eq!(delivery(SensorKind::Gyroscope), Delivery::Delivers);
}

#[test]
fn a_compass_that_stands_in_for_the_magnetometer_has_lamp_innovations_and_switch() {
    let mut live = session(&[EstimatorKind::Mekf]);
    live.take(&mut compass_phone());
    let frame = live.frame("d");
    let lamps: Vec<_> = frame.lamp.iter().map(|l| l.sensor).collect();
    assert_eq!(
        lamps,
        [SensorKind::Accelerometer, SensorKind::CompassHeading]
    );
    assert!(frame.lamp[1].nis_mean.is_some() && frame.lamp[1].nis_expected == Some(1));
    assert!(
        frame
            .innovations
            .iter()
            .any(|i| i.sensor == SensorKind::CompassHeading)
    );
    let sensor = |live: &DeviceSession, kind| {
        let sensors = live.status(0).sensors;
        sensors.into_iter().find(|s| s.sensor == kind).unwrap()
    };
    let magnetometer = sensor(&live, SensorKind::Magnetometer);
    assert_eq!(magnetometer.delivery, Delivery::Missing);
    assert!(
        magnetometer.text.contains("sends no samples"),
        "{}",
        magnetometer.text
    );
    assert!(sensor(&live, SensorKind::CompassHeading).is_used);
    let off = crate::messages::SensorUse {
        gyroscope: true,
        accelerometer: true,
        magnetometer: true,
        compass: Some(false),
    };
    live.use_sensors(off.selection().unwrap());
    assert!(!sensor(&live, SensorKind::CompassHeading).is_used);
    let health = serde_json::to_string(&live.status(0).health).unwrap();
    assert!(health.contains("compass is switched off"), "{health}");
    let grey = lamp(&mut live, SensorKind::CompassHeading).unwrap();
    assert_eq!(
        (grey.tone, grey.text.as_str()),
        (Tone::Idle, "Switched off: nothing to judge.")
    );
}

#[test]
fn a_device_without_a_sample_has_no_health_but_that() {
    let live = session(&[EstimatorKind::Mekf]);
    let health = live.status(0).health;
    assert_eq!(health.len(), 1, "{health:?}");
    assert!(health[0].tone == Tone::Bad && health[0].text.starts_with("Nothing received"));
    let refused = live.has_samples().unwrap_err();
    assert!(
        refused.contains("no gyroscope sample") && refused.contains("Unlock"),
        "{refused}"
    );
}

/// Rounded as browsers round, and calibrated: values that repeat say nothing of the noise below their step, and
/// nobody is told to make R smaller.
#[test]
fn rounding_makes_no_lamp_amber() {
    let mut judged = 0;
    for seed in 0..8 {
        let mut config = VirtualPhoneConfig {
            seed,
            rest_before_s: 30.0,
            duration_s: Some(28.0),
            ..VirtualPhoneConfig::default()
        };
        // One axis on the edge between two steps: its value is one of two, the others' always the same.
        config.accelerometer.bias_m_s2 = [0.05, 0.0, 0.0];
        config.accelerometer.noise_std_m_s2 = 0.015;
        config.accelerometer.resolution_m_s2 = 0.1;
        let phone = VirtualPhone::new(config).unwrap();
        // Its truth would have a say: such an edge is a tilt that no calibration knows.
        let is_measured = |e: &Event| e.sample.kind() != SensorKind::Reference;
        let events = phone.events().filter(is_measured);
        let mut live = session(&[EstimatorKind::Mekf]);
        live.read_by_browser(true);
        live.calibrate(6.0).unwrap();
        for batch in events.collect::<Vec<_>>().chunks(500) {
            live.take(&mut batch.to_vec());
            let Some(lamp) = lamp(&mut live, SensorKind::Accelerometer) else {
                continue;
            };
            if lamp.nis_mean.is_some() && live.options().calibration.is_some() {
                judged += 1;
                let is_amber = matches!(lamp.tone, Tone::Warn | Tone::Bad);
                assert!(!is_amber, "seed {seed}: {lamp:?}");
            }
        }
        assert!(live.options().calibration.is_some());
    }
    assert!(judged > 5, "{judged} lamps: the case itself");
}
