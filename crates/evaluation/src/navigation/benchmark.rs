//! Navigation benchmark: one estimator with its defaults over many recordings, with thinned fixes and with outages.
//!
//! The same rule for every recording, so that rows compare: see [`RULE`]. Beside the estimator two answers that need no
//! filter are scored at the same points: holding the last fix, and extrapolating from it with its velocity; and, as a bound, the
//! batch smoother, which knows the whole recording.

mod survey;
mod watch;

use std::path::{Path, PathBuf};

use northing_recording::{OpenOptions, open};
use rayon::prelude::*;
use serde::Serialize;

use self::survey::Survey;
use self::watch::Watch;
use super::kinds::NavigationKind;
use super::options::{NavigationOptions, Outage};
use super::outcome::NavigationSummary;
use super::runner::run_navigation;
use super::score::{OutageScore, PositionScore};
use crate::error::EvaluationError;
use crate::statistics::median;

/// How every recording is run, in words.
pub const RULE: &str = "Of the fixes one a second is used, and without a reference position at most one of two; scored at the \
     reference, otherwise at the held-out fixes, from 5 s after the first fix. Outages, in a second run: 10 s every 60 s, \
     the first after 20 s, scored at their ends.";
/// Scores count from so many seconds after the first fix.
pub(super) const SCORE_FROM_S: f64 = 5.0;
const FIRST_OUTAGE_S: f64 = 20.0;
const OUTAGE_EVERY_S: f64 = 60.0;
const OUTAGE_S: f64 = 10.0;

/// What is run.
#[derive(Debug, Clone)]
pub struct BenchmarkOptions {
    /// The estimator, with its defaults and what each recording knows about its receiver.
    pub estimator: NavigationKind,
    /// Whether its estimates are smoothed; otherwise the smoother's stand beside them, as a bound.
    pub smooth: bool,
    /// How recordings are opened.
    pub open: OpenOptions,
}

/// One recording.
#[derive(Debug)]
pub struct Benchmarked {
    /// Its file.
    pub path: PathBuf,
    /// What came of it.
    pub outcome: Result<Row, EvaluationError>,
}

/// Scores of one recording; what does not apply is `None`, `null` in JSON.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Row {
    /// Its name: the file.
    pub recording: String,
    /// Time from the first to the last sample, s.
    pub duration_s: f64,
    /// Fixes that the recording holds.
    pub fixes: u64,
    /// Of so many usable fixes one was given to the estimator.
    pub gnss_every: u32,
    /// Fixes that the estimator got.
    pub fixes_given: u64,
    /// Those that it used.
    pub fixes_used: u64,
    /// What was scored at: `reference` or `held-out fixes`.
    pub scored_against: Option<&'static str>,
    /// Scores of the position.
    pub position: Option<PositionScore>,
    /// What the recording holds: the batch smoother at the same points; `None` where the estimator has none, or is smoothed itself.
    pub batch: Option<BatchRow>,
    /// Share of the points to score at for which there was an estimate, 0 to 1; `None` without points.
    pub answered: Option<f64>,
    /// Root mean square of the heading error against a reference attitude, degrees.
    pub heading_rmse_deg: Option<f64>,
    /// Whether the horizontal error is above that of extrapolating the last fix.
    pub worse_than_extrapolation: bool,
    /// Whether the error was beyond five times the radius that holds 95 % by the stated covariance, for 10 s.
    pub lost: bool,
    /// Scores at the ends of outages; `None` where the recording is too short for one.
    pub outages: Option<OutageRow>,
    /// What was odd, one sentence each.
    pub issues: Vec<String>,
}

/// Scores of the batch smoother.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct BatchRow {
    /// Horizontal error, m.
    pub horizontal_rmse_m: f64,
    /// Vertical error, m.
    pub vertical_rmse_m: Option<f64>,
    /// Share inside the 95 % ellipse, 0 to 1.
    pub inside_95: f64,
    /// Heading error against a reference attitude, degrees.
    pub heading_rmse_deg: Option<f64>,
    /// Passes forward and backward.
    pub iterations: u32,
    /// Whether they converged.
    pub converged: bool,
}

