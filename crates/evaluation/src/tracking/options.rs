//! What a tracking run can be asked for.

use super::kinds::TrackerKind;

/// Standard deviations of the own ship's pose.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OwnShipStd {
    /// Position on each axis, m.
    pub position_m: f64,
    /// Heading, rad.
    pub heading_rad: f64,
}

/// How to run.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TrackOptions {
    /// What to do about the own ship's uncertainty.
    pub tracker: TrackerKind,
    /// Standard deviations of the own ship's pose, instead of those of the recording (and zero when
    /// that has none).
    pub own_ship_std: Option<OwnShipStd>,
    /// Names of the sensors to use, instead of those that the recording marks.
    pub sensors: Option<Vec<String>>,
    /// Added to the own ship's heading, rad: an error that is known exactly.
    pub heading_error_rad: f64,
}
