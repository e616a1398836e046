//! KML 2.2 for Google Earth and other maps: a line, with times where the stamps are dates.
//!
//! The line lies on the ground, since KML counts heights from the sea and we from the ellipsoid; the
//! heights are in the coordinates all the same.

use std::path::Path;

use super::TrackPoint;
use super::text::{date, escaped};
use crate::atomic_file::AtomicFile;
use crate::error::Result;

/// Writes one track.
pub(super) fn write(path: &Path, name: &str, points: &[TrackPoint], force: bool) -> Result<()> {
    write_all(path, name, std::iter::once((name, points)), force)
}

/// Writes several tracks, each with its name.
///
/// # Errors
/// As [`AtomicFile`].
pub(crate) fn write_kml(
    path: &Path,
    name: &str,
    tracks: &[(String, Vec<TrackPoint>)],
    force: bool,
) -> Result<()> {
    let each = tracks.iter();
    let each = each.map(|(name, points)| (name.as_str(), points.as_slice()));
    write_all(path, name, each, force)
}

fn write_all<'a>(
    path: &Path,
    name: &str,
    tracks: impl Iterator<Item = (&'a str, &'a [TrackPoint])>,
    force: bool,
) -> Result<()> {
    let mut out = AtomicFile::create(path, force)?;
    let name = escaped(name);
    out.print(format_args!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <kml xmlns=\"http://www.opengis.net/kml/2.2\" xmlns:gx=\"http://www.google.com/kml/ext/2.2\">\n\
         <Document>\n<name>{name}</name>\n\
         <Style id=\"track\"><LineStyle><color>ff0055ff</color><width>3</width></LineStyle></Style>\n"
    ))?;
    for (name, points) in tracks {
        let name = escaped(name);
        out.print(format_args!(
            "<Placemark>\n<name>{name}</name>\n<styleUrl>#track</styleUrl>\n"
        ))?;
        let dates: Option<Vec<String>> = points.iter().map(|point| date(point.time_ns)).collect();
        match dates {
            Some(dates) => timed(&mut out, points, &dates)?,
            None => line(&mut out, points)?,
        }
        out.print(format_args!("</Placemark>\n"))?;
    }
    out.print(format_args!("</Document>\n</kml>\n"))?;
    out.commit()
}

fn timed(out: &mut AtomicFile, points: &[TrackPoint], dates: &[String]) -> Result<()> {
    out.print(format_args!(
        "<gx:Track>\n<altitudeMode>clampToGround</altitudeMode>\n"
    ))?;
    for date in dates {
        out.print(format_args!("<when>{date}</when>\n"))?;
    }
    for point in points {
        let [latitude, longitude] = point.degrees();
        let height = height(point, ' ');
        out.print(format_args!(
            "<gx:coord>{longitude:.9} {latitude:.9}{height}</gx:coord>\n"
        ))?;
    }
    out.print(format_args!("</gx:Track>\n"))
}

fn line(out: &mut AtomicFile, points: &[TrackPoint]) -> Result<()> {
    out.print(format_args!(
        "<LineString>\n<tessellate>1</tessellate>\n<altitudeMode>clampToGround</altitudeMode>\n<coordinates>\n"
    ))?;
    for point in points {
        let [latitude, longitude] = point.degrees();
        let height = height(point, ',');
        out.print(format_args!("{longitude:.9},{latitude:.9}{height}\n"))?;
    }
    out.print(format_args!("</coordinates>\n</LineString>\n"))
}

/// The height behind its separator; nothing where it is not known.
fn height(point: &TrackPoint, separator: char) -> String {
    let height = point.height();
    height.map_or(String::new(), |height| format!("{separator}{height:.3}"))
}
