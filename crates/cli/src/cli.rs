//! The commands of the program and their help.

use clap::{Parser, Subcommand};

#[cfg(feature = "live")]
use crate::commands::live;
#[cfg(feature = "parquet")]
use crate::commands::montecarlo;
#[cfg(feature = "ros")]
use crate::commands::ros;
#[cfg(feature = "parquet")]
use crate::commands::study;
use crate::commands::{
    benchmark, calibrate, compare, completions, convert, demo, describe, estimators, exercises,
    experiment, grade, hand_in, info, man, run, simulate, track, tune,
};

/// Attitude, navigation and tracking from noisy sensors.
#[derive(Debug, Parser)]
#[command(
    name = "northing",
    version,
    about = "Which way is it pointing, where is it, and where are the others?",
    long_about = "Which way is it pointing, where is it, and where are the others? Northing estimates attitude, \
                  position and targets from recordings of phones, inertial units, GNSS receivers and radars, each \
                  with a covariance, and says whether that is consistent.",
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
    /// Start the live lab (default): phones stream to this computer, results in the browser
    #[cfg(feature = "live")]
    Live(live::LiveArgs),
    /// The lab's steps on a virtual phone with known truth, and a report: start here
    Demo(demo::DemoArgs),
    /// Estimate attitude or position over one recording: errors, consistency, report
    Run(Box<run::RunArgs>),
    /// A node of ROS 2, without ROS: sensors in, attitude or position with covariance out
    #[cfg(feature = "ros")]
    Ros(Box<ros::RosArgs>),
    /// Compare estimators over recordings, in one table
    Compare(Box<compare::CompareArgs>),
    /// Attitude or navigation over folders of recordings, beside third-party baselines or extrapolated fixes
    Benchmark(benchmark::BenchmarkArgs),
    /// Track targets in recordings of radar, lidar, cameras and AIS
    Track(track::TrackArgs),
    /// Sensor calibration: rest, magnetometer, Allan variance
    Calibrate(calibrate::CalibrateArgs),
    /// Draft the manifest of tables that do not open by themselves: columns, units, axes, with reasons
    Describe(describe::DescribeArgs),
    /// What a recording holds: sensors, rates, pauses, frames, what was left out
    Info(info::InfoArgs),
    /// Write a recording in another format
    Convert(convert::ConvertArgs),
    /// Simulate one run of a tracking scenario: truth, navigation and every tracker
    Simulate(simulate::SimulateArgs),
    /// Monte Carlo campaign: RMSE and NEES of each tracker over many runs of a scenario
    #[cfg(feature = "parquet")]
    #[command(name = "montecarlo")]
    MonteCarlo(Box<montecarlo::MonteCarloArgs>),
    /// Study: estimators with varied parameters and seeds over recordings or worlds, a row a run
    #[cfg(feature = "parquet")]
    Study(Box<study::StudyArgs>),
    /// Experiments of the literature, reproduced: errors, gains, cost
    Experiment(experiment::ExperimentArgs),
    /// Exercise cards of the laboratory course: what to do, and what to answer
    Exercises(exercises::ExercisesArgs),
    /// Make the file that is handed in for an exercise card: recording, settings and answers, judged at once
    HandIn(Box<hand_in::HandInArgs>),
    /// Judge the hand-ins of a class by running them again: a table with the reasons
    Grade(grade::GradeArgs),
    /// Fit noise parameters of an estimator by maximum likelihood, checked on held-out data
    Tune(tune::TuneArgs),
    /// List the estimators and their parameters
    Estimators(estimators::EstimatorsArgs),
    /// Print a completion script for a shell
    Completions(completions::CompletionsArgs),
    /// Write the manual pages, one file a command
    Man(man::ManArgs),
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
northing: which way is it pointing, where is it, and where are the others?

  northing demo                          a virtual phone, the lab's steps, a report: start here
  northing run walk.zip --report w.html  one recording: attitude or position, consistency, report
  northing compare a.csv b.csv           several recordings and estimators in one table
  northing benchmark attitude --data d   all estimators beside third-party baselines
  northing benchmark navigation --data d GNSS/INS over a folder, beside extrapolated fixes
  northing track harbour.toml            targets in recordings of radar, cameras and AIS
  northing calibrate rest desk.csv       bias, noise and references of a device at rest
  northing calibrate magnetometer t.csv  hard and soft iron of a device turned in all directions
  northing calibrate allan night.csv     noise over averaging time, and the Q that follows
  northing describe imu.txt              what the columns of a table are, guessed with reasons
  northing info walk.zip                 sensors, rates, pauses and frames of a recording
  northing convert walk.zip walk.csv     a recording in another format
  northing simulate scenario.toml        one run of a tracking scenario
  northing montecarlo scenario.toml      many runs: RMSE and NEES of each tracker
  northing study study.toml              estimators x parameters x seeds, a row a run
  northing experiment observers          observers in cascade: errors, gains, cost
  northing experiment attitude-worlds    attitude on random worlds: accuracy, coverage, causes
  northing experiment navigation-worlds  GNSS/INS on random worlds: lost, coverage, heading
  northing experiment faults             faults of sensors, injected: cost, recovery, detection
  northing exercises                     the cards of the laboratory course
  northing hand-in bias rest.csv         the file that a student hands in for a card, judged at once
  northing grade class/                  the hand-ins of a class, run again, in one table
  northing tune drive.toml               noise parameters fitted to a recording
  northing estimators                    the estimators and their parameters
  northing completions bash              commands and options completed by the shell
  northing man share/man/man1            the manual pages

`northing COMMAND --help` says more, with examples.
";
