//! `northing track`: targets from tables, and what is refused.

use northing_recording::test_data::data_dir;

use crate::support::{Lab, contains};

const MANIFEST: &str = r#"
name = "pond"
[scans]
file = "scans.csv"
scan = "scan"
time_s = "t_s"
own_north_m = "n_m"
own_east_m = "e_m"
[detections]
file = "detections.csv"
scan = "scan"
relative_north_east_m = ["n_m", "e_m"]
[truth]
file = "truth.csv"
scan = "scan"
north_m = "n_m"
east_m = "e_m"
[sensors.radar]
range_std_m = 3.0
bearing_std_deg = 1.0
detection_probability = 0.9
clutter_per_km2 = 1.0
"#;

/// A boat that passes, seen every second; `spoil` changes a row of detections.
pub(crate) fn pond(spoil: impl Fn(usize, String) -> String) -> Lab {
    let lab = Lab::new();
    lab.write("pond.toml", MANIFEST);
    let table = |header: &str, row: &dyn Fn(usize) -> String| {
        (0..60).fold(format!("{header}\n"), |text, k| text + &row(k) + "\n")
    };
    let place = |k: usize| (200.0 + 2.0 * k as f64, 100.0 - 3.0 * k as f64);
    lab.write(
        "scans.csv",
        table("scan,t_s,n_m,e_m", &|k| format!("{k},{k}.0,0,0")),
    );
    lab.write(
        "truth.csv",
        table("scan,n_m,e_m", &|k| {
            format!("{k},{},{}", place(k).0, place(k).1)
        }),
    );
    lab.write(
        "detections.csv",
        table("scan,n_m,e_m", &|k| {
            let wobble = (k as f64 * 2.4).sin();
            let (n, e) = (place(k).0 + wobble, place(k).1 - wobble);
            spoil(k, format!("{k},{n:.3},{e:.3}"))
        }),
    );
    lab
}

#[test]
fn a_target_is_found_and_scored() {
    let lab = pond(|_, row| row);
    let json = lab.json(&["track", "pond.toml", "--json"]);
    let target = &json["targets"][0];
    assert!(target["rmse_m"].as_f64().unwrap() < 3.0, "{json}");
    assert!(target["median_error_m"].as_f64().unwrap() < 3.0, "{json}");
    assert!(target["coverage"].as_f64().unwrap() > 0.9, "{json}");
    assert_eq!(
        (&target["lost"], &target["switches"]),
        (&false.into(), &0.into())
    );
    assert_eq!(
        (&json["false_tracks"], &json["tracker"]),
        (&0.into(), &"schmidt".into())
    );
    let text = lab.succeeds(&[
        "track",
        "pond.toml",
        "--own-ship-std",
        "heading=3deg,position=3m",
    ]);
    contains(&text, &["pond", "RMSE m", "1 tracks confirmed"]);
}

#[test]
fn a_report_has_the_map_and_is_not_overwritten() {
    let lab = pond(|_, row| row);
    let text = lab.succeeds(&["track", "pond.toml", "--report", "r.html"]);
    contains(&text, &["Report: r.html"]);
    contains(
        &lab.read("r.html"),
        &["<svg", "Map", "target 1", "95 %", "Errors over time"],
    );
    let message = lab.refuses(&["track", "pond.toml", "--report", "r.html"]);
    contains(&message, &["exists already", "--force"]);
    lab.succeeds(&["track", "pond.toml", "--report", "r.html", "--force"]);
}

