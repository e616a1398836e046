//! What outlives the lab: names, settings and calibrations of devices, and finished experiments, in the folder for data.
//!
//! `devices/NAME.json` holds a device, `experiments/ID/` an experiment with its samples, `tokens.json` the secrets of a lab that
//! runs. Files are written aside and renamed,
//! so that a killed program leaves whole ones; devices are written by a thread of their own, a moment after the last change.
//! What cannot be read is told once and kept under another name. One lab at a time writes a folder.

mod device;
mod experiment;
mod files;
mod options;
mod restore;
mod tokens;

use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, Receiver, RecvTimeoutError, Sender};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::sync::broadcast;

use crate::audience::Told;
use crate::experiments::Finished;
use crate::lab::lock;
use crate::private;
use crate::to_page::ToPage;
use files::Refused;

pub use device::{CalibrationTimes, SavedDevice};
pub(crate) use experiment::FACTS;
pub use experiment::SavedExperiment;
pub use tokens::{SavedKey, SavedOwner, SavedTokens};

/// Changes of a device are gathered for so long: a slider changes it sixty times a second.
const GATHER: Duration = Duration::from_millis(200);
/// A lab that has just ended may still write for so long.
const PATIENCE: Duration = Duration::from_secs(2);
/// The file in the folder of an experiment that is not to be seen in the table.
const ARCHIVED: &str = "archived";
/// What is lost if nothing can be written.
const LOST: &str =
    "names, settings, calibrations and experiments of this lab will be lost when it ends";

/// The folder and the thread that writes it.
#[derive(Debug)]
pub struct Persistence {
    folder: PathBuf,
    devices: Mutex<BTreeMap<String, SavedDevice>>,
    changed: Mutex<Option<Sender<SavedDevice>>>,
    thread: Mutex<Option<JoinHandle<()>>>,
    teller: Arc<Teller>,
    /// Held while the secrets are written.
    tokens: Mutex<()>,
    /// Held while this lab writes.
    lock: Arc<File>,
}

/// What a folder held when it was opened.
#[derive(Debug, Default)]
pub struct Opened {
    /// The folder, if it can be written.
    pub persistence: Option<Persistence>,
    /// The experiments of earlier starts, the oldest first.
    pub experiments: Vec<SavedExperiment>,
    /// The greatest number that an experiment's identifier has.
    pub last_number: u64,
    /// A sentence about everything that could not be taken.
    pub notes: Vec<String>,
}

/// Says once that nothing can be written, and again only after something could.
#[derive(Debug)]
struct Teller {
    pages: broadcast::Sender<Told>,
    problem: Mutex<Option<String>>,
}

impl Teller {
    fn note(&self, what: &Path, done: io::Result<()>) -> bool {
        let mut problem = lock(&self.problem);
        let Err(error) = done else {
            *problem = None;
            return true;
        };
        if problem.is_none() {
            let text = format!(
                "{}: {error}; until it can be written, {LOST}.",
                what.display()
            );
            // Without a page nobody listens, and one that comes later is told, too.
            let _ = self.pages.send(Told::new(&ToPage::error(text.as_str())));
            *problem = Some(text);
        }
        false
    }
}

/// Opens a folder, or makes it, and reads what is in it.
#[must_use]
pub fn open(folder: &Path, pages: broadcast::Sender<Told>) -> Opened {
    let mut opened = Opened::default();
    let lock = match locked(folder) {
        Ok(Some(lock)) => Arc::new(lock),
        Ok(None) => {
            let text = format!("Another lab writes {}: {LOST}.", folder.display());
            opened.notes.push(text);
            return opened;
        }
        Err(error) => {
            opened
                .notes
                .push(format!("{}: {error}: {LOST}.", folder.display()));
            return opened;
        }
    };
    let devices = read_devices(&devices_of(folder), &mut opened.notes);
    read_experiments(folder, &mut opened);
    let (changed, changes) = mpsc::channel();
    let teller = Arc::new(Teller {
        pages,
        problem: Mutex::default(),
    });
    let thread = {
        let (folder, teller, lock) = (devices_of(folder), teller.clone(), lock.clone());
        std::thread::spawn(move || {
            write_devices(&folder, &changes, &teller);
            drop(lock);
        })
    };
    opened.persistence = Some(Persistence {
        folder: folder.to_owned(),
        devices: Mutex::new(devices),
        changed: Mutex::new(Some(changed)),
        thread: Mutex::new(Some(thread)),
        teller,
        tokens: Mutex::default(),
        lock,
    });
    opened
}

