//! `northing`: the program.
//!
//! | folder | what is in it |
//! |---|---|
//! | `commands` | each command, one file |
//! | `arguments` | arguments that commands share, and what they mean |
//! | `text` | outcomes as text for people |
//! | `files` | what the program reads and writes beside recordings |

mod arguments;
mod cli;
mod commands;
mod failure;
mod files;
mod interrupt;
mod invocation;
mod progress;
mod text;

use std::process::ExitCode;

use clap::{CommandFactory as _, Parser as _};
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
        None => files::output::print(cli::INTRODUCTION),
        #[cfg(feature = "live")]
        Some(Command::Live(args)) => commands::live::execute(&args),
        Some(Command::Demo(args)) => commands::demo::execute(&args),
        Some(Command::Run(args)) => commands::run::execute(&args),
        #[cfg(feature = "ros")]
        Some(Command::Ros(args)) => commands::ros::execute(&args),
        Some(Command::Compare(args)) => commands::compare::execute(&args),
        Some(Command::Benchmark(args)) => commands::benchmark::execute(&args),
        Some(Command::Track(args)) => commands::track::execute(&args),
        Some(Command::Calibrate(args)) => commands::calibrate::execute(&args),
        Some(Command::Describe(args)) => commands::describe::execute(&args),
        Some(Command::Info(args)) => commands::info::execute(&args),
        Some(Command::Convert(args)) => commands::convert::execute(&args),
        Some(Command::Simulate(args)) => commands::simulate::execute(&args),
        #[cfg(feature = "parquet")]
        Some(Command::MonteCarlo(args)) => commands::montecarlo::execute(&args),
        #[cfg(feature = "parquet")]
        Some(Command::Study(args)) => commands::study::execute(&args),
        Some(Command::Experiment(args)) => commands::experiment::execute(&args),
        Some(Command::Exercises(args)) => commands::exercises::execute(&args),
        Some(Command::HandIn(args)) => commands::hand_in::execute(&args),
        Some(Command::Grade(args)) => commands::grade::execute(&args),
        Some(Command::Tune(args)) => commands::tune::execute(&args),
        Some(Command::Estimators(args)) => commands::estimators::execute(&args),
        Some(Command::Completions(args)) => commands::completions::execute(&args, Cli::command()),
        Some(Command::Man(args)) => commands::man::execute(&args, Cli::command()),
    }
}
