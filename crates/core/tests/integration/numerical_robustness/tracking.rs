//! Trackers of one target in each form, and the multi-target tracker.

use nalgebra::{Matrix3, Matrix4, RealField, SMatrix, Vector3, Vector4};
use northing_core::parameters::Range;
use northing_core::tracking::body_frame::OwnIncrement;
use northing_core::tracking::multi_target::MotionModels;
use northing_core::tracking::{
    BlackBoxSchmidt, BodyFrameTracker, ConstantVelocity, Conversion, ConvertedMeasurement,
    Coupling, Detection, DetectionNoise, JointEkf, MultiTargetConfig, MultiTargetTracker,
    NavigationPose, OwnShip, PoseAsKnown, RadarDetection, RadarNoise, Scan, ScanSensor,
    SchmidtKalman, TrackEstimate, TrackerConfig,
};

use super::garbage::{Garbage, number};
use super::harness::{Check, continuable, covariance, record, run};

pub fn settings<T: RealField + Copy>(g: &mut Garbage) -> TrackerConfig<T> {
    let mut one = |usual: f64, range: Range| {
        if g.chance(0.4) {
            g.within(&range)
        } else {
            number(usual)
        }
    };
    let motion = ConstantVelocity::new(one(0.1, Range::From(0.0, 1e3)));
    let radar = RadarNoise::new(
        one(5.0, Range::From(1e-3, 1e6)),
        one(0.02, Range::From(1e-6, 10.0)),
    );
    let gate_nis = one(0.0, Range::From(0.0, 1e6));
    let config = TrackerConfig {
        motion,
        radar,
        gate_nis,
    };
    config.validate().unwrap();
    config
}

/// A track as one detection starts it; standard deviations that are no variances are left out.
pub fn track<T: RealField + Copy>(g: &mut Garbage) -> TrackEstimate<T> {
    loop {
        let stds: Vector4<T> = Vector4::new(g.std(20.0), g.std(5.0), g.std(20.0), g.std(5.0));
        let track = TrackEstimate {
            state: Vector4::new(g.near(900.0), g.near(5.0), g.near(900.0), g.near(5.0)),
            covariance: Matrix4::from_diagonal(&stds.map(|std| std * std)),
        };
        if track.is_usable() {
            return track;
        }
    }
}

pub fn detection<T: RealField + Copy>(g: &mut Garbage) -> RadarDetection<T> {
    let range: T = g.near(1000.0);
    let range = if g.chance(0.9) { range.abs() } else { range };
    RadarDetection::new(range, g.near(3.0))
}

fn pose_covariance<T: RealField + Copy>(g: &mut Garbage) -> Matrix3<T> {
    if g.chance(0.2) {
        let factor = Matrix3::<T>::from_columns(&[g.vector(3.0), g.vector(3.0), g.vector(0.1)]);
        return factor * factor.transpose();
    }
    let stds = Vector3::new(g.std(2.0), g.std(2.0), g.std(0.01));
    Matrix3::from_diagonal(&stds.map(|std: T| std * std))
}

macro_rules! trackers {
    ($($test:ident: $name:literal, $make:ident, $operate:ident;)+) => {$(
        #[test]
        fn $test() {
            run(concat!($name, ", f32"), $make::<f32>, $operate, check);
            run(concat!($name, ", f64"), $make::<f64>, $operate, check);
        }
    )+};
}

trackers! {
    pose_as_known: "pose as known", known, see_known;
    converted_measurement: "converted measurement", converted, see_converted;
    body_frame: "body frame", body, see_body;
    schmidt_kalman: "Schmidt-Kalman", schmidt, see_schmidt;
    joint_ekf: "joint EKF", joint, see_joint;
    beside_a_black_box: "Schmidt-Kalman beside a black box", black_box, see_black_box;
}

/// What all of them show.
trait Tracks<T: RealField + Copy>: northing_core::Restorable + Clone {
    fn estimate(&self) -> TrackEstimate<T>;
}

