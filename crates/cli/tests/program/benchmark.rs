//! `northing benchmark attitude`.

use crate::support::{Lab, contains};

const HEADER: &str = "recording,estimator,total_deg,heading_deg,inclination_deg\n";

/// A folder `set` with the recordings of two virtual phones, `a` and `b`.
fn lab() -> Lab {
    let lab = Lab::new();
    std::fs::create_dir_all(lab.path("set")).unwrap();
    for (name, seed) in [("set/a.csv", "1"), ("set/b.csv", "2")] {
        lab.succeeds(&["demo", "--record-only", name, "--seed", seed]);
    }
    lab
}

#[test]
fn ours_and_peers_stand_in_one_table() {
    let lab = lab();
    lab.write(
        "peers.csv",
        format!("{HEADER}a,vqf,2,1.5,1\nset/b,vqf,4,3.5,2\nb.csv,partial,7,6,5\n"),
    );
    let text = lab.succeeds(&[
        "benchmark",
        "attitude",
        "--data",
        "set",
        "--peers",
        "peers.csv",
        "--report",
        "b.html",
    ]);
    let line = |name: &str| {
        let mut lines = text.lines().map(|line| line.split_whitespace().collect());
        lines.find(|words: &Vec<&str>| words.first() == Some(&"set") && words.get(1) == Some(&name))
    };
    let vqf = "set vqf 2 3.00 / 3.00 2.50 / 2.50 1.50 / 1.50 -";
    assert_eq!(line("vqf").unwrap().join(" "), vqf, "{text}");
    // Ours come with their own errors and, where there is a covariance, with NEES.
    let mekf = line("mekf").unwrap();
    assert!(mekf[2] == "2" && mekf.len() == 15, "{mekf:?}");
    assert!(line("integration").is_some() && line("bounded-velocity").is_some());
    assert!(line("device").is_some(), "{text}");
    contains(
        &text,
        &[
            "set/a.csv",
            "partial: rows for 1 of the 2 recordings",
            "Report: b.html",
        ],
    );
    contains(
        &lab.read("b.html"),
        &["Attitude benchmark", "vqf", "<svg", "</html>"],
    );
}

#[test]
fn json_has_the_table_and_every_score_and_ours_are_those_of_compare() {
    let lab = lab();
    lab.write("one.csv", format!("{HEADER}a,vqf,2,1.5,1\n"));
    lab.write(
        "two.csv",
        "estimator,inclination_deg,note,heading_deg,total_deg,recording\nvqf,2,x,3.5,4,b\n",
    );
    let json = lab.json(&[
        "benchmark",
        "attitude",
        "--data",
        "set",
        "--peers",
        "one.csv",
        "--peers",
        "two.csv",
        "--json",
    ]);
    let rows = json["table"].as_array().unwrap();
    assert_eq!(rows.len(), 13);
    let vqf = &rows[12];
    assert_eq!(vqf["estimator"], "vqf");
    assert_eq!(vqf["scored_recordings"], 2);
    assert_eq!(vqf["heading_deg"]["mean"], 2.5);
    assert_eq!(json["scores"].as_array().unwrap().len(), 2 * 13);
    let compared = lab.json(&["compare", "set/a.csv", "--estimators", "mekf", "--json"]);
    let ours = json["scores"].as_array().unwrap().iter();
    let mut ours = ours.filter(|s| s["estimator"] == "mekf" && s["recording"] == "set/a.csv");
    assert_eq!(
        ours.next().unwrap()["error_deg"]["total"],
        compared[0]["error_deg"]["total_rmse"]
    );
}

