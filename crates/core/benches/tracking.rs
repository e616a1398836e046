//! Cost of navigation and tracking: one inertial sample, one fix, one update of each tracker.
//!
//! `cargo bench -p northing-core --bench tracking`

use divan::{Bencher, black_box};
use nalgebra::{SMatrix, SVector, UnitQuaternion, Vector3, Vector4};
use northing_core::navigation::{
    ErrorStateConfig, ErrorStateFilter, ErrorTransition, GnssCompassFix, NavigationState,
};
use northing_core::tracking::initiation::one_point;
use northing_core::tracking::{
    ConstantVelocity, Conversion, ConvertedMeasurement, Coupling, NavigationPose, PoseAsKnown,
    RadarDetection, RadarNoise, SchmidtKalman, SeenTrack, TrackerConfig,
};

fn main() {
    divan::main();
}

fn navigation() -> ErrorStateFilter<f64> {
    let stds = [0.05, 0.5, 1.5, 0.02, 0.0004];
    let state = NavigationState {
        ned_from_body: UnitQuaternion::identity(),
        velocity: Vector3::new(10.0, 0.0, 0.0),
        position: Vector3::zeros(),
        accelerometer_bias: Vector3::zeros(),
        gyroscope_bias: Vector3::zeros(),
        covariance: SMatrix::from_diagonal(&SVector::from_fn(|i, _| {
            let std: f64 = stds[i / 3];
            std * std
        })),
        pending: ErrorTransition::default(),
        skipped: 0,
    };
    let Ok(filter) = ErrorStateFilter::new(ErrorStateConfig::default(), state) else {
        unreachable!("the settings are good");
    };
    filter
}

fn config() -> TrackerConfig<f64> {
    TrackerConfig::new(
        ConstantVelocity {
            acceleration_std: 0.05,
        },
        RadarNoise {
            range_std: 20.0,
            bearing_std: 0.017,
        },
    )
}

const DETECTION: RadarDetection<f64> = RadarDetection {
    range: 3605.0,
    bearing: 0.588,
};

type Start = (
    SeenTrack<f64>,
    SMatrix<f64, 15, 4>,
    SMatrix<f64, 15, 15>,
    SMatrix<f64, 3, 15>,
);

fn start() -> Start {
    let filter = navigation();
    let (covariance, rows) = (filter.state().covariance, filter.pose_from_error());
    let own = NavigationPose {
        pose: filter.pose(),
        covariance: &covariance,
        pose_from_error: rows,
    };
    let Ok((mut track, cross)) = one_point(&DETECTION, &config().radar, 8.0, &own) else {
        unreachable!("the detection is good");
    };
    track.tangent.state = Vector4::new(3000.0, -5.0, 2000.0, -10.0);
    (track, cross, covariance, rows)
}

#[divan::bench]
fn inertial_sample(bencher: Bencher<'_, '_>) {
    let mut filter = navigation();
    let (rate, force) = (Vector3::new(0.01, 0.0, 0.03), Vector3::new(0.1, 0.2, -9.8));
    bencher.bench_local(|| filter.propagate(black_box(&rate), black_box(&force), 1e-6));
}

#[divan::bench]
fn gnss_compass_fix(bencher: Bencher<'_, '_>) {
    let mut filter = navigation();
    let fix = GnssCompassFix {
        position: Vector3::new(0.1, 0.2, 0.0),
        position_std: Vector3::repeat(1.5),
        ned_from_body: UnitQuaternion::identity(),
        attitude_std: Vector3::repeat(0.05),
    };
    bencher.bench_local(|| filter.update_gnss_compass(black_box(&fix)));
}

#[divan::bench]
fn schmidt_update(bencher: Bencher<'_, '_>) {
    let (track, cross, covariance, rows) = start();
    let tracker =
        SchmidtKalman::new(config(), Coupling::Exact, track, cross).expect("within its ranges");
    let own = NavigationPose {
        pose: Vector3::zeros(),
        covariance: &covariance,
        pose_from_error: rows,
    };
    bencher.bench_local(|| {
        let mut tracker = black_box(tracker);
        let _ = tracker.predict(1.0);
        tracker.update(black_box(&DETECTION), &own);
        tracker
    });
}

#[divan::bench]
fn converted_update(bencher: Bencher<'_, '_>) {
    let (track, _, covariance, rows) = start();
    let tracker = ConvertedMeasurement::new(config(), Conversion::Linearized, track.tangent)
        .expect("within its ranges");
    let pose_covariance = rows * covariance * rows.transpose();
    bencher.bench_local(|| {
        let mut tracker = black_box(tracker);
        let _ = tracker.predict(1.0);
        tracker.update(black_box(&DETECTION), &Vector3::zeros(), &pose_covariance);
        tracker
    });
}

#[divan::bench]
fn uncompensated_update(bencher: Bencher<'_, '_>) {
    let tracker = PoseAsKnown::new(config(), start().0).expect("within its ranges");
    bencher.bench_local(|| {
        let mut tracker = black_box(tracker);
        let _ = tracker.predict(1.0);
        tracker.update(black_box(&DETECTION), &Vector3::zeros());
        tracker
    });
}
