//! Sensor Logger exports in all their forms, made here from a known motion.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use crate::support;

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};
use northing_recording::{
    Event, Format, OpenOptions, Recording, RecordingError, Sample, SensorKind, WorldFrame, open,
    read_bytes, test_data,
};
use proptest::prelude::*;
use support::error_of;

/// 2025-11-21; as a float these nanoseconds would lose their last digits.
const START_NS: i64 = 1_763_697_600_000_000_001;
const GRAVITY: f64 = 9.80665;

#[derive(Clone, Copy, PartialEq)]
enum Phone {
    /// With `TotalAcceleration`.
    Android,
    /// Without it.
    AndroidWithoutTotal,
    Ios,
    IosStandardised,
}

/// One instant of the motion: body axes x right, y top edge, z out of the screen; world ENU.
struct Instant {
    time_ns: i64,
    rate: Vector3<f64>,
    force: Vector3<f64>,
    field: Vector3<f64>,
    attitude: UnitQuaternion<f64>,
}

fn motion() -> Vec<Instant> {
    (0..200)
        .map(|i| {
            let t = f64::from(i) * 0.01;
            let attitude = UnitQuaternion::from_euler_angles(0.3 * t, 0.2, 0.5 * t);
            let linear = Vector3::new(0.1 * t.sin(), 0.0, 0.0);
            Instant {
                time_ns: START_NS + i64::from(i) * 10_000_000,
                rate: Vector3::new(0.3, 0.05 * t, 0.5),
                force: attitude.inverse() * Vector3::z() * GRAVITY + linear,
                field: attitude.inverse() * Vector3::new(0.0, 22.0, -42.0),
                attitude,
            }
        })
        .collect()
}

/// Table name, column names, rows of (stamp, values).
type Table = (&'static str, Vec<&'static str>, Vec<(i64, Vec<f64>)>);

fn tables(phone: Phone) -> Vec<Table> {
    let motion = motion();
    // The iPhone's accelerations point the other way.
    let sign = if phone == Phone::Ios { -1.0 } else { 1.0 };
    let zyx = |name, offset: i64, value: &dyn Fn(&Instant) -> Vector3<f64>| -> Table {
        let row = |instant: &Instant| {
            let v = value(instant);
            (instant.time_ns + offset, vec![v.z, v.y, v.x])
        };
        (name, vec!["z", "y", "x"], motion.iter().map(row).collect())
    };
    let gravity = |i: &Instant| i.attitude.inverse() * Vector3::z() * GRAVITY;
    let mut tables = vec![
        zyx("Accelerometer", 0, &|i| (i.force - gravity(i)) * sign),
        zyx("Gravity", 0, &|i| gravity(i) * sign),
        // Stamps of its own.
        zyx("Gyroscope", 3_000_000, &|i| i.rate),
        zyx("GyroscopeUncalibrated", 3_000_000, &|i| {
            i.rate + Vector3::x() * 0.01
        }),
        zyx("Magnetometer", 1_000_000, &|i| i.field),
        zyx("MagnetometerUncalibrated", 1_000_000, &|i| {
            i.field + Vector3::y() * 200.0
        }),
    ];
    if phone == Phone::Android {
        tables.push(zyx("TotalAcceleration", 0, &|i| i.force));
    }
    let orientation = |instant: &Instant| {
        // The iPhone's world has x to the north and y to the west.
        let quarter =
            UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -std::f64::consts::FRAC_PI_2);
        let q = if phone == Phone::Ios {
            quarter * instant.attitude
        } else {
            instant.attitude
        };
        let (roll, pitch, yaw) = q.euler_angles();
        (
            instant.time_ns + 4_000_000,
            vec![yaw, q.i, q.k, roll, q.w, q.j, pitch],
        )
    };
    tables.push((
        "Orientation",
        vec!["yaw", "qx", "qz", "roll", "qw", "qy", "pitch"],
        motion.iter().map(orientation).collect(),
    ));
    let pressure = |instant: &Instant| (instant.time_ns, vec![0.0, 1013.25]);
    tables.push((
        "Barometer",
        vec!["relativeAltitude", "pressure"],
        motion.iter().step_by(50).map(pressure).collect(),
    ));
    tables
}

