//! `northing describe`, and `--describe`.

use crate::support::{Lab, contains};

/// A device that turns to and fro about x, in degrees and g, without units in the header.
fn turning(rows: usize) -> String {
    let row = |k: usize| {
        let t = k as f64 * 0.01;
        let (angle, rate) = ((2.0 * t).sin(), 2.0 * (2.0 * t).cos());
        let (y, z) = (angle.sin(), angle.cos());
        format!(
            "{};{:.4};0;0;0;{y:.5};{z:.5};{}\n",
            k * 10,
            rate.to_degrees(),
            20 + k % 2
        )
    };
    let rows: String = (0..rows).map(row).collect();
    format!("board 3\nms;gx;gy;gz;ax;ay;az;chip\n{rows}")
}

#[test]
fn a_table_is_described_and_runs_as_by_a_manifest_written_by_hand() {
    let lab = Lab::new();
    lab.write("log.txt", turning(2000));
    let told = lab.succeeds(&["describe", "log.txt", "--out", "log.toml"]);
    contains(
        &told,
        &[
            "gyroscope",
            "likely",
            "unit = \"deg-per-s\"",
            "gx, gy, gz",
            "not used: chip",
            "Read by it: 19.990 s of samples",
            "Written to log.toml",
            "run log.toml",
        ],
    );
    contains(
        &lab.read("log.toml"),
        &[
            "file = \"log.txt\"",
            "delimiter = \";\"",
            "skip_rows = 1",
            "# likely: gravity turns 1.0",
            "# certain: the header names the unit; rows come at 100.0000 Hz",
            "# Columns not used: chip",
        ],
    );
    lab.write(
        "by_hand.toml",
        "file = 'log.txt'\ndelimiter = ';'\nskip_rows = 1\ntime = { column = 'ms', unit = 'ms' }\n\
         gyroscope = { columns = ['gx', 'gy', 'gz'], unit = 'deg-per-s' }\n\
         accelerometer = { columns = ['ax', 'ay', 'az'], unit = 'g' }\n",
    );
    for (from, to) in [("log.toml", "a.csv"), ("by_hand.toml", "b.csv")] {
        lab.succeeds(&["run", from, "--out", to]);
    }
    assert_eq!(lab.read("a.csv"), lab.read("b.csv"));
    // Beside the table it is found without being named.
    contains(
        &lab.refuses(&["describe", "log.txt", "--out", "log.csv"]),
        &["log.csv", "ends in .toml"],
    );
    contains(
        &lab.refuses(&["describe", "log.txt", "--out", "log.toml"]),
        &["log.toml", "exists already", "--force"],
    );
}

#[test]
fn a_run_by_a_guess_says_what_was_guessed() {
    let lab = Lab::new();
    lab.write("log.txt", turning(2000));
    let refused = lab.refuses(&["run", "log.txt"]);
    contains(&refused, &["log.txt", "northing describe"]);
    let told = lab.succeeds(&["run", "log.txt", "--describe"]);
    contains(
        &told,
        &["Guessed (likely): gyroscope from gx, gy, gz, unit = \"deg-per-s\""],
    );
}

#[test]
fn the_document_has_manifest_guesses_and_what_was_read() {
    let lab = Lab::new();
    lab.write("log.txt", turning(500));
    let found = lab.json(&["describe", "log.txt", "--json"]);
    contains(found["manifest"].as_str().unwrap(), &["[gyroscope]"]);
    let guesses = found["guesses"].as_array().unwrap();
    let gyroscope = guesses
        .iter()
        .find(|guess| guess["key"] == "gyroscope")
        .unwrap();
    assert_eq!(gyroscope["confidence"], "likely");
    assert_eq!(found["sensors"][0]["samples"], 500);
}

#[test]
fn what_needs_no_draft_and_what_cannot_have_one_is_said() {
    let lab = Lab::with_phone();
    contains(
        &lab.refuses(&["describe", "phone.csv"]),
        &["phone.csv", "opens by itself", "info phone.csv"],
    );
    lab.write("still.csv", "a,b,c\n1,2,3\n4,5,6\n7,8,9\n");
    contains(
        &lab.refuses(&["describe", "still.csv"]),
        &[
            "still.csv",
            "neither the names of its columns nor their numbers",
        ],
    );
    contains(
        &lab.refuses(&["describe", "nothing.csv"]),
        &["nothing.csv", "cannot open it"],
    );
    lab.write("noise.bin", "\u{0}\u{1}");
    contains(
        &lab.refuses(&["describe", "noise.bin"]),
        &["noise.bin", "unknown kind"],
    );
}
