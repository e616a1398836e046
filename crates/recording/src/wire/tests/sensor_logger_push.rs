//! Sensor Logger's messages.

use serde_json::{Value, json};

use super::{said, vectors};
use crate::event::SensorKind;
use crate::wire::sensor_logger_push::{Push, SensorLoggerPush};
use crate::wire::{Decoded, ForceSign, MOST_READINGS};

const G: f64 = 9.80665;
/// An odd number of nanoseconds beyond 2^53.
const START_NS: i64 = 1_763_697_600_000_000_001;

fn reading(name: &str, time_ns: i64, v: [f64; 3]) -> Value {
    json!({"name": name, "time": time_ns, "values": {"x": v[0], "y": v[1], "z": v[2]}})
}

fn message(id: u64, payload: &[Value]) -> Vec<u8> {
    json!({"messageId": id, "sessionId": "s", "deviceId": "d", "payload": payload})
        .to_string()
        .into_bytes()
}

fn decode(payload: &[Value]) -> Decoded {
    SensorLoggerPush::default().push(&message(0, payload))
}

/// `count` stamps, 10 ms apart.
fn stamps(count: i64) -> impl Iterator<Item = i64> {
    (0..count).map(|index| START_NS + index * 10_000_000)
}

#[test]
fn stamps_are_exact_nanoseconds() {
    let out = decode(&[reading("gyroscope", START_NS, [0.1, 0.2, 0.3])]);
    assert_eq!(out.events[0].time_ns, START_NS);
    assert_eq!(vectors(&out, SensorKind::Gyroscope), [[0.1, 0.2, 0.3]]);
}

#[test]
fn acceleration_and_gravity_are_added_across_messages() {
    let mut decoder = SensorLoggerPush::with_sign(ForceSign::Standard);
    let out = decoder.push(&message(0, &[reading("gravity", START_NS, [0.0, 0.0, G])]));
    assert!(out.events.is_empty());
    let out = decoder.push(&message(
        1,
        &[reading("accelerometer", START_NS, [1.0, 2.0, 0.5])],
    ));
    assert_eq!(
        vectors(&out, SensorKind::Accelerometer),
        [[1.0, 2.0, G + 0.5]]
    );
}

#[test]
fn total_acceleration_is_taken_alone_where_it_comes() {
    let out = decode(&[
        reading("accelerometer", START_NS, [0.0; 3]),
        reading("gravity", START_NS, [0.0, 0.0, G]),
        reading("totalacceleration", START_NS, [0.0, 0.0, 9.5]),
        reading("accelerometeruncalibrated", START_NS, [0.0, 0.0, 9.0]),
    ]);
    assert_eq!(vectors(&out, SensorKind::Accelerometer), [[0.0, 0.0, 9.5]]);
}

#[test]
fn uncalibrated_acceleration_of_one_is_an_iphones_in_g() {
    // Standing on its lower edge: nothing but the unit tells.
    let payload: Vec<_> = stamps(8)
        .map(|t| reading("accelerometeruncalibrated", t, [0.0, -1.0, 0.0]))
        .collect();
    let out = decode(&payload);
    assert_eq!(vectors(&out, SensorKind::Accelerometer), [[0.0, G, 0.0]; 8]);
    assert!(said(&out, "as iPhones have it"));
}

#[test]
fn the_orientation_tells_the_sign_in_any_posture() {
    // Screen down: half a turn about x. Gravity as Android writes it is then negative on z.
    let flipped = |t| json!({"name": "orientation", "time": t, "values": {"qw": 0, "qx": 1, "qy": 0, "qz": 0}});
    let gravity = |t| reading("gravity", t, [0.0, 0.0, -G]);
    let rest = |t| reading("accelerometer", t, [0.0; 3]);
    let mixed: Vec<_> = stamps(8)
        .flat_map(|t| [gravity(t), rest(t), flipped(t)])
        .collect();
    let grouped: Vec<_> = stamps(8)
        .map(gravity)
        .chain(stamps(8).map(rest))
        .chain(stamps(8).map(flipped))
        .collect();
    for payload in [mixed, grouped] {
        let out = decode(&payload);
        assert_eq!(
            vectors(&out, SensorKind::Accelerometer),
            [[0.0, 0.0, -G]; 8]
        );
        assert!(said(&out, "as Android and the standard have it"));
    }
}

