//! Exports of phyphox: zip, folder and single tables, in all variants of separators.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use std::fs;
use std::io::{Cursor, Write};

use northing_recording::{Event, OpenOptions, Recording, Sample, SensorKind, open, read_bytes};
use zip::write::SimpleFileOptions;

/// A table with these columns behind the time, as phyphox writes it.
fn table(
    columns: &[&str],
    separator: char,
    point: char,
    value: impl Fn(usize, usize) -> f64,
) -> Vec<u8> {
    let quoted = |name: &str| format!("\"{name}\"");
    let header = ["Time (s)"].iter().chain(columns).map(|name| quoted(name));
    let mut text = header.collect::<Vec<_>>().join(&separator.to_string()) + "\n";
    for row in 0..300 {
        let mut cells = vec![format!("{:.9E}", 0.01 * row as f64)];
        cells.extend((0..columns.len()).map(|column| format!("{:.9E}", value(row, column))));
        let cells = cells.join(&separator.to_string());
        text += &(cells.replace('.', &point.to_string()) + "\n");
    }
    text.into_bytes()
}

fn gyroscope(separator: char, point: char) -> Vec<u8> {
    let columns = [
        "Gyroscope x (rad/s)",
        "Gyroscope y (rad/s)",
        "Gyroscope z (rad/s)",
        "Absolute (rad/s)",
    ];
    table(&columns, separator, point, |row, column| {
        0.1 * column as f64 + 1e-3 * row as f64
    })
}

fn tables(separator: char, point: char) -> Vec<(&'static str, Vec<u8>)> {
    let vectors = |columns: &[&str], z: f64| {
        table(
            columns,
            separator,
            point,
            |_, column| if column == 2 { z } else { 0.5 },
        )
    };
    vec![
        ("Gyroscope.csv", gyroscope(separator, point)),
        (
            "Accelerometer.csv",
            vectors(
                &[
                    "Acceleration x (m/s^2)",
                    "Acceleration y (m/s^2)",
                    "Acceleration z (m/s^2)",
                ],
                9.8,
            ),
        ),
        (
            "Linear Accelerometer.csv",
            vectors(&["X (m/s^2)", "Y (m/s^2)", "Z (m/s^2)"], 0.0),
        ),
        (
            "Magnetometer.csv",
            vectors(&["X (\u{b5}T)", "Y (\u{b5}T)", "Z (\u{b5}T)"], -41.0),
        ),
        ("Pressure.csv", vectors(&["Pressure (hPa)"], 0.0)),
        (
            "meta/time.csv",
            b"\"event\",\"experiment time\"\n\"START\",0\n".to_vec(),
        ),
    ]
}

fn zipped(tables: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in tables {
        archive
            .start_file(*name, SimpleFileOptions::default())
            .unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

fn opened(bytes: Vec<u8>) -> Recording {
    read_bytes(bytes, "export", &OpenOptions::default()).unwrap()
}

fn events(recording: Recording) -> Vec<Event> {
    recording.map(Result::unwrap).collect()
}

#[test]
fn a_zip_a_folder_and_every_separator_give_the_same_samples() {
    let recording = opened(zipped(&tables(',', '.')));
    assert_eq!(recording.metadata().format, "phyphox");
    assert_eq!(
        recording.sensors(),
        [
            SensorKind::Gyroscope,
            SensorKind::Accelerometer,
            SensorKind::Magnetometer,
            SensorKind::Pressure
        ]
    );
    assert!(
        recording
            .issues()
            .notes
            .concat()
            .contains("Linear Accelerometer.csv")
    );
    let expected = events(recording);
    assert_eq!(expected.len(), 4 * 300);
    assert_eq!(expected[4].time_ns, 10_000_000);
    assert_eq!(
        expected[4].sample,
        Sample::AngularRate([0.001, 0.101, 0.201].into())
    );
    assert_eq!(
        expected[1].sample,
        Sample::SpecificForce([0.5, 0.5, 9.8].into())
    );
    assert_eq!(expected[3].sample, Sample::Pressure(50.0));
    for (separator, point) in [(';', ','), (';', '.'), ('\t', ','), ('\t', '.')] {
        let read = events(opened(zipped(&tables(separator, point))));
        assert_eq!(read, expected, "{separator:?} {point}");
    }
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("meta")).unwrap();
    for (name, bytes) in tables(';', ',') {
        fs::write(folder.path().join(name), bytes).unwrap();
    }
    let recording = open(folder.path(), &OpenOptions::default()).unwrap();
    assert_eq!(events(recording), expected);
}

#[test]
fn one_table_is_read_alone_and_one_without_gyroscope_says_so() {
    let rates = events(opened(gyroscope(';', ',')));
    assert_eq!(rates.len(), 300);
    let force = tables(',', '.').swap_remove(1).1;
    let error = read_bytes(force, "export", &OpenOptions::default()).unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("export: no gyroscope: it has accelerometer"),
        "{error}"
    );
    let workbook = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1".to_vec();
    let error = read_bytes(workbook, "export.xls", &OpenOptions::default()).unwrap_err();
    assert!(error.to_string().contains("a workbook of Excel"), "{error}");
}

#[test]
fn the_fixes_of_the_location_table_are_read() {
    let columns = [
        "Latitude (\u{b0})",
        "Longitude (\u{b0})",
        "Height (m)",
        "Velocity (m/s)",
    ];
    let location = table(&columns, ',', '.', |_, column| {
        [48.0, 11.0, 500.0, 1.0][column]
    });
    let events = events(opened(zipped(&[("Location.csv", location)])));
    let Sample::GnssPosition(fix) = events[0].sample else {
        panic!("{:?}", events[0]);
    };
    assert!((fix.latitude_rad - 48_f64.to_radians()).abs() < 1e-15);
    assert_eq!((fix.height_m, fix.std_m), (Some(500.0), None));
}

#[test]
fn cut_and_flipped_bytes_are_refused_or_read() {
    let (plain, packed) = (gyroscope(';', ','), zipped(&tables(';', ',')));
    for whole in [plain, packed] {
        for at in (0..whole.len()).step_by(whole.len() / 211) {
            let mut flipped = whole.clone();
            flipped[at] ^= 0x15;
            for bytes in [whole[..at].to_vec(), flipped] {
                if let Ok(recording) = read_bytes(bytes, "export", &OpenOptions::default()) {
                    assert!(recording.count() <= 4 * 300 + 1, "{at}");
                }
            }
        }
    }
}
