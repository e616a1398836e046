//! `northing compare`.

use crate::support::{Lab, contains};

#[test]
fn one_recording_gives_a_line_for_each_estimator() {
    let text = Lab::with_phone().succeeds(&["compare", "phone.csv"]);
    contains(
        &text,
        &[
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
            "device",
            "total deg",
        ],
    );
}

#[test]
fn json_is_an_array_of_runs_in_order() {
    let lab = Lab::with_phone();
    lab.succeeds(&["demo", "--record-only", "b.csv", "--seed", "2"]);
    let json = lab.json(&[
        "compare",
        "phone.csv",
        "b.csv",
        "--estimators",
        "usque,mekf",
        "--json",
    ]);
    let runs: Vec<_> = json
        .as_array()
        .unwrap()
        .iter()
        .map(|run| {
            (
                run["recording"].as_str().unwrap(),
                run["estimator"].as_str().unwrap(),
            )
        })
        .collect();
    assert_eq!(
        runs,
        [
            ("phone.csv", "usque"),
            ("phone.csv", "mekf"),
            ("b.csv", "usque"),
            ("b.csv", "mekf")
        ]
    );
    let alone = lab.json(&["run", "b.csv", "--estimator", "mekf", "--json"]);
    assert_eq!(json[3]["error_deg"], alone["error_deg"]);
}

#[test]
fn folders_are_searched_and_calibrations_left_out() {
    let lab = Lab::new();
    for (name, seed) in [
        ("set/a.csv", "1"),
        ("set/b.csv", "2"),
        ("set/calib_a.csv", "3"),
    ] {
        std::fs::create_dir_all(lab.path("set")).unwrap();
        lab.succeeds(&["demo", "--record-only", name, "--seed", seed]);
    }
    lab.write("set/notes.csv", "day,what\n1,2\n");
    let text = lab.succeeds(&[
        "compare",
        "set",
        "--estimators",
        "mekf,device",
        "--report",
        "c.html",
    ]);
    contains(
        &text,
        &[
            "set/a.csv",
            "set/b.csv",
            "mean / median",
            "Left out: set/notes.csv",
        ],
    );
    assert!(!text.contains("calib_a"), "{text}");
    contains(&lab.read("c.html"), &["<svg", "</html>", "mekf"]);
}

#[test]
fn a_broken_recording_is_left_out_and_named() {
    let lab = Lab::with_phone();
    lab.write(
        "broken.csv",
        "t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s\n0,0,0,0\n0.01,0,zero,0\n",
    );
    let output = lab
        .program(&["compare", "broken.csv", "phone.csv", "--json"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    let runs: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let names: Vec<&str> = runs
        .as_array()
        .unwrap()
        .iter()
        .map(|run| run["recording"].as_str().unwrap())
        .collect();
    assert!(
        names.len() == 12 && names.iter().all(|name| *name == "phone.csv"),
        "{names:?}"
    );
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(message.lines().count(), 1, "{message}");
    contains(
        &message,
        &[
            "northing: one recording is left out of the comparison: broken.csv, line 3, column `gyro_y_rad_s`",
            "`zero`",
        ],
    );
    let output = lab
        .program(&["compare", "phone.csv", "broken.csv", "none.csv"])
        .output()
        .unwrap();
    contains(
        &String::from_utf8(output.stdout).unwrap(),
        &["phone.csv", "total deg", "mekf"],
    );
    contains(
        &String::from_utf8(output.stderr).unwrap(),
        &["2 recordings are left out of the comparison; the first: broken.csv, line 3"],
    );
    contains(
        &lab.refuses(&["compare", "broken.csv"]),
        &["broken.csv, line 3"],
    );
    contains(&lab.refuses(&["compare", "-"]), &["standard input"]);
}

/// A report of one recording draws the errors of all estimators over time.
#[test]
fn a_report_of_one_recording_has_curves() {
    let lab = Lab::with_phone();
    lab.succeeds(&[
        "compare",
        "phone.csv",
        "--estimators",
        "mekf,integration",
        "--report",
        "c.html",
    ]);
    contains(&lab.read("c.html"), &["<svg", "Errors over time"]);
}
