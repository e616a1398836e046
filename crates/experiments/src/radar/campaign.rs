//! Many runs on all processors, parts of a campaign, and their merging.
//!
//! Each run depends on the scenario, the seed and its number alone, and the sums do not depend on
//! the order of adding; so threads, shards and machines give the same bits. Memory does not grow
//! with the number of runs.

use std::ops::Range;
use std::time::Instant;

use nalgebra::Vector4;
use northing_core::ConfigError;
use northing_core::geometry::trigonometry::wrap;
use northing_simulation::scenario::TrackingWorld;
use northing_simulation::scenario::schema::Scenario;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::experiment::{NavigationRecord, RunWatcher, TrackRecord, check_navigation, run};
use super::sums::{
    CampaignSums, HEADING_FACTOR, NEES, POSE_ERROR, POSE_NEES, POSE_VARIANCE, POSITION, VELOCITY,
};
use super::trackers::TrackerKind;
use crate::shard::{Shard, ShardError};

/// Why a campaign or a merge cannot be.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CampaignError {
    /// No tracker has this name.
    #[error("unknown tracker `{name}`; expected a list of: {valid}")]
    UnknownTracker {
        /// What was asked for.
        name: String,
        /// The names there are.
        valid: String,
    },
    /// Trackers that do not go with the navigation filter.
    #[error(
        "the tracker `{name}` needs the navigation filter error-state: it looks into it or corrects it"
    )]
    NeedsErrorState {
        /// The tracker.
        name: String,
    },
    /// No runs.
    #[error("runs is 0, expected at least 1")]
    NoRuns,
    /// The navigation filter refuses what the scenario says.
    #[error("the navigation filter cannot start with this scenario: {0}")]
    Navigation(ConfigError),
    /// A shard that there is not.
    #[error(transparent)]
    NoSuchShard(#[from] ShardError),
    /// Nothing to merge.
    #[error("no parts to merge")]
    NoParts,
    /// Parts that are not of one campaign.
    #[error("{file} is of another campaign than {first}: {what} differs")]
    OtherCampaign {
        /// The part.
        file: String,
        /// The first part.
        first: String,
        /// What differs.
        what: String,
    },
    /// Parts that hold the same runs.
    #[error("{file} and {other} both hold run {run}; leave one of them out")]
    Overlap {
        /// A part.
        file: String,
        /// Another.
        other: String,
        /// A run in both.
        run: u64,
    },
}

/// What identifies a campaign: parts agree on all of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CampaignKey {
    /// The scenario with its variant applied.
    pub scenario: Scenario,
    /// The seed.
    pub seed: u64,
    /// Runs of the whole campaign.
    pub runs: u64,
    /// Names of the trackers.
    pub trackers: Vec<String>,
}

impl CampaignKey {
    /// What differs first.
    fn difference(&self, other: &Self) -> Option<String> {
        if self.scenario != other.scenario {
            let names = (&self.scenario.meta.name, &other.scenario.meta.name);
            return Some(format!("the scenario ({} and {})", names.0, names.1));
        }
        if self.seed != other.seed {
            return Some(format!("the seed ({} and {})", self.seed, other.seed));
        }
        if self.runs != other.runs {
            return Some(format!(
                "the number of runs ({} and {})",
                self.runs, other.runs
            ));
        }
        (self.trackers != other.trackers).then(|| "the list of trackers".to_owned())
    }
}

/// A part of a campaign, or a whole one.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// The campaign.
    pub key: CampaignKey,
    /// The runs in it, ascending.
    pub ranges: Vec<Range<u64>>,
    /// The sums over them.
    pub sums: CampaignSums,
    /// Time it took, s.
    pub elapsed_s: f64,
}

/// A campaign that can be run.
#[derive(Debug, Clone)]
pub struct Campaign {
    world: TrackingWorld,
    kinds: Vec<TrackerKind>,
    seed: u64,
    runs: u64,
}

/// `e^T P^-1 e`, also for matrices that are not positive: what a broken recursion gives is shown.
fn normalized<const N: usize>(
    error: &nalgebra::SVector<f64, N>,
    inverse: Option<nalgebra::SMatrix<f64, N, N>>,
) -> f64 {
    inverse.map_or(f64::NAN, |inverse| error.dot(&(inverse * error)))
}

impl RunWatcher for CampaignSums {
    fn scan(&mut self, step: usize, navigation: &NavigationRecord, _target: &Vector4<f64>) {
        let Some(sums) = self.navigation.get_mut(step) else {
            return;
        };
        let mut error = navigation.true_pose - navigation.pose;
        error.z = wrap(error.z);
        for i in 0..3 {
            sums[POSE_VARIANCE + i].add(navigation.covariance[(i, i)]);
            sums[POSE_ERROR + i].add(error[i] * error[i]);
        }
        sums[POSE_NEES].add(normalized(&error, navigation.covariance.try_inverse()));
        sums[HEADING_FACTOR].add(navigation.heading_factor);
    }

