//! Every filter: 200 samples in one go equal 100, saved, through JSON, into a fresh filter, and 100 more, to the bit.
//! A state with a number that is not finite is refused, and the filter stays as it was.

#![allow(clippy::unwrap_used)]

use std::fmt::Debug;

use northing_core::attitude::axis_filters::{AxisFilters, AxisFiltersConfig};
use northing_core::attitude::{
    AttitudeConfig, AttitudeDriver, AttitudeEstimator, BoundedVelocity, BoundedVelocityConfig,
    CompassHeading, Complementary, ComplementaryForm, DriverConfig, EkfReconstruction,
    InitialState, Integration, Mekf, Mekf3, QuaternionEkf, QuaternionNorm, References, Usque,
};
use northing_core::geometry::frames::TangentFrame;
use northing_core::geometry::rotation;
use northing_core::nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector2, Vector3, Vector4};
use northing_core::navigation::axis_filters::{PositionAxisConfig, PositionAxisFilters};
use northing_core::navigation::in_motion_alignment::{InMotionAlignment, InMotionAlignmentConfig};
use northing_core::navigation::{
    Cascade, CascadeConfig, DeadReckoning, DeadReckoningConfig, ErrorStateConfig, ErrorStateFilter,
    GnssCompassFix, GnssIns, GnssInsConfig, GnssPosition, GnssVelocity, NavigationState,
};
use northing_core::tracking::body_frame::OwnIncrement;
use northing_core::tracking::{
    BlackBoxSchmidt, BodyFrameTracker, ConstantVelocity, Conversion, ConvertedMeasurement,
    Coupling, Detection, DetectionNoise, JointEkf, MultiTargetConfig, MultiTargetTracker,
    NavigationPose, OwnShip, PoseAsKnown, PoseErrorCorrelation, RadarDetection, RadarNoise, Scan,
    ScanSensor, SchmidtKalman, TrackEstimate, TrackerConfig,
};
use northing_core::{InvalidState, Restorable};
use serde::Serialize;
use serde::de::DeserializeOwned;

/// Runs a filter with and without a save in the middle; then spoils what `single`, the same filter in single
/// precision, would take.
fn check<F, S>(name: &str, make: impl Fn() -> F, mut single: S, mut step: impl FnMut(&mut F, u32))
where
    F: Restorable<State: Serialize + DeserializeOwned + PartialEq + Debug>,
    S: Restorable<State: DeserializeOwned + PartialEq + Debug>,
{
    let mut whole = make();
    for k in 0..100 {
        step(&mut whole, k);
    }
    let text = serde_json::to_string(&whole.save()).unwrap();
    let state: F::State = serde_json::from_str(&text).unwrap();
    let mut restored = make();
    assert_ne!(whole.save(), restored.save(), "{name} has not moved");
    restored
        .restore(state)
        .unwrap_or_else(|e| panic!("{name}: {e}"));
    for k in 100..200 {
        step(&mut whole, k);
        step(&mut restored, k);
    }
    assert_eq!(whole.save(), restored.save(), "{name}");
    let [text, again] = [&whole, &restored].map(|f| serde_json::to_string(&f.save()).unwrap());
    assert_eq!(text, again, "{name}, to the bit");
    assert_refuses(name, &text, &mut single);
}

/// No number of a state may be infinite: 1e308 is, once it is read in single precision.
fn assert_refuses<S>(name: &str, text: &str, filter: &mut S)
where
    S: Restorable<State: DeserializeOwned + PartialEq + Debug>,
{
    filter.restore(serde_json::from_str(text).unwrap()).unwrap();
    let before = filter.save();
    let mut refused = 0;
    for (at, end) in numbers(text) {
        let spoilt = format!("{}1e308{}", &text[..at], &text[end..]);
        // Counters and unit quaternions are refused by their reader.
        let value: serde_json::Value = serde_json::from_str(&spoilt).unwrap();
        let Ok(state) = serde_json::from_value(value) else {
            continue;
        };
        let around = &text[at.saturating_sub(60)..(end + 20).min(text.len())];
        assert!(
            filter.restore(state).is_err(),
            "{name} takes infinity at {around}"
        );
        assert_eq!(filter.save(), before, "{name} changed by a refused state");
        refused += 1;
    }
    assert!(refused > 0, "{name} has no numbers");
}

