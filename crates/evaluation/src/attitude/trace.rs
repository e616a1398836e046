//! Trace of a run for plots, thinned as it grows so that memory stays bounded.

use northing_core::kalman::Outcome;
use northing_recording::SensorKind;

use crate::statistics::thinned::Thinned;

/// The estimate at one instant. Angles in degrees: heading, pitch, roll of the aerospace order
/// (yaw, pitch, roll) in the recording's world frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TracePoint {
    /// Seconds since the first sample of the recording.
    pub time_s: f64,
    /// Yaw, pitch, roll of the estimate, deg.
    pub angles_deg: [f64; 3],
    /// Standard deviation of each of those angles, deg; `None` for estimators without covariance.
    pub angles_std_deg: Option<[f64; 3]>,
    /// Yaw, pitch, roll of the reference, deg.
    pub reference_deg: Option<[f64; 3]>,
    /// Yaw, pitch, roll of the device's own orientation, deg.
    pub device_deg: Option<[f64; 3]>,
    /// Total, heading and inclination error against the reference, deg (heading is signed).
    pub error_deg: Option<[f64; 3]>,
    /// Predicted standard deviation of the total error (root of the covariance's trace) and of the
    /// heading error, deg.
    pub error_std_deg: Option<[f64; 2]>,
    /// Gyroscope bias estimate, deg/s, body axes.
    pub bias_deg_s: Option<[f64; 3]>,
    /// Its standard deviation, deg/s.
    pub bias_std_deg_s: Option<[f64; 3]>,
    /// Estimated position, east, north, up, m.
    pub position_m: Option<[f64; 3]>,
}

/// One measured position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionPoint {
    /// When it was true, seconds since the first sample of the recording.
    pub time_s: f64,
    /// The position, east, north, up, m.
    pub measured_m: [f64; 3],
    /// Measured minus estimated, east, north, up, m.
    pub residual_m: [f64; 3],
    /// What was done with it.
    pub outcome: Outcome,
}

/// One innovation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct InnovationPoint {
    /// Seconds since the first sample of the recording.
    pub time_s: f64,
    /// Measured minus predicted (m/s^2, microtesla, or rad for a heading).
    pub residual: [f64; 3],
    /// What the filter expected: square roots of the diagonal of S.
    pub std: [f64; 3],
    /// Normalised innovation squared.
    pub nis: f64,
    /// Components measured: 3, or 1 for a heading.
    pub degrees_of_freedom: u8,
    /// What was done with it.
    pub outcome: Outcome,
}

/// What plots need of one run.
#[derive(Debug, Clone)]
pub struct Trace {
    /// Estimates over time.
    pub points: Thinned<TracePoint>,
    /// Innovations of each sensor that was updated with.
    pub innovations: Vec<(SensorKind, Thinned<InnovationPoint>)>,
    /// Measured positions, where the estimator looked at them.
    pub positions: Thinned<PositionPoint>,
}

impl Trace {
    /// An empty trace that keeps at most `capacity` points a series.
    #[must_use]
    pub fn new(capacity: usize) -> Self {
        let series = |kind| (kind, Thinned::new(capacity));
        Self {
            points: Thinned::new(capacity),
            innovations: vec![
                series(SensorKind::Accelerometer),
                series(SensorKind::Magnetometer),
            ],
            positions: Thinned::new(capacity),
        }
    }
}
