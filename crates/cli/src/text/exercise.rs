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
