//! Everything that can be wrong with what the program is given: one line that says what, where, what
//! was expected and what to do; exit code 2; no output left behind.

use crate::support::{IMU, Lab, contains, csv, refusal};

/// The message about a file `x.csv` with this content.
fn refused(content: impl AsRef<[u8]>) -> String {
    let lab = Lab::new();
    lab.write("x.csv", content);
    let message = lab.refuses(&[
        "run", "x.csv", "--json", "--out", "e.csv", "--report", "r.html",
    ]);
    contains(&message, &["x.csv"]);
    message
}

/// A device at rest that is tilted slowly to and fro, so that gyroscope and accelerometer must agree.
fn rocking(rate_scale: f64, force_scale: f64) -> String {
    csv(IMU, 6000, |k| {
        let t = k as f64 * 0.01;
        let angle = 0.8 * (0.7 * t).sin();
        let rate = 0.8 * 0.7 * (0.7 * t).cos() * rate_scale;
        let (sin, cos) = angle.sin_cos();
        format!(
            "{rate},0,0,0,{},{}",
            9.81 * sin * force_scale,
            9.81 * cos * force_scale
        )
    })
}

#[test]
fn no_such_file() {
    let message = Lab::new().refuses(&["run", "nowhere.csv"]);
    contains(&message, &["nowhere.csv: cannot open it", "No such file"]);
}

#[test]
fn not_a_recording() {
    contains(
        &refused("dear diary\nnothing happened\n"),
        &[
            "not a recording",
            "expected Parquet, MCAP, a bag of ROS, CSV",
        ],
    );
    contains(
        &refused([0_u8, 159, 146, 150, 0, 7]),
        &["not a recording", "binary data"],
    );
    contains(&refused("\u{7f}ELF\0\0"), &["not a recording"]);
}

#[test]
fn empty_files() {
    contains(&refused(""), &["empty: 0 bytes", "expected a recording"]);
    contains(
        &refused(format!("{IMU}\n")),
        &["empty", "expected at least one sample"],
    );
}

#[test]
fn wrong_and_missing_columns() {
    contains(
        &refused("t_s,gyro_x_rad_s,gyro_y_rad_s\n0,0,0\n"),
        &["missing column gyro_z_rad_s", "docs/formats.md"],
    );
    contains(
        &refused("time,wx,wy,wz\n0,0,0,0\n"),
        &["missing column t_s", "time, wx, wy, wz"],
    );
    let twice = refused("t_s,gyro_x_rad_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s\n0,0,0,0,0\n");
    contains(&twice, &["`gyro_x_rad_s` is there twice"]);
}

#[cfg(feature = "live")]
#[test]
fn an_input_or_a_host_that_is_none() {
    for (option, value, parts) in [
        (
            "--input",
            "telepathy=1",
            ["telepathy", "one of: sensorserver"],
        ),
        (
            "--input",
            "sensorserver=phone",
            ["HOST:PORT", "192.168.1.20:8080"],
        ),
        (
            "--input",
            "phyphox=http://phone:80/",
            ["phyphox", "without a path"],
        ),
        ("--input", "razor=/etc/passwd", ["razor", "a serial device"]),
        (
            "--allowed-host",
            "lab.example:80",
            ["lab.example:80", "without port"],
        ),
    ] {
        let message = Lab::new().refuses(&["live", "--no-open", option, value]);
        contains(&message, &parts);
    }
}

#[test]
fn a_recording_without_gyroscope() {
    let message = refused("t_s,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2\n0,0,0,9.81\n");
    contains(
        &message,
        &["no gyroscope", "it has accelerometer", "gyro_x_rad_s"],
    );
}

#[test]
fn a_cell_that_is_no_number() {
    let message = refused(csv(IMU, 50, |k| {
        if k == 7 {
            "0,0,oops,0,0,9.81"
        } else {
            "0,0,0,0,0,9.81"
        }
        .to_owned()
    }));
    contains(
        &message,
        &["x.csv, line 9, column `gyro_z_rad_s`: `oops` is not"],
    );
}

