//! The page around tables and figures: head, contents, sections, footer.

use std::fmt::Write as _;

use crate::drawing::plot::Figure;
use crate::drawing::style;
use crate::drawing::svg::escape;
use crate::page::facts::{Fact, Verdict};
use crate::page::instrument;
use northing_evaluation::{PROGRAM, UsedParameter};

/// A page under construction: sections, and the contents line that names them.
#[derive(Debug, Default)]
pub(crate) struct Page {
    contents: Vec<(String, String)>,
    body: String,
}

/// What stands in the page's header and footer.
pub(crate) struct Frame<'a> {
    pub(crate) kicker: &'a str,
    pub(crate) title: &'a str,
    pub(crate) lead: &'a str,
    pub(crate) summary: &'a [Fact],
    pub(crate) verdicts: &'a [Verdict],
    pub(crate) recording: &'a str,
    pub(crate) command: Option<&'a str>,
    /// How to read what the page shows; the last line of its footer.
    pub(crate) reading: &'a str,
}

/// How pages about attitude are read.
pub(crate) const ATTITUDE_READING: &str = "Angles are heading (yaw), pitch and roll in the recording\u{2019}s \
     world frame. \u{03c3} is a standard deviation; a well-tuned filter stays inside \u{00b1}3\u{03c3} \
     almost always.";

impl Page {
    /// Adds a section; one without content is left out.
    pub(crate) fn section(&mut self, id: &str, title: &str, content: &str) {
        if content.is_empty() {
            return;
        }
        self.contents.push((id.to_owned(), title.to_owned()));
        let title = escape(title);
        let _ = writeln!(
            self.body,
            "<section id=\"{id}\" aria-labelledby=\"{id}-title\">\n\
             <h2 id=\"{id}-title\">{title}</h2>\n{content}</section>"
        );
    }

    /// The whole document.
    pub(crate) fn finish(self, frame: &Frame<'_>) -> String {
        let mut html = format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n\
             <meta name=\"generator\" content=\"{PROGRAM}\">\n\
             <title>{}</title>\n<style>\n{}{}</style>\n</head>\n<body>\n",
            escape(frame.title),
            style::page_css(),
            instrument::style(),
        );
        html.push_str(&self.header(frame));
        let _ = write!(html, "<main>\n{}</main>\n", self.body);
        html.push_str(&footer(frame));
        html.push_str(&instrument::script());
        html.push_str("</body>\n</html>\n");
        html
    }

    fn header(&self, frame: &Frame<'_>) -> String {
        let mut html = format!(
            "<header>\n<p class=\"kicker\">{}</p>\n<h1>{}</h1>\n",
            escape(frame.kicker),
            escape(frame.title)
        );
        if !frame.lead.is_empty() {
            let _ = writeln!(html, "<p class=\"lead\">{}</p>", escape(frame.lead));
        }
        if !self.contents.is_empty() {
            html.push_str("<nav aria-label=\"Contents\"><ul>\n");
            for (id, title) in &self.contents {
                let _ = writeln!(html, "<li><a href=\"#{id}\">{}</a></li>", escape(title));
            }
            html.push_str("</ul></nav>\n");
        }
        html.push_str(&facts(frame.summary));
        html.push_str(&verdicts(frame.verdicts));
        html.push_str("</header>\n");
        html
    }
}

fn footer(frame: &Frame<'_>) -> String {
    let mut html = String::from("<footer>\n");
    let made = match frame.recording {
        "" => format!("Made by {PROGRAM}."),
        name => format!(
            "Made by {PROGRAM} from the recording <code>{}</code>.",
            escape(name)
        ),
    };
    let _ = writeln!(html, "<p>{made}</p>");
    if let Some(command) = frame.command {
        let command = escape(command);
        let _ = writeln!(html, "<p>Make it again: <code>{command}</code></p>");
    }
    let _ = writeln!(html, "<p>{}</p>\n</footer>", escape(frame.reading));
    html
}

