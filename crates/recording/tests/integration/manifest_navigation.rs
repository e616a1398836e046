//! Manifests of several files, satellite receivers, and references to score against.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use crate::support;

use std::fs;

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
            "std = [",
            "accuracy = [",
            "expected [horizontal, vertical], or [horizontal] alone",
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

const ROOM: &str = r#"
[[source]]
file = "imu.csv"
time = { column = "t", unit = "s" }
gyroscope = { columns = ["wx", "wy", "wz"] }

[[source]]
file = "mocap.csv"
time = { column = "t", unit = "s" }
[source.local_position]
columns = ["x", "y", "z"]
origin = { latitude_deg = 47.0, longitude_deg = 8.0, height_m = 400.0 }
std_m = [0.01, 0.02, 0.03]
"#;

#[test]
fn positions_in_metres_from_a_place_are_fixes() {
    use nalgebra::Vector3;
    use northing_core::earth::{Geodetic, LocalFrame};
    let files = [
        ("imu.csv", "t,wx,wy,wz\n0,0,0,0\n"),
        ("mocap.csv", "t,x,y,z,sx,sy,sz\n0,3,-40,5,1,2,3\n1,,,,,,\n"),
    ];
    let frame = LocalFrame::new(Geodetic::from_degrees(47.0, 8.0, 400.0).unwrap());
    let fix_of = |manifest: &str| {
        let events = all(opened(manifest, &files).unwrap());
        assert_eq!(events.len(), 2, "an empty row is no fix");
        let fix = events.into_iter().find_map(|event| match event.sample {
            Sample::GnssPosition(fix) => Some(fix),
            _ => None,
        });
        fix.unwrap()
    };
    let enu = Vector3::new(-40.0, 3.0, -5.0);
    for (axes, ned, std) in [
        ("enu", enu, [0.02, 0.01, 0.03]),
        ("ned", Vector3::new(3.0, -40.0, 5.0), [0.01, 0.02, 0.03]),
        ("neu", Vector3::new(3.0, -40.0, -5.0), [0.01, 0.02, 0.03]),
    ] {
        let fix = fix_of(&format!("{ROOM}axes = \"{axes}\"\n"));
        let place = Geodetic {
            latitude_rad: fix.latitude_rad,
            longitude_rad: fix.longitude_rad,
            height_m: fix.height_m.unwrap(),
        };
        assert!((frame.ned(&place) - ned).norm() < 1e-6, "{axes}");
        assert_eq!(fix.std_m, Some(std), "{axes}");
    }
    let columns = ROOM.replace(
        "std_m = [0.01, 0.02, 0.03]",
        "std = [\"sx\", \"sy\", \"sz\"]",
    );
    assert_eq!(fix_of(&columns).std_m, Some([2.0, 1.0, 3.0]));
    let reference = all(opened(
        &format!(
            "{}role = \"reference\"\n{}",
            &ROOM[..ROOM.find("[source.local").unwrap()],
            &ROOM[ROOM.find("[source.local").unwrap()..]
        ),
        &files,
    )
    .unwrap());
    assert!(
        reference
            .iter()
            .any(|event| matches!(event.sample, Sample::ReferencePosition(_)))
    );
    for (from, to, expected) in [
        (
            "47.0",
            "97.0",
            "[local_position] origin: expected latitude_deg from -90 to 90",
        ),
        (
            "[0.01,",
            "[0.0,",
            "[local_position] std_m: expected metres above 0",
        ),
        (
            "std_m",
            "std = [\"sx\", \"sy\", \"sz\"]\nstd_m",
            "has both `std` and `std_m`",
        ),
        (
            "[source.local_position]",
            "gnss_position = { latitude = \"sx\", longitude = \"sy\" }\n[source.local_position]",
            "has both [gnss_position] and [local_position]",
        ),
    ] {
        let error = error_of(opened(&ROOM.replacen(from, to, 1), &files));
        assert!(error.contains(expected), "{to}: {error}");
    }
}

