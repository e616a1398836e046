//! One run of a scenario: truth and measurements, in the order in which they happen.
//!
//! Everything drawn comes from streams named for the sensor, under a seed made of the campaign's
//! seed and the run's number ([`run_seed`](crate::random::run_seed)): a run is the same whoever asks
//! for it, alone or among thousands.

use nalgebra::{UnitQuaternion, Vector3, Vector4};
use rand::RngExt as _;

use super::schema::FaultySensor;
use super::world::TrackingWorld;
use crate::faults::FaultInjector;
use crate::random::{Stream, normal_vector, standard_normal, stream};
use crate::rotation::exp;
use crate::sensors::{ErrorModel, SensorErrors};

/// What the navigation believes at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NavigationStart {
    /// Attitude, `ned_from_body`.
    pub ned_from_body: UnitQuaternion<f64>,
    /// Velocity, m/s, NED.
    pub velocity: Vector3<f64>,
    /// Position, m, NED.
    pub position: Vector3<f64>,
}

/// A fix of the GPS compass.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Fix {
    /// Position, m, NED.
    pub position: Vector3<f64>,
    /// Attitude, `ned_from_body`.
    pub ned_from_body: UnitQuaternion<f64>,
}

/// A run in progress: call [`Self::next_sample`] until it gives `None`, then [`Self::fix`]; after
/// [`TrackingWorld::fixes_per_scan`] of those, [`Self::next_scan`].
#[derive(Debug, Clone)]
pub struct TrackingRun<'a> {
    world: &'a TrackingWorld,
    gyroscope: SensorErrors,
    accelerometer: SensorErrors,
    fixes: Stream,
    lost_fixes: Stream,
    radar: Stream,
    misses: Stream,
    target_noise: Stream,
    target: Vector4<f64>,
    start: NavigationStart,
    prior: Vector4<f64>,
    sample: usize,
    until: usize,
    faults: Faults,
}

#[derive(Debug, Clone)]
struct Faults {
    gyroscope: FaultInjector<3>,
    accelerometer: FaultInjector<3>,
    position: FaultInjector<3>,
    compass: FaultInjector<3>,
    radar: FaultInjector<2>,
}

impl<'a> TrackingRun<'a> {
    pub(super) fn new(world: &'a TrackingWorld, seed: u64) -> Self {
        let rate_hz = world.scenario().imu.rate_hz;
        let sensor = |name: &str, model: &ErrorModel| SensorErrors::new(seed, name, model, rate_hz);
        let [north, east] = world.scenario().target.position_m;
        let [v_north, v_east] = world.scenario().target.velocity_m_s;
        let mut prior = stream(seed, "track/start");
        Self {
            gyroscope: sensor("gyroscope", &world.gyroscope_errors()),
            accelerometer: sensor("accelerometer", &world.accelerometer_errors()),
            fixes: stream(seed, "gps-compass"),
            lost_fixes: stream(seed, "gps-compass/dropouts"),
            radar: stream(seed, "radar"),
            misses: stream(seed, "radar/detections"),
            target_noise: stream(seed, "target"),
            target: Vector4::new(north, v_north, east, v_east),
            start: start(world, seed),
            prior: Vector4::from_fn(|_, _| standard_normal(&mut prior)),
            sample: 0,
            until: world.samples_per_fix(),
            faults: Faults {
                gyroscope: world.faults(FaultySensor::Gyroscope),
                accelerometer: world.faults(FaultySensor::Accelerometer),
                position: world.faults(FaultySensor::GpsPosition),
                compass: world.faults(FaultySensor::GpsCompass),
                radar: world.faults(FaultySensor::Radar),
            },
            world,
        }
    }

    /// What the navigation starts from.
    #[must_use]
    pub fn navigation_start(&self) -> NavigationStart {
        self.start
    }

    /// Four standard normal numbers: the error of a track that starts from a prior.
    #[must_use]
    pub fn prior_draw(&self) -> Vector4<f64> {
        self.prior
    }

    /// The target: `[north, v_north, east, v_east]`.
    #[must_use]
    pub fn target(&self) -> Vector4<f64> {
        self.target
    }

    /// The next inertial sample, angular rate (rad/s) and specific force (m/s^2); `None` when a fix
    /// is due. A sample that a fault swallows comes as not a number.
    pub fn next_sample(&mut self) -> Option<[Vector3<f64>; 2]> {
        if self.sample == self.until {
            return None;
        }
        let [ideal_rate, ideal_force] = self.world.ideal_sample(self.sample)?;
        self.sample += 1;
        let t_s = self.sample as f64 * self.world.sample_s();
        let rate = self.gyroscope.measure(&ideal_rate);
        let force = self.accelerometer.measure(&ideal_force);
        if self.world.scenario().faults.is_empty() {
            return Some([rate, force]);
        }
        let faulty = |faults: &mut FaultInjector<3>, measured: Vector3<f64>| {
            let sample = faults.apply(t_s, measured.into());
            Vector3::from(sample.unwrap_or([f64::NAN; 3]))
        };
        let rate = faulty(&mut self.faults.gyroscope, rate);
        Some([rate, faulty(&mut self.faults.accelerometer, force)])
    }

