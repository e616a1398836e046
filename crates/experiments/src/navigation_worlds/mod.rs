//! GNSS/INS on random worlds: the default filter on every vehicle, unit and receiver, judged against what it states and against
//! extrapolation.
//!
//! [`Worlds`] says which worlds; each is run by `run` and becomes a [`WorldOutcome`], all together a [`WorldsOutcome`] with a
//! row a class and the worst worlds.
//!
//! # What is scored
//!
//! Ten times a second from the first estimate on: the horizontal distance between the filter's position of the antenna and where the
//! antenna was at the receiver's time, against the 95 % ellipse of its covariance (fixes see the antenna, by the receiver's
//! clock, and the filter is not told lever arm and latency: while the vehicle drives straight on neither can be known, and a receiver
//! alone does not know them either); the error of its attitude about the vertical against the
//! standard deviation of that. The baselines are [`Baseline`]: the last fix held, and the last fix moved on.
//! They are not given outliers and stale fixes, which any plausibility check removes: an outlier of 2000 km would be an
//! excuse for everything else.
//!
//! A world is **lost** if the error lay beyond five times the ellipse for ten seconds in one piece, if its root mean square is more
//! than three times that of extrapolation over the same instants, or if there was no estimate at all. Solution status
//! excuses nothing. **Worse** is a root mean square above extrapolation's.
//!
//! # What nobody can know
//!
//! Some instants cannot be judged by the standard deviation that a filter states, because no estimator could state a better one:
//!
//! - during a drift of the receiver, and for 20 s after it. A position that moves away smoothly, with the standard
//!   deviation stated as ever, is what a bias of the accelerometer looks like, or an unknown latency. Afterwards the
//!   filter has to find back;
//! - from a wrong fix among the first three until three good fixes have come: before that no majority says which are wrong;
//! - in a world whose receiver understates its error more than three times, and shows nothing of it from fix to fix because it is
//!   correlated for a minute: it is a drift that never ends.
//!
//! Everything else is judged: outliers, frozen positions, jumps of biases, saturation, unknown latency, wrongly stated
//! standard deviations. And where fixes are missing the error is judged against the ellipse alone: whether a craft keeps its velocity while nobody
//! sees it is luck, and for one that hovers the held fix is hard to beat. Both numbers are given, of all instants and of
//! those that can be known, and the ratio to extrapolation in outages apart.
//!
//! # Coverage
//!
//! Errors that last a minute are few in a world of two to four: an estimator that is consistent to the letter has a coverage between
//! 0.90 and 0.99 in 26 % of the worlds if its error is correlated for 60 s, in 79 % for 10 s, in 98 % for 1 s. So the share of
//! consistent worlds says which worlds to look at; the coverage pooled over all worlds, which expects 0.95 whatever the
//! correlation, says whether the filter is consistent.

mod baseline;
mod events;
mod outcome;
mod run;
mod score;
mod undetectable;

pub use baseline::Baseline;
pub use events::{events, world_frame};
pub use outcome::{ClassRow, FeatureRow, WorldsOutcome};
pub use run::{WorldInstant, WorldRun};
pub use score::{Score, WorldOutcome};

use northing_simulation::navigation_world::WorldClass;
use rayon::prelude::*;

/// Which worlds.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Worlds {
    /// Seed of all.
    pub seed: u64,
    /// Number of the first.
    pub first: u64,
    /// So many numbers from there on.
    pub count: u64,
    /// Only those of this class.
    pub class: Option<WorldClass>,
}

impl Worlds {
    /// Their numbers.
    #[must_use]
    pub fn numbers(&self) -> Vec<u64> {
        let range = self.first..self.first.saturating_add(self.count);
        let wanted = |number: &u64| {
            self.class
                .is_none_or(|class| WorldClass::of(*number) == class)
        };
        range.filter(wanted).collect()
    }

    /// Runs them on all processors; `done` is called after each.
    #[must_use]
    pub fn run(&self, done: &(dyn Fn() + Sync)) -> WorldsOutcome {
        let one = |number: u64| {
            let outcome = WorldRun::of(self.seed, number).outcome();
            done();
            outcome
        };
        let worlds = self.numbers().into_par_iter().map(one).collect();
        WorldsOutcome::of(self.seed, worlds)
    }
}
