//! Drafts of manifests: a recording written in hundreds of ways is read back as it was.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use std::path::{Path, PathBuf};

use nalgebra::{UnitQuaternion, Vector3};
use northing_recording::describe::{Confidence, Draft, draft};
use northing_recording::{OpenOptions, RateUnit, Sample, WorldFrame, manifest, open, read_from};

use crate::tables;

use tables::{Random, Row, plain, recording, table};

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

fn near(a: Vector3<f64>, b: Vector3<f64>) -> bool {
    (a - b).norm() < 1e-6 * (1.0 + b.norm())
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
fn arrays_without_names_are_told_by_their_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let mut offs: Vec<f64> = Vec::new();
    for seed in 1..=40_u64 {
        let mut random = Random(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15));
        let rows = recording(&mut random, 100.0, 40.0);
        let order = random.of(&[[0, 1, 2], [0, 2, 1], [1, 0, 2], [2, 1, 0]]);
        let text = plain(&rows, |row| {
            let three = [row.rate, row.force, row.field];
            order
                .iter()
                .flat_map(|which| three[*which].iter().copied().collect::<Vec<_>>())
                .collect()
        });
        // The rate is told, or found to some per cent by the turns.
        for told in [Some(100.0), None] {
            let (draft, events) = read(folder.path(), "array.csv", &text, told);
            let mut rates = rows.iter();
            let turns = events.iter().filter_map(|event| match event.sample {
                Sample::AngularRate(v) => Some(v),
                _ => None,
            });
            assert!(
                turns.clone().count() == rows.len()
                    && turns.clone().all(|v| near(v, rates.next().unwrap().rate)),
                "seed {seed}: {}",
                draft.manifest
            );
            let seconds = (events[events.len() - 1].time_ns - events[0].time_ns) as f64 * 1e-9;
            let off = (seconds / rows[rows.len() - 1].t - 1.0).abs();
            offs.extend(told.is_none().then_some(off));
            assert!(
                off < if told.is_some() { 1e-6 } else { 0.15 },
                "seed {seed}: {off}"
            );
            assert_eq!(
                sure(&draft, "time"),
                if told.is_some() {
                    Confidence::Certain
                } else {
                    Confidence::Assumed
                }
            );
        }
    }
    offs.sort_by(f64::total_cmp);
    assert!(offs[offs.len() * 9 / 10] < 0.03, "{offs:?}");
}

#[test]
fn axes_quaternions_and_the_vertical_are_found_by_gravity() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(77);
    let rows = recording(&mut random, 100.0, 60.0);
    let text = plain(&rows, |row| {
        let (w, f, q) = (row.rate, row.force, row.attitude.inverse());
        vec![row.t, w.y, w.x, -w.z, f.x, f.y, f.z, q.i, q.j, q.k, q.w]
    });
    let text = format!("t,gx,gy,gz,ax,ay,az,vicon_x,vicon_y,vicon_z,vicon_w\n{text}");
    let (draft, events) = read(folder.path(), "mocap.csv", &text, None);
    let mut row = rows.iter();
    let mut truth = rows.iter();
    for event in &events {
        let is_right = match &event.sample {
            Sample::AngularRate(v) => near(*v, row.next().unwrap().rate),
            Sample::Reference(reference) => {
                reference.attitude.angle_to(&truth.next().unwrap().attitude) < 1e-6
            }
            _ => true,
        };
        assert!(is_right, "{event:?}\n{}", draft.manifest);
    }
    assert!(row.next().is_none() && truth.next().is_none());
    // The same with z down.
    let text = plain(&rows, |row| {
        let down = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f64::consts::PI);
        let (w, f, q) = (row.rate, row.force, down * row.attitude);
        vec![row.t, w.x, w.y, w.z, f.x, f.y, f.z, q.w, q.i, q.j, q.k]
    });
    let text = format!("t,gx,gy,gz,ax,ay,az,q0,q1,q2,q3\n{text}");
    let path = folder.path().join("down.csv");
    std::fs::write(&path, &text).unwrap();
    let options = OpenOptions {
        describe: true,
        ..OpenOptions::default()
    };
    let recording = open(&path, &options).unwrap();
    assert_eq!(recording.metadata().world_frame, WorldFrame::Ned);
    let told = recording.issues().sentences().join("\n");
    assert!(
        told.contains("Guessed (likely): device_orientation from q0, q1, q2, q3"),
        "{told}"
    );
    assert!(open(&path, &OpenOptions::default()).is_err());
}

