//! What is learnt, what grows, frames, blocks, rates; beside them Jacobians and robustness.

mod gyroscope_bias;
mod hard_iron;
mod jacobians;
mod robustness;

use super::*;
use crate::attitude::driver::{AttitudeDriver, DriverConfig};
use crate::attitude::integration::Integration;
use crate::attitude::test_world;
use crate::attitude::{AttitudeConfig, References};
use crate::faults::bias_step::LEARNT;
use crate::geometry::frames::TangentFrame;
use crate::kalman::covariance::cholesky;
use crate::kalman::{Outcome, SkipReason};
use layout::{CAPACITY, SCALE};
use nalgebra::{Matrix3, SMatrix, Vector3};
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use std::vec::Vec;

const FIELD: [f64; 2] = [27.0, 33.0];

fn full<T: Scalar>() -> BoundedVelocityConfig<T> {
    BoundedVelocityConfig {
        initial_hard_iron_std_ut: lit(12.0),
        ..BoundedVelocityConfig::lab()
    }
}

fn initial<T: Scalar>(frame: TangentFrame, attitude: UnitQuaternion<T>) -> InitialState<T> {
    let config = BoundedVelocityConfig::<T>::lab();
    let tilt = config.initial_tilt_std;
    InitialState {
        attitude,
        attitude_covariance: Matrix3::identity() * (tilt * tilt),
        gyroscope_bias: Vector3::zeros(),
        gyroscope_bias_std: config.initial_gyroscope_bias_std,
        north_known: false,
        references: References {
            specific_force: frame.specific_force_at_rest(lit(9.81)),
            magnetic_field: Some(frame.magnetic_field(lit(FIELD[0]), lit(FIELD[1]))),
        },
    }
}

fn filter<T: Scalar>(config: BoundedVelocityConfig<T>) -> BoundedVelocity<T> {
    let mut filter = BoundedVelocity::new(config).unwrap();
    filter.initialize(&initial(TangentFrame::Enu, UnitQuaternion::identity()));
    filter
}

/// What is wrong with the sensors of [`hand`].
#[derive(Default)]
struct Errors {
    bias: Vector3<f64>,
    scale: Matrix3<f64>,
    hard_iron: Vector3<f64>,
}

/// A device that a hand turns and shakes, at 100 Hz in ENU; calls `step` with truth and samples.
fn hand(
    seconds: u32,
    seed: u64,
    errors: &Errors,
    mut step: impl FnMut(&UnitQuaternion<f64>, &[Vector3<f64>; 3]),
) {
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut noise = |std: f64| Vector3::from_fn(|_, _| std * rng.sample::<f64, _>(StandardNormal));
    let frame = TangentFrame::Enu;
    let field = frame.magnetic_field(FIELD[0], FIELD[1]);
    // The filter's M corrects what was measured: w = (I + M) w_m - b.
    let unscaled = (Matrix3::identity() + errors.scale).try_inverse().unwrap();
    let mut truth = UnitQuaternion::identity();
    for k in 0..seconds * 100 {
        let t = f64::from(k) * 0.01;
        let rate = Vector3::new(
            2.0 * (1.7 * t).sin(),
            1.5 * (1.1 * t).cos(),
            1.8 * (0.6 * t).sin(),
        );
        let sway = Vector3::new((5.0 * t).sin(), (4.0 * t).cos(), 0.5 * (6.0 * t).sin());
        truth = rotation::renormalize(&(truth * so3::exp(&(rate * 0.01))));
        let force = frame.specific_force_at_rest(9.81) + sway * 2.0;
        let samples = [
            unscaled * (rate + errors.bias) + noise(0.005),
            truth.inverse() * force + noise(0.05),
            truth.inverse() * field + errors.hard_iron + noise(0.5),
        ];
        step(&truth, &samples);
    }
}

fn step_all<T: Scalar>(f: &mut BoundedVelocity<T>, samples: &[Vector3<f64>; 3]) {
    let [w, a, m] = samples.map(|v| v.map(lit::<T>));
    f.propagate(&w, lit(0.01));
    f.update_accelerometer(&a);
    f.update_magnetometer(&m);
}

