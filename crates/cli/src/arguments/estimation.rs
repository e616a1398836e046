//! What a run of an estimator can be asked for, shared by `run` and `compare`.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::Args;
use northing_evaluation::attitude::reference::{self, ReferenceUse};
use northing_evaluation::attitude::runner::run;
use northing_evaluation::attitude::{
    Calibrations, EstimatorKind, RunObserver, RunOptions, RunSummary, SensorSelection,
};
use northing_evaluation::calibration::magnetometer::MagnetometerSource;
use northing_evaluation::calibration::magnetometer::MagnetometerStreamCalibration;
use northing_evaluation::calibration::set::CalibrationSet;
use northing_evaluation::navigation::{NavigationKind, NavigationOptions};
use northing_evaluation::{EvaluationError, RunEstimator};
use northing_recording::{Metadata, Recording};

use crate::arguments::input::{
    InputArgs, MagnetometerChoice, magnetometer_choice, positive_seconds,
};
use crate::arguments::settings::SettingArgs;
use crate::files::magnetometer_calibration;
use crate::files::rest_calibration;
use crate::files::shown;
use crate::progress::watched;

/// Options about the estimation.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "Estimation")]
pub(crate) struct EstimationArgs {
    /// Sensors to use, e.g. gyro,acc to leave the magnetometer out; `compass` uses the device's own
    /// headings beside a magnetometer, too
    #[arg(long, value_name = "LIST")]
    sensors: Option<SensorSelection>,
    /// Which magnetometer: device (calibrated by the device), uncalibrated, or calibrated=FILE, which is
    /// --magnetometer-calibration FILE; without it what the recording has and the estimator can use
    #[arg(long, value_name = "WHICH", value_parser = magnetometer_choice)]
    magnetometer: Option<MagnetometerChoice>,
    /// Calibration at rest, a file that `northing calibrate rest` wrote, or a folder of files whose names
    /// end with device and day (rest_iPhone5_d3.toml)
    #[arg(long, value_name = "FILE", conflicts_with = "calibrate_first")]
    calibration: Option<PathBuf>,
    /// Calibration of the magnetometer, a file that `northing calibrate magnetometer` wrote, or such a folder
    #[arg(long, value_name = "FILE")]
    magnetometer_calibration: Option<PathBuf>,
    /// Calibrate from the first seconds of the recording, in which the device must rest
    #[arg(long, value_name = "SECONDS", value_parser = positive_seconds, allow_negative_numbers = true)]
    calibrate_first: Option<f64>,
    /// Smoothing over the whole recording (mekf, bounded-velocity: RTS; error-state: batch; keeps it in memory)
    #[arg(long)]
    smooth: bool,
    /// Put the reference on the sensors' clock and into their axes before it is scored: clock offset and constant
    /// misalignment are found by its angular rates, and stated (reads the recording twice)
    #[arg(long, conflicts_with = "ignore_reference")]
    align_reference: bool,
    /// Run as if the recording had no reference
    #[arg(long)]
    ignore_reference: bool,
    #[command(flatten)]
    settings: SettingArgs,
}

/// What a command asks of its runs.
#[derive(Debug, Clone)]
pub(crate) struct Asked {
    /// The options of every run.
    pub(crate) run: RunOptions,
    /// Calibrations of devices and days, of which each recording gets its own.
    pub(crate) calibrations: Calibrations,
    /// Whether each recording's reference is aligned by its rates first.
    pub(crate) align_reference: bool,
}

impl EstimationArgs {
    /// The options of a run with this estimator, otherwise that of the profile.
    ///
    /// # Errors
    /// A setting, a file or a combination that is invalid.
    pub(crate) fn options(
        &self,
        estimator: Option<EstimatorKind>,
        input: &InputArgs,
    ) -> Result<Asked> {
        let mut run = self.settings.options(estimator)?;
        run.driver.gap_limit_s = input.gap_limit_s();
        run.choose_magnetometer = self.magnetometer.is_none() && self.sensors.is_none();
        if let Some(sensors) = self.sensors {
            run.sensors = sensors;
        }
        if let Some(MagnetometerChoice::Stream(source)) = self.magnetometer {
            run.sensors.magnetometer_source = source;
        }
        run.calibrate_first_s = self.calibrate_first;
        run.smooth = self.smooth;
        let mut asked = Asked {
            run,
            calibrations: Calibrations::default(),
            align_reference: self.align_reference,
        };
        if self.ignore_reference {
            asked.run.reference = ReferenceUse::Ignored;
        }
        if let Some(path) = self.magnetometer_calibration_path()? {
            self.calibrate_magnetometer(&mut asked, path)?;
        }
        match self.calibration.as_deref() {
            Some(folder) if folder.is_dir() => {
                asked.calibrations.rest = Some(rest_calibration::read_folder(folder)?);
            }
            Some(path) => {
                asked.run.calibration = Some(rest_calibration::read(path)?);
                asked.run.calibration_names[0] = Some(shown(path));
            }
            None => {}
        }
        asked.run.check()?;
        Ok(asked)
    }

    /// As [`Self::options`] for this estimator alone, which must have a use for every `--set`.
    ///
    /// # Errors
    /// As [`Self::options`], and a setting without effect.
    pub(crate) fn options_of_one(
        &self,
        estimator: Option<EstimatorKind>,
        input: &InputArgs,
    ) -> Result<Asked> {
        let asked = self.options(estimator, input)?;
        self.settings.check_effect(asked.run.estimator)?;
        Ok(asked)
    }

