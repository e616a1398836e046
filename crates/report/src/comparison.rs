//! The report of a comparison: several estimators, over one recording or many.

use std::fmt::Write as _;

use super::html::{self, Frame, Page};
use super::svg::escape;
use super::{Fact, Setting, Verdict, comparison_plots};
use crate::trace::Trace;

/// What a comparison's report shows. Sections without data are left out.
#[derive(Debug, Clone, Default)]
pub struct ComparisonReport<'a> {
    /// Heading of the page.
    pub title: String,
    /// What was compared over: name of the recording, or how many there are.
    pub recording: String,
    /// Program and version, e.g. `northing 0.1.0`.
    pub program: String,
    /// The command that makes this report again.
    pub command: Option<String>,
    /// The numbers that matter most, shown large.
    pub summary: Vec<Fact>,
    /// What they mean, in words.
    pub verdicts: Vec<Verdict>,
    /// Tables, in this order.
    pub tables: Vec<Table>,
    /// Errors of each estimator over all recordings.
    pub distributions: Vec<Distribution>,
    /// Estimators on the same recording, whose errors are drawn over time.
    pub runs: Vec<ComparedRun<'a>>,
    /// What was odd about the recordings, one sentence each.
    pub issues: Vec<String>,
    /// Parameters of each estimator, by name.
    pub settings: Vec<(String, Vec<Setting>)>,
}

/// A table of a comparison.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// Heading above it.
    pub title: String,
    /// One sentence on what its numbers are.
    pub caption: String,
    /// Columns, from left to right; the first names the row.
    pub columns: Vec<Column>,
    /// Rows, each with one cell for every column.
    pub rows: Vec<Vec<Cell>>,
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Column {
    /// Its name.
    pub name: String,
    /// Unit of its numbers; empty without one.
    pub unit: String,
    /// Which of its numbers is the best; `None` marks none.
    pub best: Option<Best>,
}

/// Which number of a column, or of a row, is the best.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Best {
    /// The lowest of the column.
    Lowest,
    /// The one of the column nearest to this value.
    Nearest(f64),
    /// The lowest of the row, among the columns marked so.
    LowestOfRow,
}

/// A cell of a table.
#[derive(Debug, Clone, PartialEq)]
pub enum Cell {
    /// Words.
    Text(String),
    /// A number and the decimals it is shown with.
    Number {
        /// The number; one that is not finite is shown as missing.
        value: f64,
        /// Digits behind the point.
        decimals: usize,
    },
    /// Does not apply.
    Missing,
}

/// One estimator of a comparison over a single recording.
#[derive(Debug, Clone, Copy)]
pub struct ComparedRun<'a> {
    /// Name of the estimator.
    pub name: &'a str,
    /// Its estimates.
    pub trace: &'a Trace,
}

/// Errors of one estimator over many recordings.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Distribution {
    /// Name of the estimator.
    pub name: String,
    /// One error of each recording, deg.
    pub errors_deg: Vec<f64>,
}

impl Column {
    /// A column of numbers.
    pub fn new(name: impl Into<String>, unit: impl Into<String>, best: Option<Best>) -> Self {
        Self {
            name: name.into(),
            unit: unit.into(),
            best,
        }
    }
}

impl Cell {
    /// A cell of words.
    pub fn text(text: impl Into<String>) -> Self {
        Self::Text(text.into())
    }

    /// A number, or missing.
    #[must_use]
    pub fn number(value: Option<f64>, decimals: usize) -> Self {
        value.map_or(Self::Missing, |value| Self::Number { value, decimals })
    }

    fn value(&self) -> Option<f64> {
        match self {
            Self::Number { value, .. } if value.is_finite() => Some(*value),
            _ => None,
        }
    }
}

impl ComparisonReport<'_> {
    /// The report as one HTML page that needs nothing else.
    #[must_use]
    pub fn render(&self) -> String {
        let mut page = Page::default();
        page.section(
            "results",
            "Results",
            &self.tables.iter().map(table).collect::<String>(),
        );
        page.section("distribution", "Over all recordings", &self.distribution());
        page.section("errors", "Errors over time", &self.errors());
        page.section("heading", "Heading", &self.heading());
        page.section("recordings", "Recordings", &html::sentences(&self.issues));
        page.section("settings", "Settings", &self.settings());
        page.finish(&Frame {
            kicker: "Northing \u{00b7} comparison of estimators",
            title: &self.title,
            lead: &self.recording,
            summary: &self.summary,
            verdicts: &self.verdicts,
            recording: &self.recording,
            program: match self.program.as_str() {
                "" => concat!("northing ", env!("CARGO_PKG_VERSION")),
                program => program,
            },
            command: self.command.as_deref(),
            reading: html::ATTITUDE_READING,
        })
    }

    fn distribution(&self) -> String {
        let Some(svg) = comparison_plots::distribution(&self.distributions, &self.runs) else {
            return String::new();
        };
        format!(
            "<figure>\n{svg}<figcaption><b>One dot for each recording.</b> Look at the median \
             (the bar) for what to expect, and at the dots far to the right for what can go \
             wrong; the axis is logarithmic.</figcaption>\n</figure>\n"
        )
    }

    fn errors(&self) -> String {
        comparison_plots::errors(&self.runs).map_or_else(String::new, |figure| {
            html::figure(
                &figure,
                "Errors of each estimator, root mean square over short windows.",
                "Look which lines rise for ever (nothing corrects them) and which ones come back \
                 after a disturbance; the axis is logarithmic.",
            )
        })
    }

    fn heading(&self) -> String {
        comparison_plots::headings(&self.runs).map_or_else(String::new, |figure| {
            html::figure(
                &figure,
                "The heading that each estimator gives.",
                "Look who stays with the dashed reference, and who leaves it, when and which way.",
            )
        })
    }

    fn settings(&self) -> String {
        let mut content = String::new();
        for (estimator, settings) in &self.settings {
            let table = html::settings(settings);
            if !table.is_empty() {
                let _ = write!(content, "<h3>{}</h3>\n{table}", escape(estimator));
            }
        }
        content
    }
}

