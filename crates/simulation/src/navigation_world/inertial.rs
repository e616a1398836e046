//! Inertial units of the worlds, from tactical to phone grade: noise, bias and its random walk, bias jumps, vibration that is
//! sampled too slowly, saturation, jitter of the stamps.

use nalgebra::{UnitQuaternion, Vector3};
use serde::Serialize;

use super::WorldClass;
use super::motion::{Path, STEPS};
use crate::ground::GRAVITY_M_S2;
use crate::rotation::{log, sin_cos};
use crate::signals::{Draws, exponential, logarithm};

/// Mean radius of the Earth, m.
const EARTH_RADIUS_M: f64 = 6_371_000.0;

/// A bias that jumps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BiasJump {
    /// When, s.
    pub time_s: f64,
    /// By how much, rad/s.
    pub gyroscope_rad_s: [f64; 3],
    /// By how much, m/s^2.
    pub accelerometer_m_s2: [f64; 3],
}

/// What an inertial unit has, and how it errs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InertialUnit {
    /// Samples a second.
    pub rate_hz: f64,
    /// White noise, (rad/s)/sqrt(Hz).
    pub gyroscope_noise_density: f64,
    /// White noise, (m/s^2)/sqrt(Hz).
    pub accelerometer_noise_density: f64,
    /// Bias at the first sample, rad/s.
    pub gyroscope_bias_rad_s: [f64; 3],
    /// Bias at the first sample, m/s^2.
    pub accelerometer_bias_m_s2: [f64; 3],
    /// (rad/s)/sqrt(s).
    pub gyroscope_bias_random_walk: f64,
    /// (m/s^2)/sqrt(s).
    pub accelerometer_bias_random_walk: f64,
    /// Vibration at its strongest, standard deviation an axis as it is sampled, m/s^2.
    pub vibration_m_s2: f64,
    /// The same of the angular rate, rad/s.
    pub vibration_rad_s: f64,
    /// Middle of its band, Hz.
    pub vibration_hz: f64,
    /// How long it stays in phase, s.
    pub vibration_coherence_s: f64,
    /// Standard deviation of stamps, s.
    pub stamp_jitter_s: f64,
    /// Largest angular rate (rad/s) and specific force (m/s^2) an axis that it can measure, where the motion exceeds them.
    pub saturation: Option<[f64; 2]>,
    /// Jumps of the biases.
    pub bias_jumps: Vec<BiasJump>,
    /// From the vehicle's axes (forward, right, down) to the unit's: w, x, y, z.
    pub unit_from_vehicle: [f64; 4],
    /// Whether it lies anyhow, instead of roughly along the vehicle's axes.
    pub any_mount: bool,
}

/// One inertial sample and the truth at its instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WorldSample {
    /// When it was taken, s.
    pub time_s: f64,
    /// Its stamp, ns.
    pub stamp_ns: i64,
    /// Measured angular rate, mean of the interval around the stamp, rad/s, unit's axes.
    pub angular_rate: Vector3<f64>,
    /// Measured specific force, the same, m/s^2.
    pub specific_force: Vector3<f64>,
    /// True position of the unit, m, NED.
    pub position: Vector3<f64>,
    /// True velocity of the unit, m/s.
    pub velocity: Vector3<f64>,
    /// True attitude of the unit.
    pub ned_from_unit: UnitQuaternion<f64>,
    /// True position of the antenna, m, NED.
    pub antenna: Vector3<f64>,
}

