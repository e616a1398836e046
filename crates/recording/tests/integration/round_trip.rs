//! What the writers write, the readers read back, to the bit.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

#[cfg(feature = "parquet")]
use crate::support;

use std::path::Path;

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::navigation::Validity;
use northing_recording::{
    CompassHeading, DeviceNavigation, Event, GnssPosition, GnssQuality, GnssVelocity, Metadata,
    OpenOptions, Reference, Sample, SensorKind, TrueHeading, WaterVelocity, WorldFrame, create,
    open,
};
#[cfg(feature = "parquet")]
use support::error_of;

/// 3000 instants of a slow turn with every sensor at its own rate, starting at an epoch stamp.
fn all_sensors() -> Vec<Event> {
    let mut events = Vec::new();
    for i in 0..3000_i64 {
        let t = i as f64 * 0.005;
        let time_ns = 1_763_697_600_123_456_789 + i * 5_000_001;
        let v = |scale: f64| Vector3::new(0.1, t.sin(), t.cos() / 3.0) * scale;
        let attitude = UnitQuaternion::from_euler_angles(0.1 * t, 0.2, -0.3);
        let mut put = |sample| events.push(Event { time_ns, sample });
        put(Sample::AngularRate(v(0.3)));
        if i % 2 == 0 {
            put(Sample::SpecificForce(v(1.0) + Vector3::z() * 9.81));
        }
        if i % 4 == 0 {
            put(Sample::MagneticField(v(30.0)));
            put(Sample::MagneticFieldUncalibrated(v(300.0)));
        }
        if i % 5 == 0 {
            put(Sample::DeviceGyroscopeBias(v(0.001)));
            put(Sample::DeviceOrientation(attitude));
        }
        if i % 10 == 0 {
            put(Sample::Position(v(10.0)));
            put(Sample::Velocity(v(5.0)));
            put(Sample::Pressure(101_325.0 + t));
            put(Sample::CompassHeading(CompassHeading {
                heading_rad: 0.01 * t,
                std_rad: 0.2,
            }));
            navigation(i).into_iter().for_each(&mut put);
        }
        let scored = i % 3 == 0;
        put(Sample::Reference(Reference { attitude, scored }));
    }
    events
}

/// Navigation sensors, with and without the numbers that may be absent.
fn navigation(i: i64) -> [Sample; 8] {
    let t = i as f64 * 0.005;
    let whole = i % 20 == 0;
    let fix = GnssPosition {
        latitude_rad: 0.7 + t * 1e-7,
        longitude_rad: -1.8 - t * 1e-7,
        height_m: whole.then_some(1601.474),
        std_m: whole.then_some([0.01, 0.02, 0.03]),
        hdop: whole.then_some(0.9),
        satellites: whole.then_some(21),
        quality: if whole {
            GnssQuality::RtkFloat
        } else {
            GnssQuality::Unknown
        },
    };
    [
        Sample::GnssPosition(fix),
        Sample::GnssVelocity(GnssVelocity {
            north_m_s: t.cos(),
            east_m_s: t.sin(),
            down_m_s: whole.then_some(0.1),
            std_m_s: whole.then_some([0.1; 3]),
        }),
        Sample::ForwardSpeed(-0.5),
        Sample::WaterVelocity(WaterVelocity {
            forward_m_s: 4.0,
            starboard_m_s: whole.then_some(0.3),
        }),
        Sample::TrueHeading(TrueHeading {
            heading_rad: 6.0 - t / 100.0,
            std_rad: whole.then_some(0.01),
        }),
        Sample::DeviceNavigation(DeviceNavigation {
            latitude_rad: 0.7 + t * 1e-7,
            longitude_rad: -1.8,
            height_m: 1600.0 - t,
            std_m: [1.0, 2.0, 3.0 + t],
            velocity_m_s: [t.sin(), 0.2, -0.1],
            heading_std_rad: 0.05,
            validity: if whole {
                Validity::Aided
            } else {
                Validity::DeadReckoning
            },
        }),
        Sample::ReferencePosition(GnssPosition {
            height_m: Some(1600.0 + t),
            ..fix
        }),
        Sample::ReferenceVelocity(Vector3::new(t, 1.0, 2.0)),
    ]
}

