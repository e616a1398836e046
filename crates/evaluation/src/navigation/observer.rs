//! Observer interface of a navigation run: files, plots, tests.

use nalgebra::Vector3;
use northing_core::earth::wgs84::LocalFrame;
use northing_core::kalman::Innovation;

use crate::observers::observers;

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
    /// Standard deviation of the truth per horizontal axis, m: that of a held-out fix.
    pub truth_std: f64,
    /// Whether the truth of the height is known.
    pub vertical: bool,
}

observers! {
    /// What watches a navigation run.
    pub trait NavigationObserver {
        asks {
            /// How often an estimate is wanted, ns; 0 for each sample. Each costs a look at the covariance.
            interval_ns -> i64, usually 100_000_000, of nobody i64::MAX, of two i64::min;
        }

        /// An estimate, in its own local frame.
        tells estimate(estimate: &NavigationEstimate);

        /// A fix, m from the first origin, and whether the estimator got it.
        tells fix(time_ns: i64, ned: &Vector3<f64>, used: bool);

        /// A place to score against, m from the first origin.
        tells reference(time_ns: i64, ned: &Vector3<f64>);

        /// The error of a position.
        tells scored(point: &ScoredPoint);

        /// What an aid told.
        tells innovation(time_ns: i64, aid: AidKind, innovation: &Innovation<f64>);

        /// Inertial samples: angular rate and specific force, body axes.
        tells inertial(time_ns: i64, rate: &Vector3<f64>, force: &Vector3<f64>);

        /// A sample of the magnetic field, body axes.
        tells magnetic_field(time_ns: i64, field: &Vector3<f64>);

        /// What the device itself said, whatever the estimator.
        tells device(estimate: &NavigationEstimate);

        /// The first origin is known.
        tells origin(frame: &LocalFrame);
    }
}

/// Watches nothing.
impl NavigationObserver for () {
    fn interval_ns(&self) -> i64 {
        i64::MAX
    }
}
