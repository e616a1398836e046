//! Errors of every kind of the own ship's heading: how long they are taken to last, and whether the stated position is right.

use std::vec::Vec;

use nalgebra::{Matrix2, Vector2};
use rand::SeedableRng as _;
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64Mcg;

use crate::restorable::Restorable as _;
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
const INTERVAL_S: f64 = 2.0;

/// The error of the heading, or of the position where that has a standard deviation (m), in standard deviations: first order with this correlation time in scans, a part of its variance new in every scan.
#[derive(Clone, Copy)]
struct Error {
    scans: f64,
    jitter: f64,
    position_m: f64,
}

struct Outcome {
    nees: f64,
    position_s: f64,
    heading_s: f64,
}

/// Boats around the own ship for 400 scans; mean NEES of their positions over two in the last 300, and what was learnt.
fn follow(boats: usize, error: Error, seed: u64) -> Outcome {
    follow_with(MultiTargetConfig::default(), boats, error, seed)
}

fn follow_with(
    config: MultiTargetConfig<f64, 3>,
    boats: usize,
    error: Error,
    seed: u64,
) -> Outcome {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let normal = Normal::new(0.0, 1.0).unwrap();
    let mut draw = || normal.sample(&mut rng);
    let position_m = error.position_m;
    let heading_rad = if position_m > 0.0 { 0.0 } else { STD_RAD };
    let own = OwnShip::exact(0.0, 0.0, 0.0).with_std(position_m, position_m, heading_rad);
    let mut tracker = MultiTargetTracker::<f64, 3, 16, 8>::new(config).unwrap();
    let kept = (-1.0 / error.scans).exp();
    let mut slow = draw();
    let mut place_slow = Vector2::zeros();
    if position_m > 0.0 {
        place_slow = Vector2::new(draw(), draw());
    }
    let mut squares = Vec::new();
    for k in 0..400 {
        if k == 300 {
            // A restart in the middle, with what was learnt.
            let mut again = MultiTargetTracker::new(config).unwrap();
            again.restore(tracker.save()).unwrap();
            assert_eq!(
                again.pose_error_correlation(),
                tracker.pose_error_correlation()
            );
            tracker = again;
        }
        let time_s = INTERVAL_S * f64::from(k);
        slow = kept * slow + (1.0 - kept * kept).sqrt() * draw();
        let off = heading_rad * ((1.0 - error.jitter).sqrt() * slow + error.jitter.sqrt() * draw());
        if position_m > 0.0 {
            place_slow =
                place_slow * kept + Vector2::new(draw(), draw()) * (1.0 - kept * kept).sqrt();
        }
        let own_place = place_slow * position_m;
        let places: Vec<_> = (0..boats)
            .map(|i| {
                let (s, c) = (1.7 * i as f64 + 0.4).sin_cos();
                Vector2::new(
                    600.0 * c - 2.0 * s * (time_s - 400.0),
                    600.0 * s + 2.0 * c * (time_s - 400.0),
                )
            })
            .collect();
        let detections: Vec<_> = places
            .iter()
            .map(|place| place - own_place)
            .map(|place| Detection::RangeBearing {
                range_m: (place + Vector2::new(draw(), draw())).norm() + 3.0 * draw(),
                bearing_rad: place.y.atan2(place.x) - off + 0.01 * draw(),
            })
            .collect();
        let scan = Scan {
            time_s,
            sensor: &RADAR,
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
        position_s: tracker.pose_error_correlation().position_s,
        heading_s: tracker.pose_error_correlation().heading_s,
    }
}

/// Twelve seeds: correlation times of the heading that were taken (s), in order, and the mean NEES.
fn twelve(boats: usize, error: Error) -> (Vec<f64>, f64) {
    let all: Vec<_> = (0..12).map(|seed| follow(boats, error, seed)).collect();
    let mut times: Vec<_> = all.iter().map(|outcome| outcome.heading_s).collect();
    times.sort_by(f64::total_cmp);
    let nees = all.iter().map(|outcome| outcome.nees).sum::<f64>() / 12.0;
    (times, nees)
}

const fn drifts(scans: f64) -> Error {
    Error {
        scans,
        jitter: 0.0,
        position_m: 0.0,
    }
}

#[test]
fn an_error_that_drifts_is_found() {
    for (boats, scans) in [(2, 20.0), (4, 20.0), (8, 20.0), (8, 100.0)] {
        let (times, nees) = twelve(boats, drifts(scans));
        let factors = [times[0], times[11]].map(|time| time / (INTERVAL_S * scans));
        assert!(factors[0] > 0.6 && factors[1] < 2.5, "{scans}: {times:?}");
        assert!((0.8..1.3).contains(&nees), "{scans}: {nees}");
    }
}

#[test]
fn what_changes_faster_than_it_can_be_followed_is_not_taken_for_slower_than_it_is_by_much() {
    let (times, nees) = twelve(4, drifts(5.0));
    assert!(times[0] > 8.0 && times[11] < 60.0, "{times:?}");
    assert!((0.8..1.3).contains(&nees), "{nees}");
}

#[test]
fn an_error_that_stays_is_not_taken_for_one_that_drifts() {
    for boats in [4, 8] {
        let (times, nees) = twelve(boats, drifts(1e9));
        assert!(times[0] > 9999.0, "{times:?}");
        assert!((0.8..1.2).contains(&nees), "{nees}");
    }
}

#[test]
fn jitter_about_an_error_that_stays_is_not_taken_for_one_that_drifts() {
    for jitter in [0.1, 0.5] {
        for boats in [2, 4, 8] {
            let stays = Error {
                jitter,
                ..drifts(1e9)
            };
            let (times, nees) = twelve(boats, stays);
            // One in twelve is chance at two standard deviations.
            assert!(times[1] > 9999.0, "{jitter} {boats}: {times:?}");
            assert!((0.8..1.2).contains(&nees), "{jitter} {boats}: {nees}");
        }
    }
}

#[test]
fn an_error_of_the_position_that_drifts_is_found_and_one_that_stays_is_not() {
    let error = |scans| Error {
        position_m: 12.0,
        ..drifts(scans)
    };
    let times = |scans| {
        let all = (0..12).map(|seed| follow(6, error(scans), seed));
        let mut times: Vec<_> = all.map(|outcome| outcome.position_s).collect();
        times.sort_by(f64::total_cmp);
        times
    };
    let found = times(20.0);
    let factors = [found[0], found[11]].map(|time| time / (INTERVAL_S * 20.0));
    assert!(factors[0] > 0.6 && factors[1] < 2.5, "{found:?}");
    let stays = times(1e9);
    // Longer than the setting's 300 s may be found, shorter not.
    assert!(stays[0] > 299.0, "{stays:?}");
}

#[test]
fn of_one_target_nothing_is_learnt() {
    let (times, _) = twelve(1, drifts(20.0));
    assert!(times[0] > 9999.0 && times[11] < 10001.0, "{times:?}");
}

#[test]
fn nothing_is_learnt_where_it_is_not_asked_for() {
    let mut config = MultiTargetConfig::default();
    config.settings.learn_pose_error_correlation = false;
    let outcome = follow_with(config, 8, drifts(20.0), 0);
    assert!((9999.0..10001.0).contains(&outcome.heading_s));
}
