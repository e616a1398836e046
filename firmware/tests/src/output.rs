//! The sentences, read back: strictly, so that a damaged one fails a test.

use std::str::FromStr;

/// One sentence: the letter behind `$PNOR`, and its fields.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sentence {
    /// `B`, `I`, `G`, `O`, `F`, `E` or `S`.
    pub kind: char,
    /// What stands between the commas.
    pub fields: Vec<String>,
}

impl Sentence {
    /// A field as a number.
    ///
    /// # Panics
    /// When it is none.
    pub fn number<T: FromStr>(&self, place: usize) -> T {
        let field = &self.fields[place];
        field
            .parse()
            .unwrap_or_else(|_| panic!("field {place} of {self:?}"))
    }

    /// Three fields as numbers times `unit`.
    #[must_use]
    pub fn vector(&self, place: usize, unit: f64) -> [f64; 3] {
        [0, 1, 2].map(|i| self.number::<f64>(place + i) * unit)
    }
}

/// Every sentence of an output.
///
/// # Panics
/// When anything else is in it, or a checksum is wrong.
#[must_use]
pub fn sentences(output: &[u8]) -> Vec<Sentence> {
    let text = std::str::from_utf8(output).unwrap();
    assert!(text.is_empty() || text.ends_with("\r\n"));
    text.lines().map(sentence).collect()
}

fn sentence(line: &str) -> Sentence {
    let parts = line.strip_prefix('$').and_then(|rest| rest.split_once('*'));
    let (body, sum) = parts.unwrap_or_else(|| panic!("no sentence: {line}"));
    let computed = body.bytes().fold(0, |sum, byte| sum ^ byte);
    assert_eq!(u8::from_str_radix(sum, 16), Ok(computed), "{line}");
    let mut fields = body.split(',').map(str::to_owned);
    let address = fields.next().unwrap();
    let kind = address
        .strip_prefix("PNOR")
        .and_then(|kind| kind.chars().next());
    Sentence {
        kind: kind.unwrap_or_else(|| panic!("{line}")),
        fields: fields.collect(),
    }
}

/// Those of one kind.
pub fn of_kind(sentences: &[Sentence], kind: char) -> impl Iterator<Item = &Sentence> {
    sentences
        .iter()
        .filter(move |sentence| sentence.kind == kind)
}