fn is_sound(f: &BoundedVelocity<impl Scalar>) -> bool {
    let n = f.state.layout.len();
    let p = f
        .state
        .covariance
        .map(|v| nalgebra::try_convert::<_, f64>(v).unwrap());
    // Scaled to unit diagonal, and what is not in use made harmless.
    let mut scaled = p;
    for i in 0..CAPACITY {
        for j in 0..CAPACITY {
            scaled[(i, j)] /= (p[(i, i)] * p[(j, j)]).sqrt();
            if i >= n || j >= n {
                assert!(p[(i, j)] == 0.0, "state {i} or {j} is not in use");
                scaled[(i, j)] = f64::from(u8::from(i == j));
            }
        }
    }
    scaled += layout::Covariance::identity() * 1e-6;
    p == p.transpose() && cholesky(&scaled).is_some()
}

#[test]
fn attitude_bias_scale_and_hard_iron_are_learnt_with_an_consistent_covariance() {
    let errors = Errors {
        bias: Vector3::new(0.03, -0.02, 0.015),
        scale: Matrix3::new(0.004, 0.001, 0.0, -0.001, -0.005, 0.0, 0.0, 0.001, 0.003),
        hard_iron: Vector3::new(9.0, -12.0, 7.0),
    };
    let mut f = filter(full());
    let (mut worst, mut count) = (0.0_f64, 0);
    hand(120, 1, &errors, |truth, samples| {
        step_all(&mut f, samples);
        count += 1;
        if count > 6000 {
            let error = so3::log(&(f.attitude().inverse() * truth));
            worst = worst.max(error.norm().to_degrees());
            let p = f.attitude_covariance().unwrap();
            let nees = error.dot(&(p.try_inverse().unwrap() * error));
            assert!(nees < 16.3, "NEES {nees} at {count}");
        }
    });
    assert!(worst < 1.5, "{worst} deg");
    let state = f.state();
    assert!((state.gyroscope_bias - errors.bias).amax() < 2e-3);
    assert!(
        (state.scale - errors.scale).amax() < 2e-3,
        "{}",
        state.scale
    );
    let iron = state.hard_iron_ut - errors.hard_iron;
    assert!(iron.amax() < 1.0, "{iron}");
    assert!(is_sound(&f));
}

/// A car that stands, gets to 15 m/s, goes on, brakes and starts again; errors of the tilt from 5 s on in standard deviations,
/// and their root mean square in degrees.
fn drive(config: BoundedVelocityConfig<f64>) -> (Vec<f64>, f64) {
    let mut f = BoundedVelocity::new(config).unwrap();
    let mut start = initial(TangentFrame::Enu, UnitQuaternion::identity());
    start.references.magnetic_field = None;
    f.initialize(&start);
    let mut rng = Pcg64Mcg::seed_from_u64(3);
    let mut noise = |std: f64| Vector3::from_fn(|_, _| std * rng.sample::<f64, _>(StandardNormal));
    let (mut sigmas, mut square) = (Vec::new(), 0.0);
    for k in 0..9000 {
        let acceleration = match k % 4500 {
            800..1400 => 2.5,
            2600..3100 => -3.0,
            _ => 0.0,
        };
        f.propagate(&(noise(0.01) + Vector3::new(0.002, -0.004, 0.001)), 0.01);
        f.update_accelerometer(&(noise(0.5) + Vector3::new(acceleration, 0.0, 9.81)));
        if k > 500 {
            let error = so3::log(&f.state.level_from_body).xy();
            let std = f.state.covariance.fixed_view::<2, 2>(0, 0).trace().sqrt();
            sigmas.push(error.norm() / std);
            square += error.norm_squared();
        }
    }
    let rms = (square / sigmas.len() as f64).sqrt();
    (sigmas, rms.to_degrees())
}

#[test]
fn a_car_is_no_hand() {
    let outside = |sigmas: &[f64]| {
        let count = sigmas.iter().filter(|s| **s > 2.0).count();
        count as f64 / sigmas.len() as f64
    };
    let config = BoundedVelocityConfig::<f64>::lab();
    let (sigmas, rms) = drive(config);
    assert!(
        outside(&sigmas) < 0.1 && rms < 2.5,
        "{} {rms}",
        outside(&sigmas)
    );
    // Hypotheses that are all so fast that none is told from another: the first stays.
    let hand = BoundedVelocityConfig {
        hand_velocity_std: 1e4,
        ..config
    };
    let (sigmas, wrong) = drive(hand);
    assert!(
        outside(&sigmas) > 0.3 && wrong > 2.0 * rms,
        "{} {wrong} {rms}",
        outside(&sigmas)
    );
}

