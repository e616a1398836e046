//! What a check of the laboratory course found, in words.

use northing_evaluation::exercises::words::{self, Language};
use northing_evaluation::exercises::{Judgement, Reason};

use super::sheet::paragraph;

/// Every reason, a paragraph each.
pub(crate) fn reasons(judgement: &Judgement, language: Language) -> String {
    let one = |reason: &Reason| {
        let word = if reason.holds { "yes" } else { "no" };
        let text = paragraph(&words::reason(reason, language), "       ");
        format!("  {word:<5}{}", text.trim_start())
    };
    judgement.reasons.iter().map(one).collect()
}

/// What decided: the reason that does not hold, or the last of those that do.
pub(crate) fn decisive(judgement: &Judgement, language: Language) -> String {
    let reason = judgement.failure().or(judgement.reasons.last());
    reason.map_or_else(String::new, |reason| words::reason(reason, language))
}

/// Every reason in one sentence after the other.
pub(crate) fn sentences(judgement: &Judgement, language: Language) -> String {
    let sentences = judgement.reasons.iter();
    let sentences: Vec<String> = sentences.map(|r| words::reason(r, language)).collect();
    sentences.join(" ")
}