/// Root mean squares over the ends of outages.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OutageRow {
    /// Outages made.
    pub made: u64,
    /// Those at whose end there was an estimate to score.
    pub scored: u64,
    /// Horizontal error, m.
    pub horizontal_rmse_m: f64,
    /// Share inside the 95 % ellipse, 0 to 1.
    pub inside_95: f64,
    /// Horizontal error of the last fix held, m.
    pub hold_rmse_m: Option<f64>,
    /// Horizontal error of the last fix moved on with its velocity, m.
    pub extrapolation_rmse_m: Option<f64>,
}

/// Medians over recordings, and how many went wrong.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Totals {
    /// Recordings run.
    pub recordings: u64,
    /// Those with a position that was scored.
    pub scored: u64,
    /// Median horizontal root mean square, m.
    pub horizontal_rmse_m: Option<f64>,
    /// Of the batch smoother, m.
    pub batch_rmse_m: Option<f64>,
    /// Of the last fix held, m.
    pub hold_rmse_m: Option<f64>,
    /// Of the last fix moved on with its velocity, m.
    pub extrapolation_rmse_m: Option<f64>,
    /// Median vertical root mean square, m.
    pub vertical_rmse_m: Option<f64>,
    /// Median share inside the 95 % ellipse, 0 to 1.
    pub inside_95: Option<f64>,
    /// Median heading error against a reference attitude, degrees.
    pub heading_rmse_deg: Option<f64>,
    /// Median horizontal error at the ends of outages, m.
    pub outage_rmse_m: Option<f64>,
    /// Of the last fix moved on with its velocity, m.
    pub outage_extrapolation_rmse_m: Option<f64>,
    /// Recordings on which extrapolation is better.
    pub worse_than_extrapolation: u64,
    /// Recordings on which the estimator was lost.
    pub lost: u64,
    /// Recordings without one estimate where it would have been scored.
    pub without_estimate: u64,
}

/// Runs the estimator over every recording, on all processors; the result is in the order of `paths`. `finished` is called
/// after each recording, from any thread.
#[must_use]
pub fn benchmark(
    paths: &[PathBuf],
    options: &BenchmarkOptions,
    finished: &(dyn Fn() + Sync),
) -> Vec<Benchmarked> {
    let one = |path: &PathBuf| {
        let outcome = run_file(path, options);
        finished();
        Benchmarked {
            path: path.clone(),
            outcome,
        }
    };
    paths.par_iter().map(one).collect()
}

fn run_file(path: &Path, options: &BenchmarkOptions) -> Result<Row, EvaluationError> {
    let survey = Survey::of(path, &options.open)?;
    if survey.usable_fixes == 0 {
        return Err(EvaluationError::NoFix {
            fixes: survey.fixes,
            because: String::new(),
        });
    }
    let gnss_every = survey.gnss_every();
    let mut watch = Watch::default();
    let summary = run_once(path, options, gnss_every, Vec::new(), &mut watch)?;
    let outages = survey.outages();
    let outages = if outages.is_empty() {
        None
    } else {
        let run = run_once(path, options, gnss_every, outages, &mut Watch::default())?;
        OutageRow::of(&run.outages)
    };
    let mut row = Row::of(summary, gnss_every, &watch, outages);
    if options.estimator == NavigationKind::ErrorState && !options.smooth {
        let smoothed = BenchmarkOptions {
            smooth: true,
            ..options.clone()
        };
        let mut nobody = Watch::default();
        let run = run_once(path, &smoothed, gnss_every, Vec::new(), &mut nobody)?;
        row.batch = BatchRow::of(&run);
    }
    Ok(row)
}

fn run_once(
    path: &Path,
    options: &BenchmarkOptions,
    gnss_every: u32,
    outages: Vec<Outage>,
    watch: &mut Watch,
) -> Result<NavigationSummary, EvaluationError> {
    let opened = open(path, &options.open);
    let mut recording = opened.map_err(|error| EvaluationError::Recording(Box::new(error)))?;
    let metadata = recording.metadata();
    let world = metadata.frames();
    let run = NavigationOptions {
        gnss_every,
        outages,
        smooth: options.smooth,
        score_from_s: SCORE_FROM_S,
        ..NavigationOptions::of_recording(options.estimator, metadata)
    };
    let name = path.display().to_string();
    let mut summary = run_navigation(recording.by_ref(), &name, world, &run, watch)?;
    summary.issues.splice(0..0, recording.issues().sentences());
    Ok(summary)
}

