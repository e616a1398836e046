//! The lab: its devices, what pages are told, and the finished experiments.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use axum::body::Bytes;
use northing_core::calibration::magnetometer::MagnetometerCalibration;
use northing_evaluation::RunOptions;
use tokio::sync::{broadcast, mpsc, oneshot, watch};

use crate::audience::Told;
use crate::board;
use crate::device::{self, Work};
use crate::engine::DeviceEngine;
use crate::experiment_table::ExperimentTable;
use crate::experiments::Finished;
use crate::frames::FrameText;
use crate::identities::Identities;
use crate::inputs::InputKind;
use crate::latency::Latency;
use crate::limits::{DEVICE, Queued, RateLimit, Room};
use crate::messages::{Command, DeviceStatus};
use crate::mine::ForOwner;
use crate::persistence::{self, Opened, Persistence, SavedDevice};
use crate::recorder::{Control, Recorder, RecordingStatus};
use crate::session::frame::Frame;
use crate::to_page::{ExperimentRow, ToPage};

/// Most devices at a time.
pub const MOST_DEVICES: usize = 64;
/// A device that has been silent for so long makes room for another when the lab is full.
const EVICTABLE: Duration = Duration::from_secs(10);
/// Batches that may wait for one device.
const QUEUE: usize = 64;
/// Frames that a slow page may lag behind before it misses some.
const FRAMES: usize = 256;
/// Messages that a slow page may lag behind.
const MESSAGES: usize = 1024;

/// A device as the rest of the lab sees it.
#[derive(Debug)]
pub struct Device {
    /// What it is addressed by.
    pub id: String,
    /// The same, for recordings.
    pub(crate) key: Arc<str>,
    /// How it delivers.
    pub source: &'static str,
    queue: mpsc::Sender<Queuing>,
    queued: Queued,
    all_queued: Queued,
    last_heard: Mutex<Instant>,
    pub(crate) status: Mutex<DeviceStatus>,
    pub(crate) for_owner: Mutex<ForOwner>,
    pub(crate) limit: Mutex<RateLimit>,
    /// It lives in the time of a recording.
    pub(crate) replayed: bool,
    gone: AtomicBool,
}

/// How a device of a recording began.
#[derive(Debug)]
pub(crate) struct Recorded {
    pub(crate) options: RunOptions,
    /// Whether what waited for samples was ended.
    pub(crate) time_outs: bool,
    /// Of an earlier start.
    pub(crate) saved: Option<SavedDevice>,
}

/// Work in the queue of a device, and the room that it takes there.
#[derive(Debug)]
pub(crate) struct Queuing {
    pub(crate) work: Work,
    _room: Option<Room>,
}

/// The lab. Shared by all listeners and tasks.
#[derive(Debug)]
pub struct Lab {
    devices: Mutex<BTreeMap<String, Arc<Device>>>,
    pub(crate) experiments: ExperimentTable,
    pub(crate) persistence: Option<Arc<Persistence>>,
    /// A sentence about everything in the folder for data that could not be taken.
    pub notes: Vec<String>,
    identities: Mutex<Identities>,
    next_virtual: AtomicU64,
    queued: Queued,
    pub(crate) frames: broadcast::Sender<Arc<FrameText>>,
    /// The same for whoever is no page.
    pub(crate) watched: broadcast::Sender<Arc<Frame>>,
    pub(crate) messages: broadcast::Sender<Told>,
    pub(crate) devices_changed: watch::Sender<()>,
    pub(crate) recorder: Recorder,
    refused: Mutex<RateLimit>,
    /// How long samples take to the pages.
    pub latency: Latency,
    pub(crate) options: RunOptions,
    started: Instant,
    started_unix_ns: i64,
}

