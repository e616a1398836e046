//! What the rows of a study say together: exact sums of each score, by estimator and by value of each parameter.

use serde::{Serialize, Serializer};
use serde_json::Value as Json;

use super::grid::Design;
use super::key::Plan;
use super::part::Row;
use crate::exact_sum::ExactSum;

/// Sums of one score over runs, the same in whatever order they are added.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct ScoreSum {
    count: u64,
    sum: ExactSum,
    squares: ExactSum,
    least: Least,
    greatest: Least,
}

/// The smallest of some numbers, in the order of their bits; `None` before the first.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Least(Option<u64>);

impl Least {
    fn add(&mut self, value: f64) {
        let smaller = self
            .value()
            .is_none_or(|least| value.total_cmp(&least).is_lt());
        if smaller {
            self.0 = Some(value.to_bits());
        }
    }

    fn value(self) -> Option<f64> {
        self.0.map(f64::from_bits)
    }
}

impl ScoreSum {
    fn add(&mut self, score: f64) {
        if score.is_nan() {
            return;
        }
        self.count += 1;
        self.sum.add(score);
        self.squares.add(score * score);
        self.least.add(score);
        self.greatest.add(-score);
    }

    fn outcome(&self) -> ScoreOutcome {
        let finite = |value: f64| value.is_finite().then_some(value);
        let mean = finite(self.sum.mean(self.count));
        let square = finite(self.squares.mean(self.count));
        let freedom = self.count as f64 / self.count.saturating_sub(1).max(1) as f64;
        ScoreOutcome {
            count: self.count,
            infinite: self.sum.not_finite,
            mean,
            std: mean
                .zip(square)
                .filter(|_| self.count > 1)
                .map(|(mean, square)| ((square - mean * mean).max(0.0) * freedom).sqrt()),
            least: self.least.value().and_then(finite),
            greatest: self.greatest.value().map(|value| -value).and_then(finite),
            sum_units: self.sum.units.to_string(),
            squares_units: self.squares.units.to_string(),
        }
    }
}

/// Sums of the runs of one estimator, or of those of them with one value of a parameter.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
struct GroupSums {
    runs: u64,
    failed: u64,
    scores: Vec<ScoreSum>,
}

impl GroupSums {
    fn new(scores: usize) -> Self {
        Self {
            scores: vec![ScoreSum::default(); scores],
            ..Self::default()
        }
    }

    fn add(&mut self, row: &Row) {
        self.runs += 1;
        self.failed += u64::from(!row.error.is_empty());
        for (sum, score) in self.scores.iter_mut().zip(&row.scores) {
            sum.add(*score);
        }
    }
}

/// A parameter of a grid has at most so many values for each to have sums of its own.
const MOST_LEVELS: u64 = 1000;

/// All sums of a study or of a part of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StudySums {
    /// By estimator.
    estimators: Vec<GroupSums>,
    /// By estimator, parameter of the grid, and value.
    levels: Vec<Vec<Vec<GroupSums>>>,
    /// The failed run with the lowest number, and why.
    first_error: Option<(u64, String)>,
}

impl StudySums {
    /// Of no runs yet.
    #[must_use]
    pub fn new(plan: &Plan) -> Self {
        let key = plan.key();
        let scores = key.scores().len();
        let counts: Vec<u64> = match &key.design {
            Design::Grid(axes) => axes.iter().map(|axis| axis.values.count()).collect(),
            Design::LatinHypercube { .. } => Vec::new(),
        };
        let of_axis = |count: &u64| match *count <= MOST_LEVELS {
            true => vec![GroupSums::new(scores); *count as usize],
            false => Vec::new(),
        };
        let of_axes: Vec<Vec<GroupSums>> = counts.iter().map(of_axis).collect();
        Self {
            estimators: vec![GroupSums::new(scores); key.estimators.len()],
            levels: vec![of_axes; key.estimators.len()],
            first_error: None,
        }
    }

