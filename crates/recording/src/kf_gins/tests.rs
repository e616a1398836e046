//! Made tables: read, told apart from others, and told when they are none.

use std::path::Path;

use super::{Table, columns_of_numbers};
use crate::event::{Event, Sample, SensorKind};
use crate::metadata::WorldFrame;
use crate::{Format, OpenOptions, RecordingError, open, read_bytes};

/// 100 Hz for a second, turning by 0.5 rad/s and speeding up by 2 m/s^2 on a level plane.
fn increments() -> String {
    let row = |k: i32| {
        let t = 100_000.0 + f64::from(k) * 0.01;
        format!("{t:.4}  0.000000000  0.000000000\t0.005000000 0.0200000 0.0000000 -0.0980665\n")
    };
    (0..101).map(row).collect()
}

/// 2 Hz over the same second, going north.
fn positions() -> String {
    let row = |k: i32| {
        let t = 100_000.25 + f64::from(k) * 0.5;
        let latitude = 47.0 + f64::from(k) * 1e-5;
        format!("{t:.3} {latitude:.9} 8.500000000 431.2500 0.0100 0.0200 0.0300\n")
    };
    (0..3).map(row).collect()
}

fn read(text: &str) -> Result<Vec<Event>, RecordingError> {
    read_bytes(
        text.as_bytes().to_vec(),
        "made.txt",
        &OpenOptions::default(),
    )?
    .collect()
}

fn of(events: &[Event], kind: SensorKind) -> Vec<Event> {
    let found = events.iter().filter(|e| e.sample.kind() == kind);
    found.copied().collect()
}

fn write(folder: &Path, name: &str, text: &str) {
    std::fs::write(folder.join(name), text).unwrap();
}

#[test]
fn increments_become_rates_and_forces_and_the_first_row_none() {
    for text in [
        increments(),
        increments()
            .replace("  ", ", ")
            .replace(['\t', ' '], ",")
            .replace(",,", ","),
        format!("# time, dthx, dthy, dthz\n{}", increments()),
    ] {
        let recording = read_bytes(text.into_bytes(), "made.txt", &OpenOptions::default()).unwrap();
        assert_eq!(recording.metadata().format, "kf-gins");
        assert_eq!(recording.metadata().world_frame, WorldFrame::Ned);
        let events: Vec<Event> = recording.map(Result::unwrap).collect();
        assert_eq!(events.len(), 200);
        assert_eq!(events[0].time_ns, 100_000_010_000_000);
        let (Sample::AngularRate(rate), Sample::SpecificForce(force)) =
            (events[100].sample, events[101].sample)
        else {
            panic!("{events:?}")
        };
        approx::assert_relative_eq!(rate.z, 0.5, epsilon = 1e-9);
        approx::assert_relative_eq!(force.x, 2.0, epsilon = 1e-9);
        approx::assert_relative_eq!(force.z, -9.80665, epsilon = 1e-9);
    }
}

#[test]
fn positions_have_their_standard_deviations() {
    let events = read(&positions()).unwrap();
    assert_eq!(events.len(), 3);
    let Sample::GnssPosition(fix) = events[2].sample else {
        panic!("{events:?}")
    };
    approx::assert_relative_eq!(fix.latitude_rad.to_degrees(), 47.00002, epsilon = 1e-12);
    approx::assert_relative_eq!(fix.longitude_rad.to_degrees(), 8.5, epsilon = 1e-12);
    assert_eq!(
        (fix.height_m, fix.std_m),
        (Some(431.25), Some([0.01, 0.02, 0.03]))
    );
}

#[test]
fn a_folder_with_both_is_one_recording() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "imu.txt", &increments());
    write(folder.path(), "readme.md", "# A drive\n");
    // Positions alone make no recording of a folder.
    assert!(open(folder.path(), &OpenOptions::default()).is_err());
    write(folder.path(), "gnss.pos", &positions());
    let recording = open(folder.path(), &OpenOptions::default()).unwrap();
    let events: Vec<Event> = recording.map(Result::unwrap).collect();
    assert_eq!(of(&events, SensorKind::Gyroscope).len(), 100);
    assert_eq!(of(&events, SensorKind::GnssPosition).len(), 3);
    assert!(events.is_sorted_by_key(|event| event.time_ns));

    write(folder.path(), "other.txt", &increments());
    let error = open(folder.path(), &OpenOptions::default())
        .err()
        .unwrap()
        .to_string();
    assert!(
        error.contains("2 KF-GINS tables of inertial increments (imu.txt, other.txt)"),
        "{error}"
    );
    assert!(error.contains("write a manifest"), "{error}");
    assert!(!error.contains('\n'), "{error}");
}

