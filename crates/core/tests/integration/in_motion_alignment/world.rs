//! Simulated vehicles, inertial units and receivers for the tests of the in-motion alignment.

use core::f64::consts::PI;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use northing_core::geometry::{rotation, so3};
use northing_core::navigation::GnssPosition;
use rand::{RngExt as _, SeedableRng as _};
use rand_distr::StandardNormal;
use rand_pcg::Pcg64Mcg;

/// Interval of the inertial samples, s.
pub(crate) const DT: f64 = 0.01;
const GRAVITY: f64 = 9.806_65;

/// What moves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Vehicle {
    /// A smooth car that is already moving and turns with the road.
    Car,
    /// The same with the unit lying anyhow.
    Phone,
    /// The same on a straight road at constant speed.
    Straight,
    /// Flies in any direction, whatever its heading.
    Drone,
    /// Stands.
    Standing,
}

/// Standard deviations of a receiver: independent from fix to fix, correlated over a minute, stated (m); lever arm (m)
/// and clock offset (s) that nobody knows of.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Receiver {
    pub(crate) white: f64,
    pub(crate) slow: f64,
    pub(crate) stated: f64,
    pub(crate) arm: f64,
    pub(crate) clock: f64,
}

pub(crate) const RTK: Receiver = Receiver {
    white: 0.02,
    slow: 0.0,
    stated: 0.02,
    arm: 0.0,
    clock: 0.0,
};
pub(crate) const GPS: Receiver = Receiver {
    white: 0.8,
    slow: 1.2,
    stated: 1.5,
    arm: 0.0,
    clock: 0.0,
};

/// The motion and what is measured of it.
pub(crate) struct World {
    /// At multiples of [`DT`].
    pub(crate) position: Vec<Vector3<f64>>,
    pub(crate) velocity: Vec<Vector3<f64>>,
    pub(crate) ned_from_body: Vec<UnitQuaternion<f64>>,
    /// Angular rate and specific force between them.
    pub(crate) samples: Vec<[Vector3<f64>; 2]>,
    /// Index of the instant and what the receiver says of it.
    pub(crate) fixes: Vec<(usize, GnssPosition<f64>)>,
    /// How many samples later than its stamp the receiver is valid.
    pub(crate) late: isize,
}

struct Random(Pcg64Mcg);

impl Random {
    fn normal(&mut self) -> f64 {
        self.0.sample(StandardNormal)
    }

    fn vector(&mut self, std: f64) -> Vector3<f64> {
        Vector3::from_fn(|_, _| self.normal()) * std
    }

    fn uniform(&mut self, from: f64, to: f64) -> f64 {
        from + (to - from) * self.0.random::<f64>()
    }

    /// A first-order Gauss-Markov process, smoothed over `half_width` samples to either side.
    fn process(&mut self, n: usize, std: f64, time: f64, half_width: usize) -> Vec<f64> {
        let kept = (-DT / time).exp();
        let mut x = std * self.normal();
        let raw: Vec<f64> = (0..n + 2 * half_width)
            .map(|_| {
                let before = x;
                x = kept * x + std * (1.0 - kept * kept).sqrt() * self.normal();
                before
            })
            .collect();
        // Two running means are a triangle.
        let mean = |x: &[f64], width: usize| -> Vec<f64> {
            let sums: Vec<f64> = core::iter::once(0.0)
                .chain(x.iter().scan(0.0, |sum, x| {
                    *sum += x;
                    Some(*sum)
                }))
                .collect();
            (0..=x.len() - width)
                .map(|i| (sums[i + width] - sums[i]) / width as f64)
                .collect()
        };
        let width = half_width.max(1);
        let mut smooth = mean(&mean(&raw, width), width);
        smooth.truncate(n);
        smooth
    }
}

