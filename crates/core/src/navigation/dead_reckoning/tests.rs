//! Tests of dead reckoning: the dense filter as oracle, closed forms, and what must not get in.

use nalgebra::{Matrix2x4, Matrix4, Vector2, Vector4};

use std::vec::Vec;

use super::*;

const STD: f64 = 2.5;

/// A ship that makes 5 m/s through the water to the north-east in a current of 0.7 m/s.
fn after(seconds: usize, fixes: bool) -> DeadReckoning<f64> {
    let mut filter = DeadReckoning::new(DeadReckoningConfig::default()).unwrap();
    let water = Vector2::new(4.0, 3.0);
    let over_ground = water + Vector2::new(-0.5, 0.5);
    filter.water_velocity(&water).unwrap();
    filter.update_position(&Vector2::zeros(), STD);
    for k in 1..=seconds {
        filter.propagate(1.0).unwrap();
        if fixes {
            filter.update_position(&(over_ground * k as f64), STD);
        }
    }
    filter
}

#[test]
fn it_learns_the_current_and_carries_it_through_an_outage() {
    let mut filter = after(300, true);
    let learnt = filter.current() - Vector2::new(-0.5, 0.5);
    assert!(learnt.norm() < 0.01, "{learnt}");
    assert_eq!(filter.validity(), Validity::Aided);
    for _ in 0..600 {
        filter.propagate(1.0).unwrap();
    }
    let truth = Vector2::new(3.5, 3.5) * 900.0;
    assert!((filter.position() - truth).norm() < 10.0);
    assert_eq!(filter.validity(), Validity::DeadReckoning);
    let variance = filter.position_covariance().m11;
    assert!(variance > 100.0 && variance < 4e5, "{variance}");
}

#[test]
fn without_a_log_it_is_a_filter_of_constant_velocity() {
    let mut filter = DeadReckoning::<f64>::new(DeadReckoningConfig::default()).unwrap();
    for k in 0..200 {
        filter.update_position(&(Vector2::new(1.0, -2.0) * f64::from(k)), STD);
        filter.propagate(1.0).unwrap();
    }
    assert!((filter.velocity() - Vector2::new(1.0, -2.0)).norm() < 1e-3);
}

#[test]
fn scalar_updates_in_place_equal_the_dense_joseph_form() {
    let mut filter = after(40, true);
    let before = *filter.state();
    filter.propagate(0.7).unwrap();
    let config = DeadReckoningConfig::<f64>::default();
    let mut f = Matrix4::identity();
    (f[(0, 2)], f[(1, 3)]) = (0.7, 0.7);
    let white = config.water_velocity_noise_density.powi(2) * 0.7;
    let walk = config.current_random_walk.powi(2) * 0.7;
    let q = Matrix4::from_diagonal(&Vector4::new(white, white, walk, walk));
    let predicted = f * before.covariance * f.transpose() + q;
    assert!((predicted - filter.state().covariance).norm() < 1e-12);

    let z = filter.position() + Vector2::new(3.0, -1.0);
    let state = filter.state().state;
    let done = filter.update_position(&z, STD);
    let mut h = Matrix2x4::zeros();
    (h[(0, 0)], h[(1, 1)]) = (1.0, 1.0);
    let r = Matrix2::identity() * (STD * STD);
    let s = h * predicted * h.transpose() + r;
    let gain = predicted * h.transpose() * s.try_inverse().unwrap();
    let i_kh = Matrix4::identity() - gain * h;
    let joseph = i_kh * predicted * i_kh.transpose() + gain * r * gain.transpose();
    let expected = state + gain * Vector2::new(3.0, -1.0);
    assert!((joseph - filter.state().covariance).norm() < 1e-9);
    assert!((expected - filter.state().state).norm() < 1e-9);
    let nis = Vector2::new(3.0, -1.0).dot(&(s.try_inverse().unwrap() * Vector2::new(3.0, -1.0)));
    assert!((done.nis - nis).abs() < 1e-9 && done.degrees_of_freedom == 2);
}

#[test]
fn a_jump_is_left_out_until_it_has_come_six_times() {
    let mut filter = after(60, true);
    let mut far = filter.position() + Vector2::new(900.0, 0.0);
    for _ in 0..5 {
        assert_eq!(filter.update_position(&far, STD).outcome, Outcome::Gated);
        far.y += 0.5;
    }
    let current = filter.current();
    assert_eq!(filter.update_position(&far, STD).outcome, Outcome::Inflated);
    assert_eq!((filter.position(), filter.current()), (far, current));
}

/// A fix a second of a ship at 6 m/s to the east, the receiver frozen from one second to another; the error at each second.
fn frozen(has_log: bool, from: u32, until: u32) -> Vec<f64> {
    let mut filter = DeadReckoning::<f64>::new(DeadReckoningConfig::default()).unwrap();
    let errors = (0..120_u32).map(|k| {
        let truth = Vector2::new(0.0, 6.0 * f64::from(k));
        let told = match (from..until).contains(&k) {
            true => from,
            false => k,
        };
        let noise = Vector2::new((7.7 * f64::from(told)).sin(), (5.3 * f64::from(told)).cos());
        let fix = Vector2::new(0.0, 6.0 * f64::from(told)) + noise;
        if has_log {
            filter.water_velocity(&Vector2::new(0.3, 5.5)).unwrap();
        }
        filter.update_position(&fix, 1.0);
        let error = (filter.position() - truth).norm();
        filter.propagate(1.0).unwrap();
        error
    });
    errors.collect()
}

