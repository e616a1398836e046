//! Scenario files on the command line.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use clap::Args;
use northing_experiments::radar::TrackerKind;
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
    /// Trackers, separated by commas; without it those of the scenario, or all
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = tracker)]
    pub(crate) trackers: Vec<TrackerKind>,
}

fn tracker(name: &str) -> Result<TrackerKind, String> {
    TrackerKind::parse(name).map_err(|error| error.to_string())
}

/// Reads a scenario.
pub(crate) fn read(path: &Path, variant: Option<&str>) -> Result<Scenario> {
    let name = path.display().to_string();
    let text = fs::read_to_string(path).with_context(|| format!("{name}: cannot read it"))?;
    let file = ScenarioFile::parse(&name, &text)?;
    Ok(file.scenario(variant)?)
}