#[test]
fn tracks_are_written_as_rows_and_as_lines_of_a_map() {
    let lab = pond(|_, row| row);
    let text = lab.succeeds(&["track", "pond.toml", "--out", "tracks.csv"]);
    contains(&text, &["Tracks: tracks.csv"]);
    let table = lab.read("tracks.csv");
    let mut rows = table.lines();
    assert!(
        rows.next()
            .unwrap()
            .starts_with("t_s,track,north_m,east_m,vel_n_m_s,")
    );
    let last: Vec<f64> = rows
        .last()
        .unwrap()
        .split(',')
        .take(12)
        .map(|x| x.parse().unwrap())
        .collect();
    // The boat at 59 s, to some standard deviations, and its speed.
    let [t, track, north, east, vn, ve, nn, ne, ee, ..] = last[..] else {
        panic!("{last:?}")
    };
    assert_eq!((t, last.len()), (59.0, 12));
    assert!(
        track >= 0.0 && nn > 0.0 && ee > 0.0 && nn * ee > ne * ne,
        "{last:?}"
    );
    assert!(
        (north - 318.0).abs() < 4.0 * nn.sqrt() && (east + 77.0).abs() < 4.0 * ee.sqrt(),
        "{last:?}"
    );
    assert!((vn - 2.0).hypot(ve + 3.0) < 0.5, "{last:?}");
    contains(
        &lab.refuses(&["track", "pond.toml", "--out", "tracks.csv"]),
        &["exists already", "--force"],
    );
    contains(
        &lab.refuses(&["track", "pond.toml", "--out", "tracks.geojson"]),
        &["tracks.geojson", "where its plane is", "[plane]"],
    );
    contains(
        &lab.refuses(&["track", "pond.toml", "--out", "tracks.xls"]),
        &[
            "tracks.xls",
            ".csv, .parquet, .mcap, .geojson, .kml or .nmea",
        ],
    );
    contains(
        &lab.refuses(&["track", "pond.toml", "pond.toml", "--out", "both.csv"]),
        &["--out is about one recording"],
    );
    // With a place on Earth a map shows it: 111 m are a thousandth of a degree of latitude.
    let placed = format!("{MANIFEST}[plane]\nlatitude_deg = 60.0\nlongitude_deg = 5.0\n");
    lab.write("placed.toml", placed);
    lab.succeeds(&["track", "placed.toml", "--out", "tracks.geojson"]);
    let map: serde_json::Value = serde_json::from_str(&lab.read("tracks.geojson")).unwrap();
    let line = &map["features"][0]["geometry"];
    assert_eq!(line["type"], "LineString");
    let place = line["coordinates"].as_array().unwrap().last().unwrap();
    let (longitude, latitude) = (place[0].as_f64().unwrap(), place[1].as_f64().unwrap());
    assert!(
        ((latitude - 60.0) * 111_412.0 - north).abs() < 0.1,
        "{latitude}"
    );
    assert!(
        ((longitude - 5.0) * 55_800.0 - east).abs() < 0.1,
        "{longitude}"
    );
    lab.succeeds(&["track", "placed.toml", "--out", "tracks.csv", "--force"]);
    assert!(
        lab.read("tracks.csv")
            .lines()
            .next()
            .unwrap()
            .ends_with(",latitude_deg,longitude_deg")
    );
}

#[test]
fn an_injected_heading_error_compares_the_trackers() {
    let lab = pond(|_, row| row);
    let arguments = [
        "track",
        "pond.toml",
        "--inject-heading-std",
        "3deg",
        "--runs",
        "12",
    ];
    contains(
        &lab.succeeds(&arguments),
        &["uncompensated", "converted", "schmidt", "12 runs of pond"],
    );
    let json = lab.json(&[&arguments[..], &["--json", "--seed", "7"]].concat());
    let inside = |name: &str| json["trackers"][name]["inside_95"].as_f64().unwrap();
    assert!(inside("schmidt") > inside("uncompensated"), "{json}");
}

#[test]
fn several_recordings_are_one_document() {
    let lab = pond(|_, row| row);
    let json = lab.json(&["track", "pond.toml", "pond.toml", "--json"]);
    assert_eq!(json["recordings"].as_array().unwrap().len(), 2);
}

