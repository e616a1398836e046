//! A file of the x-IMU3's data logger, or a table of its software, of any bytes: read or counted, never a panic, and what is delivered
//! is finite.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::{Format, OpenOptions, read_bytes};

const TABLE: &[u8] = b"Timestamp (us),Gyroscope X (deg/s),Gyroscope Y (deg/s),Gyroscope Z (deg/s)\n";

fuzz_target!(|bytes: &[u8]| {
    let options = OpenOptions {
        format: Some(Format::XImu3),
        ..OpenOptions::default()
    };
    if let Ok(recording) = read_bytes(bytes.to_vec(), "fuzz.ximu3", &options) {
        for event in recording.map_while(Result::ok) {
            assert!(event.sample.is_finite());
        }
    }
    let table = [TABLE, bytes].concat();
    if let Ok(recording) = read_bytes(table, "fuzz.csv", &options) {
        recording.for_each(drop);
    }
});
