//! Stamps, gaps, mean rates and late sensors.

use super::*;
use crate::attitude::AttitudeConfig;
use crate::attitude::integration::Integration;
use crate::attitude::mekf::Mekf;
use crate::faults::FaultKind;
use crate::geometry::{rotation, so3};
use crate::kalman::Outcome;
use approx::assert_relative_eq;

const MS: i64 = 1_000_000;

type MekfDriver = AttitudeDriver<f64, Mekf<f64>>;

fn mekf() -> MekfDriver {
    let settings = AttitudeConfig::lab();
    AttitudeDriver::new(Mekf::new(settings).unwrap(), DriverConfig::default())
}

fn up() -> Vector3<f64> {
    Vector3::new(0.0, 0.0, 9.806_65)
}

fn north() -> Vector3<f64> {
    Vector3::new(0.0, 22.0, -42.0)
}

/// Feeds rest samples at 100 Hz from `from_ms` to `to_ms`.
fn rest(driver: &mut MekfDriver, from_ms: i64, to_ms: i64, with_field: bool) {
    for t in (from_ms..to_ms).step_by(10) {
        driver.gyroscope(t * MS, &Vector3::zeros());
        driver.accelerometer(t * MS, &up());
        if with_field {
            driver.magnetometer(t * MS, &north());
        }
    }
}

#[test]
fn starts_after_the_alignment_and_not_before() {
    let mut driver = mekf();
    rest(&mut driver, 0, 500, true);
    assert!(!driver.is_started() && driver.attitude().is_none());
    rest(&mut driver, 500, 520, true);
    assert!(driver.is_started());
    assert!(driver.attitude().unwrap().angle() < 1e-9);
}

/// GIVEN one sample of each sensor, then a pause of minutes in which the device is turned, and a gyroscope with a known bias WHEN
/// samples go on THEN the start is that of the samples behind the pause.
#[test]
fn a_pause_in_the_alignment_begins_it_anew() {
    let bias = Vector3::new(0.0, 0.0, 0.5_f64.to_radians());
    for turned in [0.0, 70.0_f64] {
        let mut config = DriverConfig::default();
        config.prior.gyroscope_bias = bias;
        let mut driver = AttitudeDriver::new(Mekf::new(AttitudeConfig::lab()).unwrap(), config);
        let feed = |driver: &mut MekfDriver, t: i64, heading: f64| {
            let body = UnitQuaternion::from_euler_angles(0.0, 0.0, heading.to_radians()).inverse();
            driver.gyroscope(t * MS, &bias);
            driver.accelerometer(t * MS, &up());
            driver.magnetometer(t * MS, &(body * north()));
        };
        feed(&mut driver, 0, 0.0);
        for t in (240_000..242_000).step_by(10) {
            feed(&mut driver, t, turned);
            if let Some(now) = driver.attitude() {
                let heading = now.euler_angles().2.to_degrees();
                assert!((heading - turned).abs() < 0.1, "{heading} of {turned}");
            }
        }
        assert!(driver.is_started());
    }
}

/// GIVEN a gyroscope of half a hertz beside an accelerometer of fifty WHEN it is aligned THEN it starts: such intervals are no pauses.
#[test]
fn a_slow_gyroscope_starts() {
    let mut driver = mekf();
    for t in (0..60_000).step_by(20) {
        if t % 2000 == 0 {
            driver.gyroscope(t * MS, &Vector3::zeros());
        }
        driver.accelerometer(t * MS, &up());
    }
    assert!(driver.is_started());
}

#[test]
fn without_an_accelerometer_it_starts_blind_after_four_times_as_long() {
    let mut driver = mekf();
    for t in (0..2100).step_by(10) {
        assert_eq!(driver.is_started(), t > 2000, "{t} ms");
        driver.gyroscope(t * MS, &Vector3::zeros());
    }
}

#[test]
fn repeated_and_older_samples_are_skipped() {
    let mut driver = mekf();
    rest(&mut driver, 0, 1000, true);
    let before = driver;
    let skipped = Outcome::Skipped(SkipReason::NotNewer);
    assert_eq!(
        driver.gyroscope(990 * MS, &Vector3::x()),
        Propagation::Skipped(SkipReason::NotNewer)
    );
    assert_eq!(
        driver.gyroscope(10 * MS, &Vector3::x()),
        Propagation::Skipped(SkipReason::NotNewer)
    );
    assert_eq!(driver.accelerometer(990 * MS, &up()).outcome, skipped);
    assert_eq!(driver.magnetometer(500 * MS, &north()).outcome, skipped);
    // That a gyroscope sample came from far behind is all that is remembered.
    assert_eq!(driver.memory.behind.unwrap().last_ns, 10 * MS);
    driver.memory.behind = None;
    assert_eq!(driver, before);
}

