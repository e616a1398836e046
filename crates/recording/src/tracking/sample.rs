//! The sample model of tracking recordings.

/// One thing that happened.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackingEvent {
    /// Nanoseconds on the recording's clock.
    pub time_ns: i64,
    /// What happened.
    pub sample: TrackingSample,
}

/// What happened.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum TrackingSample {
    /// The own ship's pose, known until the next one.
    OwnShip(OwnShipPose),
    /// One sensor looked once.
    Scan(Scan),
    /// A ship reported its own position.
    Ais(AisReport),
    /// Where a target really was.
    Truth(TargetTruth),
}

impl TrackingSample {
    /// Order of samples of one instant: the pose is known before it is used, the truth last.
    pub(super) const fn order(&self) -> u8 {
        match self {
            Self::OwnShip(_) => 0,
            Self::Scan(_) | Self::Ais(_) => 1,
            Self::Truth(_) => 2,
        }
    }
}

/// Pose of the own ship in the local plane.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct OwnShipPose {
    /// North, m.
    pub north_m: f64,
    /// East, m.
    pub east_m: f64,
    /// Heading clockwise from north, rad; zero when detections are in north-east axes.
    pub heading_rad: f64,
    /// Standard deviations of north (m), east (m), heading (rad), if the recording states them.
    pub std: Option<[f64; 3]>,
}

/// One look of one sensor.
#[derive(Debug, Clone, PartialEq)]
pub struct Scan {
    /// Number of the scan in its table.
    pub id: i64,
    /// Place of the sensor in [`super::TrackingRecording::sensors`].
    pub sensor: usize,
    /// What it saw; empty when it saw nothing.
    pub detections: Vec<Detection>,
}

/// One detection, not assigned to a target. A number may be non-finite: trackers refuse and count it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Detection {
    /// Range and bearing from the bow.
    RangeBearing {
        /// Distance, m.
        range_m: f64,
        /// Angle clockwise from the bow (from north, when the pose has no heading), rad.
        bearing_rad: f64,
    },
    /// Bearing only.
    Bearing {
        /// Angle clockwise from the bow (from north, when the pose has no heading), rad.
        bearing_rad: f64,
    },
    /// Offset from the own ship in north-east axes; its heading has been taken out already.
    Relative {
        /// North, m.
        north_m: f64,
        /// East, m.
        east_m: f64,
    },
    /// Place in the local plane, moved there with the own ship's pose: its error is inside.
    Placed {
        /// North, m.
        north_m: f64,
        /// East, m.
        east_m: f64,
    },
}

/// A position report of a ship about itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AisReport {
    /// Maritime mobile service identity.
    pub mmsi: u32,
    /// North, m.
    pub north_m: f64,
    /// East, m.
    pub east_m: f64,
    /// Course over ground clockwise from north, rad.
    pub course_rad: Option<f64>,
    /// Speed over ground, m/s.
    pub speed_m_s: Option<f64>,
}

/// True position of a target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetTruth {
    /// Scan to which it belongs.
    pub scan: i64,
    /// Number of the target.
    pub target: u32,
    /// North, m.
    pub north_m: f64,
    /// East, m.
    pub east_m: f64,
}

/// What was left out of a recording, or put instead.
#[derive(Debug, Clone, PartialEq, Eq, Default, serde::Serialize)]
pub struct TrackingIssues {
    /// Detections and truths whose scan is not in the table of scans.
    pub rows_without_scan: u64,
    /// Scans, reports and targets whose sensor the manifest does not describe.
    pub scans_of_unknown_sensors: u64,
    /// Scans of which a cell of the own ship's pose is empty, as where its receiver had no fix.
    pub scans_without_own_ship: u64,
    /// Scans and reports that stood after a later one in their file; they were sorted.
    pub out_of_time_order: u64,
    /// AIS reports without a position.
    pub reports_without_position: u64,
    /// NMEA lines that are no sentence, have a wrong checksum, come before any time stamp, or are a radar's target before the
    /// own ship's place (and for a bearing from the bow its heading) is known.
    pub sentences_unusable: u64,
    /// What is unusual and may be an error, or is taken for granted: a sentence each.
    pub remarks: Vec<String>,
}