#[cfg(feature = "parquet")]
#[test]
fn truncated_parquet() {
    let lab = Lab::with_phone();
    lab.succeeds(&["convert", "phone.csv", "phone.parquet"]);
    let bytes = std::fs::read(lab.path("phone.parquet")).unwrap();
    for length in [4, 100, bytes.len() / 2, bytes.len() - 1] {
        lab.write("cut.parquet", &bytes[..length]);
        let message = lab.refuses(&["run", "cut.parquet", "--json", "--out", "e.csv"]);
        contains(&message, &["cut.parquet", "damaged or cut off"]);
    }
}

#[test]
fn samples_that_are_not_finite_are_skipped_and_counted() {
    let lab = Lab::new();
    let row = |k: usize| match k {
        300..310 => "nan,0,0,0,0,9.81",
        400..405 => "0,0,0,inf,0,9.81",
        _ => "0,0,0,0,0,9.81",
    };
    lab.write("nan.csv", csv(IMU, 1000, |k| row(k).to_owned()));
    let json = lab.json(&["run", "nan.csv", "--json"]);
    assert_eq!(json["updates"]["gyroscope"]["skipped"], 10);
    let text = lab.succeeds(&["run", "nan.csv"]);
    contains(
        &text,
        &[
            "gyroscope has 10 sample(s) with NaN",
            "accelerometer has 5 sample(s)",
        ],
    );
}

#[test]
fn time_that_goes_back_now_and_then_is_dropped_and_counted() {
    let lab = Lab::new();
    let mut text = format!("{IMU}\n");
    for k in 0..1000 {
        let t = if k == 500 { 2.0 } else { f64::from(k) * 0.01 };
        text += &format!("{t:.2},0,0,0,0,0,9.81\n");
        if k == 700 {
            text += &format!("{t:.2},0,0,0,0,0,9.81\n");
        }
    }
    lab.write("back.csv", text);
    let text = lab.succeeds(&["run", "back.csv"]);
    contains(
        &text,
        &[
            "time of gyroscope goes back once",
            "time of gyroscope repeats itself once",
        ],
    );
}

#[test]
fn time_that_runs_backwards_is_refused() {
    let message = refused((0..500).rev().fold(format!("{IMU}\n"), |text, k| {
        text + &format!("{:.2},0,0,0,0,0,9.81\n", f64::from(k) * 0.01)
    }));
    contains(&message, &["time runs backwards", "sort the rows by time"]);
}

#[test]
fn gaps_are_reported_and_widen_the_uncertainty() {
    let lab = Lab::new();
    let gap = |seconds: f64| {
        let mut text = format!("{IMU}\n");
        for k in 0..2000 {
            let t = f64::from(k) * 0.01 + if k >= 1000 { seconds } else { 0.0 };
            text += &format!("{t:.2},0,0,0,0,0,9.81\n");
        }
        text
    };
    lab.write("gap.csv", gap(4.0));
    lab.write("whole.csv", gap(0.0));
    let text = lab.succeeds(&["run", "gap.csv"]);
    contains(
        &text,
        &[
            "pauses for more than 0.5 s once",
            "the longest gap lasts 4.010 s",
        ],
    );
    let json = lab.json(&["run", "gap.csv", "--json"]);
    assert_eq!(json["gaps"]["count"], 1);
    let tilt_std = |name: &str| -> Vec<f64> {
        let out = format!("e-{name}");
        lab.succeeds(&["run", name, "--profile", "lab", "--out", &out]);
        let cell = |line: &str| line.split(',').nth(5).unwrap().parse().unwrap();
        lab.read(&out).lines().skip(1).map(cell).collect()
    };
    let largest = |stds: Vec<f64>| stds[500..].iter().copied().fold(0.0, f64::max);
    assert!(largest(tilt_std("gap.csv")) > 3.0 * largest(tilt_std("whole.csv")));
    let patient = lab.succeeds(&["run", "gap.csv", "--gap-limit", "10"]);
    assert!(!patient.contains("pauses"), "{patient}");
}

