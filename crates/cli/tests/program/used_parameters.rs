//! What a run used: the same in text, JSON and report, with its origin; and a run made again from it.

use serde_json::Value;

use crate::support::{IMU, Lab, contains, csv};
use crate::{board, navigation, positions};

/// A number between -1 and 1 that looks drawn, evenly spread.
fn noise(k: usize, salt: usize) -> f64 {
    let mixed = (k * 7919 + salt * 104_729 + (k / 7) * 31_337) % 2003;
    mixed as f64 / 1001.0 - 1.0
}

/// A device at rest for half a minute whose accelerometer has a standard deviation of 0.203 m/s^2.
fn with_noisy_device() -> Lab {
    let lab = Lab::new();
    let amplitude = 0.203 * 3_f64.sqrt();
    let row = |k: usize| {
        let cell = |i: usize| match i {
            0..=2 => 0.002 * noise(k, i),
            5 => 9.80665 + amplitude * noise(k, i),
            _ => amplitude * noise(k, i),
        };
        let cells: Vec<_> = (0..6).map(|i| format!("{:.6}", cell(i))).collect();
        cells.join(",")
    };
    lab.write("noisy.csv", csv(IMU, 3000, row));
    lab
}

/// The value and the origin of a parameter.
fn used(document: &Value, name: &str) -> (f64, String) {
    let parameters = document["parameters"].as_array().unwrap();
    let found = parameters.iter().find(|used| used["name"] == name);
    let found = found.unwrap_or_else(|| panic!("{name} is missing in {parameters:?}"));
    let origin = found["origin"].as_str().unwrap().to_owned();
    (found["value"].as_f64().unwrap(), origin)
}

/// The cells of a parameter's row in a report: value, unit, origin.
fn row(html: &str, name: &str) -> Vec<String> {
    let start = format!("<code>{name}</code></th>");
    let (_, rest) = html.split_once(&start).unwrap();
    let (row, _) = rest.split_once("</tr>").unwrap();
    let cells = row.split("<td").skip(1);
    let cells = cells.map(|cell| cell.split_once('>').unwrap().1.replace("</td>", ""));
    cells.collect()
}

#[test]
fn what_a_calibration_at_the_start_measured_is_what_report_json_and_text_say() {
    let lab = with_noisy_device();
    let run = [
        "run",
        "noisy.csv",
        "--estimator",
        "mekf",
        "--profile",
        "lab",
        "--calibrate-first",
        "9",
        "--set",
        "gate_timeout_s=5",
    ];
    let json = lab.json(&[&run[..], &["--report", "r.html", "--json"]].concat());
    let (std, origin) = used(&json, "accelerometer_std");
    assert!((std - 0.203).abs() < 0.003, "{std}");
    assert_eq!(origin, "calibration");
    assert_eq!(
        used(&json, "gate_timeout_s"),
        (5.0, "set".to_owned()),
        "{json}"
    );
    assert_eq!(used(&json, "gyroscope_bias_random_walk").1, "profile");
    assert_eq!(used(&json, "accelerometer_norm_gain").1, "default");
    let cells = row(&lab.read("r.html"), "accelerometer_std");
    assert_eq!(cells[0].parse::<f64>(), Ok(std));
    assert_eq!(cells[2], "calibration");
    let text = lab.succeeds(&run);
    contains(
        &text,
        &[
            "accelerometer_std 0.20",
            "(calibration)",
            "gate_timeout_s 5 s (set)",
        ],
    );
    // The values that matter of the calibration itself, and the version.
    assert!(json["calibrations"]["rest"]["values"]["gyroscope_bias_rad_s"].is_array());
    assert_eq!(json["version"], env!("CARGO_PKG_VERSION"));
    // The same settings in the report of a comparison.
    let compare = [
        "compare",
        "noisy.csv",
        "--estimators",
        "mekf,usque",
        "--profile",
        "lab",
        "--calibrate-first",
        "9",
        "--report",
        "c.html",
    ];
    lab.succeeds(&compare);
    let cells = row(&lab.read("c.html"), "accelerometer_std");
    assert_eq!(cells[0].parse::<f64>(), Ok(std));
    assert_eq!(cells[2], "calibration");
}

/// A document without what depends on the command: origins, and whether something was set.
fn comparable(mut document: Value) -> Value {
    for used in document["parameters"].as_array_mut().unwrap() {
        used["origin"].take();
    }
    document
}

