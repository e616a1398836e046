//! `northing live` as a script uses it.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests
#![cfg(feature = "live")]

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Output, Stdio};

use serde_json::Value;

fn northing(arguments: &[&str]) -> Output {
    let output = Command::new(env!("CARGO_BIN_EXE_northing"))
        .args(arguments)
        .output();
    output.unwrap()
}

fn recording(folder: &Path) -> String {
    let path = folder.join("walk.csv");
    let path = path.to_str().unwrap();
    let made = northing(&["demo", "--record-only", path, "--duration", "20"]);
    assert!(
        made.status.success(),
        "{}",
        String::from_utf8_lossy(&made.stderr)
    );
    path.to_owned()
}

#[test]
fn a_replay_ends_with_the_summary_of_run() {
    let folder = tempfile::tempdir().unwrap();
    let path = recording(folder.path());
    let data = folder.path().join("data");
    let run = northing(&["run", &path, "--json"]);
    let expected: Value = serde_json::from_slice(&run.stdout).unwrap();
    let live = northing(&[
        "live",
        "--local",
        "--port",
        "0",
        "--json",
        "--replay",
        &path,
        "--speed",
        "max",
        "--exit",
        "--data-dir",
        data.to_str().unwrap(),
    ]);
    assert!(
        live.status.success(),
        "{}",
        String::from_utf8_lossy(&live.stderr)
    );
    let text = String::from_utf8(live.stdout).unwrap();
    let first: Value = serde_json::from_str(text.lines().next().unwrap()).unwrap();
    assert_eq!(first["event"], "ready");
    assert!(
        first["lab"]
            .as_str()
            .unwrap()
            .starts_with("http://127.0.0.1:")
    );
    assert!(
        first["phone"]
            .as_str()
            .unwrap()
            .ends_with(first["token"].as_str().unwrap())
    );
    let last: Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    assert_eq!(last, expected);
}

#[test]
fn a_port_that_is_taken_is_named_and_so_is_a_missing_recording() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().to_str().unwrap();
    let taken = std::net::TcpListener::bind(("127.0.0.1", 0)).unwrap();
    let port = taken.local_addr().unwrap().port().to_string();
    let refused = northing(&[
        "live",
        "--local",
        "--no-open",
        "--port",
        &port,
        "--data-dir",
        data,
    ]);
    let words = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert_eq!(refused.status.code(), Some(2));
    assert!(
        words.contains(&format!("port {port}")) && words.contains("--port"),
        "{words}"
    );
    let missing = northing(&[
        "live",
        "--local",
        "--no-open",
        "--port",
        "0",
        "--data-dir",
        data,
        "--replay",
        "no.csv",
    ]);
    assert_eq!(missing.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&missing.stderr).contains("no.csv"));
}

#[cfg(unix)]
#[test]
fn an_interrupt_ends_the_lab_cleanly() {
    let folder = tempfile::tempdir().unwrap();
    let mut lab = Command::new(env!("CARGO_BIN_EXE_northing"))
        .args(["live", "--local", "--port", "0", "--json", "--data-dir"])
        .arg(folder.path())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut line = String::new();
    BufReader::new(lab.stdout.as_mut().unwrap())
        .read_line(&mut line)
        .unwrap();
    assert!(line.contains("\"event\":\"ready\""), "{line}");
    let killed = Command::new("kill")
        .args(["-INT", &lab.id().to_string()])
        .status()
        .unwrap();
    assert!(killed.success());
    assert!(lab.wait().unwrap().success());
}

