//! `northing demo`: a virtual phone goes through the laboratory of the paper, and the truth is known.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use clap::Args;
use northing_core::calibration::RestCalibration;
use northing_core::nalgebra::Vector3;
use northing_evaluation::estimators::EstimatorKind;
use northing_evaluation::observer::{EstimateRecord, InnovationRecord, RunObserver, TraceObserver};
use northing_evaluation::options::{MagnetometerSource, RunOptions};
use northing_evaluation::parameters::Profile;
use northing_evaluation::summary::RunSummary;
use northing_recording::atomic_file::write_whole;
use northing_recording::{OpenOptions, Recording, open};
use northing_simulation::VirtualPhone;
use northing_simulation::virtual_phone::Motion;

use crate::calibration_file;
use crate::commands::calibrate;
use crate::commands::run::TRACE_CAPACITY;
use crate::estimate_file::EstimateFile;
use crate::estimation::{parameters_used, run_over};
use crate::output::{check_free, print, print_json};
use crate::rest_span::{self, Calibrated, Span};
use crate::table::Table;
use crate::virtual_recording::{self, PhoneArgs};
use crate::{run_report, summary_text};

/// What the demonstration compares: the filter, integration alone, and the phone itself.
const COMPARED: [EstimatorKind; 3] = [
    EstimatorKind::Mekf,
    EstimatorKind::Integration,
    EstimatorKind::Device,
];
/// The recording's name.
const RECORDING: &str = if cfg!(feature = "parquet") {
    "recording.parquet"
} else {
    "recording.csv"
};

/// Arguments of `demo`.
#[derive(Debug, Args)]
#[command(
    long_about = "A virtual phone lies on a table, is turned about by hand, and is put back. Its sensors have \
                  bias and noise, and the truth is known. The demonstration runs the laboratory steps of \
                  Utrera & Vazquez (2021) on its recording: calibrate at rest, estimate, compare, and the \
                  final test. Everything is written into one folder.",
    after_help = "\
Examples:
  northing demo
  northing demo --seed 7 --motion brisk --disturbance magnetic --out disturbed
  northing demo --record-only phone.csv --duration 600
  northing demo --record-only - --samples 1000000 | northing run - --json"
)]
pub(crate) struct DemoArgs {
    /// Folder for recording, calibration, estimates and report
    #[arg(long, value_name = "FOLDER", default_value = "northing-demo")]
    out: PathBuf,
    /// Overwrite what an earlier demonstration wrote
    #[arg(long)]
    force: bool,
    /// Print one JSON document: the runs of step 5
    #[arg(long, conflicts_with = "record_only")]
    json: bool,
    /// Only make the recording: a .csv or .parquet file, or - for CSV on standard output
    #[arg(long, value_name = "FILE")]
    record_only: Option<PathBuf>,
    /// Format of --record-only: csv or parquet
    #[arg(long, value_name = "FORMAT", requires = "record_only")]
    format: Option<String>,
    /// End the recording after so many samples (of all sensors together)
    #[arg(
        long,
        value_name = "NUMBER",
        requires = "record_only",
        conflicts_with = "duration"
    )]
    samples: Option<u64>,
    #[command(flatten)]
    phone: PhoneArgs,
}

/// Demonstrates, or only records.
pub(crate) fn execute(args: &DemoArgs) -> Result<()> {
    let phone = args.phone.phone(args.samples)?;
    if let Some(output) = &args.record_only {
        virtual_recording::check_format(output, args.format.as_deref())?;
        virtual_recording::write(&phone, args.samples, output, args.force)?;
        return Ok(());
    }
    let folder = Folder::prepare(&args.out, args.force)?;
    let mut lab = Lab {
        phone: &phone,
        folder: &folder,
        json: args.json,
        runs: Vec::new(),
    };
    lab.work()?;
    if args.json {
        print_json(&lab.runs)
    } else {
        Ok(())
    }
}

/// The files of a demonstration.
struct Folder {
    recording: PathBuf,
    calibration: PathBuf,
    estimates: PathBuf,
    report: PathBuf,
    force: bool,
}

impl Folder {
    /// Makes the folder, and refuses to write over an earlier demonstration.
    fn prepare(path: &Path, force: bool) -> Result<Self> {
        std::fs::create_dir_all(path)
            .with_context(|| format!("{}: cannot make this folder", path.display()))?;
        let folder = Self {
            recording: path.join(RECORDING),
            calibration: path.join("calibration.toml"),
            estimates: path.join("estimates.csv"),
            report: path.join("report.html"),
            force,
        };
        for file in [
            &folder.recording,
            &folder.calibration,
            &folder.estimates,
            &folder.report,
        ] {
            check_free(file, force)?;
        }
        Ok(folder)
    }

