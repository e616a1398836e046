//! SensorServer's frames: any bytes, in pieces divided by a zero byte, are decoded or refused, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::wire::sensorserver::SensorServer;

fuzz_target!(|bytes: &[u8]| {
    let mut decoder = SensorServer::default();
    for piece in bytes.split(|byte| *byte == 0) {
        let decoded = decoder.push(piece);
        assert!(decoded.events.iter().all(|event| event.sample.is_finite()));
    }
});
