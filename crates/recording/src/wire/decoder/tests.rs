//! Order, sessions, and refusals of the decoder for all formats.

use super::*;
use crate::event::{Event, Sample};

fn page(session: &str, seq: u64, time_ms: u64) -> Vec<u8> {
    format!(
        r#"{{"v":1,"device":"d","name":"Anna","session":"{session}","seq":{seq},"gs":{{"g":[[{time_ms},0.1,0,0]]}}}}"#
    )
    .into_bytes()
}

fn stamps_ms(decoded: &Decoded) -> Vec<i64> {
    decoded
        .events
        .iter()
        .map(|e| e.time_ns / 1_000_000)
        .collect()
}

#[test]
fn page_batches_come_in_order_once_and_gaps_are_given_up_by_poll() {
    let mut decoder = WireDecoder::new(WireFormat::PhonePage);
    let mut at = |seq: u64, arrival_ns: i64| {
        let decoded = decoder.accept(&page("s", seq, 10 * (seq + 1)), arrival_ns);
        stamps_ms(&decoded.unwrap())
    };
    assert_eq!(at(0, 0), [10]);
    assert_eq!(at(2, 1), [0; 0]);
    assert_eq!(at(2, 2), [0; 0]);
    assert_eq!(at(1, 3), [20, 30]);
    assert_eq!(at(4, 4), [0; 0]);
    assert_eq!(decoder.poll(PAGE_WAIT_NS), None);
    let given_up = decoder.poll(PAGE_WAIT_NS + 4).unwrap();
    assert_eq!(stamps_ms(&given_up), [50]);
    let late = decoder.accept(&page("s", 3, 40), PAGE_WAIT_NS + 5).unwrap();
    assert_eq!((late.events.len(), late.late.len()), (0, 1));
    assert_eq!((decoder.lost(), decoder.duplicated()), (0, 1));
    assert_eq!((decoder.name(), decoder.sessions()), ("Anna", 1));
}

#[test]
fn another_page_load_begins_anew_and_what_waited_is_not_lost() {
    let mut decoder = WireDecoder::new(WireFormat::PhonePage);
    let accept = |decoder: &mut WireDecoder, session, seq, time_ms| {
        stamps_ms(&decoder.accept(&page(session, seq, time_ms), 0).unwrap())
    };
    assert_eq!(accept(&mut decoder, "a", 0, 500), [500]);
    assert_eq!(accept(&mut decoder, "a", 2, 700), [0; 0]);
    assert_eq!(accept(&mut decoder, "b", 0, 1), [700, 1]);
    assert_eq!(accept(&mut decoder, "b", 0, 1), [0; 0]);
    assert_eq!(decoder.sessions(), 2);
    assert_eq!((decoder.lost(), decoder.duplicated()), (1, 1));
}

#[test]
fn of_two_pages_that_are_open_the_newer_one_is_used_until_it_is_silent_and_nothing_is_lost() {
    let mut decoder = WireDecoder::new(WireFormat::PhonePage);
    let mut accept = |session, seq, arrival_ns| {
        let decoded = decoder.accept(&page(session, seq, 1000 + seq), arrival_ns);
        let decoded = decoded.unwrap();
        (decoded.events.len(), decoded.late.len())
    };
    assert_eq!(accept("a", 0, 0), (1, 0));
    assert_eq!(accept("b", 0, 1), (1, 0));
    assert_eq!(accept("a", 1, 2), (0, 1));
    assert_eq!(accept("b", 1, 3), (1, 0));
    // Back on the first page, which goes on where it was.
    assert_eq!(accept("a", 2, PAGE_SILENT_NS + 3), (1, 0));
    assert_eq!(accept("b", 2, PAGE_SILENT_NS + 4), (0, 1));
    assert_eq!((decoder.lost(), decoder.duplicated()), (0, 0));
}

