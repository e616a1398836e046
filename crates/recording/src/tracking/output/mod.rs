//! Tracks of targets as files: tables, maps, messages of ROS 2, sentences of NMEA 0183.
//!
//! Read first: `docs/formats.md`, section "Tracks of targets".
//!
//! | file | what is in it |
//! |---|---|
//! | `row.rs` | the columns of a table, and a track's row |
//! | `csv.rs`, `parquet.rs` | the table: text, numbers |
//! | `map.rs` | a line for each track: GeoJSON, KML |
//! | `messages.rs` | `Odometry` and `NavSatFix` of each track in MCAP |
//! | `sentences.rs` | `TTM`, `TLL` and `RMC` for chart plotters |

mod csv;
mod map;
#[cfg(feature = "mcap")]
mod messages;
#[cfg(feature = "parquet")]
mod parquet;
mod row;
mod sentences;

use std::path::Path;

use super::LocalPlane;
use crate::error::{RecordingError, Result};

/// A target at an instant.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TargetPoint {
    /// Number of the track.
    pub track: u32,
    /// North and east in the local plane, m.
    pub place_m: [f64; 2],
    /// North and east, m/s.
    pub velocity_m_s: [f64; 2],
    /// Clockwise, rad/s.
    pub turn_rate_rad_s: f64,
    /// Covariance of north, its velocity, east, its velocity, and the turn rate; m, m/s, rad/s.
    pub covariance: [[f64; 5]; 5],
    /// Probability that there is a target.
    pub existence: f64,
    /// Probability that the sensor can see it, if there is one.
    pub visibility: f64,
    /// Probabilities of the motion models: straight, turning, manoeuvring.
    pub models: [f64; 3],
    /// Name of the sensor of the instant's last scan.
    pub sensor: String,
    /// Number of that scan in the recording, where it has one.
    pub scan: Option<i64>,
    /// Detections of that scan in the target's gate.
    pub detections_in_gate: usize,
    /// The likeliest of them, its index in the scan from 0, and the probability that the target caused it.
    pub detection: Option<(u32, f64)>,
    /// Probability that the target caused none.
    pub missed_probability: f64,
    /// Whether its target is there more likely than not: other tracks are only kept, in case they are seen again.
    pub is_reported: bool,
    /// Why the track ended after this instant, if it did.
    pub end: Option<String>,
}

impl TargetPoint {
    /// Variance of north, covariance, variance of east, m^2.
    fn place_covariance(&self) -> [f64; 3] {
        let p = &self.covariance;
        [p[0][0], p[0][2], p[2][2]]
    }
}

/// Every confirmed track at an instant.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TargetInstant {
    /// Stamp of the recording, ns.
    pub time_ns: i64,
    /// North and east of the own ship in the local plane, m.
    pub own_place_m: [f64; 2],
    /// The tracks.
    pub targets: Vec<TargetPoint>,
}

/// Which format a name asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Csv,
    Parquet,
    Mcap,
    GeoJson,
    Kml,
    Nmea,
}

const FORMATS: &str = "tracks of targets are written as .csv, .parquet, .mcap, .geojson, .kml or .nmea; name the output so";

fn kind(path: &Path, plane: Option<&LocalPlane>) -> Result<Kind> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let refused = |problem: &str| {
        Err(RecordingError::unsupported(
            path.display().to_string(),
            problem,
        ))
    };
    let kind = match extension.to_lowercase().as_str() {
        "csv" => Kind::Csv,
        "parquet" => Kind::Parquet,
        "mcap" => Kind::Mcap,
        "geojson" => Kind::GeoJson,
        "kml" => Kind::Kml,
        "nmea" => Kind::Nmea,
        _ => return refused(FORMATS),
    };
    match kind {
        Kind::Parquet if !cfg!(feature = "parquet") => {
            refused("this build cannot write Parquet; write .csv")
        }
        Kind::Mcap if !cfg!(feature = "mcap") => {
            refused("this build cannot write MCAP; write .csv")
        }
        Kind::GeoJson | Kind::Kml if plane.is_none() => refused(
            "a map needs latitudes and longitudes, and the recording does not tell where its plane is; add [plane] \
             with latitude_deg and longitude_deg to the manifest, or write .csv",
        ),
        kind => Ok(kind),
    }
}

/// Whether tracks of a recording with this plane can be written under that name.
///
/// # Errors
/// [`RecordingError::Unsupported`] with what can be written.
pub fn check_targets_path(path: &Path, plane: Option<&LocalPlane>) -> Result<()> {
    kind(path, plane).map(drop)
}

/// One format of an output.
trait TargetOutput {
    fn instant(&mut self, instant: &TargetInstant) -> Result<()>;
    fn finish(self: Box<Self>) -> Result<()>;
}

/// A file of tracks that is being written, in the format of its extension.
pub struct TargetWriter {
    output: Box<dyn TargetOutput>,
    /// The last instant: only the next tells which of its tracks ended.
    held: Option<TargetInstant>,
}

impl std::fmt::Debug for TargetWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut text = f.debug_struct("TargetWriter");
        text.field("held", &self.held).finish_non_exhaustive()
    }
}

impl TargetWriter {
    /// Starts the file; it appears under its name at [`Self::finish`]. `name` is what a map shows.
    ///
    /// # Errors
    /// As [`check_targets_path`]; [`RecordingError::Exists`] and [`RecordingError::Io`] as [`crate::AtomicFile`].
    pub fn create(
        path: &Path,
        name: &str,
        plane: Option<&LocalPlane>,
        force: bool,
    ) -> Result<Self> {
        let plane = plane.copied();
        let output: Box<dyn TargetOutput> = match (kind(path, plane.as_ref())?, plane) {
            #[cfg(feature = "parquet")]
            (Kind::Parquet, _) => Box::new(parquet::Table::create(path, plane, force)?),
            #[cfg(feature = "mcap")]
            (Kind::Mcap, _) => Box::new(messages::Messages::create(path, plane, force)?),
            (Kind::Nmea, _) => Box::new(sentences::Sentences::create(path, plane, force)?),
            (Kind::GeoJson, Some(plane)) => Box::new(map::Map::geojson(path, name, plane, force)?),
            (Kind::Kml, Some(plane)) => Box::new(map::Map::kml(path, name, plane, force)?),
            _ => Box::new(csv::Table::create(path, plane, force)?),
        };
        Ok(Self { output, held: None })
    }

    /// Adds an instant, later than the last, and the tracks of the last that ended since, each with the reason.
    ///
    /// # Errors
    /// The output refuses, or cannot hold the stamp.
    pub fn instant(&mut self, instant: TargetInstant, ended: &[(u32, String)]) -> Result<()> {
        if let Some(mut last) = self.held.replace(instant) {
            for target in &mut last.targets {
                let end = ended.iter().find(|(track, _)| *track == target.track);
                target.end = end.map(|(_, reason)| reason.clone());
            }
            self.output.instant(&last)?;
        }
        Ok(())
    }

    /// Completes the file.
    ///
    /// # Errors
    /// The output refuses.
    pub fn finish(mut self) -> Result<()> {
        if let Some(last) = self.held.take() {
            self.output.instant(&last)?;
        }
        self.output.finish()
    }
}

#[cfg(test)]
mod tests;
