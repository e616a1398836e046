//! The hand-ins of the laboratory course that this lab has taken: made from an experiment, judged at once, kept in the folder for
//! data as `northing grade` reads them.

use std::collections::{BTreeMap, VecDeque};
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::SystemTime;

use northing_evaluation::attitude::setup::{RunSetup, Start};
use northing_evaluation::exercises::{Card, Class, HandIn, Judged, answers};
use rayon::prelude::*;
use serde::Deserialize;

use crate::experiments::Finished;
use crate::lab::lock;
use crate::messages::Change;
use crate::private;

/// Files that are kept, and bytes of all of them.
const MOST_KEPT: (usize, u64) = (5000, 8 << 30);
/// Hand-ins of one device from one start of the lab: nobody fills the folder alone.
const MOST_OF_DEVICE: u32 = 200;
/// Files that stay in memory where nothing is kept, and bytes of all of them; the newest stays, however long.
const MOST_HELD: (usize, usize) = (200, 64 << 20);
/// Hexadecimal digits of the samples' hash in the name of a file.
const MARK: usize = 12;

/// What a page hands in: the experiment as it was, or as a what-if has it.
#[derive(Debug, Deserialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct HandInRequest {
    /// The exercise.
    pub card: Card,
    /// Who hands it in.
    pub student: String,
    /// Answers by the name of their question, as they were typed.
    pub answers: BTreeMap<String, String>,
    /// What is other than it was.
    #[serde(flatten)]
    pub change: Change,
}

impl Finished {
    /// What is handed in of it.
    ///
    /// # Errors
    /// Name, answers or change do not fit, in a sentence.
    pub fn hand_in(&self, request: &HandInRequest, at: String) -> Result<HandIn, String> {
        let student = answers::student(&request.student);
        let student = student.map_err(|problem| format!("student: {problem}"))?;
        let given = request.answers.iter();
        let given = given.map(|(name, text)| (name.as_str(), text.as_str()));
        let answers = answers::checked(request.card, given).map_err(|error| error.to_string())?;
        let options = self.altered(&request.change)?.subjects_options();
        HandIn::check_estimator(options.estimator).map_err(|error| error.to_string())?;
        // Nobody else has the estimators that somebody brought along.
        let starts = self.experiment.starts.iter();
        let starts = starts.filter(|(kind, _)| HandIn::check_estimator(*kind).is_ok());
        Ok(HandIn {
            student,
            card: request.card,
            at,
            answers,
            world_frame: options.world_frame,
            setup: RunSetup::of(&options),
            starts: starts.map(|(k, state)| (*k, Start::of(state))).collect(),
            alterations: request.change.alterations,
            events: self.experiment.events.clone(),
        })
    }
}

/// A hand-in that was taken.
#[derive(Debug)]
pub struct Taken {
    /// The name of its file.
    pub file: String,
    /// What was found.
    pub judged: Judged,
    /// Why it is not kept; `None` where it is.
    pub not_kept: Option<String>,
}

/// What was found in a file, and what the file was like.
#[derive(Debug, Clone)]
struct Known {
    like: Option<(u64, Option<SystemTime>)>,
    outcome: Result<Judged, String>,
}

/// The hand-ins of a lab.
#[derive(Debug, Default)]
pub struct HandIns {
    /// None where nothing is kept.
    folder: Option<PathBuf>,
    /// By the names of their files.
    known: Mutex<BTreeMap<String, Known>>,
    /// What is not kept can be fetched for a while.
    held: Mutex<VecDeque<(String, Arc<Vec<u8>>)>>,
    /// How many were taken of each device.
    taken: Mutex<BTreeMap<String, u32>>,
    /// Held while a file gets its name.
    naming: Mutex<()>,
    /// Held while files of before are judged.
    judging: Mutex<()>,
}

impl HandIns {
    /// Those of a folder, or nothing is kept.
    #[must_use]
    pub fn new(folder: Option<PathBuf>) -> Self {
        Self {
            folder,
            ..Self::default()
        }
    }

    /// Judges a hand-in of an experiment and keeps its file.
    ///
    /// # Errors
    /// It cannot be judged, in a sentence.
    pub fn take(&self, finished: &Finished, hand_in: &HandIn) -> Result<Taken, String> {
        let (bytes, judged) = hand_in.sealed().map_err(|error| error.to_string())?;
        let name = HandIn::name_of(hand_in.card, &hand_in.student);
        let stem = format!("{name}-{}", mark(finished));
        let bytes = Arc::new(bytes);
        let _one = lock(&self.naming);
        let (file, not_kept) = match self.keep(&finished.device, &stem, &bytes) {
            Ok(file) => (file, None),
            Err(problem) => (self.hold(&stem, &bytes), Some(problem)),
        };
        if not_kept.is_none() || self.folder.is_none() {
            let known = Known {
                like: self.like(&file),
                outcome: Ok(judged.clone()),
            };
            let mut all = lock(&self.known);
            if self.folder.is_some() || all.len() < MOST_KEPT.0 {
                all.insert(file.clone(), known);
            }
        }
        Ok(Taken {
            file,
            judged,
            not_kept,
        })
    }