/// Facts as large numbers in a grid.
pub(crate) fn facts(facts: &[Fact]) -> String {
    if facts.is_empty() {
        return String::new();
    }
    let mut html = String::from("<dl class=\"facts\">\n");
    for fact in facts {
        let (label, value) = (escape(&fact.label), escape(&fact.value));
        let _ = writeln!(html, "<div><dt>{label}</dt><dd>{value}</dd></div>");
    }
    html.push_str("</dl>\n");
    html
}

/// Facts as a table of two columns.
pub(crate) fn fact_table(facts: &[Fact]) -> String {
    let mut rows = String::new();
    for fact in facts {
        let (label, value) = (escape(&fact.label), escape(&fact.value));
        let _ = writeln!(
            rows,
            "<tr><th scope=\"row\">{label}</th><td>{value}</td></tr>"
        );
    }
    table("", &rows)
}

/// A table from its head row and body rows, both already HTML; empty without rows.
pub(crate) fn table(head: &str, rows: &str) -> String {
    if rows.is_empty() {
        return String::new();
    }
    let head = match head {
        "" => String::new(),
        cells => format!("<thead><tr>{cells}</tr></thead>\n"),
    };
    format!("<div class=\"wide\"><table>\n{head}<tbody>\n{rows}</tbody>\n</table></div>\n")
}

/// Verdicts as a list, each with its tone as word and colour.
pub(crate) fn verdicts(verdicts: &[Verdict]) -> String {
    if verdicts.is_empty() {
        return String::new();
    }
    let mut html = String::from("<ul class=\"verdicts\">\n");
    for verdict in verdicts {
        let (class, word) = verdict.tone.class_and_word();
        let text = escape(&verdict.text);
        let _ = writeln!(
            html,
            "<li class=\"{class}\"><b>{word}</b><span>{text}</span></li>"
        );
    }
    html.push_str("</ul>\n");
    html
}

/// Sentences as a list.
pub(crate) fn sentences(sentences: &[String]) -> String {
    if sentences.is_empty() {
        return String::new();
    }
    let mut html = String::from("<ul class=\"issues\">\n");
    for sentence in sentences {
        let _ = writeln!(html, "<li>{}</li>", escape(sentence));
    }
    html.push_str("</ul>\n");
    html
}

/// A figure with its caption: what it is, and what to look for. With its data, of which the page's script makes instruments.
pub(crate) fn figure(figure: impl Into<Option<Figure>>, what: &str, look: &str) -> String {
    picture(
        figure.into().map(|figure| instrument::with_data(&figure)),
        what,
        look,
    )
}

/// As [`figure`], of a picture that is drawn already.
pub(crate) fn picture(svg: impl Into<Option<String>>, what: &str, look: &str) -> String {
    let Some(svg) = svg.into() else {
        return String::new();
    };
    format!(
        "<figure>\n<div class=\"picture\">{svg}</div><figcaption><b>{}</b> {}</figcaption>\n</figure>\n",
        escape(what),
        escape(look)
    )
}

/// The parameters of an estimator.
pub(crate) fn settings(settings: &[UsedParameter]) -> String {
    let mut rows = String::new();
    for s in settings {
        let _ = writeln!(
            rows,
            "<tr><th scope=\"row\"><code>{}</code></th><td class=\"num\">{}</td><td>{}</td><td>{}</td><td>{}</td></tr>",
            escape(&s.name),
            escape(&s.value_text()),
            escape(s.unit),
            s.origin.name(),
            escape(s.meaning)
        );
    }
    table(
        "<th scope=\"col\">Parameter</th><th scope=\"col\" class=\"num\">Value</th>\
         <th scope=\"col\">Unit</th><th scope=\"col\">Origin</th><th scope=\"col\">Meaning</th>",
        &rows,
    )
}

/// With a capital letter at its beginning.
pub(crate) fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().map(char::to_uppercase);
    first.into_iter().flatten().chain(letters).collect()
}
