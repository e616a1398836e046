//! What-if: an experiment run again with other parameters, sensors, estimators or worse samples, beside how it was.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::Instant;

use northing_evaluation::attitude::options::SensorSelection;
use northing_evaluation::attitude::trace::Trace;
use northing_evaluation::{
    EstimateRecord, EstimatorKind, EvaluationError, InnovationRecord, RunObserver, RunOptions,
    RunSummary, TraceObserver,
};
use northing_recording::{Event, SensorKind};
use rayon::prelude::*;
use serde_json::Value;

use crate::experiments::{Finished, TRACE_POINTS, error_deg, run_options, run_over};
use crate::lab::lock;
use crate::messages::Change;
use crate::session::aids::AIDS;
use crate::session::experiment::Experiment;
use crate::session::with_settings;
use crate::to_page::{CurveColumns, NisColumns, TraceColumns, WhatIf};

/// Values of a curve over one parameter.
const CURVE_POINTS: usize = 21;
/// How far a curve reaches to both sides of the present value.
const CURVE_REACH: f64 = 30.0;
/// A curve of NIS over time has so many means.
const NIS_POINTS: f64 = 200.0;
/// Each of them over no less than this, s.
const SHORTEST_MEAN_S: f64 = 0.25;

/// How the subject did on the samples as they were measured, of each estimator that was asked for.
#[derive(Debug, Default)]
pub struct Originals(Mutex<BTreeMap<EstimatorKind, Arc<TraceColumns>>>);

/// An experiment as it would have been.
#[derive(Debug)]
pub struct Altered<'a> {
    experiment: Cow<'a, Experiment>,
    options: RunOptions,
    estimators: Vec<EstimatorKind>,
    subject: EstimatorKind,
}

impl Finished {
    /// The experiment with this change.
    ///
    /// # Errors
    /// A name or value does not fit, or nothing would run, in a sentence.
    pub fn altered(&self, change: &Change) -> Result<Altered<'_>, String> {
        change.alterations.check()?;
        let options = with_settings(&self.options, None, &change.settings);
        let mut options = options.map_err(|error| error.to_string())?;
        if let Some(used) = change.used {
            options.sensors = SensorSelection {
                magnetometer_source: self.options.sensors.magnetometer_source,
                ..used.selection()?
            };
        }
        let estimators = self.chosen(change.estimators.as_deref())?;
        let subject = match change.subject {
            Some(subject) if !estimators.contains(&subject) => {
                return Err(format!("`{subject}` is not among the estimators that run"));
            }
            Some(subject) => subject,
            None if estimators.contains(&self.subject) => self.subject,
            None => estimators[0],
        };
        let experiment = match change.alterations.is_none() {
            true => Cow::Borrowed(&self.experiment),
            false => Cow::Owned(Experiment {
                name: self.experiment.name.clone(),
                seconds: self.experiment.seconds,
                events: change.alterations.apply(&self.experiment.events),
                starts: self.experiment.starts.clone(),
                changed: Vec::new(),
            }),
        };
        Ok(Altered {
            experiment,
            options,
            estimators,
            subject,
        })
    }

    /// The estimators to run; the device's own orientation only where it was recorded.
    fn chosen(&self, wanted: Option<&[EstimatorKind]>) -> Result<Vec<EstimatorKind>, String> {
        let Some(wanted) = wanted else {
            return Ok(self.estimators.clone());
        };
        let mut chosen: Vec<EstimatorKind> = Vec::new();
        for kind in wanted {
            let is_there = *kind != EstimatorKind::Device || self.estimators.contains(kind);
            if is_there && !chosen.contains(kind) {
                chosen.push(*kind);
            }
        }
        match chosen.is_empty() {
            true => Err("no estimator would run: choose one".to_owned()),
            false => Ok(chosen),
        }
    }

    /// Runs it again with a change: the answer to this request.
    ///
    /// # Errors
    /// A name or value does not fit, or nothing can be estimated, in a sentence.
    pub fn what_if(&self, change: &Change, request: Value) -> Result<WhatIf, String> {
        let asked = Instant::now();
        let altered = self.altered(change)?;
        let text = |error: EvaluationError| error.to_string();
        let (runs, original) = rayon::join(|| altered.run(), || self.original(altered.subject));
        let (results, trace) = runs.map_err(text)?;
        Ok(WhatIf {
            request,
            id: self.id.clone(),
            subject: altered.subject,
            elapsed_ms: asked.elapsed().as_secs_f64() * 1e3,
            results,
            trace,
            original: original.map_err(text)?.as_ref().clone(),
        })
    }

    /// What an estimator makes of the samples as they were measured, run once.
    fn original(&self, kind: EstimatorKind) -> Result<Arc<TraceColumns>, EvaluationError> {
        if let Some(known) = lock(&self.originals.0).get(&kind) {
            return Ok(known.clone());
        }
        let (_, columns) = traced(&self.experiment, &self.options, kind)?;
        let columns = Arc::new(columns);
        lock(&self.originals.0).insert(kind, columns.clone());
        Ok(columns)
    }

    /// NIS and error of the subject over a range of one parameter, beside the rest of a change; `None` when
    /// it is no longer `wanted`, which is asked before each run.
    ///
    /// # Errors
    /// A name or value does not fit, in a sentence.
    pub fn curve(
        &self,
        change: &Change,
        parameter: &str,
        wanted: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<CurveColumns>, String> {
        self.altered(change)?.curve(parameter, wanted)
    }
}

