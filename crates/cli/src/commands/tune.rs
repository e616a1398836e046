//! `northing tune`: noise parameters of an estimator, fitted to a recording.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args;
use northing_evaluation::navigation::{NavigationKind, NavigationOptions};
use northing_evaluation::tune::{TuneOptions, TuneOutcome, TunedParameter, attitude, navigation};
use northing_evaluation::{Profile, RunEstimator, RunOptions};
use northing_recording::atomic_file::write_whole;
use northing_recording::{Event, Metadata, Recording, SensorKind};
use serde::Serialize;

use crate::arguments::input::{DataArgs, InputArgs, positive_seconds};
use crate::arguments::settings::SettingArgs;
use crate::files::output::{check_free, print, print_json};
use crate::files::shown;
use crate::files::toml_file::in_comment;
use crate::interrupt::happened;
use crate::invocation::called;
use crate::progress::Progress;
use crate::text::sheet::paragraph;
use crate::text::table::Table;

/// Arguments of `tune`.
#[derive(Debug, Args)]
#[command(
    long_about = "Fits noise parameters of an estimator to a recording, that minimise the negative log-likelihood \
                  of its innovations, and says whether the fit holds on a held-out part of the recording. No \
                  reference is used. How large errors are is found, how long they last is not: that an innovation \
                  has become more likely does not say that the attitude has become more accurate: on recordings of \
                  wearables bounded-velocity lost by it (docs/results/attitude.md).",
    after_help = "\
Examples:
  northing tune drive.toml --out drive-noise.toml
  northing run drive.toml --config drive-noise.toml
  northing tune walk.zip --estimator mekf --out walk-noise.toml
  northing tune lab.csv --profile lab --parameters accelerometer_std,magnetometer_std_ut
  northing tune drive.toml --parameters accelerometer_noise_density,gyroscope_noise_density"
)]
pub(crate) struct TuneArgs {
    /// The recording: file, manifest, Sensor Logger folder, or - for standard input
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
    /// The estimator, of attitude or navigation; without it error-state where there are fixes, otherwise that of the
    /// profile
    #[arg(long, value_name = "NAME")]
    estimator: Option<RunEstimator>,
    /// Parameters to fit, separated by commas [default: every noise of the estimator that makes a difference]
    #[arg(long, value_name = "LIST", value_delimiter = ',')]
    parameters: Vec<String>,
    /// Share of the recording that the fit sees; the rest is held out
    #[arg(long, value_name = "SHARE", default_value = "0.6", value_parser = share)]
    fit: f64,
    /// Of an attitude estimator: judge innovations after so many seconds of gyroscope alone; errors of a sensor that last
    /// shorter than that are not taken for motion [default: 3]
    #[arg(long, value_name = "SECONDS", value_parser = positive_seconds)]
    prediction: Option<f64>,
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
    settings: SettingArgs,
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
        args.input
            .check_not_read(out, &args.recording, &args.data)?;
        check_free(out, args.force)?;
    }
    let named = match args.estimator {
        None => args.settings.estimator()?,
        named => named,
    };
    let name = shown(&args.recording);
    let recording = args.input.open_in(&args.recording, &args.data)?;
    let (outcome, profile) = fit(args, named, recording, &name)?;
    if let Some(out) = &args.out {
        let text = to_toml(&outcome, profile, &name);
        write_whole(out, text.as_bytes(), args.force)?;
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
    args: &TuneArgs,
    named: Option<RunEstimator>,
    mut recording: Recording,
    name: &str,
) -> Result<(TuneOutcome, Option<Profile>)> {
    let has_fixes = recording.sensors().contains(&SensorKind::GnssPosition);
    let metadata = recording.metadata().clone();
    let estimator =
        named.or(has_fixes.then_some(RunEstimator::Navigation(NavigationKind::ErrorState)));
    // What is wrong with the options is told before a long recording is read.
    let ready = Ready::new(args, estimator, &metadata)?;
    let events: Vec<Event> = recording
        .watched(|| !happened())
        .collect::<Result<_, _>>()?;
    let usual = TuneOptions::default();
    let asked = TuneOptions {
        parameters: args.parameters.clone(),
        fitted_share: args.fit,
        prediction_s: args.prediction.unwrap_or(usual.prediction_s),
        ..usual
    };
    let progress = std::sync::Mutex::new(Progress::of_stream("fitting"));
    let go_on = || {
        if let Ok(mut progress) = progress.lock() {
            progress.event();
        }
        !happened()
    };
    let outcome = match &ready {
        Ready::Attitude(options) => attitude::tune(&events, options, &asked, &go_on),
        Ready::Navigation(options) => {
            navigation::tune(&events, metadata.frames(), options, &asked, &go_on)
        }
    };
    let profile = match &ready {
        Ready::Attitude(options) => Some(options.profile),
        Ready::Navigation(_) => None,
    };
    Ok((outcome.with_context(|| name.to_owned())?, profile))
}

