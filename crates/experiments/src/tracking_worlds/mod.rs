//! Trackers of many targets on random scenes: the default settings on every sensor, class of targets and own ship.
//!
//! [`Scenes`] says which scenes; each is run by every tracker and becomes a [`SceneOutcome`], all together a [`ScenesOutcome`] with a row
//! for each class and tracker.
//!
//! # What is scored
//!
//! Scores are those of `northing track` with the scene's own cut-off: four standard deviations of a detection's place, the own ship's error
//! with it. GOSPA and OSPA are given in cut-offs, so that scenes of metres and of kilometres have one mean: a target that is never found
//! costs the root of 1/2 in GOSPA. A pose that is wrong shifts all tracks together; what it costs cannot be removed by any tracker,
//! and a tracker that is told its standard deviation should state it.
//!
//! # Consistency
//!
//! ANEES of a scene is the mean over all matched instants of its targets, 1 where the covariances are right. A scene is called consistent
//! when it lies in the band in which the mean of as many independent samples lies with a probability of 99 %. Independent is one instant of
//! ten of a target; where an own ship's error shifts all targets together, one instant of twice its correlation time. Both are rules of
//! thumb, and both make the band wide rather than narrow; the mean over all scenes needs no such rule. Scenes in which the tracker is told
//! wrong noise, or an own ship's error is not told, are not counted here: nobody can be consistent there.

mod outcome;
mod run;

pub use outcome::{Interval, ScenesOutcome, TrackerRow};
pub use run::{SceneOutcome, TrackerScore};

use northing_simulation::tracking_world::SceneClass;
use rayon::prelude::*;

/// Which scenes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Scenes {
    /// Seed of all.
    pub seed: u64,
    /// Number of the first.
    pub first: u64,
    /// So many numbers from there on.
    pub count: u64,
    /// Only those of this class.
    pub class: Option<SceneClass>,
}

impl Scenes {
    /// Their numbers.
    #[must_use]
    pub fn numbers(&self) -> Vec<u64> {
        let range = self.first..self.first.saturating_add(self.count);
        let wanted = |number: &u64| {
            self.class
                .is_none_or(|class| SceneClass::of(*number) == class)
        };
        range.filter(wanted).collect()
    }

    /// Runs them on all processors; `done` is called after each.
    #[must_use]
    pub fn run(&self, done: &(dyn Fn() + Sync)) -> ScenesOutcome {
        let one = |number: u64| {
            let outcome = SceneOutcome::of(self.seed, number);
            done();
            outcome
        };
        let scenes = self.numbers().into_par_iter().map(one).collect();
        ScenesOutcome::of(self.seed, scenes)
    }
}
