//! `northing estimators`: each estimator with its parameters, units, defaults and meaning.

use anyhow::Result;
use clap::Args;
use northing_evaluation::attitude::kinds::{EstimatorInfo, EstimatorKind};
use northing_evaluation::attitude::parameters::{
    ParameterInfo, Profile, parameters, parameters_of,
};
use serde::Serialize;
use serde_json::{Map, Value};

use crate::files::output::{print, print_json};
use crate::text::table::Table;

/// Arguments of `estimators`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  northing estimators
  northing run walk.zip --estimator usque --set accelerometer_std=0.3
  northing estimators --json")]
pub(crate) struct EstimatorsArgs {
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Lists them.
pub(crate) fn execute(args: &EstimatorsArgs) -> Result<()> {
    if args.json {
        let all: Vec<_> = EstimatorKind::ALL
            .into_iter()
            .map(EstimatorJson::of)
            .collect();
        print_json(&all)
    } else {
        print(&text())
    }
}

#[derive(Serialize)]
struct EstimatorJson {
    #[serde(flatten)]
    info: EstimatorInfo,
    parameters: Vec<ParameterJson>,
}

#[derive(Serialize)]
struct ParameterJson {
    name: String,
    unit: String,
    range: String,
    meaning: &'static str,
    defaults: Map<String, Value>,
}

impl EstimatorJson {
    fn of(kind: EstimatorKind) -> Self {
        let parameters = parameters_of(kind)
            .into_iter()
            .map(ParameterJson::of)
            .collect();
        Self {
            info: kind.info(),
            parameters,
        }
    }
}

impl ParameterJson {
    fn of(parameter: ParameterInfo) -> Self {
        let defaults = parameter.defaults.into_iter();
        Self {
            name: parameter.name,
            unit: parameter.unit,
            range: parameter.range,
            meaning: parameter.meaning,
            defaults: defaults
                .map(|(profile, value)| (profile.name().to_owned(), value))
                .collect(),
        }
    }
}

fn text() -> String {
    let mut text = String::from("Estimators (--estimator NAME):\n\n");
    let mut names = Table::new(&["<name", "<what it is", "<read"]);
    for info in EstimatorKind::ALL.map(EstimatorKind::info) {
        names.row([info.name, info.summary, info.paper].map(str::to_owned));
    }
    text.push_str(&names.render("  "));
    text.push_str("\nParameters (--set NAME=VALUE, or in a file for --config):\n\n");
    let all = parameters();
    let [first, second] = Profile::ALL.map(Profile::name);
    let mut rows = Table::new(&["<name", "<unit", "<range", first, second, "<used by"]);
    for parameter in &all {
        let value = |index: usize| {
            parameter
                .defaults
                .get(index)
                .map(|(_, value)| plain(value))
                .unwrap_or_default()
        };
        let cells = [
            parameter.name.clone(),
            parameter.unit.clone(),
            parameter.range.clone(),
            value(0),
            value(1),
            users(parameter),
        ];
        rows.row(cells);
    }
    text.push_str(&rows.render("  "));
    text.push_str("\nWhat they mean:\n\n");
    let mut meanings = Table::new(&["<name", "<meaning"]);
    for parameter in all {
        meanings.row([parameter.name, parameter.meaning.to_owned()]);
    }
    text.push_str(&meanings.render("  "));
    text
}

/// A default as people write it.
fn plain(value: &Value) -> String {
    value
        .as_str()
        .map_or_else(|| value.to_string(), str::to_owned)
}

/// Which estimators a parameter makes a difference to.
fn users(parameter: &ParameterInfo) -> String {
    let uses = |kind: &EstimatorKind| {
        parameters_of(*kind)
            .iter()
            .any(|p| p.name == parameter.name)
    };
    let users: Vec<_> = EstimatorKind::ALL
        .into_iter()
        .filter(uses)
        .map(EstimatorKind::name)
        .collect();
    users.join(", ")
}
