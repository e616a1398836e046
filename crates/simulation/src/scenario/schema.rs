//! The tables of a tracking scenario. Units are in the keys: `_s`, `_hz`, `_m`, `_m_s`, `_m_s2`,
//! `_deg`, `_deg_s`.
//!
//! Frames: north, east, down; heading clockwise from north. All tables but `nees`, `blackbox` and
//! `faults` must be there.

use serde::{Deserialize, Serialize};

use crate::faults::FaultKind;
use crate::settings::settings;
use crate::trajectory::vessel::Manoeuvre;

/// A whole scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Name, length, runs.
    pub meta: Meta,
    /// The own ship.
    pub ownship: OwnShipTable,
    /// The target.
    pub target: TargetTable,
    /// The inertial measurement unit.
    pub imu: ImuTable,
    /// The GPS compass.
    pub gps_compass: GpsCompassTable,
    /// The navigation filter.
    pub navigation: NavigationTable,
    /// The radar.
    pub radar: RadarTable,
    /// How tracks start.
    pub track_init: TrackInitTable,
    /// What is said about consistency; the bands are computed, these are for the reader.
    #[serde(default)]
    pub nees: NeesTable,
    /// What a tracker beside a black-box navigation assumes.
    #[serde(default)]
    pub blackbox: BlackBoxTable,
    /// Faults of sensors.
    #[serde(default)]
    pub faults: Vec<FaultTable>,
}

/// Name, length, runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Meta {
    /// The scenario's name; a variant goes by its own.
    pub name: String,
    /// Runs of a campaign, unless asked otherwise.
    pub monte_carlo_runs: u32,
    /// Seed, unless asked otherwise.
    pub seed: u64,
    /// Length of a run, s.
    pub duration_s: f64,
    /// Gravity, m/s^2.
    pub gravity_m_s2: f64,
    /// Trackers of a campaign, unless asked otherwise; default: all.
    #[serde(default)]
    pub trackers: Vec<String>,
}

/// The own ship's motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OwnShipTable {
    /// Start: north, east, down, m.
    pub position_m: [f64; 3],
    /// Start heading, deg.
    pub heading_deg: f64,
    /// Start speed, m/s.
    pub speed_m_s: f64,
    /// When the one turn starts, s. Default 0.
    #[serde(default)]
    pub turn_start_s: f64,
    /// Rate of the one turn, deg/s, positive to the right; default 0: there is none.
    #[serde(default)]
    pub turn_rate_deg_s: f64,
    /// Angle of the one turn, deg. Default 0.
    #[serde(default)]
    pub turn_angle_deg: f64,
    /// A list of manoeuvres instead of the one turn.
    #[serde(default)]
    pub manoeuvres: Vec<Manoeuvre>,
    /// Amplitude of rolling, deg. Default 0.
    #[serde(default)]
    pub roll_amplitude_deg: f64,
    /// Period of rolling, s. Default 8.
    #[serde(default = "number::<8>")]
    pub roll_period_s: f64,
    /// Amplitude of pitching, deg. Default 0.
    #[serde(default)]
    pub pitch_amplitude_deg: f64,
    /// Period of pitching, s. Default 6.
    #[serde(default = "number::<6>")]
    pub pitch_period_s: f64,
}

fn number<const N: u8>() -> f64 {
    f64::from(N)
}

fn yes() -> bool {
    true
}

/// The target's motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TargetTable {
    /// Start: north, east, m.
    pub position_m: [f64; 2],
    /// Velocity: north, east, m/s.
    pub velocity_m_s: [f64; 2],
    /// Whether each run draws its own truth from the trackers' motion model; otherwise the target
    /// goes straight on.
    pub truth_process_noise: bool,
    /// White acceleration of each radar period, per axis, m/s^2: the trackers' model.
    pub sigma_accel_m_s2: f64,
    /// The kind of that noise.
    pub process_noise_model: ProcessNoiseModel,
}

