//! The estimators of all questions as lists show them: name, states, paper, when to use, parameters.

use northing_core::parameters::{Parameter, Range, Table};
use serde::Serialize;
use serde_json::Value;

use crate::by_name;

/// What an estimator estimates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Question {
    /// Which way does it point?
    Attitude,
    /// Where is it?
    Navigation,
    /// Where are the others?
    Tracking,
}

/// What people want to know of an estimator before they choose it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct EstimatorInfo {
    /// The name on the command line and in files.
    pub name: &'static str,
    /// What it is, in a sentence.
    pub summary: &'static str,
    /// Components of its error state: what its covariance speaks of. Zero without one.
    pub error_states: u8,
    /// Whether it states its uncertainty.
    pub has_covariance: bool,
    /// Where to read about it.
    pub paper: &'static str,
    /// When to use it.
    pub when: &'static str,
}

/// Estimators of one kind.
pub trait Registered: Copy + 'static {
    /// What they estimate.
    const QUESTION: Question;
    /// The command that runs them, and its option.
    const COMMAND: &'static str;
    /// Every one.
    const EVERY: &'static [Self];

    /// What there is to know about it.
    fn info(self) -> EstimatorInfo;

    /// Its parameters, in the order of the tables.
    fn parameters(self) -> Vec<ParameterInfo>;
}

/// An estimator as lists show it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Listed {
    /// What it estimates.
    pub question: Question,
    /// The command that runs it, and its option.
    pub command: &'static str,
    /// What there is to know about it.
    #[serde(flatten)]
    pub info: EstimatorInfo,
    /// Its parameters.
    pub parameters: Vec<ParameterInfo>,
}

/// Every estimator of a kind.
pub fn listed<E: Registered>() -> impl Iterator<Item = Listed> {
    E::EVERY.iter().map(|estimator| Listed {
        question: E::QUESTION,
        command: E::COMMAND,
        info: estimator.info(),
        parameters: estimator.parameters(),
    })
}

/// One parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterInfo {
    /// Its name in `--set NAME=VALUE` and in configuration files.
    pub name: String,
    /// Its unit; `-` for numbers without one, otherwise the words it can be.
    pub unit: String,
    /// What is permitted, such as `from 0 to 10`.
    pub range: String,
    /// What it is.
    pub meaning: &'static str,
    /// What raising it does.
    pub note: &'static str,
    /// Its value in each profile, by the name of the profile.
    #[serde(serialize_with = "as_map")]
    pub defaults: Vec<(&'static str, Value)>,
}

fn as_map<S: serde::Serializer>(
    pairs: &[(&'static str, Value)],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_map(pairs.iter().map(|(name, value)| (name, value)))
}

impl ParameterInfo {
    /// A row of a table under the name of the command line.
    pub(crate) fn new(name: String, row: &Parameter, defaults: Vec<(&'static str, Value)>) -> Self {
        Self {
            name,
            unit: match row.range {
                Range::Words(_) => row.range.to_string(),
                _ => row.unit.to_owned(),
            },
            range: row.range.to_string(),
            meaning: row.meaning,
            note: row.note,
            defaults,
        }
    }

    /// Every row of a table, its names after a prefix.
    #[must_use]
    pub fn of_table<C: Table<Number = f64>>(prefix: &str) -> Vec<Self> {
        let profiles: Vec<_> = C::PROFILES.iter().map(|(name, of)| (*name, of())).collect();
        let info = |row: &Parameter| {
            let default = |(name, config): &(&'static str, C)| {
                let value = config.parameter(row.name);
                (*name, value.map_or(Value::Null, by_name::json))
            };
            let defaults = profiles.iter().map(default).collect();
            Self::new(format!("{prefix}{}", row.name), row, defaults)
        };
        C::PARAMETERS.iter().map(info).collect()
    }
}
