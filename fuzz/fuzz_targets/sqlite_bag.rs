//! Bags of ROS 2 in SQLite: any file is read or refused, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::{OpenOptions, open};

fuzz_target!(|bytes: &[u8]| {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("fuzz.db3");
    std::fs::write(&path, bytes).expect("a temporary file");
    if let Ok(recording) = open(&path, &OpenOptions::default()) {
        recording.for_each(drop);
    }
});
