//! The commands of the program and their help.

use clap::{Parser, Subcommand};

#[cfg(feature = "live")]
use crate::commands::live;
#[cfg(feature = "parquet")]
use crate::commands::montecarlo;
use crate::commands::{
    benchmark, calibrate, compare, convert, demo, estimators, experiment, run, simulate, track,
    tune,
};

/// Which way does a device point, and how sure are we?
#[derive(Debug, Parser)]
#[command(
    name = "northing",
    version,
    about = "Which way does a device point, and how sure are we?",
    long_about = "Which way does a device point, and how sure are we? Northing estimates attitude from \
                  recordings of phones and IMUs, with an uncertainty that can be trusted, and says in \
                  words whether the tuning is consistent.",
    after_help = HELP_END,
    disable_help_subcommand = true
)]
pub(crate) struct Cli {
    /// What to do; without it the lab starts.
    #[command(subcommand)]
    pub(crate) command: Option<Command>,
}

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// The lab: phones deliver into it, a page shows it; what `northing` alone starts
    #[cfg(feature = "live")]
    Live(live::LiveArgs),
    /// A virtual phone with known truth, the lab's steps on it, and a report: start here
    Demo(demo::DemoArgs),
    /// Estimate attitude or position over one recording and say how good it is
    Run(Box<run::RunArgs>),
    /// Several recordings and estimators in one table
    Compare(Box<compare::CompareArgs>),
    /// All estimators, and other people's, over folders of recordings: who is how wrong
    Benchmark(benchmark::BenchmarkArgs),
    /// Find and follow targets in recordings of radar, lidar, cameras and AIS
    Track(track::TrackArgs),
    /// Measure what a sensor does wrong: at rest, turned about, or over hours
    Calibrate(calibrate::CalibrateArgs),
    /// Write a recording in another format
    Convert(convert::ConvertArgs),
    /// One run of a tracking scenario: truth, navigation and every tracker
    Simulate(simulate::SimulateArgs),
    /// Many runs of a tracking scenario: who is how wrong, and who knows
    #[cfg(feature = "parquet")]
    #[command(name = "montecarlo")]
    MonteCarlo(Box<montecarlo::MonteCarloArgs>),
    /// Experiments of the literature, made again: who is better, by how much, at what cost
    Experiment(experiment::ExperimentArgs),
    /// Fit the noise of a navigation estimator to a recording, and say whether it holds
    Tune(tune::TuneArgs),
    /// List the estimators and their parameters
    Estimators(estimators::EstimatorsArgs),
}

/// Where to begin.
const HELP_END: &str = if cfg!(feature = "live") {
    "Without a command the lab starts: its page opens in a browser, and virtual phones are one click away. No \
     browser? Try `northing demo`. Each command has its own help with examples: northing run --help"
} else {
    "Start with `northing demo`. Each command has its own help with examples: northing run --help"
};

/// What `northing` alone prints where there is no lab to start.
#[cfg(not(feature = "live"))]
pub(crate) const INTRODUCTION: &str = "\
northing: which way does a device point, and how sure are we?

  northing demo                          a virtual phone, the lab's steps, a report: start here
  northing run walk.zip --report w.html  one recording: attitude, uncertainty, verdicts
  northing compare a.csv b.csv           several recordings and estimators in one table
  northing benchmark attitude --data d   all estimators, and others', over folders
  northing track harbour.toml            targets in recordings of radar, cameras and AIS
  northing calibrate rest desk.csv       bias, noise and references of a device at rest
  northing calibrate magnetometer t.csv  hard and soft iron of a device turned in all directions
  northing calibrate allan night.csv     noise over averaging time, and the Q that follows
  northing convert walk.zip walk.csv     a recording in another format
  northing simulate scenario.toml        one run of a tracking scenario
  northing montecarlo scenario.toml      many runs: who is how wrong, and who knows
  northing experiment observers          observers in cascade, judged: errors, gains, cost
  northing tune drive.toml               noise parameters fitted to a recording
  northing estimators                    the estimators and their parameters

`northing COMMAND --help` says more, with examples.
";
