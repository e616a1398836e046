//! A table of numbers of any bytes, as KF-GINS would have it: told, read or refused, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::{Format, OpenOptions, read_bytes};

fuzz_target!(|bytes: &[u8]| {
    for format in [None, Some(Format::KfGins)] {
        let options = OpenOptions {
            format,
            ..OpenOptions::default()
        };
        if let Ok(recording) = read_bytes(bytes.to_vec(), "fuzz.txt", &options) {
            let _ = recording.map_while(Result::ok).count();
        }
    }
});