#[test]
fn at_rest_the_unit_of_a_gyroscope_is_assumed_and_said() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(5);
    let text: String = (0..2000)
        .map(|k| {
            let (w, f) = (random.vector() * 0.02, random.vector() * 0.1);
            format!(
                "{},{},{},{},{},{},{}\n",
                f64::from(k) * 0.01,
                w.x,
                w.y,
                w.z,
                f.x,
                f.y,
                9.81 + f.z
            )
        })
        .collect();
    let text = format!("t,gx,gy,gz,ax,ay,az\n{text}");
    let (draft, _) = read(folder.path(), "rest.csv", &text, None);
    assert_eq!(sure(&draft, "gyroscope"), Confidence::Assumed);
    assert!(
        draft
            .manifest
            .contains("# assumed: neither a header nor a turn of gravity tells the unit")
    );
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

#[test]
fn the_unit_of_time_that_a_header_names_holds_at_any_rate_that_can_be() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(11);
    let rows = recording(&mut random, 100.0, 3.0);
    let seconds = |events: &[northing_recording::Event]| {
        (events[events.len() - 1].time_ns - events[0].time_ns) as f64 * 1e-9
    };
    let (draft, events) = read(
        folder.path(),
        "a.csv",
        &slow("t_s", &rows, |k| k.to_string()),
        None,
    );
    assert!(
        (seconds(&events) - 299.0).abs() < 1e-9,
        "{}",
        draft.manifest
    );
    assert_eq!(sure(&draft, "time"), Confidence::Likely);
    // Without a unit in the header both are as plausible, which is said.
    let (draft, _) = read(
        folder.path(),
        "a.csv",
        &slow("time", &rows, |k| k.to_string()),
        None,
    );
    assert_eq!(sure(&draft, "time"), Confidence::Assumed);
    assert!(
        draft.manifest.contains("in s it would be 1.0000 Hz"),
        "{}",
        draft.manifest
    );
    // Ten nanoseconds are no time of a row.
    let ten = |k: usize| (10 * k).to_string();
    let (draft, events) = read(folder.path(), "a.csv", &slow("t_ns", &rows, ten), None);
    assert!((seconds(&events) - 2.99).abs() < 1e-9, "{}", draft.manifest);
    assert!(
        draft.manifest.contains("the header says ns"),
        "{}",
        draft.manifest
    );
}

#[test]
fn a_finer_clock_stands_before_dates_that_are_cut_off() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(12);
    let rows = recording(&mut random, 100.0, 5.0);
    let time = |k: usize| format!("2024-05-06 07:08:{:02},{}", k / 100, 10 * k);
    let text = slow("date,elapsed_ms", &rows, time);
    let (draft, events) = read(folder.path(), "a.csv", &text, None);
    assert_eq!(
        events[2].time_ns - events[0].time_ns,
        10_000_000,
        "{}",
        draft.manifest
    );
    // What only happens to grow is no clock.
    let time = |k: usize| format!("2024-05-06 07:08:{:02},{}", k / 100, 0.01 * k as f64);
    let text = slow("date,wound_up", &rows, time);
    let (draft, _) = draft_of(folder.path(), &text);
    assert!(draft.contains("column = \"date\""), "{draft}");
    // Dates as fine are better: they tell when it was.
    let time = |k: usize| format!("2024-05-06 07:08:{:06.3},{}", k as f64 * 0.01, 10 * k);
    let text = slow("date,elapsed_ms", &rows, time);
    let (draft, events) = read(folder.path(), "a.csv", &text, None);
    assert_eq!(
        events[0].time_ns, 1_714_979_280_000_000_000,
        "{}",
        draft.manifest
    );
}