#[test]
fn an_interval_turns_with_the_mean_of_its_two_rates_whatever_comes_between() {
    let start = InitialState {
        attitude: UnitQuaternion::identity(),
        attitude_covariance: nalgebra::Matrix3::identity(),
        gyroscope_bias: Vector3::zeros(),
        gyroscope_bias_std: 0.0,
        north_known: false,
        references: crate::attitude::References {
            specific_force: up(),
            magnetic_field: None,
        },
    };
    let turned = |between: &[i64]| {
        let mut driver = AttitudeDriver::new(Integration::default(), DriverConfig::default());
        driver.start_from(&start);
        driver.gyroscope(0, &Vector3::new(0.0, 0.0, 1.0));
        for t in between {
            driver.accelerometer(*t, &up());
        }
        driver.gyroscope(10 * MS, &Vector3::new(0.0, 0.0, 3.0));
        driver.gyroscope(20 * MS, &Vector3::new(0.0, 0.0, 3.0));
        so3::log(&driver.attitude().unwrap()).z
    };
    assert_relative_eq!(turned(&[]), 0.05, epsilon = 1e-15);
    assert_relative_eq!(turned(&[2 * MS, 7 * MS]), 0.05, epsilon = 1e-15);
    assert_relative_eq!(turned(&[0, 9_999_999]), 0.05, epsilon = 1e-15);
}

#[test]
fn a_hole_turns_by_what_both_ends_let_expect_and_grows_the_covariance() {
    let turned = |silence_ms: i64| {
        let mut driver = mekf();
        rest(&mut driver, 0, 1000, true);
        // It turns to and fro: 2 rad/s, 0.8 Hz.
        let rate = |t: i64| Vector3::z() * (2.0 * (5e-3 * (t - 1000) as f64).sin());
        let mut time = 1000;
        while time <= 7000 || rate(time).z < 1.99 {
            driver.gyroscope(time * MS, &rate(time));
            time += 10;
        }
        let before = driver.estimator.attitude_covariance().unwrap();
        let attitude = driver.attitude().unwrap();
        driver.gyroscope((time - 10 + silence_ms) * MS, &(Vector3::z() * 2.0));
        let after = driver.estimator.attitude_covariance().unwrap();
        let turn = so3::log(&(attitude.inverse() * driver.attitude().unwrap())).z;
        let fault = driver.take_fault();
        (turn, (after - before)[(2, 2)].sqrt(), fault)
    };
    // Of a tenth of a second nearly all is known, of five seconds nearly nothing.
    let (turn, std, fault) = turned(100);
    assert!(
        (turn - 0.2).abs() < 0.02 && std > 0.005 && std < 0.06,
        "{turn} {std}"
    );
    assert!(fault.is_some_and(|f| f.kind == FaultKind::Missing) == (std > 0.0175));
    let (turn, std, fault) = turned(5000);
    assert!(turn.abs() < 1.5 && std > 1.0, "{turn} {std}");
    let fault = fault.unwrap();
    assert_eq!(
        (fault.kind, fault.is_over, fault.size),
        (FaultKind::Missing, true, 5.0)
    );
}

/// A device in motion, seen at 100 Hz by all sensors; `faulty` changes the samples of an instant (ms). What is said of
/// errors, deg, and NEES a degree of freedom, second by second.
fn in_motion(
    seconds: u32,
    mut faulty: impl FnMut(i64, &mut [Vector3<f64>; 3]),
) -> (std::vec::Vec<[f64; 2]>, MekfDriver) {
    use crate::attitude::test_world;
    let mut driver = mekf();
    let mut told = std::vec::Vec::new();
    let mut k = 0_i64;
    test_world::drive(seconds, 5, |truth, mut samples| {
        k += 1;
        faulty(k * 10, &mut samples);
        let [w, a, m] = samples;
        driver.gyroscope(k * 10 * MS, &w);
        driver.accelerometer(k * 10 * MS, &a);
        driver.magnetometer(k * 10 * MS, &m);
        if k % 100 == 0 && driver.is_started() {
            let off = so3::log(&(driver.attitude().unwrap().inverse() * truth));
            let p = driver.attitude_covariance().unwrap();
            let nees = off.dot(&(p.try_inverse().unwrap() * off)) / 3.0;
            told.push([off.norm().to_degrees(), nees]);
        }
    });
    (told, driver)
}

