//! What came out over all worlds: rows by motion and by fault, a confusion matrix of causes, the worst.

use std::collections::BTreeMap;

use northing_simulation::attitude_world::{WorldFault, WorldMotion};
use serde::Serialize;

use super::cause::Cause;
use super::consistent::ConsistentShares;
use super::score::{EstimatorScore, StatedScore, WorldOutcome};
use super::{Sensing, baseline};
use crate::scoring::{CONSISTENT, is_consistent, median};

/// So many of the worst worlds are listed.
const WORST: usize = 10;

/// What was stated of tilt or heading, over worlds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct StatedRow {
    /// Worlds in which it was stated.
    pub worlds: usize,
    /// Coverage of the stated 95 % over the instants of all.
    pub pooled_coverage: f64,
    /// Share of the worlds with coverage between 0.90 and 0.99.
    pub consistent_share: f64,
    /// The share that a consistent estimator would have, its errors as long as these.
    pub expected_share: f64,
    /// Share of the worlds below: overconfident.
    pub overconfident_share: f64,
    /// Median of the mean NEES per degree of freedom.
    pub median_nees: f64,
    /// Median of how long errors last, s.
    pub median_correlation_time_s: f64,
}

/// Numbers over a group of worlds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GroupRow {
    /// Name of the motion or of the fault, or `all`.
    pub group: String,
    /// How many worlds.
    pub worlds: usize,
    /// Of these without any estimate.
    pub without_estimate: usize,
    /// Median of the root mean square of the tilt error, deg.
    pub tilt_rms_deg: Option<f64>,
    /// The same of the heading.
    pub heading_rms_deg: Option<f64>,
    /// The same of the whole error.
    pub total_rms_deg: Option<f64>,
    /// Median of the tilt's root mean square over VQF's.
    pub tilt_over_vqf: Option<f64>,
    /// The same of the heading, where both have the same zero.
    pub heading_over_vqf: Option<f64>,
    /// The same of the whole error, likewise.
    pub total_over_vqf: Option<f64>,
    /// What was stated of the tilt.
    pub tilt: Option<StatedRow>,
    /// What was stated of the heading.
    pub heading: Option<StatedRow>,
    /// Worlds in which nothing was named while the truth was beyond five standard deviations.
    pub green_beyond_five: usize,
    /// Worlds in which a sensor was blamed while its mean NIS was in its band.
    pub blamed_inside_the_band: usize,
    /// Share of the worlds in which a true cause was named.
    pub right_share: Option<f64>,
    /// Share of the worlds in which something was named that is no true cause: false reasons.
    pub false_share: Option<f64>,
}

/// How often causes were named for true ones.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Confusion {
    /// Columns: what was named.
    pub named: Vec<Cause>,
    /// Rows: the main true cause, and how often each was named for it.
    pub rows: Vec<(Cause, Vec<usize>)>,
}

/// One estimator with some sensors over all worlds.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EstimatorOutcome {
    /// Its name.
    pub estimator: &'static str,
    /// What it was given.
    pub sensing: Sensing,
    /// Over all worlds.
    pub total: GroupRow,
    /// By motion.
    pub motions: Vec<GroupRow>,
    /// By fault.
    pub faults: Vec<GroupRow>,
    /// Causes; none for what has no verdicts.
    pub confusion: Option<Confusion>,
    /// Numbers of the worst worlds, the worst first.
    pub worst: Vec<u64>,
}

/// What came out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorldsOutcome {
    /// Seed of the worlds.
    pub seed: u64,
    /// Every estimator and VQF, with all sensors and with gyroscope and accelerometer; the subject first.
    pub estimators: Vec<EstimatorOutcome>,
    /// Every world, by number.
    pub worlds: Vec<WorldOutcome>,
}

/// A world and the score of one estimator in it.
type Scored<'a> = (&'a WorldOutcome, &'a EstimatorScore);

impl WorldsOutcome {
    /// What these worlds say together.
    #[must_use]
    pub fn of(seed: u64, worlds: Vec<WorldOutcome>) -> Self {
        let mut estimators: Vec<(&'static str, Sensing)> = Vec::new();
        for score in worlds.iter().flat_map(|world| &world.scores) {
            let key = (score.estimator, score.sensing);
            if !estimators.contains(&key) {
                estimators.push(key);
            }
        }
        // Worlds without north come with one kind of sensing alone: the order is that of the kinds.
        estimators.sort_by_key(|(_, sensing)| *sensing);
        let mut shares = ConsistentShares::default();
        let outcome = |(estimator, sensing): (&'static str, Sensing)| {
            let scored = |world: &'_ WorldOutcome| world.score(estimator, sensing).is_some();
            let of: Vec<Scored<'_>> = (worlds.iter().filter(|w| scored(w)))
                .filter_map(|world| Some((world, world.score(estimator, sensing)?)))
                .collect();
            EstimatorOutcome::of(estimator, sensing, &of, &mut shares)
        };
        Self {
            seed,
            estimators: estimators.into_iter().map(outcome).collect(),
            worlds,
        }
    }

    /// What an estimator came to with these sensors.
    #[must_use]
    pub fn estimator(&self, name: &str, sensing: Sensing) -> Option<&EstimatorOutcome> {
        let mut estimators = self.estimators.iter();
        estimators.find(|of| of.estimator == name && of.sensing == sensing)
    }

    /// The first estimator, which the detailed tables are about.
    #[must_use]
    pub fn subject(&self) -> &'static str {
        let mut names = self.estimators.iter().map(|of| of.estimator);
        names.next().unwrap_or(baseline::NAME)
    }

    /// The world with this number.
    #[must_use]
    pub fn world(&self, number: u64) -> Option<&WorldOutcome> {
        let mut worlds = self.worlds.iter();
        worlds.find(|world| world.description.number == number)
    }
}