/// The lock of a folder, made if it is not there; `None` when another lab has it.
fn locked(folder: &Path) -> io::Result<Option<File>> {
    private::create_folder(&devices_of(folder))?;
    private::create_folder(&experiments_of(folder))?;
    let path = folder.join("lock");
    let file = match private::create_new(&path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
            File::options().write(true).open(&path)?
        }
        made => made?,
    };
    let since = Instant::now();
    loop {
        match file.try_lock() {
            Err(TryLockError::WouldBlock) if since.elapsed() > PATIENCE => return Ok(None),
            Err(TryLockError::WouldBlock) => std::thread::sleep(GATHER / 4),
            // A file system without locks has no second lab.
            Ok(()) | Err(TryLockError::Error(_)) => return Ok(Some(file)),
        }
    }
}

fn devices_of(folder: &Path) -> PathBuf {
    folder.join("devices")
}

fn experiments_of(folder: &Path) -> PathBuf {
    folder.join("experiments")
}

/// Its file: the identifier as far as it can be a name, and what tells it from all others.
fn device_file(id: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    let name: String = id.chars().filter(|c| plain(*c)).take(40).collect();
    let digest = ring::digest::digest(&ring::digest::SHA256, id.as_bytes());
    let mark = digest.as_ref()[..6].iter().map(|b| format!("{b:02x}"));
    format!("{name}-{}.json", mark.collect::<String>())
}

/// The names of what is in a folder, in order; not what was left over.
fn listed(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
    let mut names: Vec<String> = names
        .filter(|name| !files::is_left_over(name) && !name.starts_with('.'))
        .collect();
    names.sort();
    names
}

fn read_devices(folder: &Path, notes: &mut Vec<String>) -> BTreeMap<String, SavedDevice> {
    let mut devices = BTreeMap::new();
    for name in listed(folder) {
        let path = folder.join(&name);
        let read = files::read_json::<SavedDevice>(&path, device::FORMAT, device::VERSION);
        let read = read.and_then(|saved| match device_file(&saved.id) == name {
            true => Ok(saved),
            false => Err(Refused::Damaged(format!("it is of `{}`", saved.id))),
        });
        match read {
            Ok(saved) => {
                devices.insert(saved.id.clone(), saved);
            }
            Err(why) => notes.push(set_aside(&path, "the settings of a device", &why)),
        }
    }
    devices
}

/// Keeps a file under another name, for this one will be written. Returns a sentence.
fn set_aside(path: &Path, what: &str, why: &Refused) -> String {
    let why = match why {
        Refused::Damaged(text) => format!("is none or damaged ({text})"),
        Refused::Newer(version) => format!("is of a newer version of this program ({version})"),
    };
    let place = path.display();
    match files::set_aside(path) {
        Ok(name) => format!("{place}: {what}, but it {why}; it is kept as {name}."),
        Err(error) => format!("{place}: {what}, but it {why}; it cannot be renamed: {error}."),
    }
}

fn read_experiments(folder: &Path, opened: &mut Opened) {
    let folder = experiments_of(folder);
    let number = |name: &str| -> Option<u64> {
        let digits = name.strip_prefix('e')?.split('.').next()?;
        digits.parse().ok()
    };
    // What was set aside has a number, too, which nothing else gets.
    let all = std::fs::read_dir(&folder).into_iter().flatten().flatten();
    let numbers = all.filter_map(|entry| number(entry.file_name().to_str()?));
    opened.last_number = numbers.max().unwrap_or(0);
    let mut names = listed(&folder);
    names.sort_by_key(|name| number(name));
    for name in names {
        let path = folder.join(&name);
        if number(&name).is_none() {
            continue;
        }
        match experiment::read(&path) {
            Ok(saved) => opened.experiments.push(saved),
            Err(why) => opened.notes.push(set_aside(&path, "an experiment", &why)),
        }
    }
}

