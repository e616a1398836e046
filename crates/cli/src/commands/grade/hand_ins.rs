//! Hand-ins in folders, found and judged in parallel, in an order that depends on nothing else.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use northing_evaluation::exercises::{Card, HandIn, Judged, shared};
use rayon::prelude::*;

use crate::files::{has_extension, shown};
use crate::interrupt;
use crate::progress::SharedProgress;

/// A hand-in and its file.
pub(super) struct Graded {
    pub(super) file: String,
    pub(super) judged: Judged,
}

/// What was found and judged.
#[derive(Default)]
pub(super) struct Class {
    /// By student, card, time and file.
    pub(super) hand_ins: Vec<Graded>,
    /// Files that cannot be judged, with the reason.
    pub(super) not_judged: Vec<(String, String)>,
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

impl Class {
    /// Judges every file; with a `card` the hand-ins of others are counted only.
    pub(super) fn judged(found: Found, card: Option<Card>) -> Self {
        let progress = SharedProgress::of_steps(found.files.len() as u64, "judging");
        let judge = |path: &PathBuf| {
            let outcome = (!interrupt::happened()).then(|| read(path));
            progress.step();
            outcome.map(|outcome| (shown(path), outcome))
        };
        let outcomes: Vec<_> = found.files.par_iter().filter_map(judge).collect();
        let mut class = Self {
            left_out: found.left_out,
            ..Self::default()
        };
        for (file, outcome) in outcomes {
            match outcome {
                Ok(judged) if card.is_some_and(|card| card != judged.card) => {
                    class.of_other_cards += 1;
                }
                Ok(judged) => class.hand_ins.push(Graded { file, judged }),
                Err(error) => class.not_judged.push((file, format!("{error:#}"))),
            }
        }
        class.hand_ins.sort_by_cached_key(|one| {
            let judged = &one.judged;
            let name = judged.student.to_lowercase();
            (
                name,
                judged.student.clone(),
                judged.card,
                judged.at.clone(),
                one.file.clone(),
            )
        });
        class
    }

    /// Why the program ends with an error although it has judged what it could.
    pub(super) fn failure(&self) -> Option<anyhow::Error> {
        let (file, reason) = self.not_judged.first()?;
        Some(match self.not_judged.len() {
            1 => anyhow!("{file}: {reason}"),
            n => anyhow!("{n} files cannot be judged; the first: {file}: {reason}"),
        })
    }

    /// Names under which one and the same recording was handed in.
    pub(super) fn shared(&self) -> Vec<Vec<String>> {
        let judged: Vec<Judged> = self.hand_ins.iter().map(|one| one.judged.clone()).collect();
        let by_samples: BTreeMap<_, _> = shared(&judged);
        let mut names: Vec<Vec<String>> = by_samples
            .into_values()
            .map(|names| names.into_iter().map(str::to_owned).collect())
            .collect();
        names.sort();
        names
    }
}

fn read(path: &Path) -> Result<Judged> {
    let file = File::open(path).context("cannot open it")?;
    let (_, judged) = HandIn::read(file)?;
    Ok(judged)
}
