//! What came out over all worlds: a row a class, a row a feature, the worst.

use northing_simulation::navigation_world::{FaultKind, WorldClass};
use serde::Serialize;

use super::score::{Score, WorldOutcome};
use crate::scoring::{CONSISTENT, is_consistent, median};

/// Numbers over the worlds of a class, or over all.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ClassRow {
    /// Name of the class, or `all`.
    pub class: String,
    /// How many worlds.
    pub worlds: usize,
    /// Of these lost.
    pub lost: usize,
    /// Of these lost at instants at which an estimator could know its error.
    pub lost_knowably: usize,
    /// Lost beyond the ellipse, at such instants.
    pub beyond_the_ellipse: usize,
    /// Lost beyond extrapolation, at such instants.
    pub beyond_extrapolation: usize,
    /// Without any estimate.
    pub without_estimate: usize,
    /// Worse than extrapolation.
    pub worse: usize,
    /// Share of the worlds with coverage between 0.90 and 0.99, at instants that can be known.
    pub consistent_share: f64,
    /// Share below: overconfident.
    pub overconfident_share: f64,
    /// Median coverage, at all instants.
    pub median_coverage: Option<f64>,
    /// The same at instants that can be known.
    pub median_coverage_knowable: Option<f64>,
    /// Coverage over the instants of all worlds that can be known.
    pub pooled_coverage: Option<f64>,
    /// Share of the headings stated within 8 deg whose error is within three standard deviations, over the instants of all worlds.
    pub heading_inside_share: Option<f64>,
    /// Worlds whose heading was ever stated within 8 deg.
    pub heading_stated: usize,
    /// Median time from the first fix until then, over those, s.
    pub median_heading_after_s: Option<f64>,
    /// Median of the root mean square over extrapolation's.
    pub median_ratio: Option<f64>,
    /// The same while fixes are missing, over the worlds in which they are.
    pub median_outage_ratio: Option<f64>,
}

/// The same for what worlds have in common.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FeatureRow {
    /// What they have.
    pub feature: String,
    /// How many worlds.
    pub worlds: usize,
    /// Of these lost.
    pub lost: usize,
    /// Of these lost at instants that can be known.
    pub lost_knowably: usize,
    /// Worse than extrapolation.
    pub worse: usize,
    /// Share of the worlds with coverage between 0.90 and 0.99, at instants that can be known.
    pub consistent_share: f64,
}

/// What came out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct WorldsOutcome {
    /// Seed of the worlds.
    pub seed: u64,
    /// A row a class.
    pub classes: Vec<ClassRow>,
    /// All of them.
    pub total: ClassRow,
    /// By what worlds have in common.
    pub features: Vec<FeatureRow>,
    /// Numbers of the worst worlds, the worst first.
    pub worst: Vec<u64>,
    /// Every world, by number.
    pub worlds: Vec<WorldOutcome>,
}

