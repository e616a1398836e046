//! Output files that appear whole or not at all.

use std::fmt::Arguments;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::error::{RecordingError, Result};

/// A file being written under a temporary name in the target's folder. [`AtomicFile::commit`] gives
/// it its name; dropped before that, it leaves nothing behind.
#[derive(Debug)]
pub struct AtomicFile {
    path: PathBuf,
    force: bool,
    output: BufWriter<NamedTempFile>,
}

impl AtomicFile {
    /// Starts the file. An existing one is refused unless `force`, and stays as it is until the commit.
    ///
    /// # Errors
    /// [`RecordingError::Exists`]; [`RecordingError::Io`] when the folder is missing or not writable.
    pub fn create(path: &Path, force: bool) -> Result<Self> {
        let file = path.display().to_string();
        let failed = |error| RecordingError::io(&file, "write it", error);
        let refused = |kind, why: &str| Err(failed(io::Error::new(kind, why)));
        if path.is_dir() {
            return refused(
                io::ErrorKind::IsADirectory,
                "it is a folder; name a file in it",
            );
        }
        if path.metadata().is_ok_and(|found| !found.is_file()) {
            return refused(
                io::ErrorKind::InvalidInput,
                "it is a device or a pipe and not a file; name a file",
            );
        }
        if !force && path.symlink_metadata().is_ok() {
            return Err(RecordingError::Exists { file });
        }
        let folder = match path.parent() {
            Some(folder) if !folder.as_os_str().is_empty() => folder,
            _ => Path::new("."),
        };
        if !folder.is_dir() {
            return refused(
                io::ErrorKind::NotFound,
                &format!(
                    "the folder `{}` does not exist; make it first",
                    folder.display()
                ),
            );
        }
        let temporary = temporary_in(folder).map_err(failed)?;
        Ok(Self {
            path: path.to_owned(),
            force,
            output: BufWriter::with_capacity(1 << 16, temporary),
        })
    }

    /// Writes what `format_args!` gives, with this file's name in the error.
    ///
    /// # Errors
    /// [`RecordingError::Io`], e.g. when the disk is full.
    pub fn print(&mut self, text: Arguments<'_>) -> Result<()> {
        self.output
            .write_fmt(text)
            .map_err(|error| self.failed(error))
    }

    /// Writes bytes, with this file's name in the error.
    ///
    /// # Errors
    /// As [`AtomicFile::print`].
    pub fn bytes(&mut self, bytes: &[u8]) -> Result<()> {
        self.output
            .write_all(bytes)
            .map_err(|error| self.failed(error))
    }

    /// Finishes the file and gives it its name.
    ///
    /// # Errors
    /// [`RecordingError::Exists`] when the name has been taken meanwhile; [`RecordingError::Io`].
    pub fn commit(self) -> Result<()> {
        let file = self.path.display().to_string();
        let failed = |error| RecordingError::io(&file, "write it", error);
        let temporary = self
            .output
            .into_inner()
            .map_err(|error| failed(error.into_error()))?;
        if self.force {
            temporary
                .persist(&self.path)
                .map_err(|error| failed(error.error))?;
            return Ok(());
        }
        match temporary.persist_noclobber(&self.path) {
            Ok(_) => Ok(()),
            Err(error) if error.error.kind() == io::ErrorKind::AlreadyExists => {
                Err(RecordingError::Exists { file })
            }
            Err(error) => Err(failed(error.error)),
        }
    }

    /// The name the file will have.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    pub(crate) fn failed(&self, error: io::Error) -> RecordingError {
        RecordingError::io(self.path.display().to_string(), "write it", error)
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.output.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.output.flush()
    }
}

impl io::Seek for AtomicFile {
    fn seek(&mut self, to: io::SeekFrom) -> io::Result<u64> {
        self.output.seek(to)
    }
}

/// Writes a whole file at once, atomically.
///
/// # Errors
/// As [`AtomicFile::create`] and [`AtomicFile::commit`].
pub fn write_whole(path: &Path, contents: &[u8], force: bool) -> Result<()> {
    let mut file = AtomicFile::create(path, force)?;
    file.bytes(contents)?;
    file.commit()
}

/// A temporary file with the permissions of ordinary new files.
fn temporary_in(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".northing-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt as _;
        // The umask takes its share.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

#[cfg(test)]
mod tests {
    use super::{AtomicFile, write_whole};
    use crate::error::RecordingError;
    use std::io::Write;

    #[test]
    fn nothing_appears_before_the_commit_and_nothing_stays_without_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.csv");
        let mut file = AtomicFile::create(&path, false).unwrap();
        file.write_all(b"half").unwrap();
        file.flush().unwrap();
        assert!(!path.exists());
        drop(file);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);

        write_whole(&path, b"whole", false).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"whole");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn an_existing_file_needs_force() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.csv");
        write_whole(&path, b"first", false).unwrap();
        let error = write_whole(&path, b"second", false).unwrap_err();
        assert!(matches!(error, RecordingError::Exists { .. }));
        assert!(error.to_string().ends_with("or use --force"));
        assert_eq!(std::fs::read(&path).unwrap(), b"first");
        write_whole(&path, b"second", true).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), b"second");
    }

    #[test]
    fn a_name_taken_meanwhile_is_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.csv");
        let mine = AtomicFile::create(&path, false).unwrap();
        std::fs::write(&path, b"theirs").unwrap();
        assert!(matches!(mine.commit(), Err(RecordingError::Exists { .. })));
        assert_eq!(std::fs::read(&path).unwrap(), b"theirs");
    }

    #[test]
    fn a_missing_folder_and_a_folder_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("no").join("out.csv");
        let error = AtomicFile::create(&missing, false).unwrap_err().to_string();
        assert!(error.contains("does not exist; make it first"), "{error}");
        let error = AtomicFile::create(folder.path(), true)
            .unwrap_err()
            .to_string();
        assert!(error.contains("it is a folder"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn the_file_has_ordinary_permissions() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let (ours, plain) = (folder.path().join("ours"), folder.path().join("plain"));
        write_whole(&ours, b"", false).unwrap();
        std::fs::write(&plain, b"").unwrap();
        let mode = |path| std::fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&plain));
    }
}