/// Runs, and runs again with the parameters that the first run used: both must agree in every digit.
fn runs_again(lab: &Lab, recording: &str, asked: &[&str], both: &[&str]) -> Value {
    let what = format!("{recording} {asked:?} {both:?}");
    let run = |more: &[&str], out: &str| {
        let common = ["run", recording, "--json", "--force", "--out", out];
        lab.succeeds(&[&common[..], more, both].concat())
    };
    let first = run(asked, "first.csv");
    lab.write("used.json", &first);
    let again = run(&["--config", "used.json"], "again.csv");
    let read = |text: &str| serde_json::from_str::<Value>(text).unwrap();
    let (first, again) = (read(&first), read(&again));
    assert_eq!(
        comparable(first.clone()),
        comparable(again.clone()),
        "{what}"
    );
    assert!(
        lab.read("first.csv") == lab.read("again.csv"),
        "{what}: other estimates"
    );
    for used in again["parameters"].as_array().unwrap() {
        assert_eq!(used["origin"], "file", "{what}: {used}");
    }
    first
}

#[test]
fn every_attitude_estimator_runs_again_from_what_it_used() {
    let lab = Lab::with_phone();
    let all = lab.json(&["estimators", "--json"]);
    let attitude = all.as_array().unwrap().iter();
    let attitude = attitude.filter(|info| info["question"] == "attitude");
    let names: Vec<&str> = attitude
        .map(|info| info["name"].as_str().unwrap())
        .collect();
    assert_eq!(names.len(), 12, "{names:?}");
    for name in names {
        for profile in ["lab", "hand-held"] {
            for both in [&[][..], &["--calibrate-first", "9"]] {
                let asked = ["--estimator", name, "--profile", profile];
                runs_again(&lab, "phone.csv", &asked, both);
            }
        }
    }
    runs_again(&lab, "phone.csv", &["--profile", "lab"], &["--smooth"]);
    runs_again(
        &lab,
        "phone.csv",
        &[],
        &["--calibrate-first", "9", "--smooth"],
    );
    lab.succeeds(&[
        "calibrate",
        "rest",
        "phone.csv",
        "--to",
        "9",
        "--out",
        "rest.toml",
    ]);
    for name in ["mekf", "bounded-velocity"] {
        let asked = ["--estimator", name, "--profile", "lab"];
        let first = runs_again(&lab, "phone.csv", &asked, &["--calibration", "rest.toml"]);
        assert_eq!(first["calibrations"]["rest"]["name"], "rest.toml");
    }
}

#[test]
fn estimators_that_use_positions_run_again_from_what_they_used() {
    let lab = positions::lab(|_, _| {});
    for name in ["cascade", "cascade-ekf"] {
        let asked = [
            "--estimator",
            name,
            "--set",
            "cascade_pole=0.3123456789012345",
        ];
        let first = runs_again(&lab, "flight.csv", &asked, &["--manifest", "flight.toml"]);
        assert!(first["position"].is_object());
    }
}

/// The car with a magnetometer, a lever arm and a latency, so that everything that a run learns makes a difference.
fn with_equipped_car() -> Lab {
    let lab = navigation::with_car();
    let mut course = 0.4_f64;
    let mut imu = String::new();
    for (k, line) in lab.read("imu.csv").lines().enumerate() {
        if k == 0 {
            imu += &format!("{line},mx,my,mz\n");
            continue;
        }
        let magnetic = course - 0.07;
        let (x, y) = (21.0 * magnetic.cos(), -21.0 * magnetic.sin());
        imu += &format!("{line},{x:.3},{y:.3},43.2\n");
        course += if (k - 1) as f64 * 0.02 > 75.0 {
            0.003
        } else {
            0.0
        };
    }
    lab.write("imu.csv", imu);
    let manifest = navigation::MANIFEST.replace(
        "accelerometer = { columns = [\"fx\", \"fy\", \"fz\"] }",
        "accelerometer = { columns = [\"fx\", \"fy\", \"fz\"] }\nmagnetometer = { columns = [\"mx\", \"my\", \"mz\"] }",
    );
    let manifest = manifest.replace(
        "[[source]]\nfile = \"gnss.csv\"",
        "[lever_arm]\nfrd_m = [0.4, 0.0, -0.9]\n\n[latency]\ngnss_position_s = 0.1\n\n[[source]]\nfile = \"gnss.csv\"",
    );
    lab.write("car.toml", manifest);
    lab
}

