//! `northing track`: targets in recordings of radar, lidar, cameras and AIS.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use northing_evaluation::tracking::outcome::COVERED;
use northing_evaluation::tracking::{
    InjectionOptions, InjectionSummary, OwnShipStd, TrackEpoch, TrackOptions, TrackSummary,
    TrackedTarget, TrackerKind, end_reason, inject_heading, run,
};
use northing_recording::atomic_file::write_whole;
use northing_recording::tracking::{
    self, TargetInstant, TargetPoint, TargetWriter, TrackingRecording, check_targets_path,
};
use serde::Serialize;

use crate::arguments::quantity;
use crate::arguments::settings::ParameterArgs;
use crate::files::output::{
    check_free, check_not_input, number, print, print_json, report_written,
};
use crate::invocation::command_line;
use crate::text::table::Table;
use northing_report::followed_targets::{self, metres};

/// Most runs of one command: more would take days.
const MOST_RUNS: u32 = 100_000;

/// Arguments of `track`.
#[derive(Debug, Args)]
#[command(
    mut_arg("config", |config| config.help(
        "File with parameters: TOML, one `name = value` a line, and perhaps `tracker = \"converted\"`; or JSON, \
         such as `northing track --json` prints"
    )),
    mut_arg("set", |set| set.help(
        "One parameter, e.g. gate_sigmas=4; may be repeated; `northing estimators schmidt` lists them"
    )),
    long_about = "Finds and follows targets in recordings of radar, lidar, cameras and AIS: unlabelled \
                  detections in clutter, tracks that start, are confirmed and end by themselves, with the \
                  own ship's uncertainty in every step. Where the recording has true positions, each is \
                  matched with a track at every instant, by the best assignment within a cut-off: four standard deviations of \
                  a detection's position where the targets are, half the targets' spacing where they are closer together (two standard deviations at least), \
                  or what --cutoff says. A recording is a manifest that names tables; docs/formats.md describes it.",
    after_help = "\
Examples:
  northing track harbour.toml --data recordings --report harbour.html
  northing track harbour.toml --out tracks.geojson # every track, on a map
  northing track harbour.toml --out tracks.parquet # states, covariances, detections used, for pandas
  northing track harbour.toml --own-ship-std heading=3deg,position=3m --json
  northing track a.toml b.toml --sensors radar,lidar --tracker uncompensated
  northing track harbour.toml --inject-heading-std 3deg --runs 100 --seed 1"
)]
pub(crate) struct TrackArgs {
    /// Manifests of tracking recordings (.toml)
    #[arg(value_name = "RECORDING", required = true)]
    recordings: Vec<PathBuf>,
    /// Folder of the files that the manifests name; without it, the manifest's own
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// What to do about the own ship's uncertainty: uncompensated, converted, schmidt (the default)
    #[arg(long, value_name = "NAME")]
    tracker: Option<TrackerKind>,
    /// Standard deviations of the own ship's pose, e.g. heading=3deg,position=3m
    #[arg(long, value_name = "LIST", value_parser = own_ship_std)]
    own_ship_std: Option<OwnShipStd>,
    /// Sensors to use, separated by commas, instead of those that the manifest marks
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    sensors: Option<Vec<String>>,
    /// Distance beyond which a track is no track of a target, the cut-off of GOSPA and OSPA, e.g. 40m; a target is covered by a track within
    /// half of it
    #[arg(long, value_name = "LENGTH", value_parser = cutoff)]
    cutoff: Option<f64>,
    /// Add an error to the own ship's heading, drawn for each run, and compare the trackers
    #[arg(long, value_name = "ANGLE", value_parser = quantity::angle, requires = "runs")]
    inject_heading_std: Option<f64>,
    /// Runs with an injected error
    #[arg(long, value_name = "N", requires = "inject_heading_std",
          value_parser = clap::value_parser!(u32).range(1..=i64::from(MOST_RUNS)))]
    runs: Option<u32>,
    /// Seed of the injected errors
    #[arg(long, value_name = "S", default_value_t = 1)]
    seed: u64,
    /// Write the confirmed tracks: .csv or .parquet, a row for each track and instant; .geojson or .kml, a line for each track on
    /// a map; .mcap, messages of ROS 2; .nmea, sentences for chart plotters
    #[arg(long, value_name = "FILE", conflicts_with = "inject_heading_std")]
    out: Option<PathBuf>,
    /// Write a report with map and plots: one HTML file for a browser
    #[arg(long, value_name = "FILE", conflicts_with = "inject_heading_std")]
    report: Option<PathBuf>,
    /// Overwrite outputs that exist
    #[arg(long)]
    force: bool,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    parameters: ParameterArgs,
}

