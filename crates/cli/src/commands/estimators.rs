//! `northing estimators`: the estimators of all questions, and one with its parameters.

use anyhow::{Result, bail};
use clap::Args;
use northing_evaluation::attitude::EstimatorKind;
use northing_evaluation::by_name;
use northing_evaluation::navigation::NavigationKind;
use northing_evaluation::registry::{Listed, Question, listed};
use northing_evaluation::tracking::TrackerKind;
use northing_experiments::radar;

use crate::files::output::{print, print_json};
use crate::text::table::Table;

/// Arguments of `estimators`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  northing estimators
  northing estimators usque                    # its parameters
  northing run walk.zip --estimator usque --set accelerometer_std=0.3
  northing estimators --json")]
pub(crate) struct EstimatorsArgs {
    /// The estimator whose parameters are shown
    #[arg(value_name = "NAME")]
    name: Option<String>,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

/// Lists them.
pub(crate) fn execute(args: &EstimatorsArgs) -> Result<()> {
    let all: Vec<Listed> = listed::<EstimatorKind>()
        .chain(listed::<NavigationKind>())
        .chain(listed::<TrackerKind>())
        .chain(listed::<radar::TrackerKind>())
        .collect();
    let Some(name) = &args.name else {
        return match args.json {
            true => print_json(&all),
            false => print(&list(&all)),
        };
    };
    let mut names: Vec<&str> = all.iter().map(|known| known.info.name).collect();
    // Some are estimators of two kinds.
    let named: Vec<&Listed> = all.iter().filter(|known| known.info.name == name).collect();
    if named.is_empty() {
        names.sort_unstable();
        names.dedup();
        let names = names.join(", ");
        bail!("unknown estimator `{name}`; expected one of: {names}");
    }
    if args.json {
        return print_json(&named);
    }
    let texts: Vec<String> = named.into_iter().map(describe).collect();
    print(&texts.join("\n"))
}

fn list(all: &[Listed]) -> String {
    let mut text = String::new();
    for (question, heading) in [
        (Question::Attitude, "Attitude: which way does it point?"),
        (Question::Navigation, "Navigation: where is it?"),
        (Question::Tracking, "Tracking: where are the others?"),
    ] {
        text.push_str(&format!("{heading}\n"));
        let mut command = "";
        for known in all.iter().filter(|known| known.question == question) {
            let info = &known.info;
            if known.command != command {
                command = known.command;
                text.push_str(&format!("\nnorthing {command} NAME\n\n"));
            }
            text.push_str(&format!(
                "  {:<26}{}\n{:28}when: {}; read: {}\n",
                info.name, info.summary, "", info.when, info.paper
            ));
        }
        text.push('\n');
    }
    text.push_str("`northing estimators NAME` shows the states and the parameters of one.\n");
    text
}

fn states(count: u8) -> String {
    match count {
        0 => "-".to_owned(),
        count => count.to_string(),
    }
}

fn describe(known: &Listed) -> String {
    let info = &known.info;
    let mut text = format!(
        "{}: {}\n\n  states  {}\n  when    {}\n  read    {}\n  with    northing {}\n\n",
        info.name,
        info.summary,
        states(info.error_states),
        info.when,
        info.paper,
        known.command
    );
    let Some(first) = known.parameters.first() else {
        text.push_str("It has no parameters to set.\n");
        return text;
    };
    text.push_str(match known.question {
        Question::Tracking => "Parameters (--set NAME=VALUE):\n\n",
        _ => "Parameters (--set NAME=VALUE, or in a file for --config):\n\n",
    });
    let mut columns = vec!["<name", "<unit"];
    columns.extend(first.defaults.iter().map(|(profile, _)| *profile));
    columns.extend(["<range", "<meaning"]);
    let mut rows = Table::new(&columns);
    for parameter in &known.parameters {
        let defaults = parameter.defaults.iter();
        let cells = [parameter.name.clone(), parameter.unit.clone()].into_iter();
        let cells = cells.chain(defaults.map(|(_, value)| by_name::text(value)));
        rows.row(cells.chain([parameter.range.clone(), parameter.meaning.to_owned()]));
    }
    text.push_str(&rows.render("  "));
    text
}
