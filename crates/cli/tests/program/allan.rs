//! `northing calibrate allan`, and runs with the settings it wrote; the noise is known.

use northing_recording::{SensorKind, create};
use northing_simulation::sensors::GyroscopeConfig;
use northing_simulation::virtual_phone::Motion;
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

use crate::support::{IMU, Lab, contains, csv};

/// White noise, rad/s/sqrt(Hz), and random walk of the bias, rad/s/sqrt(s).
const N: f64 = 5e-4;
const K: f64 = 2e-4;

/// A phone at rest for ten minutes.
fn at_rest(lab: &Lab, name: &str) {
    let phone = VirtualPhone::new(VirtualPhoneConfig {
        motion: Motion::Rest,
        duration_s: Some(600.0),
        gyroscope: GyroscopeConfig {
            noise_std_rad_s: 0.0,
            noise_density_rad_s_sqrt_hz: N,
            bias_random_walk_rad_s_sqrt_s: K,
            resolution_rad_s: 0.0,
            ..GyroscopeConfig::default()
        },
        ..VirtualPhoneConfig::default()
    })
    .unwrap();
    let sensors = [SensorKind::Gyroscope, SensorKind::Accelerometer];
    let mut writer = create(&lab.path(name), &phone.metadata(), &sensors, false).unwrap();
    for event in phone
        .events()
        .filter(|event| sensors.contains(&event.sample.kind()))
    {
        writer.write(&event).unwrap();
    }
    writer.finish().unwrap();
}

#[test]
fn known_noise_is_found_and_becomes_the_q_of_a_filter() {
    let lab = Lab::new();
    at_rest(&lab, "rest.csv");
    let text = lab.succeeds(&[
        "calibrate",
        "allan",
        "rest.csv",
        "--out",
        "q.toml",
        "--report",
        "a.html",
    ]);
    contains(
        &text,
        &[
            "rest.csv: gyroscope at rest for 600 s, 60",
            "White noise: 0.00050 rad/s/sqrt(Hz)",
            "the bias walks by 0.00",
            "gyroscope_noise_density = ",
            "from the rise of the curve",
            "Written to q.toml",
            "Report: a.html",
            "run RECORDING --estimator mekf --config q.toml",
        ],
    );
    let json = lab.json(&["calibrate", "allan", "rest.csv", "--json"]);
    let setting = |name: &str| json["settings"][name].as_f64().unwrap();
    let (noise, walk) = (
        setting("gyroscope_noise_density"),
        setting("gyroscope_bias_random_walk"),
    );
    // The record bounds what can be known: a few percent of N, some tens of K.
    assert!((noise / N - 1.0).abs() < 0.05, "{noise}");
    assert!((walk / K - 1.0).abs() < 0.35, "{walk}");
    let html = lab.read("a.html");
    contains(
        &html,
        &[
            "Allan deviation",
            "random walk",
            "averaging time",
            "northing calibrate allan rest.csv",
        ],
    );
    lab.succeeds(&["demo", "--record-only", "phone.csv"]);
    lab.succeeds(&[
        "run",
        "phone.csv",
        "--estimator",
        "mekf",
        "--config",
        "q.toml",
        "--report",
        "r.html",
    ]);
    contains(
        &lab.read("r.html"),
        &[&format!("{noise}"), &format!("{walk}")],
    );
    // They are those of other filters than the first choice.
    contains(
        &lab.refuses(&["run", "phone.csv", "--config", "q.toml"]),
        &[
            "q.toml: none of its parameters has an effect on `bounded-velocity`",
            "--estimator",
        ],
    );
}

#[test]
fn other_sensors_are_explained_and_write_no_q() {
    let lab = Lab::new();
    at_rest(&lab, "rest.csv");
    let acc = [
        "calibrate",
        "allan",
        "rest.csv",
        "--sensor",
        "accelerometer",
    ];
    let text = lab.succeeds(&acc);
    contains(&text, &["accelerometer at rest", "m/s^2/sqrt(Hz)"]);
    assert!(!text.contains("gyroscope_noise_density"), "{text}");
    contains(
        &lab.refuses(&[&acc[..], &["--out", "q.toml"]].concat()),
        &["--out", "gyroscope", "accelerometer"],
    );
}

#[test]
fn what_has_no_allan_deviation_is_refused_with_the_reason() {
    let lab = Lab::with_phone();
    let refused = |arguments: &[&str]| lab.refuses(&[&["calibrate", "allan"], arguments].concat());
    contains(
        &refused(&["phone.csv", "--out", "q.toml"]),
        &[
            "phone.csv: Allan deviation: the device",
            "put",
            "firm table",
        ],
    );
    contains(
        &refused(&["phone.csv", "--to", "9"]),
        &["too short", "at least 60 s needed"],
    );
    lab.write(
        "gyro.csv",
        csv("t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s", 9000, |k| {
            format!("{},0,0", k % 3)
        }),
    );
    contains(
        &refused(&["gyro.csv", "--sensor", "magnetometer"]),
        &["gyro.csv", "no magnetometer samples"],
    );
    contains(
        &refused(&["gyro.csv", "--sensor", "barometer"]),
        &["barometer", "expected gyroscope"],
    );
    lab.write("stuck.csv", csv(IMU, 9000, |_| "0,0,0,0,0,9.81".to_owned()));
    contains(
        &refused(&["stuck.csv"]),
        &["the gyroscope repeated one value 9000 times"],
    );
}
