//! An MCAP file of ROS 2 messages `sensor_msgs/NavSatFix` on `/fix` (feature `mcap`), for Foxglove's map.
//!
//! Read first: the comments in the message definition. Covariance is east, north, up.

use std::collections::BTreeMap;
use std::path::Path;

use super::TrackPoint;
use crate::atomic_file::AtomicFile;
use crate::error::{RecordingError, Result};
use crate::mcap::nav_sat_fix::{DEFINITION, NAME, encode};
use crate::mcap::output::{NO_FACTS, Output, RosTopic, io_error, options};

pub(super) fn write(path: &Path, name: &str, points: &[TrackPoint], force: bool) -> Result<()> {
    let file = path.display().to_string();
    let failed = |error| RecordingError::io(&file, "write it", io_error(error));
    let facts = BTreeMap::from([("name".to_owned(), name.to_owned())]);
    let output = AtomicFile::create(path, force)?;
    let mut out = Output::new(output, options().profile("ros2"), facts).map_err(failed)?;
    let topic = RosTopic {
        name: "/fix",
        schema: NAME,
        definition: DEFINITION,
        facts: &NO_FACTS,
    };
    for point in points {
        let bytes = encode(point).ok_or_else(|| {
            RecordingError::unsupported(
                &file,
                "a stamp is beyond the 68 years that ROS can hold; write .geojson",
            )
        })?;
        out.ros_message((), point.time_ns, &bytes, &topic)
            .map_err(failed)?;
    }
    out.finish().map_err(failed)?;
    out.into_inner().commit()
}
