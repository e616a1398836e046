//! How well targets were tracked: per target and over all.

use std::collections::{BTreeMap, BTreeSet};

use northing_core::tracking::multi_target::TrackerCounts;
use northing_recording::tracking::TrackingIssues;
use serde::Serialize;

use super::epoch::TrackedTarget;
use super::matching::{Gospa, Place, assign, distance};
use crate::used_parameters::UsedParameter;

/// Farther than this a track is no track of the target, m.
pub const MATCH_M: f64 = 40.0;
/// Nearer than this a target counts as covered, m.
pub const COVERED_M: f64 = 20.0;
/// Coverage below which a target counts as lost.
pub const LOST_BELOW: f64 = 0.5;
/// 95 % quantile of chi-square with two degrees of freedom.
const ELLIPSE_95: f64 = 5.991_464_547_107_979;

/// How well one target was tracked.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TargetSummary {
    /// Number of the target.
    pub target: u32,
    /// Instants with a true position.
    pub epochs: usize,
    /// Instants with a track within 40 m.
    pub matched: usize,
    /// Root mean square distance while matched, m.
    pub rmse_m: Option<f64>,
    /// Median distance while matched, m.
    pub median_error_m: Option<f64>,
    /// Share of the instants with a track within 20 m.
    pub coverage: f64,
    /// Whether the coverage is below one half.
    pub lost: bool,
    /// How often the target's track became another one.
    pub switches: usize,
    /// Share of the matched instants at which the truth lies in the track's 95 % ellipse.
    pub inside_95: Option<f64>,
}

/// How well a recording was tracked.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrackSummary {
    /// Name of the recording.
    pub recording: String,
    /// Name of the tracker.
    pub tracker: &'static str,
    /// Sensors used.
    pub sensors: Vec<String>,
    /// Seconds from the first to the last event.
    pub duration_s: f64,
    /// Seconds of computing.
    pub elapsed_s: f64,
    /// One for each target with true positions.
    pub targets: Vec<TargetSummary>,
    /// Tracks that were ever confirmed.
    pub confirmed_tracks: usize,
    /// Confirmed tracks that never followed a target (of all confirmed tracks when there is truth).
    pub false_tracks: usize,
    /// Sum over the instants of confirmed tracks without a target.
    pub false_track_epochs: usize,
    /// Mean GOSPA, p = 2, cut-off 40 m.
    pub gospa_m: Option<f64>,
    /// What the tracker did and refused.
    pub counts: Counts,
    /// What the reader left out.
    pub left_out: TrackingIssues,
    /// Every parameter of the tracker as it ran, in the order of the table.
    pub parameters: Vec<UsedParameter>,
    /// Version of the program.
    pub version: &'static str,
}

/// The tracker's counters.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Scans used.
    pub scans: u64,
    /// Scans refused because of their time.
    pub scans_refused_time: u64,
    /// Scans refused because of the own ship's pose or its covariance.
    pub scans_refused_pose: u64,
    /// Scans refused because the own ship's pose had jumped.
    pub scans_refused_jump: u64,
    /// Detections that were not finite, or had a range that is not positive.
    pub detections_invalid: u64,
    /// Updates skipped at the own ship's position, where a bearing is undefined.
    pub bearing_undefined: u64,
    /// Updates skipped because an innovation covariance was not positive.
    pub numerical: u64,
    /// Detections and tracks for which there was no room.
    pub beyond_capacity: u64,
    /// Tracks started.
    pub initiated: u64,
    /// Tracks removed as duplicates.
    pub merged: u64,
    /// Clusters too large for exact association.
    pub approximate_clusters: u64,
}

impl From<&TrackerCounts> for Counts {
    fn from(c: &TrackerCounts) -> Self {
        Self {
            scans: c.scans,
            scans_refused_time: c.time_not_finite + c.time_goes_back + c.time_in_future,
            scans_refused_pose: c.pose_invalid,
            scans_refused_jump: c.pose_jumps,
            detections_invalid: c.detections_invalid,
            bearing_undefined: c.bearing_undefined,
            numerical: c.numerical,
            beyond_capacity: c.detections_beyond_capacity + c.tracks_beyond_capacity,
            initiated: c.initiated,
            merged: c.merged,
            approximate_clusters: c.approximate_clusters,
        }
    }
}

/// What is gathered about one target.
#[derive(Debug, Clone, Default)]
struct TargetTally {
    epochs: usize,
    errors: Vec<f64>,
    covered: usize,
    inside: usize,
    switches: usize,
    last: Option<u32>,
}

/// What is gathered over the instants of a run.
#[derive(Debug, Clone, Default)]
pub(super) struct Score {
    targets: BTreeMap<u32, TargetTally>,
    pub(super) confirmed: BTreeSet<u32>,
    matched: BTreeSet<u32>,
    pub(super) false_epochs: usize,
    gospa_sum: f64,
    gospa_count: usize,
}