/// Where the numbers of a JSON text begin and end.
fn numbers(text: &str) -> Vec<(usize, usize)> {
    let is_number = |c: char| c.is_ascii_digit() || "+-.eE".contains(c);
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(start) = text[at..].find([':', '[', ',']).map(|i| at + i + 1) {
        let rest = &text[start..];
        let end = start + rest.find(|c| !is_number(c)).unwrap_or(rest.len());
        if rest.starts_with(|c: char| c == '-' || c.is_ascii_digit()) {
            found.push((start, end));
        }
        at = end.max(start);
    }
    found
}

/// Angular rate, specific force and magnetic field of a device that is waved about, with some noise.
fn samples(k: u32) -> [Vector3<f64>; 3] {
    let t = f64::from(k) * 0.01;
    let jitter = |i: f64| 0.01 * (17.0 * t + 3.0 * i).sin();
    let rate = Vector3::new(0.3 * t.sin(), 0.2, 0.1 * (2.0 * t).cos());
    let force = Vector3::new(0.4 * t, -0.3 + jitter(1.0), 9.78 + jitter(2.0));
    let field = Vector3::new(1.0 + jitter(3.0), 21.5 - t, -42.0);
    [rate, force, field]
}

fn start() -> InitialState<f64> {
    InitialState {
        attitude: rotation::from_yaw_pitch_roll([2.9, 0.02, -0.03]),
        attitude_covariance: Matrix3::identity() * 0.01,
        gyroscope_bias: Vector3::new(0.01, -0.02, 0.005),
        gyroscope_bias_std: 0.01,
        north_known: false,
        references: References {
            specific_force: Vector3::new(0.0, 0.0, 9.81),
            magnetic_field: Some(Vector3::new(0.0, 22.0, -42.0)),
        },
    }
}

fn attitude<E, S>(name: &str, make: impl Fn() -> E + Copy, single: S)
where
    E: AttitudeEstimator<f64> + Restorable<State: Serialize + DeserializeOwned + PartialEq + Debug>,
    S: AttitudeEstimator<f32> + Restorable<State: DeserializeOwned + PartialEq + Debug> + Clone,
{
    let started = move || {
        let mut filter = make();
        filter.initialize(&start());
        filter
    };
    check(name, started, single.clone(), |filter, k| {
        let [rate, force, field] = samples(k);
        let _ = filter.propagate(&rate, 0.01);
        let _ = filter.update_accelerometer(&force);
        if k % 3 == 0 {
            let _ = filter.update_magnetometer(&field);
        }
        if k % 50 == 0 {
            let _ = filter.update_compass(&CompassHeading {
                frame: TangentFrame::Enu,
                heading: 0.3,
                std: 0.1,
            });
        }
    });
    // While it aligns as well as after: the driver starts at half a second.
    check(
        name,
        || AttitudeDriver::new(make(), DriverConfig::default()),
        AttitudeDriver::new(single, DriverConfig::default()),
        |driver, k| {
            let [rate, force, field] = samples(k);
            let time_ns = i64::from(k) * 3_000_000;
            let _ = driver.gyroscope(time_ns, &rate);
            let _ = driver.accelerometer(time_ns, &force);
            let _ = driver.magnetometer(time_ns + 1_000_000, &field);
        },
    );
}

