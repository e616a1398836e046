//! SensorServer's frames.

use serde_json::{Value, json};

use super::{said, vectors};
use crate::event::{Sample, SensorKind};
use crate::wire::Decoded;
use crate::wire::sensorserver::SensorServer;

fn frame(sensor: &str, timestamp: i64, values: &Value) -> Vec<u8> {
    json!({"values": values, "timestamp": timestamp, "accuracy": 3,
        "type": format!("android.sensor.{sensor}")})
    .to_string()
    .into_bytes()
}

#[test]
fn five_hertz_is_remarked_on_with_what_to_do() {
    let mut decoder = SensorServer::default();
    let mut all = Decoded::default();
    for index in 0..30 {
        all.append(decoder.push(&frame("gyroscope", index * 200_000_000, &json!([0, 0, 0]))));
    }
    assert_eq!(all.events.len(), 30);
    assert!(said(&all, "only 5 times a second") && said(&all, "10000 microseconds"));
}

#[test]
fn uncalibrated_sensors_give_the_bias_and_stand_in_after_a_second() {
    let mut decoder = SensorServer::default();
    let mut all = Decoded::default();
    for index in 0..=150 {
        let values = json!([0.5, 0, 0, 0.125, 0, 0]);
        all.append(decoder.push(&frame(
            "gyroscope_uncalibrated",
            index * 10_000_000,
            &values,
        )));
    }
    assert_eq!(
        vectors(&all, SensorKind::DeviceGyroscopeBias),
        [[0.125, 0.0, 0.0]; 151]
    );
    assert_eq!(vectors(&all, SensorKind::Gyroscope), [[0.5, 0.0, 0.0]; 50]);
}

#[test]
fn a_rotation_vector_without_w_is_completed() {
    let out = SensorServer::default().push(&frame("rotation_vector", 1, &json!([0.6, 0.0, 0.0])));
    let Sample::DeviceOrientation(q) = out.events[0].sample else {
        panic!("no orientation");
    };
    approx::assert_relative_eq!(q.w, 0.8, epsilon = 1e-12);
}

#[test]
fn frames_that_cannot_be_used_are_said() {
    let mut decoder = SensorServer::default();
    assert!(said(
        &decoder.push(b"{\"values\":[1,2,3],\"timestamp\":1}"),
        "does not name its sensor"
    ));
    assert!(said(
        &decoder.push(&frame("step_counter", 1, &json!([7]))),
        "step_counter is not used"
    ));
    assert!(said(
        &decoder.push(&frame("gyroscope", 1, &json!([1, 2]))),
        "a number is missing"
    ));
    assert!(said(
        &decoder.push(b"{\"type\":\"gyroscope\",\"values\":[1,2,3]}"),
        "`timestamp`"
    ));
    let out = decoder.push(&frame("pressure", 1, &json!([1013.25])));
    assert_eq!(out.events[0].sample, Sample::Pressure(101_325.0));
}