/// Trajectory of `n` instants: velocities and attitudes.
fn motion(
    vehicle: Vehicle,
    random: &mut Random,
    n: usize,
) -> (Vec<Vector3<f64>>, Vec<UnitQuaternion<f64>>) {
    let first = random.uniform(-PI, PI);
    match vehicle {
        Vehicle::Standing => {
            let attitude = rotation::from_yaw_pitch_roll([first, 0.02, -0.03]);
            (vec![Vector3::zeros(); n], vec![attitude; n])
        }
        Vehicle::Drone => {
            let acceleration = [1.5, 1.5, 0.3].map(|std| random.process(n, std, 2.0, 60));
            let turning = random.process(n, 0.2, 3.0, 100);
            let mut v = random
                .vector(3.0)
                .component_mul(&Vector3::new(1.0, 1.0, 0.1));
            let mut yaw = first;
            (0..n)
                .map(|k| {
                    let a = Vector3::from_fn(|i, _| acceleration[i][k]);
                    v += a * DT;
                    yaw += turning[k] * DT;
                    let down = (Vector3::z() * GRAVITY - a).normalize();
                    let ahead = Vector3::new(yaw.cos(), yaw.sin(), 0.0);
                    let ahead = (ahead - down * ahead.dot(&down)).normalize();
                    let axes = Matrix3::from_columns(&[ahead, down.cross(&ahead), down]);
                    (v, rotation::from_matrix(&axes))
                })
                .unzip()
        }
        Vehicle::Car | Vehicle::Phone | Vehicle::Straight => {
            let moves = if vehicle == Vehicle::Straight {
                0.0
            } else {
                1.0
            };
            let rate = random.process(n, 0.12 * moves, 4.0, 100);
            let cruise = random.uniform(7.0, 16.0);
            let speed: Vec<f64> = random.process(n, 2.0 * moves, 6.0, 150);
            let climb = random.process(n, 0.1, 3.0, 100);
            let nods = [0, 1].map(|_| random.process(n, 0.01, 1.0, 30));
            let mount = if vehicle == Vehicle::Phone {
                so3::exp(&random.vector(1.5))
            } else {
                UnitQuaternion::identity()
            };
            let mut yaw = first;
            (0..n)
                .map(|k| {
                    yaw += rate[k] * DT;
                    let v = (cruise + speed[k]).max(2.0);
                    let after = (cruise + speed[(k + 1).min(n - 1)]).max(2.0);
                    let pitch = 0.01 * (after - v) / DT + nods[0][k];
                    let roll = -0.01 * v * rate[k] + nods[1][k];
                    let attitude = rotation::from_yaw_pitch_roll([yaw, pitch, roll]);
                    (
                        Vector3::new(v * yaw.cos(), v * yaw.sin(), climb[k]),
                        attitude * mount,
                    )
                })
                .unzip()
        }
    }
}

/// A world of `duration` seconds with a consumer's inertial unit and a fix a second.
pub(crate) fn world(vehicle: Vehicle, receiver: &Receiver, seed: u64, duration: f64) -> World {
    world_with(1.0, vehicle, receiver, seed, duration)
}

/// The same with so much of the scale errors that no filter here has a state for.
pub(crate) fn world_with(
    unit_errors: f64,
    vehicle: Vehicle,
    receiver: &Receiver,
    seed: u64,
    duration: f64,
) -> World {
    let mut random = Random(Pcg64Mcg::seed_from_u64(
        seed.wrapping_mul(0x9e37_79b9_7f4a_7c15),
    ));
    let n = (duration / DT) as usize;
    let (velocity, ned_from_body) = motion(vehicle, &mut random, n);
    let mut position = vec![Vector3::zeros(); n];
    for k in 1..n {
        position[k] = position[k - 1] + (velocity[k - 1] + velocity[k]) * (0.5 * DT);
    }
    let scale = [3e-3, 1.5e-3].map(|std| random.vector(std * unit_errors).map(|x| 1.0 + x));
    let bias = [0.3_f64.to_radians(), 0.05].map(|std| random.vector(std));
    let samples = (1..n)
        .map(|k| {
            let turn = so3::log(&(ned_from_body[k - 1].inverse() * ned_from_body[k]));
            let middle = ned_from_body[k - 1] * so3::exp(&(turn * 0.5));
            let acceleration = (velocity[k] - velocity[k - 1]) / DT;
            let force = middle.inverse() * (acceleration - Vector3::z() * GRAVITY);
            let noise = [2e-4, 3e-3].map(|density| random.vector(density / DT.sqrt()));
            [
                (turn / DT).component_mul(&scale[0]) + bias[0] + noise[0],
                force.component_mul(&scale[1]) + bias[1] + noise[1],
            ]
        })
        .collect();
    let arm = random.vector(1.0).normalize() * receiver.arm;
    let late = (random.uniform(-1.0, 1.0) * receiver.clock / DT).round() as isize;
    let mut slow = random.vector(receiver.slow);
    let kept = (-1.0_f64 / 60.0).exp();
    let mut fixes = Vec::new();
    for k in (30..n - 100).step_by(100) {
        let there = k.saturating_add_signed(late);
        let stretch = Vector3::new(1.0, 1.0, 1.5);
        let noise = (random.vector(receiver.white) + slow).component_mul(&stretch);
        slow = slow * kept + random.vector(receiver.slow * (1.0 - kept * kept).sqrt());
        let ned = position[there] + ned_from_body[there] * arm + noise;
        let fix = GnssPosition {
            ned,
            std: stretch * receiver.stated,
            has_height: true,
        };
        fixes.push((k, fix));
    }
    World {
        position,
        velocity,
        ned_from_body,
        samples,
        fixes,
        late,
    }
}

impl World {
    /// The same world turned about the vertical by `yaw` (rad).
    pub(crate) fn turned(mut self, yaw: f64) -> Self {
        let turn = so3::exp(&(Vector3::z() * yaw));
        for v in self.position.iter_mut().chain(&mut self.velocity) {
            *v = turn * *v;
        }
        for q in &mut self.ned_from_body {
            *q = turn * *q;
        }
        for (_, fix) in &mut self.fixes {
            fix.ned = turn * fix.ned;
        }
        self
    }
}
