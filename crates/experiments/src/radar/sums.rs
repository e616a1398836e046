//! Sums over the runs of a campaign: squared errors and NEES of each tracker at each
//! scan, and how good the navigation was.

use super::trackers::TrackerKind;
use crate::exact_sum::ExactSum;

/// Sums of a tracker at one scan: squared position error, squared velocity error, NEES.
pub type TrackerStep = [ExactSum; 3];
/// Index of the squared position error, m^2.
pub const POSITION: usize = 0;
/// Index of the squared velocity error, (m/s)^2.
pub const VELOCITY: usize = 1;
/// Index of the NEES of the target's state, four degrees of freedom.
pub const NEES: usize = 2;

/// Sums of the navigation at one scan: variances of north, east (m^2) and heading (rad^2), their
/// squared errors, NEES of the three, and the closed-loop factor of the heading error over the scan.
pub type NavigationStep = [ExactSum; 8];
/// Index of the first of the three variances.
pub const POSE_VARIANCE: usize = 0;
/// Index of the first of the three squared errors.
pub const POSE_ERROR: usize = 3;
/// Index of the NEES of the pose, three degrees of freedom.
pub const POSE_NEES: usize = 6;
/// Index of the closed-loop factor.
pub const HEADING_FACTOR: usize = 7;

/// All sums of a campaign or of a part of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CampaignSums {
    /// The trackers, in the order of `trackers`.
    pub kinds: Vec<TrackerKind>,
    /// Each tracker's steps; step 0 is the start.
    pub trackers: Vec<Vec<TrackerStep>>,
    /// Detections each tracker skipped.
    pub skipped: Vec<u64>,
    /// The navigation's steps.
    pub navigation: Vec<NavigationStep>,
    /// Runs in it.
    pub runs: u64,
}

impl CampaignSums {
    /// Nothing yet, over scans `0..=scans`.
    #[must_use]
    pub fn new(kinds: &[TrackerKind], scans: usize) -> Self {
        Self {
            kinds: kinds.to_vec(),
            trackers: vec![vec![TrackerStep::default(); scans + 1]; kinds.len()],
            skipped: vec![0; kinds.len()],
            navigation: vec![NavigationStep::default(); scans + 1],
            runs: 0,
        }
    }

    /// Adds the runs of another campaign over the same trackers and scans.
    #[must_use]
    pub fn merged(mut self, other: &Self) -> Self {
        for (mine, theirs) in self.trackers.iter_mut().zip(&other.trackers) {
            merge_steps(mine, theirs);
        }
        merge_steps(&mut self.navigation, &other.navigation);
        for (mine, theirs) in self.skipped.iter_mut().zip(&other.skipped) {
            *mine += theirs;
        }
        self.runs += other.runs;
        self
    }
}

fn merge_steps<const N: usize>(mine: &mut [[ExactSum; N]], theirs: &[[ExactSum; N]]) {
    for (mine, theirs) in mine.iter_mut().flatten().zip(theirs.iter().flatten()) {
        mine.merge(theirs);
    }
}