/// Largest angle between true and estimated up, deg, in the last ten seconds of two minutes in a hand without a magnetometer that
/// turns slowly, whose bias steps after a minute; and its standard deviation then.
fn after_a_step(config: BoundedVelocityConfig<f64>, step: &Vector3<f64>) -> (f64, f64) {
    let mut f = filter(config);
    let mut rng = Pcg64Mcg::seed_from_u64(7);
    let mut noise = |std: f64| Vector3::from_fn(|_, _| std * rng.sample::<f64, _>(StandardNormal));
    let (mut truth, mut worst, mut std) = (UnitQuaternion::identity(), 0.0_f64, 0.0);
    for k in 0..12_000 {
        let t = f64::from(k) * 0.01;
        let rate = Vector3::new((0.5 * t).sin(), (0.4 * t).cos(), 0.3) * 0.5;
        truth = rotation::renormalize(&(truth * so3::exp(&(rate * 0.01))));
        let sway = Vector3::new((5.0 * t).sin(), (4.0 * t).cos(), 0.0) * 0.3;
        let bias = if k > 6000 { *step } else { Vector3::zeros() };
        f.propagate(&(rate + bias + noise(0.002)), 0.01);
        let force = truth.inverse() * (Vector3::new(0.0, 0.0, 9.81) + sway);
        f.update_accelerometer(&(force + noise(0.1)));
        if k > 11_000 {
            let up = f.state.level_from_body * (truth.inverse() * Vector3::z());
            worst = worst.max(up.angle(&Vector3::z()).to_degrees());
            std = f.state.covariance.fixed_view::<2, 2>(0, 0).trace().sqrt();
        }
    }
    (worst, std.to_degrees())
}

/// GIVEN a hand WHEN the bias steps by a degree a second THEN the tilt is right again within a minute; it never was without the
/// hypothesis of a bias that drifts.
#[test]
fn a_step_of_the_bias_is_no_vehicle() {
    let config = BoundedVelocityConfig::<f64>::lab();
    let step = Vector3::new(0.012, -0.01, 0.008);
    let (tilt, std) = after_a_step(config, &step);
    let never = BoundedVelocityConfig {
        drifting_bias_weight: 0.0,
        ..config
    };
    let (lost, stated) = after_a_step(never, &step);
    assert!(tilt < 2.0 && tilt < 3.0 * std, "{tilt} {std}");
    assert!(lost > 5.0 * stated, "{lost} {stated}");
}

/// GIVEN a device that rests WHEN its bias steps THEN the filter has it in seconds, and a turn about the vertical, which no
/// accelerometer sees, stays a turn.
#[test]
fn a_step_of_the_bias_at_a_rest_is_followed_at_once() {
    let after = |doubt: f64, step: Vector3<f64>| {
        let mut f = filter(BoundedVelocityConfig {
            rest_bias_doubt: doubt,
            ..BoundedVelocityConfig::<f64>::lab()
        });
        for k in 0..7000 {
            let bias = if k < 6000 { Vector3::zeros() } else { step };
            f.propagate(&bias, 0.01);
            f.update_accelerometer(&Vector3::new(0.0, 0.0, 9.81));
        }
        (f.state.gyroscope_bias - step).norm() / step.norm()
    };
    let tilting = Vector3::new(0.014, 0.0, 0.003);
    assert!(after(3.0, tilting) < 0.2 && after(0.0, tilting) > 0.7);
    let upright = Vector3::new(0.0, 0.0, 0.014);
    assert!((after(3.0, upright) - after(0.0, upright)).abs() < 1e-9);
}

/// Sees what the smoother is told of the covariance, and what it is not.
#[derive(Default)]
struct Watcher {
    last: Option<layout::Covariance<f64>>,
    untold: usize,
    widenings: usize,
}

