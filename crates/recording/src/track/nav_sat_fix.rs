//! An MCAP file of ROS 2 messages `sensor_msgs/NavSatFix` on `/fix` (feature `mcap`), for Foxglove's map.
//!
//! Read first: the comments in the message definition. Covariance is east, north, up.

use std::collections::BTreeMap;
use std::path::Path;

use ::mcap::records::{MessageHeader, Metadata as McapMetadata};
use ::mcap::{McapError, WriteOptions};

use super::TrackPoint;
use crate::atomic_file::AtomicFile;
use crate::error::{RecordingError, Result};
use crate::mcap::nav_sat_fix::{DEFINITION, NAME, encode};

pub(super) fn write(path: &Path, name: &str, points: &[TrackPoint], force: bool) -> Result<()> {
    let file = path.display().to_string();
    let failed = |error| match error {
        McapError::Io(error) => RecordingError::io(&file, "write it", error),
        other => RecordingError::io(&file, "write it", std::io::Error::other(other)),
    };
    let options = WriteOptions::new()
        .compression(None)
        .profile("ros2")
        .disable_seeking(true)
        .library(format!("northing {}", env!("CARGO_PKG_VERSION")));
    let mut out = options
        .create(AtomicFile::create(path, force)?)
        .map_err(failed)?;
    let facts = BTreeMap::from([("name".to_owned(), name.to_owned())]);
    let begun = out
        .write_metadata(&McapMetadata {
            name: "northing".to_owned(),
            metadata: facts,
        })
        .and_then(|()| out.add_schema(NAME, "ros2msg", DEFINITION.as_bytes()))
        .and_then(|schema| out.add_channel(schema, "/fix", "cdr", &BTreeMap::new()));
    let channel_id = begun.map_err(failed)?;
    for (sequence, point) in points.iter().enumerate() {
        let bytes = encode(point).ok_or_else(|| RecordingError::Unsupported {
            file: file.clone(),
            problem: "a stamp is beyond the 68 years that ROS can hold; write .geojson".to_owned(),
        })?;
        let time = u64::try_from(point.time_ns).unwrap_or(0);
        let header = MessageHeader {
            channel_id,
            sequence: u32::try_from(sequence).unwrap_or(u32::MAX),
            log_time: time,
            publish_time: time,
        };
        out.write_to_known_channel(&header, &bytes)
            .map_err(failed)?;
    }
    out.finish().map_err(failed)?;
    out.into_inner().commit()
}
