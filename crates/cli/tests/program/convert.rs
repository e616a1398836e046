//! `northing convert`.

use crate::support::{IMU, Lab, contains, csv};

#[test]
fn a_recording_survives_the_way_there_and_back() {
    let lab = Lab::with_phone();
    let between = if cfg!(feature = "parquet") {
        "phone.parquet"
    } else {
        "between.csv"
    };
    contains(
        &lab.succeeds(&["convert", "phone.csv", between]),
        &["samples written to", between],
    );
    lab.succeeds(&["convert", between, "--out", "back.csv"]);
    let rows = |name: &str| -> Vec<String> {
        let text = lab.read(name);
        text.lines()
            .filter(|line| !line.starts_with('#'))
            .map(str::to_owned)
            .collect()
    };
    let (first, second) = (rows("phone.csv"), rows("back.csv"));
    assert_eq!(first.len(), second.len());
    assert_eq!(first[0], second[0]);
    let estimates = |name: &str, out: &str| {
        lab.succeeds(&["run", name, "--out", out]);
        lab.read(out)
    };
    assert_eq!(
        estimates("phone.csv", "first.csv"),
        estimates("back.csv", "second.csv")
    );
}

#[test]
fn a_trajectory_is_made_of_the_reference_or_refused() {
    let lab = Lab::with_phone();
    let json = lab.json(&["convert", "phone.csv", "truth.tum", "--json"]);
    assert_eq!(json["output"], "truth.tum");
    let lines = lab.read("truth.tum").lines().count() as u64;
    assert_eq!(json["samples"].as_u64().unwrap() + 2, lines);
    lab.write("imu.csv", csv(IMU, 10, |_| "0,0,0,0,0,9.81".to_owned()));
    let message = lab.refuses(&["convert", "imu.csv", "imu.tum"]);
    contains(
        &message,
        &[
            "imu.csv",
            "neither reference nor device orientation",
            "northing run",
        ],
    );
}

#[test]
fn a_manifest_describes_any_table() {
    let lab = Lab::new();
    let rows: String = (0..600)
        .map(|k| format!("{};0;0;{};0;0;1\n", k * 10, if k < 300 { 0 } else { 10 }))
        .collect();
    lab.write("log.txt", format!("ms;p;q;r;ax;ay;az\n{rows}"));
    lab.write(
        "log.toml",
        "delimiter = ';'\n[time]\ncolumn = 'ms'\nunit = 'ms'\n\
         [gyroscope]\ncolumns = ['p', 'q', 'r']\nunit = 'deg-per-s'\n\
         [accelerometer]\ncolumns = ['ax', 'ay', 'az']\nunit = 'g'\n",
    );
    let text = lab.succeeds(&["convert", "log.txt", "log.csv", "--manifest", "log.toml"]);
    contains(&text, &["1200 samples"]);
    contains(
        lab.read("log.csv").lines().last().unwrap(),
        &["5.99,", ",9.80665"],
    );
}

#[test]
fn other_extensions_and_existing_outputs_are_refused() {
    let lab = Lab::with_phone();
    contains(
        &lab.refuses(&["convert", "phone.csv", "phone.xls"]),
        &["phone.xls", ".csv, .parquet or .mcap"],
    );
    contains(
        &lab.refuses(&["convert", "phone.csv", "phone.csv"]),
        &["exists already", "--force"],
    );
    lab.write("old.csv", "old");
    lab.succeeds(&["convert", "phone.csv", "old.csv", "--force"]);
    assert!(lab.read("old.csv").len() > 1000);
}

#[test]
fn the_fixes_of_a_receiver_become_a_map() {
    let lab = Lab::new();
    let log = "$GPGGA,123519.50,4807.038,N,01131.324,E,1,08,0.9,545.4,M,46.9,M,,*69\n\
        $GPGGA,123520.50,4807.040,N,01131.326,E,1,08,0.9,545.4,M,46.9,M,,*6E\n";
    lab.write("bridge.nmea", log);
    let said = lab.succeeds(&["convert", "bridge.nmea", "voyage.kml"]);
    contains(&said, &["2 samples written to voyage.kml"]);
    contains(
        &lab.read("voyage.kml"),
        &["<name>bridge</name>", "11.522066667,48.117300000,592.300"],
    );
    lab.write("imu.csv", csv(IMU, 10, |_| "0,0,0,0,0,9.81".to_owned()));
    let message = lab.refuses(&["convert", "imu.csv", "imu.gpx"]);
    contains(&message, &["imu.csv", "no fix of a satellite receiver"]);
}

#[test]
fn info_says_what_a_recording_holds() {
    let lab = Lab::with_phone();
    let text = lab.succeeds(&["info", "phone.csv"]);
    contains(
        &text,
        &[
            "of samples",
            "gyroscope",
            "100.00",
            "reference",
            "world frame  east, north, up",
            "run phone.csv",
        ],
    );
    assert!(!text.contains("error-state"), "{text}");
    let found = lab.json(&["info", "phone.csv", "--json"]);
    let force = &found["sensors"][1];
    assert_eq!(force["sensor"], "accelerometer");
    let length = force["mean_length"].as_f64().unwrap();
    assert!((length - 9.8).abs() < 0.1, "{length}");
    assert!((force["rate_hz"].as_f64().unwrap() - 100.0).abs() < 0.5);

    let row = |k: usize| {
        let t = k as f64 * 0.01 + if k < 150 { 0.0 } else { 3.0 };
        format!("{t:.2},0.0,0.0,0.0,0.0,0.0,9.81\n")
    };
    let rows: String = (0..400).map(row).collect();
    lab.write("pause.csv", format!("{IMU}\n{rows}"));
    let found = lab.json(&["info", "pause.csv", "--json"]);
    let rates = &found["sensors"][0];
    assert!(
        (rates["longest_pause_s"].as_f64().unwrap() - 3.01).abs() < 1e-6,
        "{rates}"
    );
    assert!(
        (rates["longest_pause_at_s"].as_f64().unwrap() - 1.49).abs() < 1e-6,
        "{rates}"
    );
    lab.refuses(&["info", "nothing.csv"]);
}