/// From a second on, errors and NEES are those of a run without faults.
fn as_good_as_clean(told: &[[f64; 2]], from: usize) {
    let (clean, _) = in_motion(told.len() as u32 + 1, |_, _| ());
    let mean = |told: &[[f64; 2]], which: usize| {
        let late = told.iter().skip(from).map(|t| t[which]);
        late.clone().sum::<f64>() / late.count() as f64
    };
    for which in [0, 1] {
        let (faulty, clean) = (mean(told, which), mean(&clean, which));
        assert!(faulty < 1.2 * clean, "{faulty} {clean}");
    }
}

#[test]
fn one_bad_sample_costs_nothing() {
    let worst = |told: &[[f64; 2]]| told.iter().map(|t| t[0]).fold(0.0, f64::max);
    let (clean, mut driver) = in_motion(30, |_, _| ());
    assert_eq!(driver.take_fault(), None);
    for sensor in 0..3 {
        let (told, mut driver) = in_motion(30, |t, samples| {
            if t == 20_000 {
                samples[sensor].y += [34.9, 160.0, 4000.0][sensor];
            }
        });
        assert!(
            worst(&told) < 1.05 * worst(&clean),
            "{sensor}: {}",
            worst(&told)
        );
        let fault = driver.take_fault().unwrap();
        assert_eq!((fault.kind, fault.is_over), (FaultKind::Spike, true));
        assert_eq!((fault.from_ns, fault.until_ns), (19_990 * MS, 20_010 * MS));
        assert_eq!(driver.take_fault(), None);
    }
}

#[test]
fn a_frozen_or_silent_gyroscope_is_survived_and_told() {
    for zeros in [false, true] {
        let mut held = None;
        let (told, mut driver) = in_motion(60, |t, samples| {
            if (20_000..23_000).contains(&t) {
                let value = if zeros { Vector3::zeros() } else { samples[0] };
                samples[0] = *held.get_or_insert(value);
            }
        });
        // Ten seconds of normal samples later.
        as_good_as_clean(&told, 33);
        let found = driver.take_fault().unwrap();
        let over = driver.take_fault().unwrap();
        assert_eq!((found.kind, found.is_over), (FaultKind::Stuck, false));
        assert!(found.until_ns < 20_100 * MS && over.is_over);
        assert_eq!(over.until_ns, 23_000 * MS);
        assert_eq!(
            (
                driver.take_fault(),
                driver.fault_now(FaultySensor::Gyroscope)
            ),
            (None, None)
        );
    }
}

/// GIVEN a second without gyroscope in a turn whose rate doubles WHEN accelerometer and magnetometer go on THEN what they have put right
/// is not turned once more at the end, and the covariance says what is left.
#[test]
fn a_hole_of_the_gyroscope_alone_leaves_what_other_sensors_have_put_right() {
    let mut driver = mekf();
    rest(&mut driver, 0, 2000, true);
    let mut truth = UnitQuaternion::identity();
    let mut worst: f64 = 0.0;
    for k in 200..700_i64 {
        let rate = Vector3::new(0.4, 0.9, -0.5) * (0.01 * (k - 200) as f64).sin();
        truth *= UnitQuaternion::from_scaled_axis(rate * 0.01);
        let body = truth.inverse();
        let t = k * 10 * MS;
        if !(380..480).contains(&k) {
            driver.gyroscope(t, &rate);
        }
        driver.accelerometer(t, &(body * up()));
        driver.magnetometer(t, &(body * north()));
        let off = (driver.attitude().unwrap().inverse() * truth).angle();
        worst = worst.max(off.to_degrees());
        if k == 482 {
            let std = driver.attitude_covariance().unwrap().trace().sqrt();
            // 5 degrees where the turn over the hole was made up in full, with 1 stated.
            assert!(off < 3.0 * std, "{off} {std}");
        }
    }
    assert!(worst < 4.0, "{worst}");
}

