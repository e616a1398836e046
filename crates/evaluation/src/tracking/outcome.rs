//! How well targets were tracked: per target and over all.

use std::collections::{BTreeMap, BTreeSet};

use northing_core::tracking::multi_target::TrackerCounts;
use northing_recording::tracking::TrackingIssues;
use serde::Serialize;

use super::epoch::TrackedTarget;
use super::matching::{Gospa, Place, assign, distance, ospa_m};
use super::trajectories::{Trajectories, TrajectoryDistance};
use crate::used_parameters::UsedParameter;

/// A target counts as covered by a track nearer than this share of the cut-off.
pub const COVERED: f64 = 0.5;
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
    /// Instants with a track within the cut-off.
    pub matched: usize,
    /// Root mean square distance while matched, m.
    pub rmse_m: Option<f64>,
    /// Median distance while matched, m.
    pub median_error_m: Option<f64>,
    /// Share of the instants with a track within half the cut-off.
    pub coverage: f64,
    /// Share of the instants with a detection that has a position within the cut-off: what the sensor saw of it, or of what is near.
    pub seen: f64,
    /// Whether the coverage is below one half.
    pub lost: bool,
    /// How often the target's track became another one.
    pub switches: usize,
    /// Share of the matched instants at which the truth lies in the track's 95 % ellipse.
    pub inside_95: Option<f64>,
    /// Mean of the squared distances in standard deviations while matched, for each of the two axes: 1 when the tracks' covariances are consistent
    /// (ANEES).
    pub anees: Option<f64>,
    /// Seconds from the first true position to the first with a track.
    pub found_after_s: Option<f64>,
    /// Share of the instants with a true position in the longest stretch with one and the same track.
    pub continuity: f64,
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
    /// Those of them that were reported at an instant with true positions; of the others nothing is known.
    pub scored_tracks: usize,
    /// Scored tracks that never followed a target.
    pub false_tracks: usize,
    /// Sum over the instants with true positions of reported tracks without a target.
    pub false_track_epochs: usize,
    /// Scored tracks that never followed a target, for each hour from the first true position to the last. What is there without a true position, a quay or a moored boat, counts too.
    pub false_tracks_per_hour: Option<f64>,
    /// Distance beyond which a track is no track of a target, m; `None` without true positions.
    pub cutoff_m: Option<f64>,
    /// Mean GOSPA, p = 2, alpha = 2, with that cut-off.
    pub gospa_m: Option<f64>,
    /// Mean OSPA, p = 2, with that cut-off.
    pub ospa_m: Option<f64>,
    /// T-GOSPA, p = 2, alpha = 2, with that cut-off, which is also what a change of track costs: the root of the mean square over the
    /// instants with true positions, of the best assignment that was found. `None`, too, where instants times tracks
    /// are more than twenty million.
    pub tgospa_m: Option<f64>,
    /// No assignment is nearer; equal to `tgospa_m` where that is known to be the best.
    pub tgospa_at_least_m: Option<f64>,
    /// What the tracker learnt of the own ship and the sensors, as it was at the end.
    pub learnt: Learnt,
    /// What the tracker did and refused.
    pub counts: Counts,
    /// What the reader left out.
    pub left_out: TrackingIssues,
    /// Every parameter of the tracker as it ran, in the order of the table.
    pub parameters: Vec<UsedParameter>,
    /// Version of the program.
    pub version: &'static str,
}

/// What a tracker learnt from its detections.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
pub struct Learnt {
    /// Mean time that targets are taken to stay visible, s, where that is not the setting.
    pub visible_s: Option<f64>,
    /// How long errors of the own ship's position last, s, where that is not the setting.
    pub position_error_s: Option<f64>,
    /// The same of the heading.
    pub heading_error_s: Option<f64>,
    /// Sensors whose echoes stay on their targets from scan to scan.
    pub echoes: Vec<LearntEcho>,
}

