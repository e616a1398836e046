//! `northing run` with navigation estimators, and `northing tune`.

use std::fmt::Write as _;

use crate::support::{Lab, contains};

/// A car: it stands for 5 s, pulls away to 10 m/s, and after 75 s drives circles; IMU at 50 Hz, fixes at 1 Hz.
pub(crate) fn with_car() -> Lab {
    let lab = Lab::new();
    let (mut imu, mut gnss) = (
        "t_s,wx,wy,wz,fx,fy,fz\n".to_owned(),
        "t_s,lat_deg,lon_deg,h_m,vn,ve,vd\n".to_owned(),
    );
    let (mut speed, mut course, mut north, mut east) = (0.0_f64, 0.4_f64, 0.0_f64, 0.0_f64);
    for k in 0..6000_u32 {
        let t = f64::from(k) * 0.02;
        let forward = if (5.0..10.0).contains(&t) { 2.0 } else { 0.0 };
        let turn = if t > 75.0 { 0.15 } else { 0.0 };
        let shake = 0.05 * (t * 37.0).sin();
        writeln!(
            imu,
            "{t:.2},{:.6},{:.6},{:.6},{:.5},{:.5},{:.5}",
            0.01 * shake,
            -0.02 * shake,
            turn + 0.01 * shake,
            forward + shake,
            speed * turn - shake,
            -9.80665 + shake
        )
        .unwrap();
        if k % 50 == 0 {
            // Errors of a metre without pattern, the same on every machine.
            let off = |n: f64| 1.5 * (f64::from(k) * n).sin();
            let latitude = 48.0 + (north + off(12.9)) / 111_200.0;
            let longitude = 11.0 + (east + off(7.7)) / 74_600.0;
            writeln!(
                gnss,
                "{t:.2},{latitude:.8},{longitude:.8},{:.2},{:.3},{:.3},0.0",
                500.0 + off(3.3),
                speed * course.cos(),
                speed * course.sin()
            )
            .unwrap();
        }
        north += speed * course.cos() * 0.02;
        east += speed * course.sin() * 0.02;
        speed += forward * 0.02;
        course += turn * 0.02;
    }
    lab.write("imu.csv", imu);
    lab.write("gnss.csv", gnss);
    lab.write("car.toml", MANIFEST);
    lab
}

pub(crate) const MANIFEST: &str = r#"
name = "car"
world_frame = "ned"

[[source]]
file = "imu.csv"
time = { column = "t_s", unit = "s" }
gyroscope = { columns = ["wx", "wy", "wz"] }
accelerometer = { columns = ["fx", "fy", "fz"] }

[[source]]
file = "gnss.csv"
time = { column = "t_s", unit = "s" }
gnss_position = { latitude = "lat_deg", longitude = "lon_deg", height = "h_m" }
gnss_velocity = { columns = ["vn", "ve", "vd"] }
"#;

#[test]
fn json_has_what_scripts_read_and_the_filter_beats_no_filter() {
    let json = with_car().json(&[
        "run",
        "car.toml",
        "--estimator",
        "error-state",
        "--gnss-every",
        "2",
        "--outage",
        "60:10",
        "--score-from",
        "20",
        "--json",
    ]);
    let position = &json["position"];
    let number = |key: &str| position[key].as_f64().unwrap();
    assert!(number("horizontal_rmse_m") < 3.0, "{position}");
    assert!(number("horizontal_rmse_m") < number("hold_rmse_m"));
    assert!(number("vertical_rmse_m") < 3.0 && number("scored_fixes") > 30.0);
    for key in ["velocity_rmse_m_s", "heading_rmse_deg"] {
        assert!(json[key].is_f64(), "{key}");
    }
    let outage = &json["outages"][0];
    assert_eq!(outage["start_s"].as_f64(), Some(60.0));
    assert_eq!(outage["duration_s"].as_f64(), Some(10.0));
    assert!(outage["horizontal_error_m"].as_f64().unwrap() < 20.0);
    assert!(outage["predicted_std_m"].is_f64());
    assert!(json["aids"]["gnss-position"]["nis"]["mean"].is_f64());
    for worth in ["aligning_s", "aided_s", "dead_reckoning_s", "invalid_s"] {
        assert!(json["validity"][worth].is_f64(), "{worth}");
    }
    assert!(json["validity"]["dead_reckoning_s"].as_f64().unwrap() > 5.0);
}

