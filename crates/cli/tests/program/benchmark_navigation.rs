//! `northing benchmark navigation`.

use crate::support::{Lab, contains};

const HEADER: &str = "# world_frame: ned\n\
    t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2,gnss_latitude_rad,gnss_longitude_rad,\
    gnss_height_m,gnss_std_n_m,gnss_std_e_m,gnss_std_d_m,ref_latitude_rad,ref_longitude_rad,ref_height_m";
/// Metres of a radian of latitude.
const RADIAN_M: f64 = 6_367_400.0;

/// A car that stands for 10 s and then drives north in waves, 100 s at 50 Hz with a fix a second.
fn drive(first_fix: Option<[f64; 2]>, reference: bool) -> String {
    let (latitude, longitude) = (0.82, 0.14);
    let (mut north, mut speed) = (0.0, 0.0);
    let mut text = format!("{HEADER}\n");
    for k in 0..5000 {
        let t = f64::from(k) * 0.02;
        let acceleration = if t < 10.0 {
            0.0
        } else {
            (0.4 * (t - 10.0)).sin()
        };
        let wiggle = 0.02 * (7.0 * t).sin();
        let now = latitude + north / RADIAN_M;
        let row = if k % 50 == 0 {
            // Centimetres of noise.
            let noise = 0.02 * (1.7 * t).sin() / RADIAN_M;
            let [latitude, longitude] = first_fix
                .filter(|_| k == 0)
                .unwrap_or([now + noise, longitude]);
            format!("{latitude:.12},{longitude:.12},100,0.05,0.05,0.1,,,")
        } else if reference && k % 50 == 25 {
            format!(",,,,,,{now:.12},{longitude:.12},100")
        } else {
            ",,,,,,,,".to_owned()
        };
        text += &format!(
            "{t:.2},{:.5},0,0.001,{:.5},{wiggle:.5},-9.80665,{row}\n",
            0.01 * wiggle,
            acceleration + wiggle
        );
        speed += acceleration * 0.02;
        north += speed * 0.02;
    }
    text
}

fn lab() -> Lab {
    let lab = Lab::new();
    std::fs::create_dir_all(lab.path("drives/deeper")).unwrap();
    lab.write("drives/held_out.csv", drive(None, false));
    lab.write("drives/reference.csv", drive(None, true));
    lab.write("drives/deeper/stale.csv", drive(Some([0.01, 0.01]), true));
    lab
}

#[test]
fn every_recording_of_a_folder_stands_in_one_table_and_others_are_left_out() {
    let lab = lab();
    let imu = "t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2";
    lab.write(
        "drives/desk.csv",
        format!("{imu}\n0,0,0,0,0,0,9.81\n0.1,0,0,0,0,0,9.81\n"),
    );
    lab.write("drives/notes.txt", "dear diary\n");
    lab.write("drives/settings.toml", "colour = \"red\"\n");
    let text = lab.succeeds(&["benchmark", "navigation", "--data", "drives"]);
    contains(
        &text,
        &[
            "Of the fixes one a second is used",
            "recording",
            "drives/held_out.csv",
            "drives/reference.csv",
            "median",
            "3 recordings, 3 scored: 0 lost",
            "drives/deeper/stale.csv: 1 fix at 0.0 s is",
            "Left out:",
            "drives/desk.csv: no usable fix",
            "drives/notes.txt: not a recording",
            "drives/settings.toml",
        ],
    );
    let row = |name: &str| {
        let line = text.lines().find(|line| line.starts_with(name)).unwrap();
        line.split_whitespace()
            .map(str::to_owned)
            .collect::<Vec<_>>()
    };
    // Every second fix of the one without a reference is held out.
    let used: u32 = row("drives/held_out.csv")[1].parse().unwrap();
    assert!((20..=50).contains(&used), "{text}");
    let used: u32 = row("drives/reference.csv")[1].parse().unwrap();
    assert!((51..=100).contains(&used), "{text}");
}

#[test]
fn json_has_every_score_and_they_are_those_of_run() {
    let lab = lab();
    let json = lab.json(&["benchmark", "navigation", "--data", "drives", "--json"]);
    let rows = json["recordings"].as_array().unwrap();
    assert_eq!(rows.len(), 3);
    let row = rows
        .iter()
        .find(|row| row["recording"] == "drives/held_out.csv")
        .unwrap();
    assert_eq!(
        (row["gnss_every"].as_u64(), row["fixes_given"].as_u64()),
        (Some(2), Some(50))
    );
    assert_eq!(row["scored_against"], "held-out fixes");
    assert_eq!(row["outages"]["made"], 2);
    let run = |more: &[&str]| {
        let run = [
            "run",
            "drives/held_out.csv",
            "--estimator",
            "error-state",
            "--json",
        ];
        let thinned = ["--gnss-every", "2", "--score-from", "5"];
        lab.json(&[&run[..], &thinned, more].concat())
    };
    assert_eq!(row["position"], run(&[])["position"]);
    let whole = run(&["--smooth"]);
    let batch = [&row["batch"], &whole["position"]].map(|scores| &scores["horizontal_rmse_m"]);
    assert_eq!(batch[0], batch[1]);
    assert_eq!(whole["smoothing"]["converged"], true);
    let outages = run(&["--outage", "20:10", "--outage", "80:10"]);
    let errors = outages["outages"].as_array().unwrap().iter();
    let errors: Vec<f64> = errors
        .filter_map(|o| o["horizontal_error_m"].as_f64())
        .collect();
    let square: f64 = errors.iter().map(|x| x * x).sum();
    let rmse = (square / errors.len() as f64).sqrt();
    let ours = row["outages"]["horizontal_rmse_m"].as_f64().unwrap();
    assert!((ours - rmse).abs() < 1e-9 * rmse, "{ours} {rmse}");
    let totals = &json["totals"];
    assert_eq!(
        (&totals["recordings"], &totals["lost"]),
        (&3.into(), &0.into())
    );
    let stale = rows
        .iter()
        .find(|row| row["recording"] == "drives/deeper/stale.csv");
    assert_eq!(stale.unwrap()["scored_against"], "reference");
    // One that is named, and smoothed.
    let smoothed = [
        "benchmark",
        "navigation",
        "drives/reference.csv",
        "--smooth",
        "--json",
    ];
    let smoothed = lab.json(&smoothed);
    assert_eq!(smoothed["smoothed"], true);
    assert_eq!(smoothed["recordings"][0]["batch"], serde_json::Value::Null);
    let error = |json: &serde_json::Value| {
        let rows = json["recordings"].as_array().unwrap();
        let row = rows
            .iter()
            .find(|row| row["recording"] == "drives/reference.csv");
        row.unwrap()["position"]["horizontal_rmse_m"]
            .as_f64()
            .unwrap()
    };
    assert!(error(&smoothed) < error(&json));
}

