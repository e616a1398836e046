//! The decoder for all wire formats: the first byte chooses the format, the rest are payloads divided by a byte that
//! says how much later the next one arrives. Never a panic, and only finite numbers come out of the readings.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::wire::{WireDecoder, WireFormat};

fuzz_target!(|bytes: &[u8]| {
    let Some((first, rest)) = bytes.split_first() else {
        return;
    };
    let format = WireFormat::ALL[usize::from(*first) % WireFormat::ALL.len()];
    let mut decoder = WireDecoder::new(format);
    let mut arrival_ns = 0_i64;
    for payload in rest.split_inclusive(|byte| *byte >= 0xf8) {
        let (payload, later) = match payload.split_last() {
            Some((last, payload)) if *last >= 0xf8 => (payload, i64::from(last - 0xf7)),
            _ => (payload, 0),
        };
        let decoded = decoder.accept(payload, arrival_ns).unwrap_or_default();
        // Our own events are passed on as they were, bad numbers included.
        let finite = decoded.events.iter().all(|event| event.sample.is_finite());
        assert!(finite || format == WireFormat::Events);
        arrival_ns = arrival_ns.saturating_add(later * 1_000_000_000);
        decoder.poll(arrival_ns);
    }
    decoder.finish();
});
