//! Finished experiments: their results, and the rows of their table.

use std::collections::BTreeMap;
use std::convert::Infallible;

use northing_evaluation::attitude::parameters::Parameters;
use northing_evaluation::statistics::verdict::findings::{Cause, Finding};
use northing_evaluation::{
    EstimatorKind, EvaluationError, RunObserver, RunOptions, RunSummary, run,
};
use northing_recording::plausibility::Plausibility;
use northing_recording::wire::events;
use northing_recording::{Event, OpenOptions, RecordingError, SensorKind};
use rayon::prelude::*;

use crate::messages::SensorUse;
use crate::session::experiment::Experiment;
use crate::to_page::{self, ExperimentResult, ExperimentRow, ExperimentState, ResultCell, ToPage};
use crate::what_if::Originals;

/// Points of a trace that a page draws.
pub const TRACE_POINTS: usize = 1500;
/// Seconds at the start that are not scored where an estimator aligns itself.
const SKIP_S: f64 = 1.0;

/// A finished experiment.
#[derive(Debug)]
pub struct Finished {
    /// What it is addressed by.
    pub id: String,
    /// The device.
    pub device: String,
    /// What people call the device.
    pub device_name: String,
    /// When it ended, UTC.
    pub at: String,
    /// What was measured.
    pub experiment: Experiment,
    /// The options it is run with.
    pub options: RunOptions,
    /// The estimators that ran.
    pub estimators: Vec<EstimatorKind>,
    /// The one of them that result, curves, files and report are about.
    pub subject: EstimatorKind,
    /// The outcome of each.
    pub summaries: BTreeMap<&'static str, RunSummary>,
    /// SHA-256 of the events, in hexadecimal.
    pub hash: String,
    /// Traces of the experiment as it was, for what-if.
    pub originals: Originals,
}

/// A time of arrival (ns since 1970) for people, in UTC.
#[must_use]
pub fn utc(unix_ns: i64) -> String {
    let time = time::OffsetDateTime::from_unix_timestamp_nanos(i128::from(unix_ns))
        .unwrap_or(time::OffsetDateTime::UNIX_EPOCH);
    let (date, clock) = (time.date(), time.time());
    format!(
        "{date} {:02}:{:02}:{:02} UTC",
        clock.hour(),
        clock.minute(),
        clock.second()
    )
}

/// Runs one estimator over an experiment, from the state it had at the first sample.
///
/// # Errors
/// As [`run`].
pub fn run_over(
    experiment: &Experiment,
    options: &RunOptions,
    estimator: EstimatorKind,
    observer: &mut dyn RunObserver,
) -> Result<RunSummary, EvaluationError> {
    let options = run_options(experiment, options, estimator);
    let events = experiment.events.iter();
    let events = events.map(|event| Ok::<_, Infallible>(*event));
    run(events, &options, observer)
}

/// What one estimator is run with over an experiment.
pub(crate) fn run_options(
    experiment: &Experiment,
    options: &RunOptions,
    estimator: EstimatorKind,
) -> RunOptions {
    let start = experiment.start_of(estimator);
    RunOptions {
        estimator,
        start,
        skip_s: if start.is_some() { 0.0 } else { SKIP_S },
        ..options.clone()
    }
}

/// Runs several estimators at once on all processors.
fn run_all(
    experiment: &Experiment,
    options: &RunOptions,
    estimators: &[EstimatorKind],
) -> Result<BTreeMap<&'static str, RunSummary>, EvaluationError> {
    let runs = estimators.par_iter().map(|kind| {
        let summary = run_over(experiment, options, *kind, &mut ())?;
        Ok((kind.name(), summary))
    });
    runs.collect()
}

/// What readers of files refuse: numbers that are of another unit, or of other axes.
fn wrong_unit(events: &[Event]) -> Option<Finding> {
    let mut plausibility = Plausibility::new(&OpenOptions::default());
    let mut checked = events
        .iter()
        .try_for_each(|event| plausibility.check(event, ""));
    checked = checked.and_then(|()| plausibility.finish(""));
    let Err(RecordingError::ImplausibleUnit {
        sensor, evidence, ..
    }) = checked
    else {
        return None;
    };
    let kind = SensorKind::ALL
        .into_iter()
        .find(|kind| kind.name() == sensor)?;
    Some(Finding {
        cause: Cause::Unit,
        sensor: kind,
        confidence: 0.97,
        sentence: format!(
            "The numbers of the {sensor} are not what is said of them: {evidence}. Nothing here is right before that is put right \
             where they are sent."
        ),
    })
}