/// The guard of a mutex. A task that panicked has left plain data, which is still good.
pub(crate) fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Lab {
    /// A lab without devices; each one starts with `options`.
    #[must_use]
    pub fn new(options: RunOptions) -> Arc<Self> {
        Self::recording(options, None)
    }

    /// A lab without devices that records everything into a folder, if one is given.
    #[must_use]
    pub fn recording(options: RunOptions, folder: Option<PathBuf>) -> Arc<Self> {
        Self::persistent(options, folder, None)
    }

    /// As [`Lab::recording`]; names, settings, calibrations and experiments are those of the folder `saved`, if one is given,
    /// and stay there.
    #[must_use]
    pub fn persistent(
        options: RunOptions,
        folder: Option<PathBuf>,
        saved: Option<PathBuf>,
    ) -> Arc<Self> {
        let messages = broadcast::channel(MESSAGES).0;
        let opened = saved.map(|saved| persistence::open(&saved, messages.clone()));
        let Opened {
            persistence,
            experiments,
            last_number,
            mut notes,
        } = opened.unwrap_or_default();
        let persistence = persistence.map(Arc::new);
        let (experiments, note) =
            ExperimentTable::new(persistence.clone(), experiments, last_number);
        notes.extend(note);
        let recorder = match folder {
            Some(folder) => Recorder::new(folder, messages.clone()),
            None => Recorder::off(),
        };
        Arc::new(Self {
            devices: Mutex::default(),
            experiments,
            persistence,
            notes,
            identities: Mutex::default(),
            next_virtual: AtomicU64::new(1),
            queued: Queued::default(),
            frames: broadcast::channel(FRAMES).0,
            watched: broadcast::channel(FRAMES).0,
            devices_changed: watch::Sender::new(()),
            messages,
            recorder,
            refused: Mutex::new(RateLimit::new(DEVICE, Instant::now())),
            latency: Latency::default(),
            options,
            started: Instant::now(),
            started_unix_ns: unix_ns(),
        })
    }

    /// Now, for times of arrival: ns since 1970 by the clock of the computer at the start of the lab,
    /// and from then on a clock that never goes back.
    #[must_use]
    pub fn now_ns(&self) -> i64 {
        let since = i64::try_from(self.started.elapsed().as_nanos()).unwrap_or(i64::MAX);
        self.started_unix_ns.saturating_add(since)
    }

    /// Records bytes of a phone that nobody could make sense of, within the limits of one device.
    pub(crate) fn refused(&self, bytes: Bytes) {
        if lock(&self.refused).admits(Instant::now(), bytes.len()) {
            self.recorder.refused(self.now_ns(), bytes);
        }
    }

    /// How the recording is.
    #[must_use]
    pub fn recording_status(&self) -> RecordingStatus {
        self.recorder.status()
    }

    /// Completes the recording and what is to be saved, and waits for both.
    pub fn close_recording(&self) {
        self.recorder.close();
        if let Some(persistence) = &self.persistence {
            persistence.close();
        }
    }

    /// Tells all pages, each what is for its role.
    pub fn tell(&self, message: &ToPage) {
        // Without a page nobody listens, and that is fine.
        let _ = self.messages.send(Told::new(message));
    }

    /// Tells the student of a device, too, what is otherwise for teachers.
    pub(crate) fn tell_about(&self, device: &str, message: &ToPage) {
        let _ = self.messages.send(Told::about(device, message));
    }

    /// Follows what pages are told.
    #[must_use]
    pub fn listen(&self) -> broadcast::Receiver<Told> {
        self.messages.subscribe()
    }

    /// Follows the frames of all devices: at most 60 a second of each, with every innovation of its subject. Who lags
    /// behind misses some.
    #[must_use]
    pub fn watch(&self) -> broadcast::Receiver<Arc<Frame>> {
        self.watched.subscribe()
    }

    /// The device of a page's batch: pages that share an identifier are told apart.
    pub(crate) fn identity(&self, identifier: &str, session: &str) -> String {
        lock(&self.identities).device(identifier, session, Instant::now())
    }

    /// The device that a page's batches went to, if it is a page that has sent some.
    pub(crate) fn identified(&self, identifier: &str, session: &str) -> Option<String> {
        lock(&self.identities).known(identifier, session)
    }

    /// The device of this id, made if it is new.
    ///
    /// # Errors
    /// The lab is full, in a sentence.
    pub fn device(
        self: &Arc<Self>,
        id: &str,
        name: &str,
        source: &'static str,
    ) -> Result<Arc<Device>, String> {
        self.device_with(id, name, source, None)
    }

    /// As [`Lab::device`], with other options to start with: a device of a recording.
    ///
    /// # Errors
    /// As [`Lab::device`].
    pub(crate) fn device_with(
        self: &Arc<Self>,
        id: &str,
        name: &str,
        source: &'static str,
        recorded: Option<Recorded>,
    ) -> Result<Arc<Device>, String> {
        let mut devices = lock(&self.devices);
        if let Some(device) = devices.get(id) {
            return Ok(device.clone());
        }
        if devices.len() >= MOST_DEVICES {
            make_room(&mut devices, Instant::now())?;
        }
        let replayed = recorded.is_some();
        let (engine, saved) = match recorded {
            None => {
                let engine = DeviceEngine::new(self.options.clone());
                (engine, self.saved(id, source))
            }
            Some(as_then) if as_then.time_outs => {
                (DeviceEngine::new(as_then.options), as_then.saved)
            }
            Some(as_then) => {
                let engine = DeviceEngine::new(as_then.options);
                (engine.map(DeviceEngine::without_time_outs), as_then.saved)
            }
        };
        let mut engine = engine.map_err(|e| e.to_string())?;
        let saved = self.restored(&mut engine, saved);
        let given = saved.as_ref().and_then(|saved| saved.name.as_deref());
        let name = match given.unwrap_or(name) {
            "" => id,
            name => name,
        };
        let (queue, work) = mpsc::channel(QUEUE);
        let status = DeviceStatus {
            id: id.to_owned(),
            name: name.to_owned(),
            source,
            connected: true,
            ..DeviceStatus::default()
        };
        let device = Arc::new(Device {
            id: id.to_owned(),
            key: id.into(),
            source,
            queue,
            status: Mutex::new(status),
            for_owner: Mutex::default(),
            queued: Queued::default(),
            all_queued: self.queued.clone(),
            last_heard: Mutex::new(Instant::now()),
            limit: Mutex::new(RateLimit::new(DEVICE, Instant::now())),
            replayed,
            gone: AtomicBool::new(false),
        });
        let came = Control::Device {
            name: name.to_owned(),
            source: source.to_owned(),
            profile: engine.session().options().profile.name().to_owned(),
            time_outs: true,
            saved: saved.clone().map(Box::new),
        };
        self.recorder.control(&device.key, self.now_ns(), &came);
        devices.insert(id.to_owned(), device.clone());
        drop(devices);
        device::spawn(self.clone(), device.clone(), engine, saved, work);
        self.tell_devices();
        Ok(device)
    }

    /// A device that is there.
    ///
    /// # Errors
    /// It is not, in a sentence.
    pub fn find(&self, id: &str) -> Result<Arc<Device>, String> {
        let known = lock(&self.devices).get(id).cloned();
        known.ok_or_else(|| format!("there is no device `{id}`"))
    }

    /// Takes a device away whose task broke off, unless another has its name by now. It comes back
    /// when it sends again.
    pub(crate) fn broke_off(&self, device: &Arc<Device>) {
        let mut devices = lock(&self.devices);
        if devices
            .get(&device.id)
            .is_some_and(|d| Arc::ptr_eq(d, device))
        {
            devices.remove(&device.id);
        }
        drop(devices);
        device.gone.store(true, Ordering::Relaxed);
        let name = lock(&device.status).name.clone();
        let text = format!(
            "`{name}` met a fault of this program and was taken away; it starts anew when it sends again. Please report what it sent."
        );
        self.tell(&ToPage::error(text));
        self.tell_devices();
    }

    /// Takes a device away; its experiments stay.
    pub fn remove(&self, id: &str) {
        if let Some(device) = lock(&self.devices).remove(id) {
            device.gone.store(true, Ordering::Relaxed);
            self.recorder
                .control(&device.key, self.now_ns(), &Control::Removed);
        }
        self.tell_devices();
    }

    /// Takes away a device that no longer sends; a virtual one goes at any time.
    ///
    /// # Errors
    /// It is not there, or it would be back with its next batch, in a sentence.
    pub fn remove_gone(&self, id: &str) -> Result<(), String> {
        let device = self.find(id)?;
        let (connected, name) = {
            let status = lock(&device.status);
            (status.connected, status.name.clone())
        };
        if connected && device.source != "virtual" {
            return Err(format!(
                "{name} still sends and would be back at once; stop it on the device first"
            ));
        }
        self.remove(id);
        Ok(())
    }

    /// Every device.
    pub(crate) fn devices(&self) -> Vec<Arc<Device>> {
        lock(&self.devices).values().cloned().collect()
    }

    /// Every device as it is now.
    #[must_use]
    pub fn statuses(&self) -> Vec<DeviceStatus> {
        let devices = self.devices();
        devices.iter().map(|d| lock(&d.status).clone()).collect()
    }

    /// Tells all pages that the list of devices is another one; each asks for it when it can.
    pub fn tell_devices(&self) {
        self.devices_changed.send_replace(());
    }

    /// The list of devices as a message.
    #[must_use]
    pub fn devices_message(&self) -> ToPage {
        ToPage::Devices {
            devices: self.statuses(),
        }
    }

    /// An identifier for the next virtual phone, and its number.
    pub(crate) fn next_virtual(&self) -> u64 {
        self.next_virtual.fetch_add(1, Ordering::Relaxed)
    }

    /// The newest virtual phone.
    pub(crate) fn newest_virtual(&self) -> Option<String> {
        let devices = lock(&self.devices);
        let virtual_phones = devices.values().filter(|d| d.source == "virtual");
        virtual_phones
            .map(|d| d.id.clone())
            .max_by_key(|id| (id.len(), id.clone()))
    }

    /// A finished experiment with its samples; those of an earlier one are read, which takes a while.
    ///
    /// # Errors
    /// There is none of this id, or its samples cannot be had, in a sentence.
    pub fn experiment(&self, id: &str) -> Result<Arc<Finished>, String> {
        self.experiments.get(id)
    }

    /// Deletes an experiment, from the disk, too.
    ///
    /// # Errors
    /// There is none of this id, or it cannot be deleted, in a sentence.
    pub fn delete_experiment(&self, id: &str) -> Result<(), String> {
        self.experiments.delete(id)
    }

    /// Hides an experiment from the table or brings it back; its files stay.
    ///
    /// # Errors
    /// There is none of this id, or it cannot be written down, in a sentence.
    pub fn archive_experiment(&self, id: &str, archived: bool) -> Result<(), String> {
        self.experiments.archive(id, archived)
    }

    /// The table of experiments, the oldest first.
    #[must_use]
    pub fn experiment_rows(&self) -> Vec<ExperimentRow> {
        self.experiments.rows()
    }

    /// The table of experiments as a message.
    #[must_use]
    pub fn experiments_message(&self) -> ToPage {
        let rows = self.experiment_rows();
        ToPage::Experiments {
            board: board::standings(&rows),
            rows,
        }
    }
}