#[test]
fn estimates_and_a_report_are_written() {
    let lab = with_car();
    let text = lab.succeeds(&[
        "run",
        "car.toml",
        "--estimator",
        "error-state",
        "--gnss-every",
        "2",
        "--out",
        "car.csv",
        "--report",
        "car.html",
    ]);
    contains(
        &text,
        &[
            "position",
            "RMS horizontally",
            "solution status",
            "Estimates: car.csv",
        ],
    );
    let estimates = lab.read("car.csv");
    assert!(estimates.starts_with("t_s,latitude_deg,longitude_deg,height_m,"));
    let row: Vec<_> = estimates.lines().last().unwrap().split(',').collect();
    assert!((row[1].parse::<f64>().unwrap() - 48.0).abs() < 0.01);
    assert_eq!((row.len(), row[19]), (20, "aided"));
    for track in ["car.kml", "car.gpx", "car.geojson", "car.tum"] {
        let run = [
            "run",
            "car.toml",
            "--estimator",
            "error-state",
            "--out",
            track,
        ];
        lab.succeeds(&run);
        assert!(lab.read(track).len() > 1000, "{track}");
    }
    let report = lab.read("car.html");
    contains(
        &report,
        &[
            "Where was car?",
            "Track",
            "Orientation",
            "Aiding innovations",
            "held-out fixes",
        ],
    );
    assert!(!report.contains("NaN"));
    // The car has no magnetometer: no caption speaks of one.
    assert!(report.contains("what the accelerometer says without a filter"));
    assert!(!report.contains("accelerometer and magnetometer say"));
}

#[test]
fn a_folder_of_kf_gins_tables_is_run_as_it_is() {
    let lab = with_car();
    let numbers =
        |line: &str| -> Vec<f64> { line.split(',').map(|x| x.parse().unwrap()).collect() };
    let (mut imu, mut gnss) = (String::new(), String::new());
    for row in lab.read("imu.csv").lines().skip(1).map(numbers) {
        write!(imu, "{:.3}", 300_000.0 + row[0]).unwrap();
        for value in &row[1..] {
            write!(imu, " {:.9}", value * 0.02).unwrap();
        }
        imu.push('\n');
    }
    for row in lab.read("gnss.csv").lines().skip(1).map(numbers) {
        let [t, latitude, longitude, height] = [300_000.0 + row[0], row[1], row[2], row[3]];
        writeln!(
            gnss,
            "{t:.3} {latitude:.9} {longitude:.9} {height:.4} 1.0 1.0 1.0"
        )
        .unwrap();
    }
    std::fs::create_dir(lab.path("drive")).unwrap();
    lab.write("drive/imu.txt", imu);
    lab.write("drive/gnss.txt", gnss);
    let run = [
        "run",
        "drive",
        "--estimator",
        "error-state",
        "--gnss-every",
        "2",
        "--json",
    ];
    let json = lab.json(&run);
    let position = &json["position"];
    assert!(
        position["horizontal_rmse_m"].as_f64().unwrap() < 3.0,
        "{position}"
    );
    assert_eq!(json["inertial_samples"].as_u64(), Some(5999));
    // The increments alone have no fix in them.
    let message = lab.refuses(&["run", "drive/imu.txt", "--estimator", "error-state"]);
    contains(&message, &["drive/imu.txt", "fix"]);
}