#[test]
fn a_receiver_that_is_frozen_is_not_followed() {
    let errors = frozen(true, 60, 90);
    let worst = errors.iter().skip(5).copied().fold(0.0, f64::max);
    assert!(worst < 6.0, "{worst}");
    // Without a log the ship may have stopped; the second new fix tells that it has not.
    let errors = frozen(false, 60, 90);
    let after = errors.iter().skip(91).copied().fold(0.0, f64::max);
    assert!(after < 3.0, "{errors:?}");
}

/// Each fix ten times, as in a table with a row for every inertial sample.
#[test]
fn a_fix_that_a_table_tells_again_is_used_once_while_the_ship_moves() {
    let mut filter = DeadReckoning::<f64>::new(DeadReckoningConfig::default()).unwrap();
    let (mut used, mut worst) = (0, 0.0_f64);
    for k in 0..600 {
        let truth = Vector2::new(0.0, 0.6 * f64::from(k));
        let told = f64::from(k / 10);
        let fix = Vector2::new((7.7 * told).sin(), 6.0 * told + (5.3 * told).cos());
        let done = filter.update_position(&fix, 1.0).outcome;
        if k >= 300 {
            used += usize::from(done.is_fused());
            worst = worst.max((filter.position() - truth).norm());
        }
        filter.propagate(0.1).unwrap();
    }
    assert!(used == 30 && worst < 3.0, "{used} used, {worst} m");
}

#[test]
fn a_ship_that_lies_still_uses_every_fix_of_the_same_digits() {
    let mut filter = DeadReckoning::<f64>::new(DeadReckoningConfig::default()).unwrap();
    for _ in 0..600 {
        let done = filter.update_position(&Vector2::new(3.0, 4.0), 1.0).outcome;
        assert!(done.is_fused(), "{done:?}");
        filter.propagate(1.0).unwrap();
    }
}

/// A vehicle without a log that has done nothing for a minute and then turns with so much, m/s^2, a fix a second.
fn turning(acceleration: f64) -> (f64, usize) {
    let mut filter = DeadReckoning::<f64>::new(DeadReckoningConfig::default()).unwrap();
    let speed = 15.0;
    let (mut course, mut place, mut worst, mut gated) = (0.3_f64, Vector2::zeros(), 0.0_f64, 0);
    for k in 0..2400 {
        if k % 10 == 0 {
            let noise = Vector2::new((7.7 * f64::from(k)).sin(), (5.3 * f64::from(k)).cos()) * 0.5;
            let done = filter.update_position(&(place + noise), 0.5).outcome;
            gated += usize::from(done == Outcome::Gated);
            if k > 300 {
                worst = worst.max((filter.position() - place).norm());
            }
        }
        filter.propagate(0.1).unwrap();
        let turns = k > 600 && (k / 80) % 2 == 0;
        course += if turns {
            acceleration / speed * 0.1
        } else {
            0.0
        };
        place += Vector2::new(course.cos(), course.sin()) * (speed * 0.1);
    }
    (worst, gated)
}

#[test]
fn without_a_log_it_follows_a_vehicle_that_turns() {
    for (acceleration, most) in [(1.0, 1.5), (3.0, 8.0), (6.0, 22.0)] {
        let (worst, gated) = turning(acceleration);
        assert!(
            worst < most && gated <= 3,
            "{acceleration}: {worst} m, {gated} gated"
        );
    }
}

#[test]
fn without_a_log_a_vehicle_that_moves_at_first_is_followed_and_a_log_that_comes_later_explains_its_share()
 {
    let mut filter = DeadReckoning::<f64>::new(DeadReckoningConfig::default()).unwrap();
    let velocity = Vector2::new(30.0, -20.0);
    for k in 0..60 {
        let done = filter.update_position(&(velocity * f64::from(k)), STD);
        assert!(done.outcome.is_fused(), "{k}: {done:?}");
        filter.propagate(1.0).unwrap();
    }
    let before = filter.velocity();
    assert!((before - velocity).norm() < 1e-3);
    filter.water_velocity(&Vector2::new(29.0, -20.0)).unwrap();
    assert!((filter.velocity() - before).norm() < 1e-9);
    // Where nothing is known of the velocity yet, the log is most of it.
    let mut filter = DeadReckoning::<f64>::new(DeadReckoningConfig::default()).unwrap();
    filter.update_position(&Vector2::zeros(), STD);
    filter.water_velocity(&velocity).unwrap();
    assert!((filter.velocity() - velocity).norm() < 1e-9);
    let std = filter.state().covariance.m33.sqrt();
    assert!((std - 2.0).abs() < 1e-9, "{std}");
}

