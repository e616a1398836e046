//! Sessions of the lab and hand-ins of the course with any content: read or refused, never a panic. A byte 0 ends a part.
#![no_main]

use std::io::{Cursor, Write};

use libfuzzer_sys::fuzz_target;
use northing_recording::{OpenOptions, read_bytes};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

fn zipped(parts: &[(&str, &[u8])]) -> Vec<u8> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, content) in parts {
        archive
            .start_file(*name, SimpleFileOptions::default())
            .expect("a part");
        archive.write_all(content).expect("its bytes");
    }
    archive.finish().expect("a zip").into_inner()
}

fn read(parts: &[(&str, &[u8])]) {
    for device in [None, Some("a".to_owned())] {
        let options = OpenOptions {
            device,
            ..OpenOptions::default()
        };
        if let Ok(recording) = read_bytes(zipped(parts), "fuzz.zip", &options) {
            recording.map_while(Result::ok).for_each(drop);
        }
    }
}

fuzz_target!(|bytes: &[u8]| {
    let mut parts = bytes.splitn(3, |byte| *byte == 0);
    let mut next = || parts.next().unwrap_or_default();
    let (table, experiment, samples) = (next(), next(), next());
    let own =
        br#"{"format":"northing-session","experiments":[{"id":"1","name":"a","device":"b"}]}"#;
    for table in [table, own] {
        read(&[
            ("session.json", table),
            ("experiments/1/experiment.json", experiment),
            ("experiments/1/samples.bin", samples),
        ]);
    }
    read(&[("hand_in.json", experiment), ("samples.bin", samples)]);
});
