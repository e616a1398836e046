//! Bags of ROS 1: any bytes behind the magic line are read or refused, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::{Format, OpenOptions, read_bytes};

const MAGIC: &[u8] = b"#ROSBAG V2.0\n";

fuzz_target!(|bytes: &[u8]| {
    let options = OpenOptions {
        format: Some(Format::Mcap),
        ..OpenOptions::default()
    };
    for bytes in [bytes.to_vec(), [MAGIC, bytes].concat()] {
        if let Ok(recording) = read_bytes(bytes, "fuzz.bag", &options) {
            recording.for_each(drop);
        }
    }
});