impl InertialUnit {
    /// A unit for a world of this class.
    pub(super) fn draw(class: WorldClass, seconds: f64, draws: &mut Draws) -> Self {
        // 0 is tactical, 1 a phone.
        let grade = match class {
            WorldClass::CarPhone | WorldClass::Pedestrian => draws.uniform(0.6, 1.0),
            _ => draws.uniform(0.0, 1.0),
        };
        let mut graded = |best: f64, worst: f64| {
            let scatter = exponential(0.4 * draws.normal());
            best * exponential(grade * logarithm(worst / best)) * scatter
        };
        let gyroscope_noise_density = graded(3e-5, 3e-4);
        let accelerometer_noise_density = graded(3e-4, 4e-3);
        let (rate_bias, force_bias) = (graded(5e-5, 6e-3), graded(3e-3, 0.08));
        let gyroscope_bias_random_walk = graded(1e-6, 3e-5);
        let accelerometer_bias_random_walk = graded(2e-5, 1e-3);
        let strength = match class {
            WorldClass::CarSmooth | WorldClass::CarParking => [0.03, 0.3],
            WorldClass::CarRough => [0.8, 4.0],
            WorldClass::CarPhone => [0.1, 1.0],
            WorldClass::Bicycle => [0.3, 3.0],
            WorldClass::DroneSideways | WorldClass::DroneHovering => [0.3, 5.0],
            WorldClass::Ship => [0.01, 0.3],
            WorldClass::Pedestrian => [0.1, 1.5],
        };
        let vibration_m_s2 = draws.log_uniform(strength[0], strength[1]);
        let jumps = if draws.chance(0.1) {
            1 + usize::from(draws.chance(0.3))
        } else {
            0
        };
        let jump = |draws: &mut Draws| BiasJump {
            time_s: draws.uniform(20.0, seconds - 20.0),
            gyroscope_rad_s: (draws.direction() * draws.log_uniform(5e-4, 0.01)).into(),
            accelerometer_m_s2: (draws.direction() * draws.log_uniform(0.01, 0.2)).into(),
        };
        let always_any = matches!(
            class,
            WorldClass::DroneSideways
                | WorldClass::DroneHovering
                | WorldClass::CarPhone
                | WorldClass::Pedestrian
        );
        let any_mount = always_any || draws.chance(0.3);
        let mount = if any_mount {
            draws.rotation()
        } else {
            draws.small_rotation(0.05)
        };
        Self {
            rate_hz: draws.one_of(&[50.0, 100.0, 100.0, 125.0, 200.0]),
            gyroscope_noise_density,
            accelerometer_noise_density,
            gyroscope_bias_rad_s: (draws.normals() * rate_bias).into(),
            accelerometer_bias_m_s2: (draws.normals() * force_bias).into(),
            gyroscope_bias_random_walk,
            accelerometer_bias_random_walk,
            vibration_m_s2,
            vibration_rad_s: vibration_m_s2 * draws.log_uniform(0.005, 0.1),
            vibration_hz: draws.log_uniform(12.0, 80.0),
            vibration_coherence_s: draws.log_uniform(0.05, 1.0),
            stamp_jitter_s: draws.log_uniform(1e-6, 3e-4),
            saturation: draws
                .chance(0.04)
                .then(|| [draws.uniform(0.6, 1.0), draws.uniform(0.75, 1.0)]),
            bias_jumps: (0..jumps).map(|_| jump(draws)).collect(),
            unit_from_vehicle: [mount.w, mount.i, mount.j, mount.k],
            any_mount,
        }
    }

    /// The unit's axes in the vehicle's.
    fn vehicle_from_unit(&self) -> UnitQuaternion<f64> {
        let [w, x, y, z] = self.unit_from_vehicle;
        UnitQuaternion::new_normalize(nalgebra::Quaternion::new(w, x, y, z)).inverse()
    }

    /// Truth at the samples, with the mean rate and the mean specific force between the instants half an interval before
    /// and after each. A unit that saturates gets its limits, as parts of the largest that it meets.
    pub(super) fn truth(&mut self, path: &Path, lever_arm: &Vector3<f64>) -> Vec<WorldSample> {
        let mount = self.vehicle_from_unit();
        let attitude = |i: usize| path.ned_from_vehicle[i] * mount;
        let last = path.position.len() - 1;
        let half = STEPS / 2;
        let sample = |i: usize| {
            let (before, after) = (attitude(i - half), attitude(i + half));
            let interval = STEPS as f64 * path.step_s;
            let turn = log(&(before.inverse() * after));
            let middle = before * crate::rotation::exp(&(turn * 0.5));
            let acceleration = (path.velocity[i + half] - path.velocity[i - half]) / interval;
            WorldSample {
                time_s: i as f64 * path.step_s,
                stamp_ns: 0,
                angular_rate: turn / interval,
                specific_force: middle.inverse() * (acceleration - gravity(&path.position[i])),
                position: path.position[i],
                velocity: path.velocity[i],
                ned_from_unit: attitude(i),
                antenna: path.position[i] + attitude(i) * lever_arm,
            }
        };
        let instants = (STEPS..=last - half).step_by(STEPS);
        let samples: Vec<_> = instants.map(sample).collect();
        if let Some([rate, force]) = &mut self.saturation {
            let largest = |of: fn(&WorldSample) -> f64| samples.iter().map(of).fold(0.0, f64::max);
            *rate *= largest(|s| s.angular_rate.amax());
            *force *= largest(|s| s.specific_force.amax());
        }
        samples
    }