#[test]
fn velocities_and_the_estimate_of_gravity_are_no_accelerometer() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(13);
    let rows = recording(&mut random, 100.0, 20.0);
    let text = plain(&rows, |row| {
        let (g, w) = (row.attitude.inverse() * Vector3::z() * 9.81, row.rate);
        vec![
            row.t, g.x, g.y, g.z, 9.8, 0.1, 0.1, 30.0, 20.0, 10.0, w.x, w.y, w.z,
        ]
    });
    let header =
        "t,gravity_x,gravity_y,gravity_z,vel_x,vel_y,vel_z,pos_x,pos_y,pos_z,gyro_x,gyro_y,gyro_z";
    let path = folder.path().join("a.csv");
    std::fs::write(&path, format!("{header}\n{text}")).unwrap();
    let draft = draft(std::slice::from_ref(&path), folder.path(), None).unwrap();
    let keys: Vec<&str> = draft.guesses.iter().map(|guess| guess.key).collect();
    assert_eq!(keys, ["time", "gyroscope"], "{}", draft.manifest);
}

#[test]
fn a_unit_that_is_told_is_taken_and_a_stream_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(14);
    let rows = recording(&mut random, 100.0, 20.0);
    let text = slow("time_s", &rows, |k| (k as f64 * 0.01).to_string());
    let path = folder.path().join("a.csv");
    std::fs::write(&path, &text).unwrap();
    let options = OpenOptions {
        describe: true,
        gyroscope_unit: Some(RateUnit::DegPerS),
        ..OpenOptions::default()
    };
    let recording = open(&path, &options).unwrap();
    let told = recording.issues().sentences().join("\n");
    assert!(
        told.contains("in rad-per-s. Taken in deg-per-s, as told."),
        "{told}"
    );
    let first = recording
        .map(Result::unwrap)
        .find_map(|event| match event.sample {
            Sample::AngularRate(v) => Some(v),
            _ => None,
        });
    assert!(near(first.unwrap(), rows[0].rate * 1_f64.to_radians()));
    let input = std::io::Cursor::new(text.into_bytes());
    let error = read_from(input, "standard input", &options)
        .unwrap_err()
        .to_string();
    assert!(error.contains("cannot be described"), "{error}");
}

