//! `northing calibrate magnetometer`: hard and soft iron from a device that is turned about.

use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use northing_core::calibration::{MagnetometerCalibration, MagnetometerLimits};
use northing_evaluation::calibration::magnetometer::MagnetometerSource;
use northing_evaluation::calibration::magnetometer::{FieldSamples, MagnetometerReport};
use northing_recording::atomic_file::write_whole;
use northing_report::{Source, magnetometer_html};
use serde::Serialize;

use super::OutputArgs;
use crate::arguments::input::{InputArgs, magnetometer_source};
use crate::arguments::span::SpanArgs;
use crate::files::magnetometer_calibration;
use crate::files::output::{print, print_json};
use crate::files::shown;
use crate::invocation::{called, command_line};
use crate::progress::watched;
use crate::text::sheet::Sheet;

/// Arguments of `calibrate magnetometer`.
#[derive(Debug, Args)]
#[command(
    long_about = "Fits hard iron (a shift) and soft iron (a stretch) of the magnetometer to a recording in which \
                  the device is turned through as many directions as possible, on one spot, away from iron, for \
                  20 seconds or more. Where too little of the sphere was seen it fits hard iron alone, or refuses \
                  with the reason.",
    after_help = "\
Examples:
  northing calibrate magnetometer turned.csv --out magnetometer.toml --report magnetometer.html
  northing calibrate magnetometer turned.csv --field-strength 48.2 --out magnetometer.toml
  northing run walk.csv --magnetometer-calibration magnetometer.toml"
)]
pub(super) struct MagnetometerArgs {
    /// The recording: file, Sensor Logger folder, or - for standard input
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
    #[command(flatten)]
    span: SpanArgs,
    /// Which magnetometer: device or uncalibrated; without it the uncalibrated one, if there is one
    #[arg(long, value_name = "WHICH", value_parser = magnetometer_source)]
    magnetometer: Option<MagnetometerSource>,
    /// Strength of the Earth's field at this place, to which samples are scaled
    #[arg(long, value_name = "MICROTESLA", value_parser = field_strength, allow_negative_numbers = true)]
    field_strength: Option<f64>,
    /// Write a report with plots: one HTML file for a browser
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
    #[command(flatten)]
    input: InputArgs,
}

fn field_strength(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(strength) if (10.0..=100.0).contains(&strength) => Ok(strength),
        _ => Err("expected microtesla, 22 to 67 on Earth, e.g. 48".to_owned()),
    }
}

/// Calibrates.
pub(super) fn execute(args: &MagnetometerArgs) -> Result<()> {
    args.span.check()?;
    args.output
        .check(&args.input, &args.recording, args.report.as_deref())?;
    let name = shown(&args.recording);
    let (report, issues) = calibrate(args, &name)?;
    let toml = magnetometer_calibration::to_toml(&report, &name)?;
    args.output.write_toml(&toml)?;
    if let Some(path) = &args.report {
        let command = command_line();
        let source = Source {
            recording: &name,
            command: Some(&command),
        };
        write_whole(
            path,
            magnetometer_html(&report, &source).as_bytes(),
            args.output.force,
        )?;
    }
    if args.output.prints_toml() {
        return print(&toml);
    }
    if args.output.json {
        return print_json(&Json::new(&name, &report, &issues));
    }
    let text = describe(&name, &report, &issues);
    let told = args.output.told(args.report.as_deref());
    let next = match args.output.file() {
        Some(file) => format!(
            "Use it with\n  {} run RECORDING --magnetometer-calibration {}\n",
            called(),
            file.display()
        ),
        None => "No calibration was written; --out FILE.toml keeps it for `northing run \
                 --magnetometer-calibration`.\n"
            .to_owned(),
    };
    print(&format!("{text}\n{told}{next}"))
}

fn calibrate(args: &MagnetometerArgs, name: &str) -> Result<(MagnetometerReport, Vec<String>)> {
    let mut recording = args.input.open(&args.recording)?;
    let mut samples = FieldSamples::default();
    for event in args.span.of(watched(&mut recording, "calibrating")) {
        samples.add(&event?);
    }
    let limits = MagnetometerLimits {
        field_strength_ut: args.field_strength,
        ..MagnetometerLimits::default()
    };
    let report = samples
        .calibrate(args.magnetometer, &limits)
        .with_context(|| name.to_owned())?;
    Ok((report, recording.issues().sentences()))
}

fn describe(name: &str, report: &MagnetometerReport, issues: &[String]) -> String {
    let c = &report.field.calibration;
    let mut sheet = Sheet::default();
    sheet.sentences("verdict", &report.sentences);
    let [x, y, z] = c.hard_iron_ut;
    sheet.row("hard iron", format!("{x:+.2} {y:+.2} {z:+.2} microtesla"));
    for (index, [x, y, z]) in c.soft_iron.iter().enumerate() {
        let label = if index == 0 { "soft iron" } else { "" };
        sheet.row(label, format!("{x:+.4} {y:+.4} {z:+.4}"));
    }
    sheet.row(
        "calibrated",
        format!("{:.2} microtesla in every direction", c.field_strength_ut),
    );
    sheet.sentences("recording", issues);
    format!(
        "{name}: magnetometer `{}`\n\n{}",
        report.field.magnetometer.name(),
        sheet.render()
    )
}

/// The calibration as JSON: where it is from, then its values.
#[derive(Serialize)]
struct Json<'a> {
    recording: &'a str,
    magnetometer: MagnetometerSource,
    duration_s: f64,
    sentences: &'a [String],
    issues: &'a [String],
    #[serde(flatten)]
    calibration: &'a MagnetometerCalibration<f64>,
}

impl<'a> Json<'a> {
    fn new(recording: &'a str, report: &'a MagnetometerReport, issues: &'a [String]) -> Self {
        Self {
            recording,
            magnetometer: report.field.magnetometer,
            duration_s: report.duration_s,
            sentences: &report.sentences,
            issues,
            calibration: &report.field.calibration,
        }
    }
}
