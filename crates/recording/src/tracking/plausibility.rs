//! Gross errors of units, clocks and columns in recordings of targets: what cannot be is refused, what may be is said.

use std::fmt::Write as _;
use std::path::Path;

use chrono::DateTime;

use super::manifest::{AisFile, ScanTable, SensorSettings};
use super::plane::LocalPlane;
use super::sample::{Detection, OwnShipPose, TrackingEvent, TrackingSample};
use super::{TrackingIssues, TrackingRecording};
use crate::error::{RecordingError, Result, shown};
use crate::stamp::format_s;

/// From so many on, what all of them have in common is no chance.
const ENOUGH: usize = 10;

fn implausible(
    file: &str,
    sensor: &'static str,
    evidence: String,
    hint: &'static str,
) -> RecordingError {
    RecordingError::ImplausibleUnit {
        file: file.to_owned(),
        sensor,
        evidence,
        hint,
    }
}

/// The bearings of one column, as they were written.
#[derive(Debug, Clone, Copy)]
pub(super) struct Bearings {
    count: u64,
    beyond: u64,
    least: f64,
    most: f64,
}

impl Default for Bearings {
    fn default() -> Self {
        Self {
            count: 0,
            beyond: 0,
            least: f64::INFINITY,
            most: f64::NEG_INFINITY,
        }
    }
}

impl Bearings {
    /// More than a full turn either way, with room for rounding.
    const TURN: f64 = std::f64::consts::TAU + 0.01;
    /// More than any bearing in degrees. A bearing beyond counts its turns.
    const MOST_DEG: f64 = 400.0;

    pub(super) fn take(&mut self, bearing: f64) {
        if bearing.is_finite() {
            self.count += 1;
            self.beyond += u64::from(bearing.abs() > Self::TURN);
            self.least = self.least.min(bearing);
            self.most = self.most.max(bearing);
        }
    }

    /// Refuses degrees: of bearings all around 98 % are beyond a full turn of radians, of a camera's within 30 degrees of the bow 79 %, where of
    /// radians none is, but for one that counts on past a turn. A tenth is between the two. Those that are beyond and yet within two turns of each
    /// other may be radians with turns added, which is said only.
    pub(super) fn check(
        &self,
        file: &str,
        column: &str,
        issues: &mut TrackingIssues,
    ) -> Result<()> {
        if self.beyond == 0 || 10 * self.beyond < self.count {
            return Ok(());
        }
        let largest = self.most.abs().max(self.least.abs());
        let evidence = format!(
            "column `{}`: {} of {} are beyond a full turn of 2 pi, the largest is {:.1}; expected radians, clockwise from the bow",
            shown(column),
            self.beyond,
            self.count,
            largest
        );
        if largest > Self::MOST_DEG || self.most - self.least <= 2.0 * Self::TURN {
            issues.remarks.push(format!("bearings in {evidence}"));
            return Ok(());
        }
        let hint = "these look like degrees: multiply the column by pi / 180";
        Err(implausible(file, "bearings", evidence, hint))
    }
}

/// Where the own ship was and how it headed, as written in its table.
#[derive(Debug, Clone, Copy)]
pub(super) struct OwnPoint {
    pub(super) time_ns: i64,
    pub(super) place: [f64; 2],
    pub(super) position_std_m: f64,
    pub(super) heading: f64,
}

/// Refuses headings in radians in a column of degrees, where the course made good says so.
///
/// Nothing is said below 1 m/s, where a current alone makes a course. A ship that moves does not go sideways: its course and its heading
/// differ by its leeway, less than 20 degrees, and read in the wrong unit by more than 30 and more than three times as much.
pub(super) fn heading_unit(file: &str, column: &str, mut own: Vec<OwnPoint>) -> Result<()> {
    let most = std::f64::consts::TAU + 0.01;
    own.retain(|point| point.place.iter().all(|x| x.is_finite()) && point.heading.is_finite());
    if own.iter().any(|point| point.heading.abs() > most) {
        return Ok(());
    }
    own.sort_by_key(|point| point.time_ns);
    let mut squares = [0.0; 2];
    let mut legs = 0_usize;
    let mut from = 0;
    for to in 1..own.len() {
        let (first, last) = (&own[from], &own[to]);
        let [north, east] = [0, 1].map(|axis| last.place[axis] - first.place[axis]);
        // The errors of both ends turn a leg of ten of them by 8 degrees.
        let leg_m = 10.0 * first.position_std_m.max(last.position_std_m).max(1.0);
        if north.hypot(east) < leg_m {
            continue;
        }
        let seconds = (last.time_ns - first.time_ns) as f64 * 1e-9;
        if north.hypot(east) >= seconds {
            let (course, heading) = (east.atan2(north), own[usize::midpoint(from, to)].heading);
            for (sum, heading) in squares.iter_mut().zip([heading.to_radians(), heading]) {
                let (sin, cos) = (course - heading).sin_cos();
                *sum += sin.atan2(cos).powi(2);
            }
            legs += 1;
        }
        from = to;
    }
    if legs < ENOUGH {
        return Ok(());
    }
    let [degrees, radians] = squares.map(|sum| (sum / legs as f64).sqrt().to_degrees());
    if radians < 20.0 && degrees > 30.0 && degrees > 3.0 * radians {
        let evidence = format!(
            "column `{}`: the course made good is {degrees:.0} deg (RMS) off the heading in degrees, and {radians:.0} deg off it in radians",
            shown(column)
        );
        let hint = "these look like radians: multiply the column by 180 / pi (own_heading_deg)";
        return Err(implausible(file, "own heading", evidence, hint));
    }
    Ok(())
}

