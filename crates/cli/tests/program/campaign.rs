//! `simulate` and `montecarlo` on the scenario of Wilthil & Brekke.

use serde_json::Value;

use crate::support::{Lab, contains};

const SCENARIO: &str = include_str!("../../../../scenarios/tracking/wilthil_brekke.toml");
const FEW: [&str; 2] = ["--trackers", "converted,schmidt"];

/// A folder with the scenario, shortened to 70 s.
fn lab() -> Lab {
    let lab = Lab::new();
    let short = SCENARIO.replace("duration_s = 300.0", "duration_s = 70.0 ");
    lab.write("s.toml", short);
    lab
}

fn with<'a>(arguments: &[&'a str]) -> Vec<&'a str> {
    [arguments, &FEW].concat()
}

#[test]
fn a_campaign_prints_a_table_or_one_document() {
    let lab = lab();
    contains(
        &lab.succeeds(&with(&["montecarlo", "s.toml", "--runs", "3"])),
        &[
            "consistent: 3 runs, seed 1",
            "schmidt",
            "NEES: 4 is consistent",
        ],
    );
    let document = lab.json(&with(&[
        "montecarlo",
        "s.toml",
        "--variant",
        "mems",
        "--runs",
        "3",
        "--seed",
        "9",
        "--json",
        "--report",
        "r.html",
    ]));
    assert_eq!(document["scenario"], "mems");
    assert_eq!(
        (&document["runs"], &document["seed"]),
        (&3.into(), &9.into())
    );
    assert!(document["elapsed_s"].as_f64().unwrap() > 0.0);
    let tracker = &document["trackers"]["schmidt"];
    for key in [
        "position_rmse_m",
        "velocity_rmse_m_s",
        "nees_mean",
        "nees_inside_band",
        "nees_inside_band_2dof",
    ] {
        assert!(tracker[key].as_f64().unwrap() >= 0.0, "{key}");
    }
    for part in ["transient", "steady"] {
        assert!(tracker[part]["position_rmse_m"].as_f64().unwrap() > 0.0);
        assert!(tracker[part]["velocity_rmse_m_s"].as_f64().unwrap() > 0.0);
    }
    assert_eq!(tracker["series"]["nees"].as_array().unwrap().len(), 70);
    assert_eq!(document["trackers"].as_object().unwrap().len(), 2);
    assert!(lab.read("r.html").contains("<svg"));
}

/// The flag stands above the scenario, and is part of what a campaign is.
#[test]
fn a_campaign_runs_beside_the_gnss_ins() {
    let lab = lab();
    let campaign = with(&["montecarlo", "s.toml", "--runs", "3"]);
    let beside = |filter| [&campaign[..], &["--navigation", filter]].concat();
    let nees = |arguments: &[&str]| {
        let document = lab.json(&[arguments, &["--json"]].concat());
        document["trackers"]["schmidt"]["nees_mean"]
            .as_f64()
            .unwrap()
    };
    let paper = nees(&campaign);
    assert_eq!(nees(&beside("error-state")).to_bits(), paper.to_bits());
    let product = nees(&beside("gnss-ins"));
    assert!((1.0..10.0).contains(&product) && (product - paper).abs() > 1e-6);

    for (filter, shard, out) in [("error-state", "1/2", "p"), ("gnss-ins", "2/2", "q")] {
        lab.succeeds(&[&beside(filter)[..], &["--shard", shard, "--out", out]].concat());
    }
    contains(
        &lab.refuses(&["montecarlo", "merge", "p", "q"]),
        &["another campaign"],
    );
    contains(
        &lab.refuses(&[
            "montecarlo",
            "s.toml",
            "--navigation",
            "gnss-ins",
            "--trackers",
            "joint",
        ]),
        &["`joint`", "error-state"],
    );
}

#[test]
fn shards_merge_to_the_whole_to_the_last_bit() {
    let lab = lab();
    let campaign = with(&["montecarlo", "s.toml", "--runs", "5", "--seed", "4"]);
    let trackers = |mut document: Value| document["trackers"].take();
    let whole = trackers(lab.json(&[&campaign[..], &["--json", "--threads", "1"]].concat()));
    for (shard, out) in [("1/2", "a.parquet"), ("2/2", "b.parquet")] {
        lab.succeeds(&[&campaign[..], &["--shard", shard, "--out", out]].concat());
    }
    let merged = trackers(lab.json(&["montecarlo", "merge", "b.parquet", "a.parquet", "--json"]));
    assert_eq!(merged, whole);

    contains(
        &lab.refuses(&["montecarlo", "merge", "a.parquet", "a.parquet"]),
        &["a.parquet and a.parquet both hold run 0"],
    );
    let other = with(&[
        "montecarlo",
        "s.toml",
        "--runs",
        "5",
        "--seed",
        "5",
        "--shard",
        "2/2",
        "--out",
        "c.parquet",
    ]);
    lab.succeeds(&other);
    contains(
        &lab.refuses(&["montecarlo", "merge", "a.parquet", "c.parquet"]),
        &["c.parquet is of another campaign than a.parquet: the seed (4 and 5) differs"],
    );
    lab.write("d.parquet", "PAR1 nonsense PAR1");
    contains(
        &lab.refuses(&["montecarlo", "merge", "a.parquet", "d.parquet"]),
        &["d.parquet: not a part of a campaign"],
    );
}

#[test]
fn what_cannot_be_run_is_refused_in_one_line() {
    let lab = lab();
    let refused = |arguments: &[&str]| lab.refuses(&[&["montecarlo"], arguments].concat());
    contains(
        &refused(&["s.toml", "--runs", "0"]),
        &["runs is 0, expected at least 1"],
    );
    contains(
        &refused(&["s.toml", "--shard", "5/4", "--out", "x.parquet"]),
        &["shard `5/4`", "from 1 to N"],
    );
    contains(
        &refused(&["s.toml", "--variant", "papers"]),
        &["no variant `papers`", "paper, paper_halved"],
    );
    contains(
        &refused(&["s.toml", "--trackers", "kalman"]),
        &["kalman", "schmidt-feed-forward"],
    );
    contains(&refused(&["none.toml"]), &["none.toml: cannot read it"]);
    refused(&[]);
    lab.write("k.toml", SCENARIO.replace("sigma_range_m", "sigma_range"));
    contains(
        &refused(&["k.toml"]),
        &["k.toml:", "unknown field `sigma_range`", "`sigma_range_m`"],
    );
    lab.write(
        "n.toml",
        SCENARIO.replace("sigma_gyro_deg_s = 0.4", "sigma_gyro_deg_s = -0.4"),
    );
    contains(
        &refused(&["n.toml"]),
        &[
            "n.toml:",
            "imu.sigma_gyro_deg_s is -0.4, expected a finite number above zero",
        ],
    );
}

#[test]
fn one_run_is_shown_and_written() {
    let lab = lab();
    let document = lab.json(&with(&[
        "simulate", "s.toml", "--run", "2", "--out", "run.csv", "--json",
    ]));
    assert_eq!(
        (&document["run"], &document["scans"]),
        (&2.into(), &70.into())
    );
    let table = lab.read("run.csv");
    assert_eq!(table.lines().count(), 72);
    let cells = |line: &str| line.split(',').count();
    assert!(table.lines().all(|line| cells(line) == 14 + 2 * 6 + 6));
    contains(
        &lab.succeeds(&with(&["simulate", "s.toml"])),
        &["seed 1, run 0, 70 scans"],
    );
}