#[test]
fn counts_that_no_turn_tells_the_scale_of_are_assumed() {
    let folder = tempfile::tempdir().unwrap();
    let mut random = Random(15);
    let text: String = (0..2000)
        .map(|k| {
            let (w, f) = (random.vector() * 9000.0, random.vector() * 0.05);
            let t = f64::from(k) * 0.01;
            format!(
                "{t},{},{},{},{},{},{}\n",
                w.x,
                w.y,
                w.z,
                f.x,
                f.y,
                9.81 + f.z
            )
        })
        .collect();
    let text = format!("t,gx,gy,gz,ax,ay,az\n{text}");
    let path = folder.path().join("a.csv");
    std::fs::write(&path, text).unwrap();
    let draft = draft(std::slice::from_ref(&path), folder.path(), None).unwrap();
    assert_eq!(sure(&draft, "gyroscope"), Confidence::Assumed);
    assert!(
        draft.manifest.contains("counts of a converter"),
        "{}",
        draft.manifest
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

#[test]
fn times_of_day_and_dates_with_the_day_first_are_read_with_their_holes() {
    let folder = tempfile::tempdir().unwrap();
    let rows = recording(&mut Random(11), 100.0, 20.0);
    // Ten seconds are missing, and midnight is between.
    let clock = |k: usize| {
        let s = 86_390.0 + k as f64 * 0.01 + if k < 500 { 0.0 } else { 10.0 };
        let of_day = s % 86_400.0;
        let (h, m) = ((of_day / 3600.0).floor(), (of_day / 60.0).floor() % 60.0);
        (
            s >= 86_400.0,
            format!("{h:02}:{m:02}:{:06.3}", of_day % 60.0),
        )
    };
    let dates = |k: usize| {
        let (is_next, clock) = clock(k);
        format!("{}.03.2025 {clock}", if is_next { "02" } else { "01" })
    };
    type Stamps<'a> = &'a dyn Fn(usize) -> String;
    let forms: [(&str, Stamps<'_>, &str); 3] = [
        ("time", &|k| clock(k).1, "time-of-day"),
        ("Datum", &dates, "date-time"),
        // Which number is the month nobody knows; the clock is enough.
        (
            "Date,Time",
            &|k| format!("03/04/2025,{}", clock(k).1),
            "time-of-day",
        ),
    ];
    for (header, time, unit) in forms {
        let (draft, events) = read(folder.path(), "a.csv", &slow(header, &rows, time), None);
        assert!(
            draft.manifest.contains(&format!("unit = \"{unit}\"")),
            "{}",
            draft.manifest
        );
        let seconds = (events[events.len() - 1].time_ns - events[0].time_ns) as f64 * 1e-9;
        assert!(
            (seconds - (rows.len() as f64 - 1.0) * 0.01 - 10.0).abs() < 1e-6,
            "{header}: {seconds}"
        );
    }
    // What is called a time and is none is said.
    for (time, why) in [
        (
            "03/04/2025 12:00:00",
            "is called a time, but `03/04/2025 12:00:00` is none that can be read",
        ),
        ("7", "is called a time, but its numbers do not go on"),
    ] {
        let (text, _) = draft_of(folder.path(), &slow("time", &rows, |_| time.to_owned()));
        assert!(text.contains("rate_hz =") && text.contains(why), "{text}");
    }
}

#[test]
fn cells_with_a_line_inside_and_heights_in_feet_or_millimetres_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let text = |header: &str, height: &str, factor: f64| {
        let rows = (0..20).map(|k| {
            let at = |degrees: f64| (degrees + 1e-5 * f64::from(k)) * factor;
            format!(
                "{k},{},{},{height},\"$GPGGA,{k},0*63\r\n\"\n",
                at(47.0),
                at(8.5)
            )
        });
        format!(
            "t,latitude,longitude,{header},raw\n{}",
            rows.collect::<String>()
        )
    };
    let height = |header: &str, height: &str, factor: f64| {
        let (draft, events) = read(folder.path(), "a.csv", &text(header, height, factor), None);
        assert_eq!(events.len(), 20, "{}", draft.manifest);
        match &events[3].sample {
            Sample::GnssPosition(fix) => fix.height_m.unwrap(),
            other => panic!("{other:?}"),
        }
    };
    assert!((height("alt", "300", 1.0) - 300.0).abs() < 1e-9);
    assert!((height("alt_ft", "1000", 1.0) - 304.8).abs() < 1e-9);
    assert!((height("hMSL", "300123", 1e7) - 300.123).abs() < 1e-9);
}

#[test]
fn fixes_of_zeros_between_epochs_are_said_and_are_none() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..2000)
        .map(|k| match k % 100 {
            0 => format!(
                "{:.2},{},8.5,300\n",
                0.01 * f64::from(k),
                47.0 + 1e-5 * f64::from(k)
            ),
            _ => format!("{:.2},0,0,0\n", 0.01 * f64::from(k)),
        })
        .collect();
    let text = format!("time,latitude,longitude,altitude\n{rows}");
    let (draft, events) = read(folder.path(), "a.csv", &text, None);
    assert_eq!(events.len(), 20, "{}", draft.manifest);
    assert!(
        draft
            .manifest
            .contains("both are exactly 0 in 1980 of 2000 rows, which is taken as no fix"),
        "{}",
        draft.manifest
    );
}

