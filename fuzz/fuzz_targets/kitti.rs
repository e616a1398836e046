//! A folder of KITTI whose files hold any bytes: read or refused, never a panic. A byte 0 ends a file; the first is that of
//! the stamps.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::{OpenOptions, open};

fuzz_target!(|bytes: &[u8]| {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let root = folder.path().join("oxts");
    std::fs::create_dir_all(root.join("data")).expect("a temporary folder");
    let mut files = bytes.split(|byte| *byte == 0);
    let stamps = files.next().unwrap_or_default();
    std::fs::write(root.join("timestamps.txt"), stamps).expect("a temporary file");
    for (number, content) in files.take(8).enumerate() {
        let path = root.join("data").join(format!("{number:010}.txt"));
        std::fs::write(path, content).expect("a temporary file");
    }
    if let Ok(recording) = open(folder.path(), &OpenOptions::default()) {
        recording.map_while(Result::ok).for_each(drop);
    }
});
