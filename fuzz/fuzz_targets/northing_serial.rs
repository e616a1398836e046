//! What a board with our firmware prints, of any bytes: read or counted, never a panic; what is delivered is finite,
//! and the same however the bytes are cut.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::wire::northing_serial::{Axes, NorthingSerial};
use northing_recording::{Format, OpenOptions, read_bytes};

fuzz_target!(|bytes: &[u8]| {
    let options = OpenOptions {
        format: Some(Format::NorthingSerial),
        ..OpenOptions::default()
    };
    if let Ok(recording) = read_bytes(bytes.to_vec(), "fuzz.txt", &options) {
        for event in recording.map_while(Result::ok) {
            assert!(event.sample.is_finite());
        }
    }
    let whole = NorthingSerial::new(Axes::Phone).push(bytes).events;
    let mut cut = NorthingSerial::new(Axes::Phone);
    let (first, second) = bytes.split_at(bytes.len() / 2);
    let mut pieces = cut.push(first).events;
    pieces.extend(cut.push(second).events);
    assert_eq!(whole, pieces);
});
