//! `northing live` records: what is left when it is killed, and when the disk is full.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests
#![cfg(all(feature = "live", unix))]

use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

/// A running lab: its process, its lines, and where it is.
struct Lab {
    process: Child,
    lines: Receiver<Value>,
    ready: Value,
}

impl Drop for Lab {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Lab {
    fn start(mut command: Command) -> Self {
        let mut process = command.stdout(Stdio::piped()).spawn().unwrap();
        let output = BufReader::new(process.stdout.take().unwrap());
        let (sender, lines) = channel();
        std::thread::spawn(move || {
            for line in output.lines().map_while(Result::ok) {
                let value = serde_json::from_str(&line).unwrap_or(Value::String(line));
                if sender.send(value).is_err() {
                    return;
                }
            }
        });
        let ready = lines.recv_timeout(Duration::from_secs(60)).unwrap();
        assert_eq!(ready["event"], "ready", "{ready}");
        Self {
            process,
            lines,
            ready,
        }
    }

    /// The first line that fits.
    fn line(&self, what: &str, fits: impl Fn(&Value) -> bool) -> Value {
        let end = Instant::now() + Duration::from_secs(60);
        loop {
            let left = end.saturating_duration_since(Instant::now());
            let line = self.lines.recv_timeout(left);
            let line = line.unwrap_or_else(|_| panic!("waited a minute for {what}"));
            if fits(&line) {
                return line;
            }
        }
    }

    fn status(&self) -> Value {
        let lab = self.ready["lab"].as_str().unwrap();
        let (status, body) = request("GET", &format!("{lab}api/status"), b"");
        assert_eq!(status, 200);
        serde_json::from_slice(&body).unwrap()
    }

    fn upload(&self, body: &[u8]) -> u16 {
        request("POST", self.ready["ingest"].as_str().unwrap(), body).0
    }
}

fn request(method: &str, url: &str, body: &[u8]) -> (u16, Vec<u8>) {
    let (host, path) = url
        .strip_prefix("http://")
        .unwrap()
        .split_once('/')
        .unwrap();
    let mut stream = TcpStream::connect(host).unwrap();
    stream
        .set_read_timeout(Some(Duration::from_secs(30)))
        .unwrap();
    let head = format!(
        "{method} /{path} HTTP/1.1\r\nhost: {host}\r\nconnection: close\r\ncontent-length: {}\r\n\r\n",
        body.len()
    );
    stream.write_all(head.as_bytes()).unwrap();
    stream.write_all(body).unwrap();
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).unwrap();
    let status = String::from_utf8_lossy(&answer[9..12]).parse().unwrap();
    let end = answer.windows(4).position(|w| w == b"\r\n\r\n").unwrap();
    (status, answer[end + 4..].to_vec())
}

/// A tenth of a second of a phone at rest at 100 Hz.
fn batch(device: &str, seq: u64) -> Vec<u8> {
    let rows = |v: [f64; 3]| -> Vec<Value> {
        let row = |k: u64| {
            let t_ms = 100 * seq + 10 * k;
            let wobble = 1e-3 * ((t_ms / 10) % 7) as f64;
            json!([t_ms, v[0] + wobble, v[1], v[2] - wobble])
        };
        (0..10).map(row).collect()
    };
    json!({
        "v": 1, "device": device, "session": "s", "seq": seq, "platform": "android",
        "gs": {"g": rows([0.0; 3]), "a": rows([0.0, 0.0, 9.81]), "m": rows([0.0, 22.0, -40.0])},
    })
    .to_string()
    .into_bytes()
}

const SAMPLES: u64 = 30;

fn live(data: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_northing"));
    command.args(["live", "--local", "--json", "--port", "0", "--data-dir"]);
    command.arg(data);
    command
}

fn recordings(data: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(data.join("recordings")).unwrap();
    entries.map(|entry| entry.unwrap().path()).collect()
}

