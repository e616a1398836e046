//! `northing calibrate rest`: bias, noise and references of a device that lies still.

use std::fmt::Write as _;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::Args;
use northing_core::calibration::RestCalibration;
use northing_evaluation::EvaluationError;
use northing_evaluation::field_calibration::FieldCalibration;
use northing_evaluation::options::MagnetometerSource;
use serde::Serialize;

use super::OutputArgs;
use crate::cli::called;
use crate::input::{InputArgs, magnetometer_source, shown};
use crate::interrupt::interruptible;
use crate::output::{print, print_json};
use crate::progress::Progress;
use crate::rest_span::{self, Calibrated, Span};
use crate::span::SpanArgs;
use crate::{calibration_file, field_file};

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
    args.output.check(&args.recording, None)?;
    let calibrated = calibrate(args)?;
    let recording = shown(&args.recording);
    let toml = calibration_file::to_toml(&calibrated, &recording)?;
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
    let field = path.map(field_file::read).transpose()?;
    let source = stream(args.magnetometer, field.as_ref())?;
    let mut recording = args.input.open(&args.recording)?;
    let span = Span {
        from_s: args.span.from,
        to_s: args.span.to,
    };
    let mut progress = Progress::of_stream("calibrating");
    let events = interruptible(recording.by_ref()).inspect(|_| progress.event());
    let events = events.map(|event| {
        let apply = |event| field.map_or(event, |field| field.apply(event));
        event.map(apply)
    });
    rest_span::calibrate(events, span, source)
        .with_context(|| format!("{}: no calibration", shown(&args.recording)))
}

/// The stream in use: the one asked for, otherwise that of the calibration, otherwise the device's.
fn stream(
    asked: Option<Asked>,
    field: Option<&FieldCalibration>,
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

/// Bias, noise and references, a line each, after `indent`.
pub(crate) fn values(c: &RestCalibration<f64>, indent: &str) -> String {
    let mut lines = Vec::new();
    let degrees = c.gyroscope_bias_rad_s.map(f64::to_degrees);
    let known = c.gyroscope_bias_std().to_degrees();
    let density = c.gyroscope_noise_density();
    let density = density
        .map(|d| format!(", {d:.2e} rad/s/sqrt(Hz)"))
        .unwrap_or_default();
    let std = rms(&c.gyroscope_std_rad_s);
    lines.push(format!("gyroscope      {} samples", c.gyroscope_samples));
    lines.push(format!(
        "  bias         {} deg/s, each known to {known:.4}",
        vector(&degrees, 3)
    ));
    lines.push(format!("  noise        {std:.5} rad/s a sample{density}"));
    match (c.gravity(), c.accelerometer_std()) {
        (Some(gravity), Some(std)) => {
            lines.push(format!(
                "accelerometer  {} samples",
                c.accelerometer_samples
            ));
            lines.push(format!("  gravity      {gravity:.3} m/s^2"));
            lines.push(format!("  noise        {std:.4} m/s^2 a sample"));
        }
        _ => lines.push("accelerometer  none: the tilt has no reference".to_owned()),
    }
    match (c.magnetic_field_ut(), c.magnetometer_std_ut()) {
        (Some(field), Some(std)) => {
            let dip = c
                .dip()
                .map(|dip| format!(", {:.1} deg below the horizon", dip.to_degrees()));
            let dip = dip.unwrap_or_default();
            lines.push(format!("magnetometer   {} samples", c.magnetometer_samples));
            lines.push(format!(
                "  field        {:.2} microtesla{dip}",
                field.norm()
            ));
            lines.push(format!("  noise        {std:.3} microtesla a sample"));
        }
        _ => lines.push("magnetometer   none: the heading has no reference".to_owned()),
    }
    lines
        .iter()
        .map(|line| format!("{indent}{line}\n"))
        .collect()
}

fn vector(v: &[f64; 3], decimals: usize) -> String {
    let [x, y, z] = v;
    format!("{x:+.decimals$} {y:+.decimals$} {z:+.decimals$}")
}

fn rms([x, y, z]: &[f64; 3]) -> f64 {
    ((x * x + y * y + z * z) / 3.0).sqrt()
}