#[test]
fn without_accelerometer_or_magnetometer_it_runs_and_says_what_is_unobservable() {
    let lab = Lab::new();
    lab.write("imu.csv", csv(IMU, 1000, |_| "0,0,0,0,0,9.81".to_owned()));
    contains(
        &lab.succeeds(&["run", "imu.csv"]),
        &["unobservable", "heading"],
    );
    let gyro = "t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s";
    lab.write("gyro.csv", csv(gyro, 1000, |_| "0,0,0".to_owned()));
    contains(&lab.succeeds(&["run", "gyro.csv"]), &["unobservable"]);
}

#[test]
fn all_zero_vectors_are_skipped() {
    let lab = Lab::new();
    let header = format!("{IMU},mag_x_ut,mag_y_ut,mag_z_ut");
    lab.write(
        "zero.csv",
        csv(&header, 1000, |_| "0,0,0,0,0,9.81,0,0,0".to_owned()),
    );
    let json = lab.json(&["run", "zero.csv", "--json"]);
    assert_eq!(json["updates"]["magnetometer"]["fused"], 0);
    assert!(json["updates"]["magnetometer"]["skipped"].as_u64().unwrap() >= 900);
}

/// What a node could only start with and never do.
#[cfg(feature = "ros")]
#[test]
fn what_a_node_would_leave_unsaid() {
    let lab = Lab::new();
    let refused = lab.refuses(&["ros", "--estimator", "device"]);
    contains(&refused, &["`device`", "--estimator mekf"]);
    for option in ["--fix", "--velocity", "--pressure"] {
        let refused = lab.refuses(&["ros", "--estimator", "mekf", option, "/gps/it"]);
        contains(
            &refused,
            &[
                option,
                "`mekf` estimates the attitude",
                "--estimator error-state",
            ],
        );
    }
}

#[test]
fn degrees_where_radians_belong() {
    let message = refused(rocking(1_f64.to_degrees(), 1.0));
    contains(&message, &["gyroscope", "use --gyroscope-unit deg-per-s"]);
    let lab = Lab::new();
    lab.write("degrees.csv", rocking(1_f64.to_degrees(), 1.0));
    lab.succeeds(&["run", "degrees.csv", "--gyroscope-unit", "deg-per-s"]);
    lab.write("radians.csv", rocking(1.0, 1.0));
    lab.succeeds(&["run", "radians.csv"]);
}

#[test]
fn g_where_metres_per_second_squared_belong() {
    let message = refused(rocking(1.0, 1.0 / 9.81));
    contains(&message, &["accelerometer", "--accelerometer-unit g"]);
    let lab = Lab::new();
    lab.write("g.csv", rocking(1.0, 1.0 / 9.81));
    lab.succeeds(&["run", "g.csv", "--accelerometer-unit", "g"]);
}

