//! Every wire decoder against one known motion, rendered in each device's format.

use crate::wire_truth;

use std::fs;
use std::path::Path;

use northing_recording::SensorKind;
use northing_recording::test_data::fixtures_dir;
use northing_recording::wire::hyperimu::HyperImu;
use northing_recording::wire::linkoping::Linkoping;
use northing_recording::wire::phone_page::PhonePage;
use northing_recording::wire::phyphox::Phyphox;
use northing_recording::wire::razor::{Razor, RazorConfig, RazorOutput};
use northing_recording::wire::sensor_logger_push::SensorLoggerPush;
use northing_recording::wire::sensorserver::{CONNECT_PATH, SensorServer};
use northing_recording::wire::sensorstreamer::SensorStreamer;
use northing_recording::wire::{Decoded, Tone};
use serde_json::{Value, json};
use wire_truth::{Tolerance, Truth};

const EPOCH_NS: i64 = 1_763_697_600_000_000_000;
const BOOT_NS: i64 = 3_925_657_519_043_709;

/// Numbers written in full: what is left is the truth file's nine digits.
const EXACT: Tolerance = Tolerance {
    rate_rad_s: 1e-8,
    force_m_s2: 1e-8,
    field_ut: 1e-7,
    attitude_rad: 1e-8,
    heading_rad: 0.0,
};

fn lines(path: &Path) -> Vec<Vec<u8>> {
    let text = fs::read(path).expect("the fixture is there");
    let lines = text.split(|&byte| byte == b'\n');
    lines
        .filter(|line| !line.is_empty())
        .map(<[u8]>::to_vec)
        .collect()
}

/// All messages through `push`, one after the other.
fn all(messages: &[Vec<u8>], mut push: impl FnMut(&[u8]) -> Decoded) -> Decoded {
    let mut out = Decoded::default();
    for message in messages {
        out.append(push(message));
    }
    out
}

/// The motion has phases at rest, so a decoder that gives nothing but rest would be seen by the counts.
fn assert_clean(out: &Decoded) {
    assert!(
        out.notices.iter().all(|notice| notice.tone == Tone::Info),
        "{:?}",
        out.notices
    );
}

#[test]
fn sensor_logger_push_is_the_truth_on_android_and_on_both_settings_of_an_iphone() {
    let Some(dir) = fixtures_dir("sensor_logger_push") else {
        return;
    };
    let truth = Truth::read(&dir);
    for (file, count, with_attitude) in [
        ("push_android_50hz.ndjson", 301, true),
        ("push_ios_default_25hz.ndjson", 151, false),
        ("push_ios_standardised_25hz.ndjson", 151, false),
    ] {
        let mut decoder = SensorLoggerPush::default();
        let messages = lines(&dir.join("sensor_logger").join(file));
        let mut out = all(&messages, |body| decoder.push(body));
        out.append(decoder.flush());
        assert_clean(&out);
        let seen = truth.assert_equal(&out.events, EPOCH_NS, &EXACT);
        assert_eq!(seen[&SensorKind::Gyroscope], count, "{file}");
        assert_eq!(seen[&SensorKind::Accelerometer], count, "{file}");
        assert_eq!(seen[&SensorKind::Magnetometer], count, "{file}");
        let attitudes = seen.get(&SensorKind::DeviceOrientation);
        assert_eq!(attitudes, with_attitude.then_some(&count), "{file}");
        assert_eq!(
            out.notices.len(),
            1,
            "what was decided about the sign is said"
        );
    }
}

#[test]
fn sensor_logger_messages_out_of_order_and_twice_give_each_reading_once_in_order() {
    let Some(dir) = fixtures_dir("sensor_logger_out_of_order") else {
        return;
    };
    let truth = Truth::read(&dir);
    let mut decoder = SensorLoggerPush::default();
    let messages = lines(&dir.join("sensor_logger/push_out_of_order_duplicate.ndjson"));
    let out = all(&messages, |body| decoder.push(body));
    let seen = truth.assert_equal(&out.events, EPOCH_NS, &EXACT);
    assert!(out.events.is_sorted_by_key(|event| event.time_ns));
    for kind in [SensorKind::Gyroscope, SensorKind::Accelerometer] {
        // Ten a second over the 2 s of the first four messages.
        assert_eq!(seen[&kind], 20);
    }
    let twice = out.notices.iter().find(|n| n.text.contains("twice"));
    assert_eq!(twice.map(|notice| notice.count), Some(1));
    assert!(decoder.flush().events.is_empty());
}

