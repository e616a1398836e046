//! Real radar: no target lost, errors beside those of a baseline that started at the truth, and an own
//! ship whose heading is wrong.

#![allow(clippy::unwrap_used)]

use std::path::Path;

use northing_evaluation::tracking::{
    InjectionOptions, TrackOptions, TrackSummary, TrackerKind, inject_heading, run,
};
use northing_recording::test_data::data_dir;
use northing_recording::tracking::{TrackingRecording, open};

/// Scenario, and for each of its two targets the baseline's RMSE, m. A JPDA that was started at the
/// truth lost target 1 of scenario 3.
const AUTOFERRY: [(&str, [Option<f64>; 2]); 6] = [
    ("02", [Some(5.9), Some(8.3)]),
    ("03", [None, Some(11.2)]),
    ("05", [Some(11.5), Some(9.4)]),
    ("13", [Some(5.1), Some(3.8)]),
    ("16", [Some(6.7), Some(3.4)]),
    ("22", [Some(9.5), Some(9.2)]),
];

fn example(name: &str, data: &Path) -> TrackingRecording {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/recordings");
    open(&folder.join(format!("{name}.toml")), Some(data)).unwrap()
}

fn autoferry(data: &Path) -> Vec<TrackingRecording> {
    let each = AUTOFERRY.iter();
    each.map(|(scenario, _)| example(&format!("autoferry_{scenario}"), data))
        .collect()
}

fn tracked(recording: &TrackingRecording) -> TrackSummary {
    run(recording, &TrackOptions::default(), |_| {}).unwrap()
}

#[test]
fn autoferry_loses_no_target_and_stays_near_the_baseline() {
    let Some(data) = data_dir("autoferry_loses_no_target_and_stays_near_the_baseline") else {
        return;
    };
    for (recording, (_, baseline)) in autoferry(&data).iter().zip(AUTOFERRY) {
        let summary = tracked(recording);
        assert_eq!(summary.targets.len(), 2);
        assert_eq!(summary.sensors, ["radar"]);
        for (target, limit) in summary.targets.iter().zip(baseline) {
            assert!(!target.lost, "{}: {target:?}", summary.recording);
            let rmse = target.rmse_m.unwrap();
            let limit = limit.map_or(f64::INFINITY, |limit| 1.2 * limit);
            assert!(rmse <= limit, "{}: {target:?}", summary.recording);
        }
    }
}

#[test]
fn joyride_is_followed_through_its_turns() {
    let Some(data) = data_dir("joyride_is_followed_through_its_turns") else {
        return;
    };
    let summary = tracked(&example("joyride", &data));
    let target = &summary.targets[0];
    assert!(!target.lost && target.rmse_m.unwrap() < 35.0, "{target:?}");
    assert!(
        target.matched as f64 > 0.8 * target.epochs as f64,
        "{target:?}"
    );
}

#[test]
fn an_hour_of_ais_becomes_about_as_many_tracks_as_ships() {
    let Some(data) = data_dir("an_hour_of_ais_becomes_about_as_many_tracks_as_ships") else {
        return;
    };
    let summary = tracked(&example("solent_ais", &data));
    assert!(summary.targets.is_empty() && summary.gospa_m.is_none());
    assert!(summary.counts.scans > 18_000, "{:?}", summary.counts);
    assert!(
        (40..400).contains(&summary.confirmed_tracks),
        "{}",
        summary.confirmed_tracks
    );
}

#[test]
fn with_a_wrong_heading_the_schmidt_tracker_is_the_most_consistent() {
    let Some(data) = data_dir("with_a_wrong_heading_the_schmidt_tracker_is_the_most_consistent")
    else {
        return;
    };
    let options = InjectionOptions {
        heading_std_rad: 3_f64.to_radians(),
        runs: 20,
        seed: 4,
        track: TrackOptions::default(),
    };
    let recordings = autoferry(&data);
    let summary = inject_heading(&recordings, &options).unwrap();
    let off = |kind: TrackerKind| {
        let tracker = &summary.trackers[kind.name()];
        (tracker.inside_95.unwrap() - 0.95).abs()
    };
    let schmidt = off(TrackerKind::Schmidt);
    assert!(
        schmidt < off(TrackerKind::Converted),
        "{:?}",
        summary.trackers
    );
    assert!(
        schmidt < off(TrackerKind::Uncompensated),
        "{:?}",
        summary.trackers
    );
    assert_eq!(
        inject_heading(&recordings, &options).unwrap(),
        summary,
        "the same seed"
    );
}
