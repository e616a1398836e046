//! Inputs that the lab goes out for, or listens for on request: apps with a server of their own, apps
//! that connect to a port, boards on a serial line.
//!
//! One file an input. Each connects again by itself when it breaks off, says in words what happens,
//! hands raw payloads to its device and decodes nothing. An input that floods is throttled by not
//! reading on; one that stalls costs nothing; none of them disturbs another device.

mod link;
mod listener;
mod phyphox;
#[cfg(feature = "serial")]
mod razor;
mod sensorserver;
mod spec;

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};

use serde::Serialize;
use tokio::task::AbortHandle;

pub use spec::{Address, InputKind, InputSpec, SpecError};

use crate::addresses::Reach;
use crate::lab::{Lab, lock};
use crate::messages::Action;
use crate::to_page::ToPage;
use link::{BackOff, Link};

/// Most inputs at a time.
pub const MOST_INPUTS: usize = 32;

/// How an input is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
#[serde(rename_all = "lowercase")]
pub enum InputState {
    /// It tries to connect.
    Connecting,
    /// Samples come, or could.
    Connected,
    /// It waits for a device to connect.
    Waiting,
    /// It does not work at the moment; it tries again.
    Failed,
}

/// One input as pages are told.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub struct InputStatus {
    /// What it is addressed by.
    pub id: String,
    /// What it is.
    pub kind: InputKind,
    /// Where it is.
    pub address: String,
    /// How it is.
    pub state: InputState,
    /// The same in words.
    pub text: String,
}

#[derive(Debug)]
struct Entry {
    status: InputStatus,
    task: Option<AbortHandle>,
}

/// The inputs of a lab.
#[derive(Debug)]
pub struct Inputs {
    lab: Arc<Lab>,
    /// Where phones reach this computer, if they may.
    reach: Option<Arc<Reach>>,
    entries: Mutex<Vec<Entry>>,
    next: AtomicU64,
}

impl Inputs {
    /// No inputs yet. `reach` says where devices reach this computer: without it, inputs that wait for
    /// devices listen on this computer alone.
    #[must_use]
    pub fn new(lab: Arc<Lab>, reach: Option<Arc<Reach>>) -> Arc<Self> {
        Arc::new(Self {
            lab,
            reach,
            entries: Mutex::default(),
            next: AtomicU64::new(1),
        })
    }

    /// Adds an input; it runs until it is removed. Returns its identifier. Needs a tokio runtime.
    ///
    /// # Errors
    /// It is there already, there are too many, or this program was built without it: in a sentence.
    pub fn add(self: &Arc<Self>, spec: InputSpec) -> Result<String, String> {
        let serial = matches!(spec.kind, InputKind::Razor | InputKind::Northing);
        if serial && cfg!(not(feature = "serial")) {
            return Err(
                "this program was built without serial lines (feature `serial`)".to_owned(),
            );
        }
        let (kind, address) = (spec.kind, spec.address.to_string());
        let mut entries = lock(&self.entries);
        let same = |entry: &&Entry| entry.status.kind == kind && entry.status.address == address;
        if entries.iter().find(same).is_some() {
            return Err(format!("{} {address} is there already", kind.name()));
        }
        if entries.len() >= MOST_INPUTS {
            return Err(format!(
                "there are {MOST_INPUTS} inputs already; remove one"
            ));
        }
        let id = format!("input-{}", self.next.fetch_add(1, Ordering::Relaxed));
        entries.push(Entry {
            status: InputStatus {
                id: id.clone(),
                kind,
                address,
                state: InputState::Connecting,
                text: "starting".to_owned(),
            },
            task: None,
        });
        drop(entries);
        let link = Link::new(self.clone(), id.clone(), spec);
        let task = tokio::spawn(run(link)).abort_handle();
        if let Some(entry) = lock(&self.entries).iter_mut().find(|e| e.status.id == id) {
            entry.task = Some(task);
        }
        self.tell();
        Ok(id)
    }

    /// Removes an input by its identifier; its devices stay, without new samples.
    ///
    /// # Errors
    /// There is none of this identifier.
    pub fn remove(&self, id: &str) -> Result<(), String> {
        let mut entries = lock(&self.entries);
        let place = entries.iter().position(|entry| entry.status.id == id);
        let place = place.ok_or_else(|| format!("there is no input `{id}`"))?;
        if let Some(task) = entries.remove(place).task {
            task.abort();
        }
        drop(entries);
        self.tell();
        Ok(())
    }

    /// What a page asks for: adds an input, or removes one by its identifier or kind and address.
    ///
    /// # Errors
    /// It cannot be done, in a sentence.
    pub fn change(
        self: &Arc<Self>,
        action: Action,
        kind: Option<InputKind>,
        address: &str,
        id: Option<&str>,
    ) -> Result<(), String> {
        let spec = || {
            let kind = kind.ok_or("an input needs a `kind`")?;
            InputSpec::new(kind, address).map_err(|error| error.to_string())
        };
        match (action, id) {
            (Action::Add, _) => self.add(spec()?).map(|_| ()),
            (Action::Remove, Some(id)) => self.remove(id),
            (Action::Remove, None) => {
                let id = self.find(&spec()?).ok_or("there is no such input")?;
                self.remove(&id)
            }
        }
    }

    /// The identifier of the input of this kind at this address.
    #[must_use]
    pub fn find(&self, spec: &InputSpec) -> Option<String> {
        let address = spec.address.to_string();
        let entries = lock(&self.entries);
        let found = entries
            .iter()
            .find(|e| e.status.kind == spec.kind && e.status.address == address);
        found.map(|entry| entry.status.id.clone())
    }

    /// Every input as it is now.
    #[must_use]
    pub fn statuses(&self) -> Vec<InputStatus> {
        let entries = lock(&self.entries);
        entries.iter().map(|entry| entry.status.clone()).collect()
    }

    /// The list of inputs as a message.
    #[must_use]
    pub fn message(&self) -> ToPage {
        ToPage::Inputs {
            inputs: self.statuses(),
        }
    }

    fn tell(&self) {
        self.lab.tell(&self.message());
    }

    /// Writes down how an input is, and tells when that is new.
    fn say(&self, id: &str, state: InputState, text: String) {
        let mut entries = lock(&self.entries);
        let Some(entry) = entries.iter_mut().find(|entry| entry.status.id == id) else {
            return;
        };
        if entry.status.state == state && entry.status.text == text {
            return;
        }
        entry.status.state = state;
        entry.status.text = text;
        drop(entries);
        self.tell();
    }
}

/// Tries again and again.
async fn run(link: Link) {
    let mut feed = link.feed(&link.address().to_string());
    let (mut back_off, mut experiment) = (BackOff::default(), None);
    loop {
        let mut delivered = false;
        let Err(why) = match link.kind() {
            InputKind::SensorServer => {
                sensorserver::connected(&link, &mut feed, &mut delivered).await
            }
            InputKind::Phyphox => {
                phyphox::connected(&link, &mut feed, &mut experiment, &mut delivered).await
            }
            InputKind::Linkoping | InputKind::SensorStreamer | InputKind::HyperImu => {
                listener::listening(&link).await
            }
            #[cfg(feature = "serial")]
            InputKind::Razor | InputKind::Northing => {
                razor::open(&link, &mut feed, &mut delivered).await
            }
            #[cfg(not(feature = "serial"))]
            InputKind::Razor | InputKind::Northing => return,
        };
        back_off.wait(&link, &why, delivered).await;
    }
}
