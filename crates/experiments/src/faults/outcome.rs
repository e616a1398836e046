//! What came out of a campaign: a row a fault, estimator and origin of the streams, and the worst runs.

use std::collections::BTreeSet;

use northing_evaluation::registry::Question;
use northing_simulation::fault_injection::CATALOGUE;
use serde::Serialize;

use super::judge::Judgement;
use super::stream::Origin;
use super::{MOST_NEES, RECOVERY_S, Subject};

/// So many of the worst runs are listed.
const WORST: usize = 8;
/// Tables, in their order.
const PARTS: [(Question, Origin, &str); 4] = [
    (
        Question::Attitude,
        Origin::Simulated,
        "attitude, simulated worlds",
    ),
    (Question::Attitude, Origin::Recorded, "attitude, recordings"),
    (
        Question::Navigation,
        Origin::Simulated,
        "navigation, simulated worlds",
    ),
    (
        Question::Navigation,
        Origin::Recorded,
        "navigation, recordings",
    ),
];

/// One fault and one estimator over all streams of an origin.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FaultRow {
    /// The fault.
    pub fault: &'static str,
    /// The estimator.
    pub estimator: &'static str,
    /// What it estimates.
    pub question: Question,
    /// Where the streams come from.
    pub origin: Origin,
    /// How many.
    pub runs: usize,
    /// Median of the clean root mean square, deg or m.
    pub clean_rms: Option<f64>,
    /// Median of the root mean square over the clean one.
    pub cost: Option<f64>,
    /// Its 95th percentile.
    pub cost_95: Option<f64>,
    /// Median of the largest error in the minute after, deg or m.
    pub largest: Option<f64>,
    /// Median time until recovery, s; `None`: half of the runs or more do not recover within the minute.
    pub recovery_s: Option<f64>,
    /// Share of the runs that recover within ten seconds.
    pub recovered_share: f64,
    /// Mean over runs of the mean NEES per degree of freedom in the minute from ten seconds after the fault on.
    pub nees: Option<f64>,
    /// Share of the runs that state a covariance in which that is below 3.
    pub nees_share: Option<f64>,
    /// The same without the fault.
    pub clean_nees_share: Option<f64>,
    /// Share of the runs in which it is found, of the right sensor and within ten seconds; `None` where nobody looks for faults.
    pub detected_share: Option<f64>,
    /// Share of the runs that meet the limits.
    pub meets_share: f64,
}

/// False alarms of an estimator on clean data.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AlarmRow {
    /// The estimator.
    pub estimator: &'static str,
    /// Where the streams come from.
    pub origin: Origin,
    /// Clean data, hours.
    pub hours: f64,
    /// Faults that were found in them.
    pub alarms: usize,
    /// The one over the other.
    pub per_hour: f64,
}

/// Rows of one question and origin, at least one.
#[derive(Debug, Clone, PartialEq)]
pub struct Part<'a> {
    /// What is estimated, and on which streams: `attitude, recordings`.
    pub title: &'static str,
    /// A row a fault and estimator, in the order of the outcome.
    pub rows: Vec<&'a FaultRow>,
}

impl<'a> Part<'a> {
    /// Names of the estimators, the default first.
    #[must_use]
    pub fn estimators(&self) -> Vec<&'static str> {
        let mut names = Vec::new();
        for row in &self.rows {
            if !names.contains(&row.estimator) {
                names.push(row.estimator);
            }
        }
        names
    }

    /// Names of the faults, in the order of the catalogue.
    pub fn faults(&self) -> impl Iterator<Item = &'static str> + use<'_> {
        let names = CATALOGUE.iter().map(|fault| fault.name);
        names.filter(|name| self.rows.iter().any(|row| row.fault == *name))
    }

    /// The row of a fault and an estimator.
    #[must_use]
    pub fn row(&self, fault: &str, estimator: &str) -> Option<&'a FaultRow> {
        let is_it = |row: &&&FaultRow| row.fault == fault && row.estimator == estimator;
        self.rows.iter().find(is_it).copied()
    }

    /// The default estimator, or the first of those that were asked for, and its rows.
    #[must_use]
    pub fn of_default(&self) -> (&'static str, Vec<&'a FaultRow>) {
        let name = self.rows.first().map_or("", |row| row.estimator);
        let of = self.rows.iter().filter(|row| row.estimator == name);
        (name, of.copied().collect())
    }
}

/// What came out.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CampaignOutcome {
    /// Seed of the campaign.
    pub seed: u64,
    /// A row a fault and estimator: the faults in the order of the catalogue, of each the estimators.
    pub rows: Vec<FaultRow>,
    /// False alarms, a row an estimator that looks for faults.
    pub alarms: Vec<AlarmRow>,
    /// The runs of the default estimators that miss the limits by most, one a fault at most.
    pub worst: Vec<Judgement>,
    /// Every run.
    pub runs: Vec<Judgement>,
}

impl CampaignOutcome {
    /// What these runs say together.
    #[must_use]
    pub fn of(seed: u64, runs: Vec<Judgement>) -> Self {
        let mut rows = Vec::new();
        for (question, origin, _) in PARTS {
            for fault in &CATALOGUE {
                for subject in Subject::every() {
                    let of = |run: &&Judgement| {
                        run.question == question
                            && run.origin == origin
                            && run.fault == fault.name
                            && run.estimator == subject.name()
                    };
                    let of_row: Vec<_> = runs.iter().filter(of).collect();
                    rows.extend(FaultRow::of(&of_row));
                }
            }
        }
        Self {
            seed,
            worst: worst(&runs),
            alarms: alarms(&runs),
            rows,
            runs,
        }
    }

