//! A finished experiment as it is kept: what came out, what it ran with, and its samples beside it.
//!
//! A folder of the experiment's identifier holds `experiment.json` and `samples.bin`, as a session's zip does
//! (`northing_recording::lab_session`).

use std::collections::BTreeMap;
use std::io;
use std::path::Path;

use northing_evaluation::EstimatorKind;
use northing_evaluation::attitude::setup::Start;
use northing_evaluation::used_parameters::PROGRAM;
use northing_recording::lab_session::SAMPLES;
use northing_recording::wire::events;
use northing_recording::{SensorKind, WorldFrame};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::files::{self, Refused};
use super::options::SavedOptions;
use crate::experiments::{Finished, hash};
use crate::messages::SensorUse;
use crate::private;
use crate::session::experiment::Experiment;
use crate::to_page::{ExperimentRow, ResultCell};

/// What the file says of itself.
const FORMAT: &str = "northing-lab-experiment";
/// The version that this program writes.
const VERSION: u64 = 1;
/// The file beside the samples.
pub(crate) const FACTS: &str = "experiment.json";

/// Everything about an experiment but its samples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SavedExperiment {
    format: String,
    version: u64,
    program: String,
    /// What it is addressed by.
    pub id: String,
    /// What people call it.
    pub name: String,
    /// What people called the device.
    pub device: String,
    /// What the device is addressed by.
    pub device_id: String,
    /// When it ended, UTC.
    pub at: String,
    /// How long it was meant to be, s.
    pub seconds: f64,
    /// From the first to the last sample, s.
    pub duration_s: f64,
    /// The frame of its attitudes.
    pub world_frame: WorldFrame,
    /// The parameters in force, by name.
    pub settings: Value,
    /// What it is run with; read when it is run again.
    pub options: Value,
    /// The estimators that ran, by name.
    pub estimators: Vec<String>,
    /// The one of them that it is about.
    pub subject: String,
    /// States of the estimators at the first sample, by name.
    pub starts: Vec<(String, Start)>,
    /// What was changed while it ran.
    pub changed: Vec<String>,
    /// The sensors that delivered.
    pub sensors: Vec<SensorKind>,
    /// Those that were used.
    #[serde(rename = "use")]
    pub used: SensorUse,
    /// Of each estimator, in a few numbers.
    pub results: BTreeMap<String, ResultCell>,
    /// Of each estimator, the whole outcome, for whoever reads the file.
    pub summaries: Value,
    /// SHA-256 of the samples, in hexadecimal.
    pub hash: String,
}

impl SavedExperiment {
    /// Of an experiment that has been evaluated.
    #[must_use]
    pub fn of(finished: &Finished) -> Self {
        let row = finished.row();
        let starts = finished.experiment.starts.iter();
        let options = SavedOptions::of(&finished.options);
        Self {
            format: FORMAT.to_owned(),
            version: VERSION,
            program: PROGRAM.to_owned(),
            id: row.id,
            name: finished.experiment.name.clone(),
            device: row.device,
            device_id: row.device_id,
            at: row.at,
            seconds: finished.experiment.seconds,
            duration_s: row.duration_s,
            world_frame: finished.options.world_frame,
            settings: row.settings,
            options: serde_json::to_value(options).unwrap_or_default(),
            estimators: names(&finished.estimators),
            subject: row.subject,
            starts: starts
                .map(|(kind, state)| (kind.name().to_owned(), Start::of(state)))
                .collect(),
            changed: finished.experiment.changed.clone(),
            sensors: row.sensors,
            used: row.used,
            results: row.results,
            summaries: serde_json::to_value(&finished.summaries).unwrap_or_default(),
            hash: finished.hash.clone(),
        }
    }

    /// Its row in the table of experiments.
    #[must_use]
    pub fn row(&self, is_earlier: bool, has_samples: bool) -> ExperimentRow {
        ExperimentRow {
            id: self.id.clone(),
            device: self.device.clone(),
            device_id: self.device_id.clone(),
            name: match self.name.as_str() {
                "" => self.id.clone(),
                name => name.to_owned(),
            },
            at: self.at.clone(),
            duration_s: self.duration_s,
            asked_s: self.seconds,
            settings: self.settings.clone(),
            subject: self.subject.clone(),
            sensors: self.sensors.clone(),
            used: self.used,
            results: self.results.clone(),
            is_earlier,
            has_samples,
            is_archived: false,
        }
    }

    /// The experiment as it was, with the samples of its folder, run again.
    ///
    /// # Errors
    /// The samples are not there or are others, or it ran with what this program does not have, in a sentence.
    pub fn finished(&self, folder: &Path) -> Result<Finished, String> {
        let title = &self.name;
        let path = folder.join(SAMPLES);
        let bytes = std::fs::read(&path).map_err(|error| match error.kind() {
            io::ErrorKind::NotFound => format!(
                "the samples of `{title}` are not there any more ({} is missing): its result can be seen, but not run again",
                path.display()
            ),
            _ => format!("the samples of `{title}`: {}: {error}", path.display()),
        })?;
        let damaged =
            |text: String| format!("the samples of `{title}`: {}: {text}", path.display());
        let events = events::decode(&bytes).map_err(|error| damaged(error.to_string()))?;
        if hash(&events) != self.hash {
            return Err(damaged(
                "these are not the samples that were measured".to_owned(),
            ));
        }
        let options: SavedOptions = serde_json::from_value(self.options.clone())
            .map_err(|error| format!("`{title}` ran with settings of another version: {error}"))?;
        let options = options
            .options()
            .map_err(|error| format!("`{title}`: {error}"))?;
        let subject = EstimatorKind::named(&self.subject).ok_or_else(|| {
            format!(
                "`{title}` is about the estimator `{}`, which this lab was not started with",
                self.subject
            )
        })?;
        let known = |name: &String| EstimatorKind::named(name);
        let starts = self.starts.iter();
        let starts = starts.filter_map(|(name, start)| Some((known(name)?, start.state()?)));
        let finished = Finished {
            id: self.id.clone(),
            device: self.device_id.clone(),
            device_name: self.device.clone(),
            at: self.at.clone(),
            experiment: Experiment {
                name: self.name.clone(),
                seconds: self.seconds,
                starts: starts.collect(),
                changed: self.changed.clone(),
                events,
            },
            options,
            // The device's own orientation is found among the samples again.
            estimators: self
                .estimators
                .iter()
                .filter_map(known)
                .filter(|kind| *kind != EstimatorKind::Device)
                .collect(),
            subject,
            summaries: BTreeMap::new(),
            hash: String::new(),
            originals: Default::default(),
        };
        finished.evaluated()
    }
}

fn names(kinds: &[EstimatorKind]) -> Vec<String> {
    kinds.iter().map(|kind| kind.name().to_owned()).collect()
}

/// Writes an experiment into its folder: the samples first, so that one whose facts are there is whole.
pub(super) fn write(folder: &Path, finished: &Finished) -> io::Result<()> {
    private::create_folder(folder)?;
    let samples = events::encode(&finished.experiment.events);
    files::write(&folder.join(SAMPLES), &samples)?;
    files::write_json(&folder.join(FACTS), &SavedExperiment::of(finished))
}

/// Reads the facts of a folder.
pub(super) fn read(folder: &Path) -> Result<SavedExperiment, Refused> {
    let saved: SavedExperiment = files::read_json(&folder.join(FACTS), FORMAT, VERSION)?;
    let name = files::name_of(folder);
    match saved.id == name {
        true => Ok(saved),
        false => Err(Refused::Damaged(format!("it is of `{}`", saved.id))),
    }
}