fn metadata() -> Metadata {
    Metadata {
        name: "every sensor".to_owned(),
        format: String::new(),
        world_frame: WorldFrame::Ned,
        body_axes: Some(northing_recording::BodyAxes::Flu),
        device: Some("test bench".to_owned()),
        gnss_lever_arm_m: Some([0.5, -0.05, -1.25]),
        gnss_position_latency_s: 0.045,
        gnss_velocity_latency_s: 0.12,
        extra: [("weather".to_owned(), "dry: mostly".to_owned())].into(),
    }
}

fn write(path: &Path, events: &[Event], sensors: &[SensorKind]) {
    let mut writer = create(path, &metadata(), sensors, false).unwrap();
    for event in events {
        writer.write(event).unwrap();
    }
    writer.finish().unwrap();
}

/// Largest difference of two samples' numbers.
fn difference(a: &Sample, b: &Sample) -> f64 {
    match (a, b) {
        (Sample::Reference(a), Sample::Reference(b)) if a.scored == b.scored => {
            a.attitude.angle_to(&b.attitude)
        }
        (Sample::DeviceOrientation(a), Sample::DeviceOrientation(b)) => a.angle_to(b),
        (a, b) if a == b => 0.0,
        _ => f64::INFINITY,
    }
}

fn reads_back(file: &str) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(file);
    let written = all_sensors();
    write(&path, &written, &SensorKind::ALL);
    let mut recording = open(&path, &OpenOptions::default()).unwrap();
    let format = recording.metadata().format.clone();
    assert_eq!(
        *recording.metadata(),
        Metadata {
            format,
            ..metadata()
        }
    );
    assert_eq!(recording.sensors(), SensorKind::ALL);
    let read: Vec<Event> = recording.by_ref().map(Result::unwrap).collect();
    assert!(recording.issues().is_empty(), "{:?}", recording.issues());
    assert_eq!(read.len(), written.len());
    for (read, written) in read.iter().zip(&written) {
        assert_eq!(read.time_ns, written.time_ns);
        let difference = difference(&read.sample, &written.sample);
        assert!(difference < 1e-14, "{read:?} for {written:?}");
    }
}

#[test]
fn csv_reads_back() {
    reads_back("all.csv");
}

#[cfg(feature = "parquet")]
#[test]
fn parquet_reads_back() {
    reads_back("all.parquet");
}

const GPS_LOG: &str = "$GPZDA,120000.00,01,06,2020,00,00\n\
    $GPGGA,120000.00,4807.038,N,01131.324,E,4,08,0.9,545.4,M,46.9,M,,\n$HEHDT,90.5,T\n\
    $GPGGA,120001.00,4807.040,N,01131.326,E,1,07,1.1,545.6,M,46.9,M,,\n$HEHDT,90.7,T\n\
    $GPGGA,120002.00,4807.042,N,01131.328,E,2,07,1.1,545.6,M,46.9,M,,\n$HEHDT,90.9,T\n";

