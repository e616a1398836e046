//! The laboratory of the paper, step by step, on a virtual phone whose truth is known.
//!
//! Read first: Utrera & Vazquez (2021), section 4; `docs/tutorials/attitude-from-a-phone-recording.md`
//! does the same by hand.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};
use northing_core::calibration::RestCalibration;
use northing_core::nalgebra::Vector3;
use northing_evaluation::attitude::{
    EstimateFile, EstimatorKind, Profile, RunObserver, RunOptions, RunSummary, TraceObserver,
};
use northing_evaluation::calibration::magnetometer::MagnetometerSource;
use northing_evaluation::statistics::consistency::nees_in_words;
use northing_recording::atomic_file::write_whole;
use northing_recording::{OpenOptions, Recording, open};
use northing_report::{HeroPicture, hero_svg};
use northing_simulation::VirtualPhone;
use northing_simulation::virtual_phone::Motion;

use crate::arguments::estimation::run_over;
use crate::arguments::virtual_recording;
use crate::files::output::{check_free, number, print};
use crate::files::rest_calibration;
use crate::invocation::{called, command_line};
use crate::text::rest_calibration::values;
use crate::text::sheet::paragraph;
use crate::text::table::Table;
use northing_evaluation::calibration::rest::{self, Calibrated, Span};
use northing_report::{TRACE_CAPACITY, run_page};

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

/// The files of a demonstration.
pub(crate) struct Folder {
    recording: PathBuf,
    calibration: PathBuf,
    estimates: PathBuf,
    report: PathBuf,
    force: bool,
    /// The folder itself, if it was made for this demonstration.
    made: Option<PathBuf>,
}

/// A demonstration that wrote nothing leaves no folder either.
impl Drop for Folder {
    fn drop(&mut self) {
        if let Some(made) = &self.made {
            // It stays if there is anything in it.
            let _ = std::fs::remove_dir(made);
        }
    }
}

