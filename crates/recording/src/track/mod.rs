//! Tracks of positions for maps and viewers: KML, GPX, GeoJSON, TUM, MCAP (`NavSatFix`).
//!
//! Read first: `docs/formats.md`. One file a format; [`write_track`] chooses by the extension.

mod geojson;
mod gpx;
mod kml;
#[cfg(feature = "mcap")]
mod nav_sat_fix;
pub(crate) mod text;
mod tum;

use std::path::Path;

pub(crate) use kml::write_kml;
use nalgebra::UnitQuaternion;

use crate::error::{RecordingError, Result};

/// One point of a track.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackPoint {
    /// Stamp of the recording, ns. From 2000 on it is taken as UTC and written where a format has
    /// times; smaller ones (seconds of a week, since power-on) are no date.
    pub time_ns: i64,
    /// Geodetic latitude, rad.
    pub latitude_rad: f64,
    /// Longitude, rad.
    pub longitude_rad: f64,
    /// Height above the ellipsoid, m; NaN where it is not known, which is then left out of what is written.
    pub height_m: f64,
    /// Standard deviations north, east and down, m.
    pub std_m: Option<[f64; 3]>,
    /// `ned_from_body`.
    pub attitude: Option<UnitQuaternion<f64>>,
}

/// The extensions that are known.
const EXTENSIONS: &str = ".kml, .gpx, .geojson, .tum or .mcap";

/// Whether the extension of a file says that [`write_track`] can write it.
///
/// # Errors
/// [`RecordingError::Unsupported`] with the extensions that it can.
pub fn check_track_path(path: &Path) -> Result<()> {
    match extension(path).as_str() {
        "kml" | "gpx" | "geojson" | "tum" => Ok(()),
        #[cfg(feature = "mcap")]
        "mcap" => Ok(()),
        #[cfg(not(feature = "mcap"))]
        "mcap" => Err(unsupported(
            path,
            "this build cannot write MCAP; build with `--features mcap`, or write .geojson",
        )),
        _ => Err(unsupported(
            path,
            &format!("tracks are written as {EXTENSIONS}; name the output so"),
        )),
    }
}

/// Writes a track: `.kml`, `.gpx`, `.geojson`, `.tum` or `.mcap` by its extension. `name` is what a map
/// shows. Points whose place is not finite are left out.
///
/// # Errors
/// As [`check_track_path`]; [`RecordingError::Empty`] without a point; [`RecordingError::Exists`] and
/// [`RecordingError::Io`] as [`crate::AtomicFile`].
pub fn write_track(path: &Path, name: &str, points: &[TrackPoint], force: bool) -> Result<()> {
    check_track_path(path)?;
    let finite: Vec<TrackPoint> = points.iter().filter(|p| p.is_finite()).copied().collect();
    if finite.is_empty() {
        return Err(RecordingError::empty(
            path.display().to_string(),
            "no position",
            "at least one point of a track",
        ));
    }
    match extension(path).as_str() {
        "kml" => kml::write(path, name, &finite, force),
        "gpx" => gpx::write(path, name, &finite, force),
        "geojson" => geojson::write(path, name, &finite, force),
        #[cfg(feature = "mcap")]
        "mcap" => nav_sat_fix::write(path, name, &finite, force),
        _ => tum::write(path, &finite, force),
    }
}

impl TrackPoint {
    fn is_finite(&self) -> bool {
        let place = [self.latitude_rad, self.longitude_rad];
        place.iter().all(|x| x.is_finite()) && !self.height_m.is_infinite()
    }

    /// Height, m, where it is known.
    fn height(&self) -> Option<f64> {
        self.height_m.is_finite().then_some(self.height_m)
    }

    /// Latitude and longitude in degrees, the longitude within 180.
    fn degrees(&self) -> [f64; 2] {
        let longitude = self.longitude_rad.to_degrees();
        let wrapped = (longitude + 180.0).rem_euclid(360.0) - 180.0;
        [self.latitude_rad.to_degrees(), wrapped]
    }
}

fn extension(path: &Path) -> String {
    path.extension()
        .map(|extension| extension.to_string_lossy().to_lowercase())
        .unwrap_or_default()
}

fn unsupported(path: &Path, problem: &str) -> RecordingError {
    RecordingError::unsupported(path.display().to_string(), problem)
}

#[cfg(test)]
mod tests;
