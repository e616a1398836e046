//! Tracks of targets as files: CSV with a row for each track and instant, GeoJSON with a line for each track.
//!
//! Read first: `docs/formats.md`, section "Tracks of targets".

use std::collections::BTreeMap;
use std::path::Path;

use serde_json::{Value, json};

use super::LocalPlane;
use crate::atomic_file::{AtomicFile, write_whole};
use crate::error::{RecordingError, Result};
use crate::stamp::format_s;
use crate::track::text::date;

/// A target at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetPoint {
    /// Stamp of the recording, ns.
    pub time_ns: i64,
    /// Number of the track.
    pub track: u32,
    /// North and east in the local plane, m.
    pub place_m: [f64; 2],
    /// North and east, m/s.
    pub velocity_m_s: [f64; 2],
    /// Variance of north, covariance, variance of east, m^2.
    pub place_covariance_m2: [f64; 3],
    /// The same of the velocity, (m/s)^2.
    pub velocity_covariance_m2_s2: [f64; 3],
}

/// The columns of the CSV.
const COLUMNS: &str = "t_s,track,north_m,east_m,vel_n_m_s,vel_e_m_s,cov_nn_m2,cov_ne_m2,cov_ee_m2,\
     vel_cov_nn_m2_s2,vel_cov_ne_m2_s2,vel_cov_ee_m2_s2";

/// Which format a name asks for.
enum Kind {
    Csv,
    GeoJson,
}

fn kind(path: &Path, plane: Option<&LocalPlane>) -> Result<Kind> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    let refused = |problem: &str| {
        let file = path.display().to_string();
        Err(RecordingError::unsupported(file, problem))
    };
    match (extension.to_lowercase().as_str(), plane) {
        ("csv", _) => Ok(Kind::Csv),
        ("geojson", Some(_)) => Ok(Kind::GeoJson),
        ("geojson", None) => refused(
            "GeoJSON needs latitudes and longitudes, and the recording does not tell where its plane is; add [plane] \
             with latitude_deg and longitude_deg to the manifest, or write .csv",
        ),
        _ => refused("tracks of targets are written as .csv or .geojson; name the output so"),
    }
}

/// Whether tracks of a recording with this plane can be written under that name.
///
/// # Errors
/// [`RecordingError::Unsupported`] with what can be written.
pub fn check_targets_path(path: &Path, plane: Option<&LocalPlane>) -> Result<()> {
    kind(path, plane).map(drop)
}

/// Writes tracks, points in time order: `.csv` or `.geojson` by the extension. Without a point the CSV has its header alone
/// and the collection no feature.
///
/// # Errors
/// As [`check_targets_path`]; [`RecordingError::Exists`] and [`RecordingError::Io`] as [`AtomicFile`].
pub fn write_targets(
    path: &Path,
    name: &str,
    plane: Option<&LocalPlane>,
    points: &[TargetPoint],
    force: bool,
) -> Result<()> {
    match (kind(path, plane)?, plane) {
        (Kind::GeoJson, Some(plane)) => {
            let text = format!("{}\n", geojson(name, plane, points));
            write_whole(path, text.as_bytes(), force)
        }
        _ => csv(path, plane, points, force),
    }
}

fn csv(path: &Path, plane: Option<&LocalPlane>, points: &[TargetPoint], force: bool) -> Result<()> {
    let mut out = AtomicFile::create(path, force)?;
    let degrees = if plane.is_some() {
        ",latitude_deg,longitude_deg"
    } else {
        ""
    };
    out.print(format_args!("{COLUMNS}{degrees}\n"))?;
    for point in points {
        out.print(format_args!("{},{}", format_s(point.time_ns), point.track))?;
        let numbers = [point.place_m, point.velocity_m_s].concat();
        let covariances = [point.place_covariance_m2, point.velocity_covariance_m2_s2].concat();
        for number in numbers.iter().chain(&covariances) {
            out.print(format_args!(",{number}"))?;
        }
        if let Some(plane) = plane {
            let [latitude, longitude] = plane.degrees(point.place_m[0], point.place_m[1]);
            out.print(format_args!(",{latitude:.9},{longitude:.9}"))?;
        }
        out.print(format_args!("\n"))?;
    }
    out.commit()
}

fn geojson(name: &str, plane: &LocalPlane, points: &[TargetPoint]) -> Value {
    let mut tracks: BTreeMap<u32, Vec<&TargetPoint>> = BTreeMap::new();
    for point in points {
        tracks.entry(point.track).or_default().push(point);
    }
    let features: Vec<Value> = tracks
        .into_iter()
        .map(|(track, points)| feature(name, plane, track, &points))
        .collect();
    json!({ "type": "FeatureCollection", "features": features })
}

/// A line; of a single instant a point.
fn feature(name: &str, plane: &LocalPlane, track: u32, points: &[&TargetPoint]) -> Value {
    let rounded = |degrees: f64| (degrees * 1e9).round() / 1e9;
    let coordinates: Vec<[f64; 2]> = points
        .iter()
        .map(|point| {
            let [latitude, longitude] = plane.degrees(point.place_m[0], point.place_m[1]);
            [rounded(longitude), rounded(latitude)]
        })
        .collect();
    let geometry = match &coordinates[..] {
        [point] => json!({ "type": "Point", "coordinates": point }),
        line => json!({ "type": "LineString", "coordinates": line }),
    };
    let times_s: Vec<f64> = points.iter().map(|p| p.time_ns as f64 * 1e-9).collect();
    let std_ne_m: Vec<[f64; 2]> = points
        .iter()
        .map(|p| {
            [
                p.place_covariance_m2[0].sqrt(),
                p.place_covariance_m2[2].sqrt(),
            ]
        })
        .collect();
    let mut properties = json!({
        "name": format!("{name}, track {track}"), "track": track, "times_s": times_s, "std_ne_m": std_ne_m,
    });
    if let (Some(first), Some(last)) = (points.first(), points.last())
        && let (Some(first), Some(last)) = (date(first.time_ns), date(last.time_ns))
    {
        properties["start"] = json!(first);
        properties["end"] = json!(last);
    }
    json!({ "type": "Feature", "geometry": geometry, "properties": properties })
}