/// A length above zero.
fn cutoff(text: &str) -> Result<f64, String> {
    let length = quantity::length(text)?;
    match length > 0.0 {
        true => Ok(length),
        false => Err("a cut-off is above zero, e.g. 40m".to_owned()),
    }
}

/// `heading=3deg,position=3m`; what is not named is zero.
fn own_ship_std(text: &str) -> Result<OwnShipStd, String> {
    let mut std = OwnShipStd::default();
    for part in text.split(',') {
        match part.split_once('=') {
            Some(("heading", value)) => std.heading_rad = quantity::angle(value)?,
            Some(("position", value)) => std.position_m = quantity::length(value)?,
            _ => {
                return Err(format!(
                    "`{part}` is neither heading=ANGLE nor position=LENGTH, e.g. heading=3deg,position=3m"
                ));
            }
        }
    }
    Ok(std)
}

/// Runs.
pub(crate) fn execute(args: &TrackArgs) -> Result<()> {
    for (option, output) in [("--report", &args.report), ("--out", &args.out)] {
        let Some(output) = output else { continue };
        if args.recordings.len() > 1 {
            bail!("{option} is about one recording; name one, or leave {option} out");
        }
        for recording in &args.recordings {
            check_not_input(output, recording, args.data.as_deref())?;
        }
        check_free(output, args.force)?;
    }
    let recordings = open(args)?;
    if let (Some(out), [recording]) = (&args.out, &recordings[..]) {
        check_targets_path(out, recording.plane.as_ref())?;
    }
    let in_file = args.parameters.estimator()?;
    let tracker: TrackerKind = args.tracker.or(in_file).unwrap_or_default();
    let mut options = TrackOptions {
        tracker,
        own_ship_std: args.own_ship_std,
        sensors: args.sensors.clone(),
        cutoff_m: args.cutoff,
        ..TrackOptions::default()
    };
    let set = |setting: &str, origin| options.set_from(setting, origin);
    args.parameters
        .apply_without_profile(&tracker.name(), set)?;
    if let (Some(heading_std_rad), Some(runs)) = (args.inject_heading_std, args.runs) {
        let options = InjectionOptions {
            heading_std_rad,
            runs,
            seed: args.seed,
            track: options,
        };
        return print_injection(&inject_heading(&recordings, &options)?, args.json);
    }
    let mut epochs: Vec<TrackEpoch> = Vec::new();
    let mut summaries = Vec::new();
    for recording in &recordings {
        epochs.clear();
        let mut out = match &args.out {
            Some(path) => {
                let plane = recording.plane.as_ref();
                Some(TargetWriter::create(
                    path,
                    &recording.name,
                    plane,
                    args.force,
                )?)
            }
            None => None,
        };
        let mut written = Ok(());
        summaries.push(run(recording, &options, |epoch| {
            if let Some(out) = &mut out
                && written.is_ok()
            {
                written = out.instant(instant(recording, &epoch), &ended(&epoch));
            }
            if args.report.is_some() {
                epochs.push(epoch);
            }
        })?);
        written?;
        if let Some(out) = out {
            out.finish()?;
        }
    }
    if let (Some(path), [summary]) = (&args.report, &summaries[..]) {
        let html = followed_targets::render(summary, &epochs, &command_line());
        write_whole(path, html.as_bytes(), args.force)?;
    }
    match &summaries[..] {
        [one] if args.json => print_json(one),
        many if args.json => print_json(&Several { recordings: many }),
        _ => print(&describe(&summaries, args)),
    }
}

/// The confirmed tracks of an instant, those of which it says something, as files take them.
fn instant(recording: &TrackingRecording, epoch: &TrackEpoch) -> TargetInstant {
    let sensor = recording.sensors.get(epoch.scan.sensor);
    let sensor = sensor.map_or(String::new(), |(name, _)| name.clone());
    let point = |(track, is_reported): (&TrackedTarget, bool)| TargetPoint {
        is_reported,
        track: track.id,
        place_m: track.place,
        velocity_m_s: track.velocity,
        turn_rate_rad_s: track.turn_rate,
        covariance: track.covariance.transpose().into(),
        existence: track.existence,
        visibility: track.visibility,
        models: track.models,
        sensor: sensor.clone(),
        scan: epoch.scan.scan,
        detections_in_gate: track.association.in_gate,
        detection: track.association.likeliest,
        missed_probability: track.association.missed,
        end: None,
    };
    TargetInstant {
        time_ns: epoch.time_ns,
        own_place_m: epoch.own_ship,
        targets: epoch.updated_tracks().map(point).collect(),
    }
}

