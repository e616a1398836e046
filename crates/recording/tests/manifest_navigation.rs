//! Manifests of several files, satellite receivers, and references to score against.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

mod support;

use std::fs;
use std::path::Path;

use northing_recording::{
    Event, GnssPosition, GnssQuality, OpenOptions, Recording, RecordingError, Sample, SensorKind,
    WorldFrame, open,
};
use support::error_of;

const DEGREE: f64 = std::f64::consts::PI / 180.0;

/// Opens a manifest whose files are in a folder of their own.
fn opened(manifest: &str, files: &[(&str, &str)]) -> Result<Recording, RecordingError> {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    fs::create_dir(&data).unwrap();
    for (name, text) in files {
        fs::write(data.join(name), text).unwrap();
    }
    let path = folder.path().join("drive.toml");
    fs::write(&path, manifest).unwrap();
    let options = OpenOptions {
        data: Some(data),
        ..OpenOptions::default()
    };
    // The files stay open when the folder goes.
    open(&path, &options)
}

fn all(recording: Recording) -> Vec<Event> {
    recording.map(Result::unwrap).collect()
}

const DRIVE: &str = r#"
name = "drive"
world_frame = "ned"
lever_arm = { frd_m = [0.1, -0.05, -1.2] }
latency = { gnss_position_s = 0.02, gnss_velocity_s = 0.12 }

[[source]]
file = "imu.csv"
time = { column = "t", unit = "s" }
time_offset_s = -0.5
gyroscope = { columns = ["wx", "wy", "wz"], axes = "-x,y,-z" }

[[source]]
file = "fixes.csv"
time = { column = "t", unit = "s" }
[source.gnss_position]
latitude = "lat"
longitude = "lon"
height = "h"
std = ["sn", "se", "su"]
hdop = "hdop"
satellites = "n"
quality = "q"
[source.gnss_velocity]
columns = ["ve", "vn", "vu"]
axes = "enu"

[[source]]
file = "fixes.csv"
role = "reference"
time = { column = "t", unit = "s" }
gnss_position = { latitude = "lat", longitude = "lon" }
gnss_velocity = { speed = "vn", course = "h" }
"#;

const IMU: &str = "t,wx,wy,wz\n10.5,1,2,3\n11.5,1,2,3\n";
const FIXES: &str = "t,lat,lon,h,sn,se,su,hdop,n,q,ve,vn,vu\n\
    10.0,47.5,-8.25,90,1,2,3,0.9,12,4,1,2,3\n\
    10.5,47.5,-8.25,,,,,,,0,1,2,3\n\
    11.0,47.5,-8.25,,,,,,,,1,2,3\n";

#[test]
fn sources_are_shifted_merged_and_made_references() {
    let mut recording = opened(DRIVE, &[("imu.csv", IMU), ("fixes.csv", FIXES)]).unwrap();
    let metadata = recording.metadata().clone();
    assert_eq!(metadata.name, "drive");
    assert_eq!(metadata.world_frame, WorldFrame::Ned);
    assert_eq!(metadata.gnss_lever_arm_m, Some([0.1, -0.05, -1.2]));
    approx::assert_relative_eq!(metadata.gnss_position_latency_s, 0.02);
    approx::assert_relative_eq!(metadata.gnss_velocity_latency_s, 0.12);
    use SensorKind::{GnssVelocity, Gyroscope, ReferencePosition, ReferenceVelocity};
    assert_eq!(
        recording.sensors(),
        [
            Gyroscope,
            SensorKind::GnssPosition,
            GnssVelocity,
            ReferencePosition,
            ReferenceVelocity
        ]
    );
    let events: Vec<Event> = recording.by_ref().map(Result::unwrap).collect();
    let times: Vec<i64> = events.iter().map(|e| e.time_ns / 100_000_000).collect();
    // At 10.5 the receiver calls its fix invalid.
    assert_eq!(
        times,
        [
            100, 100, 100, 100, 100, 105, 105, 105, 110, 110, 110, 110, 110
        ]
    );
    let issues = recording.issues();
    assert_eq!(issues.invalid_fixes[&SensorKind::GnssPosition], 1);
    let told = |sentence: &String| sentence.contains("the receiver itself calls invalid");
    assert!(issues.sentences().iter().any(told));

    let Sample::AngularRate(rate) = events[0].sample else {
        panic!("{:?}", events[0])
    };
    assert_eq!(rate.as_slice(), [-1.0, 2.0, -3.0]);
    let full = GnssPosition {
        latitude_rad: 47.5 * DEGREE,
        longitude_rad: -8.25 * DEGREE,
        height_m: Some(90.0),
        std_m: Some([1.0, 2.0, 3.0]),
        hdop: Some(0.9),
        satellites: Some(12),
        quality: GnssQuality::RtkFixed,
    };
    assert_eq!(events[1].sample, Sample::GnssPosition(full));
    let Sample::GnssVelocity(v) = events[2].sample else {
        panic!("{:?}", events[2])
    };
    approx::assert_relative_eq!(v.north_m_s, 2.0);
    approx::assert_relative_eq!(v.east_m_s, 1.0);
    assert_eq!((v.down_m_s, v.std_m_s), (Some(-3.0), None));
    let Sample::ReferencePosition(reference) = events[3].sample else {
        panic!("{:?}", events[3])
    };
    assert_eq!(reference.height_m, None);
    // 2 m/s with a course of 90 deg.
    let Sample::ReferenceVelocity(v) = events[4].sample else {
        panic!("{:?}", events[4])
    };
    assert!(v.x.abs() < 1e-12 && (v.y - 2.0).abs() < 1e-12 && v.z.is_nan());
}