impl Device {
    /// Whether it has been taken away.
    #[must_use]
    pub fn is_gone(&self) -> bool {
        self.gone.load(Ordering::Relaxed)
    }

    /// Hands over work; waits while the device is busy. Samples are never dropped here.
    ///
    /// # Errors
    /// The device has been taken away.
    pub async fn give(&self, work: Work) -> Result<(), String> {
        let sent = self.queue.send(Queuing { work, _room: None }).await;
        sent.map_err(|_| "the device has been taken away".to_owned())
    }

    /// Hands over work with so many bytes if there is room for it.
    ///
    /// # Errors
    /// The queue is full: whoever sent it keeps it and sends it again.
    pub fn try_give(&self, work: Work, bytes: usize) -> Result<(), String> {
        let busy = || "the lab is busy; send it again".to_owned();
        let room = Room::take(&self.queued, &self.all_queued, bytes).ok_or_else(busy)?;
        let work = Queuing {
            work,
            _room: Some(room),
        };
        self.queue.try_send(work).map_err(|_| busy())
    }

    /// Something has come from it.
    pub(crate) fn heard(&self) {
        *lock(&self.last_heard) = Instant::now();
    }

    /// Carries out a command that came at `arrival_ns` ([`Lab::now_ns`]).
    ///
    /// # Errors
    /// Why it cannot be done, in a sentence.
    pub async fn command(&self, command: Command, arrival_ns: i64) -> Result<(), String> {
        let (reply, answer) = oneshot::channel();
        let work = Work::Command {
            command,
            arrival_ns,
            reply,
        };
        self.give(work).await?;
        let answer = answer.await;
        answer.unwrap_or_else(|_| Err("the device has been taken away".to_owned()))
    }

