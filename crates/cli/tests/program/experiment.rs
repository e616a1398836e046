//! `experiment observers` on a few short flights, `experiment navigation-worlds` and `attitude-worlds` on a few worlds, `faults` on one.

use crate::support::{Lab, contains};

const SCENARIO: &str = include_str!("../../../../scenarios/observers/cascade.toml");

/// A folder with the flights, shortened to 30 s.
fn lab() -> Lab {
    let lab = Lab::new();
    let short = SCENARIO.replace("duration_s = 120.0", "duration_s = 30.0 ");
    lab.write("c.toml", short);
    lab
}

const FEW: [&str; 8] = [
    "experiment",
    "observers",
    "--scenario",
    "c.toml",
    "--flights",
    "2",
    "--condition",
    "free-1.5",
];

#[test]
fn the_experiment_prints_tables_or_one_document_and_a_report() {
    let lab = lab();
    contains(
        &lab.succeeds(&FEW),
        &[
            "Tuned on one half, scored on the other",
            "At the literature's gains",
            "free-1.5",
            "Cost of a step",
            "Is it 40 % better?",
            "For 21 % more time?",
        ],
    );
    let document = lab.json(&[&FEW[..], &["--json", "--report", "r.html", "--seed", "7"]].concat());
    assert_eq!(
        (&document["seed"], &document["flights"]),
        (&7.into(), &2.into())
    );
    let condition = &document["conditions"][0];
    assert_eq!(condition["name"], "free-1.5");
    for key in ["original_deg", "modified_deg", "ekf_deg", "gain_percent"] {
        assert!(condition[key].as_f64().unwrap().is_finite(), "{key}");
    }
    assert_eq!(condition["gain_ci95"].as_array().unwrap().len(), 2);
    for cost in [&condition["cost_ns"], &document["cost_ns"]] {
        for scheme in ["original", "modified", "ekf", "cascade", "cascade_ekf"] {
            assert!(cost[scheme].as_f64().unwrap() > 0.0, "{scheme}");
        }
    }
    let page = lab.read("r.html");
    contains(
        &page,
        &[
            "<svg",
            "free, acceleration 1.5 m/s^2",
            "is the modification worth it?",
        ],
    );
}

