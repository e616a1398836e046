//! One scene, run by every tracker.

use northing_evaluation::tracking::{TargetSummary, TrackOptions, TrackSummary, TrackerKind, run};
use northing_simulation::tracking_world::{SceneDescription, TrackingScene};
use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

/// Instants of a target of which one is independent of the others.
const CORRELATED_SCANS: f64 = 10.0;
/// Of the band of a scene's ANEES.
const BAND: [f64; 2] = [0.005, 0.995];

/// A scene and what its trackers made of it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SceneOutcome {
    /// What the scene has.
    pub description: SceneDescription,
    /// One for each tracker, in the order of [`TrackerKind::ALL`].
    pub trackers: Vec<TrackerScore>,
}

/// What one tracker made of a scene.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrackerScore {
    /// Name of the tracker.
    pub tracker: &'static str,
    /// Mean GOSPA (p = 2, alpha = 2) in cut-offs.
    pub gospa: f64,
    /// Mean OSPA (p = 2) in cut-offs.
    pub ospa: f64,
    /// Share of the targets' instants with a track within half a cut-off.
    pub coverage: f64,
    /// Targets covered in less than half of their instants.
    pub lost: usize,
    /// Changes of a target's track for each target.
    pub switches: f64,
    /// Tracks that followed no target for each 100 scans.
    pub false_tracks: f64,
    /// Root mean square error of matched instants, in cut-offs; none without a match.
    pub rmse: Option<f64>,
    /// ANEES over all matched instants; none without a match.
    pub anees: Option<f64>,
    /// Where it lies if the covariances are right.
    pub anees_band: [f64; 2],
    /// Share of the matched instants inside the 95 % ellipse.
    pub inside_95: Option<f64>,
    /// Seconds of computing for a scan.
    pub s_per_scan: f64,
    /// Detections and tracks for which there was no room.
    pub without_room: u64,
}

impl SceneOutcome {
    /// The scene with this number, with default settings.
    #[must_use]
    pub fn of(seed: u64, number: u64) -> Self {
        let world = TrackingScene::draw(seed, number);
        let score = |tracker: &TrackerKind| {
            let options = TrackOptions {
                tracker: *tracker,
                cutoff_m: Some(world.description.cutoff_m),
                ..TrackOptions::default()
            };
            // The settings are the defaults and what follows from the sensor: none is out of its range.
            let summary = run(&world.recording, &options, |_| {}).ok()?;
            Some(TrackerScore::of(&summary, &world.description))
        };
        Self {
            trackers: TrackerKind::ALL.iter().filter_map(score).collect(),
            description: world.description,
        }
    }
}

impl TrackerScore {
    fn of(summary: &TrackSummary, scene: &SceneDescription) -> Self {
        let targets = &summary.targets;
        let epochs: usize = targets.iter().map(|t| t.epochs).sum();
        let matched: usize = targets.iter().map(|t| t.matched).sum();
        // Of what is there only while matched, weighted by that.
        let pooled = |of: fn(&TargetSummary) -> Option<f64>| {
            let each = targets
                .iter()
                .filter_map(|t| Some(of(t)? * t.matched as f64));
            (matched > 0).then(|| each.sum::<f64>() / matched as f64)
        };
        let covered = targets.iter().map(|t| t.coverage * t.epochs as f64);
        let count = targets.len().max(1) as f64;
        let cutoff = scene.cutoff_m;
        Self {
            tracker: summary.tracker,
            gospa: summary.gospa_m.unwrap_or(0.0) / cutoff,
            ospa: summary.ospa_m.unwrap_or(0.0) / cutoff,
            coverage: covered.sum::<f64>() / epochs.max(1) as f64,
            lost: targets.iter().filter(|t| t.lost).count(),
            switches: targets.iter().map(|t| t.switches as f64).sum::<f64>() / count,
            false_tracks: 100.0 * summary.false_tracks as f64 / scene.scans as f64,
            rmse: pooled(|t| t.rmse_m.map(|rmse| rmse * rmse)).map(|square| square.sqrt() / cutoff),
            anees: pooled(|t| t.anees),
            anees_band: band(independent(scene, matched)),
            inside_95: pooled(|t| t.inside_95),
            s_per_scan: summary.elapsed_s / scene.scans as f64,
            without_room: summary.counts.beyond_capacity,
        }
    }

    /// Whether ANEES is in its band; none without a match.
    #[must_use]
    pub fn is_consistent(&self) -> Option<bool> {
        let [low, high] = self.anees_band;
        self.anees.map(|anees| (low..=high).contains(&anees))
    }
}

/// How many independent samples the matched instants of a scene are worth.
fn independent(scene: &SceneDescription, matched: usize) -> f64 {
    let own = scene.own_ship_error.map_or(f64::INFINITY, |error| {
        scene.scans as f64 / (2.0 * error.correlation_scans)
    });
    (matched as f64 / CORRELATED_SCANS).min(own).max(1.0)
}

/// Where the mean of so many squared distances in two dimensions lies, each divided by two.
fn band(samples: f64) -> [f64; 2] {
    let degrees = 2.0 * samples;
    let bound = |p| ChiSquared::new(degrees).map_or(f64::NAN, |sum| sum.inverse_cdf(p) / degrees);
    BAND.map(bound)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_band_narrows_with_the_samples() {
        let [low, high] = band(1.0);
        // Of two degrees of freedom: -2 ln(1 - p) / 2.
        assert!((low + f64::ln(0.995)).abs() < 1e-6 && (high + f64::ln(0.005)).abs() < 1e-6);
        let [low, high] = band(500.0);
        assert!(low > 0.85 && high < 1.15);
    }

    #[test]
    fn a_scene_is_scored_for_each_tracker() {
        let outcome = SceneOutcome::of(1, 1);
        assert_eq!(outcome.trackers.len(), TrackerKind::ALL.len());
        for score in &outcome.trackers {
            assert!(score.gospa > 0.0 && score.coverage > 0.2, "{score:?}");
        }
        assert_eq!(
            outcome.trackers,
            SceneOutcome::of(1, 1).without_time(&outcome)
        );
    }

    impl SceneOutcome {
        /// The scores with the other's times, which differ from run to run.
        fn without_time(mut self, other: &Self) -> Vec<TrackerScore> {
            for (own, other) in self.trackers.iter_mut().zip(&other.trackers) {
                own.s_per_scan = other.s_per_scan;
            }
            self.trackers
        }
    }
}