macro_rules! tracks {
    ($($tracker:ty),+) => {$(
        impl<T: RealField + Copy> Tracks<T> for $tracker {
            fn estimate(&self) -> TrackEstimate<T> {
                self.track()
            }
        }
    )+};
}

tracks!(
    PoseAsKnown<T>,
    ConvertedMeasurement<T>,
    BodyFrameTracker<T>,
    SchmidtKalman<T, 3>,
    JointEkf<T, 3>,
    BlackBoxSchmidt<T>
);

fn check<T: RealField + Copy>(tracker: &impl Tracks<T>) -> Check {
    continuable(tracker)?;
    covariance("covariance", &tracker.estimate().covariance)
}

fn known<T: RealField + Copy>(g: &mut Garbage) -> PoseAsKnown<T> {
    PoseAsKnown::new(settings(g), track(g)).unwrap()
}

fn see_known<T: RealField + Copy>(tracker: &mut PoseAsKnown<T>, g: &mut Garbage) -> Check {
    let _ = tracker.predict(g.interval(1.0));
    record("detection", &tracker.update(&detection(g), &g.vector(3.0)))
}

fn converted<T: RealField + Copy>(g: &mut Garbage) -> ConvertedMeasurement<T> {
    let conversion = if g.chance(0.5) {
        Conversion::Debiased
    } else {
        Conversion::Linearized
    };
    ConvertedMeasurement::new(settings(g), conversion, track(g)).unwrap()
}

fn see_converted<T: RealField + Copy>(
    tracker: &mut ConvertedMeasurement<T>,
    g: &mut Garbage,
) -> Check {
    let _ = tracker.predict(g.interval(1.0));
    let (pose, own) = (g.vector(3.0), pose_covariance(g));
    record("detection", &tracker.update(&detection(g), &pose, &own))
}

fn body<T: RealField + Copy>(g: &mut Garbage) -> BodyFrameTracker<T> {
    BodyFrameTracker::new(settings(g), track(g)).unwrap()
}

fn see_body<T: RealField + Copy>(tracker: &mut BodyFrameTracker<T>, g: &mut Garbage) -> Check {
    let own = OwnIncrement {
        displacement: g.plane(3.0),
        turn: g.near(0.1),
        covariance: pose_covariance(g),
    };
    let _ = tracker.predict(g.interval(1.0), &own);
    record("detection", &tracker.update(&detection(g)))
}

fn own<'a, T: RealField + Copy>(g: &mut Garbage, p: &'a Matrix3<T>) -> NavigationPose<'a, T, 3> {
    NavigationPose {
        pose: g.vector(3.0),
        covariance: p,
        pose_from_error: Matrix3::identity(),
    }
}

/// Not the open loop: as printed it is no recursion of a covariance.
pub fn coupling(g: &mut Garbage) -> Coupling {
    [Coupling::Exact, Coupling::FeedForward][g.below(2)]
}

fn schmidt<T: RealField + Copy>(g: &mut Garbage) -> SchmidtKalman<T, 3> {
    SchmidtKalman::new(settings(g), coupling(g), track(g), SMatrix::zeros()).unwrap()
}

fn see_schmidt<T: RealField + Copy>(tracker: &mut SchmidtKalman<T, 3>, g: &mut Garbage) -> Check {
    let _ = tracker.predict(g.interval(1.0));
    let p = pose_covariance(g);
    let own = own(g, &p);
    record("detection", &tracker.update(&detection(g), &own))
}

fn joint<T: RealField + Copy>(g: &mut Garbage) -> JointEkf<T, 3> {
    JointEkf::new(settings(g), track(g), SMatrix::zeros()).unwrap()
}

fn see_joint<T: RealField + Copy>(tracker: &mut JointEkf<T, 3>, g: &mut Garbage) -> Check {
    let _ = tracker.predict(g.interval(1.0));
    let p = pose_covariance(g);
    let own = own(g, &p);
    let (innovation, _) = tracker.update(&detection(g), &own);
    record("detection", &innovation)
}