    /// Takes a row.
    pub fn add(&mut self, plan: &Plan, row: &Row) {
        let place = plan.place(row.run);
        if let Some(sums) = self.estimators.get_mut(place.estimator) {
            sums.add(row);
        }
        let levels = plan.points().levels(place.point);
        let axes = self.levels.get_mut(place.estimator).into_iter().flatten();
        for (sums, level) in axes.zip(levels) {
            if let Some(sums) = sums.get_mut(level as usize) {
                sums.add(row);
            }
        }
        let is_first = (self.first_error.as_ref()).is_none_or(|(run, _)| row.run < *run);
        if !row.error.is_empty() && is_first {
            self.first_error = Some((row.run, row.error.clone()));
        }
    }

    /// Runs in it.
    #[must_use]
    pub fn runs(&self) -> u64 {
        self.estimators.iter().map(|sums| sums.runs).sum()
    }
}

/// One score over runs; what does not apply is null.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScoreOutcome {
    /// Runs that have it.
    pub count: u64,
    /// Of these, runs in which it is infinite; there is no mean then.
    pub infinite: u64,
    /// Mean.
    pub mean: Option<f64>,
    /// Standard deviation from run to run.
    pub std: Option<f64>,
    /// The smallest.
    pub least: Option<f64>,
    /// The largest.
    pub greatest: Option<f64>,
    /// The sum in units of 2^-40, exact.
    pub sum_units: String,
    /// The same of the squares.
    pub squares_units: String,
}

/// Scores by name, in the order of the table.
type Scores = Vec<(&'static str, ScoreOutcome)>;

fn as_map<S: Serializer>(scores: &Scores, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_map(scores.iter().map(|(name, score)| (name, score)))
}

/// Runs of an estimator with one value of a parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LevelOutcome {
    /// The parameter.
    pub parameter: String,
    /// Its value.
    pub value: Json,
    /// Runs.
    pub runs: u64,
    /// Of these without scores.
    pub failed: u64,
    /// By name.
    #[serde(serialize_with = "as_map")]
    pub scores: Scores,
}

/// One estimator over its runs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct EstimatorOutcome {
    /// Its name.
    pub estimator: String,
    /// Runs.
    pub runs: u64,
    /// Of these without scores.
    pub failed: u64,
    /// By name.
    #[serde(serialize_with = "as_map")]
    pub scores: Scores,
    /// By value of each parameter of a grid.
    pub levels: Vec<LevelOutcome>,
}

/// What `study --json` prints.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StudyOutcome {
    /// Name of the study.
    pub study: String,
    /// Program and version.
    pub program: String,
    /// What was estimated.
    pub question: &'static str,
    /// SHA-256 of the study: its file, data and version.
    pub study_sha256: String,
    /// Runs of the whole study.
    pub runs: u64,
    /// Runs that these rows are of.
    pub runs_held: u64,
    /// SHA-256 of the study and of these rows in the order of their numbers.
    pub hash: String,
    /// The first run that has no scores, and why; null without any.
    pub first_error: Option<String>,
    /// By estimator.
    pub estimators: Vec<EstimatorOutcome>,
}

impl StudyOutcome {
    /// What sums say.
    #[must_use]
    pub fn of(plan: &Plan, sums: &StudySums, hash: String) -> Self {
        let key = plan.key();
        let scores = |group: &GroupSums| -> Scores {
            let each = key.scores().iter().zip(&group.scores);
            each.map(|(name, sum)| (*name, sum.outcome())).collect()
        };
        let estimator = |place: usize, name: &String| {
            let sums_of = &sums.estimators[place];
            EstimatorOutcome {
                estimator: name.clone(),
                runs: sums_of.runs,
                failed: sums_of.failed,
                scores: scores(sums_of),
                levels: levels(plan, &sums.levels[place], &scores),
            }
        };
        let names = key.estimators.iter().enumerate();
        Self {
            study: key.name.clone(),
            program: key.program.clone(),
            question: key.question.name(),
            study_sha256: key.sha256(),
            runs: plan.runs(),
            runs_held: sums.runs(),
            hash,
            first_error: (sums.first_error.as_ref()).map(|(run, why)| format!("run {run}: {why}")),
            estimators: names.map(|(place, name)| estimator(place, name)).collect(),
        }
    }
}

