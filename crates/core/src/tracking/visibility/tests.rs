use std::vec::Vec;

use rand::{RngExt as _, SeedableRng as _};
use rand_pcg::Pcg64Mcg;

use crate::Restorable as _;
use crate::tracking::association::ipda::ExistenceModel;
use crate::tracking::{
    Detection, DetectionNoise, MultiTargetConfig, MultiTargetTracker, OwnShip, Scan, ScanSensor,
    TrackStatus,
};

type Tracker = MultiTargetTracker<f64, 3, 16, 8>;

const RADAR: ScanSensor<f64> = ScanSensor {
    noise: DetectionNoise {
        range_std_m: 3.0,
        bearing_std_rad: 0.01,
        extent_std_m: 1.0,
    },
    detection_probability: 0.9,
    clutter_density: 1e-7,
    largest_range_m: 5000.0,
    covers_all: true,
    initiates: true,
};
/// Seconds between scans.
const INTERVAL_S: f64 = 2.0;
const TARGETS: u32 = 4;

fn tracker(config: MultiTargetConfig<f64, 3>) -> Tracker {
    Tracker::new(config).unwrap()
}

/// Four targets that lie still far apart, each seen with the radar's probability where `is_there` says so of it and the scan.
fn follow(
    tracker: &mut Tracker,
    scans: std::ops::Range<u32>,
    is_there: impl Fn(u32, u32) -> bool,
    rng: &mut Pcg64Mcg,
) {
    let own_ship = OwnShip::exact(0.0, 0.0, 0.0);
    for k in scans {
        let seen = (0..TARGETS).filter(|target| {
            let is_detected = rng.random::<f64>() < RADAR.detection_probability;
            is_there(*target, k) && is_detected
        });
        let detections: Vec<_> = seen
            .map(|target| Detection::RangeBearing {
                range_m: 500.0,
                bearing_rad: 1.5 * f64::from(target),
            })
            .collect();
        let scan = Scan {
            time_s: INTERVAL_S * f64::from(k),
            sensor: &RADAR,
            own_ship: &own_ship,
            detections: &detections,
        };
        tracker.scan(&scan).unwrap();
    }
}

/// Scans for which the tracks of targets that leave are still reported, of all together.
fn reported_after_leaving(config: MultiTargetConfig<f64, 3>, seed: u64) -> usize {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut tracker = tracker(config);
    follow(&mut tracker, 0..100, |_, _| true, &mut rng);
    let mut reported = 0;
    for k in 100..200 {
        follow(&mut tracker, k..k + 1, |_, _| false, &mut rng);
        let settings = &config.settings;
        reported += tracker.tracks().filter(|t| t.is_reported(settings)).count();
    }
    reported
}

#[test]
fn where_targets_never_hide_those_that_leave_are_given_up_sooner() {
    let learning = MultiTargetConfig::default();
    let mut not_learning = learning;
    not_learning.settings.learn_visibility = false;
    for seed in 0..12 {
        let scans = [learning, not_learning].map(|config| reported_after_leaving(config, seed));
        // Four misses of a target seen with 0.9 come once in ten thousand; ten scans stand for 20 s of being hidden.
        assert!(scans[0] < 6 * TARGETS as usize, "seed {seed}: {scans:?}");
        assert!(scans[1] > 2 * scans[0], "seed {seed}: {scans:?}");
    }
}

#[test]
fn how_often_targets_hide_is_found() {
    // Each is hidden for 15 of 60 scans: it stays visible for 90 s.
    let hides = |target: u32, k: u32| (k + 15 * target) % 60 < 45;
    for seed in 0..12 {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let found = [true, false].map(|hidden| {
            let mut tracker = tracker(MultiTargetConfig::default());
            let is_there = |target, k| !hidden || hides(target, k);
            follow(&mut tracker, 0..600, is_there, &mut rng);
            tracker.existence_model().visible_s
        });
        let ratio = found[0] / 90.0;
        assert!((0.6..1.6).contains(&ratio), "seed {seed}: {found:?}");
        // Two misses in a row look a little like hiding, more so at first.
        assert!(found[1] > 600.0, "seed {seed}: {found:?}");
    }
}

#[test]
fn a_target_that_hides_is_kept_while_it_is_not_reported_and_comes_back_with_its_number() {
    let config = MultiTargetConfig::default();
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut tracker = tracker(config);
    follow(&mut tracker, 0..100, |_, _| true, &mut rng);
    let numbers = |tracker: &Tracker, reported: bool| -> Vec<u32> {
        let those = tracker.tracks().filter(|track| {
            track.status == TrackStatus::Confirmed
                && track.is_reported(&config.settings) == reported
        });
        those.map(|track| track.id).collect()
    };
    let all = numbers(&tracker, true);
    assert_eq!(all.len(), TARGETS as usize);
    follow(&mut tracker, 100..107, |target, _| target > 0, &mut rng);
    let doubtful = numbers(&tracker, false);
    assert_eq!(doubtful.len(), 1);
    follow(&mut tracker, 107..112, |_, _| true, &mut rng);
    assert_eq!(numbers(&tracker, true), all);
}

#[test]
fn what_is_learnt_is_saved_and_nothing_is_learnt_where_targets_never_hide() {
    let mut rng = Pcg64Mcg::seed_from_u64(1);
    let mut first = tracker(MultiTargetConfig::default());
    follow(&mut first, 0..50, |_, _| true, &mut rng);
    let mut second = tracker(MultiTargetConfig::default());
    second.restore(first.save()).unwrap();
    let [a, b] = [&first, &second].map(MultiTargetTracker::existence_model);
    assert_eq!(a, b);
    assert!(a.visible_s > 3.0 * ExistenceModel::<f64>::default().visible_s);

    let mut config = MultiTargetConfig::default();
    config.settings.existence.hidden_s = 0.0;
    let mut never = tracker(config);
    follow(&mut never, 0..50, |_, _| true, &mut rng);
    assert_eq!(never.existence_model(), config.settings.existence);
}
