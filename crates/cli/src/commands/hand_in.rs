//! `northing hand-in`: the file that a student hands in for an exercise card, judged at once.

use std::convert::Infallible;
use std::path::PathBuf;

use anyhow::{Context as _, Result, anyhow, bail};
use clap::Args;
use northing_evaluation::EstimatorKind;
use northing_evaluation::attitude::alterations::Alterations;
use northing_evaluation::attitude::runner::run;
use northing_evaluation::attitude::setup::RunSetup;
use northing_evaluation::attitude::{Calibrations, RunOptions};
use northing_evaluation::exercises::answers::{checked, student};
use northing_evaluation::exercises::words::{Language, text};
use northing_evaluation::exercises::{Answers, Card, HandIn, Judged};
use northing_recording::atomic_file::write_whole;
use northing_recording::{Event, Metadata};

use crate::arguments::estimation::{Asked, EstimationArgs};
use crate::arguments::exercise::{card, language};
use crate::arguments::input::{DataArgs, InputArgs};
use crate::files::output::{check_free, print, print_json};
use crate::files::{setup, shown};
use crate::progress::watched;
use crate::text::exercise::reasons;

/// Options that a report of the lab decides; sensors and parameters may be changed.
const SET_ELSEWHERE: [&str; 10] = [
    "estimator",
    "magnetometer",
    "magnetometer_calibration",
    "calibration",
    "calibrate_first",
    "smooth",
    "align_reference",
    "ignore_reference",
    "profile",
    "config",
];

/// Arguments of `hand-in`.
#[derive(Debug, Args)]
#[command(
    long_about = "Makes the file that is handed in for an exercise card: recording, settings of the estimator and \
                  answers in one zip, with which anybody gets the same numbers. It is judged at once, by running it \
                  again, and says why it passes or not; northing grade does the same for a class. `northing exercises \
                  CARD` shows what a card asks. Calibration and settings come from the report that the lab exports \
                  beside the recording (--setup), or are given as for northing run.",
    after_help = "\
Examples:
  northing hand-in bias e1-recording.csv --setup e1-report.html --student Anna --answer x=0.12 --answer y=-0.31 --answer z=0.08
  northing hand-in consistent e1-recording.csv --setup e1-report.html --student Anna --set accelerometer_std=0.05
  northing hand-in no-magnetometer walk.csv --profile lab --calibrate-first 8 --sensors gyro,acc --student Ben \\
      --answer axis=yaw --answer why=gravity
  northing hand-in rate walk.csv --student Ben --answer rate=12.5 --out ben-rate.zip"
)]
pub(crate) struct HandInArgs {
    /// The card; `northing exercises` lists them
    #[arg(value_name = "CARD", value_parser = card)]
    card: Card,
    /// The recording: what the lab exported, or any other that the program reads
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
    /// Who hands it in
    #[arg(long, value_name = "NAME")]
    student: String,
    /// An answer of the card, such as x=0.12 or axis=yaw; once for each question
    #[arg(long = "answer", value_name = "QUESTION=ANSWER")]
    answers: Vec<String>,
    /// Estimator, calibration and settings from a report of the lab; --sensors and --set change them
    #[arg(long, value_name = "REPORT", conflicts_with_all = SET_ELSEWHERE)]
    setup: Option<PathBuf>,
    /// Estimator; without it bounded-velocity, with the lab profile mekf
    #[arg(long, value_name = "NAME")]
    estimator: Option<EstimatorKind>,
    /// The file to write [default: CARD-NAME.zip]
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Overwrite the file if it exists
    #[arg(long)]
    force: bool,
    /// Language of the reasons: en or es
    #[arg(long, value_name = "NAME", default_value = "en", value_parser = language)]
    language: Language,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    estimation: EstimationArgs,
    #[command(flatten)]
    input: InputArgs,
}

