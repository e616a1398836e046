//! `northing run`: one estimator over one recording.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use northing_evaluation::calibration_set::Calibrations;
use northing_evaluation::observer::{
    EstimateRecord, InnovationRecord, PositionRecord, RunObserver, TraceObserver,
};
use northing_evaluation::setup::RunSetup;
use northing_recording::Recording;
use northing_recording::atomic_file::write_whole;

use crate::estimate_file::EstimateFile;
use crate::estimation::{Asked, EstimationArgs, parameters_used, run_over};
use crate::input::{DataArgs, InputArgs, shown};
use crate::navigation_run::{self, NavigationArgs};
use crate::output::{check_free, check_not_input, print, print_json, same_file};
use crate::progress::Progress;
use crate::run_estimator::RunEstimator;
use crate::{run_report, summary_text};

/// Points a series of a report's plots has at most.
pub(crate) const TRACE_CAPACITY: usize = 6000;

/// Options that a report of the lab decides.
const SET_ELSEWHERE: [&str; 9] = [
    "sensors",
    "magnetometer",
    "magnetometer_calibration",
    "calibration",
    "calibrate_first",
    "smooth",
    "profile",
    "config",
    "set",
];

/// Arguments of `run`.
#[derive(Debug, Args)]
#[command(
    long_about = "Estimates the attitude over one recording and says how good the estimate is: the error \
                  against a reference if the recording has one, whether the stated uncertainty and the noise \
                  of each sensor are honest, and the final test of a device that is put back where it began. \
                  With a navigation estimator (error-state, axis-filters, dead-reckoning) it says where the device \
                  was, scored at fixes that are kept back. Of a board with our firmware it shows what the board itself \
                  estimated (device), unless another estimator is named.",
    after_help = "\
Examples:
  northing run walk.zip --report walk.html
  northing run lab.csv --profile lab --calibrate-first 10 --report lab.html
  northing run walk.zip --sensors gyro,acc --set bounded_velocity_psd=0.05 --out estimates.csv
  northing run walk.parquet --smooth --out smoothed.tum
  northing run walk.zip --magnetometer calibrated=magnetometer.toml --calibration rest.toml
  northing run drive.toml --estimator error-state --gnss-every 4 --outage 120:30 --report drive.html
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
    estimator: Option<RunEstimator>,
    /// Run as a report of the lab says: estimator, parameters, calibrations and all; nothing else may be set
    #[arg(long, value_name = "REPORT", conflicts_with_all = SET_ELSEWHERE)]
    setup: Option<PathBuf>,
    /// Write a report with plots: one HTML file for a browser
    #[arg(long, value_name = "FILE")]
    pub(crate) report: Option<PathBuf>,
    /// Write the estimates: .csv, .parquet or .tum; of a navigation estimator .csv, .kml, .gpx, .geojson, .tum or .mcap
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Overwrite outputs that exist
    #[arg(long)]
    pub(crate) force: bool,
    /// Print one JSON document
    #[arg(long)]
    pub(crate) json: bool,
    #[command(flatten)]
    pub(crate) navigation: NavigationArgs,
    #[command(flatten)]
    pub(crate) estimation: EstimationArgs,
    #[command(flatten)]
    pub(crate) data: DataArgs,
    #[command(flatten)]
    pub(crate) input: InputArgs,
}

