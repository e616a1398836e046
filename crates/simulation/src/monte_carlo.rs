//! Monte Carlo trials for consistency tests: arrays of truth and measurements of a device that starts and ends
//! in the reference pose.
//!
//! A consistency test runs a filter over many trials and asks whether its errors are as large as it
//! says (NEES, NIS). Here everything is ideal except what the filter models: white noise, a bias
//! that walks, and on request bursts of acceleration and of magnetic disturbance. All samples share
//! one clock; for sensors with their own rates, see [`crate::virtual_phone`].

use std::f64::consts::TAU;

use nalgebra::{UnitQuaternion, Vector3};
use rand::RngExt as _;
use serde::{Deserialize, Serialize};

use crate::random::{Stream, normal_vector, stream};
use crate::rotation::sin_cos;
use crate::settings::settings;
use crate::trajectory::{MultiSine, MultiSineConfig, Trajectory as _, mean_rate};
use crate::world::{default_magnetic_field_ut, specific_force_at_rest};

settings! {
    /// What a trial looks like. The defaults are a phone in a brisk hand for a minute.
    #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct AttitudeTrialConfig {
        /// Length, s. Default 60.
        duration_s: f64 = 60.0,
        /// Samples per second of all three sensors, Hz. Default 100.
        rate_hz: f64 = 100.0,
        /// Size of the motion, rad ([`MultiSineConfig::amplitude_rad`]). Default 1.2; zero is rest.
        amplitude_rad: f64 = 1.2,
        /// White noise of each gyroscope sample, per axis, rad/s. Default 0.005.
        gyroscope_noise_std_rad_s: f64 = 0.005,
        /// Standard deviation of the gyroscope bias at the start, per axis, rad/s. Default 0.02.
        gyroscope_bias_std_rad_s: f64 = 0.02,
        /// Random walk of the gyroscope bias, per axis, (rad/s)/sqrt(s): its variance grows by the
        /// square of this every second. Default 2e-5.
        gyroscope_bias_random_walk_rad_s_sqrt_s: f64 = 2e-5,
        /// White noise of each accelerometer sample, per axis, m/s^2. Default 0.05.
        accelerometer_noise_std_m_s2: f64 = 0.05,
        /// White noise of each magnetometer sample, per axis, microtesla. Default 0.5.
        magnetometer_noise_std_ut: f64 = 0.5,
        /// Amplitude per world axis of 0.8 Hz acceleration bursts that fill 40 % of every 20 s,
        /// m/s^2. Default 0: none.
        acceleration_burst_m_s2: f64 = 0.0,
        /// Field added towards the east for the last 6 s of every 20 s, microtesla. Default 0: none.
        magnetic_burst_ut: f64 = 0.0,
    }
}

/// One trial. With `n` samples there are `n` intervals and `n + 1` instants: `gyroscope[k]`,
/// `accelerometer[k]` and `magnetometer[k]` belong to the interval from instant `k` to `k + 1`. The
/// gyroscope is the mean over the interval; the other two are taken **at its end**, so they see the
/// attitude `world_from_body[k + 1]`.
#[derive(Debug, Clone, PartialEq)]
pub struct AttitudeTrial {
    /// Length of each interval, s.
    pub dt_s: f64,
    /// Specific force at rest in the world frame, m/s^2: the reference of the accelerometer.
    pub specific_force_world: Vector3<f64>,
    /// Undisturbed field in the world frame, microtesla: the reference of the magnetometer.
    pub magnetic_field_world_ut: Vector3<f64>,
    /// True attitude at each of the `n + 1` instants; identity at the first and the last.
    pub world_from_body: Vec<UnitQuaternion<f64>>,
    /// True gyroscope bias at each of the `n + 1` instants, rad/s.
    pub gyroscope_bias: Vec<Vector3<f64>>,
    /// Mean rate of each interval, plus the bias at its start, plus noise, rad/s.
    pub gyroscope: Vec<Vector3<f64>>,
    /// Specific force at the end of each interval, m/s^2.
    pub accelerometer: Vec<Vector3<f64>>,
    /// Magnetic field at the end of each interval, microtesla.
    pub magnetometer: Vec<Vector3<f64>>,
}

