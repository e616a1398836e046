//! What outlives the lab: killed and started again, it has names, settings, calibrations and experiments; a session as one file.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use crate::support;

use std::path::Path;

use northing_evaluation::{EstimatorKind, RunOptions};
use northing_live::lab::Lab;
use northing_live::messages::{Change, Command, SensorUse};
use northing_live::replay::{Speed, play};
use northing_recording::{Event, OpenOptions, Sample, open};
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use serde_json::{Map, Value, json};
use support::{TestLab, batch, request, wait_for};

/// What a phone page sends of a virtual phone.
fn sensor_events(seconds: f64) -> Vec<Event> {
    let phone = VirtualPhone::new(VirtualPhoneConfig {
        seed: 3,
        duration_s: Some(seconds),
        rest_before_s: 4.0,
        ..VirtualPhoneConfig::default()
    });
    let sent = |event: &Event| {
        matches!(
            event.sample,
            Sample::AngularRate(_) | Sample::SpecificForce(_) | Sample::MagneticField(_)
        )
    };
    phone.unwrap().events().filter(sent).collect()
}

/// Uploads everything as `anna`, and does what `between` says before each batch.
fn upload(lab: &TestLab, session: &str, seconds: f64, mut between: impl FnMut(usize)) {
    let events = sensor_events(seconds);
    for (turn, chunk) in events.chunks(60).enumerate() {
        between(turn);
        let body = batch("anna", session, turn as u64, chunk);
        wait_for("room for a batch", || {
            (lab.upload(&body).status == 200).then_some(())
        });
    }
}

fn command(lab: &TestLab, command: Command) {
    let now = lab.running.lab.now_ns();
    let device = lab.running.lab.find("anna").unwrap();
    lab.runtime.block_on(device.command(command, now)).unwrap();
}

fn settings() -> Map<String, Value> {
    let settings = json!({"accelerometer_std": 0.123, "gyroscope_noise_density": 0.1 / 3.0});
    settings.as_object().unwrap().clone()
}

/// A calibration, settings, sensors, estimators, a name, and an experiment called `swing`.
fn work(lab: &TestLab) -> Value {
    upload(lab, "first", 10.0, |turn| match turn {
        2 => command(lab, Command::Calibrate(1.5)),
        14 => {
            let used = SensorUse {
                gyroscope: true,
                accelerometer: true,
                magnetometer: false,
                compass: Some(false),
            };
            let kinds = vec![
                EstimatorKind::Mekf,
                EstimatorKind::Usque,
                EstimatorKind::Mekf3,
            ];
            command(lab, Command::Settings(None, settings()));
            command(lab, Command::Sensors(used.selection().unwrap()));
            command(lab, Command::Estimators(kinds));
            command(lab, Command::Subject(EstimatorKind::Usque));
            command(lab, Command::Rename("Anna's phone".to_owned()));
        }
        16 => command(lab, Command::Experiment(3.0, "swing".to_owned())),
        _ => {}
    });
    wait_for("the experiment", || {
        let row = lab.status()["experiments"][0].clone();
        row.is_object().then_some(row)
    })
}

/// Waits until everything is on the disk.
fn saved(lab: &TestLab) {
    let folder = lab.data.path().join("lab");
    let text = |path: &Path| std::fs::read_to_string(path).unwrap_or_default();
    wait_for("the files", || {
        let devices = std::fs::read_dir(folder.join("devices")).unwrap();
        let device = devices
            .flatten()
            .map(|file| file.path())
            // Not one that is being written.
            .filter(|path| path.extension().is_some_and(|e| e == "json"))
            .any(|path| text(&path).contains("Anna's phone"));
        let facts = folder.join("experiments/e1/experiment.json");
        (device && text(&facts).contains("swing")).then_some(())
    });
}

/// The folder as a program that was killed now would leave it: nothing is flushed, closed or told.
fn as_killed(lab: &TestLab) -> tempfile::TempDir {
    fn copy(from: &Path, to: &Path) {
        std::fs::create_dir_all(to).unwrap();
        for entry in std::fs::read_dir(from).unwrap().flatten() {
            let other = to.join(entry.file_name());
            match entry.file_type().unwrap().is_dir() {
                true => copy(&entry.path(), &other),
                false => drop(std::fs::copy(entry.path(), other).unwrap()),
            }
        }
    }
    let data = tempfile::tempdir().unwrap();
    copy(lab.data.path(), data.path());
    data
}

/// What must be the same at the next start.
fn remembered(device: &Value) -> Value {
    let of = [
        "name",
        "settings",
        "use",
        "rest",
        "calibrated",
        "estimators",
        "subject",
        "is_calibrated",
    ];
    of.iter()
        .map(|key| (key.to_string(), device[key].clone()))
        .collect::<Map<_, _>>()
        .into()
}