#[test]
fn the_other_estimators_run_on_the_same_file() {
    let lab = with_car();
    let error = |estimator: &str| {
        let options = [
            "run",
            "car.toml",
            "--gnss-every",
            "2",
            "--json",
            "--estimator",
        ];
        let json = lab.json(&[&options[..], &[estimator]].concat());
        assert_eq!(json["estimator"].as_str(), Some(estimator));
        json["position"]["horizontal_rmse_m"].as_f64().unwrap()
    };
    let best = error("error-state");
    let axis_filters = error("axis-filters");
    assert!(
        axis_filters > best,
        "{axis_filters} m, error-state {best} m"
    );
    // The receiver's velocities, which it goes on with, are exact in this file.
    let reckoned = error("dead-reckoning");
    assert!(reckoned > 0.8 * best, "{reckoned} m, error-state {best} m");
}

#[test]
fn options_that_do_not_fit_are_refused_with_what_to_do() {
    let lab = with_car();
    lab.succeeds(&["demo", "--record-only", "phone.csv"]);
    let navigate = |more: &[&str]| {
        lab.refuses(&[&["run", "car.toml", "--estimator", "error-state"], more].concat())
    };
    for (more, expected) in [
        (&["--outage", "60"][..], "expected START:DURATION"),
        (&["--gnss-every", "0"], "0"),
        (
            &["--sensors", "gyro,acc"],
            "--sensors has no effect on `error-state`",
        ),
        (&["--without", "sonar"], "unknown aid `sonar`"),
        (&["--set", "colour=3"], "unknown parameter `colour`"),
        (&["--set", "gravity=-3"], "gravity"),
        (&["--out", "car.xyz"], "car.xyz"),
    ] {
        let message = navigate(more);
        assert!(message.contains(expected), "{more:?}: {message}");
    }
    let message = lab.refuses(&["run", "phone.csv", "--estimator", "error-state"]);
    contains(
        &message,
        &["phone.csv", "no usable fix", "choose another --estimator"],
    );
    let message = lab.refuses(&["run", "phone.csv", "--gnss-every", "2"]);
    contains(&message, &["--gnss-every has no effect", "error-state"]);
    let message = lab.refuses(&["run", "car.toml", "--estimator", "ins"]);
    contains(&message, &["unknown estimator `ins`", "error-state"]);
}

#[test]
fn noise_is_fitted_written_and_used() {
    let lab = with_car();
    let text = lab.succeeds(&[
        "tune",
        "car.toml",
        "--parameters",
        "accelerometer_noise_density",
        "--out",
        "noise.toml",
    ]);
    contains(
        &text,
        &[
            "accelerometer_noise_density",
            "held-out",
            "--config noise.toml",
        ],
    );
    let run = [
        "run",
        "car.toml",
        "--estimator",
        "error-state",
        "--config",
        "noise.toml",
    ];
    lab.succeeds(&run);
    let message = lab.refuses(&["tune", "car.toml", "--parameters", "colour"]);
    contains(
        &message,
        &["unknown parameter `colour`", "gyroscope_noise_density"],
    );
    lab.refuses(&["tune", "car.toml", "--fit", "2"]);
    let message = lab.refuses(&["tune", "car.toml", "--prediction", "2"]);
    contains(
        &message,
        &[
            "--prediction has no effect on `error-state`",
            "attitude estimators",
        ],
    );
}

#[test]
fn a_tune_says_what_became_of_the_error_against_another_files_reference() {
    let lab = with_car();
    let tune = |reference: &'static str| {
        lab.succeeds(&[
            "tune",
            "car.toml",
            "--estimator",
            "dead-reckoning",
            "--parameters",
            "velocity_random_walk",
            "--reference",
            reference,
        ])
    };
    lab.succeeds(&["convert", "car.toml", "car.csv"]);
    // The fixes themselves, to which the last fix is nearest.
    contains(
        &tune("car.csv"),
        &["reference, which the fit does not see", "m before,"],
    );
    lab.write(
        "turns.tum",
        "# world_frame: ned\n0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n",
    );
    contains(&tune("turns.tum"), &["The reference was of no use"]);
}