impl StepObserver<f64> for Watcher {
    fn observe(&mut self, moment: Moment<'_, f64>, state: &BoundedVelocityState<f64>) {
        if let Moment::Leaving(step) = moment {
            let told = self.last.as_ref() == Some(&state.covariance);
            self.untold += usize::from(!told);
            self.widenings += usize::from(matches!(step, Step::Widening));
        }
        self.last = Some(state.covariance);
    }
}

/// GIVEN a hand that moves, rests while its bias steps, and moves on WHEN somebody records the steps for a smoother THEN they are told
/// of every change of the covariance.
#[test]
fn no_change_of_the_covariance_is_untold() {
    let config = BoundedVelocityConfig::<f64>::lab();
    let mut f = BoundedVelocity::observed(config, Watcher::default()).unwrap();
    f.initialize(&initial(TangentFrame::Enu, UnitQuaternion::identity()));
    for k in 0..9000 {
        let t = f64::from(k) * 0.01;
        let bias = if k < 6000 { 0.0 } else { 0.014 };
        let moves = if (500..8000).contains(&k) { 0.0 } else { 1.0 };
        f.propagate(
            &Vector3::new(bias + moves * (7.0 * t).sin(), 0.0, 0.0),
            0.01,
        );
        let push = moves * 2.0 * (9.0 * t).cos();
        f.update_accelerometer(&Vector3::new(push, 0.0, 9.81));
        f.update_magnetometer(&Vector3::new(0.0, FIELD[0], -FIELD[1]));
    }
    assert!(f.observer().widenings > 0);
    assert_eq!(f.observer().untold, 0);
}

#[test]
fn north_east_down_is_the_same_filter() {
    let mut enu = filter(full::<f64>());
    let mut ned = BoundedVelocity::new(full()).unwrap();
    let turn = crate::geometry::frames::enu_from_ned_rotation::<f64>().inverse();
    ned.initialize(&initial(TangentFrame::Ned, turn));
    hand(5, 2, &Errors::default(), |_, samples| {
        step_all(&mut enu, samples);
        step_all(&mut ned, samples);
        let expected = turn * enu.attitude();
        assert!(rotation::angle_between(&expected, &ned.attitude()) < 1e-9);
    });
    let (p, q) = (enu.attitude_covariance(), ned.attitude_covariance());
    assert!((p.unwrap() - q.unwrap()).amax() < 1e-12);
}

#[test]
fn blocks_that_are_off_are_not_there() {
    for (scale, iron, field, states) in [
        (ScaleStates::Off, 0.0, 0.0, 8),
        (ScaleStates::Diagonal, 0.0, 5.0, 13),
        (ScaleStates::Diagonal, 12.0, 5.0, 16),
        (ScaleStates::Full, 12.0, 5.0, 22),
    ] {
        let mut f = filter(BoundedVelocityConfig {
            scale_states: scale,
            initial_hard_iron_std_ut: iron,
            initial_field_std_ut: field,
            ..BoundedVelocityConfig::<f64>::lab()
        });
        let mut error = f64::NAN;
        hand(20, 3, &Errors::default(), |truth, samples| {
            step_all(&mut f, samples);
            error = rotation::angle_between(truth, &f.attitude()).to_degrees();
        });
        assert_eq!(f.state.layout.len(), states);
        assert!(is_sound(&f) && error < 1.5, "{error} deg");
        assert_eq!(scale == ScaleStates::Off, f.state.scale == Matrix3::zeros());
        assert_eq!(iron > 0.0, f.state.hard_iron_ut != Vector3::zeros());
    }
}

/// Acceptance test (f): the gyroscope alone, and a covariance that says so.
#[test]
fn without_other_sensors_the_gyroscope_is_followed_and_the_covariance_grows() {
    // What a bias or a scale turned, motion can turn back: they are known here.
    let mut f = BoundedVelocity::new(BoundedVelocityConfig {
        scale_states: ScaleStates::Off,
        gyroscope_noise_density: 0.05,
        ..full::<f64>()
    })
    .unwrap();
    let mut gyroscope = Integration::default();
    let mut start = initial(TangentFrame::Enu, UnitQuaternion::identity());
    start.gyroscope_bias_std = 0.0;
    f.initialize(&start);
    gyroscope.initialize(&start);
    let trace = |f: &BoundedVelocity<f64>| f.attitude_covariance().unwrap().trace();
    let (mut last, mut count) = (trace(&f), 0);
    hand(20, 4, &Errors::default(), |_, samples| {
        f.propagate(&samples[0], 0.01);
        gyroscope.propagate(&samples[0], 0.01);
        count += 1;
        if count % 100 == 0 {
            assert!(trace(&f) > last, "{} after {last}", trace(&f));
            last = trace(&f);
        }
    });
    let apart = rotation::angle_between(&gyroscope.attitude(), &f.attitude());
    assert!(apart < 1e-9, "{apart} rad");
    assert!(last > 0.1, "{last} rad^2");
}

