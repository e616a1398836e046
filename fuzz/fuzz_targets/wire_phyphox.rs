//! phyphox's answers: any bytes, in pieces divided by a zero byte, are decoded or refused, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::wire::phyphox::Phyphox;

fuzz_target!(|bytes: &[u8]| {
    let mut decoder = Phyphox::default();
    for piece in bytes.split(|byte| *byte == 0) {
        // An answer to /config, or to /get.
        if let Ok(configured) = Phyphox::from_config(piece) {
            decoder = configured;
        }
        let decoded = decoder.push(piece);
        assert!(decoded.events.iter().all(|event| event.sample.is_finite()));
        assert!(decoder.request_path().is_ascii());
    }
});
