//! The seeds of the fuzz targets: small files of every format, made by our own writers.
//!
//! `NORTHING_BLESS=1 cargo test -p northing-recording --all-features --test integration fuzz_seeds::` makes them anew.
#![cfg(all(
    feature = "mcap",
    feature = "parquet",
    feature = "sqlite",
    feature = "ulog",
    feature = "ardupilot"
))]
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use crate::ros;

use std::collections::BTreeMap;
use std::fs;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use northing_recording::mcap::{LabWriter, RecordKind};
use northing_recording::wire::{WireFormat, events};
use northing_recording::{
    Event, Format, GnssPosition, GnssQuality, Metadata, OpenOptions, Sample, SensorKind, create,
    read_bytes,
};

/// All of them together, bytes.
const MOST: u64 = 100_000;

const SENSORS: [SensorKind; 4] = [
    SensorKind::Gyroscope,
    SensorKind::Accelerometer,
    SensorKind::Magnetometer,
    SensorKind::GnssPosition,
];

fn samples() -> Vec<Event> {
    (0..12)
        .flat_map(|k| {
            let time_ns = 1_763_697_600_000_000_000 + k * 10_000_000;
            let v = |x: f64| Vector3::new(x, 0.1 * k as f64, -0.2);
            let fix = GnssPosition {
                latitude_rad: 0.8,
                longitude_rad: 0.1 + 1e-6 * k as f64,
                height_m: Some(500.0),
                std_m: Some([1.0, 1.0, 2.0]),
                hdop: None,
                satellites: Some(9),
                quality: GnssQuality::Autonomous,
            };
            [
                Sample::AngularRate(v(0.1)),
                Sample::SpecificForce(v(9.7)),
                Sample::MagneticField(v(22.0)),
                Sample::GnssPosition(fix),
            ]
            .map(|sample| Event { time_ns, sample })
        })
        .collect()
}

fn written(name: &str) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    let metadata = Metadata {
        name: "seed".to_owned(),
        ..Metadata::default()
    };
    let mut writer = create(&path, &metadata, &SENSORS, false).unwrap();
    samples()
        .iter()
        .for_each(|event| writer.write(event).unwrap());
    writer.finish().unwrap();
    fs::read(path).unwrap()
}

fn sqlite_bag() -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("bag.db3");
    ros::database(&path, &ros::drive(0..4), <[u8]>::to_vec);
    fs::read(path).unwrap()
}

fn lab() -> Vec<u8> {
    let mut writer = LabWriter::new(Cursor::new(Vec::new()), &BTreeMap::new()).unwrap();
    let kind = RecordKind::Payload(WireFormat::Events);
    let own: Vec<Event> = samples()
        .into_iter()
        .filter(|e| e.sample.vector().is_some())
        .collect();
    writer
        .write(
            "phone",
            kind,
            1_763_697_600_000_000_000,
            &events::encode(&own),
        )
        .unwrap();
    writer.finish().unwrap().into_inner()
}

fn zip() -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, values) in [("Gyroscope", "0.1,0.2,0.3"), ("Orientation", "0,0,0,1")] {
        let header = if name == "Gyroscope" {
            "z,y,x"
        } else {
            "qz,qy,qx,qw"
        };
        archive
            .start_file(
                format!("walk/{name}.csv"),
                zip::write::SimpleFileOptions::default(),
            )
            .unwrap();
        writeln!(archive, "time,seconds_elapsed,{header}").unwrap();
        for k in 0..12_i64 {
            writeln!(
                archive,
                "{},0,{values}",
                1_763_697_600_000_000_000 + k * 10_000_000
            )
            .unwrap();
        }
    }
    archive.finish().unwrap().into_inner()
}

