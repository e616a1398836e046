//! Drafts of manifests: what the columns of a table probably are, by their names, their magnitudes and physics.
//!
//! Read first: `docs/formats.md`, section "A draft of a manifest". A resting accelerometer shows gravity, a magnetometer
//! the Earth's field, and the direction of gravity turns as the gyroscope says; that tells units, axes and orders that no
//! header names. Every guess comes with its reason and how sure it is.

mod across;
mod draft;
mod names;
mod navigation;
mod orientation;
mod position;
mod table;
mod text;
mod time;
mod turns;
mod vectors;

use serde::Serialize;

pub use draft::{Draft, draft};

/// Whether a column of this name has times.
pub(crate) fn is_time(name: &str) -> bool {
    names::single(name) == Some(names::Single::Time)
}

/// How sure a guess is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Confidence {
    /// Nothing speaks for it but that something must be taken.
    Assumed,
    /// Either its name or its numbers tell it.
    Likely,
    /// Its name tells it, and its numbers do not contradict.
    Certain,
}

impl Confidence {
    /// The word for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Assumed => "assumed",
            Self::Likely => "likely",
            Self::Certain => "certain",
        }
    }
}

/// A guess.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Guess {
    /// The file.
    pub file: String,
    /// The key of the manifest: `gyroscope`.
    pub key: &'static str,
    /// The columns, by their names or numbers.
    pub columns: String,
    /// What else is taken, as the manifest says it: `unit = "g"`.
    pub taken: String,
    /// Why.
    pub why: String,
    /// How sure it is.
    pub confidence: Confidence,
}

impl Guess {
    /// It as a sentence, for a run that reads by it.
    #[must_use]
    pub fn sentence(&self) -> String {
        let word = self.confidence.name();
        let taken = match self.taken.as_str() {
            "" => String::new(),
            taken => format!(", {taken}"),
        };
        let columns = match self.columns.as_str() {
            "" => String::new(),
            columns => format!(" from {columns}"),
        };
        format!(
            "Guessed ({word}): {}{columns}{taken}: {}.",
            self.key, self.why
        )
    }
}

/// Why something was taken, and how sure that is.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Found {
    why: String,
    confidence: Confidence,
}

impl Found {
    fn new(why: impl Into<String>, confidence: Confidence) -> Self {
        let why = why.into();
        Self { why, confidence }
    }
}

/// A table of a manifest, in the making.
#[derive(Debug, Clone)]
struct Section {
    key: &'static str,
    lines: Vec<String>,
    /// The columns that it takes.
    columns: Vec<usize>,
    found: Found,
}