/// A spin beyond the range: where it ends nobody knows, and no linear update finds out. It is aligned again.
#[test]
fn a_spin_beyond_the_range_is_survived_and_told() {
    let (told, mut driver) = in_motion(60, |t, samples| {
        if (20_000..23_000).contains(&t) {
            samples[0].z = 34.9;
        }
    });
    as_good_as_clean(&told, 33);
    let (found, over) = (driver.take_fault().unwrap(), driver.take_fault().unwrap());
    assert_eq!((found.kind, found.size), (FaultKind::Saturated, 34.9));
    assert!(found.from_ns < 20_200 * MS && found.until_ns < 20_200 * MS);
    // The first sample behind it waits for the next one.
    assert!(over.is_over && over.until_ns == 23_010 * MS);
    assert_eq!(driver.take_fault(), None);
}

/// A limit that begins in the midst of a motion, below what was seen before.
#[test]
fn a_limit_below_the_largest_rate_is_survived_and_told() {
    let clipped = |t: i64| (20_000..23_000).contains(&t);
    // Two axes are larger there, the third is not.
    let limit = 0.6;
    let (told, mut driver) = in_motion(60, |t, samples| {
        if clipped(t) {
            samples[0] = samples[0].map(|x| x.clamp(-limit, limit));
        }
    });
    as_good_as_clean(&told, 33);
    let found = driver.take_fault().unwrap();
    assert_eq!((found.kind, found.size), (FaultKind::Saturated, limit));
    assert!(clipped(found.from_ns / MS + 10) && clipped(found.until_ns / MS));
    let mut last = found;
    while let Some(fault) = driver.take_fault() {
        assert_eq!(fault.kind, FaultKind::Saturated);
        last = fault;
    }
    assert!(last.is_over && driver.fault_now(FaultySensor::Gyroscope).is_none());
}

#[test]
fn twenty_seconds_of_garbage_on_all_sensors_are_survived() {
    use rand::{RngExt, SeedableRng};
    let mut rng = rand_pcg::Pcg64::seed_from_u64(3);
    let (told, _) = in_motion(90, |t, samples| {
        if (20_000..40_000).contains(&t) {
            for (sample, size) in samples.iter_mut().zip([8.0, 40.0, 80.0]) {
                *sample = Vector3::from_fn(|_, _| size * rng.random_range(-1.0..1.0));
            }
        }
    });
    as_good_as_clean(&told, 50);
}

#[test]
fn a_day_of_silence_ends_at_the_cap_and_in_bounded_time() {
    let mut driver = mekf();
    rest(&mut driver, 0, 1000, true);
    let first = driver.gyroscope(86_400_000 * MS, &Vector3::zeros());
    assert_eq!(first, Propagation::Skipped(SkipReason::Suspect));
    driver.gyroscope(86_400_010 * MS, &Vector3::zeros());
    let p = driver.estimator.attitude_covariance().unwrap();
    assert_relative_eq!(p[(0, 0)].sqrt(), 1.8, epsilon = 1e-6);
}

/// GIVEN a magnetometer that appears after ten seconds WHEN it has been seen for the alignment
/// time THEN the heading is known from then on and the bias is kept.
#[test]
fn a_late_magnetometer_is_aligned_with() {
    let mut driver = mekf();
    let bias = Vector3::new(0.0, 0.01, 0.0);
    let truth = so3::exp(&Vector3::new(0.0, 0.0, 0.6));
    for t in (0..20_000).step_by(10) {
        driver.gyroscope(t * MS, &bias);
        driver.accelerometer(t * MS, &up());
        if t > 10_000 {
            driver.magnetometer(t * MS, &(truth.inverse() * north()));
        }
    }
    let error = rotation::angle_between(&driver.attitude().unwrap(), &truth);
    assert!(error.to_degrees() < 0.5, "{} deg", error.to_degrees());
    let (estimate, _) = driver.estimator.gyroscope_bias().unwrap();
    assert!((estimate - bias).norm() < 1e-3, "{estimate}");
}

