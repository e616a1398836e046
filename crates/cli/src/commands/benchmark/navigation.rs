//! `northing benchmark navigation`: a navigation estimator over many recordings by one rule, beside answers without a filter.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::Args;
use northing_evaluation::EvaluationError;
use northing_evaluation::navigation::NavigationKind;
use northing_evaluation::navigation::benchmark::{
    BenchmarkOptions, Benchmarked, RULE, Row, Totals, benchmark,
};
use northing_recording::{OpenOptions, RecordingError};
use serde::Serialize;

use crate::arguments::input::InputArgs;
use crate::arguments::recordings::{self, Recordings};
use crate::files::output::{number, print, print_json};
use crate::files::shown;
use crate::interrupt;
use crate::progress::SharedProgress;
use crate::text::sheet::paragraph;
use crate::text::table::Table;

/// With more files left out than this the rest is a number.
const MOST_LEFT_OUT: usize = 5;

/// Arguments of `benchmark navigation`.
#[derive(Debug, Args)]
#[command(
    long_about = "Runs a navigation estimator with its defaults over every recording of the folders, once with thinned \
                  fixes and once with outages, beside holding the last fix, extrapolating from it, and the batch \
                  smoother, which knows the whole recording: a bound on what the estimator can reach as it goes. Prints \
                  one table: errors, share inside the 95 % ellipse, heading against a reference attitude, where it was worse \
                  than extrapolation, and where it was lost: beyond five times the stated 95 % for 10 s. Files without \
                  fixes or without inertial samples are left out.",
    after_help = "\
Examples:
  northing benchmark navigation --data flights
  northing benchmark navigation --data flights --data drives --json
  northing benchmark navigation --data flights --smooth
  northing benchmark navigation examples/recordings/car_rtk.toml --data data
  python3 oracles/navigation.py flights"
)]
pub(super) struct NavigationBenchmarkArgs {
    /// Recordings or manifests, instead of those found in the folders
    #[arg(value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// Folder of recordings; may be given several times. With recordings named: the folder of the files that manifests name
    #[arg(long, value_name = "DIR")]
    data: Vec<PathBuf>,
    /// The estimator: error-state, axis-filters, dead-reckoning
    #[arg(long, value_name = "NAME", default_value = "error-state", value_parser = estimator)]
    estimator: NavigationKind,
    /// Smooth each recording as a whole (error-state; keeps it in memory)
    #[arg(long)]
    smooth: bool,
    /// Print one JSON document: the rule, the scores of each recording, medians and counts
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    input: InputArgs,
}

/// The document of `--json`.
#[derive(Serialize)]
struct Document<'a> {
    rule: &'a str,
    estimator: NavigationKind,
    smoothed: bool,
    recordings: &'a [&'a Row],
    totals: Totals,
    left_out: &'a [String],
}

/// A device had used every fix already: none can be held out.
fn estimator(name: &str) -> Result<NavigationKind, String> {
    let kind: NavigationKind = name
        .parse()
        .map_err(|error: EvaluationError| error.to_string())?;
    if kind == NavigationKind::Device {
        return Err(EvaluationError::DeviceHadEverything.to_string());
    }
    Ok(kind)
}

/// Runs the benchmark.
pub(super) fn execute(args: &NavigationBenchmarkArgs) -> Result<()> {
    if args.smooth && args.estimator != NavigationKind::ErrorState {
        let estimator = args.estimator.name();
        return Err(EvaluationError::NoSmoother { estimator }.into());
    }
    let (mut found, options) = find(args)?;
    let progress = SharedProgress::of_steps(found.paths.len() as u64, "navigating");
    let runs = benchmark(&found.paths, &options, &|| progress.step());
    drop(progress);
    if interrupt::happened() {
        bail!("interrupted");
    }
    let failure = sort_out(&runs, args, &mut found);
    let rows: Vec<&Row> = runs
        .iter()
        .filter_map(|run| run.outcome.as_ref().ok())
        .collect();
    if rows.is_empty() {
        return Err(failure.unwrap_or_else(|| nothing_to_run(&found)));
    }
    show(args, &rows, &found.left_out)?;
    failure.map_or(Ok(()), Err)
}