#[test]
fn unknown_estimators_parameters_and_sensors_list_the_valid_ones() {
    let lab = Lab::with_phone();
    let names = "integration, mekf3, mekf, bounded-velocity, usque, quaternion-ekf, complementary, \
                 complementary-passive, complementary-direct, cascade, cascade-ekf, device";
    contains(
        &lab.refuses(&["run", "phone.csv", "--estimator", "kalman"]),
        &["`kalman`", names],
    );
    contains(
        &lab.refuses(&["compare", "phone.csv", "--estimators", "mekf,ukf"]),
        &["`ukf`", names],
    );
    let parameter = lab.refuses(&["run", "phone.csv", "--set", "acc_std=1"]);
    contains(
        &parameter,
        &[
            "unknown parameter `acc_std`",
            "accelerometer_std, ",
            "magnetometer_use",
        ],
    );
    contains(
        &lab.refuses(&["run", "phone.csv", "--set", "accelerometer_std"]),
        &["NAME=VALUE"],
    );
    contains(
        &lab.refuses(&["run", "phone.csv", "--set", "accelerometer_std=-1"]),
        &["accelerometer_std", "from 1e-6 to 10000"],
    );
    contains(
        &lab.refuses(&["run", "phone.csv", "--profile", "car"]),
        &["hand-held, lab"],
    );
    contains(
        &lab.refuses(&["run", "phone.csv", "--sensors", "gyro,gps"]),
        &["`gps`", "acc (accelerometer)"],
    );
    contains(
        &lab.refuses(&["run", "phone.csv", "--sensors", "acc,mag"]),
        &["gyroscope is missing"],
    );
    contains(
        &lab.refuses(&["run", "phone.csv", "--magnetometer", "mine"]),
        &["device, uncalibrated or calibrated=FILE"],
    );
    contains(
        &lab.refuses(&["run", "phone.csv", "--format", "xls"]),
        &["xls", "parquet, csv, sensor-logger, phyphox, mcap"],
    );
    contains(
        &lab.refuses(&["run", "phone.csv", "--smooth", "--estimator", "usque"]),
        &["no smoother for `usque`"],
    );
}

#[test]
fn configuration_files_are_checked_line_by_line() {
    let lab = Lab::with_phone();
    lab.write("bad.toml", "profile = 'lab'\nacc_std = 1\n");
    let message = lab.refuses(&["run", "phone.csv", "--config", "bad.toml"]);
    contains(
        &message,
        &[
            "bad.toml, line 2",
            "unknown parameter `acc_std`",
            "accelerometer_std",
        ],
    );
    lab.write("bad.toml", "accelerometer_std = 1\nmagnetometer_std_ut\n");
    contains(
        &lab.refuses(&["run", "phone.csv", "--config", "bad.toml"]),
        &["bad.toml, line 2: not TOML"],
    );
    contains(
        &lab.refuses(&["run", "phone.csv", "--config", "none.toml"]),
        &["none.toml: cannot read it"],
    );
}

#[test]
fn outputs_that_exist_are_not_touched_without_force() {
    let lab = Lab::with_phone();
    for option in ["--out", "--report"] {
        lab.write("old.csv", "old");
        contains(
            &lab.refuses(&["run", "phone.csv", option, "old.csv"]),
            &["old.csv: exists already", "--force"],
        );
        assert_eq!(lab.read("old.csv"), "old");
        lab.succeeds(&["run", "phone.csv", option, "old.csv", "--force"]);
        assert_ne!(lab.read("old.csv"), "old");
    }
    lab.write("old.toml", "old");
    contains(
        &lab.refuses(&["calibrate", "rest", "phone.csv", "--out", "old.toml"]),
        &["exists already"],
    );
    contains(
        &lab.refuses(&["demo", "--record-only", "phone.csv"]),
        &["exists already"],
    );
}

#[test]
fn outputs_that_cannot_be_written_are_named() {
    let lab = Lab::with_phone();
    contains(
        &lab.refuses(&["run", "phone.csv", "--out", "no/e.csv"]),
        &["no/e.csv", "folder `no` does not exist"],
    );
    contains(
        &lab.refuses(&["run", "phone.csv", "--out", "e.txt"]),
        &["e.txt", ".csv, .parquet, .tum or .mcap"],
    );
    contains(
        &lab.refuses(&["run", "phone.csv", "--report", "a.csv", "--out", "a.csv"]),
        &["--report and --out name the same file"],
    );
    contains(
        &lab.refuses(&["run", "phone.csv", "--report", "."]),
        &["it is a folder"],
    );
    contains(
        &lab.refuses(&["demo", "--out", "phone.csv"]),
        &["phone.csv", "cannot make this folder"],
    );
}

