//! Errors of every kind of the own ship's heading: how long they are taken to last, and whether the stated position is right.

use std::vec::Vec;

use nalgebra::{Matrix2, Vector2};
use rand::SeedableRng as _;
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64Mcg;

use crate::tracking::{Detection, DetectionNoise, MultiTargetConfig, MultiTargetTracker};
use crate::tracking::{OwnShip, Scan, ScanSensor};

const RADAR: ScanSensor<f64> = ScanSensor {
    noise: DetectionNoise {
        range_std_m: 3.0,
        bearing_std_rad: 0.01,
        extent_std_m: 1.0,
    },
    detection_probability: 0.95,
    clutter_density: 1e-9,
    largest_range_m: 5000.0,
    covers_all: true,
    initiates: true,
};
const STD_RAD: f64 = 0.04;

/// The heading's error, in standard deviations: first order with this correlation time in scans, a part of its variance new in every scan.
#[derive(Clone, Copy)]
struct Error {
    scans: f64,
    jitter: f64,
}

struct Outcome {
    nees: f64,
    heading_s: f64,
}

/// Boats around the own ship for 400 scans; mean NEES of their positions over two in the last 300, and what was learnt.
fn follow(boats: usize, error: Error, told: f64, seed: u64) -> Outcome {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let normal = Normal::new(0.0, 1.0).unwrap();
    let mut draw = || normal.sample(&mut rng);
    let own = OwnShip::exact(0.0, 0.0, 0.0).with_std(0.0, 0.0, STD_RAD);
    let mut tracker =
        MultiTargetTracker::<f64, 3, 16, 8>::new(MultiTargetConfig::default()).unwrap();
    let kept = (-1.0 / error.scans).exp();
    let mut slow = draw();
    let mut squares = Vec::new();
    let mut sensor = RADAR;
    sensor.noise.bearing_std_rad *= told;
    sensor.noise.range_std_m *= told;
    for k in 0..400 {
        let time_s = 2.0 * f64::from(k);
        slow = kept * slow + (1.0 - kept * kept).sqrt() * draw();
        let off = STD_RAD * ((1.0 - error.jitter).sqrt() * slow + error.jitter.sqrt() * draw());
        let places: Vec<_> = (0..boats)
            .map(|i| {
                let (s, c) = (1.7 * i as f64 + 0.4).sin_cos();
                Vector2::new(600.0 * c - 2.0 * s * (time_s - 400.0), 600.0 * s + 2.0 * c * (time_s - 400.0))
            })
            .collect();
        let detections: Vec<_> = places
            .iter()
            .map(|place| Detection::RangeBearing {
                range_m: (place + Vector2::new(draw(), draw())).norm() + 3.0 * draw(),
                bearing_rad: place.y.atan2(place.x) - off + 0.01 * draw(),
            })
            .collect();
        let scan = Scan {
            time_s,
            sensor: &sensor,
            own_ship: &own,
            detections: &detections,
        };
        tracker.scan(&scan).unwrap();
        if k < 100 {
            continue;
        }
        for track in tracker.tracks().filter(|track| track.age_s > 150.0) {
            let estimate = track.estimate();
            let at = Vector2::new(estimate.state[0], estimate.state[2]);
            let near = places.iter().map(|place| place - at);
            let error = near.min_by(|a, b| a.norm().total_cmp(&b.norm())).unwrap();
            let p = &estimate.covariance;
            let p = Matrix2::new(p[(0, 0)], p[(0, 2)], p[(2, 0)], p[(2, 2)]);
            squares.push(0.5 * error.dot(&(p.try_inverse().unwrap() * error)));
        }
    }
    Outcome {
        nees: squares.iter().sum::<f64>() / squares.len() as f64,
        heading_s: tracker.pose_error_correlation().heading_s,
    }
}

#[test]
fn probe() {
    for (name, error) in [
        ("5", Error { scans: 5.0, jitter: 0.0 }),
        ("20", Error { scans: 20.0, jitter: 0.0 }),
        ("100", Error { scans: 100.0, jitter: 0.0 }),
        ("const", Error { scans: 1e9, jitter: 0.0 }),
        ("const+10%jitter", Error { scans: 1e9, jitter: 0.1 }),
        ("const+50%jitter", Error { scans: 1e9, jitter: 0.5 }),
        ("20+10%jitter", Error { scans: 20.0, jitter: 0.1 }),
        ("white", Error { scans: 1e-3, jitter: 1.0 }),
    ] {
        for boats in [1, 2, 4, 8] {
            for told in [1.0] {
            let all: Vec<_> = (0..12).map(|seed| follow(boats, error, told, seed)).collect();
            let mut times: Vec<_> = all.iter().map(|o| o.heading_s).collect();
            times.sort_by(f64::total_cmp);
            let nees = all.iter().map(|o| o.nees).sum::<f64>() / 12.0;
            std::println!("{name:16} boats {boats} told {told} nees {nees:.2} times {:.0} {:.0} {:.0} {:.0}", times[0], times[3], times[6], times[11]);
            }
        }
    }
}