#[test]
fn units_codes_and_kinds_of_rows() {
    let manifest = r#"
[[source]]
file = "log.csv"
header = false
rows = { column = 2, equals = "imu" }
time = { column = 1, unit = "us" }
gyroscope = { columns = [3, 4, 5], unit = "deg" }
accelerometer = { columns = [6, 7, 8], unit = "m-per-s" }

[[source]]
file = "log.csv"
header = false
rows = { column = 2, equals = "gps" }
time = { column = 1, unit = "us" }
gnss_velocity = { speed = 6, speed_unit = "knots", course = 7, speed_std = 8 }
[source.gnss_position]
latitude = 3
longitude = 4
unit = "1e-7-deg"
height = 5
height_unit = "mm"

[[source]]
file = "log.csv"
header = false
rows = { column = 2, equals = "rest" }
time = { column = 1, unit = "us" }
pressure = { column = 3, unit = "m" }
true_heading = { column = 4 }
forward_speed = { column = 5, unit = "km-per-h" }
water_velocity = { forward = 6, unit = "knots" }
"#;
    let log = "0,imu,0,0,0,0,0,0\n10000,imu,1.8,0,0,0,0,-0.098\n20000,gps,475000000,-82500000,1500,10,90,1\n\
        30000,rest,0,180,36,10\n";
    let events = all(opened(manifest, &[("log.csv", log)]).unwrap());
    assert_eq!(events.len(), 8);
    // The first row of increments has nothing before it.
    assert_eq!(events[0].time_ns, 10_000_000);
    let near = |a: f64, b: f64| (a - b).abs() < 1e-9;
    for event in &events {
        let right = match event.sample {
            Sample::AngularRate(v) => near(v.x, std::f64::consts::PI),
            Sample::SpecificForce(v) => near(v.z, -9.8),
            Sample::GnssPosition(fix) => {
                near(fix.latitude_rad, 47.5 * DEGREE)
                    && near(fix.longitude_rad, -8.25 * DEGREE)
                    && fix.height_m.is_some_and(|h| near(h, 1.5))
                    && fix.quality == GnssQuality::Unknown
            }
            Sample::GnssVelocity(v) => {
                let knots = 1852.0 / 3600.0;
                near(v.north_m_s, 0.0)
                    && near(v.east_m_s, 10.0 * knots)
                    && v.std_m_s.is_some_and(|std| near(std[0], knots))
            }
            Sample::Pressure(p) => near(p, 101_325.0),
            Sample::TrueHeading(h) => near(h.heading_rad, std::f64::consts::PI),
            Sample::ForwardSpeed(v) => near(v, 10.0),
            Sample::WaterVelocity(w) => near(w.forward_m_s, 18520.0 / 3600.0),
            _ => false,
        };
        assert!(right, "{event:?}");
    }
}

