//! The outcome of a comparison as the data of its HTML report.

use std::path::Path;

use crate::attitude::comparison::{ComparedRun, ComparisonReport, Distribution};
use crate::attitude::from_summary::removed_offset;
use crate::page::facts::Fact;
use crate::page::table::{Best, Cell, Column, Table};
use northing_evaluation::UsedParameter;
use northing_evaluation::attitude::compare::{
    self, Compared, MeanMedian, Score, TableRow, distinct, statistics, totals,
};
use northing_evaluation::attitude::{EstimatorKind, RunSummary, TraceObserver};

/// A run with what its plots need, where they are wanted.
pub type Run = Compared<Option<TraceObserver>>;

/// Heading of the page of a comparison.
pub const TITLE: &str = "Comparison of estimators";

/// The page of a comparison: the runs, and the scores of these and of others' estimators.
#[must_use]
pub fn render(title: &str, runs: &[Run], scores: &[Score], command: String) -> String {
    let summaries: Vec<&RunSummary> = runs
        .iter()
        .filter_map(|run| run.outcome.as_ref().ok())
        .collect();
    let mut recordings: Vec<&str> = summaries.iter().map(|s| s.recording.as_str()).collect();
    recordings.dedup();
    let mut estimators: Vec<EstimatorKind> = Vec::new();
    for run in runs {
        if !estimators.contains(&run.estimator) {
            estimators.push(run.estimator);
        }
    }
    let over = match recordings[..] {
        [one] => one.to_owned(),
        _ => format!("{} recordings", recordings.len()),
    };
    let rows = statistics(scores);
    let tables = match recordings.len() {
        // Of others' estimators there is less to tell: they have a place in the table of many only.
        1 if scores.len() == runs.len() => vec![estimators_table(&summaries)],
        _ => vec![statistics_table(&rows), recordings_table(scores)],
    };
    ComparisonReport {
        title: title.to_owned(),
        recording: over,
        command: Some(command),
        summary: best(&rows, recordings.len()),
        tables,
        distributions: distributions(scores, recordings.len()),
        runs: runs.iter().filter_map(drawn).collect(),
        issues: arbitrary_headings(&summaries)
            .into_iter()
            .chain(issues(&summaries))
            .collect(),
        settings: estimators
            .iter()
            .map(|estimator| (estimator.to_string(), settings(*estimator, &summaries)))
            .filter(|(_, settings)| !settings.is_empty())
            .collect(),
        ..ComparisonReport::default()
    }
    .render()
}

/// The parameters that an estimator ran with; of numbers that differ between recordings, the range.
fn settings(estimator: EstimatorKind, summaries: &[&RunSummary]) -> Vec<UsedParameter> {
    let runs = summaries.iter().filter(|run| run.estimator == estimator);
    let runs: Vec<_> = runs.map(|run| &run.parameters).collect();
    let mut settings = runs.first().map_or_else(Vec::new, |first| first.to_vec());
    for used in &mut settings {
        let same = runs.iter().flat_map(|run| run.iter());
        let same = same.filter(|other| other.name == used.name);
        let Some(other) = same.clone().find(|other| other.value != used.value) else {
            continue;
        };
        let numbers = same.filter_map(|other| other.value.as_f64());
        let range = [f64::INFINITY, f64::NEG_INFINITY];
        let [least, most] = numbers.fold(range, |[a, b], x| [a.min(x), b.max(x)]);
        used.origin = other.origin;
        used.value = format!("{least} to {most}").into();
    }
    settings
}

fn drawn(run: &Run) -> Option<ComparedRun<'_>> {
    let trace = run.observer.as_ref()?.as_ref()?.trace();
    Some(ComparedRun {
        name: run.estimator.name(),
        trace,
        heading_offset_deg: run.outcome.as_ref().ok().and_then(removed_offset),
    })
}

/// The estimator with the lowest median of each part of the table.
fn best(rows: &[TableRow], recordings: usize) -> Vec<Fact> {
    let mut folders: Vec<Option<&String>> = rows.iter().map(|row| row.folder.as_ref()).collect();
    folders.dedup();
    let best = folders.into_iter().filter_map(|folder| {
        let of = rows.iter().filter(|row| row.folder.as_ref() == folder);
        let scored = of.filter_map(|row| Some((&row.estimator, row.total_deg?.median)));
        let (estimator, median) = scored.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let label = match folder {
            _ if recordings == 1 => "lowest error".to_owned(),
            Some(folder) => format!("lowest median error, {folder}"),
            None => "lowest median error, all recordings".to_owned(),
        };
        Some(Fact::new(label, format!("{estimator}: {median:.2} deg")))
    });
    best.collect()
}