#[test]
fn attitude_estimators_and_their_drivers() {
    let config = AttitudeConfig::default();
    let single = AttitudeConfig::<f32>::default();
    attitude("integration", Integration::default, Integration::default());
    let make = || Mekf::new(config).unwrap();
    attitude("MEKF", make, Mekf::new(single).unwrap());
    let make = || Mekf3::new(config).unwrap();
    attitude("three-state MEKF", make, Mekf3::new(single).unwrap());
    let make = || Usque::new(config).unwrap();
    attitude("USQUE", make, Usque::new(single).unwrap());
    for quaternion_norm in [QuaternionNorm::Projected, QuaternionNorm::Free] {
        let config = AttitudeConfig {
            quaternion_norm,
            ..config
        };
        let make = || QuaternionEkf::new(config).unwrap();
        attitude("quaternion EKF", make, QuaternionEkf::new(single).unwrap());
    }
    let make = || EkfReconstruction::new(config).unwrap();
    attitude(
        "EKF and observer",
        make,
        EkfReconstruction::new(single).unwrap(),
    );
    for form in [
        ComplementaryForm::Explicit,
        ComplementaryForm::Passive,
        ComplementaryForm::Direct,
    ] {
        let make = || Complementary::new(form, config).unwrap();
        attitude(
            "complementary",
            make,
            Complementary::new(form, single).unwrap(),
        );
    }
    let config = BoundedVelocityConfig {
        initial_hard_iron_std_ut: 5.0,
        ..BoundedVelocityConfig::default()
    };
    let single = BoundedVelocity::new(BoundedVelocityConfig::<f32>::default()).unwrap();
    attitude(
        "bounded velocity",
        || BoundedVelocity::new(config).unwrap(),
        single,
    );
}

#[test]
fn axis_filters() {
    let config = AxisFiltersConfig::<f64>::default();
    let make = || AxisFilters::new(config, [0.1, -0.1, 3.0]).unwrap();
    let single = AxisFilters::new(AxisFiltersConfig::<f32>::default(), [0.0; 3]).unwrap();
    check("attitude axis filters", make, single, |filter, k| {
        let [rate, force, field] = samples(k);
        let dt = if k % 7 == 0 { 0.02 } else { 0.01 };
        filter.propagate(&rate, dt).unwrap();
        let _ = filter.update_accelerometer(&-force);
        let _ = filter.update_magnetometer(&field);
    });
    let config = PositionAxisConfig::<f64>::default();
    let make = || PositionAxisFilters::new(config).unwrap();
    let single = PositionAxisFilters::new(PositionAxisConfig::<f32>::default()).unwrap();
    check("position axis filters", make, single, |filter, k| {
        let (_, attitude, force) = body(k);
        filter.propagate(&attitude, &force, 9.81, 0.02).unwrap();
        if k % 10 == 0 {
            let _ = filter.update_position(u64::from(k) + 1, &Vector3::repeat(f64::from(k) * 0.1));
        }
    });
}

/// Angular rate, attitude and specific force of a vehicle that speeds up and turns.
fn body(k: u32) -> (Vector3<f64>, UnitQuaternion<f64>, Vector3<f64>) {
    let t = f64::from(k) * 0.02;
    let attitude = rotation::from_yaw_pitch_roll([0.2 * t, 0.02, 0.01]);
    let rate = Vector3::new(0.001, 0.002, 0.2);
    let force = Vector3::new(0.5, 0.3 * t.sin(), -9.8 + 0.02 * (9.0 * t).sin());
    (rate, attitude, force)
}

