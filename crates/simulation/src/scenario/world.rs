//! What all runs of a scenario share: the own ship's motion, worked out once, and the noises.

use nalgebra::{UnitQuaternion, Vector2, Vector3};

use super::run::TrackingRun;
use super::schema::{FaultySensor, Scenario};
use crate::faults::{Fault, FaultInjector};
use crate::random::run_seed;
use crate::rotation::exp;
use crate::sensors::ErrorModel;
use crate::trajectory::vessel::{Manoeuvre, Swing, Vessel};
use crate::trajectory::{Trajectory as _, mean_rate};

/// Sub-steps over which ideal inertial sensors average, as parts with integration do.
#[derive(Debug, Clone, Copy)]
struct Interval {
    mean_rate: Vector3<f64>,
    mean_force: Vector3<f64>,
}

/// The own ship at one fix.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OwnTruth {
    /// Attitude, `ned_from_body`.
    pub ned_from_body: UnitQuaternion<f64>,
    /// Velocity, m/s, NED.
    pub velocity: Vector3<f64>,
    /// Position, m, NED.
    pub position: Vector3<f64>,
    /// Heading, rad, clockwise from north, not wrapped.
    pub heading_rad: f64,
}

/// Standard deviations that follow from a scenario.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noises {
    /// Accelerometer, each sample, m/s^2.
    pub accelerometer_std: f64,
    /// Gyroscope, each sample, rad/s.
    pub gyroscope_std: f64,
    /// What the navigation filter takes as the accelerometer's density, (m/s^2)/sqrt(Hz).
    pub filter_accelerometer_density: f64,
    /// What the navigation filter takes as the gyroscope's density, (rad/s)/sqrt(Hz).
    pub filter_gyroscope_density: f64,
    /// Position of a fix, m, NED.
    pub position_std: Vector3<f64>,
    /// Attitude of a fix, rad, about the NED axes.
    pub attitude_std: Vector3<f64>,
    /// Velocity at the start, m/s.
    pub velocity_std: f64,
    /// Accelerometer bias, m/s^2.
    pub accelerometer_bias_std: f64,
    /// Gyroscope bias, rad/s.
    pub gyroscope_bias_std: f64,
    /// Range, m, and bearing, rad, of the radar.
    pub radar_std: Vector2<f64>,
}

impl Noises {
    fn of(scenario: &Scenario) -> Self {
        let (imu, gps) = (&scenario.imu, &scenario.gps_compass);
        let factor = scenario.navigation.noise_factor;
        let dt = 1.0 / imu.rate_hz;
        let accelerometer = factor * imu.sigma_accel_m_s2;
        let gyroscope = factor * imu.sigma_gyro_deg_s.to_radians();
        let (real, assumed) = (imu.noise_reading, imu.filter_noise_reading);
        let level = gps.roll_pitch_std_deg.to_radians();
        Self {
            accelerometer_std: real.sample_std(accelerometer, dt),
            gyroscope_std: real.sample_std(gyroscope, dt),
            filter_accelerometer_density: assumed.sample_std(accelerometer, dt) * dt.sqrt(),
            filter_gyroscope_density: assumed.sample_std(gyroscope, dt) * dt.sqrt(),
            position_std: Vector3::from(gps.position_std_m) * factor,
            attitude_std: Vector3::new(level, level, gps.heading_std_deg.to_radians()) * factor,
            velocity_std: scenario.navigation.initial_velocity_std_m_s,
            accelerometer_bias_std: imu.accel_bias_std_m_s2,
            gyroscope_bias_std: imu.gyro_bias_std_deg_s.to_radians(),
            radar_std: Vector2::new(
                scenario.radar.sigma_range_m,
                scenario.radar.sigma_bearing_deg.to_radians(),
            ),
        }
    }
}

/// What all runs of a scenario share.
#[derive(Debug, Clone)]
pub struct TrackingWorld {
    scenario: Scenario,
    noises: Noises,
    intervals: Vec<Interval>,
    /// The own ship at each fix; the first is the start.
    own: Vec<OwnTruth>,
    samples_per_fix: usize,
    fixes_per_scan: usize,
    /// Age of a fix, in fixes.
    fix_age: usize,
}

impl TrackingWorld {
    /// Works out the own ship's motion.
    #[must_use]
    pub fn new(scenario: &Scenario) -> Self {
        let vessel = vessel(scenario);
        let dt = 1.0 / scenario.imu.rate_hz;
        let samples_per_fix =
            (scenario.imu.rate_hz / scenario.gps_compass.rate_hz).round() as usize;
        let fixes_per_scan =
            (scenario.gps_compass.rate_hz / scenario.radar.rate_hz).round() as usize;
        let scans = (scenario.meta.duration_s * scenario.radar.rate_hz).round() as usize;
        let samples = scans * fixes_per_scan * samples_per_fix;
        let gravity = Vector3::new(0.0, 0.0, scenario.meta.gravity_m_s2);
        let mut intervals = Vec::with_capacity(samples);
        let mut own = vec![own_truth(&vessel, 0.0)];
        let mut before = vessel.at(0.0);
        for k in 1..=samples {
            let t_s = k as f64 * dt;
            let now = vessel.at(t_s);
            let rate = mean_rate(&before.world_from_body, &now.world_from_body, dt);
            let middle = before.world_from_body * exp(&(rate * (0.5 * dt)));
            let acceleration = (now.velocity - before.velocity) / dt;
            intervals.push(Interval {
                mean_rate: rate,
                mean_force: middle.inverse_transform_vector(&(acceleration - gravity)),
            });
            if k.is_multiple_of(samples_per_fix) {
                own.push(own_truth(&vessel, t_s));
            }
            before = now;
        }
        Self {
            noises: Noises::of(scenario),
            scenario: scenario.clone(),
            intervals,
            own,
            samples_per_fix,
            fixes_per_scan,
            fix_age: (scenario.gps_compass.latency_s * scenario.gps_compass.rate_hz).round()
                as usize,
        }
    }

