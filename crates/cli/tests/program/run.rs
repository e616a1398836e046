//! `northing run`.

use serde_json::Value;

use crate::support::{IMU, Lab, contains, csv};

fn keys(value: &Value) -> Vec<&str> {
    value
        .as_object()
        .unwrap()
        .keys()
        .map(String::as_str)
        .collect()
}

#[test]
fn json_has_the_keys_that_scripts_read() {
    let json = Lab::with_phone().json(&["run", "phone.csv", "--json"]);
    for key in [
        "estimator",
        "recording",
        "duration_s",
        "samples",
        "updates",
        "error_deg",
        "nees_mean",
        "nis_mean",
        "final",
    ] {
        assert!(keys(&json).contains(&key), "{key}");
    }
    assert_eq!(
        (&json["estimator"], &json["recording"]),
        (&"bounded-velocity".into(), &"phone.csv".into())
    );
    assert!((json["duration_s"].as_f64().unwrap() - 75.0).abs() < 0.02);
    for sensor in ["gyroscope", "accelerometer", "magnetometer"] {
        for count in ["fused", "gated", "skipped"] {
            assert!(json["updates"][sensor][count].is_u64(), "{sensor} {count}");
        }
    }
    for error in ["total_rmse", "heading_rmse", "inclination_rmse"] {
        let value = json["error_deg"][error].as_f64().unwrap();
        assert!(value > 0.0 && value < 3.0, "{error}: {value}");
    }
    assert!(json["error_deg"]["scored_samples"].as_u64().unwrap() > 5000);
    assert!(json["nees_mean"].is_f64());
    assert!(
        json["nis_mean"]["accelerometer"].is_f64() && json["nis_mean"]["magnetometer"].is_f64()
    );
    assert!(json["final"]["calculated_error_deg"].is_f64());
    assert!(json["final"]["estimated_error_deg"].is_f64());
    assert!(json["final"]["verdict"].is_string());
}

#[test]
fn what_does_not_apply_is_null() {
    let lab = Lab::new();
    let rows = csv(IMU, 1000, |k| {
        format!("0.01,0,{},0,0,9.81", (k as f64 * 0.01).sin())
    });
    lab.write("imu.csv", rows);
    let json = lab.json(&["run", "imu.csv", "--json"]);
    assert!(json["error_deg"].is_null() && json["nees_mean"].is_null());
    assert!(json["nis_mean"]["magnetometer"].is_null());
    assert!(json["final"].is_null());
    let json =
        Lab::with_phone().json(&["run", "phone.csv", "--estimator", "integration", "--json"]);
    assert!(json["nees_mean"].is_null() && json["final"]["estimated_error_deg"].is_null());
    assert!(json["final"]["verdict"].is_null());
}

#[test]
fn every_estimator_runs() {
    let lab = Lab::with_phone();
    for estimator in [
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
    ] {
        let arguments = [
            "run",
            "phone.csv",
            "--estimator",
            estimator,
            "--calibrate-first",
            "10",
            "--json",
        ];
        let json = lab.json(&arguments);
        assert_eq!(json["estimator"], estimator);
        let error = json["error_deg"]["total_rmse"].as_f64().unwrap();
        assert!(error < 8.0, "{estimator}: {error}");
    }
}

#[test]
fn people_get_a_short_sheet_with_words() {
    let text = Lab::with_phone().succeeds(&[
        "run",
        "phone.csv",
        "--profile",
        "lab",
        "--calibrate-first",
        "10",
    ]);
    contains(
        &text,
        &[
            "phone.csv: mekf (lab profile)",
            "attitude error",
            "deg RMS",
            "the stated uncertainty is consistent",
        ],
    );
    contains(
        &text,
        &[
            "Your accelerometer R is consistent",
            "Your magnetometer R is consistent",
            "final test",
            "consistent",
        ],
    );
    assert!(text.lines().count() < 30, "{text}");
    assert!(
        text.lines().all(|line| line.chars().count() <= 100),
        "{text}"
    );
}

#[test]
fn sensors_can_be_left_out_and_it_says_what_is_then_unobservable() {
    let lab = Lab::with_phone();
    let text = lab.succeeds(&["run", "phone.csv", "--sensors", "gyro,acc"]);
    contains(&text, &["unobservable", "heading"]);
    assert!(!text.contains("magnetometer   "), "{text}");
    let text = lab.succeeds(&["run", "phone.csv", "--sensors", "gyro,mag"]);
    contains(&text, &["unobservable", "accelerometer"]);
}

