//! A recording of elsewhere is sent to the lab, kept for its owner alone, played as a device and run as an experiment.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use crate::support;

use northing_evaluation::{EstimatorKind, Profile, RunOptions};
use northing_live::replay::summary;
use northing_recording::{CsvWriter, Event, EventWriter as _, Metadata, SensorKind, open};
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use serde_json::Value;
use support::{Answer, TestLab, request, wait_for};

/// A CSV of a virtual phone with its truth.
fn csv(seconds: f64) -> Vec<u8> {
    let phone = VirtualPhone::new(VirtualPhoneConfig {
        seed: 11,
        duration_s: Some(seconds),
        ..VirtualPhoneConfig::default()
    });
    let events: Vec<Event> = phone.unwrap().events().collect();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("walk.csv");
    let metadata = Metadata {
        name: "walk".to_owned(),
        ..Metadata::default()
    };
    let mut kinds: Vec<SensorKind> = events.iter().map(|e| e.sample.kind()).collect();
    kinds.sort();
    kinds.dedup();
    let mut writer = CsvWriter::create(&path, &metadata, &kinds, false).unwrap();
    for event in &events {
        writer.write(event).unwrap();
    }
    Box::new(writer).finish().unwrap();
    std::fs::read(&path).unwrap()
}

fn send(lab: &TestLab, name: &str, bytes: &[u8]) -> Answer {
    let path = format!("/api/opened?name={name}");
    request(&lab.lab_host(), "POST", &path, &[], bytes)
}

fn post(lab: &TestLab, path: &str) -> Answer {
    request(&lab.lab_host(), "POST", path, &[], b"")
}

#[test]
fn a_csv_becomes_a_file_a_device_and_an_experiment_with_the_numbers_of_northing_run() {
    let lab = TestLab::start();
    let text = csv(12.0);
    let answer = send(&lab, "walk.csv", &text);
    assert_eq!(answer.status, 200, "{}", answer.text());
    let contents = answer.json();
    assert_eq!(
        (&contents["name"], &contents["format"]),
        (&"walk.csv".into(), &"csv".into())
    );
    assert!(
        (contents["duration_s"].as_f64().unwrap() - 12.0).abs() < 0.1,
        "{contents}"
    );
    let path = lab.data.path().join("opened/walk.csv");
    assert_eq!(std::fs::read(&path).unwrap(), text);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o600);
    }
    // Nothing is written over.
    assert_eq!(
        send(&lab, "walk.csv", &csv(2.0)).json()["name"],
        "walk-2.csv"
    );
    assert_eq!(std::fs::read(&path).unwrap(), text);

    let made = post(&lab, "/api/opened/walk.csv/experiments");
    assert_eq!(made.status, 200, "{}", made.text());
    let id = made.json()["experiments"][0].as_str().unwrap().to_owned();
    let status = lab.status();
    let row = &status["experiments"][0];
    assert_eq!(
        (
            row["id"].as_str().unwrap(),
            row["device_id"].as_str().unwrap()
        ),
        (id.as_str(), "file-walk.csv")
    );
    let options = RunOptions {
        skip_s: 1.0,
        ..RunOptions::new(EstimatorKind::Mekf, Profile::Lab)
    };
    let run = summary(&path, None, &options).unwrap();
    let expected = run.error_deg.unwrap().total_rmse;
    let told = row["results"]["mekf"]["error_deg"].as_f64().unwrap();
    assert_eq!(
        told.to_bits(),
        expected.to_bits(),
        "{told} against {expected}"
    );
    // Report and files are those of every experiment.
    let report = request(
        &lab.lab_host(),
        "GET",
        &format!("/api/experiments/{id}/report.html"),
        &[],
        b"",
    );
    assert!(
        report.status == 200 && report.text().contains("walk"),
        "{}",
        report.status
    );

    assert_eq!(post(&lab, "/api/opened/walk.csv/play").status, 202);
    let device = wait_for("the device", || {
        let all = lab.status()["devices"].clone();
        let device = all
            .as_array()
            .unwrap()
            .iter()
            .find(|d| d["source"] == "replay")
            .cloned();
        device.filter(|d| d["received"].as_u64().unwrap() > 100)
    });
    assert_eq!(device["id"], "replay-walk");
    // One that plays is not begun a second time.
    let mut told = lab.running.lab.listen();
    assert_eq!(post(&lab, "/api/opened/walk.csv/play").status, 202);
    wait_for("the refusal", || {
        let text = told.try_recv().ok()?;
        text.contains("walk.csv: it is being played").then_some(())
    });

    let deleted = request(&lab.lab_host(), "DELETE", "/api/opened/walk.csv", &[], b"");
    assert_eq!(deleted.status, 204);
    assert!(!path.exists());
    assert_eq!(post(&lab, "/api/opened/walk.csv/experiments").status, 404);
}

