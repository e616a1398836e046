//! `northing demo`: a virtual phone goes through the laboratory of the paper, and the truth is known.

mod laboratory;

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Args;
use northing_recording::atomic_file::write_whole;

use crate::arguments::virtual_recording::{self, PhoneArgs};
use crate::files::output::{check_free, print_json};
use laboratory::{Folder, Lab};

/// Arguments of `demo`.
#[derive(Debug, Args)]
#[command(
    long_about = "A virtual phone lies on a table, is turned about by hand, and is put back. Its sensors have \
                  bias and noise, and the truth is known. The demonstration runs the laboratory steps of \
                  Utrera & Vazquez (2021) on its recording: calibrate at rest, estimate, compare, and the \
                  final test. Everything is written into one folder.",
    after_help = "\
Examples:
  northing demo
  northing demo --seed 7 --motion brisk --disturbance magnetic --out disturbed
  northing demo --record-only phone.csv --duration 600
  northing demo --record-only - --samples 1000000 | northing run - --json"
)]
pub(crate) struct DemoArgs {
    /// Folder for recording, calibration, estimates and report
    #[arg(long, value_name = "FOLDER", default_value = "northing-demo")]
    out: PathBuf,
    /// Overwrite what an earlier demonstration wrote
    #[arg(long)]
    force: bool,
    /// Print one JSON document: the runs of step 5
    #[arg(long, conflicts_with = "record_only")]
    json: bool,
    /// Also draw one picture of the result (SVG)
    #[arg(long, value_name = "FILE", conflicts_with = "record_only")]
    picture: Option<PathBuf>,
    /// Only make the recording: a .csv or .parquet file, or - for CSV on standard output
    #[arg(long, value_name = "FILE")]
    record_only: Option<PathBuf>,
    /// Format of --record-only: csv or parquet
    #[arg(long, value_name = "FORMAT", requires = "record_only")]
    format: Option<String>,
    /// End the recording after so many samples (of all sensors together)
    #[arg(
        long,
        value_name = "NUMBER",
        requires = "record_only",
        conflicts_with = "duration"
    )]
    samples: Option<u64>,
    #[command(flatten)]
    phone: PhoneArgs,
}

/// Demonstrates, or only records.
pub(crate) fn execute(args: &DemoArgs) -> Result<()> {
    let phone = args.phone.phone(args.samples)?;
    if let Some(output) = &args.record_only {
        virtual_recording::check_format(output, args.format.as_deref())?;
        virtual_recording::write(&phone, args.samples, output, args.force)?;
        return Ok(());
    }
    let (recorded, script) = (phone.config().duration_s(), phone.config().script_s());
    if recorded < script {
        bail!(
            "--duration {recorded}: the laboratory takes {script} s; a shorter recording needs --record-only"
        );
    }
    let folder = Folder::prepare(&args.out, args.force)?;
    if let Some(picture) = &args.picture {
        check_free(picture, args.force)?;
    }
    let mut lab = Lab::new(&phone, &folder, args.json);
    lab.work()?;
    if let Some(picture) = &args.picture {
        write_whole(picture, lab.picture()?.as_bytes(), args.force)?;
    }
    if args.json {
        print_json(&lab.runs)
    } else {
        Ok(())
    }
}
