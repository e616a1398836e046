//! `northing`: the program. Each command is one file in `commands`; what they share is beside it.

mod calibration_file;
mod cli;
mod commands;
mod comparison_report;
mod estimate_file;
mod estimation;
mod failure;
mod input;
mod interrupt;
mod laboratory;
mod output;
#[cfg(feature = "parquet")]
mod parquet_table;
mod progress;
mod recordings;
mod rest_span;
mod run_report;
mod settings;
mod sheet;
mod summary_text;
mod table;
mod virtual_recording;

#[cfg(feature = "live")]
use std::io::IsTerminal as _;
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
        // At a terminal the lab starts; a script gets an answer that ends.
        #[cfg(feature = "live")]
        None if std::io::stdout().is_terminal() => {
            commands::live::execute(&commands::live::LiveArgs::default())
        }
        None => output::print(cli::INTRODUCTION),
        #[cfg(feature = "live")]
        Some(Command::Live(args)) => commands::live::execute(&args),
        Some(Command::Demo(args)) => commands::demo::execute(&args),
        Some(Command::Run(args)) => commands::run::execute(&args),
        Some(Command::Compare(args)) => commands::compare::execute(&args),
        Some(Command::Calibrate(args)) => commands::calibrate::execute(&args),
        Some(Command::Convert(args)) => commands::convert::execute(&args),
        Some(Command::Estimators(args)) => commands::estimators::execute(&args),
    }
}
