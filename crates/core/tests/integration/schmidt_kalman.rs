//! The Schmidt-Kalman tracker beside a navigation filter, against the dense joint covariance.

#![allow(clippy::unwrap_used)]

use approx::assert_relative_eq;
use nalgebra::{Matrix3, Matrix4, SMatrix, SVector, UnitQuaternion, Vector3, Vector4};
use northing_core::Restorable as _;
use northing_core::kalman::{Outcome, SkipReason};
use northing_core::navigation::{
    ErrorStateConfig, ErrorStateFilter, ErrorTransition, GnssCompassFix, NavigationState,
};
use northing_core::tracking::initiation::one_point;
use northing_core::tracking::own_ship::PoseErrorCorrelation;
use northing_core::tracking::radar::PredictedDetection;
use northing_core::tracking::{
    BlackBoxSchmidt, ConstantVelocity, Coupling, JointEkf, NavigationPose, RadarDetection,
    RadarNoise, SchmidtKalman, SeenTrack, TrackEstimate, TrackerConfig,
};
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

use crate::polar;
use polar::{map_of_errors, on_the_arc};

type M15 = SMatrix<f64, 15, 15>;
type M19 = SMatrix<f64, 19, 19>;

const DEG: f64 = core::f64::consts::PI / 180.0;

/// A ship that turns and rolls past a target; every filter model equals the truth.
struct World {
    rng: Pcg64Mcg,
    navigation: ErrorStateFilter<f64>,
    truth: NavigationState<f64>,
    target: Vector4<f64>,
}

const RADAR: RadarNoise<f64> = RadarNoise {
    range_std: 20.0,
    bearing_std: DEG,
};

fn tracker_config() -> TrackerConfig<f64> {
    TrackerConfig::new(
        ConstantVelocity {
            acceleration_std: 0.05,
        },
        RADAR,
    )
}

fn normal(rng: &mut Pcg64Mcg, std: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| std * rng.sample::<f64, _>(StandardNormal))
}

impl World {
    fn new(seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let stds = [3.0 * DEG, 0.5, 1.5, 0.02, 0.02 * DEG];
        let covariance = M15::from_diagonal(&SVector::from_fn(|i, _| stds[i / 3].powi(2)));
        let truth = NavigationState {
            ned_from_body: UnitQuaternion::identity(),
            velocity: Vector3::new(10.0, 0.0, 0.0),
            position: Vector3::zeros(),
            accelerometer_bias: Vector3::zeros(),
            gyroscope_bias: Vector3::zeros(),
            covariance,
            pending: ErrorTransition::default(),
            skipped: 0,
        };
        let turned = UnitQuaternion::from_scaled_axis(normal(&mut rng, stds[0]));
        let start = NavigationState {
            ned_from_body: turned * truth.ned_from_body,
            velocity: truth.velocity + normal(&mut rng, stds[1]),
            position: truth.position + normal(&mut rng, stds[2]),
            accelerometer_bias: normal(&mut rng, stds[3]),
            gyroscope_bias: normal(&mut rng, stds[4]),
            ..truth
        };
        let config = ErrorStateConfig {
            accelerometer_noise_density: 0.7,
            gyroscope_noise_density: 0.4 * DEG,
            ..ErrorStateConfig::default()
        };
        Self {
            rng,
            navigation: ErrorStateFilter::new(config, start).unwrap(),
            truth,
            target: Vector4::new(3000.0, -5.0, 2000.0, -10.0),
        }
    }

    fn own_pose(&self) -> Vector3<f64> {
        let truth = ErrorStateFilter::new(*self.navigation.config(), self.truth).unwrap();
        truth.pose()
    }

    fn detection(&mut self) -> RadarDetection<f64> {
        let exact = PredictedDetection::new(&self.target, &self.own_pose()).unwrap();
        let noise = normal(&mut self.rng, 1.0);
        RadarDetection {
            range: exact.detection.range + RADAR.range_std * noise.x,
            bearing: exact.detection.bearing + RADAR.bearing_std * noise.y,
        }
    }

    /// Twenty inertial samples and a fix.
    fn interval(
        &mut self,
        k: usize,
    ) -> northing_core::navigation::error_state::GnssCompassUpdate<f64> {
        let dt = 0.01;
        for i in 0..20 {
            let t = k as f64 * 0.2 + f64::from(i) * dt;
            let rate = Vector3::new(0.05 * t.sin(), 0.02 * t.cos(), 0.01);
            let force = Vector3::new(0.1, 0.1, -9.8);
            let mut ideal = ErrorStateFilter::new(*self.navigation.config(), self.truth).unwrap();
            ideal.propagate(&rate, &force, dt).unwrap();
            self.truth = NavigationState {
                pending: ErrorTransition::default(),
                ..*ideal.state()
            };
            let rate = rate + normal(&mut self.rng, 4.0 * DEG);
            let force = force + normal(&mut self.rng, 7.0);
            self.navigation.propagate(&rate, &force, dt).unwrap();
        }
        let noise = normal(&mut self.rng, 1.0);
        let turn = UnitQuaternion::from_scaled_axis(normal(&mut self.rng, 3.0 * DEG));
        self.navigation.update_gnss_compass(&GnssCompassFix {
            position: self.truth.position + noise * 1.5,
            position_std: Vector3::repeat(1.5),
            ned_from_body: turn * self.truth.ned_from_body,
            attitude_std: Vector3::repeat(3.0 * DEG),
        })
    }

