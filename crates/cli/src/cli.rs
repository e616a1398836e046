//! The commands of the program and their help.

use clap::{Parser, Subcommand};

#[cfg(feature = "live")]
use crate::commands::live;
use crate::commands::{calibrate, compare, convert, demo, estimators, run};

/// Which way does a device point, and how sure are we?
#[derive(Debug, Parser)]
#[command(
    name = "northing",
    version,
    about = "Which way does a device point, and how sure are we?",
    long_about = "Which way does a device point, and how sure are we? Northing estimates attitude from \
                  recordings of phones and IMUs, with an uncertainty that can be trusted, and says in \
                  words whether the tuning is honest.",
    after_help = "Start with `northing demo`. Each command has its own help with examples: northing run --help",
    disable_help_subcommand = true
)]
pub(crate) struct Cli {
    /// What to do; without it the lab starts, if this is a terminal.
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// The lab: phones deliver into it, a page shows it; what `northing` alone starts at a terminal
    #[cfg(feature = "live")]
    Live(live::LiveArgs),
    /// A virtual phone with known truth, the lab's steps on it, and a report: start here
    Demo(demo::DemoArgs),
    /// Estimate the attitude of one recording and say how good it is
    Run(Box<run::RunArgs>),
    /// Several recordings and estimators in one table
    Compare(Box<compare::CompareArgs>),
    /// Measure bias, noise and references of a device at rest
    Calibrate(calibrate::CalibrateArgs),
    /// Write a recording in another format
    Convert(convert::ConvertArgs),
    /// List the estimators and their parameters
    Estimators(estimators::EstimatorsArgs),
}

/// What `northing` alone prints where it does not start the lab.
pub(crate) const INTRODUCTION: &str = "\
northing: which way does a device point, and how sure are we?

  northing demo                          a virtual phone, the lab's steps, a report: start here
  northing run walk.zip --report w.html  one recording: attitude, uncertainty, verdicts
  northing compare a.csv b.csv           several recordings and estimators in one table
  northing calibrate rest desk.csv       bias, noise and references of a device at rest
  northing convert walk.zip walk.csv     a recording in another format
  northing estimators                    the estimators and their parameters

`northing COMMAND --help` says more, with examples.
";

/// The program as it was called, for commands that people may copy: its path, or `northing`.
pub(crate) fn called() -> String {
    let path = std::env::args_os()
        .next()
        .map(|path| path.to_string_lossy().into_owned());
    path.filter(|path| path.contains('/') && !path.contains(' '))
        .unwrap_or_else(|| "northing".to_owned())
}