fn black_box<T: RealField + Copy>(g: &mut Garbage) -> BlackBoxSchmidt<T> {
    let start = Matrix3::identity();
    BlackBoxSchmidt::new(
        settings(g),
        g.settings(),
        track(g),
        SMatrix::zeros(),
        &start,
    )
    .unwrap()
}

fn see_black_box<T: RealField + Copy>(tracker: &mut BlackBoxSchmidt<T>, g: &mut Garbage) -> Check {
    let _ = tracker.predict(g.interval(1.0));
    let (pose, own) = (g.vector(3.0), pose_covariance(g));
    record("detection", &tracker.update(&detection(g), &pose, &own))
}

struct Scene<T: RealField + Copy> {
    tracker: MultiTargetTracker<T, 3, 8, 8>,
    time_s: T,
}

fn scene<T: RealField + Copy>(g: &mut Garbage) -> Scene<T> {
    let config = MultiTargetConfig {
        models: g.settings::<MotionModels<T>>().into(),
        settings: g.settings(),
    };
    Scene {
        tracker: MultiTargetTracker::new(config).unwrap(),
        time_s: T::zero(),
    }
}

fn scan<T: RealField + Copy>(scene: &mut Scene<T>, g: &mut Garbage) -> Check {
    let sensor = ScanSensor {
        noise: DetectionNoise {
            range_std_m: g.std(3.0),
            bearing_std_rad: g.std(0.01),
            extent_std_m: g.std(1.0),
        },
        detection_probability: if g.chance(0.1) {
            g.near(1.0)
        } else {
            number(0.9)
        },
        clutter_density: if g.chance(0.1) {
            g.near(1.0)
        } else {
            number(1e-6)
        },
        largest_range_m: if g.chance(0.1) {
            g.near(1e4)
        } else {
            number(5000.0)
        },
        covers_all: g.chance(0.8),
        initiates: g.chance(0.8),
    };
    let own_ship = OwnShip {
        north_m: g.near(3.0),
        east_m: g.near(3.0),
        heading_rad: g.near(0.1),
        covariance: pose_covariance(g),
    };
    let detections: Vec<_> = (0..g.below(5))
        .map(|k| {
            let at = 400.0 + 200.0 * k as f64;
            match g.below(6) {
                0 => Detection::Bearing {
                    bearing_rad: g.near(3.0),
                },
                1 => Detection::Position {
                    north_m: g.near(at),
                    east_m: g.near(at),
                },
                _ => {
                    let around: Vector3<T> = g.around([at, 0.3 * k as f64, 0.0], 2.0);
                    Detection::RangeBearing {
                        range_m: around.x,
                        bearing_rad: around.y,
                    }
                }
            }
        })
        .collect();
    let dt: T = g.interval(1.0);
    let time_s = scene.time_s + dt;
    let scan = Scan {
        time_s,
        sensor: &sensor,
        own_ship: &own_ship,
        detections: &detections,
    };
    if scene.tracker.scan(&scan).is_ok() {
        scene.time_s = time_s;
    }
    Ok(())
}

fn check_scene<T: RealField + Copy>(scene: &Scene<T>) -> Check {
    continuable(&scene.tracker)?;
    for track in scene.tracker.tracks() {
        for mode in &track.imm.modes {
            covariance("covariance of a model", &mode.covariance)?;
        }
        let estimate = track.estimate();
        covariance("covariance of a track", &estimate.covariance)?;
        record("track", &track.innovation)?;
        let total = track
            .imm
            .modes
            .iter()
            .fold(T::zero(), |sum, mode| sum + mode.probability);
        let off = (total - T::one()).abs();
        let sums_to_one = off <= number(1e-4);
        if !sums_to_one {
            return Err(format!("probabilities of the models sum to {total}"));
        }
        let existence = track.existence.existence;
        if !(existence >= T::zero() && existence <= number(1.0 + 1e-6)) {
            return Err(format!("existence {existence}"));
        }
    }
    Ok(())
}

#[test]
fn multi_target_single() {
    run("multi-target tracker, f32", scene::<f32>, scan, check_scene);
}

#[test]
fn multi_target_double() {
    run("multi-target tracker, f64", scene::<f64>, scan, check_scene);
}
