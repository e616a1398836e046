//! Tracks as sentences of NMEA 0183, which chart plotters read: `TTM` (range and bearing from the own ship, speed, course, closest
//! approach), and where the place on the Earth is known `TLL` (latitude and longitude) and the own ship's `RMC`.
//!
//! A target's number has two digits, so it is that of the track modulo 100; its name is that of the track whole. The own ship's
//! velocity is that over the last seconds; before there is one there is no closest approach.

use std::collections::VecDeque;
use std::fmt::Write as _;
use std::path::Path;

use chrono::{DateTime, Utc};

use super::super::LocalPlane;
use super::super::ttm::NAUTICAL_MILE_M as MILE_M;
use super::{TargetInstant, TargetOutput, TargetPoint};
use crate::atomic_file::AtomicFile;
use crate::error::Result;
use crate::track::text::date;

/// Knots of a metre per second.
const KNOTS: f64 = 3600.0 / MILE_M;

/// Over so long the own ship's velocity is taken (ns): fixes of a satellite receiver are metres off, each in its own way.
const VELOCITY_OVER_NS: i64 = 10_000_000_000;

pub(super) struct Sentences {
    out: AtomicFile,
    plane: Option<LocalPlane>,
    /// Times and places where the own ship was seen to be, the oldest first, and its velocity over them.
    seen: VecDeque<(i64, [f64; 2])>,
    own_velocity: Option<[f64; 2]>,
}

impl Sentences {
    pub(super) fn create(path: &Path, plane: Option<LocalPlane>, force: bool) -> Result<Self> {
        Ok(Self {
            out: AtomicFile::create(path, force)?,
            plane,
            seen: VecDeque::new(),
            own_velocity: None,
        })
    }

    /// Writes what stands between `$` and `*`.
    fn sentence(&mut self, body: &str) -> Result<()> {
        let sum = body.bytes().fold(0, |sum, byte| sum ^ byte);
        self.out.print(format_args!("${body}*{sum:02X}\r\n"))
    }

    fn see_own_ship(&mut self, instant: &TargetInstant) {
        let now_ns = instant.time_ns;
        // A report of a target comes with the place of the own ship that was known before: not a place of this instant.
        let is_here =
            |place: &[f64; 2]| place.map(f64::to_bits) == instant.own_place_m.map(f64::to_bits);
        let last = self.seen.back();
        let is_known = last.is_some_and(|(last_ns, place)| now_ns <= *last_ns || is_here(place));
        if !is_known {
            self.seen.push_back((now_ns, instant.own_place_m));
        }
        // As many as lie within the time, and at least two.
        while (self.seen.get(1)).is_some_and(|(from_ns, _)| now_ns - from_ns >= VELOCITY_OVER_NS) {
            self.seen.pop_front();
        }
        self.own_velocity = self.fitted_velocity(now_ns);
    }

    /// The slope of a straight line through the places by least squares. What was seen at one place only, for longer, stands; of a ship that
    /// was not seen for longer nothing is known.
    fn fitted_velocity(&self, now_ns: i64) -> Option<[f64; 2]> {
        let (last_ns, _) = self.seen.back()?;
        if now_ns - last_ns > VELOCITY_OVER_NS {
            return (self.seen.len() == 1).then_some([0.0; 2]);
        }
        let count = self.seen.len() as f64;
        let time = |ns: i64| (ns - last_ns) as f64 * 1e-9;
        let mean = self.seen.iter().map(|(ns, _)| time(*ns)).sum::<f64>() / count;
        let (mut squares, mut slopes) = (0.0, [0.0; 2]);
        for (ns, place) in &self.seen {
            let off = time(*ns) - mean;
            squares += off * off;
            slopes[0] += off * place[0];
            slopes[1] += off * place[1];
        }
        (squares > 0.0).then(|| slopes.map(|slope| slope / squares))
    }

    fn own_ship(&mut self, instant: &TargetInstant) -> Result<()> {
        let (Some(plane), Some(time)) = (self.plane, utc(instant.time_ns)) else {
            return Ok(());
        };
        let place = degrees_and_minutes(&plane, instant.own_place_m);
        let motion = self.own_velocity.map_or(",".to_owned(), |[north, east]| {
            format!(
                "{:.2},{:.1}",
                north.hypot(east) * KNOTS,
                azimuth(north, east)
            )
        });
        self.sentence(&format!(
            "INRMC,{},A,{place},{motion},{},,",
            time_of_day(&time),
            time.format("%d%m%y"),
        ))
    }