fn metadata(phone: Phone) -> Vec<(&'static str, &'static str)> {
    let (platform, standardisation) = match phone {
        Phone::Android | Phone::AndroidWithoutTotal => ("android", "false"),
        Phone::Ios => ("ios", "false"),
        Phone::IosStandardised => ("ios", "true"),
    };
    vec![
        ("version", "3"),
        ("device name", "test phone"),
        ("platform", platform),
        ("appVersion", "1.63"),
        ("standardisation", standardisation),
    ]
}

/// File name and content of every CSV of the export.
fn csv_files(tables: &[Table], metadata: &[(&str, &str)]) -> BTreeMap<String, String> {
    let mut files = BTreeMap::new();
    for (name, columns, rows) in tables {
        let mut text = format!("time,seconds_elapsed,{}\n", columns.join(","));
        for (time_ns, values) in rows {
            write!(text, "{time_ns},{}", (time_ns - START_NS) as f64 * 1e-9).unwrap();
            values.iter().for_each(|v| write!(text, ",{v}").unwrap());
            text.push('\n');
        }
        files.insert(format!("{name}.csv"), text);
    }
    if !metadata.is_empty() {
        let names: Vec<_> = metadata.iter().map(|(name, _)| *name).collect();
        let values: Vec<_> = metadata.iter().map(|(_, value)| *value).collect();
        files.insert(
            "Metadata.csv".to_owned(),
            format!("{}\n{}\n", names.join(","), values.join(",")),
        );
    }
    files.insert(
        "Annotation.csv".to_owned(),
        "time,seconds_elapsed,text\n".to_owned(),
    );
    files
}

fn write_folder(folder: &Path, files: &BTreeMap<String, String>) {
    for (name, text) in files {
        std::fs::write(folder.join(name), text).unwrap();
    }
}

