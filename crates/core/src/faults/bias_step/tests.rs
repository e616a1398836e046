//! Steps of the bias in the motion of a hand, and what is none.

use super::*;
use crate::geometry::so3;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;
use std::vec::Vec;

const DT: f64 = 0.01;

/// A hand that turns and shakes a device: rate, force and field in body axes, with noise.
struct Hand {
    rng: Pcg64Mcg,
    phases: [f64; 6],
    reference_from_body: UnitQuaternion<f64>,
    time_s: f64,
    bias: Vector3<f64>,
    /// How fast an estimator's attitude goes off from a minute and a half on, body axes, rad/s.
    goes_off: Vector3<f64>,
    /// In reference axes, microtesla.
    field: Vector3<f64>,
}

impl Hand {
    fn new(seed: u64) -> Self {
        let mut rng = Pcg64Mcg::seed_from_u64(seed);
        let phases = core::array::from_fn(|_| core::f64::consts::TAU * rng.random::<f64>());
        Self {
            rng,
            phases,
            reference_from_body: UnitQuaternion::identity(),
            time_s: 0.0,
            bias: Vector3::new(0.004, -0.006, 0.003),
            goes_off: Vector3::zeros(),
            field: Vector3::new(0.0, 20.0, -43.0),
        }
    }

    fn noise(&mut self, std: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| std * self.rng.sample::<f64, _>(StandardNormal))
    }

    fn samples(&mut self) -> [Vector3<f64>; 3] {
        let [a, b, c, d, e, f] = self.phases;
        let t = self.time_s;
        let rate = Vector3::new(
            0.8 * (1.3 * t + a).sin() + 0.5 * (0.31 * t + b).sin(),
            0.7 * (0.9 * t + c).cos(),
            0.6 * (1.7 * t + d).sin() + 0.4 * (0.23 * t + e).cos(),
        );
        // The derivative of a velocity that stays bounded.
        let push = Vector3::new(
            (4.0 * t + f).cos(),
            (5.0 * t + a).sin(),
            (3.0 * t + b).cos(),
        );
        self.time_s += DT;
        self.reference_from_body *= so3::exp(&(rate * DT));
        let up = Vector3::new(0.0, 0.0, 9.81) + push * 1.5;
        let body = self.reference_from_body.inverse();
        [
            rate + self.bias + self.noise(0.01),
            body * up + self.noise(0.05),
            body * self.field + self.noise(0.5),
        ]
    }
}

/// What an estimator knows of a hand's attitude, to a degree.
fn known_by(hand: &Hand) -> Known<f64> {
    let off = hand.goes_off * (hand.time_s - 90.0).max(0.0);
    Known {
        attitude: hand.reference_from_body * so3::exp(&off),
        covariance: Matrix3::identity() * 3e-4,
        learnt: Learnt([hand.time_s; LEARNT]),
    }
}

/// When steps were told, s, and the last one.
fn told(
    hand: &mut Hand,
    watch: &mut BiasWatch<f64>,
    seconds: f64,
    has_field: bool,
) -> Vec<(f64, BiasStep<f64>)> {
    let mut all = Vec::new();
    for _ in 0..(seconds / DT) as u32 {
        let [rate, force, field] = hand.samples();
        watch.force(&force);
        if has_field {
            watch.field(&field);
        }
        let known = || known_by(hand);
        let step = watch.rotate(&rate, DT, known);
        all.extend(step.map(|step| (hand.time_s, step)));
    }
    all
}

/// A unit vector in no special direction, times `size`.
fn a_step_of(size: f64) -> Vector3<f64> {
    Vector3::new(0.03, -0.03, 0.026).normalize() * size
}

/// Nothing is told before the step, and no second one after it; how many of `seeds` motions showed it in ten seconds.
fn found_in_ten_seconds(size: f64, seeds: u64, has_field: bool) -> usize {
    let mut found = 0;
    for seed in 1..=seeds {
        let (mut hand, mut watch) = (Hand::new(seed), BiasWatch::default());
        let before = told(&mut hand, &mut watch, 90.0, has_field);
        assert_eq!(before, [], "seed {seed}");
        hand.bias += a_step_of(size);
        let (at_s, step) = match told(&mut hand, &mut watch, 60.0, has_field)[..] {
            [] => continue,
            [step] => step,
            ref more => panic!("seed {seed}: {more:?}"),
        };
        let error = (step.bias - hand.bias).norm();
        assert!(
            !has_field || error < 0.02 && error < 3.0 * step.std,
            "seed {seed}: {error} {step:?}"
        );
        found += usize::from(at_s < 100.5);
    }
    found
}

/// Three degrees a second, where a shaken hand hides some of them; more is found always.
#[test]
fn a_step_is_found_in_ten_seconds_and_nothing_before_or_after() {
    let found = found_in_ten_seconds(0.052, 16, true);
    assert!(found >= 14, "{found} of 16");
    assert_eq!(found_in_ten_seconds(0.078, 8, true), 8);
}

