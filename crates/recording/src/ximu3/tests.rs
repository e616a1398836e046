//! Tests of the x-IMU3's files.

use super::*;
use crate::event::Event;
use crate::{OpenOptions, Recording, read_bytes};

/// A message in bytes, as the manual has it.
fn bytes(kind: u8, time_us: u64, numbers: &[f32]) -> Vec<u8> {
    let mut plain = vec![kind + BINARY];
    plain.extend(time_us.to_le_bytes());
    plain.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    let mut line = Vec::new();
    for byte in plain {
        match byte {
            LF => line.extend([ESCAPE, ESCAPED_LF]),
            ESCAPE => line.extend([ESCAPE, ESCAPED_ESCAPE]),
            byte => line.push(byte),
        }
    }
    line.push(LF);
    line
}

const PREAMBLE: &[u8] =
    b"{\"ping\":{\"interface\":\"Data Logger\",\"name\":\"x-IMU3\",\"sn\":\"0123-4567\"}}\n\
    {\"time\":\"2025-01-20 15:30:00\"}\n{\"serial_number\":\"0123-4567\"}\n";

fn open(bytes: Vec<u8>) -> Recording {
    read_bytes(bytes, "log.ximu3", &OpenOptions::default()).unwrap()
}

#[test]
fn the_examples_of_the_manual_are_read() {
    let text = b"I,1000000,0.0000,0.0000,0.0000,0.0000,0.0000,1.0000\r\n";
    let inertial = message(text).unwrap().unwrap();
    assert_eq!(inertial.time_us, 1_000_000);
    assert_eq!(inertial.numbers, [0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    let mut binary = vec![0xc9, 0x40, 0x42, 0x0f, 0, 0, 0, 0, 0];
    binary.extend([0; 20]);
    binary.extend([0, 0, 0x80, 0x3f, LF]);
    assert_eq!(message(&binary).unwrap().unwrap(), inertial);
    assert_eq!(
        bytes(b'I', 1_000_000, &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
        binary
    );
    // A stamp with LF and the escape in it.
    let stamped = bytes(b'M', 0xdb0a, &[1.0, 0.0, 0.0]);
    assert_eq!(message(&stamped).unwrap().unwrap().time_us, 0xdb0a);
}

#[test]
fn a_file_of_the_data_logger_is_rate_force_field_and_orientation_in_order() {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    for is_binary in [false, true] {
        let mut file = PREAMBLE.to_vec();
        for k in 0..50_u64 {
            let time_us = 19_000_000 + 20_000 * k;
            let text =
                |kind: &str, numbers: &str| format!("{kind},{time_us},{numbers}\n").into_bytes();
            if is_binary {
                file.extend(bytes(b'I', time_us, &[90.0, 0.0, 0.0, 0.0, 0.0, 1.0]));
                // The field was measured before, and comes behind.
                file.extend(bytes(b'M', time_us - 5000, &[0.4, 0.0, -0.9]));
                file.extend(bytes(b'Q', time_us, &[half, 0.0, 0.0, half]));
                file.extend(bytes(b'T', time_us, &[25.0]));
            } else {
                file.extend(text("I", "90,0,0,0,0,1"));
                file.extend(format!("M,{},0.4,0,-0.9\n", time_us - 5000).bytes());
                file.extend(text("Q", &format!("{half},0,0,{half}")));
                file.extend(text("T", "25"));
            }
        }
        let mut recording = open(file);
        assert_eq!(recording.metadata().format, "x-imu3");
        assert_eq!(
            recording.metadata().device.as_deref(),
            Some("x-IMU3 0123-4567")
        );
        let events: Vec<Event> = recording.by_ref().map(Result::unwrap).collect();
        assert_eq!(events.len(), 200);
        assert!(events.is_sorted_by_key(|event| event.time_ns));
        assert!(recording.issues().stamps_going_back.is_empty());
        let (mut seen, ns) = (0, 19_000_000_000);
        for event in events
            .iter()
            .filter(|event| event.time_ns == ns || event.time_ns == ns - 5_000_000)
        {
            seen += 1;
            match event.sample {
                Sample::AngularRate(v) => {
                    approx::assert_relative_eq!(v.x, std::f64::consts::FRAC_PI_2, epsilon = 1e-12);
                }
                Sample::SpecificForce(v) => {
                    approx::assert_relative_eq!(v.z, 9.80665);
                }
                Sample::MagneticField(v) => approx::assert_relative_eq!(v.z, -45.0, epsilon = 1e-5),
                // Turned left by 90 degrees from north: it looks west.
                Sample::DeviceOrientation(q) => {
                    approx::assert_relative_eq!(q * Vector3::x(), -Vector3::x(), epsilon = 1e-6);
                }
                other => panic!("{other:?}"),
            }
        }
        assert_eq!(seen, 4);
        assert!(
            recording
                .issues()
                .sentences()
                .join(" ")
                .contains("1 is taken as 50 uT")
        );
    }
}

#[test]
fn the_convention_of_the_device_is_that_of_its_orientation() {
    let of = |convention: &str| {
        let mut file = PREAMBLE.to_vec();
        file.extend(format!("{{\"ahrs_axes_convention\":{convention}}}\n").bytes());
        file.extend(bytes(b'I', 1, &[0.0; 6]));
        file.extend(bytes(b'Q', 1, &[1.0, 0.0, 0.0, 0.0]));
        let events = open(file).map_while(Result::ok);
        let looks = events.filter_map(|event| match event.sample {
            Sample::DeviceOrientation(q) => Some(q * Vector3::x()),
            _ => None,
        });
        looks.collect::<Vec<_>>()
    };
    approx::assert_relative_eq!(of("0")[0], Vector3::y(), epsilon = 1e-12);
    approx::assert_relative_eq!(of("1")[0], Vector3::x(), epsilon = 1e-12);
    approx::assert_relative_eq!(of("2")[0], Vector3::y(), epsilon = 1e-12);
    assert!(of("7").is_empty(), "nobody knows what it is");
}

#[test]
fn damage_is_counted_and_what_is_no_such_file_is_none() {
    let good = bytes(b'I', 1, &[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    let mut short = good.clone();
    short.remove(20);
    let mut escaped = good.clone();
    escaped[3] = ESCAPE;
    let nan = bytes(b'I', 1, &[f32::NAN, 0.0, 0.0, 0.0, 0.0, 1.0]);
    let texts = [
        &short[..],
        &escaped,
        &nan,
        &good[..good.len() - 1],
        b"I,1,2\n",
        b"I,x,1,2,3,4,5,6\n",
        b"I,-1,1,2,3,4,5,6\n",
        b"I,1,1,2,3,4,5,6,7\n",
    ];
    for text in texts {
        assert_eq!(message(text), Some(Err(())), "{text:?}");
        assert!(!recognises(text), "{text:?}");
    }
    for other in [
        &b"time,x\n"[..],
        b"N,1,a note\n",
        b"\n",
        b"\x00",
        b"IMU log\n1,2\n",
    ] {
        assert_eq!(message(other), None, "{other:?}");
        assert!(!recognises(other), "{other:?}");
    }
    assert!(recognises(&good.repeat(4)) && recognises(PREAMBLE));
    let file = [
        PREAMBLE,
        &good,
        &short,
        &bytes(b'I', 9, &[0.0; 6]),
        &bytes(b'A', 9, &[0.0; 3]),
    ]
    .concat();
    let mut recording = open(file);
    assert_eq!(recording.by_ref().map(Result::unwrap).count(), 4);
    let told = recording.issues().sentences().join(" ");
    assert!(
        told.contains("1 message(s) of an x-IMU3 that are damaged")
            && told.contains("as matrices or angles"),
        "{told}"
    );
}

#[test]
fn any_bytes_are_read_or_refused() {
    let whole = [
        PREAMBLE,
        &bytes(b'I', 1, &[0.5; 6]),
        &bytes(b'Q', 2, &[0.5; 4]),
    ]
    .concat();
    for at in 0..whole.len() {
        let mut flipped = whole.clone();
        flipped[at] ^= 0xff;
        for bytes in [whole[..at].to_vec(), flipped] {
            if let Ok(recording) = read_bytes(bytes, "cut.ximu3", &OpenOptions::default()) {
                recording.for_each(drop);
            }
        }
    }
}

#[test]
fn the_folder_of_a_device_and_what_it_is_in_open() {
    let folder = tempfile::tempdir().unwrap();
    let device = folder.path().join("x-IMU3 0123 (USB)");
    let write = |device: &std::path::Path| {
        std::fs::create_dir(device).unwrap();
        let table = |name: &str, header: &str, numbers: &str| {
            let rows: String = (0..50)
                .map(|k| format!("{},{numbers}\n", 1_000_000 + 20_000 * k))
                .collect();
            std::fs::write(
                device.join(name),
                format!("Timestamp (us),{header}\n{rows}"),
            )
            .unwrap();
        };
        let inertial = "Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s),Accelerometer X (g),Accelerometer Y (g),Accelerometer Z (g)";
        table("Inertial.csv", inertial, "90,0,0,0,0,1");
        table(
            "Magnetometer.csv",
            "X (a.u.),Y (a.u.),Z (a.u.)",
            "0.4,0,-0.9",
        );
        table("Quaternion.csv", "W,X,Y,Z", "1,0,0,0");
        table("Temperature.csv", "Temperature (degrees Celsius)", "25");
        let answers = "[{\"ping\":{\"interface\":\"USB\",\"name\":\"x-IMU3\",\"sn\":\"0123\"}}]";
        std::fs::write(device.join("Command.json"), answers).unwrap();
    };
    write(&device);
    for path in [device.as_path(), folder.path()] {
        let mut recording = crate::open(path, &OpenOptions::default()).unwrap();
        assert_eq!(recording.metadata().device.as_deref(), Some("x-IMU3 0123"));
        let events: Vec<Event> = recording.by_ref().map(Result::unwrap).collect();
        assert_eq!(events.len(), 200);
        let Sample::DeviceOrientation(q) = events[3].sample else {
            panic!("{:?}", events[3])
        };
        approx::assert_relative_eq!(q * Vector3::x(), Vector3::y(), epsilon = 1e-12);
    }
    // One table alone.
    let mut alone = crate::open(&device.join("Inertial.csv"), &OpenOptions::default()).unwrap();
    assert_eq!(alone.by_ref().map(Result::unwrap).count(), 100);
    write(&folder.path().join("x-IMU3 4567 (USB)"));
    let refused = crate::open(folder.path(), &OpenOptions::default())
        .unwrap_err()
        .to_string();
    assert!(
        refused.contains("several devices") && refused.contains("x-IMU3 4567 (USB)"),
        "{refused}"
    );
}
