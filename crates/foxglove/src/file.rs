//! A run as an MCAP file of Foxglove's messages: the topics that a server shows, all at once.

use std::path::{Path, PathBuf};

use foxglove::{Context, FoxgloveError, McapWriter};
use northing_recording::{AtomicFile, RecordingError};

use crate::played_run::PlayedRun;
use crate::topics::Topics;

/// What stops a file from being written.
#[derive(Debug, thiserror::Error)]
pub enum FileError {
    /// The file cannot be made.
    #[error(transparent)]
    Output(#[from] RecordingError),
    /// The writer refuses.
    #[error("{file}: cannot write it: {why}")]
    Writer {
        /// The file.
        file: String,
        /// Why.
        why: FoxgloveError,
    },
}

/// A file that appears under its name when it is written whole.
#[derive(Debug)]
pub struct RunFile {
    output: AtomicFile,
    path: PathBuf,
}

impl RunFile {
    /// Begins it; one that exists is refused unless `force`.
    ///
    /// # Errors
    /// As [`AtomicFile::create`].
    pub fn create(path: &Path, force: bool) -> Result<Self, FileError> {
        Ok(Self {
            output: AtomicFile::create(path, force)?,
            path: path.to_owned(),
        })
    }

    /// Where it is.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes everything that was told, the body named `base_link`.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn write(self, run: &PlayedRun) -> Result<(), FileError> {
        let file = self.path.display().to_string();
        let failed = |why| FileError::Writer {
            file: file.clone(),
            why,
        };
        let context = Context::new();
        let writer = McapWriter::new().context(&context).create(self.output);
        let writer = writer.map_err(failed)?;
        let mut topics = Topics::new(context, "", "base_link");
        for (time_ns, told) in run.all() {
            topics.publish(*time_ns, told, true);
        }
        writer.close().map_err(failed)?.commit()?;
        Ok(())
    }
}
