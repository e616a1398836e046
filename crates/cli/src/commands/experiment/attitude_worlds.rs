//! `northing experiment attitude-worlds`: attitude estimators on random boards and motions, and what the verdicts name.

use std::fmt::Write as _;

use anyhow::{Context as _, Result};
use clap::Args;
use northing_evaluation::EstimatorKind;
use northing_experiments::attitude_worlds::{
    Confusion, EstimatorOutcome, EstimatorRun, GroupRow, Sensing, StatedRow, WorldRun, Worlds,
    WorldsOutcome, every_estimator,
};
use northing_simulation::attitude_world::WorldMotion;

use super::frame::{OutputArgs, WorldsArgs, each_second, percent, with_progress};
use crate::files::output::number;
use crate::text::table::Table;

/// Most worlds of one run: their judgements are kept in memory.
const MOST_WORLDS: u64 = 100_000;

/// Arguments of `experiment attitude-worlds`.
#[derive(Debug, Args)]
#[command(
    long_about = "Draws worlds from a seed (boards with noise over three decades, on a desk, in a hand, walking, running, swinging, \
                  driving, flying, turning slowly and fast; most with one fault such as rounding, holes, jitter, saturation, \
                  magnets, two chips that are not parallel), runs the estimators with their default parameters and VQF on the \
                  same samples, with all sensors and with gyroscope and accelerometer, and judges them against the truth and \
                  against what they state. The verdicts' first named cause is compared with the true one.",
    after_help = "\
Examples:
  northing experiment attitude-worlds
  northing experiment attitude-worlds --report worlds.html
  northing experiment attitude-worlds --worlds 270 --estimator bounded-velocity
  northing experiment attitude-worlds --motion running --estimator mekf --set accelerometer_std=3
  northing experiment attitude-worlds --seed 2 --first 500 --worlds 500 --json
  northing experiment attitude-worlds --world 17"
)]
pub(super) struct AttitudeWorldsArgs {
    #[command(flatten)]
    numbers: WorldsArgs,
    /// Of these worlds only those of one motion
    #[arg(long, value_name = "NAME")]
    motion: Option<String>,
    /// An estimator, more than once for several; the tables by motion and fault are of the first [default: all, bounded-velocity first]
    #[arg(long, value_name = "NAME")]
    estimator: Vec<EstimatorKind>,
    /// A parameter that is not the default, for every estimator that reads it
    #[arg(long = "set", value_name = "NAME=VALUE")]
    settings: Vec<String>,
    /// One world: what it has, and a line a second of the first estimator
    #[arg(long, value_name = "NUMBER", alias = "only", conflicts_with_all = ["worlds", "first", "motion"])]
    world: Option<u64>,
    #[command(flatten)]
    output: OutputArgs,
}

/// Runs the worlds, or one.
pub(super) fn execute(args: &AttitudeWorldsArgs) -> Result<()> {
    args.output.check_free()?;
    let worlds = asked(args)?;
    let options = worlds.options()?;
    if let Some(number) = args.world {
        let run = WorldRun::of(args.numbers.seed, number, &options);
        let outcome = WorldsOutcome::of(args.numbers.seed, vec![run.clone().outcome()]);
        write_report(args, &outcome, std::slice::from_ref(&run))?;
        return args.output.print(&run, || one_world(&run));
    }
    let count = args.numbers.counted(&worlds.numbers(), "motion")?;
    let outcome = with_progress(count, "worlds", |done| worlds.run(done))?;
    if args.output.has_report() {
        let worst = outcome.estimators.first().map(|of| of.worst.as_slice());
        let again = |number: &u64| WorldRun::of(args.numbers.seed, *number, &options[..1]);
        let runs: Vec<_> = worst.unwrap_or_default().iter().map(again).collect();
        write_report(args, &outcome, &runs)?;
    }
    args.output
        .print(&outcome, || text(&outcome, args.settings.is_empty()))
}

