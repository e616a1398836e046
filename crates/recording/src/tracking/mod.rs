//! Recordings of targets: scans with detections, the own ship's pose, AIS reports, true positions.
//!
//! Beside the sample model of motion sensors and not inside it: a scan is a list of detections, which
//! is worth nothing without the pose from which it was taken, and an empty scan says something too.
//! [`TrackingSample`] is the sample model of this kind of recording. It is held in memory: an hour of
//! radar is a few megabytes.
//!
//! | file | what is in it |
//! |---|---|
//! | [`sample`] | [`TrackingEvent`], [`TrackingSample`], [`Detection`] |
//! | [`manifest`] | the TOML file that says which tables hold what, and what the sensors are like |
//! | `tables.rs` | scans, detections and truth from delimited text |
//! | `table_writer.rs` | a recording as such a manifest with its tables |
//! | `ais.rs` | AIS reports and own-ship positions from tables and NMEA sentences |
//! | `ttm.rs` | a radar's targets as NMEA sentences |
//! | `plane.rs` | latitude and longitude to the local plane |
//! | `plausibility.rs` | gross errors of units, clocks and columns |

mod ais;
pub mod manifest;
mod output;
mod plane;
mod plausibility;
pub mod sample;
mod table_writer;
mod tables;
mod ttm;

use std::path::Path;

pub use ais::Sentences;
pub use manifest::{SensorSettings, TrackingManifest};
pub use output::{TargetInstant, TargetPoint, TargetWriter, check_targets_path};
pub use plane::LocalPlane;
pub use sample::{AisReport, Detection, OwnShipPose, Scan, TargetTruth, TrackingEvent};
pub use sample::{TrackingIssues, TrackingSample};
pub use table_writer::write_tables;

use crate::error::{RecordingError, Result};
use crate::limits::TRACKING_EVENTS;
use crate::text::read_manifest;

/// A recording of targets.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackingRecording {
    /// Its name.
    pub name: String,
    /// Where its local plane touches the Earth, if that is told.
    pub plane: Option<LocalPlane>,
    /// The sensors; scans name them by their place here.
    pub sensors: Vec<(String, SensorSettings)>,
    /// Everything that happened, in time order; of one instant first the own ship's pose, then
    /// detections and reports, then the truth.
    pub events: Vec<TrackingEvent>,
    /// Standard deviation of the true positions on each axis, m.
    pub truth_std_m: f64,
    /// What was left out, counted.
    pub issues: TrackingIssues,
}

impl TrackingRecording {
    /// Adds an event from `file`.
    fn add(&mut self, event: TrackingEvent, file: &str) -> Result<()> {
        self.events.push(event);
        TRACKING_EVENTS.check(self.events.len() as u64, file, "")
    }
}

/// Opens the recording that the manifest at `path` describes. Its files are found in `data`, or
/// without it beside the manifest.
///
/// # Errors
/// The manifest is wrong, a file is missing, or a cell does not hold what its column promises; the
/// message names file, line and column.
pub fn open(path: &Path, data: Option<&Path>) -> Result<TrackingRecording> {
    let manifest = read_manifest(path).and_then(|(text, file)| manifest::parse(&text, &file));
    let manifest = manifest.map_err(|error| no_manifest(path, error))?;
    let file = path.display().to_string();
    let beside = path.parent().unwrap_or(Path::new(""));
    read(&manifest, &file, data.unwrap_or(beside))
}

/// The complaint about a file that is no manifest by its name either.
fn no_manifest(path: &Path, error: RecordingError) -> RecordingError {
    let is_named = path.extension().is_some_and(|name| name == "toml");
    if is_named || matches!(error, RecordingError::Io { .. }) {
        return error;
    }
    RecordingError::unsupported(
        path.display().to_string(),
        "not a manifest; targets are read through a manifest (.toml) that names the tables of scans and detections, or the log of AIS \
         reports, and says what the sensors are like: write one as docs/formats.md, Targets, describes it",
    )
}

/// How often the time goes back from one event of a file to the next. The truth has a file of its own.
fn going_back(events: &[TrackingEvent]) -> u64 {
    let seen = events
        .iter()
        .filter(|event| !matches!(event.sample, TrackingSample::Truth(_)));
    let times: Vec<i64> = seen.map(|event| event.time_ns).collect();
    times.windows(2).filter(|pair| pair[1] < pair[0]).count() as u64
}

/// Reads the tables of a manifest from a folder.
///
/// # Errors
/// As [`open`].
pub fn read(manifest: &TrackingManifest, file: &str, folder: &Path) -> Result<TrackingRecording> {
    let mut recording = TrackingRecording {
        name: manifest.name.clone(),
        plane: manifest.plane,
        sensors: manifest
            .sensors
            .iter()
            .map(|(name, settings)| (name.clone(), *settings))
            .collect(),
        events: Vec::new(),
        truth_std_m: manifest.truth.as_ref().map_or(0.0, |truth| truth.std_m),
        issues: TrackingIssues::default(),
    };
    if let Some(scans) = &manifest.scans {
        tables::read(manifest, scans, file, folder, &mut recording)?;
        recording.issues.out_of_time_order += going_back(&recording.events);
    }
    let from_tables = recording.events.len();
    if let Some(ais) = &manifest.ais {
        ais::read(manifest, ais, file, folder, &mut recording)?;
        recording.issues.out_of_time_order += going_back(&recording.events[from_tables..]);
        if let Some(plane) = &recording.plane {
            let log = plausibility::file_of(folder, &ais.file);
            plausibility::reports(&log, ais, plane, &recording.events[from_tables..])?;
        }
    }
    // Stable: events of one instant keep the order pose, detections, truth.
    recording
        .events
        .sort_by_key(|event| (event.time_ns, event.sample.order()));
    if recording.events.is_empty() {
        return Err(RecordingError::empty(
            file,
            "no scan and no report in its files",
            "at least one",
        ));
    }
    plausibility::spans(&mut recording);
    Ok(recording)
}