#[test]
fn rtklib_numbers_its_fixes_the_other_way_round() {
    let manifest = r#"
file = "fixes.csv"
time = { column = "t", unit = "date-time" }
[gnss_position]
latitude = "lat"
longitude = "lon"
unit = "rad"
accuracy = ["acc", "v"]
quality = "q"
quality_code = "rtklib"
"#;
    let rows: String = [1, 2, 3, 4, 5, 6, 0]
        .iter()
        .map(|q| format!("2025-07-08 19:34:1{q},0.7,-1.8,2,3,{q}\n"))
        .collect();
    let fixes = format!("t,lat,lon,acc,v,q\n{rows}");
    let recording = opened(manifest, &[("fixes.csv", &fixes)]);
    let mut recording = recording.unwrap();
    assert_eq!(recording.metadata().name, "fixes");
    let qualities: Vec<GnssQuality> = recording
        .by_ref()
        .filter_map(|event| match event.unwrap().sample {
            Sample::GnssPosition(fix) => {
                approx::assert_relative_eq!(fix.std_m.unwrap()[1], 2_f64.sqrt());
                Some(fix.quality)
            }
            _ => None,
        })
        .collect();
    use GnssQuality::{Autonomous, Differential, RtkFixed, RtkFloat};
    assert_eq!(
        qualities,
        [
            RtkFixed,
            RtkFloat,
            Differential,
            Differential,
            Autonomous,
            Differential
        ]
    );
}

#[test]
fn a_pose_in_earth_centred_axes_becomes_three_references() {
    // On the equator at longitude 90: ECEF y is up, -x east, z north. The quaternion turns ECEF into a
    // body that looks east with its right side to the south and its belly down.
    let manifest = r#"
[[source]]
file = "imu.csv"
time = { column = "t", unit = "s" }
gyroscope = { columns = ["wx", "wy", "wz"] }
[[source]]
file = "track.csv"
time = { column = "t", unit = "s" }
[source.ecef_reference]
position_m = ["x", "y", "z"]
velocity_m_s = ["vx", "vy", "vz"]
attitude = ["qw", "qx", "qy", "qz"]
direction = "world-to-body"
"#;
    let earth = nalgebra::Matrix3::new(-1.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, -1.0, 0.0);
    let q = nalgebra::UnitQuaternion::from_matrix(&earth);
    let track = format!(
        "t,x,y,z,vx,vy,vz,qw,qx,qy,qz\n11,0,6378147,0,-5,0,1,{},{},{},{}\n",
        q.w, q.i, q.j, q.k
    );
    let files = [("imu.csv", IMU), ("track.csv", track.as_str())];
    let events = all(opened(manifest, &files).unwrap());
    assert_eq!(events.len(), 5);
    for event in &events[1..4] {
        match event.sample {
            Sample::ReferencePosition(place) => {
                approx::assert_abs_diff_eq!(place.latitude_rad, 0.0, epsilon = 1e-9);
                approx::assert_relative_eq!(place.longitude_rad, 90.0 * DEGREE);
                approx::assert_relative_eq!(place.height_m.unwrap(), 10.0, epsilon = 1e-6);
            }
            Sample::ReferenceVelocity(v) => {
                let expected = nalgebra::Vector3::new(1.0, 5.0, 0.0);
                approx::assert_relative_eq!(v, expected, epsilon = 1e-9);
            }
            Sample::Reference(reference) => {
                let (roll, pitch, yaw) = reference.attitude.euler_angles();
                approx::assert_abs_diff_eq!(roll, 0.0, epsilon = 1e-9);
                approx::assert_abs_diff_eq!(pitch, 0.0, epsilon = 1e-9);
                approx::assert_relative_eq!(yaw, 90.0 * DEGREE, epsilon = 1e-9);
            }
            _ => panic!("{event:?}"),
        }
    }
}