/// A question that a world answers with yes or no.
type Question = (&'static str, fn(&WorldOutcome) -> bool);

/// What worlds are told apart by.
const FEATURES: [Question; 21] = [
    ("moving at the first sample", |w| {
        w.description.first_speed_m_s > 0.5
    }),
    ("any mount", |w| w.description.inertial.any_mount),
    ("vibration above 1 m/s^2", |w| {
        w.description.inertial.vibration_m_s2 > 1.0
    }),
    ("bias jumps", |w| {
        !w.description.inertial.bias_jumps.is_empty()
    }),
    ("saturation", |w| {
        w.description.inertial.saturation.is_some()
    }),
    ("receiver below 0.1 m", |w| {
        w.description.receiver.position_std_m < 0.1
    }),
    ("receiver 0.1 to 1 m", |w| {
        (0.1..1.0).contains(&w.description.receiver.position_std_m)
    }),
    ("receiver above 1 m", |w| {
        w.description.receiver.position_std_m >= 1.0
    }),
    ("stated below a half", |w| {
        w.description.receiver.position_stated < 0.5
    }),
    ("stated above twice", |w| {
        w.description.receiver.position_stated > 2.0
    }),
    ("with velocity", |w| {
        w.description.receiver.velocity_std_m_s.is_some()
    }),
    ("without velocity", |w| {
        w.description.receiver.velocity_std_m_s.is_none()
    }),
    ("latency above 0.1 s", |w| {
        w.description.receiver.latency_s > 0.1
    }),
    ("lever arm above 0.3 m", |w| arm(w) > 0.3),
    ("fixes slower than 1 Hz", |w| {
        w.description.receiver.rate_hz < 1.0
    }),
    ("outliers", |w| has(w, FaultKind::Outlier)),
    ("drift", |w| has(w, FaultKind::Drift)),
    ("frozen", |w| has(w, FaultKind::Frozen)),
    ("outages", |w| has(w, FaultKind::Outage)),
    ("stale first fix", |w| has(w, FaultKind::Stale)),
    ("no fault of the receiver", |w| {
        w.description.receiver.faults.is_empty()
    }),
];

fn has(world: &WorldOutcome, kind: FaultKind) -> bool {
    world
        .description
        .receiver
        .faults
        .iter()
        .any(|fault| fault.kind == kind)
}

fn arm(world: &WorldOutcome) -> f64 {
    let arm = world.description.receiver.lever_arm_m;
    arm.iter().map(|v| v * v).sum::<f64>().sqrt()
}

impl WorldsOutcome {
    /// What these worlds say together.
    #[must_use]
    pub fn of(seed: u64, worlds: Vec<WorldOutcome>) -> Self {
        let class_row = |class: &WorldClass| {
            let of_class = worlds.iter().filter(|w| w.description.class == *class);
            ClassRow::of(class.name(), &of_class.collect::<Vec<_>>())
        };
        let feature_row = |(feature, asked): &Question| {
            let having: Vec<_> = worlds.iter().filter(|w| asked(w)).collect();
            let row = ClassRow::of(feature, &having);
            FeatureRow {
                feature: row.class,
                worlds: row.worlds,
                lost: row.lost,
                lost_knowably: row.lost_knowably,
                worse: row.worse,
                consistent_share: row.consistent_share,
            }
        };
        let mut by_badness: Vec<_> = worlds.iter().collect();
        by_badness.sort_by(|a, b| b.badness().total_cmp(&a.badness()));
        let worst = by_badness.iter().map(|w| w.description.number);
        Self {
            seed,
            classes: WorldClass::ALL
                .iter()
                .map(class_row)
                .filter(|row| row.worlds > 0)
                .collect(),
            total: ClassRow::of("all", &worlds.iter().collect::<Vec<_>>()),
            features: FEATURES
                .iter()
                .map(feature_row)
                .filter(|row| row.worlds > 0)
                .collect(),
            worst: worst.take(10).collect(),
            worlds,
        }
    }

    /// Numbers of the worlds that are lost at instants at which an estimator could know its error.
    pub fn lost_knowably(&self) -> impl Iterator<Item = u64> {
        let lost = self.worlds.iter().filter(|w| w.is_lost_knowably());
        lost.map(|w| w.description.number)
    }

    /// The worst worlds, the worst first.
    pub fn worst_worlds(&self) -> impl Iterator<Item = &WorldOutcome> {
        let find = |number: &u64| self.worlds.iter().find(|w| w.description.number == *number);
        self.worst.iter().filter_map(find)
    }
}

impl ClassRow {
    fn of(name: &str, worlds: &[&WorldOutcome]) -> Self {
        let count =
            |asked: &dyn Fn(&WorldOutcome) -> bool| worlds.iter().filter(|w| asked(w)).count();
        let share = |n: usize, of: usize| n as f64 / of.max(1) as f64;
        let coverages =
            |of: fn(&WorldOutcome) -> &Score| worlds.iter().filter_map(move |w| of(w).coverage);
        let knowable: Vec<f64> = coverages(|w| &w.can_be_known).collect();
        let consistent = knowable.iter().filter(|c| is_consistent(**c)).count();
        let overconfident = knowable.iter().filter(|c| **c < CONSISTENT[0]).count();
        let inside = |w: &&WorldOutcome| {
            let score = &w.can_be_known;
            score.coverage.unwrap_or(0.0) * score.instants as f64
        };
        let instants: usize = worlds.iter().map(|w| w.can_be_known.instants).sum();
        let stated: usize = worlds.iter().map(|w| w.all.heading_instants).sum();
        let sound: usize = worlds.iter().map(|w| w.all.heading_inside).sum();
        let after: Vec<f64> = worlds.iter().filter_map(|w| w.heading_after_s).collect();
        Self {
            class: name.to_owned(),
            worlds: worlds.len(),
            lost: count(&|w| w.is_lost()),
            lost_knowably: count(&|w| w.is_lost_knowably()),
            beyond_the_ellipse: count(&|w| w.can_be_known.beyond_the_ellipse),
            beyond_extrapolation: count(&|w| w.can_be_known.beyond_extrapolation),
            without_estimate: count(&|w| w.first_estimate_s.is_none()),
            worse: count(&|w| w.all.worse),
            consistent_share: share(consistent, worlds.len()),
            overconfident_share: share(overconfident, worlds.len()),
            median_coverage: median(coverages(|w| &w.all).collect()),
            median_coverage_knowable: median(knowable),
            pooled_coverage: (instants > 0)
                .then(|| worlds.iter().map(inside).sum::<f64>() / instants as f64),
            heading_inside_share: (stated > 0).then(|| share(sound, stated)),
            heading_stated: after.len(),
            median_heading_after_s: median(after),
            median_ratio: median(worlds.iter().filter_map(|w| w.all.ratio).collect()),
            median_outage_ratio: median(worlds.iter().filter_map(|w| w.outage_ratio).collect()),
        }
    }
}
