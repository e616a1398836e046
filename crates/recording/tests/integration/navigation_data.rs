//! The manifests in `examples/recordings` and the logs of receivers, on the data of `NORTHING_DATA`.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use std::path::Path;

use northing_recording::{Event, GnssQuality, OpenOptions, Recording, Sample, SensorKind, open};

fn all(recording: Recording) -> Vec<Event> {
    recording.map(Result::unwrap).collect()
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

fn vector(event: &Event) -> nalgebra::Vector3<f64> {
    match event.sample {
        Sample::AngularRate(v) | Sample::SpecificForce(v) | Sample::MagneticField(v) => v,
        other => panic!("{other:?}"),
    }
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
    // The folder holds them among other tables, which are left alone; it knows no time offset.
    let folder = open(&data.join("nav/car_rtk"), &OpenOptions::default()).unwrap();
    assert_eq!(folder.metadata().format, "kf-gins");
    let folder = all(folder);
    assert_eq!(folder.len(), increments.len());
    let fix = first(&increments, SensorKind::GnssPosition);
    assert_eq!(first(&folder, SensorKind::GnssPosition), fix);
    let rate = first(&increments, Gyroscope);
    assert_eq!(first(&folder, Gyroscope).sample, rate.sample);
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

#[test]
fn a_table_that_quotes_the_sensor_s_own_lines_is_read_as_those() {
    let Some(data) =
        northing_recording::test_data::data_dir("a_table_that_quotes_the_sensor_s_own_lines")
    else {
        return;
    };
    let columns = all(example("vn100_circles_1hz.toml", &data));
    let path = data.join("nav/vn100_circles_1hz/circle_data_0_imu.csv");
    let mut recording = open(&path, &OpenOptions::default()).unwrap();
    let lines: Vec<Event> = recording.by_ref().map(Result::unwrap).collect();
    assert_eq!(recording.metadata().format, "vectornav");
    assert!(recording.issues().rejected.is_empty());
    for kind in [
        SensorKind::Gyroscope,
        SensorKind::Accelerometer,
        SensorKind::Magnetometer,
    ] {
        let of = |events: &[Event]| -> Vec<Event> {
            let found = events.iter().filter(|e| e.sample.kind() == kind);
            found.copied().collect()
        };
        let (columns, lines) = (of(&columns), of(&lines));
        assert_eq!((columns.len(), lines.len()), (2530, 2530));
        for (a, b) in columns.iter().zip(&lines) {
            assert_eq!(a.time_ns, b.time_ns);
            // The example turns the unit, which looks backwards in its car.
            let (a, mut b) = (vector(a), vector(b));
            (b.x, b.y) = (-b.x, -b.y);
            assert!((a - b).norm() < 1e-9, "{a} {b}");
        }
    }
}