/// The times of the scans of each sensor: refuses a clock that stands, and remarks on one that runs a thousand times too fast.
pub(super) fn scan_times(
    file: &str,
    scans: &ScanTable,
    times: Vec<Vec<i64>>,
    out: &mut TrackingRecording,
) -> Result<()> {
    /// A radar turns in seconds; between two scans a minute apart targets are not followed.
    const LONG_S: f64 = 60.0;
    let column = shown(&scans.time_s);
    for (mut times, (name, settings)) in times.into_iter().zip(&out.sensors) {
        times.sort_unstable();
        let name = shown(name);
        let [Some(first), Some(last)] = [times.first(), times.last()] else {
            continue;
        };
        if times.len() >= ENOUGH && first == last {
            let evidence = format!(
                "column `{column}`: all {} scans of {name} are of one time, {} s; a track is followed from one time to the next",
                times.len(),
                format_s(*first)
            );
            let hint = "write the time of each scan, with the fractions of a second";
            return Err(implausible(file, "time", evidence, hint));
        }
        let gaps = times
            .windows(2)
            .map(|pair| (pair[1] - pair[0]) as f64 * 1e-9);
        let Some(apart_s) = median(gaps.collect()) else {
            continue;
        };
        if settings.covers_all && apart_s > LONG_S {
            out.issues.remarks.push(format!(
                "the scans of {name} are {apart_s:.0} s apart (median of column `{column}`): milliseconds under the name of seconds?"
            ));
        }
    }
    Ok(())
}

/// The ranges of each sensor against what is stated of it: refuses kilometres and miles, and remarks on a limit below what was seen.
pub(super) fn ranges(file: &str, out: &mut TrackingRecording) -> Result<()> {
    let mut own = OwnShipPose::default();
    let mut ranges: Vec<Vec<f64>> = vec![Vec::new(); out.sensors.len()];
    for event in &out.events {
        match &event.sample {
            TrackingSample::OwnShip(pose) => own = *pose,
            TrackingSample::Scan(scan) => {
                let seen = scan.detections.iter().filter_map(|d| range_of(d, &own));
                ranges[scan.sensor].extend(seen);
            }
            _ => {}
        }
    }
    for ((name, settings), ranges) in out.sensors.iter().zip(&ranges) {
        if ranges.is_empty() {
            continue;
        }
        let (name, largest) = (shown(name), ranges.iter().copied().fold(0.0, f64::max));
        refuse_ranges_of_noise(file, &name, settings, ranges, largest)?;
        let limit = settings.largest_range_m;
        let beyond = ranges.iter().filter(|range| **range > limit).count();
        // A few are rounding or noise at the edge; most are another limit.
        if settings.has_largest_range() && 2 * beyond > ranges.len() {
            let number = if beyond == ranges.len() {
                format!("all {beyond}")
            } else {
                format!("{beyond} of {}", ranges.len())
            };
            out.issues.remarks.push(format!(
                "{number} detections of {name} lie beyond its largest_range_m of {limit} m, the farthest at {largest:.0} m"
            ));
        }
    }
    Ok(())
}

/// Refuses ranges that are all smaller than their own standard deviation.
fn refuse_ranges_of_noise(
    file: &str,
    name: &str,
    settings: &SensorSettings,
    ranges: &[f64],
    largest: f64,
) -> Result<()> {
    // Of negative ones the tracker skips each, and counts it.
    if ranges.len() < ENOUGH || largest >= settings.range_std_m || largest <= 0.0 {
        return Ok(());
    }
    let evidence = format!(
        "all {} detections of {name} are nearer than its range_std_m of {} m, the farthest at {largest:.3}",
        ranges.len(),
        settings.range_std_m
    );
    let hint = "if these are kilometres or nautical miles, multiply by 1000 or 1852; else state a smaller range_std_m";
    Err(implausible(file, "ranges", evidence, hint))
}

fn range_of(detection: &Detection, own: &OwnShipPose) -> Option<f64> {
    let range = match *detection {
        Detection::RangeBearing { range_m, .. } => range_m,
        Detection::Relative { north_m, east_m } => north_m.hypot(east_m),
        Detection::Placed { north_m, east_m } => (north_m - own.north_m).hypot(east_m - own.east_m),
        Detection::Bearing { .. } => return None,
    };
    range.is_finite().then_some(range)
}

