//! `northing study`: estimators x parameters x seeds over recordings, worlds or scenarios, a row a run, on one machine or many.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use clap::{Args, Subcommand};
use northing_experiments::shard::Shard;
use northing_experiments::studies::key::short;
use northing_experiments::studies::part::missing;
use northing_experiments::studies::{
    FoundRecording, FoundSources, RowsHash, SourceEntries, Study, StudyFile, StudyOutcome,
    StudyQuestion, StudySums,
};
use northing_recording::limits::read_description;
use northing_recording::{OpenOptions, has_extension, tracking};
use northing_report::study_part::{self, StudyPart};

use crate::arguments::recordings;
use crate::files::output::{check_ending, check_free, print, print_json};
use crate::interrupt;
use crate::progress::SharedProgress;
use crate::text::table::Table;

/// Runs of a part file: so many, or a thousandth of what is to be run where that is more.
const PART_RUNS: u64 = 64;
/// Most of them: a part is kept in memory until it is written.
const MOST_PART_RUNS: u64 = 4096;

/// Arguments of `study`.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    long_about = "Runs estimators with varied parameters and seeds over recordings, random worlds or a tracking scenario, as \
                  study.toml says (docs/studies.md), on all processors. With --out each piece of the runs becomes a part file, a row a \
                  run; parts that are there count as done, so that a study that was cut off goes on where it was, and shards on several \
                  machines make parts that merge to the same bytes in any order. The hash depends on the study, its data and the version \
                  of the program alone.",
    after_help = "\
Examples:
  northing study study.toml
  northing study study.toml --out parts/          # go on where it was: the same line again
  northing study merge parts/ --out study.parquet

A study as an array job, shards from 1, or from 0 as Slurm and Kubernetes count:
  northing study study.toml --shard 3/16 --out parts/
  northing study study.toml --shard-index $SLURM_ARRAY_TASK_ID --shards 16 --out parts/"
)]
pub(crate) struct StudyArgs {
    #[command(subcommand)]
    command: Option<StudyCommand>,
    /// Study: a .toml file
    #[arg(value_name = "STUDY", required = true)]
    study: Option<PathBuf>,
    /// Only the I-th of N shards of the runs, I from 1; needs --out
    #[arg(
        long,
        value_name = "I/N",
        requires = "out",
        conflicts_with = "shard_index"
    )]
    shard: Option<String>,
    /// Only the shard of this index, from 0; needs --shards and --out
    #[arg(long, value_name = "I", requires = "shards", requires = "out")]
    shard_index: Option<u64>,
    /// Of so many shards
    #[arg(
        long,
        value_name = "N",
        requires = "shard_index",
        conflicts_with = "shard"
    )]
    shards: Option<u64>,
    /// Folder of the part files; made if it is not there
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Folder of the files that manifests name, in place of the study's `data`
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Threads; without it all processors
    #[arg(long, value_name = "NUMBER")]
    threads: Option<usize>,
    /// Print one JSON document: exact sums by estimator and by value of each parameter
    #[arg(long)]
    json: bool,
}

/// What else can be done with studies.
#[derive(Debug, Subcommand)]
enum StudyCommand {
    /// Put the parts of a study together, in any order
    Merge(MergeArgs),
}

