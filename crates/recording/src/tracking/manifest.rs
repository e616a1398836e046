//! The TOML file that describes a tracking recording: tables, columns, sensors.
//!
//! Described with an example in `docs/formats.md`. Unknown keys are refused.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::ais::RADAR;
use super::plane::LocalPlane;
use crate::error::{RecordingError, Result};
use crate::text::toml_problem;

/// A manifest.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct TrackingManifest {
    /// Name of the recording.
    pub name: String,
    /// Origin of the local plane; needed when positions are latitude and longitude.
    pub plane: Option<LocalPlane>,
    /// The table of scans, one row a scan.
    pub scans: Option<ScanTable>,
    /// The table of detections, one row a detection.
    pub detections: Option<DetectionTable>,
    /// The table of true positions.
    pub truth: Option<TruthTable>,
    /// AIS reports.
    pub ais: Option<AisFile>,
    /// What each sensor is like, by its name in the table of scans (`ais` for AIS reports, `ttm` for a radar's targets in the same log).
    #[serde(default)]
    pub sensors: BTreeMap<String, SensorSettings>,
}

/// The table of scans.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct ScanTable {
    /// The file.
    pub file: PathBuf,
    /// Column of the scan's number.
    pub scan: String,
    /// Column of the time: s, or a date and time of day.
    pub time_s: String,
    /// Column of the sensor's name; without it all scans are of the only sensor.
    pub sensor: Option<String>,
    /// Column of the own ship's north, m; without it and the next one the own ship lies at the origin.
    pub own_north_m: Option<String>,
    /// Column of the own ship's east, m.
    pub own_east_m: Option<String>,
    /// Column of the own ship's heading, deg; without it detections are in north-east axes.
    pub own_heading_deg: Option<String>,
    /// Column of the standard deviation of the own ship's position on each axis, m.
    pub own_position_std_m: Option<String>,
    /// Column of the standard deviation of the own ship's heading, deg.
    pub own_heading_std_deg: Option<String>,
}

/// The table of detections. Of the four kinds a row is the first whose cells are not empty.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct DetectionTable {
    /// The file.
    pub file: PathBuf,
    /// Column of the scan's number.
    pub scan: String,
    /// Columns of range (m) and bearing (rad).
    pub range_m_bearing_rad: Option<[String; 2]>,
    /// Columns of north and east relative to the own ship, m.
    pub relative_north_east_m: Option<[String; 2]>,
    /// Columns of north and east in the local plane, m.
    pub north_east_m: Option<[String; 2]>,
    /// Column of a bearing without range, rad.
    pub bearing_rad: Option<String>,
}

/// The table of true positions.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct TruthTable {
    /// The file.
    pub file: PathBuf,
    /// Column of the scan's number.
    pub scan: String,
    /// Column of the target's number; without it there is one target, number 1.
    pub target: Option<String>,
    /// Column of the north, m.
    pub north_m: String,
    /// Column of the east, m.
    pub east_m: String,
    /// Standard deviation of the true positions on each axis, m: a receiver's error, or the way from its antenna to the echo.
    #[serde(default)]
    pub std_m: f64,
}

/// AIS reports: NMEA sentences, a radar's targets (`TTM`) among them, or a table of decoded reports.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct AisFile {
    /// The file.
    pub file: PathBuf,
    /// Columns of a table; without them the file holds NMEA sentences.
    pub columns: Option<AisColumns>,
}

/// Columns of decoded AIS reports.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct AisColumns {
    /// Column of the time: a date and time of day (`YYYY-MM-DD HH:MM:SS.fff`), or s.
    pub time: String,
    /// Column of the MMSI.
    pub mmsi: String,
    /// Column of the latitude, deg.
    pub latitude_deg: String,
    /// Column of the longitude, deg.
    pub longitude_deg: String,
    /// Column of the course over ground, deg.
    pub course_deg: Option<String>,
    /// Column of the speed over ground, knots.
    pub speed_knots: Option<String>,
}

/// What a sensor is like.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct SensorSettings {
    /// Standard deviation of a range, m.
    #[serde(default)]
    pub range_std_m: f64,
    /// Standard deviation of a bearing, deg.
    #[serde(default)]
    pub bearing_std_deg: f64,
    /// Standard deviation of the echo's place on the hull, or of a reported position, m.
    #[serde(default)]
    pub extent_std_m: f64,
    /// Probability that a visible target is detected in a scan.
    pub detection_probability: f64,
    /// False detections a scan in a square kilometre; for sensors that measure positions.
    pub clutter_per_km2: Option<f64>,
    /// False detections a scan in a radian; for sensors that measure bearings only.
    pub clutter_per_rad: Option<f64>,
    /// Range beyond which it detects nothing, m. Default: none.
    #[serde(default = "unlimited")]
    pub largest_range_m: f64,
    /// Whether a target that it did not report was missed. Default true; false for sensors that see
    /// only now and then, such as AIS.
    #[serde(default = "yes")]
    pub covers_all: bool,
    /// Whether its detections start tracks. Default true.
    #[serde(default = "yes")]
    pub initiates: bool,
    /// Whether it is used when the command does not choose. Default true.
    #[serde(default = "yes")]
    pub used: bool,
}

impl SensorSettings {
    /// Whether the range is limited.
    #[must_use]
    pub fn has_largest_range(&self) -> bool {
        self.largest_range_m < unlimited()
    }

