//! The table of finished experiments: those of this start with their samples in memory, earlier ones on the disk.

use std::collections::VecDeque;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use northing_recording::lab_session::SAMPLES;

use crate::experiments::Finished;
use crate::lab::lock;
use crate::persistence::{Persistence, SavedExperiment};
use crate::to_page::ExperimentRow;

/// Experiments in the table.
const MOST_EXPERIMENTS: usize = 500;
/// Events of all experiments that are in memory: about 700 MB.
const MOST_EVENTS: usize = 12_000_000;

/// One experiment; it has at least one of the two.
#[derive(Debug)]
struct Entry {
    id: String,
    /// With its samples.
    held: Option<Arc<Finished>>,
    /// What is on the disk of it: of an experiment that was read there, or whose samples have been let go.
    saved: Option<Arc<SavedExperiment>>,
    is_on_disk: bool,
    /// It is of an earlier start of the lab.
    is_earlier: bool,
    /// It is not to be seen in the table.
    is_archived: bool,
}

impl Entry {
    /// The device that it is of.
    fn device(&self) -> Option<&str> {
        let held = self.held.as_ref().map(|held| held.device.as_str());
        held.or_else(|| self.saved.as_ref().map(|saved| saved.device_id.as_str()))
    }
}

/// The experiments of a lab.
#[derive(Debug)]
pub(crate) struct ExperimentTable {
    entries: Mutex<VecDeque<Entry>>,
    next: AtomicU64,
    persistence: Option<Arc<Persistence>>,
}

impl ExperimentTable {
    /// With the experiments of earlier starts. Returns a sentence if these are more than a table holds.
    pub(crate) fn new(
        persistence: Option<Arc<Persistence>>,
        mut earlier: Vec<SavedExperiment>,
        last_number: u64,
    ) -> (Self, Option<String>) {
        let too_many = earlier.len().saturating_sub(MOST_EXPERIMENTS);
        earlier.drain(..too_many);
        let is_archived = |id: &str| {
            let kept = persistence.as_ref();
            kept.is_some_and(|kept| kept.is_archived(id))
        };
        let entries = earlier.into_iter().map(|saved| Entry {
            is_archived: is_archived(&saved.id),
            id: saved.id.clone(),
            held: None,
            saved: Some(Arc::new(saved)),
            is_on_disk: true,
            is_earlier: true,
        });
        let entries = entries.collect();
        let table = Self {
            entries: Mutex::new(entries),
            next: AtomicU64::new(last_number.saturating_add(1)),
            persistence,
        };
        let note = (too_many > 0).then(|| {
            format!("The {too_many} oldest experiments stay in the folder for data and are not in the table, which holds {MOST_EXPERIMENTS}.")
        });
        (table, note)
    }

    /// An identifier for the next experiment.
    pub(crate) fn next_id(&self) -> String {
        let number = self.next.fetch_add(1, Ordering::Relaxed);
        format!("e{number}")
    }

    /// Takes a finished experiment; [`Self::save`] writes it.
    pub(crate) fn add(&self, finished: Finished) -> Arc<Finished> {
        let finished = Arc::new(finished);
        let mut entries = lock(&self.entries);
        entries.push_back(Entry {
            id: finished.id.clone(),
            held: Some(finished.clone()),
            saved: None,
            is_on_disk: false,
            is_earlier: false,
            is_archived: false,
        });
        make_room(&mut entries, &finished.id);
        finished
    }

    /// Writes an experiment of the table and waits for it.
    pub(crate) fn save(&self, finished: &Finished) {
        let Some(persistence) = &self.persistence else {
            return;
        };
        if !persistence.save_experiment(finished) {
            return;
        }
        let mut entries = lock(&self.entries);
        match entries.iter_mut().find(|entry| entry.id == finished.id) {
            Some(entry) => {
                entry.is_on_disk = true;
                // Archived while it was written.
                if entry.is_archived {
                    drop(persistence.archive(&finished.id, true));
                }
            }
            // It was deleted meanwhile; where that fails it is seen at the next start.
            None => drop(persistence.delete_experiment(&finished.id)),
        }
    }

    /// An experiment with its samples; they are read where they are not in memory.
    ///
    /// # Errors
    /// There is none of this id, or its samples cannot be had, in a sentence.
    pub(crate) fn get(&self, id: &str) -> Result<Arc<Finished>, String> {
        let unknown = || format!("there is no experiment `{id}`");
        let saved = {
            let entries = lock(&self.entries);
            let entry = entries.iter().find(|entry| entry.id == id);
            let entry = entry.ok_or_else(unknown)?;
            match &entry.held {
                Some(held) => return Ok(held.clone()),
                None => entry.saved.clone().ok_or_else(unknown)?,
            }
        };
        let folder = self.folder(id).ok_or_else(unknown)?;
        let finished = Arc::new(saved.finished(&folder)?);
        let mut entries = lock(&self.entries);
        if let Some(entry) = entries.iter_mut().find(|entry| entry.id == id) {
            entry.held = Some(finished.clone());
        }
        make_room(&mut entries, id);
        Ok(finished)
    }

