//! One run of a scenario, scan by scan, as columns with a unit in each name, and what every tracker made of it.

use std::collections::BTreeMap;

use nalgebra::Vector4;
use northing_core::geometry::trigonometry::wrap;
use serde::Serialize;

use super::Campaign;
use super::experiment::{NavigationRecord, RunWatcher, TrackRecord, run};

/// What a tracker made of the run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize)]
pub struct RunResult {
    /// Root mean square of the position error, m.
    pub position_rmse_m: f64,
    /// The same of the velocity, m/s.
    pub velocity_rmse_m_s: f64,
    /// Position error at the last scan, m.
    pub final_position_error_m: f64,
    /// Detections skipped.
    pub skipped_updates: u64,
}

/// What `simulate --json` prints.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RunSummary {
    /// Name of the scenario.
    pub scenario: String,
    /// Seed of the campaign.
    pub seed: u64,
    /// Number of the run in it.
    pub run: u64,
    /// Scans after the one that starts the tracks.
    pub scans: u64,
    /// Root mean square of the own ship's heading error, degrees.
    pub heading_rmse_deg: f64,
    /// By name of the tracker.
    pub trackers: BTreeMap<&'static str, RunResult>,
}

/// A run: its summary, and a row a scan.
#[derive(Debug, Clone, PartialEq)]
pub struct SingleRun {
    /// What every tracker made of it.
    pub summary: RunSummary,
    /// Names and values of the columns; NaN where nothing was seen or estimated.
    pub columns: Vec<(String, Vec<f64>)>,
}

/// Columns about the own ship, its navigation, the radar and the target.
const OWN: [&str; 14] = [
    "time_s",
    "own_north_m",
    "own_east_m",
    "own_heading_rad",
    "nav_north_m",
    "nav_east_m",
    "nav_heading_rad",
    "nav_heading_std_rad",
    "target_north_m",
    "target_v_north_m_s",
    "target_east_m",
    "target_v_east_m_s",
    "range_m",
    "bearing_rad",
];
/// Columns about each tracker, behind its name.
const TRACKER: [&str; 6] = [
    "north_m",
    "v_north_m_s",
    "east_m",
    "v_east_m_s",
    "north_std_m",
    "east_std_m",
];
/// The covariance of the own pose, row by row of its upper half.
const COVARIANCE: [(&str, usize, usize); 6] = [
    ("nav_cov_north_north_m2", 0, 0),
    ("nav_cov_north_east_m2", 0, 1),
    ("nav_cov_north_heading_m_rad", 0, 2),
    ("nav_cov_east_east_m2", 1, 1),
    ("nav_cov_east_heading_m_rad", 1, 2),
    ("nav_cov_heading_heading_rad2", 2, 2),
];

/// Collects rows and errors.
struct Recorder {
    scan_s: f64,
    rows: Vec<Vec<f64>>,
    covariances: Vec<[f64; 6]>,
    results: Vec<RunResult>,
    heading_square: f64,
    scans: u64,
}

impl RunWatcher for Recorder {
    fn scan(&mut self, step: usize, navigation: &NavigationRecord, target: &Vector4<f64>) {
        let mut row = vec![step as f64 * self.scan_s];
        row.extend(navigation.true_pose.iter());
        row.extend(navigation.pose.iter());
        row.push(navigation.covariance[(2, 2)].max(0.0).sqrt());
        row.extend(target.iter());
        let seen = navigation.detection.map(|seen| [seen.range, seen.bearing]);
        row.extend(seen.unwrap_or([f64::NAN; 2]));
        self.rows.push(row);
        let covariance = &navigation.covariance;
        self.covariances
            .push(COVARIANCE.map(|(_, i, j)| covariance[(i, j)]));
        if step > 0 {
            self.scans += 1;
            self.heading_square += wrap(navigation.true_pose.z - navigation.pose.z).powi(2);
        }
    }

    fn tracker(&mut self, step: usize, index: usize, record: &TrackRecord, target: &Vector4<f64>) {
        let Some(row) = self.rows.last_mut() else {
            return;
        };
        // The joint estimator comes last, wherever it stands in the list.
        let start = OWN.len() + index * TRACKER.len();
        row.resize(row.len().max(start + TRACKER.len()), f64::NAN);
        let Some(estimate) = record.estimate else {
            return;
        };
        let (x, p) = (estimate.state, &estimate.covariance);
        let stds = [0, 2].map(|i| p[(i, i)].max(0.0).sqrt());
        let numbers = x.iter().copied().chain(stds);
        for (cell, number) in row[start..].iter_mut().zip(numbers) {
            *cell = number;
        }
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

impl SingleRun {
    /// Carries out the run that a campaign has under this number.
    #[must_use]
    pub fn of(campaign: &Campaign, scenario: &str, seed: u64, number: u64) -> Self {
        let kinds = campaign.trackers();
        let mut recorder = Recorder {
            scan_s: campaign.world().scan_s(),
            rows: Vec::new(),
            covariances: Vec::new(),
            results: vec![RunResult::default(); kinds.len()],
            heading_square: 0.0,
            scans: 0,
        };
        run(campaign.world(), kinds, seed, number, &mut recorder);
        let scans = recorder.scans as f64;
        for result in &mut recorder.results {
            result.position_rmse_m = (result.position_rmse_m / scans).sqrt();
            result.velocity_rmse_m_s = (result.velocity_rmse_m_s / scans).sqrt();
        }
        let names = kinds.iter().map(|kind| kind.name());
        let summary = RunSummary {
            scenario: scenario.to_owned(),
            seed,
            run: number,
            scans: recorder.scans,
            heading_rmse_deg: (recorder.heading_square / scans).sqrt().to_degrees(),
            trackers: names.clone().zip(recorder.results).collect(),
        };
        let of_trackers = names.flat_map(|name| TRACKER.map(|column| format!("{name}_{column}")));
        let names = OWN.map(str::to_owned).into_iter().chain(of_trackers);
        let column = |(i, name): (usize, String)| {
            let cell = |row: &Vec<f64>| row.get(i).copied().unwrap_or(f64::NAN);
            (name, recorder.rows.iter().map(cell).collect())
        };
        let mut columns: Vec<(String, Vec<f64>)> = names.enumerate().map(column).collect();
        columns.extend(COVARIANCE.iter().enumerate().map(|(i, (name, _, _))| {
            let cells = recorder.covariances.iter().map(|row| row[i]);
            ((*name).to_owned(), cells.collect())
        }));
        Self { summary, columns }
    }

    /// As a table: a header, then a row a scan, to the last digit.
    #[must_use]
    pub fn csv(&self) -> String {
        let names: Vec<&str> = self.columns.iter().map(|(name, _)| name.as_str()).collect();
        let mut table = names.join(",");
        let rows = self.columns.first().map_or(0, |(_, values)| values.len());
        for row in 0..rows {
            let cells = self.columns.iter().map(|(_, values)| values[row]);
            let cells: Vec<String> = cells.map(|number| number.to_string()).collect();
            table.push('\n');
            table.push_str(&cells.join(","));
        }
        table.push('\n');
        table
    }
}