#[test]
fn what_cannot_be_run_is_one_line() {
    let lab = lab();
    let refused = |arguments: &[&str], expected: &[&str]| {
        let all = [&["benchmark", "navigation"], arguments].concat();
        contains(&lab.refuses(&all), expected);
    };
    refused(
        &[],
        &["no recordings: name them, or a folder of them: --data DIR"],
    );
    refused(&["--data", "nowhere"], &["nowhere: no such folder"]);
    refused(&["nowhere.csv"], &["nowhere.csv: cannot open it"]);
    refused(
        &["--data", "drives", "--estimator", "device"],
        &["nothing can be kept from it"],
    );
    refused(
        &["--data", "drives", "--estimator", "mekf"],
        &["error-state, axis-filters, dead-reckoning"],
    );
    refused(
        &[
            "--data",
            "drives",
            "--estimator",
            "axis-filters",
            "--smooth",
        ],
        &["axis-filters"],
    );
    let imu = "t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s\n0,0,0,0\n0.1,0,0,0\n";
    std::fs::create_dir(lab.path("desk")).unwrap();
    lab.write("desk/a.csv", imu);
    refused(
        &["--data", "desk"],
        &["none has satellite fixes", "desk/a.csv: no usable fix"],
    );
    refused(
        &["desk/a.csv"],
        &["desk/a.csv: no usable fix of a satellite receiver"],
    );
    std::fs::create_dir(lab.path("empty")).unwrap();
    refused(
        &["--data", "empty"],
        &["empty: no recordings in this folder"],
    );
}

#[test]
fn a_damaged_recording_does_not_hide_the_others_and_is_an_error() {
    let lab = lab();
    lab.write(
        "drives/broken.csv",
        format!("{HEADER}\n0,0,0,0,0,0,oops,,,,,,,,,\n"),
    );
    let arguments = ["benchmark", "navigation", "--data", "drives"];
    let output = lab.program(&arguments).output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    contains(
        &String::from_utf8_lossy(&output.stdout),
        &["drives/reference.csv", "3 recordings"],
    );
    contains(
        &String::from_utf8_lossy(&output.stderr),
        &["drives/broken.csv, line 3", "oops"],
    );
}

const MANIFEST: &str = r#"
name = "car"
world_frame = "ned"

[[source]]
file = "imu.csv"
time = { column = "t", unit = "s" }
gyroscope = { columns = ["wx", "wy", "wz"] }
accelerometer = { columns = ["fx", "fy", "fz"] }

[[source]]
file = "gnss.csv"
time = { column = "t", unit = "s" }
gnss_position = { latitude = "lat", longitude = "lon", height = "h" }
"#;

/// The drive in two tables: inertial samples and fixes, degrees.
fn tables() -> [String; 2] {
    let [mut imu, mut gnss] = ["t,wx,wy,wz,fx,fy,fz\n", "t,lat,lon,h\n"].map(str::to_owned);
    for line in drive(None, false).lines().skip(2) {
        let cells: Vec<&str> = line.split(',').collect();
        imu += &format!("{}\n", cells[..7].join(","));
        if let (Ok(latitude), Ok(longitude)) = (cells[7].parse::<f64>(), cells[8].parse::<f64>()) {
            let [latitude, longitude] = [latitude, longitude].map(f64::to_degrees);
            gnss += &format!("{},{latitude:.10},{longitude:.10},100\n", cells[0]);
        }
    }
    [imu, gnss]
}

#[test]
fn manifests_are_found_in_folders_and_named_with_the_folder_of_their_files() {
    let lab = Lab::new();
    let [imu, gnss] = tables();
    for folder in ["drives", "elsewhere", "tables"] {
        std::fs::create_dir(lab.path(folder)).unwrap();
    }
    for folder in ["drives", "tables"] {
        lab.write(&format!("{folder}/imu.csv"), &imu);
        lab.write(&format!("{folder}/gnss.csv"), &gnss);
    }
    lab.write("drives/car.toml", MANIFEST);
    lab.write("elsewhere/car.toml", MANIFEST);
    let found = ["benchmark", "navigation", "--data", "drives", "--json"];
    let found = lab.json(&found);
    let [row] = &found["recordings"].as_array().unwrap()[..] else {
        panic!("{found}")
    };
    assert_eq!(row["recording"], "drives/car.toml");
    let named = [
        "benchmark",
        "navigation",
        "elsewhere/car.toml",
        "--data",
        "tables",
        "--json",
    ];
    let named = lab.json(&named);
    assert_eq!(named["recordings"][0]["position"], row["position"]);
    assert!(row["position"]["scored_fixes"].as_u64().unwrap() > 20);
}