/// How white acceleration enters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ProcessNoiseModel {
    /// Discrete white noise acceleration: constant over a period.
    Dwna,
}

/// What a standard deviation of an inertial sensor means.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NoiseReading {
    /// A density: each sample has `sigma / sqrt(dt)`.
    Density,
    /// That of each sample.
    Sample,
    /// That of each step's increment: each sample has `sigma / dt`.
    Step,
}

impl NoiseReading {
    /// Standard deviation of a sample.
    #[must_use]
    pub fn sample_std(self, sigma: f64, dt_s: f64) -> f64 {
        match self {
            Self::Density => sigma / dt_s.sqrt(),
            Self::Sample => sigma,
            Self::Step => sigma / dt_s,
        }
    }
}

/// The inertial measurement unit.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImuTable {
    /// Samples each second, Hz.
    pub rate_hz: f64,
    /// Noise of the accelerometer, m/s^2, read as `noise_reading` says.
    #[serde(alias = "sigma_accel")]
    pub sigma_accel_m_s2: f64,
    /// Noise of the gyroscope, deg/s, read as `noise_reading` says.
    pub sigma_gyro_deg_s: f64,
    /// What these mean in the simulated sensor.
    pub noise_reading: NoiseReading,
    /// What the navigation filter takes them for.
    pub filter_noise_reading: NoiseReading,
    /// Constant accelerometer bias, drawn for each run, m/s^2 per axis.
    pub accel_bias_std_m_s2: f64,
    /// Constant gyroscope bias, drawn for each run, deg/s per axis.
    pub gyro_bias_std_deg_s: f64,
    /// Random walk of the accelerometer bias, (m/s^2)/sqrt(s). Default 0. The navigation filter
    /// takes biases for constant: this and the errors below are truth that it does not know of.
    #[serde(default)]
    pub accel_bias_random_walk_m_s2_sqrt_s: f64,
    /// Random walk of the gyroscope bias, (deg/s)/sqrt(s). Default 0.
    #[serde(default)]
    pub gyro_bias_random_walk_deg_s_sqrt_s: f64,
    /// Relative scale error of the accelerometer, drawn for each run and axis. Default 0.
    #[serde(default)]
    pub accel_scale_error_std: f64,
    /// Relative scale error of the gyroscope, drawn for each run and axis. Default 0.
    #[serde(default)]
    pub gyro_scale_error_std: f64,
    /// One step of the accelerometer's output, m/s^2. Default 0: not rounded.
    #[serde(default)]
    pub accel_resolution_m_s2: f64,
    /// One step of the gyroscope's output, deg/s. Default 0: not rounded.
    #[serde(default)]
    pub gyro_resolution_deg_s: f64,
    /// Largest specific force that an axis can show, m/s^2. Default 0: no limit.
    #[serde(default)]
    pub accel_range_m_s2: f64,
    /// Largest rate that an axis can show, deg/s. Default 0: no limit.
    #[serde(default)]
    pub gyro_range_deg_s: f64,
}

/// The GPS compass.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GpsCompassTable {
    /// Fixes each second, Hz; the inertial rate must be a multiple.
    pub rate_hz: f64,
    /// Noise of the position: north, east, down, m.
    pub position_std_m: [f64; 3],
    /// Noise of the heading, deg.
    pub heading_std_deg: f64,
    /// Noise of roll and pitch, deg.
    pub roll_pitch_std_deg: f64,
    /// Age of what a fix shows, s: a whole number of its periods. Default 0. The navigation filter
    /// takes a fix for new.
    #[serde(default)]
    pub latency_s: f64,
    /// Probability that a fix does not come. Default 0.
    #[serde(default)]
    pub dropout_probability: f64,
}

/// The attitude error that the filter uses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ErrorAngle {
    /// In the reference frame: `q_true = Exp(dpsi) q`.
    Global,
}

/// The navigation filter that the trackers are beside.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NavigationFilter {
    /// The error-state filter with the GNSS compass's position and attitude, as in the paper.
    #[default]
    ErrorState,
    /// The GNSS/INS, with position and heading of the same fixes.
    GnssIns,
}

