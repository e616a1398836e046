//! Delimited text of all kinds through a manifest.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use crate::support;

use nalgebra::{UnitQuaternion, Vector3};
use northing_recording::{
    Event, OpenOptions, RateUnit, Recording, RecordingError, Sample, SensorKind, WorldFrame,
    manifest, open, read_from,
};
use proptest::prelude::*;
use support::error_of;

const MANIFEST: &str = r#"
file = "log.txt"
name = "bench"
device = "board 3"
world_frame = "ned"
delimiter = ";"
decimal_comma = true
skip_rows = 2
comment = "%"

[time]
column = "ms"
unit = "ms"

[gyroscope]
columns = ["wx", "wy", "wz"]
unit = "deg-per-s"
axes = "y,x,-z"

[accelerometer]
columns = [5, 6, 7]
unit = "g"
axes = "-x,-y,-z"

[magnetometer]
columns = ["bx", "by", "bz"]
unit = "gauss"

[device_orientation]
columns = ["q1", "q2", "q3", "q0"]
order = "xyzw"

[reference]
columns = ["r0", "r1", "r2", "r3"]
direction = "world-to-body"
scored = "ok"

[pressure]
column = "p"
unit = "hpa"

[extra]
firmware = "1.2"
"#;

const DATA: &str = "Logger 7\nstarted at noon\n\
    ms;wx;wy;wz;ax;ay;az;bx;by;bz;q0;q1;q2;q3;r0;r1;r2;r3;ok;p\n\
    1000,5;180;90;-45;0,1;0,2;-1;0,2;0,1;-0,4;0,8;0,6;0;0;0,8;0,6;0;0;0;1013,25\n\
    % a remark\n\
    1010,5;0;0;0;;;;;;;;;;;;;;;;\n";

fn read(manifest: &str, data: &str) -> Result<Recording, RecordingError> {
    manifest::read_bytes(
        manifest,
        data.as_bytes().to_vec(),
        "log",
        &OpenOptions::default(),
    )
}

fn all(recording: Recording) -> Vec<Event> {
    recording.map(Result::unwrap).collect()
}

#[test]
fn units_axes_orders_and_decimal_commas_are_applied() {
    let recording = read(MANIFEST, DATA).unwrap();
    let metadata = recording.metadata();
    assert_eq!(
        (metadata.name.as_str(), metadata.format.as_str()),
        ("bench", "manifest")
    );
    assert_eq!(metadata.world_frame, WorldFrame::Ned);
    assert_eq!(metadata.device.as_deref(), Some("board 3"));
    assert_eq!(metadata.extra["firmware"], "1.2");
    let events = all(recording);
    assert_eq!(events.len(), 7);
    assert!(
        events[..6]
            .iter()
            .all(|event| event.time_ns == 1_000_500_000)
    );
    assert_eq!(events[6].time_ns, 1_010_500_000);
    let near = |v: Vector3<f64>, x: f64, y: f64, z: f64| (v - Vector3::new(x, y, z)).norm() < 1e-12;
    let tilted = UnitQuaternion::new_normalize(nalgebra::Quaternion::new(0.8, 0.6, 0.0, 0.0));
    let pi = std::f64::consts::PI;
    for event in &events[..6] {
        let right = match event.sample {
            Sample::AngularRate(v) => near(v, pi / 2.0, pi, pi / 4.0),
            Sample::SpecificForce(v) => near(v, -0.980665, -1.96133, 9.80665),
            Sample::MagneticField(v) => near(v, 20.0, 10.0, -40.0),
            Sample::DeviceOrientation(q) => q.angle_to(&tilted) < 1e-12,
            Sample::Reference(r) => !r.scored && r.attitude.angle_to(&tilted.inverse()) < 1e-12,
            Sample::Pressure(p) => (p - 101_325.0).abs() < 1e-9,
            _ => false,
        };
        assert!(right, "{event:?}");
    }
}

const NUMBERED: &str = r#"
delimiter = " "
header = false
time = { column = 1, unit = "us" }
gyroscope = { columns = [2, 3, 4] }
"#;

#[test]
fn runs_of_blanks_separate_numbered_columns() {
    // Longer than the reader's buffers, so that runs of blanks cross them.
    let rows = 30_000;
    let text: String = (0..rows)
        .map(|i| format!("  {}\t  {}   0.5 \t -1e-3  \r\n", i * 5000, i % 7))
        .collect();
    let events = all(read(NUMBERED, &text).unwrap());
    assert_eq!(events.len(), rows);
    for (i, event) in events.iter().enumerate() {
        assert_eq!(event.time_ns, i as i64 * 5_000_000);
        assert_eq!(
            event.sample,
            Sample::AngularRate(Vector3::new((i % 7) as f64, 0.5, -1e-3))
        );
    }
}

