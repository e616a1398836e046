//! Virtual phones: simulated devices with known truth that deliver as real ones do.

use std::sync::Arc;
use std::time::Duration;

use northing_recording::Event;
use northing_recording::wire::{WireFormat, events};
use northing_simulation::{VirtualPhone, VirtualPhoneConfig};
use tokio::time::{Instant, MissedTickBehavior};

use crate::device::Work;
use crate::lab::{Device, Lab};

/// How often a virtual phone sends a batch.
const BATCH: Duration = Duration::from_millis(40);
/// A virtual phone plays its script again and again for so long, s.
const DURATION_S: f64 = 86_400.0;

/// Adds a virtual phone that delivers in real time; without a `seed` each one is another phone. Returns its identifier.
///
/// # Errors
/// The lab is full, in a sentence.
pub fn add(
    lab: &Arc<Lab>,
    mut config: VirtualPhoneConfig,
    seed: Option<u64>,
) -> Result<String, String> {
    let mut number = lab.next_virtual();
    // A phone may call itself so.
    while lab.find(&format!("virtual-{number}")).is_ok() {
        number = lab.next_virtual();
    }
    config.seed = seed.unwrap_or(number);
    config.duration_s = Some(DURATION_S);
    let phone = VirtualPhone::new(config).map_err(|error| error.to_string())?;
    let id = format!("virtual-{number}");
    let device = lab.device(&id, &format!("Virtual phone {number}"), "virtual")?;
    let lab = lab.clone();
    tokio::spawn(async move { play(phone.events(), &lab, &device).await });
    Ok(id)
}

/// Delivers events when they are due, until they end or the device is gone.
pub(crate) async fn play(events: impl Iterator<Item = Event> + Send, lab: &Lab, device: &Device) {
    let mut events = events.peekable();
    let Some(first_ns) = events.peek().map(|event| event.time_ns) else {
        return;
    };
    let start = Instant::now();
    let mut tick = tokio::time::interval(BATCH);
    tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
    loop {
        tick.tick().await;
        if device.is_gone() {
            return;
        }
        let elapsed = start.elapsed().as_nanos();
        let due = first_ns.saturating_add(i64::try_from(elapsed).unwrap_or(i64::MAX));
        let mut batch = Vec::new();
        while let Some(event) = events.next_if(|event| event.time_ns <= due) {
            batch.push(event);
        }
        if !batch.is_empty() && give(lab, device, &batch).await.is_err() {
            return;
        }
        if events.peek().is_none() {
            return;
        }
    }
}

/// Delivers events as a device delivers its bytes.
///
/// # Errors
/// The device has been taken away.
pub(crate) async fn give(lab: &Lab, device: &Device, batch: &[Event]) -> Result<(), String> {
    let work = Work::Payload {
        format: WireFormat::Events,
        bytes: events::encode(batch).into(),
        arrival_ns: lab.now_ns(),
        reply: None,
    };
    device.give(work).await
}