/// Each is one line with file, line and what was expected, before any estimator runs.
#[test]
fn a_peers_file_that_is_invalid_is_refused() {
    let lab = lab();
    let refused = |content: &[u8], expected: &[&str]| {
        lab.write("p.csv", content);
        let arguments = ["benchmark", "attitude", "--data", "set", "--peers", "p.csv"];
        contains(&lab.refuses(&arguments), expected);
    };
    let rows = |rows: &str| format!("{HEADER}{rows}").into_bytes();
    refused(
        b"recording,estimator,total_deg\na,vqf,1\n",
        &[
            "p.csv, line 1: no column `heading_deg`, `inclination_deg`; expected a header with recording,",
        ],
    );
    refused(b"", &["p.csv, line 1: no column `recording`"]);
    refused(HEADER.as_bytes(), &["p.csv, line 2: no rows"]);
    refused(
        &rows("a,vqf,1,1,1\nc,vqf,1,1,1\n"),
        &[
            "p.csv, line 3, column `recording`: `c` is none of the 2 recordings; expected a name such as `a`",
        ],
    );
    refused(
        &rows(",vqf,1,1,1\n"),
        &["line 2, column `recording`: empty"],
    );
    for bad in ["nan", "inf", "-1", "181", "x", ""] {
        refused(
            &rows(&format!("a,vqf,1,{bad},1\n")),
            &[&format!(
                "p.csv, line 2, column `heading_deg`: `{bad}`; expected degrees from 0 to 180"
            )],
        );
    }
    refused(
        &rows("a,vqf,1,1\n"),
        &["p.csv, line 2: 4 cells; expected 5, as in the header"],
    );
    refused(
        &rows("a,mekf,1,1,1\n"),
        &["line 2, column `estimator`: `mekf` is an estimator of this program"],
    );
    refused(&rows("a,,1,1,1\n"), &["line 2, column `estimator`"]);
    refused(
        &rows("a,vqf,1,1,1\nset/a,vqf,1,1,1\n"),
        &["p.csv, line 3: a second row for `vqf` on set/a.csv"],
    );
    refused(
        &[HEADER.as_bytes(), b"a,\xff\xfe,1,1,1\n"].concat(),
        &["p.csv, line 2: this is no text; expected a CSV file in UTF-8"],
    );
}

#[test]
fn a_name_that_two_folders_share_needs_its_folder() {
    let lab = lab();
    std::fs::create_dir_all(lab.path("other")).unwrap();
    std::fs::copy(lab.path("set/a.csv"), lab.path("other/a.csv")).unwrap();
    lab.write("p.csv", format!("{HEADER}a,vqf,1,1,1\n"));
    let arguments = [
        "benchmark",
        "attitude",
        "--data",
        "set",
        "--data",
        "other",
        "--peers",
        "p.csv",
    ];
    contains(
        &lab.refuses(&arguments),
        &[
            "line 2",
            "`a` is set/a.csv or other/a.csv; expected its folder before it",
        ],
    );
}

#[test]
fn folders_and_files_that_are_not_there_are_refused() {
    let lab = lab();
    let refuses =
        |arguments: &[&str]| lab.refuses(&[&["benchmark", "attitude"], arguments].concat());
    contains(&refuses(&[]), &["--data"]);
    contains(&refuses(&["--data", "none"]), &["none: no such folder"]);
    contains(
        &refuses(&["--data", "set/a.csv"]),
        &["northing compare FILE"],
    );
    contains(
        &refuses(&["--data", "set", "--peers", "none.csv"]),
        &["none.csv: cannot read it"],
    );
    #[cfg(feature = "parquet")]
    {
        lab.write("set/cut.parquet", "PAR1 and then nothing");
        lab.write("p.csv", format!("{HEADER}cut,vqf,1,1,1\n"));
        contains(
            &refuses(&["--data", "set", "--peers", "p.csv"]),
            &["cut.parquet", "needs every recording"],
        );
    }
}

/// It is left out for everybody, with the reason, and the exit code says so.
#[test]
fn a_recording_on_which_ours_fail_does_not_count_for_peers() {
    let lab = lab();
    lab.write(
        "set/cut.csv",
        "t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s\n0,0,0,0\n0.01,0,zero,0\n",
    );
    lab.write(
        "p.csv",
        format!("{HEADER}a,vqf,1,1,1\nb,vqf,2,1,1\ncut,vqf,60,60,60\n"),
    );
    let output = lab
        .program(&["benchmark", "attitude", "--data", "set", "--peers", "p.csv"])
        .output()
        .unwrap();
    assert_eq!(output.status.code(), Some(2));
    let text = String::from_utf8(output.stdout).unwrap();
    contains(&text, &["vqf 2 1.50 / 1.50 1.00 / 1.00 1.00 / 1.00"]);
    assert!(!text.contains("cut"), "{text}");
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(message.lines().count(), 1, "{message}");
    contains(&message, &["one recording is left out", "cut.csv, line 3"]);
}