/// A gyroscope whose white noise is eight times what is configured, on a table: the driver learns it from the samples, and the filter states it.
#[test]
fn white_noise_of_the_gyroscope_is_learnt_where_it_is_more_than_configured() {
    let at_the_table = |density: f64, gain: f64| {
        let config = BoundedVelocityConfig {
            gyroscope_noise_gain: gain,
            ..BoundedVelocityConfig::lab()
        };
        let filter = BoundedVelocity::new(config).unwrap();
        let mut driver = AttitudeDriver::new(filter, DriverConfig::default());
        let mut rng = Pcg64Mcg::seed_from_u64(9);
        for k in 0..2000_i64 {
            let time_ns = k * 10_000_000;
            let std = density * 10.0;
            let noise = Vector3::from_fn(|_, _| std * rng.sample::<f64, _>(StandardNormal));
            driver.gyroscope(time_ns, &noise);
            driver.accelerometer(time_ns, &Vector3::new(0.0, 0.0, 9.8));
        }
        driver.estimator
    };
    let noisy = at_the_table(1e-2, 1.0);
    let learnt = noisy.state.gyroscope_noise_psd.sqrt();
    assert!((learnt / 1e-2 - 1.0).abs() < 0.2, "{learnt}");
    let good = at_the_table(1e-5, 1.0);
    let deaf = at_the_table(1e-2, 0.0);
    // Level all the time: the first two axes are the tilt.
    let tilt = |f: &BoundedVelocity<f64>| {
        let p = f.attitude_covariance().unwrap();
        p[(0, 0)] + p[(1, 1)]
    };
    assert!(tilt(&noisy) > 1.5 * tilt(&deaf), "{}", tilt(&noisy));
    assert!(tilt(&noisy) > 1.5 * tilt(&good));
    let mut f = noisy;
    for nonsense in [f64::NAN, f64::INFINITY, -1.0] {
        f.learn_gyroscope_noise(nonsense);
        assert!((f.state.gyroscope_noise_psd.sqrt() - learnt).abs() < 1e-12);
    }
}

#[test]
fn without_a_magnetometer_the_tilt_is_kept_and_the_heading_variance_grows() {
    let config = BoundedVelocityConfig::<f64>::lab();
    let mut f = BoundedVelocity::new(config).unwrap();
    let mut start = initial(TangentFrame::Enu, UnitQuaternion::identity());
    start.references.magnetic_field = None;
    start.attitude_covariance = Matrix3::identity() * 4e-4;
    f.initialize(&start);
    let prior = config.initial_gyroscope_bias_without_magnetometer_std;
    let (_, p) = f.gyroscope_bias().unwrap();
    assert!((p[(2, 2)] - prior * prior).abs() < 1e-15, "its own prior");
    let up = |f: &BoundedVelocity<f64>| f.state.covariance[(2, 2)];
    let before = up(&f);
    let mut tilt = f64::NAN;
    hand(60, 5, &Errors::default(), |truth, samples| {
        f.propagate(&samples[0], 0.01);
        f.update_accelerometer(&samples[1]);
        let record = f.update_magnetometer(&samples[2]);
        assert_eq!(record.outcome, Outcome::Skipped(SkipReason::NotInitialized));
        tilt = (f.attitude() * (truth.inverse() * Vector3::z())).angle(&Vector3::z());
    });
    assert!(tilt.to_degrees() < 0.5, "{} deg", tilt.to_degrees());
    let level = f.state.covariance[(0, 0)];
    assert!(up(&f) > before && level < 2e-4, "{} {level}", up(&f));
    assert_eq!(f.state.layout.len(), 17);
}