    /// The fix that is due; `None` when it does not come.
    pub fn fix(&mut self) -> Option<Fix> {
        self.until += self.world.samples_per_fix();
        let noises = self.world.noises();
        let off = normal_vector(&mut self.fixes, 1.0).component_mul(&noises.position_std);
        let turned = normal_vector(&mut self.fixes, 1.0).component_mul(&noises.attitude_std);
        let lost = self.lost_fixes.random::<f64>();
        let truth = self
            .world
            .shown_by_fix(self.sample / self.world.samples_per_fix())?;
        let t_s = self.sample as f64 * self.world.sample_s();
        if lost < self.world.scenario().gps_compass.dropout_probability {
            return None;
        }
        let position = truth.position + off;
        let position = self.faults.position.apply(t_s, position.into())?;
        let turned = self.faults.compass.apply(t_s, turned.into())?;
        Some(Fix {
            position: position.into(),
            ned_from_body: exp(&Vector3::from(turned)) * truth.ned_from_body,
        })
    }

    /// Moves the target on by one scan.
    pub fn next_scan(&mut self) {
        let dt = self.world.scan_s();
        let target = &self.world.scenario().target;
        let std = if target.truth_process_noise {
            target.sigma_accel_m_s2
        } else {
            0.0
        };
        for axis in [0, 2] {
            let acceleration = std * standard_normal(&mut self.target_noise);
            let velocity = self.target[axis + 1];
            self.target[axis] += dt * velocity + 0.5 * dt * dt * acceleration;
            self.target[axis + 1] += dt * acceleration;
        }
    }

    /// Range (m) and bearing (rad) of the target now; `None` when the radar does not see it. The
    /// first detection, which starts the tracks, is never missed.
    pub fn detection(&mut self) -> Option<[f64; 2]> {
        let at = self.sample / self.world.samples_per_fix();
        let own = self.world.own_at_fix(at)?;
        let (north, east) = (
            self.target[0] - own.position.x,
            self.target[2] - own.position.y,
        );
        let std = &self.world.noises().radar_std;
        let range = north.hypot(east) + std.x * standard_normal(&mut self.radar);
        let exact = nalgebra::RealField::atan2(east, north) - own.heading_rad;
        let bearing = exact + std.y * standard_normal(&mut self.radar);
        let seen = self.misses.random::<f64>() < self.world.scenario().radar.detection_probability;
        if !seen && self.sample > 0 {
            return None;
        }
        let t_s = self.sample as f64 * self.world.sample_s();
        let wrapped = bearing - (bearing / std::f64::consts::TAU).round() * std::f64::consts::TAU;
        self.faults.radar.apply(t_s, [range, wrapped])
    }
}

