//! A manifest and its data, divided by a zero byte: read or refused, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::{OpenOptions, manifest};

fuzz_target!(|bytes: &[u8]| {
    let mut parts = bytes.splitn(2, |byte| *byte == 0);
    let text = String::from_utf8_lossy(parts.next().unwrap_or_default());
    let data = parts.next().unwrap_or_default().to_vec();
    if let Ok(recording) = manifest::read_bytes(&text, data, "fuzz.txt", &OpenOptions::default()) {
        recording.for_each(drop);
    }
});
