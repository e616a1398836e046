//! `northing calibrate`: what a sensor does wrong, measured before it is used.

mod allan;
mod magnetometer;
pub(crate) mod rest;

use std::path::{Path, PathBuf};

use anyhow::{Result, bail};
use clap::{Args, Subcommand};
use northing_recording::atomic_file::write_whole;

use crate::arguments::input::{DataArgs, InputArgs};
use crate::files::STDIN as STDOUT;
use crate::files::output::{check_free, report_written, same_file};

/// Arguments of `calibrate`.
#[derive(Debug, Args)]
#[command(subcommand_required = true, arg_required_else_help = false)]
pub(crate) struct CalibrateArgs {
    #[command(subcommand)]
    what: What,
}

#[derive(Debug, Subcommand)]
enum What {
    /// A device at rest: gyroscope bias, noise of each sensor, gravity and magnetic field
    Rest(Box<rest::RestArgs>),
    /// A device turned in all directions: hard and soft iron of its magnetometer
    Magnetometer(Box<magnetometer::MagnetometerArgs>),
    /// A device at rest for long: the Allan deviation, and the Q that follows from it
    Allan(Box<allan::AllanArgs>),
}

/// Calibrates.
pub(crate) fn execute(args: &CalibrateArgs) -> Result<()> {
    match &args.what {
        What::Rest(args) => rest::execute(args),
        What::Magnetometer(args) => magnetometer::execute(args),
        What::Allan(args) => allan::execute(args),
    }
}

/// What a calibration writes beside what it prints.
#[derive(Debug, Clone, Args)]
struct OutputArgs {
    /// Where to write the result (TOML); - writes it, and nothing else, to standard output
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Overwrite outputs that exist
    #[arg(long)]
    force: bool,
    /// Print one JSON document
    #[arg(long)]
    json: bool,
}

impl OutputArgs {
    /// Refuses outputs that cannot be written, before any work is done for them.
    fn check(&self, input: &InputArgs, recording: &Path, report: Option<&Path>) -> Result<()> {
        if self.prints_toml() && self.json {
            bail!("--json and --out - both want standard output; name a file for one of them");
        }
        if let (Some(out), Some(report)) = (&self.out, report)
            && same_file(out, report)
        {
            bail!(
                "--report and --out name the same file, {}; name two",
                report.display()
            );
        }
        for output in self.file().into_iter().chain(report) {
            check_free(output, self.force)?;
            input.check_not_read(output, recording, &DataArgs::default())?;
        }
        Ok(())
    }

    fn prints_toml(&self) -> bool {
        self.out.as_deref() == Some(Path::new(STDOUT))
    }

    /// The file to write the result to.
    fn file(&self) -> Option<&Path> {
        self.out.as_deref().filter(|_| !self.prints_toml())
    }

    /// Writes the result, if there is a file for it.
    fn write_toml(&self, toml: &str) -> Result<()> {
        match self.file() {
            Some(path) => Ok(write_whole(path, toml.as_bytes(), self.force)?),
            None => Ok(()),
        }
    }

    /// Lines that say what was written, for the end of what is printed.
    fn told(&self, report: Option<&Path>) -> String {
        let out = self
            .file()
            .map(|path| format!("Written to {}\n", path.display()));
        let report = report.map(|path| format!("{}\n", report_written(path)));
        out.into_iter().chain(report).collect()
    }
}
