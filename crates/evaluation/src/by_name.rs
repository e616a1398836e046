//! Names and texts of parameters: `NAME=VALUE` taken apart, the row that is meant, the value that a text stands for.

use northing_core::parameters::{ConfigError, Parameter, Range, Table, Value};
use serde_json::Value as Json;

use crate::error::EvaluationError;

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
pub(crate) fn find<'a>(name: &str, rows: &'a [Row]) -> Result<&'a Row, EvaluationError> {
    let names: Vec<String> = rows.iter().map(Row::name).collect();
    if let Some(place) = names.iter().position(|known| known == name) {
        return Ok(&rows[place]);
    }
    let is_old = |row: &&Row| row.formerly().is_some_and(|old| old == name);
    let renamed = rows.iter().find(is_old);
    let hint = match (renamed, nearest(name, &names)) {
        (Some(row), _) => format!("it is now called `{}`", row.name()),
        (None, Some(meant)) => format!("did you mean `{meant}`?"),
        (None, None) => format!("expected one of: {}", names.join(", ")),
    };
    Err(EvaluationError::UnknownParameter {
        name: name.to_owned(),
        hint,
    })
}

/// The name that a mistyped one is nearest to, if any is near.
fn nearest<'a>(name: &str, names: &'a [String]) -> Option<&'a str> {
    let near = |known: &'a String| (strsim::jaro_winkler(name, known), known.as_str());
    let best = names.iter().map(near).max_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|(likeness, _)| *likeness > 0.8)
        .map(|(_, known)| known)
}

/// The refusal of a value.
fn refused(name: &str, value: &str, range: &Range) -> EvaluationError {
    let number = match range {
        Range::From(..) | Range::Above(..) => "a number ",
        _ => "",
    };
    EvaluationError::BadValue {
        name: name.to_owned(),
        value: value.to_owned(),
        problem: format!("expected {number}{range}"),
    }
}

/// A configuration of any type, its parameters by name.
pub(crate) trait Configuration {
    fn rows(&self) -> &'static [Parameter];
    fn value(&self, name: &str) -> Option<Value<f64>>;
    fn put(&mut self, name: &str, value: Value<f64>) -> Result<(), ConfigError>;
    fn check(&self) -> Result<(), ConfigError>;
}

impl<C: Table<Number = f64>> Configuration for C {
    fn rows(&self) -> &'static [Parameter] {
        C::PARAMETERS
    }

    fn value(&self, name: &str) -> Option<Value<f64>> {
        self.parameter(name)
    }

    fn put(&mut self, name: &str, value: Value<f64>) -> Result<(), ConfigError> {
        self.set_parameter(name, value)
    }

    fn check(&self) -> Result<(), ConfigError> {
        Table::check(self)
    }
}

/// Configurations that are set together, each with what the names of its parameters begin with.
pub(crate) type Tables<'a> = Vec<(&'static str, &'a mut dyn Configuration)>;

/// A parameter under the name of the command line, with its value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Row {
    pub(crate) prefix: &'static str,
    pub(crate) parameter: &'static Parameter,
    pub(crate) value: Value<f64>,
}

impl Row {
    pub(crate) fn name(&self) -> String {
        format!("{}{}", self.prefix, self.parameter.name)
    }

    /// The name it had before.
    pub(crate) fn formerly(&self) -> Option<String> {
        let old = self.parameter.formerly?;
        Some(format!("{}{old}", self.prefix))
    }
}

/// Every parameter, in the order of the tables.
pub(crate) fn rows(tables: &Tables<'_>) -> Vec<Row> {
    let of = |(prefix, table): &(&'static str, &mut dyn Configuration)| {
        let row = |parameter: &'static Parameter| Row {
            prefix,
            parameter,
            value: table.value(parameter.name).unwrap_or(Value::Absent),
        };
        table.rows().iter().map(row).collect::<Vec<_>>()
    };
    tables.iter().flat_map(of).collect()
}

/// The value of a parameter; `None`: there is none of that name.
pub(crate) fn value(tables: &Tables<'_>, name: &str) -> Option<Value<f64>> {
    let mut tables = tables.iter();
    tables.find_map(|(prefix, table)| table.value(name.strip_prefix(prefix)?))
}

/// Sets a parameter; on an error nothing is changed.
///
/// # Errors
/// There is none of that name, or the value is outside the permitted range.
pub(crate) fn put(tables: Tables<'_>, name: &str, value: Value<f64>) -> Result<(), ConfigError> {
    for (prefix, table) in tables {
        let own = name.strip_prefix(prefix);
        if let Some(own) = own.filter(|own| table.rows().iter().any(|row| row.name == *own)) {
            return table.put(own, value);
        }
    }
    Err(ConfigError::UNKNOWN_NAME)
}

/// Sets one parameter from `NAME=VALUE` and returns its name; on an error nothing is changed.
///
/// # Errors
/// It is no setting, the name is unknown (the nearest one is named), or the value does not fit.
pub(crate) fn set(tables: Tables<'_>, setting: &str) -> Result<String, EvaluationError> {
    let (name, text) = split(setting)?;
    let range = find(name, &rows(&tables))?.parameter.range;
    let value = range
        .read(text)
        .ok_or_else(|| refused(name, text, &range))?;
    put(tables, name, value).map_err(|error| refused(name, text, &error.range))?;
    Ok(name.to_owned())
}

/// Checks every value.
///
/// # Errors
/// The first that is outside its range, and the range.
pub(crate) fn check(tables: &Tables<'_>) -> Result<(), EvaluationError> {
    for (prefix, table) in tables {
        table.check().map_err(|error| EvaluationError::Config {
            name: format!("{prefix}{}", error.field),
            range: error.range.to_string(),
        })?;
    }
    Ok(())
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