/// A failure late in the file leaves no half-written output behind.
#[test]
fn nothing_is_left_behind_by_a_run_that_fails_late() {
    let row = |k: usize| {
        if k == 1999 {
            "0,0,0,0,0,x"
        } else {
            "0,0,0,0,0,9.81"
        }
    };
    contains(
        &refused(csv(IMU, 2000, |k| row(k).to_owned())),
        &["line 2001", "`x`"],
    );
}

#[test]
fn mistakes_in_the_arguments_are_one_line_that_names_the_help() {
    let lab = Lab::new();
    contains(
        &lab.refuses(&["run"]),
        &["<RECORDING>", "northing run --help"],
    );
    contains(
        &lab.refuses(&["calibrate"]),
        &["requires a subcommand", "rest", "northing calibrate --help"],
    );
    contains(
        &lab.refuses(&["demo", "--seed", "-1"]),
        &["'-1'", "--seed", "see northing demo --help"],
    );
    contains(&lab.refuses(&["fly"]), &["fly", "northing --help"]);
    contains(
        &lab.refuses(&["run", "a.csv", "--sets", "x=1"]),
        &["--sets", "--set"],
    );
    contains(
        &lab.refuses(&["run", "a.csv", "--gap-limit", "-1"]),
        &["--gap-limit", "expected seconds"],
    );
    contains(
        &lab.refuses(&["demo", "--record-only", "-", "--format", "parquet"]),
        &["a stream can only be csv"],
    );
    contains(
        &lab.refuses(&["demo", "--record-only", "a.csv", "--format", "parquet"]),
        &["a.csv", ".parquet"],
    );
}

#[test]
fn a_stream_that_is_no_recording() {
    let lab = Lab::new();
    let output = lab
        .program(&["run", "-", "--json"])
        .write_stdin("nonsense\n")
        .output()
        .unwrap();
    contains(
        &refusal(&output, "stream"),
        &["standard input: not a recording"],
    );
    let output = lab
        .program(&["run", "-"])
        .write_stdin("PAR1xxxx")
        .output()
        .unwrap();
    contains(
        &refusal(&output, "stream"),
        &["standard input", "cannot be read from a stream"],
    );
}

#[test]
fn too_short_a_recording() {
    contains(
        &refused(csv(IMU, 20, |_| "0,0,0,0,0,9.81".to_owned())),
        &["too short", "0.190 s"],
    );
}

#[test]
fn a_setting_without_effect_is_refused() {
    let lab = Lab::with_phone();
    let run = [
        "run",
        "phone.csv",
        "--estimator",
        "integration",
        "--set",
        "accelerometer_std=0.3",
    ];
    contains(
        &lab.refuses(&run),
        &["--set accelerometer_std=0.3 has no effect on `integration`"],
    );
}

/// A magnet, a gyroscope that is off, stamps in milliseconds: the run goes on and says so.
#[test]
fn what_is_odd_about_the_sensors_is_remarked() {
    let lab = Lab::new();
    let header = format!("{IMU},mag_x_ut,mag_y_ut,mag_z_ut");
    let noise = |k: usize| (k % 7) as f64 * 1e-3;
    lab.write(
        "magnet.csv",
        csv(&header, 2000, |k| {
            format!(
                "{0},{0},{0},{0},{0},{1},150,{0},{0}",
                noise(k),
                9.8 + noise(k)
            )
        }),
    );
    contains(
        &lab.succeeds(&["run", "magnet.csv"]),
        &[
            "magnetic field is 150 microtesla strong",
            "22 to 67",
            "northing calibrate magnetometer",
        ],
    );
    lab.write(
        "off.csv",
        csv(IMU, 2000, |k| {
            format!("0,0,0,{0},{0},{1}", noise(k), 9.8 + noise(k))
        }),
    );
    contains(
        &lab.succeeds(&["run", "off.csv"]),
        &["Every one of the 2000 gyroscope samples is exactly zero"],
    );
    let mut text = format!("{IMU}\n");
    for k in 0..2000 {
        text += &format!("{},{1},{1},{1},{1},{1},9.8\n", k * 10, noise(k));
    }
    lab.write("ms.csv", text);
    contains(
        &lab.succeeds(&["run", "ms.csv"]),
        &["stamps look like milliseconds under the name of seconds (100 samples a second then)"],
    );
    // A logger with one row a second whose stamps are dates: in milliseconds they would be of 1970.
    let mut text = format!("{IMU}\n");
    for k in 0..600 {
        text += &format!(
            "{},{2},{1},{1},{1},{2},9.8\n",
            1_740_000_000 + k,
            noise(k),
            noise(k + 7)
        );
    }
    lab.write("slow.csv", text);
    let said = lab.succeeds(&["run", "slow.csv"]);
    assert!(!said.contains("under the name of"), "{said}");
}