/// GIVEN a table that tells the last field of a slow magnetometer again until the next comes WHEN the device turns THEN the attitude is
/// that without the fields that are told again.
#[test]
fn a_field_that_is_told_again_is_no_measurement() {
    let run = |is_told_again: bool| {
        let mut driver = mekf();
        let (mut truth, mut last, mut fused) = (UnitQuaternion::identity(), north(), 0);
        for k in 0..3000_i64 {
            let t = k as f64 * 0.01;
            let rate = Vector3::new((0.9 * t).sin(), 0.7 * (0.7 * t).cos(), 0.8);
            let rate = if k < 100 { Vector3::zeros() } else { rate };
            truth *= so3::exp(&(rate * 0.01));
            let noise = Vector3::new((77.0 * t).sin(), (53.0 * t).cos(), (91.0 * t).sin()) * 0.3;
            driver.gyroscope(k * 10 * MS, &rate);
            driver.accelerometer(k * 10 * MS, &(truth.inverse() * up() + noise * 0.1));
            if k % 10 == 0 {
                last = truth.inverse() * north() + noise;
            }
            if is_told_again || k % 10 == 0 {
                fused += i32::from(driver.magnetometer(k * 10 * MS, &last).outcome.is_fused());
            }
        }
        (
            rotation::angle_between(&driver.attitude().unwrap(), &truth).to_degrees(),
            fused,
        )
    };
    let ((told_again, fused), (once, of)) = (run(true), run(false));
    assert!(
        told_again < 1.1 * once + 0.05 && told_again < 0.5,
        "{told_again} and {once} deg"
    );
    assert!((of - 10..=of).contains(&fused), "{fused} of {of}");
}

/// GIVEN a device at rest whose coarse magnetometer shows the same value for a minute THEN it counts once a second: the heading is held.
#[test]
fn a_field_that_stays_counts_once_in_a_second() {
    let mut driver = mekf();
    let mut fused = 0;
    for t in (0..60_000).step_by(10) {
        driver.gyroscope(t * MS, &Vector3::new(0.0, 0.0, 0.005));
        driver.accelerometer(
            t * MS,
            &(up() + Vector3::x() * 1e-3 * ((t / 10) % 3) as f64),
        );
        fused += i32::from(driver.magnetometer(t * MS, &north()).outcome.is_fused());
    }
    assert!((50..=61).contains(&fused), "{fused}");
    let heading = driver.attitude().unwrap().euler_angles().2.to_degrees();
    assert!(heading.abs() < 1.0, "{heading} deg");
}

#[test]
fn extreme_stamps_do_not_overflow() {
    let mut driver = mekf();
    for t in [i64::MIN, -1, 0, i64::MAX - 1, i64::MAX] {
        driver.gyroscope(t, &Vector3::x());
        driver.accelerometer(t, &up());
        driver.magnetometer(t, &north());
    }
    assert!(driver.attitude().is_none_or(|q| q.norm().is_finite()));
}

/// GIVEN a device that turns and a magnetometer that delivers only zeros WHEN it is fed for long
/// THEN nothing is aligned with it: the attitude is that of gyroscope and accelerometer.
#[test]
fn a_sensor_that_delivers_nothing_usable_restarts_nothing() {
    let run = |dead: &dyn Fn(&mut MekfDriver, i64)| {
        let mut driver = mekf();
        for t in (0..8000).step_by(10) {
            let rate = if t < 1000 { 0.0 } else { 0.2 };
            driver.gyroscope(t * MS, &Vector3::new(0.0, 0.0, rate));
            driver.accelerometer(t * MS, &up());
            dead(&mut driver, t * MS);
        }
        driver.attitude().unwrap()
    };
    let without = run(&|_, _| {});
    for field in [
        Vector3::zeros(),
        Vector3::new(f64::NAN, 0.0, 0.0),
        Vector3::new(1e300, 0.0, 0.0),
    ] {
        let with = run(&|driver, t| {
            assert!(!driver.magnetometer(t, &field).outcome.is_fused());
        });
        assert!(rotation::angle_between(&with, &without) < 1e-12, "{field}");
    }
    assert!(
        so3::log(&without).z > 1.0,
        "it turned: {}",
        so3::log(&without).z
    );
}

/// A gap is held by every estimator, also by those whose bias is a constant.
#[test]
fn a_gap_is_held_with_a_constant_bias_too() {
    let bias = Vector3::new(0.0, 0.0, 0.02);
    let start = InitialState {
        attitude: UnitQuaternion::identity(),
        attitude_covariance: nalgebra::Matrix3::identity() * 1e-6,
        gyroscope_bias: bias,
        gyroscope_bias_std: 1e-4,
        north_known: false,
        references: crate::attitude::References {
            specific_force: up(),
            magnetic_field: None,
        },
    };
    let settings = AttitudeConfig::lab();
    fn held<E: AttitudeEstimator<f64>>(estimator: E, start: &InitialState<f64>) -> f64 {
        let mut driver = AttitudeDriver::new(estimator, DriverConfig::default());
        driver.start_from(start);
        driver.gyroscope(0, &start.gyroscope_bias);
        driver.gyroscope(60_000 * MS, &start.gyroscope_bias);
        driver.attitude().unwrap().angle()
    }
    assert!(held(Integration::default(), &start) < 1e-9);
    assert!(
        held(
            crate::attitude::mekf3::Mekf3::new(settings).unwrap(),
            &start
        ) < 1e-9
    );
    assert!(held(Mekf::new(settings).unwrap(), &start) < 1e-9);
    assert!(
        held(
            crate::attitude::usque::Usque::new(settings).unwrap(),
            &start
        ) < 1e-6
    );
}

