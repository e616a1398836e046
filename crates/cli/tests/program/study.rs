//! `study`: a row a run, shards, parts, and what is refused.

use std::fs;

use serde_json::Value;

use crate::support::{Lab, contains};
use crate::track::pond;

const SCENARIO: &str = include_str!("../../../../scenarios/tracking/wilthil_brekke.toml");
const ATTITUDE: &str = r#"
question = "attitude"
estimators = ["mekf", "usque"]
seeds = [1, 2]

[sources.worlds]
count = 2

[parameters]
gate_timeout_s = 3

[grid]
accelerometer_std = { from = 0.1, to = 10, steps = 3, scale = "log" }
"#;

/// A folder with a study.
fn lab(study: &str) -> Lab {
    let lab = Lab::new();
    lab.write("study.toml", study);
    lab
}

fn hash(document: &Value) -> &str {
    let hash = document["hash"].as_str().unwrap();
    assert_eq!(hash.len(), 64);
    hash
}

/// Runs the study in three shards into folders of their own.
fn three_shards(lab: &Lab) {
    for (shard, out) in [("1/3", "a"), ("3/3", "c")] {
        lab.succeeds(&["study", "study.toml", "--shard", shard, "--out", out]);
    }
    lab.succeeds(&[
        "study",
        "study.toml",
        "--shard-index",
        "1",
        "--shards",
        "3",
        "--out",
        "b",
    ]);
}

/// One process, shards merged in any order, and a study that was cut off agree to the byte.
fn agrees_however_it_is_split(lab: &Lab, runs: u64) -> Value {
    let whole = lab.json(&["study", "study.toml", "--threads", "1", "--json"]);
    assert_eq!(whole["runs"], runs);
    three_shards(lab);
    let forward = lab.json(&[
        "study",
        "merge",
        "a",
        "b",
        "c",
        "--out",
        "forward.parquet",
        "--json",
    ]);
    let backward = lab.json(&[
        "study",
        "merge",
        "c",
        "a",
        "b",
        "--out",
        "backward.parquet",
        "--json",
    ]);
    assert_eq!(forward, whole);
    assert_eq!(backward, whole);
    let bytes = |name: &str| fs::read(lab.path(name)).unwrap();
    assert!(bytes("forward.parquet") == bytes("backward.parquet"));

    // Merged parts are a part, and two of three shards are no whole study.
    let two = lab.json(&["study", "merge", "c", "a", "--out", "two.parquet", "--json"]);
    assert!(two["runs_held"].as_u64().unwrap() < runs);
    assert_ne!(hash(&two), hash(&whole));
    let again = lab.json(&[
        "study",
        "merge",
        "b",
        "two.parquet",
        "--out",
        "again.parquet",
        "--json",
    ]);
    assert_eq!(again, whole);
    assert!(bytes("again.parquet") == bytes("forward.parquet"));

    // Parts that are there are not run again.
    fs::create_dir(lab.path("all")).unwrap();
    let mut kept = Vec::new();
    for folder in ["a", "c"] {
        for entry in fs::read_dir(lab.path(folder)).unwrap() {
            let entry = entry.unwrap();
            let to = lab.path("all").join(entry.file_name());
            fs::copy(entry.path(), &to).unwrap();
            let changed = fs::metadata(&to).unwrap().modified().unwrap();
            kept.push((to, changed));
        }
    }
    let resumed = lab.json(&["study", "study.toml", "--out", "all", "--json"]);
    assert_eq!(resumed, whole);
    for (path, changed) in kept {
        assert_eq!(fs::metadata(path).unwrap().modified().unwrap(), changed);
    }
    whole
}