/// Echoes of a sensor that stay.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LearntEcho {
    /// The sensor, or those of the same noise.
    pub sensors: Vec<String>,
    /// Share of an echo's place that at least is still the same in the next scan.
    pub kept: f64,
    /// Seconds between two scans.
    pub interval_s: f64,
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
    seen: usize,
    inside: usize,
    normalised_squares: f64,
    switches: usize,
    last: Option<u32>,
    first_s: f64,
    found_s: Option<f64>,
    /// Instants in the stretch with the present track, and in the longest.
    stretch: usize,
    longest: usize,
}

/// What is gathered over the instants of a run.
#[derive(Debug, Clone, Default)]
pub(super) struct Score {
    cutoff_m: f64,
    truth_std_m: f64,
    targets: BTreeMap<u32, TargetTally>,
    pub(super) confirmed: BTreeSet<u32>,
    /// Tracks at instants with true positions, and those of them that followed a target.
    pub(super) scored: BTreeSet<u32>,
    matched: BTreeSet<u32>,
    pub(super) false_epochs: usize,
    gospa_sum: f64,
    ospa_sum: f64,
    count: usize,
    trajectories: Trajectories,
    /// The first and the last instant with true positions, s.
    scored_s: Option<[f64; 2]>,
}

impl Score {
    /// With the distance beyond which a track is no track of a target, if there is one, and the standard deviation of the true positions.
    pub(super) fn new(cutoff_m: Option<f64>, truth_std_m: f64) -> Self {
        Self {
            cutoff_m: cutoff_m.unwrap_or(0.0),
            truth_std_m,
            ..Self::default()
        }
    }

    /// Takes note of tracks where no truth is known.
    pub(super) fn seen(&mut self, tracks: &[TrackedTarget]) {
        self.confirmed.extend(tracks.iter().map(|track| track.id));
    }

    /// Scores one instant, with the places of its detections.
    pub(super) fn epoch(
        &mut self,
        time_s: f64,
        truth: &[(u32, Place)],
        tracks: &[TrackedTarget],
        detections: &[Place],
    ) {
        self.seen(tracks);
        // True positions of which none is finite: there is nothing to measure by.
        if self.cutoff_m <= 0.0 {
            return;
        }
        self.scored.extend(tracks.iter().map(|track| track.id));
        let first = self.scored_s.map_or(time_s, |[first, _]| first);
        self.scored_s = Some([first, time_s]);
        let cutoff = self.cutoff_m;
        let targets: Vec<Place> = truth.iter().map(|(_, place)| *place).collect();
        let places: Vec<Place> = tracks.iter().map(|track| track.place).collect();
        let assignment = assign(&targets, &places, cutoff);
        let gospa = Gospa::new(&targets, &places, &assignment, cutoff);
        self.gospa_sum += gospa.distance_m();
        self.ospa_sum += ospa_m(&gospa, targets.len(), places.len(), cutoff);
        self.count += 1;
        self.trajectories.take(truth, tracks, cutoff);
        self.false_epochs += tracks.len() - assignment.iter().flatten().count();
        for ((number, place), chosen) in truth.iter().zip(&assignment) {
            let tally = self.targets.entry(*number).or_insert_with(|| TargetTally {
                first_s: time_s,
                ..TargetTally::default()
            });
            tally.epochs += 1;
            let is_seen = detections.iter().any(|d| distance(*d, *place) < cutoff);
            tally.seen += usize::from(is_seen);
            let Some(track) = chosen.map(|index| &tracks[index]) else {
                tally.stretch = 0;
                continue;
            };
            self.matched.insert(track.id);
            let known = self.truth_std_m * self.truth_std_m;
            let square = track.normalised_square(*place, known);
            tally.take(
                time_s,
                distance(*place, track.place),
                square,
                track.id,
                cutoff,
            );
        }
    }

