//! What `compare` and `benchmark` share: estimators over recordings, what failed, and the table.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use northing_evaluation::attitude::TraceObserver;
use northing_evaluation::attitude::compare::{
    CompareOptions, MeanMedian, Score, arbitrary_heading_note, compare_observed, distinct,
    statistics, totals,
};
use northing_evaluation::calibration::magnetometer::MagnetometerSource;
use northing_evaluation::{EstimatorKind, EvaluationError};
use northing_recording::Metadata;
use northing_report::compared_runs::Run;

use crate::arguments::recordings::Recordings;
use crate::files::output::{number, report_written};
use crate::files::shown;
use crate::interrupt;
use crate::progress::SharedProgress;
use crate::text::table::Table;

/// With more recordings than this only means and medians are printed.
const MOST_LISTED: usize = 12;
/// Points of each series in a report of several runs.
const TRACE_CAPACITY: usize = 3000;

/// The runs that were made, and why others were not.
pub(crate) struct Outcome {
    /// Recording by recording, of each every estimator.
    pub(crate) runs: Vec<Run>,
    /// The recordings that are left out, as the error to end with.
    pub(crate) failure: Option<anyhow::Error>,
}

/// Runs every estimator over every recording; `traced` keeps what plots over time need.
///
/// # Errors
/// Interrupted, or not one recording could be compared.
pub(crate) fn run(found: &Recordings, options: &CompareOptions, traced: bool) -> Result<Outcome> {
    let mut runs = run_all(&found.paths, options, traced);
    if interrupt::happened() {
        bail!("interrupted");
    }
    let failure = Failures::taken_from(&mut runs, &found.broken).into_error(found.paths.len());
    match failure {
        Some(failure) if runs.is_empty() => Err(failure),
        failure => Ok(Outcome { runs, failure }),
    }
}

fn run_all(paths: &[PathBuf], options: &CompareOptions, traced: bool) -> Vec<Run> {
    let total = (paths.len() * options.estimators.len()) as u64;
    let progress = SharedProgress::of_steps(total, "comparing");
    let finished = || progress.step();
    let observe = |metadata: &Metadata| {
        traced.then(|| TraceObserver::new(TRACE_CAPACITY, metadata.world_frame))
    };
    let mut runs = compare_observed(paths, options, &finished, &observe);
    for run in &mut runs {
        if let Ok(summary) = &mut run.outcome {
            summary.recording = shown(&run.path);
        }
    }
    runs
}

/// What could not be compared, with the reason.
#[derive(Default)]
struct Failures {
    /// Recordings, each once.
    recordings: Vec<String>,
    /// Runs of estimators that somebody brought along: each with how many there were, and the first reason.
    own: Vec<(EstimatorKind, usize, String)>,
}

impl Failures {
    /// Takes recordings out on which a run failed: a table of the others stays whole. An estimator that somebody brought along
    /// fails alone.
    fn taken_from(runs: &mut Vec<Run>, broken: &[String]) -> Self {
        let mut failures = Self {
            recordings: broken.to_vec(),
            ..Self::default()
        };
        let mut failed: Vec<PathBuf> = Vec::new();
        for run in runs.iter() {
            let Err(error) = &run.outcome else { continue };
            let place = shown(&run.path);
            if matches!(error, EvaluationError::OwnEstimator { .. }) {
                failures.add_own(run.estimator, format!("{place}: {error}"));
                continue;
            }
            if failed.contains(&run.path) {
                continue;
            }
            failures.recordings.push(match error {
                // Its message begins with the file already.
                EvaluationError::Recording(_) => error.to_string(),
                error => format!("{place}: {error}"),
            });
            failed.push(run.path.clone());
        }
        runs.retain(|run| run.outcome.is_ok() && !failed.contains(&run.path));
        failures
    }

    fn add_own(&mut self, estimator: EstimatorKind, reason: String) {
        match self.own.iter_mut().find(|(kind, _, _)| *kind == estimator) {
            Some((_, count, _)) => *count += 1,
            None => self.own.push((estimator, 1, reason)),
        }
    }

    /// In a sentence, with the first reason of each; `all` recordings were asked for.
    fn into_error(self, all: usize) -> Option<anyhow::Error> {
        let mut sentences = Vec::new();
        if let Some(first) = self.recordings.first() {
            sentences.push(match self.recordings.len() {
                1 if all == 1 => first.clone(),
                1 => format!("one recording is left out of the comparison: {first}"),
                n => format!("{n} recordings are left out of the comparison; the first: {first}"),
            });
        }
        sentences.extend(self.own.iter().map(|(_, count, first)| match count {
            1 => first.clone(),
            n => format!("{first}; in all on {n} of {all} recordings"),
        }));
        (!sentences.is_empty()).then(|| anyhow::anyhow!("{}", sentences.join("\n")))
    }
}

