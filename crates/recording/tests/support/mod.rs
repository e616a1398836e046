//! What the tests share: the real data sets, if there, and small helpers.
#![allow(dead_code)] // every test file uses its own part

use std::path::PathBuf;

use proptest::test_runner::{Config as ProptestConfig, RngSeed};

use northing_recording::{Event, OpenOptions, Recording, RecordingError, test_data};

/// The Parquet files of the attitude data sets, or `None` (said aloud) without them.
pub(crate) fn attitude_files(test: &str) -> Option<Vec<PathBuf>> {
    let data = test_data::data_dir(test)?.join("attitude");
    let mut files: Vec<PathBuf> = ["broad", "smartphone"]
        .iter()
        .flat_map(|set| std::fs::read_dir(data.join(set)).expect("NORTHING_DATA/attitude/SET"))
        .map(|entry| entry.expect("a readable folder").path())
        .filter(|path| path.extension().is_some_and(|e| e == "parquet"))
        .collect();
    files.sort();
    assert!(files.len() >= 10, "only {} Parquet files", files.len());
    Some(files)
}

/// A configuration of property tests whose cases are the same on every run.
pub(crate) fn arbitrary_cases(cases: u32, seed: u64) -> ProptestConfig {
    ProptestConfig {
        cases,
        rng_seed: RngSeed::Fixed(seed),
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

/// Reads our CSV from memory.
pub(crate) fn csv(text: &str) -> Result<Recording, RecordingError> {
    northing_recording::read_bytes(
        text.as_bytes().to_vec(),
        "test.csv",
        &OpenOptions::default(),
    )
}

/// All events, or the first error.
pub(crate) fn events(recording: &mut Recording) -> Result<Vec<Event>, RecordingError> {
    recording.collect()
}

/// The error of opening or reading to the end.
pub(crate) fn error_of(recording: Result<Recording, RecordingError>) -> String {
    match recording.and_then(|mut recording| events(&mut recording)) {
        Ok(_) => panic!("no error"),
        Err(error) => error.to_string(),
    }
}
