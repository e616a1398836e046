//! `northing simulate`: one run of a tracking scenario, step by step.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use northing_experiments::radar::single_run::RunSummary;
use northing_experiments::radar::{Campaign, SingleRun};
use northing_recording::atomic_file::write_whole;

use crate::arguments::scenario::{self, ScenarioArgs};
use crate::files::output::{check_ending, check_free, check_not_input, print, print_json};
use crate::text::table::Table;

/// Arguments of `simulate`.
#[derive(Debug, Args)]
#[command(
    long_about = "Simulates one run of a tracking scenario: a ship with an inertial unit, a GPS compass and a \
                  radar, a target, and every tracker on the same measurements. The run is the one that a \
                  campaign with this seed has under this number.",
    after_help = "\
Examples:
  northing simulate scenarios/tracking/wilthil_brekke.toml
  northing simulate scenarios/tracking/wilthil_brekke.toml --variant paper --run 17 --out run17.csv
  northing simulate scenarios/tracking/wilthil_brekke.toml --trackers schmidt,joint --json"
)]
pub(crate) struct SimulateArgs {
    #[command(flatten)]
    scenario: ScenarioArgs,
    /// Number of the run within the campaign
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    run: u64,
    /// Write truth and estimates of each scan as a table (.csv)
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Overwrite the table if it exists
    #[arg(long)]
    force: bool,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Simulates.
pub(crate) fn execute(args: &SimulateArgs) -> Result<()> {
    let wanted = &args.scenario;
    let scenario = scenario::read(wanted)?;
    let seed = wanted.seed.unwrap_or(scenario.meta.seed);
    let campaign = Campaign::new(&scenario, &wanted.trackers, seed, 1)?;
    if let Some(path) = &args.out {
        check_ending(path, "csv", "a run is written as CSV")?;
        check_not_input(path, &wanted.scenario, None)?;
        check_free(path, args.force)?;
    }
    let run = SingleRun::of(&campaign, &scenario.meta.name, seed, args.run);
    if let Some(path) = &args.out {
        write_whole(path, run.csv().as_bytes(), args.force)?;
    }
    if args.json {
        print_json(&run.summary)
    } else {
        print(&text(&run.summary))
    }
}

fn text(document: &RunSummary) -> String {
    let mut table = Table::new(&[
        "<tracker",
        "position m",
        "velocity m/s",
        "at the end m",
        "skipped",
    ]);
    for (name, result) in &document.trackers {
        table.row([
            (*name).to_owned(),
            format!("{:.2}", result.position_rmse_m),
            format!("{:.3}", result.velocity_rmse_m_s),
            format!("{:.2}", result.final_position_error_m),
            result.skipped_updates.to_string(),
        ]);
    }
    format!(
        "{}: seed {}, run {}, {} scans; own heading off by {:.2} deg RMS\n\n{}",
        document.scenario,
        document.seed,
        document.run,
        document.scans,
        document.heading_rmse_deg,
        table.render("  ")
    )
}