/// The error that position, velocity and attitude start with: one fix, and a guess at the velocity.
fn start(world: &TrackingWorld, seed: u64) -> NavigationStart {
    let mut draws = stream(seed, "navigation/start");
    let noises = world.noises();
    let turned = normal_vector(&mut draws, 1.0).component_mul(&noises.attitude_std);
    let faster = normal_vector(&mut draws, noises.velocity_std);
    let off = normal_vector(&mut draws, 1.0).component_mul(&noises.position_std);
    let truth = world.own_at_scan(0);
    // true = estimate + error, C_true = Exp(error) C
    NavigationStart {
        ned_from_body: exp(&-turned) * truth.ned_from_body,
        velocity: truth.velocity - faster,
        position: truth.position - off,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::faults::FaultKind;
    use crate::rotation::log;
    use crate::scenario::Scenario;
    use crate::scenario::ScenarioFile;
    use crate::scenario::schema::FaultTable;

    fn scenario() -> Scenario {
        let text = include_str!("../../../../scenarios/tracking/wilthil_brekke.toml");
        let mut scenario = ScenarioFile::parse("s", text)
            .unwrap()
            .scenario(None)
            .unwrap();
        scenario.meta.duration_s = 20.0;
        scenario.ownship.turn_start_s = 5.0;
        scenario
    }

    /// All that a run gives, in a row.
    fn record(world: &TrackingWorld, seed: u64, run: u64) -> Vec<f64> {
        let mut run = world.run(seed, run);
        let mut out: Vec<f64> = run.navigation_start().position.iter().copied().collect();
        for _ in 0..world.scans() {
            for _ in 0..world.fixes_per_scan() {
                while let Some([rate, force]) = run.next_sample() {
                    out.extend(rate.iter().chain(force.iter()));
                }
                out.extend(
                    run.fix()
                        .map_or(vec![], |f| f.position.iter().copied().collect()),
                );
            }
            run.next_scan();
            out.extend(run.target().iter());
            out.extend(run.detection().into_iter().flatten());
        }
        out
    }

    #[test]
    fn a_run_is_determined_by_file_seed_and_number() {
        let world = TrackingWorld::new(&scenario());
        assert_eq!(record(&world, 1, 7), record(&world, 1, 7));
        assert_ne!(record(&world, 1, 7), record(&world, 1, 8));
        assert_ne!(record(&world, 1, 7), record(&world, 2, 7));
    }

    #[test]
    fn perfect_inertial_samples_integrate_to_the_truth() {
        let mut scenario = scenario();
        scenario.ownship.roll_amplitude_deg = 5.0;
        let world = TrackingWorld::new(&scenario);
        let dt = world.sample_s();
        let own = world.own_at_scan(0);
        let (mut q, mut v, mut p) = (own.ned_from_body, own.velocity, own.position);
        for [mean_rate, mean_force] in (0..).map_while(|k| world.ideal_sample(k)) {
            let middle = q * exp(&(mean_rate * (0.5 * dt)));
            let step = (middle * mean_force + Vector3::new(0.0, 0.0, 9.81)) * dt;
            p += (v + step * 0.5) * dt;
            v += step;
            q *= exp(&(mean_rate * dt));
        }
        let end = world.own_at_scan(world.scans());
        assert!((end.position - p).norm() < 1e-3, "{}", end.position - p);
        assert!((end.velocity - v).norm() < 1e-9);
        assert!(log(&(end.ned_from_body * q.inverse())).norm() < 1e-9);
    }

    #[test]
    fn a_fault_of_one_sensor_leaves_the_others_as_they_were() {
        let clean = scenario();
        let mut faulty = clean.clone();
        faulty.faults.push(FaultTable {
            sensor: FaultySensor::Radar,
            from_s: 5.0,
            until_s: 7.0,
            what: FaultKind::Offset {
                value: vec![1000.0],
            },
        });
        let clean = record(&TrackingWorld::new(&clean), 3, 0);
        let faulty = record(&TrackingWorld::new(&faulty), 3, 0);
        let differing = clean
            .iter()
            .zip(&faulty)
            .filter(|(a, b)| a.to_bits() != b.to_bits());
        let off: Vec<f64> = differing.map(|(a, b)| b - a).collect();
        assert_eq!(off.len(), 2, "{off:?}");
        assert!(off.iter().all(|off| (off - 1000.0).abs() < 1e-9));
    }

    /// Of fixes without noise: how many came, and by how much the ship was further on.
    fn fixes(scenario: &Scenario) -> (usize, f64) {
        let world = TrackingWorld::new(scenario);
        let mut run = world.run(1, 0);
        let (mut came, mut behind) = (0, 0.0);
        for fix in 1..=world.scans() * world.fixes_per_scan() {
            while run.next_sample().is_some() {}
            let Some(shown) = run.fix() else { continue };
            came += 1;
            behind = (world.own_at_fix(fix).unwrap().position - shown.position).norm();
        }
        (came, behind)
    }

    #[test]
    fn a_fix_can_be_late_and_can_be_lost() {
        let mut scenario = scenario();
        scenario.ownship.turn_rate_deg_s = 0.0;
        scenario.navigation.noise_factor = 1e-9;
        let (all, behind) = fixes(&scenario);
        assert!(all == 100 && behind < 1e-6, "{all}, {behind} m");
        scenario.gps_compass.latency_s = 0.4;
        scenario.gps_compass.dropout_probability = 0.2;
        let (came, behind) = fixes(&scenario);
        assert!((60..=95).contains(&came), "{came}");
        assert!((behind - 4.0).abs() < 1e-6, "10 m/s for 0.4 s: {behind} m");
    }

    #[test]
    fn the_inertial_unit_has_the_errors_that_the_file_says() {
        let mut scenario = scenario();
        scenario.navigation.noise_factor = 1e-9;
        scenario.imu.gyro_resolution_deg_s = 0.5;
        scenario.imu.accel_range_m_s2 = 5.0;
        let world = TrackingWorld::new(&scenario);
        let mut run = world.run(1, 0);
        let [rate, force] = run.next_sample().unwrap();
        let steps = rate.map(|x| x.to_degrees() / 0.5);
        assert!(
            steps.iter().all(|x| (x - x.round()).abs() < 1e-9),
            "{steps}"
        );
        assert!((force.z + 5.0).abs() < 1e-12, "{force}");
    }
}
