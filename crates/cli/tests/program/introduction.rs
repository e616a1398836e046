//! What the program says about itself.

use crate::support::{Lab, contains};

#[cfg(not(feature = "live"))]
#[test]
fn without_arguments_it_introduces_itself() {
    insta::assert_snapshot!(Lab::new().succeeds(&[]), @r"
    northing: which way is it pointing, where is it, and where are the others?

      northing demo                          a virtual phone, the lab's steps, a report: start here
      northing run walk.zip --report w.html  one recording: attitude or position, consistency, report
      northing compare a.csv b.csv           several recordings and estimators in one table
      northing benchmark attitude --data d   all estimators beside third-party baselines
      northing benchmark navigation --data d GNSS/INS over a folder, beside extrapolated fixes
      northing track harbour.toml            targets in recordings of radar, cameras and AIS
      northing calibrate rest desk.csv       bias, noise and references of a device at rest
      northing calibrate magnetometer t.csv  hard and soft iron of a device turned in all directions
      northing calibrate allan night.csv     noise over averaging time, and the Q that follows
      northing describe imu.txt              what the columns of a table are, guessed with reasons
      northing info walk.zip                 sensors, rates, pauses and frames of a recording
      northing convert walk.zip walk.csv     a recording in another format
      northing simulate scenario.toml        one run of a tracking scenario
      northing montecarlo scenario.toml      many runs: RMSE and NEES of each tracker
      northing study study.toml              estimators x parameters x seeds, a row a run
      northing experiment observers          observers in cascade: errors, gains, cost
      northing experiment attitude-worlds    attitude on random worlds: accuracy, coverage, causes
      northing experiment navigation-worlds  GNSS/INS on random worlds: lost, coverage, heading
      northing experiment faults             faults of sensors, injected: cost, recovery, detection
      northing exercises                     the cards of the laboratory course
      northing hand-in bias rest.csv         the file that a student hands in for a card, judged at once
      northing grade class/                  the hand-ins of a class, run again, in one table
      northing tune drive.toml               noise parameters fitted to a recording
      northing estimators                    the estimators and their parameters
      northing completions bash              commands and options completed by the shell
      northing man share/man/man1            the manual pages

    `northing COMMAND --help` says more, with examples.
    ");
}

#[test]
fn every_command_has_help_with_examples() {
    let lab = Lab::new();
    for command in [
        "demo",
        "run",
        "compare",
        "convert",
        "describe",
        "info",
        "simulate",
        "montecarlo",
        "study",
        "estimators",
        "exercises",
        "hand-in",
        "grade",
        "track",
    ] {
        contains(
            &lab.succeeds(&[command, "--help"]),
            &["Examples:", &format!("northing {command}")],
        );
    }
    for what in ["rest", "magnetometer", "allan"] {
        contains(
            &lab.succeeds(&["calibrate", what, "--help"]),
            &["Examples:", "--from", "--to"],
        );
    }
    contains(&lab.succeeds(&["--version"]), &["northing 0."]);
}

#[test]
fn estimators_of_all_questions_are_listed_and_one_is_shown_with_its_parameters() {
    let lab = Lab::new();
    let text = lab.succeeds(&["estimators"]);
    let names = [
        "Attitude:",
        "integration",
        "mekf3",
        "bounded-velocity",
        "usque",
        "quaternion-ekf",
        "complementary-direct",
        "cascade-ekf",
        "Navigation:",
        "error-state",
        "axis-filters",
        "dead-reckoning",
        "device",
        "Tracking:",
        "track --tracker",
        "schmidt-black-box",
        "joint",
    ];
    contains(&text, &names);
    let one = |name: &str, parts: &[&str]| contains(&lab.succeeds(&["estimators", name]), parts);
    one(
        "mekf",
        &[
            "accelerometer_std",
            "m/s^2",
            "hand-held",
            "lab",
            "from 1e-6 to 10000",
        ],
    );
    one(
        "cascade-ekf",
        &["cascade_pole", "estimated | reconstructed"],
    );
    one("error-state", &["lever_arm_m", "validity.invalid_after_s"]);
    one("axis-filters", &["acceleration_std"]);
    one(
        "schmidt",
        &[
            "gate_sigmas",
            "pose_error_correlation.heading_s",
            "montecarlo",
        ],
    );
    one("integration", &["no parameters"]);
    let message = lab.refuses(&["estimators", "ins"]);
    contains(
        &message,
        &["unknown estimator `ins`", "error-state, ", "usque"],
    );
    let shown = lab.json(&["estimators", "error-state", "--json"]);
    assert_eq!(shown[0]["question"], "navigation");
    let mut parameters = shown[0]["parameters"].as_array().unwrap().iter();
    let gap = parameters.find(|p| p["name"] == "validity.invalid_after_s");
    assert!(gap.unwrap()["defaults"]["default"].is_number(), "{gap:?}");
}

#[test]
fn estimators_as_json_have_units_defaults_and_meanings() {
    let json = Lab::new().json(&["estimators", "--json"]);
    let names: Vec<_> = json
        .as_array()
        .unwrap()
        .iter()
        .filter(|e| e["question"] == "attitude")
        .map(|e| e["name"].as_str().unwrap())
        .collect();
    assert_eq!(
        names,
        [
            "integration",
            "mekf3",
            "mekf",
            "bounded-velocity",
            "usque",
            "quaternion-ekf",
            "complementary",
            "complementary-passive",
            "complementary-direct",
            "cascade",
            "cascade-ekf",
            "device"
        ]
    );
    let parameters = json[2]["parameters"].as_array().unwrap();
    let std = parameters
        .iter()
        .find(|p| p["name"] == "accelerometer_std")
        .unwrap();
    assert_eq!(std["unit"], "m/s^2");
    assert_eq!(std["defaults"]["lab"], 0.05);
    assert!(std["defaults"]["hand-held"].as_f64().unwrap() > 0.05);
    assert!(!std["meaning"].as_str().unwrap().is_empty());
    assert!(json[0]["parameters"].as_array().unwrap().is_empty());
}

/// `northing ... | head` closes the pipe while the program writes.
#[test]
fn a_reader_that_has_seen_enough_ends_it_quietly() {
    use std::io::Read as _;
    use std::process::{Command, Stdio};
    let mut child = Command::new(env!("CARGO_BIN_EXE_northing"))
        .args(["demo", "--record-only", "-", "--duration", "1000"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut first = [0; 100];
    child.stdout.take().unwrap().read_exact(&mut first).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{output:?}");
    assert!(output.stderr.is_empty(), "{output:?}");
}

#[test]
fn shells_complete_commands_and_options() {
    let lab = Lab::new();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        contains(
            &lab.succeeds(&["completions", shell]),
            &["northing", "calibrate", "navigation-worlds", "gnss-every"],
        );
    }
    contains(&lab.refuses(&["completions", "csh"]), &["csh", "bash"]);
}

#[test]
fn manual_pages_are_written_one_a_command_and_none_is_overwritten() {
    let lab = Lab::new();
    contains(&lab.succeeds(&["man", "."]), &["manual pages in"]);
    let page = |name: &str| std::fs::read_to_string(lab.path(name)).unwrap();
    contains(
        &page("northing-run.1"),
        &[".TH NORTHING-RUN 1", "gnss\\-every", ".SH EXAMPLES\n.nf\n"],
    );
    contains(&page("northing-calibrate-allan.1"), &["Allan"]);
    contains(&page("northing.1"), &["northing\\-tune(1)"]);
    contains(&lab.refuses(&["man", "."]), &["--force", "northing.1"]);
    lab.succeeds(&["man", ".", "--force"]);
    contains(
        &lab.refuses(&["man", "nowhere"]),
        &["nowhere", "not a folder"],
    );
}
