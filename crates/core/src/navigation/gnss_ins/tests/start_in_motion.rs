//! Starts of vehicles that move smoothly from the first sample on: to inertial sensors alone they stand.

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;

use super::*;
use crate::navigation::GYROSCOPE_BIAS;

/// A boat on a circle of 100 m at 5 m/s whose gyroscope has no bias: the bias about down that is estimated after half a
/// minute, and its standard deviation.
fn bias_on_a_circle(seed: u64, has_velocity: bool, position_std: f64) -> (f64, f64) {
    let mut random = Pcg64Mcg::seed_from_u64(seed);
    let mut noise = |std: f64| -> Vector3<f64> {
        Vector3::from_fn(|_, _| {
            let drawn: f64 = StandardNormal.sample(&mut random);
            drawn * std
        })
    };
    let mut ins = GnssIns::<f64>::new(GnssInsConfig::default()).unwrap();
    let (turn_rate, speed) = (0.05, 5.0);
    let heading = |t: f64| 1.0 + turn_rate * t;
    for k in 1..=1500_i64 {
        let (time_ns, t) = (k * 20_000_000, k as f64 * 0.02);
        let rate = Vector3::z() * turn_rate + noise(2e-3);
        let force = Vector3::new(0.0, turn_rate * speed, -GRAVITY) + noise(0.03);
        ins.imu(time_ns, &rate, &force).unwrap();
        if k % 50 == 0 {
            let (sin, cos) = heading(t).sin_cos();
            let place = Vector3::new(sin, -cos, 0.0) * 100.0 + noise(position_std);
            let std = Vector3::repeat(position_std);
            ins.gnss_position(time_ns, &GnssPosition::new(place, std));
            if has_velocity {
                let velocity = Vector3::new(cos, sin, 0.0) * speed + noise(0.1);
                let fix = GnssVelocity::new(velocity, Vector3::repeat(0.1));
                ins.gnss_velocity(time_ns, &fix);
            }
        }
    }
    let state = ins.state().expect("started");
    let variance = state.covariance[(GYROSCOPE_BIAS + 2, GYROSCOPE_BIAS + 2)];
    (state.gyroscope_bias.z, variance.sqrt())
}

#[test]
fn a_steady_turn_from_the_first_sample_on_is_no_bias() {
    for seed in 0..6 {
        for (has_velocity, position_std) in [(true, 2.0), (true, 0.05), (false, 0.05)] {
            let (bias, std) = bias_on_a_circle(seed, has_velocity, position_std);
            // Once 0.05 +- 0.002: the rate of the turn.
            assert!(
                bias.abs() < 3.0 * std && bias.abs() < 0.03,
                "{seed} {has_velocity} {position_std}: {bias} +- {std}"
            );
        }
    }
}
