//! Tracking recordings: tables through a manifest, and what is said when they are wrong.

#![allow(clippy::unwrap_used)]

mod plausibility;

use std::path::{Path, PathBuf};

use northing_recording::test_data::data_dir;
use northing_recording::tracking::{Detection, TrackingRecording, TrackingSample, manifest, open};

const MANIFEST: &str = r#"
name = "harbour"
[scans]
file = "scans.csv"
scan = "scan"
time_s = "t"
sensor = "sensor"
own_north_m = "n"
own_east_m = "e"
own_heading_deg = "heading"
own_heading_std_deg = "heading_std"
[detections]
file = "detections.csv"
scan = "scan"
range_m_bearing_rad = ["range", "bearing"]
relative_north_east_m = ["rn", "re"]
bearing_rad = "bearing"
[truth]
file = "truth.csv"
scan = "scan"
target = "target"
north_m = "n"
east_m = "e"
[sensors.radar]
range_std_m = 5.0
bearing_std_deg = 2.0
detection_probability = 0.9
clutter_per_km2 = 10.0
"#;

const SCANS: &str = "scan,t,sensor,n,e,heading,heading_std\n1,10.5,radar,1,2,90,3\n2,12,radar,1,2,90,3\n3,12.1,sonar,1,2,90,3\n";
const DETECTIONS: &str =
    "scan,range,bearing,rn,re\n1,100,0.5,,\n1,,,30,40\n2,,,,\n3,5,0,,\n9,5,0,,\n";
const TRUTH: &str = "scan,target,n,e\n1,1,50,60\n2,1,51,61\n";

/// A folder with the four files, some of them replaced.
fn folder(replaced: &[(&str, &str)]) -> (tempfile::TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let files = [
        ("m.toml", MANIFEST),
        ("scans.csv", SCANS),
        ("detections.csv", DETECTIONS),
        ("truth.csv", TRUTH),
    ];
    for (name, text) in files.iter().chain(replaced) {
        std::fs::write(folder.path().join(name), text).unwrap();
    }
    let manifest = folder.path().join("m.toml");
    (folder, manifest)
}

#[test]
fn scans_detections_and_truth_come_in_time_order() {
    let (_folder, manifest) = folder(&[]);
    let recording = open(&manifest, None).unwrap();
    let kinds: Vec<_> = recording
        .events
        .iter()
        .map(|event| match &event.sample {
            TrackingSample::OwnShip(_) => "pose",
            TrackingSample::Scan(_) => "scan",
            TrackingSample::Truth(_) => "truth",
            _ => "other",
        })
        .collect();
    let expected = ["pose", "scan", "truth", "pose", "scan", "truth", "pose"];
    assert_eq!(kinds, expected);
    assert_eq!(recording.events[0].time_ns, 10_500_000_000);
    let TrackingSample::OwnShip(pose) = &recording.events[0].sample else {
        panic!("{:?}", recording.events[0])
    };
    assert!((pose.heading_rad - 90_f64.to_radians()).abs() < 1e-12);
    assert_eq!(pose.std, Some([0.0, 0.0, 3_f64.to_radians()]));
    let TrackingSample::Scan(scan) = &recording.events[1].sample else {
        panic!("{:?}", recording.events[1])
    };
    let expected = [
        Detection::RangeBearing {
            range_m: 100.0,
            bearing_rad: 0.5,
        },
        Detection::Relative {
            north_m: 30.0,
            east_m: 40.0,
        },
    ];
    assert_eq!(scan.detections, expected);
    let issues = recording.issues;
    assert_eq!(
        (issues.rows_without_scan, issues.scans_of_unknown_sensors),
        (1, 1)
    );
}

#[test]
fn files_are_found_in_the_folder_that_is_named() {
    let (tables, _) = folder(&[]);
    let elsewhere = tempfile::tempdir().unwrap();
    let manifest = elsewhere.path().join("m.toml");
    std::fs::write(&manifest, MANIFEST).unwrap();
    assert!(open(&manifest, None).is_err());
    assert_eq!(
        open(&manifest, Some(tables.path())).unwrap().events.len(),
        7
    );
}