#[test]
fn a_setting_changes_the_verdict() {
    let lab = Lab::with_phone();
    let small = [
        "run",
        "phone.csv",
        "--profile",
        "lab",
        "--calibrate-first",
        "10",
        "--set",
        "accelerometer_std=0.0165",
    ];
    contains(
        &lab.succeeds(&small),
        &["Your accelerometer R is about", "times too small"],
    );
    lab.write("lab.toml", "profile = 'lab'\naccelerometer_std = 0.0165\n");
    let file = lab.succeeds(&[
        "run",
        "phone.csv",
        "--config",
        "lab.toml",
        "--calibrate-first",
        "10",
    ]);
    contains(&file, &["lab profile", "times too small"]);
}

#[test]
fn smoothing_lowers_the_error() {
    let lab = Lab::with_phone();
    let error = |extra: &[&str]| {
        let arguments = [
            &[
                "run",
                "phone.csv",
                "--profile",
                "lab",
                "--calibrate-first",
                "10",
                "--json",
            ],
            extra,
        ]
        .concat();
        lab.json(&arguments)["error_deg"]["total_rmse"]
            .as_f64()
            .unwrap()
    };
    let (filtered, smoothed) = (error(&[]), error(&["--smooth"]));
    assert!(smoothed < 0.8 * filtered, "{smoothed} {filtered}");
}

#[test]
fn report_and_estimates_are_written() {
    let lab = Lab::with_phone();
    let text = lab.succeeds(&["run", "phone.csv", "--report", "r.html", "--out", "e.csv"]);
    contains(&text, &["Report: r.html", "Estimates: e.csv"]);
    let report = lab.read("r.html");
    contains(
        &report,
        &["<svg", "</html>", "bounded_velocity_psd", "Final test"],
    );
    for outside in [
        "<script src",
        "src=\"http",
        "href=\"http",
        "@import",
        "url(http",
    ] {
        assert!(
            !report.contains(outside),
            "the report is not self-contained: {outside}"
        );
    }
    let estimates = lab.read("e.csv");
    let header: Vec<_> = estimates.lines().next().unwrap().split(',').collect();
    assert_eq!(&header[..5], ["t_s", "qw", "qx", "qy", "qz"]);
    assert!(estimates.lines().count() > 7000);
    for line in estimates.lines().skip(1).take(20) {
        let q: Vec<f64> = line
            .split(',')
            .skip(1)
            .take(4)
            .map(|cell| cell.parse().unwrap())
            .collect();
        let norm: f64 = q.iter().map(|x| x * x).sum();
        assert!((norm - 1.0).abs() < 1e-9 && q[0] >= 0.0, "{line}");
    }
    lab.succeeds(&["run", "phone.csv", "--out", "e.tum"]);
    assert_eq!(
        lab.read("e.tum").lines().last().unwrap().split(' ').count(),
        8
    );
}

#[cfg(feature = "parquet")]
#[test]
fn estimates_can_be_parquet() {
    let lab = Lab::with_phone();
    lab.succeeds(&["run", "phone.csv", "--out", "e.parquet"]);
    let bytes = std::fs::read(lab.path("e.parquet")).unwrap();
    assert!(bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"));
}

#[test]
fn a_recording_comes_through_a_pipe() {
    let lab = Lab::with_phone();
    let from_file = lab.json(&["run", "phone.csv", "--json"]);
    let piped = lab
        .program(&["run", "-", "--json"])
        .pipe_stdin(lab.path("phone.csv"))
        .unwrap()
        .output()
        .unwrap();
    assert!(piped.status.success(), "{piped:?}");
    let piped: Value = serde_json::from_slice(&piped.stdout).unwrap();
    assert_eq!(piped["recording"], "standard input");
    assert_eq!(piped["error_deg"], from_file["error_deg"]);
}

#[test]
fn units_named_by_the_user_are_applied() {
    let lab = Lab::with_phone();
    let degrees: String = lab
        .read("phone.csv")
        .lines()
        .map(|line| {
            let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
            if let Some(Ok(_)) = cells.first().map(|t| t.parse::<f64>()) {
                for cell in &mut cells[1..4] {
                    if let Ok(rate) = cell.parse::<f64>() {
                        *cell = rate.to_degrees().to_string();
                    }
                }
            }
            cells.join(",") + "\n"
        })
        .collect();
    lab.write("degrees.csv", degrees);
    let message = lab.refuses(&["run", "degrees.csv", "--json"]);
    contains(
        &message,
        &["degrees.csv", "gyroscope", "--gyroscope-unit deg-per-s"],
    );
    let json = lab.json(&[
        "run",
        "degrees.csv",
        "--gyroscope-unit",
        "deg-per-s",
        "--json",
    ]);
    assert!(json["error_deg"]["total_rmse"].as_f64().unwrap() < 3.0);
}