/// The tracks that ended, with the reason in words.
fn ended(epoch: &TrackEpoch) -> Vec<(u32, String)> {
    let each = epoch.ended.iter();
    each.map(|track| (track.id, end_reason(track.end)))
        .collect()
}

/// The JSON document of several recordings.
#[derive(Debug, Serialize)]
struct Several<'a> {
    recordings: &'a [TrackSummary],
}

fn open(args: &TrackArgs) -> Result<Vec<TrackingRecording>> {
    let mut recordings = Vec::new();
    for path in &args.recordings {
        let recording = tracking::open(path, args.data.as_deref())?;
        let names: Vec<&str> = recording.sensors.iter().map(|(n, _)| n.as_str()).collect();
        for wanted in args.sensors.iter().flatten() {
            if !names.contains(&wanted.as_str()) {
                bail!(
                    "{}: no sensor `{wanted}`; it has {}",
                    path.display(),
                    names.join(", ")
                );
            }
        }
        recordings.push(recording);
    }
    Ok(recordings)
}

fn describe(summaries: &[TrackSummary], args: &TrackArgs) -> String {
    let mut text = String::new();
    let mut table = Table::new(&[
        "<recording",
        "target",
        "RMSE m",
        "median m",
        "coverage",
        "seen",
        "switches",
        "in 95 %",
        "<",
    ]);
    for summary in summaries {
        for target in &summary.targets {
            table.row([
                summary.recording.clone(),
                target.target.to_string(),
                number(target.rmse_m, 1),
                number(target.median_error_m, 1),
                format!("{:.2}", target.coverage),
                format!("{:.2}", target.seen),
                target.switches.to_string(),
                number(target.inside_95, 2),
                if target.lost { "lost" } else { "" }.to_owned(),
            ]);
        }
    }
    if summaries.iter().any(|summary| !summary.targets.is_empty()) {
        text.push_str(&table.render(""));
        text.push('\n');
    }
    for summary in summaries {
        let truth = !summary.targets.is_empty();
        let note = if truth {
            format!(", {} of them on no target", summary.false_tracks)
        } else if summary.counts.scans == 0 {
            // What became of true positions is among the remarks.
            "; nothing was tracked".to_owned()
        } else {
            "; no true positions to score against".to_owned()
        };
        text.push_str(&format!(
            "{}: {} scans of {} in {:.0} s, {} tracks confirmed{note} ({})\n",
            summary.recording,
            summary.counts.scans,
            summary.sensors.join(", "),
            summary.duration_s,
            summary.confirmed_tracks,
            summary.tracker,
        ));
        if let Some(cutoff) = summary.cutoff_m {
            text.push_str(&scores(summary, cutoff));
        }
        let learnt = followed_targets::learnt(&summary.learnt);
        for issue in learnt
            .into_iter()
            .chain(followed_targets::left_out(summary))
        {
            text.push_str(&format!("  {issue}\n"));
        }
    }
    if let Some(out) = &args.out {
        text.push_str(&format!("\nTracks: {}\n", out.display()));
    }
    if let Some(report) = &args.report {
        text.push_str(&format!("\n{}\n", report_written(report)));
    }
    text
}

/// The scores over all targets, and what they were measured with.
fn scores(summary: &TrackSummary, cutoff_m: f64) -> String {
    let mean = |value: Option<f64>| value.map_or("-".to_owned(), metres);
    let over_time = followed_targets::tgospa(summary).unwrap_or("-".to_owned());
    format!(
        "  cut-off {}, seen by a detection within it, covered by a track within {}; mean GOSPA {}, OSPA {}; T-GOSPA {over_time}; on no target {} tracks an hour\n",
        metres(cutoff_m),
        metres(COVERED * cutoff_m),
        mean(summary.gospa_m),
        mean(summary.ospa_m),
        number(summary.false_tracks_per_hour, 0),
    )
}

fn print_injection(summary: &InjectionSummary, json: bool) -> Result<()> {
    if json {
        return print_json(summary);
    }
    let mut table = Table::new(&[
        "<tracker",
        "truth in 95 %",
        "RMSE m",
        "coverage",
        "targets lost",
    ]);
    for kind in TrackerKind::ALL {
        let Some(row) = summary.trackers.get(kind.name()) else {
            continue;
        };
        table.row([
            kind.name().to_owned(),
            number(row.inside_95.map(|share| 100.0 * share), 1),
            number(row.rmse_m, 1),
            format!("{:.2}", row.coverage),
            format!("{} of {}", row.lost, row.targets),
        ]);
    }
    print(&format!(
        "Heading error of {:.1} deg (1 sigma) in the own ship, {} runs of {}:\n\n{}",
        summary.injected_heading_std_deg,
        summary.runs,
        summary.recordings.join(", "),
        table.render("")
    ))
}
