//! The examples of `docs/formats.md` are read as they stand there.
#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

use northing_recording::{OpenOptions, Recording, SensorKind, manifest, read_bytes};

/// The first block of that kind in the document, after `heading`.
fn block(heading: &str, kind: &str) -> String {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/formats.md");
    let text = std::fs::read_to_string(path).unwrap();
    let section = text.split(&format!("\n## {heading}")).nth(1).unwrap();
    let block = section.split(&format!("```{kind}\n")).nth(1).unwrap();
    block.split("```").next().unwrap().to_owned()
}

fn kinds(recording: Recording) -> Vec<SensorKind> {
    recording
        .map(|event| event.unwrap().sample.kind())
        .collect()
}

#[test]
fn the_csv_example_reads() {
    let bytes = block("CSV", "csv").into_bytes();
    let recording = read_bytes(bytes, "formats.md", &OpenOptions::default()).unwrap();
    assert_eq!(recording.metadata().device.as_deref(), Some("phone"));
    assert!(recording.issues().is_empty());
    assert_eq!(kinds(recording).len(), 6);
}

#[test]
fn the_manifest_example_reads_its_data() {
    let toml = block("Any other text file", "toml");
    let data = block("Any other text file", "text").into_bytes();
    let recording =
        manifest::read_bytes(&toml, data, "formats.md", &OpenOptions::default()).unwrap();
    assert_eq!(
        kinds(recording),
        [
            SensorKind::Gyroscope,
            SensorKind::Accelerometer,
            SensorKind::Magnetometer,
            SensorKind::DeviceOrientation,
            SensorKind::Reference,
            SensorKind::Gyroscope,
        ]
    );
}

#[test]
fn the_manifests_of_targets_parse() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/formats.md");
    let text = std::fs::read_to_string(path).unwrap();
    let section = text.split("\n## Targets").nth(1).unwrap();
    let section = section.split("\n## ").next().unwrap();
    let blocks: Vec<_> = section.split("```toml\n").skip(1).collect();
    assert_eq!(blocks.len(), 2);
    for block in blocks {
        let toml = block.split("```").next().unwrap();
        northing_recording::tracking::manifest::parse(toml, "formats.md").unwrap();
    }
}

#[test]
fn the_manifest_of_several_files_is_one() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/formats.md");
    let text = std::fs::read_to_string(path).unwrap();
    let section = text
        .split("\n### Several files as one recording")
        .nth(1)
        .unwrap();
    let toml = section.split("```toml\n").nth(1).unwrap();
    let read = manifest::parse(toml.split("```").next().unwrap(), "formats.md").unwrap();
    assert_eq!(read.sources.len(), 4);
    assert_eq!(read.general.lever_arm.unwrap().frd_m.len(), 3);
}