/// The README's first command, on a machine without browser and without phones; a second one finds
/// the port taken and takes others.
#[cfg(unix)]
#[test]
fn northing_alone_starts_the_lab_and_says_where() {
    let folder = tempfile::tempdir().unwrap();
    let start = || {
        let mut lab = Command::new(env!("CARGO_BIN_EXE_northing"))
            .env("HOME", folder.path())
            .env("XDG_DATA_HOME", folder.path())
            .env("PATH", "")
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap();
        let mut line = String::new();
        BufReader::new(lab.stdout.as_mut().unwrap())
            .read_line(&mut line)
            .unwrap();
        (lab, line)
    };
    let labs = [start(), start()];
    assert_ne!(labs[0].1, labs[1].1);
    for (lab, line) in labs {
        assert!(
            line.starts_with("The lab is at http://127.0.0.1:"),
            "{line}"
        );
        let killed = Command::new("kill")
            .args(["-INT", &lab.id().to_string()])
            .status();
        assert!(killed.unwrap().success());
        let output = lab.wait_with_output().unwrap();
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success() && errors.is_empty(), "{errors}");
    }
}

/// Twelve digits of every number: what a file rounds in the last place does not count.
fn digits(value: &Value) -> Value {
    match value {
        Value::Number(number) => format!("{:.11e}", number.as_f64().unwrap()).into(),
        Value::Array(values) => values.iter().map(digits).collect(),
        Value::Object(map) => {
            let pairs = map.iter().map(|(key, value)| (key.clone(), digits(value)));
            Value::Object(pairs.collect())
        }
        other => other.clone(),
    }
}

/// The teacher's side of a hand-in: the recording and the report, and nothing else.
#[test]
fn a_report_of_the_lab_is_run_again_to_the_same_digits() {
    use northing_evaluation::{EstimatorKind, Profile, RunOptions};
    use northing_live::experiments::Finished;
    use northing_live::export::export;
    use northing_live::session::experiment::ExperimentRun;
    use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
    let phone = VirtualPhone::new(VirtualPhoneConfig::default()).unwrap();
    // Rest, motion and rest: without the second rest there is no final test to repeat.
    let mut run = ExperimentRun::new(75.0, "hand-in").unwrap();
    run.begin(0, Vec::new());
    let _ = phone.events().any(|event| run.add(&event));
    let mut options = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
    options.set("accelerometer_std=0.0712345678901").unwrap();
    let finished = Finished {
        id: "e7".to_owned(),
        device: "phone".to_owned(),
        device_name: "phone".to_owned(),
        at: String::new(),
        options,
        estimators: vec![EstimatorKind::Mekf],
        subject: EstimatorKind::Mekf,
        summaries: Default::default(),
        hash: String::new(),
        originals: Default::default(),
        experiment: run.finish(),
    };
    let finished = finished.evaluated().unwrap();
    let folder = tempfile::tempdir().unwrap();
    for file in ["report.html", "recording.csv"] {
        let made = export(&finished, file).unwrap().unwrap();
        std::fs::write(folder.path().join(format!("e7-{file}")), made.bytes).unwrap();
    }
    let html = std::fs::read_to_string(folder.path().join("e7-report.html")).unwrap();
    let (_, command) = html.split_once("<code>northing run ").unwrap();
    let (arguments, _) = command.split_once("</code>").unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_northing"))
        .current_dir(folder.path())
        .arg("run")
        .args(arguments.split(' '))
        .arg("--json")
        .output()
        .unwrap();
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let again: Value = serde_json::from_slice(&output.stdout).unwrap();
    let first = serde_json::to_value(&finished.summaries["mekf"]).unwrap();
    for key in [
        "error_deg",
        "nees_mean",
        "nis",
        "final",
        "updates",
        "estimates",
        "verdicts",
    ] {
        assert!(!first[key].is_null(), "{key}");
        assert_eq!(digits(&again[key]), digits(&first[key]), "{key}");
    }
    let mixed = Command::new(env!("CARGO_BIN_EXE_northing"))
        .current_dir(folder.path())
        .args([
            "run",
            "e7-recording.csv",
            "--setup",
            "e7-report.html",
            "--profile",
            "lab",
        ])
        .output()
        .unwrap();
    assert_eq!(mixed.status.code(), Some(2));
}