pub(super) fn table(table: &Table) -> String {
    let mut head = String::new();
    for (i, column) in table.columns.iter().enumerate() {
        let class = if i == 0 { "" } else { " class=\"num\"" };
        let unit = match column.unit.as_str() {
            "" => String::new(),
            unit => format!(", {}", escape(unit)),
        };
        let name = escape(&column.name);
        let _ = write!(head, "<th scope=\"col\"{class}>{name}{unit}</th>");
    }
    let best: Vec<Option<f64>> = (0..table.columns.len())
        .map(|i| best_of_column(table, i))
        .collect();
    let mut rows = String::new();
    for row in &table.rows {
        let best_of_row = best_of_row(table, row);
        rows.push_str("<tr>");
        for (i, cell) in row.iter().enumerate() {
            let best = match table.columns.get(i).and_then(|c| c.best) {
                Some(Best::LowestOfRow) => best_of_row,
                _ => best.get(i).copied().flatten(),
            };
            rows.push_str(&cell_html(cell, i == 0, best));
        }
        rows.push_str("</tr>\n");
    }
    let body = html::table(&head, &rows);
    if body.is_empty() {
        return body;
    }
    let mut content = String::new();
    if !table.title.is_empty() {
        let _ = writeln!(content, "<h3>{}</h3>", escape(&table.title));
    }
    content.push_str(&body);
    if !table.caption.is_empty() {
        let _ = writeln!(content, "<p class=\"small\">{}</p>", escape(&table.caption));
    }
    content
}

fn cell_html(cell: &Cell, first: bool, best: Option<f64>) -> String {
    let is_best = |value: f64| best.is_some_and(|b| (b - value).abs() <= 0.0);
    match (cell, cell.value()) {
        (Cell::Text(text), _) if first => format!("<th scope=\"row\">{}</th>", escape(text)),
        (Cell::Text(text), _) => format!("<td class=\"num\">{}</td>", escape(text)),
        (Cell::Number { decimals, .. }, Some(value)) => {
            let class = if is_best(value) { "num best" } else { "num" };
            let decimals = (*decimals).min(9);
            format!("<td class=\"{class}\">{value:.decimals$}</td>")
        }
        _ => "<td class=\"num none\">\u{2013}</td>".to_owned(),
    }
}

/// The value to mark in a column; `None` when there is nothing to choose from.
fn best_of_column(table: &Table, i: usize) -> Option<f64> {
    let distance = |value: f64| match table.columns[i].best {
        Some(Best::Lowest) => Some(value),
        Some(Best::Nearest(target)) => Some((value - target).abs()),
        _ => None,
    };
    let values: Vec<f64> = table
        .rows
        .iter()
        .filter_map(|r| r.get(i)?.value())
        .collect();
    lowest(&values, distance)
}

fn best_of_row(table: &Table, row: &[Cell]) -> Option<f64> {
    let marked = table.columns.iter().zip(row);
    let marked = marked.filter(|(c, _)| c.best == Some(Best::LowestOfRow));
    let values: Vec<f64> = marked.filter_map(|(_, cell)| cell.value()).collect();
    lowest(&values, Some)
}

fn lowest(values: &[f64], distance: impl Fn(f64) -> Option<f64>) -> Option<f64> {
    if values.len() < 2 {
        return None;
    }
    let scored = values.iter().filter_map(|v| Some((distance(*v)?, *v)));
    scored.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, v)| v)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(name: &str, values: [f64; 2]) -> Vec<Cell> {
        vec![
            Cell::text(name),
            Cell::number(Some(values[0]), 2),
            Cell::number(Some(values[1]), 3),
        ]
    }

    #[test]
    fn best_number_of_a_column_is_marked() {
        let html = table(&Table {
            columns: vec![
                Column::new("estimator", "", None),
                Column::new("total", "deg", Some(Best::Lowest)),
                Column::new("NIS", "", Some(Best::Nearest(3.0))),
            ],
            rows: vec![
                row("a", [5.0, 2.0]),
                row("b", [4.0, 9.0]),
                row("c", [f64::NAN, 3.5]),
            ],
            ..Table::default()
        });
        assert_eq!(html.matches("num best").count(), 2, "{html}");
        assert!(html.contains("<td class=\"num best\">4.00</td>"));
        assert!(html.contains("<td class=\"num best\">3.500</td>"));
        assert!(!html.contains("NaN") && html.contains("num none"));
    }

    #[test]
    fn best_number_of_a_row_is_marked_among_its_columns() {
        let best = Some(Best::LowestOfRow);
        let html = table(&Table {
            columns: vec![
                Column::new("recording", "", None),
                Column::new("mekf", "deg", best),
                Column::new("device", "deg", best),
            ],
            rows: vec![row("a", [5.0, 2.0]), row("b", [4.0, 9.0])],
            ..Table::default()
        });
        assert!(html.contains("num best\">2.000<") && html.contains("num best\">4.00<"));
    }

    #[test]
    fn single_row_has_no_best() {
        assert_eq!(lowest(&[1.0], Some), None);
    }
}