fn asked(args: &AttitudeWorldsArgs) -> Result<Worlds> {
    args.numbers.check(MOST_WORLDS)?;
    let estimators = if args.estimator.is_empty() {
        every_estimator()
    } else {
        args.estimator.clone()
    };
    Ok(Worlds {
        seed: args.numbers.seed,
        first: args.numbers.first,
        count: args.numbers.worlds,
        motion: args.motion.as_deref().map(motion_named).transpose()?,
        estimators,
        settings: args.settings.clone(),
    })
}

/// The page, with these worlds drawn.
fn write_report(
    args: &AttitudeWorldsArgs,
    outcome: &WorldsOutcome,
    runs: &[WorldRun],
) -> Result<()> {
    let html = |command: &str| northing_report::attitude_worlds_html(outcome, runs, Some(command));
    args.output.write_report(html)
}

fn motion_named(name: &str) -> Result<WorldMotion> {
    WorldMotion::named(name).with_context(|| {
        format!(
            "no motion `{name}`; expected one of {}",
            WorldMotion::names()
        )
    })
}

/// The result for people.
fn text(outcome: &WorldsOutcome, default_parameters: bool) -> String {
    let parameters = if default_parameters {
        "default"
    } else {
        "changed"
    };
    let mut text = format!(
        "{} worlds, seed {}, {parameters} parameters\n\n\
         Medians over worlds of RMS errors in degrees from 5 s on, and of their ratios to VQF's. Coverage of the stated 95 % over the \
         instants of\nall worlds; in band: worlds with coverage 0.90 to 0.99, and of these as many as a consistent estimator would \
         have whose errors last as long.\nFar: green, and beyond 5 sigma; blamed: a sensor inside its band of the mean NIS; right: a true cause is \
         named.\n",
        outcome.worlds.len(),
        outcome.seed,
    );
    for sensing in Sensing::ALL {
        let of_sensing = outcome.estimators.iter().filter(|of| of.sensing == sensing);
        let rows: Vec<_> = of_sensing.map(|of| (of.estimator, &of.total)).collect();
        if !rows.is_empty() {
            let _ = write!(text, "\n{}\n{}", sensing.name(), groups("estimator", &rows));
        }
    }
    for sensing in Sensing::ALL {
        if let Some(of) = outcome.estimator(outcome.subject(), sensing) {
            text.push_str(&details(of));
        }
    }
    text.push_str(&worst(outcome));
    text
}

fn details(of: &EstimatorOutcome) -> String {
    let mut text = String::new();
    for (kind, rows) in [("motion", &of.motions), ("fault", &of.faults)] {
        let rows: Vec<_> = rows.iter().map(|row| (row.group.as_str(), row)).collect();
        let (name, sensing) = (of.estimator, of.sensing.name());
        let _ = write!(
            text,
            "\n{name} by {kind}, {sensing}\n{}",
            groups(kind, &rows)
        );
    }
    if let Some(confusion) = &of.confusion {
        let (name, sensing) = (of.estimator, of.sensing.name());
        let _ = write!(
            text,
            "\n{name}: true cause, and what is named, {sensing}\n{}",
            causes(confusion)
        );
    }
    text
}

fn groups(kind: &str, rows: &[(&str, &GroupRow)]) -> String {
    let first = format!("<{kind}");
    let mut table = Table::new(&[
        &first,
        "worlds",
        "none",
        "tilt",
        "/vqf",
        "heading",
        "/vqf",
        "total",
        "/vqf",
        "tilt cov. %",
        "in band %",
        "of",
        "head. cov. %",
        "in band %",
        "of",
        "far",
        "blamed",
        "right %",
        "false %",
    ]);
    for (name, row) in rows {
        let [tilt, heading] = [&row.tilt, &row.heading].map(|stated| {
            let of = |of: fn(&_) -> f64| percent(stated.as_ref().map(of));
            let band = of(|s: &StatedRow| s.consistent_share);
            [of(|s| s.pooled_coverage), band, of(|s| s.expected_share)]
        });
        let accuracy = [
            row.tilt_rms_deg,
            row.tilt_over_vqf,
            row.heading_rms_deg,
            row.heading_over_vqf,
            row.total_rms_deg,
            row.total_over_vqf,
        ];
        let mut cells = vec![
            (*name).to_owned(),
            row.worlds.to_string(),
            row.without_estimate.to_string(),
        ];
        cells.extend(accuracy.map(|value| number(value, 2)));
        cells.extend(tilt.into_iter().chain(heading));
        cells.extend([row.green_beyond_five, row.blamed_inside_the_band].map(|n| n.to_string()));
        cells.extend([row.right_share, row.false_share].map(percent));
        table.row(cells);
    }
    table.render("  ")
}