    fn start_track(&mut self) -> (SeenTrack<f64>, SMatrix<f64, 15, 4>) {
        let rows = self.navigation.pose_from_error();
        let covariance = self.navigation.state().covariance;
        let own = NavigationPose {
            pose: self.navigation.pose(),
            covariance: &covariance,
            pose_from_error: rows,
        };
        let detection = self.detection();
        one_point(&detection, &RADAR, 8.0, &own).unwrap()
    }

    fn step_target(&mut self) {
        let a = normal(&mut self.rng, 0.05);
        let x = &mut self.target;
        for (axis, a) in [(0, a.x), (2, a.y)] {
            x[axis] += x[axis + 1] + 0.5 * a;
            x[axis + 1] += a;
        }
    }
}

/// The joint covariance of target and navigation, along the line of sight and on the arc across it.
fn joint(tracker: &SchmidtKalman<f64, 15>, navigation: &M15) -> M19 {
    let mut p = M19::zeros();
    let cross = tracker.cross_covariance();
    p.fixed_view_mut::<4, 4>(0, 0)
        .copy_from(&tracker.save().track.tangent.covariance);
    p.fixed_view_mut::<15, 4>(4, 0).copy_from(cross);
    p.fixed_view_mut::<4, 15>(0, 4)
        .copy_from(&cross.transpose());
    p.fixed_view_mut::<15, 15>(4, 4).copy_from(navigation);
    p
}

/// The smallest eigenvalue of the joint correlation matrix.
fn smallest_eigenvalue(p: &M19) -> f64 {
    let scale = M19::from_diagonal(&p.diagonal().map(|v| 1.0 / v.abs().sqrt()));
    (scale * p * scale).symmetric_eigenvalues().min()
}

/// Runs a tracker for a minute; gives the smallest eigenvalue met and the sum of its NEES.
fn run(coupling: Coupling, seed: u64) -> (f64, f64) {
    let mut world = World::new(seed);
    let (track, cross) = world.start_track();
    let mut tracker = SchmidtKalman::new(tracker_config(), coupling, track, cross).unwrap();
    let mut smallest = f64::INFINITY;
    let mut nees = 0.0;
    for scan in 0..60 {
        for k in 0..5 {
            world.interval(5 * scan + k).tell(&mut tracker);
        }
        world.step_target();
        tracker.predict(1.0).unwrap();
        let detection = world.detection();
        let covariance = world.navigation.state().covariance;
        let rows = world.navigation.pose_from_error();
        let own = NavigationPose {
            pose: world.navigation.pose(),
            covariance: &covariance,
            pose_from_error: rows,
        };
        tracker.update(&detection, &own);
        smallest = smallest.min(smallest_eigenvalue(&joint(&tracker, &covariance)));
        let error = world.target - tracker.track().state;
        let inverse = tracker.track().covariance.try_inverse();
        nees += inverse.map_or(f64::INFINITY, |p| (error.transpose() * p * error)[(0, 0)]);
    }
    (smallest, nees / 60.0)
}

#[test]
fn the_joint_covariance_stays_positive_with_the_closed_loop_and_not_without() {
    let seeds = 0..8;
    for coupling in [Coupling::Exact, Coupling::FeedForward] {
        let runs: Vec<_> = seeds.clone().map(|seed| run(coupling, seed)).collect();
        assert!(
            runs.iter().all(|(smallest, _)| *smallest > -1e-9),
            "{coupling:?} {runs:?}"
        );
        let nees = runs.iter().map(|(_, nees)| nees).sum::<f64>() / 8.0;
        // Mean of 8 correlated rows of 4 degrees of freedom.
        assert!((2.0..6.0).contains(&nees), "{coupling:?} {nees}");
    }
    let literal: Vec<_> = seeds.map(|seed| run(Coupling::OpenLoop, seed)).collect();
    assert!(
        literal.iter().all(|(smallest, _)| *smallest < -1e-3),
        "{literal:?}"
    );
}

