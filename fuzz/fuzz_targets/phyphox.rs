//! A table of phyphox, as it is and behind a header: any bytes are read or refused, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::{Format, OpenOptions, read_bytes};

const HEADER: &[u8] =
    b"\"Time (s)\";\"Gyroscope x (rad/s)\";\"Gyroscope y (rad/s)\";\"Gyroscope z (rad/s)\"\n";

fuzz_target!(|bytes: &[u8]| {
    let options = OpenOptions {
        format: Some(Format::Phyphox),
        ..OpenOptions::default()
    };
    for bytes in [bytes.to_vec(), [HEADER, bytes].concat()] {
        if let Ok(recording) = read_bytes(bytes, "fuzz.csv", &options) {
            recording.for_each(drop);
        }
    }
});
