//! Observer interface of a navigation run: files, plots, tests.

use nalgebra::Vector3;
use northing_core::earth::wgs84::LocalFrame;
use northing_core::kalman::Innovation;

use super::navigator::{AidKind, NavigationEstimate};

/// The error of a position, and the standard deviations stated for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScoredPoint {
    /// Time of validity, ns.
    pub time_ns: i64,
    /// Estimate minus truth, m, north, east, down.
    pub error: Vector3<f64>,
    /// Root of the horizontal variances' sum that the estimator stated, m.
    pub horizontal_std: f64,
    /// That of the height, m.
    pub vertical_std: f64,
    /// Whether the truth of the height is known.
    pub vertical: bool,
}

/// What watches a navigation run.
pub trait NavigationObserver {
    /// How often an estimate is wanted, ns; 0 for each sample. Each costs a look at the covariance.
    fn interval_ns(&self) -> i64 {
        100_000_000
    }

    /// An estimate.
    fn estimate(&mut self, _estimate: &NavigationEstimate) {}

    /// A fix, m from the origin, and whether the estimator got it.
    fn fix(&mut self, _time_ns: i64, _ned: &Vector3<f64>, _used: bool) {}

    /// A place to score against.
    fn reference(&mut self, _time_ns: i64, _ned: &Vector3<f64>) {}

    /// The error of a position.
    fn scored(&mut self, _point: &ScoredPoint) {}

    /// What an aid told.
    fn innovation(&mut self, _time_ns: i64, _aid: AidKind, _innovation: &Innovation<f64>) {}

    /// Inertial samples: angular rate and specific force, body axes.
    fn inertial(&mut self, _time_ns: i64, _rate: &Vector3<f64>, _force: &Vector3<f64>) {}

    /// A sample of the magnetic field, body axes.
    fn magnetic_field(&mut self, _time_ns: i64, _field: &Vector3<f64>) {}

    /// What the device itself said, whatever the estimator.
    fn device(&mut self, _estimate: &NavigationEstimate) {}

    /// The origin of the local frame is known.
    fn origin(&mut self, _frame: &LocalFrame) {}
}

/// Watches nothing.
impl NavigationObserver for () {
    fn interval_ns(&self) -> i64 {
        i64::MAX
    }
}