/// A joint covariance of target (first) and navigation in which everything is correlated with everything.
fn full_joint(navigation: &M15) -> M19 {
    let std = SVector::<f64, 19>::from_fn(|i, _| match i {
        0 | 2 => 40.0,
        1 | 3 => 4.0,
        _ => navigation[(i - 4, i - 4)].sqrt(),
    });
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let a = M19::from_fn(|_, _| rng.sample(StandardNormal));
    let scale = M19::from_diagonal(&std);
    scale * (a * a.transpose() / 19.0 + M19::identity() * 0.2) * scale
}

/// The joint covariance in units of its standard deviations in `scale`.
fn scaled(p: &M19, scale: &M19) -> M19 {
    let scale = M19::from_diagonal(&scale.diagonal().map(|v| 1.0 / v.sqrt()));
    scale * p * scale
}

/// Prediction and update are those of the dense filter of 19 states, the navigation's gain being zero in the update of
/// the Schmidt-Kalman filter, and the target's step taken on the arc about the own ship. Target and navigation are correlated in every element, so that no term is zero by itself.
#[test]
fn prediction_and_update_equal_the_dense_schmidt_filter() {
    let mut world = World::new(11);
    let start = full_joint(&world.navigation.state().covariance);
    let covariance: M15 = start.fixed_view::<15, 15>(4, 4).into_owned();
    let state = NavigationState {
        covariance,
        ..*world.navigation.state()
    };
    world.navigation.restore(state).unwrap();
    let track = TrackEstimate {
        state: world.target + Vector4::new(30.0, -2.0, 20.0, 3.0),
        covariance: start.fixed_view::<4, 4>(0, 0).into_owned(),
    };
    let cross = start.fixed_view::<15, 4>(4, 0).into_owned();
    let mut tracker = SchmidtKalman::new(tracker_config(), Coupling::Exact, track, cross).unwrap();
    let mut joint_ekf = JointEkf::new(tracker_config(), track, cross).unwrap();
    assert_relative_eq!(joint(&tracker, &covariance), start, epsilon = 1e-12);

    let dt = 2.0;
    tracker.predict(dt).unwrap();
    joint_ekf.predict(dt).unwrap();
    let mut f = M19::identity();
    (f[(0, 1)], f[(2, 3)]) = (dt, dt);
    let mut by_acceleration = SMatrix::<f64, 19, 2>::zeros();
    for axis in [0, 1] {
        by_acceleration[(2 * axis, axis)] = 0.5 * dt * dt;
        by_acceleration[(2 * axis + 1, axis)] = dt;
    }
    let p = f * start * f.transpose()
        + by_acceleration * by_acceleration.transpose() * 0.05_f64.powi(2);
    assert_relative_eq!(
        scaled(&joint(&tracker, &covariance), &p),
        scaled(&p, &p),
        epsilon = 1e-12
    );

    let rows = world.navigation.pose_from_error();
    let own = NavigationPose {
        pose: world.navigation.pose(),
        covariance: &covariance,
        pose_from_error: rows,
    };
    let detection = world.detection();
    let predicted = PredictedDetection::new(&tracker.track().state, &own.pose).unwrap();
    let mut h = SMatrix::<f64, 2, 19>::zeros();
    h.fixed_view_mut::<2, 4>(0, 0)
        .copy_from(&predicted.by_target);
    h.fixed_view_mut::<2, 15>(0, 4)
        .copy_from(&(predicted.by_pose * rows));
    let r = RADAR.covariance();
    let s = h * p * h.transpose() + r;
    let full = p * h.transpose() * s.try_inverse().unwrap();
    let residual = predicted.residual(&detection);
    let before = tracker.track().state;
    for schmidt in [true, false] {
        let mut k = full;
        if schmidt {
            k.fixed_view_mut::<15, 2>(4, 0).fill(0.0);
        }
        let left = M19::identity() - k * h;
        let expected = left * p * left.transpose() + k * r * k.transpose();
        let moved = k * residual;
        if schmidt {
            let innovation = tracker.update(&detection, &own);
            assert_eq!(innovation.outcome, Outcome::Fused);
            let step = moved.fixed_rows::<4>(0).into_owned();
            let x = on_the_arc(&before, &step, &own.pose);
            let map = map_of_errors(&before, &x, &own.pose);
            assert!((x - before - step).norm() > 0.1, "an arc that shows");
            assert_relative_eq!(tracker.track().state, x, epsilon = 1e-9);
            let mut turn = M19::identity();
            turn.fixed_view_mut::<4, 4>(0, 0).copy_from(&map);
            assert_relative_eq!(
                scaled(&joint(&tracker, &covariance), &p),
                scaled(&(turn * expected * turn.transpose()), &p),
                epsilon = 1e-10
            );
        } else {
            let (_, outside) = joint_ekf.update(&detection, &own);
            let outside = outside.unwrap();
            assert_relative_eq!(
                outside.correction,
                moved.fixed_rows::<15>(4).into_owned(),
                epsilon = 1e-9
            );
            let mut navigation = world.navigation;
            let angle = navigation.correct_from_outside(&outside);
            let mut reset = M15::identity();
            let turn = Matrix3::identity() + angle.cross_matrix() * 0.5;
            reset.fixed_view_mut::<3, 3>(0, 0).copy_from(&turn);
            let block = reset * expected.fixed_view::<15, 15>(4, 4) * reset.transpose();
            let scale = M15::from_diagonal(&covariance.diagonal().map(|v| 1.0 / v.sqrt()));
            assert_relative_eq!(
                scale * navigation.state().covariance * scale,
                scale * block * scale,
                epsilon = 1e-10
            );
        }
    }
}