fn zip_of(files: &BTreeMap<String, String>) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default();
    for (name, text) in files {
        archive.start_file(format!("walk/{name}"), options).unwrap();
        archive.write_all(text.as_bytes()).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

fn json_of(tables: &[Table], metadata: &[(&str, &str)]) -> String {
    let mut entries = Vec::new();
    if !metadata.is_empty() {
        let pairs: Vec<_> = metadata
            .iter()
            .map(|(k, v)| format!("\"{k}\":\"{v}\""))
            .collect();
        entries.push(format!("{{\"sensor\":\"Metadata\",{}}}", pairs.join(",")));
    }
    for (name, columns, rows) in tables {
        for (time_ns, values) in rows {
            let mut entry = format!(
                "{{\"sensor\":\"{name}\",\n\"time\":\"{time_ns}\",\"note\":null,\"list\":[1,{{}}]"
            );
            for (column, value) in columns.iter().zip(values) {
                write!(entry, ",\"{column}\":\"{value}\"").unwrap();
            }
            entries.push(entry + "}");
        }
    }
    format!("[\n{}\n]\n", entries.join(",\n"))
}

/// Checks every event against the motion; returns how many of each sensor there are.
fn check(recording: &mut Recording) -> BTreeMap<SensorKind, usize> {
    let motion = motion();
    let mut counts = BTreeMap::new();
    let mut last = i64::MIN;
    for event in recording {
        let Event { time_ns, sample } = event.unwrap();
        assert!(time_ns >= last);
        last = time_ns;
        *counts.entry(sample.kind()).or_default() += 1;
        let place = usize::try_from((time_ns - START_NS) / 10_000_000).unwrap();
        let offset = (time_ns - START_NS) % 10_000_000;
        let truth = &motion[place];
        let (error, expected_offset) = match sample {
            Sample::AngularRate(v) => ((v - truth.rate).norm(), 3_000_000),
            Sample::DeviceGyroscopeBias(v) => ((v - Vector3::x() * 0.01).norm(), 3_000_000),
            Sample::SpecificForce(v) => ((v - truth.force).norm(), 0),
            Sample::MagneticField(v) => ((v - truth.field).norm(), 1_000_000),
            Sample::MagneticFieldUncalibrated(v) => {
                ((v - truth.field - Vector3::y() * 200.0).norm(), 1_000_000)
            }
            Sample::DeviceOrientation(q) => (q.angle_to(&truth.attitude), 4_000_000),
            Sample::Pressure(p) => ((p - 101_325.0).abs(), 0),
            other => panic!("{other:?}"),
        };
        assert!(error < 1e-7, "{sample:?} is off by {error}");
        assert_eq!(offset, expected_offset);
    }
    counts
}

fn check_all(mut recording: Recording) {
    assert_eq!(recording.metadata().format, "sensor-logger");
    assert_eq!(recording.metadata().world_frame, WorldFrame::Enu);
    assert_eq!(recording.metadata().device.as_deref(), Some("test phone"));
    assert_eq!(recording.metadata().extra["appVersion"], "1.63");
    let counts = check(&mut recording);
    assert_eq!(counts.keys().copied().collect::<Vec<_>>(), {
        let mut kinds = recording.sensors().to_vec();
        kinds.sort_unstable();
        kinds
    });
    for (kind, count) in counts {
        assert_eq!(
            count,
            if kind == SensorKind::Pressure { 4 } else { 200 },
            "{}",
            kind.name()
        );
    }
    assert!(recording.issues().is_empty(), "{:?}", recording.issues());
}

const PHONES: [Phone; 4] = [
    Phone::Android,
    Phone::AndroidWithoutTotal,
    Phone::Ios,
    Phone::IosStandardised,
];

#[test]
fn folders_of_every_platform_read_the_same() {
    for phone in PHONES {
        let folder = tempfile::tempdir().unwrap();
        write_folder(folder.path(), &csv_files(&tables(phone), &metadata(phone)));
        check_all(open(folder.path(), &OpenOptions::default()).unwrap());
    }
}

#[test]
fn zips_of_every_platform_read_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("walk.zip");
    for phone in PHONES {
        std::fs::write(&path, zip_of(&csv_files(&tables(phone), &metadata(phone)))).unwrap();
        let recording = open(&path, &OpenOptions::default()).unwrap();
        assert_eq!(recording.metadata().name, "walk");
        check_all(recording);
    }
}

#[test]
fn json_of_every_platform_reads_the_same_from_file_and_memory() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("walk.json");
    for phone in PHONES {
        let text = json_of(&tables(phone), &metadata(phone));
        std::fs::write(&path, &text).unwrap();
        check_all(open(&path, &OpenOptions::default()).unwrap());
        check_all(read_bytes(text.into_bytes(), "walk.json", &OpenOptions::default()).unwrap());
    }
}

#[test]
fn json_with_interleaved_tables_reads_the_same() {
    let mut entries = Vec::new();
    for (name, columns, rows) in tables(Phone::Android) {
        for row in rows {
            entries.push((row.0, json_of(&[(name, columns.clone(), vec![row])], &[])));
        }
    }
    entries.sort();
    let entries: Vec<_> = entries
        .iter()
        .map(|(_, e)| e.trim().trim_matches(['[', ']']))
        .collect();
    let text = format!("[{}]", entries.join(","));
    let mut recording =
        read_bytes(text.into_bytes(), "walk.json", &OpenOptions::default()).unwrap();
    assert_eq!(check(&mut recording).values().sum::<usize>(), 6 * 200 + 4);
}

#[test]
fn without_metadata_the_phone_orientation_tells_the_sign() {
    for (phone, expected) in [
        (Phone::AndroidWithoutTotal, "it is"),
        (Phone::Ios, "inverted"),
    ] {
        let text = json_of(&tables(phone), &[]);
        let mut recording =
            read_bytes(text.into_bytes(), "walk.json", &OpenOptions::default()).unwrap();
        assert_eq!(check(&mut recording)[&SensorKind::Accelerometer], 200);
        let notes = &recording.issues().notes;
        assert!(
            notes[0].contains(&format!("taken as {expected}: the phone's own orientation")),
            "{notes:?}"
        );
    }
}