/// The recordings that are meant, and how they are opened.
fn find(args: &NavigationBenchmarkArgs) -> Result<(Recordings, BenchmarkOptions)> {
    if let Some(path) = args.data.iter().find(|path| !path.is_dir()) {
        bail!(
            "{}: no such folder; expected a folder of recordings, or name files: northing benchmark navigation FILE",
            path.display()
        );
    }
    let mut open = args.input.options();
    let found = match (&args.recordings[..], &args.data[..]) {
        ([], []) => bail!("no recordings: name them, or a folder of them: --data DIR"),
        ([], folders) => recordings::find_navigation(folders, &open)?,
        (_, [_, _, ..]) => {
            bail!(
                "--data is given several times beside recordings; expected one folder, that of the files their manifests name"
            )
        }
        (named, data) => {
            open.data = data.first().cloned();
            named_or_found(named, &open)?
        }
    };
    let options = BenchmarkOptions {
        estimator: args.estimator,
        smooth: args.smooth,
        open,
    };
    Ok((found, options))
}

/// Recordings that were named, and those in folders that were.
fn named_or_found(named: &[PathBuf], open: &OpenOptions) -> Result<Recordings> {
    if let Some(missing) = named.iter().find(|path| !path.exists()) {
        bail!(
            "{}: cannot open it: no such file or folder",
            missing.display()
        );
    }
    recordings::find_navigation(named, open)
}

/// Notes recordings without what the estimator needs, and gives what else failed as the error to end with. A file that was
/// named is not left out silently.
fn sort_out(
    runs: &[Benchmarked],
    args: &NavigationBenchmarkArgs,
    found: &mut Recordings,
) -> Option<anyhow::Error> {
    let mut failures = found.broken.clone();
    for run in runs {
        let Err(error) = &run.outcome else { continue };
        let message = match error {
            // Its message begins with the file already.
            EvaluationError::Recording(_) => error.to_string(),
            error => format!("{}: {error}", shown(&run.path)),
        };
        match lacks(error) {
            Some(lacks) if !args.recordings.contains(&run.path) => {
                found
                    .left_out
                    .push(format!("{}: {lacks}", shown(&run.path)));
            }
            _ => failures.push(message),
        }
    }
    let first = failures.first()?;
    Some(match failures.len() {
        1 => anyhow::anyhow!("{first}"),
        n => anyhow::anyhow!("{n} recordings failed; the first: {first}"),
    })
}

/// What makes a file no recording of navigation; `None` where it is one that is broken.
fn lacks(error: &EvaluationError) -> Option<&'static str> {
    match error {
        EvaluationError::NoFix { .. } => Some("no usable fix"),
        EvaluationError::NoInertialSamples { .. } => Some("no inertial samples"),
        EvaluationError::Recording(error) => match error.downcast_ref()? {
            RecordingError::NoGyroscope { .. } => Some("no inertial samples"),
            RecordingError::Empty { .. } => Some("no samples"),
            _ => None,
        },
        _ => None,
    }
}

fn nothing_to_run(found: &Recordings) -> anyhow::Error {
    let first = found.left_out.first().map_or("", String::as_str);
    anyhow::anyhow!("none has satellite fixes and inertial samples; the first: {first}")
}

fn show(args: &NavigationBenchmarkArgs, rows: &[&Row], left_out: &[String]) -> Result<()> {
    let totals = Totals::of(rows);
    if args.json {
        return print_json(&Document {
            rule: RULE,
            estimator: args.estimator,
            smoothed: args.smooth,
            recordings: rows,
            totals,
            left_out,
        });
    }
    let smoothed = if args.smooth { ", smoothed" } else { "" };
    let heading = format!("{}{smoothed}, defaults. {RULE}", args.estimator);
    let mut text = format!("{}\n", paragraph(&heading, ""));
    text.push_str(&table(rows, &totals));
    text.push_str(&summary(&totals));
    for row in rows {
        for issue in &row.issues {
            let issue = format!("{}: {issue}", row.recording);
            text.push_str(&format!("\n{}", paragraph(&issue, "")));
        }
    }
    if !left_out.is_empty() {
        text.push_str("\nLeft out:\n");
    }
    for sentence in left_out.iter().take(MOST_LEFT_OUT) {
        // What to do about each stands in --json.
        let (reason, _) = sentence.split_once(';').unwrap_or((sentence, ""));
        text.push_str(&format!("  {reason}\n"));
    }
    if left_out.len() > MOST_LEFT_OUT {
        let more = left_out.len() - MOST_LEFT_OUT;
        text.push_str(&format!("  and {more} more: --json lists them\n"));
    }
    print(&text)
}

