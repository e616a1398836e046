//! The tracker end to end on made-up scans: initiation, clutter, crossing, hiding, bad input.

use std::vec::Vec;

use approx::assert_relative_eq;
use nalgebra::Vector2;
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64Mcg;

use super::*;
use crate::kalman::covariance::cholesky;
use crate::tracking::detection::DetectionNoise;

mod room;

type Tracker = MultiTargetTracker<f64, 3, 24, 32>;

const RADAR: ScanSensor<f64> = ScanSensor {
    noise: DetectionNoise {
        range_std_m: 3.0,
        bearing_std_rad: 0.01,
        extent_std_m: 1.0,
    },
    detection_probability: 0.9,
    clutter_density: 1e-6,
    largest_range_m: 5000.0,
    covers_all: true,
    initiates: true,
};

fn radar(range_m: f64, bearing_rad: f64) -> Detection<f64> {
    Detection::RangeBearing {
        range_m,
        bearing_rad,
    }
}

fn scan<'a>(time_s: f64, own: &'a OwnShip<f64>, detections: &'a [Detection<f64>]) -> Scan<'a, f64> {
    Scan {
        time_s,
        sensor: &RADAR,
        own_ship: own,
        detections,
    }
}

/// Noisy radar of targets, with false alarms in a square of 2 km.
fn observe(targets: &[Vector2<f64>], clutter: usize, rng: &mut Pcg64Mcg) -> Vec<Detection<f64>> {
    let normal = Normal::new(0.0, 1.0).unwrap();
    let mut out = Vec::new();
    for p in targets {
        if rng.random::<f64>() < 0.9 {
            let range = p.norm() + 3.0 * normal.sample(rng);
            out.push(radar(range, p.y.atan2(p.x) + 0.01 * normal.sample(rng)));
        }
    }
    for _ in 0..clutter {
        let p = Vector2::<f64>::new(rng.random_range(-1e3..1e3), rng.random_range(-1e3..1e3));
        out.push(radar(p.norm(), p.y.atan2(p.x)));
    }
    out
}

fn confirmed(tracker: &Tracker) -> Vec<Track<f64, 3>> {
    let all = tracker.tracks();
    all.filter(|t| t.status == TrackStatus::Confirmed)
        .copied()
        .collect()
}

#[test]
fn crossing_targets_keep_their_tracks_in_clutter() {
    let mut rng = Pcg64Mcg::seed_from_u64(11);
    let own = OwnShip::exact(0.0, 0.0, 0.0).with_std(2.0, 2.0, 0.01);
    let mut tracker = Tracker::new(MultiTargetConfig::default()).unwrap();
    let at = |t: f64| {
        [
            Vector2::new(300.0 + 4.0 * t, 200.0),
            Vector2::new(380.0 + t, 60.0 + 5.0 * t),
        ]
    };
    let mut first = Vec::new();
    for k in 0..60 {
        let t = f64::from(k);
        let detections = observe(&at(t), 3, &mut rng);
        tracker.scan(&scan(t, &own, &detections)).unwrap();
        let near = |p: &Vector2<f64>| {
            confirmed(&tracker).iter().find_map(|track| {
                let m = track.estimate().state;
                ((m[0] - p.x).hypot(m[2] - p.y) < 25.0).then_some(track.id)
            })
        };
        let ids: Vec<_> = at(t).iter().map(near).collect();
        if k == 10 {
            first.clone_from(&ids);
        }
        if k == 59 {
            assert!(ids.iter().all(Option::is_some), "{ids:?}");
            assert_eq!(ids, first, "the tracks swapped or were replaced");
        }
    }
    assert!(tracker.counts().initiated > 30);
    assert!(
        confirmed(&tracker).len() <= 3,
        "{}",
        confirmed(&tracker).len()
    );
}