impl Finished {
    /// With its results and its hash.
    ///
    /// # Errors
    /// There was nothing to estimate, in a sentence.
    pub fn evaluated(mut self) -> Result<Self, String> {
        let events = &self.experiment.events;
        let has_device = events
            .iter()
            .any(|e| e.sample.kind() == SensorKind::DeviceOrientation);
        if has_device {
            self.estimators.push(EstimatorKind::Device);
        }
        self.options.recording = format!("{} of {}", self.title(), self.device_name);
        let summaries = run_all(&self.experiment, &self.options, &self.estimators)
            .map_err(|error| format!("experiment `{}`: {error}", self.title()))?;
        self.summaries = summaries;
        if let Some(wrong) = wrong_unit(&self.experiment.events) {
            for summary in self.summaries.values_mut() {
                summary.findings.insert(0, wrong.clone());
            }
        }
        self.hash = hash(events);
        Ok(self)
    }

    /// The parameters in force, those of estimators that did not run among them.
    #[must_use]
    pub fn settings(&self) -> Parameters {
        self.options.in_force().config
    }

    /// What people call it.
    #[must_use]
    pub fn title(&self) -> &str {
        match self.experiment.name.as_str() {
            "" => &self.id,
            name => name,
        }
    }

    /// The message that says it is done.
    #[must_use]
    pub fn message(&self) -> ToPage {
        let summaries = self.summaries.iter();
        ToPage::Experiment(Box::new(to_page::Experiment {
            device: self.device.clone(),
            id: self.id.clone(),
            state: ExperimentState::Done,
            progress: 1.0,
            remaining_s: 0.0,
            result: Some(ExperimentResult {
                subject: self.subject,
                final_tests: summaries
                    .map(|(name, s)| (*name, s.final_test.clone()))
                    .collect(),
                summary: self.summaries.clone(),
                settings: self.settings(),
                hash: self.hash.clone(),
                origin: self.origin(),
            }),
        }))
    }

    /// Where the numbers come from, in words.
    fn origin(&self) -> String {
        let mut text = if self.experiment.start_of(self.subject).is_some() {
            "The recording was run again from the state the estimate had when it began: the same \
             numbers as live."
        } else {
            "Nothing was estimated when the recording began: it was run again with an alignment of \
             its own in the first second."
        }
        .to_owned();
        if !self.experiment.changed.is_empty() {
            text.push_str(&format!(
                " Changed while it ran: {}. The result takes what was in force at the end.",
                self.experiment.changed.join(", ")
            ));
        }
        text
    }

    /// Its row in the table of experiments.
    #[must_use]
    pub fn row(&self) -> ExperimentRow {
        let results = self
            .summaries
            .iter()
            .map(|(name, s)| {
                let test = s.final_test.as_ref();
                // Of the samples by which the sensor is judged: one that a magnet explains says nothing of its R.
                let nis = |sensor: SensorKind, of_all: Option<f64>| {
                    let judged = s.verdicts.iter().find(|verdict| verdict.sensor == sensor);
                    judged.map(|verdict| verdict.mean_nis).or(of_all)
                };
                let cell = ResultCell {
                    calculated_error_deg: test.map(|t| t.calculated_error_deg),
                    estimated_error_deg: test.and_then(|t| t.estimated_error_deg),
                    degrees_of_freedom: test.map(|t| t.degrees_of_freedom),
                    calculated_tilt_deg: test.map(|t| t.calculated_tilt_deg),
                    estimated_tilt_deg: test.and_then(|t| t.estimated_tilt_deg),
                    verdict: test.and_then(|t| t.verdict),
                    nis_acc: nis(SensorKind::Accelerometer, s.nis_mean.accelerometer),
                    nis_mag: nis(SensorKind::Magnetometer, s.nis_mean.magnetometer),
                    nis_compass: nis(SensorKind::CompassHeading, s.nis_mean.compass),
                    error_deg: error_deg(s),
                };
                ((*name).to_owned(), cell)
            })
            .collect();
        ExperimentRow {
            id: self.id.clone(),
            device: self.device_name.clone(),
            device_id: self.device.clone(),
            name: self.title().to_owned(),
            at: self.at.clone(),
            duration_s: self.experiment.duration_s(),
            asked_s: self.experiment.seconds,
            settings: serde_json::to_value(self.settings()).unwrap_or_default(),
            subject: self.subject.name().to_owned(),
            sensors: self.experiment.sensors(),
            used: SensorUse::of(&self.options.sensors),
            results,
            is_earlier: false,
            has_samples: true,
            is_archived: false,
        }
    }
}

/// RMS error where the truth is known, otherwise the error of the final test that is judged.
pub(crate) fn error_deg(summary: &RunSummary) -> Option<f64> {
    let known = summary.error_deg.map(|e| e.total_rmse);
    known.or(summary.final_test.as_ref().map(|t| t.judged_deg().0))
}

/// SHA-256 of the events as [`events::encode`] writes them.
pub(crate) fn hash(measured: &[Event]) -> String {
    let digest = ring::digest::digest(&ring::digest::SHA256, &events::encode(measured));
    digest.as_ref().iter().map(|b| format!("{b:02x}")).collect()
}