/// The covariance does not depend on how close to the next gyroscope sample another sensor's comes.
#[test]
fn a_sliver_of_an_interval_adds_no_noise() {
    let settings = AttitudeConfig::hand_held();
    let variance = |between: &[i64]| {
        let mut driver = AttitudeDriver::new(Mekf::new(settings).unwrap(), DriverConfig::default());
        driver.start_from(&InitialState {
            attitude: UnitQuaternion::identity(),
            attitude_covariance: nalgebra::Matrix3::identity() * 1e-8,
            gyroscope_bias: Vector3::zeros(),
            gyroscope_bias_std: 0.0,
            north_known: false,
            references: crate::attitude::References {
                specific_force: up(),
                magnetic_field: None,
            },
        });
        driver.gyroscope(0, &Vector3::new(0.0, 0.0, 1.0));
        for t in between {
            driver.magnetometer(*t, &north());
        }
        driver.gyroscope(10 * MS, &Vector3::new(0.0, 0.0, 2.0));
        driver.estimator.attitude_covariance().unwrap()[(2, 2)]
    };
    // The held rate is the first one here, the mean of both there: nothing else may differ.
    let ratio = variance(&[9_999_999]) / variance(&[]);
    assert!((0.5..=1.0).contains(&ratio), "{ratio}");
}

/// One stamp an hour ahead, before the start and after it, in either sensor: the estimates go on.
#[test]
fn a_stamp_far_in_the_future_freezes_nothing() {
    const HOUR: i64 = 3_600_000;
    for (at, field) in [(100, false), (100, true), (2000, false), (2000, true)] {
        let mut driver = mekf();
        rest(&mut driver, 0, at, true);
        if field {
            driver.magnetometer((at + HOUR) * MS, &north());
        } else {
            driver.accelerometer((at + HOUR) * MS, &up());
        }
        rest(&mut driver, at, at + 2000, true);
        assert!(driver.is_started(), "{at} ms");
        // A quarter of a turn within a second.
        let rate = Vector3::new(0.0, 0.0, core::f64::consts::FRAC_PI_2);
        let before = driver.attitude().unwrap();
        for t in (at + 2000..=at + 3000).step_by(10) {
            assert_eq!(driver.gyroscope(t * MS, &rate), Propagation::Done);
        }
        let turned = rotation::angle_between(&driver.attitude().unwrap(), &before);
        assert!((turned - rate.z).abs() < 0.02, "{at} ms, {field}: {turned}");
        let outcome = driver.accelerometer((at + 3010) * MS, &up()).outcome;
        assert_eq!(outcome, Outcome::Fused, "{at} ms, {field}");
    }
}

/// One stamp of the gyroscope an hour ahead, before the start and after it, costs its own sample and is an event. Two that
/// agree are taken for a pause: samples are taken again once they have gone on for longer than a gap.
#[test]
fn a_gyroscope_stamp_far_in_the_future_costs_its_sample_and_two_half_a_second() {
    const HOUR: i64 = 3_600_000;
    for (at, two) in [(100, false), (2000, false), (100, true), (2000, true)] {
        let mut driver = mekf();
        rest(&mut driver, 0, at, true);
        let mut ahead = |ms: i64| driver.gyroscope((at + HOUR + ms) * MS, &Vector3::zeros());
        assert_eq!(ahead(0), Propagation::Skipped(SkipReason::Suspect));
        if two {
            assert_eq!(ahead(10), Propagation::Done);
        }
        let mut skipped = std::vec::Vec::new();
        for t in (at..at + 4000).step_by(10) {
            if driver.gyroscope(t * MS, &Vector3::zeros()) != Propagation::Done {
                skipped.push(t - at);
            }
            driver.accelerometer(t * MS, &up());
            driver.magnetometer(t * MS, &north());
        }
        let until = if two { 510 } else { 0 };
        assert!(
            skipped.iter().copied().eq((0..until).step_by(10)),
            "{at} ms: {skipped:?}"
        );
        if !two {
            let fault = driver.take_fault().unwrap();
            assert_eq!((fault.kind, fault.until_ns), (FaultKind::Stamp, at * MS));
            assert!((fault.size - 3600.01).abs() < 1e-6, "{}", fault.size);
        }
        let rate = Vector3::new(0.0, 0.0, core::f64::consts::FRAC_PI_2);
        let before = driver.attitude().unwrap();
        for t in (at + 4000..=at + 5000).step_by(10) {
            assert_eq!(driver.gyroscope(t * MS, &rate), Propagation::Done);
        }
        let turned = rotation::angle_between(&driver.attitude().unwrap(), &before);
        assert!((turned - rate.z).abs() < 0.02, "{at} ms: {turned}");
    }
}