    /// Writes a file under a name that is free; the name.
    fn keep(&self, device: &str, stem: &str, bytes: &[u8]) -> Result<String, String> {
        let Some(folder) = &self.folder else {
            return Err("this lab keeps nothing: it was started with --no-recording".to_owned());
        };
        let mut taken = lock(&self.taken);
        let of_device = taken.entry(device.to_owned()).or_default();
        if *of_device >= MOST_OF_DEVICE {
            return Err(format!(
                "{MOST_OF_DEVICE} hand-ins of this device are kept, and no more until the lab starts again"
            ));
        }
        let (files, length) = MOST_KEPT;
        let all = listed(folder);
        let kept: u64 = all.iter().map(|(_, (bytes, _))| bytes).sum();
        if all.len() >= files || kept.saturating_add(bytes.len() as u64) > length {
            return Err(format!(
                "the folder of hand-ins is full: it has {} files of {} MiB, at most {files} of {} MiB are kept; the \
                 teacher can move files elsewhere",
                all.len(),
                kept >> 20,
                length >> 20
            ));
        }
        let file = write_new(folder, stem, bytes)
            .map_err(|error| format!("{stem}.zip cannot be kept: {error}"))?;
        *of_device += 1;
        Ok(file)
    }

    /// Holds a file in memory; its name.
    fn hold(&self, stem: &str, bytes: &Arc<Vec<u8>>) -> String {
        let mut held = lock(&self.held);
        let is_free = |name: &String| {
            let on_disk = self.folder.as_ref().map(|folder| folder.join(name));
            !held.iter().any(|(known, _)| known == name)
                && !lock(&self.known).contains_key(name)
                && on_disk.is_none_or(|path| path.symlink_metadata().is_err())
        };
        let mut names = (1..=u32::MAX).map(|number| numbered(stem, number));
        let name = names.find(is_free).unwrap_or_default();
        held.push_back((name.clone(), bytes.clone()));
        let length = |held: &VecDeque<(String, Arc<Vec<u8>>)>| -> usize {
            held.iter().map(|(_, bytes)| bytes.len()).sum()
        };
        while held.len() > 1 && (held.len() > MOST_HELD.0 || length(&held) > MOST_HELD.1) {
            held.pop_front();
        }
        name
    }

    /// The file of this name that was handed in of an experiment; `None` for all others.
    #[must_use]
    pub fn file(&self, finished: &Finished, name: &str) -> Option<Vec<u8>> {
        if !is_of(finished, name) {
            return None;
        }
        let held = lock(&self.held)
            .iter()
            .find_map(|(known, bytes)| (known == name).then(|| bytes.clone()));
        if let Some(bytes) = held {
            return Some(bytes.to_vec());
        }
        let folder = self.folder.as_ref()?;
        // Compared with what is there, so no name can lead elsewhere.
        let is_there = listed(folder).iter().any(|(known, _)| known == name);
        is_there
            .then(|| std::fs::read(folder.join(name)).ok())
            .flatten()
    }

    /// Every hand-in of the folder; files of earlier starts are judged when they are first asked for.
    #[must_use]
    pub fn class(&self) -> Class {
        let _one = lock(&self.judging);
        if let Some(folder) = &self.folder {
            let files = listed(folder);
            let known = lock(&self.known).clone();
            let is_new = |(name, like): &&(String, Like)| {
                known.get(name).and_then(|known| known.like) != Some(*like)
            };
            let new: Vec<&(String, Like)> = files.iter().filter(is_new).collect();
            let found: Vec<(String, Known)> = new
                .par_iter()
                .map(|(name, like)| {
                    let known = Known {
                        like: Some(*like),
                        outcome: judged(&folder.join(name)),
                    };
                    (name.clone(), known)
                })
                .collect();
            let mut known = lock(&self.known);
            known.extend(found);
            known.retain(|name, _| folder.join(name).is_file());
        }
        let known = lock(&self.known);
        Class::of(
            known
                .iter()
                .map(|(file, known)| (file.clone(), known.outcome.clone())),
        )
    }

    fn like(&self, file: &str) -> Option<Like> {
        let about = self.folder.as_ref()?.join(file).metadata().ok()?;
        Some((about.len(), about.modified().ok()))
    }
}

/// Length and time of a file.
type Like = (u64, Option<SystemTime>);

/// What tells the files of one experiment from all others: identifiers come again after an experiment was deleted.
fn mark(finished: &Finished) -> String {
    let hash = finished.hash.get(..MARK).unwrap_or(&finished.hash);
    format!("{}-{hash}", finished.id)
}

