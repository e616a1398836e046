//! Names and texts of parameters: `NAME=VALUE` taken apart, the row that is meant, the value that a text stands for.

use northing_core::parameters::{Range, Table, Value};
use serde_json::Value as Json;

use crate::error::EvaluationError;

/// Names and what they are read as.
type Names = Vec<(String, Option<String>)>;

/// Name and value of `NAME=VALUE`.
///
/// # Errors
/// It is no such text.
pub(crate) fn split(setting: &str) -> Result<(&str, &str), EvaluationError> {
    let parts = setting.split_once('=');
    let parts = parts.map(|(name, text)| (name.trim(), text.trim()));
    parts
        .filter(|(name, text)| !name.is_empty() && !text.is_empty())
        .ok_or_else(|| EvaluationError::NotASetting {
            text: setting.to_owned(),
        })
}

/// The place of a name among names, each perhaps with the one that it had before.
///
/// # Errors
/// There is none: what it is called now, or the nearest name, or all of them.
pub(crate) fn find(
    name: &str,
    names: impl Iterator<Item = (String, Option<String>)>,
) -> Result<usize, EvaluationError> {
    let names: Names = names.collect();
    if let Some(place) = names.iter().position(|(known, _)| known == name) {
        return Ok(place);
    }
    let renamed = names.iter().find(|(_, old)| old.as_deref() == Some(name));
    let hint = match (renamed, nearest(name, &names)) {
        (Some((now, _)), _) => format!("it is now called `{now}`"),
        (None, Some(meant)) => format!("did you mean `{meant}`?"),
        (None, None) => {
            let all: Vec<&str> = names.iter().map(|(known, _)| known.as_str()).collect();
            format!("expected one of: {}", all.join(", "))
        }
    };
    Err(EvaluationError::UnknownParameter {
        name: name.to_owned(),
        hint,
    })
}

/// The name that a mistyped one is nearest to, if any is near.
fn nearest<'a>(name: &str, names: &'a Names) -> Option<&'a str> {
    let near = |known: &'a str| (strsim::jaro_winkler(name, known), known);
    let all = names.iter().map(|(known, _)| near(known));
    let best = all.max_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|(likeness, _)| *likeness > 0.8)
        .map(|(_, known)| known)
}

/// The value that a text stands for.
///
/// # Errors
/// It is of another kind than the range.
pub(crate) fn read(name: &str, range: &Range, text: &str) -> Result<Value<f64>, EvaluationError> {
    range.read(text).ok_or_else(|| refused(name, text, range))
}

/// The refusal of a value.
pub(crate) fn refused(name: &str, value: &str, range: &Range) -> EvaluationError {
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

/// Sets one parameter of a table from `NAME=VALUE` and returns its name; on an error nothing is changed.
///
/// # Errors
/// It is no setting, the name is unknown, or the value does not fit.
pub(crate) fn set<C: Table<Number = f64>>(
    config: &mut C,
    setting: &str,
) -> Result<String, EvaluationError> {
    let (name, text) = split(setting)?;
    let rows = C::PARAMETERS;
    let names = rows.iter().map(|row| {
        let old = row.formerly.map(str::to_owned);
        (row.name.to_owned(), old)
    });
    let row = &rows[find(name, names)?];
    let value = read(name, &row.range, text)?;
    let set = config.set_parameter(name, value);
    set.map_err(|error| refused(name, text, &error.range))?;
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