fn json() -> Vec<u8> {
    let entry = |k: i64| {
        let time = 1_763_697_600_000_000_000 + k * 10_000_000;
        format!(r#"{{"sensor":"Gyroscope","time":"{time}","x":"0.1","y":"0.2","z":"0.3"}}"#)
    };
    let entries: Vec<String> = (0..6).map(entry).collect();
    format!("[{}]", entries.join(",")).into_bytes()
}

const NMEA: &str = "$GPZDA,120000.00,01,06,2020,00,00\n\
    $GPGGA,120000.00,4807.038,N,01131.324,E,4,08,0.9,545.4,M,46.9,M,,\n$HEHDT,90.5,T\n\
    $GPRMC,120001.00,A,4807.038,N,01131.324,E,5.0,90.0,010620,,\n$VDVHW,,,,,4.1,N,,\n\
    $GPGGA,120002.00,4807.042,N,01131.328,E,2,07,1.1,545.6,M,46.9,M,,\n";

const PHYPHOX: &str = "\"Time (s)\";\"Gyroscope x (rad/s)\";\"Gyroscope y (rad/s)\";\"Gyroscope z (rad/s)\"\n\
    0,00E0;1,5E-3;2,0E-3;-1,0E-3\n1,00E-2;1,6E-3;2,1E-3;-1,1E-3\n2,00E-2;1,7E-3;2,2E-3;-1,2E-3\n";

fn ulog() -> Vec<u8> {
    let message = |kind: u8, content: &[u8]| {
        let length = (content.len() as u16).to_le_bytes();
        [&length[..], &[kind], content].concat()
    };
    let mut log = b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0".to_vec();
    log.extend(message(b'B', &[0; 40]));
    log.extend(message(
        b'F',
        b"sensor_combined:uint64_t timestamp;float[3] gyro_rad;",
    ));
    log.extend(message(b'A', b"\0\x07\0sensor_combined"));
    for k in 0..6_u64 {
        let time = (1000 * k).to_le_bytes();
        log.extend(message(b'D', &[&[7, 0][..], &time, &[0; 12]].concat()));
    }
    log
}

/// Formats and three samples of ArduPilot.
fn ardupilot() -> Vec<u8> {
    let format = |kind: u8, length: u8, texts: [(&str, usize); 3]| {
        let mut message = vec![0xa3, 0x95, 0x80, kind, length];
        for (text, width) in texts {
            message.extend(text.bytes().chain(std::iter::repeat(0)).take(width));
        }
        message
    };
    let formats = [
        ("FMT", 4),
        ("BBnNZ", 16),
        ("Type,Length,Name,Format,Columns", 64),
    ];
    let mut log = format(0x80, 89, formats);
    let labels = "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ";
    log.extend(format(1, 36, [("IMU", 4), ("QBffffff", 16), (labels, 64)]));
    for k in 1..4_u64 {
        log.extend([0xa3, 0x95, 1]);
        log.extend((1000 * k).to_le_bytes());
        log.extend([0; 25]);
    }
    log
}

/// Two arrays of NumPy in a zip.
fn arrays() -> Vec<u8> {
    let header = "{'descr': '<i2', 'fortran_order': False, 'shape': (4, 3), }\n";
    let length = (header.len() as u16).to_le_bytes();
    let array = [b"\x93NUMPY\x01\0", &length[..], header.as_bytes(), &[1; 24]].concat();
    let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
    for name in ["gyr.npy", "acc.npy"] {
        let options = zip::write::SimpleFileOptions::default();
        archive.start_file(name, options).unwrap();
        std::io::Write::write_all(&mut archive, &array).unwrap();
    }
    archive.finish().unwrap().into_inner()
}

/// What the target of arrays makes an array of: kind, order, rows, columns, numbers.
fn shaped_arrays() -> Vec<u8> {
    let array = |kind: u8, columns: u8| [&[kind, 0, 6, columns][..], &[1; 60]].concat();
    [array(3, 3), array(4, 1)].concat()
}

/// Stamps and two samples of a drive of KITTI.
fn kitti() -> Vec<u8> {
    let stamps = "2011-09-26 13:02:25.964389445\n2011-09-26 13:02:25.974389445\n";
    let sample = "49.0 8.4 112.8 0.01 0.02 1.6 -0.1 7.9 7.9 0.0 0.1 0.2 0.3 9.8 0.2 0.3 9.8 0.01 0.02 0.03 0.01 0.02 0.03 \
        0.05 0.03 4 11 5 5 6\n";
    [stamps, sample, sample].join("\0").into_bytes()
}

/// Table, experiment and samples of a session.
fn lab_session() -> Vec<u8> {
    let table =
        r#"{"format":"northing-session","experiments":[{"id":"1","name":"a","device":"b"}]}"#;
    let experiment = r#"{"student":"b","card":"scale","world_frame":"enu"}"#;
    let samples = events::encode(&samples());
    [table.as_bytes(), experiment.as_bytes(), &samples].join(&0)
}

/// A frame of a u-blox receiver with a solution: NAV-PVT, its checksum of 8 bits behind it.
fn ubx() -> Vec<u8> {
    let mut payload = [0_u8; 92];
    payload[4..12].copy_from_slice(&[0xe4, 7, 6, 1, 12, 30, 5, 7]);
    payload[20..24].copy_from_slice(&[3, 1, 0, 11]);
    payload[24..28].copy_from_slice(&(-80_000_000_i32).to_le_bytes());
    payload[28..32].copy_from_slice(&470_000_000_i32.to_le_bytes());
    let frame = [&[1, 7, 92, 0][..], &payload].concat();
    let (a, b) = frame.iter().fold((0_u8, 0_u8), |(a, b), byte| {
        let a = a.wrapping_add(*byte);
        (a, b.wrapping_add(a))
    });
    [&[0xb5, 0x62][..], &frame, &[a, b]].concat()
}

/// What the data logger of an x-IMU3 writes, in bytes and as text.
fn ximu3() -> Vec<u8> {
    let mut file =
        b"{\"ping\":{\"interface\":\"Data Logger\",\"name\":\"x-IMU3\",\"sn\":\"01\"}}\n".to_vec();
    file.extend(b"{\"ahrs_axes_convention\":1}\n");
    for (kind, numbers) in [(b'I', 6), (b'M', 3), (b'Q', 4)] {
        file.push(kind + 0x80);
        file.extend(1_000_000_u64.to_le_bytes());
        file.extend((0..numbers).flat_map(|_| 0.5_f32.to_le_bytes()));
        file.push(b'\n');
    }
    file.extend(b"I,1020000,0.1,0.2,0.3,0.0,0.0,1.0\nM,1020000,0.4,0.0,-0.9\n");
    file
}

/// Target, name, content, and the format where it is a file.
fn seeds() -> Vec<(&'static str, &'static str, Vec<u8>, Option<Format>)> {
    let lines = "$VNYMR,+10,+1,+2,+0.2,+0.0,+0.4,+0.1,+0.2,-9.8,+0.01,+0.02,+0.03*65\n";
    let table: String = (0..6)
        .map(|k| {
            format!(
                "{:.3} 1e-5 2e-5 3e-5 1e-3 2e-3 -4.9e-2\n",
                500.0 + 0.005 * f64::from(k)
            )
        })
        .collect();
    let manifest = "[[source]]\ntime = { column = \"t\", unit = \"s\" }\n\
        gyroscope = { columns = [\"x\", \"y\", \"z\"], unit = \"rad/s\" }\n\0t,x,y,z\n0,1,2,3\n1,1,2,3\n";
    let batch = r#"{"v":1,"device":"a","session":"s","seq":0,"platform":"android","gs":{"g":[[0,1,2,3],[10,1,2,3]],"a":[[3,0,0,9.8]]}}"#;
    vec![
        ("csv", "all.csv", written("all.csv"), Some(Format::Csv)),
        (
            "parquet",
            "all.parquet",
            written("all.parquet"),
            Some(Format::Parquet),
        ),
        ("mcap", "ros.mcap", written("ros.mcap"), Some(Format::Mcap)),
        ("mcap", "lab.mcap", lab(), Some(Format::Mcap)),
        (
            "ros_1",
            "imu.bag",
            ros::bag_of_ros_1(&ros::drive(0..4), "none"),
            Some(Format::Mcap),
        ),
        ("sqlite_bag", "imu.db3", sqlite_bag(), None),
        (
            "sensor_logger",
            "walk.zip",
            zip(),
            Some(Format::SensorLogger),
        ),
        (
            "sensor_logger",
            "walk.json",
            json(),
            Some(Format::SensorLogger),
        ),
        ("nmea", "fixes.log", NMEA.into(), Some(Format::Nmea)),
        ("tracking_sentences", "own_ship.log", NMEA.into(), None),
        (
            "tracking_sentences",
            "radar.log",
            [NMEA, "$RATTM,01,0.2,190.8,T,12.1,109.7,T,,,N,T1,T,,,A\n"]
                .concat()
                .into(),
            None,
        ),
        ("ubx", "solution.ubx", ubx(), Some(Format::Ubx)),
        ("ulog", "rates.ulg", ulog(), Some(Format::Ulog)),
        (
            "ardupilot",
            "rates.bin",
            ardupilot(),
            Some(Format::ArduPilot),
        ),
        ("describe", "arrays.npz", arrays(), None),
        ("numpy", "arrays.bin", shaped_arrays(), None),
        ("kitti", "drive.bin", kitti(), None),
        ("lab_session", "session.bin", lab_session(), None),
        ("vectornav", "lines.log", lines.into(), None),
        ("ximu3", "log.ximu3", ximu3(), Some(Format::XImu3)),
        (
            "ros_messages",
            "imu.bin",
            [&[0][..], &ros::imu(ros::at(0), "imu", 1.0)].concat(),
            None,
        ),
        (
            "kf_gins",
            "increments.txt",
            table.into(),
            Some(Format::KfGins),
        ),
        (
            "phyphox",
            "gyroscope.csv",
            PHYPHOX.into(),
            Some(Format::Phyphox),
        ),
        ("manifest", "table.txt", manifest.into(), None),
        ("wire_phone_page", "batch.json", batch.into(), None),
    ]
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fuzz/seeds")
}

#[test]
fn every_seed_is_there_and_its_reader_takes_it() {
    let bless = std::env::var_os("NORTHING_BLESS").is_some();
    let mut total = 0;
    for (target, name, made, format) in seeds() {
        let path = folder().join(target).join(name);
        if bless {
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, &made).unwrap();
        }
        // What is there may have been made by an older writer: it has to be read all the same.
        let there = fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        total += there.len() as u64;
        if let Some(format) = format {
            let options = OpenOptions {
                format: Some(format),
                ..OpenOptions::default()
            };
            let mut recording = read_bytes(there, name, &options).unwrap();
            let events = recording.by_ref().map(Result::unwrap).count();
            assert!(events > 0, "{name}");
        }
    }
    assert!(total < MOST, "{total} bytes");
}