#[test]
fn a_study_of_attitude_is_the_same_in_one_process_in_shards_and_cut_off() {
    let lab = lab(ATTITUDE);
    let whole = agrees_however_it_is_split(&lab, 24);
    for estimator in whole["estimators"].as_array().unwrap() {
        assert_eq!(estimator["runs"], 12);
        assert_eq!(estimator["failed"], 0);
        for score in [
            "tilt_rmse_deg",
            "nees",
            "tilt_coverage_95",
            "accelerometer_nis",
        ] {
            let score = &estimator["scores"][score];
            assert_eq!(score["count"], 12);
            assert!(score["mean"].as_f64().unwrap() > 0.0);
        }
        let levels = estimator["levels"].as_array().unwrap();
        let nis = |level: &Value| {
            level["scores"]["accelerometer_nis"]["mean"]
                .as_f64()
                .unwrap()
        };
        assert_eq!(levels.len(), 3);
        assert!((levels[1]["value"].as_f64().unwrap() - 1.0).abs() < 1e-12);
        // The more noise a filter expects, the smaller is its NIS.
        assert!(nis(&levels[0]) > nis(&levels[1]) && nis(&levels[1]) > nis(&levels[2]));
    }
    contains(
        &lab.succeeds(&["study", "merge", "a"]),
        &["study: 8 of 24 runs", "usque", "tilt_rmse_deg", "Hash "],
    );
}

#[test]
fn a_study_of_navigation_over_worlds_and_a_latin_hypercube() {
    let study = r#"
        question = "navigation"
        estimators = ["error-state"]
        [sources.worlds]
        count = 1
        class = "car-smooth"
        [navigation]
        score_from_s = 30
        [latin_hypercube]
        samples = 3
        seed = 4
        [latin_hypercube.parameters]
        gyroscope_noise_density = { from = 1e-4, to = 1e-2, scale = "log" }
    "#;
    let whole = agrees_however_it_is_split(&lab(study), 3);
    let scores = &whole["estimators"][0]["scores"];
    assert_eq!(scores["horizontal_rmse_m"]["count"], 3);
    assert!(scores["coverage_95"]["mean"].as_f64().unwrap() > 0.1);
}

#[test]
fn a_study_of_tracking_over_a_scenario_varies_its_keys() {
    let study = r#"
        question = "tracking"
        estimators = ["converted", "schmidt"]
        seeds = { first = 5, count = 3 }
        [sources.scenario]
        file = "s.toml"
        [grid]
        radar.sigma_range_m = [5, 50]
    "#;
    let lab = lab(study);
    lab.write(
        "s.toml",
        SCENARIO.replace("duration_s = 300.0", "duration_s = 70.0 "),
    );
    let whole = agrees_however_it_is_split(&lab, 12);
    for estimator in whole["estimators"].as_array().unwrap() {
        let rmse = |level: usize| {
            let scores = &estimator["levels"][level]["scores"];
            scores["position_rmse_m"]["mean"].as_f64().unwrap()
        };
        assert!(rmse(1) > rmse(0));
    }
}

#[test]
fn a_study_of_tracking_over_a_recording_draws_heading_errors_from_its_seeds() {
    let lab = pond(|_, row| row);
    let study = r#"
        question = "tracking"
        estimators = ["uncompensated", "schmidt"]
        seeds = { first = 1, count = 4 }
        [sources]
        recordings = ["pond.toml"]
        [tracking]
        injected_heading_std_deg = 3
        [grid]
        gate_sigmas = [3, 5]
    "#;
    lab.write("study.toml", study);
    let whole = agrees_however_it_is_split(&lab, 16);
    let mean = |estimator: usize, score: &str| {
        let score = &whole["estimators"][estimator]["scores"][score];
        score["mean"].as_f64().unwrap()
    };
    for estimator in [0, 1] {
        assert!(mean(estimator, "coverage") > 0.5 && mean(estimator, "gospa_m") > 0.0);
        assert!(mean(estimator, "targets").to_bits() == 1.0_f64.to_bits());
    }
    // One of them knows of the error.
    assert!(mean(1, "anees") < mean(0, "anees"));
    lab.write("study.toml", study.replace("3, 5", "3, -5"));
    contains(
        &lab.refuses(&["study", "study.toml"]),
        &["`gate_sigmas`: `-5` does not fit"],
    );
}

