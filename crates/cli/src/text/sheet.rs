//! A sheet of facts for people: a label, and beside it text that is wrapped to the width of a page.

use northing_evaluation::{Origin, UsedParameter};

/// Width of a line.
const WIDTH: usize = 100;
/// More parameters of one origin than these are not named.
const MOST_NAMED: usize = 8;

/// Labels and texts.
#[derive(Debug, Default)]
pub(crate) struct Sheet {
    rows: Vec<(String, String)>,
}

impl Sheet {
    /// Adds a row; rows with an empty label go on with the label above.
    pub(crate) fn row(&mut self, label: &str, text: impl Into<String>) {
        self.rows.push((label.to_owned(), text.into()));
    }

    /// Adds sentences under one label, each on a line of its own.
    pub(crate) fn sentences(&mut self, label: &str, sentences: &[String]) {
        for (index, sentence) in sentences.iter().enumerate() {
            self.row(if index == 0 { label } else { "" }, sentence.as_str());
        }
    }

    /// Adds the parameters that are neither default nor of a profile, with their origin; many of one origin as their
    /// number.
    pub(crate) fn parameters(&mut self, used: &[UsedParameter]) {
        let mut origins: Vec<(Origin, Vec<String>)> = Vec::new();
        for parameter in used {
            let origin = parameter.origin;
            if matches!(origin, Origin::Default | Origin::Profile) {
                continue;
            }
            let text = format!("{} {}", parameter.name, short(parameter));
            match origins.iter_mut().find(|(known, _)| *known == origin) {
                Some((_, texts)) => texts.push(text),
                None => origins.push((origin, vec![text])),
            }
        }
        for (index, (origin, texts)) in origins.iter().enumerate() {
            let text = match texts.len() {
                0..=MOST_NAMED => texts.join(", "),
                many => format!("{many} parameters"),
            };
            let label = if index == 0 { "parameters" } else { "" };
            self.row(label, format!("{text} ({})", origin.name()));
        }
    }

    /// Changes every text; rows of which nothing is left are gone.
    pub(crate) fn change(&mut self, change: &dyn Fn(&str) -> String) {
        for (_, words) in &mut self.rows {
            *words = change(words);
        }
        self.rows.retain(|(_, words)| !words.is_empty());
    }

    /// The text, indented by two.
    pub(crate) fn render(&self) -> String {
        let labels = self
            .rows
            .iter()
            .map(|(label, _)| label.chars().count())
            .max()
            .unwrap_or(0);
        let mut text = String::new();
        for (label, words) in &self.rows {
            let mut margin = format!("  {label:<labels$}  ");
            for line in wrap(words, WIDTH.saturating_sub(labels + 4)) {
                text.push_str(format!("{margin}{line}").trim_end());
                text.push('\n');
                margin = " ".repeat(labels + 4);
            }
        }
        text
    }
}

/// A value with four digits, and its unit.
fn short(parameter: &UsedParameter) -> String {
    let value = match parameter.value.as_f64() {
        Some(number) if number != 0.0 => {
            let decimals = (3.0 - number.abs().log10().floor()).clamp(0.0, 12.0) as usize;
            let text = format!("{number:.decimals$}");
            match text.contains('.') {
                true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
                false => text,
            }
        }
        _ => parameter.value_text(),
    };
    match parameter.unit {
        "-" => value,
        unit => format!("{value} {unit}"),
    }
}

/// A text on lines that begin with `indent` and are not wider than a page.
pub(crate) fn paragraph(text: &str, indent: &str) -> String {
    let lines = wrap(text, WIDTH.saturating_sub(indent.chars().count()));
    lines
        .iter()
        .map(|line| format!("{indent}{line}\n"))
        .collect()
}

/// Lines of at most `width` characters, broken between words.
fn wrap(text: &str, width: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let last = lines.len() - 1;
        let line = &mut lines[last];
        if line.is_empty() {
            line.push_str(word);
        } else if line.chars().count() + 1 + word.chars().count() <= width {
            line.push(' ');
            line.push_str(word);
        } else {
            lines.push(word.to_owned());
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_stand_beside_their_labels() {
        let mut sheet = Sheet::default();
        sheet.row("error", "1 deg");
        sheet.sentences(
            "uncertainty",
            &["Consistent.".to_owned(), "Really.".to_owned()],
        );
        let expected = "  error        1 deg\n  uncertainty  Consistent.\n               Really.\n";
        assert_eq!(sheet.render(), expected);
    }

    #[test]
    fn long_texts_are_broken_between_words() {
        assert_eq!(wrap("one two three", 8), ["one two", "three"]);
        assert_eq!(wrap("unbreakable", 3), ["unbreakable"]);
    }
}