#[test]
fn what_cannot_be_flown_is_said_in_one_line() {
    let lab = lab();
    let with = |more: &[&'static str]| [&["experiment", "observers"][..], more].concat();
    contains(
        &lab.refuses(&with(&["--scenario", "none.toml"])),
        &["none.toml", "cannot read it"],
    );
    lab.write(
        "bad.toml",
        SCENARIO.replace("rate_hz = 100.0", "rate_hz = -1.0"),
    );
    contains(
        &lab.refuses(&with(&["--scenario", "bad.toml"])),
        &[
            "bad.toml:",
            "gyroscope.rate_hz is -1, expected a finite number above zero",
        ],
    );
    contains(
        &lab.refuses(&with(&["--condition", "free"])),
        &["no variant `free`", "free-1.5"],
    );
    contains(
        &lab.refuses(&with(&["--flights", "1"])),
        &["1 flights of rotation: expected from 2 to 500 of this length"],
    );
    contains(&lab.refuses(&with(&["--data", "nowhere"])), &["nowhere"]);
    lab.write("r.html", "mine");
    contains(&lab.refuses(&with(&["--report", "r.html"])), &["r.html"]);
    assert_eq!(lab.read("r.html"), "mine");
    // One recording: nothing is left to tune on.
    std::fs::create_dir(lab.path("one")).unwrap();
    lab.succeeds(&["demo", "--record-only", "one/phone.csv"]);
    let one = [&FEW[..], &["--data", "one"]].concat();
    contains(
        &lab.refuses(&one),
        &["one: 1 of its recordings have gyroscope", "at least 2"],
    );
}

#[test]
fn random_worlds_print_a_table_or_one_document_and_a_report() {
    let lab = Lab::new();
    let with = |more: &[&'static str]| [&["experiment", "navigation-worlds"][..], more].concat();
    let text = lab.succeeds(&with(&["--worlds", "18"]));
    contains(
        &text,
        &[
            "18 worlds, seed 1, default parameters",
            "class worlds lost known",
            "drone-hovering",
            "worlds with",
            "The worst:",
            "Lost where it can be known:",
        ],
    );
    let document = lab.json(&with(&[
        "--worlds", "18", "--class", "ship", "--json", "--report", "w.html",
    ]));
    assert_eq!(document["worlds"].as_array().unwrap().len(), 2);
    assert_eq!(document["total"]["worlds"], 2);
    let ship = &document["worlds"][1];
    assert_eq!(
        (
            &ship["description"]["number"],
            &ship["description"]["class"]
        ),
        (&16.into(), &"ship".into())
    );
    assert!(ship["all"]["extrapolation_rms_m"].as_f64().unwrap() > 0.0);
    contains(
        &lab.read("w.html"),
        &["<svg", "is it ever lost?", "World 16, ship."],
    );

    // The same world alone, second by second.
    let text = lab.succeeds(&with(&["--world", "16"]));
    contains(
        &text,
        &["World 16: ship,", "Receiver:", "stated 95 % m", "status"],
    );
    let run = lab.json(&with(&["--world", "16", "--json"]));
    let instants = run["instants"].as_array().unwrap();
    assert_eq!(
        instants.len() as u64,
        ship["all"]["instants"].as_u64().unwrap()
    );
}

#[test]
fn random_worlds_that_are_not_there_are_said_in_one_line() {
    let lab = Lab::new();
    let with = |more: &[&'static str]| [&["experiment", "navigation-worlds"][..], more].concat();
    contains(
        &lab.refuses(&with(&["--class", "tank"])),
        &["no class `tank`", "car-smooth, ", "ship"],
    );
    contains(
        &lab.refuses(&with(&["--worlds", "0"])),
        &["--worlds is 0, expected from 1"],
    );
    contains(
        &lab.refuses(&with(&["--worlds", "3", "--class", "ship"])),
        &["no world of this class among the numbers 0 to 2"],
    );
    lab.write("w.html", "mine");
    contains(
        &lab.refuses(&with(&["--world", "1", "--report", "w.html"])),
        &["w.html"],
    );
}

#[test]
fn random_boards_print_tables_or_one_document_and_a_report() {
    let lab = Lab::new();
    let with = |more: &[&'static str]| [&["experiment", "attitude-worlds"][..], more].concat();
    let text = lab.succeeds(&with(&[
        "--worlds",
        "9",
        "--estimator",
        "mekf",
        "--report",
        "w.html",
    ]));
    contains(
        &text,
        &[
            "9 worlds, seed 1, default parameters",
            "gyroscope and accelerometer",
            "mekf by motion, all sensors",
            "slow-turns",
            "vqf",
            "true cause, and what is named",
            "The worst of mekf",
        ],
    );
    contains(
        &lab.read("w.html"),
        &["<svg", "does it state its error?", "true cause", "World "],
    );
    let document = lab.json(&with(&[
        "--worlds",
        "18",
        "--motion",
        "desk",
        "--estimator",
        "mekf",
        "--estimator",
        "usque",
        "--set",
        "accelerometer_std=0.5",
        "--json",
    ]));
    assert_eq!(document["worlds"].as_array().unwrap().len(), 2);
    let first = &document["estimators"][0];
    assert_eq!(
        (&first["estimator"], &first["sensing"]),
        (&"mekf".into(), &"all".into())
    );
    assert!(first["total"]["tilt"]["pooled_coverage"].is_f64());
    assert!(document["worlds"][0]["scores"][0]["true_causes"][0].is_string());

    // One world, second by second.
    let text = lab.succeeds(&with(&["--only", "13", "--estimator", "mekf"]));
    contains(
        &text,
        &["World 13: swinging,", "Gyroscope:", "tilt error deg", "vqf"],
    );
}

#[test]
fn random_boards_that_are_not_there_are_said_in_one_line() {
    let lab = Lab::new();
    let with = |more: &[&'static str]| [&["experiment", "attitude-worlds"][..], more].concat();
    contains(
        &lab.refuses(&with(&["--motion", "flying"])),
        &["no motion `flying`", "desk, ", "fast-turns"],
    );
    contains(&lab.refuses(&with(&["--worlds", "0"])), &["--worlds is 0"]);
    contains(
        &lab.refuses(&with(&[
            "--first", "0", "--worlds", "1", "--motion", "drone",
        ])),
        &["no world of this motion"],
    );
    contains(
        &lab.refuses(&with(&["--worlds", "1", "--set", "accelerometer_std=-1"])),
        &["accelerometer_std"],
    );
}

#[test]
fn faults_print_a_table_or_one_document_and_a_report() {
    let lab = Lab::new();
    let with =
        |more: &[&'static str]| [&["experiment", "faults", "--runs", "1"][..], more].concat();
    let few = [
        "--estimator",
        "complementary",
        "--kind",
        "gyroscope-spike-all-axes",
    ];
    contains(
        &lab.succeeds(&with(&few)),
        &[
            "1 runs, seed 1, default parameters",
            "attitude, simulated worlds",
            "fault complementary",
            "gyroscope-spike-all-axes",
            "RMS/clean",
        ],
    );
    let document = lab.json(&with(
        &[&few[..], &["--json", "--report", "f.html"]].concat(),
    ));
    let [row, run] = ["rows", "runs"].map(|name| &document[name][0]);
    assert_eq!(row["fault"], "gyroscope-spike-all-axes");
    assert_eq!((&row["runs"], &row["cost"]), (&1.into(), &run["cost"]));
    assert!(run["clean_rms"].as_f64().unwrap() > 0.0);
    contains(
        &lab.read("f.html"),
        &["num toned", "does an estimator recover?"],
    );
    for (bad, expected) in [
        (
            &["--kind", "toothache"][..],
            "no fault `toothache`; expected one of gyroscope-spike",
        ),
        (
            &["--estimator", "oracle"],
            "no estimator `oracle`; expected one of bounded-velocity",
        ),
        (&["--data", "nowhere"], "nowhere"),
    ] {
        contains(&lab.refuses(&with(bad)), &[expected]);
    }
    contains(
        &lab.refuses(&with(&["--estimator", "mekf", "--kind", "fix-10km-off"])),
        &["none of these faults concerns one of these estimators"],
    );
    // A named recording on which nothing would be run is not left out without a word.
    let fixes: String = (0..2000)
        .map(|k| {
            let fix = if k % 20 == 0 { "0.7,0.1,300" } else { ",," };
            format!("{:.2},0.1,0,0,0,0,9.81,{fix}\n", 0.05 * f64::from(k))
        })
        .collect();
    let header = "t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s,acc_x_m_s2,acc_y_m_s2,acc_z_m_s2,gnss_latitude_rad,\
                  gnss_longitude_rad,gnss_height_m";
    lab.write(
        "drive.csv",
        format!("# world_frame: ned\n{header}\n{fixes}"),
    );
    for (asked, expected) in [
        (
            ["--estimator", "mekf"],
            "drive: it has fixes, so estimators of the position run on it",
        ),
        (
            ["--kind", "magnetometer-spike"],
            "drive: none of the faults that --kind names can be laid over it",
        ),
    ] {
        contains(
            &lab.refuses(&with(&[&["drive.csv"][..], &asked].concat())),
            &[expected],
        );
    }
    contains(
        &lab.refuses(&["experiment", "faults", "--runs", "0"]),
        &["--runs is 0, expected from 1 to 1000"],
    );
}

#[test]
fn random_scenes_print_tables_or_one_document_and_are_saved_for_track() {
    let lab = Lab::new();
    let with = |more: &[&'static str]| [&["experiment", "tracking-worlds"][..], more].concat();
    let text = lab.succeeds(&with(&["--worlds", "8"]));
    contains(
        &text,
        &[
            "8 scenes, seed 1, default settings",
            "class tracker scenes GOSPA",
            "aircraft schmidt 2",
            "scenes with",
            "The worst:",
        ],
    );
    // The folder is made.
    let one = lab.json(&with(&["--world", "5", "--save", "scenes", "--json"]));
    assert_eq!(one["description"]["class"], "boats");
    let cutoff = one["description"]["cutoff_m"].as_f64().unwrap();
    let cutoff = format!("{cutoff}m");
    let again = lab.json(&[
        "track",
        "scenes/boats-5.toml",
        "--cutoff",
        &cutoff,
        "--json",
    ]);
    let by_file = again["gospa_m"].as_f64().unwrap() / again["cutoff_m"].as_f64().unwrap();
    let schmidt = one["trackers"][2]["gospa"].as_f64().unwrap();
    assert_eq!(one["trackers"][2]["tracker"], "schmidt");
    assert!((by_file - schmidt).abs() < 1e-9, "{by_file} {schmidt}");
    contains(
        &lab.refuses(&with(&["--world", "5", "--save", "scenes"])),
        &["boats-5_scans.csv"],
    );
    contains(
        &lab.refuses(&with(&["--world", "5", "--save", "nowhere/scenes"])),
        &[
            "--save nowhere/scenes",
            "`nowhere` does not exist",
            "make it first",
        ],
    );
    contains(
        &lab.refuses(&with(&["--world", "5", "--save", "scenes/boats-5.toml"])),
        &["--save scenes/boats-5.toml: not a folder"],
    );
    contains(
        &lab.refuses(&with(&["--class", "submarines"])),
        &["no class `submarines`", "boats"],
    );
}