#[test]
fn settings_of_the_tracker_are_set_by_name_and_handed_over() {
    let lab = pond(|_, row| row);
    let json = lab.json(&["track", "pond.toml", "--set", "gate_sigmas=4", "--json"]);
    let used = |json: &serde_json::Value, name: &str| {
        let all = json["parameters"].as_array().unwrap().iter();
        all.filter(|used| used["name"] == name)
            .map(|used| (used["value"].clone(), used["origin"].clone()))
            .next()
            .unwrap()
    };
    assert_eq!(used(&json, "gate_sigmas"), (4.0.into(), "set".into()));
    let memory = used(&json, "pose_error_correlation.position_s");
    assert_eq!(memory, (300.0.into(), "default".into()));
    let learns = "learn_pose_error_correlation";
    assert_eq!(used(&json, learns), (true.into(), "default".into()));
    // Whoever says how long errors last means it.
    let set = "pose_error_correlation.heading_s=20";
    let said = lab.json(&["track", "pond.toml", "--set", set, "--json"]);
    assert_eq!(used(&said, learns), (false.into(), "set".into()));
    let both = ["track", "pond.toml", "--set", set, "--set"];
    let said = lab.json(&[&both[..], &["learn_pose_error_correlation=true", "--json"]].concat());
    assert_eq!(used(&said, learns), (true.into(), "set".into()));
    for (set, learns) in [
        ("existence.visible_s=60", "learn_visibility"),
        ("motion.straight_dwell_s=60", "learn_manoeuvres"),
    ] {
        assert_eq!(used(&json, learns).0, true);
        let said = lab.json(&["track", "pond.toml", "--set", set, "--json"]);
        assert_eq!(used(&said, learns), (false.into(), "set".into()));
        assert_eq!(
            said["learnt"]["visible_s"].is_null(),
            learns == "learn_visibility"
        );
    }
    assert_eq!(json["version"], env!("CARGO_PKG_VERSION"));
    let converted = ["track", "pond.toml", "--tracker", "converted"];
    let json = lab.json(&[&converted[..], &["--json"]].concat());
    assert_eq!(used(&json, "pose_error_correlation.position_s").0, 0.0);
    for (setting, expected) in [
        (
            "motion.turn_rate_std=4",
            "did you mean `motion.turn_rate_std_rad_s`?",
        ),
        ("gate_sigma=4", "did you mean `gate_sigmas`?"),
        ("gate_sigmas=0", "from 0.001 to 1e6"),
        (
            "pose_error_correlation.heading_s=10",
            "`converted` takes pose errors as new",
        ),
    ] {
        let message = lab.refuses(&[&converted[..], &["--set", setting]].concat());
        contains(&message, &[expected]);
    }
}

#[test]
fn every_tracker_runs_again_from_what_it_used() {
    let lab = pond(|_, row| row);
    for tracker in ["uncompensated", "converted", "schmidt"] {
        let asked = ["--tracker", tracker, "--set", "motion.straight_dwell_s=25"];
        let first = lab.json(&[&["track", "pond.toml", "--json"][..], &asked].concat());
        lab.write("used.json", first.to_string());
        let again = ["track", "pond.toml", "--json", "--config", "used.json"];
        let mut again = lab.json(&again);
        let mut parameters = first["parameters"].as_array().unwrap().clone();
        for (now, before) in again["parameters"]
            .as_array_mut()
            .unwrap()
            .iter_mut()
            .zip(&mut parameters)
        {
            assert_eq!(now["origin"], "file");
            now["origin"] = before["origin"].clone();
        }
        again["elapsed_s"] = first["elapsed_s"].clone();
        assert_eq!(again, first);
    }
    let plain = lab.json(&["track", "pond.toml", "--json"]);
    lab.write("used.json", "{\"parameters\": [], \"tracker\": \"best\"}");
    let message = lab.refuses(&["track", "pond.toml", "--config", "used.json"]);
    contains(&message, &["used.json, `tracker`: `best` is no tracker"]);
    let changed = [
        "track",
        "pond.toml",
        "--json",
        "--set",
        "motion.straight_dwell_s=25",
    ];
    assert_ne!(lab.json(&changed)["targets"], plain["targets"]);
}

