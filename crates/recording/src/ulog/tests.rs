use super::*;
use crate::options::{Format, OpenOptions};
use proptest::prelude::*;

fn message(kind: u8, content: &[u8]) -> Vec<u8> {
    let mut message = (content.len() as u16).to_le_bytes().to_vec();
    message.push(kind);
    message.extend_from_slice(content);
    message
}

/// Header, a format, and its subscription with the id 7.
fn begin(format: &str) -> Vec<u8> {
    let name = format.split(':').next().unwrap();
    let mut log = b"ULog\x01\x12\x35\x01\0\0\0\0\0\0\0\0".to_vec();
    log.extend(message(b'F', format.as_bytes()));
    log.extend(message(b'A', &[&[0, 7, 0], name.as_bytes()].concat()));
    log
}

const COMBINED: &str = "sensor_combined:uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;\
    int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;";

fn combined(us: u64, relative: i32) -> Vec<u8> {
    let mut data = 7_u16.to_le_bytes().to_vec();
    data.extend(us.to_le_bytes());
    data.extend([0.1_f32, 0.2, 0.3].iter().flat_map(|x| x.to_le_bytes()));
    data.extend(4000_u32.to_le_bytes());
    data.extend(relative.to_le_bytes());
    data.extend([1.0_f32, 2.0, -9.5].iter().flat_map(|x| x.to_le_bytes()));
    message(b'D', &data)
}

fn read(bytes: Vec<u8>) -> (std::result::Result<Vec<Event>, String>, Issues) {
    let options = OpenOptions {
        format: Some(Format::Ulog),
        ..OpenOptions::default()
    };
    let mut recording = match crate::read_bytes(bytes, "test.ulg", &options) {
        Ok(recording) => recording,
        Err(error) => return (Err(error.to_string()), Issues::default()),
    };
    let events: Result<Vec<Event>> = recording.by_ref().collect();
    (
        events.map_err(|error| error.to_string()),
        recording.issues().clone(),
    )
}

#[test]
fn rates_and_forces_have_their_own_stamps() {
    let log = [
        begin(COMBINED),
        combined(1000, 500),
        combined(5000, i32::MAX),
    ]
    .concat();
    let (events, issues) = read(log);
    let events = events.unwrap();
    assert!(issues.is_empty(), "{issues:?}");
    let times: Vec<i64> = events.iter().map(|e| e.time_ns).collect();
    assert_eq!(times, [1_000_000, 1_500_000, 5_000_000]);
    let Sample::SpecificForce(force) = events[1].sample else {
        panic!("{events:?}")
    };
    assert_eq!(force, Vector3::new(1.0, 2.0, -9.5));
}

#[test]
fn fixes_of_both_generations_of_logs() {
    let old = "vehicle_gps_position:uint64_t timestamp;int32_t lat;int32_t lon;int32_t alt_ellipsoid;float eph;\
        float epv;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;uint8_t fix_type;bool vel_ned_valid;";
    let new = "vehicle_gps_position:uint64_t timestamp;double latitude_deg;double longitude_deg;\
        double altitude_ellipsoid_m;float eph;float epv;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;\
        uint8_t fix_type;bool vel_ned_valid;";
    for (format, is_old) in [(old, true), (new, false)] {
        let mut log = begin(format);
        for (us, fix_type) in [(1000_u64, 6_u8), (2000, 2), (3000, 1)] {
            let mut data = 7_u16.to_le_bytes().to_vec();
            data.extend(us.to_le_bytes());
            if is_old {
                for x in [470_000_000_i32, -80_000_000, 512_000] {
                    data.extend(x.to_le_bytes());
                }
            } else {
                for x in [47.0_f64, -8.0, 512.0] {
                    data.extend(x.to_le_bytes());
                }
            }
            for x in [1.0_f32, 2.0, 3.0, 4.0, 5.0] {
                data.extend(x.to_le_bytes());
            }
            data.extend([fix_type, 1]);
            log.extend(message(b'D', &data));
        }
        let (events, issues) = read(log);
        let events = events.unwrap();
        assert_eq!(issues.invalid_fixes[&SensorKind::GnssPosition], 1);
        assert_eq!(events.len(), 4, "{events:?}");
        let Sample::GnssPosition(fix) = events[0].sample else {
            panic!("{events:?}")
        };
        approx::assert_relative_eq!(fix.latitude_rad.to_degrees(), 47.0, epsilon = 1e-9);
        approx::assert_relative_eq!(fix.longitude_rad.to_degrees(), -8.0, epsilon = 1e-9);
        approx::assert_relative_eq!(fix.height_m.unwrap(), 512.0);
        assert_eq!(fix.quality, GnssQuality::RtkFixed);
        let Sample::GnssPosition(flat) = events[2].sample else {
            panic!("{events:?}")
        };
        assert_eq!(
            (flat.quality, flat.height_m),
            (GnssQuality::Autonomous, None)
        );
    }
}

#[test]
fn a_log_that_is_cut_off_is_read_up_to_there() {
    let whole = [begin(COMBINED), combined(1000, 0), combined(5000, 0)].concat();
    let (events, issues) = read(whole[..whole.len() - 5].to_vec());
    assert_eq!(events.unwrap().len(), 2);
    assert!(issues.sentences()[0].contains("cut off"), "{issues:?}");
    let (nothing, _) = read(whole[..10].to_vec());
    assert!(nothing.is_err());
}

#[test]
fn definitions_that_would_eat_memory_or_turn_in_circles_do_not_pass() {
    for format in [
        "sensor_combined:uint64_t timestamp;float[3] gyro_rad;float[99999999999999] x;",
        "sensor_combined:uint64_t timestamp;sensor_combined self;",
        "sensor_combined:uint64_t timestamp;float[-1] x;",
        // Numbers outside of brackets; the parser gives up at the first that is too large for it.
        "sensor_combined:uint64_t timestamp99999999999999999999999 9;float[3] gyro_rad;",
        "sensor_combined:uint64_t timestamp 99999999999999999999999;float[3] gyro_rad;",
        "sensor_combined:uint64_t 99999999999999999999999;float[3] gyro_rad;",
        "sensor_combined:uint64_t ?99999999999999999999999;float[3] gyro_rad;",
    ] {
        let mut log = begin(format);
        log.extend(message(b'I', b"\x1echar[9999999999999999999] sys_name x"));
        log.extend(combined(1000, 0));
        let (events, _) = read(log);
        assert!(events.unwrap_err().contains("no sample"), "{format}");
    }
}

proptest! {
    #[test]
    fn any_bytes_are_read_or_refused(
        messages in proptest::collection::vec(
            (prop_oneof![Just(b'D'), Just(b'A'), Just(b'F'), Just(b'B'), any::<u8>()],
             proptest::collection::vec(any::<u8>(), 0..60), any::<bool>()),
            0..20,
        ),
        cut in 0_usize..2000,
    ) {
        let mut log = begin(COMBINED);
        for (kind, mut content, is_data) in messages {
            if is_data {
                content.splice(0..0, [7, 0]);
            }
            log.extend(message(kind, &content));
            log.extend(combined(u64::from(kind) * 1000, 0));
        }
        log.truncate(cut.max(1));
        if let (Ok(events), _) = read(log) {
            prop_assert!(events.windows(2).all(|pair| pair[0].time_ns <= pair[1].time_ns));
        }
    }
}
