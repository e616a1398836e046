//! `northing calibrate magnetometer`, and runs with what it wrote; the iron is known.

use northing_core::nalgebra::{Matrix3, Vector3};
use northing_recording::{Sample, SensorKind, create};
use northing_simulation::random::{normal_vector, stream};
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

use crate::support::{IMU, Lab, contains, csv};

const HARD_IRON: Vector3<f64> = Vector3::new(25.0, -18.0, 9.0);

fn soft_iron() -> Matrix3<f64> {
    Matrix3::new(1.08, 0.04, 0.0, 0.04, 0.94, -0.03, 0.0, -0.03, 1.01)
}

/// What a sensor with iron around it shows, with noise of 0.3 microtesla.
fn disturbed(
    field: &Vector3<f64>,
    noise: &mut northing_simulation::random::Stream,
) -> Vector3<f64> {
    soft_iron() * field + HARD_IRON + normal_vector(noise, 0.3)
}

/// A device turned so that `share` of all directions is seen, 40 s at 50 Hz.
fn turned(lab: &Lab, name: &str, share: f64) {
    let mut noise = stream(3, "iron");
    let rows: Vec<Vector3<f64>> = (0..4000)
        .map(|k| {
            let z = 1.0 - 2.0 * share * (f64::from(k) + 0.5) / 4000.0;
            let (across, turn) = ((1.0 - z * z).sqrt(), 2.4 * f64::from(k));
            let field = Vector3::new(across * turn.cos(), across * turn.sin(), z) * 43.0;
            disturbed(&field, &mut noise)
        })
        .collect();
    let header = format!("{IMU},mag_x_ut,mag_y_ut,mag_z_ut");
    let row = |k: usize| {
        let m = rows[k];
        format!("0.01,0.02,{},0,0,9.81,{},{},{}", k % 3, m.x, m.y, m.z)
    };
    lab.write(name, csv(&header, rows.len(), row));
}

