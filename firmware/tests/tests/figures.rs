//! The estimates that the emulated board prints draw the paper's figures 3 to 6 through `northing run`.

#![allow(clippy::unwrap_used, clippy::indexing_slicing)]

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

use northing_firmware_tests::Board;
use northing_firmware_tests::capture;
use northing_firmware_tests::emulator::Emulator;
use northing_firmware_tests::errors::errors;
use northing_firmware_tests::images::Chip;
use northing_firmware_tests::output::{Sentence, of_kind, sentences};
use northing_firmware_tests::walk::{SEED, Walk};
use tempfile::TempDir;

/// The program that reads what boards print.
fn northing(arguments: &[&Path]) -> String {
    let program =
        env::var_os("NORTHING").expect("NORTHING is not set: run ./scripts/test firmware");
    let run = Command::new(program).args(arguments).output().unwrap();
    let errors = String::from_utf8_lossy(&run.stderr);
    assert!(run.status.success(), "{errors}");
    String::from_utf8(run.stdout).unwrap()
}

/// A walk through a build of the emulated board, and from its output on through `northing run`: the numbers that
/// it draws are those that the board printed, and its scores are the errors of those.
fn printed_and_drawn(name: &str) {
    let walk = Walk::new(SEED, 60.0);
    let printed = Emulator::start(Chip::CortexM3, &format!("emulated-{name}")).ticks(&walk.ticks);
    let said = sentences(&printed);
    let folder = TempDir::new().unwrap();
    let manifest = capture::write(folder.path(), name, &printed, &walk.truth);
    let [report, table] = ["figures.html", "estimates.csv"].map(|name| folder.path().join(name));
    let run = northing(&[
        "run".as_ref(),
        &manifest,
        "--score-from".as_ref(),
        "19".as_ref(),
        "--json".as_ref(),
        "--report".as_ref(),
        &report,
        "--out".as_ref(),
        &table,
    ]);
    same_numbers(&said, &table);
    scored(&run, &said, &walk);
    figures(&report);
    // The output alone, as it came over the line: the same estimates, and no truth to score at.
    let alone: PathBuf = folder.path().join(format!("{name}.txt"));
    let text = northing(&["run".as_ref(), &alone]);
    assert!(text.contains(": device over 60.0 s"), "{text}");
    assert!(
        text.contains(&format!("The board has started: {name}.")),
        "{text}"
    );
}

/// Each estimate that the board printed with a position is a row, with the same numbers.
fn same_numbers(said: &[Sentence], table: &Path) {
    let text = fs::read_to_string(table).unwrap();
    let mut rows = text.lines();
    let names: Vec<&str> = rows.next().unwrap().split(',').collect();
    let place = |name: &str| names.iter().position(|n| *n == name).unwrap();
    let mut estimates = of_kind(said, 'E').filter(|estimate| estimate.fields[7] != "0");
    for row in rows.by_ref() {
        let estimate = estimates.next().unwrap();
        let cells: Vec<&str> = row.split(',').collect();
        let number = |name: &str| cells[place(name)].parse::<f64>().unwrap();
        let printed = |field: usize| estimate.number::<f64>(field) * 1e-3;
        for (name, field) in [
            ("t_s", 0),
            ("north_m", 8),
            ("east_m", 9),
            ("down_m", 10),
            ("velocity_north_m_s", 11),
            ("velocity_east_m_s", 12),
            ("velocity_down_m_s", 13),
            ("north_std_m", 14),
            ("east_std_m", 15),
            ("down_std_m", 16),
            ("heading_std_deg", 6),
            ("heading_deg", 3),
        ] {
            let (drawn, printed) = (number(name), printed(field));
            // Both are rounded, one to a thousandth and one to a ten-thousandth.
            assert!(
                (drawn - printed).abs() < 2e-4,
                "{name} {drawn} {printed}: {row}"
            );
        }
    }
    assert_eq!(estimates.next(), None);
}

/// The scores are the errors of the printed estimates against the truth.
fn scored(run: &str, said: &[Sentence], walk: &Walk) {
    let run: serde_json::Value = serde_json::from_str(run).unwrap();
    assert_eq!(run["estimator"], "device");
    assert_eq!(run["scored_against"], "reference");
    let errors = errors(said, &walk.truth);
    let number = |path: &str| {
        run.pointer(path)
            .and_then(serde_json::Value::as_f64)
            .unwrap()
    };
    // Scored at five points a second of the fifty.
    for (path, expected) in [
        ("/position/horizontal_rmse_m", errors.position_m),
        ("/tilt_rmse_deg", errors.tilt.to_degrees()),
        ("/heading_rmse_deg", errors.heading.to_degrees()),
    ] {
        let scored = number(path);
        assert!(
            (scored / expected - 1.0).abs() < 0.05,
            "{path} {scored} {expected}"
        );
    }
    assert!(number("/position/scored_fixes") > 190.0);
}

/// The paper's figures: 3 is the orientation, 4 and 5 are the position, 6 is the track.
fn figures(report: &Path) {
    let page = fs::read_to_string(report).unwrap();
    for (section, label) in [
        ("orientation", "Roll, pitch and heading over time"),
        (
            "position",
            "Position north, east and up over time, with fixes",
        ),
        ("position", "Position over a few seconds"),
        ("track", "Map of the track with its fixes"),
    ] {
        let (_, section) = page
            .split_once(&format!("<section id=\"{section}\""))
            .unwrap();
        let (section, _) = section.split_once("</section>").unwrap();
        let (_, figure) = section.split_once(label).unwrap();
        let (figure, _) = figure.split_once("</figure>").unwrap();
        assert!(
            figure.contains("the device\u{2019}s own estimate"),
            "{label}"
        );
        let curve = figure.contains("line estimate\"");
        let measured = figure.contains("soft device");
        assert!(curve && measured, "{label}");
    }
}

#[test]
fn what_the_board_with_the_axis_filters_prints_draws_the_papers_figures() {
    printed_and_drawn("axis-filters");
}

#[test]
fn what_the_board_with_the_error_state_filter_prints_draws_them_too() {
    printed_and_drawn("error-state");
}