#[test]
fn joint_covariance_with_the_own_ship_stays_positive() {
    let mut rng = Pcg64Mcg::seed_from_u64(5);
    let own = OwnShip::exact(0.0, 0.0, 0.0).with_std(3.0, 3.0, 0.05);
    let mut tracker = Tracker::new(MultiTargetConfig::default()).unwrap();
    for k in 0..80 {
        let t = 1.5 * f64::from(k);
        let target = [Vector2::new(
            300.0 * (0.02 * t).cos(),
            300.0 * (0.02 * t).sin(),
        )];
        let detections = observe(&target, 2, &mut rng);
        tracker.scan(&scan(t, &own, &detections)).unwrap();
        for track in tracker.tracks() {
            for mode in &track.imm.modes {
                let mut joint = nalgebra::SMatrix::<f64, 8, 8>::zeros();
                joint
                    .fixed_view_mut::<5, 5>(0, 0)
                    .copy_from(&mode.covariance);
                joint.fixed_view_mut::<5, 3>(0, 5).copy_from(&mode.cross);
                joint
                    .fixed_view_mut::<3, 5>(5, 0)
                    .copy_from(&mode.cross.transpose());
                joint
                    .fixed_view_mut::<3, 3>(5, 5)
                    .copy_from(&own.covariance);
                assert!(cholesky(&joint).is_some(), "scan {k}, track {}", track.id);
            }
        }
    }
    assert!(!confirmed(&tracker).is_empty());
}

#[test]
fn a_new_track_knows_what_it_shares_with_the_own_ship() {
    let own = OwnShip::exact(10.0, 20.0, 0.2).with_std(3.0, 4.0, 0.05);
    let mut tracker = Tracker::new(MultiTargetConfig::default()).unwrap();
    tracker
        .scan(&scan(0.0, &own, &[radar(200.0, 0.3)]))
        .unwrap();
    let track = *tracker.tracks().next().unwrap();
    let mode = track.estimate();
    let (n, e) = (200.0 * 0.5_f64.cos(), 200.0 * 0.5_f64.sin());
    assert_relative_eq!(mode.state[0], 10.0 + n, epsilon = 1e-9);
    assert_relative_eq!(mode.state[2], 20.0 + e, epsilon = 1e-9);
    assert_relative_eq!(mode.cross[(0, 0)], 9.0, epsilon = 1e-9);
    assert_relative_eq!(mode.cross[(0, 2)], -e * 0.0025, epsilon = 1e-9);
    assert_relative_eq!(mode.cross[(2, 2)], n * 0.0025, epsilon = 1e-9);
    // an exact own ship leaves only the sensor's own uncertainty
    let mut sure = Tracker::new(MultiTargetConfig::default()).unwrap();
    let exact = OwnShip::exact(10.0, 20.0, 0.2);
    sure.scan(&scan(0.0, &exact, &[radar(200.0, 0.3)])).unwrap();
    let difference = mode.covariance - sure.tracks().next().unwrap().estimate().covariance;
    assert_relative_eq!(difference[(0, 0)], 9.0 + e * e * 0.0025, epsilon = 1e-9);
    assert_relative_eq!(difference[(2, 2)], 16.0 + n * n * 0.0025, epsilon = 1e-9);
}

#[test]
fn a_target_that_is_gone_is_deleted_and_a_hidden_one_survives() {
    let own = OwnShip::exact(0.0, 0.0, 0.0);
    let mut tracker = Tracker::new(MultiTargetConfig::default()).unwrap();
    for k in 0..12 {
        let detections = [radar(200.0, 0.3)];
        tracker
            .scan(&scan(f64::from(k), &own, &detections))
            .unwrap();
    }
    assert_eq!(confirmed(&tracker).len(), 1);
    for k in 12..17 {
        tracker.scan(&scan(f64::from(k), &own, &[])).unwrap();
    }
    assert_eq!(confirmed(&tracker).len(), 1, "five scans in a shadow");
    for k in 17..120 {
        tracker.scan(&scan(f64::from(k), &own, &[])).unwrap();
    }
    assert_eq!(tracker.tracks().count(), 0);
    assert_eq!(tracker.counts().deleted_confirmed, 1);
}