/// The navigation filter.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NavigationTable {
    /// Which one. Default `error-state`.
    #[serde(default)]
    pub filter: NavigationFilter,
    /// Standard deviation of the start velocity, m/s; position and attitude start from one fix.
    pub initial_velocity_std_m_s: f64,
    /// Start of both biases; their standard deviations are those of `imu`.
    pub initial_bias_estimate: f64,
    /// The attitude error.
    pub error_angle: ErrorAngle,
    /// Whether the reset Jacobian is applied. Default true.
    #[serde(default = "yes")]
    pub reset_jacobian: bool,
    /// Navigation before the first detection, s; must be 0.
    #[serde(default)]
    pub warmup_s: f64,
    /// Multiplies all noises of the inertial sensors and of the GPS compass, in truth and filter;
    /// not the biases. Default 1.
    #[serde(default = "number::<1>")]
    pub noise_factor: f64,
}

/// The radar.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RadarTable {
    /// Scans each second, Hz; the rate of fixes must be a multiple.
    pub rate_hz: f64,
    /// Noise of the range, m.
    pub sigma_range_m: f64,
    /// Noise of the bearing, deg.
    pub sigma_bearing_deg: f64,
    /// Probability that the target is seen in a scan. Default 1.
    #[serde(default = "number::<1>")]
    pub detection_probability: f64,
    /// False detections in a scan; must be 0, as these trackers take every detection for the target.
    #[serde(default)]
    pub clutter_per_scan: f64,
}

/// How tracks start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TrackStart {
    /// At the first detection, with zero velocity.
    OnePoint,
    /// At the truth plus an error of the stated size, the same for each tracker.
    Prior,
}

/// Covariance of a new track with the navigation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StartCross {
    /// That of the converted detection.
    FromConversion,
    /// None.
    Zero,
}

/// The start of the tracks.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrackInitTable {
    /// The kind.
    pub mode: TrackStart,
    /// Standard deviation of the velocity, m/s per axis.
    pub velocity_std_m_s: f64,
    /// Standard deviation of the position, m per axis; for `prior`. Default 100.
    #[serde(default = "number::<100>")]
    pub position_std_m: f64,
    /// The cross-covariance; `prior` has none.
    pub cross_covariance: StartCross,
    /// First scan that counts. Default 1: the one after the start.
    #[serde(default = "first")]
    pub first_scored_step: u32,
}

fn first() -> u32 {
    1
}

/// What is said about consistency.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct NeesTable {
    /// Degrees of freedom.
    pub dof: Option<u32>,
    /// The 95 % band of the mean over the runs.
    pub interval: Option<[f64; 2]>,
    /// The band of 2 degrees of freedom that the paper's plots use.
    pub interval_paper: Option<[f64; 2]>,
}

settings! {
    /// Correlation times that a black-box tracker assumes.
    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    #[serde(deny_unknown_fields, default)]
    pub struct BlackBoxTable {
        /// Of the heading error, s. Default 3.3.
        tau_heading_s: f64 = 3.3,
        /// Of the position error, s. Default 0.41.
        tau_position_s: f64 = 0.41,
    }
}

/// The sensors that can fail.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultySensor {
    /// Angular rate, rad/s.
    Gyroscope,
    /// Specific force, m/s^2.
    Accelerometer,
    /// Position, m, north, east, down.
    GpsPosition,
    /// Turn about north, east, down, rad: the error of the compass.
    GpsCompass,
    /// Range (m) and bearing (rad).
    Radar,
}

/// A fault of a sensor: `sensor`, `from_s`, `until_s`, and a table `what` with its `kind`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FaultTable {
    /// The sensor.
    pub sensor: FaultySensor,
    /// From when on, s.
    pub from_s: f64,
    /// Until when, s.
    pub until_s: f64,
    /// What happens.
    pub what: FaultKind,
}
