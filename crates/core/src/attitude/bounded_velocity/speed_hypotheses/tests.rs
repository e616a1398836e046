//! What is a vehicle and what is none; elementary steps beside dense products; corrections of the filter.

use super::*;
use crate::attitude::bounded_velocity::ScaleStates;
use nalgebra::Matrix3;
use std::vec::Vec;

const GRAVITY: f64 = 9.81;

/// A device that does not turn feels `level` for `dt` seconds.
fn feed(hypotheses: &mut SpeedHypotheses<f64>, level: &Vector3<f64>, dt: f64) {
    let mut sums = Sums::default();
    let turn = Matrix3::identity();
    sums.add_rate(ScaleStates::Off, &turn, &Vector3::zeros(), dt, 1e-6);
    sums.add_force(level, dt, 1e-4);
    hypotheses.force(level, dt);
    hypotheses.advance(&sums);
}

/// Feeds `seconds` of a level device that is carried with this acceleration eastwards, with a bias about north (rad/s);
/// which hypothesis is the likeliest after each look.
fn carried(
    hypotheses: &mut SpeedHypotheses<f64>,
    config: &BoundedVelocityConfig<f64>,
    seconds: f64,
    acceleration: impl Fn(f64) -> f64,
    bias: f64,
) -> Vec<u8> {
    let (dt, mut likeliest, mut tilted) = (0.01, Vec::new(), 0.0_f64);
    for k in 0..(seconds / dt) as u32 {
        let a = acceleration(f64::from(k) * dt);
        // A bias about north tilts what the filter thinks is level.
        tilted += bias * dt;
        let level = Vector3::new(a - GRAVITY * tilted, 0.0, GRAVITY);
        feed(hypotheses, &level, dt);
        if hypotheses.is_due() {
            hypotheses.look(config);
            if !hypotheses.is_looking() {
                likeliest.push(hypotheses.likeliest);
            }
        }
    }
    likeliest
}

/// The speeds alone: a car that begins to accelerate is a bias that drifts for the first looks.
fn speeds_alone() -> BoundedVelocityConfig<f64> {
    BoundedVelocityConfig {
        drifting_bias_weight: 0.0,
        ..BoundedVelocityConfig::lab()
    }
}

fn fresh() -> SpeedHypotheses<f64> {
    SpeedHypotheses::new(&speeds_alone(), 0.03_f64.powi(2), 0.005_f64.powi(2))
}

#[test]
fn a_hand_is_a_hand_and_a_car_is_none() {
    let mut h = fresh();
    let hand = carried(
        &mut h,
        &speeds_alone(),
        20.0,
        |t| 3.0 * (5.0 * t).sin(),
        0.0,
    );
    assert!(hand.iter().all(|k| *k == 0), "{hand:?}");
    // From there into a car that gets to 20 m/s in 10 s and stays at it.
    let speed = carried(
        &mut h,
        &speeds_alone(),
        30.0,
        |t| if t < 10.0 { 2.0 } else { 0.0 },
        0.0,
    );
    assert!(speed.iter().skip(3).all(|k| *k >= 1), "{speed:?}");
}

/// GIVEN looks at a velocity that lasts WHEN they speak against a vehicle THEN they count once for as long as it lasts; what speaks for it
/// counts in full.
#[test]
fn looks_at_a_vehicle_that_is_slow_are_few() {
    let tempered = |likelihoods: [f64; HYPOTHESES], drifting_weight: f64| {
        let mut h = fresh();
        h.hypotheses[DRIFTING].weight = drifting_weight;
        for (h, likelihood) in h.hypotheses.iter_mut().zip(likelihoods) {
            h.likelihood = likelihood;
        }
        h.temper(5.0);
        SVector::from(h.hypotheses.map(|h| h.likelihood))
    };
    let is = |likelihoods, weight, expected: [f64; HYPOTHESES]| {
        let after = tempered(likelihoods, weight);
        let off: SVector<f64, HYPOTHESES> = after - SVector::from(expected);
        assert!(off.amax() < 1e-12, "{after}");
    };
    is([-2.0, -4.0, -12.0, -7.0], 0.0, [-2.0, -2.4, -4.0, -7.0]);
    is([-9.0, -3.0, -4.0, -9.5], 0.0, [-9.0, -3.0, -4.0, -9.5]);
    // A bias that drifts is slow, too, where there is such a hypothesis.
    is([-9.0, -4.0, -3.0, -2.0], 0.0, [-9.0, -4.0, -3.0, -2.0]);
    is([-9.0, -4.0, -3.0, -2.0], 0.01, [-9.0, -2.4, -2.2, -2.0]);
}

/// GIVEN a hand whose bias is known WHEN it steps THEN the likeliest becomes a hand with the new bias, and no vehicle after that.
#[test]
fn a_bias_that_steps_is_found() {
    let config = BoundedVelocityConfig::<f64>::lab();
    let mut h = SpeedHypotheses::new(&config, 0.01_f64.powi(2), 0.0005_f64.powi(2));
    let sway = |t: f64| 2.0 * (4.0 * t).sin();
    let likeliest = carried(&mut h, &config, 60.0, sway, 0.015);
    assert!(likeliest[15..].iter().all(|k| *k == 0), "{likeliest:?}");
    let learnt = h.hypotheses[0].x[BIAS + 1];
    assert!((learnt + 0.015).abs() < 2e-3, "{learnt}");
}

#[test]
fn a_bias_is_learnt_and_is_no_vehicle() {
    let mut h = fresh();
    let sway = |t: f64| 2.0 * (4.0 * t).sin();
    let likeliest = carried(&mut h, &BoundedVelocityConfig::lab(), 30.0, sway, 0.01);
    let last = &likeliest[5..];
    assert!(last.iter().all(|k| *k == 0), "{likeliest:?}");
    let learnt = h.hypotheses[0].x[BIAS + 1];
    assert!((learnt + 0.01).abs() < 1e-3, "{learnt}");
}

