//! The texts of the course, from the catalogue that the lab's page uses, too.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use super::judgement::{Judgement, Reason};

const CATALOGUE: &str = include_str!("../../../../web/words/course.json");

crate::named! {
    /// A language of the course.
    #[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
    pub enum Language {
        /// English.
        #[default]
        English = "en",
        /// Spanish.
        Spanish = "es",
    }
}

type Texts = BTreeMap<String, BTreeMap<String, String>>;

fn texts() -> &'static Texts {
    static TEXTS: OnceLock<Texts> = OnceLock::new();
    TEXTS.get_or_init(|| serde_json::from_str(CATALOGUE).unwrap_or_default())
}

/// A text of the catalogue; one that is not there is its own key, which a test refuses.
#[must_use]
pub fn text(key: &str, language: Language) -> &'static str {
    let found = texts().get(key).and_then(|text| text.get(language.name()));
    found.map_or("", String::as_str)
}

/// A reason in words: where it does not hold, by the sentence that says so, if it has one of its own.
#[must_use]
pub fn reason(reason: &Reason, language: Language) -> String {
    let negated = match reason.holds {
        true => "",
        false => text(&format!("{}.not", reason.key), language),
    };
    let mut sentence = match negated.is_empty() {
        true => text(&reason.key, language).to_owned(),
        false => negated.to_owned(),
    };
    for (name, value) in &reason.values {
        // Words that have a translation of their own: questions, names of sensors, choices.
        let keys = [format!("word.{value}"), value.clone()];
        let mut words = keys.iter().map(|key| text(key, language));
        let shown = words.find(|word| !word.is_empty()).unwrap_or(value);
        sentence = sentence.replace(&format!("{{{name}}}"), shown);
    }
    sentence
}

/// What decided: the reason that does not hold, or the last of those that do.
#[must_use]
pub fn decisive(judgement: &Judgement, language: Language) -> String {
    let decided = judgement.failure().or(judgement.reasons.last());
    decided.map_or_else(String::new, |one| reason(one, language))
}

/// Every reason in one sentence after the other.
#[must_use]
pub fn sentences(judgement: &Judgement, language: Language) -> String {
    let sentences = judgement.reasons.iter();
    let sentences: Vec<String> = sentences.map(|one| reason(one, language)).collect();
    sentences.join(" ")
}