#[test]
fn a_wrong_manifest_is_told_with_line_and_advice() {
    let files = [("imu.csv", IMU), ("fixes.csv", FIXES)];
    let error = |from: &str, to: &str| {
        assert!(DRIVE.contains(from), "{from}");
        error_of(opened(&DRIVE.replace(from, to), &files))
    };
    for (from, to, expected) in [
        (
            "role = \"reference\"",
            "role = \"truth\"",
            "unknown variant `truth`",
        ),
        (
            "quality = \"q\"",
            "qualty = \"q\"",
            "line 23: unknown field `qualty`",
        ),
        (
            "latitude = \"lat\"",
            "latitude = \"latitude\"",
            "missing column latitude",
        ),
        (
            "speed = \"vn\", course",
            "speed = \"vn\", columns",
            "invalid",
        ),
        (
            "axes = \"enu\"",
            "axes = \"enu\"\nspeed = \"hdop\"",
            "either three `columns`, or `speed` and `course`",
        ),
        (
            "hdop = \"hdop\"",
            "hdop = \"n\"",
            "column `n` is used twice",
        ),
        (
            "std = [",
            "accuracy = [\"sn\", \"se\"]\nstd = [",
            "both `std` and `accuracy`",
        ),
        (
            "time_offset_s = -0.5",
            "time_offset_s = nan",
            "expected seconds",
        ),
        ("file = \"imu.csv\"\n", "", "missing key `file`"),
        ("file = \"imu.csv\"", "file = \"../drive.toml\"", "missing"),
    ] {
        let text = error(from, to);
        assert!(text.contains(expected), "{to}: {text}");
    }
    let nothing = error_of(opened("source = []", &[]));
    assert!(nothing.contains("no [[source]]"), "{nothing}");
    let itself = error_of(opened("[[source]]\nfile = \"../drive.toml\"", &[]));
    assert!(
        itself.contains("is a manifest, not a data file"),
        "{itself}"
    );
    let pressure = "file = \"imu.csv\"\ntime = { column = \"t\", unit = \"s\" }\npressure = { column = \"wx\" }";
    let blind = error_of(opened(pressure, &files));
    assert!(
        blind.contains("no gyroscope") && blind.contains("satellite"),
        "{blind}"
    );
}

/// A manifest of the repository with the data of `NORTHING_DATA`.
fn example(name: &str, data: &Path) -> Recording {
    let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/recordings");
    let options = OpenOptions {
        data: Some(data.to_owned()),
        ..OpenOptions::default()
    };
    open(&manifest.join(name), &options).unwrap()
}

fn count(events: &[Event], kind: SensorKind) -> usize {
    events.iter().filter(|e| e.sample.kind() == kind).count()
}

fn first(events: &[Event], kind: SensorKind) -> Event {
    *events.iter().find(|e| e.sample.kind() == kind).unwrap()
}

#[test]
fn the_car_is_read() {
    let Some(data) = northing_recording::test_data::data_dir("the_car_is_read") else {
        return;
    };
    use SensorKind::{Accelerometer, GnssVelocity, Gyroscope, ReferencePosition};
    let mut recording = example("car_rtk.toml", &data);
    assert_eq!(
        recording.metadata().gnss_lever_arm_m,
        Some([0.0, -0.05, 0.0])
    );
    let rtk: Vec<Event> = recording.by_ref().map(Result::unwrap).collect();
    assert!(recording.issues().is_empty(), "{:?}", recording.issues());
    assert_eq!(count(&rtk, Gyroscope), 39_666);
    assert_eq!(count(&rtk, Accelerometer), 39_666);
    assert_eq!(count(&rtk, SensorKind::GnssPosition), 1601);
    assert_eq!(count(&rtk, GnssVelocity), 1601);
    assert_eq!(rtk[0].time_ns, 243_258_499_000_000);
    assert_eq!(first(&rtk, Gyroscope).time_ns, 243_261_684_000_000);
    let fixed = |e: &Event| matches!(e.sample, Sample::GnssPosition(fix) if fix.quality == GnssQuality::RtkFixed);
    assert!(rtk.iter().filter(|e| fixed(e)).count() > 1000);

    let noisy = all(example("car_rtk_1hz_noisy.toml", &data));
    assert_eq!(count(&noisy, SensorKind::GnssPosition), 400);
    assert_eq!(count(&noisy, ReferencePosition), 1601);

    // The same drive as increments: the same rates and forces, the first row apart.
    let increments = all(example("car_rtk_kf_gins.toml", &data));
    assert_eq!(count(&increments, Gyroscope), 39_665);
    let of = |events: &[Event], kind| -> Vec<Event> {
        events
            .iter()
            .filter(|e| e.sample.kind() == kind)
            .copied()
            .collect()
    };
    for kind in [Gyroscope, Accelerometer] {
        for (one, other) in of(&rtk, kind)[1..].iter().zip(of(&increments, kind)) {
            assert_eq!(one.time_ns, other.time_ns);
            let ((Sample::AngularRate(a), Sample::AngularRate(b))
            | (Sample::SpecificForce(a), Sample::SpecificForce(b))) = (one.sample, other.sample)
            else {
                panic!("{one:?} {other:?}")
            };
            // The stamps of increments are written to 0.1 ms of 8 to 11 ms.
            let bound = 0.013 * a.amax() + 1e-4;
            assert!((a - b).amax() < bound, "{one:?} {other:?}");
        }
    }
}