/// Arguments of `study merge`.
#[derive(Debug, Args)]
struct MergeArgs {
    /// Part files, or folders of them
    #[arg(value_name = "PART", required = true)]
    parts: Vec<PathBuf>,
    /// Write one table, a row a run (.parquet)
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Overwrite it if it exists
    #[arg(long)]
    force: bool,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Runs a study, or merges one.
pub(crate) fn execute(args: &StudyArgs) -> Result<()> {
    match (&args.command, &args.study) {
        (Some(StudyCommand::Merge(args)), _) => execute_merge(args),
        (None, Some(path)) => execute_study(args, path),
        (None, None) => bail!("which study? name a .toml file; docs/studies.md has an example"),
    }
}

fn execute_study(args: &StudyArgs, path: &Path) -> Result<()> {
    let place = path.display().to_string();
    let file = StudyFile::parse(&place, &read_description(path)?)?;
    let (found, left_out) = find(&file, path, args.data.as_deref())?;
    let study = Study::new(&file, found).with_context(|| place.clone())?;
    let shard = match (&args.shard, args.shard_index, args.shards) {
        (Some(text), _, _) => Shard::parse(text)?,
        (None, Some(index), Some(count)) => Shard::from_zero(index, count)?,
        _ => Shard::WHOLE,
    };
    let range = shard.range(study.plan().runs());
    if range.is_empty() {
        return Err(shard.without_runs().into());
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(args.threads.unwrap_or(0))
        .build()
        .context("threads")?;
    let outcome = pool.install(|| match &args.out {
        Some(folder) => into_folder(&study, range, folder, &place),
        None => in_memory(&study, range),
    })?;
    conclude(&outcome, &left_out, args.json)
}

/// The sources of a study, and sentences about files that are none.
fn find(
    file: &StudyFile,
    study: &Path,
    data: Option<&Path>,
) -> Result<(FoundSources, Vec<String>)> {
    let beside = study.parent().unwrap_or(Path::new(""));
    match &file.sources {
        SourceEntries::Worlds(_) => Ok((FoundSources::Worlds, Vec::new())),
        SourceEntries::Scenario(table) => {
            let text = read_description(&beside.join(&table.file))?;
            Ok((FoundSources::Scenario(text), Vec::new()))
        }
        SourceEntries::Recordings { entries, data: own } => {
            let own = own.as_ref().map(|folder| beside.join(folder));
            let data = data.map(Path::to_owned).or(own);
            let mut all = Vec::new();
            let mut left_out = Vec::new();
            for entry in entries {
                let path = beside.join(entry);
                let paths = match file.question {
                    StudyQuestion::Tracking => target_recordings(&path, data.as_deref())?,
                    question => sensor_recordings(&path, data.as_deref(), question, &mut left_out)?,
                };
                all.extend(paths.into_iter().map(|found| named(entry, &path, found)));
            }
            Ok((FoundSources::Recordings(all, data), left_out))
        }
    }
}

/// A recording by the name that the study leads to it with.
fn named(entry: &str, folder: &Path, path: PathBuf) -> FoundRecording {
    let entry = entry.trim_end_matches('/');
    let name = match path.strip_prefix(folder) {
        Ok(rest) if rest.as_os_str().is_empty() => entry.to_owned(),
        Ok(rest) => {
            let parts = rest
                .components()
                .map(|part| part.as_os_str().to_string_lossy());
            let parts: Vec<_> = parts.collect();
            format!("{entry}/{}", parts.join("/"))
        }
        Err(_) => path.display().to_string(),
    };
    FoundRecording { name, path }
}

fn sensor_recordings(
    path: &Path,
    data: Option<&Path>,
    question: StudyQuestion,
    left_out: &mut Vec<String>,
) -> Result<Vec<PathBuf>> {
    let options = OpenOptions {
        data: data.map(Path::to_owned),
        ..OpenOptions::default()
    };
    let paths = [path.to_owned()];
    let found = match question {
        StudyQuestion::Navigation => recordings::find_navigation(&paths, &options)?,
        _ => recordings::find(&paths, &options)?,
    };
    if let Some(broken) = found.broken.first() {
        bail!("{broken}");
    }
    left_out.extend(found.left_out);
    for path in &found.paths {
        northing_recording::open(path, &options)?;
    }
    Ok(found.paths)
}

/// A manifest of targets, or those of a folder.
fn target_recordings(path: &Path, data: Option<&Path>) -> Result<Vec<PathBuf>> {
    if !path.is_dir() {
        tracking::open(path, data)?;
        return Ok(vec![path.to_owned()]);
    }
    let mut paths = files_of(path, "toml")?;
    paths.retain(|path| tracking::open(path, data).is_ok());
    if paths.is_empty() {
        bail!(
            "{}: no recordings of targets in this folder; expected manifests (.toml)",
            path.display()
        );
    }
    Ok(paths)
}

/// The files of a folder with this ending, by name.
fn files_of(folder: &Path, ending: &str) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).and_then(Iterator::collect::<Result<Vec<_>, _>>);
    let entries = entries.with_context(|| format!("{}: cannot search it", folder.display()))?;
    let mut paths: Vec<_> = entries.into_iter().map(|entry| entry.path()).collect();
    // What is half written has a name that begins with a point.
    let is_hidden = |path: &Path| {
        path.file_name()
            .is_some_and(|name| name.as_encoded_bytes().starts_with(b"."))
    };
    paths.retain(|path| path.is_file() && has_extension(path, ending) && !is_hidden(path));
    paths.sort();
    Ok(paths)
}

