//! Arguments of `northing run`.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use northing_evaluation::RunEstimator;
use northing_recording::Recording;

use crate::arguments::estimation::EstimationArgs;
use crate::arguments::input::{DataArgs, InputArgs};
use crate::arguments::navigation::NavigationArgs;

/// Options that a report of the lab decides.
const SET_ELSEWHERE: [&str; 11] = [
    "sensors",
    "magnetometer",
    "magnetometer_calibration",
    "calibration",
    "calibrate_first",
    "smooth",
    "align_reference",
    "ignore_reference",
    "profile",
    "config",
    "set",
];

/// Arguments of `run`.
#[derive(Debug, Args)]
#[command(
    long_about = "Estimates the attitude over one recording and says how good the estimate is: the error \
                  against a reference if the recording has one, whether the stated uncertainty and the noise \
                  of each sensor are consistent, and the final test of a device that is put back where it began. \
                  With a navigation estimator (error-state, axis-filters, dead-reckoning) it says where the device \
                  was, scored at held-out fixes. Of a board with our firmware it shows what the board itself \
                  estimated (device), unless another estimator is named.",
    after_help = "\
Examples:
  northing run walk.zip --report walk.html
  northing run lab.csv --profile lab --calibrate-first 10 --report lab.html
  northing run walk.zip --sensors gyro,acc --set bounded_velocity_psd=0.05 --out estimates.csv
  northing run walk.parquet --smooth --out smoothed.tum
  northing run walk.zip --magnetometer calibrated=magnetometer.toml --calibration rest.toml
  northing run capture.csv --align-reference                    # motion capture on a clock of its own
  northing run drive.toml --estimator error-state --gnss-every 4 --outage 120:30 --report drive.html
  northing run drive.toml --estimator error-state --out drive.mcap  # for Foxglove, evo, ROS 2
  northing run board.txt --report board.html                    # what our firmware printed
  northing demo --record-only - | northing run - --json"
)]
pub(crate) struct RunArgs {
    /// The recording: file, Sensor Logger folder, or - for standard input
    #[arg(value_name = "RECORDING")]
    pub(crate) recording: PathBuf,
    /// Estimator; `northing estimators` lists them; without it bounded-velocity, with the lab profile mekf, of a
    /// board with our firmware device
    #[arg(long, value_name = "NAME", conflicts_with = "setup")]
    pub(super) estimator: Option<RunEstimator>,
    /// Run as a report of the lab says: estimator, parameters, calibrations and all; nothing else may be set
    #[arg(long, value_name = "REPORT", conflicts_with_all = SET_ELSEWHERE)]
    pub(super) setup: Option<PathBuf>,
    /// Write a report with plots: one HTML file for a browser
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Write the estimates: .csv, .parquet, .tum or .mcap; of a navigation estimator also .kml, .gpx or .geojson
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Whose messages an .mcap of --out has: ros2, or foxglove, which are those that --foxglove shows, innovations and lamps among
    /// them
    #[cfg(feature = "foxglove")]
    #[arg(long, value_name = "KIND", requires = "out", default_value = "ros2")]
    pub(crate) messages: Messages,
    /// Overwrite outputs that exist
    #[arg(long)]
    pub(crate) force: bool,
    /// Print one JSON document
    #[arg(long)]
    pub(crate) json: bool,
    /// When the run has ended, be a server for Foxglove, whose viewers play it, pause, seek and set parameters; without
    /// an address on this computer alone, port 8765
    #[cfg(feature = "foxglove")]
    #[arg(long, value_name = "HOST:PORT", num_args = 0..=1, require_equals = true,
          default_missing_value = "127.0.0.1:8765", value_parser = crate::arguments::address::host_and_port)]
    pub(crate) foxglove: Option<std::net::SocketAddr>,
    #[command(flatten)]
    pub(crate) navigation: NavigationArgs,
    #[command(flatten)]
    pub(crate) estimation: EstimationArgs,
    #[command(flatten)]
    pub(crate) data: DataArgs,
    #[command(flatten)]
    pub(crate) input: InputArgs,
}

/// Whose messages are written.
#[cfg(feature = "foxglove")]
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Messages {
    /// Of ROS 2, in CDR.
    Ros2,
    /// Of Foxglove, in Protobuf and JSON.
    Foxglove,
}

impl RunArgs {
    /// The estimator that is asked for: by name, or by the file of `--config`.
    pub(super) fn asked_estimator(&self) -> Result<Option<RunEstimator>> {
        match self.estimator {
            None => self.estimation.estimator_of_config(),
            named => Ok(named),
        }
    }

    /// The recording, already open where the estimator depends on what it holds.
    pub(super) fn open_first(&self, asked: Option<RunEstimator>) -> Option<Result<Recording>> {
        let depends = RunEstimator::depends_on_recording(asked) && self.setup.is_none();
        depends.then(|| self.opened(None))
    }

    /// The recording that is open already, otherwise opened now.
    ///
    /// # Errors
    /// It cannot be opened.
    pub(crate) fn opened(&self, already: Option<Result<Recording>>) -> Result<Recording> {
        already.unwrap_or_else(|| self.input.open_in(&self.recording, &self.data))
    }
}