#[test]
fn recordings_are_named_as_the_study_names_them_and_told_by_their_bytes() {
    let study = r#"
        question = "attitude"
        estimators = ["mekf"]
        [sources]
        recordings = ["walks"]
    "#;
    let lab = Lab::with_phone();
    lab.write("study.toml", study);
    fs::create_dir(lab.path("walks")).unwrap();
    fs::copy(lab.path("phone.csv"), lab.path("walks/one.csv")).unwrap();
    let before = lab.json(&["study", "study.toml", "--out", "parts", "--json"]);
    assert_eq!(
        before["estimators"][0]["scores"]["tilt_rmse_deg"]["count"],
        1
    );
    let run = lab.json(&["run", "phone.csv", "--estimator", "mekf", "--json"]);
    assert_eq!(
        before["estimators"][0]["scores"]["tilt_rmse_deg"]["least"],
        run["error_deg"]["inclination_rmse"]
    );

    // Other data of the same name are another study.
    let text = lab.read("phone.csv");
    let short: Vec<&str> = text.lines().take(6000).collect();
    lab.write("walks/one.csv", short.join("\n"));
    contains(
        &lab.refuses(&["study", "study.toml", "--out", "parts"]),
        &[
            "parts/runs-00000000-00000000.parquet is of another study than study.toml: the data of walks/one.csv (SHA-256",
            " and ",
        ],
    );
    let after = lab.json(&["study", "study.toml", "--out", "others", "--json"]);
    assert_ne!(hash(&after), hash(&before));
    contains(
        &lab.refuses(&["study", "merge", "parts", "others"]),
        &[
            "is of another study than parts/runs-00000000-00000000.parquet: the data of walks/one.csv",
        ],
    );

    // And so is another version of the program, whose number stands in the part.
    let part = lab.path("others/runs-00000000-00000000.parquet");
    let mut bytes = fs::read(&part).unwrap();
    let version = format!("northing {}", env!("CARGO_PKG_VERSION"));
    let header = format!("\"program\":\"{version}\"");
    let at = bytes
        .windows(header.len())
        .position(|window| window == header.as_bytes());
    let digit = at.unwrap() + "\"program\":\"northing ".len();
    bytes[digit] = b'7';
    fs::write(&part, bytes).unwrap();
    let other = version.replacen(" 0", " 7", 1);
    contains(
        &lab.refuses(&["study", "study.toml", "--out", "others"]),
        &[&format!(
            "the version of the program ({version} and {other}) differs"
        )],
    );
    // Standard seeds and nothing drawn from them: the same rows again.
    lab.write("seeds.toml", format!("seeds = [1, 2]\n{study}"));
    contains(
        &lab.refuses(&["study", "seeds.toml"]),
        &["a recording is the same for every seed"],
    );
}