#[test]
fn a_platform_that_contradicts_the_orientation_is_told() {
    let text = json_of(&tables(Phone::Ios), &metadata(Phone::Android));
    let recording = read_bytes(text.into_bytes(), "walk.json", &OpenOptions::default()).unwrap();
    assert!(recording.issues().notes[0].contains("wrong sign"));
}

#[test]
fn uncalibrated_acceleration_stands_in_with_its_platform_unit() {
    for (phone, factor) in [(Phone::Android, 1.0), (Phone::Ios, -1.0 / GRAVITY)] {
        let total = tables(Phone::Android)
            .into_iter()
            .find(|(name, ..)| *name == "TotalAcceleration");
        let (_, columns, rows) = total.unwrap();
        let scaled = rows
            .into_iter()
            .map(|(t, values)| (t, values.iter().map(|v| v * factor).collect()))
            .collect();
        let mut tables = tables(phone);
        tables.retain(|(name, ..)| *name == "Gyroscope");
        tables.push(("AccelerometerUncalibrated", columns, scaled));
        let text = json_of(&tables, &metadata(phone));
        let mut recording =
            read_bytes(text.into_bytes(), "walk.json", &OpenOptions::default()).unwrap();
        assert_eq!(check(&mut recording)[&SensorKind::Accelerometer], 200);
    }
}

#[test]
fn acceleration_without_gravity_at_its_stamp_is_dropped_and_counted() {
    let mut tables = tables(Phone::AndroidWithoutTotal);
    for (name, _, rows) in &mut tables {
        if *name == "Gravity" {
            rows.remove(10);
            rows[20].0 += 1;
        }
    }
    let text = json_of(&tables, &metadata(Phone::Android));
    let mut recording =
        read_bytes(text.into_bytes(), "walk.json", &OpenOptions::default()).unwrap();
    assert_eq!(check(&mut recording)[&SensorKind::Accelerometer], 198);
    // One acceleration without gravity, and one of each whose stamps differ by a nanosecond.
    assert_eq!(recording.issues().incomplete_samples, 3);
}

