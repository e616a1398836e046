//! Several estimators over many recordings: in parallel, in order, and as one table.

use std::path::{Path, PathBuf};

use northing_recording::{Metadata, OpenOptions, Recording};
use rayon::prelude::*;
use serde::Serialize;

use crate::attitude::reference::{self, ReferenceUse};
use crate::attitude::runner;
use crate::attitude::{Calibrations, EstimatorKind, RunObserver, RunOptions, RunSummary};
use crate::error::EvaluationError;
use crate::statistics::median;

/// What is compared, and how.
#[derive(Debug, Clone)]
pub struct CompareOptions {
    /// The estimators, in the order of the table.
    pub estimators: Vec<EstimatorKind>,
    /// The options of every run; the estimator in it is replaced.
    pub run: RunOptions,
    /// Calibrations of devices and days, of which each recording gets its own.
    pub calibrations: Calibrations,
    /// Whether the reference of each recording is put on the sensors' clock first.
    pub align_reference: bool,
    /// How recordings are opened.
    pub open: OpenOptions,
}

/// One estimator on one recording.
#[derive(Debug)]
pub struct Compared<O = ()> {
    /// The recording's file.
    pub path: PathBuf,
    /// Name of the folder it is in: the table has a part for each.
    pub folder: String,
    /// The estimator.
    pub estimator: EstimatorKind,
    /// The outcome. A recording without orientation of the device is no error for `device`: its
    /// summary then has no values and says so.
    pub outcome: Result<RunSummary, EvaluationError>,
    /// What watched the run; `None` where the recording could not be opened.
    pub observer: Option<O>,
}

/// Runs every estimator over every recording, on all processors. The result is in the order of
/// `paths` and `estimators`, whatever finishes first. `finished` is called after each run, from any
/// thread.
pub fn compare(
    paths: &[PathBuf],
    options: &CompareOptions,
    finished: &(dyn Fn() + Sync),
) -> Vec<Compared> {
    compare_observed(paths, options, finished, &|_| ())
}

/// As [`compare`], with an observer of its own for each run, which comes back with the result.
pub fn compare_observed<O: RunObserver + Send>(
    paths: &[PathBuf],
    options: &CompareOptions,
    finished: &(dyn Fn() + Sync),
    observe: &(dyn Fn(&Metadata) -> O + Sync),
) -> Vec<Compared<O>> {
    paths
        .par_iter()
        .flat_map(|path| {
            let reference = reference_of(path, options);
            options.estimators.par_iter().map(move |&estimator| {
                let run = RunOptions {
                    estimator,
                    smooth: options.run.smooth && estimator.has_smoother(),
                    reference: reference.unwrap_or(options.run.reference),
                    ..options.run.clone()
                };
                let is_aligned = reference.is_some() || !options.align_reference;
                let (outcome, observer) = match run_file(path, run, is_aligned, options, observe) {
                    Ok((summary, observer)) => (Ok(summary), Some(observer)),
                    Err(error) => (Err(error), None),
                };
                finished();
                Compared {
                    path: path.clone(),
                    folder: folder_of(path),
                    estimator,
                    outcome,
                    observer,
                }
            })
        })
        .collect()
}

/// What becomes of the reference of a recording, found once for all estimators; `None` where it is not to be aligned, and where it
/// cannot be: then every run looks again, and has the error.
fn reference_of(path: &Path, options: &CompareOptions) -> Option<ReferenceUse> {
    if !options.align_reference || options.estimators.is_empty() {
        return None;
    }
    let mut recording = open(path, options).ok()?;
    let found = reference::fit_recording(&mut recording).ok()?;
    Some(ReferenceUse::Aligned(found))
}

fn open(path: &Path, options: &CompareOptions) -> Result<Recording, EvaluationError> {
    northing_recording::open(path, &options.open)
        .map_err(|error| EvaluationError::Recording(Box::new(error)))
}

