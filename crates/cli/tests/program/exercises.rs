//! `northing exercises`, `northing hand-in` and `northing grade`: a class, its hand-ins right and wrong, and the table.

use std::fs;

use serde_json::Value;

use crate::support::{Lab, contains};

/// Mean angular rate of the first seconds of `phone.csv`, in which it rests, deg/s: the bias, found as a student does.
fn bias_deg_s(lab: &Lab) -> [f64; 3] {
    let text = lab.read("phone.csv");
    let mut lines = text.lines().filter(|line| !line.starts_with('#'));
    let heads: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |name: &str| heads.iter().position(|head| *head == name).unwrap();
    let columns = ["gyro_x_rad_s", "gyro_y_rad_s", "gyro_z_rad_s"].map(column);
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    let rates = |i: usize| {
        rows.iter()
            .filter_map(move |row| row[i].parse::<f64>().ok())
    };
    // 8 s at 100 Hz.
    columns.map(|i| (rates(i).take(800).sum::<f64>() / 800.0).to_degrees())
}

const SETTINGS: [&str; 4] = ["--profile", "lab", "--calibrate-first", "8"];

/// The arguments of a hand-in with a calibration from the first 8 s.
fn arguments<'a>(card: &'a str, student: &'a str, answers: &'a [String]) -> Vec<&'a str> {
    let mut arguments = vec!["hand-in", card, "phone.csv", "--student", student];
    arguments.extend(SETTINGS);
    for answer in answers {
        arguments.extend(["--answer", answer]);
    }
    arguments
}

fn axes(bias: [f64; 3]) -> Vec<String> {
    let named = ["x", "y", "z"].into_iter().zip(bias);
    named
        .map(|(axis, value)| format!("{axis}={value:.4}"))
        .collect()
}

/// A class of three: Anna is right; Ben answers in rad/s; Cleo hands in what Anna recorded, for another card.
fn class() -> Lab {
    let lab = Lab::with_phone();
    fs::create_dir_all(lab.path("class/late")).unwrap();
    let bias = bias_deg_s(&lab);
    let hand_in = |card: &str, student: &str, answers: &[String], out: &str| {
        let mut arguments = arguments(card, student, answers);
        arguments.extend(["--out", out]);
        lab.succeeds(&arguments)
    };
    let said = hand_in("bias", "Anna", &axes(bias), "class/anna.zip");
    contains(
        &said,
        &[
            "Find the bias: Anna",
            "It passes.",
            "Hand in this file: class/anna.zip",
        ],
    );
    let said = hand_in(
        "bias",
        "Ben",
        &axes(bias.map(f64::to_radians)),
        "class/ben.zip",
    );
    contains(&said, &["It does not pass.", "if they are in rad/s"]);
    let answers = ["axis=z", "error=0.5"].map(str::to_owned);
    let said = hand_in("scale", "Cleo", &answers, "class/late/cleo.zip");
    contains(&said, &["It does not pass."]);
    lab
}

#[test]
fn a_class_is_graded_with_the_reasons() {
    let lab = class();
    let text = lab.succeeds(&["grade", "class", "--out", "class.csv"]);
    contains(
        &text,
        &[
            "3 hand-ins, 1 pass",
            "student bias scale passed",
            "Anna yes - 1 of 2",
            "Ben no - 0 of 2",
            "Cleo - no 0 of 2",
            "Ben, bias: does not pass",
            "if they are in rad/s: the answer is asked for in deg/s.",
            "Table: class.csv",
        ],
    );
    let rows = lab.read("class.csv");
    assert_eq!(rows.lines().count(), 4, "{rows}");
    assert!(
        rows.lines().nth(1).unwrap().starts_with("Anna,bias,yes,"),
        "{rows}"
    );
    contains(
        &lab.refuses(&["grade", "class", "--out", "class.csv"]),
        &["exists already"],
    );
    // The same in another order of files, and in Spanish.
    let again = lab.succeeds(&[
        "grade",
        "class/late/cleo.zip",
        "class/ben.zip",
        "class/anna.zip",
    ]);
    assert_eq!(text.replace("\nTable: class.csv\n", ""), again);
    let spanish = lab.succeeds(&["grade", "class", "--card", "bias", "--language", "es"]);
    contains(
        &spanish,
        &[
            "2 hand-ins, 1 pass",
            "la respuesta se pide en deg/s",
            "other cards: 1",
        ],
    );
    assert!(
        lab.refuses(&["grade", "class", "--card", "magnet"])
            .contains("`magnet`")
    );
}

#[test]
fn one_recording_under_several_names_is_seen() {
    let lab = class();
    let text = lab.succeeds(&["grade", "class"]);
    contains(
        &text,
        &["One and the same recording under several names: Anna, Ben, Cleo."],
    );
    let json = lab.json(&["grade", "class", "--json"]);
    assert_eq!(
        json["hand_ins"][0]["same_recording_as"],
        serde_json::json!(["Ben", "Cleo"])
    );
    assert_eq!(json["hand_ins"][0]["passes"], true);
    assert_eq!(json["hand_ins"][1]["reasons"][1]["key"], "reason.biasUnit");
}