/// However long it is shaken: what the velocity tells is not the heading (B8c).
#[test]
fn without_a_magnetometer_shaking_makes_no_heading() {
    let mut config = full::<f64>();
    // Nothing but the angle's own noise may change what is known of the heading.
    config.scale_states = ScaleStates::Off;
    let mut start = initial(TangentFrame::Enu, UnitQuaternion::identity());
    start.references.magnetic_field = None;
    start.gyroscope_bias_std = 1e-9;
    config.gyroscope_bias_random_walk = 1e-12;
    let mut f = BoundedVelocity::new(config).unwrap();
    f.initialize(&start);
    let mut last = f.state.covariance[(2, 2)];
    for k in 0..6000 {
        let t = f64::from(k) * 0.01;
        let force = Vector3::new(8.0 * (5.0 * t).sin(), 6.0 * (7.0 * t).cos(), 9.81);
        f.propagate(&Vector3::zeros(), 0.01);
        f.update_accelerometer(&force);
        let now = f.state.covariance[(2, 2)];
        assert!(now > last * (1.0 - 1e-9), "step {k}: {now} after {last}");
        last = now;
    }
    assert!(f.state.covariance[(0, 0)] < 1e-3, "the tilt is learnt");
}

#[test]
fn a_bias_of_the_accelerometer_widens_what_is_stated_of_the_tilt_alone() {
    let mut config = full::<f64>();
    let plain = filter(config);
    config.accelerometer_bias_std = 0.05;
    let wide = filter(config);
    assert_eq!(plain.state, wide.state);
    let stated = |f: &BoundedVelocity<f64>| f.attitude_covariance().unwrap();
    let more = stated(&wide) - stated(&plain);
    let tilt = (0.05_f64 / 9.81).powi(2);
    let expected = Matrix3::from_diagonal(&Vector3::new(tilt, tilt, 0.0));
    assert!((more - expected).amax() < 1e-12, "{more}");
}

#[test]
fn a_rest_tells_the_bias() {
    let run = |moving: f64| {
        let mut f = filter(BoundedVelocityConfig {
            gyroscope_bias_freedom: 0.0,
            ..BoundedVelocityConfig::<f64>::lab()
        });
        for k in 0..1000 {
            let shake = Vector3::new(moving * (f64::from(k) * 0.07).sin(), 0.0, 0.0);
            f.propagate(&(test_world::BIAS + shake), 0.01);
            f.update_accelerometer(&(Vector3::z() * 9.81 + shake * 5.0));
        }
        (f.gyroscope_bias().unwrap(), f.state.rest.is_resting())
    };
    let ((bias, p), resting) = run(0.0);
    assert!(resting && (bias - test_world::BIAS).amax() < 1e-3, "{bias}");
    assert!(p[(2, 2)].sqrt() < 1.2e-3);
    let ((_, p), resting) = run(0.5);
    assert!(!resting && p[(2, 2)].sqrt() > 0.015, "heading bias unseen");
}

#[test]
fn clipping_widens_and_a_pause_of_the_accelerometer_forgets_the_velocity() {
    let config = BoundedVelocityConfig {
        gyroscope_saturation: 7.0,
        ..BoundedVelocityConfig::<f64>::lab()
    };
    let grown = |config| {
        let mut f = filter(config);
        // Two steps of the covariance, which waits for an update for 0.1 s.
        for _ in 0..22 {
            f.propagate(&Vector3::new(7.2, 0.0, 0.0), 0.01);
        }
        f.attitude_covariance().unwrap().trace()
    };
    assert!(grown(config) > grown(BoundedVelocityConfig::lab()) + 3.0 * 0.2 * 0.2);

    let mut f = filter(BoundedVelocityConfig {
        initial_velocity_psd: 0.0,
        ..config
    });
    hand(5, 6, &Errors::default(), |_, samples| {
        step_all(&mut f, samples);
    });
    assert!(f.state.covariance[(3, 3)] < 0.5);
    for _ in 0..100 {
        f.propagate(&Vector3::zeros(), 0.01);
    }
    let record = f.update_accelerometer(&(f.attitude().inverse() * Vector3::z() * 9.81));
    assert_eq!(record.outcome, Outcome::Skipped(SkipReason::TooLate));
    assert_eq!(f.state.velocity, nalgebra::Vector2::zeros());
    assert!((f.state.covariance[(3, 3)] - 1.0).abs() < 1e-12 && is_sound(&f));
}

