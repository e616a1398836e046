//! Parquet: any bytes are read or refused, never a panic that gets out.
#![no_main]

use std::sync::Once;

use libfuzzer_sys::fuzz_target;
use northing_recording::{Format, OpenOptions, read_bytes};

static QUIET: Once = Once::new();

fuzz_target!(|bytes: &[u8]| {
    // The fuzzer's hook aborts on every panic. The reader contains those of the Parquet decoder on
    // purpose, so only a panic that gets out of it may count; that one ends the process by itself.
    QUIET.call_once(|| std::panic::set_hook(Box::new(|_| {})));
    let options = OpenOptions {
        format: Some(Format::Parquet),
        ..OpenOptions::default()
    };
    if let Ok(recording) = read_bytes(bytes.to_vec(), "fuzz.parquet", &options) {
        recording.for_each(drop);
    }
});
