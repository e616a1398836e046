//! Sources of a study: hashes of files, random worlds, and what runs share while it is needed.

use std::collections::VecDeque;
use std::fs::{self, File};
use std::io::{self, Read as _};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use northing_recording::Event;
use northing_recording::tracking::TrackingRecording;
use northing_simulation::attitude_world::{AttitudeWorld, WorldMotion};
use northing_simulation::navigation_world::{NavigationWorld, WorldClass};
use sha2::{Digest as _, Sha256};

use super::StudyError;
use super::file::{StudyQuestion, WorldsTable};
use super::key::hex;
use crate::navigation_worlds;

/// A recording that was found.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FoundRecording {
    /// Its name in the study: as the study's file leads to it, whatever folder that is in.
    pub name: String,
    /// Where it is.
    pub path: PathBuf,
}

/// SHA-256 of a recording: of its bytes; of a folder those of all files with their names; of a manifest those of the files that it
/// names too, which are in `data` or beside it.
///
/// # Errors
/// A file cannot be read.
pub(super) fn hash_of_recording(path: &Path, data: Option<&Path>) -> Result<String, StudyError> {
    let mut hash = Sha256::new();
    let failed = |error: io::Error| {
        StudyError::file(
            &path.display().to_string(),
            &format!("cannot read it: {error}"),
        )
    };
    add(&mut hash, path).map_err(failed)?;
    let folder = data.or(path.parent()).unwrap_or(Path::new(""));
    let is_toml = |path: &Path| path.extension().is_some_and(|ending| ending == "toml");
    let beside = PathBuf::from(format!("{}.toml", path.display()));
    for manifest in [path.to_owned(), path.with_extension("toml"), beside] {
        if !is_toml(&manifest) || !manifest.is_file() {
            continue;
        }
        if manifest != path {
            add(&mut hash, &manifest).map_err(failed)?;
        }
        let text = fs::read_to_string(&manifest).map_err(failed)?;
        for file in files_named(&text, folder) {
            add(&mut hash, &file).map_err(failed)?;
        }
    }
    Ok(hex(hash.finalize().as_slice()))
}

/// The files in a folder that a TOML text names in any of its values.
fn files_named(text: &str, folder: &Path) -> Vec<PathBuf> {
    fn walk(value: &toml::Value, names: &mut Vec<String>) {
        match value {
            toml::Value::String(name) => names.push(name.clone()),
            toml::Value::Array(items) => items.iter().for_each(|item| walk(item, names)),
            toml::Value::Table(table) => table.values().for_each(|item| walk(item, names)),
            _ => {}
        }
    }
    let mut names = Vec::new();
    if let Ok(table) = text.parse::<toml::Table>() {
        walk(&toml::Value::Table(table), &mut names);
    }
    let paths = names.iter().filter(|name| !name.is_empty());
    let mut paths: Vec<_> = paths.map(|name| folder.join(name)).collect();
    paths.retain(|path| path.is_file() || path.is_dir());
    paths.sort();
    paths.dedup();
    paths
}

/// The bytes of a file, or of every file of a folder behind its name.
fn add(hash: &mut Sha256, path: &Path) -> io::Result<()> {
    if path.is_dir() {
        let entries = fs::read_dir(path)?.collect::<Result<Vec<_>, _>>()?;
        let mut paths: Vec<_> = entries.into_iter().map(|entry| entry.path()).collect();
        paths.sort();
        for path in paths {
            let name = path.file_name().unwrap_or_default();
            hash.update(name.as_encoded_bytes());
            add(hash, &path)?;
        }
        return Ok(());
    }
    let mut file = File::open(path)?;
    let mut buffer = vec![0; 1 << 16];
    loop {
        let read = file.read(&mut buffer)?;
        if read == 0 {
            return Ok(());
        }
        hash.update(&buffer[..read]);
    }
}

/// Refuses a motion or class that there is not, and one of another question.
pub(super) fn check_worlds(
    worlds: &WorldsTable,
    question: StudyQuestion,
) -> Result<(), StudyError> {
    let refused = |key: &str, name: &str, names: String| {
        Err(StudyError::Refused(format!(
            "sources.worlds: no {key} `{name}`; expected one of: {names}"
        )))
    };
    match (question, &worlds.motion, &worlds.class) {
        (StudyQuestion::Attitude, Some(name), None) if WorldMotion::named(name).is_none() => {
            refused("motion", name, WorldMotion::names())
        }
        (StudyQuestion::Navigation, None, Some(name)) if WorldClass::named(name).is_none() => {
            refused("class", name, WorldClass::names())
        }
        (StudyQuestion::Attitude, _, None) | (StudyQuestion::Navigation, None, _) => Ok(()),
        (StudyQuestion::Tracking, ..) => Err(StudyError::Refused(
            "sources.worlds: there are worlds of attitude and of navigation; name a `scenario`, or `recordings`"
                .to_owned(),
        )),
        _ => Err(StudyError::Refused(
            "sources.worlds: worlds of attitude are chosen by `motion`, those of navigation by `class`".to_owned(),
        )),
    }
}