    /// Lays the unit's errors over the truth, and stamps the samples.
    pub(super) fn measure(&self, samples: &mut [WorldSample], path: &Path, seed: u64) {
        let dt = 1.0 / self.rate_hz;
        let stream = |name: &str| Draws::new(seed, name);
        let (mut gyroscope, mut accelerometer) = (stream("gyroscope"), stream("accelerometer"));
        let (mut walk, mut timing) = (stream("imu/bias"), stream("imu/timing"));
        let mut vibration = Vibration::new(self, stream("imu/vibration"));
        let mut rate_bias = Vector3::from(self.gyroscope_bias_rad_s);
        let mut force_bias = Vector3::from(self.accelerometer_bias_m_s2);
        let root = dt.sqrt();
        for (k, sample) in samples.iter_mut().enumerate() {
            rate_bias += walk.normals() * (self.gyroscope_bias_random_walk * root);
            force_bias += walk.normals() * (self.accelerometer_bias_random_walk * root);
            let mut jumped = [Vector3::zeros(); 2];
            for jump in self
                .bias_jumps
                .iter()
                .filter(|jump| jump.time_s <= sample.time_s)
            {
                jumped[0] += Vector3::from(jump.gyroscope_rad_s);
                jumped[1] += Vector3::from(jump.accelerometer_m_s2);
            }
            let [rate, force] = vibration.next(path.shake[(k + 1) * STEPS]);
            let white = gyroscope.normals() * (self.gyroscope_noise_density / root);
            sample.angular_rate += rate_bias + jumped[0] + rate + white;
            let white = accelerometer.normals() * (self.accelerometer_noise_density / root);
            sample.specific_force += force_bias + jumped[1] + force + white;
            if let Some([rate, force]) = self.saturation {
                sample.angular_rate.apply(|v| *v = v.clamp(-rate, rate));
                sample.specific_force.apply(|v| *v = v.clamp(-force, force));
            }
            // Stamps stay in order, whatever is drawn.
            let jitter = (timing.normal() * self.stamp_jitter_s).clamp(-0.3 * dt, 0.3 * dt);
            sample.stamp_ns = ((sample.time_s + jitter) * 1e9).round() as i64;
        }
    }
}

/// Gravity at a position: it turns and falls with the distance from the origin, as it does on a round Earth.
fn gravity(position: &Vector3<f64>) -> Vector3<f64> {
    let turned = Vector3::new(-position.x, -position.y, 2.0 * position.z) / EARTH_RADIUS_M;
    (Vector3::z() + turned) * GRAVITY_M_S2
}

/// Noise in a band: a damped oscillation that is kicked all the time, an axis each, read at the unit's instants.
struct Vibration {
    draws: Draws,
    /// In phase and in quadrature; three axes of rate, three of force.
    state: [[f64; 2]; 6],
    /// The turn of one sample, and what is left after it.
    turn: [f64; 2],
    kept: f64,
    strength: [f64; 2],
}

impl Vibration {
    fn new(unit: &InertialUnit, mut draws: Draws) -> Self {
        let (sin, cos) = sin_cos(core::f64::consts::TAU * unit.vibration_hz / unit.rate_hz);
        // The low-pass that such units have, of the second order at 0.4 of the rate.
        let above = unit.vibration_hz / (0.4 * unit.rate_hz);
        let passed = 1.0 / (1.0 + above * above * above * above).sqrt();
        Self {
            state: core::array::from_fn(|_| [draws.normal(), draws.normal()]),
            draws,
            turn: [sin, cos],
            kept: exponential(-1.0 / (unit.rate_hz * unit.vibration_coherence_s)),
            strength: [unit.vibration_rad_s, unit.vibration_m_s2].map(|s| s * passed),
        }
    }

    /// Rate and force of the next sample.
    fn next(&mut self, shake: f64) -> [Vector3<f64>; 2] {
        let [sin, cos] = self.turn;
        let fresh = (1.0 - self.kept * self.kept).sqrt();
        for [x, y] in &mut self.state {
            let turned = [*x * cos - *y * sin, *x * sin + *y * cos];
            *x = turned[0] * self.kept + fresh * self.draws.normal();
            *y = turned[1] * self.kept + fresh * self.draws.normal();
        }
        let axes = |from: usize| Vector3::from_fn(|i, _| self.state[from + i][0]);
        [
            axes(0) * (self.strength[0] * shake),
            axes(3) * (self.strength[1] * shake),
        ]
    }
}
