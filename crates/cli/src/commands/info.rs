//! `northing info`: what a recording holds.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use northing_evaluation::RunEstimator;
use northing_evaluation::navigation::NavigationKind;
use northing_recording::{Contents, Issues, Metadata, SensorContents, SensorKind, WorldFrame};
use serde::Serialize;

use crate::arguments::input::{DataArgs, InputArgs};
use crate::files::output::{number, print, print_json};
use crate::files::shown;
use crate::invocation::called;
use crate::progress::watched;
use crate::text::sheet::Sheet;
use crate::text::table::Table;

/// Arguments of `info`.
#[derive(Debug, Args)]
#[command(
    long_about = "Reads a recording whole and says what it holds, as every other command would read it: sensors, \
                  samples, rates, pauses, frames, receiver and reference, and what was left out or odd. Nothing is \
                  estimated.",
    after_help = "\
Examples:
  northing info walk.zip
  northing info rosbag2_2026_05_04                 # topics used and left out
  northing info imu.txt --manifest imu.toml        # does the manifest say what was meant?
  northing info walk.zip --json"
)]
pub(crate) struct InfoArgs {
    /// The recording: file, manifest, folder, or - for standard input
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    data: DataArgs,
    #[command(flatten)]
    input: InputArgs,
}

/// What was found.
#[derive(Serialize)]
struct Info {
    recording: String,
    metadata: Metadata,
    duration_s: f64,
    sensors: Vec<SensorContents>,
    issues: Issues,
}

/// Reads and tells.
pub(crate) fn execute(args: &InfoArgs) -> Result<()> {
    let mut recording = args.input.open_in(&args.recording, &args.data)?;
    let mut contents = Contents::default();
    contents.read(&mut watched(&mut recording, "reading"))?;
    let info = Info {
        recording: shown(&args.recording),
        metadata: recording.metadata().clone(),
        duration_s: contents.duration_s(),
        sensors: contents.sensors(),
        issues: recording.issues().clone(),
    };
    if args.json {
        return print_json(&info);
    }
    print(&describe(&info))
}

fn describe(info: &Info) -> String {
    let meta = &info.metadata;
    let mut sheet = Sheet::default();
    sheet.row("format", meta.format.as_str());
    if let Some(device) = &meta.device {
        sheet.row("device", device.as_str());
    }
    sheet.row(
        "world frame",
        match meta.world_frame {
            WorldFrame::Enu => "east, north, up",
            WorldFrame::Ned => "north, east, down",
        },
    );
    let axes = meta.frames().body.in_words();
    sheet.row(
        "sensor axes",
        match meta.body_axes {
            Some(_) => axes.to_owned(),
            None => format!("taken as {axes}"),
        },
    );
    if let Some([x, y, z]) = meta.gnss_lever_arm_m {
        let arm = format!("{x} m forward, {y} m right, {z} m down of the inertial sensor");
        sheet.row("antenna", arm);
    }
    for (name, latency_s) in [
        ("fixes", meta.gnss_position_latency_s),
        ("GNSS velocity", meta.gnss_velocity_latency_s),
    ] {
        if latency_s != 0.0 {
            sheet.row(name, format!("true {latency_s} s before their stamps"));
        }
    }
    for (key, value) in &meta.extra {
        sheet.row(key, value.as_str());
    }
    sheet.sentences("notes", &info.issues.sentences());
    sheet.row("to run", to_run(info));
    let seconds = info.duration_s;
    format!(
        "{}: {seconds:.3} s of samples\n\n{}\n{}",
        info.recording,
        table(&info.sensors),
        sheet.render()
    )
}

/// The sensors of a recording, one a line.
pub(crate) fn table(sensors: &[SensorContents]) -> String {
    let mut table = Table::new(&[
        "<sensor", "samples", "rate Hz", "from s", "to s", "pause s", "at s", "mean", "<unit",
    ]);
    for one in sensors {
        table.row([
            one.sensor.name().to_owned(),
            match one.not_finite {
                0 => one.samples.to_string(),
                bad => format!("{} ({bad} not finite)", one.samples),
            },
            number(one.rate_hz, 2),
            format!("{:.3}", one.from_s),
            format!("{:.3}", one.to_s),
            format!("{:.3}", one.longest_pause_s),
            format!("{:.3}", one.longest_pause_at_s),
            number(one.mean_length, 3),
            unit(one.sensor).to_owned(),
        ]);
    }
    table.render("  ")
}

/// The unit of a vector's length.
const fn unit(sensor: SensorKind) -> &'static str {
    match sensor {
        SensorKind::Gyroscope | SensorKind::DeviceGyroscopeBias => "rad/s",
        SensorKind::Accelerometer => "m/s^2",
        SensorKind::Magnetometer | SensorKind::MagnetometerUncalibrated => "uT",
        SensorKind::Position => "m",
        SensorKind::Velocity | SensorKind::ReferenceVelocity => "m/s",
        _ => "",
    }
}

/// The commands for which the sensors are there.
fn to_run(info: &Info) -> String {
    let sensors: Vec<SensorKind> = info.sensors.iter().map(|one| one.sensor).collect();
    let has = |sensor| sensors.contains(&sensor);
    let mut commands = Vec::new();
    let chosen = RunEstimator::of_recording(None, &sensors);
    if let Some(RunEstimator::Navigation(NavigationKind::DeadReckoning)) = chosen {
        // Columns of a gyroscope may stand there, and be empty.
        commands.push(format!(
            "{} run {} --estimator {}",
            called(),
            info.recording,
            NavigationKind::DeadReckoning
        ));
    } else if has(SensorKind::Gyroscope) || chosen.is_some() {
        commands.push(format!("{} run {}", called(), info.recording));
    }
    let inertial = has(SensorKind::Gyroscope) && has(SensorKind::Accelerometer);
    if inertial && has(SensorKind::GnssPosition) {
        commands.push(format!(
            "{} run {} --estimator error-state",
            called(),
            info.recording
        ));
    }
    match commands.is_empty() {
        true => "there is neither a gyroscope nor a satellite receiver's position".to_owned(),
        false => commands.join("; "),
    }
}