/// What a format keeps of an event: MCAP has topics for some sensors, and of a fix no number of satellites.
fn kept(event: &Event, format: &str) -> Option<(i64, SensorKind, Vec<f64>)> {
    use northing_recording::event::SensorKind::{
        Accelerometer, DeviceOrientation, GnssPosition, GnssVelocity, Gyroscope, Magnetometer,
        Reference,
    };
    let kind = event.sample.kind();
    let of_ros = [
        Gyroscope,
        Accelerometer,
        Magnetometer,
        DeviceOrientation,
        Reference,
        GnssPosition,
        GnssVelocity,
    ];
    let is_kept = format != "mcap"
        || (of_ros.contains(&kind)
            && !matches!(event.sample, Sample::Reference(reference) if !reference.scored));
    let numbers = match event.sample {
        Sample::GnssPosition(fix) => vec![
            fix.latitude_rad,
            fix.longitude_rad,
            fix.height_m.unwrap_or(-1.0),
            fix.std_m.map_or(-1.0, |std| std[1]),
        ],
        Sample::GnssVelocity(v) => vec![
            v.north_m_s,
            v.east_m_s,
            v.down_m_s.unwrap_or(-1.0),
            v.std_m_s.map_or(-1.0, |std| std[0]),
            v.std_m_s.map_or(-1.0, |std| std[2]),
        ],
        Sample::TrueHeading(heading) => vec![heading.heading_rad],
        sample => sample
            .vector()
            .map_or(vec![], |v| v.iter().copied().collect()),
    };
    is_kept.then_some((event.time_ns, kind, numbers))
}

/// Every writer through its reader: all sensors, an inertial unit alone, a receiver alone, and the log of a receiver.
#[cfg(all(feature = "parquet", feature = "mcap"))]
#[test]
fn what_was_written_is_read_again_whatever_sensors_there_are() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("gps.log");
    std::fs::write(&log, GPS_LOG).unwrap();
    let mut log = open(&log, &OpenOptions::default()).unwrap();
    let promised = log.sensors().to_vec();
    let from_log: Vec<Event> = log.by_ref().map(Result::unwrap).collect();
    assert_eq!(from_log.len(), 6, "{from_log:?}");
    let only = |wanted: &[SensorKind]| {
        let all = all_sensors().into_iter();
        let of = all.filter(|event| wanted.contains(&event.sample.kind()));
        (wanted.to_vec(), of.collect::<Vec<_>>())
    };
    let inertial = [SensorKind::Gyroscope, SensorKind::Accelerometer];
    let receiver = [SensorKind::GnssPosition, SensorKind::GnssVelocity];
    for (sensors, events) in [
        only(&SensorKind::ALL),
        only(&inertial),
        only(&inertial[..1]),
        only(&receiver),
        only(&receiver[..1]),
        (promised, from_log),
    ] {
        for format in ["csv", "parquet", "mcap"] {
            let path = folder.path().join(format!("again.{format}"));
            let mut writer = create(&path, &metadata(), &sensors, true).unwrap();
            events.iter().for_each(|event| writer.write(event).unwrap());
            writer.finish().unwrap();
            let mut recording = open(&path, &OpenOptions::default()).unwrap();
            let read = recording.by_ref().map(Result::unwrap);
            let read: Vec<_> = read.filter_map(|event| kept(&event, format)).collect();
            let expected: Vec<_> = events.iter().filter_map(|e| kept(e, format)).collect();
            assert_eq!(read.len(), expected.len(), "{format} {sensors:?}");
            for (read, expected) in read.iter().zip(&expected) {
                assert_eq!((read.0, read.1), (expected.0, expected.1), "{format}");
                let pairs = read.2.iter().zip(&expected.2);
                let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                assert!(worst < 1e-12, "{format}: {read:?} for {expected:?}");
            }
            let mut issues = recording.issues().clone();
            // Of a bag it is said which topics were read.
            issues
                .notes
                .retain(|note| !note.starts_with("Topics that are read: "));
            assert!(issues.is_empty(), "{issues:?}");
        }
    }
}

/// More rows than a row group, so that groups and batches are crossed.
#[cfg(feature = "parquet")]
#[test]
fn parquet_reads_back_across_row_groups() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("long.parquet");
    let written: Vec<Event> = (0..70_001)
        .map(|i| Event {
            time_ns: i * 10_000_000,
            sample: Sample::AngularRate(Vector3::new(i as f64, 0.5, 0.0) * 1e-5),
        })
        .collect();
    write(&path, &written, &[SensorKind::Gyroscope]);
    let read: Vec<Event> = open(&path, &OpenOptions::default())
        .unwrap()
        .map(Result::unwrap)
        .collect();
    assert!(read == written);
}