#[test]
fn sensor_logger_sensors_that_are_not_used_cost_nothing_else() {
    let Some(dir) = fixtures_dir("sensor_logger_other_sensors") else {
        return;
    };
    let body = fs::read(dir.join("sensor_logger/push_other_sensors.json")).unwrap();
    let mut decoder = SensorLoggerPush::default();
    let mut out = decoder.push(&body);
    out.append(decoder.flush());
    let kinds: Vec<_> = out.events.iter().map(|e| e.sample.kind()).collect();
    assert_eq!(kinds, [SensorKind::Pressure]);
    let said = |part: &str| out.notices.iter().any(|n| n.text.contains(part));
    assert!(said("a-sensor-of-the-future"), "{:?}", out.notices);
    assert!(said("Annotation: start of turn"), "{:?}", out.notices);
    assert!(said("a number is missing"), "{:?}", out.notices);
}

#[test]
fn sensorserver_is_the_truth() {
    let Some(dir) = fixtures_dir("sensorserver") else {
        return;
    };
    let truth = Truth::read(&dir);
    // Six decimals; seven of the quaternion.
    let tolerance = Tolerance {
        rate_rad_s: 5.2e-7,
        force_m_s2: 5.2e-7,
        field_ut: 5.6e-7,
        attitude_rad: 2.1e-7,
        ..EXACT
    };
    let mut decoder = SensorServer::default();
    let frames = lines(&dir.join("sensorserver/sensors_multi_50hz.ndjson"));
    let out = all(&frames, |frame| decoder.push(frame));
    assert!(out.notices.is_empty(), "{:?}", out.notices);
    let seen = truth.assert_equal(&out.events, BOOT_NS, &tolerance);
    assert_eq!(seen.len(), 4);
    assert!(seen.values().all(|&count| count == 301), "{seen:?}");
    for sensor in [
        "accelerometer",
        "gyroscope",
        "magnetic_field",
        "rotation_vector",
    ] {
        assert!(CONNECT_PATH.contains(sensor));
    }

    let mut decoder = SensorServer::for_sensor("android.sensor.accelerometer");
    let frames = lines(&dir.join("sensorserver/single_accelerometer.ndjson"));
    let out = all(&frames, |frame| decoder.push(frame));
    let seen = truth.assert_equal(&out.events, BOOT_NS, &tolerance);
    assert_eq!(seen[&SensorKind::Accelerometer], 10);

    let mut decoder = SensorServer::default();
    let frames = lines(&dir.join("sensorserver/gps.ndjson"));
    let out = all(&frames, |frame| decoder.push(frame));
    assert!(out.events.is_empty() && out.notices[0].tone == Tone::Info);
}

#[test]
fn linkoping_is_the_truth_however_the_stream_is_cut() {
    let Some(dir) = fixtures_dir("linkoping") else {
        return;
    };
    let truth = Truth::read(&dir);
    // Eight significant digits.
    let tolerance = Tolerance {
        rate_rad_s: 6e-8,
        force_m_s2: 6e-8,
        field_ut: 6e-7,
        attitude_rad: 3e-8,
        ..EXACT
    };
    let stream = fs::read(dir.join("linkoping_sensor_fusion/stream_100hz.txt")).unwrap();
    let mut whole = None;
    for cut in [7, 1448, stream.len()] {
        let mut decoder = Linkoping::default();
        let mut out = Decoded::default();
        for piece in stream.chunks(cut) {
            out.append(decoder.push(piece));
        }
        assert!(out.notices.is_empty(), "{:?}", out.notices);
        let seen = truth.assert_equal(&out.events, 122_130_049_000_000, &tolerance);
        assert_eq!(seen[&SensorKind::Gyroscope], 301);
        assert_eq!(seen[&SensorKind::Accelerometer], 301);
        assert_eq!(seen[&SensorKind::Magnetometer], 301);
        assert_eq!(seen[&SensorKind::DeviceOrientation], 301);
        let mut events = out.events;
        events.sort_by_key(|event| (event.time_ns, event.sample.kind().order()));
        let first = whole.get_or_insert_with(|| events.clone());
        assert_eq!(*first, events);
    }
}

