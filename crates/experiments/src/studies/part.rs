//! Rows of a study, which runs are missing, and a hash of all that does not depend on the split.

use std::ops::Range;

use sha2::{Digest as _, Sha256};

use super::key::{StudyKey, as_json, hex};

/// What came of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Its number.
    pub run: u64,
    /// Its scores, in the order of [`StudyKey::scores`]; not a number where there is none.
    pub scores: Vec<f64>,
    /// SHA-256 of every parameter that it used, as JSON; empty where it did not run.
    pub parameters_sha256: String,
    /// Why there are no scores; empty where there are.
    pub error: String,
}

/// The hash of rows in the order of their numbers: that of a study, however it was split.
#[derive(Debug, Clone)]
pub struct RowsHash(Sha256);

impl RowsHash {
    /// Of no rows yet.
    #[must_use]
    pub fn of(key: &StudyKey) -> Self {
        let mut hash = Sha256::new();
        hash.update(as_json(key));
        Self(hash)
    }

    /// Takes the next row.
    pub fn add(&mut self, row: &Row) {
        self.0.update(row.run.to_le_bytes());
        for score in &row.scores {
            // Every value that is not a number is the same one.
            let score = if score.is_nan() { f64::NAN } else { *score };
            self.0.update(score.to_bits().to_le_bytes());
        }
        for text in [&row.parameters_sha256, &row.error] {
            self.0.update((text.len() as u64).to_le_bytes());
            self.0.update(text);
        }
    }

    /// In hexadecimal digits.
    #[must_use]
    pub fn finish(self) -> String {
        hex(self.0.finalize().as_slice())
    }
}

/// The runs of `wanted` that are in none of the ranges, in pieces of at most `most` that end at its multiples.
#[must_use]
pub fn missing(wanted: Range<u64>, held: &[Range<u64>], most: u64) -> Vec<Range<u64>> {
    let mut held: Vec<_> = held.iter().filter(|range| !range.is_empty()).collect();
    held.sort_by_key(|range| range.start);
    let mut pieces = Vec::new();
    let mut next = wanted.start;
    let mut gap = |from: u64, until: u64| {
        let mut from = from;
        while from < until {
            let end = ((from / most + 1) * most).min(until);
            pieces.push(from..end);
            from = end;
        }
    };
    for range in held {
        gap(next, range.start.min(wanted.end));
        next = next.max(range.end);
    }
    gap(next, wanted.end);
    pieces
}

#[cfg(test)]
mod tests {
    use super::missing;

    #[test]
    fn what_is_missing_comes_in_pieces_that_end_at_multiples() {
        assert_eq!(missing(0..25, &[], 10), [0..10, 10..20, 20..25]);
        assert_eq!(
            missing(7..25, &[12..15, 0..9], 10),
            [9..10, 10..12, 15..20, 20..25]
        );
        assert_eq!(missing(3..5, std::slice::from_ref(&(0..9)), 10), [0..0; 0]);
        assert_eq!(
            missing(3..5, std::slice::from_ref(&(5..9)), 10),
            std::slice::from_ref(&(3..5))
        );
    }
}
