//! A recording played into the lab as if it were measured now, or as fast as it goes.
//!
//! A recording of the lab is played input by input (payloads, commands, and the passing of time where
//! it mattered) through the same engines: what comes out is what came out then, to the bit. Any other
//! recording is played event by event.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use northing_evaluation::{
    EstimatorKind, EvaluationError, Profile, RunOptions, RunSummary, run_recording,
};
use northing_recording::mcap::{LabRecord, RecordKind, describe, lab_records};
use northing_recording::{Event, OpenOptions, Recording, RecordingError, open};
use tokio::sync::{mpsc, oneshot};
use tokio::time::Instant;

use crate::device::Work;
use crate::lab::{Device, Lab, Recorded, lock};
use crate::messages::Command;
use crate::recorder::Control;
use crate::virtual_phones;

/// Events of one batch at maximal speed.
const BATCH: usize = 500;
/// Records that are read ahead.
const READ_AHEAD: usize = 256;

/// How fast a replay is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Speed {
    /// As it was measured.
    #[default]
    Real,
    /// As fast as the lab takes it; nothing is dropped.
    Max,
}

/// Plays a recording to its end.
///
/// # Errors
/// It cannot be read, or the lab is full.
pub async fn play(lab: &Arc<Lab>, path: &Path, speed: Speed) -> Result<(), String> {
    if is_of_the_lab(path) {
        return play_inputs(Player::new(lab), path.to_owned(), speed).await;
    }
    play_events(lab, path, speed).await
}

/// Plays a recording to its end beside devices that may be those of the recording: its own have other identifiers. One that
/// has ended begins anew.
///
/// # Errors
/// As [`play`]; or it is being played.
pub async fn play_beside(lab: &Arc<Lab>, path: &Path, speed: Speed) -> Result<(), String> {
    if is_of_the_lab(path) {
        let contents = describe(path).map_err(|e| e.to_string())?;
        for device in contents.devices {
            make_way(lab, &beside(&device))?;
        }
        return play_inputs(Player::new(lab).beside(), path.to_owned(), speed).await;
    }
    let recording = open(path, &OpenOptions::default()).map_err(|e| e.to_string())?;
    make_way(lab, &beside(&recording.metadata().name))?;
    drop(recording);
    play_events(lab, path, speed).await
}

/// The identifier of a device of a recording that is played beside others.
fn beside(id: &str) -> String {
    format!("replay-{id}")
}

/// Takes the device of an earlier replay away, if that has ended.
fn make_way(lab: &Lab, id: &str) -> Result<(), String> {
    match lab.find(id) {
        Err(_) => Ok(()),
        Ok(device) if lock(&device.status).delivers => {
            Err("it is being played; remove its device to begin anew".to_owned())
        }
        Ok(_) => {
            lab.remove(id);
            Ok(())
        }
    }
}

async fn play_events(lab: &Arc<Lab>, path: &Path, speed: Speed) -> Result<(), String> {
    let recording = open(path, &OpenOptions::default()).map_err(|e| e.to_string())?;
    let name = recording.metadata().name.clone();
    let id = beside(&name);
    let device = lab.device(&id, &name, "replay")?;
    if device.source != "replay" {
        return Err(format!("the name `{id}` is taken by another device"));
    }
    match speed {
        Speed::Max => at_once(lab, &device, recording).await?,
        Speed::Real => {
            let mut failed = None;
            let events = recording.map_while(|event| event.map_err(|e| failed = Some(e)).ok());
            virtual_phones::play(events, lab, &device).await;
            if let Some(error) = failed {
                return Err(error.to_string());
            }
        }
    }
    // A command waits for everything before it.
    device.command(Command::Stop, lab.now_ns()).await
}

async fn at_once(lab: &Lab, device: &Device, recording: Recording) -> Result<(), String> {
    let mut batch: Vec<Event> = Vec::with_capacity(BATCH);
    for event in recording {
        let event = event.map_err(|e: RecordingError| e.to_string())?;
        // Batches end between instants: events of one instant belong together.
        if batch.len() >= BATCH
            && batch
                .last()
                .is_some_and(|last| last.time_ns < event.time_ns)
        {
            virtual_phones::give(lab, device, &batch).await?;
            batch.clear();
        }
        batch.push(event);
    }
    virtual_phones::give(lab, device, &batch).await
}

fn is_of_the_lab(path: &Path) -> bool {
    path.extension().is_some_and(|e| e == "mcap")
        && describe(path).is_ok_and(|contents| !contents.devices.is_empty())
}

