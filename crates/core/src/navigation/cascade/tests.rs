use super::*;
use crate::geometry::so3;
use approx::assert_relative_eq;
use nalgebra::SMatrix;
use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64;
use std::vec::Vec;

const G: f64 = 9.81;
const UP: Vector3<f64> = Vector3::new(0.0, 0.0, G);

fn observer(pole: f64) -> Cascade<f64> {
    let config = CascadeConfig {
        pole,
        ..CascadeConfig::lab()
    };
    Cascade::new(config, UP).unwrap()
}

/// What one interval with ten inertial samples and a position makes of an error of one component
/// of the state, at rest at the origin.
fn after_one_interval(pole: f64, interval: f64, component: usize) -> Vector3<f64> {
    let identity = UnitQuaternion::identity();
    let mut f = observer(pole);
    f.config.position_std_m = 100.0;
    f.update_position(&Vector3::zeros(), 0.0, &identity, &Vector3::zeros());
    // Small, so that the bias stays within its bound.
    let size = 1e-3;
    match component {
        0 => f.memory.state.position.x = size,
        1 => f.memory.state.velocity.x = size,
        _ => f.memory.state.accelerometer_bias.x = size,
    }
    for _ in 0..10 {
        f.propagate(&identity, &UP, interval / 10.0).unwrap();
    }
    f.update_position(&Vector3::zeros(), 0.0, &identity, &Vector3::zeros());
    Vector3::new(
        f.memory.state.position.x,
        f.memory.state.velocity.x,
        f.memory.state.accelerometer_bias.x,
    ) / size
}

#[test]
fn all_three_discrete_poles_lie_at_theta() {
    for (pole, interval) in [
        (1.0, 0.1),
        (0.5, 0.2),
        (0.25, 1.0),
        (0.25, 10.0),
        (1.0, 60.0),
    ] {
        let columns = [0, 1, 2].map(|i| after_one_interval(pole, interval, i));
        let step = Matrix3::from_columns(&columns);
        let theta = (-pole * interval).exp();
        // Cayley-Hamilton: the characteristic polynomial is (z - theta)^3.
        let minors = (step.trace().powi(2) - (step * step).trace()) / 2.0;
        assert_relative_eq!(step.trace(), 3.0 * theta, epsilon = 1e-9);
        assert_relative_eq!(minors, 3.0 * theta * theta, epsilon = 1e-9);
        assert_relative_eq!(step.determinant(), theta.powi(3), epsilon = 1e-9);
    }
}

/// The continuous loop while spinning about z at `rate`, in axes that turn with the body.
fn largest_real_part(pole: f64, rate: f64, with_term: bool) -> f64 {
    let (k_p, k_v, k_b) = (3.0 * pole, 3.0 * pole * pole, pole.powi(3));
    let spin = Vector3::new(0.0, 0.0, rate).cross_matrix();
    let eye = Matrix3::identity();
    let term = if with_term {
        spin / k_p
    } else {
        Matrix3::zeros()
    };
    let mut a = SMatrix::<f64, 9, 9>::zeros();
    // Errors p, v, b in body axes: d/dt R^T p = -spin R^T p + R^T dp/dt; the bias is fixed in the body.
    a.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&(-spin - eye * k_p));
    a.fixed_view_mut::<3, 3>(0, 3).copy_from(&eye);
    a.fixed_view_mut::<3, 3>(3, 0).copy_from(&(-eye * k_v));
    a.fixed_view_mut::<3, 3>(3, 3).copy_from(&-spin);
    a.fixed_view_mut::<3, 3>(3, 6).copy_from(&-eye);
    a.fixed_view_mut::<3, 3>(6, 0)
        .copy_from(&((eye + term) * k_b));
    let poles = a.complex_eigenvalues();
    poles.iter().map(|p| p.re).fold(f64::MIN, f64::max)
}

#[test]
fn without_the_rotation_rate_term_the_loop_is_unstable_above_one_and_a_half_poles() {
    for (rate, without, with) in [(2.0, 0.033, -0.054), (4.0, 0.040, -0.0075)] {
        assert_relative_eq!(largest_real_part(1.0, rate, false), without, epsilon = 1e-3);
        assert_relative_eq!(largest_real_part(1.0, rate, true), with, epsilon = 1e-3);
    }
    let limit = 3.0_f64.sqrt() - 1.0 / (3.0 * 3.0_f64.sqrt());
    assert_relative_eq!(limit, 1.54, epsilon = 0.005);
    for pole in [0.3, 1.0, 2.0] {
        assert!(largest_real_part(pole, 0.99 * limit * pole, false) < 0.0);
        assert!(largest_real_part(pole, 1.01 * limit * pole, false) > 0.0);
    }
}

