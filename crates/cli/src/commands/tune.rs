//! `northing tune`: noise parameters of a navigation estimator, fitted to a recording.

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context, Result, bail};
use clap::Args;
use northing_evaluation::navigation::tune::{TuneOptions, TuneOutcome, TunedParameter, tune};
use northing_evaluation::navigation::{NavigationKind, NavigationOptions};
use northing_recording::Event;
use northing_recording::atomic_file::write_whole;
use serde::Serialize;

use crate::arguments::input::{DataArgs, InputArgs};
use crate::files::output::{check_free, check_not_input, print, print_json};
use crate::files::shown;
use crate::files::toml_file::in_comment;
use crate::interrupt::{happened, interruptible};
use crate::invocation::called;
use crate::progress::Progress;
use crate::text::sheet::paragraph;
use crate::text::table::Table;

/// Arguments of `tune`.
#[derive(Debug, Args)]
#[command(
    long_about = "Fits noise parameters of a navigation estimator to a recording, that minimise the negative \
                  log-likelihood of its innovations, and says whether the fit holds on a held-out part of the \
                  recording.",
    after_help = "\
Examples:
  northing tune drive.toml --out drive-noise.toml
  northing run drive.toml --estimator error-state --config drive-noise.toml
  northing tune drive.toml --parameters accelerometer_noise_density,gyroscope_noise_density"
)]
pub(crate) struct TuneArgs {
    /// The recording: file, manifest, Sensor Logger folder, or - for standard input
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
    /// The estimator: error-state, axis-filters, dead-reckoning
    #[arg(long, value_name = "NAME", default_value = "error-state")]
    estimator: NavigationKind,
    /// Parameters to fit, separated by commas [default: every noise of the estimator]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    parameters: Vec<String>,
    /// Share of the recording that the fit sees; the rest is held out
    #[arg(long, value_name = "SHARE", default_value = "0.6", value_parser = share)]
    fit: f64,
    /// Write the parameters as a file for --config
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Overwrite outputs that exist
    #[arg(long)]
    force: bool,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    input: InputArgs,
}

fn share(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(share) if (0.1..=0.9).contains(&share) => Ok(share),
        _ => Err("expected a share from 0.1 to 0.9, e.g. 0.6".to_owned()),
    }
}

#[derive(Serialize)]
struct Json<'a> {
    recording: &'a str,
    #[serde(flatten)]
    outcome: &'a TuneOutcome,
}

/// Fits.
pub(crate) fn execute(args: &TuneArgs) -> Result<()> {
    if let Some(out) = &args.out {
        check_not_input(out, &args.recording)?;
        check_free(out, args.force)?;
    }
    let name = shown(&args.recording);
    let mut recording = args.input.open_in(&args.recording, &args.data)?;
    let metadata = recording.metadata().clone();
    let events: Vec<Event> = interruptible(recording.by_ref()).collect::<Result<_, _>>()?;
    let options = NavigationOptions::of_recording(args.estimator, &metadata);
    let asked = TuneOptions {
        parameters: args.parameters.clone(),
        fitted_share: args.fit,
        ..TuneOptions::default()
    };
    let outcome = fit(&events, &metadata, &options, &asked).with_context(|| name.clone())?;
    if let Some(out) = &args.out {
        write_whole(out, to_toml(&outcome, &name).as_bytes(), args.force)?;
    }
    if args.json {
        return print_json(&Json {
            recording: &name,
            outcome: &outcome,
        });
    }
    print(&describe(&outcome, &name, args))
}

fn fit(
    events: &[Event],
    metadata: &northing_recording::Metadata,
    options: &NavigationOptions,
    asked: &TuneOptions,
) -> Result<TuneOutcome> {
    let progress = std::sync::Mutex::new(Progress::of_stream("fitting"));
    let stopped = AtomicBool::new(false);
    let on_run = || {
        if let Ok(mut progress) = progress.lock() {
            progress.event();
        }
        stopped.fetch_or(happened(), Ordering::Relaxed);
    };
    let outcome = tune(events, metadata.world_frame, options, asked, &on_run)?;
    if stopped.load(Ordering::Relaxed) {
        bail!("interrupted");
    }
    Ok(outcome)
}

fn describe(outcome: &TuneOutcome, name: &str, args: &TuneArgs) -> String {
    let mut table = Table::new(&["<parameter", "before", "after"]);
    for p in &outcome.parameters {
        table.row([
            p.name.clone(),
            format!("{:.3e}", p.before),
            format!("{:.3e}", p.after),
        ]);
    }
    let mut text = format!(
        "{name}: {} parameters of {} fitted in {} runs\n\n{}\n",
        outcome.parameters.len(),
        outcome.estimator,
        outcome.runs,
        table.render("  ")
    );
    let gained = [
        outcome.before.fitted - outcome.after.fitted,
        outcome.before.held_out - outcome.after.held_out,
    ];
    let verdict = if outcome.over_fits {
        "It over-fits: the held-out part has become less likely. Do not use these parameters on other recordings."
    } else if gained[1] > 0.0 {
        "It holds: the held-out part has become more likely, too."
    } else {
        "It neither helps nor harms the held-out part: the parameters from before are as good."
    };
    text.push_str(&paragraph(
        &format!(
            "Log-likelihood gained an innovation: {:.3} where it was fitted, {:.3} on the held-out part. {verdict}{}",
            gained[0],
            gained[1],
            ran_off(outcome)
        ),
        "  ",
    ));
    if let Some(out) = &args.out {
        text.push_str(&format!(
            "\nUse it with\n  {} run {name} --estimator {} --config {}\n",
            called(),
            outcome.estimator,
            out.display()
        ));
    }
    text
}

/// The parameters as a file for `--config`.
fn to_toml(outcome: &TuneOutcome, name: &str) -> String {
    let mut text = format!(
        "# Noise of {} fitted to {} by northing tune; gained an innovation on the held-out part: {:.3}.\n",
        outcome.estimator,
        in_comment(name),
        outcome.before.held_out - outcome.after.held_out
    );
    for p in &outcome.parameters {
        text.push_str(&format!("{} = {:e}\n", p.name, p.after));
    }
    text
}

/// What to do about parameters that the recording does not see.
fn ran_off(outcome: &TuneOutcome) -> String {
    let (off, others): (Vec<_>, Vec<_>) = outcome.parameters.iter().partition(|p| p.ran_off);
    let names = |parameters: Vec<&TunedParameter>| {
        let names: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
        names.join(",")
    };
    if off.is_empty() {
        return String::new();
    }
    let remedy = if others.is_empty() {
        String::new()
    } else {
        format!(" Fit the others alone: --parameters {}.", names(others))
    };
    format!(
        " Moved by more than a thousandfold: {}. The recording says nothing about that.{remedy}",
        names(off)
    )
}
