//! `northing experiment faults`: faults of sensors laid over worlds and recordings, and what they cost every estimator.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::{Context as _, Result, bail};
use clap::Args;
use northing_experiments::faults::{Campaign, CampaignOutcome, FaultRow, Part, Stream, Subject};
use northing_recording::{OpenOptions, open};
use northing_simulation::fault_injection::InjectedFault;

use super::frame::{OutputArgs, percent, with_progress, within};
use crate::arguments::recordings;
use crate::files::output::number;
use crate::text::table::Table;

/// Most worlds of a question: every run is kept.
const MOST_RUNS: u64 = 1000;

/// What recordings are to have.
const EXPECTED: &str = "expected 90 s or more with a gyroscope and a reference attitude or fixes";

/// Arguments of `experiment faults`.
#[derive(Debug, Args)]
#[command(
    long_about = "Lays one fault at a time (a spike, a frozen, silent, clipped or biased sensor, garbage, a false stamp, a wrong fix) over \
                  clean streams of samples and runs every estimator without and with it: simulated worlds with healthy sensors, and \
                  recordings. Limits: one bad sample costs at most 1.2 times the clean RMS error; after any other fault the error \
                  is within 5 deg, or 3 times the clean RMS of the position, 10 s after samples are normal again, and stays \
                  there, and the NEES per degree of freedom is below 3 in the minute after. What a clean run has as well is not counted. Detected: found in the right sensor within 10 s.",
    after_help = "\
Examples:
  northing experiment faults
  northing experiment faults --report faults.html
  northing experiment faults --estimator mekf --kind gyroscope-spike --runs 50
  northing experiment faults --data recordings --runs 4 --json
  northing experiment faults examples/recordings/car_rtk.toml --data data"
)]
pub(super) struct FaultsArgs {
    /// Recordings or manifests, all of them, with a reference attitude or with fixes
    #[arg(value_name = "RECORDING")]
    recordings: Vec<PathBuf>,
    /// How many simulated worlds of attitude, and as many of navigation; with --data also the most recordings, spread evenly
    #[arg(long, value_name = "NUMBER", default_value_t = 12)]
    runs: u64,
    /// Seed of worlds and faults
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    seed: u64,
    /// An estimator of attitude or navigation, more than once for several [default: all]
    #[arg(long, value_name = "NAME", value_parser = subject)]
    estimator: Vec<Subject>,
    /// A fault, more than once for several [default: all]
    #[arg(long, value_name = "NAME", value_parser = fault)]
    kind: Vec<&'static InjectedFault>,
    /// Folder of recordings; may be given several times. With recordings named: the folder of the files that manifests name
    #[arg(long, value_name = "DIR")]
    data: Vec<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
}

fn subject(name: &str) -> Result<Subject, String> {
    Subject::named(name).ok_or_else(|| {
        format!(
            "no estimator `{name}`; expected one of {}",
            Subject::names()
        )
    })
}

fn fault(name: &str) -> Result<&'static InjectedFault, String> {
    InjectedFault::named(name).ok_or_else(|| {
        format!(
            "no fault `{name}`; expected one of {}",
            InjectedFault::names()
        )
    })
}

/// Runs the campaign.
pub(super) fn execute(args: &FaultsArgs) -> Result<()> {
    args.output.check_free()?;
    within("--runs", args.runs, MOST_RUNS)?;
    let campaign = asked(args)?;
    let outcome = with_progress(campaign.streams(), "streams", |done| campaign.run(done));
    if outcome.rows.is_empty() {
        bail!(
            "none of these faults concerns one of these estimators; leave --kind or --estimator out"
        );
    }
    if args.output.has_report() {
        let again = |judgement| campaign.again(judgement);
        let drawn: Vec<_> = outcome.worst.iter().filter_map(again).collect();
        args.output.write_report(|command| {
            northing_report::faults_html(&outcome, &drawn, Some(command))
        })?;
    }
    args.output.print(&outcome, || text(&outcome))
}

fn asked(args: &FaultsArgs) -> Result<Campaign> {
    let mut campaign = Campaign::of_worlds(args.seed, args.runs);
    if !args.estimator.is_empty() {
        campaign.subjects.clone_from(&args.estimator);
    }
    if !args.kind.is_empty() {
        campaign.faults.clone_from(&args.kind);
    }
    campaign.recordings = recorded(args)?;
    leave_out(&mut campaign, args)?;
    Ok(campaign)
}

