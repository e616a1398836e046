//! The recording of a virtual phone as the program makes it: which one, and where it goes.

use std::path::Path;

use anyhow::{Result, bail};
use clap::Args;
use northing_recording::{CsvWriter, EventWriter, RecordingError, SensorKind, create};
use northing_simulation::virtual_phone::{Disturbance, Motion};
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};

use crate::arguments::input::positive_seconds;
use crate::files::STDIN as STDOUT;
use crate::interrupt::happened;
use crate::progress::Progress;

/// What a virtual phone records.
const SENSORS: [SensorKind; 5] = [
    SensorKind::Gyroscope,
    SensorKind::Accelerometer,
    SensorKind::Magnetometer,
    SensorKind::DeviceOrientation,
    SensorKind::Reference,
];
/// The longest recording that time stamps allow, s.
const LONGEST_S: f64 = 4e9;

/// Options about the virtual phone.
#[derive(Debug, Clone, Args)]
#[command(next_help_heading = "The virtual phone")]
pub(crate) struct PhoneArgs {
    /// Determines everything random: noise, bias, motion
    #[arg(
        long,
        value_name = "NUMBER",
        default_value_t = 1,
        allow_negative_numbers = true
    )]
    seed: u64,
    /// Length of the recording; the script of 75 s starts again until it has passed
    #[arg(long, value_name = "SECONDS", value_parser = positive_seconds, allow_negative_numbers = true)]
    duration: Option<f64>,
    /// How it is moved: gentle, brisk, tumble, rest
    #[arg(long, value_name = "HOW", default_value = "gentle", value_parser = motion)]
    motion: Motion,
    /// What disturbs it: none, acceleration, magnetic, both
    #[arg(long, value_name = "WHAT", default_value = "none", value_parser = disturbance)]
    disturbance: Disturbance,
}

fn motion(name: &str) -> Result<Motion, String> {
    named(name, Motion::ALL, Motion::name)
}

fn disturbance(name: &str) -> Result<Disturbance, String> {
    named(name, Disturbance::ALL, Disturbance::name)
}

fn named<T: Copy, const N: usize>(
    name: &str,
    all: [T; N],
    of: fn(T) -> &'static str,
) -> Result<T, String> {
    let known = all.into_iter().find(|one| of(*one) == name);
    known.ok_or_else(|| format!("expected one of: {}", all.map(of).join(", ")))
}

impl PhoneArgs {
    /// The phone; with a number of samples it records for as long as they need.
    ///
    /// # Errors
    /// A duration that no recording can have.
    pub(crate) fn phone(&self, samples: Option<u64>) -> Result<VirtualPhone> {
        let duration_s = samples.map_or(self.duration, |_| Some(LONGEST_S));
        let config = VirtualPhoneConfig {
            seed: self.seed,
            duration_s,
            motion: self.motion,
            disturbance: self.disturbance,
            ..VirtualPhoneConfig::default()
        };
        Ok(VirtualPhone::new(config)?)
    }
}

/// Writes the recording to a file (by its extension), or as CSV to standard output (`-`), and
/// returns how many samples it has. Memory does not grow with its length.
///
/// # Errors
/// The output cannot be written, or standard output is asked for another format.
pub(crate) fn write(
    phone: &VirtualPhone,
    samples: Option<u64>,
    output: &Path,
    force: bool,
) -> Result<u64> {
    let metadata = phone.metadata();
    let mut writer: Box<dyn EventWriter> = if output == Path::new(STDOUT) {
        let out = std::io::stdout().lock();
        Box::new(CsvWriter::to_stream(
            out,
            "standard output",
            &metadata,
            &SENSORS,
        )?)
    } else {
        create(output, &metadata, &SENSORS, force)?
    };
    let mut progress = Progress::of_steps(
        samples.unwrap_or(phone.config().duration_s() as u64),
        "recording",
    );
    let start_ns = phone.config().start_time_ns;
    let mut written = 0;
    for event in phone.events() {
        if happened() {
            return Err(RecordingError::interrupted().into());
        }
        if samples.is_some_and(|samples| written >= samples) {
            break;
        }
        writer.write(&event)?;
        written += u64::from(event.sample.kind() != SensorKind::Reference);
        progress.event_at(
            samples.map_or((event.time_ns - start_ns) as u64 / 1_000_000_000, |_| {
                written
            }),
        );
    }
    writer.finish()?;
    Ok(written)
}

/// Refuses a format that the output cannot have.
pub(crate) fn check_format(output: &Path, format: Option<&str>) -> Result<()> {
    let Some(format) = format else { return Ok(()) };
    if output == Path::new(STDOUT) {
        if format != "csv" {
            bail!("--format {format}: a stream can only be csv; name a file for other formats");
        }
        return Ok(());
    }
    let extension = output
        .extension()
        .map(|e| e.to_string_lossy().to_lowercase());
    if extension.as_deref() != Some(format) {
        bail!(
            "{}: its name does not end in .{format}, as --format says",
            output.display()
        );
    }
    Ok(())
}