fn causes(confusion: &Confusion) -> String {
    let names: Vec<&str> = confusion.named.iter().map(|cause| cause.name()).collect();
    let mut table = Table::new(&[&["<true cause"][..], &names].concat());
    for (cause, counts) in &confusion.rows {
        let mut cells = vec![cause.name().to_owned()];
        cells.extend(counts.iter().map(ToString::to_string));
        table.row(cells);
    }
    table.render("  ")
}

fn worst(outcome: &WorldsOutcome) -> String {
    let Some(of) = outcome.estimators.first() else {
        return String::new();
    };
    let mut table = Table::new(&[
        "world",
        "<motion",
        "tilt",
        "heading",
        "tilt cov. %",
        "NEES/2",
        "<named",
        "<has",
    ]);
    for number_of in &of.worst {
        let Some(world) = outcome.world(*number_of) else {
            continue;
        };
        let Some(score) = world.score(of.estimator, of.sensing) else {
            continue;
        };
        table.row([
            number_of.to_string(),
            world.description.motion.name().to_owned(),
            number(score.tilt_rms_deg, 2),
            number(score.heading_rms_deg, 2),
            percent(score.tilt.map(|tilt| tilt.coverage)),
            number(score.tilt.map(|tilt| tilt.nees), 1),
            score.named.map_or("-", |cause| cause.name()).to_owned(),
            world.description.fault_in_words(),
        ]);
    }
    let (name, sensing) = (of.estimator, of.sensing.name());
    format!("\nThe worst of {name}, {sensing}\n{}", table.render("  "))
}

/// One world for people: what it has, every estimator, and a line a second of the first.
fn one_world(run: &WorldRun) -> String {
    let mut text = run.description.to_string();
    let mut table = Table::new(&[
        "<estimator",
        "<sensors",
        "tilt",
        "heading",
        "total",
        "tilt cov. %",
        "heading cov. %",
        "<named",
        "<true cause",
    ]);
    for EstimatorRun { score, .. } in &run.runs {
        let causes: Vec<_> = score.true_causes.iter().map(|cause| cause.name()).collect();
        table.row([
            score.estimator.to_owned(),
            score.sensing.name().to_owned(),
            number(score.tilt_rms_deg, 2),
            number(score.heading_rms_deg, 2),
            number(score.total_rms_deg, 2),
            percent(score.tilt.map(|s| s.coverage)),
            percent(score.heading.map(|s| s.coverage)),
            score.named.map_or("-", |cause| cause.name()).to_owned(),
            causes.join(", "),
        ]);
    }
    let _ = write!(text, "\n{}", table.render("  "));
    if let Some(first) = run.runs.first() {
        let _ = write!(text, "\n{}\n{}", first.score.estimator, seconds(first));
    }
    text
}

fn seconds(run: &EstimatorRun) -> String {
    let mut table = Table::new(&[
        "t s",
        "tilt error deg",
        "std deg",
        "heading error deg",
        "std deg",
        "total deg",
    ]);
    for instant in each_second(&run.instants, |i| i.time_s) {
        table.row([
            format!("{:.1}", instant.time_s),
            format!("{:.2}", instant.tilt_error_deg),
            number(instant.tilt_std_deg, 2),
            format!("{:.2}", instant.heading_error_deg),
            number(instant.heading_std_deg, 2),
            format!("{:.2}", instant.total_error_deg),
        ]);
    }
    table.render("  ")
}