impl Row {
    fn of(
        summary: NavigationSummary,
        gnss_every: u32,
        watch: &Watch,
        outages: Option<OutageRow>,
    ) -> Self {
        let position = summary.position;
        let extrapolated = position.as_ref().and_then(|p| p.extrapolation_rmse_m);
        let error = position.as_ref().map(|p| p.horizontal_rmse_m);
        let heading = summary.heading.filter(|heading| !heading.against_course);
        Self {
            recording: summary.recording,
            duration_s: summary.duration_s,
            fixes: summary.fixes,
            gnss_every,
            fixes_given: summary.fixes_given,
            fixes_used: summary.fixes_used,
            scored_against: summary.scored_against,
            answered: watch.answered(),
            heading_rmse_deg: heading.map(|heading| heading.rmse_deg),
            worse_than_extrapolation: error.zip(extrapolated).is_some_and(|(e, x)| e > x),
            lost: watch.is_lost(),
            position,
            batch: None,
            outages,
            issues: summary.issues,
        }
    }

    /// Whether there were points to score at, and not one estimate.
    #[must_use]
    pub fn is_without_estimate(&self) -> bool {
        self.answered == Some(0.0)
    }
}

impl BatchRow {
    fn of(summary: &NavigationSummary) -> Option<Self> {
        let position = summary.position.as_ref()?;
        let smoothing = summary.smoothing?;
        let heading = summary.heading.as_ref();
        let heading = heading.filter(|heading| !heading.against_course);
        Some(Self {
            horizontal_rmse_m: position.horizontal_rmse_m,
            vertical_rmse_m: position.vertical_rmse_m,
            inside_95: position.inside_95,
            heading_rmse_deg: heading.map(|heading| heading.rmse_deg),
            iterations: smoothing.iterations,
            converged: smoothing.converged,
        })
    }
}

impl OutageRow {
    fn of(scores: &[OutageScore]) -> Option<Self> {
        let scored = scores
            .iter()
            .filter(|score| score.horizontal_error_m.is_some());
        let rms = |value: fn(&OutageScore) -> Option<f64>| {
            let squares: Vec<f64> = scored.clone().filter_map(value).map(|x| x * x).collect();
            let n = squares.len() as f64;
            (n > 0.0).then(|| (squares.iter().sum::<f64>() / n).sqrt())
        };
        let count = scored.clone().count() as u64;
        let inside = scored.clone().filter(|s| s.inside_95 == Some(true)).count();
        Some(Self {
            made: scores.len() as u64,
            scored: count,
            horizontal_rmse_m: rms(|score| score.horizontal_error_m)?,
            inside_95: inside as f64 / count as f64,
            hold_rmse_m: rms(|score| score.hold_error_m),
            extrapolation_rmse_m: rms(|score| score.extrapolation_error_m),
        })
    }
}

impl Totals {
    /// Over these rows.
    #[must_use]
    pub fn of(rows: &[&Row]) -> Self {
        let middle = |value: &dyn Fn(&Row) -> Option<f64>| {
            let mut values: Vec<f64> = rows.iter().filter_map(|row| value(row)).collect();
            values.sort_by(f64::total_cmp);
            median(&values)
        };
        let position = |value: fn(&PositionScore) -> Option<f64>| {
            middle(&|row: &Row| row.position.as_ref().and_then(value))
        };
        let count = |is: fn(&Row) -> bool| rows.iter().filter(|row| is(row)).count() as u64;
        Self {
            recordings: count(|_| true),
            scored: count(|row| row.position.is_some()),
            horizontal_rmse_m: position(|p| Some(p.horizontal_rmse_m)),
            batch_rmse_m: middle(&|row: &Row| Some(row.batch?.horizontal_rmse_m)),
            hold_rmse_m: position(|p| p.hold_rmse_m),
            extrapolation_rmse_m: position(|p| p.extrapolation_rmse_m),
            vertical_rmse_m: position(|p| p.vertical_rmse_m),
            inside_95: position(|p| Some(p.inside_95)),
            heading_rmse_deg: middle(&|row: &Row| row.heading_rmse_deg),
            outage_rmse_m: middle(&|row: &Row| Some(row.outages?.horizontal_rmse_m)),
            outage_extrapolation_rmse_m: middle(&|row: &Row| row.outages?.extrapolation_rmse_m),
            worse_than_extrapolation: count(|row| row.worse_than_extrapolation),
            lost: count(|row| row.lost),
            without_estimate: count(Row::is_without_estimate),
        }
    }
}
