//! GPX 1.1, one track of one segment, as most maps and navigation programs read it.
//!
//! GPX means heights above the geoid; ours are above the ellipsoid and differ from them by up to 100 m.

use std::path::Path;

use super::TrackPoint;
use super::text::{date, escaped};
use crate::atomic_file::AtomicFile;
use crate::error::Result;

pub(super) fn write(path: &Path, name: &str, points: &[TrackPoint], force: bool) -> Result<()> {
    let mut out = AtomicFile::create(path, force)?;
    let (name, version) = (escaped(name), env!("CARGO_PKG_VERSION"));
    out.print(format_args!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <gpx version=\"1.1\" creator=\"northing {version}\" xmlns=\"http://www.topografix.com/GPX/1/1\">\n\
         <trk>\n<name>{name}</name>\n<trkseg>\n"
    ))?;
    for point in points {
        let [latitude, longitude] = point.degrees();
        let height = point.height();
        let height = height.map_or(String::new(), |height| format!("<ele>{height:.3}</ele>"));
        let time = date(point.time_ns).map_or(String::new(), |date| format!("<time>{date}</time>"));
        out.print(format_args!(
            "<trkpt lat=\"{latitude:.9}\" lon=\"{longitude:.9}\">{height}{time}</trkpt>\n"
        ))?;
    }
    out.print(format_args!("</trkseg>\n</trk>\n</gpx>\n"))?;
    out.commit()
}
