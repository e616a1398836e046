//! What a check found, as keys of the catalogue with their numbers.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// One thing that a check found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Reason {
    /// Its sentence in the catalogue.
    pub key: String,
    /// What stands in the sentence's places.
    pub values: BTreeMap<String, String>,
    /// Whether it speaks for the hand-in.
    pub holds: bool,
}

/// Whether a hand-in passes, and why.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[cfg_attr(feature = "typescript", derive(ts_rs::TS))]
pub struct Judgement {
    /// Whether everything holds.
    pub passed: bool,
    /// What was looked at, in order; the last is what decided where something does not hold.
    pub reasons: Vec<Reason>,
}

impl Judgement {
    /// Notes what was found.
    pub(super) fn find<const N: usize>(
        &mut self,
        holds: bool,
        key: &str,
        values: [(&str, String); N],
    ) -> bool {
        let values = values
            .into_iter()
            .map(|(name, value)| (name.to_owned(), value))
            .collect();
        self.reasons.push(Reason {
            key: key.to_owned(),
            values,
            holds,
        });
        holds
    }

    /// With its outcome: it passes when something was found and all of it holds.
    #[must_use]
    pub(super) fn closed(mut self) -> Self {
        self.passed = !self.reasons.is_empty() && self.reasons.iter().all(|reason| reason.holds);
        self
    }

    /// The first thing that does not hold.
    #[must_use]
    pub fn failure(&self) -> Option<&Reason> {
        self.reasons.iter().find(|reason| !reason.holds)
    }
}

/// A number with as many decimals as are worth reading.
pub(super) fn decimals(value: f64, decimals: usize) -> String {
    let text = format!("{value:.decimals$}");
    match text
        .trim_start_matches('-')
        .chars()
        .any(|c| ('1'..='9').contains(&c))
    {
        true => text,
        false => text.trim_start_matches('-').to_owned(),
    }
}