#[test]
fn what_is_wrong_is_skipped_with_its_reason_and_changes_nothing() {
    let mut world = World::new(2);
    let (track, cross) = world.start_track();
    let mut config = tracker_config();
    config.gate_nis = 20.0;
    let mut tracker = SchmidtKalman::new(config, Coupling::Exact, track, cross).unwrap();
    let before = tracker;
    let covariance = world.navigation.state().covariance;
    let rows = world.navigation.pose_from_error();
    let own = NavigationPose {
        pose: world.navigation.pose(),
        covariance: &covariance,
        pose_from_error: rows,
    };
    let detection = world.detection();
    let nan = RadarDetection {
        range: f64::NAN,
        ..detection
    };
    let over_us = NavigationPose {
        pose: Vector3::new(track.tangent.state[0], track.tangent.state[2], 0.0),
        ..own
    };
    let jumped = NavigationPose {
        pose: own.pose + Vector3::new(1e5, 0.0, 0.0),
        ..own
    };
    let negative = -covariance;
    let not_positive = NavigationPose {
        covariance: &negative,
        ..own
    };
    let nowhere = NavigationPose {
        pose: Vector3::repeat(f64::NAN),
        ..own
    };
    let skipped = |reason| Outcome::Skipped(reason);
    assert_eq!(
        tracker.update(&nan, &own).outcome,
        skipped(SkipReason::NotFinite)
    );
    // Right above us it is not in a direction, but in a place: not where it was seen.
    assert_eq!(tracker.update(&detection, &over_us).outcome, Outcome::Gated);
    assert_eq!(tracker.update(&detection, &jumped).outcome, Outcome::Gated);
    assert_eq!(
        tracker.update(&detection, &not_positive).outcome,
        skipped(SkipReason::Numerical)
    );
    assert_eq!(
        tracker.update(&detection, &nowhere).outcome,
        skipped(SkipReason::NotFinite)
    );
    for (dt, reason) in [
        (0.0, SkipReason::NotNewer),
        (-1.0, SkipReason::NotNewer),
        (f64::NAN, SkipReason::NotFinite),
        (1e9, SkipReason::OutOfRange),
    ] {
        assert_eq!(tracker.predict(dt), Err(reason));
    }
    assert_eq!(tracker, before);
}

/// With the pose error's true lifetime the black box is the exact tracker.
#[test]
fn the_black_box_equals_the_exact_tracker_when_its_times_are_right() {
    let covariance = nalgebra::Matrix3::from_diagonal(&Vector3::new(2.0, 2.0, 0.001));
    let own = NavigationPose {
        pose: Vector3::new(1.0, 2.0, 0.1),
        covariance: &covariance,
        pose_from_error: nalgebra::Matrix3::identity(),
    };
    let detection = RadarDetection {
        range: 1000.0,
        bearing: 0.5,
    };
    let (track, cross) = one_point(&detection, &RADAR, 5.0, &own).unwrap();
    let lifetimes = PoseErrorCorrelation {
        position_s: 0.5,
        heading_s: 4.0,
    };
    let mut black =
        BlackBoxSchmidt::new(tracker_config(), lifetimes, track, cross, &covariance).unwrap();
    let keep = Vector3::new(-2.0_f64, -2.0, -0.25).map(f64::exp);
    let mut exact = SchmidtKalman::new(
        tracker_config(),
        Coupling::Exact,
        track,
        nalgebra::Matrix3::from_diagonal(&keep) * cross,
    )
    .unwrap();
    black.predict(1.0).unwrap();
    exact.predict(1.0).unwrap();
    black.update(&detection, &own.pose, &covariance);
    exact.update(&detection, &own);
    assert_relative_eq!(black.track().state, exact.track().state, epsilon = 1e-9);
    assert_relative_eq!(
        black.track().covariance,
        exact.track().covariance,
        epsilon = 1e-9
    );
    let refused = black.update(&detection, &own.pose, &(-covariance));
    assert_eq!(refused.outcome, Outcome::Skipped(SkipReason::Numerical));
    assert!(Matrix4::cholesky(black.track().covariance).is_some());
}