    /// False detections in a square metre, or in a radian for sensors of bearings.
    #[must_use]
    pub fn clutter_density(&self) -> f64 {
        let per_m2 = self.clutter_per_km2.map(|density| density * 1e-6);
        self.clutter_per_rad.or(per_m2).unwrap_or(1e-6)
    }
}

fn unlimited() -> f64 {
    1e7
}

fn yes() -> bool {
    true
}

/// Parses a manifest; `file` stands for it in messages.
///
/// # Errors
/// [`RecordingError::Manifest`] with the line, and what was expected.
pub fn parse(text: &str, file: &str) -> Result<TrackingManifest> {
    let manifest: TrackingManifest = toml::from_str(text)
        .map_err(|error| RecordingError::manifest(file, toml_problem(text, &error)))?;
    check(&manifest).map_err(|what| RecordingError::manifest(file, what))?;
    Ok(manifest)
}

fn check(manifest: &TrackingManifest) -> std::result::Result<(), String> {
    if manifest.scans.is_none() && manifest.ais.is_none() {
        return Err("neither [scans] nor [ais]; a tracking recording needs one of them".to_owned());
    }
    if manifest.scans.is_none() && (manifest.detections.is_some() || manifest.truth.is_some()) {
        return Err("[detections] and [truth] refer to scans; add the table [scans]".to_owned());
    }
    let own = manifest
        .scans
        .as_ref()
        .map(|s| (&s.own_north_m, &s.own_east_m));
    if own.is_some_and(|(north, east)| north.is_some() != east.is_some()) {
        return Err(
            "[scans] has one of own_north_m and own_east_m; name the columns of both, or of none where the own ship stands at the origin"
                .to_owned(),
        );
    }
    let unnamed = manifest.scans.as_ref().is_some_and(|s| s.sensor.is_none());
    let is_log = manifest
        .ais
        .as_ref()
        .is_some_and(|ais| ais.columns.is_none());
    let of_log = |name: &str| name == "ais" || (name == RADAR && is_log);
    let scanning = manifest.sensors.keys().filter(|name| !of_log(name));
    if unnamed && scanning.count() != 1 {
        return Err(
            "[scans] names no `sensor` column, so there must be one [sensors.NAME] table"
                .to_owned(),
        );
    }
    if manifest.ais.is_some() {
        let radar = manifest.sensors.get(RADAR).filter(|_| is_log);
        if !manifest.sensors.contains_key("ais") && radar.is_none() {
            return Err(
                "[ais] needs [sensors.ais], or [sensors.ttm] for a radar's targets: extent_std_m, detection_probability, \
                 clutter_per_km2"
                    .to_owned(),
            );
        }
        if radar.is_some_and(|radar| radar.covers_all) {
            return Err(
                "[sensors.ttm] needs `covers_all = false`: a sentence tells of one target"
                    .to_owned(),
            );
        }
    }
    if manifest.ais.is_some() && !manifest.plane.is_some_and(|plane| plane.is_valid()) {
        return Err("[ais] needs [plane] with latitude_deg and longitude_deg on Earth".to_owned());
    }
    if let Some(truth) = &manifest.truth {
        let std = truth.std_m;
        if !(std.is_finite() && std >= 0.0) {
            return Err(format!(
                "[truth] std_m = {std}: a standard deviation is not negative"
            ));
        }
    }
    for (name, sensor) in &manifest.sensors {
        check_sensor(sensor).map_err(|what| format!("[sensors.{name}] {what}"))?;
    }
    Ok(())
}

fn check_sensor(s: &SensorSettings) -> std::result::Result<(), String> {
    let stds = [
        ("range_std_m", s.range_std_m),
        ("bearing_std_deg", s.bearing_std_deg),
        ("extent_std_m", s.extent_std_m),
    ];
    for (key, value) in stds {
        if !(value.is_finite() && value >= 0.0) {
            return Err(format!(
                "{key} = {value}: a standard deviation is not negative"
            ));
        }
    }
    if s.bearing_std_deg <= 0.0 && s.extent_std_m <= 0.0 {
        return Err("has no noise; give bearing_std_deg or extent_std_m above zero".to_owned());
    }
    if !(s.detection_probability > 0.0 && s.detection_probability < 1.0) {
        return Err(format!(
            "detection_probability = {}: must lie between 0 and 1; for a sensor that misses next to nothing write 0.99",
            s.detection_probability
        ));
    }
    let densities = [
        ("clutter_per_km2", s.clutter_per_km2),
        ("clutter_per_rad", s.clutter_per_rad),
    ];
    let given = densities.iter().filter(|(_, density)| density.is_some());
    if given.count() != 1 {
        return Err(
            "needs one of clutter_per_km2 and clutter_per_rad: false detections a scan".to_owned(),
        );
    }
    for (key, density) in densities {
        if let Some(density) = density.filter(|d| !(*d > 0.0 && d.is_finite())) {
            return Err(format!(
                "{key} = {density}: must be above 0; for a sensor with next to no false detections write a small number, such as 0.01"
            ));
        }
    }
    if s.largest_range_m.is_nan() || s.largest_range_m <= 0.0 {
        return Err(format!(
            "largest_range_m = {}: must be above 0",
            s.largest_range_m
        ));
    }
    Ok(())
}
