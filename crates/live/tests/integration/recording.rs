//! The recording: it replays a session to the bit, it is listed and handed out, and it can fail.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use crate::support;

use northing_evaluation::{EstimatorKind, Profile, RunOptions};
use northing_live::lab::Lab;
use northing_live::messages::Command;
use northing_live::replay::{Speed, play};
use northing_recording::{Event, OpenOptions, Sample, open};
use northing_simulation::virtual_phone::Motion;
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use serde_json::{Value, json};
use support::{TestLab, batch, request, wait_for};

/// What a phone page sends of a virtual phone.
fn sensor_events(seed: u64, seconds: f64, motion: Motion) -> Vec<Event> {
    let phone = VirtualPhone::new(VirtualPhoneConfig {
        seed,
        duration_s: Some(seconds),
        motion,
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

/// Uploads batches of two phones in turn, each pair of batches swapped and some sent twice, and does
/// what `between` says after each turn.
fn session(lab: &TestLab, seconds: f64, mut between: impl FnMut(usize)) {
    let phones = [("anna", 1), ("ben", 2)].map(|(name, seed)| {
        let events = sensor_events(seed, seconds, Motion::default());
        let mut batches: Vec<Vec<u8>> = events
            .chunks(60)
            .zip(0..)
            .map(|(chunk, seq)| batch(name, "s", seq, chunk))
            .collect();
        batches[1..]
            .chunks_exact_mut(2)
            .for_each(|pair| pair.swap(0, 1));
        batches
    });
    for turn in 0..phones[0].len() {
        for batches in &phones {
            let Some(body) = batches.get(turn) else {
                continue;
            };
            let again = if turn % 5 == 0 { 2 } else { 1 };
            for _ in 0..again {
                wait_for("room for a batch", || {
                    (lab.upload(body).status == 200).then_some(())
                });
            }
        }
        between(turn);
    }
}

fn command(lab: &TestLab, device: &str, command: Command) -> Result<(), String> {
    let lab_now = lab.running.lab.now_ns();
    let device = lab.running.lab.find(device).unwrap();
    lab.runtime.block_on(device.command(command, lab_now))
}

/// Everything that must be equal: not how the device is connected, which a replay is not.
fn comparable(lab: &Lab) -> Value {
    let mut devices = json!(lab.statuses());
    for device in devices.as_array_mut().unwrap() {
        let device = device.as_object_mut().unwrap();
        device.remove("source");
        device.remove("connected");
        device.remove("delivers");
        device.remove("silence");
    }
    let mut rows = lab.experiment_rows();
    rows.sort_by_key(|row| row.id.clone());
    let results: Vec<Value> = rows
        .iter()
        .map(|row| {
            let finished = lab.experiment(&row.id).unwrap();
            json!({"row": row, "message": finished.message(), "at": finished.at})
        })
        .collect();
    json!({"devices": devices, "experiments": results})
}

#[test]
fn a_replay_gives_the_numbers_of_the_live_run_to_the_bit() {
    let lab = TestLab::start();
    session(&lab, 12.0, |turn| match turn {
        2 => command(&lab, "anna", Command::Calibrate(1.5)).unwrap(),
        20 => {
            let settings =
                json!({"accelerometer_std": 0.123, "gyroscope_noise_density": 0.1 / 3.0});
            let settings = settings.as_object().unwrap().clone();
            command(
                &lab,
                "anna",
                Command::Settings(Some(Profile::Lab), settings),
            )
            .unwrap();
            let kinds = EstimatorKind::ALL.into_iter().take(4).collect();
            command(&lab, "ben", Command::Estimators(kinds)).unwrap();
            command(&lab, "ben", Command::Subject(EstimatorKind::Mekf3)).unwrap();
        }
        24 => {
            command(&lab, "anna", Command::Experiment(3.0, "swing".to_owned())).unwrap();
            command(&lab, "ben", Command::Experiment(3600.0, String::new())).unwrap();
            command(
                &lab,
                "ben",
                Command::Experiment(5.0, "two at once".to_owned()),
            )
            .unwrap_err();
        }
        30 => command(&lab, "ben", Command::Rename("Ben's phone".to_owned())).unwrap(),
        36 => command(&lab, "ben", Command::Stop).unwrap(),
        _ => {}
    });
    lab.upload(b"{ no batch");
    let live = wait_for("both experiments", || {
        let live = comparable(&lab.running.lab);
        (live["experiments"].as_array().unwrap().len() == 2).then_some(live)
    });
    let again = live["devices"][0]["duplicated_batches"].as_u64().unwrap();
    assert!(again > 5, "{live}");
    lab.runtime.block_on(lab.running.stop());
    let status = lab.running.lab.recording_status();
    assert!(status.text.contains("complete"), "{status:?}");
    let file = lab
        .data
        .path()
        .join("recordings")
        .join(status.file.unwrap());

    let replayed = Lab::new(RunOptions::default());
    lab.runtime
        .block_on(play(&replayed, &file, Speed::Max))
        .unwrap();
    let replayed = wait_for("both experiments again", || {
        let replayed = comparable(&replayed);
        (replayed["experiments"].as_array().unwrap().len() == 2).then_some(replayed)
    });
    assert_eq!(live, replayed);

    // And whoever reads the file gets each sample once and in order.
    let anna = OpenOptions {
        device: Some("anna".to_owned()),
        ..OpenOptions::default()
    };
    let read = open(&file, &anna).unwrap().map(|event| event.unwrap());
    assert_eq!(
        read.count(),
        sensor_events(1, 12.0, Motion::default()).len()
    );
}

#[test]
fn an_experiment_is_exported_as_messages_of_ros() {
    let lab = TestLab::start();
    session(&lab, 6.0, |turn| {
        if turn == 3 {
            command(&lab, "anna", Command::Experiment(4.0, "turn".to_owned())).unwrap();
        }
    });
    let rows = wait_for("the experiment", || {
        let status = lab.status();
        Some(status["experiments"].clone()).filter(|rows| rows[0].is_object())
    });
    let id = rows[0]["id"].as_str().unwrap();
    let file = |name: &str| lab.get(&format!("/api/experiments/{id}/{name}"));
    let (exported, table) = (file("recording.mcap"), file("recording.csv"));
    assert_eq!((exported.status, table.status), (200, 200));
    let folder = tempfile::tempdir().unwrap();
    let read = |name: &str, bytes: &[u8], topic: Option<&str>| -> Vec<Event> {
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        let options = OpenOptions {
            device: topic.map(str::to_owned),
            ..OpenOptions::default()
        };
        open(&path, &options)
            .unwrap()
            .map(|event| event.unwrap())
            .collect()
    };
    let messages = read("e.mcap", &exported.body, None);
    let rows = read("e.csv", &table.body, None);
    assert_eq!(messages.len(), rows.len());
    for (one, other) in messages.iter().zip(&rows) {
        assert_eq!(
            (one.time_ns, one.sample.kind()),
            (other.time_ns, other.sample.kind())
        );
        match (&one.sample, &other.sample) {
            // Tesla in the file.
            (Sample::MagneticField(a), Sample::MagneticField(b)) => {
                assert!((a - b).norm() < 1e-9, "{a} {b}");
            }
            (a, b) => assert_eq!(a, b),
        }
    }
    let estimated = read("e.mcap", &exported.body, Some("/imu/data"));
    let attitudes = estimated
        .iter()
        .filter(|event| matches!(event.sample, Sample::DeviceOrientation(_)));
    assert!(
        attitudes.count() > 250,
        "an estimate for each gyroscope sample"
    );
}

#[test]
fn recordings_are_listed_and_handed_out_and_nothing_else_is() {
    let lab = TestLab::start();
    assert_eq!(lab.status()["recording"]["state"], "idle");
    assert_eq!(lab.get("/api/recordings").json(), json!([]));
    session(&lab, 1.0, |_| {});
    let name = wait_for("the recording", || {
        let status = lab.status()["recording"].clone();
        (status["state"] == "on" && status["bytes"].as_u64().unwrap() > 10_000)
            .then(|| status["file"].as_str().unwrap().to_owned())
    });
    let listed = lab.get("/api/recordings").json();
    assert_eq!(listed[0]["name"], name.as_str());
    assert_eq!(listed[0]["devices"], json!(["anna", "ben"]));
    assert_eq!(listed[0]["finished"], false);
    assert!(listed[0]["start"].as_str().unwrap().ends_with("UTC"));
    let file = lab.get(&format!("/api/recordings/{name}"));
    assert_eq!(file.status, 200);
    assert!(file.head.contains("attachment"));
    std::fs::write(lab.data.path().join("secret.mcap"), b"x").unwrap();
    std::fs::write(lab.data.path().join("recordings/notes.txt"), b"x").unwrap();
    for path in [
        "..%2fsecret.mcap",
        "%2e%2e%2fsecret.mcap",
        "notes.txt",
        "none.mcap",
        "..",
        "%00",
    ] {
        let answer = lab.get(&format!("/api/recordings/{path}"));
        assert_ne!(answer.status, 200, "{path}");
    }
    // Phones do not get recordings.
    let app = lab.app_host();
    assert_eq!(
        request(&app, "GET", "/api/recordings", &[], b"").status,
        404
    );
}

#[test]
fn a_folder_that_cannot_be_written_stops_the_recording_and_nothing_else() {
    let lab = TestLab::start();
    // A file stands where the folder should be.
    std::fs::write(lab.data.path().join("recordings"), b"").unwrap();
    session(&lab, 1.0, |_| {});
    let status = wait_for("the failure", || {
        let status = lab.status();
        (status["recording"]["state"] == "failed").then_some(status)
    });
    let text = status["recording"]["text"].as_str().unwrap();
    assert!(
        text.contains("stopped") && text.contains("recordings"),
        "{text}"
    );
    assert_eq!(status["devices"].as_array().unwrap().len(), 2);
    assert_eq!(
        lab.upload(&batch(
            "carl",
            "s",
            0,
            &sensor_events(3, 0.2, Motion::default())
        ))
        .status,
        200
    );
}
