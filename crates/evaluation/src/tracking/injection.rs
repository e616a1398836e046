//! Injected heading error, drawn for each run: consistency and losses of each tracker.
//!
//! The recordings' detections are relative to the own ship, so an error added to its heading is known
//! exactly. A tracker that states its uncertainty consistently has the true position inside its 95 %
//! ellipse 95 times of 100.

use std::collections::BTreeMap;

use northing_recording::tracking::TrackingRecording;
use rand::SeedableRng as _;
use rand_distr::{Distribution as _, Normal};
use rand_pcg::Pcg64Mcg;
use rayon::prelude::*;
use serde::Serialize;

use super::kinds::TrackerKind;
use super::options::{OwnShipStd, TrackOptions};
use super::outcome::TrackSummary;
use super::runner::run;
use crate::error::EvaluationError;

/// How to inject.
#[derive(Debug, Clone, PartialEq)]
pub struct InjectionOptions {
    /// Standard deviation of the heading error, rad.
    pub heading_std_rad: f64,
    /// Runs, each with an error of its own.
    pub runs: u32,
    /// Seed of the errors.
    pub seed: u64,
    /// Everything else. Its own-ship standard deviations are what the trackers are told; without them
    /// they are told the injected one.
    pub track: TrackOptions,
}

/// How one tracker did, over all runs and recordings.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct InjectedTracker {
    /// Share of the true positions inside the 95 % ellipse of their track.
    pub inside_95: Option<f64>,
    /// Root mean square distance while matched, m.
    pub rmse_m: Option<f64>,
    /// Share of the instants with a track within half the cut-off.
    pub coverage: f64,
    /// Instants with a true position.
    pub epochs: usize,
    /// Instants with a track within the cut-off.
    pub matched: usize,
    /// Targets lost, of all targets in all runs.
    pub lost: usize,
    /// Targets in all runs.
    pub targets: usize,
}

/// The table.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct InjectionSummary {
    /// Names of the recordings.
    pub recordings: Vec<String>,
    /// Standard deviation of the injected heading error, deg.
    pub injected_heading_std_deg: f64,
    /// Runs.
    pub runs: u32,
    /// Seed.
    pub seed: u64,
    /// By name of the tracker.
    pub trackers: BTreeMap<&'static str, InjectedTracker>,
}

/// Runs every tracker over every recording with the same errors. The result does not depend on the
/// number of threads: runs are summed in their order.
///
/// # Errors
/// As [`run`].
pub fn inject_heading(
    recordings: &[TrackingRecording],
    options: &InjectionOptions,
) -> Result<InjectionSummary, EvaluationError> {
    let errors = errors(options);
    let jobs: Vec<_> = (TrackerKind::ALL.into_iter())
        .flat_map(|kind| errors.iter().map(move |error| (kind, *error)))
        .flat_map(|(kind, error)| recordings.iter().map(move |r| (kind, error, r)))
        .collect();
    let results: Result<Vec<_>, EvaluationError> = jobs
        .par_iter()
        .map(|(kind, error, recording)| Ok((*kind, one(recording, *kind, *error, options)?)))
        .collect();
    let mut sums = BTreeMap::<&'static str, Sums>::new();
    for (kind, summary) in &results? {
        sums.entry(kind.name()).or_default().add(summary);
    }
    Ok(InjectionSummary {
        recordings: recordings.iter().map(|r| r.name.clone()).collect(),
        injected_heading_std_deg: options.heading_std_rad.to_degrees(),
        runs: options.runs,
        seed: options.seed,
        trackers: sums
            .iter()
            .map(|(name, sums)| (*name, sums.mean()))
            .collect(),
    })
}

fn errors(options: &InjectionOptions) -> Vec<f64> {
    let mut rng = Pcg64Mcg::seed_from_u64(options.seed);
    // The standard deviation is checked by whoever asks; a bad one injects nothing.
    let normal = Normal::new(0.0, options.heading_std_rad).ok();
    let draw = |_| normal.map_or(0.0, |normal| normal.sample(&mut rng));
    (0..options.runs).map(draw).collect()
}

fn one(
    recording: &TrackingRecording,
    kind: TrackerKind,
    error: f64,
    options: &InjectionOptions,
) -> Result<TrackSummary, EvaluationError> {
    let told = OwnShipStd {
        position_m: 0.0,
        heading_rad: options.heading_std_rad,
    };
    let track = TrackOptions {
        tracker: kind,
        heading_error_rad: error,
        own_ship_std: options.track.own_ship_std.or(Some(told)),
        ..options.track.clone()
    };
    run(recording, &track, |_| {})
}

#[derive(Debug, Clone, Default)]
struct Sums {
    epochs: usize,
    matched: usize,
    covered: f64,
    inside: f64,
    square: f64,
    lost: usize,
    targets: usize,
}

impl Sums {
    fn add(&mut self, summary: &TrackSummary) {
        for target in &summary.targets {
            let matched = target.matched as f64;
            self.epochs += target.epochs;
            self.matched += target.matched;
            self.covered += target.coverage * target.epochs as f64;
            self.inside += target.inside_95.unwrap_or(0.0) * matched;
            self.square += target.rmse_m.map_or(0.0, |rmse| rmse * rmse) * matched;
            self.lost += usize::from(target.lost);
            self.targets += 1;
        }
    }

    fn mean(&self) -> InjectedTracker {
        let mean = |sum: f64| (self.matched > 0).then(|| sum / self.matched as f64);
        InjectedTracker {
            inside_95: mean(self.inside),
            rmse_m: mean(self.square).map(f64::sqrt),
            coverage: self.covered / self.epochs.max(1) as f64,
            epochs: self.epochs,
            matched: self.matched,
            lost: self.lost,
            targets: self.targets,
        }
    }
}
