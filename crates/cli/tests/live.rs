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
