//! `northing`: the program. Each command is one file in `commands`; what they share is beside it.

mod calibration_file;
#[cfg(feature = "parquet")]
mod campaign_part;
#[cfg(feature = "parquet")]
mod campaign_report;
mod cli;
mod commands;
mod comparison;
mod comparison_report;
mod estimate_file;
mod estimation;
mod failure;
mod field_file;
mod input;
mod interrupt;
mod laboratory;
mod navigation_file;
mod navigation_run;
mod navigation_text;
mod output;
#[cfg(feature = "parquet")]
mod parquet_table;
mod peers_file;
mod progress;
mod quantity;
mod recordings;
mod rest_span;
mod run_estimator;
mod run_report;
mod scenario_input;
mod settings;
mod sheet;
mod span;
mod summary_text;
mod table;
mod toml_file;
mod track_report;
mod virtual_recording;

use std::process::ExitCode;

use clap::Parser as _;
use cli::{Cli, Command};

fn main() -> ExitCode {
    interrupt::install();
    match Cli::try_parse() {
        Ok(cli) => failure::exit_code(&execute(cli)),
        Err(error) => failure::exit_code_of_arguments(&error),
    }
}

fn execute(cli: Cli) -> anyhow::Result<()> {
    match cli.command {
        #[cfg(feature = "live")]
        None => commands::live::execute(&commands::live::LiveArgs::alone()),
        #[cfg(not(feature = "live"))]
        None => output::print(cli::INTRODUCTION),
        #[cfg(feature = "live")]
        Some(Command::Live(args)) => commands::live::execute(&args),
        Some(Command::Demo(args)) => commands::demo::execute(&args),
        Some(Command::Run(args)) => commands::run::execute(&args),
        Some(Command::Compare(args)) => commands::compare::execute(&args),
        Some(Command::Benchmark(args)) => commands::benchmark::execute(&args),
        Some(Command::Track(args)) => commands::track::execute(&args),
        Some(Command::Calibrate(args)) => commands::calibrate::execute(&args),
        Some(Command::Convert(args)) => commands::convert::execute(&args),
        Some(Command::Simulate(args)) => commands::simulate::execute(&args),
        #[cfg(feature = "parquet")]
        Some(Command::MonteCarlo(args)) => commands::montecarlo::execute(&args),
        Some(Command::Experiment(args)) => commands::experiment::execute(&args),
        Some(Command::Tune(args)) => commands::tune::execute(&args),
        Some(Command::Estimators(args)) => commands::estimators::execute(&args),
    }
}
