//! `northing experiment tracking-worlds`: trackers of many targets on random scenes.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail};
use clap::Args;
use northing_experiments::tracking_worlds::{
    Interval, SceneOutcome, Scenes, ScenesOutcome, TrackerRow, TrackerScore,
};
use northing_recording::tracking::write_tables;
use northing_simulation::tracking_world::{SceneClass, TrackingScene};

use super::frame::{WorldsArgs, percent, with_progress};
use crate::files::output::{number, print, print_json};
use crate::text::table::Table;

/// Most scenes of one run: their judgements are kept in memory.
const MOST_SCENES: u64 = 1_000_000;

/// Arguments of `experiment tracking-worlds`.
#[derive(Debug, Args)]
#[command(
    long_about = "Draws scenes from a seed (pedestrians before a laser scanner, boats and ships before radars, aircraft before a \
                  surveillance radar; standing, turning, crossing, in pairs; misses, false detections, an own ship whose pose is wrong), \
                  runs every tracker with its default settings on each, and scores it against the true positions. GOSPA and OSPA are \
                  in cut-offs: four standard deviations of a detection's place, the own ship's error with it. Consistent: ANEES in \
                  the band in which nearly all scenes lie if the covariances are right; scenes in which the tracker is told wrong \
                  noise, or nothing of the own ship's error, are left out there.",
    after_help = "\
Examples:
  northing experiment tracking-worlds
  northing experiment tracking-worlds --worlds 100 --class boats
  northing experiment tracking-worlds --seed 2 --first 500 --worlds 500 --json
  northing experiment tracking-worlds --world 17
  northing experiment tracking-worlds --world 17 --save scenes && northing track scenes/boats-17.toml"
)]
pub(super) struct TrackingWorldsArgs {
    #[command(flatten)]
    numbers: WorldsArgs,
    /// Of these scenes only those of one class
    #[arg(long, value_name = "NAME")]
    class: Option<String>,
    /// One scene: what it has, and what each tracker made of it
    #[arg(long, value_name = "NUMBER", conflicts_with_all = ["worlds", "first", "class"])]
    world: Option<u64>,
    /// Write the scenes into this folder, which is made if need be, as manifests with tables that `northing track` reads
    #[arg(long, value_name = "DIR")]
    save: Option<PathBuf>,
    /// Replace files that are there already
    #[arg(long, requires = "save")]
    force: bool,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Runs the scenes, or one.
pub(super) fn execute(args: &TrackingWorldsArgs) -> Result<()> {
    args.save.as_deref().map_or(Ok(()), check_folder)?;
    let seed = args.numbers.seed;
    if let Some(number) = args.world {
        save(args, &[number])?;
        let outcome = SceneOutcome::of(seed, number);
        return match args.json {
            true => print_json(&outcome),
            false => print(&one_scene(&outcome)),
        };
    }
    args.numbers.check(MOST_SCENES)?;
    let scenes = Scenes {
        seed,
        first: args.numbers.first,
        count: args.numbers.worlds,
        class: args.class.as_deref().map(class_named).transpose()?,
    };
    let numbers = scenes.numbers();
    let count = args.numbers.counted(&numbers, "class")?;
    save(args, &numbers)?;
    let outcome = with_progress(count, "scenes", |done| scenes.run(done));
    match args.json {
        true => print_json(&outcome),
        false => print(&text(&outcome)),
    }
}

/// Refuses a folder that is not there and cannot be made, before anything is run.
fn check_folder(folder: &Path) -> Result<()> {
    if folder.exists() && !folder.is_dir() {
        bail!("--save {}: not a folder", folder.display());
    }
    let parent = folder
        .parent()
        .filter(|parent| !parent.as_os_str().is_empty());
    if let Some(parent) = parent.filter(|parent| !folder.exists() && !parent.is_dir()) {
        bail!(
            "--save {}: the folder `{}` does not exist; make it first",
            folder.display(),
            parent.display()
        );
    }
    Ok(())
}

/// Writes the scenes where that is asked for.
fn save(args: &TrackingWorldsArgs, numbers: &[u64]) -> Result<()> {
    let Some(folder) = &args.save else {
        return Ok(());
    };
    if !folder.exists() {
        std::fs::create_dir(folder)
            .with_context(|| format!("--save {}: cannot make it", folder.display()))?;
    }
    let one = |number: &u64| write_one(args.numbers.seed, *number, folder, args.force);
    numbers.iter().try_for_each(one)
}

fn write_one(seed: u64, number: u64, folder: &Path, force: bool) -> Result<()> {
    let world = TrackingScene::draw(seed, number);
    write_tables(&world.recording, folder, force)?;
    Ok(())
}

fn class_named(name: &str) -> Result<SceneClass> {
    SceneClass::named(name)
        .with_context(|| format!("no class `{name}`; expected one of {}", SceneClass::names()))
}

/// The result for people.
fn text(outcome: &ScenesOutcome) -> String {
    format!(
        "{} scenes, seed {}, default settings\n\n{}\n\
         GOSPA and OSPA in cut-offs, means over the scenes with 95 % intervals. Coverage: instants of targets with a track within half a \
         cut-off. Lost: targets covered in less than half of their instants. Switches: for each target. False: tracks that followed no \
         target, for each 100 scans. Consistent, over: ANEES of a scene in its band, above it.\n\n{}\nThe worst:\n{}",
        outcome.scenes.len(),
        outcome.seed,
        rows(&outcome.classes, "class"),
        rows(&outcome.features, "scenes with"),
        worst(outcome),
    )
}

fn interval(value: Interval, digits: usize) -> String {
    let Interval { mean, half_width } = value;
    if half_width.is_finite() {
        format!("{mean:.digits$} +- {half_width:.digits$}")
    } else {
        format!("{mean:.digits$}")
    }
}

fn rows(rows: &[TrackerRow], what: &str) -> String {
    let what = format!("<{what}");
    let mut table = Table::new(&[
        &what,
        "<tracker",
        "scenes",
        "GOSPA",
        "OSPA",
        "coverage %",
        "targets",
        "lost",
        "switches",
        "false",
        "ANEES",
        "consistent %",
        "over %",
        "inside 95 %",
    ]);
    for row in rows {
        let coverage = Interval {
            mean: 100.0 * row.coverage.mean,
            half_width: 100.0 * row.coverage.half_width,
        };
        table.row([
            row.scenes_with.clone(),
            row.tracker.to_owned(),
            row.scenes.to_string(),
            interval(row.gospa, 3),
            interval(row.ospa, 3),
            interval(coverage, 1),
            row.targets.to_string(),
            row.lost.to_string(),
            interval(row.switches, 2),
            interval(row.false_tracks, 2),
            number(row.median_anees, 2),
            percent(row.consistent_share),
            percent(row.overconfident_share),
            percent(row.inside_95),
        ]);
    }
    table.render("  ")
}

/// The scores of one tracker in a scene.
const SCORES: [&str; 9] = [
    "GOSPA",
    "OSPA",
    "coverage %",
    "lost",
    "switches",
    "false",
    "ANEES",
    "band",
    "inside 95 %",
];

fn scores(score: &TrackerScore) -> Vec<String> {
    let [low, high] = score.anees_band;
    vec![
        format!("{:.3}", score.gospa),
        format!("{:.3}", score.ospa),
        percent(Some(score.coverage)),
        score.lost.to_string(),
        format!("{:.2}", score.switches),
        format!("{:.2}", score.false_tracks),
        number(score.anees, 2),
        format!("{low:.2} to {high:.2}"),
        percent(score.inside_95),
    ]
}

fn worst(outcome: &ScenesOutcome) -> String {
    let mut table = Table::new(&["scene", "<class", "GOSPA", "coverage %", "ANEES", "<has"]);
    for scene in outcome.worst_scenes() {
        // The default tracker is the last.
        let Some(score) = scene.trackers.last() else {
            continue;
        };
        table.row([
            scene.description.number.to_string(),
            scene.description.class.name().to_owned(),
            format!("{:.3}", score.gospa),
            percent(Some(score.coverage)),
            number(score.anees, 2),
            scene.description.features().join("; "),
        ]);
    }
    table.render("  ")
}

/// One scene for people.
fn one_scene(outcome: &SceneOutcome) -> String {
    let mut columns = vec!["<tracker"];
    columns.extend(SCORES);
    let mut table = Table::new(&columns);
    for score in &outcome.trackers {
        let mut row = vec![score.tracker.to_owned()];
        row.extend(scores(score));
        table.row(row);
    }
    let cutoff = outcome.description.cutoff_m;
    format!(
        "{}\nCut-off {cutoff:.3} m\n\n{}",
        outcome.description,
        table.render("  ")
    )
}