/// GIVEN a clock that is set back by a second, by minutes or to zero in the midst of a motion WHEN samples go on THEN they are refused
/// for a gap only, their turn is made up for, and the covariance says that nobody knows how long the clock stood.
#[test]
fn a_clock_that_is_set_back_costs_no_turn() {
    use crate::attitude::test_world;
    for back_ms in [200, 700, 1000, 10_000, 20_000] {
        let mut driver = mekf();
        let mut refused = 0;
        let (mut k, mut worst, mut worst_nees) = (0_i64, 0.0_f64, 0.0_f64);
        test_world::drive(40, 5, |truth, [w, a, m]| {
            k += 1;
            let t = (k * 10 - if k > 2000 { back_ms } else { 0 }) * MS;
            if driver.gyroscope(t, &w) != Propagation::Done {
                refused += 1;
                return;
            }
            driver.accelerometer(t, &a);
            driver.magnetometer(t, &m);
            if k > 2000 {
                let off = so3::log(&(driver.attitude().unwrap().inverse() * truth));
                let p = driver.attitude_covariance().unwrap();
                let nees = off.dot(&(p.try_inverse().unwrap() * off)) / 3.0;
                worst_nees = worst_nees.max(nees);
                worst = worst.max(off.norm().to_degrees());
            }
        });
        // 24 with a clock that goes on; 2e6 where the turn of what was refused was forgotten.
        assert!(worst_nees < 30.0, "{back_ms} ms: {worst_nees}");
        if back_ms < 500 {
            // What may be missing is stated.
            assert_eq!(refused, back_ms / 10, "{back_ms} ms");
            continue;
        }
        assert_eq!(refused, 51, "{back_ms} ms");
        assert!(worst < 1.0, "{back_ms} ms: {worst}");
        let fault = driver.take_fault().unwrap();
        assert_eq!((fault.kind, fault.is_over), (FaultKind::Missing, true));
        assert_eq!(driver.take_fault(), None);
    }
}

/// Old samples that do not follow each other bring nothing back.
#[test]
fn stray_gyroscope_samples_from_long_ago_do_not_turn_the_clock_back() {
    let mut driver = mekf();
    rest(&mut driver, 0, 20_000, true);
    let now = driver.memory.now_ns;
    for t in (0..10_000).step_by(700) {
        let outcome = driver.gyroscope(t * MS, &Vector3::x());
        assert_eq!(outcome, Propagation::Skipped(SkipReason::NotNewer));
        let outcome = driver.gyroscope((t + 10) * MS, &Vector3::x());
        assert_eq!(outcome, Propagation::Skipped(SkipReason::NotNewer));
    }
    assert_eq!(driver.memory.now_ns, now);
}

#[test]
fn a_compass_stamp_far_in_the_future_does_not_stop_the_compass() {
    let mut driver = mekf();
    rest_with_compass(&mut driver, 0, 2000, 0.0);
    driver.compass((2000 + 3_600_000) * MS, 0.0, 0.1);
    let outcome = rest_with_compass(&mut driver, 2000, 4000, 0.0);
    assert_eq!(outcome, Outcome::Fused);
}

/// Feeds rest with a compass that reads `heading` ten times a second.
fn rest_with_compass(driver: &mut MekfDriver, from_ms: i64, to_ms: i64, heading: f64) -> Outcome {
    let mut last = Outcome::Gated;
    for t in (from_ms..to_ms).step_by(100) {
        rest(driver, t, t + 100, false);
        last = driver.compass((t + 95) * MS, heading, 0.1).outcome;
    }
    last
}

