//! A log of VectorNav's lines of any bytes: read or counted, never a panic, and what is delivered is finite.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::{Format, OpenOptions, read_bytes};

fuzz_target!(|bytes: &[u8]| {
    let options = OpenOptions {
        format: Some(Format::VectorNav),
        ..OpenOptions::default()
    };
    if let Ok(recording) = read_bytes(bytes.to_vec(), "fuzz.log", &options) {
        for event in recording.map_while(Result::ok) {
            assert!(event.sample.is_finite());
        }
    }
});