    /// What it was made from.
    #[must_use]
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The standard deviations.
    #[must_use]
    pub fn noises(&self) -> &Noises {
        &self.noises
    }

    /// Number of radar scans after the start.
    #[must_use]
    pub fn scans(&self) -> usize {
        (self.own.len() - 1) / self.fixes_per_scan.max(1)
    }

    /// Fixes from one scan to the next.
    #[must_use]
    pub fn fixes_per_scan(&self) -> usize {
        self.fixes_per_scan
    }

    /// Length of an inertial sample, s.
    #[must_use]
    pub fn sample_s(&self) -> f64 {
        1.0 / self.scenario.imu.rate_hz
    }

    /// Time between scans, s.
    #[must_use]
    pub fn scan_s(&self) -> f64 {
        1.0 / self.scenario.radar.rate_hz
    }

    /// The own ship at a scan; scan 0 is the start.
    #[must_use]
    pub fn own_at_scan(&self, scan: usize) -> OwnTruth {
        let last = self.own.len() - 1;
        self.own[(scan * self.fixes_per_scan).min(last)]
    }

    /// Starts the run of this number under the campaign's seed.
    #[must_use]
    pub fn run(&self, campaign_seed: u64, run: u64) -> TrackingRun<'_> {
        TrackingRun::new(self, run_seed(campaign_seed, run))
    }

    /// The ideal inertial sample of this number: angular rate (rad/s) and specific force (m/s^2).
    pub(super) fn ideal_sample(&self, number: usize) -> Option<[Vector3<f64>; 2]> {
        let interval = self.intervals.get(number)?;
        Some([interval.mean_rate, interval.mean_force])
    }

    /// The own ship at a fix; fix 0 is the start.
    pub(super) fn own_at_fix(&self, fix: usize) -> Option<&OwnTruth> {
        self.own.get(fix)
    }

    /// What a fix shows: the own ship as it was the latency ago.
    pub(super) fn shown_by_fix(&self, fix: usize) -> Option<&OwnTruth> {
        self.own.get(fix.saturating_sub(self.fix_age))
    }

    /// Inertial samples from one fix to the next.
    pub(super) fn samples_per_fix(&self) -> usize {
        self.samples_per_fix
    }

    /// Errors of the gyroscope, rad/s.
    pub(super) fn gyroscope_errors(&self) -> ErrorModel {
        let imu = &self.scenario.imu;
        ErrorModel {
            noise_std: self.noises.gyroscope_std,
            bias_std: self.noises.gyroscope_bias_std,
            bias_random_walk: imu.gyro_bias_random_walk_deg_s_sqrt_s.to_radians(),
            scale_error_std: imu.gyro_scale_error_std,
            resolution: imu.gyro_resolution_deg_s.to_radians(),
            range: imu.gyro_range_deg_s.to_radians(),
            ..ErrorModel::default()
        }
    }

    /// Errors of the accelerometer, m/s^2.
    pub(super) fn accelerometer_errors(&self) -> ErrorModel {
        let imu = &self.scenario.imu;
        ErrorModel {
            noise_std: self.noises.accelerometer_std,
            bias_std: self.noises.accelerometer_bias_std,
            bias_random_walk: imu.accel_bias_random_walk_m_s2_sqrt_s,
            scale_error_std: imu.accel_scale_error_std,
            resolution: imu.accel_resolution_m_s2,
            range: imu.accel_range_m_s2,
            ..ErrorModel::default()
        }
    }

    pub(super) fn faults<const N: usize>(&self, sensor: FaultySensor) -> FaultInjector<N> {
        let of_sensor = self.scenario.faults.iter().filter(|f| f.sensor == sensor);
        let faults = of_sensor.map(|f| Fault {
            kind: f.what.clone(),
            from_s: f.from_s,
            until_s: f.until_s,
        });
        FaultInjector::new(faults.collect())
    }
}

fn vessel(scenario: &Scenario) -> Vessel {
    let own = &scenario.ownship;
    let one_turn = [
        Manoeuvre::Straight {
            duration_s: own.turn_start_s,
        },
        Manoeuvre::Turn {
            rate_deg_s: own.turn_rate_deg_s,
            angle_deg: own.turn_angle_deg,
        },
    ];
    let turns = own.turn_rate_deg_s.abs() > 0.0;
    let manoeuvres = match (own.manoeuvres.is_empty(), turns) {
        (false, _) => &own.manoeuvres[..],
        (true, true) => &one_turn[..],
        (true, false) => &[],
    };
    let swing = |amplitude_deg: f64, period_s: f64| Swing {
        amplitude_rad: amplitude_deg.to_radians(),
        period_s,
    };
    let vessel = Vessel::new(
        own.position_m,
        own.heading_deg.to_radians(),
        own.speed_m_s,
        manoeuvres,
    );
    vessel.swinging(
        swing(own.roll_amplitude_deg, own.roll_period_s),
        swing(own.pitch_amplitude_deg, own.pitch_period_s),
    )
}

fn own_truth(vessel: &Vessel, t_s: f64) -> OwnTruth {
    let truth = vessel.at(t_s);
    OwnTruth {
        ned_from_body: truth.world_from_body,
        velocity: truth.velocity,
        position: truth.position,
        heading_rad: vessel.heading_rad(t_s),
    }
}