#[test]
fn navigation_filters() {
    let level = NavigationState::new(UnitQuaternion::identity(), Vector3::x(), Vector3::zeros());
    let level = level.with_std([0.05, 0.5, 1.5, 0.02, 1e-3]);
    let nowhere = NavigationState::new(
        UnitQuaternion::identity(),
        Vector3::zeros(),
        Vector3::zeros(),
    );
    let make = || ErrorStateFilter::new(ErrorStateConfig::default(), level).unwrap();
    let single = ErrorStateFilter::new(ErrorStateConfig::<f32>::default(), nowhere).unwrap();
    check("error-state filter", make, single, |filter, k| {
        let (rate, ned_from_body, force) = body(k);
        filter.propagate(&rate, &force, 0.02).unwrap();
        if k % 10 == 5 {
            let fix = GnssCompassFix {
                position: Vector3::repeat(0.02 * f64::from(k)),
                position_std: Vector3::repeat(1.5),
                ned_from_body,
                attitude_std: Vector3::repeat(0.05),
            };
            assert!(filter.update_gnss_compass(&fix).position.outcome.is_fused());
        }
    });
    let make = || DeadReckoning::new(DeadReckoningConfig::default()).unwrap();
    let single = DeadReckoning::new(DeadReckoningConfig::<f32>::default()).unwrap();
    check("dead reckoning", make, single, |filter, k| {
        filter.propagate(1.0).unwrap();
        filter.water_velocity(&Vector2::new(2.0, 0.1)).unwrap();
        if k % 20 == 0 {
            let _ = filter.update_position(&Vector2::new(2.1 * f64::from(k), 0.0), 3.0);
        }
    });
    let rest = Vector3::new(0.0, 0.0, -9.81);
    let make = || Cascade::new(CascadeConfig::default(), rest).unwrap();
    let single = Cascade::new(CascadeConfig::<f32>::default(), rest.cast()).unwrap();
    check("cascade", make, single, |filter, k| {
        let (rate, attitude, force) = body(k);
        filter.propagate(&attitude, &force, 0.02).unwrap();
        if k % 5 == 0 {
            let position = Vector3::repeat(0.01 * f64::from(k));
            let _ = filter.update_position(&position, 0.03, &attitude, &rate);
        }
    });
}

/// Saved while it aligns (steps of 10 ms), and once it runs (steps of 0.1 s).
#[test]
fn gnss_ins() {
    for step_ns in [10_000_000, 100_000_000] {
        let config = GnssInsConfig {
            zero_velocity: true,
            non_holonomic: true,
            ..GnssInsConfig::default()
        };
        let make = || GnssIns::<f64>::new(config).unwrap();
        let single = GnssIns::<f32>::new(GnssInsConfig::default()).unwrap();
        check("GNSS/INS", make, single, |ins, k| {
            let time_ns = i64::from(k) * step_ns;
            let t = (time_ns as f64 * 1e-9 - 2.0).max(0.0);
            let acceleration = if t > 0.0 { 1.0 } else { 0.0 };
            let force = Vector3::new(acceleration, 0.01 * (9.0 * t).sin(), -9.806_65);
            ins.imu(time_ns, &Vector3::zeros(), &force).unwrap();
            if k % 10 == 0 {
                let ned = Vector3::new(0.5 * t * t, 0.0, 0.0);
                let std = Vector3::new(2.0, 2.0, 4.0);
                let has_height = true;
                let fix = GnssPosition {
                    ned,
                    std,
                    has_height,
                };
                let _ = ins.gnss_position(time_ns, &fix);
                let (ned, std) = (Vector3::new(t, 0.0, 0.0), Vector3::repeat(0.1));
                let has_vertical = true;
                let _ = ins.gnss_velocity(
                    time_ns,
                    &GnssVelocity {
                        ned,
                        std,
                        has_vertical,
                    },
                );
            }
        });
    }
}

/// Circles without turning, with a position a second, a velocity with each, and a heading now and then.
#[test]
fn in_motion_alignment() {
    type Alignment<T> = InMotionAlignment<T, 2, 4>;
    let config = InMotionAlignmentConfig::default();
    let single = Alignment::<f32>::new(InMotionAlignmentConfig::default()).unwrap();
    let make = || Alignment::<f64>::new(config).unwrap();
    check("in-motion alignment", make, single, |alignment, k| {
        let t = f64::from(k) * 0.05;
        let circle = Vector3::new(-t.cos(), -t.sin(), 0.0) * 4.0;
        if k % 20 == 0 {
            let fix = GnssPosition {
                ned: circle,
                std: Vector3::repeat(0.5),
                has_height: true,
            };
            let _ = alignment.gnss_position(&fix);
            let ned = Vector3::new(t.sin(), -t.cos(), 0.0) * 4.0;
            let _ = alignment.gnss_velocity(&GnssVelocity::new(ned, Vector3::repeat(0.1)));
        }
        if k % 30 == 7 {
            let _ = alignment.heading(0.1, 0.2);
        }
        let force = Vector3::new(-circle.x, -circle.y, -9.806_65);
        let rate = Vector3::new(0.0, 0.01 * t.sin(), 0.0);
        alignment.propagate(&rate, &force, 0.05).unwrap();
    });
}