    fn target(&mut self, instant: &TargetInstant, target: &TargetPoint) -> Result<()> {
        let number = target.track % 100;
        let is_lost = target.end.is_some() || !target.is_reported;
        let status = if is_lost { 'L' } else { 'T' };
        let time = utc(instant.time_ns).map_or(String::new(), |time| time_of_day(&time));
        let way = [0, 1].map(|i| target.place_m[i] - instant.own_place_m[i]);
        let mut text = format!("RATTM,{number:02},");
        let [north, east] = target.velocity_m_s;
        let _ = write!(
            text,
            "{:.3},{:.1},T,{:.1},{:.1},T,{},N,T{},{status},,{time},A",
            way[0].hypot(way[1]) / MILE_M,
            azimuth(way[0], way[1]),
            north.hypot(east) * KNOTS,
            azimuth(north, east),
            self.closest_approach(way, target.velocity_m_s),
            target.track,
        );
        self.sentence(&text)?;
        if let Some(plane) = self.plane {
            let place = degrees_and_minutes(&plane, target.place_m);
            let track = target.track;
            self.sentence(&format!(
                "RATLL,{number:02},{place},T{track},{time},{status},"
            ))?;
        }
        Ok(())
    }

    /// Distance (nautical miles) and time (minutes, negative when it is past); empty where the own ship's velocity is not known
    /// or both move alike.
    fn closest_approach(&self, way: [f64; 2], velocity: [f64; 2]) -> String {
        let relative = self
            .own_velocity
            .map(|own| [velocity[0] - own[0], velocity[1] - own[1]]);
        let Some([north, east]) = relative.filter(|v| v[0].hypot(v[1]) > 0.0) else {
            return ",".to_owned();
        };
        let time_s = -(way[0] * north + way[1] * east) / (north * north + east * east);
        let distance_m = (way[0] + north * time_s).hypot(way[1] + east * time_s);
        // A field has room for so much: what approaches in more than two months does not.
        let minutes = (time_s / 60.0).clamp(-99_999.0, 99_999.0);
        format!("{:.3},{minutes:.1}", distance_m / MILE_M)
    }
}

impl TargetOutput for Sentences {
    fn instant(&mut self, instant: &TargetInstant) -> Result<()> {
        self.see_own_ship(instant);
        self.own_ship(instant)?;
        let mut each = instant.targets.iter();
        each.try_for_each(|target| self.target(instant, target))
    }

    fn finish(self: Box<Self>) -> Result<()> {
        self.out.commit()
    }
}

/// The stamp as time, where it is one.
fn utc(time_ns: i64) -> Option<DateTime<Utc>> {
    date(time_ns).map(|_| DateTime::from_timestamp_nanos(time_ns))
}

/// `hhmmss.ss`.
fn time_of_day(time: &DateTime<Utc>) -> String {
    let hundredths = time.timestamp_subsec_millis() / 10;
    format!("{}.{:02}", time.format("%H%M%S"), hundredths.min(99))
}

/// Clockwise from north, in degrees from 0 to below 360 when written with one decimal.
fn azimuth(north: f64, east: f64) -> f64 {
    let degrees = east.atan2(north).to_degrees().rem_euclid(360.0);
    if degrees < 359.95 { degrees } else { 0.0 }
}

/// `ddmm.mmmmm,N,dddmm.mmmmm,E`.
pub(super) fn degrees_and_minutes(plane: &LocalPlane, [north, east]: [f64; 2]) -> String {
    let [latitude, longitude] = plane.degrees(north, east);
    let parts = |degrees: f64| {
        // In whole hundred-thousandths of a minute, so that no minute is written as 60.
        let units = (degrees.abs() * 60e5).round();
        let whole = (units / 60e5).floor();
        (whole, (units - whole * 60e5) / 1e5)
    };
    let ((lat, lat_min), (lon, lon_min)) = (parts(latitude), parts(longitude));
    let ns = if latitude < 0.0 { 'S' } else { 'N' };
    let ew = if longitude < 0.0 { 'W' } else { 'E' };
    format!("{lat:02}{lat_min:08.5},{ns},{lon:03}{lon_min:08.5},{ew}")
}
