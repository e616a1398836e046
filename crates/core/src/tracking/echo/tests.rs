//! Places that stay and places that are new: what is learnt, and whether the stated position is right.

use std::vec::Vec;

use approx::assert_relative_eq;
use nalgebra::{Matrix2, Vector2};
use rand::SeedableRng as _;
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64Mcg;

use super::*;
use crate::tracking::coordinated_turn::TargetState;
use crate::tracking::detection::Detection;
use crate::tracking::{MultiTargetConfig, MultiTargetTracker, OwnShip, Scan, ScanSensor};

const RADAR: ScanSensor<f64> = ScanSensor {
    noise: DetectionNoise {
        range_std_m: 1.0,
        bearing_std_rad: 0.002,
        extent_std_m: 4.0,
    },
    detection_probability: 0.95,
    clutter_density: 1e-9,
    largest_range_m: 5000.0,
    covers_all: true,
    initiates: true,
};

/// A boat that goes straight on for 300 scans, of whose echo's place so much is kept from scan to scan; its position's mean NEES over two
/// in the last 200, and what was learnt.
fn follow(kept: f64, seed: u64) -> (f64, f64) {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let normal = Normal::new(0.0, 1.0).unwrap();
    let mut draw = || normal.sample(&mut rng);
    let own = OwnShip::exact(0.0, 0.0, 0.0);
    let mut tracker =
        MultiTargetTracker::<f64, 3, 8, 8>::new(MultiTargetConfig::default()).unwrap();
    let mut echo = Vector2::new(draw(), draw()) * 4.0;
    let mut squares = Vec::new();
    for k in 0..300 {
        let time_s = 2.0 * f64::from(k);
        let place = Vector2::new(900.0 - 2.5 * time_s, 300.0 + 0.5 * time_s);
        echo = echo * kept + Vector2::new(draw(), draw()) * (4.0 * (1.0 - kept * kept).sqrt());
        let seen = place + echo;
        let detections = [Detection::RangeBearing {
            range_m: seen.norm() + draw(),
            bearing_rad: seen.y.atan2(seen.x) + 0.002 * draw(),
        }];
        let scan = Scan {
            time_s,
            sensor: &RADAR,
            own_ship: &own,
            detections: &detections,
        };
        tracker.scan(&scan).unwrap();
        let oldest = tracker.tracks().max_by(|a, b| a.age_s.total_cmp(&b.age_s));
        let estimate = oldest.unwrap().estimate();
        let error = place - Vector2::new(estimate.state[0], estimate.state[2]);
        let p = &estimate.covariance;
        let p = Matrix2::new(p[(0, 0)], p[(0, 2)], p[(2, 0)], p[(2, 2)]);
        if k >= 100 {
            squares.push(0.5 * error.dot(&(p.try_inverse().unwrap() * error)));
        }
    }
    let learnt = tracker.echoes().sensors().next().unwrap().kept();
    (squares.iter().sum::<f64>() / squares.len() as f64, learnt)
}

#[test]
fn a_place_that_stays_is_found_and_the_stated_position_is_right() {
    let runs: Vec<_> = (0..12).map(|seed| follow(0.9, seed)).collect();
    let nees = runs.iter().map(|(nees, _)| nees).sum::<f64>() / 12.0;
    assert!((0.6..1.4).contains(&nees), "NEES {nees}: {runs:?}");
    let found = runs.iter().filter(|(_, kept)| *kept > 0.0).count();
    assert_eq!(found, 12, "{runs:?}");
}

#[test]
fn a_place_that_is_new_in_every_scan_is_not_taken_for_one_that_stays() {
    for seed in 0..12 {
        let (nees, kept) = follow(0.0, seed);
        assert!(
            kept.abs() < 1e-12 && nees < 1.3,
            "seed {seed}: {kept}, {nees}"
        );
    }
}

/// Target, own ship and echo as one state of ten.
#[test]
fn the_innovation_equals_the_joint_filter_of_target_pose_and_place() {
    let root = SMatrix::<f64, 10, 10>::from_fn(|i, j| {
        0.3 * ((i * 7 + j * 3) as f64).sin() + if i == j { 3.0 } else { 0.0 }
    });
    let mut joint = root * root.transpose();
    // The place has one variance on both axes, and nothing to do with the own ship.
    joint
        .fixed_view_mut::<2, 2>(8, 8)
        .copy_from(&(Matrix2::identity() * 12.0));
    joint.fixed_view_mut::<3, 2>(5, 8).fill(0.0);
    joint.fixed_view_mut::<2, 3>(8, 5).fill(0.0);
    let own = OwnShip {
        covariance: joint.fixed_view::<3, 3>(5, 5).into_owned(),
        ..OwnShip::exact(1.0, 2.0, 0.1)
    };
    let detection = Detection::RangeBearing {
        range_m: 103.0,
        bearing_rad: 0.8,
    };
    let target = TargetState::from([60.0, 1.0, 80.0, 0.0, 0.0]);
    let prediction = detection.predict(&target, &own, &RADAR.noise).unwrap();
    let mut h = SMatrix::<f64, 2, 10>::zeros();
    let of_target = &prediction.target_jacobian;
    h.fixed_columns_mut::<5>(0).copy_from(of_target);
    h.fixed_columns_mut::<3>(5)
        .copy_from(&prediction.pose_jacobian);
    h.column_mut(8).copy_from(&of_target.column(0));
    h.column_mut(9).copy_from(&of_target.column(2));
    let s = h * joint * h.transpose() + prediction.noise;
    let k = joint * h.transpose() * s.try_inverse().unwrap();
    let echo = joint.fixed_view::<5, 2>(0, 8).into_owned();
    let scale = prediction.scale(
        &joint.fixed_view::<5, 5>(0, 0).into_owned(),
        &joint.fixed_view::<5, 3>(0, 5).into_owned(),
        &own,
        (&echo, 12.0),
    );
    let i = scale.unwrap().innovation(prediction.residual).unwrap();
    assert_relative_eq!(i.covariance, s, epsilon = 1e-9, max_relative = 1e-9);
    let gain = k.fixed_rows::<5>(0).into_owned();
    assert_relative_eq!(i.gain, gain, epsilon = 1e-9, max_relative = 1e-9);
    let of_echo = (joint * h.transpose()).fixed_rows::<2>(8).into_owned();
    assert_relative_eq!(i.echo_covariance.unwrap(), of_echo, epsilon = 1e-9);
}