/// A spin beyond the range, or samples that were lost: gravity and field lie elsewhere, and stay there.
#[test]
fn a_turn_that_the_gyroscope_missed_is_no_step() {
    for seed in 1..=16 {
        let (mut hand, mut watch) = (Hand::new(seed), BiasWatch::default());
        assert_eq!(told(&mut hand, &mut watch, 90.0, true), [], "seed {seed}");
        hand.reference_from_body *= so3::exp(&a_step_of(0.7));
        let after = told(&mut hand, &mut watch, 30.0, true);
        assert_eq!(after, [], "seed {seed}");
    }
}

/// GIVEN an estimator that a step of the bias turns away WHEN the step is found THEN the attitude goes on from before it, and what is left
/// of its error is what the error of the new bias has turned.
#[test]
fn the_attitude_of_before_is_carried_on_with_the_new_bias() {
    let mut squared = Vec::new();
    for seed in 1..=12 {
        let (mut hand, mut watch) = (Hand::new(seed), BiasWatch::default());
        let _ = told(&mut hand, &mut watch, 90.0, true);
        hand.bias += a_step_of(0.1);
        hand.goes_off = a_step_of(0.1);
        let steps = told(&mut hand, &mut watch, 1.0, true);
        assert_eq!(steps, [], "seed {seed}");
        let mut steps = Vec::new();
        while steps.is_empty() && hand.time_s < 110.0 {
            steps = told(&mut hand, &mut watch, DT, true);
        }
        let resumed = steps[0].1.resumed;
        let error = so3::log(&(resumed.attitude.inverse() * hand.reference_from_body));
        let by_bias = -resumed.drift * (hand.bias - steps[0].1.bias);
        let left = (error - by_bias).norm();
        // The beginning of the step is known to two blocks, in which it turns a tenth of a radian.
        assert!(left < 0.12, "seed {seed}: {left} of {}", error.norm());
        // It had learnt what it knew before the step, or in the block in which it came.
        let age = resumed.learnt.0[0] - 90.0;
        assert!(age.abs() < 1.1, "seed {seed}: {age}");
        let covariance = resumed.attitude_covariance.cholesky().unwrap();
        squared.push(error.dot(&covariance.solve(&error)) / 3.0);
    }
    let mean = squared.iter().sum::<f64>() / squared.len() as f64;
    assert!(mean < 2.0, "{mean} {squared:?}");
}

/// Tilting turns gravity; about the vertical nothing is seen, and the bias there stays.
#[test]
fn without_a_magnetometer_gravity_shows_larger_ones() {
    let found = found_in_ten_seconds(0.155, 16, false);
    assert!(found >= 12, "{found} of 16");
}

#[test]
fn a_turn_of_the_field_without_one_of_gravity_and_a_drift_are_no_steps() {
    for seed in 1..=8 {
        let (mut hand, mut watch) = (Hand::new(seed), BiasWatch::default());
        let calm = hand.field;
        for second in 0..180 {
            // Past a steel beam and back, three times a minute: 25 degrees in three seconds.
            let turn = 0.44 * (f64::from(second % 20) / 3.0).clamp(0.0, 1.0);
            hand.field = so3::exp(&Vector3::new(0.0, 0.0, turn)) * calm;
            hand.bias.x += 1e-5;
            assert_eq!(told(&mut hand, &mut watch, 1.0, true), [], "seed {seed}");
        }
    }
}

#[test]
fn an_interruption_forgets_the_window_and_keeps_the_bias() {
    let (mut hand, mut watch) = (Hand::new(3), BiasWatch::default());
    let _ = told(&mut hand, &mut watch, 60.0, true);
    let (before, _) = watch.known.solve().unwrap();
    assert!((before - hand.bias).norm() < 0.01, "{before}");
    watch.interrupt();
    assert_eq!(watch.known.solve().unwrap().0, before);
    // Less than a window says nothing, however wrong the rate is.
    hand.bias += Vector3::repeat(1.0);
    assert_eq!(told(&mut hand, &mut watch, 5.0, true), []);
}

#[test]
fn garbage_leaves_nothing_that_is_not_finite() {
    fn feed<T: Scalar>() {
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        let mut watch = BiasWatch::<T>::default();
        for _ in 0..200_000 {
            let mut any = || {
                let scale = 10_f64.powf(rng.random_range(-9.0..9.0));
                Vector3::from_fn(|_, _| lit::<T>(scale * rng.sample::<f64, _>(StandardNormal)))
            };
            let (rate, force, field) = (any(), any(), any());
            watch.force(&force);
            watch.field(&field);
            let known = || Known {
                attitude: UnitQuaternion::from_scaled_axis(rate),
                covariance: force * field.transpose(),
                learnt: Learnt([force.x; LEARNT]),
            };
            let _ = watch.rotate(&rate, lit(0.01), known);
            assert!(watch.numbers().all(|x| x.is_finite()));
        }
    }
    feed::<f32>();
    feed::<f64>();
}
