//! `northing montecarlo`: many runs of a tracking scenario, and what they say together.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use clap::{Args, Subcommand};
use northing_experiments::radar::campaign::merge;
use northing_experiments::radar::{Campaign, CampaignOutcome, Part, Shard};
use northing_recording::atomic_file::write_whole;

use crate::arguments::scenario::{self, ScenarioArgs};
use crate::files::output::{check_ending, check_free, check_not_input, print, print_json};
use crate::interrupt;
use crate::progress::SharedProgress;
use crate::text::table::Table;
use northing_report::campaign_outcome::{self, FEWEST_FOR_VERDICT, counted};
use northing_report::campaign_part;

/// Arguments of `montecarlo`.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    long_about = "Runs a tracking scenario many times, on all processors, and prints for each tracker how \
                  large its errors are and whether it knows: RMSE, and NEES with its 95 % band. The result \
                  depends on scenario, seed and number of runs alone, to the last digit: not on threads, and \
                  not on how a campaign is split.",
    after_help = "\
Examples:
  northing montecarlo scenarios/tracking/wilthil_brekke.toml
  northing montecarlo scenarios/tracking/wilthil_brekke.toml --variant paper --runs 400 --report paper.html
  northing montecarlo scenarios/tracking/wilthil_brekke.toml --trackers converted,schmidt --json

A campaign as an array job, one shard a task, merged at the end:
  northing montecarlo scenario.toml --runs 10000 --shard 3/16 --out part3.parquet
  northing montecarlo merge part*.parquet --json"
)]
pub(crate) struct MonteCarloArgs {
    #[command(subcommand)]
    command: Option<MonteCarloCommand>,
    #[command(flatten)]
    scenario: Option<ScenarioArgs>,
    /// Number of runs; without it that of the scenario
    #[arg(long, value_name = "NUMBER")]
    runs: Option<u64>,
    /// Threads; without it all processors
    #[arg(long, value_name = "NUMBER")]
    threads: Option<usize>,
    /// Only the I-th of N parts of the runs; needs --out
    #[arg(long, value_name = "I/N", requires = "out")]
    shard: Option<String>,
    /// Write the sums as a part for `merge` (.parquet) instead of printing
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    shown: ShownArgs,
}

/// How a result is shown.
#[derive(Debug, Args)]
pub(crate) struct ShownArgs {
    /// Print one JSON document
    #[arg(long)]
    json: bool,
    /// Write a report with plots: one HTML file for a browser
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Overwrite files that exist
    #[arg(long)]
    force: bool,
}

/// What else can be done with campaigns.
#[derive(Debug, Subcommand)]
enum MonteCarloCommand {
    /// Put the parts of a campaign together
    Merge(MergeArgs),
}

/// Arguments of `montecarlo merge`.
#[derive(Debug, Args)]
struct MergeArgs {
    /// Parts, as `--out` wrote them
    #[arg(value_name = "PART", required = true)]
    parts: Vec<PathBuf>,
    /// Write the merged part (.parquet) instead of printing
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    shown: ShownArgs,
}

/// Runs a campaign, or merges one.
pub(crate) fn execute(args: &MonteCarloArgs) -> Result<()> {
    match (&args.command, &args.scenario) {
        (Some(MonteCarloCommand::Merge(args)), _) => execute_merge(args),
        (None, Some(scenario)) => execute_campaign(args, scenario),
        (None, None) => {
            bail!("which scenario? name a .toml file, e.g. scenarios/tracking/wilthil_brekke.toml")
        }
    }
}

fn execute_campaign(args: &MonteCarloArgs, wanted: &ScenarioArgs) -> Result<()> {
    let scenario = scenario::read(wanted)?;
    let runs = args
        .runs
        .unwrap_or_else(|| u64::from(scenario.meta.monte_carlo_runs));
    let seed = wanted.seed.unwrap_or(scenario.meta.seed);
    let shard = match &args.shard {
        Some(text) => Shard::parse(text)?,
        None => Shard::WHOLE,
    };
    let campaign = Campaign::new(&scenario, &wanted.trackers, seed, runs)?;
    for output in args.out.iter().chain(&args.shown.report) {
        check_not_input(output, &wanted.scenario, None)?;
    }
    check_outputs(args.out.as_deref(), &args.shown)?;
    let part = run(&campaign, shard, runs, args.threads)?;
    conclude(&part, args.out.as_deref(), &args.shown)
}

