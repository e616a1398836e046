//! `northing experiment navigation-worlds`: GNSS/INS on random vehicles, inertial units and receivers.

use std::fmt::Write as _;

use anyhow::{Context as _, Result};
use clap::Args;
use northing_experiments::navigation_worlds::{
    ClassRow, FeatureRow, Score, WorldInstant, WorldOutcome, WorldRun, Worlds, WorldsOutcome,
};
use northing_simulation::navigation_world::WorldClass;

use super::frame::{OutputArgs, WorldsArgs, each_second, percent, with_progress};
use crate::files::output::number;
use crate::text::table::Table;

/// Most worlds of one run: their judgements are kept in memory.
const MOST_WORLDS: u64 = 1_000_000;
/// Numbers of lost worlds that are listed.
const SHOWN_NUMBERS: usize = 40;

/// Arguments of `experiment navigation-worlds`.
#[derive(Debug, Args)]
#[command(
    long_about = "Draws worlds from a seed (cars, drones, ships, bicycles, persons; inertial units from tactical to phone grade; \
                  receivers from centimetres to metres with latency, lever arm and faults that nobody tells the filter), runs \
                  the GNSS/INS with its default parameters on each, and judges it against what it states and against \
                  extrapolation of the fixes. Lost: beyond five times the stated 95 % ellipse for ten seconds in one piece, or \
                  a root mean square of three times extrapolation's, or no estimate. Known: the same without the instants at \
                  which no estimator can know its error, which are drifts of the receiver and 20 s after them, wrong fixes \
                  among the first three, and correlated errors that no fix shows; outages are not compared with extrapolation.",
    after_help = "\
Examples:
  northing experiment navigation-worlds
  northing experiment navigation-worlds --report worlds.html
  northing experiment navigation-worlds --worlds 90 --class ship
  northing experiment navigation-worlds --seed 2 --first 500 --worlds 500 --json
  northing experiment navigation-worlds --world 17"
)]
pub(super) struct NavigationWorldsArgs {
    #[command(flatten)]
    numbers: WorldsArgs,
    /// Of these worlds only those of one class
    #[arg(long, value_name = "NAME", alias = "only")]
    class: Option<String>,
    /// One world: what it has, and a line a second
    #[arg(long, value_name = "NUMBER", conflicts_with_all = ["worlds", "first", "class"])]
    world: Option<u64>,
    #[command(flatten)]
    output: OutputArgs,
}

/// Runs the worlds, or one.
pub(super) fn execute(args: &NavigationWorldsArgs) -> Result<()> {
    args.output.check_free()?;
    if let Some(number) = args.world {
        let run = WorldRun::of(args.numbers.seed, number);
        let outcome = WorldsOutcome::of(args.numbers.seed, vec![run.outcome()]);
        write_report(args, &outcome, std::slice::from_ref(&run))?;
        return args.output.print(&run, || one_world(&run));
    }
    let worlds = Worlds {
        seed: args.numbers.seed,
        first: args.numbers.first,
        count: args.numbers.worlds,
        class: args.class.as_deref().map(class_named).transpose()?,
    };
    args.numbers.check(MOST_WORLDS)?;
    let count = args.numbers.counted(&worlds.numbers(), "class")?;
    let outcome = with_progress(count, "worlds", |done| worlds.run(done));
    if args.output.has_report() {
        let again = |number: &u64| WorldRun::of(args.numbers.seed, *number);
        let runs: Vec<_> = outcome.worst.iter().map(again).collect();
        write_report(args, &outcome, &runs)?;
    }
    args.output.print(&outcome, || text(&outcome))
}

/// The page, with these worlds drawn.
fn write_report(
    args: &NavigationWorldsArgs,
    outcome: &WorldsOutcome,
    runs: &[WorldRun],
) -> Result<()> {
    let html =
        |command: &str| northing_report::navigation_worlds_html(outcome, runs, Some(command));
    args.output.write_report(html)
}

fn class_named(name: &str) -> Result<WorldClass> {
    WorldClass::named(name)
        .with_context(|| format!("no class `{name}`; expected one of {}", WorldClass::names()))
}

/// The result for people.
fn text(outcome: &WorldsOutcome) -> String {
    format!(
        "{} worlds, seed {}, default parameters\n\n{}\n\
         Lost: beyond five times the stated 95 % ellipse for 10 s, or RMS beyond three times extrapolation's; known: where an \
         estimator can know its error, and of these by ellipse, by extrapolation, and without any estimate.\nConsistent: coverage of the 95 % ellipse in a world 0.90 to 0.99; over: below, \
         overconfident. Pooled: over the instants of all.\nHeading: stated within 8 deg, in how many worlds, how long after the \
         first fix, and how much of it within 3 sigma.\n\n{}\nThe worst:\n{}\nLost where it can be known: {}\n",
        outcome.worlds.len(),
        outcome.seed,
        classes(outcome),
        features(&outcome.features),
        worst(outcome),
        lost_numbers(outcome),
    )
}

