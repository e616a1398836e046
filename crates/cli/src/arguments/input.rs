//! The recordings that a command reads: files, folders, standard input, and what may be said of them.

use std::path::{Path, PathBuf};

use anyhow::Result;
use clap::Args;
use northing_evaluation::calibration::magnetometer::MagnetometerSource;
use northing_recording::{
    FieldUnit, ForceUnit, Format, OpenOptions, RateUnit, Recording, open, read_from,
};

use crate::files::STDIN;
use crate::files::output::check_not_input;

/// Options about the recording itself.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "About the recording")]
pub(crate) struct InputArgs {
    /// Format, where it shall not be told by content: parquet, csv, mcap, sensor-logger, phyphox, nmea, ubx, ulog, ardupilot, kf-gins,
    /// rtklib, euroc, gpx, tum, vectornav, x-imu3, northing-serial, manifest
    #[arg(long, value_name = "FORMAT")]
    format: Option<Format>,
    /// The device, where a file holds several (in ROS 2 files: the topic)
    #[arg(long, value_name = "NAME")]
    device: Option<String>,
    /// TOML file that describes the columns of any other table (see docs/formats.md)
    #[arg(long, value_name = "FILE")]
    manifest: Option<PathBuf>,
    /// Read a table that nothing describes by a guess at its columns, and say what was guessed (see northing describe)
    #[arg(long)]
    describe: bool,
    /// Another file with the truth to score against: a trajectory (.tum), a track (.gpx), a solution (.pos) or any recording, of
    /// which the orientations and positions are taken
    #[arg(long, value_name = "FILE")]
    reference: Option<PathBuf>,
    /// Unit of the gyroscope in the file: rad-per-s, deg-per-s
    #[arg(long, value_name = "UNIT")]
    gyroscope_unit: Option<RateUnit>,
    /// Unit of the accelerometer in the file: m-per-s2, g
    #[arg(long, value_name = "UNIT")]
    accelerometer_unit: Option<ForceUnit>,
    /// Unit of the magnetometer in the file: microtesla, nanotesla, millitesla, tesla, gauss, milligauss
    #[arg(long, value_name = "UNIT")]
    magnetometer_unit: Option<FieldUnit>,
    /// Longest pause of the gyroscope that is no gap; the uncertainty grows over a gap
    #[arg(long, value_name = "SECONDS", default_value = "0.5", value_parser = positive_seconds, allow_negative_numbers = true)]
    gap_limit: f64,
}

/// Where the files of a manifest are.
#[derive(Debug, Clone, Default, Args)]
#[command(next_help_heading = "About the recording")]
pub(crate) struct DataArgs {
    /// The folder in which the files that a manifest names are [default: the manifest's own]
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
}

impl InputArgs {
    /// Whether another file was named to score against.
    pub(crate) fn has_reference(&self) -> bool {
        self.reference.is_some()
    }

    /// The longest pause of the gyroscope that is no gap, s.
    pub(crate) fn gap_limit_s(&self) -> f64 {
        self.gap_limit
    }

    /// The options for the readers.
    pub(crate) fn options(&self) -> OpenOptions {
        OpenOptions {
            format: self.format,
            device: self.device.clone(),
            manifest: self.manifest.clone(),
            describe: self.describe,
            reference: self.reference.clone(),
            gyroscope_unit: self.gyroscope_unit,
            accelerometer_unit: self.accelerometer_unit,
            magnetometer_unit: self.magnetometer_unit,
            gap_limit_s: self.gap_limit,
            ..OpenOptions::default()
        }
    }

    /// Refuses an output that is one of the files being read: not even `--force` means that.
    ///
    /// # Errors
    /// It is one.
    pub(crate) fn check_not_read(
        &self,
        output: &Path,
        recording: &Path,
        data: &DataArgs,
    ) -> Result<()> {
        let others = self.manifest.iter().chain(&self.reference);
        let all = [recording].into_iter().chain(others.map(PathBuf::as_path));
        for input in all {
            check_not_input(output, input, data.data.as_deref())?;
        }
        Ok(())
    }

    /// Opens a recording, `-` being standard input.
    ///
    /// # Errors
    /// It is no recording; the message says which file and why.
    pub(crate) fn open(&self, path: &Path) -> Result<Recording> {
        self.open_in(path, &DataArgs::default())
    }

    /// As [`Self::open`], with the files that a manifest names in the folder of `data`.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub(crate) fn open_in(&self, path: &Path, data: &DataArgs) -> Result<Recording> {
        let options = OpenOptions {
            data: data.data.clone(),
            ..self.options()
        };
        Ok(if path == Path::new(STDIN) {
            read_from(std::io::stdin(), "standard input", &options)?
        } else {
            open(path, &options)?
        })
    }
}

/// A duration above zero.
pub(crate) fn positive_seconds(text: &str) -> Result<f64, String> {
    let seconds = seconds(text)?;
    if seconds > 0.0 {
        Ok(seconds)
    } else {
        Err("expected seconds above 0, e.g. 10".to_owned())
    }
}

/// A time or duration, zero or more.
pub(crate) fn seconds(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds >= 0.0 && seconds.is_finite() => Ok(seconds),
        _ => Err("expected seconds, e.g. 10".to_owned()),
    }
}

/// Which magnetometer a run uses.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum MagnetometerChoice {
    /// The device's own, or the uncalibrated one.
    Stream(MagnetometerSource),
    /// The one that a file, or a file of a folder, is a calibration of.
    Calibrated(PathBuf),
}

/// A choice such as `uncalibrated` or `calibrated=magnetometer.toml`.
pub(crate) fn magnetometer_choice(text: &str) -> Result<MagnetometerChoice, String> {
    match text.strip_prefix("calibrated=") {
        Some("") => Err("expected a file or folder after calibrated=".to_owned()),
        Some(path) => Ok(MagnetometerChoice::Calibrated(path.into())),
        None => magnetometer_source(text)
            .map(MagnetometerChoice::Stream)
            .map_err(|_| "expected device, uncalibrated or calibrated=FILE".to_owned()),
    }
}

/// Which of a phone's two magnetometers is meant.
pub(crate) fn magnetometer_source(text: &str) -> Result<MagnetometerSource, String> {
    match text {
        "device" => Ok(MagnetometerSource::Device),
        "uncalibrated" => Ok(MagnetometerSource::Uncalibrated),
        _ => Err("expected device or uncalibrated".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::{positive_seconds, seconds};

    #[test]
    fn seconds_are_finite_and_not_negative() {
        assert_eq!(seconds("2.5"), Ok(2.5));
        assert_eq!(seconds("0"), Ok(0.0));
        for bad in ["-1", "nan", "inf", "ten", ""] {
            assert!(seconds(bad).is_err(), "{bad}");
        }
        assert!(positive_seconds("0").is_err());
    }
}