/// Writes devices a moment after they have changed, until nobody can change them any more.
fn write_devices(folder: &Path, changes: &Receiver<SavedDevice>, teller: &Teller) {
    while let Ok(first) = changes.recv() {
        let mut waiting = BTreeMap::from([(first.id.clone(), first)]);
        let since = Instant::now();
        loop {
            let left = GATHER.saturating_sub(since.elapsed());
            match changes.recv_timeout(left) {
                Ok(next) => waiting.insert(next.id.clone(), next),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => break,
            };
        }
        for saved in waiting.values() {
            let path = folder.join(device_file(&saved.id));
            teller.note(&path, files::write_json(&path, saved));
        }
    }
}

impl Persistence {
    /// What is known of a device.
    #[must_use]
    pub fn device(&self, id: &str) -> Option<SavedDevice> {
        lock(&self.devices).get(id).cloned()
    }

    /// A device has changed. Never waits.
    pub fn save_device(&self, saved: SavedDevice) {
        lock(&self.devices).insert(saved.id.clone(), saved.clone());
        if let Some(changed) = lock(&self.changed).as_ref() {
            // The thread lives as long as this.
            let _ = changed.send(saved);
        }
    }

    /// What was saved of a device cannot be used: it is kept under another name. Returns a sentence.
    pub fn refuse_device(&self, id: &str, why: &str) -> String {
        lock(&self.devices).remove(id);
        let path = devices_of(&self.folder).join(device_file(id));
        let why = Refused::Damaged(why.to_owned());
        set_aside(&path, "the settings of a device", &why)
    }

    /// Writes an experiment and waits for it. Returns whether it could be written.
    pub fn save_experiment(&self, finished: &Finished) -> bool {
        let folder = self.experiment_folder(&finished.id);
        let written = experiment::write(&folder, finished);
        self.teller.note(&folder, written)
    }

    /// Deletes an experiment from the disk.
    ///
    /// # Errors
    /// What the system says.
    pub fn delete_experiment(&self, id: &str) -> io::Result<()> {
        match std::fs::remove_dir_all(self.experiment_folder(id)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
            _ => Ok(()),
        }
    }

    /// Notes that an experiment is not to be seen, or is again: an empty file beside its own, which stay as they are.
    ///
    /// # Errors
    /// What the system says.
    pub fn archive(&self, id: &str, archived: bool) -> io::Result<()> {
        let mark = self.experiment_folder(id).join(ARCHIVED);
        let (done, is_done) = match archived {
            true => (
                private::create_new(&mark).map(drop),
                io::ErrorKind::AlreadyExists,
            ),
            false => (std::fs::remove_file(&mark), io::ErrorKind::NotFound),
        };
        match done {
            Err(error) if error.kind() == is_done => Ok(()),
            done => done,
        }
    }

    /// Whether an experiment is not to be seen.
    #[must_use]
    pub fn is_archived(&self, id: &str) -> bool {
        self.experiment_folder(id).join(ARCHIVED).is_file()
    }

    /// The folder of an experiment.
    #[must_use]
    pub fn experiment_folder(&self, id: &str) -> PathBuf {
        experiments_of(&self.folder).join(id)
    }

    /// Why nothing can be written at present, in a sentence.
    #[must_use]
    pub fn problem(&self) -> Option<String> {
        lock(&self.teller.problem).clone()
    }

    /// Writes what is to be written and waits for it.
    pub fn close(&self) {
        *lock(&self.changed) = None;
        if let Some(thread) = lock(&self.thread).take() {
            // What a thread that panicked had not written is lost; the rest is whole.
            let _ = thread.join();
        }
        // The next lab may have the folder.
        let _ = self.lock.unlock();
    }
}

#[cfg(test)]
mod tests;
