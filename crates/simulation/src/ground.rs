//! Trajectories of a person and a car, with a cheap inertial unit, a magnetometer and a receiver error model at 1 Hz: what GNSS/INS
//! is tried on.
//!
//! The motions are those of the specification that the axis filters and the error-state filter are compared by: 12 s at
//! rest, then 1.4 m/s on foot with a gait of 1.9 Hz, or 3 to 15 m/s on the road. Unlike the closed forms of
//! [`crate::trajectory`] they are sampled: the truth at 50 Hz, and between two instants the mean rate and the mean
//! acceleration that lead from one to the other, which is what a strapdown integration needs to be exact.
//!
//! Axes are those of navigation, not of the rest of this crate: north, east, down, and forward, right, down.

use nalgebra::{Rotation3, UnitQuaternion, Vector3};
use rand::RngExt as _;

use crate::random::{Stream, normal_vector, standard_normal, stream};
use crate::rotation::{log, sin_cos};

/// Samples a second.
pub const RATE_HZ: f64 = 50.0;
/// Truth is made in so many steps a sample.
const STEPS: usize = 4;
/// Gravity, m/s^2.
pub const GRAVITY_M_S2: f64 = 9.806_65;
/// Magnetic field: strength (microtesla) and dip.
const FIELD_UT: f64 = 48.0;
const DIP_DEG: f64 = 62.0;

/// Who moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ground {
    /// On foot.
    Walk,
    /// By car.
    Drive,
}

/// How a receiver errs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ReceiverError {
    /// Anew with every fix.
    White,
    /// Slowly: 60 s, with a small white part; the same variance in all.
    Correlated,
}

/// Standard deviations of the sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundSensors {
    /// Gyroscope noise of a sample, rad/s.
    pub gyroscope_std: f64,
    /// Accelerometer noise of a sample, m/s^2.
    pub accelerometer_std: f64,
    /// Magnetometer noise of a sample, microtesla.
    pub magnetometer_std: f64,
    /// Biases are drawn evenly up to these: rad/s and m/s^2.
    pub gyroscope_bias: f64,
    /// See `gyroscope_bias`.
    pub accelerometer_bias: f64,
    /// Random walk of the gyroscope bias, (rad/s)/sqrt(s).
    pub gyroscope_bias_random_walk: f64,
    /// Random walk of the accelerometer bias, (m/s^2)/sqrt(s).
    pub accelerometer_bias_random_walk: f64,
    /// Receiver: horizontal axes, vertical axis (m), velocity (m/s).
    pub position_std: [f64; 2],
    /// See `position_std`.
    pub velocity_std: f64,
    /// How the receiver errs.
    pub receiver: ReceiverError,
}

impl Default for GroundSensors {
    /// A Razor 9DOF (MPU-6050 class) and a receiver with 3 m of circular error probable.
    fn default() -> Self {
        let horizontal = 3.0 / 1.177_41;
        Self {
            gyroscope_std: 0.2_f64.to_radians(),
            accelerometer_std: 0.03,
            magnetometer_std: 0.7,
            gyroscope_bias: 1_f64.to_radians(),
            accelerometer_bias: 0.15,
            gyroscope_bias_random_walk: 2e-5,
            accelerometer_bias_random_walk: 0.0,
            position_std: [horizontal, 2.0 * horizontal],
            velocity_std: 0.1,
            receiver: ReceiverError::White,
        }
    }
}

/// The truth at one instant, and what the sensors said about the interval before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GroundSample {
    /// Time, s: the first is one interval.
    pub time_s: f64,
    /// Position, m, north, east, down.
    pub position: Vector3<f64>,
    /// Velocity, m/s.
    pub velocity: Vector3<f64>,
    /// Attitude.
    pub ned_from_body: UnitQuaternion<f64>,
    /// Measured mean rate of the interval, rad/s.
    pub angular_rate: Vector3<f64>,
    /// Measured mean specific force of the interval, m/s^2.
    pub specific_force: Vector3<f64>,
    /// Measured field, microtesla.
    pub magnetic_field: Vector3<f64>,
    /// Once a second: measured position and velocity.
    pub fix: Option<[Vector3<f64>; 2]>,
    /// The biases that rate and force have in them.
    pub biases: [Vector3<f64>; 2],
}

