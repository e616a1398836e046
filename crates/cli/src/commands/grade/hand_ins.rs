//! Hand-ins in folders, found and judged in parallel, in an order that depends on nothing else.

use std::fs::{self, File};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use northing_evaluation::exercises::{Card, Class, HandIn, Judged};
use northing_recording::has_extension;
use rayon::prelude::*;

use crate::files::shown;
use crate::interrupt;
use crate::progress::SharedProgress;

/// What was found and judged.
#[derive(Default)]
pub(super) struct Grading {
    pub(super) class: Class,
    /// Files that do not end in .zip.
    pub(super) left_out: Vec<String>,
    /// Hand-ins of other cards than the one that was asked for.
    pub(super) of_other_cards: usize,
}

/// Files of hand-ins, and others.
#[derive(Default)]
pub(super) struct Found {
    files: Vec<PathBuf>,
    left_out: Vec<String>,
}

/// The files behind the arguments, each once.
///
/// # Errors
/// A folder cannot be searched, or has no hand-in.
pub(super) fn find(paths: &[PathBuf]) -> Result<Found> {
    let mut found = Found::default();
    for path in paths {
        if !path.is_dir() {
            found.files.push(path.clone());
            continue;
        }
        let before = found.files.len();
        found.search(path)?;
        if found.files.len() == before {
            bail!(
                "{}: no hand-ins in this folder; expected files that end in .zip, as northing hand-in writes them",
                path.display()
            );
        }
    }
    found.files.sort();
    found.files.dedup();
    found.left_out.sort();
    Ok(found)
}

impl Found {
    fn search(&mut self, folder: &Path) -> Result<()> {
        let entries = fs::read_dir(folder).and_then(Iterator::collect::<Result<Vec<_>, _>>);
        let entries = entries.with_context(|| format!("{}: cannot search it", folder.display()))?;
        for entry in entries {
            let path = entry.path();
            if entry.file_name().to_string_lossy().starts_with('.') {
                continue;
            }
            // A link to a folder may lead back here.
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                self.search(&path)?;
            } else if has_extension(&path, "zip") {
                self.files.push(path);
            } else {
                self.left_out.push(shown(&path));
            }
        }
        Ok(())
    }
}

impl Grading {
    /// Judges every file; with a `card` the hand-ins of others are counted only.
    pub(super) fn judged(found: Found, card: Option<Card>) -> Self {
        let progress = SharedProgress::of_steps(found.files.len() as u64, "judging");
        let judge = |path: &PathBuf| {
            let outcome = (!interrupt::happened()).then(|| read(path));
            progress.step();
            outcome.map(|outcome| (shown(path), outcome.map_err(|error| format!("{error:#}"))))
        };
        let mut outcomes: Vec<_> = found.files.par_iter().filter_map(judge).collect();
        let all = outcomes.len();
        outcomes.retain(|(_, outcome)| {
            let of_card = |judged: &Judged| card.is_none_or(|card| card == judged.card);
            outcome.as_ref().map_or(true, of_card)
        });
        Self {
            of_other_cards: all - outcomes.len(),
            class: Class::of(outcomes),
            left_out: found.left_out,
        }
    }

    /// Why the program ends with an error although it has judged what it could.
    pub(super) fn failure(&self) -> Option<anyhow::Error> {
        let (file, reason) = self.class.not_judged.first()?;
        Some(match self.class.not_judged.len() {
            1 => anyhow!("{file}: {reason}"),
            n => anyhow!("{n} files cannot be judged; the first: {file}: {reason}"),
        })
    }
}

fn read(path: &Path) -> Result<Judged> {
    let file = File::open(path).context("cannot open it")?;
    let (_, judged) = HandIn::read(file)?;
    Ok(judged)
}