#[test]
fn a_column_with_two_meanings_is_refused() {
    let lab = Lab::new();
    lab.write("data.txt", "t,a,b,c\n0,0,0,0\n1,0,0,0\n");
    lab.write(
        "data.toml",
        "file = 'data.txt'\n[time]\ncolumn = 't'\nunit = 's'\n[gyroscope]\ncolumns = ['a', 'a', 'c']\n",
    );
    let message = lab.refuses(&["run", "data.toml"]);
    contains(&message, &["data.toml", "column `a` is used twice"]);
}

/// A car at 10 m/s that turns into streets as if by chance, 240 s at 50 Hz with a fix a second; `change` gets each row of
/// numbers: time, rates, forces, and those of the fix where there is one.
fn car(change: impl Fn(usize, &mut Vec<f64>)) -> String {
    let mut rows: Vec<Vec<f64>> = Vec::new();
    let (mut course, mut north, mut east) = (0.5_f64, 0.0, 0.0);
    for k in 0..12_000_usize {
        let t = k as f64 * 0.02;
        let street = ((t / 6.0).floor() + 1.0).powi(2);
        let turn = 0.15 * ((7.3 * street).sin() * 2.0).round();
        let mut row = vec![t, 0.0, 0.0, turn, 0.0, 10.0 * turn, -9.80665];
        if k % 50 == 0 {
            let place = [0.82 + north / 6_367_400.0, 0.14 + east / 4_370_000.0];
            row.extend([place[0], place[1], 100.0, 1.0, 1.0, 2.0]);
        }
        change(k, &mut row);
        rows.push(row);
        course += turn * 0.02;
        north += 0.2 * course.cos();
        east += 0.2 * course.sin();
    }
    let mut text = format!(
        "# world_frame: ned\n{IMU},gnss_latitude_rad,gnss_longitude_rad,gnss_height_m,gnss_std_n_m,gnss_std_e_m,gnss_std_d_m\n"
    );
    for row in rows {
        let mut cells: Vec<String> = row.iter().map(|x| format!("{x:.10}")).collect();
        cells.resize(13, String::new());
        text += &format!("{}\n", cells.join(","));
    }
    text
}

/// The same with the fixes in a file of their own, whose clock is another: a manifest and two tables.
fn car_with_clocks_apart(lab: &Lab, offset_s: f64) {
    let [mut imu, mut gnss] = ["t,wx,wy,wz,fx,fy,fz\n", "t,lat,lon,h\n"].map(str::to_owned);
    for line in car(|_, _| {}).lines().skip(2) {
        let cells: Vec<&str> = line.split(',').collect();
        imu += &format!("{}\n", cells[..7].join(","));
        if let (Ok(latitude), Ok(longitude)) = (cells[7].parse::<f64>(), cells[8].parse::<f64>()) {
            let [latitude, longitude] = [latitude, longitude].map(f64::to_degrees);
            gnss += &format!("{},{latitude:.10},{longitude:.10},100\n", cells[0]);
        }
    }
    lab.write("imu.csv", imu);
    lab.write("gnss.csv", gnss);
    let manifest = format!(
        "name = \"car\"\nworld_frame = \"ned\"\n\n[[source]]\nfile = \"imu.csv\"\n\
         time = {{ column = \"t\", unit = \"s\" }}\ntime_offset_s = {offset_s:.1}\n\
         gyroscope = {{ columns = [\"wx\", \"wy\", \"wz\"] }}\naccelerometer = {{ columns = [\"fx\", \"fy\", \"fz\"] }}\n\n\
         [[source]]\nfile = \"gnss.csv\"\ntime = {{ column = \"t\", unit = \"s\" }}\n\
         gnss_position = {{ latitude = \"lat\", longitude = \"lon\", height = \"h\" }}\n"
    );
    lab.write("car.toml", manifest);
}