/// Refuses recordings on which nothing would be run; of folders those that are left are enough.
fn leave_out(campaign: &mut Campaign, args: &FaultsArgs) -> Result<()> {
    let mut recordings = std::mem::take(&mut campaign.recordings);
    let told = recordings.iter().find_map(|stream| {
        let why = campaign.without_run(stream)?;
        Some(format!("{}: {why}", stream.name))
    });
    recordings.retain(|stream| campaign.without_run(stream).is_none());
    if let Some(told) = told
        && (!args.recordings.is_empty() || recordings.is_empty())
    {
        bail!(told);
    }
    campaign.recordings = recordings;
    Ok(())
}

/// The recordings that are named, or of each folder at most so many as there are runs, spread evenly.
fn recorded(args: &FaultsArgs) -> Result<Vec<Stream>> {
    let mut options = OpenOptions::default();
    if !args.recordings.is_empty() {
        options.data = args.data.first().cloned();
        return args
            .recordings
            .iter()
            .zip(0..)
            .map(|(path, number)| {
                let mut recording = open(path, &options)?;
                let name = path.display();
                Stream::recorded(&mut recording, number)
                    .with_context(|| format!("{name}: cannot lay faults over it; {EXPECTED}"))
            })
            .collect();
    }
    let mut streams = Vec::new();
    for folder in &args.data {
        let paths = recordings::find_navigation(std::slice::from_ref(folder), &options)?.paths;
        let every = paths.len().div_ceil(args.runs as usize).max(1);
        let before = streams.len();
        for (path, number) in paths.iter().zip(0..).step_by(every) {
            let stream = open(path, &options).ok();
            streams
                .extend(stream.and_then(|mut recording| Stream::recorded(&mut recording, number)));
        }
        if streams.len() == before {
            bail!(
                "{}: no recording to lay faults over; {EXPECTED}",
                folder.display()
            );
        }
    }
    Ok(streams)
}

/// The result for people.
fn text(outcome: &CampaignOutcome) -> String {
    let mut text = format!(
        "{} runs, seed {}, default parameters\n\nShare of the runs that meet the limits, %. One bad sample: RMS at most 1.2 times the clean one; else within 5 deg or 3 times\n\
         the clean RMS of the position 10 s after the fault and for a minute, NEES per degree of freedom below 3 meanwhile.\n",
        outcome.runs.len(),
        outcome.seed,
    );
    let parts = outcome.parts();
    for part in &parts {
        let _ = write!(text, "\n{}\n{}", part.title, shares(part));
    }
    for part in &parts {
        let (name, rows) = part.of_default();
        let _ = write!(text, "\n{name}: {}\n{}", part.title, details(&rows));
    }
    text.push_str(&alarms(outcome));
    text
}

/// False alarms on clean data.
fn alarms(outcome: &CampaignOutcome) -> String {
    if outcome.alarms.is_empty() {
        return String::new();
    }
    let mut table = Table::new(&["<estimator", "<data", "hours", "alarms", "an hour"]);
    for row in &outcome.alarms {
        table.row([
            row.estimator.to_owned(),
            row.origin.name().to_owned(),
            format!("{:.2}", row.hours),
            row.alarms.to_string(),
            format!("{:.1}", row.per_hour),
        ]);
    }
    format!("\nFalse alarms on clean data\n{}", table.render("  "))
}

/// A row a fault, a column an estimator: shares that meet the limits.
fn shares(part: &Part<'_>) -> String {
    let names = part.estimators();
    let mut table = Table::new(&[&["<fault"][..], &names].concat());
    for fault in part.faults() {
        let share = |name: &&str| part.row(fault, name).map(|row| 100.0 * row.meets_share);
        let cells = names.iter().map(|name| number(share(name), 0));
        table.row(core::iter::once(fault.to_owned()).chain(cells));
    }
    table.render("  ")
}

/// A row a fault of one estimator.
fn details(rows: &[&FaultRow]) -> String {
    let mut table = Table::new(&[
        "<fault",
        "runs",
        "clean RMS",
        "RMS/clean",
        "95th",
        "largest",
        "recovery s",
        "in 10 s %",
        "NEES/dof",
        "below 3 %",
        "clean %",
        "detected %",
        "meets %",
    ]);
    for row in rows {
        table.row([
            row.fault.to_owned(),
            row.runs.to_string(),
            number(row.clean_rms, 2),
            number(row.cost, 2),
            number(row.cost_95, 2),
            number(row.largest, 1),
            number(row.recovery_s, 1),
            percent(Some(row.recovered_share)),
            number(row.nees, 1),
            percent(row.nees_share),
            percent(row.clean_nees_share),
            percent(row.detected_share),
            percent(Some(row.meets_share)),
        ]);
    }
    table.render("  ")
}
