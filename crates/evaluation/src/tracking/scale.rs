//! What a recording says of its scale: how its sensor sees the scene, and how far apart its targets are.
//!
//! From it follow the tracker's settings that nobody gave ([`SensorScale`]) and the distance beyond which a track is no track of a target.

use std::collections::HashMap;

use northing_core::tracking::{ScanSensor, SensorScale};
use northing_recording::tracking::{
    Detection, OwnShipPose, SensorSettings, TrackingRecording, TrackingSample,
};

use super::matching::{Place, distance};

/// The cut-off, in standard deviations of a detection's position.
const CUTOFF_SIGMAS: f64 = 4.0;

/// How one sensor looks at a scene.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SensorLooks {
    /// What it is like.
    pub sensor: ScanSensor<f64>,
    /// Time from one look to the next, or between two reports of one ship, s, where it looks more than once.
    pub scan_interval_s: Option<f64>,
    /// Range to which it sees, m, where that is known.
    pub range_m: Option<f64>,
}

impl SensorLooks {
    /// Whether tracks begin with its detections: they have a position.
    #[must_use]
    pub fn starts_tracks(&self) -> bool {
        self.sensor.initiates && self.position_std_m() > 0.0
    }

    fn position_std_m(&self) -> f64 {
        let noise = &self.sensor.noise;
        noise.range_std_m.hypot(noise.extent_std_m)
    }

    /// How the sensor that starts tracks sees the scene: the one that looks most rarely, because a target has to be followed from one of
    /// its looks to the next. `None` where no sensor starts tracks, none looks twice, or its range is unknown.
    #[must_use]
    pub fn scale(used: &[Self]) -> Option<SensorScale<f64>> {
        let candidates: Vec<&Self> = used.iter().filter(|one| one.starts_tracks()).collect();
        let covering = |one: &&Self| one.sensor.covers_all;
        // A sensor that sees only now and then says less of how targets move between two looks.
        let some: Vec<&Self> = match candidates.iter().copied().filter(covering).collect() {
            none if Vec::is_empty(&none) => candidates,
            covering => covering,
        };
        let intervals = some
            .into_iter()
            .filter_map(|one| Some((one, one.scan_interval_s?)));
        let (one, scan_interval_s) = intervals.max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(SensorScale {
            scan_interval_s,
            position_std_m: one.position_std_m(),
            range_m: one.range_m?,
            clutter_density: one.sensor.clutter_density,
        })
    }
}

/// How the sensors of a recording look, those that are used.
pub(super) fn looks(
    recording: &TrackingRecording,
    used: &[Option<ScanSensor<f64>>],
) -> Vec<SensorLooks> {
    let each = used.iter().enumerate();
    each.filter_map(|(place, sensor)| {
        Some(SensorLooks {
            sensor: (*sensor)?,
            scan_interval_s: interval_s(recording, place),
            range_m: range_m(recording, place),
        })
    })
    .collect()
}

/// Median time between two scans of a sensor, or between two reports of one ship, s.
fn interval_s(recording: &TrackingRecording, sensor: usize) -> Option<f64> {
    let is_ais = recording.sensors[sensor].0 == "ais";
    let mut before = HashMap::<u32, i64>::new();
    let mut times = Vec::new();
    for event in &recording.events {
        let who = match &event.sample {
            TrackingSample::Scan(scan) if scan.sensor == sensor => 0,
            TrackingSample::Ais(report) if is_ais => report.mmsi,
            _ => continue,
        };
        if let Some(before) = before.insert(who, event.time_ns) {
            times.push((event.time_ns - before) as f64 * 1e-9);
        }
    }
    times.retain(|seconds| *seconds > 0.0);
    quantile(times, 0.5)
}

/// Range to which a sensor sees: what is stated of it, or else of what it saw, the farthest twentieth left out; of reports, their distance from
/// the own ship, which is at the plane's origin where the recording does not have it.
fn range_m(recording: &TrackingRecording, sensor: usize) -> Option<f64> {
    let (name, settings) = &recording.sensors[sensor];
    if settings.has_largest_range() {
        return Some(settings.largest_range_m);
    }
    let mut own = OwnShipPose::default();
    let mut ranges = Vec::new();
    for event in &recording.events {
        match &event.sample {
            TrackingSample::OwnShip(pose) => own = *pose,
            TrackingSample::Scan(scan) if scan.sensor == sensor => {
                ranges.extend(scan.detections.iter().filter_map(|d| range_of(d, &own)));
            }
            TrackingSample::Ais(report) if name == "ais" => {
                ranges.push(from_own([report.north_m, report.east_m], &own));
            }
            _ => {}
        }
    }
    ranges.retain(|range| range.is_finite());
    quantile(ranges, 0.95)
}

