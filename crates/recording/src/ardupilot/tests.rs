use super::*;
use crate::options::{Format, OpenOptions};
use proptest::prelude::*;

/// The format of a message.
fn format(id: u8, length: u8, name: &str, fields: &str, labels: &str) -> Vec<u8> {
    let mut message = vec![0xa3, 0x95, 0x80, id, length];
    for (text, width) in [(name, 4), (fields, 16), (labels, 64)] {
        let mut text = text.as_bytes().to_vec();
        text.resize(width, 0);
        message.extend(text);
    }
    message
}

fn message(id: u8, parts: &[&[u8]]) -> Vec<u8> {
    [&[0xa3, 0x95, id][..], &parts.concat()].concat()
}

fn begin() -> Vec<u8> {
    [
        format(0x80, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
        format(
            1,
            36,
            "IMU",
            "QBffffff",
            "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ",
        ),
        format(2, 18, "MAG", "QBhhh", "TimeUS,I,MagX,MagY,MagZ"),
        format(
            3,
            40,
            "GPS",
            "QBBBcLLefff",
            "TimeUS,I,Status,NSats,HDop,Lat,Lng,Alt,Spd,GCrs,VZ",
        ),
        format(4, 19, "GPA", "QBCCCB", "TimeUS,I,HAcc,VAcc,SAcc,VV"),
        format(5, 17, "ATT", "Qccc", "TimeUS,Roll,Pitch,Yaw"),
    ]
    .concat()
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|x| x.to_le_bytes()).collect()
}

fn imu(us: u64, instance: u8, x: f32) -> Vec<u8> {
    let values = floats(&[x, 0.2, 0.3, 0.0, 0.0, -9.75]);
    message(1, &[&us.to_le_bytes(), &[instance], &values])
}

fn gps(us: u64, status: u8) -> Vec<u8> {
    let place = [481_234_567_i32, 91_234_567, 45_678];
    let place: Vec<u8> = place.iter().flat_map(|x| x.to_le_bytes()).collect();
    let hdop = 120_i16.to_le_bytes();
    let motion = floats(&[5.0, 90.0, -0.5]);
    message(
        3,
        &[&us.to_le_bytes(), &[0, status, 11], &hdop, &place, &motion],
    )
}

fn gpa(us: u64) -> Vec<u8> {
    let accuracies: Vec<u8> = [200_u16, 350, 40]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect();
    message(4, &[&us.to_le_bytes(), &[0], &accuracies, &[1]])
}

fn read(bytes: Vec<u8>) -> (Vec<Event>, Issues) {
    let options = OpenOptions {
        format: Some(Format::ArduPilot),
        ..OpenOptions::default()
    };
    let mut recording = crate::read_bytes(bytes, "test.bin", &options).unwrap();
    let events = recording.by_ref().map_while(Result::ok).collect();
    (events, recording.issues().clone())
}

#[test]
fn a_log_becomes_samples_of_the_first_sensors() {
    let turned = [100_i16, -200, 9000]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect::<Vec<u8>>();
    let field = [200_i16, -50, 430]
        .iter()
        .flat_map(|x| x.to_le_bytes())
        .collect::<Vec<u8>>();
    let us = 3_000_u64.to_le_bytes();
    let log = [
        begin(),
        imu(1_000, 0, 0.125),
        imu(1_000, 1, 7.0),
        gps(2_000, 3),
        gpa(2_000),
        message(2, &[&us, &[0], &field]),
        message(5, &[&us, &turned]),
        gps(4_000, 1),
        imu(5_000, 0, 0.25),
    ]
    .concat();
    let (events, issues) = read(log);
    assert!(
        issues.notes.len() == 1 && issues.notes[0].contains("above the geoid"),
        "{issues:?}"
    );
    let of = |us: i64| {
        events
            .iter()
            .filter(move |e| e.time_ns == us * 1000)
            .map(|e| e.sample)
    };
    let rates: Vec<f64> = events
        .iter()
        .filter_map(|event| match event.sample {
            Sample::AngularRate(rate) => Some(rate.x),
            _ => None,
        })
        .collect();
    assert_eq!(rates, [0.125, 0.25]);
    let fixes: Vec<Sample> = of(2_000).collect();
    let [Sample::GnssPosition(fix), Sample::GnssVelocity(velocity)] = fixes[..] else {
        panic!("{fixes:?}");
    };
    assert!((fix.latitude_rad.to_degrees() - 48.123_456_7).abs() < 1e-12);
    assert_eq!(
        (fix.height_m, fix.hdop, fix.satellites),
        (Some(456.78), Some(1.2), Some(11))
    );
    let axis = 2.0 * std::f64::consts::FRAC_1_SQRT_2;
    assert_eq!(fix.std_m, Some([axis, axis, 3.5]));
    assert!((velocity.east_m_s - 5.0).abs() < 1e-12 && velocity.north_m_s.abs() < 1e-12);
    assert_eq!(
        (velocity.down_m_s, velocity.std_m_s),
        (Some(-0.5), Some([0.4; 3]))
    );
    let others: Vec<Sample> = of(3_000).collect();
    let [
        Sample::MagneticField(field),
        Sample::DeviceOrientation(turned),
    ] = others[..]
    else {
        panic!("{others:?}");
    };
    assert!((field - Vector3::new(20.0, -5.0, 43.0)).norm() < 1e-12);
    let forward = turned * Vector3::x();
    let pitch = (-2_f64).to_radians();
    // East, and below the horizon.
    assert!((forward - Vector3::new(0.0, pitch.cos(), -pitch.sin())).norm() < 1e-12);
    // A receiver without a fix has no velocity either.
    assert_eq!(of(4_000).count(), 0);
    assert_eq!(issues.invalid_fixes.values().sum::<u64>(), 1);
}

#[test]
fn what_is_damaged_is_left_out_and_the_end_of_reading_is_said() {
    let good: Vec<u8> = (0..100).flat_map(|k| imu(k * 1000, 0, 0.5)).collect();
    let log = [begin(), good.clone(), vec![0x55; 999], good.clone()].concat();
    let (events, issues) = read(log);
    assert_eq!(
        events.len(),
        400 - 2 * 100,
        "of equal stamps the later are left out"
    );
    assert!(issues.notes.is_empty());
    // Behind a format that is shorter than its own head nothing can be read.
    let bad = format(9, 1, "BAD", "Q", "TimeUS");
    let bad = [bad, vec![0xa3, 0x95, 9], vec![0; 20_000]].concat();
    let (events, issues) = read([begin(), good, bad].concat());
    assert_eq!(events.len(), 200);
    assert!(
        issues.notes.iter().any(|note| note.contains("damaged")),
        "{issues:?}"
    );
}

proptest! {
    #[test]
    fn any_bytes_are_read_or_left_out(bytes in proptest::collection::vec(any::<u8>(), 0..600), at in 0..400_usize) {
        let mut log = [begin(), imu(1_000, 0, 0.5), gps(2_000, 3), gpa(2_000)].concat();
        read(log.clone());
        log.splice(at..at, bytes);
        read(log);
    }
}
