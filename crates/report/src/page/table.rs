//! Tables of a page: columns with units, cells with numbers, the best of them marked.

use std::fmt::Write as _;

use crate::drawing::svg::escape;
use crate::page::facts::Tone;
use crate::page::html;

/// A table of a page.
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
    /// A number of no decimals, coloured by how welcome it is.
    Toned {
        /// The number.
        value: f64,
        /// How welcome it is.
        tone: Tone,
    },
    /// Does not apply.
    Missing,
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

pub(crate) fn table(table: &Table) -> String {
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
        (Cell::Toned { value, tone }, _) => {
            let (class, _) = tone.class_and_word();
            format!("<td class=\"num toned {class}\">{value:.0}</td>")
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