#[test]
fn a_manifest_takes_them_as_files_that_describe_themselves() {
    let folder = tempfile::tempdir().unwrap();
    write(folder.path(), "imu.txt", &increments());
    write(folder.path(), "gnss.txt", &positions());
    write(
        folder.path(),
        "drive.toml",
        "world_frame = 'ned'\n[[source]]\nfile = 'imu.txt'\ntime_offset_s = 1.0\n[[source]]\nfile = 'gnss.txt'\nformat = 'kf-gins'\n",
    );
    let recording = open(&folder.path().join("drive.toml"), &OpenOptions::default()).unwrap();
    let events: Vec<Event> = recording.map(Result::unwrap).collect();
    let first = of(&events, SensorKind::Gyroscope)[0];
    assert_eq!(first.time_ns, 100_001_010_000_000);
    assert_eq!(of(&events, SensorKind::GnssPosition).len(), 3);
}

#[test]
fn other_tables_of_numbers_are_not_taken_for_them() {
    let table = |row: fn(f64) -> String| -> String {
        (0..50).map(|k| row(100.0 + f64::from(k) * 0.01)).collect()
    };
    for (what, text) in [
        (
            "rates and forces",
            table(|t| format!("{t} 0.01 0.02 0.5 0.1 0.2 -9.8\n")),
        ),
        (
            "forces and rates",
            table(|t| format!("{t} 0.1 0.2 -9.8 0.01 0.02 0.09\n")),
        ),
        (
            "a TUM trajectory",
            table(|t| format!("{t} 1.0 2.0 3.0 0 0 0 1\n")),
        ),
        (
            "metres",
            table(|t| format!("{t} {:.6} 2.000000 3.0 0.1 0.1 0.1\n", t * 2.0 - 200.0)),
        ),
        (
            "whole degrees",
            table(|t| format!("{t} 47 8 431 0.1 0.1 0.1\n")),
        ),
        (
            "no standard deviation",
            table(|t| format!("{t} 47.000001 8.000001 431 0 0 0\n")),
        ),
        (
            "seconds since 1970",
            table(|t| format!("{} 47.000001 8.000001 431 1 1 1\n", t + 1.7e9)),
        ),
        (
            "a clock that stands",
            table(|_| "5 47.000001 8.000001 431 1 1 1\n".to_owned()),
        ),
        (
            "gravity missing",
            table(|t| format!("{t} 0 0 0.005 0.001 0 0\n")),
        ),
        (
            "uneven increments",
            table(|t| format!("{} 0 0 0.005 0 0 -0.098\n", t * t)),
        ),
        ("not finite", table(|t| format!("{t} 0 0 nan 0 0 -0.098\n"))),
        (
            "two rows",
            "1.00 0 0 0 0 0 -0.098\n1.01 0 0 0 0 0 -0.098\n1.02 0 0 0 0 0 -0.0".to_owned(),
        ),
        ("nothing", String::new()),
    ] {
        assert_eq!(Table::of(&text), None, "{what}");
        let error = read(&text).err().map(|error| error.to_string());
        assert!(error.is_some(), "{what}");
    }
}

#[test]
fn a_table_of_numbers_that_is_neither_is_told_which_manifest_to_write() {
    let text = "1.0 0.01 0.02 0.5 0.1 0.2 -9.8\n2.0 0.01 0.02 0.5 0.1 0.2 -9.8\n";
    assert_eq!(columns_of_numbers(text), Some(7));
    let error = read(text).unwrap_err().to_string();
    for part in [
        "made.txt: 7 columns of numbers without names",
        "`header = false`",
        "`FILE.EXT.toml`",
    ] {
        assert!(error.contains(part), "{error}");
    }
    let options = OpenOptions {
        format: Some(Format::KfGins),
        ..OpenOptions::default()
    };
    let error = read_bytes(text.as_bytes().to_vec(), "made.txt", &options)
        .err()
        .unwrap()
        .to_string();
    assert!(
        error.contains("the first rows are no KF-GINS table"),
        "{error}"
    );
}

#[test]
fn a_broken_row_is_named_with_its_place() {
    let cut = positions() + "100001.75 47.00003";
    let error = read(&cut).unwrap_err().to_string();
    assert!(
        error.contains("line 4") && error.contains("2 cells where the first row has 7"),
        "{error}"
    );
    let far: String = (0..200)
        .map(|k| format!("{}.5 47.000001 8.500001 431 1 1 1\n", 1000 + k))
        .collect();
    let error = read(&(far + "1300 north 8.5 431 1 1 1\n"))
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("line 201, column `latitude`: `north` is not a number"),
        "{error}"
    );
}