fn run_file<O: RunObserver>(
    path: &Path,
    mut run: RunOptions,
    is_aligned: bool,
    options: &CompareOptions,
    observe: &(dyn Fn(&Metadata) -> O + Sync),
) -> Result<(RunSummary, O), EvaluationError> {
    if !is_aligned {
        let found = reference::fit_recording(&mut open(path, options)?)?;
        run.reference = ReferenceUse::Aligned(found);
    }
    let mut recording = open(path, options)?;
    options.calibrations.apply(recording.metadata(), &mut run)?;
    let options = runner::options_for(&recording, &run);
    let mut observer = observe(recording.metadata());
    let mut summary = runner::run_leniently(&mut recording, &options, &mut observer)?;
    if summary.estimates == 0 {
        match runner::nothing_estimated(&summary, &options) {
            error @ EvaluationError::NoDeviceOrientation => summary.issues.push(error.to_string()),
            error => return Err(error),
        }
    }
    summary.issues.splice(0..0, recording.issues().sentences());
    Ok((summary, observer))
}

/// Name of the folder that a file is in. Where the path does not say it (`a.csv`, `../a.csv`), the file system does; `.` for one without a name.
#[must_use]
pub fn folder_of(path: &Path) -> String {
    let named = |folder: &Path| Some(folder.file_name()?.to_string_lossy().into_owned());
    let folder = path.parent().unwrap_or(path);
    let there = || {
        let relative = Some(folder).filter(|folder| !folder.as_os_str().is_empty());
        named(&relative.unwrap_or(Path::new(".")).canonicalize().ok()?)
    };
    named(folder)
        .or_else(there)
        .unwrap_or_else(|| ".".to_owned())
}

/// Mean and median of one value over recordings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct MeanMedian {
    /// Arithmetic mean.
    pub mean: f64,
    /// Median; with an even number of values the mean of the middle two.
    pub median: f64,
}

impl MeanMedian {
    /// Of these values; `None` without any.
    #[must_use]
    pub fn of(mut values: Vec<f64>) -> Option<Self> {
        values.sort_by(f64::total_cmp);
        Some(Self {
            mean: values.iter().sum::<f64>() / values.len() as f64,
            median: median(&values)?,
        })
    }
}

/// How one estimator did on one recording, whoever ran it: ours, or a third-party baseline whose
/// errors were read from a file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Score {
    /// The recording's file.
    pub recording: String,
    /// Name of the folder it is in.
    pub folder: String,
    /// Name of the estimator.
    pub estimator: String,
    /// Its errors; `None` where there is no reference, or nothing was estimated.
    pub error_deg: Option<ErrorsDeg>,
    /// Mean NEES per degree of freedom; `None` without a covariance.
    pub nees: Option<f64>,
}

/// RMS errors over the scored samples of one recording, deg.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ErrorsDeg {
    /// The whole error rotation, deg.
    pub total: f64,
    /// Its part about the vertical, deg.
    pub heading: f64,
    /// Its part about a horizontal axis, deg.
    pub inclination: f64,
}

/// The scores of runs, in their order; a run that failed has no values.
#[must_use]
pub fn scores<O>(compared: &[Compared<O>]) -> Vec<Score> {
    let score = |one: &Compared<O>| {
        let summary = one.outcome.as_ref().ok();
        let error = summary.and_then(|summary| summary.error_deg);
        Score {
            recording: one.path.display().to_string(),
            folder: one.folder.clone(),
            estimator: one.estimator.name().to_owned(),
            error_deg: error.map(|error| ErrorsDeg {
                total: error.total_rmse,
                heading: error.heading_rmse,
                inclination: error.inclination_rmse,
            }),
            nees: summary.and_then(|summary| summary.nees_mean),
        }
    };
    compared.iter().map(score).collect()
}