/// The virtual phone's recording with the same iron around its magnetometer.
fn walk(lab: &Lab, name: &str) {
    let phone = VirtualPhone::new(VirtualPhoneConfig::default()).unwrap();
    let sensors = [
        SensorKind::Gyroscope,
        SensorKind::Accelerometer,
        SensorKind::Magnetometer,
        SensorKind::Reference,
    ];
    let mut writer = create(&lab.path(name), &phone.metadata(), &sensors, false).unwrap();
    let mut noise = stream(4, "iron");
    for mut event in phone.events() {
        if !sensors.contains(&event.sample.kind()) {
            continue;
        }
        if let Sample::MagneticField(field) = &mut event.sample {
            *field = disturbed(field, &mut noise);
        }
        writer.write(&event).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn known_iron_is_found_and_the_run_is_as_good_as_without_it() {
    let lab = Lab::new();
    turned(&lab, "turned.csv", 1.0);
    let text = lab.succeeds(&[
        "calibrate",
        "magnetometer",
        "turned.csv",
        "--field-strength",
        "43",
        "--out",
        "m.toml",
        "--report",
        "m.html",
    ]);
    contains(
        &text,
        &[
            "turned.csv: magnetometer `device`",
            "Accepted: hard and soft iron, an ellipsoid, from",
            "in 40 s; 100 % of all directions were seen",
            "Written to m.toml",
            "Report: m.html",
            "--magnetometer-calibration m.toml",
        ],
    );
    let json = lab.json(&["calibrate", "magnetometer", "turned.csv", "--json"]);
    let found: Vec<f64> = json["hard_iron_ut"]
        .as_array()
        .unwrap()
        .iter()
        .map(|v| v.as_f64().unwrap())
        .collect();
    assert!(
        (Vector3::from_column_slice(&found) - HARD_IRON).norm() < 0.1,
        "{found:?}"
    );
    assert!(json["residual_std_ut"].as_f64().unwrap() < 0.4);
    let html = lab.read("m.html");
    contains(
        &html,
        &[
            "Directions seen",
            "Strength of the field",
            "soft iron, row x",
            "northing calibrate magnetometer turned.csv",
        ],
    );

    walk(&lab, "walk.csv");
    lab.succeeds(&["demo", "--record-only", "clean.csv"]);
    let heading = |file: &str, extra: &[&str]| {
        let arguments = [&["run", file, "--profile", "lab", "--json"], extra].concat();
        lab.json(&arguments)["error_deg"]["heading_rmse"]
            .as_f64()
            .unwrap()
    };
    let (clean, raw) = (heading("clean.csv", &[]), heading("walk.csv", &[]));
    let mended = heading("walk.csv", &["--magnetometer-calibration", "m.toml"]);
    assert!(
        raw > 10.0 && mended < clean + 0.5,
        "clean {clean}, raw {raw}, mended {mended}"
    );
    let text = lab.succeeds(&["run", "walk.csv", "--magnetometer-calibration", "m.toml"]);
    contains(&text, &["made before (m.toml): ellipsoid, hard iron 32."]);
}

#[test]
fn the_calibration_alone_goes_to_standard_output() {
    let lab = Lab::new();
    turned(&lab, "turned.csv", 1.0);
    let arguments = ["calibrate", "magnetometer", "turned.csv", "--out"];
    lab.succeeds(&[&arguments[..], &["m.toml"]].concat());
    let printed = lab.succeeds(&[&arguments[..], &["-"]].concat());
    assert_eq!(printed, lab.read("m.toml"));
    contains(
        &lab.refuses(&[&arguments[..], &["-", "--json"]].concat()),
        &["--json and --out -"],
    );
}

#[test]
fn what_gives_no_calibration_is_refused_with_the_reason() {
    let lab = Lab::with_phone();
    turned(&lab, "part.csv", 0.15);
    contains(
        &lab.refuses(&["calibrate", "magnetometer", "part.csv", "--out", "m.toml"]),
        &[
            "part.csv: magnetometer calibration: turn the device through more directions: only",
            "of the sphere seen",
        ],
    );
    lab.write(
        "imu.csv",
        csv(IMU, 2000, |k| format!("{},0,0,0,0,9.81", k % 3)),
    );
    contains(
        &lab.refuses(&["calibrate", "magnetometer", "imu.csv"]),
        &["imu.csv: the recording has no samples of the magnetometer `device`"],
    );
    contains(
        &lab.refuses(&[
            "calibrate",
            "magnetometer",
            "phone.csv",
            "--magnetometer",
            "uncalibrated",
        ]),
        &[
            "no samples of the magnetometer `uncalibrated`",
            "--magnetometer",
        ],
    );
    contains(
        &lab.refuses(&[
            "calibrate",
            "magnetometer",
            "phone.csv",
            "--from",
            "2",
            "--to",
            "3",
        ]),
        &["too short", "at least 100 needed", "turn the device"],
    );
    contains(
        &lab.refuses(&[
            "calibrate",
            "magnetometer",
            "phone.csv",
            "--field-strength",
            "4800",
        ]),
        &["--field-strength", "22 to 67 on Earth"],
    );
}

#[test]
fn a_calibration_that_cannot_apply_is_refused() {
    let lab = Lab::with_phone();
    turned(&lab, "turned.csv", 1.0);
    lab.succeeds(&["calibrate", "magnetometer", "turned.csv", "--out", "m.toml"]);
    let run = |extra: &[&str]| {
        let all = [
            &["run", "phone.csv", "--magnetometer-calibration", "m.toml"],
            extra,
        ]
        .concat();
        lab.refuses(&all)
    };
    contains(
        &run(&["--sensors", "gyro,acc"]),
        &["has no effect", "--sensors"],
    );
    contains(
        &run(&["--magnetometer", "uncalibrated"]),
        &["of the stream `device`, and `uncalibrated` is in use"],
    );
    lab.write(
        "bad.toml",
        lab.read("m.toml")
            .replace("model = \"ellipsoid\"", "model = \"cube\""),
    );
    contains(
        &lab.refuses(&["run", "phone.csv", "--magnetometer-calibration", "bad.toml"]),
        &[
            "bad.toml, line",
            "cube",
            "northing calibrate magnetometer RECORDING",
        ],
    );
}

#[test]
fn a_rest_is_calibrated_with_the_same_field() {
    let lab = Lab::with_phone();
    turned(&lab, "turned.csv", 1.0);
    lab.succeeds(&["calibrate", "magnetometer", "turned.csv", "--out", "m.toml"]);
    let field = |extra: &[&str]| {
        let all = [&["calibrate", "rest", "phone.csv", "--json"], extra].concat();
        let json = lab.json(&all);
        let field = json["magnetic_field_ut"].as_array().unwrap().clone();
        Vector3::from_iterator(field.iter().map(|v| v.as_f64().unwrap()))
    };
    let (raw, mended) = (field(&[]), field(&["--magnetometer-calibration", "m.toml"]));
    // Subtracting iron that is not there moves the field by as much.
    assert!((raw - mended).norm() > 20.0, "{raw} {mended}");
}