/// The Lyapunov function of the derivation, along a random rotation, with any gains that obey
/// `k_p k_v > k_b`.
#[test]
fn the_lyapunov_function_never_grows() {
    let mut rng = Pcg64::seed_from_u64(8);
    for _ in 0..20 {
        let mut random =
            |scale: f64| Vector3::from_fn(|_, _| scale * rng.sample::<f64, _>(StandardNormal));
        let gains = random(0.5).map(f64::exp);
        let (k_p, k_b) = (gains.x, gains.y);
        let k_v = k_b / k_p * (1.0 + gains.z);
        let k_s = k_b / k_p;
        let (mut p, mut v, mut b) = (random(1.0), random(1.0), random(0.3));
        let (swing, speed) = (random(3.0), random(2.0));
        let (mut attitude, mut last) = (UnitQuaternion::identity(), f64::MAX);
        let dt = 1e-4;
        for k in 0..50_000 {
            let t = f64::from(k) * dt;
            let rate = Vector3::from_fn(|i, _| swing[i] * (speed[i] * t).sin());
            let eta = attitude * b + p * k_s;
            let value = eta.norm_squared() / (2.0 * k_s)
                + v.norm_squared() / 2.0
                + (k_v - k_s) * p.norm_squared() / 2.0;
            assert!(
                value <= last * (1.0 + 1e-6),
                "at {t} s: {value} after {last}"
            );
            last = value;
            // True minus estimated: the estimated bias follows -k_b (I + [w]x/k_p) R^T e.
            let body = attitude.inverse() * p;
            let (dp, dv) = (v - p * k_p, -(attitude * b) - p * k_v);
            let db = (body + rate.cross(&body) / k_p) * k_b;
            p += dp * dt;
            v += dv * dt;
            b += db * dt;
            attitude *= so3::exp(&(rate * dt));
        }
    }
}

/// Two minutes in motion, 100 Hz inertial and 10 Hz positions; returns the errors of position,
/// velocity and bias over the last 20 s.
fn circling(config: CascadeConfig<f64>, spin: f64, delay: f64, bias: Vector3<f64>) -> [f64; 3] {
    let mut rng = Pcg64::seed_from_u64(3);
    let mut noise = |std: f64| Vector3::from_fn(|_, _| std * rng.sample::<f64, _>(StandardNormal));
    let mut f = Cascade::new(config, UP).unwrap();
    let path = |t: f64| {
        let (s, c) = (0.8 * t).sin_cos();
        (
            Vector3::new(3.0 * s, 2.0 * c, 0.0),
            Vector3::new(2.4 * c, -1.6 * s, 0.0),
            Vector3::new(-1.92 * s, -1.28 * c, 0.0),
        )
    };
    let rate = Vector3::new(0.0, 0.0, spin);
    let (mut sums, mut count) = ([0.0; 3], 0.0);
    for k in 0..12_000_u32 {
        let t = f64::from(k) * 0.01;
        let attitude = so3::exp(&(rate * t));
        let (p, v, _) = path(t);
        if k % 10 == 0 {
            let then = path(t - delay).0;
            f.update_position(&(then + noise(0.1)), delay, &attitude, &rate);
        }
        if t > 100.0 {
            let state = f.state().unwrap();
            for (sum, error) in sums.iter_mut().zip([
                state.position - p,
                state.velocity - v,
                state.accelerometer_bias - bias,
            ]) {
                *sum += error.norm_squared();
            }
            count += 1.0;
        }
        // Force and attitude of the middle of the interval.
        let middle = so3::exp(&(rate * (t + 0.005)));
        let force = middle.inverse() * (path(t + 0.005).2 + UP) + bias;
        f.propagate(&middle, &(force + noise(0.05)), 0.01).unwrap();
    }
    sums.map(|sum: f64| (sum / count).sqrt())
}

#[test]
fn position_velocity_and_bias_are_found_on_a_path() {
    let bias = Vector3::new(0.1, -0.05, 0.08);
    let [p, v, b] = circling(CascadeConfig::lab(), 0.5, 0.0, bias);
    assert!(p < 0.1 && v < 0.1 && b < 0.05, "{p} m, {v} m/s, {b} m/s^2");
}

/// Whatever the steps are: entries of the past are as far apart as they are.
#[test]
fn the_past_is_looked_up_by_its_time() {
    for dt in [0.003, 0.015, 0.04, 0.2] {
        let identity = UnitQuaternion::identity();
        let mut f = observer(1.0);
        f.update_position(&Vector3::zeros(), 0.0, &identity, &Vector3::zeros());
        f.memory.state.velocity.x = 2.0;
        let steps = (2.0_f64 / dt).round() as usize;
        for _ in 0..steps {
            f.propagate(&identity, &UP, dt).unwrap();
        }
        let now = f.memory.state.position;
        for age in [0.0, 0.07, 0.5, 1.1] {
            let then = f.memory.past.before(age, &now).unwrap();
            assert_relative_eq!(now.x - then.x, 2.0 * age, epsilon = 1e-9);
        }
    }
}