const RADAR: RadarNoise<f64> = RadarNoise {
    range_std: 5.0,
    bearing_std: 0.02,
};

fn seen(k: u32) -> RadarDetection<f64> {
    let t = f64::from(k);
    RadarDetection {
        range: 900.0 + 2.0 * t,
        bearing: 0.7 + 0.002 * t.sin(),
    }
}

#[test]
fn trackers_of_one_target() {
    let motion = ConstantVelocity {
        acceleration_std: 0.1,
    };
    let config = TrackerConfig::new(motion, RADAR);
    let track = TrackEstimate {
        state: Vector4::new(688.0, 0.0, 580.0, 0.0),
        covariance: SMatrix::from_diagonal(&Vector4::new(300.0, 25.0, 300.0, 25.0)),
    };
    let track32 = TrackEstimate {
        state: track.state.cast::<f32>(),
        covariance: track.covariance.cast(),
    };
    let config32 = TrackerConfig::new(
        ConstantVelocity {
            acceleration_std: 0.1,
        },
        RadarNoise {
            range_std: 5.0,
            bearing_std: 0.02,
        },
    );
    let pose = Vector3::new(0.0, 0.0, 0.01);
    let covariance = Matrix3::from_diagonal(&Vector3::new(2.0, 2.0, 1e-4));
    let own = NavigationPose {
        pose,
        covariance: &covariance,
        pose_from_error: Matrix3::identity(),
    };
    let cross = SMatrix::<f64, 3, 4>::from_element(0.01);
    let make = || PoseAsKnown::new(config, track).unwrap();
    let single = PoseAsKnown::new(config32, track32).unwrap();
    check("pose as known", make, single, |tracker, k| {
        tracker.predict(1.0).unwrap();
        let _ = tracker.update(&seen(k), &pose);
    });
    let make = || ConvertedMeasurement::new(config, Conversion::Debiased, track).unwrap();
    let single = ConvertedMeasurement::new(config32, Conversion::Debiased, track32).unwrap();
    check("converted measurement", make, single, |tracker, k| {
        tracker.predict(1.0).unwrap();
        let _ = tracker.update(&seen(k), &pose, &covariance);
    });
    let make = || SchmidtKalman::new(config, Coupling::Exact, track, cross).unwrap();
    let single = SchmidtKalman::new(config32, Coupling::Exact, track32, cross.cast()).unwrap();
    check("Schmidt-Kalman", make, single, |tracker, k| {
        tracker.predict(1.0).unwrap();
        let _ = tracker.update(&seen(k), &own);
    });
    let make = || JointEkf::new(config, track, cross).unwrap();
    let single = JointEkf::new(config32, track32, cross.cast()).unwrap();
    check("joint EKF", make, single, |tracker, k| {
        tracker.predict(1.0).unwrap();
        let (innovation, outside) = tracker.update(&seen(k), &own);
        assert!(innovation.outcome.is_fused() && outside.is_some());
    });
    let memory = PoseErrorCorrelation::default();
    let make = || BlackBoxSchmidt::new(config, memory, track, cross, &covariance).unwrap();
    let single = BlackBoxSchmidt::new(
        config32,
        PoseErrorCorrelation::default(),
        track32,
        cross.cast(),
        &covariance.cast(),
    )
    .unwrap();
    check(
        "Schmidt-Kalman beside a black box",
        make,
        single,
        |tracker, k| {
            tracker.predict(1.0).unwrap();
            let _ = tracker.update(&seen(k), &pose, &covariance);
        },
    );
    let own = OwnIncrement {
        displacement: Vector2::new(1.0, 0.0),
        turn: 0.001,
        covariance: covariance * 1e-3,
    };
    let make = || BodyFrameTracker::new(config, track).unwrap();
    let single = BodyFrameTracker::new(config32, track32).unwrap();
    check("body frame", make, single, |tracker, k| {
        tracker.predict(1.0, &own).unwrap();
        let _ = tracker.update(&seen(k));
    });
}