    /// The targets' summaries, with the totals left for the caller to name.
    pub(super) fn targets(&self) -> Vec<TargetSummary> {
        let each = self.targets.iter();
        each.map(|(number, tally)| tally.summary(*number)).collect()
    }

    pub(super) fn false_tracks(&self) -> usize {
        self.scored.difference(&self.matched).count()
    }

    pub(super) fn false_tracks_per_hour(&self) -> Option<f64> {
        let [first, last] = self.scored_s?;
        let hours = (last - first) / 3600.0;
        (hours > 0.0).then(|| self.false_tracks() as f64 / hours)
    }

    pub(super) fn cutoff_m(&self) -> Option<f64> {
        (self.count > 0).then_some(self.cutoff_m)
    }

    pub(super) fn gospa_m(&self) -> Option<f64> {
        (self.count > 0).then(|| self.gospa_sum / self.count as f64)
    }

    pub(super) fn trajectory_distance(&self) -> Option<TrajectoryDistance> {
        self.trajectories.distance(self.cutoff_m)
    }

    pub(super) fn ospa_m(&self) -> Option<f64> {
        (self.count > 0).then(|| self.ospa_sum / self.count as f64)
    }
}

impl TargetTally {
    /// An instant with a track: its distance (m), and that squared in standard deviations.
    fn take(&mut self, time_s: f64, error: f64, square: f64, track: u32, cutoff_m: f64) {
        self.errors.push(error);
        self.covered += usize::from(error < COVERED * cutoff_m);
        self.inside += usize::from(square <= ELLIPSE_95);
        self.normalised_squares += square;
        self.switches += usize::from(self.last.is_some_and(|last| last != track));
        self.stretch = match self.last {
            Some(last) if last == track => self.stretch + 1,
            _ => 1,
        };
        self.longest = self.longest.max(self.stretch);
        self.found_s.get_or_insert(time_s);
        self.last = Some(track);
    }

