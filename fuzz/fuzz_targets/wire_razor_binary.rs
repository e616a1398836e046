//! A Razor board's binary frames: any bytes, cut anywhere, are decoded or skipped, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::wire::razor::{Razor, RazorConfig, RazorOutput};

fuzz_target!(|bytes: &[u8]| {
    let config = RazorConfig {
        output: RazorOutput::BinarySensors,
        ..RazorConfig::default()
    };
    let cut = usize::from(bytes.first().copied().unwrap_or(1)).max(1);
    let mut decoder = Razor::new(config);
    for piece in bytes.chunks(cut) {
        let decoded = decoder.push(piece);
        assert!(decoded.events.iter().all(|event| event.sample.is_finite()));
    }
});
