//! `northing compare`: several estimators over several recordings.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use northing_evaluation::attitude::compare::{CompareOptions, scores};
use northing_evaluation::attitude::final_test::FinalVerdict;
use northing_evaluation::attitude::{EstimatorKind, RunSummary};

use crate::arguments::estimation::{Asked, EstimationArgs};
use crate::arguments::input::InputArgs;
use crate::arguments::recordings::{self, Recordings};
use crate::commands::comparison::{self, Outcome, arbitrary_headings, describe, notes, streams};
use crate::files::STDIN;
use crate::files::output::{ReportArgs, number, print, print_json};
use crate::invocation::command_line;
use crate::text::table::Table;
use northing_report::compared_runs::{self, Run};

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
  northing compare walk.csv --estimators mekf,mine.py:Mine
  northing compare data/broad data/smartphone --report comparison.html
  northing compare lab.csv --calibrate-first 10 --profile lab --json"
)]
pub(crate) struct CompareArgs {
    /// Recordings, or folders of recordings
    #[arg(value_name = "RECORDING", required = true)]
    recordings: Vec<PathBuf>,
    /// Estimators, separated by commas, your own among them (mine.py:Mine); without it all of ours
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    estimators: Vec<EstimatorKind>,
    /// List each recording, however many there are
    #[arg(long)]
    each: bool,
    #[command(flatten)]
    report: ReportArgs,
    /// Print one JSON document: an array with one object a run
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    estimation: EstimationArgs,
    #[command(flatten)]
    input: InputArgs,
}

/// Compares.
pub(crate) fn execute(args: &CompareArgs) -> Result<()> {
    if args.recordings.iter().any(|path| path.as_os_str() == STDIN) {
        bail!("standard input can be read only once; save it to a file, or use northing run -");
    }
    let options = compare_options(args)?;
    args.report.check_free()?;
    let found =
        recordings::find_calibrated(&args.recordings, &options.open, &options.calibrations)?;
    // Plots over time are for one recording; of many they would be a wall.
    let traced = args.report.report.is_some() && found.paths.len() == 1;
    let Outcome { runs, failure } = comparison::run(&found, &options, traced)?;
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
    let scores = scores(runs);
    args.report
        .write(|| compared_runs::render(compared_runs::TITLE, runs, &scores, command_line()))?;
    if args.json {
        let summaries: Vec<_> = runs
            .iter()
            .filter_map(|run| run.outcome.as_ref().ok())
            .collect();
        return print_json(&summaries);
    }
    let mut text = if runs.len() <= options.estimators.len() {
        one_recording(runs)
    } else {
        describe(&scores, args.each)
    };
    text.push_str(&arbitrary_headings(runs));
    text.push_str(&streams(runs));
    text.push_str(&notes(found, args.report.report.as_deref()));
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
    let Asked {
        run,
        calibrations,
        align_reference,
    } = args
        .estimation
        .options(Some(EstimatorKind::Mekf), &args.input)?;
    Ok(CompareOptions {
        estimators,
        run,
        calibrations,
        align_reference,
        open: args.input.options(),
    })
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
    let number = |value: Option<f64>| number(value, 2);
    let error = summary.error_deg;
    let test = summary.final_test.as_ref();
    let verdict = test.and_then(|test| test.verdict).map(FinalVerdict::name);
    vec![
        summary.estimator.to_string(),
        number(error.map(|e| e.total_rmse)),
        number(error.map(|e| e.heading_rmse)),
        number(error.map(|e| e.inclination_rmse)),
        number(summary.nees_mean),
        number(test.map(|t| t.judged_deg().0)),
        number(test.and_then(|t| t.judged_deg().1)),
        verdict.unwrap_or("-").to_owned(),
    ]
}
