//! `northing calibrate rest`: bias, noise and references of a device that lies still.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use northing_core::calibration::RestCalibration;
use northing_evaluation::EvaluationError;
use northing_evaluation::calibration::magnetometer::MagnetometerSource;
use northing_evaluation::calibration::magnetometer::MagnetometerStreamCalibration;
use serde::Serialize;

use super::OutputArgs;
use crate::arguments::input::{InputArgs, magnetometer_source};
use crate::arguments::span::SpanArgs;
use crate::files::output::{print, print_json};
use crate::files::shown;
use crate::files::{magnetometer_calibration, rest_calibration};
use crate::invocation::called;
use crate::progress::watched;
use crate::text::rest_calibration::values;
use northing_evaluation::calibration::rest::{self, Calibrated, Span};

/// Arguments of `calibrate rest`.
#[derive(Debug, Args)]
#[command(
    long_about = "Measures a device at rest: the gyroscope's bias, the noise of each sensor, gravity and the \
                  magnetic field. Without --from and --to it takes the rest at the beginning of the \
                  recording. It refuses, with the reason, when the device moved, the samples are too few, or \
                  the field is not the Earth's.",
    after_help = "\
Examples:
  northing calibrate rest lab.csv --out lab-calibration.toml
  northing calibrate rest lab.csv --from 2 --to 12 --out lab-calibration.toml
  northing run lab.csv --calibration lab-calibration.toml"
)]
pub(super) struct RestArgs {
    /// The recording: file, Sensor Logger folder, or - for standard input
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
    #[command(flatten)]
    span: SpanArgs,
    /// Which magnetometer: device (calibrated by the device, the default), uncalibrated, or none: only
    /// gyroscope and accelerometer
    #[arg(long, value_name = "WHICH", value_parser = magnetometer_or_none)]
    magnetometer: Option<Asked>,
    /// Calibration of the magnetometer, a file that `northing calibrate magnetometer` wrote
    #[arg(long, value_name = "FILE")]
    magnetometer_calibration: Option<PathBuf>,
    #[command(flatten)]
    output: OutputArgs,
    #[command(flatten)]
    input: InputArgs,
}

/// The magnetometer that is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Asked {
    Stream(MagnetometerSource),
    None,
}

fn magnetometer_or_none(text: &str) -> Result<Asked, String> {
    match text {
        "none" => Ok(Asked::None),
        _ => magnetometer_source(text)
            .map(Asked::Stream)
            .map_err(|_| "expected device, uncalibrated or none".to_owned()),
    }
}

/// Calibrates.
pub(super) fn execute(args: &RestArgs) -> Result<()> {
    args.span.check()?;
    args.output.check(&args.input, &args.recording, None)?;
    let calibrated = calibrate(args)?;
    let recording = shown(&args.recording);
    let toml = rest_calibration::to_toml(&calibrated, &recording)?;
    args.output.write_toml(&toml)?;
    if args.output.prints_toml() {
        return print(&toml);
    }
    if args.output.json {
        return print_json(&CalibrationJson::new(&recording, &calibrated));
    }
    let mut text = describe(&recording, &calibrated);
    match args.output.file() {
        Some(out) => {
            let out = out.display();
            let _ = write!(
                text,
                "\nWritten to {out}; use it with\n  {} run {recording} --calibration {out}\n",
                called()
            );
        }
        None => text.push_str(
            "\nNothing was written; --out FILE.toml keeps it for `northing run --calibration`.\n",
        ),
    }
    print(&text)
}

fn calibrate(args: &RestArgs) -> Result<Calibrated> {
    let path = args.magnetometer_calibration.as_deref();
    let field = path.map(magnetometer_calibration::read).transpose()?;
    let source = stream(args.magnetometer, field.as_ref())?;
    let mut recording = args.input.open(&args.recording)?;
    let span = Span {
        from_s: args.span.from,
        to_s: args.span.to,
    };
    let events = watched(&mut recording, "calibrating").map(|event| {
        let apply = |event| field.map_or(event, |field| field.apply(event));
        event.map(apply)
    });
    rest::calibrate(events, span, source)
        .with_context(|| format!("{}: no calibration", shown(&args.recording)))
}

/// The stream in use: the one asked for, otherwise that of the calibration, otherwise the device's.
fn stream(
    asked: Option<Asked>,
    field: Option<&MagnetometerStreamCalibration>,
) -> Result<Option<MagnetometerSource>> {
    let calibrated = field.map(|field| field.magnetometer);
    let asked = match asked {
        Some(Asked::None) => return Ok(None),
        Some(Asked::Stream(stream)) => Some(stream),
        None => None,
    };
    match (asked, calibrated) {
        (Some(used), Some(calibrated)) if used != calibrated => {
            Err(EvaluationError::OtherMagnetometer {
                calibrated: calibrated.name(),
                used: used.name(),
            }
            .into())
        }
        (asked, calibrated) => Ok(Some(asked.or(calibrated).unwrap_or_default())),
    }
}

/// The calibration as JSON: where it is from, then its values.
#[derive(Serialize)]
pub(crate) struct CalibrationJson<'a> {
    recording: &'a str,
    from_s: f64,
    to_s: f64,
    #[serde(flatten)]
    calibration: &'a RestCalibration<f64>,
}

impl<'a> CalibrationJson<'a> {
    fn new(recording: &'a str, calibrated: &'a Calibrated) -> Self {
        let [from_s, to_s] = calibrated.span_s;
        Self {
            recording,
            from_s,
            to_s,
            calibration: &calibrated.calibration,
        }
    }
}

/// The calibration for people.
fn describe(recording: &str, calibrated: &Calibrated) -> String {
    let [from_s, to_s] = calibrated.span_s;
    format!(
        "{recording}: at rest from {from_s:.1} s to {to_s:.1} s\n{}",
        values(&calibrated.calibration, "  ")
    )
}