#[test]
fn multi_target_tracker() {
    let sensor = ScanSensor {
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
    let own_ship = OwnShip::exact(0.0, 0.0, 0.1).with_std(1.0, 1.0, 0.01);
    let make = || MultiTargetTracker::<f64, 3, 8, 8>::new(MultiTargetConfig::default()).unwrap();
    let single = MultiTargetTracker::<f32, 3, 8, 8>::new(MultiTargetConfig::default()).unwrap();
    check("multi-target tracker", make, single, |tracker, k| {
        let t = f64::from(k);
        let at = |range_m, bearing_rad| Detection::RangeBearing {
            range_m,
            bearing_rad,
        };
        let clutter = at(500.0 + (7.7 * t) % 900.0, (1.3 * t).sin());
        let detections = [
            at(800.0 + 2.0 * t, 0.5),
            at(700.0, -0.7 + 1e-3 * t),
            clutter,
        ];
        let scan = Scan {
            time_s: t,
            sensor: &sensor,
            own_ship: &own_ship,
            detections: &detections[..1 + (k % 3) as usize],
        };
        tracker.scan(&scan).unwrap();
    });
}

#[test]
fn quaternions_are_written_w_first_and_matrices_as_rows() {
    let mut filter = Mekf::<f64>::new(AttitudeConfig::default()).unwrap();
    filter.initialize(&InitialState {
        attitude: UnitQuaternion::from_euler_angles(0.0, 0.0, 1.0),
        ..start()
    });
    let json = serde_json::to_value(filter.save()).unwrap();
    assert_eq!(json["attitude"][0], 0.5_f64.cos());
    assert_eq!(json["attitude"][3], 0.5_f64.sin());
    assert_eq!(json["covariance"].as_array().unwrap().len(), 6);
    assert_eq!(json["covariance"][5].as_array().unwrap().len(), 6);
}

#[test]
fn what_no_filter_can_have_left_is_named() {
    let mut filter = Mekf::<f64>::new(AttitudeConfig::default()).unwrap();
    let good = filter.save();
    let mut refused = |spoil: fn(&mut northing_core::attitude::MekfState<f64>)| {
        let mut state = good;
        spoil(&mut state);
        let InvalidState { part, .. } = filter.restore(state).unwrap_err();
        assert_eq!(filter.save(), good);
        part
    };
    assert_eq!(refused(|s| s.gyroscope_bias.y = f64::NAN), "gyroscope bias");
    assert_eq!(refused(|s| s.covariance[(2, 2)] = -1e-9), "covariance");
    assert_eq!(refused(|s| s.covariance[(0, 1)] = 0.1), "covariance");
    assert_eq!(
        refused(|s| s.covariance[(4, 4)] = f64::INFINITY),
        "covariance"
    );
    let shrink = |s: &mut northing_core::attitude::MekfState<f64>| {
        let q = s.attitude.into_inner() * 0.9;
        s.attitude = UnitQuaternion::new_unchecked(q);
    };
    assert_eq!(refused(shrink), "attitude");
    // Symmetric, each correlation below one, and yet of no distribution.
    let contradict = |s: &mut northing_core::attitude::MekfState<f64>| {
        s.covariance.fill_with_identity();
        for (i, j) in [(0, 1), (1, 2), (0, 2)] {
            let value = if (i, j) == (0, 2) { -0.9 } else { 0.9 };
            s.covariance[(i, j)] = value;
            s.covariance[(j, i)] = value;
        }
    };
    assert_eq!(refused(contradict), "covariance");
}
