//! The tables of a flight scenario: what attitude and position observers are judged by.
//!
//! Units are in the keys. Frames: east, north, up; body axes forward, left, up.

use serde::{Deserialize, Serialize};

use super::file::ScenarioTables;
use crate::settings::{named_values, rule, rules};
use crate::trajectory::FlightAttitude;

/// Samples of a flight at most.
const MOST_SAMPLES: f64 = 2e7;

/// A whole flight scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlightScenario {
    /// Name, length, what is scored.
    pub meta: FlightMeta,
    /// How the body moves.
    pub motion: MotionTable,
    /// What the observers start from.
    pub start: StartTable,
    /// The gyroscope.
    pub gyroscope: FlightGyroscopeTable,
    /// The accelerometer.
    pub accelerometer: FlightAccelerometerTable,
    /// The magnetometer.
    pub magnetometer: FlightMagnetometerTable,
    /// Position measurements.
    pub position: FlightPositionTable,
    /// What the quaternion EKF assumes.
    pub ekf: EkfTable,
}

/// Name, length, what is scored.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlightMeta {
    /// The scenario's name; a variant goes by its own.
    pub name: String,
    /// What it is, in a few words.
    pub title: String,
    /// Length of a flight, s.
    pub duration_s: f64,
    /// Scores begin here, s.
    pub scored_from_s: f64,
    /// Scores end here, s; default: at the end.
    pub scored_until_s: Option<f64>,
    /// Which error counts.
    pub metric: Metric,
}

/// Which error counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Metric {
    /// The whole attitude error.
    Total,
    /// Only the inclination: without a magnetometer nobody knows the heading.
    Inclination,
}

/// How the body moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionTable {
    /// Attitude free of the acceleration, or the z axis along the specific force.
    pub attitude: FlightAttitude,
    /// Root mean square of the acceleration of each horizontal axis, m/s^2.
    pub acceleration_rms_m_s2: f64,
    /// Instead of a flight: a spin about the vertical, rad/s. Default 0: a flight.
    #[serde(default)]
    pub spin_rad_s: f64,
}

/// What the observers start from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StartTable {
    /// Angle between truth and start, about an axis drawn for each flight, deg.
    pub attitude_error_deg: f64,
}

/// The gyroscope, whose samples are the mean rate since the last one.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlightGyroscopeTable {
    /// Samples per second, of the accelerometer and the magnetometer as well, Hz.
    pub rate_hz: f64,
    /// White noise of each sample, rad/s.
    pub noise_std_rad_s: f64,
    /// Standard deviation of the bias of each axis, rad/s.
    pub bias_std_rad_s: f64,
    /// Random walk of the bias, rad/s/sqrt(s).
    pub bias_random_walk_rad_s_sqrt_s: f64,
}

/// The accelerometer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlightAccelerometerTable {
    /// White noise of each sample, m/s^2.
    pub noise_std_m_s2: f64,
    /// Standard deviation of the bias of each axis, m/s^2.
    pub bias_std_m_s2: f64,
}

/// The magnetometer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlightMagnetometerTable {
    /// Whether there is one.
    pub used: bool,
    /// Strength of the field, microtesla.
    pub strength_ut: f64,
    /// How far it dips below the horizon, deg.
    pub dip_deg: f64,
    /// White noise of each sample, microtesla.
    pub noise_std_ut: f64,
    /// A disturbance towards the east, microtesla, in the last third of every period. Default 0.
    #[serde(default)]
    pub burst_ut: f64,
    /// That period, s. Default 30.
    #[serde(default = "thirty")]
    pub burst_period_s: f64,
}

/// Position measurements.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FlightPositionTable {
    /// Inertial samples from one position to the next.
    pub every_samples: u32,
    /// White noise of each axis, m.
    pub noise_std_m: f64,
    /// Pole of the position observer, 1/s.
    pub pole_per_s: f64,
}

/// What the quaternion EKF assumes beside the sensors' noises.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EkfTable {
    /// Accelerations that are taken for errors of gravity, standard deviation of each axis, m/s^2.
    pub linear_acceleration_std_m_s2: f64,
}

fn thirty() -> f64 {
    30.0
}

impl ScenarioTables for FlightScenario {
    fn set_name(&mut self, name: &str) {
        name.clone_into(&mut self.meta.name);
    }

