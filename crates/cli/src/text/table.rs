//! Aligned columns for people: the first to the left, numbers to the right.

use std::fmt::Write as _;

/// Rows of cells under a header.
#[derive(Debug, Default)]
pub(crate) struct Table {
    rows: Vec<Vec<String>>,
    left: Vec<bool>,
}

impl Table {
    /// A table with these headings; those that start with `<` head a column of words, which is
    /// aligned to the left.
    pub(crate) fn new(headings: &[&str]) -> Self {
        let mut table = Self {
            left: headings.iter().map(|name| name.starts_with('<')).collect(),
            rows: Vec::new(),
        };
        table.row(
            headings
                .iter()
                .map(|name| name.trim_start_matches('<').to_owned()),
        );
        table
    }

    /// Adds a row.
    pub(crate) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// The text, each line after `indent`.
    pub(crate) fn render(&self, indent: &str) -> String {
        let widths: Vec<usize> = (0..self.left.len())
            .map(|i| {
                self.rows
                    .iter()
                    .filter_map(|row| row.get(i))
                    .map(|c| c.chars().count())
                    .max()
            })
            .map(Option::unwrap_or_default)
            .collect();
        let mut text = String::new();
        for row in &self.rows {
            let mut line = indent.to_owned();
            for ((cell, width), left) in row.iter().zip(&widths).zip(&self.left) {
                // Writing to a string cannot fail.
                let _ = if *left {
                    write!(line, "{cell:<width$}  ")
                } else {
                    write!(line, "{cell:>width$}  ")
                };
            }
            text.push_str(line.trim_end());
            text.push('\n');
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::Table;

    #[test]
    fn words_align_left_and_numbers_right() {
        let mut table = Table::new(&["<name", "error"]);
        table.row(["mekf".to_owned(), "1.25".to_owned()]);
        table.row(["quaternion-ekf".to_owned(), "12.50".to_owned()]);
        let expected =
            "  name            error\n  mekf             1.25\n  quaternion-ekf  12.50\n";
        assert_eq!(table.render("  "), expected);
    }
}
