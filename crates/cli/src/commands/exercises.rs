//! `northing exercises`: the cards of the laboratory course, one of them, and the lab's eleven steps.

use anyhow::Result;
use clap::Args;
use northing_evaluation::exercises::words::{Language, text};
use northing_evaluation::exercises::{Card, Question, QuestionKind};
use serde_json::{Value, json};

use crate::arguments::exercise::{card, language};
use crate::files::output::{print, print_json};
use crate::text::sheet::paragraph;
use crate::text::table::Table;

/// Arguments of `exercises`.
#[derive(Debug, Args)]
#[command(
    long_about = "Lists the exercise cards of the laboratory course, or shows one: what to do, what to answer, and \
                  how to hand it in. Each card is checked on the recording and on the settings of the estimator \
                  (northing hand-in, northing grade).",
    after_help = "\
Examples:
  northing exercises
  northing exercises bias                      # what to do, and what to answer
  northing exercises bias --language es
  northing exercises --sheet                   # the lab, step by step"
)]
pub(crate) struct ExercisesArgs {
    /// The card that is shown: experiment, bias, consistent, no-magnetometer, rate, scale, magnet
    #[arg(value_name = "CARD", value_parser = card, conflicts_with = "sheet")]
    card: Option<Card>,
    /// Show the eleven steps of the lab instead
    #[arg(long)]
    sheet: bool,
    /// Language of the cards: en or es
    #[arg(long, value_name = "NAME", default_value = "en", value_parser = language)]
    language: Language,
    /// Print one JSON document
    #[arg(long, conflicts_with = "sheet")]
    json: bool,
}

/// Lists them.
pub(crate) fn execute(args: &ExercisesArgs) -> Result<()> {
    let language = args.language;
    match (args.card, args.json) {
        _ if args.sheet => print(&sheet(language)),
        (None, false) => print(&list(language)),
        (None, true) => print_json(&Card::ALL.map(|card| document(card, language))),
        (Some(card), true) => print_json(&document(card, language)),
        (Some(card), false) => print(&describe(card, language)),
    }
}

fn of(card: Card, part: &str, language: Language) -> &'static str {
    text(&format!("card.{}.{part}", card.name()), language)
}

fn list(language: Language) -> String {
    let mut rows = Table::new(&["<card", "minutes", "<title"]);
    for card in Card::ALL {
        let title = of(card, "title", language).to_owned();
        rows.row([card.name().to_owned(), card.minutes().to_string(), title]);
    }
    format!(
        "Exercises of the laboratory course, with the minutes to plan for each\n\n{}\n\
         `northing exercises CARD` shows one, `northing exercises --sheet` the lab step by step.\n",
        rows.render("  ")
    )
}

fn describe(card: Card, language: Language) -> String {
    let name = card.name();
    let mut shown = format!("{} ({name})\n\n", of(card, "title", language));
    for part in ["task", "hint"] {
        shown.push_str(&paragraph(of(card, part, language), "  "));
        shown.push('\n');
    }
    let questions = card.questions();
    if !questions.is_empty() {
        shown.push_str("To answer:\n\n");
        for question in questions {
            shown.push_str(&asked(card, question, language));
        }
        shown.push('\n');
    }
    let answers = questions.iter().map(|question| match question.kind {
        QuestionKind::Number => format!(" --answer {}=NUMBER", question.name),
        QuestionKind::Choice => format!(" --answer {}=WORD", question.name),
    });
    shown.push_str(&format!(
        "To hand it in:\n\n  northing hand-in {name} RECORDING --student NAME{}\n",
        answers.collect::<String>()
    ));
    shown
}

/// A question, with its choices a line each.
fn asked(card: Card, question: &Question, language: Language) -> String {
    let words = of(card, question.name, language);
    let unit = match question.unit {
        "" => String::new(),
        unit => format!(", {unit}"),
    };
    let mut shown = format!("  {:<12}{words}{unit}\n", question.name);
    for choice in question.choices {
        let words = of(card, &format!("{}.{choice}", question.name), language);
        let meaning = if words == *choice { "" } else { words };
        let line = format!("{:14}{choice:<16}{meaning}", "");
        shown.push_str(line.trim_end());
        shown.push('\n');
    }
    shown
}

fn document(card: Card, language: Language) -> Value {
    let questions = card.questions().iter().map(|question| {
        json!({
            "name": question.name,
            "text": of(card, question.name, language),
            "kind": question.kind,
            "unit": question.unit,
            "choices": question.choices,
        })
    });
    json!({
        "card": card.name(),
        "minutes": card.minutes(),
        "title": of(card, "title", language),
        "task": of(card, "task", language),
        "hint": of(card, "hint", language),
        "questions": questions.collect::<Vec<_>>(),
    })
}

fn sheet(language: Language) -> String {
    let mut shown = format!("{}\n\n", text("sheet.title", language));
    shown.push_str(&paragraph(text("sheet.intro", language), ""));
    for step in 1..=11 {
        let part = |part: &str| text(&format!("sheet.{step}.{part}"), language);
        shown.push_str(&format!("\n{step:>2}. {}\n", part("title")));
        shown.push_str(&paragraph(part("text"), "    "));
    }
    shown
}