#[test]
fn the_users_word_about_the_sign_is_final() {
    let payload: Vec<_> = stamps(8)
        .flat_map(|t| {
            [
                reading("gravity", t, [0.0, 0.0, -G]),
                reading("accelerometer", t, [0.0; 3]),
            ]
        })
        .collect();
    let out = SensorLoggerPush::with_sign(ForceSign::Standard).push(&message(0, &payload));
    assert_eq!(
        vectors(&out, SensorKind::Accelerometer),
        [[0.0, 0.0, -G]; 8]
    );
}

#[test]
fn the_uncalibrated_gyroscope_gives_the_devices_bias_or_stands_in() {
    let uncalibrated = reading("gyroscopeuncalibrated", START_NS, [0.5, 0.0, 0.0]);
    let out = decode(&[
        uncalibrated.clone(),
        reading("gyroscope", START_NS, [0.25, 0.0, 0.0]),
    ]);
    assert_eq!(vectors(&out, SensorKind::Gyroscope), [[0.25, 0.0, 0.0]]);
    assert_eq!(
        vectors(&out, SensorKind::DeviceGyroscopeBias),
        [[0.25, 0.0, 0.0]]
    );
    let out = decode(&[uncalibrated]);
    assert_eq!(vectors(&out, SensorKind::Gyroscope), [[0.5, 0.0, 0.0]]);
}

#[test]
fn a_gap_is_waited_for_by_the_readings_own_time() {
    let gyroscope = |ms: i64| reading("gyroscope", START_NS + ms * 1_000_000, [0.0; 3]);
    let mut decoder = SensorLoggerPush::default();
    assert_eq!(decoder.push(&message(0, &[gyroscope(0)])).events.len(), 1);
    assert_eq!(decoder.push(&message(2, &[gyroscope(200)])).events.len(), 0);
    assert_eq!(decoder.push(&message(3, &[gyroscope(900)])).events.len(), 0);
    let out = decoder.push(&message(4, &[gyroscope(1200)]));
    assert_eq!(out.events.len(), 3);
    assert!(said(&out, "was given up"));
    let out = decoder.push(&message(1, &[gyroscope(100)]));
    assert_eq!(out.late.len(), 1);
    assert!(said(&out, "after its successors"));
}

#[test]
fn a_new_session_starts_anew_and_loses_nothing_of_the_old() {
    let mut decoder = SensorLoggerPush::default();
    decoder.push(&message(0, &[reading("gyroscope", START_NS, [0.0; 3])]));
    decoder.push(&message(2, &[reading("gyroscope", START_NS + 1, [0.0; 3])]));
    let other =
        json!({"messageId": 0, "sessionId": "t", "payload": [reading("gyroscope", 5, [0.0; 3])]});
    let out = decoder.push(other.to_string().as_bytes());
    let times: Vec<_> = out.events.iter().map(|event| event.time_ns).collect();
    assert_eq!(times, [START_NS + 1, 5]);
}

#[test]
fn one_bad_reading_costs_only_itself() {
    let out = decode(&[
        json!({"name": "gyroscope", "time": "soon", "values": {"x": 0, "y": 0, "z": 0}}),
        json!({"name": "gyroscope", "time": START_NS, "values": {"x": 0, "y": null, "z": 0}}),
        json!({"name": "gyroscope", "time": START_NS, "values": 7}),
        json!({"time": START_NS}),
        json!(null),
        reading("gyroscope", START_NS, [0.0; 3]),
    ]);
    assert_eq!(out.events.len(), 1);
    assert!(said(&out, "not a count of nanoseconds") && said(&out, "has no `name`"));
}

#[test]
fn what_is_no_message_is_said() {
    assert!(
        Push::parse(b"{}")
            .unwrap_err()
            .problem
            .contains("`payload`")
    );
    assert!(said(
        &SensorLoggerPush::default().push(b"hello"),
        "not JSON"
    ));
}

#[test]
fn a_message_that_is_too_long_is_used_up_to_the_limit() {
    let payload: Vec<_> = stamps(MOST_READINGS as i64 + 5)
        .map(|t| json!({"name": "gyroscope", "time": t, "values": {"x": 0, "y": 0, "z": 0}}))
        .collect();
    let out = decode(&payload);
    assert_eq!(out.events.len(), MOST_READINGS);
    assert!(said(&out, "shorten the batch period"));
}
