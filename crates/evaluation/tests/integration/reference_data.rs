//! References of real recordings: none is refused, and their clocks are those of the sensors to milliseconds.

#![allow(clippy::unwrap_used, clippy::print_stdout)]

use northing_evaluation::attitude::reference::fit;
use northing_recording::test_data::data_dir;
use northing_recording::{OpenOptions, open};
use rayon::prelude::*;

/// The optical reference of BROAD leads its inertial unit by 4.1 ms in all recordings, little more than a sample; those of the
/// phones were put on the phones' clock by their authors.
#[test]
fn good_references_are_not_refused_and_their_offset_is_small() {
    let Some(data) = data_dir("references of attitude recordings") else {
        return;
    };
    for (folder, middle_s, reach_s, misaligned_deg) in [
        ("broad", 0.004_13, 0.000_15, 1.6),
        ("smartphone", 0.0, 0.002_5, 3.0),
    ] {
        let paths: Vec<_> = std::fs::read_dir(data.join("attitude").join(folder))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| {
                let name = path.file_name().unwrap().to_string_lossy().into_owned();
                name.ends_with(".parquet") && !name.starts_with("calib_")
            })
            .collect();
        assert!(paths.len() >= 14, "{folder}: {}", paths.len());
        paths.par_iter().for_each(|path| {
            let recording = open(path, &OpenOptions::default()).unwrap();
            let found = fit(recording).unwrap();
            let name = path.display();
            println!("{name}: {}", found.in_words());
            assert!(
                (found.clock_offset_s - middle_s).abs() < reach_s,
                "{name}: {found:?}"
            );
            assert!(
                found.misalignment_angle_deg() < misaligned_deg,
                "{name}: {found:?}"
            );
            assert!(found.correlation > 0.97, "{name}: {found:?}");
        });
    }
}
