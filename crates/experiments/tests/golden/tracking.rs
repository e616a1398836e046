//! Trackers: of one target on the scenario of the radar experiment, of many on three simulated boats.

use nalgebra::Vector4;
use northing_evaluation::tracking::{TrackEpoch, TrackOptions, TrackerKind as ManyKind, run};
use northing_experiments::radar::TrackerKind;
use northing_experiments::radar::experiment::{
    NavigationRecord, RunWatcher, TrackRecord, run as run_experiment,
};
use northing_recording::tracking::{
    Detection, OwnShipPose, Scan, SensorSettings, TrackingEvent, TrackingIssues, TrackingRecording,
    TrackingSample,
};
use northing_simulation::random::{standard_normal, stream};
use northing_simulation::scenario::ScenarioFile;
use northing_simulation::scenario::world::TrackingWorld;

use crate::Trace;

const SCENARIO: &str = include_str!("../../../../scenarios/tracking/wilthil_brekke.toml");

const ONE: &str = "scan,north_m,v_north,east_m,v_east,north_variance,v_north_variance,east_variance,v_east_variance,north_east";

/// A trace for each tracker of one target.
struct Rows(Vec<Trace>);

impl RunWatcher for Rows {
    fn scan(&mut self, _: usize, _: &NavigationRecord, _: &Vector4<f64>) {}

    fn tracker(&mut self, step: usize, index: usize, record: &TrackRecord, _: &Vector4<f64>) {
        let (Some(track), true) = (record.estimate, step.is_multiple_of(8)) else {
            return;
        };
        let p = &track.covariance;
        // Variances: those of `schmidt-authors` become negative.
        let variances = p.diagonal();
        let numbers = track.state.iter().copied();
        let numbers = numbers.chain(variances.iter().copied());
        let numbers = [step as f64].into_iter().chain(numbers).chain([p[(0, 2)]]);
        self.0[index].row(numbers.map(Some));
    }
}

#[test]
fn every_tracker_of_one_target_as_committed() {
    let file = ScenarioFile::parse("wilthil_brekke.toml", SCENARIO).unwrap();
    let world = TrackingWorld::new(&file.scenario(None).unwrap());
    let mut rows = Rows(TrackerKind::ALL.iter().map(|_| Trace::new(ONE)).collect());
    run_experiment(&world, &TrackerKind::ALL, 15, 0, &mut rows);
    for (kind, trace) in TrackerKind::ALL.iter().zip(&rows.0) {
        trace.check(&format!("tracking_one_{}", kind.name()));
    }
}

/// Boats that start at a place (m) with a velocity (m/s), the third one turning slowly.
const BOATS: [([f64; 2], [f64; 2], f64); 3] = [
    ([400.0, -150.0], [-3.0, 2.0], 0.0),
    ([250.0, 250.0], [1.0, -4.0], 0.0),
    ([-300.0, 100.0], [4.0, 1.0], 0.04),
];

/// Where a boat is after a time (s).
fn place(([north, east], [v_north, v_east], rate): ([f64; 2], [f64; 2], f64), t: f64) -> [f64; 2] {
    // Along a circle whose chord is `2 sin(rate t / 2) / rate` long.
    let half = 0.5 * rate * t;
    let along = if rate == 0.0 {
        t
    } else {
        2.0 * half.sin() / rate
    };
    let (sin, cos) = half.sin_cos();
    [
        north + along * (v_north * cos - v_east * sin),
        east + along * (v_north * sin + v_east * cos),
    ]
}

/// Sixty scans of a radar on a ship that goes north, with missed and false detections.
fn harbour() -> TrackingRecording {
    let mut noise = stream(15, "radar");
    let mut draw = || standard_normal(&mut noise);
    let mut events = Vec::new();
    for k in 0..60_i64 {
        let t = k as f64 * 2.0;
        let time_ns = k * 2_000_000_000;
        let own = OwnShipPose {
            north_m: 2.0 * t,
            east_m: 0.0,
            heading_rad: 0.02 * draw(),
            std: Some([1.0, 1.0, 0.02]),
        };
        let mut detections = Vec::new();
        for boat in BOATS {
            let [north, east] = place(boat, t);
            let (north, east) = (north - own.north_m, east - own.east_m);
            let range_m = north.hypot(east) + 3.0 * draw();
            let bearing_rad = east.atan2(north) + 0.01 * draw();
            if draw() < 1.2 {
                detections.push(Detection::RangeBearing {
                    range_m,
                    bearing_rad,
                });
            }
        }
        detections.push(Detection::RangeBearing {
            range_m: 300.0 + 80.0 * draw(),
            bearing_rad: 2.0 * draw(),
        });
        let mut put = |sample| events.push(TrackingEvent { time_ns, sample });
        put(TrackingSample::OwnShip(own));
        put(TrackingSample::Scan(Scan {
            id: k,
            sensor: 0,
            detections,
        }));
    }
    let radar = SensorSettings {
        range_std_m: 3.0,
        bearing_std_deg: 0.6,
        extent_std_m: 1.0,
        detection_probability: 0.9,
        clutter_per_km2: Some(1.0),
        clutter_per_rad: None,
        largest_range_m: 1000.0,
        covers_all: true,
        initiates: true,
        used: true,
    };
    TrackingRecording {
        plane: None,
        name: "harbour".to_owned(),
        sensors: vec![("radar".to_owned(), radar)],
        events,
        truth_std_m: 0.0,
        issues: TrackingIssues::default(),
    }
}

#[test]
fn every_tracker_of_many_targets_as_committed() {
    let recording = harbour();
    for kind in ManyKind::ALL {
        let options = TrackOptions {
            tracker: kind,
            ..TrackOptions::default()
        };
        let mut trace =
            Trace::new("time_s,id,north_m,east_m,v_north,v_east,north_std,east_std,north_east");
        run(&recording, &options, |epoch: TrackEpoch| {
            if !((epoch.time_s * 0.5).round() as u64).is_multiple_of(3) {
                return;
            }
            for track in epoch.tracks {
                let [nn, ne, ee] = track.place_covariance();
                let numbers = [
                    [epoch.time_s, f64::from(track.id), track.place[0]],
                    [track.place[1], track.velocity[0], track.velocity[1]],
                    [nn.sqrt(), ee.sqrt(), ne],
                ];
                trace.row(numbers.concat().into_iter().map(Some));
            }
        })
        .unwrap();
        trace.check(&format!("tracking_many_{}", kind.name()));
    }
}