    /// Changes the options of a lab's report by `--sensors` and `--set`.
    ///
    /// # Errors
    /// A setting that is invalid or without effect.
    pub(crate) fn change(&self, options: &mut RunOptions) -> Result<()> {
        if let Some(sensors) = self.sensors {
            options.sensors = sensors;
        }
        self.settings.change(options)?;
        Ok(options.check()?)
    }

    /// The estimator that the file of `--config` names.
    ///
    /// # Errors
    /// The file cannot be read, or there is no such estimator.
    pub(crate) fn estimator_of_config(&self) -> Result<Option<RunEstimator>> {
        self.settings.estimator()
    }

    /// Where the calibration of the magnetometer is.
    fn magnetometer_calibration_path(&self) -> Result<Option<&Path>> {
        let option = self.magnetometer_calibration.as_deref();
        let chosen = match &self.magnetometer {
            Some(MagnetometerChoice::Calibrated(path)) => Some(path.as_path()),
            _ => None,
        };
        if option.is_some() && chosen.is_some() {
            bail!(
                "--magnetometer calibrated= and --magnetometer-calibration both name a calibration; keep one"
            );
        }
        Ok(option.or(chosen))
    }

    /// The options of a run with this navigation estimator.
    ///
    /// # Errors
    /// A setting that is invalid, or an option that only attitude estimators have a use for.
    pub(crate) fn navigation_options(
        &self,
        kind: NavigationKind,
        metadata: &Metadata,
    ) -> Result<NavigationOptions> {
        let attitude_alone = [
            ("--sensors", self.sensors.is_some()),
            ("--magnetometer", self.magnetometer.is_some()),
            ("--calibration", self.calibration.is_some()),
            (
                "--magnetometer-calibration",
                self.magnetometer_calibration.is_some(),
            ),
            ("--calibrate-first", self.calibrate_first.is_some()),
            ("--align-reference", self.align_reference),
            ("--ignore-reference", self.ignore_reference),
        ];
        if let Some((option, _)) = attitude_alone.into_iter().find(|(_, given)| *given) {
            bail!(
                "{option} has no effect on `{kind}`: it is for attitude estimators; leave it out"
            );
        }
        let mut options = NavigationOptions::of_recording(kind, metadata);
        options.smooth = self.smooth;
        self.settings.navigation_parameters(&mut options)?;
        Ok(options)
    }

    /// A calibration of the magnetometer also says which of the two is used, unless the user did.
    fn calibrate_magnetometer(&self, asked: &mut Asked, path: &Path) -> Result<()> {
        if !asked.run.sensors.magnetometer {
            bail!(
                "a calibration of the magnetometer has no effect: --sensors leaves the magnetometer out"
            );
        }
        asked.run.choose_magnetometer = false;
        if path.is_dir() {
            let set = magnetometer_calibration::read_folder(path)?;
            if let Some(MagnetometerChoice::Stream(used)) = self.magnetometer {
                check_streams(&set, used)?;
            }
            asked.calibrations.field = Some(set);
            return Ok(());
        }
        let field = magnetometer_calibration::read(path)?;
        let sensors = &mut asked.run.sensors;
        let is_named = matches!(self.magnetometer, Some(MagnetometerChoice::Stream(_)));
        if !is_named && sensors.magnetometer_source == MagnetometerSource::Device {
            sensors.magnetometer_source = field.magnetometer;
        }
        asked.run.magnetometer_calibration = Some(field);
        asked.run.calibration_names[1] = Some(shown(path));
        Ok(())
    }
}

/// Refuses calibrations of another stream than the one that was named.
fn check_streams(
    set: &CalibrationSet<MagnetometerStreamCalibration>,
    used: MagnetometerSource,
) -> Result<()> {
    let other = set.named.iter().find(|(_, c)| c.magnetometer != used);
    let Some((name, calibration)) = other else {
        return Ok(());
    };
    let error = EvaluationError::OtherMagnetometer {
        calibrated: calibration.magnetometer.name(),
        used: used.name(),
    };
    Err(anyhow::Error::from(error).context(format!("{}/{name}.toml", set.place)))
}

/// Finds clock offset and misalignment of a recording's reference; `name` stands for it in messages.
///
/// # Errors
/// The recording, or its reference; the message begins with the name.
pub(crate) fn aligned_reference(recording: &mut Recording, name: &str) -> Result<ReferenceUse> {
    let events = watched(recording, "aligning the reference");
    let found = reference::fit(events).map_err(|error| of_recording(error, name))?;
    Ok(ReferenceUse::Aligned(found))
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
) -> Result<RunSummary> {
    let options = RunOptions {
        recording: name.to_owned(),
        world_frame: recording.metadata().world_frame,
        ..options.clone()
    };
    let events = watched(recording, "estimating");
    let summary = run(events, &options, observer);
    let mut summary = summary.map_err(|error| of_recording(error, name))?;
    summary.issues.splice(0..0, recording.issues().sentences());
    Ok(summary)
}

/// What went wrong with a recording, its name before it.
pub(crate) fn of_recording(error: EvaluationError, name: &str) -> anyhow::Error {
    match error {
        // Its message begins with the file already.
        error @ EvaluationError::Recording(_) => error.into(),
        error => anyhow::Error::from(error).context(name.to_owned()),
    }
}