/// The events of a manifest, and what was odd.
fn told(name: &str, data: &Path) -> (Vec<Event>, Vec<String>) {
    let mut recording = example(name, data);
    let events = recording.by_ref().map(Result::unwrap).collect();
    (events, recording.issues().sentences())
}

/// Name, how many samples of some kinds there are, and parts of remarks.
type Expected = (
    &'static str,
    &'static [(SensorKind, usize)],
    &'static [&'static str],
);

#[test]
fn every_example_is_read() {
    use SensorKind as Kind;
    let Some(data) = northing_recording::test_data::data_dir("every_example_is_read") else {
        return;
    };
    let expected: [Expected; 8] = [
        (
            "phone_comma2k19",
            &[
                (Kind::Gyroscope, 6256),
                (Kind::Magnetometer, 592),
                (Kind::GnssPosition, 579),
                (Kind::GnssVelocity, 579),
                (Kind::ForwardSpeed, 4974),
                (Kind::ReferencePosition, 1200),
                (Kind::ReferenceVelocity, 1200),
                (Kind::Reference, 1200),
            ],
            &[],
        ),
        (
            "vn100_circles_1hz",
            &[
                (Kind::Gyroscope, 2530),
                (Kind::Magnetometer, 2530),
                (Kind::GnssPosition, 66),
            ],
            &[],
        ),
        (
            "px4_simulated",
            &[
                (Kind::Gyroscope, 9711),
                (Kind::Magnetometer, 3212),
                (Kind::Pressure, 538),
                (Kind::GnssPosition, 98),
                (Kind::GnssVelocity, 98),
            ],
            &[],
        ),
        (
            "phone_sensorlogger_1hz",
            &[
                (Kind::Gyroscope, 5450),
                (Kind::Pressure, 5450),
                (Kind::GnssPosition, 5443),
            ],
            &["one sample every 1.000 s"],
        ),
        (
            "ship_nbp1406_pcode",
            &[
                (Kind::GnssPosition, 420),
                (Kind::GnssVelocity, 420),
                (Kind::WaterVelocity, 352),
                (Kind::TrueHeading, 2099),
                (Kind::ReferencePosition, 420),
                (Kind::Reference, 420),
            ],
            &["1024 weeks from that of the log"],
        ),
        (
            "nmea_gps",
            &[(Kind::GnssPosition, 1202), (Kind::GnssVelocity, 1201)],
            &[],
        ),
        (
            "nmea_plaka",
            &[
                (Kind::GnssPosition, 7250),
                (Kind::GnssVelocity, 7249),
                (Kind::WaterVelocity, 7249),
            ],
            &["before the first time of the log"],
        ),
        (
            "nmea_gofree_merrimac",
            &[(Kind::GnssPosition, 142), (Kind::WaterVelocity, 142)],
            &[
                "142 NMEA sentence(s) with a wrong checksum",
                "fields are not",
            ],
        ),
    ];
    for (name, counts, remarks) in expected {
        let (events, sentences) = told(&format!("{name}.toml"), &data);
        for &(kind, number) in counts {
            assert_eq!(count(&events, kind), number, "{name}: {kind:?}");
        }
        let all = sentences.join(" ");
        assert!(remarks.iter().all(|r| all.contains(r)), "{name}: {all}");
        assert!(!remarks.is_empty() || all.is_empty(), "{name}: {all}");
    }
}