#[test]
fn noise_of_an_attitude_estimator_is_fitted_written_and_used() {
    let lab = Lab::with_phone();
    let text = lab.succeeds(&[
        "tune",
        "phone.csv",
        "--estimator",
        "mekf",
        "--profile",
        "lab",
        "--out",
        "noise.toml",
    ]);
    contains(
        &text,
        &[
            "parameters of mekf fitted",
            "accelerometer_std",
            "reference, which the fit does not see",
            "change no innovation here: compass_std",
        ],
    );
    contains(
        &lab.read("noise.toml"),
        &["estimator = \"mekf\"", "profile = \"lab\""],
    );
    let used = lab.json(&["run", "phone.csv", "--config", "noise.toml", "--json"]);
    assert_eq!(used["estimator"], "mekf");
    assert_eq!(used["profile"], "lab");
    let message = lab.refuses(&["tune", "phone.csv", "--estimator", "complementary"]);
    contains(&message, &["complementary", "another --estimator: mekf"]);
    let message = lab.refuses(&[
        "tune",
        "phone.csv",
        "--estimator",
        "error-state",
        "--profile",
        "lab",
    ]);
    contains(&message, &["has no profiles"]);
}

#[test]
fn a_bag_of_ros_gives_the_digits_of_the_csv_of_its_samples() {
    let lab = with_car();
    lab.succeeds(&["convert", "car.toml", "car.mcap"]);
    lab.succeeds(&["convert", "car.mcap", "again.csv"]);
    let run = |file: &str| {
        let text = [
            "run",
            file,
            "--estimator",
            "error-state",
            "--gnss-every",
            "2",
        ];
        (
            lab.json(&[&text[..], &["--json"]].concat()),
            lab.succeeds(&text),
        )
    };
    let ((bag, said), (csv, _)) = (run("car.mcap"), run("again.csv"));
    assert_eq!(bag["fixes"].as_u64(), Some(120));
    for key in [
        "position",
        "fixes",
        "fixes_used",
        "aids",
        "validity",
        "heading",
    ] {
        assert!(!bag[key].is_null() || key == "heading", "{key}");
        assert_eq!(bag[key], csv[key], "{key}");
    }
    contains(
        &said,
        &["Topics that are read: /fix, /fix_velocity, /imu/data_raw."],
    );
    // The velocities come with it: degrees and radians of a place differ in the last digit alone.
    let (car, _) = run("car.toml");
    let error = |run: &serde_json::Value| run["position"]["horizontal_rmse_m"].as_f64().unwrap();
    assert!((error(&bag) - error(&car)).abs() < 1e-4, "{bag} {car}");
    assert_eq!(
        bag["aids"]["gnss-velocity"]["updates"],
        car["aids"]["gnss-velocity"]["updates"]
    );
    // The axes of the sensors, too. Of another kind they would be a quarter turn off.
    let heading = |from: &str, to: &str| -> f64 {
        lab.succeeds(&["run", from, "--estimator", "error-state", "--out", to]);
        let text = lab.read(to);
        let mut lines = text.lines();
        let column = lines
            .next()
            .unwrap()
            .split(',')
            .position(|name| name == "heading_deg");
        let last = lines.last().unwrap();
        last.split(',')
            .nth(column.unwrap())
            .unwrap()
            .parse()
            .unwrap()
    };
    let (bag, car) = (
        heading("car.mcap", "bag.csv"),
        heading("car.toml", "car.csv"),
    );
    assert!((bag - car).abs() < 0.1, "{bag} {car}");
    contains(
        &lab.succeeds(&["info", "car.mcap"]),
        &["sensor axes  forward, right, down"],
    );
}

