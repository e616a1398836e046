//! A table of any bytes is described, and read by its draft: guessed or refused, never a panic.
#![no_main]

use libfuzzer_sys::fuzz_target;
use northing_recording::{OpenOptions, describe, manifest};

fuzz_target!(|bytes: &[u8]| {
    let folder = std::env::temp_dir().join(format!("northing-fuzz-{}", std::process::id()));
    let path = folder.join("table.csv");
    if std::fs::create_dir_all(&folder).is_err() || std::fs::write(&path, bytes).is_err() {
        return;
    }
    for rate_hz in [None, Some(100.0)] {
        let drafted = describe::draft(std::slice::from_ref(&path), &folder, rate_hz);
        if let Ok(draft) = drafted {
            let place = folder.join("draft.toml");
            let options = OpenOptions::default();
            if let Ok(recording) = manifest::open_text(&draft.manifest, &place, &options) {
                let _ = recording.map_while(Result::ok).count();
            }
        }
    }
});