/// Plays what the lab recorded.
async fn play_inputs(mut player: Player<'_>, path: PathBuf, speed: Speed) -> Result<(), String> {
    let (sender, mut records) = mpsc::channel(READ_AHEAD);
    let reading = tokio::task::spawn_blocking(move || {
        for record in lab_records(&path)? {
            if sender.blocking_send(record).is_err() {
                break;
            }
        }
        Ok::<(), RecordingError>(())
    });
    let started = Instant::now();
    let mut first_ns = None;
    while let Some(record) = records.recv().await {
        let first_ns = *first_ns.get_or_insert(record.arrival_ns);
        if speed == Speed::Real {
            let since = record.arrival_ns.saturating_sub(first_ns);
            let due = Duration::from_nanos(u64::try_from(since).unwrap_or(0));
            tokio::time::sleep_until(started + due).await;
        }
        player.play(record).await?;
    }
    player.settle().await?;
    let read = reading.await.map_err(|error| error.to_string())?;
    read.map_err(|error| error.to_string())
}

/// Hands records to the devices that they are of.
struct Player<'a> {
    lab: &'a Arc<Lab>,
    /// The devices and when their last record arrived.
    devices: BTreeMap<String, (Arc<Device>, i64)>,
    /// Whether they stand beside devices of the same identifiers.
    is_beside: bool,
}

impl<'a> Player<'a> {
    fn new(lab: &'a Arc<Lab>) -> Self {
        Self {
            lab,
            devices: BTreeMap::new(),
            is_beside: false,
        }
    }

    fn beside(self) -> Self {
        Self {
            is_beside: true,
            ..self
        }
    }

    async fn play(&mut self, record: LabRecord) -> Result<(), String> {
        let LabRecord {
            device: id,
            kind,
            arrival_ns,
            bytes,
        } = record;
        let id = if self.is_beside { beside(&id) } else { id };
        match kind {
            // Of no known device: it was not taken then either.
            RecordKind::Refused => Ok(()),
            RecordKind::Payload(format) => {
                let device = self.device(&id, arrival_ns)?;
                let work = Work::Payload {
                    format,
                    bytes: bytes.into(),
                    arrival_ns,
                    reply: None,
                };
                device.give(work).await
            }
            RecordKind::Control => match serde_json::from_slice(&bytes) {
                Ok(control) => self.control(&id, control, arrival_ns).await,
                Err(error) => Err(format!(
                    "a record of the device `{id}` is of another version of this program: {error}"
                )),
            },
        }
    }

    async fn control(&mut self, id: &str, control: Control, arrival_ns: i64) -> Result<(), String> {
        match control {
            Control::Device {
                name,
                profile,
                time_outs,
                saved,
                ..
            } => {
                let profile: Profile = profile.parse().map_err(|e| format!("{e}"))?;
                let recorded = Recorded {
                    options: RunOptions::new(EstimatorKind::Mekf, profile),
                    time_outs,
                    saved: saved.map(|saved| *saved),
                };
                self.begin(id, &name, recorded, arrival_ns)?;
                Ok(())
            }
            Control::Command { command } => {
                let device = self.device(id, arrival_ns)?;
                // What was refused then is refused again.
                let _ = device.command(command, arrival_ns).await;
                Ok(())
            }
            Control::Poll => {
                let device = self.device(id, arrival_ns)?;
                let poll = Work::Poll {
                    arrival_ns,
                    reply: None,
                };
                device.give(poll).await
            }
            Control::Removed => {
                self.settle().await?;
                self.devices.remove(id);
                self.lab.remove(id);
                Ok(())
            }
        }
    }

    fn begin(
        &mut self,
        id: &str,
        name: &str,
        recorded: Recorded,
        arrival_ns: i64,
    ) -> Result<Arc<Device>, String> {
        let device = self.lab.device_with(id, name, "replay", Some(recorded))?;
        self.devices
            .insert(id.to_owned(), (device.clone(), arrival_ns));
        Ok(device)
    }

    /// The device; one whose coming was not recorded is as the lab's devices are.
    fn device(&mut self, id: &str, arrival_ns: i64) -> Result<Arc<Device>, String> {
        if let Some((device, last_ns)) = self.devices.get_mut(id) {
            *last_ns = arrival_ns;
            return Ok(device.clone());
        }
        let recorded = Recorded {
            options: RunOptions::new(EstimatorKind::Mekf, Profile::Lab),
            time_outs: false,
            saved: None,
        };
        self.begin(id, id, recorded, arrival_ns)
    }

    /// Waits until all devices have done what they were given.
    async fn settle(&self) -> Result<(), String> {
        for (device, arrival_ns) in self.devices.values() {
            let (reply, done) = oneshot::channel();
            let poll = Work::Poll {
                arrival_ns: *arrival_ns,
                reply: Some(reply),
            };
            device.give(poll).await?;
            // A device that has been taken away has nothing left to do.
            let _ = done.await;
        }
        Ok(())
    }
}

/// The summary of a recording (of one device, where it holds several), as `northing run` makes it.
///
/// # Errors
/// As [`run_recording`].
pub fn summary(
    path: &Path,
    device: Option<&str>,
    options: &RunOptions,
) -> Result<RunSummary, EvaluationError> {
    let file = |error: RecordingError| EvaluationError::Recording(Box::new(error));
    let input = OpenOptions {
        device: device.map(str::to_owned),
        ..OpenOptions::default()
    };
    let mut recording = open(path, &input).map_err(file)?;
    run_recording(&mut recording, options, &mut ())
}
