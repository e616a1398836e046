//! Drafts of manifests: a recording written in hundreds of ways is read back as it was.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use nalgebra::{UnitQuaternion, Vector3};
use northing_recording::describe::{Confidence, Draft, draft};
use northing_recording::{OpenOptions, Sample, WorldFrame, manifest, open};

const STANDARD_GRAVITY: f64 = 9.80665;

/// A generator of random numbers, the same everywhere.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() >> 16) as usize % end
    }

    /// -1 to 1.
    fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    fn vector(&mut self) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.unit())
    }

    fn of<T: Copy>(&mut self, choices: &[T]) -> T {
        choices[self.below(choices.len())]
    }
}

/// A row of a recording: time, angular rate, specific force, field, attitude.
struct Row {
    t: f64,
    rate: Vector3<f64>,
    force: Vector3<f64>,
    field: Vector3<f64>,
    attitude: UnitQuaternion<f64>,
}

/// A device in a hand, or in a vehicle that accelerates: z is up.
fn recording(random: &mut Random, rate_hz: f64, seconds: f64) -> Vec<Row> {
    let mut attitude = UnitQuaternion::new(random.vector());
    let turning = 0.4 + 0.8 * random.unit().abs();
    let shaking = 2.0 * random.unit().abs();
    let speed = random.vector() + Vector3::new(1.3, 0.9, 1.1);
    let bias = random.vector() * 0.01;
    let rows = 0..(seconds * rate_hz) as u32;
    rows.map(|k| {
        let t = f64::from(k) / rate_hz;
        let rate = turning * (speed * t).map(f64::sin);
        let acceleration = shaking * (speed * (2.0 * t)).map(f64::cos);
        let row = Row {
            t,
            rate: rate + bias + 0.005 * random.vector(),
            force: attitude.inverse() * (acceleration + Vector3::z() * 9.81)
                + 0.2 * random.vector(),
            field: attitude.inverse() * Vector3::new(3.0, 21.0, -42.0) + 0.5 * random.vector(),
            attitude,
        };
        attitude *= UnitQuaternion::new(rate / rate_hz);
        row
    })
    .collect()
}

/// A column: its name and its numbers.
type Column = (String, Vec<f64>);

/// How the names of the three sensors are written; `{}` stands for the axis.
const NAMES: [[&str; 3]; 8] = [
    ["gyro_{}", "acc_{}", "mag_{}"],
    ["g{}", "a{}", "m{}"],
    ["w{}", "f{}", "b{}"],
    ["Gyroscope {}", "Accelerometer {}", "Magnetometer {}"],
    [
        "angular_velocity.{}",
        "linear_acceleration.{}",
        "magnetic_field.{}",
    ],
    ["GYR_{}", "ACC_{}", "MAG_{}"],
    ["{}gyro", "{}acc", "{}mag"],
    ["imu0/gyro/{}", "imu0/accel/{}", "imu0/mag/{}"],
];

/// A unit: what one of ours is in it, and how headers write it; empty where they do not.
type Unit = (f64, &'static [&'static str]);
const RATES: [Unit; 2] = [
    (1.0, &["", "rad/s", "rad s^-1"]),
    (180.0 / std::f64::consts::PI, &["", "deg/s", "dps", "°/s"]),
];
const FORCES: [Unit; 3] = [
    (1.0, &["", "m/s^2", "m s^-2", "m/s²"]),
    (1.0 / STANDARD_GRAVITY, &["", "g"]),
    (1000.0 / STANDARD_GRAVITY, &["", "mg"]),
];
const FIELDS: [Unit; 4] = [
    (1.0, &["", "uT", "µT"]),
    (0.01, &["", "gauss"]),
    (10.0, &["", "mGauss"]),
    (1000.0, &["", "nT"]),
];
const TIMES: [(f64, &[&str]); 4] = [
    (1.0, &["", "s"]),
    (1e3, &["", "ms"]),
    (1e6, &["", "us"]),
    (1e9, &["", "ns"]),
];

/// The columns of a vector.
fn vector(
    random: &mut Random,
    name: &str,
    units: &[Unit],
    values: impl Iterator<Item = Vector3<f64>>,
) -> Vec<Column> {
    let (factor, spellings) = random.of(units);
    let spelling = random.of(spellings);
    let values: Vec<Vector3<f64>> = values.collect();
    (0..3)
        .map(|axis| {
            let name = name.replace("{}", ["x", "y", "z"][axis]);
            let name = match spelling {
                "" => name,
                unit => format!("{name} ({unit})"),
            };
            (name, values.iter().map(|v| v[axis] * factor).collect())
        })
        .collect()
}

/// A table in one of many ways.
fn table(random: &mut Random, rows: &[Row]) -> String {
    let names = random.of(&NAMES);
    let (factor, spellings) = random.of(&TIMES);
    let start = random.of(&[0.0, 46_408.5, 1.7e9]);
    let time = match random.of(spellings) {
        "" => random
            .of(&["t", "time", "timestamp", "Timestamp"])
            .to_owned(),
        unit => format!("time [{unit}]"),
    };
    let mut groups: Vec<Vec<Column>> = vec![
        vec![(
            time,
            rows.iter().map(|row| (row.t + start) * factor).collect(),
        )],
        vector(random, names[0], &RATES, rows.iter().map(|row| row.rate)),
        vector(random, names[1], &FORCES, rows.iter().map(|row| row.force)),
    ];
    if random.below(2) == 0 {
        groups.push(vector(
            random,
            names[2],
            &FIELDS,
            rows.iter().map(|row| row.field),
        ));
    }
    for (name, numbers) in [
        (
            "index",
            (0..rows.len()).map(|k| k as f64).collect::<Vec<_>>(),
        ),
        (
            "temperature_c",
            rows.iter().map(|row| 21.0 + 0.001 * row.t).collect(),
        ),
        ("battery", vec![3.7; rows.len()]),
    ] {
        if random.below(3) == 0 {
            groups.push(vec![(name.to_owned(), numbers)]);
        }
    }
    for place in (1..groups.len()).rev() {
        groups.swap(place, random.below(place + 1));
    }
    let columns: Vec<Column> = groups.into_iter().flatten().collect();
    let delimiter = random.of(&[',', ';', '\t']);
    let decimal_comma = delimiter != ',' && random.below(2) == 0;
    let mut text = random
        .of(&[
            "",
            "Logger 7\n",
            "Exported 12:30\nby somebody, for nobody\n\n",
        ])
        .to_owned();
    let header: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
    text.push_str(&header.join(&delimiter.to_string()));
    let end = random.of(&["\n", "\r\n"]);
    text.push_str(end);
    for row in 0..rows.len() {
        for (place, (_, numbers)) in columns.iter().enumerate() {
            if place > 0 {
                text.push(delimiter);
            }
            let number = format!("{}", numbers[row]);
            let number = if decimal_comma {
                number.replace('.', ",")
            } else {
                number
            };
            text.push_str(&number);
        }
        text.push_str(end);
    }
    text
}

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

/// The rows as text.
fn plain(rows: &[Row], row: impl Fn(&Row) -> Vec<f64>) -> String {
    let mut text = String::new();
    for one in rows {
        let cells: Vec<String> = row(one).iter().map(f64::to_string).collect();
        let _ = writeln!(text, "{}", cells.join(","));
    }
    text
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