/// GIVEN any covariance and interval WHEN it is predicted and updated by elementary steps THEN it is the dense product.
#[test]
fn elementary_steps_are_the_dense_product() {
    let number = |i: usize, j: usize| ((i * 7 + j * 3 + 1) as f64 * 0.7).sin();
    let mut h = fresh().hypotheses[1];
    let root = SMatrix::<f64, STATES, STATES>::from_fn(number);
    h.p = root * root.transpose();
    h.x = SVector::from_fn(|i, _| number(i, 2));
    let mut interval = Interval::new();
    interval.up = 19.6;
    interval.rotation = Matrix2x3::from_fn(number) * 2.0;
    interval.swept = Matrix2x3::from_fn(|i, j| number(j, i)) * 20.0;
    interval.angle_variance = 1e-3;
    let mut phi = SMatrix::<f64, STATES, STATES>::identity();
    phi[(VELOCITY, TILT + 1)] = 19.6;
    phi[(VELOCITY + 1, TILT)] = -19.6;
    for c in 0..3 {
        phi[(TILT, BIAS + c)] = -interval.rotation[(0, c)];
        phi[(TILT + 1, BIAS + c)] = -interval.rotation[(1, c)];
        phi[(VELOCITY, BIAS + c)] = -interval.swept[(1, c)];
        phi[(VELOCITY + 1, BIAS + c)] = interval.swept[(0, c)];
    }
    let (x, mut p) = (phi * h.x, phi * h.p * phi.transpose());
    for (t, v, sign) in [(1, 2, 1.0), (0, 3, -1.0)] {
        p[(t, t)] += 1e-3;
        p[(v, v)] += 19.6 * 19.6 * 1e-3 / 3.0;
        p[(t, v)] += sign * 19.6 * 1e-3 / 2.0;
        p[(v, t)] += sign * 19.6 * 1e-3 / 2.0;
    }
    h.predict(&interval);
    assert!((h.x - x).amax() < 1e-12 * x.amax(), "{} {x}", h.x);
    assert!((h.p - p).amax() < 1e-12 * p.amax(), "{} {p}", h.p);
    let velocity = h.p.fixed_view::<2, 2>(VELOCITY, VELOCITY) + nalgebra::Matrix2::identity() * 9.0;
    let columns = h.p.fixed_columns::<2>(VELOCITY).into_owned();
    let gain = columns * velocity.try_inverse().unwrap();
    let (x, p) = (
        h.x - gain * h.x.fixed_rows::<2>(VELOCITY),
        h.p - gain * columns.transpose(),
    );
    h.update(9.0);
    assert!((h.x - x).amax() < 1e-10 * x.amax() && (h.p - p).amax() < 1e-10 * p.amax());
}

#[test]
fn what_the_filter_corrects_is_not_seen_twice() {
    let config = BoundedVelocityConfig::<f64>::lab();
    let (mut free, mut held) = (fresh(), fresh());
    // A tilt about north of 0.02: free, and with a filter that finds it after half a second.
    let tilt = 0.02;
    for k in 0..200 {
        let level = |tilt: f64| Vector3::new(-GRAVITY * tilt, 0.0, GRAVITY);
        let found = k >= 50;
        if k == 50 {
            held.corrected(&Vector2::new(0.0, tilt), &Vector3::zeros());
        }
        for (h, tilt) in [
            (&mut free, tilt),
            (&mut held, if found { 0.0 } else { tilt }),
        ] {
            feed(h, &level(tilt), 0.01);
        }
    }
    for _ in 0..HYPOTHESES {
        free.look(&config);
        held.look(&config);
    }
    for (a, b) in free.hypotheses.iter().zip(&held.hypotheses) {
        assert!((a.x[VELOCITY] - b.x[VELOCITY]).abs() < 1e-9);
        assert!((a.x[TILT + 1] - tilt - b.x[TILT + 1]).abs() < 1e-9);
        assert!((a.p - b.p).amax() < 1e-12);
    }
}

/// GIVEN any estimate of a hypothesis WHEN a filter without a magnetometer takes it over THEN the bias about the vertical is none, with the
/// filter's own variance, of which the others know nothing; all else is as the hypothesis has it. A step is expected there as well.
#[test]
fn the_bias_about_the_vertical_is_not_taken_over() {
    let number = |i: usize, j: usize| ((i * 5 + j * 2 + 1) as f64 * 0.9).sin();
    let mut h = fresh().hypotheses[1];
    let root = SMatrix::<f64, STATES, STATES>::from_fn(number);
    h.p = root * root.transpose();
    h.x = SVector::from_fn(|i, _| number(i, 3));
    let up = Vector3::new(0.36, -0.48, 0.8);
    let mut project = SMatrix::<f64, STATES, STATES>::identity();
    let mut block = project.fixed_view_mut::<3, 3>(BIAS, BIAS);
    block -= up * up.transpose();
    let x = project * h.x;
    let level = x.fixed_rows::<3>(BIAS).norm_squared();
    for (likeliest, variance) in [
        (Likeliest::Faster(h), 0.2),
        (Likeliest::Stepped(h), 0.2 + 0.5 * level),
    ] {
        let mut p = project * h.p * project;
        let mut block = p.fixed_view_mut::<3, 3>(BIAS, BIAS);
        block += up * up.transpose() * variance;
        let taken = likeliest.without_vertical_bias(&up, 0.2);
        assert!((taken.x - x).amax() < 1e-12, "{}", taken.x);
        assert!((taken.p - p).amax() < 1e-12, "{}", taken.p);
    }
}