impl Altered<'_> {
    /// The samples.
    pub(crate) fn events(&self) -> &[Event] {
        &self.experiment.events
    }

    /// What its subject is run with.
    pub(crate) fn subjects_options(&self) -> RunOptions {
        run_options(&self.experiment, &self.options, self.subject)
    }

    /// Runs the estimators at once on all processors; the trace is the subject's.
    fn run(&self) -> Result<(BTreeMap<&'static str, RunSummary>, TraceColumns), EvaluationError> {
        let runs: Result<Vec<_>, EvaluationError> = self
            .estimators
            .par_iter()
            .map(|kind| {
                if *kind == self.subject {
                    let (summary, columns) = traced(&self.experiment, &self.options, *kind)?;
                    return Ok((*kind, summary, Some(columns)));
                }
                let summary = run_over(&self.experiment, &self.options, *kind, &mut ())?;
                Ok((*kind, summary, None))
            })
            .collect();
        let (mut summaries, mut trace) = (BTreeMap::new(), TraceColumns::default());
        for (kind, summary, columns) in runs? {
            summaries.insert(kind.name(), summary);
            trace = columns.unwrap_or(trace);
        }
        Ok((summaries, trace))
    }

    fn curve(
        &self,
        parameter: &str,
        wanted: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<CurveColumns>, String> {
        let config = self.options.in_force().config;
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
                let mut options = self.options.clone();
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
}

/// Runs one estimator with everything that plots need.
fn traced(
    experiment: &Experiment,
    options: &RunOptions,
    kind: EstimatorKind,
) -> Result<(RunSummary, TraceColumns), EvaluationError> {
    let mut watched = Watched {
        trace: TraceObserver::new(TRACE_POINTS, options.world_frame),
        means: NisMeans::new(experiment.duration_s()),
    };
    let summary = run_over(experiment, options, kind, &mut watched)?;
    let columns = trace_columns(&watched.trace.into_trace(), watched.means);
    Ok((summary, columns))
}

/// What plots need, column by column; angles are rows of yaw, pitch, roll.
fn trace_columns(trace: &Trace, means: NisMeans) -> TraceColumns {
    let points = trace.points.items();
    TraceColumns {
        t_s: points.iter().map(|p| p.time_s).collect(),
        angles_deg: points.iter().map(|p| p.angles_deg).collect(),
        std_deg: points.iter().map(|p| p.angles_std_deg).collect(),
        error_deg: points.iter().map(|p| p.error_deg.map(|e| e[0])).collect(),
        nis: means.columns(),
    }
}

/// Trace and means of one run.
struct Watched {
    trace: TraceObserver,
    means: NisMeans,
}

impl RunObserver for Watched {
    fn estimate(&mut self, record: &EstimateRecord) {
        self.trace.estimate(record);
    }

    fn innovation(&mut self, record: &InnovationRecord) {
        self.means.add(record);
    }
}

/// Means of the NIS of each sensor over spans of the same length.
struct NisMeans {
    span_s: f64,
    /// Sum, number, and degrees of freedom of each span.
    sums: BTreeMap<SensorKind, Vec<(f64, u32)>>,
}

impl NisMeans {
    fn new(duration_s: f64) -> Self {
        Self {
            span_s: (duration_s / NIS_POINTS).max(SHORTEST_MEAN_S),
            sums: BTreeMap::new(),
        }
    }

    fn add(&mut self, record: &InnovationRecord) {
        let innovation = &record.innovation;
        if innovation.degrees_of_freedom == 0 || !innovation.nis.is_finite() {
            return;
        }
        // A delay may put a sample behind the last span.
        let place = (record.time_s / self.span_s).clamp(0.0, 2.0 * NIS_POINTS) as usize;
        let sums = self.sums.entry(record.sensor).or_default();
        if sums.len() <= place {
            sums.resize(place + 1, (0.0, 0));
        }
        sums[place].0 += innovation.nis;
        sums[place].1 += 1;
    }

    fn columns(self) -> BTreeMap<&'static str, NisColumns> {
        let span_s = self.span_s;
        let of = |(kind, sums): (SensorKind, Vec<(f64, u32)>)| {
            let full = sums.iter().enumerate().filter(|(_, (_, n))| *n > 0);
            let columns = NisColumns {
                t_s: full
                    .clone()
                    .map(|(i, _)| (i as f64 + 0.5) * span_s)
                    .collect(),
                mean: full.map(|(_, (sum, n))| sum / f64::from(*n)).collect(),
            };
            (kind.name(), columns)
        };
        self.sums.into_iter().map(of).collect()
    }
}
