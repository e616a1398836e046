//! `northing benchmark`: attitude or navigation over folders of recordings, beside baselines.

mod navigation;

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::{Args, Subcommand};
use northing_evaluation::attitude::EstimatorKind;
use northing_evaluation::attitude::compare::{CompareOptions, Score, TableRow, scores, statistics};
use northing_evaluation::attitude::own;
use serde::Serialize;

use crate::arguments::estimation::{Asked, EstimationArgs};
use crate::arguments::input::InputArgs;
use crate::arguments::recordings;
use crate::arguments::recordings::Recordings;
use crate::commands::comparison::{self, Outcome, arbitrary_headings, describe, notes, streams};
use crate::files::baseline_errors;
use crate::files::output::{ReportArgs, print, print_json};
use crate::invocation::command_line;
use northing_evaluation::attitude::compare::distinct;
use northing_report::compared_runs::{self, Run};

/// Arguments of `benchmark`.
#[derive(Debug, Args)]
pub(crate) struct BenchmarkArgs {
    #[command(subcommand)]
    benchmark: Benchmark,
}

/// The benchmarks.
#[derive(Debug, Subcommand)]
enum Benchmark {
    /// Attitude: every estimator over every recording with a reference, beside third-party baselines (VQF, Fusion, AHRS)
    Attitude(Box<AttitudeArgs>),
    /// Navigation: GNSS/INS with its defaults over every recording with fixes, beside holding and extrapolating
    Navigation(Box<navigation::NavigationBenchmarkArgs>),
}

/// Arguments of `benchmark attitude`.
#[derive(Debug, Args)]
#[command(
    long_about = "Runs every estimator over every recording of the folders and prints one table: total, heading and \
                  inclination error, and NEES where there is a covariance, mean and median over recordings. Errors of \
                  third-party baselines on the same recordings are merged from CSV files with the columns \
                  recording,estimator,total_deg,heading_deg,inclination_deg; the scripts in oracles/ write them.",
    after_help = "\
Examples:
  northing benchmark attitude --data data/broad
  python3 oracles/attitude.py data/broad --out peers.csv
  northing benchmark attitude --data data/broad --peers peers.csv --report benchmark.html
  northing benchmark attitude --data data/broad --estimator mine.py:Mine
  northing benchmark attitude --data data/broad --data data/smartphone --magnetometer uncalibrated --json"
)]
struct AttitudeArgs {
    /// Folder of recordings; may be given several times
    #[arg(long, value_name = "DIR", required = true)]
    data: Vec<PathBuf>,
    /// An estimator of your own beside ours: a class of Python in a file, such as mine.py:Mine; may be given several times
    #[arg(long = "estimator", value_name = "FILE:CLASS", value_parser = own_class)]
    estimators: Vec<EstimatorKind>,
    /// CSV file with the errors of third-party baselines; may be given several times
    #[arg(long, value_name = "FILE")]
    peers: Vec<PathBuf>,
    /// List each recording, however many there are
    #[arg(long)]
    each: bool,
    #[command(flatten)]
    report: ReportArgs,
    /// Print one JSON document: the table, and the score of each estimator on each recording
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    estimation: EstimationArgs,
    #[command(flatten)]
    input: InputArgs,
}

/// A class of Python in a file.
fn own_class(text: &str) -> Result<EstimatorKind, String> {
    own::register_python(text).map_err(|error| error.to_string())
}

/// The document of `--json`.
#[derive(Serialize)]
struct Document<'a> {
    table: &'a [TableRow],
    scores: &'a [Score],
    /// Where the heading is arbitrary, and whether estimators took different magnetometers.
    #[serde(skip_serializing_if = "Option::is_none")]
    note: Option<&'a str>,
}

/// Runs a benchmark.
pub(crate) fn execute(args: &BenchmarkArgs) -> Result<()> {
    match &args.benchmark {
        Benchmark::Attitude(args) => attitude(args),
        Benchmark::Navigation(args) => navigation::execute(args),
    }
}

fn attitude(args: &AttitudeArgs) -> Result<()> {
    if let Some(path) = args.data.iter().find(|path| !path.is_dir()) {
        bail!(
            "{}: no such folder; expected a folder of recordings, or compare files: northing compare FILE",
            path.display()
        );
    }
    let Asked {
        run,
        calibrations,
        align_reference,
    } = args
        .estimation
        .options(Some(EstimatorKind::Mekf), &args.input)?;
    let options = CompareOptions {
        estimators: EstimatorKind::ALL
            .into_iter()
            .chain(args.estimators.iter().copied())
            .collect(),
        run,
        calibrations,
        align_reference,
        open: args.input.options(),
    };
    args.report.check_free()?;
    let found = recordings::find_calibrated(&args.data, &options.open, &options.calibrations)?;
    let peers = peers(args, &found)?;
    let Outcome { runs, failure } = comparison::run(&found, &options, false)?;
    let scores = together(&runs, peers);
    args.report
        .write(|| compared_runs::render("Attitude benchmark", &runs, &scores, command_line()))?;
    let remarks = arbitrary_headings(&runs) + &streams(&runs);
    show(args, &found, &scores, &remarks)?;
    failure.map_or(Ok(()), Err)
}

/// The peers' scores, read before the long work begins.
fn peers(args: &AttitudeArgs, found: &Recordings) -> Result<Vec<Score>> {
    // A row about a damaged recording would otherwise be blamed for naming an unknown one.
    if let (false, Some(broken)) = (args.peers.is_empty(), found.broken.first()) {
        bail!("{broken}; a comparison with others' errors needs every recording");
    }
    baseline_errors::read_all(&args.peers, &found.paths)
}

/// Our scores and then the peers', without those of recordings on which we failed.
fn together(runs: &[Run], peers: Vec<Score>) -> Vec<Score> {
    let mut scores = scores(runs);
    let ours: Vec<String> = distinct(&scores, |score| &score.recording)
        .into_iter()
        .cloned()
        .collect();
    scores.extend(
        peers
            .into_iter()
            .filter(|score| ours.contains(&score.recording)),
    );
    scores
}

fn show(args: &AttitudeArgs, found: &Recordings, scores: &[Score], remarks: &str) -> Result<()> {
    if args.json {
        return print_json(&Document {
            table: &statistics(scores),
            scores,
            note: Some(remarks.trim()).filter(|note| !note.is_empty()),
        });
    }
    let mut text = describe(scores, args.each);
    text.push_str(&incomplete(scores));
    text.push_str(remarks);
    text.push_str(&notes(found, args.report.report.as_deref()));
    print(&text)
}

/// Says whose means are over fewer recordings than there are: they compare with no other.
fn incomplete(scores: &[Score]) -> String {
    let recordings = distinct(scores, |score| &score.recording).len();
    let of = |estimator: &String| scores.iter().filter(|s| s.estimator == *estimator).count();
    let fewer = distinct(scores, |score| &score.estimator)
        .into_iter()
        .filter(|estimator| of(estimator) < recordings);
    let sentence = |estimator: &String| {
        let n = of(estimator);
        format!(
            "\n{estimator}: rows for {n} of the {recordings} recordings; its means are over those.\n"
        )
    };
    fewer.map(sentence).collect()
}