#[test]
fn phyphox_is_the_truth_in_full_and_in_parts() {
    let Some(dir) = fixtures_dir("phyphox") else {
        return;
    };
    let truth = Truth::read(&dir);
    // Eight significant digits.
    let tolerance = Tolerance {
        rate_rad_s: 6e-8,
        force_m_s2: 6e-8,
        ..EXACT
    };
    let read = |name: &str| fs::read(dir.join("phyphox").join(name)).unwrap();
    let mut decoder = Phyphox::from_config(&read("config.json")).unwrap();
    assert!(decoder.request_path().contains("acc_time=full&accX=full"));
    let mut out = decoder.push(&read("get_full.json"));
    assert!(
        decoder
            .request_path()
            .contains("gyr_time=2&gyrX=2%7Cgyr_time")
    );
    out.append(decoder.push(&read("get_partial.json")));
    // An answer that comes twice adds nothing.
    assert!(decoder.push(&read("get_partial.json")).events.is_empty());
    assert!(out.notices.is_empty(), "{:?}", out.notices);
    let seen = truth.assert_equal(&out.events, 0, &tolerance);
    // 0 to 2.5 s, of which every second stamp is in the truth.
    assert_eq!(seen[&SensorKind::Gyroscope], 126);
    assert_eq!(seen[&SensorKind::Accelerometer], 126);
    assert_eq!(out.events.len(), 2 * 251);
}

#[test]
fn razor_text_binary_and_angles_are_the_truth() {
    let Some(dir) = fixtures_dir("razor") else {
        return;
    };
    let truth = Truth::read(&dir);
    let read = |name: &str| fs::read(dir.join("razor_ahrs").join(name)).unwrap();
    // Two decimals of a count and of a degree.
    let text = Tolerance {
        rate_rad_s: 6.1e-6,
        force_m_s2: 2e-4,
        field_ut: 5.1e-4,
        attitude_rad: 1.3e-4,
        ..EXACT
    };
    let out = Razor::default().push(&read("osct_50hz.txt"));
    assert!(out.notices.is_empty(), "{:?}", out.notices);
    let seen = truth.assert_equal(&out.events, 0, &text);
    assert_eq!(seen.len(), 3);
    assert!(seen.values().all(|&count| count == 301), "{seen:?}");

    let config = RazorConfig {
        output: RazorOutput::BinarySensors,
        ..RazorConfig::default()
    };
    // Single precision.
    let binary = Tolerance {
        rate_rad_s: 1e-6,
        force_m_s2: 1e-6,
        field_ut: 3e-6,
        attitude_rad: 0.0,
        ..EXACT
    };
    let mut decoder = Razor::new(config);
    let mut out = Decoded::default();
    for piece in read("oscb_50hz.bin").chunks(50) {
        out.append(decoder.push(piece));
    }
    assert!(out.notices.is_empty(), "{:?}", out.notices);
    let seen = truth.assert_equal(&out.events, 0, &binary);
    assert!(seen.values().all(|&count| count == 301), "{seen:?}");

    let out = Razor::default().push(&read("ypr_50hz.txt"));
    let seen = truth.assert_equal(&out.events, 0, &text);
    assert_eq!(seen[&SensorKind::DeviceOrientation], 301);
    let slow = RazorConfig {
        frame_interval_ns: 100_000_000,
        ..RazorConfig::default()
    };
    let out = Razor::new(slow).push(&read("ang_old_firmware.txt"));
    let seen = truth.assert_equal(&out.events, 0, &text);
    assert_eq!(seen[&SensorKind::DeviceOrientation], 61);
}

#[test]
fn hyperimu_and_sensorstreamer_are_the_truth() {
    let Some(dir) = fixtures_dir("hyperimu_sensorstreamer") else {
        return;
    };
    let truth = Truth::read(&dir);
    let tolerance = Tolerance {
        rate_rad_s: 5.1e-6,
        force_m_s2: 5.1e-6,
        field_ut: 5.1e-6,
        attitude_rad: 0.0,
        ..EXACT
    };
    let mut csv = HyperImu::default();
    let mut json = HyperImu::default();
    let mut streamer = SensorStreamer::default();
    for (messages, push, start) in [
        (
            "hyperimu/udp_csv.txt",
            &mut (|m: &[u8]| csv.push_datagram(m)) as &mut dyn FnMut(&[u8]) -> Decoded,
            EPOCH_NS,
        ),
        (
            "hyperimu/tcp_json.ndjson",
            &mut |m: &[u8]| json.push_datagram(m),
            EPOCH_NS,
        ),
        (
            "sensorstreamer/tcp_json.ndjson",
            &mut |m: &[u8]| streamer.push(&[m, b"\n"].concat()),
            BOOT_NS,
        ),
    ] {
        let out = all(&lines(&dir.join(messages)), push);
        assert_clean(&out);
        let seen = truth.assert_equal(&out.events, start, &tolerance);
        assert_eq!(seen.len(), 3, "{messages}");
        // 20 a second; those at 0.05 s are between two rows of the truth.
        assert!(
            seen.values().all(|&count| count >= 27),
            "{messages} {seen:?}"
        );
        assert_eq!(out.events.len(), 3 * 61, "{messages}");
    }
}