#[test]
fn spoilt_detections_are_counted_and_not_fatal() {
    let lab = pond(|k, row| match k {
        20 => "20,nan,5".to_owned(),
        30 => "30,0,0".to_owned(),
        40 => "40,inf,inf".to_owned(),
        _ => row,
    });
    let json = lab.json(&["track", "pond.toml", "--json"]);
    assert_eq!(json["counts"]["detections_invalid"], 3, "{json}");
    assert_eq!(json["targets"][0]["lost"], false);
    contains(
        &lab.succeeds(&["track", "pond.toml"]),
        &["3 detections skipped: not finite"],
    );
}

#[test]
fn scans_of_another_century_and_poses_without_numbers_are_counted() {
    let lab = pond(|_, row| row);
    let scans = lab.read("scans.csv");
    let scans = scans.replace("\n30,30.0,0,0", "\n30,3000000000.0,0,0");
    lab.write(
        "scans.csv",
        scans.replace("\n10,10.0,0,0", "\n10,10.0,nan,0"),
    );
    let json = lab.json(&["track", "pond.toml", "--json"]);
    assert_eq!(json["counts"]["scans_refused_time"], 1, "{json}");
    assert_eq!(json["counts"]["scans_refused_pose"], 1, "{json}");
    assert_eq!(json["targets"][0]["lost"], false);
}

#[test]
fn covariances_that_are_none_and_rows_out_of_order_are_counted() {
    let lab = pond(|_, row| row);
    lab.write(
        "pond.toml",
        MANIFEST.replace("own_east_m", "own_position_std_m = \"p_m\"\nown_east_m"),
    );
    let row = |k: usize| {
        let std = if k == 10 { "-2" } else { "2" };
        format!("{k},{k}.0,0,0,{std}\n")
    };
    let order = (0..20).chain([21, 20]).chain(22..60);
    let rows: String = order.map(row).collect();
    lab.write("scans.csv", format!("scan,t_s,n_m,e_m,p_m\n{rows}"));
    let json = lab.json(&["track", "pond.toml", "--json"]);
    assert_eq!(json["counts"]["scans_refused_pose"], 1, "{json}");
    assert_eq!(json["counts"]["scans"], 59, "{json}");
    assert_eq!(json["left_out"]["out_of_time_order"], 1, "{json}");
    assert_eq!(json["targets"][0]["lost"], false);
    contains(
        &lab.succeeds(&["track", "pond.toml"]),
        &["1 scans or reports out of time order, put in their place"],
    );
}

#[test]
fn a_target_through_the_own_ship_ends_no_run() {
    let lab = pond(|_, row| row);
    let scans = lab.read("scans.csv");
    // once there is a track, the own ship jumps onto the target
    let place = |k: usize| (200 + 2 * k, 100 - 3 * k as i64);
    let jumped = (20..60).fold(scans, |text, k| {
        text.replace(
            &format!("\n{k},{k}.0,0,0"),
            &format!("\n{k},{k}.0,{},{}", place(k).0, place(k).1),
        )
    });
    lab.write("scans.csv", jumped);
    let json = lab.json(&["track", "pond.toml", "--json"]);
    assert_eq!(
        (
            &json["counts"]["scans"],
            &json["counts"]["scans_refused_jump"]
        ),
        (&59.into(), &1.into()),
        "{json}"
    );
    contains(
        &lab.succeeds(&["track", "pond.toml"]),
        &["1 scans refused: own ship's pose jumped"],
    );
}

