//! `northing calibrate allan`: which noise rules at which averaging time, and the Q that follows.

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Args;
use northing_core::attitude::AttitudeConfig;
use northing_evaluation::calibration::allan::{AllanConfig, AllanReport, RestSamples, analyze};
use northing_recording::SensorKind;
use northing_recording::atomic_file::write_whole;
use northing_report::{Source, allan_html};
use serde::Serialize;

use super::OutputArgs;
use crate::arguments::input::InputArgs;
use crate::arguments::span::SpanArgs;
use crate::files::output::{print, print_json};
use crate::files::shown;
use crate::files::toml_file::in_comment;
use crate::invocation::{called, command_line};
use crate::progress::watched;
use crate::text::sheet::Sheet;

/// Arguments of `calibrate allan`.
#[derive(Debug, Args)]
#[command(
    long_about = "Explains the noise of a sensor from a recording in which the device lies still: white noise, \
                  quantisation, the floor below which averaging does not help, and how the bias walks. Ten \
                  minutes show the white noise well, an hour the bias. From a gyroscope it writes the Q of a \
                  filter.",
    after_help = "\
Examples:
  northing calibrate allan night.csv --report night.html
  northing calibrate allan night.csv --out q.toml
  northing run walk.csv --estimator mekf --config q.toml
  northing calibrate allan night.csv --sensor accelerometer"
)]
pub(super) struct AllanArgs {
    /// The recording: file, Sensor Logger folder, or - for standard input
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
    #[command(flatten)]
    span: SpanArgs,
    /// The sensor: gyroscope, accelerometer, magnetometer, magnetometer-uncalibrated
    #[arg(long, value_name = "SENSOR", default_value = "gyroscope", value_parser = sensor)]
    sensor: SensorKind,
    /// Write a report with plots: one HTML file for a browser
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
    #[command(flatten)]
    input: InputArgs,
}

fn sensor(text: &str) -> Result<SensorKind, String> {
    match text {
        "gyroscope" | "gyro" => Ok(SensorKind::Gyroscope),
        "accelerometer" | "acc" => Ok(SensorKind::Accelerometer),
        "magnetometer" | "mag" => Ok(SensorKind::Magnetometer),
        "magnetometer-uncalibrated" | "mag-uncalibrated" => {
            Ok(SensorKind::MagnetometerUncalibrated)
        }
        _ => Err(
            "expected gyroscope, accelerometer, magnetometer or magnetometer-uncalibrated"
                .to_owned(),
        ),
    }
}

/// Analyses.
pub(super) fn execute(args: &AllanArgs) -> Result<()> {
    args.span.check()?;
    args.output
        .check(&args.input, &args.recording, args.report.as_deref())?;
    if args.output.out.is_some() && args.sensor != SensorKind::Gyroscope {
        bail!(
            "--out: the settings of a filter come from its gyroscope, not from the {}; leave --out away",
            args.sensor.name()
        );
    }
    let name = shown(&args.recording);
    let report = analyzed(args, &name)?;
    // What a filter starts from does not matter here: only what is said about it.
    let filled = report.fill(&mut AttitudeConfig::lab());
    let settings = Settings::of(&report);
    let toml = args.output.out.as_ref();
    let toml = toml
        .map(|_| to_toml(&settings, &report, &name))
        .transpose()?;
    args.output
        .write_toml(toml.as_deref().unwrap_or_default())?;
    if let Some(path) = &args.report {
        let command = command_line();
        let source = Source {
            recording: &name,
            command: Some(&command),
        };
        let html = allan_html(&report, &filled, &source);
        write_whole(path, html.as_bytes(), args.output.force)?;
    }
    if let (Some(toml), true) = (&toml, args.output.prints_toml()) {
        return print(toml);
    }
    if args.output.json {
        return print_json(&Json {
            recording: &name,
            report: &report,
            settings,
        });
    }
    let text = describe(&name, &report, &filled);
    let told = args.output.told(args.report.as_deref());
    let next = match args.output.file() {
        Some(file) => format!(
            "Use it with\n  {} run RECORDING --estimator mekf --config {}\n",
            called(),
            file.display()
        ),
        None if args.sensor == SensorKind::Gyroscope => {
            "No settings were written; --out FILE.toml keeps them for `northing run --config`.\n"
                .to_owned()
        }
        None => String::new(),
    };
    let all = format!("{text}\n{told}{next}");
    print(&format!("{}\n", all.trim_end()))
}

fn analyzed(args: &AllanArgs, name: &str) -> Result<AllanReport> {
    let mut recording = args.input.open(&args.recording)?;
    let config = AllanConfig {
        sensor: args.sensor,
        ..AllanConfig::default()
    };
    let events = args.span.of(watched(&mut recording, "reading"));
    let mut samples = RestSamples::new(args.sensor);
    for event in events {
        samples.add_event(&event?);
    }
    let report = analyze(&samples, &config).context("Allan deviation");
    let mut report = report.with_context(|| name.to_owned())?;
    report.sentences.extend(recording.issues().sentences());
    Ok(report)
}

/// The settings of a filter that follow; `None` where the curve does not show them.
#[derive(Debug, Clone, Copy, Serialize)]
struct Settings {
    #[serde(skip_serializing_if = "Option::is_none")]
    gyroscope_noise_density: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    gyroscope_bias_random_walk: Option<f64>,
}

impl Settings {
    fn of(report: &AllanReport) -> Self {
        let is_gyroscope = report.sensor == SensorKind::Gyroscope;
        let noise = report.coefficients.noise_density.map(|n| n.value);
        Self {
            gyroscope_noise_density: noise.filter(|_| is_gyroscope),
            gyroscope_bias_random_walk: report.bias_random_walk().filter(|_| is_gyroscope),
        }
    }
}

/// The file for `--config`.
fn to_toml(settings: &Settings, report: &AllanReport, recording: &str) -> Result<String> {
    let values = toml::to_string(settings).context("settings as TOML")?;
    if values.is_empty() {
        bail!(
            "{recording}: the curve shows neither white noise nor a walk, so there are no settings to write"
        );
    }
    let words: String = report
        .sentences
        .iter()
        .map(|sentence| format!("# {}\n", in_comment(sentence)))
        .collect();
    Ok(format!(
        "# Settings of a filter by `northing calibrate allan`, for `--config`.\n\
         # Recording: {}, {} at rest for {:.0} s\n{words}\
         # Noise density in rad/s/sqrt(Hz), random walk of the bias in rad/s/sqrt(s).\n\
         {values}",
        in_comment(recording),
        report.sensor.name(),
        report.duration_s
    ))
}

fn describe(name: &str, report: &AllanReport, filled: &[String]) -> String {
    let mut sheet = Sheet::default();
    sheet.sentences("noise", &report.sentences);
    if report.sensor == SensorKind::Gyroscope {
        sheet.sentences("Q", filled);
    }
    format!(
        "{name}: {} at rest for {:.0} s, {} samples at {:.1} Hz\n\n{}",
        report.sensor.name(),
        report.duration_s,
        report.samples,
        report.rate_hz,
        sheet.render()
    )
}

/// The analysis as JSON: where it is from, all of it, and the settings that follow.
#[derive(Serialize)]
struct Json<'a> {
    recording: &'a str,
    #[serde(flatten)]
    report: &'a AllanReport,
    settings: Settings,
}
