//! Golden traces: what every estimator of the three questions makes of a fixed simulated recording, in `traces/`.
//!
//! A change of numbers, however small, fails here and prints the rows that differ. Where it is meant,
//! `NORTHING_BLESS=1 cargo test -p northing-experiments --test golden` writes the traces anew, to be reviewed as a diff.

#![allow(clippy::unwrap_used)]

mod attitude;
mod navigation;
mod tracking;

use std::path::Path;

use northing_recording::test_data::assert_as_committed;

/// Rows of numbers under a line of column names.
struct Trace {
    text: String,
}

impl Trace {
    fn new(columns: &str) -> Self {
        Self {
            text: format!("{columns}\n"),
        }
    }

    /// A row; what an estimator does not state is an empty cell.
    fn row(&mut self, numbers: impl IntoIterator<Item = Option<f64>>) {
        let cells = numbers
            .into_iter()
            .map(|number| number.map_or_else(String::new, |x| format!("{x:.11e}")));
        self.text.push_str(&cells.collect::<Vec<_>>().join(","));
        self.text.push('\n');
    }

    /// Compares it with the committed trace of this name.
    fn check(&self, name: &str) {
        assert!(
            self.text.lines().count() > 20,
            "{name}: nothing was estimated:\n{}",
            self.text
        );
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/traces");
        assert_as_committed(&folder.join(format!("{name}.csv")), &self.text, are_alike);
    }
}

/// Whether two rows have the same numbers to 1e-9 of their size; near zero to 1e-12.
fn are_alike(committed: &str, made: &str) -> bool {
    let mut pairs = committed.split(',').zip(made.split(','));
    let is_near = |(a, b): (&str, &str)| {
        let numbers = a.parse::<f64>().ok().zip(b.parse::<f64>().ok());
        a == b || numbers.is_some_and(|(a, b)| (a - b).abs() <= 1e-9 * a.abs() + 1e-12)
    };
    committed.split(',').count() == made.split(',').count() && pairs.all(is_near)
}

#[test]
fn rows_differ_from_a_billionth_on() {
    assert!(are_alike("1.0,,name", "1.0000000009,,name"));
    assert!(are_alike("NaN", "NaN"));
    assert!(!are_alike("1.0", "1.000000002"));
    assert!(!are_alike("1e-6", "1.0000011e-6"));
    assert!(!are_alike("1.0,", "1.0"));
    assert!(!are_alike("1.0,", "1.0,0"));
    assert!(!are_alike("1.0", "NaN"));
}
