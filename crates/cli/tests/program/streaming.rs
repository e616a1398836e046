//! Long recordings through a pipe: memory stays flat, and Ctrl-C leaves nothing behind.

use std::fs;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::support::Lab;

/// How much the peak memory may grow from a tenth to the whole, kB.
const GROWTH_KB: u64 = 8 * 1024;

fn northing(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_northing"));
    command.args(arguments);
    command
}

/// Peak memory so far, kB; `None` once the process is over.
fn peak_kb(process: &Child) -> Option<u64> {
    let status = fs::read_to_string(format!("/proc/{}/status", process.id())).ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse().ok()
}

/// Records so many samples into a pipe and runs them; returns the peak memory of writer and reader.
fn piped(samples: u64) -> [u64; 2] {
    let mut writer = northing(&[
        "demo",
        "--record-only",
        "-",
        "--samples",
        &samples.to_string(),
    ])
    .stdout(Stdio::piped())
    .spawn()
    .unwrap();
    let mut reader = northing(&["run", "-", "--json"])
        .stdin(writer.stdout.take().unwrap())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let mut peaks = [0; 2];
    while reader.try_wait().unwrap().is_none() {
        for (peak, process) in peaks.iter_mut().zip([&writer, &reader]) {
            *peak = peak_kb(process).unwrap_or(0).max(*peak);
        }
        sleep(Duration::from_millis(5));
    }
    assert!(writer.wait().unwrap().success());
    let output = reader.wait_with_output().unwrap();
    assert!(output.status.success());
    let json: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(json["samples"], samples);
    assert!(json["error_deg"]["total_rmse"].as_f64().unwrap() < 5.0);
    peaks
}

#[test]
fn a_million_samples_through_a_pipe_need_no_more_memory_than_a_tenth() {
    let (tenth, whole) = (piped(100_000), piped(1_000_000));
    println!("peak memory of writer and reader, kB: {tenth:?} and {whole:?}");
    for (few, many) in tenth.into_iter().zip(whole) {
        assert!(few > 1000, "not measured: {tenth:?}");
        assert!(many < few + GROWTH_KB, "{tenth:?} {whole:?}");
    }
}

/// Waits until a condition holds.
fn wait_for(what: &str, condition: impl Fn() -> bool) {
    let start = Instant::now();
    while !condition() {
        assert!(start.elapsed() < Duration::from_secs(30), "{what}");
        sleep(Duration::from_millis(20));
    }
}

#[test]
fn ctrl_c_leaves_no_half_written_file() {
    let lab = Lab::new();
    let output = lab.path("long.csv");
    let arguments = [
        "demo",
        "--record-only",
        output.to_str().unwrap(),
        "--samples",
        "1000000000",
    ];
    let mut process = northing(&arguments).stderr(Stdio::null()).spawn().unwrap();
    wait_for("it never began to write", || !lab.names().is_empty());
    sleep(Duration::from_millis(300));
    let id = process.id().to_string();
    assert!(
        Command::new("kill")
            .args(["-INT", &id])
            .status()
            .unwrap()
            .success()
    );
    assert_eq!(process.wait().unwrap().code(), Some(130));
    assert!(lab.names().is_empty(), "{:?}", lab.names());
}