#[test]
fn a_killed_lab_leaves_all_but_its_last_second() {
    let folder = tempfile::tempdir().unwrap();
    let mut lab = Lab::start(live(folder.path()));
    // Two phones in real time, so that seconds of samples are seconds.
    let started = Instant::now();
    let mut acknowledged = 0;
    while started.elapsed() < Duration::from_secs(4) {
        // Never faster than the phone measures, also after a pause.
        std::thread::sleep(Duration::from_millis(100));
        for device in ["anna", "ben"] {
            assert_eq!(lab.upload(&batch(device, acknowledged)), 200);
        }
        acknowledged += 1;
    }
    lab.process.kill().unwrap();
    lab.process.wait().unwrap();
    let killed = recordings(folder.path());
    assert_eq!(killed.len(), 1);

    let lab = Lab::start(live(folder.path()));
    let told = lab.line("the recovery", |line| line["event"] == "recovered");
    let text = told["text"].as_str().unwrap();
    assert!(
        text.contains("not finished") && text.contains("recovered"),
        "{text}"
    );
    drop(lab);

    let run = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_northing"));
        command
            .arg("run")
            .arg(&killed[0])
            .args(arguments)
            .output()
            .unwrap()
    };
    let unsaid = run(&["--json"]);
    let words = String::from_utf8_lossy(&unsaid.stderr).into_owned();
    assert!(
        words.contains("anna, ben") && words.contains("--device"),
        "{words}"
    );
    for device in ["anna", "ben"] {
        let output = run(&["--device", device, "--json"]);
        let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
        let gyroscope = summary["samples_per_sensor"]["gyroscope"].as_u64().unwrap();
        let all = SAMPLES / 3 * acknowledged;
        // The last second of the phone that came last, and not a sample more.
        assert!(
            gyroscope <= all && all - gyroscope <= 100,
            "{gyroscope} of {all}: {summary}"
        );
        assert_eq!(gyroscope % 10, 0, "batches are whole");
    }
}

#[test]
fn a_full_disk_stops_the_recording_with_words_and_the_lab_goes_on() {
    let folder = tempfile::tempdir().unwrap();
    // No file may be longer than 64 blocks of 512 or 1024 bytes; writing on is an error, as on a full disk.
    let mut shell = Command::new("sh");
    let script = "trap '' XFSZ; ulimit -f 64; exec \"$0\" \"$@\"";
    let lab_command = live(folder.path());
    shell.args(["-c", script]).arg(lab_command.get_program());
    shell.args(lab_command.get_args());
    let lab = Lab::start(shell);
    let mut seq = 0;
    let status = loop {
        assert_eq!(lab.upload(&batch("anna", seq)), 200);
        seq += 1;
        assert!(seq < 2000, "the disk never filled");
        let status = lab.status();
        if status["recording"]["state"] == "failed" {
            break status;
        }
        std::thread::sleep(Duration::from_millis(20));
    };
    let text = status["recording"]["text"].as_str().unwrap();
    assert!(
        text.contains("stopped") && text.contains("too large"),
        "{text}"
    );
    let told = lab.line("the failure", |line| {
        line["event"] == "recording" && line["state"] == "failed"
    });
    assert_eq!(told["text"], text);
    for _ in 0..20 {
        assert_eq!(lab.upload(&batch("anna", seq)), 200);
        seq += 1;
    }
    let device = lab.status()["devices"][0].clone();
    assert_eq!(device["received"], SAMPLES * seq, "{device}");
    assert!(device["estimates"]["mekf"]["q"].is_array(), "{device}");
    // What was written before can be read.
    let file = &recordings(folder.path())[0];
    let mut command = Command::new(env!("CARGO_BIN_EXE_northing"));
    let output = command.arg("run").arg(file).arg("--json").output().unwrap();
    let summary: Value = serde_json::from_slice(&output.stdout)
        .unwrap_or_else(|error| panic!("{error}: {}", String::from_utf8_lossy(&output.stderr)));
    assert!(
        summary["samples_per_sensor"]["gyroscope"].as_u64().unwrap() > 50,
        "{summary}"
    );
    let issues = summary["issues"].to_string();
    assert!(issues.contains("not finished"), "{issues}");
}

#[test]
fn a_replay_of_a_recording_ends_with_the_summary_of_run() {
    let folder = tempfile::tempdir().unwrap();
    let mut lab = Lab::start(live(folder.path()));
    for seq in 0..60 {
        assert_eq!(lab.upload(&batch("anna", seq)), 200);
    }
    let id = lab.process.id().to_string();
    assert!(
        Command::new("kill")
            .args(["-INT", &id])
            .status()
            .unwrap()
            .success()
    );
    assert!(lab.process.wait().unwrap().success());
    let file = recordings(folder.path()).remove(0);
    let run = Command::new(env!("CARGO_BIN_EXE_northing"))
        .arg("run")
        .arg(&file)
        .arg("--json")
        .output()
        .unwrap();
    let expected: Value = serde_json::from_slice(&run.stdout).unwrap();
    assert_eq!(expected["samples_per_sensor"]["gyroscope"], 600);
    let mut replay = live(folder.path());
    replay
        .args(["--speed", "max", "--exit", "--replay"])
        .arg(&file);
    let output = replay.output().unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let last: Value = serde_json::from_str(text.lines().last().unwrap()).unwrap();
    assert_eq!(last, expected);
    // A replay is not recorded again.
    assert_eq!(recordings(folder.path()), [file]);
}