/// The motion at the fine steps.
struct Path {
    yaw: Vec<f64>,
    roll: Vec<f64>,
    pitch: Vec<f64>,
    position: Vec<Vector3<f64>>,
    velocity: Vec<Vector3<f64>>,
}

/// A wave of so many cycles a second, with a phase.
fn wave(amplitude: f64, hz: f64, phase: f64, t: f64) -> f64 {
    amplitude * sin_cos(core::f64::consts::TAU * hz * t + phase).0
}

/// The way of one run: `seconds` long, the same for the same seed.
#[must_use]
pub fn simulate(
    kind: Ground,
    sensors: &GroundSensors,
    seconds: f64,
    seed: u64,
) -> Vec<GroundSample> {
    let samples = (seconds * RATE_HZ).round().max(1.0) as usize;
    let path = path(kind, samples, &mut stream(seed, "motion"));
    measure(&path, sensors, samples, seed)
}

fn path(kind: Ground, samples: usize, random: &mut Stream) -> Path {
    let drives = kind == Ground::Drive;
    let mut phase = || random.random_range(0.0..6.0);
    let [p1, p2, p3, p4, p5, p6] = [phase(), phase(), phase(), phase(), phase(), phase()];
    let first_yaw = random.random_range(-core::f64::consts::PI..core::f64::consts::PI);
    let h = 1.0 / (RATE_HZ * STEPS as f64);
    let count = samples * STEPS + 1;
    let degree = 1_f64.to_radians();
    let gait_hz = 1.9;
    let mut speeds = Vec::with_capacity(count);
    let mut heights = Vec::with_capacity(count);
    let mut made = Path {
        yaw: Vec::with_capacity(count),
        roll: Vec::with_capacity(count),
        pitch: Vec::with_capacity(count),
        position: Vec::with_capacity(count),
        velocity: Vec::with_capacity(count),
    };
    let mut yaw = first_yaw;
    let mut rates = Vec::with_capacity(count);
    for k in 0..count {
        let t = k as f64 * h;
        let x = ((t - 12.0) / 4.0).clamp(0.0, 1.0);
        let ramp = x * x * (3.0 - 2.0 * x);
        let (speed, rate, height) = if drives {
            let speed = 9.0 + wave(3.5, 0.021, p1, t) + wave(2.5, 0.055, p2, t);
            let rate = wave(0.10, 0.017, p3, t) + wave(0.12, 0.045, p4, t);
            (
                speed.max(0.0) * ramp,
                rate * ramp,
                wave(4.0, 0.006, 0.0, t) * ramp,
            )
        } else {
            let rate = wave(0.12, 0.02, p3, t) + wave(0.15, 0.05, p4, t);
            let bounce = wave(0.013, gait_hz, 1.0, t) * ramp;
            (
                1.4 * ramp,
                rate * ramp,
                wave(2.0, 0.005, 0.0, t) * ramp + bounce,
            )
        };
        if k > 0 {
            yaw += rate * h;
        }
        speeds.push((speed, ramp));
        heights.push(height);
        rates.push(rate);
        made.yaw.push(yaw);
    }
    for k in 0..count {
        let t = k as f64 * h;
        let (speed, ramp) = speeds[k];
        let (before, after) = (k.saturating_sub(1), (k + 1).min(count - 1));
        let slope =
            |v: &dyn Fn(usize) -> f64| (v(after) - v(before)) / ((after - before) as f64 * h);
        let acceleration = slope(&|i| speeds[i].0);
        let sink = -slope(&|i| heights[i]);
        let (forward, sideways) = if drives {
            (speed, 0.0)
        } else {
            let surge = wave(0.12, gait_hz, 0.0, t) * ramp;
            (speed + surge, wave(0.08, 0.5 * gait_hz, 0.0, t) * ramp)
        };
        let (sin, cos) = sin_cos(made.yaw[k]);
        let level = Vector3::new(
            forward * cos - sideways * sin,
            forward * sin + sideways * cos,
            sink,
        );
        made.velocity.push(level);
        let last = made.position.last().copied().unwrap_or_else(Vector3::zeros);
        let moved = (made.velocity[before] + level) * (0.5 * h);
        made.position.push(if k == 0 { last } else { last + moved });
        let sway = wave(1.0 * degree, 0.13, p5, t) * ramp;
        let nod = wave(1.5 * degree, 0.09, p6, t) * ramp;
        let (roll, pitch) = if drives {
            (0.025 * speed * rates[k], -0.012 * acceleration)
        } else {
            let roll = wave(4.0 * degree, 0.5 * gait_hz, 0.0, t) * ramp;
            (roll, wave(3.0 * degree, gait_hz, 0.7, t) * ramp)
        };
        made.roll.push(3.0 * degree + roll + sway);
        made.pitch.push(-2.0 * degree + pitch + nod);
    }
    made
}

