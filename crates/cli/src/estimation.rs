//! What a run of an estimator can be asked for, shared by `run` and `compare`.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::Args;
use northing_core::calibration::RestCalibration;
use northing_evaluation::EvaluationError;
use northing_evaluation::calibration::calibrated_config;
use northing_evaluation::estimators::EstimatorKind;
use northing_evaluation::observer::RunObserver;
use northing_evaluation::options::{MagnetometerSource, RunOptions, SensorSelection};
use northing_evaluation::parameters::Parameters;
use northing_evaluation::runner::run;
use northing_evaluation::summary::RunSummary;
use northing_recording::Recording;

use crate::calibration_file;
use crate::field_file;
use crate::input::{InputArgs, magnetometer_source, positive_seconds};
use crate::interrupt::interruptible;
use crate::settings::SettingArgs;

/// Options about the estimation.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Estimation")]
pub(crate) struct EstimationArgs {
    /// Sensors to use, e.g. gyro,acc to leave the magnetometer out; `compass` uses the device's own
    /// headings beside a magnetometer, too
    #[arg(long, value_name = "LIST")]
    sensors: Option<SensorSelection>,
    /// Which magnetometer: device (calibrated by the device) or uncalibrated
    #[arg(long, value_name = "WHICH", value_parser = magnetometer_source)]
    magnetometer: Option<MagnetometerSource>,
    /// Calibration at rest, a file that `northing calibrate rest` wrote
    #[arg(long, value_name = "FILE", conflicts_with = "calibrate_first")]
    calibration: Option<PathBuf>,
    /// Calibration of the magnetometer, a file that `northing calibrate magnetometer` wrote
    #[arg(long, value_name = "FILE")]
    magnetometer_calibration: Option<PathBuf>,
    /// Calibrate from the first seconds of the recording, in which the device must rest
    #[arg(long, value_name = "SECONDS", value_parser = positive_seconds, allow_negative_numbers = true)]
    calibrate_first: Option<f64>,
    /// Look back: smooth over the whole recording (RTS; mekf and bounded-velocity, keeps it in memory)
    #[arg(long)]
    smooth: bool,
    #[command(flatten)]
    settings: SettingArgs,
}

impl EstimationArgs {
    /// The options of a run with this estimator.
    ///
    /// # Errors
    /// A setting, a file or a combination that makes no sense.
    pub(crate) fn options(
        &self,
        estimator: EstimatorKind,
        input: &InputArgs,
    ) -> Result<RunOptions> {
        let mut options = self.settings.options(estimator)?;
        options.driver.gap_limit_s = input.gap_limit_s();
        if let Some(sensors) = self.sensors {
            options.sensors = sensors;
        }
        if let Some(source) = self.magnetometer {
            options.sensors.magnetometer_source = source;
        }
        if let Some(path) = &self.magnetometer_calibration {
            self.calibrate_field(&mut options, path)?;
        }
        options.calibration = self
            .calibration
            .as_deref()
            .map(calibration_file::read)
            .transpose()?;
        options.calibrate_first_s = self.calibrate_first;
        options.smooth = self.smooth;
        options.check()?;
        Ok(options)
    }

    /// As [`Self::options`] for this estimator alone, which must have a use for every `--set`.
    ///
    /// # Errors
    /// As [`Self::options`], and a setting without effect.
    pub(crate) fn options_of_one(
        &self,
        estimator: EstimatorKind,
        input: &InputArgs,
    ) -> Result<RunOptions> {
        let options = self.options(estimator, input)?;
        self.settings.check_effect(estimator)?;
        Ok(options)
    }

    /// A calibration of the magnetometer also says which of the two is used, unless the user did.
    fn calibrate_field(&self, options: &mut RunOptions, path: &Path) -> Result<()> {
        let field = field_file::read(path)?;
        let sensors = &mut options.sensors;
        if !sensors.magnetometer {
            bail!(
                "--magnetometer-calibration has no effect: --sensors leaves the magnetometer out"
            );
        }
        if self.magnetometer.is_none() && sensors.magnetometer_source == MagnetometerSource::Device
        {
            sensors.magnetometer_source = field.magnetometer;
        }
        options.field_calibration = Some(field);
        Ok(())
    }
}

/// Runs an estimator over a recording; `name` stands for it in the summary and in messages.
///
/// # Errors
/// The recording or the run; the message begins with the name.
pub(crate) fn run_over(
    recording: &mut Recording,
    name: &str,
    options: &RunOptions,
    observer: &mut dyn RunObserver,
    mut on_event: impl FnMut(),
) -> Result<RunSummary> {
    let options = RunOptions {
        recording: name.to_owned(),
        world_frame: recording.metadata().world_frame,
        ..options.clone()
    };
    let events = interruptible(recording.by_ref()).inspect(|_| on_event());
    let mut summary = match run(events, &options, observer) {
        Ok(summary) => summary,
        // Its message begins with the file already.
        Err(error @ EvaluationError::Recording(_)) => return Err(error.into()),
        Err(error) => return Err(anyhow::Error::from(error).context(name.to_owned())),
    };
    summary.issues.splice(0..0, recording.issues().sentences());
    Ok(summary)
}

/// The parameters that a run really had: with those that its calibration measured.
pub(crate) fn parameters_used(
    options: &RunOptions,
    calibration: Option<&RestCalibration<f64>>,
) -> Parameters {
    let calibration = options.calibration.as_ref().or(calibration);
    calibration.map_or(options.config, |calibration| {
        calibrated_config(options, calibration)
    })
}