#[test]
fn the_first_compass_heading_turns_the_start_to_north_and_the_others_are_measurements() {
    let mut driver = mekf();
    let first = rest_with_compass(&mut driver, 0, 600, 1.0);
    assert_eq!(first, Outcome::Skipped(SkipReason::NotInitialized));
    // Clockwise by 1 rad is -1 rad about up.
    let yaw = |driver: &MekfDriver| so3::log(&driver.attitude().unwrap()).z;
    assert_relative_eq!(yaw(&driver), -1.0, epsilon = 1e-6);
    let tilt_before = driver.estimator.attitude_covariance().unwrap();
    assert_relative_eq!(tilt_before[(2, 2)].sqrt(), 0.1, epsilon = 1e-3);
    let last = rest_with_compass(&mut driver, 600, 20_000, 1.0);
    assert_eq!(last, Outcome::Fused);
    assert_relative_eq!(yaw(&driver), -1.0, epsilon = 1e-3);
    assert!(driver.estimator.attitude_covariance().unwrap()[(2, 2)] < tilt_before[(2, 2)] / 4.0);
    let again = driver.compass(19_000 * MS, 1.0, 0.1).outcome;
    assert_eq!(again, Outcome::Skipped(SkipReason::NotNewer));
}

#[test]
fn beside_a_magnetometer_a_compass_never_sets_the_heading() {
    let mut driver = mekf();
    rest(&mut driver, 0, 1000, true);
    let outcome = driver.compass(1000 * MS, 2.0, 0.1).outcome;
    assert_eq!(outcome, Outcome::Gated);
    assert!(driver.attitude().unwrap().angle() < 1e-3);
}

#[test]
fn an_upright_device_waits_for_its_heading() {
    let mut driver = mekf();
    for t in (0..1000).step_by(10) {
        driver.gyroscope(t * MS, &Vector3::zeros());
        driver.accelerometer(t * MS, &Vector3::new(0.0, 9.806_65, 0.0));
    }
    let outcome = driver.compass(1000 * MS, 2.0, 0.1).outcome;
    assert_eq!(outcome, Outcome::Skipped(SkipReason::Unobservable));
    assert!(driver.attitude().is_some());
}

#[test]
fn without_gravity_there_is_no_horizon_for_a_compass() {
    let mut driver = mekf();
    for t in (0..3000).step_by(10) {
        driver.gyroscope(t * MS, &Vector3::zeros());
    }
    let outcome = driver.compass(3000 * MS, 2.0, 0.1).outcome;
    assert_eq!(outcome, Outcome::Skipped(SkipReason::Unobservable));
}

#[test]
fn a_state_taken_over_from_a_filter_that_knew_north_is_not_turned() {
    let mut driver = mekf();
    rest_with_compass(&mut driver, 0, 5000, 1.0);
    let mut next = mekf();
    next.start_from(&InitialState {
        attitude: driver.attitude().unwrap(),
        attitude_covariance: driver.estimator.attitude_covariance().unwrap(),
        gyroscope_bias: Vector3::zeros(),
        gyroscope_bias_std: 1e-3,
        north_known: driver.knows_north(),
        references: crate::attitude::References {
            specific_force: up(),
            magnetic_field: None,
        },
    });
    let before = next.attitude().unwrap();
    assert_eq!(next.compass(0, 1.1, 0.1).outcome, Outcome::Fused);
    let turned = rotation::angle_between(&before, &next.attitude().unwrap());
    assert!(turned < 0.05, "{turned}");
}

#[test]
fn an_unknown_yaw_is_not_in_the_deviations_of_pitch_and_roll() {
    let mut driver = mekf();
    assert!(driver.yaw_pitch_roll().is_none());
    let tilted = rotation::from_yaw_pitch_roll([0.0, 0.3, 0.5]);
    for t in (0..2000).step_by(10) {
        driver.gyroscope(t * MS, &Vector3::zeros());
        driver.accelerometer(t * MS, &(tilted.inverse() * up()));
    }
    let (angles, [yaw_std, pitch_std, roll_std]) = driver.yaw_pitch_roll().unwrap();
    assert_relative_eq!(angles[1], 0.3, epsilon = 1e-6);
    assert_relative_eq!(angles[2], 0.5, epsilon = 1e-6);
    assert!(yaw_std > 0.1 && pitch_std < 2e-3 && roll_std < 2e-3);
    // About the body's axes the yaw leaks into all three.
    let body = driver.attitude_covariance().unwrap().diagonal();
    assert!(body.map(f64::sqrt).min() > 0.02);
}
