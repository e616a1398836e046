//! Drafts of manifests: a recording written in hundreds of ways is read back as it was.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

mod positions;
mod sensors;
mod times;

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use northing_recording::describe::{Confidence, Draft, draft};
use northing_recording::{OpenOptions, Sample, manifest, open};

use crate::tables::{Random, Row, plain, recording, table};

/// The draft of a text, and what is read by it.
fn read(
    folder: &Path,
    name: &str,
    text: &str,
    rate_hz: Option<f64>,
) -> (Draft, Vec<northing_recording::Event>) {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    let draft = draft(std::slice::from_ref(&path), folder, rate_hz)
        .unwrap_or_else(|error| panic!("{error}\n{}", &text[..400]));
    let place = folder.join("draft.toml");
    let recording = manifest::open_text(&draft.manifest, &place, &OpenOptions::default());
    let recording = recording.unwrap_or_else(|error| panic!("{error}\n{}", draft.manifest));
    let events = recording.map(|event| {
        event.unwrap_or_else(|error| panic!("{error}\n{}\n{}", draft.manifest, &text[..400]))
    });
    let events = events.collect();
    (draft, events)
}

/// The text of a draft, whether its stamps can be read or not.
fn draft_of(folder: &Path, text: &str) -> (String, PathBuf) {
    let path = folder.join("drafted.csv");
    std::fs::write(&path, text).unwrap();
    let made = draft(std::slice::from_ref(&path), folder, None).unwrap();
    (made.manifest, path)
}

fn sure(draft: &Draft, key: &str) -> Confidence {
    let guess = draft.guesses.iter().find(|guess| guess.key == key);
    guess
        .unwrap_or_else(|| panic!("no {key}: {}", draft.manifest))
        .confidence
}

/// Of a table with the rows of a device at 1 Hz and less, and one at 100 Hz.
fn slow(header: &str, rows: &[Row], time: impl Fn(usize) -> String) -> String {
    let lines = rows.iter().enumerate().map(|(k, row)| {
        let (w, f) = (row.rate, row.force);
        format!(
            "{},{},{},{},{},{},{}\n",
            time(k),
            w.x,
            w.y,
            w.z,
            f.x,
            f.y,
            f.z
        )
    });
    format!("{header},gx,gy,gz,ax,ay,az\n{}", lines.collect::<String>())
}

fn near(a: Vector3<f64>, b: Vector3<f64>) -> bool {
    (a - b).norm() < 1e-6 * (1.0 + b.norm())
}

fn draft_of_files(paths: &[PathBuf], folder: &Path) -> Draft {
    draft(paths, folder, None).unwrap()
}

#[test]
fn tables_of_hundreds_of_kinds_are_read_as_they_were() {
    let folder = tempfile::tempdir().unwrap();
    for seed in 1..=200_u64 {
        let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let rate_hz = random.of(&[50.0, 100.0, 286.0, 400.0]);
        let rows = recording(&mut random, rate_hz, 20.0);
        let text = table(&mut random, &rows);
        let (draft, events) = read(folder.path(), "log.csv", &text, None);
        let (mut rates, mut forces, mut fields) = (rows.iter(), rows.iter(), rows.iter());
        let mut seen = [0; 3];
        for event in &events {
            let (is_right, kind) = match &event.sample {
                Sample::AngularRate(v) => (near(*v, rates.next().unwrap().rate), 0),
                Sample::SpecificForce(v) => (near(*v, forces.next().unwrap().force), 1),
                Sample::MagneticField(v) => (near(*v, fields.next().unwrap().field), 2),
                _ => (false, 0),
            };
            seen[kind] += 1;
            assert!(
                is_right,
                "seed {seed}: {event:?}\n{}\n{}",
                draft.manifest,
                &text[..400]
            );
        }
        let has_field = draft
            .guesses
            .iter()
            .any(|guess| guess.key == "magnetometer");
        assert_eq!(
            has_field,
            text.to_lowercase().contains("mag") || text.contains("mx") || text.contains("bx"),
            "seed {seed}"
        );
        assert_eq!(
            seen,
            [
                rows.len(),
                rows.len(),
                if has_field { rows.len() } else { 0 }
            ],
            "seed {seed} {}\n{}",
            draft.manifest,
            &text[..400]
        );
        let seconds = (events[events.len() - 1].time_ns - events[0].time_ns) as f64 * 1e-9;
        assert!(
            (seconds - rows[rows.len() - 1].t).abs() < 1e-3,
            "seed {seed}: {seconds} s\n{}",
            draft.manifest
        );
        for key in ["gyroscope", "accelerometer"] {
            assert!(
                sure(&draft, key) >= Confidence::Likely,
                "seed {seed}: {}",
                draft.manifest
            );
        }
    }
}