/// The number of the world at this place: motions and classes follow one another by number.
pub(super) fn world_number(worlds: &WorldsTable, place: u64) -> u64 {
    let motion = worlds.motion.as_deref().and_then(WorldMotion::named);
    let motion = motion.and_then(|m| WorldMotion::ALL.iter().position(|of| *of == m));
    let class = worlds.class.as_deref().and_then(WorldClass::named);
    let class = class.and_then(|c| WorldClass::ALL.iter().position(|of| *of == c));
    let (kind, kinds) = match (motion, class) {
        (Some(kind), _) => (kind as u64, WorldMotion::ALL.len() as u64),
        (_, Some(kind)) => (kind as u64, WorldClass::ALL.len() as u64),
        _ => return worlds.first.saturating_add(place),
    };
    // The first of this kind that is not before the first wanted.
    let ahead = (kind + kinds - worlds.first % kinds) % kinds;
    worlds.first + ahead + kinds * place
}

/// What runs of one source and seed share.
#[derive(Debug)]
pub(super) enum Loaded {
    /// Events of a world.
    Events(Vec<Event>),
    /// A recording of targets, or why there is none.
    Tracking(Result<Box<TrackingRecording>, String>),
}

impl Loaded {
    /// A world of attitude.
    pub(super) fn attitude_world(seed: u64, number: u64) -> Self {
        Self::Events(AttitudeWorld::draw(seed, number).events)
    }

    /// A world of navigation.
    pub(super) fn navigation_world(seed: u64, number: u64) -> Self {
        Self::Events(navigation_worlds::events(&NavigationWorld::draw(
            seed, number,
        )))
    }

    /// A recording of targets.
    pub(super) fn tracking(path: &Path, data: Option<&Path>) -> Self {
        let recording = northing_recording::tracking::open(path, data);
        Self::Tracking(recording.map(Box::new).map_err(|error| error.to_string()))
    }
}

/// Source and seed; the seed is 0 where it makes no difference.
type Which = (u64, u64);

/// The sources that runs are at: memory does not grow with their number.
#[derive(Debug, Default)]
pub(super) struct Shelf(Mutex<VecDeque<(Which, Arc<OnceLock<Loaded>>)>>);

impl Shelf {
    /// What runs of a source share; the first one loads it, and others wait for that.
    pub(super) fn get(&self, which: Which, load: impl FnOnce() -> Loaded) -> Arc<OnceLock<Loaded>> {
        let slot = {
            let mut shelf = self.0.lock().unwrap_or_else(PoisonError::into_inner);
            let known = shelf.iter().find(|(of, _)| *of == which);
            if let Some((_, slot)) = known {
                Arc::clone(slot)
            } else {
                // One for each thread, and a little.
                while shelf.len() > rayon::current_num_threads() {
                    shelf.pop_front();
                }
                let slot = Arc::new(OnceLock::new());
                shelf.push_back((which, Arc::clone(&slot)));
                slot
            }
        };
        slot.get_or_init(load);
        slot
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn worlds_of_a_kind_are_counted_from_the_first_wanted() {
        let worlds = |motion: Option<&str>| WorldsTable {
            first: 4,
            count: 3,
            motion: motion.map(str::to_owned),
            class: None,
        };
        let numbers = |motion| [0, 1, 2].map(|place| world_number(&worlds(motion), place));
        assert_eq!(numbers(None), [4, 5, 6]);
        let walking = numbers(Some("walking"));
        assert!(
            walking
                .iter()
                .all(|number| WorldMotion::of(*number) == WorldMotion::Walking)
        );
        assert_eq!(walking[0] + 9, walking[1]);
        assert!((4..13).contains(&walking[0]));
        let wrong = check_worlds(&worlds(Some("flying")), StudyQuestion::Attitude);
        assert!(
            wrong
                .unwrap_err()
                .to_string()
                .contains("expected one of: desk")
        );
        assert!(check_worlds(&worlds(Some("walking")), StudyQuestion::Navigation).is_err());
    }

    #[test]
    fn the_hash_of_a_recording_is_that_of_every_file_it_needs() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            fs::write(&path, text).unwrap();
            path
        };
        let manifest = write("m.toml", "[a]\nfile = \"table.csv\"\nname = \"none.csv\"\n");
        write("table.csv", "1");
        let hash = || hash_of_recording(&manifest, None).unwrap();
        let before = hash();
        write("other.csv", "1");
        assert_eq!(hash(), before);
        write("table.csv", "2");
        assert_ne!(hash(), before);
        assert!(hash_of_recording(&folder.path().join("none"), None).is_err());
    }
}