#[test]
fn bearings_refine_and_never_initiate() {
    let camera = ScanSensor {
        clutter_density: 0.1,
        initiates: true,
        ..RADAR
    };
    let own = OwnShip::exact(0.0, 0.0, 0.0);
    let mut tracker = Tracker::new(MultiTargetConfig::default()).unwrap();
    let bearing = [Detection::Bearing { bearing_rad: 0.3 }];
    let look = |t| Scan {
        time_s: t,
        sensor: &camera,
        own_ship: &own,
        detections: &bearing,
    };
    tracker.scan(&look(0.0)).unwrap();
    assert_eq!(tracker.tracks().count(), 0);
    tracker
        .scan(&scan(0.0, &own, &[radar(200.0, 0.3)]))
        .unwrap();
    let before = tracker.tracks().next().unwrap().estimate();
    tracker.scan(&look(0.0)).unwrap();
    let track = tracker.tracks().next().unwrap();
    let across = |p: &nalgebra::SMatrix<f64, 5, 5>| {
        let (s, c) = 0.3_f64.sin_cos();
        s * s * p[(0, 0)] - 2.0 * s * c * p[(0, 2)] + c * c * p[(2, 2)]
    };
    assert!(across(&track.estimate().covariance) < 0.8 * across(&before.covariance));
    assert_eq!(track.innovation.degrees_of_freedom, 1);
}

#[test]
fn an_ais_report_of_one_ship_says_nothing_against_the_others() {
    let ais = ScanSensor {
        noise: DetectionNoise {
            range_std_m: 1.0,
            bearing_std_rad: 1.0,
            extent_std_m: 10.0,
        },
        covers_all: false,
        clutter_density: 1e-9,
        ..RADAR
    };
    let own = OwnShip::exact(0.0, 0.0, 0.0).with_std(5.0, 5.0, 0.05);
    let mut tracker = Tracker::new(MultiTargetConfig::default()).unwrap();
    for k in 0..8 {
        let detections = [radar(200.0, 0.3)];
        tracker
            .scan(&scan(f64::from(k), &own, &detections))
            .unwrap();
    }
    let before = tracker.tracks().next().unwrap().existence;
    let elsewhere = [Detection::Position {
        north_m: -3000.0,
        east_m: 100.0,
    }];
    let report = Scan {
        time_s: 7.0,
        sensor: &ais,
        own_ship: &own,
        detections: &elsewhere,
    };
    tracker.scan(&report).unwrap();
    assert_eq!(tracker.tracks().next().unwrap().existence, before);
    assert_eq!(tracker.tracks().count(), 2);
    let new = tracker.tracks().last().unwrap().estimate();
    assert_relative_eq!(new.cross.abs().max(), 0.0);
    assert_relative_eq!(new.covariance[(0, 0)], 100.0, epsilon = 1e-9);
}

#[test]
fn bad_scans_change_nothing_and_are_counted() {
    let own = OwnShip::exact(0.0, 0.0, 0.0);
    let mut tracker = Tracker::new(MultiTargetConfig::default()).unwrap();
    tracker
        .scan(&scan(10.0, &own, &[radar(200.0, 0.3)]))
        .unwrap();
    let before: Vec<_> = tracker.tracks().copied().collect();
    let mut no_covariance = own;
    no_covariance.covariance[(0, 0)] = -1.0;
    let cases = [
        (f64::NAN, own, ScanError::TimeNotFinite),
        (9.9, own, ScanError::TimeGoesBack),
        (1e9, own, ScanError::TimeInFuture),
        (11.0, no_covariance, ScanError::PoseInvalid),
        (
            11.0,
            OwnShip::exact(f64::NAN, 0.0, 0.0),
            ScanError::PoseInvalid,
        ),
        (11.0, OwnShip::exact(500.0, 0.0, 0.0), ScanError::PoseJumps),
        (11.5, OwnShip::exact(500.0, 0.0, 3.0), ScanError::PoseJumps),
    ];
    for (time, pose, expected) in cases {
        let result = tracker.scan(&scan(time, &pose, &[radar(100.0, 0.0)]));
        assert_eq!(result, Err(expected));
    }
    assert_eq!(tracker.tracks().copied().collect::<Vec<_>>(), before);
    let counts = tracker.counts();
    let poses = (counts.pose_invalid, counts.pose_jumps);
    assert_eq!((counts.scans, poses), (1, (2, 2)));
    assert_eq!(
        counts.time_not_finite + counts.time_goes_back + counts.time_in_future,
        3
    );
}

