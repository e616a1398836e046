//! GeoJSON (RFC 7946): one `LineString` with the stamps and standard deviations of its points beside it.
//!
//! A track of one point is a `Point`, since a line needs two.

use std::path::Path;

use serde_json::json;

use super::TrackPoint;
use super::text::date;
use crate::atomic_file::write_whole;
use crate::error::Result;

pub(super) fn write(path: &Path, name: &str, points: &[TrackPoint], force: bool) -> Result<()> {
    let coordinates: Vec<Vec<f64>> = points
        .iter()
        .map(|point| {
            let [latitude, longitude] = point.degrees();
            let mut place = vec![rounded(longitude, 1e9), rounded(latitude, 1e9)];
            place.extend(point.height().map(|height| rounded(height, 1e4)));
            place
        })
        .collect();
    let geometry = match &coordinates[..] {
        [point] => json!({ "type": "Point", "coordinates": point }),
        line => json!({ "type": "LineString", "coordinates": line }),
    };
    let times_s: Vec<f64> = points.iter().map(|p| p.time_ns as f64 * 1e-9).collect();
    let mut properties = json!({ "name": name, "times_s": times_s });
    let stds: Option<Vec<[f64; 3]>> = points.iter().map(|point| point.std_m).collect();
    if let Some(stds) = stds {
        properties["std_ned_m"] = json!(stds);
    }
    if let (Some(first), Some(last)) = (points.first(), points.last())
        && let (Some(first), Some(last)) = (date(first.time_ns), date(last.time_ns))
    {
        properties["start"] = json!(first);
        properties["end"] = json!(last);
    }
    let feature = json!({ "type": "Feature", "geometry": geometry, "properties": properties });
    let collection = json!({ "type": "FeatureCollection", "features": [feature] });
    write_whole(path, format!("{collection}\n").as_bytes(), force)
}

/// Digits below a tenth of a millimetre only make the file long.
fn rounded(x: f64, scale: f64) -> f64 {
    (x * scale).round() / scale
}