/// The stamps of the rows that are read.
fn stamps(time: &str, data: &str) -> Result<Vec<i64>, String> {
    let manifest = format!("{time}\ngyroscope = {{ columns = [\"x\", \"y\", \"z\"] }}\n");
    let recording = read(&manifest, data).map_err(|error| error.to_string())?;
    let mut times: Vec<i64> = Vec::new();
    for event in recording {
        times.push(event.map_err(|error| error.to_string())?.time_ns);
    }
    Ok(times)
}

#[test]
fn rows_at_a_rate_need_no_stamps() {
    let rows = "x,y,z,what\n1,2,3,a\n,,,a\n1,2,3,b\n1,2,3,a\n";
    let third = "time = { rate_hz = 3 }\n";
    // An empty row takes its time.
    assert_eq!(
        stamps(third, rows).unwrap(),
        [0, 666_666_667, 1_000_000_000]
    );
    // Of rows of several kinds those that are taken are counted.
    let some = format!("{third}rows = {{ column = \"what\", equals = \"a\" }}\n");
    assert_eq!(stamps(&some, rows).unwrap(), [0, 666_666_667]);
    for bad in ["0", "-100", "nan", "inf"] {
        let error = stamps(&format!("time = {{ rate_hz = {bad} }}"), rows).unwrap_err();
        assert!(error.contains("rows in a second"), "{bad}: {error}");
    }
}

#[test]
fn a_date_and_a_time_of_day_may_stand_in_two_columns() {
    let time = "time = { columns = [\"date\", \"utc\"] }\n";
    let rows = "date,utc,x,y,z\n2014/08/01,00:00:00.186,1,2,3\n01-Aug-2014,00:00:01,1,2,3\n";
    let times = stamps(time, rows).unwrap();
    assert_eq!(
        times,
        [1_406_851_200_186_000_000, 1_406_851_201_000_000_000]
    );
    let error = stamps(time, &rows.replace("2014/08/01", "01/08/2014")).unwrap_err();
    assert!(
        error.contains("line 2, column `date`: `01/08/2014` is not a date and a time of day"),
        "{error}"
    );
    for bad in [
        "time = { columns = [\"date\", \"utc\"], unit = \"s\" }",
        "time = { column = \"date\", columns = [\"date\", \"utc\"] }",
        "time = { column = \"x\", unit = \"s\", rate_hz = 3 }",
        "time = { column = \"x\" }",
        "time = {}",
    ] {
        let error = stamps(bad, rows).unwrap_err();
        assert!(error.starts_with("log: [time] "), "{bad}: {error}");
    }
}

#[test]
fn a_scale_multiplies_what_the_unit_cannot_say() {
    let with = |scale: &str| {
        let manifest = NUMBERED.replace(
            "[2, 3, 4]",
            &format!("[2, 3, 4], unit = \"deg-per-s\", scale = {scale}"),
        );
        read(&manifest, "0 180000 0 -90000\n")
    };
    let pi = std::f64::consts::PI;
    let Sample::AngularRate(rate) = all(with("0.001").unwrap())[0].sample else {
        panic!()
    };
    approx::assert_relative_eq!(rate, Vector3::new(pi, 0.0, -pi / 2.0), epsilon = 1e-12);
    for bad in ["0.0", "nan", "inf"] {
        assert!(error_of(with(bad)).contains("[gyroscope] scale"), "{bad}");
    }
}

#[test]
fn the_manifest_the_data_beside_it_and_a_stream_all_open() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("log.txt");
    std::fs::write(&data, DATA).unwrap();
    let options = OpenOptions::default();
    assert!(error_of(open(&data, &options)).contains("without a manifest beside it"));

    for name in ["log.txt.toml", "log.toml"] {
        let manifest = folder.path().join(name);
        std::fs::write(&manifest, MANIFEST).unwrap();
        assert_eq!(all(open(&manifest, &options).unwrap()).len(), 7);
        assert_eq!(all(open(&data, &options).unwrap()).len(), 7);
        std::fs::remove_file(&manifest).unwrap();
    }
    let elsewhere = tempfile::tempdir().unwrap();
    let manifest = elsewhere.path().join("board.toml");
    std::fs::write(&manifest, MANIFEST).unwrap();
    let options = OpenOptions {
        manifest: Some(manifest.clone()),
        ..options
    };
    assert_eq!(all(open(&data, &options).unwrap()).len(), 7);
    let stream = std::io::Cursor::new(DATA);
    assert_eq!(
        all(read_from(stream, "standard input", &options).unwrap()).len(),
        7
    );
    let missing = error_of(open(&manifest, &OpenOptions::default()));
    assert!(missing.contains("log.txt: cannot open it"), "{missing}");
}

