//! The table of a class: for people, for a spreadsheet, and as JSON.

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use northing_evaluation::exercises::Card;
use northing_evaluation::exercises::words::{self, Language};
use serde_json::{Value, json};

use super::hand_ins::{Class, Graded};
use crate::text::exercise::{decisive, sentences};
use crate::text::sheet::paragraph;
use crate::text::table::Table;

/// Who handed in nothing under a name.
const NO_NAME: &str = "(no name)";

fn student(one: &Graded) -> &str {
    match one.judged.student.as_str() {
        "" => NO_NAME,
        name => name,
    }
}

/// For people: who passed what, each hand-in with what decided, and what to look at.
pub(super) fn text(class: &Class, language: Language) -> String {
    let passed = class
        .hand_ins
        .iter()
        .filter(|one| one.judged.judgement.passed);
    let mut text = format!(
        "{} hand-ins, {} pass\n\n{}\n",
        class.hand_ins.len(),
        passed.count(),
        students(class)
    );
    text.push_str("Each hand-in, and what decided\n\n");
    for one in &class.hand_ins {
        let (judged, word) = (&one.judged, outcome(one.judged.judgement.passed));
        text.push_str(&format!(
            "  {}, {}: {word}\n",
            student(one),
            judged.card.name()
        ));
        text.push_str(&paragraph(&decisive(&judged.judgement, language), "    "));
        text.push_str(&format!("    {}, {}\n", one.file, judged.at));
    }
    text.push_str(&remarks(class));
    text
}

const fn outcome(passed: bool) -> &'static str {
    if passed { "passes" } else { "does not pass" }
}

/// A row a student, a column a card that somebody handed in.
fn students(class: &Class) -> String {
    let handed_in = |card: &Card| class.hand_ins.iter().any(|one| one.judged.card == *card);
    let cards: Vec<Card> = Card::ALL.into_iter().filter(handed_in).collect();
    let mut names = vec!["<student".to_owned()];
    names.extend(cards.iter().map(|card| format!("<{}", card.name())));
    names.push("passed".to_owned());
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut rows = Table::new(&names);
    // In the order of the hand-ins, which are sorted.
    let mut order: Vec<&str> = class.hand_ins.iter().map(student).collect();
    order.dedup();
    let mut best: BTreeMap<(&str, Card), bool> = BTreeMap::new();
    for one in &class.hand_ins {
        *best.entry((student(one), one.judged.card)).or_default() |= one.judged.judgement.passed;
    }
    for name in order {
        let of = |card: &Card| best.get(&(name, *card)).copied();
        let cell = |card: &Card| of(card).map_or("-", |passed| if passed { "yes" } else { "no" });
        let passed = cards.iter().filter(|card| of(card) == Some(true)).count();
        let mut row = vec![name.to_owned()];
        row.extend(cards.iter().map(|card| cell(card).to_owned()));
        row.push(format!("{passed} of {}", cards.len()));
        rows.row(row);
    }
    rows.render("  ")
}

/// What a teacher should look at, and what was not judged.
fn remarks(class: &Class) -> String {
    let mut lines = Vec::new();
    for names in class.shared() {
        lines.push(format!(
            "One and the same recording under several names: {}.",
            names.join(", ")
        ));
    }
    for one in class.hand_ins.iter().filter(|one| !one.judged.as_claimed) {
        lines.push(format!(
            "{}: the judgement that is written in the file is another one. It was written by another version of the \
             program, or changed afterwards; what stands here is judged now.",
            one.file
        ));
    }
    for (file, reason) in &class.not_judged {
        lines.push(format!("Not judged: {file}: {reason}."));
    }
    if class.of_other_cards > 0 {
        lines.push(format!(
            "Hand-ins of other cards: {}, not shown.",
            class.of_other_cards
        ));
    }
    if !class.left_out.is_empty() {
        lines.push(format!(
            "Left out, for they do not end in .zip: {}.",
            class.left_out.join(", ")
        ));
    }
    let paragraphs = lines.iter().map(|line| paragraph(line, "  "));
    match lines.is_empty() {
        true => String::new(),
        false => format!("\nTo look at\n\n{}", paragraphs.collect::<String>()),
    }
}

/// For a spreadsheet: a row a hand-in, with every reason.
pub(super) fn csv(class: &Class, language: Language) -> Result<Vec<u8>> {
    let mut rows = csv::Writer::from_writer(Vec::new());
    let heads = [
        "student",
        "card",
        "passes",
        "decided_by",
        "reasons",
        "handed_in_utc",
        "file",
        "same_recording_as",
    ];
    rows.write_record(heads)?;
    for one in &class.hand_ins {
        let judged = &one.judged;
        rows.write_record([
            cell(student(one)).as_str(),
            judged.card.name(),
            if judged.judgement.passed { "yes" } else { "no" },
            cell(&decisive(&judged.judgement, language)).as_str(),
            cell(&sentences(&judged.judgement, language)).as_str(),
            cell(&judged.at).as_str(),
            cell(&one.file).as_str(),
            cell(&others(class, one).join(", ")).as_str(),
        ])?;
    }
    rows.into_inner().context("the table")
}

/// Other names under which the recording of this hand-in stands.
fn others<'a>(class: &'a Class, one: &Graded) -> Vec<&'a str> {
    let same = |other: &&Graded| {
        other.judged.samples == one.judged.samples && student(other) != student(one)
    };
    let mut names: Vec<&str> = class.hand_ins.iter().filter(same).map(student).collect();
    names.dedup();
    names
}

/// Text of a stranger that no spreadsheet takes for a formula.
fn cell(text: &str) -> String {
    match text.starts_with(['=', '+', '-', '@', '\t', '\r']) {
        true => format!("'{text}"),
        false => text.to_owned(),
    }
}

/// For programs.
pub(super) fn document(class: &Class, language: Language) -> Value {
    let reason = |reason: &northing_evaluation::exercises::Reason| {
        json!({
            "key": reason.key,
            "holds": reason.holds,
            "values": reason.values,
            "text": words::reason(reason, language),
        })
    };
    let hand_ins = class.hand_ins.iter().map(|one| {
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
            "same_recording_as": others(class, one),
        })
    });
    let not_judged = class.not_judged.iter();
    let not_judged = not_judged.map(|(file, reason)| json!({"file": file, "reason": reason}));
    json!({
        "hand_ins": hand_ins.collect::<Vec<_>>(),
        "not_judged": not_judged.collect::<Vec<_>>(),
        "left_out": class.left_out,
        "of_other_cards": class.of_other_cards,
    })
}