#[test]
fn the_truth_may_be_in_another_file() {
    let lab = Lab::with_phone();
    // An estimate scored against itself has no error, whatever the format in between.
    lab.succeeds(&[
        "run",
        "phone.csv",
        "--estimator",
        "mekf",
        "--out",
        "truth.tum",
    ]);
    let run = [
        "run",
        "phone.csv",
        "--estimator",
        "mekf",
        "--reference",
        "truth.tum",
        "--json",
    ];
    let scored = lab.json(&run);
    let error = &scored["error_deg"]["total_rmse"];
    assert!(error.as_f64().is_some_and(|error| error < 1e-4), "{scored}");
    let issues = scored["issues"].to_string();
    contains(
        &issues,
        &[
            "The reference is of truth.tum: reference",
            "own reference is left out",
        ],
    );
    let lab = with_car();
    let drive = ["run", "car.toml", "--estimator", "error-state"];
    lab.succeeds(&["convert", "car.toml", "fixes.csv"]);
    let scored = lab.json(&[&drive[..], &["--reference", "fixes.csv", "--json"]].concat());
    let issues = scored["issues"].to_string();
    contains(
        &issues,
        &["The reference is of fixes.csv: reference-position, reference-velocity."],
    );
    let error = scored["position"]["horizontal_rmse_m"].as_f64();
    assert!(
        error.is_some_and(|error| (0.1..3.0).contains(&error)),
        "{scored}"
    );
    lab.write("words.csv", "t_s,a\n1,2\n");
    let refused = lab.refuses(&["run", "car.toml", "--reference", "words.csv"]);
    contains(&refused, &["words.csv"]);
    let stream = lab.refuses(&["run", "car.toml", "--reference", "none.tum"]);
    contains(&stream, &["none.tum", "cannot open it"]);
}

#[test]
fn the_log_of_a_receiver_alone_runs_without_an_estimator_being_named() {
    let lab = Lab::new();
    let mut log = String::new();
    for k in 0..1202_u32 {
        let (hours, minutes, seconds) = (8 + k / 3600, k / 60 % 60, k % 60);
        let north = 22.3215 + 0.003 * f64::from(k);
        let body = format!(
            "GPGGA,{hours:02}{minutes:02}{seconds:02}.000,52{north:07.4},N,00454.5778,E,1,8,1.0,16.0,M,47.0,M,,"
        );
        let checksum = body.bytes().fold(0, |sum, byte| sum ^ byte);
        writeln!(log, "${body}*{checksum:02X}\r").unwrap();
    }
    lab.write("drive.nmea", &log);
    let told = lab.succeeds(&["run", "drive.nmea"]);
    contains(&told, &["dead-reckoning", "1201.0 s"]);
    // An attitude needs what the log has not, and is told so.
    let refused = lab.refuses(&["run", "drive.nmea", "--estimator", "mekf"]);
    contains(
        &refused,
        &["no gyroscope sample", "--estimator dead-reckoning"],
    );
    assert!(!refused.contains("too short"), "{refused}");
}

#[test]
fn a_receivers_log_is_a_position_and_no_attitude_however_long_it_is() {
    let lab = Lab::new();
    let sentence = |body: String| {
        let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
        format!("${body}*{sum:02X}\r\n")
    };
    let log: String = (0..1201)
        .map(|k| {
            let clock = format!("12{:02}{:02}.00", 30 + k / 60 % 30, k % 60);
            sentence(format!(
                "GPGGA,{clock},4807.{:04},N,00900.0000,E,1,08,0.9,300.0,M,47.0,M,,",
                1000 + k
            ))
        })
        .collect();
    lab.write("walk.log", log);
    let text = lab.succeeds(&["run", "walk.log"]);
    contains(
        &text,
        &["dead-reckoning over 1200.0 s", "1201 of 1201 fixes"],
    );
    let refused = lab.refuses(&["run", "walk.log", "--estimator", "mekf"]);
    contains(
        &refused,
        &["no gyroscope", "choose --estimator dead-reckoning"],
    );
    assert!(!refused.contains("too short"), "{refused}");
}
