//! Tables of scans, detections and truth, divided by zero bytes: read or refused, never a panic.
#![no_main]

use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use northing_recording::tracking::{TrackingManifest, manifest, read};

static FOLDER: LazyLock<tempfile::TempDir> = LazyLock::new(|| tempfile::tempdir().unwrap());
static MANIFEST: LazyLock<TrackingManifest> = LazyLock::new(|| {
    let text = include_str!("tracking_tables.toml");
    manifest::parse(text, "fuzz.toml").unwrap()
});

fuzz_target!(|bytes: &[u8]| {
    let mut parts = bytes.splitn(3, |byte| *byte == 0);
    for (file, header) in [
        ("scans.csv", "s,t,k,n,e,h,p\n"),
        ("detections.csv", "s,r,b,n,e\n"),
        ("truth.csv", "s,k,n,e\n"),
    ] {
        let rows = parts.next().unwrap_or_default();
        let table = [header.as_bytes(), rows].concat();
        std::fs::write(FOLDER.path().join(file), table).unwrap();
    }
    if let Ok(recording) = read(&MANIFEST, "fuzz.toml", FOLDER.path()) {
        assert!(recording.events.is_sorted_by_key(|event| event.time_ns));
    }
});