#[test]
fn wrong_tables_are_refused_with_file_line_and_column() {
    let cases = [
        (
            "scans.csv",
            "scan,t,sensor,n,e,heading,heading_std\n1,soon,radar,1,2,90,3\n",
            "scans.csv, line 2, column `t`: `soon` is not a time in seconds",
        ),
        (
            "scans.csv",
            "scan,t,sensor,n,heading,heading_std\n",
            "scans.csv: missing column `e`; the file has heading, heading_std, n, scan, sensor, t",
        ),
        (
            "scans.csv",
            "scan,t,sensor,n,e,heading,heading_std\n1,1,radar,x,2,90,3\n",
            "scans.csv, line 2, column `n`: `x` is not a number",
        ),
        (
            "scans.csv",
            "scan,t,sensor,n,e,heading,heading_std\n1,1,radar,1,2,90,3\n1,2,radar,1,2,90,3\n",
            "line 3, column `scan`: `1` is not a scan number that stands once",
        ),
        (
            "scans.csv",
            "scan,t,sensor,n,e,heading,heading_std\n1,1,sonar,1,2,90,3\n",
            "no scan is of a sensor in [sensors]",
        ),
        (
            "scans.csv",
            "scan,t,sensor,n,e,e,heading_std\n",
            "column `e` is there twice",
        ),
        (
            "scans.csv",
            "scan,t,sensor,n,e,heading,heading_std\n",
            "empty",
        ),
        (
            "detections.csv",
            "scan,range,bearing,rn,re\none,1,2,,\n",
            "detections.csv, line 2, column `scan`: `one` is not a whole number",
        ),
        (
            "truth.csv",
            "scan,target,n,e\n1,-1,0,0\n",
            "`-1` is not a whole number",
        ),
        ("truth.csv", "scan,target,n,e\n1,1\n", "truth.csv, line 2"),
    ];
    for (file, text, expected) in cases {
        let (_folder, manifest) = folder(&[(file, text)]);
        let message = open(&manifest, None).unwrap_err().to_string();
        assert!(message.contains(expected), "{message}\n{expected}");
        assert_eq!(message.lines().count(), 1, "{message}");
    }
}

#[test]
fn wrong_manifests_are_refused_with_the_line() {
    let replace = |from: &str, to: &str| MANIFEST.replacen(from, to, 1);
    let cases = [
        (
            replace("time_s", "time_ms"),
            "line 6: unknown field `time_ms`",
        ),
        (
            replace("detection_probability = 0.9", "detection_probability = 1.5"),
            "[sensors.radar] detection_probability = 1.5: must lie between 0 and 1; for a sensor that misses next to nothing write 0.99",
        ),
        (
            replace("range_std_m = 5.0", "range_std_m = -5.0"),
            "range_std_m = -5: a standard deviation",
        ),
        (replace("bearing_std_deg = 2.0", ""), "has no noise"),
        (
            replace("clutter_per_km2 = 10.0", ""),
            "needs one of clutter_per_km2 and clutter_per_rad",
        ),
        (
            replace("clutter_per_km2 = 10.0", "clutter_per_km2 = 0.0"),
            "must be above 0; for a sensor with next to no false detections write a small number, such as 0.01",
        ),
        ("name = 'x'".to_owned(), "neither [scans] nor [ais]"),
        (
            "name = 'x'\n[ais]\nfile = 'a'".to_owned(),
            "[ais] needs [sensors.ais]",
        ),
        (
            replace("sensor = \"sensor\"\n", "").replace("[sensors.radar]", "[sensors.ais]"),
            "[scans] names no `sensor` column",
        ),
    ];
    for (text, expected) in cases {
        let message = manifest::parse(&text, "m.toml").unwrap_err().to_string();
        assert!(message.starts_with("m.toml: "), "{message}");
        assert!(message.contains(expected), "{message}\n{expected}");
        assert_eq!(message.lines().count(), 1, "{message}");
    }
}

/// Every manifest of targets among the repository's examples; those of navigation have sources.
fn examples() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/recordings");
    let entries = std::fs::read_dir(folder).unwrap();
    let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    files.retain(|file| file.extension().is_some_and(|e| e == "toml"));
    files.retain(|file| {
        !std::fs::read_to_string(file)
            .unwrap()
            .contains("[[source]]")
    });
    files
}

#[test]
fn the_examples_are_manifests() {
    let files = examples();
    assert!(files.len() >= 8, "{files:?}");
    for file in files {
        let text = std::fs::read_to_string(&file).unwrap();
        manifest::parse(&text, &file.display().to_string()).unwrap();
    }
}

#[test]
fn the_examples_read_their_data() {
    let Some(data) = data_dir("the_examples_read_their_data") else {
        return;
    };
    for file in examples() {
        let recording: TrackingRecording = open(&file, Some(&data)).unwrap();
        assert!(recording.events.len() > 400, "{}", file.display());
        assert_eq!(recording.issues.rows_without_scan, 0, "{}", file.display());
        let stamps: Vec<_> = recording.events.iter().map(|event| event.time_ns).collect();
        assert!(stamps.is_sorted());
    }
}