impl EstimatorOutcome {
    fn of(
        estimator: &'static str,
        sensing: Sensing,
        scored: &[Scored<'_>],
        shares: &mut ConsistentShares,
    ) -> Self {
        let mut row = |name: &str, of: &dyn Fn(&Scored<'_>) -> bool| {
            let group: Vec<_> = scored.iter().filter(|s| of(s)).copied().collect();
            GroupRow::of(name, &group, shares)
        };
        let total = row("all", &|_| true);
        let motion =
            |motion: WorldMotion| row(motion.name(), &|(w, _)| w.description.motion == motion);
        let motions: Vec<_> = WorldMotion::ALL.into_iter().map(motion).collect();
        let fault = |fault: WorldFault| row(fault.name(), &|(w, _)| w.description.fault == fault);
        let faults: Vec<_> = WorldFault::ALL.into_iter().map(fault).collect();
        let some = |rows: Vec<GroupRow>| rows.into_iter().filter(|row| row.worlds > 0).collect();
        let mut by_badness = scored.to_vec();
        by_badness.sort_by(|(_, a), (_, b)| b.badness().total_cmp(&a.badness()));
        let worst = by_badness.iter().map(|(world, _)| world.description.number);
        Self {
            estimator,
            sensing,
            total,
            motions: some(motions),
            faults: some(faults),
            confusion: Confusion::of(scored),
            worst: worst.take(WORST).collect(),
        }
    }
}

impl Confusion {
    fn of(scored: &[Scored<'_>]) -> Option<Self> {
        let mut counts: BTreeMap<Cause, BTreeMap<Cause, usize>> = BTreeMap::new();
        for (_, score) in scored {
            if let (Some(named), Some(cause)) = (score.named, score.true_causes.first()) {
                *counts.entry(*cause).or_default().entry(named).or_default() += 1;
            }
        }
        let mut named: Vec<_> = counts.values().flat_map(BTreeMap::keys).copied().collect();
        named.sort();
        named.dedup();
        let row = |(cause, of): (&Cause, &BTreeMap<Cause, usize>)| {
            let count = |named: &Cause| of.get(named).copied().unwrap_or(0);
            (*cause, named.iter().map(count).collect())
        };
        let rows: Vec<_> = counts.iter().map(row).collect();
        (!rows.is_empty()).then_some(Self { named, rows })
    }
}

impl GroupRow {
    fn of(name: &str, scored: &[Scored<'_>], shares: &mut ConsistentShares) -> Self {
        let scores = || scored.iter().map(|(_, score)| *score);
        let middle =
            |of: fn(&EstimatorScore) -> Option<f64>| median(scores().filter_map(of).collect());
        let over_vqf = |of: fn(&EstimatorScore) -> Option<f64>, same_zero: bool| {
            let ratio = |(world, score): &Scored<'_>| {
                let vqf = world.vqf(score.sensing)?;
                let comparable = !same_zero || vqf.has_north == score.has_north;
                comparable.then_some(of(score)? / of(vqf)?)
            };
            median(scored.iter().filter_map(ratio).collect())
        };
        let count = |of: fn(&EstimatorScore) -> bool| scores().filter(|score| of(score)).count();
        let judged: Vec<bool> = scores().filter_map(EstimatorScore::is_right).collect();
        let tilts: Vec<_> = scores().filter_map(|score| score.tilt).collect();
        let headings: Vec<_> = scores().filter_map(|score| score.heading).collect();
        let right = judged.iter().filter(|right| **right).count();
        let wrong = count(EstimatorScore::is_false_reason);
        let share = |count: usize| (!judged.is_empty()).then(|| count as f64 / judged.len() as f64);
        Self {
            group: name.to_owned(),
            worlds: scored.len(),
            without_estimate: count(|score| score.instants == 0),
            tilt_rms_deg: middle(|score| score.tilt_rms_deg),
            heading_rms_deg: middle(|score| score.heading_rms_deg),
            total_rms_deg: middle(|score| score.total_rms_deg),
            tilt_over_vqf: over_vqf(|score| score.tilt_rms_deg, false),
            heading_over_vqf: over_vqf(|score| score.heading_rms_deg, true),
            total_over_vqf: over_vqf(|score| score.total_rms_deg, true),
            tilt: StatedRow::of(2, &tilts, shares),
            heading: StatedRow::of(1, &headings, shares),
            green_beyond_five: count(EstimatorScore::is_green_beyond_five),
            blamed_inside_the_band: count(|score| score.blamed_inside_the_band),
            right_share: share(right),
            false_share: share(wrong),
        }
    }
}

impl StatedRow {
    fn of(freedom: u8, stated: &[StatedScore], shares: &mut ConsistentShares) -> Option<Self> {
        let of = |of: fn(&StatedScore) -> f64| median(stated.iter().map(of).collect());
        let share = |of: &dyn Fn(&&StatedScore) -> bool| {
            stated.iter().filter(of).count() as f64 / stated.len() as f64
        };
        let instants: usize = stated.iter().map(|s| s.instants).sum();
        let inside: f64 = stated.iter().map(|s| s.coverage * s.instants as f64).sum();
        let expected = |s: &StatedScore| shares.share(freedom, s.instants, s.correlation_time_s);
        let expected: f64 = stated.iter().map(expected).sum();
        Some(Self {
            worlds: stated.len(),
            pooled_coverage: inside / instants as f64,
            consistent_share: share(&|s| is_consistent(s.coverage)),
            expected_share: expected / stated.len() as f64,
            overconfident_share: share(&|s| s.coverage < CONSISTENT[0]),
            median_nees: of(|s| s.nees)?,
            median_correlation_time_s: of(|s| s.correlation_time_s)?,
        })
    }
}