#[test]
fn what_is_no_number_or_no_velocity_stays_out_and_the_position_says_when_it_is_worth_nothing() {
    let mut filter = after(10, true);
    let before = *filter.state();
    let nan = Vector2::new(f64::NAN, 0.0);
    assert_eq!(filter.water_velocity(&nan), Err(SkipReason::NotFinite));
    let fast = Vector2::new(1e3, 0.0);
    assert_eq!(filter.water_velocity(&fast), Err(SkipReason::OutOfRange));
    assert_eq!(filter.propagate(f64::NAN), Err(SkipReason::NotFinite));
    assert_eq!(filter.propagate(60.0), Err(SkipReason::OutOfRange));
    for (position, std) in [
        (nan, 1.0),
        (Vector2::zeros(), 0.0),
        (Vector2::zeros(), f64::NAN),
    ] {
        assert!(!filter.update_position(&position, std).outcome.is_fused());
        assert!(!filter.update_velocity(&position, std).outcome.is_fused());
    }
    assert_eq!(*filter.state(), before);
    let broken = DeadReckoningState {
        state: Vector4::repeat(f64::NAN),
        ..before
    };
    assert!(filter.restore(broken).is_err());
    for _ in 0..1801 {
        filter.propagate(1.0).unwrap();
    }
    assert_eq!(filter.validity(), Validity::Invalid);
    let waiting = DeadReckoning::<f64>::new(DeadReckoningConfig::default()).unwrap();
    assert_eq!(waiting.validity(), Validity::Aligning);
    let bad = DeadReckoningConfig {
        current_random_walk: f64::NAN,
        ..DeadReckoningConfig::default()
    };
    let refused = DeadReckoning::new(bad).unwrap_err();
    assert_eq!(refused.field, "current_random_walk");
}

#[test]
fn after_days_without_a_fix_the_next_one_is_accepted() {
    for has_log in [false, true] {
        let mut filter = DeadReckoning::<f64>::new(DeadReckoningConfig::default()).unwrap();
        if has_log {
            filter.water_velocity(&Vector2::zeros()).unwrap();
        }
        filter.update_position(&Vector2::zeros(), STD);
        for _ in 0..3 * 8640 {
            filter.propagate(10.0).unwrap();
        }
        let p = filter.state().covariance;
        assert!(p.symmetric_eigenvalues().min() > 0.0, "{p}");
        let found = Vector2::new(5000.0, -3000.0);
        for _ in 0..60 {
            filter.propagate(1.0).unwrap();
            filter.update_position(&found, STD);
        }
        assert!((filter.position() - found).norm() < STD, "{has_log}");
        assert!(filter.velocity().norm() < 1.0);
    }
}

#[test]
fn single_precision_follows_double() {
    let double = after(300, true);
    let mut single = DeadReckoning::<f32>::new(DeadReckoningConfig::default()).unwrap();
    single.water_velocity(&Vector2::new(4.0, 3.0)).unwrap();
    single.update_position(&Vector2::zeros(), STD as f32);
    for k in 1..=300_u16 {
        single.propagate(1.0).unwrap();
        single.update_position(&(Vector2::new(3.5, 3.5) * f32::from(k)), STD as f32);
    }
    let apart = single.position().cast::<f64>() - double.position();
    assert!(apart.norm() < 1e-2, "{apart}");
}

#[test]
fn the_stated_errors_are_those_made() {
    let mut sum = 0.0;
    let runs = 40;
    for run in 0..runs {
        sum += normalized_error(run);
    }
    let mean = sum / f64::from(runs);
    // 95 % of the mean of 40 chi-squares of 4 degrees of freedom lie between 3.17 and 4.92.
    assert!((3.1..5.0).contains(&mean), "{mean}");
}

/// Normalised estimation error squared after ten minutes of a truth drawn from the model itself.
fn normalized_error(seed: u32) -> f64 {
    let mut noise = Noise(u64::from(seed) * 7919 + 17);
    let config = DeadReckoningConfig::<f64>::default();
    let mut filter = DeadReckoning::new(config).unwrap();
    let water = Vector2::new(4.0, 3.0);
    filter.water_velocity(&water).unwrap();
    let mut current = noise.pair() * config.initial_current_std;
    let mut place = Vector2::zeros();
    filter.update_position(&(place + noise.pair() * STD), STD);
    for _ in 0..600 {
        place += water + current + noise.pair() * config.water_velocity_noise_density;
        current += noise.pair() * config.current_random_walk;
        filter.propagate(1.0).unwrap();
        filter.update_position(&(place + noise.pair() * STD), STD);
    }
    let error = Vector4::new(place.x, place.y, current.x, current.y) - filter.state().state;
    error.dot(&(filter.state().covariance.try_inverse().unwrap() * error))
}

/// Gaussian noise by the sum of twelve uniform numbers of a linear congruential generator.
struct Noise(u64);

impl Noise {
    fn pair(&mut self) -> Vector2<f64> {
        Vector2::new(self.one(), self.one())
    }

    fn one(&mut self) -> f64 {
        let mut sum = -6.0;
        for _ in 0..12 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            sum += (self.0 >> 11) as f64 / (1_u64 << 53) as f64;
        }
        sum
    }
}