#[test]
fn a_pose_that_jumped_and_stays_is_taken_from_the_second_scan_on_and_shares_no_error() {
    let near = OwnShip::exact(0.0, 0.0, 0.0).with_std(3.0, 3.0, 0.05);
    let far = OwnShip::exact(900.0, 0.0, 0.0).with_std(3.0, 3.0, 0.05);
    let mut tracker = Tracker::new(MultiTargetConfig::default()).unwrap();
    for k in 0..8 {
        let seen = [radar(400.0, 0.3)];
        tracker.scan(&scan(f64::from(k), &near, &seen)).unwrap();
    }
    assert!(confirmed(&tracker)[0].estimate().cross.norm() > 1.0);
    let jumped = tracker.scan(&scan(8.0, &far, &[]));
    assert_eq!(jumped, Err(ScanError::PoseJumps));
    tracker.scan(&scan(9.0, &far, &[])).unwrap();
    assert_relative_eq!(confirmed(&tracker)[0].estimate().cross.norm(), 0.0);
    assert_eq!(
        (tracker.counts().scans, tracker.counts().pose_jumps),
        (9, 1)
    );
}

#[test]
fn bad_detections_are_skipped_and_counted_and_good_ones_of_the_scan_used() {
    let own = OwnShip::exact(0.0, 0.0, 0.0);
    let mut tracker = Tracker::new(MultiTargetConfig::default()).unwrap();
    let detections = [
        radar(f64::NAN, 0.0),
        radar(-5.0, 0.0),
        radar(f64::INFINITY, 0.0),
        radar(100.0, f64::NAN),
        radar(200.0, 0.3),
    ];
    tracker.scan(&scan(0.0, &own, &detections)).unwrap();
    assert_eq!(tracker.counts().detections_invalid, 4);
    assert_eq!(tracker.tracks().count(), 1);
}

#[test]
fn a_target_through_the_own_ship_is_skipped_and_counted() {
    let own = OwnShip::exact(0.0, 0.0, 0.0);
    let mut tracker = Tracker::new(MultiTargetConfig::default()).unwrap();
    tracker.scan(&scan(0.0, &own, &[radar(15.0, 0.3)])).unwrap();
    let place = tracker.tracks().next().unwrap().estimate().state;
    let on_top = OwnShip::exact(place[0], place[2], 0.0);
    tracker
        .scan(&scan(0.0, &on_top, &[radar(5.0, 0.0)]))
        .unwrap();
    assert_eq!(tracker.counts().bearing_undefined, 3, "one for each model");
    assert!(tracker.tracks().all(|t| t.imm.is_valid()));
}