/// What cannot be judged is named; the rest is judged all the same, and the exit code tells.
#[test]
fn damaged_files_do_not_keep_the_others_from_being_judged() {
    let lab = class();
    let whole = fs::read(lab.path("class/anna.zip")).unwrap();
    lab.write("class/cut.zip", &whole[..whole.len() / 2]);
    lab.write("class/notes.txt", "who was ill");
    let output = lab.program(&["grade", "class"]).output().unwrap();
    let [text, error] = [output.stdout, output.stderr].map(|b| String::from_utf8(b).unwrap());
    assert_eq!(output.status.code(), Some(2), "{error}");
    assert_eq!(error.lines().count(), 1, "{error}");
    assert!(
        error.starts_with("northing: class/cut.zip: it is no zip"),
        "{error}"
    );
    contains(
        &text,
        &[
            "3 hand-ins, 1 pass",
            "Not judged: class/cut.zip: it is no zip",
            "class/notes.txt",
        ],
    );
    // Alone it is an error and nothing else.
    assert!(
        lab.refuses(&["grade", "class/cut.zip"])
            .starts_with("class/cut.zip: it is no zip")
    );
    assert!(
        lab.refuses(&["grade", "nobody.zip"])
            .contains("nobody.zip: cannot open it")
    );
    fs::create_dir(lab.path("empty")).unwrap();
    contains(
        &lab.refuses(&["grade", "empty"]),
        &[
            "empty: no hand-ins in this folder",
            "expected files that end in .zip",
        ],
    );
}

/// With the numbers that `northing run` prints, the experiment passes; with another it does not.
#[test]
fn the_experiment_is_judged_by_its_final_test() {
    let lab = Lab::with_phone();
    let mut run = vec!["run", "phone.csv", "--json"];
    run.extend(SETTINGS);
    let summary = lab.json(&run);
    let test = &summary["final"];
    let number = |name: &str| test[name].as_f64().unwrap();
    let answers = |calculated: f64| {
        vec![
            format!("calculated={calculated:.2}").replace('.', ","),
            format!("estimated={:.2}", number("estimated_error_deg")),
            format!("verdict={}", test["verdict"].as_str().unwrap()),
        ]
    };
    let judged = |student: &str, calculated: f64| -> Value {
        let answers = answers(calculated);
        let mut arguments = arguments("experiment", student, &answers);
        arguments.push("--json");
        lab.json(&arguments)
    };
    let calculated = number("calculated_error_deg");
    assert_eq!(judged("Anna", calculated)["passed"], true);
    assert!(lab.path("experiment-anna.zip").is_file());
    let wrong = judged("Ben", calculated + 1.0);
    let failed = wrong["reasons"]
        .as_array()
        .unwrap()
        .iter()
        .find(|r| r["holds"] == false);
    assert_eq!(failed.unwrap()["key"], "reason.calculated", "{wrong}");
    // A hand-in is a recording, too.
    let info = lab.succeeds(&["info", "experiment-anna.zip"]);
    contains(&info, &["gyroscope", "magnetometer"]);
}

#[test]
fn a_card_asks_and_what_does_not_answer_it_is_refused() {
    let lab = Lab::with_phone();
    contains(
        &lab.succeeds(&["exercises"]),
        &["no-magnetometer", "minutes", "Find the bias"],
    );
    let card = lab.succeeds(&["exercises", "no-magnetometer"]);
    contains(
        &card,
        &[
            "axis",
            "yaw",
            "gravity",
            "northing hand-in no-magnetometer RECORDING",
        ],
    );
    contains(
        &lab.succeeds(&["exercises", "bias", "--language", "es"]),
        &["Encontrar el sesgo"],
    );
    contains(
        &lab.succeeds(&["exercises", "--sheet"]),
        &["11. Compare the errors"],
    );
    assert_eq!(
        lab.json(&["exercises", "--json"]).as_array().unwrap().len(),
        7
    );
    contains(&lab.refuses(&["exercises", "biases"]), &["no-magnetometer"]);
    let refuses = |answers: &[&str]| {
        let answers: Vec<String> = answers.iter().map(|a| (*a).to_owned()).collect();
        lab.refuses(&arguments("no-magnetometer", "Anna", &answers))
    };
    contains(
        &refuses(&["axis=yaw"]),
        &["--answer why: it is not answered", "axis, why"],
    );
    contains(
        &refuses(&["axis=north"]),
        &["axis=north", "yaw, pitch, roll"],
    );
    contains(&refuses(&["axes=yaw"]), &["axes=yaw", "asks for axis, why"]);
    contains(&refuses(&["axis=yaw", "axis=roll"]), &["twice"]);
    let fast = ["rate=fast".to_owned()];
    contains(
        &lab.refuses(&arguments("rate", "Anna", &fast)),
        &["a number in Hz"],
    );
    let half = ["rate=50".to_owned()];
    contains(
        &lab.refuses(&arguments("rate", " ", &half)),
        &["--student: expected a name"],
    );
}
