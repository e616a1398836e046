//! Which recordings are meant: files as they are named, folders searched.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use northing_evaluation::attitude::{Calibrations, RunOptions};
use northing_recording::{OpenOptions, RecordingError, has_extension, open};

/// Endings of files that may be recordings of attitude ...
const ATTITUDE_ENDINGS: &[&str] = &["parquet", "csv", "zip", "json"];
/// ... and of navigation; `toml` is a manifest of several files.
const NAVIGATION_ENDINGS: &[&str] = &[
    "parquet", "csv", "zip", "json", "mcap", "ulg", "ubx", "nmea", "log", "txt", MANIFEST,
];
const MANIFEST: &str = "toml";
/// Recordings made for calibration begin so; they are left out of folders.
const CALIBRATION_PREFIX: &str = "calib_";

/// The recordings, and sentences about files of folders that were left out.
#[derive(Debug, Default)]
pub(crate) struct Recordings {
    /// In the order of the arguments, within a folder by name.
    pub(crate) paths: Vec<PathBuf>,
    /// Files that are no recordings, with the reason.
    pub(crate) left_out: Vec<String>,
    /// Recordings that are damaged, with the reason.
    pub(crate) broken: Vec<String>,
}

/// The recordings behind the arguments, without those that `calibrations` has none for.
///
/// # Errors
/// A folder cannot be read, or has no recording; or no recording has a calibration.
pub(crate) fn find_calibrated(
    arguments: &[PathBuf],
    options: &OpenOptions,
    calibrations: &Calibrations,
) -> Result<Recordings> {
    let mut found = find(arguments, options)?;
    found.keep_calibrated(options, calibrations)?;
    Ok(found)
}

/// The recordings behind the arguments.
///
/// # Errors
/// A folder cannot be read, or has no recording.
pub(crate) fn find(arguments: &[PathBuf], options: &OpenOptions) -> Result<Recordings> {
    find_with(arguments, options, ATTITUDE_ENDINGS)
}

/// The recordings of navigation behind the arguments, also in the formats of receivers and autopilots.
///
/// # Errors
/// As [`find`].
pub(crate) fn find_navigation(arguments: &[PathBuf], options: &OpenOptions) -> Result<Recordings> {
    find_with(arguments, options, NAVIGATION_ENDINGS)
}

fn find_with(arguments: &[PathBuf], options: &OpenOptions, endings: &[&str]) -> Result<Recordings> {
    let mut found = Recordings::default();
    for path in arguments {
        if !path.is_dir() || open(path, options).is_ok() {
            // A file, or a folder that is a recording itself (Sensor Logger).
            found.paths.push(path.clone());
            continue;
        }
        let before = found.paths.len();
        found.search(path, options, endings)?;
        if found.paths.len() == before && found.broken.is_empty() {
            bail!(
                "{}: no recordings in this folder; expected files that end in .{}, or name the files",
                path.display(),
                endings.join(", .")
            );
        }
    }
    Ok(found)
}

impl Recordings {
    fn search(&mut self, folder: &Path, options: &OpenOptions, endings: &[&str]) -> Result<()> {
        let entries = fs::read_dir(folder).and_then(Iterator::collect::<Result<Vec<_>, _>>);
        let entries = entries.with_context(|| format!("{}: cannot search it", folder.display()))?;
        let mut paths: Vec<PathBuf> = entries.into_iter().map(|entry| entry.path()).collect();
        paths.sort();
        for path in paths {
            let name = path
                .file_name()
                .unwrap_or_default()
                .to_string_lossy()
                .into_owned();
            if name.starts_with('.') || name.starts_with(CALIBRATION_PREFIX) {
                continue;
            }
            if path.is_dir() {
                match open(&path, options) {
                    Ok(_) => self.paths.push(path),
                    Err(_) => self.search(&path, options, endings)?,
                }
            } else if has_extension(&path, MANIFEST) && endings.contains(&MANIFEST) {
                self.take_manifest(path, options);
            } else if endings.iter().any(|ending| has_extension(&path, ending)) {
                self.take(path, options);
            }
        }
        Ok(())
    }

    /// Takes a manifest, unless it is that of one file beside it, which is taken with it. Other TOML files are no
    /// recordings.
    fn take_manifest(&mut self, path: PathBuf, options: &OpenOptions) {
        let stem = path.file_stem();
        let of_a_file = path.with_extension("").is_file()
            || fs::read_dir(path.parent().unwrap_or(Path::new("."))).is_ok_and(|entries| {
                let paths = entries.filter_map(|entry| Some(entry.ok()?.path()));
                let mut others = paths.filter(|other| *other != path && other.is_file());
                others.any(|other| other.file_stem() == stem)
            });
        if of_a_file {
            return;
        }
        match open(&path, options) {
            Ok(_) => self.paths.push(path),
            Err(error) => self.left_out.push(error.to_string()),
        }
    }

    /// Leaves recordings out that have no calibration in a folder of them.
    fn keep_calibrated(
        &mut self,
        options: &OpenOptions,
        calibrations: &Calibrations,
    ) -> Result<()> {
        let mut missing = Vec::new();
        self.paths.retain(|path| {
            // What cannot be opened is told of where it is run.
            let Ok(recording) = open(path, options) else {
                return true;
            };
            match calibrations.apply(recording.metadata(), &mut RunOptions::default()) {
                Ok(()) => true,
                Err(error) => {
                    missing.push(format!("{}: {error}", path.display()));
                    false
                }
            }
        });
        if let (true, Some(first)) = (self.paths.is_empty(), missing.first()) {
            bail!("{first}");
        }
        self.left_out.extend(missing);
        Ok(())
    }

    /// Takes a recording, and notes other files and recordings that are broken.
    fn take(&mut self, path: PathBuf, options: &OpenOptions) {
        match open(&path, options) {
            Ok(_) => self.paths.push(path),
            Err(
                error @ (RecordingError::NotARecording { .. }
                | RecordingError::MissingColumns { .. }
                | RecordingError::NoGyroscope { .. }),
            ) => self.left_out.push(error.to_string()),
            Err(error) => self.broken.push(error.to_string()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn folders_are_searched_and_calibrations_left_out_unless_named() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, text).unwrap();
            path
        };
        let recording = "t_s,gyro_x_rad_s,gyro_y_rad_s,gyro_z_rad_s\n0,0,0,0\n";
        let b = write("b.csv", recording);
        let a = write("a.csv", recording);
        let c = write("deeper/c.csv", recording);
        let calibration = write("calib_a.csv", recording);
        write("notes.csv", "when,what\n1,2\n");
        write("cut.parquet", "PAR1 and then nothing");
        write("picture.png", "x");
        let found = find(&[folder.path().to_owned()], &OpenOptions::default()).unwrap();
        assert_eq!(found.paths, [a, b, c]);
        assert_eq!(found.left_out.len(), 1, "{:?}", found.left_out);
        assert_eq!(
            found.broken.len(),
            usize::from(cfg!(feature = "parquet")),
            "{:?}",
            found.broken
        );
        let named = find(std::slice::from_ref(&calibration), &OpenOptions::default()).unwrap();
        assert_eq!(named.paths, [calibration]);
    }

    #[test]
    fn an_empty_folder_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        let error = find(&[folder.path().to_owned()], &OpenOptions::default()).unwrap_err();
        assert!(
            error.to_string().contains("no recordings in this folder"),
            "{error}"
        );
    }
}