#[test]
fn wrong_arguments_are_refused_in_one_line() {
    let lab = pond(|_, row| row);
    let cases: [(&[&str], &[&str]); 9] = [
        (
            &["--own-ship-std", "heading=3"],
            &["has no unit", "deg or rad"],
        ),
        (&["--own-ship-std", "heading=-3deg"], &["negative"]),
        (
            &["--own-ship-std", "roll=3deg"],
            &["neither heading=ANGLE nor position=LENGTH"],
        ),
        (
            &["--tracker", "magic"],
            &["no tracker", "uncompensated, converted, schmidt"],
        ),
        (&["--sensors", "sonar"], &["no sensor `sonar`", "radar"]),
        (&["--inject-heading-std", "3deg"], &["--runs"]),
        (
            &["--inject-heading-std", "3deg", "--runs", "0"],
            &["0 is not in 1..=100000"],
        ),
        (&["--data", "nowhere"], &["scans.csv", "cannot open it"]),
        (
            &["pond.toml", "--report", "x.html"],
            &["about one recording"],
        ),
    ];
    for (arguments, expected) in cases {
        let message = lab.refuses(&[&["track", "pond.toml"], arguments].concat());
        contains(&message, expected);
    }
    let message = lab.refuses(&["track", "missing.toml"]);
    contains(&message, &["missing.toml", "cannot read it"]);
}

#[test]
fn a_log_of_nmea_sentences_becomes_tracks() {
    let lab = Lab::new();
    lab.write(
        "ais.toml",
        "name = 'log'\n[plane]\nlatitude_deg = 37.8\nlongitude_deg = -122.4\n[ais]\nfile = 'log.nmea'\n\
         [sensors.ais]\nextent_std_m = 10.0\ndetection_probability = 0.95\nclutter_per_km2 = 0.001\n\
         covers_all = false\n",
    );
    let report = "!AIVDM,1,1,,B,15MgK45P3@G?fl0E`JbR0OwT0@MS,0*4D";
    let line = |k: u32| format!("\\c:{}*00\\{report}\n", 1_452_603_731 + 10 * k);
    lab.write(
        "log.nmea",
        (0..20).fold("noise\n".to_owned(), |log, k| log + &line(k)),
    );
    let json = lab.json(&["track", "ais.toml", "--json"]);
    assert_eq!(
        (&json["counts"]["scans"], &json["confirmed_tracks"]),
        (&20.into(), &1.into())
    );
}

#[test]
fn a_ferry_in_a_harbour_finds_its_targets() {
    let Some(data) = data_dir("a_ferry_in_a_harbour_finds_its_targets") else {
        return;
    };
    let manifest = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../examples/recordings/autoferry_03.toml"
    );
    let data = data.to_str().unwrap().to_owned();
    let json = Lab::new().json(&["track", manifest, "--data", &data, "--json"]);
    for target in json["targets"].as_array().unwrap() {
        assert_eq!(target["lost"], false, "{json}");
    }
}

/// A laser scanner on a platform whose heading drifts by 3.9 degrees with a correlation time of 2.1 s, of which only the size is told.
#[test]
fn how_long_errors_of_the_heading_last_is_learnt_and_said() {
    let lab = Lab::new();
    std::fs::create_dir(lab.path("scenes")).unwrap();
    let scenes = ["--worlds", "1", "--save", "scenes", "--json"];
    let drawn = lab.json(&[&["experiment", "tracking-worlds"][..], &scenes].concat());
    let scene = &drawn["scenes"][0]["description"];
    let number = |of: &serde_json::Value| of.as_f64().unwrap();
    let truth = number(&scene["own_ship_error"]["correlation_scans"])
        * number(&scene["sensor"]["scan_interval_s"]);
    let json = lab.json(&["track", "scenes/pedestrians-0.toml", "--json"]);
    let learnt = number(&json["learnt"]["heading_error_s"]);
    assert!(
        learnt > 0.5 * truth && learnt < 3.0 * truth,
        "{learnt} {truth}"
    );
    assert!(json["learnt"]["echoes"].as_array().unwrap().is_empty());
    let text = lab.succeeds(&["track", "scenes/pedestrians-0.toml"]);
    contains(
        &text,
        &[
            "a correlation time of 3.60 s is used for the error of the own ship's heading",
            "targets are taken to stay visible for",
        ],
    );
    let page = lab.succeeds(&["track", "scenes/pedestrians-0.toml", "--report", "p.html"]);
    contains(&page, &["p.html"]);
    contains(&lab.read("p.html"), &["Learnt from the detections"]);
}