#[test]
fn what_is_no_recording_is_refused_in_the_readers_words_and_not_kept() {
    let lab = TestLab::start();
    for (name, bytes, said) in [
        ("notes.txt", &b"hello\n"[..], "notes.txt"),
        ("empty.csv", b"", "empty.csv"),
        ("walk.toml", b"[table]", "northing run walk.toml"),
        ("..", b"hello", "no name"),
        (
            "bad.csv",
            b"t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s\n0,0,zero,0\n",
            "line 2",
        ),
        (
            "still.csv",
            b"t_s,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2\n0,0,0,9.8\n0.01,0,0,9.8\n",
            "gyroscope",
        ),
    ] {
        let answer = send(&lab, name, bytes);
        assert_eq!(answer.status, 422, "{name}: {}", answer.text());
        let text = answer.text();
        assert!(text.contains(said), "{name}: {text}");
        assert!(
            !text.contains(&lab.data.path().display().to_string()),
            "{text}"
        );
    }
    let listed = request(&lab.lab_host(), "GET", "/api/opened", &[], b"").json();
    assert_eq!(listed, Value::Array(Vec::new()));
    let folder = lab.data.path().join("opened");
    let left = std::fs::read_dir(folder).map_or(0, Iterator::count);
    assert_eq!(left, 0, "nothing is left behind");
    // A foreign page cannot send one.
    let headers = [("origin", "https://evil.example")];
    let path = "/api/opened?name=walk.csv";
    let foreign = request(&lab.lab_host(), "POST", path, &headers, &csv(1.0));
    assert_eq!(foreign.status, 403);
}

#[test]
fn a_lab_that_keeps_nothing_takes_no_file() {
    let lab = TestLab::start_without_recording(tempfile::tempdir().unwrap());
    let answer = send(&lab, "walk.csv", &csv(1.0));
    assert_eq!(answer.status, 409);
    assert!(
        answer.text().contains("--no-recording"),
        "{}",
        answer.text()
    );
}

/// A session of the lab holds several recordings: each becomes an experiment.
#[test]
fn a_session_becomes_its_experiments() {
    let lab = TestLab::start();
    assert_eq!(send(&lab, "a.csv", &csv(6.0)).status, 200);
    for _ in 0..2 {
        assert_eq!(post(&lab, "/api/opened/a.csv/experiments").status, 200);
    }
    let session = request(&lab.lab_host(), "GET", "/api/session.zip", &[], b"");
    let again = TestLab::start();
    let taken = send(&again, "class.zip", &session.body);
    assert_eq!(taken.json()["recordings"], 2, "{}", taken.text());
    let made = post(&again, "/api/opened/class.zip/experiments").json();
    assert_eq!(made["experiments"].as_array().unwrap().len(), 2, "{made}");
    let (then, now) = (lab.status(), again.status());
    for k in 0..2 {
        let error =
            |status: &Value| status["experiments"][k]["results"]["mekf"]["error_deg"].clone();
        assert!(error(&then).is_number());
        assert_eq!(error(&then), error(&now));
    }
    // What the lab exported reads as a recording.
    assert!(
        open(
            &again.data.path().join("opened/class.zip"),
            &northing_recording::OpenOptions::default()
        )
        .is_err()
    );
}
