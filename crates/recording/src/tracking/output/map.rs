//! A line for each track on a map: GeoJSON with times and standard deviations, KML with times.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::super::LocalPlane;
use super::{TargetInstant, TargetOutput, TargetPoint};
use crate::atomic_file::{AtomicFile, write_whole};
use crate::error::Result;
use crate::track::text::date;
use crate::track::{TrackPoint, write_kml};

/// What a map shows of a track.
#[derive(Default)]
struct Line {
    points: Vec<MapPoint>,
    end: Option<String>,
}

struct MapPoint {
    time_ns: i64,
    /// Latitude and longitude.
    degrees: [f64; 2],
    /// North and east, m.
    std_m: [f64; 2],
}

/// Every track, until the end: a line is written whole.
pub(super) struct Map {
    path: PathBuf,
    name: String,
    plane: LocalPlane,
    force: bool,
    kml: bool,
    lines: BTreeMap<u32, Line>,
}

impl Map {
    pub(super) fn geojson(path: &Path, name: &str, plane: LocalPlane, force: bool) -> Result<Self> {
        // Starting the file is the test whether it can be written; dropped, it leaves nothing behind.
        AtomicFile::create(path, force)?;
        Ok(Self {
            path: path.to_owned(),
            name: name.to_owned(),
            plane,
            force,
            kml: false,
            lines: BTreeMap::new(),
        })
    }

    pub(super) fn kml(path: &Path, name: &str, plane: LocalPlane, force: bool) -> Result<Self> {
        let map = Self::geojson(path, name, plane, force)?;
        Ok(Self { kml: true, ..map })
    }

    fn point(&self, time_ns: i64, target: &TargetPoint) -> MapPoint {
        let [nn, _, ee] = target.place_covariance();
        MapPoint {
            time_ns,
            degrees: self.plane.degrees(target.place_m[0], target.place_m[1]),
            std_m: [nn.sqrt(), ee.sqrt()],
        }
    }

    fn title(&self, track: u32) -> String {
        format!("{}, track {track}", self.name)
    }

    fn feature(&self, track: u32, line: &Line) -> Value {
        let rounded = |degrees: f64| (degrees * 1e9).round() / 1e9;
        let each = line.points.iter();
        let coordinates: Vec<[f64; 2]> = (each.clone())
            .map(|point| [rounded(point.degrees[1]), rounded(point.degrees[0])])
            .collect();
        let geometry = match &coordinates[..] {
            [point] => json!({ "type": "Point", "coordinates": point }),
            line => json!({ "type": "LineString", "coordinates": line }),
        };
        let times_s: Vec<f64> = each.clone().map(|p| p.time_ns as f64 * 1e-9).collect();
        let std_ne_m: Vec<[f64; 2]> = each.map(|point| point.std_m).collect();
        let mut properties = json!({
            "name": self.title(track), "track": track, "times_s": times_s, "std_ne_m": std_ne_m,
            "ended_because": line.end,
        });
        if let (Some(first), Some(last)) = (line.points.first(), line.points.last())
            && let (Some(first), Some(last)) = (date(first.time_ns), date(last.time_ns))
        {
            properties["start"] = json!(first);
            properties["end"] = json!(last);
        }
        json!({ "type": "Feature", "geometry": geometry, "properties": properties })
    }

    fn write_kml(&self) -> Result<()> {
        let tracks = self.lines.iter().map(|(track, line)| {
            let points = line.points.iter().map(|point| TrackPoint {
                time_ns: point.time_ns,
                latitude_rad: point.degrees[0].to_radians(),
                longitude_rad: point.degrees[1].to_radians(),
                height_m: f64::NAN,
                std_m: None,
                attitude: None,
            });
            (self.title(*track), points.collect())
        });
        let tracks: Vec<(String, Vec<TrackPoint>)> = tracks.collect();
        write_kml(&self.path, &self.name, &tracks, self.force)
    }
}

impl TargetOutput for Map {
    fn instant(&mut self, instant: &TargetInstant) -> Result<()> {
        for target in &instant.targets {
            let point = self.point(instant.time_ns, target);
            let line = self.lines.entry(target.track).or_default();
            line.points.extend(target.is_reported.then_some(point));
            line.end.clone_from(&target.end);
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> Result<()> {
        self.lines.retain(|_, line| !line.points.is_empty());
        if self.kml {
            return self.write_kml();
        }
        let each = self.lines.iter();
        let features: Vec<Value> = each
            .map(|(track, line)| self.feature(*track, line))
            .collect();
        let collection = json!({ "type": "FeatureCollection", "features": features });
        let text = format!("{collection}\n");
        write_whole(&self.path, text.as_bytes(), self.force)
    }
}