fn statistics_table(rows: &[TableRow]) -> Table {
    let both = |value: Option<MeanMedian>| match value {
        Some(v) => Cell::Text(format!("{:.2} / {:.2}", v.mean, v.median)),
        None => Cell::Missing,
    };
    let column = |name: &str, unit: &str| Column::new(name, unit, None);
    Table {
        title: "Mean / median".to_owned(),
        caption: "RMS error of each recording, its mean and its median over the recordings of a \
                  folder. NEES per degree of freedom is 1 when the stated uncertainty is consistent."
            .to_owned(),
        columns: vec![
            column("folder", ""),
            column("estimator", ""),
            column("recordings", ""),
            column("total", "deg"),
            column("heading", "deg"),
            column("inclination", "deg"),
            column("NEES, median", ""),
        ],
        rows: rows
            .iter()
            .map(|row| {
                vec![
                    Cell::text(row.folder.as_deref().unwrap_or("all")),
                    Cell::text(row.estimator.as_str()),
                    Cell::number(Some(row.scored_recordings as f64), 0),
                    both(row.total_deg),
                    both(row.heading_deg),
                    both(row.inclination_deg),
                    Cell::number(row.nees.map(|nees| nees.median), 2),
                ]
            })
            .collect(),
    }
}

/// Total error, a row for each recording and a column for each estimator.
fn recordings_table(scores: &[Score]) -> Table {
    let best = Some(Best::LowestOfRow);
    let estimators = distinct(scores, |score| &score.estimator);
    let mut columns = vec![Column::new("recording", "", None)];
    columns.extend(
        estimators
            .iter()
            .map(|estimator| Column::new(estimator.as_str(), "deg", best)),
    );
    let row = |recording: &String| {
        let name = Path::new(recording).file_stem().unwrap_or_default();
        let errors = totals(scores, recording, &estimators).into_iter();
        std::iter::once(Cell::Text(name.to_string_lossy().into_owned()))
            .chain(errors.map(|error| Cell::number(error, 2)))
            .collect()
    };
    let recordings = distinct(scores, |score| &score.recording);
    Table {
        title: "Each recording".to_owned(),
        caption: "RMS of the total error.".to_owned(),
        columns,
        rows: recordings.into_iter().map(row).collect(),
    }
}

/// Everything about each estimator on one recording.
fn estimators_table(summaries: &[&RunSummary]) -> Table {
    let column = |name: &str, best| Column::new(name, "deg", best);
    let lowest = Some(Best::Lowest);
    Table {
        title: "Each estimator".to_owned(),
        caption: "RMS errors against the reference. NEES per degree of freedom is 1 when the \
                  stated uncertainty is consistent. In the final test the device is back where it began: \
                  how far the estimate is from there, and how far the filter expects it to be."
            .to_owned(),
        columns: vec![
            Column::new("estimator", "", None),
            column("total", lowest),
            column("heading", lowest),
            column("inclination", lowest),
            Column::new("NEES", "", Some(Best::Nearest(1.0))),
            column("final test", None),
            column("expected", None),
        ],
        rows: summaries.iter().map(|summary| estimator_cells(summary)).collect(),
    }
}

fn estimator_cells(summary: &RunSummary) -> Vec<Cell> {
    let error = summary.error_deg;
    let test = summary.final_test.as_ref();
    vec![
        Cell::text(summary.estimator.name()),
        Cell::number(error.map(|e| e.total_rmse), 2),
        Cell::number(error.map(|e| e.heading_rmse), 2),
        Cell::number(error.map(|e| e.inclination_rmse), 2),
        Cell::number(summary.nees_mean, 2),
        Cell::number(test.map(|t| t.judged_deg().0), 2),
        Cell::number(test.and_then(|t| t.judged_deg().1), 2),
    ]
}

fn distributions(scores: &[Score], recordings: usize) -> Vec<Distribution> {
    if recordings < 2 {
        return Vec::new();
    }
    let of = |estimator: &String| {
        let own = scores.iter().filter(|score| score.estimator == *estimator);
        own.filter_map(|score| score.error_deg.map(|error| error.total))
            .collect()
    };
    let estimators = distinct(scores, |score| &score.estimator).into_iter();
    let all = estimators.map(|estimator| Distribution {
        name: estimator.clone(),
        errors_deg: of(estimator),
    });
    all.filter(|distribution| !distribution.errors_deg.is_empty())
        .collect()
}

/// Where the heading is arbitrary, in words: what the tables then hold.
fn arbitrary_headings(summaries: &[&RunSummary]) -> Option<String> {
    compare::arbitrary_heading_note(summaries.iter().copied())
}

/// What was odd about each recording, said once.
fn issues(summaries: &[&RunSummary]) -> Vec<String> {
    let mut issues = Vec::new();
    for summary in summaries {
        for issue in &summary.issues {
            let sentence = format!("{}: {issue}", summary.recording);
            if !issues.contains(&sentence) {
                issues.push(sentence);
            }
        }
    }
    issues
}
