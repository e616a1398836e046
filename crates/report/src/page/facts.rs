//! What every page says: facts, verdicts, and where it comes from.

/// Where a page about a calibration comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Source<'a> {
    /// Name of the recording.
    pub recording: &'a str,
    /// The command that makes the page again.
    pub command: Option<&'a str>,
}

/// A short statement: what, and its value with unit.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Fact {
    /// What it is, e.g. `heading error, RMS`.
    pub label: String,
    /// Its value with unit, e.g. `1.83 deg`.
    pub value: String,
}

/// How welcome a verdict is; shown as a word and a colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Tone {
    /// As it should be.
    Good,
    /// Good to know: nothing to judge.
    Info,
    /// Worth a look.
    Warn,
    /// Wrong: results should not be trusted before it is mended.
    Bad,
}

/// A judgement in words, e.g. "your accelerometer R is about 9 times too small".
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Verdict {
    /// How welcome it is.
    pub tone: Tone,
    /// One sentence.
    pub text: String,
}

impl Fact {
    /// A fact from its two texts.
    pub fn new(label: impl Into<String>, value: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            value: value.into(),
        }
    }
}

impl Verdict {
    /// A verdict from its tone and its sentence.
    pub fn new(tone: Tone, text: impl Into<String>) -> Self {
        Self {
            tone,
            text: text.into(),
        }
    }
}

impl Tone {
    /// Class in the style sheet, and word on the page.
    pub(crate) const fn class_and_word(self) -> (&'static str, &'static str) {
        match self {
            Self::Good => ("good", "\u{2713} Good"),
            Self::Info => ("info", "Note"),
            Self::Warn => ("warn", "! Look"),
            Self::Bad => ("bad", "\u{2717} Wrong"),
        }
    }
}