/// Makes it.
pub(crate) fn execute(args: &HandInArgs) -> Result<()> {
    let student = student(&args.student).map_err(|problem| anyhow!("--student: {problem}"))?;
    let answers = answers(args.card, &args.answers)?;
    let default = || format!("{}.zip", HandIn::name_of(args.card, &student)).into();
    let out: PathBuf = args.out.clone().unwrap_or_else(default);
    args.input
        .check_not_read(&out, &args.recording, &DataArgs::default())?;
    check_free(&out, args.force)?;
    let asked = asked(args)?;
    let mut recording = args.input.open(&args.recording)?;
    let metadata = recording.metadata().clone();
    let events = watched(&mut recording, "reading");
    let events = events.collect::<Result<Vec<Event>, _>>()?;
    let name = shown(&args.recording);
    let options = options(asked, &metadata, &events).with_context(|| name.clone())?;
    let hand_in = HandIn {
        student,
        card: args.card,
        at: now(),
        answers,
        setup: RunSetup::of(&options),
        starts: Vec::new(),
        alterations: Alterations::default(),
        world_frame: metadata.world_frame,
        events,
    };
    let (bytes, judged) = hand_in.sealed().with_context(|| name)?;
    write_whole(&out, &bytes, args.force)?;
    if args.json {
        return print_json(&judged.judgement);
    }
    print(&describe(args, &judged, &out.display()))
}

fn describe(args: &HandInArgs, judged: &Judged, out: &dyn std::fmt::Display) -> String {
    let judgement = &judged.judgement;
    let title = text(&format!("card.{}.title", args.card.name()), args.language);
    let outcome = match judgement.passed {
        true => "It passes.",
        false => "It does not pass.",
    };
    format!(
        "{title}: {}\n\n{}\n{outcome} Hand in this file: {out}\n",
        judged.student,
        reasons(judgement, args.language)
    )
}

/// The options that are asked for, before the recording is read.
fn asked(args: &HandInArgs) -> Result<Asked> {
    let asked = match &args.setup {
        Some(path) => {
            let mut run = setup::read(path)?;
            args.estimation.change(&mut run)?;
            Asked {
                run,
                calibrations: Calibrations::default(),
                align_reference: false,
            }
        }
        None => args
            .estimation
            .options_of_one(args.estimator, &args.input)?,
    };
    if asked.align_reference {
        bail!(
            "--align-reference has no effect on a hand-in: no card is judged by a reference; leave it out"
        );
    }
    HandIn::check_estimator(asked.run.estimator)?;
    Ok(asked)
}

/// The options of the run, with the magnetometer that it takes: whoever judges it takes the same.
fn options(asked: Asked, metadata: &Metadata, events: &[Event]) -> Result<RunOptions> {
    let mut options = asked.run;
    options.world_frame = metadata.world_frame;
    asked.calibrations.apply(metadata, &mut options)?;
    if options.choose_magnetometer {
        let events = events.iter().map(|event| Ok::<_, Infallible>(*event));
        // A recording that cannot be run is judged, too, and told why.
        let summary = run(events, &options, &mut ()).ok();
        if let Some(taken) = summary.and_then(|summary| summary.magnetometer) {
            options.sensors.magnetometer_source = taken;
        }
    }
    Ok(options)
}

/// The answers by their questions, each of which has one.
fn answers(card: Card, given: &[String]) -> Result<Answers> {
    let split = |text: &'_ String| {
        let pair = text
            .split_once('=')
            .map(|(a, b)| (a.to_owned(), b.to_owned()));
        pair.ok_or_else(|| anyhow!("--answer {text}: expected QUESTION=ANSWER"))
    };
    let pairs: Vec<(String, String)> = given.iter().map(split).collect::<Result<_>>()?;
    let pairs = pairs
        .iter()
        .map(|(name, value)| (name.as_str(), value.as_str()));
    checked(card, pairs)
        .map_err(|error| anyhow!("--answer {error} (northing exercises {})", card.name()))
}

/// The time of day, UTC.
fn now() -> String {
    let now = time::OffsetDateTime::now_utc();
    let (hour, minute, second) = now.to_hms();
    format!("{} {hour:02}:{minute:02}:{second:02} UTC", now.date())
}