#[test]
fn times_cut_to_whole_seconds_are_counted_and_a_rate_is_never_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let rows = recording(&mut Random(12), 100.0, 30.0);
    let clock = |k: usize| format!("23:59:{:02}", 20 + k / 100);
    let text = slow("time", &rows, clock);
    let (draft, events) = read(folder.path(), "a.csv", &text, None);
    let why = "column `time` has one stamp for about 100 rows, 1.000 s apart";
    assert!(
        draft.manifest.contains(why) && draft.manifest.contains("rate_hz = 100.0"),
        "{}",
        draft.manifest
    );
    assert_eq!(events.len(), 2 * rows.len());
    let (draft, _) = read(folder.path(), "a.csv", &text, Some(99.5));
    assert!(
        draft.manifest.contains("rate_hz = 99.5"),
        "{}",
        draft.manifest
    );
    // Samples that are held until the next stamp are no samples.
    let lines: Vec<&str> = text.lines().collect();
    let held = (0..rows.len()).map(|k| format!("{}\n", lines[1 + k - k % 100]));
    let held = format!("{}\n{}", lines[0], held.collect::<String>());
    let (text, _) = draft_of(folder.path(), &held);
    assert!(text.contains("unit = \"time-of-day\""), "{text}");
    // Stamps that are good make a rate invalid.
    let path = folder.path().join("b.csv");
    std::fs::write(
        &path,
        slow("t_s", &rows, |k| format!("{:.2}", k as f64 * 0.01)),
    )
    .unwrap();
    let refused = northing_recording::describe::draft(&[path], folder.path(), Some(100.0));
    let refused = refused.unwrap_err().to_string();
    assert!(
        refused.contains("column `t_s`") && refused.contains("leave --rate out"),
        "{refused}"
    );
}

#[test]
fn gauss_of_a_magnetometer_is_no_g() {
    let folder = tempfile::tempdir().unwrap();
    let rows = recording(&mut Random(5), 100.0, 20.0);
    for (header, factor, unit) in [("G", 0.01, "gauss"), ("mG", 10.0, "milligauss")] {
        let lines = plain(&rows, |r| {
            let (w, f, m) = (r.rate, r.force, r.field * factor);
            vec![r.t, w.x, w.y, w.z, f.x, f.y, f.z, m.x, m.y, m.z]
        });
        let text =
            format!("t_s,gx,gy,gz,ax,ay,az,Mx [{header}],My [{header}],Mz [{header}]\n{lines}");
        let (draft, _) = read(folder.path(), "a.csv", &text, None);
        assert!(
            draft.manifest.contains(&format!("unit = \"{unit}\"")),
            "{}",
            draft.manifest
        );
        assert_eq!(sure(&draft, "magnetometer"), Confidence::Certain);
        assert!(
            !draft.manifest.contains("as the header says"),
            "{}",
            draft.manifest
        );
    }
}

/// Quaternions are told by the accelerometer of another file, by the stamps of both.
#[test]
fn a_reference_in_a_file_of_its_own_is_told_by_the_accelerometer_of_another() {
    let folder = tempfile::tempdir().unwrap();
    let rows = recording(&mut Random(21), 100.0, 30.0);
    let write = |name: &str, header: &str, text: String| {
        let path = folder.path().join(name);
        std::fs::write(&path, format!("{header}\n{text}")).unwrap();
        path
    };
    let imu = slow("time_us", &rows, |k| {
        format!("{}", 5_000_000_000_u64 + 10_000 * k as u64)
    });
    let imu = {
        let path = folder.path().join("imu.csv");
        std::fs::write(&path, imu).unwrap();
        path
    };
    let reference = |offset_s: f64| {
        let inverse = plain(&rows[..], |r| {
            let q = r.attitude.inverse();
            vec![r.t + offset_s, q.i, q.j, q.k, q.w]
        });
        write("ref.csv", "t,ref_1,ref_2,ref_3,ref_4", inverse)
    };
    let made = draft(&[imu.clone(), reference(5000.003)], folder.path(), None).unwrap();
    for line in ["order = \"xyzw\"", "direction = \"world-to-body\""] {
        assert!(made.manifest.contains(line), "{}", made.manifest);
    }
    assert!(made.remarks.is_empty(), "{:?}", made.remarks);
    // Of another time it cannot be told, and the reason is not that there is no accelerometer.
    let made = draft(&[imu, reference(41_000.0)], folder.path(), None).unwrap();
    assert!(
        made.manifest
            .contains("the accelerometer has samples at fewer than 30 of its times"),
        "{}",
        made.manifest
    );
    let [remark] = &made.remarks[..] else {
        panic!("{:?}", made.remarks)
    };
    assert!(
        remark.starts_with(
            "ref.csv has times from 41000.000 to 41029.990 s, imu.csv from 5000.000 to 5029.990 s"
        ) && remark.contains("time_offset_s")
            && made.manifest.contains(remark),
        "{remark}"
    );
}