fn check_outputs(out: Option<&Path>, shown: &ShownArgs) -> Result<()> {
    if let Some(out) = out {
        check_ending(out, "parquet", "sums of a campaign are written as Parquet")?;
    }
    for path in out.into_iter().chain(shown.report.as_deref()) {
        check_free(path, shown.force)?;
    }
    Ok(())
}

fn run(campaign: &Campaign, shard: Shard, runs: u64, threads: Option<usize>) -> Result<Part> {
    let range = shard.range(runs);
    let progress = SharedProgress::of_steps(range.end - range.start, "runs");
    let done = || {
        interrupt::exit_if_happened();
        progress.step();
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads.unwrap_or(0))
        .build()
        .context("threads")?;
    Ok(pool.install(|| campaign.run(shard, &done))?)
}

fn execute_merge(args: &MergeArgs) -> Result<()> {
    check_outputs(args.out.as_deref(), &args.shown)?;
    let parts = args.parts.iter().map(|path| {
        let part = campaign_part::read(path)?;
        Ok((path.display().to_string(), part))
    });
    let whole = merge(parts.collect::<Result<Vec<_>>>()?)?;
    if whole.sums.runs < whole.key.runs && args.out.is_none() {
        let (held, all) = (whole.sums.runs, whole.key.runs);
        eprintln!("northing: these parts hold {held} of the campaign's {all} runs");
    }
    conclude(&whole, args.out.as_deref(), &args.shown)
}

/// Writes or prints what there is.
fn conclude(part: &Part, out: Option<&Path>, shown: &ShownArgs) -> Result<()> {
    let outcome = CampaignOutcome::of(part);
    if let Some(path) = &shown.report {
        let html = campaign_outcome::render(part, &outcome);
        write_whole(path, html.as_bytes(), shown.force)?;
    }
    if let Some(path) = out {
        campaign_part::write(path, part, shown.force)?;
    }
    if shown.json {
        print_json(&outcome)
    } else if out.is_some() {
        Ok(())
    } else {
        print(&text(&outcome))
    }
}

/// The result for people.
fn text(outcome: &CampaignOutcome) -> String {
    let [low, high] = outcome.nees_band;
    let mut table = Table::new(&[
        "<tracker",
        "position m",
        "velocity m/s",
        "1-60 s m",
        "m/s",
        "61- s m",
        "m/s",
        "NEES",
        "in band",
        "skipped",
    ]);
    for (name, tracker) in &outcome.trackers {
        if tracker.has_lost_the_target() {
            let mut row = vec![name.clone(), "lost".to_owned()];
            row.resize(9, "-".to_owned());
            row.push(tracker.skipped_updates.to_string());
            table.row(row);
            continue;
        }
        table.row([
            name.clone(),
            format!("{:.2}", tracker.position_rmse_m),
            format!("{:.3}", tracker.velocity_rmse_m_s),
            format!("{:.2}", tracker.transient.position_rmse_m),
            format!("{:.3}", tracker.transient.velocity_rmse_m_s),
            format!("{:.2}", tracker.steady.position_rmse_m),
            format!("{:.3}", tracker.steady.velocity_rmse_m_s),
            format!("{:.2}", tracker.nees_mean),
            format!("{:.0} %", 100.0 * tracker.nees_inside_band),
            tracker.skipped_updates.to_string(),
        ]);
    }
    let navigation = &outcome.navigation;
    format!(
        "{}: {}, seed {}, {:.1} s\n\n{}\n\
         RMSE over the runs. NEES: 4 is consistent, more is overconfident. In band: the scans at which the mean of {} lies \
         in {low:.2} to {high:.2}, as it does at 95 % of them when the tracker is consistent.{}\n\
         Navigation: heading {:.2} deg stated, {:.2} deg true; pose NEES {:.2} of 3.\n",
        outcome.scenario,
        counted(outcome.runs, "run"),
        outcome.seed,
        outcome.elapsed_s,
        table.render("  "),
        counted(outcome.runs, "run"),
        match outcome.runs < FEWEST_FOR_VERDICT {
            true => " So few runs do not tell trackers apart.",
            false => "",
        },
        navigation.heading_std_deg,
        navigation.heading_rmse_deg,
        navigation.pose_nees_mean,
    )
}