fn measure(path: &Path, sensors: &GroundSensors, samples: usize, seed: u64) -> Vec<GroundSample> {
    let dt = 1.0 / RATE_HZ;
    let stream_of = |name: &str| stream(seed, name);
    let mut gyroscope = stream_of("gyroscope");
    let mut accelerometer = stream_of("accelerometer");
    let mut magnetometer = stream_of("magnetometer");
    let mut walk = stream_of("gyroscope/bias");
    let mut force_walk = stream_of("accelerometer/bias");
    let mut errors = stream_of("errors");
    let mut even = |limit: f64| Vector3::from_fn(|_, _| errors.random_range(-1.0..1.0) * limit);
    let mut rate_bias = even(sensors.gyroscope_bias);
    let mut force_bias = even(sensors.accelerometer_bias);
    let (sin_dip, cos_dip) = sin_cos(DIP_DEG.to_radians());
    let field = Vector3::new(cos_dip, 0.0, sin_dip) * FIELD_UT;
    let mut receiver = Receiver::new(sensors, seed);
    let attitude = |k: usize| {
        let i = k * STEPS;
        UnitQuaternion::from_rotation_matrix(&Rotation3::from_euler_angles(
            path.roll[i],
            path.pitch[i],
            path.yaw[i],
        ))
    };
    let mut made = Vec::with_capacity(samples);
    let mut before = attitude(0);
    for k in 1..=samples {
        let after = attitude(k);
        let turn = log(&(before.inverse() * after));
        let (from, to) = ((k - 1) * STEPS, k * STEPS);
        let acceleration = (path.velocity[to] - path.velocity[from]) / dt;
        // The force in the axes of mid-interval, as a unit that integrates at a high rate gives it.
        let middle = before * crate::rotation::exp(&(turn * 0.5));
        let force = middle.inverse() * (acceleration - Vector3::z() * GRAVITY_M_S2);
        rate_bias += normal_vector(&mut walk, sensors.gyroscope_bias_random_walk * dt.sqrt());
        force_bias += normal_vector(
            &mut force_walk,
            sensors.accelerometer_bias_random_walk * dt.sqrt(),
        );
        let fix = (k % RATE_HZ as usize == RATE_HZ as usize - 1)
            .then(|| receiver.fix(&path.position[to], &path.velocity[to]));
        made.push(GroundSample {
            time_s: k as f64 * dt,
            position: path.position[to],
            velocity: path.velocity[to],
            ned_from_body: after,
            angular_rate: turn / dt
                + rate_bias
                + normal_vector(&mut gyroscope, sensors.gyroscope_std),
            specific_force: force
                + force_bias
                + normal_vector(&mut accelerometer, sensors.accelerometer_std),
            magnetic_field: after.inverse() * field
                + normal_vector(&mut magnetometer, sensors.magnetometer_std),
            fix,
            biases: [rate_bias, force_bias],
        });
        before = after;
    }
    made
}

/// A receiver and its slow error.
struct Receiver {
    random: Stream,
    slow: Vector3<f64>,
    std: Vector3<f64>,
    velocity_std: f64,
    error: ReceiverError,
}

impl Receiver {
    fn new(sensors: &GroundSensors, seed: u64) -> Self {
        let mut random = stream(seed, "receiver");
        let [horizontal, vertical] = sensors.position_std;
        let slow = normal_vector(&mut random, 1.0);
        Self {
            random,
            slow,
            std: Vector3::new(horizontal, horizontal, vertical),
            velocity_std: sensors.velocity_std,
            error: sensors.receiver,
        }
    }