#[test]
fn columns_of_u_blox_are_millimetres_where_the_height_is() {
    let folder = tempfile::tempdir().unwrap();
    for moving in [0.0, 1.0] {
        let rows: String = (0..60)
            .map(|k| {
                let north = 487_000_000 + (moving * 1800.0 * f64::from(k)) as i64;
                let speed = (moving * 20_000.0) as i64 + 100;
                format!(
                    "{},{north},91000123,303372,{speed},20,-25,1500,2000\n",
                    1000 * k
                )
            })
            .collect();
        let text = format!("time_ms,lat,lon,hMSL,velN,velE,velD,hAcc,vAcc\n{rows}");
        let (draft, events) = read(folder.path(), "a.csv", &text, None);
        for line in ["accuracy_unit = \"mm\"", "speed_unit = \"mm-per-s\""] {
            assert!(draft.manifest.contains(line), "{}", draft.manifest);
        }
        assert!(events.iter().any(|event| matches!(
            event.sample,
            Sample::GnssPosition(fix) if fix.std_m.is_some_and(|std| (std[2] - 2.0).abs() < 1e-9)
        )));
    }
}

/// Phones and loggers of positions tell one number.
#[test]
fn an_accuracy_that_stands_alone_is_the_radius_of_a_fix() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["h_acc", "accuracy", "gps_accuracy", "horizontal_accuracy_m"] {
        let rows: String = (0..60)
            .map(|k| format!("{k},48.{:05},11.5,500,4.0\n", 10_000 + 9 * k))
            .collect();
        let text = format!("time_s,latitude,longitude,altitude,{name}\n{rows}");
        let (draft, events) = read(folder.path(), "a.csv", &text, None);
        let manifest = &draft.manifest;
        assert!(manifest.contains("taken as the radius"), "{manifest}");
        assert!(events.iter().all(|event| matches!(
            event.sample,
            Sample::GnssPosition(fix) if fix.std_m.is_some_and(|std| {
                let expected = [8_f64.sqrt(), 8_f64.sqrt(), 6.8];
                (std.iter().zip(expected)).all(|(std, expected)| (std - expected).abs() < 1e-9)
            })
        )));
    }
}

#[test]
fn the_accuracy_of_a_speed_or_a_course_is_none_of_a_fix() {
    let folder = tempfile::tempdir().unwrap();
    for name in [
        "gps_speed_accuracy",
        "gps_bearing_accuracy",
        "magnetometer_accuracy",
    ] {
        let rows: String = (0..60)
            .map(|k| format!("{k},48.{:05},11.5,500,0.3\n", 10_000 + 9 * k))
            .collect();
        let text = format!("time_s,latitude,longitude,altitude,{name}\n{rows}");
        let (draft, _) = read(folder.path(), "a.csv", &text, None);
        let manifest = &draft.manifest;
        assert!(!manifest.contains("accuracy ="), "{manifest}");
    }
}