#[test]
fn several_files_become_one_recording() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(9);
    let rows = recording(&mut random, 100.0, 30.0);
    let mut paths: Vec<PathBuf> = Vec::new();
    let mut write = |name: &str, header: &str, text: String| {
        let path = folder.path().join(name);
        std::fs::write(&path, format!("{header}\n{text}")).unwrap();
        paths.push(path);
    };
    let degrees = 180.0 / std::f64::consts::PI;
    write(
        "Gyroscope.csv",
        "timestamp;x;y;z",
        plain(&rows, |r| {
            vec![
                (1.7e12 + r.t * 1e3).round(),
                r.rate.x * degrees,
                r.rate.y * degrees,
                r.rate.z * degrees,
            ]
        })
        .replace(',', ";"),
    );
    write(
        "Accelerometer.csv",
        "timestamp,x,y,z",
        plain(&rows, |r| {
            vec![
                (1.7e12 + r.t * 1e3).round(),
                r.force.x,
                r.force.y,
                r.force.z,
            ]
        }),
    );
    let fixes: String = (0..30)
        .map(|k| {
            let t = f64::from(k);
            format!(
                "2023-11-14 22:13:{:06.3},{},{},512.5,3.5,5.0,{},{}\n",
                20.0 + t,
                47.0 + 9e-5 * t,
                8.5,
                36.0,
                0.0
            )
        })
        .collect();
    write(
        "gps.csv",
        "utc,latitude,longitude,altitude,horizontalAccuracy,verticalAccuracy,speed,course",
        fixes,
    );
    let made = draft(&paths, folder.path(), None).unwrap();
    let place = folder.path().join("walk.toml");
    std::fs::write(&place, &made.manifest).unwrap();
    let events: Vec<_> = open(&place, &OpenOptions::default())
        .unwrap()
        .map(Result::unwrap)
        .collect();
    let count = |is: fn(&Sample) -> bool| events.iter().filter(|event| is(&event.sample)).count();
    assert_eq!(count(|s| matches!(s, Sample::GnssPosition(_))), 30);
    assert_eq!(count(|s| matches!(s, Sample::SpecificForce(_))), rows.len());
    let mut row = rows.iter();
    for event in &events {
        match event.sample {
            Sample::AngularRate(v) => {
                assert!(near(v, row.next().unwrap().rate), "{}", made.manifest);
            }
            Sample::GnssVelocity(v) => {
                let speed = v.north_m_s.hypot(v.east_m_s);
                assert!(
                    (speed - 10.0).abs() < 1e-6,
                    "{speed} in m/s, {}",
                    made.manifest
                );
            }
            _ => {}
        }
    }
    assert!(row.next().is_none());
    assert!(
        made.manifest.contains("the positions move"),
        "{}",
        made.manifest
    );
}

#[test]
fn what_is_no_sensor_is_refused_with_what_was_seen() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("prices.csv");
    std::fs::write(
        &path,
        "day,open,close\n1,2.5,2.6\n2,2.6,2.4\n3,2.4,2.9\n4,2.9,3.0\n",
    )
    .unwrap();
    let error = draft(std::slice::from_ref(&path), folder.path(), None)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains(
            "neither the names of its columns nor their numbers tell a sensor: day, open, close"
        ),
        "{error}"
    );
    let rows = "1,imu,1,2,3\n2,mag,1,2\n3,imu,1,2,3\n4,mag,1,2\n5,imu,1,2,3\n6,mag,1,2\n";
    std::fs::write(&path, rows).unwrap();
    let error = draft(std::slice::from_ref(&path), folder.path(), None)
        .unwrap_err()
        .to_string();
    assert!(
        error.contains("3 of 6 rows do not have the 5 cells")
            || error.contains("cells of the others"),
        "{error}"
    );
}

proptest::proptest! {
    #![proptest_config(proptest::test_runner::Config {
        rng_seed: proptest::test_runner::RngSeed::Fixed(0x20),
        failure_persistence: None,
        ..proptest::test_runner::Config::default()
    })]

    #[test]
    fn no_text_is_too_odd_to_be_looked_at(text in "([a-z_#%\\[\\]() /\"]{0,6}[0-9.,;\t :eE+-]{0,30}[\r]?\n){0,40}", rate in proptest::option::of(1e-3..1e6_f64)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("odd.csv");
        std::fs::write(&path, text).unwrap();
        if let Ok(draft) = draft(std::slice::from_ref(&path), folder.path(), rate) {
            let place = folder.path().join("draft.toml");
            if let Ok(recording) = manifest::open_text(&draft.manifest, &place, &OpenOptions::default()) {
                let _ = recording.count();
            }
        }
    }

    #[test]
    fn no_bytes_are_too_odd_to_be_looked_at(bytes in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..400)) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("odd.txt");
        std::fs::write(&path, bytes).unwrap();
        let _ = draft(std::slice::from_ref(&path), folder.path(), Some(100.0));
    }
}

/// As exports have it, one table a sensor: what is none of those that are known does not stand in the way.
#[test]
fn a_table_without_a_sensor_is_left_out_of_the_draft_and_said() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, row: &dyn Fn(f64) -> [f64; 3]| {
        let rows: String = (0..500)
            .map(|k| {
                let t = 0.01 * f64::from(k);
                let [x, y, z] = row(t);
                format!("{t:.2},{x:.6},{y:.6},{z:.6}\n")
            })
            .collect();
        let path = folder.path().join(name);
        std::fs::write(&path, format!("Timestamp,X,Y,Z\n{rows}")).unwrap();
        path
    };
    let tilt = |t: f64| 0.4 * (0.7 * t).sin();
    let files = [
        write("Acceleration.csv", &|t| {
            [0.0, 9.81 * tilt(t).sin(), 9.81 * tilt(t).cos()]
        }),
        write("AngularVelocity.csv", &|t| {
            [0.28 * (0.7 * t).cos(), 0.0, 0.0]
        }),
        write("Orientation.csv", &|t| [0.0, -tilt(t).to_degrees(), 0.0]),
    ];
    let draft = northing_recording::describe::draft(&files, folder.path(), None).unwrap();
    assert!(
        draft
            .manifest
            .contains("# Orientation.csv is left out: no sensor was recognised in X, Y, Z."),
        "{}",
        draft.manifest
    );
    let path = folder.path().join("walk.toml");
    let recording = northing_recording::manifest::open_text(
        &draft.manifest,
        &path,
        &northing_recording::OpenOptions::default(),
    );
    assert_eq!(recording.unwrap().map(Result::unwrap).count(), 1000);
}
