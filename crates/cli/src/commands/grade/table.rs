//! The table of a class for people, and as JSON.

use northing_evaluation::exercises::words::{Language, decisive};
use northing_evaluation::exercises::{Card, Class};
use serde_json::{Value, json};

use super::hand_ins::Grading;
use crate::text::sheet::paragraph;
use crate::text::table::Table;

/// For people: who passed what, each hand-in with what decided, and what to look at.
pub(super) fn text(grading: &Grading, language: Language) -> String {
    let class = &grading.class;
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
            one.student(),
            judged.card.name()
        ));
        text.push_str(&paragraph(&decisive(&judged.judgement, language), "    "));
        text.push_str(&format!("    {}, {}\n", one.file, judged.at));
    }
    text.push_str(&remarks(grading));
    text
}

const fn outcome(passed: bool) -> &'static str {
    if passed { "passes" } else { "does not pass" }
}

/// A row a student, a column a card that somebody handed in.
fn students(class: &Class) -> String {
    let cards = class.cards();
    let mut names = vec!["<student".to_owned()];
    names.extend(cards.iter().map(|card| format!("<{}", card.name())));
    names.push("passed".to_owned());
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut rows = Table::new(&names);
    for (name, best) in class.students() {
        let of = |card: &Card| best.get(card).copied();
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
fn remarks(grading: &Grading) -> String {
    let class = &grading.class;
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
    if grading.of_other_cards > 0 {
        lines.push(format!(
            "Hand-ins of other cards: {}, not shown.",
            grading.of_other_cards
        ));
    }
    if !grading.left_out.is_empty() {
        lines.push(format!(
            "Left out, for they do not end in .zip: {}.",
            grading.left_out.join(", ")
        ));
    }
    let paragraphs = lines.iter().map(|line| paragraph(line, "  "));
    match lines.is_empty() {
        true => String::new(),
        false => format!("\nTo look at\n\n{}", paragraphs.collect::<String>()),
    }
}

/// For programs.
pub(super) fn document(grading: &Grading, language: Language) -> Value {
    let mut document = grading.class.document(language);
    document["left_out"] = json!(grading.left_out);
    document["of_other_cards"] = json!(grading.of_other_cards);
    document
}
