//! Cards and languages of the laboratory course, as they are named on the command line.

use northing_evaluation::exercises::Card;
use northing_evaluation::exercises::words::Language;

/// A card by its name.
pub(crate) fn card(name: &str) -> Result<Card, String> {
    Card::named(name).ok_or_else(|| format!("expected one of: {}", Card::names()))
}

/// A language by its code.
pub(crate) fn language(name: &str) -> Result<Language, String> {
    Language::named(name).ok_or_else(|| format!("expected one of: {}", Language::names()))
}