    fn folder(&self, id: &str) -> Option<PathBuf> {
        let persistence = self.persistence.as_ref()?;
        Some(persistence.experiment_folder(id))
    }

    /// Takes an experiment away, from the disk, too.
    ///
    /// # Errors
    /// There is none of this id, or it cannot be deleted, in a sentence.
    pub(crate) fn delete(&self, id: &str) -> Result<(), String> {
        let mut entries = lock(&self.entries);
        let place = entries.iter().position(|entry| entry.id == id);
        let place = place.ok_or_else(|| format!("there is no experiment `{id}`"))?;
        if let Some(persistence) = &self.persistence {
            let deleted = persistence.delete_experiment(id);
            deleted.map_err(|error| format!("the experiment `{id}` stays: {error}"))?;
        }
        entries.remove(place);
        Ok(())
    }

    /// Hides an experiment from the table or brings it back; its files stay as they are.
    ///
    /// # Errors
    /// There is none of this id, or it cannot be written down, in a sentence.
    pub(crate) fn archive(&self, id: &str, archived: bool) -> Result<(), String> {
        let mut entries = lock(&self.entries);
        let entry = entries.iter_mut().find(|entry| entry.id == id);
        let entry = entry.ok_or_else(|| format!("there is no experiment `{id}`"))?;
        if let Some(persistence) = self.persistence.as_ref().filter(|_| entry.is_on_disk) {
            let noted = persistence.archive(id, archived);
            noted.map_err(|error| format!("the experiment `{id}` stays as it is: {error}"))?;
        }
        entry.is_archived = archived;
        Ok(())
    }

    /// The rows, the oldest first.
    pub(crate) fn rows(&self) -> Vec<ExperimentRow> {
        let entries = lock(&self.entries);
        entries.iter().filter_map(|entry| self.row(entry)).collect()
    }

    /// The device of an experiment.
    pub(crate) fn device_of(&self, id: &str) -> Option<String> {
        let entries = lock(&self.entries);
        let entry = entries.iter().find(|entry| entry.id == id)?;
        entry.device().map(str::to_owned)
    }

    /// The rows of one device, the oldest first.
    pub(crate) fn rows_of(&self, device: &str) -> Vec<ExperimentRow> {
        let entries = lock(&self.entries);
        let own = entries
            .iter()
            .filter(|entry| entry.device() == Some(device));
        own.filter_map(|entry| self.row(entry)).collect()
    }

    /// How many there are of one device.
    pub(crate) fn count_of(&self, device: &str) -> usize {
        let entries = lock(&self.entries);
        let own = entries
            .iter()
            .filter(|entry| entry.device() == Some(device));
        own.count()
    }

    /// The newest row of one device.
    pub(crate) fn newest_of(&self, device: &str) -> Option<ExperimentRow> {
        let entries = lock(&self.entries);
        let mut newest = entries.iter().rev();
        self.row(newest.find(|entry| entry.device() == Some(device))?)
    }

    fn row(&self, entry: &Entry) -> Option<ExperimentRow> {
        let is_archived = entry.is_archived;
        self.row_of(entry)
            .map(|row| ExperimentRow { is_archived, ..row })
    }

    fn row_of(&self, entry: &Entry) -> Option<ExperimentRow> {
        // One that was read again keeps the results of then.
        if let Some(saved) = &entry.saved {
            let is_there = |folder: PathBuf| folder.join(SAMPLES).is_file();
            let has_samples = entry.held.is_some() || self.folder(&entry.id).is_some_and(is_there);
            return Some(saved.row(entry.is_earlier, has_samples));
        }
        entry.held.as_ref().map(|finished| finished.row())
    }
}

/// Lets samples go that are on the disk, then experiments that are not, the oldest first and never this one.
fn make_room(entries: &mut VecDeque<Entry>, spared: &str) {
    let events = |entries: &VecDeque<Entry>| -> usize {
        let held = entries.iter().filter_map(|entry| entry.held.as_ref());
        held.map(|finished| finished.experiment.events.len()).sum()
    };
    while entries.len() > MOST_EXPERIMENTS {
        entries.pop_front();
    }
    while events(entries) > MOST_EVENTS {
        let Some(place) = entries
            .iter()
            .position(|entry| entry.held.is_some() && entry.id != spared)
        else {
            return;
        };
        let entry = &mut entries[place];
        let held = entry.held.take();
        match held {
            Some(held) if entry.is_on_disk => {
                let saved = || Arc::new(SavedExperiment::of(&held));
                entry.saved.get_or_insert_with(saved);
            }
            _ => drop(entries.remove(place)),
        }
    }
}
