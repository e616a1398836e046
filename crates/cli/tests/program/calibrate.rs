//! `northing calibrate rest`, and runs with what it wrote.

use crate::support::{IMU, Lab, contains, csv};

#[test]
fn the_rest_at_the_beginning_is_measured_and_used() {
    let lab = Lab::with_phone();
    let text = lab.succeeds(&["calibrate", "rest", "phone.csv", "--out", "c.toml"]);
    contains(
        &text,
        &[
            "at rest from 0.0 s to",
            "bias",
            "gravity",
            "field",
            "Written to c.toml",
        ],
    );
    let file = lab.read("c.toml");
    contains(
        &file,
        &[
            "# Calibration at rest",
            "gyroscope_bias_rad_s = [",
            "magnetic_field_ut = [",
        ],
    );
    let error = |extra: &[&str]| {
        let arguments = [&["run", "phone.csv", "--profile", "lab", "--json"], extra].concat();
        lab.json(&arguments)["error_deg"]["total_rmse"]
            .as_f64()
            .unwrap()
    };
    let integration = error(&["--estimator", "integration"]);
    let calibrated = error(&["--estimator", "integration", "--calibration", "c.toml"]);
    assert!(calibrated < 0.1 * integration, "{calibrated} {integration}");
    contains(
        &lab.succeeds(&["run", "phone.csv", "--calibration", "c.toml"]),
        &["calibration"],
    );
}

#[test]
fn json_holds_the_calibration_and_where_it_is_from() {
    let json = Lab::with_phone().json(&[
        "calibrate",
        "rest",
        "phone.csv",
        "--from",
        "1",
        "--to",
        "9",
        "--json",
    ]);
    assert_eq!(
        (json["from_s"].as_f64(), json["to_s"].as_f64()),
        (Some(1.0), Some(9.0))
    );
    assert_eq!(json["gyroscope_bias_rad_s"].as_array().unwrap().len(), 3);
    let force: f64 = json["specific_force_m_s2"]
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap().powi(2))
        .sum();
    assert!((force.sqrt() - 9.8).abs() < 0.1);
}

#[test]
fn calibrating_while_moving_is_refused() {
    let lab = Lab::with_phone();
    let span = [
        "calibrate",
        "rest",
        "phone.csv",
        "--from",
        "20",
        "--to",
        "30",
        "--out",
        "c.toml",
    ];
    contains(
        &lab.refuses(&span),
        &["phone.csv", "the device moved", "put it on a table"],
    );
    let first = ["run", "phone.csv", "--calibrate-first", "30", "--json"];
    contains(&lab.refuses(&first), &["phone.csv", "first 30 s", "moved"]);
}

#[test]
fn too_few_samples_are_refused() {
    let lab = Lab::new();
    lab.write(
        "short.csv",
        csv(IMU, 20, |k| format!("{},0,0,0,0,9.81", k % 3)),
    );
    contains(
        &lab.refuses(&["calibrate", "rest", "short.csv"]),
        &["too short", "20 gyroscope samples", "50 needed"],
    );
}

#[test]
fn a_magnet_nearby_is_refused() {
    let lab = Lab::new();
    let header = format!("{IMU},mag_x_ut,mag_y_ut,mag_z_ut");
    let noise = |k: usize| f64::from(u8::try_from(k % 7).unwrap()) * 1e-3;
    let row = |k: usize| {
        format!(
            "{0},{0},{0},{0},{0},{1},150,{0},{0}",
            noise(k),
            9.8 + noise(k)
        )
    };
    lab.write("magnet.csv", csv(&header, 1000, row));
    let message = lab.refuses(&["calibrate", "rest", "magnet.csv"]);
    contains(
        &message,
        &[
            "the magnetic field is 150",
            "move away from iron and magnets",
        ],
    );
}

#[test]
fn spans_and_files_that_are_invalid_are_refused() {
    let lab = Lab::with_phone();
    contains(
        &lab.refuses(&["calibrate", "rest", "phone.csv", "--from", "9", "--to", "1"]),
        &["--from 9", "--to 1"],
    );
    contains(
        &lab.refuses(&["calibrate", "rest", "phone.csv", "--from", "500"]),
        &["--from 500", "behind its end"],
    );
    lab.write("bad.toml", "gyroscope_bias = [1, 2, 3]\n");
    let message = lab.refuses(&["run", "phone.csv", "--calibration", "bad.toml"]);
    contains(&message, &["bad.toml, line 1", "northing calibrate rest"]);
    let both = [
        "run",
        "phone.csv",
        "--calibration",
        "bad.toml",
        "--calibrate-first",
        "5",
    ];
    contains(&lab.refuses(&both), &["--calibration", "--calibrate-first"]);
}