    /// The tables: rows of each question and origin that has any.
    #[must_use]
    pub fn parts(&self) -> Vec<Part<'_>> {
        let part = |(question, origin, title)| Part {
            title,
            rows: self.table(question, origin).collect(),
        };
        let parts = PARTS.into_iter().map(part);
        parts.filter(|part| !part.rows.is_empty()).collect()
    }

    /// Rows of one question and origin.
    pub fn table(&self, question: Question, origin: Origin) -> impl Iterator<Item = &FaultRow> {
        let of = move |row: &&FaultRow| row.question == question && row.origin == origin;
        self.rows.iter().filter(of)
    }

    /// The row of a fault and an estimator.
    #[must_use]
    pub fn row(&self, fault: &str, estimator: &str, origin: Origin) -> Option<&FaultRow> {
        let mut rows = self.rows.iter();
        rows.find(|row| row.fault == fault && row.estimator == estimator && row.origin == origin)
    }
}

impl FaultRow {
    fn of(runs: &[&Judgement]) -> Option<Self> {
        let first = runs.first()?;
        let of = |value: fn(&Judgement) -> Option<f64>| -> Vec<f64> {
            runs.iter().filter_map(|run| value(run)).collect()
        };
        let share = |of: &dyn Fn(&Judgement) -> bool| {
            runs.iter().filter(|run| of(run)).count() as f64 / runs.len() as f64
        };
        let below = |nees: &[f64]| {
            let sound = nees.iter().filter(|nees| **nees < MOST_NEES).count();
            (!nees.is_empty()).then(|| sound as f64 / nees.len() as f64)
        };
        let nees = of(|run| run.nees);
        let recovery = of(|run| Some(run.recovery_s.unwrap_or(f64::INFINITY)));
        Some(Self {
            fault: first.fault,
            estimator: first.estimator,
            question: first.question,
            origin: first.origin,
            runs: runs.len(),
            clean_rms: quantile(of(|run| run.clean_rms), 0.5),
            cost: quantile(of(|run| run.cost), 0.5),
            cost_95: quantile(of(|run| run.cost), 0.95),
            largest: quantile(of(|run| run.largest), 0.5),
            recovery_s: quantile(recovery, 0.5),
            recovered_share: share(&|run| run.recovery_s.is_some_and(|time| time <= RECOVERY_S)),
            nees: (!nees.is_empty()).then(|| nees.iter().sum::<f64>() / nees.len() as f64),
            nees_share: below(&nees),
            clean_nees_share: below(&of(|run| run.clean_nees)),
            detected_share: detected_share(runs),
            meets_share: share(&|run| run.meets),
        })
    }
}

fn detected_share(runs: &[&Judgement]) -> Option<f64> {
    let looked: Vec<bool> = runs.iter().filter_map(|run| run.detected).collect();
    let found = looked.iter().filter(|found| **found).count();
    (!looked.is_empty()).then(|| found as f64 / looked.len() as f64)
}

/// False alarms: each clean run counts once, whatever faults were laid over its stream.
fn alarms(runs: &[Judgement]) -> Vec<AlarmRow> {
    let mut rows: Vec<AlarmRow> = Vec::new();
    let mut seen = BTreeSet::new();
    for run in runs {
        let Some(alarms) = run.clean_alarms else {
            continue;
        };
        if !seen.insert((run.estimator, run.origin, &run.stream)) {
            continue;
        }
        let is_row =
            |row: &&mut AlarmRow| row.estimator == run.estimator && row.origin == run.origin;
        let hours = run.clean_s / 3600.0;
        if let Some(row) = rows.iter_mut().find(is_row) {
            row.hours += hours;
            row.alarms += alarms;
        } else {
            rows.push(AlarmRow {
                estimator: run.estimator,
                origin: run.origin,
                hours,
                alarms,
                per_hour: 0.0,
            });
        }
    }
    for row in &mut rows {
        row.per_hour = row.alarms as f64 / row.hours.max(1e-9);
    }
    rows
}

/// The value below which this share of values lies, by the nearest rank; `None` where that is no number.
fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let rank = (share * values.len() as f64).ceil().max(1.0) as usize;
    values
        .get(rank - 1)
        .copied()
        .filter(|value| value.is_finite())
}

/// Runs of the first estimator of each question that miss the limits, the largest cost first, of each fault one.
fn worst(runs: &[Judgement]) -> Vec<Judgement> {
    let mut missed: Vec<&Judgement> = Vec::new();
    for question in [Question::Attitude, Question::Navigation] {
        let of_question = runs
            .iter()
            .filter(|run| run.question == question)
            .peekable();
        let first = Subject::every()
            .into_iter()
            .map(Subject::name)
            .find(|name| of_question.clone().any(|run| run.estimator == *name));
        missed.extend(of_question.filter(|run| Some(run.estimator) == first && !run.meets));
    }
    let badness = |run: &Judgement| run.cost.unwrap_or(f64::INFINITY);
    missed.sort_by(|a, b| badness(b).total_cmp(&badness(a)));
    let mut kept: Vec<Judgement> = Vec::new();
    for run in missed {
        let has = |other: &Judgement| other.fault == run.fault && other.question == run.question;
        if kept.len() < WORST && !kept.iter().any(has) {
            kept.push(run.clone());
        }
    }
    kept
}
