//! `northing experiment`: experiments of the literature, made again, those of random worlds, and a campaign of faults.

mod attitude_worlds;
mod faults;
mod frame;
mod navigation_worlds;
mod observers;
mod tracking_worlds;

use anyhow::Result;
use clap::{Args, Subcommand};

/// Arguments of `experiment`.
#[derive(Debug, Args)]
pub(crate) struct ExperimentArgs {
    #[command(subcommand)]
    experiment: ExperimentCommand,
}

/// The experiments.
#[derive(Debug, Subcommand)]
enum ExperimentCommand {
    /// Observers in cascade: is the rotation of an EKF worth its time?
    Observers(observers::ObserversArgs),
    /// Attitude on random worlds: is it right, does it state its error, is the true cause named?
    AttitudeWorlds(attitude_worlds::AttitudeWorldsArgs),
    /// GNSS/INS on random worlds: is it ever lost, and does it state its error?
    NavigationWorlds(navigation_worlds::NavigationWorldsArgs),
    /// Trackers of many targets on random scenes: are they found, kept, and their errors stated?
    TrackingWorlds(tracking_worlds::TrackingWorldsArgs),
    /// Faults of sensors, injected: what does each cost, and does an estimator recover?
    Faults(faults::FaultsArgs),
}

/// Makes an experiment.
pub(crate) fn execute(args: &ExperimentArgs) -> Result<()> {
    match &args.experiment {
        ExperimentCommand::Observers(args) => observers::execute(args),
        ExperimentCommand::AttitudeWorlds(args) => attitude_worlds::execute(args),
        ExperimentCommand::NavigationWorlds(args) => navigation_worlds::execute(args),
        ExperimentCommand::TrackingWorlds(args) => tracking_worlds::execute(args),
        ExperimentCommand::Faults(args) => faults::execute(args),
    }
}
