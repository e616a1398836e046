//! Names and texts of parameters: `NAME=VALUE` taken apart, the row that is meant, the value that a text stands for.

use northing_core::parameters::{ConfigError, Parameter, Range, Value};
use serde_json::Value as Json;

use crate::error::EvaluationError;

/// A row of a table under the name of the command line.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Row {
    pub(crate) prefix: &'static str,
    pub(crate) parameter: &'static Parameter,
}

impl Row {
    /// The rows of a table whose names begin with `prefix`.
    pub(crate) fn of(
        prefix: &'static str,
        table: &'static [Parameter],
    ) -> impl Iterator<Item = Self> {
        table
            .iter()
            .map(move |parameter| Self { prefix, parameter })
    }

    pub(crate) fn name(&self) -> String {
        format!("{}{}", self.prefix, self.parameter.name)
    }

    /// The name it had before.
    pub(crate) fn formerly(&self) -> Option<String> {
        let old = self.parameter.formerly?;
        Some(format!("{}{old}", self.prefix))
    }
}

/// Name and value of `NAME=VALUE`.
///
/// # Errors
/// It is no such text.
fn split(setting: &str) -> Result<(&str, &str), EvaluationError> {
    let parts = setting.split_once('=');
    let parts = parts.map(|(name, text)| (name.trim(), text.trim()));
    parts
        .filter(|(name, text)| !name.is_empty() && !text.is_empty())
        .ok_or_else(|| EvaluationError::NotASetting {
            text: setting.to_owned(),
        })
}

/// The row of a name.
///
/// # Errors
/// There is none: what it is called now, or the nearest name, or all of them.
pub(crate) fn find(
    name: &str,
    rows: impl IntoIterator<Item = Row>,
) -> Result<Row, EvaluationError> {
    let rows: Vec<_> = rows.into_iter().map(|row| (row.name(), row)).collect();
    if let Some((_, row)) = rows.iter().find(|(known, _)| known == name) {
        return Ok(*row);
    }
    let mut old = rows.iter().map(|(now, row)| (now, row.formerly()));
    let renamed = old.find(|(_, old)| old.as_deref() == Some(name));
    let names: Vec<&str> = rows.iter().map(|(known, _)| known.as_str()).collect();
    let hint = match (renamed, nearest(name, &names)) {
        (Some((now, _)), _) => format!("it is now called `{now}`"),
        (None, Some(meant)) => format!("did you mean `{meant}`?"),
        (None, None) => format!("expected one of: {}", names.join(", ")),
    };
    Err(EvaluationError::UnknownParameter {
        name: name.to_owned(),
        hint,
    })
}

/// The name that a mistyped one is nearest to, if any is near.
fn nearest<'a>(name: &str, names: &[&'a str]) -> Option<&'a str> {
    let near = names
        .iter()
        .map(|known| (strsim::jaro_winkler(name, known), *known));
    let best = near.max_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|(likeness, _)| *likeness > 0.8)
        .map(|(_, known)| known)
}

/// The value that a text stands for.
///
/// # Errors
/// It is of another kind than the range.
fn read(name: &str, range: &Range, text: &str) -> Result<Value<f64>, EvaluationError> {
    range.read(text).ok_or_else(|| refused(name, text, range))
}

/// The refusal of a value.
fn refused(name: &str, value: &str, range: &Range) -> EvaluationError {
    let number = match range {
        Range::Positive | Range::NotNegative | Range::From(..) | Range::Above(..) => "a number ",
        _ => "",
    };
    EvaluationError::BadValue {
        name: name.to_owned(),
        value: value.to_owned(),
        problem: format!("expected {number}{range}"),
    }
}

/// Sets the parameter that `NAME=VALUE` means and returns its name; on an error nothing is changed.
///
/// # Errors
/// It is no setting, no row has the name, or the value does not fit.
pub(crate) fn set(
    setting: &str,
    rows: impl IntoIterator<Item = Row>,
    put: impl FnOnce(&str, Value<f64>) -> Result<(), ConfigError>,
) -> Result<String, EvaluationError> {
    let (name, text) = split(setting)?;
    let row = find(name, rows)?;
    let value = read(name, &row.parameter.range, text)?;
    put(name, value).map_err(|error| refused(name, text, &error.range))?;
    Ok(name.to_owned())
}

/// A value as JSON.
pub(crate) fn json(value: Value<f64>) -> Json {
    match value {
        Value::Number(number) => Json::from(number),
        Value::Count(count) => Json::from(count),
        Value::Flag(flag) => Json::from(flag),
        Value::Word(word) => Json::from(word),
        Value::Vector(vector) => Json::from(vector.to_vec()),
        Value::Pair(pair) => Json::from(pair.to_vec()),
        Value::Absent => Json::Null,
    }
}

/// The text of a JSON value, as [`Range::read`] takes it: no digit is lost.
#[must_use]
pub fn text(value: &Json) -> String {
    match value {
        Json::String(word) => word.clone(),
        Json::Null => "none".to_owned(),
        Json::Array(items) => items.iter().map(text).collect::<Vec<_>>().join(","),
        other => other.to_string(),
    }
}
