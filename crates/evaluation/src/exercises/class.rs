//! The hand-ins of a class: who passes which card, for a page, a spreadsheet and for programs.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use super::cards::Card;
use super::hand_in::{Judged, shared};
use super::judgement::Reason;
use super::words::{self, Language};

/// Who handed in nothing under a name.
const NO_NAME: &str = "(no name)";

/// A hand-in and its file.
#[derive(Debug, Clone, PartialEq)]
pub struct Graded {
    /// The name of its file.
    pub file: String,
    /// What was found.
    pub judged: Judged,
}

impl Graded {
    /// Who handed it in, for people.
    #[must_use]
    pub fn student(&self) -> &str {
        match self.judged.student.as_str() {
            "" => NO_NAME,
            name => name,
        }
    }
}

/// The hand-ins of a class.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Class {
    /// By student, card, time and file.
    pub hand_ins: Vec<Graded>,
    /// Files that cannot be judged, with the reason.
    pub not_judged: Vec<(String, String)>,
}

/// A student, and whether one of the hand-ins of each card passes.
pub type Student<'a> = (&'a str, BTreeMap<Card, bool>);

impl Class {
    /// Of files that were judged, in an order that depends on nothing else.
    #[must_use]
    pub fn of(outcomes: impl IntoIterator<Item = (String, Result<Judged, String>)>) -> Self {
        let mut class = Self::default();
        for (file, outcome) in outcomes {
            match outcome {
                Ok(judged) => class.hand_ins.push(Graded { file, judged }),
                Err(reason) => class.not_judged.push((file, reason)),
            }
        }
        class.not_judged.sort();
        class.hand_ins.sort_by_cached_key(|one| {
            let judged = &one.judged;
            let name = judged.student.to_lowercase();
            (
                name,
                judged.student.clone(),
                judged.card,
                judged.at.clone(),
                one.file.clone(),
            )
        });
        class
    }

    /// The cards that somebody handed in.
    #[must_use]
    pub fn cards(&self) -> Vec<Card> {
        let handed_in = |card: &Card| self.hand_ins.iter().any(|one| one.judged.card == *card);
        Card::ALL.into_iter().filter(handed_in).collect()
    }

    /// The students in the order of their names: a card is passed when one of the hand-ins passes.
    #[must_use]
    pub fn students(&self) -> Vec<Student<'_>> {
        let mut students: Vec<Student<'_>> = Vec::new();
        for one in &self.hand_ins {
            if students
                .last()
                .is_none_or(|(name, _)| *name != one.student())
            {
                students.push((one.student(), BTreeMap::new()));
            }
            if let Some((_, cards)) = students.last_mut() {
                *cards.entry(one.judged.card).or_default() |= one.judged.judgement.passed;
            }
        }
        students
    }

    /// Names under which one and the same recording was handed in.
    #[must_use]
    pub fn shared(&self) -> Vec<Vec<String>> {
        let judged: Vec<Judged> = self.hand_ins.iter().map(|one| one.judged.clone()).collect();
        let mut names: Vec<Vec<String>> = shared(&judged)
            .into_values()
            .map(|names| names.into_iter().map(str::to_owned).collect())
            .collect();
        names.sort();
        names
    }

    /// Other names under which the recording of a hand-in stands.
    #[must_use]
    pub fn others(&self, one: &Graded) -> Vec<&str> {
        let same = |other: &&Graded| {
            other.judged.samples == one.judged.samples && other.student() != one.student()
        };
        let mut names: Vec<&str> = self
            .hand_ins
            .iter()
            .filter(same)
            .map(Graded::student)
            .collect();
        names.dedup();
        names
    }

    /// For a spreadsheet: a row a hand-in, with every reason.
    ///
    /// # Errors
    /// As the system says.
    pub fn csv(&self, language: Language) -> std::io::Result<Vec<u8>> {
        let mut rows = csv::Writer::from_writer(Vec::new());
        rows.write_record([
            "student",
            "card",
            "passes",
            "decided_by",
            "reasons",
            "handed_in_utc",
            "file",
            "same_recording_as",
        ])?;
        for one in &self.hand_ins {
            let judged = &one.judged;
            rows.write_record([
                cell(one.student()).as_str(),
                judged.card.name(),
                if judged.judgement.passed { "yes" } else { "no" },
                cell(&words::decisive(&judged.judgement, language)).as_str(),
                cell(&words::sentences(&judged.judgement, language)).as_str(),
                cell(&judged.at).as_str(),
                cell(&one.file).as_str(),
                cell(&self.others(one).join(", ")).as_str(),
            ])?;
        }
        rows.into_inner().map_err(csv::IntoInnerError::into_error)
    }

    /// For programs.
    #[must_use]
    pub fn document(&self, language: Language) -> Value {
        let reason = |reason: &Reason| {
            json!({
                "key": reason.key,
                "holds": reason.holds,
                "values": reason.values,
                "text": words::reason(reason, language),
            })
        };
        let hand_ins = self.hand_ins.iter().map(|one| {
            let judged = &one.judged;
            json!({
                "file": one.file,
                "student": judged.student,
                "card": judged.card,
                "handed_in_utc": judged.at,
                "passes": judged.judgement.passed,
                "reasons": judged.judgement.reasons.iter().map(reason).collect::<Vec<_>>(),
                "judgement_in_file_is_the_same": judged.as_claimed,
                "samples_sha256": judged.samples,
                "same_recording_as": self.others(one),
            })
        });
        let not_judged = self.not_judged.iter();
        let not_judged = not_judged.map(|(file, reason)| json!({"file": file, "reason": reason}));
        json!({
            "hand_ins": hand_ins.collect::<Vec<_>>(),
            "not_judged": not_judged.collect::<Vec<_>>(),
        })
    }
}

/// Text of a stranger that no spreadsheet takes for a formula.
fn cell(text: &str) -> String {
    match text.starts_with(['=', '+', '-', '@', '\t', '\r']) {
        true => format!("'{text}"),
        false => text.to_owned(),
    }
}
