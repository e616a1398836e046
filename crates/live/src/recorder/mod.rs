//! Records everything as it arrives, before anything is made of it.
//!
//! A thread of its own writes; the lab hands records over and never waits. A file is begun with the
//! first record, what was handed over is in the system's hands a quarter of a second later and on the
//! disk after five, so a killed program loses at most the last second. When the disk refuses, the recording
//! ends with a sentence for people, and the lab goes on without it.

mod folder;
mod writing;

use std::path::PathBuf;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::{self, Sender};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

use axum::body::Bytes;
use northing_recording::mcap::RecordKind;
use northing_recording::wire::WireFormat;
use serde::Serialize;
use tokio::sync::broadcast;

use crate::audience::Told;
use crate::lab::lock;
use crate::messages::Command;
use crate::persistence::SavedDevice;
use crate::to_page::ToPage;

pub use folder::{Listed, list, path_of, recover_all};

/// So many bytes may wait for a slow disk before the recording is given up.
const MOST_WAITING_BYTES: usize = 64 << 20;
/// What a record costs beside its bytes.
const RECORD_BYTES: usize = 128;

/// Whether something is being recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "lowercase")]
pub enum RecordingState {
    /// Nobody wants a recording.
    #[default]
    Off,
    /// It begins with the first payload.
    Idle,
    /// It goes on.
    On,
    /// It ended before its end.
    Failed,
}

/// What people are told about the recording.
#[derive(Debug, Clone, PartialEq, Default, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct RecordingStatus {
    /// Whether it goes on.
    pub state: RecordingState,
    /// The file's name, once there is one.
    pub file: Option<String>,
    /// Its length, bytes.
    pub bytes: u64,
    /// Since its first record, s.
    pub seconds: f64,
    /// A sentence.
    pub text: String,
}

impl RecordingStatus {
    /// As a message for pages.
    #[must_use]
    pub fn message(&self) -> ToPage {
        ToPage::Recording(self.clone())
    }
}

/// One record on its way to the file.
#[derive(Debug)]
struct Item {
    device: Arc<str>,
    kind: RecordKind,
    arrival_ns: i64,
    bytes: Bytes,
}

/// What the lab and the writing thread share.
#[derive(Debug, Default)]
struct Shared {
    status: Mutex<RecordingStatus>,
    waiting_bytes: AtomicUsize,
}

/// Records, or does nothing when recording is off.
#[derive(Debug)]
pub struct Recorder {
    shared: Arc<Shared>,
    items: Mutex<Option<Sender<Item>>>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

impl Recorder {
    /// One that records nothing.
    #[must_use]
    pub fn off() -> Self {
        let shared = Shared::default();
        "Nothing is recorded.".clone_into(&mut lock(&shared.status).text);
        Self {
            shared: Arc::new(shared),
            items: Mutex::new(None),
            thread: Mutex::new(None),
        }
    }

    /// One that writes into `folder` and tells `pages` about it.
    #[must_use]
    pub fn new(folder: PathBuf, pages: broadcast::Sender<Told>) -> Self {
        let shared = Arc::new(Shared::default());
        *lock(&shared.status) = RecordingStatus {
            state: RecordingState::Idle,
            text: "The recording begins with the first sample.".to_owned(),
            ..RecordingStatus::default()
        };
        let (items, received) = mpsc::channel();
        let thread = {
            let shared = shared.clone();
            std::thread::spawn(move || writing::write(&folder, &received, &shared, &pages))
        };
        Self {
            shared,
            items: Mutex::new(Some(items)),
            thread: Mutex::new(Some(thread)),
        }
    }

    /// How it is.
    #[must_use]
    pub fn status(&self) -> RecordingStatus {
        lock(&self.shared.status).clone()
    }

    /// Records a payload of a device.
    pub fn payload(&self, device: &Arc<str>, format: WireFormat, arrival_ns: i64, bytes: Bytes) {
        self.record(device, RecordKind::Payload(format), arrival_ns, bytes);
    }

    /// Records bytes that were refused before it was known whose they are.
    pub fn refused(&self, arrival_ns: i64, bytes: Bytes) {
        self.record(&Arc::from(""), RecordKind::Refused, arrival_ns, bytes);
    }

    /// Records what was done to a device.
    pub fn control(&self, device: &Arc<str>, arrival_ns: i64, control: &Control) {
        let bytes = serde_json::to_vec(control).unwrap_or_default();
        self.record(device, RecordKind::Control, arrival_ns, bytes.into());
    }

    /// Hands a record over; never waits.
    fn record(&self, device: &Arc<str>, kind: RecordKind, arrival_ns: i64, bytes: Bytes) {
        let mut items = lock(&self.items);
        let Some(sender) = items.as_ref() else {
            return;
        };
        let cost = bytes.len() + RECORD_BYTES;
        let waiting = self.shared.waiting_bytes.fetch_add(cost, Ordering::Relaxed);
        if waiting > MOST_WAITING_BYTES {
            drop(items);
            self.give_up();
            return;
        }
        let item = Item {
            device: device.clone(),
            kind,
            arrival_ns,
            bytes,
        };
        // The thread has ended after a failure, and has told about it.
        if sender.send(item).is_err() {
            *items = None;
        }
    }

    /// The disk is slower than the devices: an end that is announced is better than a recording with holes.
    fn give_up(&self) {
        *lock(&self.items) = None;
        let mut status = lock(&self.shared.status);
        status.state = RecordingState::Failed;
        status.text = "The recording stopped: the disk is too slow for what arrives. The lab goes on without it.".to_owned();
    }

    /// Completes the file and waits for it.
    pub fn close(&self) {
        *lock(&self.items) = None;
        if let Some(thread) = lock(&self.thread).take() {
            // A thread that panicked has left a file that is recovered at the next start.
            let _ = thread.join();
        }
    }
}

/// What is done to a device, as it stands in a recording.
#[derive(Debug, Clone, PartialEq, Serialize, serde::Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum Control {
    /// The device came.
    Device {
        /// What people call it.
        name: String,
        /// How it delivers.
        source: String,
        /// The profile that its parameters start from.
        profile: String,
        /// Whether commands need samples and end when these stay away; recordings of before do not say so.
        #[serde(default)]
        time_outs: bool,
        /// Settings and calibrations of an earlier start that it began with.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        saved: Option<Box<SavedDevice>>,
    },
    /// A command was carried out or refused.
    Command {
        /// It.
        command: Command,
    },
    /// Time passed, and what had waited long enough was taken.
    Poll,
    /// The device was taken away.
    Removed,
}
