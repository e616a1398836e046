//! Whatever comes over the wire: no decoder panics, and what it lets through is finite and in order.

use proptest::prelude::*;
use proptest::test_runner::RngSeed;
use serde_json::{Value, json};

use crate::wire::hyperimu::HyperImu;
use crate::wire::linkoping::Linkoping;
use crate::wire::phone_page::PhonePage;
use crate::wire::phyphox::Phyphox;
use crate::wire::razor::{Razor, RazorConfig, RazorOutput};
use crate::wire::sensor_logger_push::SensorLoggerPush;
use crate::wire::sensorserver::SensorServer;
use crate::wire::sensorstreamer::SensorStreamer;
use crate::wire::{Decoded, MOST_NOTICES};

/// Every decoder, each fed all messages in turn.
fn feed_all(messages: &[Vec<u8>]) -> Vec<Decoded> {
    let (mut page, mut logger) = (PhonePage::default(), SensorLoggerPush::default());
    let (mut server, mut phyphox) = (SensorServer::default(), Phyphox::default());
    let (mut linkoping, mut streamer) = (Linkoping::default(), SensorStreamer::default());
    let (mut imu, mut text) = (HyperImu::default(), Razor::default());
    let mut binary = Razor::new(RazorConfig {
        output: RazorOutput::BinarySensors,
        ..RazorConfig::default()
    });
    let mut all = Vec::new();
    for message in messages {
        all.extend([
            page.push(message),
            logger.push(message),
            server.push(message),
            phyphox.push(message),
            linkoping.push(message),
            streamer.push(message),
            imu.push(message),
            imu.push_datagram(message),
            text.push(message),
            binary.push(message),
        ]);
        if let Ok(mut configured) = Phyphox::from_config(message) {
            all.push(configured.push(message));
            assert!(configured.request_path().is_ascii());
        }
    }
    all.push(logger.flush());
    all
}

fn assert_sane(all: &[Decoded]) {
    for out in all {
        assert!(out.events.iter().all(|event| event.sample.is_finite()));
        assert!(out.notices.len() <= MOST_NOTICES);
        for notice in &out.notices {
            assert!(notice.count > 0);
            assert!(notice.text.len() < 400, "{}", notice.text);
            assert!(!notice.text.chars().any(char::is_control));
        }
    }
}

/// JSON that is syntactically right and otherwise nonsense.
fn value() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        any::<u64>().prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        (-100.0..100.0).prop_map(Value::from),
        ".{0,12}".prop_map(Value::from),
    ];
    leaf.prop_recursive(3, 24, 6, |inner| {
        prop_oneof![
            proptest::collection::vec(inner.clone(), 0..8).prop_map(Value::from),
            proptest::collection::vec(("[a-z]{1,6}|x|y|z|time|values", inner), 0..5)
                .prop_map(|pairs| Value::Object(pairs.into_iter().collect())),
        ]
    })
}

/// Messages of the JSON formats, right in their frame and nonsense inside.
fn message() -> impl Strategy<Value = Value> {
    let rows = || proptest::collection::vec(value(), 0..12);
    let names = prop::sample::select(vec![
        "accelerometer",
        "gravity",
        "gyroscope",
        "gyroscopeuncalibrated",
        "accelerometeruncalibrated",
        "orientation",
        "barometer",
        "annotation",
    ]);
    let reading = (names, value(), value())
        .prop_map(|(name, time, values)| json!({"name": name, "time": time, "values": values}));
    let readings = proptest::collection::vec(reading, 0..8);
    prop_oneof![
        (any::<u64>(), rows(), rows(), rows(), value()).prop_map(
            |(seq, dm, a, orientation, events)| json!({
            "v": 1, "device": "d", "session": "s", "seq": seq, "dm": dm,
            "gs": {"a": a, "g": orientation}, "do": orientation, "events": events})
        ),
        (0..6_u64, readings).prop_map(|(id, payload)| json!({"messageId": id, "payload": payload})),
        (value(), value()).prop_map(|(values, timestamp)| json!({
            "type": "android.sensor.rotation_vector", "values": values, "timestamp": timestamp})),
        (value(), value(), value()).prop_map(|(t, x, status)| json!({
            "buffer": {"acc_time": {"buffer": t}, "accX": {"buffer": x}, "accY": {"buffer": x},
                "accZ": {"buffer": x}}, "status": status})),
        (value(), value()).prop_map(|(values, timestamp)| json!({
            "Timestamp": timestamp, "Accelerometer": values,
            "accelerometer": {"value": values, "timestamp": timestamp}})),
        (value(), value()).prop_map(|(source, outputs)| json!({
            "inputs": [{"source": "gyroscope", "outputs": outputs}, {"source": source}]})),
    ]
}

/// The same cases on every run.
fn same_cases(seed: u64) -> ProptestConfig {
    ProptestConfig {
        rng_seed: RngSeed::Fixed(seed),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(same_cases(0x21e))]

    #[test]
    fn arbitrary_bytes_never_panic(messages in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..200), 1..5)) {
        assert_sane(&feed_all(&messages));
    }

    #[test]
    fn nonsense_in_the_right_frame_never_panics(messages in proptest::collection::vec(message(), 1..6)) {
        let mut bytes: Vec<_> = messages.iter().map(|m| m.to_string().into_bytes()).collect();
        for message in &mut bytes {
            message.push(b'\n');
        }
        assert_sane(&feed_all(&bytes));
    }

    #[test]
    fn nonsense_lines_never_panic(text in "(([0-9]{0,20}|-?[0-9.e]{1,8}|#A-C=|#YPR=|!ANG:|#G-R=|ACC|ORI|GYR|PRS|nan|inf)[,\t\n]){0,60}") {
        assert_sane(&feed_all(&[text.into_bytes()]));
    }

    #[test]
    fn a_stream_gives_the_same_however_it_is_cut(
        text in "([0-9]{1,6}\t(ACC|GYR|ORI)(\t-?[0-9]{1,2}\\.[0-9]){3}\n){0,10}",
        cut in 1_usize..30,
    ) {
        let whole = Linkoping::default().push(text.as_bytes());
        let mut decoder = Linkoping::default();
        let mut pieces = Decoded::default();
        for piece in text.as_bytes().chunks(cut) {
            pieces.append(decoder.push(piece));
        }
        pieces.events.sort_by_key(|event| (event.time_ns, event.sample.kind().order()));
        prop_assert_eq!(whole.events, pieces.events);
    }
}

#[test]
fn json_of_any_depth_and_size_is_refused_in_words() {
    let deep = [b"{\"v\":".to_vec(), vec![b'['; 100_000]].concat();
    let long = vec![b'7'; 17 << 20];
    for message in [deep, long, Vec::new(), b"null".to_vec()] {
        let decoded = PhonePage::default().push(&message);
        assert_eq!(decoded.notices.len(), 1);
        assert_sane(&feed_all(&[message]));
    }
}
