//! `northing convert`: a recording in another format, told by the extension of the output.

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::Args;
use northing_core::nalgebra::Vector3;
use northing_recording::{
    Issues, Recording, Sample, TrackPoint, TumWriter, create, has_extension, write_events,
    write_track,
};
use serde::Serialize;

use crate::arguments::input::{DataArgs, InputArgs};
use crate::files::output::{check_free, print, print_json};
use crate::files::shown;
use crate::progress::watched;

/// Arguments of `convert`.
#[derive(Debug, Args)]
#[command(
    long_about = "Writes a recording in another format: .csv or .parquet keep every sensor; .mcap has messages \
                  of ROS 2 (Imu, MagneticField); .tum is a \
                  trajectory of poses (the reference, or without one the device's own orientation); \
                  .kml, .gpx and .geojson are the fixes of a satellite receiver on a map.",
    after_help = "\
Examples:
  northing convert walk.zip walk.parquet
  northing convert walk.parquet walk.csv
  northing convert lab.mcap walk.csv --device anna
  northing convert walk.csv walk.mcap
  northing convert trial.csv trial.tum
  northing convert bridge.nmea voyage.kml
  northing convert imu.txt imu.csv --manifest imu.toml"
)]
pub(crate) struct ConvertArgs {
    /// The recording: file, Sensor Logger folder, or - for standard input
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
    /// Where to write it: .csv, .parquet, .mcap, .tum, .kml, .gpx or .geojson
    #[arg(value_name = "OUTPUT", required_unless_present = "out")]
    output: Option<PathBuf>,
    /// The same as OUTPUT
    #[arg(long, value_name = "FILE", conflicts_with = "output")]
    out: Option<PathBuf>,
    /// Overwrite the output if it exists
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

/// What was written.
#[derive(Serialize)]
struct Converted {
    recording: String,
    output: String,
    samples: u64,
    issues: Issues,
}

/// Converts.
pub(crate) fn execute(args: &ConvertArgs) -> Result<()> {
    let Some(output) = args.output.as_ref().or(args.out.as_ref()) else {
        bail!("no output named; expected northing convert RECORDING OUTPUT");
    };
    check_free(output, args.force)?;
    args.input
        .check_not_read(output, &args.recording, &args.data)?;
    let mut recording = args.input.open_in(&args.recording, &args.data)?;
    let samples = if has_extension(output, "tum") {
        write_trajectory(&mut recording, output, args)?
    } else if ["kml", "gpx", "geojson"]
        .iter()
        .any(|e| has_extension(output, e))
    {
        write_fixes(&mut recording, output, args)?
    } else {
        write_recording(&mut recording, output, args)?
    };
    let mut issues = recording.issues().clone();
    issues.notes.extend(left_out(&recording, output));
    let converted = Converted {
        recording: shown(&args.recording),
        output: output.display().to_string(),
        samples,
        issues,
    };
    if args.json {
        return print_json(&converted);
    }
    let mut text = format!(
        "{}: {} samples written to {}\n",
        converted.recording, samples, converted.output
    );
    for sentence in converted.issues.sentences() {
        text.push_str(&format!("  {sentence}\n"));
    }
    print(&text)
}

/// What messages of ROS have no place for.
#[cfg(feature = "mcap")]
fn left_out(recording: &Recording, output: &Path) -> Option<String> {
    use northing_recording::mcap::has_topic;
    let sensors = recording.sensors().iter();
    let names: Vec<_> = sensors
        .filter(|kind| !has_topic(**kind))
        .map(|kind| kind.name())
        .collect();
    let names = (!names.is_empty() && has_extension(output, "mcap")).then(|| names.join(", "))?;
    Some(format!(
        "Left out, because the messages have no place for it: {names}."
    ))
}

#[cfg(not(feature = "mcap"))]
fn left_out(_: &Recording, _: &Path) -> Option<String> {
    None
}

fn write_recording(recording: &mut Recording, output: &Path, args: &ConvertArgs) -> Result<u64> {
    let metadata = recording.metadata().clone();
    let sensors = recording.sensors().to_vec();
    let writer = create(output, &metadata, &sensors, args.force)?;
    Ok(write_events(writer, &mut watched(recording, "converting"))?)
}

/// The fixes of a satellite receiver as a track.
fn write_fixes(recording: &mut Recording, output: &Path, args: &ConvertArgs) -> Result<u64> {
    let mut points = Vec::new();
    for event in watched(recording, "converting") {
        let event = event?;
        if let Sample::GnssPosition(fix) = event.sample
            && fix.is_usable()
        {
            points.push(TrackPoint {
                time_ns: event.time_ns,
                latitude_rad: fix.latitude_rad,
                longitude_rad: fix.longitude_rad,
                height_m: fix.height_m.unwrap_or(f64::NAN),
                std_m: fix.std_m,
                attitude: None,
            });
        }
    }
    if points.is_empty() {
        bail!(
            "{}: no fix of a satellite receiver, so there is no track to write",
            shown(&args.recording)
        );
    }
    write_track(output, &recording.metadata().name, &points, args.force)?;
    Ok(points.len() as u64)
}

/// The reference as poses, or the device's orientation where the recording has no reference.
fn write_trajectory(recording: &mut Recording, output: &Path, args: &ConvertArgs) -> Result<u64> {
    use northing_recording::SensorKind::{DeviceOrientation, Reference};
    let sensors = recording.sensors();
    if !sensors.contains(&Reference) && !sensors.contains(&DeviceOrientation) {
        bail!(
            "{}: neither reference nor device orientation, so there are no poses to write; estimate them: \
             northing run {0} --out {}",
            shown(&args.recording),
            output.display()
        );
    }
    let from_reference = sensors.contains(&Reference);
    let mut writer = TumWriter::create(output, recording.metadata().world_frame, args.force)?;
    let mut position = Vector3::zeros();
    let mut samples = 0;
    for event in watched(recording, "converting") {
        let event = event?;
        let attitude = match event.sample {
            Sample::Position(p) if event.sample.is_finite() => {
                position = p;
                continue;
            }
            Sample::Reference(reference) if from_reference => reference.attitude,
            Sample::DeviceOrientation(attitude) if !from_reference => attitude,
            _ => continue,
        };
        if event.sample.is_finite() {
            writer.write(event.time_ns, &position, &attitude)?;
            samples += 1;
        }
    }
    writer.finish()?;
    Ok(samples)
}
