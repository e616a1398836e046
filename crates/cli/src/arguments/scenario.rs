//! Scenario files on the command line.

use std::path::PathBuf;

use anyhow::Result;
use clap::{Args, ValueEnum};
use northing_experiments::radar::TrackerKind;
use northing_recording::limits::read_description;
use northing_simulation::scenario::schema::NavigationFilter;
use northing_simulation::scenario::{Scenario, ScenarioFile};

/// Which scenario, and what of it.
#[derive(Debug, Args)]
pub(crate) struct ScenarioArgs {
    /// Scenario: a .toml file
    #[arg(value_name = "SCENARIO")]
    pub(crate) scenario: PathBuf,
    /// Variant of the scenario; without it the base
    #[arg(long, value_name = "NAME")]
    pub(crate) variant: Option<String>,
    /// Seed; without it that of the scenario
    #[arg(long, value_name = "NUMBER")]
    pub(crate) seed: Option<u64>,
    /// Navigation filter beside the trackers; without it that of the scenario
    #[arg(long, value_name = "FILTER")]
    pub(crate) navigation: Option<Navigation>,
    /// Trackers, separated by commas; without it those of the scenario, or all
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = tracker)]
    pub(crate) trackers: Vec<TrackerKind>,
}

/// The navigation filters by name.
#[derive(Debug, Clone, Copy, ValueEnum)]
pub(crate) enum Navigation {
    /// The error-state filter with a GNSS compass: the paper's
    ErrorState,
    /// The GNSS/INS of `northing run`, with position and heading of the same fixes
    GnssIns,
}

impl From<Navigation> for NavigationFilter {
    fn from(navigation: Navigation) -> Self {
        match navigation {
            Navigation::ErrorState => Self::ErrorState,
            Navigation::GnssIns => Self::GnssIns,
        }
    }
}

fn tracker(name: &str) -> Result<TrackerKind, String> {
    TrackerKind::parse(name).map_err(|error| error.to_string())
}

/// Reads a scenario.
pub(crate) fn read(wanted: &ScenarioArgs) -> Result<Scenario> {
    let path = &wanted.scenario;
    let name = path.display().to_string();
    let text = read_description(path)?;
    let file = ScenarioFile::parse(&name, &text)?;
    let mut scenario = file.scenario(wanted.variant.as_deref())?;
    if let Some(navigation) = wanted.navigation {
        scenario.navigation.filter = navigation.into();
    }
    Ok(scenario)
}