/// The table over several recordings, and before it each of them where they are few or `each` is asked for.
pub(crate) fn describe(scores: &[Score], each: bool) -> String {
    let mut text = String::new();
    if each || distinct(scores, |score| &score.recording).len() <= MOST_LISTED {
        text.push_str("Total error of each recording, deg RMS\n\n");
        text.push_str(&listing(scores));
        text.push('\n');
    }
    text.push_str(&averages(scores));
    text
}

/// RMS errors in degrees, mean / median over the recordings of each folder.
fn averages(scores: &[Score]) -> String {
    let [total, heading, inclination] = ["total deg", "heading deg", "inclination deg"];
    let wide = [total, heading, inclination, "NEES / dof"].map(|name| format!("{name:>15}"));
    let mut headings = vec!["<folder", "<estimator", "  n"];
    headings.extend(wide.iter().map(String::as_str));
    let mut rows = Table::new(&headings);
    rows.row(
        ["", "", ""]
            .into_iter()
            .chain(["mean / median"; 4])
            .map(str::to_owned),
    );
    let cell = |value: Option<MeanMedian>| {
        value.map_or_else(
            || "-".to_owned(),
            |v| format!("{:.2} / {:.2}", v.mean, v.median),
        )
    };
    for row in statistics(scores) {
        let numbers = [
            row.total_deg,
            row.heading_deg,
            row.inclination_deg,
            row.nees,
        ];
        let names = [
            row.folder.unwrap_or_else(|| "all".to_owned()),
            row.estimator,
            row.scored_recordings.to_string(),
        ];
        rows.row(names.into_iter().chain(numbers.map(cell)));
    }
    rows.render("")
}

/// What comes below a table: files that are no recordings, and where the report is.
pub(crate) fn notes(found: &Recordings, report: Option<&Path>) -> String {
    let mut text = String::new();
    for sentence in &found.left_out {
        text.push_str(&format!("\nLeft out: {sentence}\n"));
    }
    if let Some(path) = report {
        text.push_str(&format!("\n{}\n", report_written(path)));
    }
    text
}

/// What the columns hold where nothing said where north is; empty where that is nowhere.
pub(crate) fn arbitrary_headings(runs: &[Run]) -> String {
    let summaries = runs.iter().filter_map(|run| run.outcome.as_ref().ok());
    arbitrary_heading_note(summaries).map_or_else(String::new, |note| format!("\n{note}\n"))
}

/// Which estimators took another magnetometer than the rest, where that was left to them.
pub(crate) fn streams(runs: &[Run]) -> String {
    let of = |source: MagnetometerSource| {
        let taken = runs.iter().filter(move |run| {
            let summary = run.outcome.as_ref().ok();
            summary.is_some_and(|summary| summary.magnetometer == Some(source))
        });
        let mut names: Vec<&str> = taken.map(|run| run.estimator.name()).collect();
        names.sort_unstable();
        names.dedup();
        names
    };
    let own = of(MagnetometerSource::Uncalibrated);
    if own.is_empty() || of(MagnetometerSource::Device).is_empty() {
        return String::new();
    }
    format!(
        "\nWhere a recording has both magnetometers, {} took the uncalibrated one, whose hard iron it estimates, and \
         the others the device's; --magnetometer gives all the same.\n",
        own.join(", ")
    )
}

/// One line a recording, one column an estimator.
fn listing(scores: &[Score]) -> String {
    let estimators = distinct(scores, |score| &score.estimator);
    let mut headings = vec!["<recording"];
    headings.extend(estimators.iter().map(|estimator| estimator.as_str()));
    let mut rows = Table::new(&headings);
    for recording in distinct(scores, |score| &score.recording) {
        let errors = totals(scores, recording, &estimators).into_iter();
        let errors = errors.map(|error| number(error, 2));
        rows.row(std::iter::once(recording.clone()).chain(errors));
    }
    rows.render("  ")
}

#[cfg(test)]
mod tests {
    use northing_evaluation::attitude::compare::ErrorsDeg;

    use super::*;

    #[test]
    fn averages_stand_in_columns_with_and_without_a_score() {
        let score = |recording: &str, estimator: &str, total: Option<f64>| Score {
            recording: recording.to_owned(),
            folder: "no-such-folder".to_owned(),
            estimator: estimator.to_owned(),
            error_deg: total.map(|total| ErrorsDeg {
                total,
                heading: 2.0,
                inclination: 1.0,
            }),
            nees: None,
        };
        let text = averages(&[
            score("a.csv", "mekf", Some(123.456)),
            score("a.csv", "a-long-name-of-an-estimator", None),
        ]);
        let first = text.lines().next().unwrap().len();
        assert!(text.lines().all(|line| line.len() == first), "{text}");
        assert!(
            text.contains("123.46 / 123.46  ") && text.ends_with(" -\n"),
            "{text}"
        );
    }
}