/// The options of the runs.
enum Ready {
    Attitude(Box<RunOptions>),
    Navigation(Box<NavigationOptions>),
}

impl Ready {
    fn new(args: &TuneArgs, estimator: Option<RunEstimator>, metadata: &Metadata) -> Result<Self> {
        let kind = match estimator {
            Some(RunEstimator::Navigation(kind)) => {
                if args.prediction.is_some() {
                    bail!(
                        "--prediction has no effect on `{}`, whose innovations are judged as they come; it is of attitude \
                         estimators",
                        kind.name()
                    );
                }
                let mut options = NavigationOptions::of_recording(kind, metadata);
                args.settings.navigation_parameters(&mut options)?;
                return Ok(Self::Navigation(Box::new(options)));
            }
            Some(RunEstimator::Attitude(kind)) => Some(kind),
            None => None,
        };
        let mut options = args.settings.options(kind)?;
        args.settings.check_effect(options.estimator)?;
        options.driver.gap_limit_s = args.input.gap_limit_s();
        options.choose_magnetometer = true;
        options.world_frame = metadata.world_frame;
        options.check()?;
        Ok(Self::Attitude(Box::new(options)))
    }
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
        "{name}: {} parameters of {} fitted in {} runs over it\n\n{}\n",
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
    } else if gained[1] > 0.0 && outcome.is_worse_at_reference() {
        "The held-out part has become more likely, too, but the error against the reference has become larger."
    } else if gained[1] > 0.0 {
        "It holds: the held-out part has become more likely, too."
    } else {
        "It neither helps nor harms the held-out part: the parameters from before are as good."
    };
    text.push_str(&paragraph(
        &format!(
            "Log-likelihood gained an innovation: {:.3} where it was fitted, {:.3} on the held-out part. {verdict}{}{}",
            gained[0],
            gained[1],
            ran_off(outcome),
            without_effect(outcome)
        ),
        "  ",
    ));
    text.push_str(&against_reference(outcome, args.input.has_reference()));
    if let Some(out) = &args.out {
        text.push_str(&format!(
            "\nUse it with\n  {} run {name} --config {}\n",
            called(),
            out.display()
        ));
    }
    text
}

/// The errors before and after, where there is a reference; that there is none where one was asked for.
fn against_reference(outcome: &TuneOutcome, is_asked: bool) -> String {
    let errors = outcome.reference_error_deg.map(|errors| (errors, "deg"));
    let errors = errors.or(outcome.reference_error_m.map(|errors| (errors, "m")));
    let Some(([before, after], unit)) = errors else {
        return match is_asked {
            true => paragraph(
                "The reference was of no use: the estimator was not scored at it (an attitude estimator is at orientations, a \
                 navigation estimator at positions).",
                "  ",
            ),
            false => String::new(),
        };
    };
    let against = match after > before {
        true => {
            " The more likely parameters are the worse ones there: errors that last, of what is measured or of the reference, can do that."
        }
        false => "",
    };
    paragraph(
        &format!(
            "Against the recording's reference, which the fit does not see: RMSE {before:.2} {unit} before, {after:.2} {unit} \
             after.{against}"
        ),
        "  ",
    )
}

/// The parameters as a file for `--config`.
fn to_toml(outcome: &TuneOutcome, profile: Option<Profile>, name: &str) -> String {
    let mut text = format!(
        "# Noise of {} fitted to {} by northing tune; gained an innovation on the held-out part: {:.3}.\n",
        outcome.estimator,
        in_comment(name),
        outcome.before.held_out - outcome.after.held_out
    );
    text.push_str(&format!("estimator = \"{}\"\n", outcome.estimator));
    if let Some(profile) = profile {
        text.push_str(&format!("profile = \"{}\"\n", profile.name()));
    }
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

/// The parameters that were left as they are.
fn without_effect(outcome: &TuneOutcome) -> String {
    match &outcome.without_effect[..] {
        [] => String::new(),
        names => format!(
            " Left as they are, for they change no innovation here: {}.",
            names.join(", ")
        ),
    }
}