#[test]
fn what_is_wrong_is_named() {
    let read = |text: &str| {
        error_of(read_bytes(
            text.as_bytes().to_vec(),
            "x.json",
            &OpenOptions::default(),
        ))
    };
    let gyroscope = r#"{"sensor":"Gyroscope","time":"1","z":"0","y":"0","x":"0"}"#;
    assert!(
        read(&format!("[{gyroscope},{gyroscope}"))
            .starts_with("x.json: damaged or cut off: the array is not closed")
    );
    assert!(read(&format!("[{gyroscope},{}", &gyroscope[..30])).contains("not closed"));
    assert_eq!(
        read(&format!(
            "[\n{gyroscope},\n{}]",
            gyroscope.replace(r#""y":"0""#, r#""y":"up""#)
        )),
        "x.json, line 3, column `y`: `up` is not a number (leave the cell empty where there is no sample)"
    );
    assert!(
        read(&format!("[{}]", gyroscope.replace("\"y\"", "\"Y\"")))
            .starts_with("x.json, line 1: an entry of gyroscope without `y`; it has Y,")
    );
    assert!(read("{}").starts_with("x.json: not a recording: JSON that is not"));
    assert!(read(r#"[{"a":1}]"#).starts_with("x.json, line 1: missing field `sensor`"));
    assert!(read(r#"[{"sensor":"Light"}]"#).contains("none of Sensor Logger's tables, but Light"));
    assert!(read("[]").contains("none of Sensor Logger's tables, and nothing else"));
    let gravity = gyroscope.replace("Gyroscope", "Magnetometer");
    assert!(read(&format!("[{gravity}]")).starts_with("x.json: no gyroscope: it has magnetometer"));
}

#[test]
fn what_is_wrong_in_a_folder_names_the_table() {
    let folder = tempfile::tempdir().unwrap();
    let table = folder.path().join("Gyroscope.csv");
    let read = || error_of(open(folder.path(), &OpenOptions::default()));
    assert!(read().contains("none of Sensor Logger's tables, and nothing else"));
    std::fs::write(&table, "time,seconds_elapsed,z,y\n1,0,0,0\n").unwrap();
    assert!(read().ends_with(
        "/Gyroscope.csv: missing column x; the file has time, seconds_elapsed, z, y; a Sensor Logger table has time and x, y, z"
    ));
    std::fs::write(&table, "time,seconds_elapsed,z,y,x\n1,0,0,0,0\n2,0,0,?,0\n").unwrap();
    assert!(read().contains("Gyroscope.csv, line 3, column `y`: `?` is not a number"));
    std::fs::write(&table, "").unwrap();
    assert!(read().contains("Gyroscope.csv: missing column x; the file has none"));
}

#[test]
fn other_zips_are_named() {
    let files = BTreeMap::from([("report.txt".to_owned(), "hello".to_owned())]);
    let whole = zip_of(&files);
    let read =
        |bytes: &[u8]| error_of(read_bytes(bytes.to_vec(), "x.zip", &OpenOptions::default()));
    assert!(read(&whole).starts_with("x.zip: not a recording: a zip of walk/report.txt;"));
    assert!(read(&whole[..whole.len() / 2]).starts_with("x.zip: damaged or cut off: "));
}

/// The exports that were made independently of this program, if there.
#[test]
fn independent_fixtures_agree_with_their_truth() {
    let Some(fixtures) = test_data::fixtures_dir("independent_fixtures_agree_with_their_truth")
    else {
        return;
    };
    let truth = std::fs::read_to_string(fixtures.join("truth.csv")).unwrap();
    let truth: Vec<Vec<f64>> = truth
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect())
        .collect();
    for (name, events_expected) in [("export_csv", 3 * 301), ("export_json.json", 3 * 31)] {
        let path = fixtures.join("sensor_logger").join(name);
        let mut count = 0;
        for event in open(&path, &OpenOptions::default()).unwrap() {
            let event = event.unwrap();
            let t = (event.time_ns - 1_763_697_600_000_000_000) as f64 * 1e-9;
            let row = truth
                .iter()
                .min_by(|a, b| (a[0] - t).abs().total_cmp(&(b[0] - t).abs()))
                .unwrap();
            let (v, first) = match event.sample {
                Sample::AngularRate(v) => (v, 1),
                Sample::SpecificForce(v) => (v, 4),
                Sample::MagneticField(v) => (v, 7),
                other => panic!("{other:?}"),
            };
            let error = (v - Vector3::new(row[first], row[first + 1], row[first + 2])).norm();
            assert!(error < 1e-3, "{name} at {t} s: {error}");
            count += 1;
        }
        assert!(count >= events_expected, "{name}: {count}");
    }
}

fn drain(bytes: Vec<u8>) -> Result<(), RecordingError> {
    let options = OpenOptions {
        format: Some(Format::SensorLogger),
        ..OpenOptions::default()
    };
    read_bytes(bytes, "fuzz", &options)?.try_for_each(|event| event.map(drop))
}

proptest! {
    #![proptest_config(support::arbitrary_cases(128, 0x5e))]

    #[test]
    fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
        let _ = drain(bytes);
    }

    #[test]
    fn arbitrary_json_never_panics(text in r#"\[(\{("(sensor|time|x|y|z|qw)":("Gyroscope"|"Gravity"|"-?[0-9]{1,22}"|[0-9]{1,3}|null|\{\}),?){0,5}\}?,?){0,4}\]?"#) {
        let _ = drain(text.into_bytes());
    }

    #[test]
    fn changed_zips_never_panic(changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..6)) {
        let mut tables = tables(Phone::Android);
        tables.iter_mut().for_each(|(_, _, rows)| rows.truncate(3));
        let mut bytes = zip_of(&csv_files(&tables, &metadata(Phone::Android)));
        for (place, value) in changes {
            let place = place.index(bytes.len());
            bytes[place] = value;
        }
        let _ = drain(bytes);
    }
}