#[cfg(feature = "parquet")]
#[test]
fn non_finite_samples_survive_parquet_unless_all_is_nan() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("odd.parquet");
    let rate = |time_ns, x, y, z| Event {
        time_ns,
        sample: Sample::AngularRate(Vector3::new(x, y, z)),
    };
    let nan = f64::NAN;
    let events = [
        rate(0, 0.0, 0.0, 0.0),
        rate(10, nan, 0.0, 0.0),
        rate(20, nan, nan, nan),
        rate(30, f64::INFINITY, 0.0, 0.0),
    ];
    write(&path, &events, &[SensorKind::Gyroscope]);
    let mut recording = open(&path, &OpenOptions::default()).unwrap();
    let stamps: Vec<i64> = recording
        .by_ref()
        .map(|event| event.unwrap().time_ns)
        .collect();
    assert_eq!(stamps, [0, 10, 30]);
    assert_eq!(
        recording.issues().non_finite_samples[&SensorKind::Gyroscope],
        2
    );
}

#[test]
fn a_sensor_without_a_column_is_an_error_and_nothing_is_left() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["a.csv", "a.parquet"] {
        if cfg!(not(feature = "parquet")) && name == "a.parquet" {
            continue;
        }
        let mut writer = create(
            &folder.path().join(name),
            &metadata(),
            &[SensorKind::Gyroscope],
            false,
        )
        .unwrap();
        let pressure = Event {
            time_ns: 0,
            sample: Sample::Pressure(1.0),
        };
        let error = writer.write(&pressure).unwrap_err().to_string();
        assert!(error.contains("no column for pressure"), "{error}");
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    let error = create(&folder.path().join("a.mat"), &metadata(), &[], false)
        .err()
        .unwrap();
    assert!(
        error
            .to_string()
            .contains("written as .csv, .parquet or .mcap"),
        "{error}"
    );
}

#[cfg(feature = "parquet")]
#[test]
fn a_parquet_file_that_is_cut_off_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cut.parquet");
    write(&path, &all_sensors(), &SensorKind::ALL);
    let whole = std::fs::read(&path).unwrap();
    for keep in [4, 100, whole.len() / 2, whole.len() - 1] {
        std::fs::write(&path, &whole[..keep]).unwrap();
        let error = error_of(open(&path, &OpenOptions::default()));
        assert!(
            error.contains("cut.parquet: damaged or cut off: "),
            "{keep}: {error}"
        );
    }
}

#[cfg(feature = "parquet")]
mod garbage {
    use super::{SensorKind, all_sensors, write};
    use northing_recording::{Format, OpenOptions, read_bytes};
    use proptest::prelude::*;
    use std::sync::LazyLock;

    static WHOLE: LazyLock<Vec<u8>> = LazyLock::new(|| {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("whole.parquet");
        write(&path, &all_sensors()[..200], &SensorKind::ALL);
        std::fs::read(&path).unwrap()
    });

    fn read(bytes: Vec<u8>) {
        let options = OpenOptions {
            format: Some(Format::Parquet),
            ..OpenOptions::default()
        };
        if let Ok(recording) = read_bytes(bytes, "fuzz", &options) {
            recording.for_each(drop);
        }
    }

    proptest! {
        #![proptest_config(crate::support::arbitrary_cases(256, 0x9a))]

        #[test]
        fn arbitrary_bytes_never_panic(mut bytes in proptest::collection::vec(any::<u8>(), 0..300)) {
            bytes.splice(..0, *b"PAR1");
            bytes.extend(b"PAR1");
            read(bytes);
        }

        #[test]
        fn changed_bytes_never_panic(changes in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8)) {
            let mut bytes = WHOLE.clone();
            for (place, value) in changes {
                let place = place.index(bytes.len());
                bytes[place] = value;
            }
            read(bytes);
        }
    }
}