impl Folder {
    /// Makes the folder, and refuses to write over an earlier demonstration.
    pub(crate) fn prepare(path: &Path, force: bool) -> Result<Self> {
        let made = (!path.exists()).then(|| path.to_owned());
        std::fs::create_dir_all(path)
            .with_context(|| format!("{}: cannot make this folder", path.display()))?;
        let folder = Self {
            recording: path.join(RECORDING),
            calibration: path.join("calibration.toml"),
            estimates: path.join("estimates.csv"),
            report: path.join("report.html"),
            force,
            made,
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
pub(crate) struct Lab<'a> {
    phone: &'a VirtualPhone,
    folder: &'a Folder,
    silent: bool,
    pub(crate) runs: Vec<RunSummary>,
    /// What a picture needs of each run.
    traces: Vec<TraceObserver>,
}

impl<'a> Lab<'a> {
    /// The laboratory of this phone; a silent one only collects its runs.
    pub(crate) fn new(phone: &'a VirtualPhone, folder: &'a Folder, silent: bool) -> Self {
        Self {
            phone,
            folder,
            silent,
            runs: Vec::new(),
            traces: Vec::new(),
        }
    }

    /// Walks through all steps.
    ///
    /// # Errors
    /// A file cannot be written; with another motion than the script's, a step cannot be made.
    pub(crate) fn work(&mut self) -> Result<()> {
        self.say(
            "A virtual phone goes through the laboratory of Utrera & Vazquez (2021). Its sensors have bias\n\
             and noise, and because it is simulated, the truth is known.\n",
        )?;
        self.place()?;
        let calibrated = self.calibrate()?;
        let options = self.tune(&calibrated.calibration)?;
        self.experiment(&options)?;
        self.compare(&options)?;
        self.final_test()?;
        self.what_next()
    }

    /// Prints, unless silent.
    fn say(&self, text: &str) -> Result<()> {
        if self.silent {
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
            Motion::Tumble => "is turned all over",
            _ => "is turned briskly by hand",
        };
        let samples =
            virtual_recording::write(self.phone, None, &self.folder.recording, self.folder.force)?;
        let story = format!(
            "It lies flat: this pose is the reference. It rests {:.0} s, {moved} for {:.0} s, is put back \
             and rests {:.0} s. Disturbance: {}.",
            config.rest_before_s,
            config.motion_s,
            config.rest_after_s,
            config.disturbance.name(),
        );
        self.say(&format!(
            "1. Place the device\n{}   {:.0} s, {samples} samples: {}\n",
            paragraph(&story, "   "),
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
            rest::calibrate(recording.by_ref(), span, Some(MagnetometerSource::Device))?;
        let name = self.folder.recording.display().to_string();
        let text = rest_calibration::to_toml(&calibrated, &name)?;
        write_whole(&self.folder.calibration, text.as_bytes(), self.folder.force)?;
        let error = bias_error_deg_s(self.phone, &calibrated.calibration);
        let known = error
            .map(|error| format!("   True bias: the calibration is off by {error:.4} deg/s.\n"));
        self.say(&format!(
            "2. Calibrate at rest, {:.0} s\n{}{}   Verdict: accepted, it was at rest. Written to {}\n",
            calibrated.span_s[1] - calibrated.span_s[0],
            values(&calibrated.calibration, "   "),
            known.unwrap_or_default(),
            self.folder.calibration.display()
        ))?;
        Ok(calibrated)
    }

    /// Q and R from the noise just measured.
    fn tune(&self, calibration: &RestCalibration<f64>) -> Result<RunOptions> {
        let mut options = RunOptions::new(EstimatorKind::Mekf, Profile::Lab);
        options.calibrate_first_s = Some(self.phone.config().rest_before_s);
        let config = options.calibrated_by(calibration).config.attitude;
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

    fn experiment(&mut self, options: &RunOptions) -> Result<()> {
        let mut recording = self.folder.open()?;
        let metadata = recording.metadata().clone();
        let trace = TraceObserver::new(TRACE_CAPACITY, metadata.world_frame);
        let (estimates, force) = (&self.folder.estimates, self.folder.force);
        let file = EstimateFile::create(estimates, options.estimator, force)?;
        let mut watchers = (trace, file);
        let summary = self.run(&mut recording, options, &mut watchers)?;
        let (trace, file) = watchers;
        file.finish()?;
        let html = run_page::render(&summary, &metadata, trace.trace(), command_line());
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
            text.push_str(&paragraph(&nees_in_words(nees), "   "));
        }
        for sentence in summary
            .verdicts
            .iter()
            .flat_map(|verdict| &verdict.sentences)
        {
            text.push_str(&paragraph(sentence, "   "));
        }
        self.say(&text)?;
        self.runs.push(summary);
        self.traces.push(trace);
        Ok(())
    }

    fn run(
        &self,
        recording: &mut Recording,
        options: &RunOptions,
        observer: &mut dyn RunObserver,
    ) -> Result<RunSummary> {
        let name = self.folder.recording.display().to_string();
        run_over(recording, &name, options, observer)
    }

    fn compare(&mut self, options: &RunOptions) -> Result<()> {
        for estimator in COMPARED.into_iter().skip(self.runs.len()) {
            let options = RunOptions {
                estimator,
                ..options.clone()
            };
            let mut recording = self.folder.open()?;
            let mut trace = TraceObserver::new(TRACE_CAPACITY, recording.metadata().world_frame);
            let summary = self.run(&mut recording, &options, &mut trace)?;
            self.runs.push(summary);
            self.traces.push(trace);
        }
        let mut table = Table::new(&["<estimator", "error deg", "heading deg", "inclination deg"]);
        for run in &self.runs {
            let cell = |value: Option<f64>| number(value, 3);
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
                    "   Calculated error {:.3} deg, estimated error {}\n{}",
                    test.calculated_error_deg,
                    estimated.unwrap_or_else(|| "unknown".to_owned()),
                    paragraph(&test.sentence, "   ")
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

    /// One picture of the result (SVG): the filter with its band, integration drifting away, the
    /// phone's own orientation.
    ///
    /// # Errors
    /// The laboratory has not been walked through.
    pub(crate) fn picture(&self) -> Result<String> {
        let [filter, integration, device] = &self.traces[..] else {
            bail!("no runs to draw");
        };
        let config = self.phone.config();
        let subtitle = format!(
            "A virtual phone whose truth is known (seed {}, {} motion, disturbance: {}).",
            config.seed,
            config.motion.name(),
            config.disturbance.name()
        );
        Ok(hero_svg(&HeroPicture {
            title: "Which way is it pointing, and how sure are we?",
            subtitle: &subtitle,
            filter: ("MEKF", filter.trace()),
            drifting: ("integration", integration.trace()),
            other: Some(("the phone's own", device.trace())),
        }))
    }

    fn what_next(&self) -> Result<()> {
        let northing = called();
        let recording = self.folder.recording.display();
        let calibration = self.folder.calibration.display();
        self.say(&format!(
            "Report: {} (open it in a browser)\n\n\
             Try next:\n  \
             {northing} run {recording} --calibration {calibration} --sensors gyro,acc\n  \
             {northing} compare {recording} --calibration {calibration} --profile lab\n  \
             {northing} run {recording} --calibration {calibration} --profile lab --smooth\n\
             and on a recording of your own, from Sensor Logger or as CSV:\n  \
             {northing} run walk.zip --report walk.html",
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
