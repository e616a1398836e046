//! `northing compare`: several estimators over several recordings.

use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::{AtomicU64, Ordering};

use anyhow::{Result, bail};
use clap::Args;
use northing_evaluation::EvaluationError;
use northing_evaluation::compare::{CompareOptions, Compared, compare_observed, statistics, table};
use northing_evaluation::estimators::EstimatorKind;
use northing_evaluation::observer::{EstimateRecord, InnovationRecord, RunObserver, TraceObserver};
use northing_evaluation::summary::RunSummary;
use northing_recording::Metadata;
use northing_recording::atomic_file::write_whole;

use crate::comparison_report;
use crate::estimation::EstimationArgs;
use crate::input::{InputArgs, STDIN, shown};
use crate::output::{check_free, print, print_json};
use crate::progress::Progress;
use crate::recordings::{self, Recordings};
use crate::table::Table;
use crate::{interrupt, summary_text};

/// With more recordings than this only means and medians are printed.
const MOST_LISTED: usize = 12;
/// Points of each series in a report of several runs.
const TRACE_CAPACITY: usize = 3000;

/// Arguments of `compare`.
#[derive(Debug, Args)]
#[command(
    long_about = "Runs several estimators over several recordings, in parallel, and prints one table: the \
                  errors of each where the recordings have a reference, mean and median over the recordings \
                  of a folder. Folders are searched for recordings; those that begin with calib_ are left out \
                  unless they are named.",
    after_help = "\
Examples:
  northing compare walk.zip
  northing compare walk.csv lab.csv --estimators mekf,usque,device
  northing compare data/broad data/smartphone --report comparison.html
  northing compare lab.csv --calibrate-first 10 --profile lab --json"
)]
pub(crate) struct CompareArgs {
    /// Recordings, or folders of recordings
    #[arg(value_name = "RECORDING", required = true)]
    recordings: Vec<PathBuf>,
    /// Estimators, separated by commas; without it all of them
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    estimators: Vec<EstimatorKind>,
    /// List each recording, however many there are
    #[arg(long)]
    each: bool,
    /// Write a report with plots: one HTML file for a browser
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Overwrite the report if it exists
    #[arg(long)]
    force: bool,
    /// Print one JSON document: an array with one object a run
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    estimation: EstimationArgs,
    #[command(flatten)]
    input: InputArgs,
}

/// A run with what its plots need, where they are wanted.
pub(crate) type Run = Compared<PerhapsTrace>;

/// Keeps what plots need, where plots are wanted.
#[derive(Debug)]
pub(crate) struct PerhapsTrace(pub(crate) Option<TraceObserver>);

impl RunObserver for PerhapsTrace {
    fn estimate(&mut self, record: &EstimateRecord) {
        if let Some(trace) = &mut self.0 {
            trace.estimate(record);
        }
    }

    fn innovation(&mut self, record: &InnovationRecord) {
        if let Some(trace) = &mut self.0 {
            trace.innovation(record);
        }
    }
}

/// Compares.
pub(crate) fn execute(args: &CompareArgs) -> Result<()> {
    if args.recordings.iter().any(|path| path.as_os_str() == STDIN) {
        bail!("standard input can be read only once; save it to a file, or use northing run -");
    }
    let options = compare_options(args)?;
    if let Some(report) = &args.report {
        check_free(report, args.force)?;
    }
    let found = recordings::find(&args.recordings, &options.open)?;
    // Plots over time are for one recording; of many they would be a wall.
    let traced = args.report.is_some() && found.paths.len() == 1;
    let mut runs = run_all(&found.paths, &options, traced);
    if interrupt::happened() {
        bail!("interrupted");
    }
    let failure = Failures::taken_from(&mut runs, &found.broken).into_error(found.paths.len());
    if runs.is_empty()
        && let Some(failure) = failure
    {
        return Err(failure);
    }
    print_all(args, &options, &found, &runs)?;
    failure.map_or(Ok(()), Err)
}

/// Prints and writes what there is of the runs that were made.
fn print_all(
    args: &CompareArgs,
    options: &CompareOptions,
    found: &Recordings,
    runs: &[Run],
) -> Result<()> {
    if let Some(path) = &args.report {
        let html = comparison_report::render(runs, &options.run);
        write_whole(path, html.as_bytes(), args.force)?;
    }
    if args.json {
        let summaries: Vec<_> = runs
            .iter()
            .filter_map(|run| run.outcome.as_ref().ok())
            .collect();
        return print_json(&summaries);
    }
    let recordings = runs.len() / options.estimators.len().max(1);
    let mut text = describe(runs, recordings, args.each);
    for sentence in &found.left_out {
        text.push_str(&format!("\nLeft out: {sentence}\n"));
    }
    if let Some(path) = &args.report {
        text.push_str(&format!(
            "\nReport: {} (open it in a browser)\n",
            path.display()
        ));
    }
    print(&text)
}

fn compare_options(args: &CompareArgs) -> Result<CompareOptions> {
    let mut estimators = Vec::new();
    for estimator in &args.estimators {
        if !estimators.contains(estimator) {
            estimators.push(*estimator);
        }
    }
    if estimators.is_empty() {
        estimators = EstimatorKind::ALL.to_vec();
    }
    let run = args.estimation.options(EstimatorKind::Mekf, &args.input)?;
    Ok(CompareOptions {
        estimators,
        run,
        open: args.input.options(),
    })
}

