//! How long a scan takes with many targets: targets spread over the range of a radar, each detected nine times of ten, in clutter.
//!
//! `cargo run --release -p northing-experiments --example tracking_crowd -- TARGETS DETECTIONS SCANS`, by default 1000 targets, 5000
//! detections a scan, 24 scans of 2.5 s. What has a `=` is a parameter of the tracker: `birth_speed_tail=1`.

#![allow(clippy::print_stdout)] // a table is its output

use std::error::Error;
use std::time::Instant;

use northing_evaluation::Origin;
use northing_evaluation::tracking::{TrackEpoch, TrackOptions, run};
use northing_recording::tracking::{
    Detection, OwnShipPose, Scan, SensorSettings, TrackingEvent, TrackingIssues, TrackingRecording,
    TrackingSample,
};
use northing_simulation::random::stream;
use rand::RngExt as _;

const INTERVAL_S: f64 = 2.5;
const RANGE_M: f64 = 20_000.0;
const RANGE_STD_M: f64 = 15.0;
const BEARING_STD_RAD: f64 = 0.0035;
const DETECTION_PROBABILITY: f64 = 0.9;

/// Place (m) and velocity (m/s) of a target.
type Target = ([f64; 2], [f64; 2]);

fn main() -> Result<(), Box<dyn Error>> {
    let mut counts = [1000, 5000, 24];
    let arguments = std::env::args().skip(1);
    let (settings, numbers): (Vec<_>, Vec<_>) = arguments.partition(|text| text.contains('='));
    for (count, text) in counts.iter_mut().zip(numbers) {
        *count = text.parse()?;
    }
    let mut options = TrackOptions::default();
    for setting in settings {
        options.set_from(&setting, Origin::Set)?;
    }
    let [targets, detections, scans] = counts;
    let (recording, ends) = crowd(targets, detections, scans);
    let mut last: Option<TrackEpoch> = None;
    let (mut slowest, mut before) = (0.0_f64, Instant::now());
    let summary = run(&recording, &options, |epoch| {
        slowest = slowest.max(before.elapsed().as_secs_f64());
        before = Instant::now();
        last = Some(epoch);
    })?;
    let tracks = last.map(|epoch| epoch.tracks).unwrap_or_default();
    let near = |target: &&Target| {
        let [north, east] = target.0;
        let limit = 4.0 * (RANGE_STD_M + BEARING_STD_RAD * north.hypot(east));
        tracks
            .iter()
            .any(|t| (t.place[0] - north).hypot(t.place[1] - east) < limit)
    };
    let followed = ends.iter().filter(near).count();
    println!("targets  detections a scan  s a scan  slowest  followed  tracks  without room");
    println!(
        "{targets:7}  {detections:17}  {:8.3}  {slowest:7.3}  {followed:8}  {:6}  {:12}",
        summary.elapsed_s / f64::from(scans),
        tracks.len(),
        summary.counts.beyond_capacity,
    );
    Ok(())
}

/// The recording, and where the targets are at its last scan.
fn crowd(targets: u32, detections: u32, scans: u32) -> (TrackingRecording, Vec<Target>) {
    let mut rng = stream(1, "crowd");
    let mut place = || loop {
        let at: [f64; 2] = std::array::from_fn(|_| rng.random_range(-RANGE_M..RANGE_M));
        if (200.0..RANGE_M).contains(&at[0].hypot(at[1])) {
            return at;
        }
    };
    let mut fleet: Vec<Target> = (0..targets).map(|_| (place(), [0.0; 2])).collect();
    let mut rng = stream(2, "crowd");
    for (_, velocity) in &mut fleet {
        *velocity = std::array::from_fn(|_| rng.random_range(-10.0..10.0));
    }
    let mut events = Vec::new();
    for k in 0..scans {
        let time_ns = (f64::from(k) * INTERVAL_S * 1e9) as i64;
        let mut put = |sample| events.push(TrackingEvent { time_ns, sample });
        put(TrackingSample::OwnShip(OwnShipPose::default()));
        let mut seen = Vec::new();
        for (place, _) in &fleet {
            if rng.random_bool(DETECTION_PROBABILITY) {
                let mut noise = || northing_simulation::random::standard_normal(&mut rng);
                seen.push(Detection::RangeBearing {
                    range_m: (place[0].hypot(place[1]) + RANGE_STD_M * noise()).abs(),
                    bearing_rad: place[1].atan2(place[0]) + BEARING_STD_RAD * noise(),
                });
            }
        }
        while seen.len() < detections as usize {
            // Evenly over the area.
            let share: f64 = rng.random_range(1e-4..1.0);
            seen.push(Detection::RangeBearing {
                range_m: RANGE_M * share.sqrt(),
                bearing_rad: rng.random_range(-std::f64::consts::PI..std::f64::consts::PI),
            });
        }
        put(TrackingSample::Scan(Scan {
            id: i64::from(k),
            sensor: 0,
            detections: seen,
        }));
        if k + 1 < scans {
            for (place, velocity) in &mut fleet {
                for axis in 0..2 {
                    place[axis] += velocity[axis] * INTERVAL_S;
                }
            }
        }
    }
    let area_km2 = std::f64::consts::PI * (RANGE_M * 1e-3).powi(2);
    let clutter = f64::from(detections) - DETECTION_PROBABILITY * f64::from(targets);
    let radar = SensorSettings {
        range_std_m: RANGE_STD_M,
        bearing_std_deg: BEARING_STD_RAD.to_degrees(),
        extent_std_m: 5.0,
        detection_probability: DETECTION_PROBABILITY,
        clutter_per_km2: Some(clutter.max(1.0) / area_km2),
        clutter_per_rad: None,
        largest_range_m: RANGE_M,
        covers_all: true,
        initiates: true,
        used: true,
    };
    let recording = TrackingRecording {
        plane: None,
        name: "crowd".to_owned(),
        sensors: vec![("radar".to_owned(), radar)],
        events,
        truth_std_m: 0.0,
        issues: TrackingIssues::default(),
    };
    (recording, fleet)
}
