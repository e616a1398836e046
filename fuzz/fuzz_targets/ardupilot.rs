//! A log of ArduPilot of any bytes: read or refused, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::{Format, OpenOptions, read_bytes};

fuzz_target!(|bytes: &[u8]| {
    let options = OpenOptions {
        format: Some(Format::ArduPilot),
        ..OpenOptions::default()
    };
    if let Ok(recording) = read_bytes(bytes.to_vec(), "fuzz.bin", &options) {
        recording.for_each(drop);
    }
});
