//! Finished experiments: their results, what-if, and the rows of their table.

use std::collections::BTreeMap;
use std::convert::Infallible;
use std::time::Instant;

use northing_evaluation::attitude::parameters::Parameters;
use northing_evaluation::attitude::trace::Trace;
use northing_evaluation::{
    EstimatorKind, EvaluationError, RunObserver, RunOptions, RunSummary, TraceObserver, run,
};
use northing_recording::wire::events;
use northing_recording::{Event, SensorKind};
use rayon::prelude::*;
use serde_json::{Map, Value};

use crate::messages::SensorUse;
use crate::session::aids::AIDS;
use crate::session::experiment::Experiment;
use crate::session::with_settings;
use crate::to_page::{
    self, CurveColumns, ExperimentResult, ExperimentRow, ExperimentState, ResultCell, ToPage,
    TraceColumns,
};

/// Points of a trace that a page draws.
pub const TRACE_POINTS: usize = 1500;
/// Values of a curve over one parameter.
const CURVE_POINTS: usize = 21;
/// How far a curve reaches to both sides of the present value.
const CURVE_REACH: f64 = 30.0;
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

/// Runs several estimators at once on all processors; the trace is the subject's.
fn run_all(
    experiment: &Experiment,
    options: &RunOptions,
    estimators: &[EstimatorKind],
    subject: EstimatorKind,
) -> Result<(BTreeMap<&'static str, RunSummary>, Trace), EvaluationError> {
    let runs: Result<Vec<_>, EvaluationError> = estimators
        .par_iter()
        .map(|kind| {
            let mut trace = TraceObserver::new(TRACE_POINTS, options.world_frame);
            let summary = run_over(experiment, options, *kind, &mut trace)?;
            Ok((*kind, summary, trace.into_trace()))
        })
        .collect();
    let mut summaries = BTreeMap::new();
    let mut drawn = None;
    for (kind, summary, trace) in runs? {
        summaries.insert(kind.name(), summary);
        if kind == subject {
            drawn = Some(trace);
        }
    }
    Ok((summaries, drawn.unwrap_or_else(|| Trace::new(0))))
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
        let (summaries, _) = run_all(
            &self.experiment,
            &self.options,
            &self.estimators,
            self.subject,
        )
        .map_err(|error| format!("experiment `{}`: {error}", self.title()))?;
        self.summaries = summaries;
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

    /// Runs it again with other parameters: the answer to this request.
    ///
    /// # Errors
    /// A name or value does not fit, in a sentence.
    pub fn what_if(
        &self,
        settings: &Map<String, Value>,
        request: Value,
    ) -> Result<to_page::WhatIf, String> {
        let asked = Instant::now();
        let text = |error: EvaluationError| error.to_string();
        let options = with_settings(&self.options, None, settings).map_err(text)?;
        let (summaries, trace) =
            run_all(&self.experiment, &options, &self.estimators, self.subject).map_err(text)?;
        Ok(to_page::WhatIf {
            request,
            id: self.id.clone(),
            subject: self.subject,
            elapsed_ms: asked.elapsed().as_secs_f64() * 1e3,
            results: summaries,
            trace: trace_columns(&trace),
        })
    }

    /// NIS and error of the subject over a range of one parameter, beside other settings; `None` when
    /// it is no longer `wanted`, which is asked before each run.
    ///
    /// # Errors
    /// A name or value does not fit, in a sentence.
    pub fn curve(
        &self,
        settings: &Map<String, Value>,
        parameter: &str,
        wanted: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<CurveColumns>, String> {
        let options = with_settings(&self.options, None, settings).map_err(|e| e.to_string())?;
        let config = options.in_force().config;
        let values = serde_json::to_value(config).unwrap_or_default();
        let present = values.get(parameter).and_then(Value::as_f64);
        let present = present.filter(|v| *v > 0.0).ok_or_else(|| {
            format!("there is no curve over `{parameter}`: choose a number above 0")
        })?;
        let step = |i: usize| CURVE_REACH.powf(2.0 * i as f64 / (CURVE_POINTS - 1) as f64 - 1.0);
        let values: Vec<f64> = (0..CURVE_POINTS).map(|i| present * step(i)).collect();
        let runs: Vec<Option<RunSummary>> = values
            .par_iter()
            .map(|value| {
                if !wanted() {
                    return None;
                }
                let mut options = options.clone();
                options.set(&format!("{parameter}={value}")).ok()?;
                run_over(&self.experiment, &options, self.subject, &mut ()).ok()
            })
            .collect();
        if !wanted() {
            return Ok(None);
        }
        let column = |of: &dyn Fn(&RunSummary) -> Option<f64>| -> Vec<Option<f64>> {
            runs.iter().map(|run| run.as_ref().and_then(of)).collect()
        };
        Ok(Some(CurveColumns {
            parameter: parameter.to_owned(),
            nis: AIDS
                .iter()
                .map(|aid| (aid.sensor, column(&|s| (aid.nis_mean)(&s.nis_mean))))
                .filter(|(_, values): &(_, Vec<_>)| values.iter().any(Option::is_some))
                .map(|(sensor, values)| (sensor.name(), values))
                .collect(),
            error_deg: column(&error_deg),
            values,
        }))
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
                let cell = ResultCell {
                    calculated_error_deg: test.map(|t| t.calculated_error_deg),
                    estimated_error_deg: test.and_then(|t| t.estimated_error_deg),
                    verdict: test.and_then(|t| t.verdict),
                    nis_acc: s.nis_mean.accelerometer,
                    nis_mag: s.nis_mean.magnetometer,
                    nis_compass: s.nis_mean.compass,
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
            settings: serde_json::to_value(self.settings()).unwrap_or_default(),
            subject: self.subject.name().to_owned(),
            sensors: self.experiment.sensors(),
            used: SensorUse::of(&self.options.sensors),
            results,
            is_earlier: false,
            has_samples: true,
        }
    }
}

/// RMS error where the truth is known, otherwise the error of the final test.
fn error_deg(summary: &RunSummary) -> Option<f64> {
    let known = summary.error_deg.map(|e| e.total_rmse);
    known.or(summary.final_test.as_ref().map(|t| t.calculated_error_deg))
}

/// What plots need, column by column; angles are rows of yaw, pitch, roll.
fn trace_columns(trace: &Trace) -> TraceColumns {
    let points = trace.points.items();
    TraceColumns {
        t_s: points.iter().map(|p| p.time_s).collect(),
        angles_deg: points.iter().map(|p| p.angles_deg).collect(),
        std_deg: points.iter().map(|p| p.angles_std_deg).collect(),
        error_deg: points.iter().map(|p| p.error_deg.map(|e| e[0])).collect(),
    }
}

/// SHA-256 of the events as [`events::encode`] writes them.
pub(crate) fn hash(measured: &[Event]) -> String {
    let digest = ring::digest::digest(&ring::digest::SHA256, &events::encode(measured));
    digest.as_ref().iter().map(|b| format!("{b:02x}")).collect()
}
