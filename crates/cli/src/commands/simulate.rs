//! `northing simulate`: one run of a tracking scenario, step by step.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use nalgebra::Vector4;
use northing_experiments::radar::experiment::{NavigationRecord, RunWatcher, TrackRecord, run};
use northing_experiments::radar::{Campaign, TrackerKind};
use northing_recording::atomic_file::write_whole;
use serde::Serialize;

use crate::arguments::scenario::{self, ScenarioArgs};
use crate::files::output::{check_free, print, print_json};
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

/// What a tracker made of the run.
#[derive(Debug, Clone, Copy, Default, Serialize)]
struct RunResult {
    /// Sum of squares while running, root of their mean at the end, m.
    position_rmse_m: f64,
    /// The same, m/s.
    velocity_rmse_m_s: f64,
    /// Position error at the last scan, m.
    final_position_error_m: f64,
    /// Detections skipped.
    skipped_updates: u64,
}

/// What `--json` prints.
#[derive(Debug, Serialize)]
struct Document {
    scenario: String,
    seed: u64,
    run: u64,
    scans: u64,
    heading_rmse_deg: f64,
    trackers: std::collections::BTreeMap<&'static str, RunResult>,
}

/// Collects rows and errors.
struct Recorder {
    scan_s: f64,
    table: String,
    results: Vec<RunResult>,
    heading_square: f64,
    scans: u64,
}

impl Recorder {
    fn new(scan_s: f64, kinds: &[TrackerKind]) -> Self {
        let mut table = "time_s,own_north_m,own_east_m,own_heading_rad,nav_north_m,nav_east_m,\
                         nav_heading_rad,nav_heading_std_rad,target_north_m,target_v_north_m_s,\
                         target_east_m,target_v_east_m_s"
            .to_owned();
        for kind in kinds {
            let name = kind.name();
            for column in [
                "north_m",
                "v_north_m_s",
                "east_m",
                "v_east_m_s",
                "north_std_m",
                "east_std_m",
            ] {
                // Writing to a string cannot fail.
                let _ = write!(table, ",{name}_{column}");
            }
        }
        Self {
            scan_s,
            table,
            results: vec![RunResult::default(); kinds.len()],
            heading_square: 0.0,
            scans: 0,
        }
    }

    fn numbers(&mut self, numbers: impl IntoIterator<Item = f64>) {
        for number in numbers {
            let _ = write!(self.table, ",{number}");
        }
    }
}

impl RunWatcher for Recorder {
    fn scan(&mut self, step: usize, navigation: &NavigationRecord, target: &Vector4<f64>) {
        let _ = write!(self.table, "\n{}", step as f64 * self.scan_s);
        self.numbers(navigation.true_pose.iter().copied());
        self.numbers(navigation.pose.iter().copied());
        self.numbers([navigation.covariance[(2, 2)].max(0.0).sqrt()]);
        self.numbers(target.iter().copied());
        if step > 0 {
            self.scans += 1;
            let error = navigation.true_pose.z - navigation.pose.z;
            let turns = (error / std::f64::consts::TAU).round();
            self.heading_square += (error - turns * std::f64::consts::TAU).powi(2);
        }
    }

    fn tracker(&mut self, step: usize, index: usize, record: &TrackRecord, target: &Vector4<f64>) {
        let Some(estimate) = record.estimate else {
            self.numbers([f64::NAN; 6]);
            return;
        };
        let (x, p) = (estimate.state, &estimate.covariance);
        self.numbers(x.iter().copied());
        self.numbers([0, 2].map(|i| p[(i, i)].max(0.0).sqrt()));
        let e = target - x;
        let result = &mut self.results[index];
        result.skipped_updates += u64::from(record.skipped);
        result.final_position_error_m = e[0].hypot(e[2]);
        if step > 0 {
            result.position_rmse_m += e[0] * e[0] + e[2] * e[2];
            result.velocity_rmse_m_s += e[1] * e[1] + e[3] * e[3];
        }
    }
}

/// Simulates.
pub(crate) fn execute(args: &SimulateArgs) -> Result<()> {
    let wanted = &args.scenario;
    let scenario = scenario::read(wanted)?;
    let seed = wanted.seed.unwrap_or(scenario.meta.seed);
    let campaign = Campaign::new(&scenario, &wanted.trackers, seed, 1)?;
    if let Some(path) = &args.out {
        check_free(path, args.force)?;
    }
    let kinds = campaign.trackers();
    let mut recorder = Recorder::new(campaign.world().scan_s(), kinds);
    run(campaign.world(), kinds, seed, args.run, &mut recorder);
    let scans = recorder.scans as f64;
    for result in &mut recorder.results {
        result.position_rmse_m = (result.position_rmse_m / scans).sqrt();
        result.velocity_rmse_m_s = (result.velocity_rmse_m_s / scans).sqrt();
    }
    if let Some(path) = &args.out {
        recorder.table.push('\n');
        write_whole(path, recorder.table.as_bytes(), args.force)?;
    }
    let document = Document {
        scenario: scenario.meta.name,
        seed,
        run: args.run,
        scans: recorder.scans,
        heading_rmse_deg: (recorder.heading_square / scans).sqrt().to_degrees(),
        trackers: kinds
            .iter()
            .map(|k| k.name())
            .zip(recorder.results)
            .collect(),
    };
    if args.json {
        print_json(&document)
    } else {
        print(&text(&document))
    }
}

fn text(document: &Document) -> String {
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
