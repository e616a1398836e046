//! What the text formats share: dates, and names inside XML.

use chrono::{DateTime, SecondsFormat};

/// 2000-01-01, ns since 1970: earlier stamps count from somewhere else.
const FIRST_DATE_NS: i64 = 946_684_800_000_000_000;

/// The stamp as a date and time of day in UTC; `None` when it is no date.
pub(crate) fn date(time_ns: i64) -> Option<String> {
    (time_ns >= FIRST_DATE_NS).then(|| {
        DateTime::from_timestamp_nanos(time_ns).to_rfc3339_opts(SecondsFormat::AutoSi, true)
    })
}

/// A text inside an element: markup is escaped, what XML cannot hold is left out.
pub(super) fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c if c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}') => out.push(' '),
            c => out.push(c),
        }
    }
    out
}