/// Whether a file was handed in of an experiment, by its name.
fn is_of(finished: &Finished, name: &str) -> bool {
    let stem = name.strip_suffix(".zip").unwrap_or_default();
    let mark = format!("-{}", mark(finished));
    let unnumbered = stem.rsplit_once('-').map_or("", |(rest, number)| {
        let is_number = !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit());
        if is_number { rest } else { "" }
    });
    stem.ends_with(&mark) || unnumbered.ends_with(&mark)
}

fn numbered(stem: &str, number: u32) -> String {
    match number {
        1 => format!("{stem}.zip"),
        _ => format!("{stem}-{number}.zip"),
    }
}

/// Writes a file that is whole or not there, under a name that nothing has; for the owner alone.
fn write_new(folder: &Path, stem: &str, bytes: &[u8]) -> io::Result<String> {
    private::create_folder(folder)?;
    // For the owner alone, and hidden from who lists the folder.
    let mut file = tempfile::Builder::new()
        .prefix(".taking-")
        .tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_data()?;
    for number in 1..=u32::MAX {
        let name = numbered(stem, number);
        match file.persist_noclobber(folder.join(&name)) {
            Ok(_) => return Ok(name),
            Err(error) if error.error.kind() == io::ErrorKind::AlreadyExists => file = error.file,
            Err(error) => return Err(error.error),
        }
    }
    Err(io::Error::from(io::ErrorKind::AlreadyExists))
}

/// The hand-ins of a folder.
fn listed(folder: &Path) -> Vec<(String, Like)> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let found = entries.filter_map(|entry| {
        let name = entry.file_name().into_string().ok()?;
        let about = entry.metadata().ok()?;
        let ending = Path::new(&name).extension()?;
        let is_one =
            about.is_file() && !name.starts_with('.') && ending.eq_ignore_ascii_case("zip");
        is_one.then(|| (name, (about.len(), about.modified().ok())))
    });
    found.collect()
}

fn judged(path: &Path) -> Result<Judged, String> {
    let file = std::fs::File::open(path).map_err(|error| format!("cannot open it: {error}"))?;
    let (_, judged) = HandIn::read(file).map_err(|error| error.to_string())?;
    Ok(judged)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn kept_in(folder: &Path) -> HandIns {
        HandIns::new(Some(folder.to_owned()))
    }

    #[test]
    fn one_device_does_not_fill_the_folder() {
        let folder = tempfile::tempdir().unwrap();
        let lab = kept_in(folder.path());
        for number in 1..=MOST_OF_DEVICE {
            let file = lab.keep("a", "bias-ana", b"x").unwrap();
            assert_eq!(
                file,
                numbered("bias-ana", number),
                "nothing is written over"
            );
        }
        let refused = lab.keep("a", "bias-ana", b"x").unwrap_err();
        assert!(
            refused.starts_with("200 hand-ins of this device"),
            "{refused}"
        );
        assert_eq!(lab.keep("b", "bias-eva", b"x").unwrap(), "bias-eva.zip");
        assert_eq!(listed(folder.path()).len(), MOST_OF_DEVICE as usize + 1);
    }

    #[test]
    fn a_full_folder_is_told_with_its_size() {
        let folder = tempfile::tempdir().unwrap();
        for number in 0..MOST_KEPT.0 {
            fs::write(folder.path().join(format!("old-{number}.zip")), b"").unwrap();
        }
        // What is no hand-in does not count.
        fs::write(folder.path().join("notes.txt"), b"mine").unwrap();
        let lab = kept_in(folder.path());
        let refused = lab.keep("a", "bias-ana", b"x").unwrap_err();
        assert!(
            refused.contains("is full: it has 5000 files of 0 MiB"),
            "{refused}"
        );
        fs::remove_file(folder.path().join("old-7.zip")).unwrap();
        assert_eq!(lab.keep("a", "bias-ana", b"x").unwrap(), "bias-ana.zip");

        let folder = tempfile::tempdir().unwrap();
        // A file with nothing in it takes no room on the disk.
        let large = fs::File::create(folder.path().join("large.zip")).unwrap();
        if large.set_len(MOST_KEPT.1).is_ok() {
            let refused = kept_in(folder.path()).keep("a", "bias-ana", b"x");
            let refused = refused.unwrap_err();
            assert!(refused.contains("1 files of 8192 MiB"), "{refused}");
        }
    }

    #[test]
    fn what_is_not_kept_is_held_until_it_makes_room() {
        let lab = HandIns::new(None);
        let refused = lab.keep("a", "bias-ana", b"x").unwrap_err();
        assert!(refused.contains("--no-recording"), "{refused}");
        let bytes = Arc::new(vec![0_u8; 1 << 20]);
        let names: Vec<String> = (0..70).map(|_| lab.hold("bias-ana", &bytes)).collect();
        assert_eq!(names[1], "bias-ana-2.zip");
        let held = lock(&lab.held);
        assert_eq!(held.len(), MOST_HELD.1 >> 20, "the newest");
        assert_eq!(held.back().map(|(name, _)| name), names.last());
    }
}
