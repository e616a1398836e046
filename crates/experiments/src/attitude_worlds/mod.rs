//! Attitude estimators on random worlds: every one on every board and motion, judged against the truth, against what it states, and
//! against VQF.
//!
//! [`Worlds`] says which worlds and estimators; each world is run by `run` and becomes a [`WorldOutcome`], all together a
//! [`WorldsOutcome`] with a row an estimator, a motion and a fault, a confusion matrix and the worst worlds.
//!
//! # What is scored
//!
//! Ten times a second from five seconds on, with default parameters and samples in the order of their stamps: the **tilt**, which is the
//! angle between estimated and true up; the **heading**, which is the rest (the parts of the BROAD benchmark, whose total
//! includes both). Where nothing says where north is, the heading counts from the first scored instant, else from north. Every
//! world runs twice, with [`Sensing::All`] and with [`Sensing::Inertial`]. [VQF](baseline) is given the same samples; ratios to it
//! are medians over worlds, of the heading where both have the same zero.
//!
//! **Coverage** is the share of instants inside the stated 95 %: of the tilt with two degrees of freedom, of the heading with one.
//! The drift of a heading without north has the variance that the heading's has grown by since the first scored instant, which is
//! exact while nothing corrects it; where a filter states that it does not know the heading at all, none is scored.
//!
//! # What a consistent estimator would have
//!
//! The error of a tilt lasts: a bias of the accelerometer at rest is one error for the whole world, and coverage of such a world is
//! 0 or 1, whatever is stated. So the share of worlds with coverage between 0.90 and 0.99 is compared with the share that an
//! estimator would have that is consistent to the letter, its errors correlated as long as those measured and its worlds as
//! long ([`consistent`]). The coverage pooled over worlds expects 0.95 whatever the correlation.
//!
//! # Verdicts
//!
//! A world knows its true cause: the fault that was drawn, where the estimate is worse for it than in the same world without it; else
//! nothing is as right to name, and so is an `R` that does not fit the true deviations of the samples (`truth.rs`). What the verdicts name is
//! read by [`cause::named_cause`] alone: it is **right** where it is a true cause, **false** where something is named that is none. A world is
//! **green** when nothing is
//! named. Counted are green worlds in which the truth is beyond five standard deviations, and worlds in which a sensor is blamed while
//! its mean NIS is in its band.

pub mod baseline;
pub mod cause;
pub mod consistent;
mod outcome;
mod run;
pub(crate) mod score;
mod truth;

pub use cause::Cause;
pub use outcome::{Confusion, EstimatorOutcome, GroupRow, StatedRow, WorldsOutcome};
pub use run::{EstimatorRun, WorldRun};
pub use score::{EstimatorScore, StatedScore, WorldInstant, WorldOutcome};

use northing_evaluation::{EstimatorKind, EvaluationError, Profile, RunOptions};
use northing_simulation::attitude_world::{HeadingSource, WorldMotion};
use rayon::prelude::*;
use serde::Serialize;

/// The sensors that estimators are given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Sensing {
    /// All that the world has.
    All,
    /// Gyroscope and accelerometer.
    Inertial,
}

impl Sensing {
    /// Both.
    pub const ALL: [Self; 2] = [Self::All, Self::Inertial];

    /// In words, for titles.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::All => "all sensors",
            Self::Inertial => "gyroscope and accelerometer",
        }
    }

    /// Whether it says where north is on this board.
    #[must_use]
    pub const fn has_north(self, heading: &HeadingSource) -> bool {
        matches!(self, Self::All) && !matches!(heading, HeadingSource::None)
    }
}

/// Which worlds, and who runs in them.
#[derive(Debug, Clone)]
pub struct Worlds {
    /// Seed of all.
    pub seed: u64,
    /// Number of the first.
    pub first: u64,
    /// So many numbers from there on.
    pub count: u64,
    /// Only those of this motion.
    pub motion: Option<WorldMotion>,
    /// The estimators; the first is the subject of detailed tables.
    pub estimators: Vec<EstimatorKind>,
    /// Parameters that are not the defaults, such as `bounded_velocity_psd=0.03`, for all of them.
    pub settings: Vec<String>,
}

impl Worlds {
    /// A thousand worlds of the first seed, with every estimator, `bounded-velocity` first.
    #[must_use]
    pub fn thousand() -> Self {
        Self {
            seed: 1,
            first: 0,
            count: 1000,
            motion: None,
            estimators: every_estimator(),
            settings: Vec::new(),
        }
    }

    /// Their numbers.
    #[must_use]
    pub fn numbers(&self) -> Vec<u64> {
        let range = self.first..self.first.saturating_add(self.count);
        let wanted = |number: &u64| {
            self.motion
                .is_none_or(|motion| WorldMotion::of(*number) == motion)
        };
        range.filter(wanted).collect()
    }

    /// The options of each estimator.
    ///
    /// # Errors
    /// A setting that no estimator has, or a value outside its range; `device`, which estimates nothing.
    pub fn options(&self) -> Result<Vec<RunOptions>, EvaluationError> {
        let one = |kind: &EstimatorKind| {
            if *kind == EstimatorKind::Device {
                return Err(EvaluationError::NoDeviceOrientation);
            }
            let mut options = RunOptions::new(*kind, Profile::HandHeld);
            for setting in &self.settings {
                options.set(setting)?;
            }
            options.check()?;
            Ok(options)
        };
        self.estimators.iter().map(one).collect()
    }

    /// Runs them on all processors; `done` is called after each world.
    ///
    /// # Errors
    /// As [`Self::options`].
    pub fn run(&self, done: &(dyn Fn() + Sync)) -> Result<WorldsOutcome, EvaluationError> {
        let options = self.options()?;
        let one = |number: u64| {
            let outcome = WorldRun::of(self.seed, number, &options).outcome();
            done();
            outcome
        };
        let worlds = self.numbers().into_par_iter().map(one).collect();
        Ok(WorldsOutcome::of(self.seed, worlds))
    }
}

/// Every estimator of the registry that runs on these samples, the default first. `cascade` is `complementary` where there are no
/// positions, and `device` reads a column.
#[must_use]
pub fn every_estimator() -> Vec<EstimatorKind> {
    let subject = EstimatorKind::BoundedVelocity;
    let others = EstimatorKind::ALL.into_iter().filter(|kind| {
        !matches!(kind, EstimatorKind::Device | EstimatorKind::Cascade) && *kind != subject
    });
    core::iter::once(subject).chain(others).collect()
}
