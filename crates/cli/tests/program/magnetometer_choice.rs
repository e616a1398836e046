//! Which magnetometer a run uses: asked for, calibrated by file or folder, or left to the program.

use northing_core::nalgebra::Vector3;
use northing_recording::{Event, Sample, SensorKind, create};
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use serde_json::Value;

use crate::support::{Lab, contains};

/// What the system of the phone knows and takes away, and what it does not know.
const OFFSET: Vector3<f64> = Vector3::new(310.0, -140.0, 220.0);
const LEFT: Vector3<f64> = Vector3::new(9.0, -6.0, 4.0);

/// A virtual phone with both magnetometers, or with the uncalibrated one alone.
fn phone(lab: &Lab, name: &str, day: &str, also_device: bool) {
    let phone = VirtualPhone::new(VirtualPhoneConfig::default()).unwrap();
    let mut metadata = phone.metadata();
    metadata.device = Some("Phone 7".to_owned());
    metadata.set("calibration_day", day).unwrap();
    let sensors = [
        SensorKind::Gyroscope,
        SensorKind::Accelerometer,
        SensorKind::Magnetometer,
        SensorKind::MagnetometerUncalibrated,
        SensorKind::Reference,
    ];
    let mut writer = create(&lab.path(name), &metadata, &sensors, false).unwrap();
    for event in phone.events() {
        match event.sample {
            Sample::MagneticField(field) => {
                if also_device {
                    let sample = Sample::MagneticField(field + LEFT);
                    writer.write(&Event { sample, ..event }).unwrap();
                }
                let sample = Sample::MagneticFieldUncalibrated(field + OFFSET + LEFT);
                writer.write(&Event { sample, ..event }).unwrap();
            }
            _ if sensors.contains(&event.sample.kind()) => writer.write(&event).unwrap(),
            _ => {}
        }
    }
    writer.finish().unwrap();
}

fn calibration(lab: &Lab, name: &str) {
    let [x, y, z] = (OFFSET + LEFT).into();
    lab.write(
        name,
        format!(
            "magnetometer = \"uncalibrated\"\n[calibration]\nmodel = \"sphere\"\nsamples = 900\n\
             ignored_samples = 0\nrejected_samples = 0\ncoverage = 1.0\nhard_iron_ut = [{x:?}, {y:?}, {z:?}]\n\
             hard_iron_std_ut = [0.1, 0.1, 0.1]\nsoft_iron = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]\n\
             field_strength_ut = 48.0\nradius_ut = 48.0\nresidual_std_ut = 0.5\n\
             uncalibrated_norm_std_ut = 30.0\ncondition_number = 1.5\n"
        ),
    );
}

fn heading(json: &Value) -> f64 {
    json["error_deg"]["heading_rmse"].as_f64().unwrap()
}

#[test]
fn the_stream_is_chosen_by_what_there_is_and_said() {
    let lab = Lab::new();
    phone(&lab, "walk.csv", "d1", true);
    let run = |extra: &[&str]| lab.json(&[&["run", "walk.csv", "--json"], extra].concat());
    let chosen = run(&[]);
    assert_eq!(chosen["magnetometer"], "uncalibrated");
    assert_eq!(chosen["hard_iron_prior_ut"], 12.0);
    assert!(
        chosen["issues"]
            .to_string()
            .contains("It was chosen because")
    );
    let device = run(&["--magnetometer", "device"]);
    assert_eq!(device["magnetometer"], "device");
    assert_eq!(device["hard_iron_prior_ut"], 3.0);
    assert_eq!(run(&["--estimator", "mekf"])["magnetometer"], "device");
    assert_eq!(
        run(&["--sensors", "gyro,acc,mag"])["magnetometer"],
        "device"
    );
    assert!(heading(&chosen) < 8.0, "{}", heading(&chosen));
    contains(
        &lab.succeeds(&["run", "walk.csv"]),
        &[
            "hard iron",
            "expected within 12 uT",
            "--magnetometer device",
        ],
    );
    let text = lab.succeeds(&[
        "compare",
        "walk.csv",
        "--estimators",
        "mekf,bounded-velocity",
    ]);
    contains(&text, &["bounded-velocity took the uncalibrated one"]);
}