#[test]
fn degrees_with_minutes_are_read_and_what_is_no_position_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let text = |latitude: f64, beside: &str| {
        let rows: String = (0..40)
            .map(|k| {
                let t = f64::from(k);
                format!(
                    "{k},{:.5},{beside},{:.5},E,300\n",
                    latitude + 0.01 * t,
                    906.0 + 0.002 * t
                )
            })
            .collect();
        format!("time_s,lat,ns,lon,ew,alt\n{rows}")
    };
    let (draft, events) = read(folder.path(), "a.csv", &text(4841.9, "N"), None);
    assert!(
        draft.manifest.contains("unit = \"deg-min\""),
        "{}",
        draft.manifest
    );
    let Sample::GnssPosition(fix) = events[0].sample else {
        panic!("{:?}", events[0])
    };
    assert!((fix.latitude_rad.to_degrees() - 48.0 - 41.9 / 60.0).abs() < 1e-9);
    // Beside a sensor that is found.
    let imu = slow("t_s", &recording(&mut Random(3), 100.0, 20.0), |k| {
        format!("{:.2}", k as f64 * 0.01)
    });
    let paths = ["imu.csv", "fixes.csv"].map(|name| folder.path().join(name));
    std::fs::write(&paths[0], imu).unwrap();
    for (fixes, why) in [
        (text(4871.9, "N"), "which are no degrees, radians"),
        (text(4841.9, "S"), "`ns` beside it says S"),
    ] {
        std::fs::write(&paths[1], fixes).unwrap();
        let made = draft_of_files(&paths, folder.path());
        let is_told = made.remarks.iter().any(|remark| {
            remark.starts_with("fixes.csv: lat, lon are called a position, but are not used")
                && remark.contains(why)
        });
        assert!(is_told, "{:?}", made.remarks);
        let alone =
            northing_recording::describe::draft(&paths[1..], folder.path(), None).unwrap_err();
        assert!(alone.to_string().contains(why), "{alone}");
    }
}

fn draft_of_files(paths: &[PathBuf], folder: &Path) -> Draft {
    draft(paths, folder, None).unwrap()
}

/// Numbers of the length of a field that do not turn are a position, or anything else.
#[test]
fn a_latitude_a_longitude_and_a_height_of_unknown_names_are_no_magnetometer() {
    let folder = tempfile::tempdir().unwrap();
    let rows: String = (0..240)
        .map(|k| {
            let t = f64::from(k);
            format!(
                "{k},{:.7},{:.7},{:.2}\n",
                48.7 + 1e-5 * t,
                9.1 + 2e-5 * t,
                303.0 + (0.1 * t).sin()
            )
        })
        .collect();
    let fixes = folder.path().join("fixes.csv");
    std::fs::write(&fixes, format!("t_s,Breite,Länge,Höhe\n{rows}")).unwrap();
    let imu = folder.path().join("imu.csv");
    let stamps = |k: usize| format!("{:.2}", k as f64 * 0.01);
    std::fs::write(
        &imu,
        slow("t_s", &recording(&mut Random(3), 100.0, 20.0), stamps),
    )
    .unwrap();
    let made = draft_of_files(&[imu, fixes], folder.path());
    assert!(
        !made.manifest.contains("magnetometer")
            && made.manifest.contains(
                "# fixes.csv is left out: no sensor was recognised in Breite, Länge, Höhe."
            ),
        "{}",
        made.manifest
    );
}

#[test]
fn a_line_of_units_below_the_names_belongs_to_them() {
    let folder = tempfile::tempdir().unwrap();
    let rows = recording(&mut Random(8), 100.0, 20.0);
    let degrees = 180.0 / std::f64::consts::PI;
    let lines = plain(&rows, |r| {
        let (w, f, m, q) = (
            r.rate * degrees,
            r.force / 9.80665e-3,
            r.field * 10.0,
            r.attitude,
        );
        vec![
            r.t, w.x, w.y, w.z, f.x, f.y, f.z, m.x, m.y, m.z, q.i, q.j, q.k, q.w,
        ]
    });
    let text = format!(
        "time,gyr_x,gyr_y,gyr_z,acc_x,acc_y,acc_z,mag_x,mag_y,mag_z,ref_x,ref_y,ref_z,ref_w\n\
         s,deg/s,deg/s,deg/s,mg,mg,mg,mG,mG,mG,-,-,-,-\n{lines}"
    );
    let (draft, events) = read(folder.path(), "a.csv", &text, None);
    assert!(draft.manifest.contains("[reference]"), "{}", draft.manifest);
    for key in ["time", "gyroscope", "accelerometer", "magnetometer"] {
        assert_eq!(sure(&draft, key), Confidence::Certain, "{}", draft.manifest);
    }
    let mut read = rows.iter();
    for event in &events {
        if let Sample::SpecificForce(force) = event.sample {
            assert!(near(force, read.next().unwrap().force), "{event:?}");
        }
    }
    assert!(read.next().is_none());
}