    /// The magnetometer calibration in force.
    #[must_use]
    pub fn magnetometer(&self) -> Option<MagnetometerCalibration<f64>> {
        lock(&self.status).session.magnetometer
    }

    /// Whether one more request of `bytes` is within the limits.
    pub(crate) fn admits(&self, bytes: usize) -> bool {
        lock(&self.limit).admits(Instant::now(), bytes)
    }
}

/// Whether an identifier is one of the lab's own devices, which no client may use.
#[must_use]
pub fn is_own_name(id: &str) -> bool {
    let kind = id.split_once('-').map_or("", |(kind, _)| kind);
    let mut inputs = InputKind::ALL.iter().map(|kind| kind.name());
    matches!(kind, "virtual" | "replay" | "file") || inputs.any(|input| input == kind)
}

/// Takes away the device that has been silent for longest.
fn make_room(devices: &mut BTreeMap<String, Arc<Device>>, now: Instant) -> Result<(), String> {
    let silence = |device: &Arc<Device>| now.saturating_duration_since(*lock(&device.last_heard));
    let silent = devices.values().max_by_key(|device| silence(device));
    match silent
        .filter(|device| silence(device) >= EVICTABLE)
        .cloned()
    {
        Some(device) => {
            devices.remove(&device.id);
            device.gone.store(true, Ordering::Relaxed);
            Ok(())
        }
        None => Err(format!(
            "the lab is full: it takes {MOST_DEVICES} devices, and all of them are sending"
        )),
    }
}