    fn open(&self) -> Result<Recording> {
        Ok(open(&self.recording, &OpenOptions::default())?)
    }
}

/// The laboratory, step by step.
struct Lab<'a> {
    phone: &'a VirtualPhone,
    folder: &'a Folder,
    json: bool,
    runs: Vec<RunSummary>,
}

impl Lab<'_> {
    fn work(&mut self) -> Result<()> {
        self.say(
            "A virtual phone goes through the laboratory of Utrera & Vazquez (2021). Its sensors have bias\n\
             and noise, and because it is simulated, the truth is known.\n",
        )?;
        self.place()?;
        let calibrated = self.calibrate()?;
        let options = self.tune(&calibrated.calibration)?;
        self.experiment(&options, &calibrated.calibration)?;
        self.compare(&options)?;
        self.final_test()?;
        self.what_next()
    }

    /// Prints, unless standard output is for JSON.
    fn say(&self, text: &str) -> Result<()> {
        if self.json {
            Ok(())
        } else {
            print(&format!("{text}\n"))
        }
    }

    fn place(&self) -> Result<()> {
        let config = self.phone.config();
        let moved = match config.motion {
            Motion::Rest => "keeps lying there",
            Motion::Gentle => "is turned gently by hand",
            _ => "is turned briskly by hand",
        };
        let samples =
            virtual_recording::write(self.phone, None, &self.folder.recording, self.folder.force)?;
        self.say(&format!(
            "1. Place the device\n   \
             It lies flat: this pose is the reference. It rests {:.0} s, {moved} for {:.0} s, is put back and\n   \
             rests {:.0} s. Disturbance: {}. {:.0} s, {samples} samples: {}\n",
            config.rest_before_s,
            config.motion_s,
            config.rest_after_s,
            config.disturbance.name(),
            config.duration_s(),
            self.folder.recording.display()
        ))
    }

    fn calibrate(&self) -> Result<Calibrated> {
        let mut recording = self.folder.open()?;
        let span = Span {
            from_s: Some(0.0),
            to_s: Some(self.phone.config().rest_before_s),
        };
        let calibrated =
            rest_span::calibrate(recording.by_ref(), span, MagnetometerSource::Device)?;
        let name = self.folder.recording.display().to_string();
        let text = calibration_file::to_toml(&calibrated, &name)?;
        write_whole(&self.folder.calibration, text.as_bytes(), self.folder.force)?;
        let error = bias_error_deg_s(self.phone, &calibrated.calibration);
        let known = error
            .map(|error| format!("   True bias: the calibration is off by {error:.4} deg/s.\n"));
        self.say(&format!(
            "2. Calibrate at rest, {:.0} s\n{}{}   Verdict: accepted, it was at rest. Written to {}\n",
            calibrated.span_s[1] - calibrated.span_s[0],
            calibrate::values(&calibrated.calibration, "   "),
            known.unwrap_or_default(),
            self.folder.calibration.display()
        ))?;
        Ok(calibrated)
    }

    /// Q and R from the noise just measured.
    fn tune(&self, calibration: &RestCalibration<f64>) -> Result<RunOptions> {
        let mut options = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
        options.calibrate_first_s = Some(self.phone.config().rest_before_s);
        let config = parameters_used(&options, Some(calibration));
        self.say(&format!(
            "3. Set Q and R: the noise just measured (profile lab)\n   \
             Q  gyroscope noise {:.2e} rad/s/sqrt(Hz), bias random walk {:.2e} rad/s/sqrt(s)\n   \
             R  accelerometer {:.4} m/s^2, magnetometer {:.3} microtesla\n",
            config.gyroscope_noise_density,
            config.gyroscope_bias_random_walk,
            config.accelerometer_std,
            config.magnetometer_std_ut
        ))?;
        Ok(options)
    }

    fn experiment(
        &mut self,
        options: &RunOptions,
        calibration: &RestCalibration<f64>,
    ) -> Result<()> {
        let mut recording = self.folder.open()?;
        let metadata = recording.metadata().clone();
        let mut watchers = Watchers {
            trace: TraceObserver::new(TRACE_CAPACITY, metadata.world_frame),
            file: EstimateFile::create(&self.folder.estimates, self.folder.force)?,
        };
        let summary = self.run(&mut recording, options, &mut watchers)?;
        watchers.file.finish()?;
        let config = parameters_used(options, Some(calibration));
        let html = run_report::render(&summary, &config, &metadata, watchers.trace.trace());
        write_whole(&self.folder.report, html.as_bytes(), self.folder.force)?;
        let mut text = String::from("4. Experiment: mekf from the calibrated start\n");
        if let Some(error) = &summary.error_deg {
            let _ = writeln!(
                text,
                "   Attitude error {:.3} deg RMS (heading {:.3}, inclination {:.3})",
                error.total_rmse, error.heading_rmse, error.inclination_rmse
            );
        }
        if let Some(nees) = summary.nees_mean {
            let _ = writeln!(text, "   {}", summary_text::nees_in_words(nees));
        }
        for verdict in &summary.verdicts {
            for sentence in &verdict.sentences {
                let _ = writeln!(text, "   {sentence}");
            }
        }
        self.say(&text)?;
        self.runs.push(summary);
        Ok(())
    }

    fn run(
        &self,
        recording: &mut Recording,
        options: &RunOptions,
        observer: &mut dyn RunObserver,
    ) -> Result<RunSummary> {
        let name = self.folder.recording.display().to_string();
        run_over(recording, &name, options, observer, || {})
    }

    fn compare(&mut self, options: &RunOptions) -> Result<()> {
        for estimator in COMPARED.into_iter().skip(self.runs.len()) {
            let options = RunOptions {
                estimator,
                ..options.clone()
            };
            let summary = self.run(&mut self.folder.open()?, &options, &mut ())?;
            self.runs.push(summary);
        }
        let mut table = Table::new(&["<estimator", "error deg", "heading deg", "inclination deg"]);
        for run in &self.runs {
            let cell = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.3}"));
            let error = run.error_deg;
            table.row([
                run.estimator.to_string(),
                cell(error.map(|e| e.total_rmse)),
                cell(error.map(|e| e.heading_rmse)),
                cell(error.map(|e| e.inclination_rmse)),
            ]);
        }
        self.say(&format!(
            "5. Compare with direct integration and with the phone's own orientation (RMS)\n{}",
            table.render("   ")
        ))
    }

    fn final_test(&self) -> Result<()> {
        let Some(run) = self.runs.first() else {
            bail!("no run to test");
        };
        let text = match &run.final_test {
            Some(test) => {
                let estimated = test.estimated_error_deg.map(|e| format!("{e:.3} deg"));
                format!(
                    "   Calculated error {:.3} deg, estimated error {}\n   {}\n",
                    test.calculated_error_deg,
                    estimated.unwrap_or_else(|| "unknown".to_owned()),
                    test.sentence
                )
            }
            None => {
                "   Does not apply: the recording does not end at rest in the reference pose.\n"
                    .to_owned()
            }
        };
        self.say(&format!(
            "6. Final test: back in the reference pose\n{text}"
        ))
    }

    fn what_next(&self) -> Result<()> {
        let recording = self.folder.recording.display();
        let calibration = self.folder.calibration.display();
        self.say(&format!(
            "Report: {} (open it in a browser)\n\n\
             Try next:\n  \
             northing run {recording} --calibration {calibration} --sensors gyro,acc\n  \
             northing compare {recording}\n  \
             northing run YOUR-RECORDING.zip --report report.html",
            self.folder.report.display()
        ))
    }
}

/// How far the calibrated bias is from the one the phone was given, deg/s.
fn bias_error_deg_s(phone: &VirtualPhone, calibration: &RestCalibration<f64>) -> Option<f64> {
    let metadata = phone.metadata();
    let text = metadata.extra.get("true_initial_gyroscope_bias_rad_s")?;
    let numbers: Vec<f64> = text
        .split(' ')
        .filter_map(|number| number.parse().ok())
        .collect();
    let [x, y, z] = numbers[..] else { return None };
    Some(
        (calibration.gyroscope_bias() - Vector3::new(x, y, z))
            .norm()
            .to_degrees(),
    )
}

struct Watchers {
    trace: TraceObserver,
    file: EstimateFile,
}

impl RunObserver for Watchers {
    fn estimate(&mut self, record: &EstimateRecord) {
        self.trace.estimate(record);
        self.file.estimate(record);
    }

    fn innovation(&mut self, record: &InnovationRecord) {
        self.trace.innovation(record);
    }
}