/// Numbers of lost worlds, to look at with `--world`.
fn lost_numbers(outcome: &WorldsOutcome) -> String {
    let numbers: Vec<_> = outcome.lost_knowably().map(|n| n.to_string()).collect();
    match numbers.len() {
        0 => "none".to_owned(),
        n if n > SHOWN_NUMBERS => format!(
            "{}, and {} more",
            numbers[..SHOWN_NUMBERS].join(", "),
            n - SHOWN_NUMBERS
        ),
        _ => numbers.join(", "),
    }
}

fn classes(outcome: &WorldsOutcome) -> String {
    let mut table = Table::new(&[
        "<class",
        "worlds",
        "lost",
        "known",
        "ellipse",
        "extrapol.",
        "none",
        "worse",
        "consistent %",
        "over %",
        "median cov. %",
        "pooled %",
        "heading",
        "after s",
        "in 3 sigma %",
        "RMS/extrapol.",
        "in outages",
    ]);
    let cells = |row: &ClassRow| {
        [
            row.class.clone(),
            row.worlds.to_string(),
            row.lost.to_string(),
            row.lost_knowably.to_string(),
            row.beyond_the_ellipse.to_string(),
            row.beyond_extrapolation.to_string(),
            row.without_estimate.to_string(),
            row.worse.to_string(),
            percent(Some(row.consistent_share)),
            percent(Some(row.overconfident_share)),
            percent(row.median_coverage_knowable),
            percent(row.pooled_coverage),
            row.heading_stated.to_string(),
            number(row.median_heading_after_s, 1),
            percent(row.heading_inside_share),
            number(row.median_ratio, 2),
            number(row.median_outage_ratio, 2),
        ]
    };
    for row in outcome.classes.iter().chain([&outcome.total]) {
        table.row(cells(row));
    }
    table.render("  ")
}

fn features(rows: &[FeatureRow]) -> String {
    let mut table = Table::new(&[
        "<worlds with",
        "worlds",
        "lost",
        "known",
        "worse",
        "consistent %",
    ]);
    for row in rows {
        table.row([
            row.feature.clone(),
            row.worlds.to_string(),
            row.lost.to_string(),
            row.lost_knowably.to_string(),
            row.worse.to_string(),
            percent(Some(row.consistent_share)),
        ]);
    }
    table.render("  ")
}

/// What became of a world, in a word.
fn verdict(world: &WorldOutcome) -> &'static str {
    let of = |score: &Score| match (score.beyond_the_ellipse, score.beyond_extrapolation) {
        (true, true) => Some("lost (ellipse, extrapolation)"),
        (true, false) => Some("lost (ellipse)"),
        (false, true) => Some("lost (extrapolation)"),
        (false, false) => None,
    };
    if world.first_estimate_s.is_none() {
        return "no estimate";
    }
    of(&world.can_be_known).unwrap_or_else(|| match (world.all.is_lost(), world.all.worse) {
        (true, _) => "lost where nobody can know",
        (false, true) => "worse",
        (false, false) => "sound",
    })
}

fn worst(outcome: &WorldsOutcome) -> String {
    let mut table = Table::new(&[
        "world",
        "<class",
        "<verdict",
        "RMS m",
        "extrapol. m",
        "coverage %",
        "<has",
    ]);
    for world in outcome.worst_worlds() {
        let score = &world.all;
        table.row([
            world.description.number.to_string(),
            world.description.class.name().to_owned(),
            verdict(world).to_owned(),
            number(score.rms_m, 2),
            number(score.extrapolation_rms_m, 2),
            percent(score.coverage),
            world.description.features().join("; "),
        ]);
    }
    table.render("  ")
}

/// One world for people: what it has, what became of it, a line a second.
fn one_world(run: &WorldRun) -> String {
    let outcome = run.outcome();
    let mut text = run.description.to_string();
    let _ = writeln!(text, "\n{}", sentence(&outcome));
    let mut table = Table::new(&[
        "t s",
        "error m",
        "stated 95 % m",
        "extrapol. m",
        "heading error deg",
        "std deg",
        "<status",
    ]);
    for instant in each_second(&run.instants, |i| i.time_s) {
        table.row(line(instant));
    }
    text.push('\n');
    text.push_str(&table.render("  "));
    text
}

fn sentence(outcome: &WorldOutcome) -> String {
    let score = &outcome.all;
    format!(
        "{}: RMS {} m (extrapolation {} m, held {} m), coverage {} % ({} % where it can be known), heading stated after {} s",
        verdict(outcome),
        number(score.rms_m, 2),
        number(score.extrapolation_rms_m, 2),
        number(score.hold_rms_m, 2),
        percent(score.coverage),
        percent(outcome.can_be_known.coverage),
        number(outcome.heading_after_s, 1),
    )
}

fn line(instant: &WorldInstant) -> [String; 7] {
    let far = instant.error_m > 5.0 * instant.stated_m;
    let unknowable = if instant.can_be_known {
        ""
    } else {
        ", cannot be known"
    };
    [
        format!("{:.1}", instant.time_s),
        format!("{:.3}", instant.error_m),
        format!("{:.3}", instant.stated_m),
        number(instant.extrapolation_error_m, 3),
        format!("{:.1}", instant.heading_error_deg),
        format!("{:.1}", instant.heading_std_deg),
        format!(
            "{}{}{unknowable}",
            instant.status,
            if far { ", far" } else { "" }
        ),
    ]
}