#[test]
fn a_lab_that_was_killed_has_everything_when_it_starts_again() {
    let lab = TestLab::start();
    let before = work(&lab);
    saved(&lab);
    let device = remembered(&lab.device("anna"));
    let lived = lab.running.lab.experiment("e1").unwrap();
    assert_eq!(
        (&before["is_earlier"], &before["has_samples"]),
        (&json!(false), &json!(true))
    );
    assert!(
        device["rest"]["gyroscope_bias_rad_s"][0].is_number(),
        "{device}"
    );

    let again = TestLab::start_with(as_killed(&lab));
    assert!(
        again.running.lab.notes.is_empty(),
        "{:?}",
        again.running.lab.notes
    );
    let row = again.status()["experiments"][0].clone();
    assert_eq!(
        (&row["is_earlier"], &row["has_samples"]),
        (&json!(true), &json!(true))
    );
    for key in [
        "id",
        "name",
        "device",
        "device_id",
        "at",
        "duration_s",
        "settings",
        "subject",
        "sensors",
        "results",
    ] {
        assert_eq!(row[key], before[key], "{key}");
    }
    // The phone comes back under its own name, and is what it was.
    assert_eq!(again.status()["devices"], json!([]));
    upload(&again, "second", 1.0, |_| {});
    assert_eq!(remembered(&again.device("anna")), device);
    assert_eq!(device["name"], "Anna's phone");
    assert_eq!(device["subject"], "usque");
    assert_eq!(device["settings"]["accelerometer_std"], 0.123);
    // Its samples run again: the same numbers to the bit, and files.
    let finished = again.running.lab.experiment("e1").unwrap();
    assert_eq!(finished.summaries, lived.summaries);
    assert!(finished.message() == lived.message());
    let same = finished.what_if(&Change::default(), Value::Null).unwrap();
    assert_eq!(same.results, lived.summaries);
    for file in ["report.html", "recording.csv"] {
        let path = format!("/api/experiments/e1/{file}");
        let (then, now) = (lab.get(&path), again.get(&path));
        assert_eq!((then.status, now.status), (200, 200));
        assert!(then.body == now.body, "{file}");
    }
    assert_eq!(again.status()["experiments"][0]["is_earlier"], true);

    // Without the samples the result stays, and the reason is told.
    let third = TestLab::start_with(as_killed(&lab));
    let samples = third.data.path().join("lab/experiments/e1/samples.bin");
    std::fs::remove_file(samples).unwrap();
    let row = third.status()["experiments"][0].clone();
    assert_eq!(
        (&row["has_samples"], &row["results"]),
        (&json!(false), &before["results"])
    );
    let refused = third.get("/api/experiments/e1/recording.csv");
    assert_eq!(refused.status, 404);
    assert!(
        refused.text().contains("not there any more"),
        "{}",
        refused.text()
    );

    // Broken off in the middle, on the folder itself.
    let TestLab {
        runtime,
        running,
        data,
    } = lab;
    drop((runtime, running));
    let fourth = TestLab::start_with(data);
    assert_eq!(
        fourth.status()["experiments"][0]["results"],
        before["results"]
    );
    fourth.running.lab.delete_experiment("e1").unwrap();
    assert_eq!(fourth.status()["experiments"], json!([]));
    assert!(!fourth.data.path().join("lab/experiments/e1").exists());
}

/// What a device begins with stands in the recording, so that a replay gives the same numbers.
#[test]
fn a_session_that_began_with_saved_settings_replays_to_the_bit() {
    let lab = TestLab::start();
    work(&lab);
    saved(&lab);
    let again = TestLab::start_with(as_killed(&lab));
    upload(&again, "second", 8.0, |turn| {
        if turn == 10 {
            command(&again, Command::Experiment(2.0, "later".to_owned()));
        }
    });
    let live = wait_for("the second experiment", || {
        again.running.lab.experiment("e2").ok()
    });
    again.runtime.block_on(again.running.stop());
    let file = again.running.lab.recording_status().file.unwrap();
    let file = again.data.path().join("recordings").join(file);
    let replayed = Lab::new(RunOptions::default());
    again
        .runtime
        .block_on(play(&replayed, &file, Speed::Max))
        .unwrap();
    let replayed = wait_for("the experiment again", || replayed.experiment("e1").ok());
    assert_eq!(replayed.summaries, live.summaries);
    assert_eq!(live.subject, EstimatorKind::Usque, "live");
    assert_eq!(
        (replayed.subject, &replayed.hash),
        (EstimatorKind::Usque, &live.hash)
    );
}

#[test]
fn a_session_is_one_file_that_northing_reads() {
    let lab = TestLab::start();
    work(&lab);
    saved(&lab);
    let again = TestLab::start_with(as_killed(&lab));
    upload(&again, "second", 8.0, |turn| {
        if turn == 10 {
            command(&again, Command::Experiment(2.0, "later".to_owned()));
        }
    });
    wait_for("the second experiment", || {
        again.running.lab.experiment("e2").ok()
    });
    let zip = again.get("/api/session.zip");
    assert_eq!(zip.status, 200);
    assert!(zip.head.contains("northing-session.zip"), "{}", zip.head);
    let path = again.data.path().join("session.zip");
    std::fs::write(&path, &zip.body).unwrap();
    for (wanted, id) in [("e1", "e1"), ("swing", "e1"), ("later", "e2")] {
        let options = OpenOptions {
            device: Some(wanted.to_owned()),
            ..OpenOptions::default()
        };
        let recording = open(&path, &options).unwrap();
        assert_eq!(recording.metadata().device.as_deref(), Some("Anna's phone"));
        let read: Vec<Event> = recording.map(|event| event.unwrap()).collect();
        let finished = again.running.lab.experiment(id).unwrap();
        assert!(read == finished.experiment.events, "{wanted}");
    }
    let foreign = request(
        &again.lab_host(),
        "GET",
        "/api/session.zip",
        &[("host", "evil.example")],
        b"",
    );
    assert_eq!(foreign.status, 403);
    let path = format!("/api/session.zip?{}", again.token());
    assert_eq!(
        request(&again.app_host(), "GET", &path, &[], b"").status,
        404
    );
}

/// Who asks for no recording leaves nothing behind.
#[test]
fn a_lab_that_records_nothing_saves_nothing() {
    let data = tempfile::tempdir().unwrap();
    let lab = TestLab::start_without_recording(data);
    work(&lab);
    lab.runtime.block_on(lab.running.stop());
    assert!(!lab.data.path().join("lab").exists());
}