    fn summary(&self, target: u32) -> TargetSummary {
        let matched = self.errors.len();
        let mut sorted = self.errors.clone();
        sorted.sort_by(f64::total_cmp);
        let mean = |sum: f64| (matched > 0).then(|| sum / matched as f64);
        let share = |count: usize| count as f64 / self.epochs.max(1) as f64;
        let coverage = share(self.covered);
        TargetSummary {
            target,
            epochs: self.epochs,
            matched,
            rmse_m: mean(self.errors.iter().map(|e| e * e).sum()).map(f64::sqrt),
            median_error_m: sorted.get(matched / 2).copied(),
            coverage,
            seen: share(self.seen),
            lost: coverage < LOST_BELOW,
            switches: self.switches,
            inside_95: mean(self.inside as f64),
            anees: mean(0.5 * self.normalised_squares),
            found_after_s: self.found_s.map(|found| found - self.first_s),
            continuity: share(self.longest),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn track(id: u32, north: f64) -> TrackedTarget {
        TrackedTarget::at(id, [north, 0.0])
    }

    #[test]
    fn a_target_that_is_covered_lost_and_taken_over() {
        let mut score = Score::new(Some(40.0), 0.0);
        let truth = [(7, [0.0, 0.0])];
        score.epoch(10.0, &truth, &[track(9, 500.0)], &[]);
        score.epoch(
            12.0,
            &truth,
            &[track(1, 3.0), track(9, 500.0)],
            &[[30.0, 0.0]],
        );
        score.epoch(14.0, &truth, &[track(1, 4.0)], &[]);
        score.epoch(16.0, &truth, &[track(2, 25.0)], &[]);
        score.epoch(18.0, &truth, &[], &[]);
        let target = &score.targets()[0];
        assert_eq!((target.target, target.epochs, target.matched), (7, 5, 3));
        assert_eq!((target.switches, target.lost), (1, true));
        assert_relative_eq!(target.coverage, 0.4);
        assert_relative_eq!(target.seen, 0.2);
        assert_relative_eq!(target.continuity, 0.4);
        assert_eq!(target.found_after_s, Some(2.0));
        let anees = 0.5 * (9.0 / 4.0 + 16.0 / 4.0 + 625.0 / 4.0) / 3.0;
        assert_relative_eq!(target.anees.unwrap(), anees, epsilon = 1e-12);
        let rmse = f64::sqrt((9.0 + 16.0 + 625.0) / 3.0);
        assert_relative_eq!(target.rmse_m.unwrap(), rmse, epsilon = 1e-12);
        assert_relative_eq!(target.median_error_m.unwrap(), 4.0);
        // 3^2/4 and 4^2/4 are inside 5.99, 25^2/4 is not
        assert_relative_eq!(target.inside_95.unwrap(), 2.0 / 3.0);
        assert_eq!((score.confirmed.len(), score.false_tracks()), (3, 1));
        assert_eq!(score.false_epochs, 2);
        assert_relative_eq!(score.false_tracks_per_hour().unwrap(), 450.0);
        // The mean of 40, of the root of (9 + 1600) / 2, of 4, of 25 and of 40.
        let ospa = (40.0 + f64::sqrt(1609.0 / 2.0) + 4.0 + 25.0 + 40.0) / 5.0;
        assert_relative_eq!(score.ospa_m().unwrap(), ospa, epsilon = 1e-9);
        // Track 2 for one instant would cost a change: more than it gains.
        let whole: f64 = [1600.0, 9.0 + 800.0, 16.0, 1600.0, 800.0].iter().sum();
        let distance = score.trajectory_distance().unwrap();
        assert_relative_eq!(distance.at_most_m, (whole / 5.0).sqrt(), epsilon = 1e-9);
    }

    #[test]
    fn false_tracks_are_those_of_the_time_of_the_true_positions() {
        // A false track of a scan each, for an hour; true positions for six minutes in it, or for all of it.
        let rate = |known: std::ops::Range<u32>| {
            let mut score = Score::new(Some(40.0), 0.0);
            for k in 0..360 {
                let tracks = [track(0, 0.0), track(1 + k, 500.0)];
                if known.contains(&k) {
                    score.epoch(f64::from(10 * k), &[(7, [0.0, 0.0])], &tracks, &[]);
                } else {
                    score.seen(&tracks);
                }
            }
            assert_eq!(score.confirmed.len(), 361);
            assert_eq!(score.scored.len(), known.len() + 1);
            assert_eq!(score.false_tracks(), known.len());
            score.false_tracks_per_hour().unwrap()
        };
        assert_relative_eq!(rate(0..360), 360.0, max_relative = 0.01);
        assert_relative_eq!(rate(100..137), 370.0, max_relative = 0.01);
    }

    #[test]
    fn true_positions_may_be_uncertain_too() {
        let mut score = Score::new(Some(40.0), f64::sqrt(5.0));
        score.epoch(0.0, &[(1, [0.0, 0.0])], &[track(1, 6.0)], &[]);
        // 6^2 / (4 + 5)
        let target = &score.targets()[0];
        assert_relative_eq!(target.anees.unwrap(), 2.0, epsilon = 1e-12);
    }

    #[test]
    fn true_positions_that_are_not_finite_give_no_score() {
        let mut score = Score::new(None, 0.0);
        score.epoch(0.0, &[(1, [f64::NAN, 0.0])], &[track(1, 6.0)], &[]);
        assert!(score.targets().is_empty() && score.confirmed.len() == 1);
        let lengths = [score.cutoff_m(), score.gospa_m(), score.ospa_m()];
        assert_eq!(lengths, [None; 3]);
    }

    #[test]
    fn without_truth_there_are_no_false_tracks_and_no_errors() {
        let mut score = Score::default();
        score.seen(&[track(1, 3.0)]);
        assert!(score.targets().is_empty() && score.gospa_m().is_none());
        assert_eq!((score.confirmed.len(), score.false_tracks()), (1, 0));
    }
}