#[test]
fn what_was_asked_for_and_is_not_there_is_said() {
    let lab = Lab::with_phone();
    let text = lab.succeeds(&["run", "phone.csv", "--magnetometer", "uncalibrated"]);
    contains(
        &text,
        &[
            "no usable uncalibrated magnetometer",
            "--magnetometer device",
        ],
    );
    phone(&lab, "raw.csv", "d1", false);
    contains(
        &lab.succeeds(&["run", "raw.csv"]),
        &[
            "uncalibrated magnetometer alone",
            "northing calibrate magnetometer",
        ],
    );
}

#[test]
fn a_file_and_a_folder_of_calibrations_are_taken_by_device_and_day() {
    let lab = Lab::new();
    std::fs::create_dir_all(lab.path("set")).unwrap();
    std::fs::create_dir_all(lab.path("cal")).unwrap();
    phone(&lab, "set/a.csv", "d1", true);
    phone(&lab, "set/b.csv", "d2", true);
    calibration(&lab, "cal/magnetometer_phone 7_d1.toml");
    lab.write("cal/q.toml", "accelerometer_std = 0.3\n");
    let run = |name: &str, which: &str| lab.json(&["run", name, "--magnetometer", which, "--json"]);
    let by_folder = run("set/a.csv", "calibrated=cal");
    let by_file = run("set/a.csv", "calibrated=cal/magnetometer_phone 7_d1.toml");
    assert_eq!(by_folder["error_deg"], by_file["error_deg"]);
    assert_eq!(by_folder["magnetometer"], "uncalibrated");
    assert_eq!(by_folder["hard_iron_prior_ut"], 2.0);
    assert!(heading(&by_folder) < 1.5, "{}", heading(&by_folder));
    let words = by_folder["magnetometer_calibration"].as_str().unwrap();
    assert!(words.contains("magnetometer_phone 7_d1"), "{words}");
    contains(
        &lab.refuses(&["run", "set/b.csv", "--magnetometer", "calibrated=cal"]),
        &[
            "set/b.csv: no calibration of Phone 7 on day d2 in cal",
            "magnetometer_phone 7_d1",
        ],
    );
    let text = lab.succeeds(&["compare", "set", "--magnetometer", "calibrated=cal"]);
    contains(&text, &["Left out: set/b.csv: no calibration of Phone 7"]);
}

#[test]
fn calibrations_that_do_not_fit_together_are_refused() {
    let lab = Lab::with_phone();
    calibration(&lab, "m.toml");
    std::fs::create_dir_all(lab.path("empty")).unwrap();
    let run = |extra: &[&str]| lab.refuses(&[&["run", "phone.csv"], extra].concat());
    contains(
        &run(&["--magnetometer", "calibrated=empty"]),
        &[
            "empty: no calibrations in this folder",
            "northing calibrate magnetometer",
        ],
    );
    contains(
        &run(&["--magnetometer", "calibrated=none.toml"]),
        &["none.toml: cannot read it"],
    );
    contains(
        &run(&[
            "--magnetometer",
            "calibrated=m.toml",
            "--magnetometer-calibration",
            "m.toml",
        ]),
        &["both name a calibration"],
    );
    contains(
        &run(&["--calibration", "empty"]),
        &["no calibrations in this folder", "northing calibrate rest"],
    );
    contains(
        &run(&["--magnetometer", "calibrated="]),
        &["after calibrated="],
    );
}

#[test]
fn a_rest_is_calibrated_without_a_magnetometer() {
    let lab = Lab::with_phone();
    let json = lab.json(&[
        "calibrate",
        "rest",
        "phone.csv",
        "--magnetometer",
        "none",
        "--json",
    ]);
    assert_eq!(json["magnetometer_samples"], 0);
    assert!(json.get("magnetic_field_ut").is_none());
    contains(
        &lab.refuses(&["calibrate", "rest", "phone.csv", "--magnetometer", "no"]),
        &["device, uncalibrated or none"],
    );
}
