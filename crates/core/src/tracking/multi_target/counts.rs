//! Counts of what the tracker used and refused.

/// Why a scan was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum ScanError {
    /// Its time is NaN or infinite.
    TimeNotFinite,
    /// Its time is before the last scan's.
    TimeGoesBack,
    /// Its time is further ahead of the last scan than any gap can be.
    TimeInFuture,
    /// The own ship's pose is not finite, or its covariance is none.
    PoseInvalid,
    /// The own ship cannot have come from its last pose to this one. The next scan from here is taken.
    PoseJumps,
    /// What is said of the sensor is of none: a standard deviation, density or range that is negative or not a number, or a
    /// probability beyond 0 to 1.
    SensorInvalid,
}

impl ScanError {
    /// The reason in words.
    pub const fn description(self) -> &'static str {
        match self {
            Self::TimeNotFinite => "time not a finite number",
            Self::TimeGoesBack => "time before the last scan",
            Self::TimeInFuture => "time far ahead of the last scan",
            Self::PoseJumps => "own ship's pose jumps",
            Self::SensorInvalid => {
                "noise, probability, density or range of the sensor out of range"
            }
            Self::PoseInvalid => "own ship's pose not finite or its covariance not positive",
        }
    }
}

impl core::fmt::Display for ScanError {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str(self.description())
    }
}

impl core::error::Error for ScanError {}

/// Counters since the tracker was made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TrackerCounts {
    /// Scans used.
    pub scans: u64,
    /// Scans refused: time not finite.
    pub time_not_finite: u64,
    /// Scans refused: before the last one.
    pub time_goes_back: u64,
    /// Scans refused: far ahead of the last one.
    pub time_in_future: u64,
    /// Scans refused: pose or its covariance.
    pub pose_invalid: u64,
    /// Scans refused: the pose jumped.
    pub pose_jumps: u64,
    /// Scans refused: noise, probability, density or range of the sensor.
    #[cfg_attr(feature = "serde", serde(default))]
    pub sensor_invalid: u64,
    /// Detections skipped: not finite, or a range that is not positive.
    pub detections_invalid: u64,
    /// Detections left out of a gate: more than a track has room for; the likeliest are kept.
    pub detections_beyond_capacity: u64,
    /// Updates skipped: the target was at the own ship's position, where a bearing is undefined.
    pub bearing_undefined: u64,
    /// Updates skipped: an innovation covariance was not positive.
    pub numerical: u64,
    /// Tracks started.
    pub initiated: u64,
    /// Tracks not started, or given up for a new one, for want of room.
    pub tracks_beyond_capacity: u64,
    /// Confirmed tracks that ended.
    pub deleted_confirmed: u64,
    /// Tracks removed because another follows the same target.
    pub merged: u64,
    /// Clusters too large for exact association.
    pub approximate_clusters: u64,
}

impl TrackerCounts {
    pub(super) fn refuse(&mut self, error: ScanError) {
        match error {
            ScanError::TimeNotFinite => self.time_not_finite += 1,
            ScanError::TimeGoesBack => self.time_goes_back += 1,
            ScanError::TimeInFuture => self.time_in_future += 1,
            ScanError::PoseJumps => self.pose_jumps += 1,
            ScanError::PoseInvalid => self.pose_invalid += 1,
            ScanError::SensorInvalid => self.sensor_invalid += 1,
        }
    }
}