impl Score {
    /// Takes note of tracks where no truth is known.
    pub(super) fn seen(&mut self, tracks: &[TrackedTarget]) {
        self.confirmed.extend(tracks.iter().map(|track| track.id));
    }

    /// Scores one instant.
    pub(super) fn epoch(&mut self, truth: &[(u32, Place)], tracks: &[TrackedTarget]) {
        self.seen(tracks);
        let targets: Vec<Place> = truth.iter().map(|(_, place)| *place).collect();
        let places: Vec<Place> = tracks.iter().map(|track| track.place).collect();
        let assignment = assign(&targets, &places, MATCH_M);
        self.gospa_sum += Gospa::new(&targets, &places, &assignment, MATCH_M).distance_m();
        self.gospa_count += 1;
        self.false_epochs += tracks.len() - assignment.iter().flatten().count();
        for ((number, place), chosen) in truth.iter().zip(&assignment) {
            let tally = self.targets.entry(*number).or_default();
            tally.epochs += 1;
            let Some(track) = chosen.map(|index| &tracks[index]) else {
                continue;
            };
            self.matched.insert(track.id);
            tally.take(*place, track);
        }
    }

    /// The targets' summaries, with the totals left for the caller to name.
    pub(super) fn targets(&self) -> Vec<TargetSummary> {
        let each = self.targets.iter();
        each.map(|(number, tally)| tally.summary(*number)).collect()
    }

    pub(super) fn false_tracks(&self) -> usize {
        if self.targets.is_empty() {
            return 0;
        }
        self.confirmed.difference(&self.matched).count()
    }

    pub(super) fn gospa_m(&self) -> Option<f64> {
        (self.gospa_count > 0).then(|| self.gospa_sum / self.gospa_count as f64)
    }
}

impl TargetTally {
    fn take(&mut self, place: Place, track: &TrackedTarget) {
        let error = distance(place, track.place);
        self.errors.push(error);
        self.covered += usize::from(error < COVERED_M);
        self.inside += usize::from(track.normalised_square(place) <= ELLIPSE_95);
        self.switches += usize::from(self.last.is_some_and(|last| last != track.id));
        self.last = Some(track.id);
    }

    fn summary(&self, target: u32) -> TargetSummary {
        let matched = self.errors.len();
        let mut sorted = self.errors.clone();
        sorted.sort_by(f64::total_cmp);
        let mean = |sum: f64| (matched > 0).then(|| sum / matched as f64);
        let coverage = self.covered as f64 / self.epochs.max(1) as f64;
        TargetSummary {
            target,
            epochs: self.epochs,
            matched,
            rmse_m: mean(self.errors.iter().map(|e| e * e).sum()).map(f64::sqrt),
            median_error_m: sorted.get(matched / 2).copied(),
            coverage,
            lost: coverage < LOST_BELOW,
            switches: self.switches,
            inside_95: mean(self.inside as f64),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::epoch::TargetAssociation;
    use super::*;
    use approx::assert_relative_eq;
    use northing_core::tracking::coordinated_turn::TargetCovariance;

    fn track(id: u32, north: f64) -> TrackedTarget {
        TrackedTarget {
            id,
            place: [north, 0.0],
            velocity: [0.0, 0.0],
            turn_rate: 0.0,
            covariance: TargetCovariance::from_diagonal(&[4.0, 1.0, 4.0, 1.0, 0.01].into()),
            existence: 1.0,
            visibility: 1.0,
            models: [1.0, 0.0, 0.0],
            association: TargetAssociation::default(),
        }
    }

    #[test]
    fn a_target_that_is_covered_lost_and_taken_over() {
        let mut score = Score::default();
        let truth = [(7, [0.0, 0.0])];
        score.epoch(&truth, &[track(1, 3.0), track(9, 500.0)]);
        score.epoch(&truth, &[track(1, 4.0)]);
        score.epoch(&truth, &[track(2, 25.0)]);
        score.epoch(&truth, &[]);
        let target = &score.targets()[0];
        assert_eq!((target.target, target.epochs, target.matched), (7, 4, 3));
        assert_eq!((target.switches, target.lost), (1, false));
        assert_relative_eq!(target.coverage, 0.5);
        let rmse = f64::sqrt((9.0 + 16.0 + 625.0) / 3.0);
        assert_relative_eq!(target.rmse_m.unwrap(), rmse, epsilon = 1e-12);
        assert_relative_eq!(target.median_error_m.unwrap(), 4.0);
        // 3^2/4 and 4^2/4 are inside 5.99, 25^2/4 is not
        assert_relative_eq!(target.inside_95.unwrap(), 2.0 / 3.0);
        assert_eq!((score.confirmed.len(), score.false_tracks()), (3, 1));
        assert_eq!(score.false_epochs, 1);
    }

    #[test]
    fn without_truth_there_are_no_false_tracks_and_no_errors() {
        let mut score = Score::default();
        score.seen(&[track(1, 3.0)]);
        assert!(score.targets().is_empty() && score.gospa_m().is_none());
        assert_eq!((score.confirmed.len(), score.false_tracks()), (1, 0));
    }
}
