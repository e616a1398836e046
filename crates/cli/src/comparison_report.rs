//! The outcome of a comparison as the data of its HTML report.

use northing_evaluation::compare::{MeanMedian, TableRow, statistics};
use northing_evaluation::estimators::EstimatorKind;
use northing_evaluation::options::RunOptions;
use northing_evaluation::report::{
    Best, Cell, Column, ComparedRun, ComparisonReport, Distribution, Fact, Table,
};
use northing_evaluation::summary::RunSummary;

use crate::commands::compare::Run;
use crate::run_report::{command_line, settings};

/// The page of a comparison.
pub(crate) fn render(runs: &[Run], options: &RunOptions) -> String {
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
    let names: Vec<&str> = estimators
        .iter()
        .map(|estimator| estimator.name())
        .collect();
    ComparisonReport {
        title: "Comparison of estimators".to_owned(),
        recording: over,
        command: Some(command_line()),
        summary: best(&statistics(runs)),
        tables: tables(runs, &summaries, recordings.len()),
        distributions: distributions(&summaries, &estimators, recordings.len()),
        runs: runs.iter().filter_map(drawn).collect(),
        issues: issues(&summaries),
        settings: names
            .iter()
            .zip(&estimators)
            .map(|(name, estimator)| ((*name).to_owned(), settings(*estimator, &options.config)))
            .filter(|(_, settings)| !settings.is_empty())
            .collect(),
        ..ComparisonReport::default()
    }
    .render()
}

fn drawn(run: &Run) -> Option<ComparedRun<'_>> {
    let trace = run.observer.as_ref()?.0.as_ref()?.trace();
    Some(ComparedRun {
        name: run.estimator.name(),
        trace,
    })
}

/// The estimator with the lowest median of each part of the table.
fn best(rows: &[TableRow]) -> Vec<Fact> {
    let mut folders: Vec<Option<&String>> = rows.iter().map(|row| row.folder.as_ref()).collect();
    folders.dedup();
    let best = folders.into_iter().filter_map(|folder| {
        let of = rows.iter().filter(|row| row.folder.as_ref() == folder);
        let scored = of.filter_map(|row| Some((row.estimator, row.total_deg?.median)));
        let (estimator, median) = scored.min_by(|a, b| a.1.total_cmp(&b.1))?;
        let place = folder.map_or("all recordings", String::as_str);
        Some(Fact::new(
            format!("lowest median error, {place}"),
            format!("{estimator}: {median:.2} deg"),
        ))
    });
    best.collect()
}

fn tables(runs: &[Run], summaries: &[&RunSummary], recordings: usize) -> Vec<Table> {
    let mut tables = Vec::new();
    if recordings > 1 {
        tables.push(statistics_table(&statistics(runs)));
    }
    tables.push(runs_table(summaries));
    tables
}

fn statistics_table(rows: &[TableRow]) -> Table {
    let number = |value: Option<MeanMedian>, of: fn(&MeanMedian) -> f64| {
        Cell::number(value.as_ref().map(of), 2)
    };
    let column = |name: &str| Column::new(name, "deg", None);
    Table {
        title: "Mean and median".to_owned(),
        caption:
            "RMS error of each recording, its mean and its median over the recordings of a folder."
                .to_owned(),
        columns: vec![
            Column::new("folder", "", None),
            Column::new("estimator", "", None),
            Column::new("recordings", "", None),
            column("total, mean"),
            column("total, median"),
            column("heading, mean"),
            column("heading, median"),
            column("inclination, mean"),
            column("inclination, median"),
        ],
        rows: rows
            .iter()
            .map(|row| {
                vec![
                    Cell::text(row.folder.as_deref().unwrap_or("all")),
                    Cell::text(row.estimator.name()),
                    Cell::number(Some(row.scored_recordings as f64), 0),
                    number(row.total_deg, |v| v.mean),
                    number(row.total_deg, |v| v.median),
                    number(row.heading_deg, |v| v.mean),
                    number(row.heading_deg, |v| v.median),
                    number(row.inclination_deg, |v| v.mean),
                    number(row.inclination_deg, |v| v.median),
                ]
            })
            .collect(),
    }
}

fn runs_table(summaries: &[&RunSummary]) -> Table {
    Table {
        title: "Each run".to_owned(),
        caption:
            "RMS errors against the reference; NEES is 1 when the stated uncertainty is honest."
                .to_owned(),
        columns: vec![
            Column::new("recording", "", None),
            Column::new("estimator", "", None),
            Column::new("total", "deg", None),
            Column::new("heading", "deg", None),
            Column::new("inclination", "deg", None),
            Column::new(
                "NEES / dof",
                "",
                Some(Best::Nearest(1.0)).filter(|_| summaries.len() < 10),
            ),
            Column::new("final test", "deg", None),
            Column::new("expected", "deg", None),
        ],
        rows: summaries.iter().map(|summary| run_cells(summary)).collect(),
    }
}

fn run_cells(summary: &RunSummary) -> Vec<Cell> {
    let error = summary.error_deg;
    let test = summary.final_test.as_ref();
    vec![
        Cell::text(summary.recording.as_str()),
        Cell::text(summary.estimator.name()),
        Cell::number(error.map(|e| e.total_rmse), 2),
        Cell::number(error.map(|e| e.heading_rmse), 2),
        Cell::number(error.map(|e| e.inclination_rmse), 2),
        Cell::number(summary.nees_mean, 2),
        Cell::number(test.map(|t| t.calculated_error_deg), 2),
        Cell::number(test.and_then(|t| t.estimated_error_deg), 2),
    ]
}

fn distributions(
    summaries: &[&RunSummary],
    estimators: &[EstimatorKind],
    recordings: usize,
) -> Vec<Distribution> {
    if recordings < 2 {
        return Vec::new();
    }
    let of = |estimator: &EstimatorKind| {
        let own = summaries
            .iter()
            .filter(|summary| summary.estimator == *estimator);
        own.filter_map(|summary| summary.error_deg.map(|e| e.total_rmse))
            .collect()
    };
    let all = estimators.iter().map(|estimator| Distribution {
        name: estimator.name().to_owned(),
        errors_deg: of(estimator),
    });
    all.filter(|distribution| !distribution.errors_deg.is_empty())
        .collect()
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