#[test]
fn the_users_unit_replaces_the_manifests() {
    let options = OpenOptions {
        gyroscope_unit: Some(RateUnit::RadPerS),
        ..OpenOptions::default()
    };
    let recording = manifest::read_bytes(MANIFEST, DATA.into(), "log", &options).unwrap();
    assert_eq!(
        all(recording)[0].sample,
        Sample::AngularRate(Vector3::new(90.0, 180.0, 45.0))
    );
}

#[test]
fn mistakes_in_the_manifest_name_line_and_key() {
    let cases = [
        (
            "name = \"bench\"",
            "nome = \"bench\"",
            "log: line 3: unknown field `nome`, expected one of",
        ),
        (
            "unit = \"ms\"",
            "unit = \"min\"",
            "log: line 13: unknown variant `min`, expected one of `s`, `ms`, `us`, `ns`",
        ),
        ("\"deg-per-s\"", "\"rpm\"", "unknown variant `rpm`"),
        (
            "y,x,-z",
            "y,y,-z",
            "[gyroscope] axes = \"y,y,-z\": expected each of x, y, z once",
        ),
        ("y,x,-z", "y,x", "[gyroscope] axes = \"y,x\""),
        ("[5, 6, 7]", "[5, 6]", "log: line 21: "),
        (
            "[5, 6, 7]",
            "[0, 6, 7]",
            "log: column number 0: columns are counted from 1",
        ),
        (
            "[5, 6, 7]",
            "[5, 6, 27]",
            "log: missing column number 27; the file has ms, wx,",
        ),
        (
            "\"bx\"",
            "\"mx\"",
            "log: missing column mx; the file has ms, wx,",
        ),
        (
            "delimiter = \";\"",
            "delimiter = \",\"",
            "decimal_comma needs a delimiter other than the comma",
        ),
        (
            "delimiter = \";\"",
            "delimiter = \"→\"",
            "one ASCII character",
        ),
        ("[time]", "[[time]]", "log: line 11: "),
        (
            "order = \"xyzw\"",
            "scored = \"ok\"",
            "[device_orientation] has `scored`",
        ),
    ];
    for (from, to, expected) in cases {
        assert!(MANIFEST.contains(from));
        let error = error_of(read(&MANIFEST.replace(from, to), DATA));
        assert!(error.contains(expected), "{to}: {error}");
    }
    let no_gyroscope = NUMBERED.replace("gyroscope", "accelerometer");
    assert!(
        error_of(read(&no_gyroscope, "0 0 0 0\n"))
            .starts_with("log: no gyroscope: it has accelerometer")
    );
    let named = NUMBERED.replace("[2, 3, 4]", "[\"x\", 3, 4]");
    assert!(error_of(read(&named, "0 0 0 0\n")).contains("header = false"));
}

#[test]
fn mistakes_in_the_data_name_line_and_column() {
    let error = error_of(read(MANIFEST, &DATA.replace("1013,25", "dry")));
    assert_eq!(
        error,
        "log, line 4, column `p`: `dry` is not a number (leave the cell empty where there is no sample)"
    );
    assert!(error_of(read(NUMBERED, "")).starts_with("log: empty: nothing after 0 skipped lines"));
    let error = error_of(read(NUMBERED, "0 0 0 0\n5000 1 2\n"));
    assert_eq!(
        error,
        "log, line 2: 3 cells where the first row has 4; is the line cut off?"
    );
    let mut gaps = read(
        NUMBERED,
        "0 0 0 0\n5000 0 0 0\n5000 0 0 0\n4000 0 0 0\n900000 0 0 0\n",
    )
    .unwrap();
    assert_eq!(gaps.by_ref().map(Result::unwrap).count(), 3);
    assert_eq!(gaps.issues().duplicate_stamps[&SensorKind::Gyroscope], 1);
    assert_eq!(gaps.issues().stamps_going_back[&SensorKind::Gyroscope], 1);
    assert_eq!(gaps.issues().gaps, 1);
}

proptest! {
    #![proptest_config(support::arbitrary_cases(256, 0x3a))]

    #[test]
    fn arbitrary_manifests_never_panic(text in "[a-z_ =\"\\[\\]\n0-9,.;{}]{0,200}") {
        let _ = manifest::parse(&text, "fuzz");
    }

    #[test]
    fn arbitrary_data_never_panics(data in proptest::collection::vec(any::<u8>(), 0..300), blanks in any::<bool>()) {
        let manifest = if blanks { NUMBERED } else { MANIFEST };
        if let Ok(recording) = manifest::read_bytes(manifest, data, "fuzz", &OpenOptions::default()) {
            recording.for_each(drop);
        }
    }
}