#[test]
fn single_precision_follows_double_precision() {
    let (mut a, mut b) = (
        MultiTargetTracker::<f64, 3, 4, 4>::new(MultiTargetConfig::default()).unwrap(),
        MultiTargetTracker::<f32, 3, 4, 4>::new(MultiTargetConfig::default()).unwrap(),
    );
    let single = ScanSensor {
        noise: DetectionNoise {
            range_std_m: 3.0_f32,
            bearing_std_rad: 0.01,
            extent_std_m: 1.0,
        },
        detection_probability: 0.9,
        clutter_density: 1e-6,
        largest_range_m: 5000.0,
        covers_all: true,
        initiates: true,
    };
    let own = OwnShip::exact(0.0, 0.0, 0.0).with_std(2.0, 2.0, 0.02);
    let own32 = OwnShip::exact(0.0_f32, 0.0, 0.0).with_std(2.0, 2.0, 0.02);
    for k in 0..30_u8 {
        let (range, bearing) = (300.0 - 2.0 * f64::from(k), 0.4 + 0.01 * f64::from(k));
        a.scan(&scan(f64::from(k), &own, &[radar(range, bearing)]))
            .unwrap();
        b.scan(&Scan {
            time_s: f32::from(k),
            sensor: &single,
            own_ship: &own32,
            detections: &[Detection::RangeBearing {
                range_m: range as f32,
                bearing_rad: bearing as f32,
            }],
        })
        .unwrap();
    }
    let (x, y) = (
        a.tracks().next().unwrap().estimate().state,
        b.tracks().next().unwrap().estimate().state,
    );
    assert!((x[0] - f64::from(y[0])).abs() < 0.05 && (x[2] - f64::from(y[2])).abs() < 0.05);
}

#[test]
fn a_configuration_outside_its_range_is_refused_by_name() {
    let refused = |change: fn(&mut MultiTargetConfig<f64, 3>)| {
        let mut config = MultiTargetConfig::default();
        change(&mut config);
        Tracker::new(config).err().map(|error| error.field)
    };
    assert_eq!(refused(|_| {}), None);
    assert_eq!(
        refused(|c| c.settings.gate_sigmas = 0.0),
        Some("gate_sigmas")
    );
    assert_eq!(
        refused(|c| c.settings.confirm_existence = 1.1),
        Some("confirm_existence")
    );
    assert_eq!(
        refused(|c| c.models.dwell_s[1] = f64::NAN),
        Some("models.dwell_s")
    );
    assert_eq!(
        refused(|c| c.settings.pose_limits.turn_rad_s = -1.0),
        Some("pose_limits.turn_rad_s")
    );
    assert_eq!(
        refused(|c| c.settings.pose_error_correlation.position_s = f64::INFINITY),
        Some("pose_error_correlation.position_s")
    );
}

/// Confirmed tracks near a target after 20 scans at which it is seen nine times of ten.
fn after_twenty_scans(
    own: &OwnShip<f64>,
    tail: f64,
    target: impl Fn(f64) -> Vector2<f64>,
) -> usize {
    let mut rng = Pcg64Mcg::seed_from_u64(6);
    let mut config = MultiTargetConfig::default();
    config.settings.birth_speed_tail = tail;
    let mut tracker = Tracker::new(config).unwrap();
    for k in 0..20 {
        let time_s = 2.0 * f64::from(k);
        let detections = observe(&[target(time_s)], 0, &mut rng);
        tracker.scan(&scan(time_s, own, &detections)).unwrap();
    }
    let near = |track: &Track<f64, 3>| {
        let (x, at) = (track.estimate().state, target(38.0));
        (x[0] - at.x).hypot(x[2] - at.y) < 60.0
    };
    confirmed(&tracker).into_iter().filter(near).count()
}

#[test]
fn a_pose_that_makes_every_target_uncertain_ends_no_track() {
    // 0.1 rad at 1500 m are 150 m, beyond `largest_position_std_m`.
    let own = OwnShip::exact(0.0, 0.0, 0.0).with_std(0.0, 0.0, 0.1);
    let followed = after_twenty_scans(&own, 3.0, |t| Vector2::new(1500.0 - 4.0 * t, 20.0));
    assert_eq!(followed, 1);
}

#[test]
fn a_target_of_five_usual_speeds_is_found_by_the_long_tail() {
    let own = OwnShip::exact(0.0, 0.0, 0.0);
    let fast = |t: f64| Vector2::new(2500.0 - 40.0 * t, 100.0);
    assert_eq!(after_twenty_scans(&own, 3.0, fast), 1);
    assert_eq!(after_twenty_scans(&own, 1.0, fast), 0);
}