impl AttitudeTrial {
    /// Makes the trial of this seed. The same seed and configuration always give the same trial,
    /// and each sensor's noise depends on nothing but the seed and its own standard deviation.
    #[must_use]
    pub fn simulate(seed: u64, config: &AttitudeTrialConfig) -> Self {
        let n = (config.duration_s * config.rate_hz).round().max(0.0) as usize;
        let dt_s = 1.0 / config.rate_hz;
        let world_from_body = attitudes(seed, config, n, dt_s);
        let gyroscope_bias = walking_bias(seed, config, n, dt_s);
        let field = default_magnetic_field_ut();

        let mut noise = stream(seed, "gyroscope");
        let gyroscope = (0..n)
            .map(|k| {
                mean_rate(&world_from_body[k], &world_from_body[k + 1], dt_s)
                    + gyroscope_bias[k]
                    + normal_vector(&mut noise, config.gyroscope_noise_std_rad_s)
            })
            .collect();

        let bursts = AccelerationBursts::random(seed, config.acceleration_burst_m_s2);
        let accelerometer = sample_at_ends(
            &world_from_body,
            dt_s,
            &mut stream(seed, "accelerometer"),
            config.accelerometer_noise_std_m_s2,
            |t| specific_force_at_rest() + bursts.at(t),
        );
        let magnetometer = sample_at_ends(
            &world_from_body,
            dt_s,
            &mut stream(seed, "magnetometer"),
            config.magnetometer_noise_std_ut,
            |t| field + magnetic_burst(t, config.magnetic_burst_ut),
        );
        Self {
            dt_s,
            specific_force_world: specific_force_at_rest(),
            magnetic_field_world_ut: field,
            world_from_body,
            gyroscope_bias,
            gyroscope,
            accelerometer,
            magnetometer,
        }
    }

    /// Number of samples (intervals).
    #[must_use]
    pub fn len(&self) -> usize {
        self.gyroscope.len()
    }

    /// Whether there are no samples.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.gyroscope.is_empty()
    }
}

/// The true attitude at instants `0..=n`.
fn attitudes(
    seed: u64,
    config: &AttitudeTrialConfig,
    n: usize,
    dt_s: f64,
) -> Vec<UnitQuaternion<f64>> {
    let motion = MultiSine::random(
        &mut stream(seed, "motion"),
        &MultiSineConfig {
            amplitude_rad: config.amplitude_rad,
            duration_s: n as f64 * dt_s,
            ..MultiSineConfig::default()
        },
    );
    (0..=n)
        .map(|k| motion.at(k as f64 * dt_s).world_from_body)
        .collect()
}

/// The true bias at instants `0..=n`: a draw, then a random walk.
fn walking_bias(seed: u64, config: &AttitudeTrialConfig, n: usize, dt_s: f64) -> Vec<Vector3<f64>> {
    let first = normal_vector(
        &mut stream(seed, "gyroscope/errors"),
        config.gyroscope_bias_std_rad_s,
    );
    let step_std = config.gyroscope_bias_random_walk_rad_s_sqrt_s * dt_s.sqrt();
    let mut steps = stream(seed, "gyroscope/bias");
    let walk = (0..n).scan(first, |bias, _| {
        *bias += normal_vector(&mut steps, step_std);
        Some(*bias)
    });
    std::iter::once(first).chain(walk).collect()
}

/// A world vector seen from the body at the end of each interval, with white noise.
fn sample_at_ends(
    world_from_body: &[UnitQuaternion<f64>],
    dt_s: f64,
    noise: &mut Stream,
    noise_std: f64,
    world_vector: impl Fn(f64) -> Vector3<f64>,
) -> Vec<Vector3<f64>> {
    let ends = world_from_body.iter().enumerate().skip(1);
    ends.map(|(k, attitude)| {
        attitude.inverse_transform_vector(&world_vector(k as f64 * dt_s))
            + normal_vector(noise, noise_std)
    })
    .collect()
}

/// Sines of 0.8 Hz with a phase per axis, switched on while `sin(2 pi t / 20 s) > 0.3`.
struct AccelerationBursts {
    amplitude_m_s2: f64,
    phases_rad: [f64; 3],
}

impl AccelerationBursts {
    fn random(seed: u64, amplitude_m_s2: f64) -> Self {
        let mut phases = stream(seed, "disturbance");
        Self {
            amplitude_m_s2,
            phases_rad: std::array::from_fn(|_| TAU * phases.random::<f64>()),
        }
    }

    fn at(&self, t_s: f64) -> Vector3<f64> {
        if sin_cos(TAU * t_s / 20.0).0 <= 0.3 {
            return Vector3::zeros();
        }
        let sine = |phase| self.amplitude_m_s2 * sin_cos(TAU * 0.8 * t_s + phase).0;
        Vector3::from(self.phases_rad.map(sine))
    }
}

/// A field towards the east during the last 6 s of every 20 s.
fn magnetic_burst(t_s: f64, strength_ut: f64) -> Vector3<f64> {
    let on = t_s.rem_euclid(20.0) > 14.0;
    Vector3::new(if on { strength_ut } else { 0.0 }, 0.0, 0.0)
}

#[cfg(test)]
#[path = "monte_carlo_tests.rs"]
mod tests;
