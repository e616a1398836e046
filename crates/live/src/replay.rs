//! A recording played into the lab as if it were measured now, or as fast as it goes.

use std::path::Path;
use std::sync::Arc;

use northing_evaluation::{EvaluationError, RunOptions, RunSummary, run_recording};
use northing_recording::{Event, OpenOptions, Recording, RecordingError, open};

use crate::lab::{Device, Lab};
use crate::messages::Command;
use crate::virtual_phones;

/// Events of one batch at maximal speed.
const BATCH: usize = 500;

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
pub async fn play(lab: &Arc<Lab>, path: &Path, speed: Speed) -> Result<Arc<Device>, String> {
    let recording = open(path, &OpenOptions::default()).map_err(|e| e.to_string())?;
    let name = recording.metadata().name.clone();
    let device = lab.device(&format!("replay-{name}"), &name, "replay")?;
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
    device.command(Command::Stop, lab.now_ns()).await?;
    Ok(device)
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

/// The summary of a recording, as `northing run` makes it.
///
/// # Errors
/// As [`run_recording`].
pub fn summary(path: &Path, options: &RunOptions) -> Result<RunSummary, EvaluationError> {
    let file = |error: RecordingError| EvaluationError::Recording(Box::new(error));
    let mut recording = open(path, &OpenOptions::default()).map_err(file)?;
    run_recording(&mut recording, options, &mut ())
}