#[test]
fn a_page_that_goes_on_alone_is_used_again_at_once() {
    let mut decoder = WireDecoder::new(WireFormat::PhonePage);
    let mut accept = |session, seq| {
        let decoded = decoder.accept(&page(session, seq, 1000 + seq), 0).unwrap();
        (decoded.events.len(), decoded.late.len())
    };
    assert_eq!(accept("a", 0), (1, 0));
    assert_eq!(accept("b", 0), (1, 0));
    assert_eq!(accept("a", 1), (0, 1));
    // Twice: it was taken, and comes again.
    assert_eq!(accept("a", 1), (0, 0));
    assert_eq!(accept("a", 2), (1, 0));
    assert_eq!(accept("a", 3), (1, 0));
    assert_eq!((decoder.lost(), decoder.duplicated()), (0, 1));
}

#[test]
fn a_message_of_sensor_logger_that_waits_is_taken_when_nothing_else_comes() {
    let mut decoder = WireDecoder::new(WireFormat::SensorLogger);
    let push = |id: u64| {
        format!(
            r#"{{"messageId":{id},"sessionId":"s","deviceId":"d","payload":[{{"name":"gyroscope","time":{},"values":{{"x":0,"y":0,"z":0}}}}]}}"#,
            id * 1_000_000
        )
    };
    assert_eq!(
        stamps_ms(&decoder.accept(push(0).as_bytes(), 0).unwrap()),
        [0]
    );
    assert!(
        decoder
            .accept(push(2).as_bytes(), 5)
            .unwrap()
            .events
            .is_empty()
    );
    assert_eq!(decoder.poll(PAGE_WAIT_NS), None);
    assert_eq!(stamps_ms(&decoder.poll(PAGE_WAIT_NS + 5).unwrap()), [2]);
    assert_eq!(decoder.lost(), 1);
    assert_eq!(decoder.poll(2 * PAGE_WAIT_NS + 5), None);
}

#[test]
fn what_is_refused_changes_nothing() {
    let mut decoder = WireDecoder::new(WireFormat::PhonePage);
    assert!(decoder.accept(b"{", 0).is_err());
    assert_eq!(decoder.accept(&page("a", 0, 1), 0).unwrap().events.len(), 1);
    let mut decoder = WireDecoder::new(WireFormat::Events);
    assert!(decoder.accept(b"x", 0).is_err());
    let event = Event {
        time_ns: 1,
        sample: Sample::Pressure(2.0),
    };
    let decoded = decoder.accept(&events::encode(&[event]), 0).unwrap();
    assert_eq!(decoded.events, [event]);
}

#[test]
fn every_format_has_its_name_and_takes_any_bytes() {
    for format in WireFormat::ALL {
        assert_eq!(format.name().parse(), Ok(format));
        let mut decoder = WireDecoder::new(format);
        for bytes in [&b""[..], b"{}", b"\xff\x00\n", b"1,2,3\n", b"[]"] {
            let _ = decoder.accept(bytes, i64::MAX);
            let _ = decoder.poll(i64::MIN);
        }
        decoder.finish();
    }
    assert!("telepathy".parse::<WireFormat>().is_err());
}

#[test]
fn phyphox_takes_its_configuration_from_the_same_stream() {
    let mut decoder = WireDecoder::new(WireFormat::Phyphox);
    let config = br#"{"inputs":[{"source":"gyroscope","outputs":[{"x":"a"},{"y":"b"},{"z":"c"},{"t":"d"}]}],"buffers":[]}"#;
    assert_eq!(decoder.accept(config, 0).unwrap(), Decoded::default());
    let answer = br#"{"buffer":{"a":{"buffer":[1]},"b":{"buffer":[2]},"c":{"buffer":[3]},"d":{"buffer":[0.5]}},"status":{}}"#;
    let decoded = decoder.accept(answer, 0).unwrap();
    assert_eq!(stamps_ms(&decoded), [500]);
    assert!(decoder.accept(br#"{"inputs":[]}"#, 0).is_err());
}