fn levels(
    plan: &Plan,
    sums: &[Vec<GroupSums>],
    scores: &dyn Fn(&GroupSums) -> Scores,
) -> Vec<LevelOutcome> {
    let Design::Grid(axes) = &plan.key().design else {
        return Vec::new();
    };
    let each = axes.iter().zip(sums).flat_map(|(axis, levels)| {
        let groups = levels.iter().enumerate();
        groups.map(move |(level, group)| LevelOutcome {
            parameter: axis.parameter.clone(),
            value: axis.values.value(level as u64),
            runs: group.runs,
            failed: group.failed,
            scores: scores(group),
        })
    });
    each.collect()
}

#[cfg(test)]
mod tests {
    use super::super::file::StudyFile;
    use super::super::key::{Sources, StudyKey};
    use super::*;

    #[test]
    fn sums_do_not_depend_on_the_order_of_rows_and_say_what_a_table_would() {
        let text = "question = 'attitude'\nestimators = ['mekf']\nseeds = { first = 1, count = 50 }\n\
                    [sources.worlds]\ncount = 1\n[grid]\naccelerometer_std = [1, 2]\n";
        let file = StudyFile::parse("s.toml", text).unwrap();
        let worlds = super::super::file::WorldsTable {
            first: 0,
            count: 1,
            motion: None,
            class: None,
        };
        let plan = Plan::of(StudyKey::of(&file, Sources::Worlds(worlds))).unwrap();
        let score = |run: u64| (run as f64 * 1.7).sin() + 3.0;
        let rows: Vec<Row> = (0..100)
            .map(|run| {
                let mut scores = vec![f64::NAN; plan.key().scores().len()];
                scores[0] = score(run);
                let error = if run == 60 || run == 61 { "why" } else { "" };
                Row {
                    run,
                    scores,
                    parameters_sha256: String::new(),
                    error: error.to_owned(),
                }
            })
            .collect();
        let sums = |rows: &mut dyn Iterator<Item = &Row>| {
            let mut sums = StudySums::new(&plan);
            rows.for_each(|row| sums.add(&plan, row));
            sums
        };
        let forward = sums(&mut rows.iter());
        assert_eq!(forward, sums(&mut rows.iter().rev()));
        let outcome = StudyOutcome::of(&plan, &forward, String::new());
        assert_eq!((outcome.runs_held, outcome.estimators[0].failed), (100, 2));
        assert_eq!(outcome.first_error.as_deref(), Some("run 60: why"));
        let scores: Vec<f64> = (0..100).map(score).collect();
        let (name, found) = &outcome.estimators[0].scores[0];
        let mean = scores.iter().sum::<f64>() / 100.0;
        let square: f64 = scores.iter().map(|score| (score - mean).powi(2)).sum();
        assert_eq!((*name, found.count), ("total_rmse_deg", 100));
        assert!((found.mean.unwrap() - mean).abs() < 1e-9);
        assert!((found.std.unwrap() - (square / 99.0).sqrt()).abs() < 1e-9);
        let least = scores.iter().copied().fold(f64::INFINITY, f64::min);
        assert_eq!(found.least.map(f64::to_bits), Some(least.to_bits()));
        // What no run has is counted as none.
        assert_eq!(outcome.estimators[0].scores[1].1.count, 0);
        // Points alternate: the second value has the odd runs.
        let odd = scores.iter().skip(1).step_by(2).sum::<f64>() / 50.0;
        let level = &outcome.estimators[0].levels[1];
        assert_eq!((level.runs, &level.value), (50, &Json::from(2)));
        assert!((level.scores[0].1.mean.unwrap() - odd).abs() < 1e-9);
    }
}