    fn check(&self) -> Result<(), String> {
        let positive = named_values![self =>
            meta.duration_s,
            gyroscope.rate_hz,
            gyroscope.noise_std_rad_s,
            accelerometer.noise_std_m_s2,
            magnetometer.strength_ut,
            magnetometer.noise_std_ut,
            magnetometer.burst_period_s,
            position.every_samples,
            position.noise_std_m,
            position.pole_per_s,
        ];
        let not_negative = named_values![self =>
            meta.scored_from_s,
            motion.acceleration_rms_m_s2,
            start.attitude_error_deg,
            gyroscope.bias_std_rad_s,
            gyroscope.bias_random_walk_rad_s_sqrt_s,
            accelerometer.bias_std_m_s2,
            ekf.linear_acceleration_std_m_s2,
        ];
        let finite = named_values![self =>
            motion.spin_rad_s,
            magnetometer.dip_deg,
            magnetometer.burst_ut,
        ];
        rules(positive, "a finite number above zero", |v| v > 0.0)?;
        rules(not_negative, "zero or more", |v| v >= 0.0)?;
        rules(finite, "a finite number", |_| true)?;
        self.spans()
    }
}

impl FlightScenario {
    fn spans(&self) -> Result<(), String> {
        let (from, end) = (self.meta.scored_from_s, self.scored_until_s());
        let duration_s = self.meta.duration_s;
        let expected = format!(
            "a time after meta.scored_from_s ({from}) and not after meta.duration_s ({duration_s})"
        );
        let is_within = end > from && end <= duration_s;
        rule(is_within, "meta.scored_until_s", end, &expected)?;
        let expected = format!("at most {MOST_SAMPLES} samples a flight");
        let is_short = duration_s * self.gyroscope.rate_hz <= MOST_SAMPLES;
        rule(is_short, "meta.duration_s", duration_s, &expected)
    }

    /// End of what is scored, s.
    #[must_use]
    pub fn scored_until_s(&self) -> f64 {
        self.meta.scored_until_s.unwrap_or(self.meta.duration_s)
    }
}

#[cfg(test)]
mod tests {
    use super::super::FlightScenarioFile;
    use super::*;

    const TEXT: &str = include_str!("../../../../scenarios/observers/cascade.toml");

    #[test]
    fn the_scenario_of_the_experiment_is_read_with_all_its_conditions() {
        let file = FlightScenarioFile::parse("cascade.toml", TEXT).unwrap();
        assert!(file.variants().len() >= 15, "{:?}", file.variants());
        let thrust = file.scenario(Some("thrust-3")).unwrap();
        assert_eq!(thrust.motion.attitude, FlightAttitude::ThrustAligned);
        assert!((thrust.motion.acceleration_rms_m_s2 - 3.0).abs() < 1e-12);
        assert!((thrust.ekf.linear_acceleration_std_m_s2 - 2.1).abs() < 1e-12);
        let blind = file.scenario(Some("thrust-3-accelerometer-only")).unwrap();
        assert_eq!(blind.meta.metric, Metric::Inclination);
        assert_eq!(blind.motion, thrust.motion);
        assert!(!blind.magnetometer.used);
    }

    #[test]
    fn numbers_without_sense_are_refused_with_their_line() {
        for (good, bad, words) in [
            (
                "rate_hz = 100.0",
                "rate_hz = 0.0",
                "gyroscope.rate_hz is 0, expected a finite number above zero",
            ),
            (
                "scored_from_s = 20.0",
                "scored_from_s = 120.0",
                "expected a time after meta.scored_from_s (120)",
            ),
            (
                "strength_ut = 48.0",
                "strength_ut = nan",
                "magnetometer.strength_ut is NaN",
            ),
            (
                "strength_ut = 48.0",
                "strength_mt = 48.0",
                "unknown field `strength_mt`",
            ),
            ("duration_s = 120.0", "duration_s = 1e9", "samples a flight"),
        ] {
            assert!(TEXT.contains(good), "{good}");
            let message = FlightScenarioFile::parse("c.toml", &TEXT.replacen(good, bad, 1));
            let message = message.unwrap_err().to_string();
            assert!(
                message.contains(words) && message.starts_with("c.toml:"),
                "{message}"
            );
        }
    }
}
