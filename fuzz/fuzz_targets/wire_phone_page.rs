//! The phone page's batches: any bytes, in pieces divided by a zero byte, are decoded or refused, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::wire::phone_page::PhonePage;

fuzz_target!(|bytes: &[u8]| {
    let mut decoder = PhonePage::default();
    for piece in bytes.split(|byte| *byte == 0) {
        let decoded = decoder.push(piece);
        assert!(decoded.events.iter().all(|event| event.sample.is_finite()));
    }
});