fn range_of(detection: &Detection, own: &OwnShipPose) -> Option<f64> {
    match *detection {
        Detection::RangeBearing { range_m, .. } => Some(range_m),
        Detection::Relative { north_m, east_m } => Some(north_m.hypot(east_m)),
        Detection::Placed { north_m, east_m } => Some(from_own([north_m, east_m], own)),
        _ => None,
    }
}

fn from_own(place: Place, own: &OwnShipPose) -> f64 {
    distance(place, [own.north_m, own.east_m])
}

/// Distance beyond which a track is no track of a target, m: four standard deviations of a detection's position where the targets are, of the
/// true positions too; where targets are closer together half their spacing, but no less than two standard deviations. `None` without true
/// positions.
pub(super) fn cutoff_m(recording: &TrackingRecording, used: &[bool]) -> Option<f64> {
    let mut own = OwnShipPose::default();
    let mut sensor_of = HashMap::<i64, usize>::new();
    let mut at_once: (i64, Vec<Place>) = (i64::MIN, Vec::new());
    let (mut squares, mut spacings) = (Vec::new(), Vec::new());
    for event in &recording.events {
        match &event.sample {
            TrackingSample::OwnShip(pose) => own = *pose,
            TrackingSample::Scan(scan) if used.get(scan.sensor) == Some(&true) => {
                sensor_of.insert(scan.id, scan.sensor);
            }
            TrackingSample::Truth(truth) => {
                let Some(sensor) = sensor_of.get(&truth.scan) else {
                    continue;
                };
                let place = [truth.north_m, truth.east_m];
                let settings = &recording.sensors[*sensor].1;
                squares.push(variance(settings, from_own(place, &own)));
                if at_once.0 != truth.scan {
                    spacings.extend(nearest(&at_once.1));
                    at_once = (truth.scan, Vec::new());
                }
                at_once.1.push(place);
            }
            _ => {}
        }
    }
    spacings.extend(nearest(&at_once.1));
    // A pose without numbers, whose scan is refused, says nothing of the distance.
    squares.retain(|square| square.is_finite());
    let known = 2.0 * recording.truth_std_m * recording.truth_std_m;
    let mean = squares.iter().sum::<f64>() / squares.len() as f64;
    let std = (mean + known).sqrt();
    let room = quantile(spacings, 0.5).map_or(f64::INFINITY, |spacing| 0.5 * spacing);
    let cutoff = (CUTOFF_SIGMAS * std).min(room.max(2.0 * std));
    (cutoff.is_finite() && cutoff > 0.0).then_some(cutoff)
}

/// Variance of a detection's position over both axes, m^2.
fn variance(settings: &SensorSettings, range_m: f64) -> f64 {
    let across = range_m * settings.bearing_std_deg.to_radians();
    let extent = settings.extent_std_m;
    settings.range_std_m.powi(2) + across.powi(2) + 2.0 * extent * extent
}

/// Distance of each place from the nearest other one.
fn nearest(places: &[Place]) -> Vec<f64> {
    let mut sorted = places.to_vec();
    sorted.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let nearest_of = |(i, place): (usize, &Place)| {
        let mut least = f64::INFINITY;
        // Sorted by north: what comes later, or before, is farther still.
        for other in &sorted[i + 1..] {
            if other[0] - place[0] > least {
                break;
            }
            least = least.min(distance(*place, *other));
        }
        for other in sorted[..i].iter().rev() {
            if place[0] - other[0] > least {
                break;
            }
            least = least.min(distance(*place, *other));
        }
        least
    };
    let each = sorted.iter().enumerate().map(nearest_of);
    each.filter(|apart| apart.is_finite()).collect()
}

fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    Some(values[(share * last as f64).round() as usize])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_neighbour_of_each() {
        let places = [[0.0, 0.0], [0.0, 30.0], [3.0, 34.0], [100.0, 0.0]];
        let mut apart = nearest(&places);
        apart.sort_by(f64::total_cmp);
        assert_eq!(apart[..3], [5.0, 5.0, 30.0]);
        assert!((apart[3] - 100.0).abs() < 1e-9);
        assert!(nearest(&places[..1]).is_empty() && nearest(&[]).is_empty());
    }

    #[test]
    fn quantiles() {
        assert_eq!(quantile(vec![3.0, 1.0, 2.0], 0.5), Some(2.0));
        assert_eq!(quantile(Vec::new(), 0.5), None);
    }
}