/// Now by the clock of the computer, ns since 1970.
fn unix_ns() -> i64 {
    let now = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH);
    now.map_or(0, |t| i64::try_from(t.as_nanos()).unwrap_or(i64::MAX))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn full() -> Arc<Lab> {
        let lab = Lab::new(RunOptions::default());
        for k in 0..MOST_DEVICES {
            lab.device(&format!("phone {k}"), "", "page").unwrap();
        }
        lab
    }

    fn silent_since(lab: &Lab, id: &str, seconds: u64) {
        let device = lab.find(id).unwrap();
        let then = Instant::now().checked_sub(Duration::from_secs(seconds));
        *lock(&device.last_heard) = then.unwrap();
    }

    #[tokio::test]
    async fn a_full_lab_lets_the_longest_silent_go_and_never_one_that_sends() {
        let lab = full();
        let refusal = lab.device("late", "", "page").unwrap_err();
        assert!(
            refusal.contains("full") && refusal.contains("64"),
            "{refusal}"
        );
        silent_since(&lab, "phone 7", 30);
        silent_since(&lab, "phone 9", 40);
        silent_since(&lab, "phone 11", 5);
        let silent = lab.find("phone 9").unwrap();
        lab.device("late", "", "page").unwrap();
        assert!(silent.is_gone() && lab.find("phone 9").is_err());
        // Who comes back is a new device, at the cost of the next.
        lab.device("phone 9", "", "page").unwrap();
        assert!(lab.find("phone 7").is_err() && lab.find("phone 11").is_ok());
        assert!(lab.device("later", "", "page").is_err());
        assert_eq!(lab.statuses().len(), MOST_DEVICES);
    }
}