#[test]
fn every_navigation_estimator_runs_again_from_what_it_used() {
    let lab = with_equipped_car();
    let both = ["--gnss-every", "2"];
    for name in ["error-state", "axis-filters", "dead-reckoning"] {
        runs_again(&lab, "car.toml", &["--estimator", name], &both);
    }
    let smooth = ["--smooth", "--outage", "80:10"];
    let asked = ["--estimator", "error-state", "--set", "zero_velocity=true"];
    let first = runs_again(&lab, "car.toml", &asked, &smooth);
    let (declination, origin) = used(&first, "declination");
    assert_eq!(origin, "learnt");
    assert!(
        (declination.to_degrees() - 4.0).abs() < 1.5,
        "{declination}"
    );
    let origin = |name: &str| {
        let all = first["parameters"].as_array().unwrap().iter();
        let mut all = all.filter(|used| used["name"] == name);
        all.next().unwrap()["origin"].clone()
    };
    assert_eq!(origin("lever_arm_m"), "recording");
    assert_eq!(origin("position_latency_s"), "recording");
    assert_eq!(origin("velocity_latency_s"), "default");
    assert_eq!(origin("zero_velocity"), "set");
    let board = board::with_board();
    runs_again(&board, "board.txt", &[], &[]);
}

#[test]
fn a_file_may_be_json_of_names_and_values_and_errors_name_the_parameter() {
    let lab = Lab::with_phone();
    lab.write(
        "a.json",
        r#"{"estimator": "usque", "accelerometer_std": 0.25}"#,
    );
    let json = lab.json(&["run", "phone.csv", "--config", "a.json", "--json"]);
    assert_eq!(json["estimator"], "usque");
    assert_eq!(used(&json, "accelerometer_std"), (0.25, "file".to_owned()));
    for (text, expected) in [
        (
            r#"{"acelerometer_std": 1}"#,
            "did you mean `accelerometer_std`?",
        ),
        (
            r#"{"estimator": "mekf", "accelerometer_std": -1}"#,
            "bad.json, `accelerometer_std`",
        ),
        (r#"{"estimator": "ukf"}"#, "unknown estimator `ukf`"),
        (
            r#"{"parameters": [{"name": "a"}]}"#,
            "without name or value",
        ),
        ("{", "not JSON"),
    ] {
        lab.write("bad.json", text);
        let message = lab.refuses(&["run", "phone.csv", "--config", "bad.json"]);
        contains(&message, &["bad.json", expected]);
    }
}

/// The word after an option.
fn after<'a>(words: &[&'a str], option: &str) -> Option<&'a str> {
    let place = words.iter().position(|word| *word == option)?;
    words.get(place + 1).copied()
}

#[test]
fn every_example_of_set_in_the_help_is_accepted_by_its_estimator() {
    let lab = Lab::with_phone();
    let mut tried = 0;
    for command in ["run", "compare", "estimators"] {
        let help = lab.succeeds(&[command, "--help"]);
        let words: Vec<&str> = help.split_whitespace().collect();
        // The example of the option itself is of the estimator that runs unless another is named.
        let of_option = words
            .windows(3)
            .filter(|w| w[0] == "One" && w[1] == "parameter,");
        let mut examples: Vec<Vec<&str>> = Vec::new();
        if of_option.count() > 0 {
            let place = words.iter().position(|w| *w == "parameter,").unwrap();
            assert_eq!(words[place + 1], "e.g.");
            examples.push(vec!["--set", words[place + 2].trim_end_matches(';')]);
        }
        let lines = help.lines().filter(|line| line.contains("northing run"));
        examples.extend(lines.map(|line| line.split_whitespace().collect()));
        for words in examples {
            let Some(setting) = after(&words, "--set") else {
                continue;
            };
            let mut run = vec!["run", "phone.csv", "--set", setting];
            for option in ["--estimator", "--profile"] {
                run.extend(
                    after(&words, option)
                        .into_iter()
                        .flat_map(|name| [option, name]),
                );
            }
            lab.succeeds(&run);
            tried += 1;
        }
    }
    assert!(tried >= 4, "{tried}");
}
