//! The Parquet reader and the plausibility checks on the real attitude data sets.
#![cfg(feature = "parquet")]

use crate::support;

use std::time::Instant;

use northing_recording::{
    Metadata, OpenOptions, Recording, RecordingError, Sample, SensorKind, WorldFrame, open,
};
use support::attitude_files;

#[test]
fn every_file_reads_in_time_order_without_a_false_alarm() {
    let Some(files) = attitude_files("every_file_reads_in_time_order_without_a_false_alarm") else {
        return;
    };
    for path in files {
        let mut recording = open(&path, &OpenOptions::default()).unwrap();
        assert_eq!(recording.metadata().world_frame, WorldFrame::Enu);
        assert_eq!(recording.metadata().format, "parquet");
        let mut last = (i64::MIN, 0);
        let mut counts = [0_u64; SensorKind::ALL.len()];
        for event in &mut recording {
            let event = event.unwrap_or_else(|error| panic!("{error}"));
            let place = (event.time_ns, event.sample.kind().order());
            assert!(place > last, "{}: {place:?} after {last:?}", path.display());
            last = place;
            counts[place.1] += 1;
        }
        let issues = recording.issues();
        assert!(
            issues.stamps_going_back.is_empty(),
            "{}: {issues:?}",
            path.display()
        );
        assert!(
            issues.duplicate_stamps.is_empty(),
            "{}: {issues:?}",
            path.display()
        );
        assert!(
            counts[SensorKind::Gyroscope.order()] > 500,
            "{}",
            path.display()
        );
        assert!(
            counts[SensorKind::Accelerometer.order()] > 500,
            "{}",
            path.display()
        );
    }
}

#[test]
fn metadata_of_a_phone_recording() {
    let Some(files) = attitude_files("metadata_of_a_phone_recording") else {
        return;
    };
    let path = files
        .iter()
        .find(|p| p.to_string_lossy().contains("Guillaume_Nexus5_NoDist_AR"))
        .unwrap();
    let mut recording = open(path, &OpenOptions::default()).unwrap();
    assert_eq!(recording.metadata().name, "Guillaume_Nexus5_NoDist_AR");
    assert_eq!(recording.metadata().device.as_deref(), Some("Nexus5"));
    assert_eq!(recording.metadata().extra["declination_deg"], "1.473");
    assert!(!recording.metadata().extra.contains_key("ARROW:schema"));
    let started = Instant::now();
    let events = recording.by_ref().filter(|event| event.is_ok()).count();
    // The timing is for people (the number stands in the report of the change); the count is the test.
    println!("{events} events in {:?}", started.elapsed());
    assert!(events > 60_000);
}

type Alter = fn(&mut Sample);

/// The recording's events with one kind of sample changed.
fn altered(path: &std::path::Path, alter: Alter) -> Recording {
    let original = open(path, &OpenOptions::default()).expect("a data file opens");
    let metadata = Metadata {
        name: path.display().to_string(),
        ..original.metadata().clone()
    };
    let events = original.map(move |event| {
        event.map(|mut event| {
            alter(&mut event.sample);
            event
        })
    });
    Recording::from_events(metadata, &SensorKind::ALL, events, &OpenOptions::default())
}

fn first_error(mut recording: Recording) -> Option<RecordingError> {
    recording.find_map(Result::err)
}

#[test]
fn degrees_are_detected_wherever_the_phone_is_moved() {
    let Some(files) = attitude_files("degrees_are_detected_wherever_the_phone_is_moved") else {
        return;
    };
    let mut missed = Vec::new();
    for path in &files {
        let error = first_error(altered(path, |sample| {
            if let Sample::AngularRate(rate) = sample {
                *rate *= 180.0 / std::f64::consts::PI;
            }
        }));
        match error {
            Some(RecordingError::ImplausibleUnit {
                sensor: "gyroscope",
                hint,
                ..
            }) => {
                assert!(hint.contains("--gyroscope-unit deg-per-s"));
            }
            Some(other) => panic!("{other}"),
            None => missed.push(path.file_stem().unwrap().to_string_lossy().into_owned()),
        }
    }
    println!("{} files, missed: {missed:?}", files.len());
    // A resting sensor fits both units: only the calibrations at rest may pass.
    assert!(
        missed.iter().all(|name| name.starts_with("calib_gyr")),
        "{missed:?}"
    );
}

#[test]
fn g_and_gauss_and_tesla_are_detected_everywhere() {
    let Some(files) = attitude_files("g_and_gauss_and_tesla_are_detected_everywhere") else {
        return;
    };
    let cases: [(Alter, &str); 3] = [
        (
            |sample| {
                if let Sample::SpecificForce(f) = sample {
                    *f /= 9.80665;
                }
            },
            "--accelerometer-unit g",
        ),
        (
            |sample| {
                if let Sample::MagneticField(m) = sample {
                    *m /= 100.0;
                }
            },
            "--magnetometer-unit gauss",
        ),
        (
            |sample| {
                if let Sample::MagneticField(m) = sample {
                    *m *= 1e-6;
                }
            },
            "--magnetometer-unit tesla",
        ),
    ];
    for path in files.iter().step_by(3) {
        for (alter, expected) in cases {
            match first_error(altered(path, alter)) {
                Some(RecordingError::ImplausibleUnit { hint, .. }) => {
                    assert!(hint.contains(expected), "{}: {hint}", path.display());
                }
                other => panic!("{}: {expected}: {other:?}", path.display()),
            }
        }
    }
}
