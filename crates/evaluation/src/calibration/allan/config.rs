//! How a record at rest is analysed, and which settings are invalid.

use northing_recording::SensorKind;

use super::error::AllanError;
use super::unit;

/// How a record is analysed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AllanConfig {
    /// The sensor, default gyroscope; also accelerometer and the magnetometers.
    pub sensor: SensorKind,
    /// Averaging times per factor of ten, default 10. Raising it draws a finer curve.
    pub points_per_decade: usize,
    /// Shortest record, s, default 60. Lowering it gives the white noise of short rests.
    pub minimum_duration_s: f64,
    /// Longest gap that is filled in, s, default 0.2; a longer one cuts the record.
    pub longest_filled_gap_s: f64,
    /// Probability that the true deviation lies within the bounds, default 0.95.
    pub confidence: f64,
    /// By how much the mean of a second may differ from the usual one, unit of the sensor. Default
    /// `None`: 0.02 rad/s, 0.2 m/s^2, 5 microtesla. Raising it accepts unsteady tables.
    pub motion_limit: Option<f64>,
}

impl Default for AllanConfig {
    fn default() -> Self {
        Self {
            sensor: SensorKind::Gyroscope,
            points_per_decade: 10,
            minimum_duration_s: 60.0,
            longest_filled_gap_s: 0.2,
            confidence: 0.95,
            motion_limit: None,
        }
    }
}

impl AllanConfig {
    pub(super) fn motion_limit(&self, sensor: SensorKind) -> f64 {
        self.motion_limit.unwrap_or(match sensor {
            SensorKind::Accelerometer => 0.2,
            SensorKind::Magnetometer | SensorKind::MagnetometerUncalibrated => 5.0,
            _ => 0.02,
        })
    }

    pub(super) fn check(&self) -> Result<(), AllanError> {
        if unit(self.sensor).is_empty() {
            return Err(AllanError::NotASensor(self.sensor.name()));
        }
        let positive = |x: f64| x > 0.0 && x.is_finite();
        let settings = [
            (
                "points_per_decade",
                self.points_per_decade as f64,
                (1..=100).contains(&self.points_per_decade),
                "1 to 100",
            ),
            (
                "minimum_duration_s",
                self.minimum_duration_s,
                positive(self.minimum_duration_s),
                "a positive number",
            ),
            (
                "longest_filled_gap_s",
                self.longest_filled_gap_s,
                self.longest_filled_gap_s >= 0.0 && self.longest_filled_gap_s.is_finite(),
                "zero or more",
            ),
            (
                "confidence",
                self.confidence,
                self.confidence > 0.0 && self.confidence < 1.0,
                "between 0 and 1",
            ),
            (
                "motion_limit",
                self.motion_limit.unwrap_or(1.0),
                self.motion_limit.is_none_or(positive),
                "a positive number",
            ),
        ];
        let bad = settings.into_iter().find(|(_, _, good, _)| !good);
        bad.map_or(Ok(()), |(name, value, _, expected)| {
            Err(AllanError::BadSetting {
                name,
                value,
                expected,
            })
        })
    }
}