#[test]
fn prediction_turns_on_at_the_present_rate() {
    let config = BoundedVelocityConfig {
        prediction_s: 0.01,
        ..BoundedVelocityConfig::<f64>::lab()
    };
    let (mut ahead, mut f) = (filter(config), filter(BoundedVelocityConfig::lab()));
    let rate = Vector3::new(1.0, -2.0, 0.5);
    for _ in 0..3 {
        ahead.propagate(&rate, 0.01);
        f.propagate(&rate, 0.01);
    }
    let before = f.attitude();
    f.propagate(&rate, 0.01);
    assert!(rotation::angle_between(&f.attitude(), &ahead.attitude()) < 1e-12);
    assert!(rotation::angle_between(&before, &ahead.attitude()) > 0.02);
}

/// Samples arrive at their own rates, each update at its own interval, and the record says so.
#[test]
fn sensors_have_their_own_rates() {
    let mut f = filter(BoundedVelocityConfig {
        update_interval_s: 0.02,
        ..full::<f64>()
    });
    let (mut count, mut fused, mut waiting) = (0, [0; 2], [0; 2]);
    let mut error = f64::NAN;
    hand(30, 7, &Errors::default(), |truth, [w, a, m]| {
        // Gyroscope in two halves, accelerometer at 50 Hz, magnetometer at 12.5 Hz.
        f.propagate(w, 0.004);
        f.propagate(w, 0.006);
        count += 1;
        if count % 2 == 0 {
            let record = f.update_accelerometer(a);
            fused[0] += u32::from(record.outcome.is_fused());
            assert_eq!(record.degrees_of_freedom, 2);
        }
        if count % 8 == 0 {
            let record = f.update_magnetometer(m);
            fused[1] += u32::from(record.outcome.is_fused());
            assert_eq!(record.degrees_of_freedom, 3);
            // The same instant again says nothing new.
            let again = f.update_magnetometer(m).outcome;
            waiting[0] += u32::from(again == Outcome::Skipped(SkipReason::NotDue));
            let again = f.update_accelerometer(a).outcome;
            waiting[1] += u32::from(again == Outcome::Skipped(SkipReason::Accumulated));
        }
        error = rotation::angle_between(truth, &f.attitude()).to_degrees();
    });
    assert_eq!((fused, waiting), ([1500, 375], [375, 375]));
    assert!(error < 1.5, "{error} deg");
}

#[test]
fn resumes_with_what_a_bias_has_turned_and_what_it_had_learnt() {
    const PLACES: [usize; 6] = [0, 1, 2, BIAS, BIAS + 1, BIAS + 2];
    let make = || BoundedVelocity::new(full::<f64>()).unwrap();
    test_world::resumes_as_if_it_had_turned(make, |f| {
        let mut f = *f;
        f.propagate_covariance();
        SMatrix::from_fn(|i, j| f.state.covariance[(PLACES[i], PLACES[j])])
    });

    let mut f = filter::<f64>(full());
    let attitude = UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3);
    let numbers = core::array::from_fn(|k| 1.0 + k as f64);
    let resumed = Resumed {
        attitude,
        attitude_covariance: Matrix3::identity() * 0.01,
        bias_covariance: Matrix3::identity() * 1e-4,
        drift: Matrix3::identity() * 3.0,
        learnt: Learnt(numbers),
    };
    let now = InitialState {
        gyroscope_bias: Vector3::new(0.1, 0.0, 0.0),
        ..initial(TangentFrame::Enu, attitude)
    };
    f.resume(&now, &resumed);
    assert_eq!(f.learnt(), Learnt(numbers));
    assert_eq!(f.state.gyroscope_bias, now.gyroscope_bias);
    // What cannot be a state is not taken: it starts at the attitude without it.
    f.resume(
        &now,
        &Resumed {
            learnt: Learnt([f64::NAN; LEARNT]),
            ..resumed
        },
    );
    assert_eq!(f.learnt(), Learnt(numbers));
}