/// Runs what is missing in a folder, part by part.
fn into_folder(
    study: &Study,
    range: Range<u64>,
    folder: &Path,
    place: &str,
) -> Result<StudyOutcome> {
    let plan = study.plan();
    let mut held = Vec::new();
    if folder.exists() {
        for path in files_of(folder, "parquet")? {
            let part = StudyPart::open(&path)?;
            part.check(plan.key(), place)?;
            held.extend(part.ranges);
        }
    } else {
        fs::create_dir_all(folder)
            .with_context(|| format!("{}: cannot make it", folder.display()))?;
    }
    let pieces = missing(range.clone(), &held, part_runs(&range));
    let runs = pieces.iter().map(|piece| piece.end - piece.start).sum();
    let progress = SharedProgress::of_steps(runs, "runs");
    for piece in pieces {
        let rows = run(study, piece.clone(), &progress)?;
        let path = folder.join(format!(
            "runs-{:08}-{:08}.parquet",
            piece.start,
            piece.end - 1
        ));
        if let Err(error) = study_part::write(&path, plan, piece.clone(), rows, false) {
            // Another process that runs the same shard, as after a worker was taken for dead, was faster.
            let is_there = path.exists() && {
                let part = StudyPart::open(&path)?;
                part.check(plan.key(), place)?;
                part.ranges == [piece]
            };
            if !is_there {
                return Err(error);
            }
        }
    }
    let merged = study_part::merge(&files_of(folder, "parquet")?, None)?;
    Ok(StudyOutcome::of(&merged.plan, &merged.sums, merged.hash))
}

fn part_runs(range: &Range<u64>) -> u64 {
    ((range.end - range.start) / 1000).clamp(PART_RUNS, MOST_PART_RUNS)
}

/// Runs everything and keeps the sums.
fn in_memory(study: &Study, range: Range<u64>) -> Result<StudyOutcome> {
    let plan = study.plan();
    let (mut sums, mut hash) = (StudySums::new(plan), RowsHash::of(plan.key()));
    let progress = SharedProgress::of_steps(range.end - range.start, "runs");
    for piece in missing(range.clone(), &[], part_runs(&range)) {
        for row in run(study, piece, &progress)? {
            sums.add(plan, &row);
            hash.add(&row);
        }
    }
    Ok(StudyOutcome::of(plan, &sums, hash.finish()))
}

fn run(
    study: &Study,
    piece: Range<u64>,
    progress: &SharedProgress,
) -> Result<Vec<northing_experiments::studies::Row>> {
    let go_on = || {
        progress.step();
        !interrupt::happened()
    };
    let rows = study.run_while(piece, &go_on);
    rows.context("interrupted")
}

fn execute_merge(args: &MergeArgs) -> Result<()> {
    if let Some(out) = &args.out {
        check_ending(out, "parquet", "a table of a study is written as Parquet")?;
        check_free(out, args.force)?;
    }
    let mut parts = Vec::new();
    for path in &args.parts {
        match path.is_dir() {
            true => parts.extend(files_of(path, "parquet")?),
            false => parts.push(path.clone()),
        }
    }
    let out = args.out.as_deref().map(|path| (path, args.force));
    let merged = study_part::merge(&parts, out)?;
    let outcome = StudyOutcome::of(&merged.plan, &merged.sums, merged.hash);
    conclude(&outcome, &[], args.json)
}

fn conclude(outcome: &StudyOutcome, left_out: &[String], json: bool) -> Result<()> {
    if json {
        return print_json(outcome);
    }
    let mut text = text(outcome);
    for sentence in left_out {
        text.push_str(&format!("Left out: {sentence}\n"));
    }
    print(&text)
}

/// The result for people.
fn text(outcome: &StudyOutcome) -> String {
    let mut table = Table::new(&[
        "<estimator",
        "<score",
        "runs",
        "mean",
        "std",
        "least",
        "greatest",
    ]);
    let number =
        |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.4}"));
    for estimator in &outcome.estimators {
        let scored = estimator.scores.iter().filter(|(_, score)| score.count > 0);
        for (name, score) in scored {
            table.row([
                estimator.estimator.clone(),
                (*name).to_owned(),
                score.count.to_string(),
                number(score.mean),
                number(score.std),
                number(score.least),
                number(score.greatest),
            ]);
        }
    }
    let held = match outcome.runs_held == outcome.runs {
        true => format!("{} runs", outcome.runs),
        false => format!("{} of {} runs", outcome.runs_held, outcome.runs),
    };
    let failed: u64 = outcome.estimators.iter().map(|of| of.failed).sum();
    let mut text = format!(
        "{}: {held}, study {}\n\n{}\nHash {}\n",
        outcome.study,
        short(&outcome.study_sha256),
        table.render("  "),
        outcome.hash,
    );
    if let Some(first) = &outcome.first_error {
        text.push_str(&format!(
            "Runs without scores: {failed}; the first is {first}\n"
        ));
    }
    text
}