/// Latitudes and longitudes that were exchanged, where that is seen by a latitude beyond a pole.
#[derive(Debug, Default, Clone, Copy)]
pub(super) struct Latitudes {
    count: u64,
    impossible: u64,
}

impl Latitudes {
    pub(super) fn take(&mut self, [latitude, longitude]: [f64; 2]) {
        self.count += 1;
        // 91 and 181 degrees mean "not available".
        let is_longitude = latitude.abs() > 91.5 && latitude.abs() <= 180.0;
        self.impossible += u64::from(is_longitude && longitude.abs() <= 90.0);
    }

    pub(super) fn check(&self, file: &str, column: &str) -> Result<()> {
        if 2 * self.impossible <= self.count {
            return Ok(());
        }
        let evidence = format!(
            "column `{}`: {} of {} latitudes are beyond 90 deg, with longitudes within 90",
            shown(column),
            self.impossible,
            self.count
        );
        Err(implausible(file, "AIS reports", evidence, EXCHANGE))
    }
}

const EXCHANGE: &str = "exchange the columns latitude_deg and longitude_deg in the manifest";

/// Refuses reports on another continent than the plane.
pub(super) fn reports(
    file: &str,
    wanted: &AisFile,
    plane: &LocalPlane,
    events: &[TrackingEvent],
) -> Result<()> {
    /// A receiver hears ships within some hundred kilometres, and the plane is good for some ten.
    const FAR_M: f64 = 1e6;
    let (mut away, mut exchanged) = (Vec::new(), Vec::new());
    for event in events {
        let TrackingSample::Ais(report) = &event.sample else {
            continue;
        };
        away.push(report.north_m.hypot(report.east_m));
        let [latitude, longitude] = plane.degrees(report.north_m, report.east_m);
        let (north, east) = plane.place(longitude, latitude);
        exchanged.push(north.hypot(east));
    }
    let (Some(away), Some(exchanged)) = (median(away), median(exchanged)) else {
        return Ok(());
    };
    if away <= FAR_M {
        return Ok(());
    }
    let mut evidence = format!(
        "they are about {:.0} km from [plane] (median), where a plane is no map",
        away * 1e-3
    );
    let mut hint = "correct latitude_deg and longitude_deg of [plane]";
    if exchanged < 0.1 * away
        && let Some(columns) = &wanted.columns
    {
        let _ = write!(
            evidence,
            ", and {:.0} km with columns `{}` and `{}` exchanged",
            exchanged * 1e-3,
            shown(&columns.latitude_deg),
            shown(&columns.longitude_deg)
        );
        hint = EXCHANGE;
    }
    Err(implausible(file, "AIS reports", evidence, hint))
}

/// Remarks on sensors of which one had ended before another began.
pub(super) fn spans(out: &mut TrackingRecording) {
    let ais = out.sensors.iter().position(|(name, _)| name == "ais");
    let mut spans: Vec<Option<[i64; 2]>> = vec![None; out.sensors.len()];
    for event in &out.events {
        let sensor = match &event.sample {
            TrackingSample::Scan(scan) => Some(scan.sensor),
            TrackingSample::Ais(_) => ais,
            _ => None,
        };
        if let Some(span) = sensor.and_then(|sensor| spans.get_mut(sensor)) {
            let [first, _] = span.unwrap_or([event.time_ns; 2]);
            *span = Some([first, event.time_ns]);
        }
    }
    let names = out.sensors.iter().map(|(name, _)| shown(name));
    let mut known: Vec<_> = names
        .zip(spans)
        .filter_map(|(n, s)| Some((n, s?)))
        .collect();
    known.sort_by_key(|(_, [first, _])| *first);
    let last_begins = known.last().map(|(_, [first, _])| *first);
    let ends_first = known.iter().map(|(_, [_, last])| *last).min();
    if last_begins <= ends_first {
        return;
    }
    let each = known.iter().map(|(name, [first, last])| {
        format!("{name} from {} to {}", instant(*first), instant(*last))
    });
    out.issues.remarks.push(format!(
        "the sensors' times do not overlap: {}; is one of them of another time zone or clock?",
        each.collect::<Vec<_>>().join(", ")
    ));
}

/// A time for readers: a date where it is one, or seconds.
fn instant(time_ns: i64) -> String {
    /// September 2001; clocks that begin with a recording or a day do not get there.
    const DATE_NS: i64 = 1_000_000_000_000_000_000;
    if time_ns < DATE_NS {
        return format!("{} s", format_s(time_ns));
    }
    let date = DateTime::from_timestamp_nanos(time_ns);
    date.format("%Y-%m-%d %H:%M:%S").to_string()
}

/// The file of a table as messages name it.
pub(super) fn file_of(folder: &Path, name: &Path) -> String {
    folder.join(name).display().to_string()
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
