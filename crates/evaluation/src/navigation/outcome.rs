//! The outcome of a navigation run: the object that `run --json` prints.

use std::collections::BTreeMap;

use northing_core::earth::wgs84::Geodetic;
use northing_core::navigation::Validity;
use serde::Serialize;

use super::batch_smoother::SmoothingSummary;
use super::kinds::NavigationKind;
use super::navigator::AidKind;
use super::score::{HeadingScore, OutageScore, PositionScore};
use crate::statistics::faults::FaultRecord;
use crate::statistics::nis::{NisSummary, UpdateCounts};
use crate::used_parameters::UsedParameter;

/// What became of one aid.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AidSummary {
    /// Used, refused, not looked at.
    #[serde(flatten)]
    pub updates: UpdateCounts,
    /// What its innovations say; `None` without any.
    pub nis: Option<NisSummary>,
}

/// How long the position was worth what, s.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct ValidityTimes {
    /// Before the start.
    pub aligning_s: f64,
    /// With fixes, but without a heading that is known.
    pub heading_unknown_s: f64,
    /// With fixes.
    pub aided_s: f64,
    /// Without, and still of use.
    pub dead_reckoning_s: f64,
    /// Without for too long, or too uncertain.
    pub invalid_s: f64,
}

impl ValidityTimes {
    /// Counts an interval, s.
    pub fn add(&mut self, validity: Validity, seconds: f64) {
        let slot = match validity {
            Validity::Aligning => &mut self.aligning_s,
            Validity::HeadingUnknown => &mut self.heading_unknown_s,
            Validity::Aided => &mut self.aided_s,
            Validity::DeadReckoning => &mut self.dead_reckoning_s,
            Validity::Invalid => &mut self.invalid_s,
        };
        *slot += seconds;
    }
}

/// Which way a vehicle moved that keeps to one direction, seen from the unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TravelDirection {
    /// From the body's forward axis to the right, seen from above, degrees: course minus heading.
    pub right_deg: f64,
    /// How much the direction scatters, degrees.
    pub spread_deg: f64,
    /// Over so many fixes, with heading and velocity known.
    pub fixes: u32,
}

/// Where the origin of the local frame is, degrees and metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Origin {
    /// Latitude, degrees, north positive.
    pub latitude_deg: f64,
    /// Longitude, degrees, east positive.
    pub longitude_deg: f64,
    /// Height above the ellipsoid, m.
    pub height_m: f64,
}

impl From<&Geodetic> for Origin {
    fn from(place: &Geodetic) -> Self {
        let [latitude_deg, longitude_deg] = place.degrees();
        Self {
            latitude_deg,
            longitude_deg,
            height_m: place.height_m,
        }
    }
}

/// The outcome of one estimator on one recording. What does not apply is `None`, `null` in JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NavigationSummary {
    /// The estimator.
    pub estimator: NavigationKind,
    /// Name of the recording.
    pub recording: String,
    /// Whether the estimates are smoothed over the whole recording.
    pub smoothed: bool,
    /// How that went.
    pub smoothing: Option<SmoothingSummary>,
    /// Time from the first to the last sample, s.
    pub duration_s: f64,
    /// Inertial samples taken.
    pub inertial_samples: u64,
    /// Fixes that the recording holds, the unusable ones among them.
    pub fixes: u64,
    /// Fixes that the estimator got: usable, and not held out.
    pub fixes_given: u64,
    /// Those of them that it used: not gated, and not skipped, as before it had aligned.
    pub fixes_used: u64,
    /// Fixes that nobody should use, by reason.
    pub fixes_unusable: BTreeMap<&'static str, u64>,
    /// Where the local frame has its origin: the first usable fix that a later one confirmed.
    pub origin: Option<Origin>,
    /// What was scored at: `reference` or `held-out fixes`.
    pub scored_against: Option<&'static str>,
    /// Scores of the position.
    pub position: Option<PositionScore>,
    /// Root mean square of the velocity error, m/s.
    pub velocity_rmse_m_s: Option<f64>,
    /// Root mean square of the heading error, degrees; see [`NavigationSummary::heading`].
    pub heading_rmse_deg: Option<f64>,
    /// Root mean square of the tilt error, degrees, against a reference attitude.
    pub tilt_rmse_deg: Option<f64>,
    /// More about the heading.
    pub heading: Option<HeadingScore>,
    /// Which way it moved: `None` where the heading was not known, or it moved anywhere.
    pub travel: Option<TravelDirection>,
    /// The outages that were made.
    pub outages: Vec<OutageScore>,
    /// What became of each aid.
    pub aids: BTreeMap<AidKind, AidSummary>,
    /// How long the position was worth what.
    pub validity: ValidityTimes,
    /// Faults of the inertial samples that were found and survived.
    pub faults: Vec<FaultRecord>,
    /// What was odd, one sentence each.
    pub issues: Vec<String>,
    /// Every parameter of the estimator as it ran, in the order of the tables.
    pub parameters: Vec<UsedParameter>,
    /// Version of the program.
    pub version: &'static str,
}