#[test]
fn a_late_position_is_compared_with_its_own_instant() {
    let bias = Vector3::zeros();
    let [p, v, _] = circling(CascadeConfig::lab(), 0.5, 0.4, bias);
    assert!(p < 0.15 && v < 0.15, "{p} m, {v} m/s");
}

/// The measurement of the specification: 3 rad/s, pole 1, bias error after a while.
#[test]
fn spinning_needs_the_rotation_rate_term() {
    let bias = Vector3::new(0.1, -0.05, 0.08);
    let config = CascadeConfig {
        // Without a bound on what is accepted: this is about the loop.
        position_std_m: 1e3,
        ..CascadeConfig::lab()
    };
    let [with, _, bias_with] = circling(config, 3.0, 0.0, bias);
    let without = CascadeConfig {
        rotation_rate_term: false,
        ..config
    };
    let [without, _, bias_without] = circling(without, 3.0, 0.0, bias);
    assert!(with < 0.1 && bias_with < 0.4, "{with} m, {bias_with} m/s^2");
    // Its bound keeps the bias from running away altogether.
    assert!(
        without > 1.05 * with && bias_without > 2.0 * bias_with,
        "{without} m after {with} m, {bias_without} m/s^2 after {bias_with} m/s^2"
    );
}

#[test]
fn a_repeated_or_earlier_position_is_refused() {
    let identity = UnitQuaternion::identity();
    let mut f = observer(1.0);
    let still = Vector3::zeros();
    assert!(f.state().is_none());
    assert!(
        f.update_position(&Vector3::x(), 0.0, &identity, &still)
            .outcome
            .is_fused()
    );
    for _ in 0..20 {
        f.propagate(&identity, &UP, 0.01).unwrap();
    }
    assert!(
        f.update_position(&Vector3::x(), 0.0, &identity, &still)
            .outcome
            .is_fused()
    );
    let before = f;
    for age in [0.0, 0.1] {
        let outcome = f
            .update_position(&Vector3::x(), age, &identity, &still)
            .outcome;
        assert_eq!(outcome, Outcome::Skipped(SkipReason::NotNewer));
    }
    f.propagate(&identity, &UP, 0.01).unwrap();
    // The receiver says it again a moment later, and that it is of then.
    let outcome = f
        .update_position(&Vector3::x(), 0.01, &identity, &still)
        .outcome;
    assert_eq!(outcome, Outcome::Skipped(SkipReason::NotNewer));
    assert_eq!(
        f.state().unwrap().position,
        before.state().unwrap().position
    );
}

#[test]
fn outliers_are_left_out_until_there_are_too_many() {
    let identity = UnitQuaternion::identity();
    let still = Vector3::zeros();
    let mut f = observer(1.0);
    f.update_position(&Vector3::zeros(), 0.0, &identity, &still);
    let mut outcomes = Vec::new();
    for _ in 0..7 {
        for _ in 0..10 {
            f.propagate(&identity, &UP, 0.01).unwrap();
        }
        let far = Vector3::new(5.0, 0.0, 0.0);
        outcomes.push(f.update_position(&far, 0.0, &identity, &still).outcome);
    }
    assert_eq!(outcomes[..5], [Outcome::Gated; 5]);
    assert_eq!(outcomes[5], Outcome::Inflated);
    assert!(f.state().unwrap().position.x > 0.5);
}

#[test]
fn bad_samples_leave_the_state_untouched() {
    let identity = UnitQuaternion::identity();
    let still = Vector3::zeros();
    let mut f = observer(1.0);
    f.update_position(&Vector3::zeros(), 0.0, &identity, &still);
    f.propagate(&identity, &UP, 0.1).unwrap();
    let before = f;
    let nan = Vector3::new(f64::NAN, 0.0, 0.0);
    let huge = Vector3::new(1e300, 0.0, 0.0);
    for bad in [nan, huge] {
        assert!(f.propagate(&identity, &bad, 0.01).is_err());
        for outcome in [
            f.update_position(&bad, 0.0, &identity, &still).outcome,
            f.update_position(&still, 0.0, &identity, &bad).outcome,
        ] {
            assert!(matches!(outcome, Outcome::Skipped(_)));
        }
    }
    assert!(f.propagate(&identity, &UP, f64::NAN).is_err());
    assert!(f.propagate(&identity, &UP, 1e9).is_err());
    assert_eq!(f.propagate(&identity, &UP, 0.0), Ok(()));
    for age in [f64::NAN, -1.0, 60.0] {
        let outcome = f.update_position(&still, age, &identity, &still).outcome;
        assert!(matches!(outcome, Outcome::Skipped(_)), "{age}");
    }
    assert_eq!(f, before);
    for (config, name) in [
        (
            CascadeConfig {
                pole: 0.0,
                ..CascadeConfig::lab()
            },
            "pole",
        ),
        (
            CascadeConfig {
                position_std_m: f64::NAN,
                ..CascadeConfig::lab()
            },
            "position_std_m",
        ),
    ] {
        assert_eq!(Cascade::new(config, UP).unwrap_err().field, name);
    }
}
