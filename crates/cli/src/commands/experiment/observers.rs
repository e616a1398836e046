//! `northing experiment observers`: observers in cascade over simulated flights and recordings.

use std::path::PathBuf;

use anyhow::{Context as _, Result};
use clap::Args;
use northing_experiments::observers::experiment::{
    SCENARIO, SCENARIO_NAME, check_recordings, read_all,
};
use northing_experiments::observers::{Comparison, Condition, Experiment, ExperimentOutcome};
use northing_recording::OpenOptions;
use northing_recording::limits::read_description;
use northing_simulation::scenario::FlightScenarioFile;

use crate::arguments::recordings;
use crate::files::output::{ReportArgs, number, print, print_json};
use crate::interrupt;
use crate::invocation::command_line;
use crate::progress::SharedProgress;
use crate::text::table::Table;

/// Arguments of `experiment observers`.
#[derive(Debug, Args)]
#[command(
    long_about = "Runs Mahony's complementary filter (original), the same behind a quaternion EKF (modified), and that EKF \
                  alone over simulated flights, and over recordings with a reference attitude. Each is tuned on \
                  one half and scored on the other. Prints error, gain with its confidence interval, and cost.",
    after_help = "\
Examples:
  northing experiment observers
  northing experiment observers --data recordings/broad --report observers.html
  northing experiment observers --condition rotation --condition free-1.5 --json"
)]
pub(super) struct ObserversArgs {
    /// Folder of recordings with reference; each folder is a condition of its own
    #[arg(long, value_name = "DIR")]
    data: Vec<PathBuf>,
    /// Flights that are scored in each simulated condition; as many others are tuned on
    #[arg(long, value_name = "NUMBER", default_value_t = 30)]
    flights: u64,
    /// Seed of the flights
    #[arg(long, value_name = "NUMBER", default_value_t = 1)]
    seed: u64,
    /// Conditions to fly instead of the built-in ones: a .toml file
    #[arg(long, value_name = "FILE")]
    scenario: Option<PathBuf>,
    /// Only this condition, a variant of the scenario; may be given again
    #[arg(long, value_name = "NAME")]
    condition: Vec<String>,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    report: ReportArgs,
}

/// Flies, tunes and scores.
pub(super) fn execute(args: &ObserversArgs) -> Result<()> {
    args.report.check_free()?;
    let file = scenario(args)?;
    let options = OpenOptions::default();
    let mut folders = Vec::new();
    for folder in &args.data {
        let found = recordings::find(std::slice::from_ref(folder), &options)?;
        for sentence in found.left_out.iter().chain(&found.broken) {
            eprintln!("northing: {sentence}");
        }
        let (name, data) = (name_of(folder), read_all(&found.paths, &options)?);
        check_recordings(&name, &data)?;
        folders.push((name, data));
    }
    let variants = chosen(args, &file)?;
    let experiment = Experiment {
        flights: args.flights,
        seed: args.seed,
    };
    for variant in &variants {
        experiment.check(&file.scenario(Some(variant))?)?;
    }
    let steps = (variants.len() + folders.len()) as u64;
    let progress = SharedProgress::of_steps(steps, "conditions");
    let done = || {
        interrupt::exit_if_happened();
        progress.step();
    };
    let mut conditions = Vec::new();
    for variant in &variants {
        conditions.push(experiment.simulated(&file.scenario(Some(variant))?)?);
        done();
    }
    for (name, data) in &folders {
        conditions.extend(Experiment::recorded(name, data)?);
        done();
    }
    drop(progress);
    let outcome = ExperimentOutcome::of(&experiment, conditions);
    conclude(args, &outcome.context("no condition is left to fly")?)
}

fn scenario(args: &ObserversArgs) -> Result<FlightScenarioFile> {
    let Some(path) = &args.scenario else {
        return Ok(FlightScenarioFile::parse(SCENARIO_NAME, SCENARIO)?);
    };
    let name = path.display().to_string();
    let text = read_description(path)?;
    Ok(FlightScenarioFile::parse(&name, &text)?)
}

/// The conditions that are asked for, each of which exists.
fn chosen(args: &ObserversArgs, file: &FlightScenarioFile) -> Result<Vec<String>> {
    if args.condition.is_empty() {
        return Ok(file.variants().to_vec());
    }
    for name in &args.condition {
        file.scenario(Some(name))?;
    }
    Ok(args.condition.clone())
}

fn name_of(folder: &std::path::Path) -> String {
    let name = folder.file_name().unwrap_or(folder.as_os_str());
    name.to_string_lossy().into_owned()
}

fn conclude(args: &ObserversArgs, outcome: &ExperimentOutcome) -> Result<()> {
    args.report
        .write(|| northing_report::observers_html(outcome, Some(&command_line())))?;
    if args.json {
        print_json(outcome)
    } else {
        print(&text(outcome))
    }
}

/// The result for people.
fn text(outcome: &ExperimentOutcome) -> String {
    let conditions = &outcome.conditions;
    let part = |title: &str, of: &dyn Fn(&Condition) -> &Comparison| {
        let rows = conditions.iter().map(|c| (c, of(c)));
        format!("{title}\n{}\n", table(rows))
    };
    let cost = &outcome.cost_ns;
    let times = |ns: f64| format!("{ns:.0} ns, {:.1} times", ns / cost.original);
    let mut costs = format!("original {:.0} ns", cost.original);
    for (name, ns) in [
        ("modified", Some(cost.modified)),
        ("EKF alone", Some(cost.ekf)),
        ("cascade", cost.cascade),
        ("cascade-ekf", cost.cascade_ekf),
    ] {
        if let Some(ns) = ns {
            costs.push_str(&format!("; {name} {}", times(ns)));
        }
    }
    let sentences = northing_report::observers_verdicts(outcome);
    let sentences: Vec<String> = sentences
        .into_iter()
        .map(|v| format!("- {}", v.text))
        .collect();
    format!(
        "{}{}{}Cost of a step, sensors of {}: {costs}\n\n{}\n",
        part("Tuned on one half, scored on the other", &|c| &c.tuned),
        part("At the literature's gains (k_P 1, k_I 0.3)", &|c| &c
            .default),
        part("Tuned, in Northing's forms", &|c| &c.northing),
        outcome.cost_of,
        sentences.join("\n"),
    )
}

fn table<'a>(rows: impl Iterator<Item = (&'a Condition, &'a Comparison)>) -> String {
    let mut table = Table::new(&[
        "<condition",
        "original deg",
        "modified deg",
        "EKF deg",
        "gain %",
        "95 %",
        "position gain %",
        "velocity gain %",
    ]);
    for (condition, c) in rows {
        let [low, high] = c.gain_ci95;
        table.row([
            condition.name.clone(),
            format!("{:.2}", c.original_deg),
            format!("{:.2}", c.modified_deg),
            format!("{:.2}", c.ekf_deg),
            format!("{:.0}", c.gain_percent),
            format!("{low:.0} to {high:.0}"),
            number(c.position_gain_percent, 0),
            number(c.velocity_gain_percent, 0),
        ]);
    }
    table.render("  ")
}