/// Tables of one row for everything are filled with zeros where the receiver has nothing new.
#[test]
fn a_fix_of_exactly_0_0_is_none_and_so_is_the_velocity_of_zeros_beside_it() {
    let manifest = "file = 'log.csv'\ntime = { column = 't', unit = 's' }\n\
                    gyroscope = { columns = ['x', 'y', 'z'] }\n\
                    gnss_position = { latitude = 'lat', longitude = 'lon', height = 'h' }\n\
                    gnss_velocity = { columns = ['vn', 've', 'vd'] }\n";
    let log = "t,x,y,z,lat,lon,h,vn,ve,vd\n0,1,2,3,47.5,8.5,300,1,0,0\n1,1,2,3,0,0,0,0,0,0\n\
               2,1,2,3,0.0,-0.0,0,1,0,0\n3,1,2,3,0,8.5,0,0,0,0\n";
    let mut recording = opened(manifest, &[("log.csv", log)]).unwrap();
    let of = |kind: SensorKind, events: &[Event]| -> Vec<i64> {
        let of_kind = events.iter().filter(|event| event.sample.kind() == kind);
        of_kind.map(|event| event.time_ns / 1_000_000_000).collect()
    };
    let events: Vec<Event> = recording.by_ref().map(Result::unwrap).collect();
    assert_eq!(of(SensorKind::Gyroscope, &events), [0, 1, 2, 3]);
    assert_eq!(of(SensorKind::GnssPosition, &events), [0, 3]);
    // A velocity that says something stays, and one of zeros beside a fix does.
    assert_eq!(of(SensorKind::GnssVelocity, &events), [0, 2, 3]);
    let told = recording.issues().sentences();
    let zeros = "Left out: 2 position(s) whose latitude and longitude are both exactly 0";
    assert!(told.iter().any(|s| s.starts_with(zeros)), "{told:?}");
}

#[test]
fn degrees_with_minutes_and_accuracies_and_velocities_in_millimetres_are_taken_apart() {
    let manifest = "file = 'log.csv'\ntime = { column = 't', unit = 's' }\n\
                    gnss_velocity = { columns = ['vn', 've', 'vd'], speed_unit = 'mm-per-s', std = ['s', 's2', 's3'] }\n\
                    [gnss_position]\nlatitude = 'lat'\nlongitude = 'lon'\nunit = 'deg-min'\naccuracy = ['h', 'v']\n\
                    accuracy_unit = 'mm'\n";
    let log = "t,lat,lon,h,v,vn,ve,vd,s,s2,s3\n0,4841.9998,-906.003,1500,2000,-108,23,-25,100,100,200\n\
               1,4800.0,-0.6,1500,2000,0,0,0,100,100,200\n";
    let events = all(opened(manifest, &[("log.csv", log)]).unwrap());
    let mut fixes = events.iter().filter_map(|event| match event.sample {
        Sample::GnssPosition(fix) => Some(fix),
        _ => None,
    });
    for (latitude, longitude) in [(48.0 + 41.9998 / 60.0, -9.0 - 6.003 / 60.0), (48.0, -0.01)] {
        let fix = fixes.next().unwrap();
        approx::assert_relative_eq!(fix.latitude_rad, latitude * DEGREE, epsilon = 1e-14);
        approx::assert_relative_eq!(fix.longitude_rad, longitude * DEGREE, epsilon = 1e-14);
        let std = fix.std_m.unwrap();
        approx::assert_relative_eq!(std[0], 1.5 / 2_f64.sqrt(), epsilon = 1e-12);
        approx::assert_relative_eq!(std[2], 2.0, epsilon = 1e-12);
    }
    let Some(Sample::GnssVelocity(velocity)) = events.iter().map(|event| event.sample).nth(1)
    else {
        panic!("{events:?}")
    };
    approx::assert_relative_eq!(velocity.north_m_s, -0.108);
    approx::assert_relative_eq!(velocity.down_m_s.unwrap(), -0.025);
    assert_eq!(velocity.std_m_s, Some([0.1, 0.1, 0.2]));
}