#[test]
fn what_cannot_be_a_study_is_refused_in_one_line() {
    let lab = Lab::new();
    lab.write("s.toml", SCENARIO);
    let refused = |study: &str, parts: &[&str]| {
        lab.write("study.toml", study);
        let message = lab.refuses(&["study", "study.toml"]);
        contains(&message, &[&["study.toml"], parts].concat());
    };
    let with = |from: &str, to: &str| {
        assert!(ATTITUDE.contains(from), "{from}");
        ATTITUDE.replace(from, to)
    };
    refused(
        &with("accelerometer_std", "acelerometer_std"),
        &["unknown parameter `acelerometer_std`; did you mean `accelerometer_std`?"],
    );
    refused(
        &with("gate_timeout_s = 3", "gate_timeout_s = -3"),
        &["`gate_timeout_s`: `-3` does not fit"],
    );
    refused(
        &with("to = 10,", "to = 1e9,"),
        &["accelerometer_std", "does not fit"],
    );
    refused(
        &with("\"usque\"]", "\"usque\", \"integration\"]"),
        &["has no effect on `integration`"],
    );
    refused(
        &with("\"usque\"", "\"kalman\""),
        &["unknown estimator `kalman`; expected one of: integration, mekf3"],
    );
    refused(&with("\"usque\"", "\"mekf\""), &["`mekf` is named twice"]);
    refused(
        &with("[\"mekf\", \"usque\"]", "[]"),
        &["estimators: the list is empty"],
    );
    refused(
        &with("[sources.worlds]", "[sources.world]"),
        &["line 6: unknown field `world`, expected one of `recordings`"],
    );
    refused(
        &with("steps = 3", "step = 3"),
        &["grid.accelerometer_std", "unknown field `step`", "`steps`"],
    );
    let grid = "{ from = 0.1, to = 10, steps = 3, scale = \"log\" }";
    refused(
        &with(grid, "[]"),
        &["grid.accelerometer_std: the list is empty"],
    );
    refused(
        &with(
            "accelerometer_std = { from = 0.1, to = 10, steps = 3, scale = \"log\" }",
            "",
        ),
        &["[grid] is empty"],
    );
    refused(
        &with("from = 0.1", "from = 0"),
        &["both ends of a log scale are above zero"],
    );
    refused(
        &with("steps = 3", "steps = 125000000"),
        &["this study has 1000000000 runs, at most 10000000"],
    );
    refused(
        &with("seeds = [1, 2]", "seeds = [1, -2]"),
        &["seeds:", "expected a list"],
    );
    refused(&with("seeds = [1, 2]", "seeds = []"), &["seeds"]);
    refused(
        &with("\"attitude\"", "\"altitude\""),
        &["unknown question `altitude`; expected one of: attitude, navigation, tracking"],
    );
    refused(
        &with("count = 2", "count = 2\nclass = \"ship\""),
        &["attitude are chosen by `motion`"],
    );
    refused(
        &with("gate_timeout_s = 3", "accelerometer_std = 3"),
        &["`accelerometer_std` is both fixed and varied"],
    );
    let tracking = |grid: &str, scenario: &str| {
        format!(
            "question = \"tracking\"\nestimators = [\"schmidt\"]\n[sources.scenario]\nfile = \"{scenario}\"\n[grid]\n{grid}\n"
        )
    };
    refused(
        &tracking("radar.sigma_rang_m = [1]", "s.toml"),
        &["unknown parameter `radar.sigma_rang_m`; did you mean `radar.sigma_range_m`?"],
    );
    refused(
        &tracking("radar.sigma_range_m = [-1]", "s.toml"),
        &["radar.sigma_range_m is -1"],
    );
    lab.write(
        "study.toml",
        tracking("radar.sigma_range_m = [1]", "none.toml"),
    );
    contains(
        &lab.refuses(&["study", "study.toml"]),
        &["none.toml: cannot read it"],
    );
    lab.refuses(&["study"]);
}

#[test]
fn shards_and_parts_that_there_are_not_are_refused() {
    let lab = lab(ATTITUDE);
    let refused = |arguments: &[&str], parts: &[&str]| {
        contains(&lab.refuses(&[&["study"], arguments].concat()), parts);
    };
    refused(
        &["study.toml", "--shard", "0/16", "--out", "p"],
        &["shard `0/16`: expected I/N with I from 1 to N"],
    );
    refused(
        &[
            "study.toml",
            "--shard-index",
            "16",
            "--shards",
            "16",
            "--out",
            "p",
        ],
        &["expected an index from 0 to 15"],
    );
    refused(
        &[
            "study.toml",
            "--shard",
            "25/25",
            "--shards",
            "25",
            "--out",
            "p",
        ],
        &["'--shard <I/N>' cannot be used with", "--shards"],
    );
    refused(&["study.toml", "--shard", "1/2"], &["--out"]);
    refused(
        &["study.toml", "--shard", "1/100", "--out", "p"],
        &["no more shards than runs"],
    );
    lab.succeeds(&["study", "study.toml", "--shard", "1/24", "--out", "p"]);
    refused(
        &["merge", "p", "p"],
        &["both hold run 0; leave one of them out"],
    );
    lab.write("nonsense.parquet", "PAR1 nonsense PAR1");
    refused(
        &["merge", "p", "nonsense.parquet"],
        &["nonsense.parquet: not a part of a study"],
    );
    refused(&["merge", "none"], &["none"]);
    lab.write("other.toml", ATTITUDE.replace("[1, 2]", "[1, 3]"));
    refused(
        &["other.toml", "--out", "p"],
        &["is of another study than other.toml: the", "differs"],
    );
}