/// One estimator over the recordings of one folder, or over all.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TableRow {
    /// The folder; `None` for all recordings together.
    pub folder: Option<String>,
    /// Name of the estimator.
    pub estimator: String,
    /// Recordings with a score.
    pub scored_recordings: usize,
    /// RMS total error, deg.
    pub total_deg: Option<MeanMedian>,
    /// RMS heading error, deg.
    pub heading_deg: Option<MeanMedian>,
    /// RMS inclination error, deg.
    pub inclination_deg: Option<MeanMedian>,
    /// Mean NEES per degree of freedom.
    pub nees: Option<MeanMedian>,
}

/// Mean and median per estimator, folder by folder in the order in which they come, and over all
/// recordings if there is more than one folder.
#[must_use]
pub fn statistics(scores: &[Score]) -> Vec<TableRow> {
    let folders = distinct(scores, |score| &score.folder);
    let estimators = distinct(scores, |score| &score.estimator);
    let mut parts: Vec<_> = folders.iter().map(|folder| Some(*folder)).collect();
    if folders.len() > 1 {
        parts.push(None);
    }
    let rows = parts.into_iter().flat_map(|folder| {
        estimators.iter().map(move |estimator| {
            let of = scores.iter().filter(move |one| {
                one.estimator == **estimator && folder.is_none_or(|folder| one.folder == *folder)
            });
            row(folder.cloned(), (*estimator).clone(), of)
        })
    });
    rows.collect()
}

fn row<'a>(
    folder: Option<String>,
    estimator: String,
    scores: impl Iterator<Item = &'a Score>,
) -> TableRow {
    let scored: Vec<_> = scores
        .filter_map(|score| score.error_deg.map(|error| (error, score.nees)))
        .collect();
    let over = |value: fn(&ErrorsDeg) -> f64| {
        MeanMedian::of(scored.iter().map(|(error, _)| value(error)).collect())
    };
    TableRow {
        folder,
        estimator,
        scored_recordings: scored.len(),
        total_deg: over(|e| e.total),
        heading_deg: over(|e| e.heading),
        inclination_deg: over(|e| e.inclination),
        nees: MeanMedian::of(scored.iter().filter_map(|(_, nees)| *nees).collect()),
    }
}

/// What total error, heading error and NEES are of where a heading is arbitrary, in words; `None` where none is.
#[must_use]
pub fn arbitrary_heading_note<'a>(
    summaries: impl IntoIterator<Item = &'a RunSummary>,
) -> Option<String> {
    let removed = |summary: &RunSummary| {
        let error = summary.error_deg.as_ref();
        error.is_some_and(|error| error.heading_offset_removed)
    };
    let mut runs = [0_usize; 2];
    for summary in summaries {
        runs[usize::from(removed(summary))] += 1;
    }
    let [known, arbitrary] = runs;
    let which = if known == 0 {
        "Nothing said where north is".to_owned()
    } else {
        format!(
            "In {arbitrary} of {} runs nothing said where north is",
            known + arbitrary
        )
    };
    (arbitrary > 0).then(|| {
        format!(
            "{which}: total and heading error are then those after a constant heading offset is removed, and NEES is \
             that of the tilt."
        )
    })
}

/// The different values of a text of the scores, in the order in which they come.
#[must_use]
pub fn distinct(scores: &[Score], of: impl Fn(&Score) -> &String) -> Vec<&String> {
    let mut texts = Vec::new();
    for text in scores.iter().map(of) {
        if !texts.contains(&text) {
            texts.push(text);
        }
    }
    texts
}

/// The total errors of one recording, deg, in the order of the estimators.
#[must_use]
pub fn totals(scores: &[Score], recording: &str, estimators: &[&String]) -> Vec<Option<f64>> {
    let of = |estimator: &&String| {
        let mut own = scores.iter().filter(|s| s.recording == recording);
        let score = own.find(|score| score.estimator == **estimator)?;
        score.error_deg.map(|error| error.total)
    };
    estimators.iter().map(of).collect()
}

#[cfg(test)]
mod tests;