/// One line a recording, and the medians.
fn table(rows: &[&Row], totals: &Totals) -> String {
    let mut table = Table::new(&[
        "<recording",
        "fixes used",
        "horizontal m",
        "batch",
        "hold",
        "extrapolation",
        "vertical m",
        "inside 95 %",
        "heading deg",
        "outages m",
        "extrapolation",
        "<",
    ]);
    let percent = |share: Option<f64>| number(share.map(|share| 100.0 * share), 0);
    for row in rows {
        let position = row.position.as_ref();
        let outages = row.outages.as_ref();
        table.row([
            name(&row.recording, rows),
            format!("{} of {}", row.fixes_used, row.fixes),
            number(position.map(|p| p.horizontal_rmse_m), 3),
            number(row.batch.map(|batch| batch.horizontal_rmse_m), 3),
            number(position.and_then(|p| p.hold_rmse_m), 3),
            number(position.and_then(|p| p.extrapolation_rmse_m), 3),
            number(position.and_then(|p| p.vertical_rmse_m), 3),
            percent(position.map(|p| p.inside_95)),
            number(row.heading_rmse_deg, 1),
            number(outages.map(|o| o.horizontal_rmse_m), 2),
            number(outages.and_then(|o| o.extrapolation_rmse_m), 2),
            remarks(row),
        ]);
    }
    table.row([
        "median".to_owned(),
        String::new(),
        number(totals.horizontal_rmse_m, 3),
        number(totals.batch_rmse_m, 3),
        number(totals.hold_rmse_m, 3),
        number(totals.extrapolation_rmse_m, 3),
        number(totals.vertical_rmse_m, 3),
        percent(totals.inside_95),
        number(totals.heading_rmse_deg, 1),
        number(totals.outage_rmse_m, 2),
        number(totals.outage_extrapolation_rmse_m, 2),
        String::new(),
    ]);
    table.render("")
}

/// A recording's file without what all of them share.
fn name(recording: &str, rows: &[&Row]) -> String {
    let parent = |text: &str| Path::new(text).parent().map(Path::to_owned);
    let shared = parent(recording);
    let alike = rows.len() > 1 && rows.iter().all(|row| parent(&row.recording) == shared);
    match Path::new(recording).file_name() {
        Some(file) if alike => file.to_string_lossy().into_owned(),
        _ => recording.to_owned(),
    }
}

/// What a row's numbers do not show.
fn remarks(row: &Row) -> String {
    let mut words: Vec<String> = Vec::new();
    if row.lost {
        words.push("lost".to_owned());
    }
    if row.worse_than_extrapolation {
        words.push("worse than extrapolation".to_owned());
    }
    if row.batch.is_some_and(|batch| !batch.converged) {
        words.push("batch not converged".to_owned());
    }
    match row.answered {
        _ if row.is_without_estimate() => words.push("no estimate".to_owned()),
        None => words.push("nothing to score at".to_owned()),
        Some(share) if share < 0.995 => {
            words.push(format!("{:.0} % of the points", 100.0 * share));
        }
        Some(_) => {}
    }
    if let Some(outages) = row.outages.filter(|outages| outages.scored < outages.made) {
        let missing = outages.made - outages.scored;
        words.push(format!(
            "no estimate in {missing} of {} outages",
            outages.made
        ));
    }
    words.join(", ")
}

fn summary(totals: &Totals) -> String {
    format!(
        "\n{} recordings, {} scored: {} lost, {} worse than extrapolation, {} without an estimate\n",
        totals.recordings,
        totals.scored,
        totals.lost,
        totals.worse_than_extrapolation,
        totals.without_estimate
    )
}
