//! `northing demo`.

use crate::support::{Lab, contains};

const RECORDING: &str = if cfg!(feature = "parquet") {
    "recording.parquet"
} else {
    "recording.csv"
};

#[test]
fn the_laboratory_is_walked_through_and_everything_written() {
    let lab = Lab::new();
    let text = lab.succeeds(&["demo"]);
    let steps = [
        "1. Place the device",
        "2. Calibrate at rest",
        "3. Set Q and R",
        "4. Experiment",
        "5. Compare with direct integration",
        "6. Final test",
    ];
    contains(&text, &steps);
    contains(
        &text,
        &[
            "Verdict: accepted",
            "the stated uncertainty is consistent",
            "consistent",
        ],
    );
    contains(&text, &["Report: northing-demo/report.html", "Try next:"]);
    for file in [
        RECORDING,
        "calibration.toml",
        "estimates.csv",
        "report.html",
    ] {
        assert!(lab.path("northing-demo").join(file).is_file(), "{file}");
    }
}

/// The three commands that it ends with.
#[test]
fn the_commands_to_try_next_work() {
    let lab = Lab::new();
    let text = lab.succeeds(&["demo"]);
    let (_, next) = text.split_once("Try next:").unwrap();
    let (next, _) = next.split_once("and on a recording of your own").unwrap();
    let commands: Vec<Vec<&str>> = next
        .lines()
        .filter_map(|line| line.split_once("northing "))
        .map(|(_, arguments)| arguments.split(' ').collect())
        .collect();
    assert_eq!(commands.len(), 3, "{next}");
    for command in commands {
        lab.succeeds(&command);
    }
}

#[test]
fn an_earlier_demonstration_is_not_overwritten_without_force() {
    let lab = Lab::new();
    lab.succeeds(&["demo", "--out", "d"]);
    let before = lab.read("d/report.html");
    let message = lab.refuses(&["demo", "--out", "d", "--seed", "2"]);
    contains(&message, &["exists already", "--force"]);
    assert_eq!(lab.read("d/report.html"), before);
    lab.succeeds(&["demo", "--out", "d", "--seed", "2", "--force"]);
    assert_ne!(lab.read("d/report.html"), before);
}

#[test]
fn json_is_the_runs_of_the_comparison_and_the_filter_wins() {
    let json = Lab::new().json(&["demo", "--json"]);
    let error = |i: usize| json[i]["error_deg"]["total_rmse"].as_f64().unwrap();
    let names: Vec<_> = (0..3)
        .map(|i| json[i]["estimator"].as_str().unwrap())
        .collect();
    assert_eq!(names, ["mekf", "integration", "device"]);
    assert!(error(0) < error(1) && error(0) < error(2));
    assert!((0.5..1.7).contains(&json[0]["nees_mean"].as_f64().unwrap()));
}

#[test]
fn a_seed_gives_the_same_recording_and_another_seed_another() {
    let lab = Lab::new();
    let record = |seed: &str| {
        lab.succeeds(&[
            "demo",
            "--record-only",
            "-",
            "--duration",
            "2",
            "--seed",
            seed,
        ])
    };
    assert_eq!(record("5"), record("5"));
    assert_ne!(record("5"), record("6"));
}

#[test]
fn a_number_of_samples_is_kept() {
    let lab = Lab::new();
    lab.succeeds(&["demo", "--record-only", "s.csv", "--samples", "3000"]);
    let json = lab.json(&["run", "s.csv", "--json"]);
    assert_eq!(json["samples"], 3000);
}

#[test]
fn disturbances_are_survived() {
    let lab = Lab::new();
    let text = lab.succeeds(&["demo", "--disturbance", "both", "--motion", "brisk"]);
    contains(&text, &["Disturbance: both", "briskly"]);
    let message = lab.refuses(&["demo", "--disturbance", "earthquake"]);
    contains(
        &message,
        &["earthquake", "none, acceleration, magnetic, both"],
    );
}

#[test]
fn a_picture_is_drawn_and_too_short_a_laboratory_refused() {
    let lab = Lab::new();
    lab.succeeds(&["demo", "--picture", "p.svg"]);
    contains(
        &lab.read("p.svg"),
        &["<svg", "MEKF", "integration", "</svg>"],
    );
    contains(
        &lab.refuses(&["demo", "--out", "d", "--duration", "5"]),
        &["takes 75 s", "--record-only"],
    );
}

/// Nothing was written yet: nothing stays, not even the folder.
#[cfg(unix)]
#[test]
fn an_interrupt_leaves_no_empty_folder() {
    use std::process::{Command, Stdio};
    use std::time::{Duration, Instant};
    let lab = Lab::new();
    let mut child = Command::new(env!("CARGO_BIN_EXE_northing"))
        .current_dir(lab.path("."))
        .args(["demo", "--duration", "100000"])
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while lab.names().is_empty() {
        assert!(
            start.elapsed() < Duration::from_secs(60),
            "no folder was made"
        );
        std::thread::sleep(Duration::from_millis(10));
    }
    let killed = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(killed.unwrap().success());
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(lab.names(), Vec::<String>::new());
}
