//! Writes estimates of a run as an MCAP file of ROS 2 messages, for Foxglove, `evo` and ROS itself.
//!
//! Topics: `/imu/data` (`Imu` with nothing but the orientation), `/tf` (`TFMessage`), `/odometry` (`Odometry`) where there is a
//! position, `/gps/filtered` (`NavSatFix`) where the place on the Earth is known.

use std::collections::BTreeMap;
use std::path::Path;

use ::mcap::McapError;

use super::estimate_messages::{EstimateTopic, FrameNames, messages};
use super::output::{Output, io_error, options};
use crate::atomic_file::AtomicFile;
use crate::error::{RecordingError, Result};
use crate::pose::PoseEstimate;

/// A file of estimates.
pub struct EstimateWriter {
    output: Output<AtomicFile, EstimateTopic>,
    file: String,
}

impl EstimateWriter {
    /// Creates the file; it appears under its name at [`Self::finish`].
    ///
    /// # Errors
    /// As [`AtomicFile::create`].
    pub fn create(path: &Path, force: bool) -> Result<Self> {
        let file = path.display().to_string();
        let output = AtomicFile::create(path, force)?;
        let output = Output::new(output, options().profile("ros2"), BTreeMap::new())
            .map_err(|error| failed(&file, error))?;
        Ok(Self { output, file })
    }

    /// Adds an estimate.
    ///
    /// # Errors
    /// The output refuses, or the stamp is beyond the 68 years that ROS can hold.
    pub fn write(&mut self, estimate: &PoseEstimate) -> Result<()> {
        for (topic, bytes) in messages(estimate, &FrameNames::default()) {
            self.message(topic, estimate.time_ns, bytes)?;
        }
        Ok(())
    }

    fn message(
        &mut self,
        topic: EstimateTopic,
        time_ns: i64,
        bytes: Option<Vec<u8>>,
    ) -> Result<()> {
        let bytes = bytes.ok_or_else(|| {
            RecordingError::unsupported(
                &self.file,
                "a stamp is beyond the 68 years that ROS can hold; write .csv",
            )
        })?;
        let written = self
            .output
            .ros_message(topic, time_ns, &bytes, &topic.told());
        written.map_err(|error| failed(&self.file, error))
    }

    /// Completes the file.
    ///
    /// # Errors
    /// The output refuses.
    pub fn finish(mut self) -> Result<()> {
        let finished = self.output.finish();
        finished.map_err(|error| failed(&self.file, error))?;
        self.output.into_inner().commit()
    }
}

impl std::fmt::Debug for EstimateWriter {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let mut text = f.debug_struct("EstimateWriter");
        text.field("file", &self.file).finish_non_exhaustive()
    }
}

fn failed(file: &str, error: McapError) -> RecordingError {
    RecordingError::io(file, "write it", io_error(error))
}
