//! phyphox's answers.

use serde_json::json;

use super::{said, vectors};
use crate::event::{Sample, SensorKind};
use crate::wire::phyphox::Phyphox;

#[test]
fn buffers_are_found_by_the_configuration_and_names_are_encoded() {
    let config = json!({"inputs": [
        {"source": "light", "outputs": [{"x": "l"}, {"t": "lt"}]},
        {"source": "gyroscope", "outputs": [{"x": "a b"}, {"y": "y&"}, {"z": "z"}, {"t": "time"}]},
        {"source": "pressure", "outputs": [{"x": "p"}, {"t": "pt"}]},
        {"source": "accelerometer", "outputs": [{"x": "without time"}]}]});
    let mut decoder = Phyphox::from_config(config.to_string().as_bytes()).unwrap();
    assert_eq!(
        decoder.request_path(),
        "/get?time=full&a%20b=full&y%26=full&z=full&pt=full&p=full"
    );
    let answer = json!({"buffer": {
        "time": {"buffer": [0.5, 0.6, 0.7]}, "a b": {"buffer": [1, 2, 3]},
        "y&": {"buffer": [1, null, 3]}, "z": {"buffer": [1, 2]},
        "pt": {"buffer": [0.5]}, "p": {"buffer": [1013.25]}}});
    let out = decoder.push(answer.to_string().as_bytes());
    // The second has a hole, the third is not complete yet.
    assert_eq!(
        vectors(&pressureless(&out), SensorKind::Gyroscope),
        [[1.0; 3]]
    );
    assert!(
        out.events
            .iter()
            .any(|e| e.sample == Sample::Pressure(101_325.0))
    );
    assert!(said(&out, "a number is missing"));
    assert_eq!(
        decoder.request_path(),
        "/get?time=0.6&a%20b=0.6%7Ctime&y%26=0.6%7Ctime&z=0.6%7Ctime&pt=0.5&p=0.5%7Cpt"
    );
}

fn pressureless(out: &crate::wire::Decoded) -> crate::wire::Decoded {
    let mut out = out.clone();
    out.events
        .retain(|e| e.sample.kind() != SensorKind::Pressure);
    out
}

#[test]
fn a_configuration_without_usable_sensors_says_what_it_has() {
    let config = json!({"inputs": [{"source": "light", "outputs": [{"x": "l"}]}]});
    let error = Phyphox::from_config(config.to_string().as_bytes()).unwrap_err();
    assert!(error.problem.contains("(it has: light)"), "{error}");
}

#[test]
fn a_pause_and_a_new_experiment_are_said_and_start_anew() {
    let answer = |session: &str, measuring: bool| {
        let values = json!({"buffer": [1.0]});
        json!({"buffer": {"acc_time": values, "accX": values, "accY": values, "accZ": values},
            "status": {"session": session, "measuring": measuring}})
        .to_string()
    };
    let mut decoder = Phyphox::default();
    assert_eq!(decoder.push(answer("a", true).as_bytes()).events.len(), 1);
    let out = decoder.push(answer("a", false).as_bytes());
    assert!(out.events.is_empty() && said(&out, "press the play button"));
    let out = decoder.push(answer("b", true).as_bytes());
    assert!(out.events.len() == 1 && said(&out, "Another phyphox experiment"));
    assert!(said(&decoder.push(b"{}"), "no `buffer`"));
}
