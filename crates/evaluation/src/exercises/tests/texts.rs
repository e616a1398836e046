//! The catalogue of texts, and the teachers' guide.

use std::collections::BTreeMap;

use super::super::Card;
use super::super::checks::samples::{
    FAILED_DEG, LEAST_MAGNET_UT, READ_S, SAME_POSE_DEG, SCALE_PERCENT, WHOLE_TURN_DEG,
};
use super::super::checks::settings::{BIAS_DEG_S, READ_DEG, UNCERTAIN};
use super::super::checks::{LEAST_TURN_DEG, SHORTEST_S};
use super::super::words::{Language, text};

/// Every text of every card, in both languages; and the places of both languages are the same.
#[test]
fn the_catalogue_is_complete() {
    let mut keys: Vec<String> = Vec::new();
    for card in Card::ALL {
        let name = card.name();
        keys.extend(["title", "task", "hint"].map(|part| format!("card.{name}.{part}")));
        for question in card.questions() {
            keys.push(format!("card.{name}.{}", question.name));
            keys.extend(
                question
                    .choices
                    .iter()
                    .map(|choice| format!("card.{name}.{}.{choice}", question.name)),
            );
        }
    }
    keys.extend(
        (1..=11).flat_map(|step| [format!("sheet.{step}.title"), format!("sheet.{step}.text")]),
    );
    // Every reason that a check can give stands in the source as a literal.
    let sources = [
        include_str!("../checks/mod.rs"),
        include_str!("../checks/samples.rs"),
        include_str!("../checks/settings.rs"),
    ];
    let source = sources.concat();
    let reasons = source
        .split("\"reason.")
        .skip(1)
        .map(|rest| rest.split('"').next().unwrap());
    keys.extend(
        reasons
            .filter(|name| !name.contains('{'))
            .map(|name| format!("reason.{name}")),
    );
    keys.extend(["reason.calculated", "reason.estimated"].map(str::to_owned));
    // A sentence that says the opposite has the same places.
    let opposites: Vec<String> = keys.iter().map(|key| format!("{key}.not")).collect();
    keys.extend(
        opposites
            .into_iter()
            .filter(|key| !text(key, Language::English).is_empty()),
    );
    let places = |text: &str| -> Vec<String> {
        let mut found: Vec<String> = text
            .split('{')
            .skip(1)
            .map(|rest| rest.split('}').next().unwrap().to_owned())
            .collect();
        found.sort();
        found
    };
    assert!(keys.len() > 80, "{}", keys.len());
    let mut missing = BTreeMap::new();
    for key in &keys {
        let [english, spanish] =
            [Language::English, Language::Spanish].map(|language| text(key, language));
        if english.is_empty() || spanish.is_empty() || places(english) != places(spanish) {
            missing.insert(key, (english, spanish));
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
}

/// The guide has every card with its minutes, and the tolerances that the checks have.
#[test]
fn the_teachers_guide_says_what_the_checks_do() {
    let guide = include_str!("../../../../../docs/exercises.md");
    let words: Vec<&str> = guide.split_whitespace().collect();
    let guide = words.join(" ");
    let part = |card: Card| {
        let title = text(&format!("card.{}.title", card.name()), Language::English);
        let head = format!(
            "### {title} (`{}`, {} minutes)",
            card.name(),
            card.minutes()
        );
        let (_, rest) = guide.split_once(&head).unwrap_or_else(|| panic!("{head}"));
        rest.split("##").next().unwrap_or_default()
    };
    let parts = Card::ALL.map(part);
    assert!(parts.iter().all(|part| part.contains("**Tolerance**")));
    for (card, number) in [
        (Card::Experiment, format!("{READ_DEG} deg:")),
        (Card::Experiment, format!("at least {SHORTEST_S} s")),
        (Card::Experiment, format!("by {LEAST_TURN_DEG} degrees")),
        (
            Card::Consistent,
            format!("{SHORTEST_S} s and {LEAST_TURN_DEG} degrees"),
        ),
        (Card::Bias, format!("{BIAS_DEG_S} deg/s,")),
        (Card::NoMagnetometer, format!("at least {UNCERTAIN} times")),
        (Card::Rate, format!("more than {FAILED_DEG} degrees")),
        (Card::Scale, format!("{SCALE_PERCENT} percent:")),
        (Card::Scale, format!("within {WHOLE_TURN_DEG} degrees")),
        (Card::Scale, format!("within {SAME_POSE_DEG} degrees")),
        (Card::Magnet, format!("than {LEAST_MAGNET_UT} µT")),
        (Card::Magnet, format!("{READ_S} s:")),
    ] {
        assert!(part(card).contains(&number), "{card:?}: {number}");
    }
}
