//! The tracker has no length of its own: a harbour shrunk to a pavement or stretched to a coast, with the sensor to match, gives the same
//! tracks and the same scores with the default settings.

#![allow(clippy::unwrap_used)]

use northing_evaluation::tracking::{TrackOptions, TrackSummary, TrackerKind, run};
use northing_recording::tracking::{
    Detection, OwnShipPose, Scan, SensorSettings, TargetTruth, TrackingEvent, TrackingIssues,
    TrackingRecording, TrackingSample,
};
use northing_simulation::random::{standard_normal, stream};

/// Boats: place (m), velocity (m/s), and the rate of turn (rad/s) in the second third of the run.
const BOATS: [([f64; 2], [f64; 2], f64); 5] = [
    ([400.0, -150.0], [-3.0, 2.0], 0.0),
    ([250.0, 250.0], [1.0, -4.0], 0.05),
    ([-300.0, 100.0], [6.0, 1.0], -0.03),
    ([-260.0, 60.0], [5.5, 2.0], 0.0),
    ([100.0, -350.0], [0.0, 0.0], 0.0),
];
/// Scans, and the seconds between two.
const SCANS: u32 = 120;
const INTERVAL_S: f64 = 2.0;

/// The harbour, its lengths multiplied by `stretch` and its times by the root of it.
fn harbour(stretch: f64, seed: u64) -> TrackingRecording {
    let mut noise = stream(seed, "scale");
    let mut draw = || standard_normal(&mut noise);
    let root = stretch.sqrt();
    let mut boats = BOATS.map(|(place, velocity, _)| (place, velocity));
    let mut events = Vec::new();
    for k in 0..SCANS {
        let time_ns = (f64::from(k) * INTERVAL_S * root * 1e9).round() as i64;
        let mut put = |sample| events.push(TrackingEvent { time_ns, sample });
        let own = [1.5 * f64::from(k), 0.0];
        put(TrackingSample::OwnShip(OwnShipPose {
            north_m: own[0] * stretch,
            east_m: own[1] * stretch,
            heading_rad: 0.3,
            std: None,
        }));
        let mut detections = Vec::new();
        for (place, _) in &boats {
            let (north, east) = (place[0] - own[0], place[1] - own[1]);
            let range = north.hypot(east) + 5.0 * draw();
            let bearing_rad = east.atan2(north) - 0.3 + 0.01 * draw();
            if draw() < 1.2 {
                detections.push(Detection::RangeBearing {
                    range_m: range.abs() * stretch,
                    bearing_rad,
                });
            }
        }
        for _ in 0..6 {
            detections.push(Detection::RangeBearing {
                range_m: (350.0 + 120.0 * draw()).abs().max(1.0) * stretch,
                bearing_rad: 3.0 * draw(),
            });
        }
        let id = i64::from(k);
        put(TrackingSample::Scan(Scan {
            id,
            sensor: 0,
            detections,
        }));
        for (target, (place, _)) in (1..).zip(&boats) {
            put(TrackingSample::Truth(TargetTruth {
                scan: id,
                target,
                north_m: place[0] * stretch,
                east_m: place[1] * stretch,
            }));
        }
        let turning = (SCANS / 3..2 * SCANS / 3).contains(&k);
        for ((place, velocity), (_, _, rate)) in boats.iter_mut().zip(&BOATS) {
            if turning {
                let (sin, cos) = (rate * INTERVAL_S).sin_cos();
                let [north, east] = *velocity;
                *velocity = [north * cos - east * sin, north * sin + east * cos];
            }
            for axis in 0..2 {
                place[axis] += velocity[axis] * INTERVAL_S;
            }
        }
    }
    let radar = SensorSettings {
        range_std_m: 5.0 * stretch,
        bearing_std_deg: 0.6,
        extent_std_m: 1.0 * stretch,
        detection_probability: 0.88,
        clutter_per_km2: Some(5.0 / (stretch * stretch)),
        clutter_per_rad: None,
        largest_range_m: 1000.0 * stretch,
        covers_all: true,
        initiates: true,
        used: true,
    };
    TrackingRecording {
        plane: None,
        name: "harbour".to_owned(),
        sensors: vec![("radar".to_owned(), radar)],
        events,
        truth_std_m: 0.5 * stretch,
        issues: TrackingIssues::default(),
    }
}

/// What does not depend on the scale.
fn scores(summary: &TrackSummary, stretch: f64) -> Vec<(String, f64)> {
    let mut scores = vec![
        ("cut-off".to_owned(), summary.cutoff_m.unwrap() / stretch),
        ("GOSPA".to_owned(), summary.gospa_m.unwrap() / stretch),
        ("OSPA".to_owned(), summary.ospa_m.unwrap() / stretch),
        ("confirmed".to_owned(), summary.confirmed_tracks as f64),
        ("false".to_owned(), summary.false_tracks as f64),
    ];
    for target in &summary.targets {
        let mut put = |name: &str, value: f64| {
            scores.push((format!("{name} of target {}", target.target), value));
        };
        put("RMSE", target.rmse_m.unwrap() / stretch);
        put("coverage", target.coverage);
        put("continuity", target.continuity);
        put("switches", target.switches as f64);
        put("ANEES", target.anees.unwrap());
        put("time to", target.found_after_s.unwrap() / stretch.sqrt());
    }
    scores
}

#[test]
fn a_scene_shrunk_or_stretched_gives_the_same_scores() {
    for tracker in [TrackerKind::Schmidt, TrackerKind::Converted] {
        let options = TrackOptions {
            tracker,
            ..TrackOptions::default()
        };
        let of = |stretch: f64| {
            let summary = run(&harbour(stretch, 21), &options, |_| {}).unwrap();
            assert_eq!(
                summary.counts.scans,
                u64::from(SCANS),
                "stretched {stretch}"
            );
            scores(&summary, stretch)
        };
        let usual = of(1.0);
        let coverage = usual
            .iter()
            .filter(|(name, _)| name.starts_with("coverage"));
        assert!(
            coverage.clone().all(|(_, share)| *share > 0.6),
            "targets that are followed, or the test shows nothing: {usual:?}"
        );
        for stretch in [1.0 / 40.0, 0.2, 7.0, 40.0] {
            for ((name, one), (_, other)) in usual.iter().zip(of(stretch)) {
                let off = (one - other).abs() / one.abs().max(1e-9);
                assert!(off < 0.05, "{name}, stretched {stretch}: {one} {other}");
            }
        }
    }
}

#[test]
fn what_follows_from_the_sensor_is_said_and_what_was_asked_for_stays() {
    use northing_evaluation::Origin;
    let mut options = TrackOptions::default();
    options
        .set_from("birth_speed_std_m_s=3", Origin::Set)
        .unwrap();
    options.cutoff_m = Some(12.5);
    let summary = run(&harbour(7.0, 21), &options, |_| {}).unwrap();
    let row = |name: &str| {
        let mut rows = summary.parameters.iter();
        let row = rows.find(|row| row.name == name).unwrap();
        (row.value_text(), row.origin)
    };
    assert_eq!(row("birth_speed_std_m_s"), ("3.0".to_owned(), Origin::Set));
    assert_eq!(row("existence.hidden_s").1, Origin::Learnt);
    assert_eq!(row("gate_sigmas").1, Origin::Default);
    assert_eq!(summary.cutoff_m, Some(12.5));
}