const NAVIGATE: [&str; 4] = ["run", "car.csv", "--estimator", "error-state"];

#[test]
fn fixes_that_cannot_be_used_are_one_line() {
    let lab = Lab::new();
    let refused = |content: String, expected: &[&str]| {
        lab.write("car.csv", content);
        contains(&lab.refuses(&NAVIGATE), expected);
    };
    let no_fix = car(|_, row| row.truncate(7));
    refused(no_fix, &["car.csv: no usable fix", "0 in all"]);
    let wide = car(|_, row| row.iter_mut().skip(10).for_each(|std| *std = 1e6));
    refused(wide, &["240 in all; 240: an error above 100 km is stated"]);
    let wild = car(|k, row| {
        if let Some(latitude) = row.get_mut(7) {
            *latitude = 0.01 * (k / 50 * 37 % 140) as f64;
        }
    });
    refused(wild, &["no two of the 240 fixes"]);
    // Fixes in rows of their own that have no time.
    let mut text = String::new();
    for line in car(|_, _| {}).lines() {
        let cells: Vec<&str> = line.split(',').collect();
        if line.starts_with("0.0000000000,")
            || !line.starts_with(char::is_numeric)
            || cells[7].is_empty()
        {
            text += &format!("{line}\n");
            continue;
        }
        text += &format!(
            "{},,,,,,\n,,,,,,,{}\n",
            cells[..7].join(","),
            cells[7..].join(",")
        );
    }
    let text = text.replacen(",0.8200000000,", ",,", 1);
    refused(
        text,
        &[
            "no usable fix",
            "rows without a time stamp, which were dropped: 239",
        ],
    );
}

#[test]
fn inertial_samples_and_fixes_of_different_times_are_one_line() {
    let lab = Lab::new();
    car_with_clocks_apart(&lab, 86_400.0);
    let message = lab.refuses(&["run", "car.toml", "--estimator", "error-state"]);
    contains(
        &message,
        &[
            "the inertial samples are of 86400 s to 86640 s and the fixes of 0 s to 239 s",
            "their clocks are 86400 s apart",
            "time_offset_s",
        ],
    );
}

#[test]
fn what_is_odd_about_the_turns_and_the_receiver_is_said() {
    let lab = Lab::new();
    let said = |expected: &str| {
        contains(&lab.succeeds(&NAVIGATE), &[expected]);
    };
    lab.write(
        "car.csv",
        car(|_, row| row.iter_mut().skip(10).for_each(|std| *std = 0.0)),
    );
    said("240 fixes state a standard deviation of 0 or below: taken as not stated.");
    lab.write("car.csv", car(|_, row| row[3] = row[3].to_degrees()));
    said("its rates are in degrees per second; say --gyroscope-unit deg-per-s");
    lab.write("car.csv", car(|_, row| row[3] = -row[3]));
    said("The gyroscope turns against the course");
    car_with_clocks_apart(&lab, -90.0);
    let text = lab.succeeds(&["run", "car.toml", "--estimator", "error-state"]);
    contains(
        &text,
        &["The clock of the inertial samples is 90 s behind the receiver's"],
    );
}