#[test]
fn the_pose_track_and_the_receiver_of_the_phone_agree() {
    let Some(data) = northing_recording::test_data::data_dir("the_pose_track_and_the_receiver")
    else {
        return;
    };
    let events = all(example("phone_comma2k19.toml", &data));
    let mut reference = None;
    let (mut pairs, mut worst_m, mut worst_course) = (0, 0.0_f64, 0.0_f64);
    let mut course = None;
    for event in &events {
        match event.sample {
            // Of one instant the attitude comes last.
            Sample::ReferenceVelocity(v) => course = Some(v.y.atan2(v.x)),
            Sample::ReferencePosition(place) => reference = Some((event.time_ns, place)),
            Sample::Reference(r) => {
                // The phone looks ahead, level within a few degrees.
                let (roll, pitch, yaw) = r.attitude.euler_angles();
                assert!(roll.abs() < 0.2 && pitch.abs() < 0.2, "{event:?}");
                let course: f64 = course.unwrap();
                worst_course = worst_course.max((yaw - course).sin().abs());
            }
            Sample::GnssPosition(fix) => {
                let Some((time_ns, place)) = reference else {
                    continue;
                };
                pairs += 1;
                let speed_m = 25.0 * (event.time_ns - time_ns) as f64 * 1e-9;
                let north = (fix.latitude_rad - place.latitude_rad) * 6.37e6;
                let east =
                    (fix.longitude_rad - place.longitude_rad) * 6.37e6 * fix.latitude_rad.cos();
                worst_m = worst_m.max(north.hypot(east) - speed_m);
                worst_course =
                    worst_course.max((fix.height_m.unwrap() - place.height_m.unwrap()).abs());
            }
            _ => {}
        }
    }
    assert!(
        pairs > 500 && worst_m < 15.0,
        "{pairs} {worst_m} {worst_course}"
    );
}

#[test]
fn logs_of_ublox_receivers_are_told_by_content_and_read() {
    let Some(data) = northing_recording::test_data::data_dir("logs_of_ublox_receivers") else {
        return;
    };
    // Solutions with a known time, and frames with a wrong checksum or cut off, counted by hand.
    for (name, solutions, broken) in [
        ("pygpsdata-MIXED", 39, 0),
        ("pygpsdata-MIXED3", 3, 0),
        ("pygpsdata-BADCK2", 1, 2),
        ("pygpsdata-BADEOF2", 1, 1),
        ("pygpsdata-NAV-ZED-X20P", 2, 0),
        ("pygpsdata-MIXED-RTCM3BADCRC", 1, 0),
        ("ucenter-ZEDF9P-configdebug", 2, 0),
    ] {
        let path = data.join(format!("nav/ubx/{name}.log"));
        let mut recording = open(&path, &OpenOptions::default()).unwrap();
        assert_eq!(recording.metadata().format, "ubx", "{name}");
        let fixes = recording
            .by_ref()
            .filter_map(Result::ok)
            .filter(|event| event.sample.kind() == SensorKind::GnssPosition)
            .count() as u64;
        let issues = recording.issues();
        let invalid: u64 = issues.invalid_fixes.values().sum();
        let repeated: u64 = issues.duplicate_stamps.values().sum();
        let of = |part: &str| -> u64 {
            let known = issues
                .rejected
                .iter()
                .filter(|(what, _)| what.contains(part));
            known.map(|(_, count)| count).sum()
        };
        let seen = fixes + invalid + of("NAV-PVT") + repeated / 2;
        assert_eq!(seen, solutions, "{name}: {issues:?}");
        assert_eq!(of("UBX frame"), broken, "{name}: {issues:?}");
    }
}

#[cfg(feature = "ulog")]
#[test]
fn logs_of_autopilots_are_read() {
    use SensorKind as Kind;
    let Some(data) = northing_recording::test_data::data_dir("logs_of_autopilots_are_read") else {
        return;
    };
    let (events, told_cube) = told("px4_cubeorange.toml", &data);
    let counts = [
        (Kind::Gyroscope, 1298),
        (Kind::Magnetometer, 319),
        (Kind::Pressure, 120),
        (Kind::DeviceOrientation, 1298),
        (Kind::GnssPosition, 32),
        (Kind::GnssVelocity, 32),
    ];
    for (kind, number) in counts {
        assert_eq!(count(&events, kind), number, "{kind:?} {told_cube:?}");
    }
    let (events, told_x21) = told("px4_auav_x21.toml", &data);
    assert_eq!(count(&events, Kind::Gyroscope), 17_070, "{told_x21:?}");
    assert_eq!(count(&events, Kind::DeviceOrientation), 6461);
    // Level on the ground or nearly: the specific force points up, which is -z.
    let Sample::SpecificForce(force) = first(&events, Kind::Accelerometer).sample else {
        panic!("{events:?}")
    };
    assert!(
        (force.norm() - 9.8).abs() < 1.0 && force.z < -8.0,
        "{force}"
    );
    let path = data.join("nav/px4_flight/sample.ulg");
    let alone = open(&path, &OpenOptions::default()).unwrap();
    assert_eq!(alone.metadata().format, "ulog");
    assert_eq!(alone.filter(Result::is_ok).count(), events.len());
}