    fn fix(&mut self, position: &Vector3<f64>, velocity: &Vector3<f64>) -> [Vector3<f64>; 2] {
        let kept = (-1.0_f64 / 60.0).exp();
        let fresh = |random: &mut Stream| Vector3::from_fn(|_, _| standard_normal(random));
        self.slow = self.slow * kept + fresh(&mut self.random) * (1.0 - kept * kept).sqrt();
        let white = fresh(&mut self.random);
        let unit = match self.error {
            ReceiverError::White => white,
            ReceiverError::Correlated => self.slow * 0.95 + white * (1.0_f64 - 0.95 * 0.95).sqrt(),
        };
        let velocity_noise = normal_vector(&mut self.random, self.velocity_std);
        [
            position + unit.component_mul(&self.std),
            velocity + velocity_noise,
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn perfect() -> GroundSensors {
        GroundSensors {
            gyroscope_std: 0.0,
            accelerometer_std: 0.0,
            magnetometer_std: 0.0,
            gyroscope_bias: 1e-300,
            accelerometer_bias: 1e-300,
            gyroscope_bias_random_walk: 0.0,
            accelerometer_bias_random_walk: 0.0,
            position_std: [0.0; 2],
            velocity_std: 0.0,
            receiver: ReceiverError::White,
        }
    }

    #[test]
    fn perfect_sensors_lead_from_one_instant_to_the_next() {
        for kind in [Ground::Walk, Ground::Drive] {
            let way = simulate(kind, &perfect(), 60.0, 7);
            let dt = 1.0 / RATE_HZ;
            let first = way[0];
            let (mut q, mut v, mut p) = (first.ned_from_body, first.velocity, first.position);
            for sample in &way[1..] {
                let middle = q * crate::rotation::exp(&(sample.angular_rate * (0.5 * dt)));
                let a = middle * sample.specific_force + Vector3::z() * GRAVITY_M_S2;
                p += v * dt + a * (0.5 * dt * dt);
                v += a * dt;
                q *= crate::rotation::exp(&(sample.angular_rate * dt));
                let fix = sample
                    .fix
                    .map_or(0.0, |[position, _]| (position - sample.position).norm());
                assert!(fix < 1e-12);
            }
            let last = way[way.len() - 1];
            assert!((v - last.velocity).norm() < 1e-9, "{kind:?}");
            assert!(
                (p - last.position).norm() < 0.05,
                "{kind:?} {}",
                (p - last.position).norm()
            );
            assert!(q.angle_to(&last.ned_from_body) < 1e-9);
            assert!(
                way.iter()
                    .filter(|s| s.time_s < 12.0)
                    .all(|s| s.velocity.norm() < 1e-9)
            );
        }
    }

    #[test]
    fn a_seed_is_a_way_and_noises_have_their_size() {
        let sensors = GroundSensors::default();
        let way = simulate(Ground::Drive, &sensors, 200.0, 3);
        assert_eq!(way, simulate(Ground::Drive, &sensors, 200.0, 3));
        assert_ne!(way, simulate(Ground::Drive, &sensors, 200.0, 4));
        let fixes: Vec<_> = way
            .iter()
            .filter_map(|s| s.fix.map(|f| f[0] - s.position))
            .collect();
        assert_eq!(fixes.len(), 200);
        let rms = |i: usize| (fixes.iter().map(|e| e[i] * e[i]).sum::<f64>() / 200.0).sqrt();
        assert!((rms(0) / 2.55 - 1.0).abs() < 0.2 && (rms(2) / 5.1 - 1.0).abs() < 0.2);
        let slow = GroundSensors {
            receiver: ReceiverError::Correlated,
            ..sensors
        };
        let way = simulate(Ground::Walk, &slow, 200.0, 3);
        let errors: Vec<_> = way
            .iter()
            .filter_map(|s| s.fix.map(|f| f[0].x - s.position.x))
            .collect();
        let steps: f64 = errors
            .windows(2)
            .map(|w| (w[1] - w[0]).powi(2))
            .sum::<f64>()
            / 199.0;
        assert!(
            steps.sqrt() < 0.6 * 2.55,
            "neighbours are alike: {}",
            steps.sqrt()
        );
    }
}