/// The browser's events as the phone page batches them.
fn batches(path: &Path, platform: &str) -> Vec<Vec<u8>> {
    let events: Vec<Value> = lines(path)
        .iter()
        .map(|line| serde_json::from_slice(line).expect("a JSON line"))
        .collect();
    events[1..]
        .chunks(25)
        .enumerate()
        .map(|(seq, events)| {
            let rows = |kind: &str, row: fn(&Value) -> Value| -> Value {
                let is_kind = |e: &&Value| e["type"].as_str().is_some_and(|name| name.starts_with(kind));
                let of_kind = events.iter().filter(is_kind);
                of_kind.map(row).collect()
            };
            let xyz: fn(&Value) -> Value = |e| json!([e["timestamp"], e["x"], e["y"], e["z"]]);
            let batch = json!({
                "v": 1, "device": "d", "session": "s", "seq": seq, "platform": platform,
                "dm": rows("devicemotion", |e| {
                    let (a, g, r) = (&e["acceleration"], &e["accelerationIncludingGravity"], &e["rotationRate"]);
                    json!([e["timeStamp"], a["x"], a["y"], a["z"], g["x"], g["y"], g["z"],
                        r["alpha"], r["beta"], r["gamma"]])
                }),
                "gs": {
                    "a": rows("Accelerometer", xyz),
                    "g": rows("Gyroscope", xyz),
                    "m": rows("Magnetometer", xyz),
                    "q": rows("AbsoluteOrientationSensor", |e| {
                        let q = &e["quaternion"];
                        json!([e["timestamp"], q[0], q[1], q[2], q[3]])
                    }),
                },
                "do": rows("deviceorientation", |e| json!([e["timeStamp"], e["alpha"], e["beta"], e["gamma"],
                    i32::from(e["absolute"] == true), e["webkitCompassHeading"], e["webkitCompassAccuracy"]])),
            });
            batch.to_string().into_bytes()
        })
        .collect()
}

#[test]
fn the_phone_page_is_the_truth_on_both_platforms_and_both_interfaces() {
    let Some(dir) = fixtures_dir("phone_page") else {
        return;
    };
    let truth = Truth::read(&dir);
    const START_NS: i64 = 1_200_000_000;
    // Rounded to 0.1 m/s^2, 0.1 deg/s, 0.01 uT, 0.1 deg of each angle.
    let coarse = Tolerance {
        rate_rad_s: 8.8e-4,
        force_m_s2: 0.0501,
        field_ut: 0.00501,
        attitude_rad: 1.3e-3,
        heading_rad: 2.7e-3,
    };
    // The compass alone is rounded, to 0.1 deg.
    let exact = Tolerance {
        heading_rad: 8.8e-4,
        ..EXACT
    };
    // 60 Hz meets the truth's 50 Hz every 0.1 s; the orientation comes so much later, ns.
    for (file, platform, tolerance, orientation_late_ns, rounded) in [
        (
            "android_chrome_devicemotion",
            "android",
            &coarse,
            3_000_000,
            2,
        ),
        ("android_chrome_generic_sensor", "android", &coarse, 0, 2),
        ("ios_safari_devicemotion", "ios", &exact, 1_000_000, 0),
        ("ios_safari_devicemotion", "other", &exact, 1_000_000, 0),
    ] {
        let mut decoder = PhonePage::default();
        let messages = batches(
            &dir.join("browser").join(format!("{file}.ndjson")),
            platform,
        );
        let mut out = all(&messages, |body| decoder.push(body));
        for event in &mut out.events {
            use SensorKind::{CompassHeading, DeviceOrientation};
            if matches!(event.sample.kind(), DeviceOrientation | CompassHeading) {
                event.time_ns -= orientation_late_ns;
            }
        }
        assert_clean(&out);
        let seen = truth.assert_equal(&out.events, START_NS, tolerance);
        assert_eq!(seen[&SensorKind::Gyroscope], 61, "{file} {platform}");
        assert_eq!(seen[&SensorKind::Accelerometer], 61, "{file} {platform}");
        assert_eq!(
            seen[&SensorKind::DeviceOrientation],
            61,
            "{file} {platform}"
        );
        assert_eq!(seen[&SensorKind::CompassHeading], 61, "{file} {platform}");
        let field = seen.get(&SensorKind::Magnetometer).copied();
        assert_eq!(field, file.contains("generic").then_some(61), "{file}");
        let told = out
            .notices
            .iter()
            .filter(|n| n.text.contains("rounds"))
            .count();
        assert_eq!(told, rounded, "{file}: {:?}", out.notices);
    }
}