fn run_all(paths: &[PathBuf], options: &CompareOptions, traced: bool) -> Vec<Run> {
    let total = (paths.len() * options.estimators.len()) as u64;
    let progress = Mutex::new(Progress::of_steps(total, "comparing"));
    let done = AtomicU64::new(0);
    let finished = || {
        let done = done.fetch_add(1, Ordering::Relaxed) + 1;
        // A panic elsewhere must not be hidden by one here.
        if let Ok(mut progress) = progress.lock() {
            progress.done(done);
        }
    };
    let observe = |metadata: &Metadata| {
        PerhapsTrace(traced.then(|| TraceObserver::new(TRACE_CAPACITY, metadata.world_frame)))
    };
    let mut runs = compare_observed(paths, options, &finished, &observe);
    for run in &mut runs {
        if let Ok(summary) = &mut run.outcome {
            summary.recording = shown(&run.path);
        }
    }
    runs
}

/// Recordings that could not be compared, with the reason, each once.
struct Failures(Vec<String>);

impl Failures {
    /// Takes recordings out on which a run failed: a table of the others stays whole.
    fn taken_from(runs: &mut Vec<Run>, broken: &[String]) -> Self {
        let mut failed: Vec<(PathBuf, String)> = Vec::new();
        for run in runs.iter() {
            let Err(error) = &run.outcome else { continue };
            if failed.iter().any(|(path, _)| *path == run.path) {
                continue;
            }
            let reason = match error {
                // Its message begins with the file already.
                EvaluationError::Recording(_) => error.to_string(),
                error => format!("{}: {error}", shown(&run.path)),
            };
            failed.push((run.path.clone(), reason));
        }
        runs.retain(|run| failed.iter().all(|(path, _)| *path != run.path));
        let reasons = failed.into_iter().map(|(_, reason)| reason);
        Self(broken.iter().cloned().chain(reasons).collect())
    }

    /// The first one, with how many more there are; `all` recordings were asked for.
    fn into_error(self, all: usize) -> Option<anyhow::Error> {
        let first = self.0.first()?;
        Some(match self.0.len() {
            1 if all == 1 => anyhow::anyhow!("{first}"),
            1 => anyhow::anyhow!("one recording is left out of the comparison: {first}"),
            n => {
                anyhow::anyhow!("{n} recordings are left out of the comparison; the first: {first}")
            }
        })
    }
}

fn describe(runs: &[Run], recordings: usize, each: bool) -> String {
    if recordings == 1 {
        return one_recording(runs);
    }
    let mut text = String::new();
    if each || recordings <= MOST_LISTED {
        text.push_str("Total error of each recording, deg RMS\n\n");
        text.push_str(&listing(runs));
        text.push('\n');
    }
    text.push_str(&table(&statistics(runs)));
    text
}

/// One line an estimator, with everything that is known of it.
fn one_recording(runs: &[Run]) -> String {
    let mut rows = Table::new(&[
        "<estimator",
        "total deg",
        "heading deg",
        "inclination deg",
        "NEES / dof",
        "final deg",
        "expected deg",
        "<verdict",
    ]);
    for summary in runs.iter().filter_map(|run| run.outcome.as_ref().ok()) {
        rows.row(cells(summary));
    }
    let first = runs.iter().find_map(|run| run.outcome.as_ref().ok());
    let title = first.map(|s| {
        format!(
            "{}: {:.1} s, {} samples",
            s.recording, s.duration_s, s.samples
        )
    });
    let mut text = format!("{}\n\n{}", title.unwrap_or_default(), rows.render("  "));
    if first.is_some_and(|summary| summary.error_deg.is_none()) {
        text.push_str("\nNo reference to score against: only the final test applies, if the device was put back.\n");
    }
    text
}

fn cells(summary: &RunSummary) -> Vec<String> {
    let number = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{v:.2}"));
    let error = summary.error_deg;
    let test = summary.final_test.as_ref();
    let verdict = test
        .and_then(|test| test.verdict)
        .map(summary_text::verdict_word);
    vec![
        summary.estimator.to_string(),
        number(error.map(|e| e.total_rmse)),
        number(error.map(|e| e.heading_rmse)),
        number(error.map(|e| e.inclination_rmse)),
        number(summary.nees_mean),
        number(test.map(|t| t.calculated_error_deg)),
        number(test.and_then(|t| t.estimated_error_deg)),
        verdict.unwrap_or("-").to_owned(),
    ]
}

/// One line a recording, one column an estimator.
fn listing(runs: &[Run]) -> String {
    let mut estimators: Vec<EstimatorKind> = Vec::new();
    for run in runs {
        if !estimators.contains(&run.estimator) {
            estimators.push(run.estimator);
        }
    }
    let mut headings = vec!["<recording"];
    headings.extend(estimators.iter().map(|estimator| estimator.name()));
    let mut rows = Table::new(&headings);
    for line in runs.chunks(estimators.len().max(1)) {
        let name = line.first().map(|run| shown(&run.path)).unwrap_or_default();
        let errors = line.iter().map(|run| {
            let error = run
                .outcome
                .as_ref()
                .ok()
                .and_then(|summary| summary.error_deg);
            error.map_or_else(|| "-".to_owned(), |e| format!("{:.2}", e.total_rmse))
        });
        rows.row(std::iter::once(name).chain(errors));
    }
    rows.render("  ")
}