impl RunArgs {
    /// The recording, already open where the estimator depends on what it holds.
    fn open_first(&self) -> Option<Result<Recording>> {
        let depends = RunEstimator::depends_on_recording(self.estimator) && self.setup.is_none();
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

/// Runs.
pub(crate) fn execute(args: &RunArgs) -> Result<()> {
    let opened = args.open_first();
    let estimator = match &opened {
        // What is wrong with the recording is told after what is wrong with the options.
        Some(Ok(recording)) => RunEstimator::of_recording(args.estimator, recording.sensors()),
        _ => args.estimator,
    };
    let estimator = match estimator {
        Some(RunEstimator::Navigation(kind)) => return navigation_run::execute(kind, args, opened),
        Some(RunEstimator::Attitude(kind)) => Some(kind),
        None => None,
    };
    if let Some(option) = args.navigation.first_given() {
        bail!(
            "{option} has no effect on an estimator of the attitude alone; choose --estimator error-state, \
             axis-filters or dead-reckoning"
        );
    }
    let Asked {
        run: mut options,
        calibrations,
    } = match &args.setup {
        Some(path) => from_setup(path)?,
        None => args.estimation.options_of_one(estimator, &args.input)?,
    };
    if let Some(report) = &args.report {
        if args.out.as_ref().is_some_and(|out| same_file(out, report)) {
            bail!(
                "--report and --out name the same file, {}; name two",
                report.display()
            );
        }
        check_free(report, args.force)?;
    }
    for output in args.report.iter().chain(&args.out) {
        check_not_input(output, &args.recording)?;
    }
    let file = args
        .out
        .as_ref()
        .map(|out| EstimateFile::create(out, options.estimator, args.force))
        .transpose()?;
    let mut recording = args.opened(opened)?;
    let metadata = recording.metadata().clone();
    calibrations
        .apply(&metadata, &mut options)
        .with_context(|| shown(&args.recording))?;
    let traced = args.report.as_ref();
    let mut watchers = Watchers {
        trace: traced.map(|_| TraceObserver::new(TRACE_CAPACITY, metadata.world_frame)),
        file,
    };
    let mut progress = Progress::of_stream("estimating");
    let name = shown(&args.recording);
    let summary = run_over(&mut recording, &name, &options, &mut watchers, || {
        progress.event();
    });
    drop(progress);
    let summary = summary?;
    let mut written = Vec::new();
    if let (Some(path), Some(trace)) = (&args.report, watchers.trace) {
        let mut config = parameters_used(&options, None);
        if let Some(prior) = summary.hard_iron_prior_ut {
            config.bounded_velocity.initial_hard_iron_std_ut = prior;
        }
        let html = run_report::render(&summary, &config, &metadata, trace.trace());
        write_whole(path, html.as_bytes(), args.force)?;
        written.push(format!("Report: {} (open it in a browser)", path.display()));
    }
    if let (Some(path), Some(file)) = (&args.out, watchers.file) {
        file.finish()?;
        written.push(format!("Estimates: {}", path.display()));
    }
    if args.json {
        return print_json(&summary);
    }
    let mut text = summary_text::describe(&summary);
    if !written.is_empty() {
        text.push_str(&format!("\n{}\n", written.join("\n")));
    }
    print(&text)
}

/// The options that a report of the lab carries.
fn from_setup(path: &Path) -> Result<Asked> {
    let file = path.display();
    let text = std::fs::read_to_string(path).with_context(|| format!("{file}: cannot read it"))?;
    let setup = RunSetup::parse(&text).map_err(|problem| anyhow!("{file}: {problem}"))?;
    Ok(Asked {
        run: setup.options().with_context(|| file.to_string())?,
        calibrations: Calibrations::default(),
    })
}

/// What watches a run: nothing, plots, a file.
struct Watchers {
    trace: Option<TraceObserver>,
    file: Option<EstimateFile>,
}

impl RunObserver for Watchers {
    fn estimate(&mut self, record: &EstimateRecord) {
        if let Some(trace) = &mut self.trace {
            trace.estimate(record);
        }
        if let Some(file) = &mut self.file {
            file.estimate(record);
        }
    }

    fn innovation(&mut self, record: &InnovationRecord) {
        if let Some(trace) = &mut self.trace {
            trace.innovation(record);
        }
    }

    fn position(&mut self, record: &PositionRecord) {
        if let Some(trace) = &mut self.trace {
            trace.position(record);
        }
    }
}
