//! A TUM trajectory: metres north, east and down of the first point, and attitude.

use std::path::Path;

use nalgebra::UnitQuaternion;
use northing_core::earth::{Geodetic, LocalFrame};

use super::TrackPoint;
use crate::error::Result;
use crate::metadata::WorldFrame;
use crate::tum_writer::TumWriter;

pub(super) fn write(path: &Path, points: &[TrackPoint], force: bool) -> Result<()> {
    let mut out = TumWriter::create(path, WorldFrame::Ned, force)?;
    let mut frame = None;
    for point in points {
        let place = Geodetic {
            latitude_rad: point.latitude_rad,
            longitude_rad: point.longitude_rad,
            // A trajectory has three coordinates: of an unknown height the last one is 0.
            height_m: point.height().unwrap_or_default(),
        };
        let frame = frame.get_or_insert_with(|| LocalFrame::new(place));
        let attitude = point.attitude.unwrap_or(UnitQuaternion::identity());
        out.write(point.time_ns, &frame.ned(&place), &attitude)?;
    }
    out.finish()
}