    fn tracker(&mut self, step: usize, index: usize, record: &TrackRecord, target: &Vector4<f64>) {
        self.skipped[index] += u64::from(record.skipped);
        let Some(sums) = self.trackers[index].get_mut(step) else {
            return;
        };
        let (position, velocity, nees) = match record.estimate {
            Some(track) => {
                let e = target - track.state;
                let nees = normalized(&e, track.covariance.try_inverse());
                (e[0] * e[0] + e[2] * e[2], e[1] * e[1] + e[3] * e[3], nees)
            }
            None => (f64::NAN, f64::NAN, f64::NAN),
        };
        sums[POSITION].add(position);
        sums[VELOCITY].add(velocity);
        sums[NEES].add(nees);
    }
}

impl Campaign {
    /// A campaign of this scenario; an empty list of trackers is that of the scenario, and all that go with its
    /// navigation filter when that is empty too.
    ///
    /// # Errors
    /// No runs, a tracker that there is not, or one that does not go with the navigation filter.
    pub fn new(
        scenario: &Scenario,
        trackers: &[TrackerKind],
        seed: u64,
        runs: u64,
    ) -> Result<Self, CampaignError> {
        if runs == 0 {
            return Err(CampaignError::NoRuns);
        }
        let mut kinds = trackers.to_vec();
        if kinds.is_empty() {
            let named = scenario.meta.trackers.iter();
            kinds = named
                .map(|name| TrackerKind::parse(name))
                .collect::<Result<_, _>>()?;
        }
        let filter = scenario.navigation.filter;
        if kinds.is_empty() {
            kinds = TrackerKind::ALL.to_vec();
        }
        if trackers.is_empty() {
            kinds.retain(|kind| kind.goes_with(filter));
        }
        if let Some(kind) = kinds.iter().find(|kind| !kind.goes_with(filter)) {
            let name = kind.name().to_owned();
            return Err(CampaignError::NeedsErrorState { name });
        }
        kinds.sort_unstable();
        kinds.dedup();
        let world = TrackingWorld::new(scenario);
        check_navigation(&world, seed).map_err(CampaignError::Navigation)?;
        Ok(Self {
            world,
            kinds,
            seed,
            runs,
        })
    }

    /// What all runs share.
    #[must_use]
    pub fn world(&self) -> &TrackingWorld {
        &self.world
    }

    /// The trackers.
    #[must_use]
    pub fn trackers(&self) -> &[TrackerKind] {
        &self.kinds
    }

    /// Runs a shard on the threads of the current pool; `done` is called after each run.
    ///
    /// # Errors
    /// A shard that holds no run.
    pub fn run(&self, shard: Shard, done: &(dyn Fn() + Sync)) -> Result<Part, CampaignError> {
        let go_on = || {
            done();
            true
        };
        let part = self.run_while(shard, &go_on)?;
        part.ok_or(CampaignError::NoSuchShard(shard.without_runs()))
    }

    /// As [`Self::run`], and `go_on` says after each run whether to; `None` when it did not.
    ///
    /// # Errors
    /// A shard that holds no run.
    pub fn run_while(
        &self,
        shard: Shard,
        go_on: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<Part>, CampaignError> {
        let range = shard.range(self.runs);
        if range.is_empty() {
            return Err(shard.without_runs().into());
        }
        let started = Instant::now();
        let empty = || CampaignSums::new(&self.kinds, self.world.scans());
        let sums = range
            .clone()
            .into_par_iter()
            .try_fold(empty, |mut sums, number| {
                run(&self.world, &self.kinds, self.seed, number, &mut sums);
                sums.runs += 1;
                go_on().then_some(sums)
            });
        let Some(sums) = sums.try_reduce(empty, |a, b| Some(a.merged(&b))) else {
            return Ok(None);
        };
        Ok(Some(Part {
            key: CampaignKey {
                scenario: self.world.scenario().clone(),
                seed: self.seed,
                runs: self.runs,
                trackers: self
                    .kinds
                    .iter()
                    .map(|kind| kind.name().to_owned())
                    .collect(),
            },
            ranges: vec![range],
            sums,
            elapsed_s: started.elapsed().as_secs_f64(),
        }))
    }
}

/// Merges parts of one campaign; each comes with the name of its file.
///
/// # Errors
/// There is none, they are of different campaigns, or a run is in two of them.
pub fn merge(parts: Vec<(String, Part)>) -> Result<Part, CampaignError> {
    let mut parts = parts.into_iter();
    let Some((first, mut whole)) = parts.next() else {
        return Err(CampaignError::NoParts);
    };
    let mut held: Vec<(Range<u64>, String)> = whole
        .ranges
        .iter()
        .map(|r| (r.clone(), first.clone()))
        .collect();
    for (file, part) in parts {
        if let Some(what) = whole.key.difference(&part.key) {
            return Err(CampaignError::OtherCampaign { file, first, what });
        }
        for range in &part.ranges {
            for (other_range, other) in &held {
                let run = range.start.max(other_range.start);
                if run < range.end.min(other_range.end) {
                    let other = other.clone();
                    return Err(CampaignError::Overlap { file, other, run });
                }
            }
        }
        held.extend(part.ranges.iter().map(|r| (r.clone(), file.clone())));
        whole.sums = whole.sums.merged(&part.sums);
        whole.elapsed_s += part.elapsed_s;
    }
    let mut ranges: Vec<Range<u64>> = held.into_iter().map(|(range, _)| range).collect();
    ranges.sort_by_key(|range| range.start);
    whole.ranges = ranges;
    Ok(whole)
}
