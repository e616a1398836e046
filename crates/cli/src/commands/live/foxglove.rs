//! `northing live --foxglove`: every device and estimator of the lab for viewers of Foxglove's protocol, and parameters that
//! they set. Names: `DEVICE/ESTIMATOR` is a frame, `/DEVICE/...` a topic, `DEVICE.PARAMETER` a parameter.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use anyhow::Result;
use northing_core::geometry::rotation;
use northing_evaluation::attitude::parameters::parameters_of;
use northing_foxglove::{InnovationTold, Server, SetRequest, Setting, Told, Topics};
use northing_live::lab::Lab;
use northing_live::messages::{Command, DeviceStatus};
use northing_live::session::frame::{Estimate, Frame};
use serde_json::{Map, Value};
use tokio::runtime::Handle;
use tokio::sync::broadcast::Receiver;
use tokio::sync::broadcast::error::RecvError;
use tokio::task::JoinHandle;

use super::LiveArgs;

/// How often it is looked whether parameters have changed.
const PARAMETERS_EVERY: Duration = Duration::from_secs(1);
/// How often it is looked whether the lab ends.
const LOOK: Duration = Duration::from_millis(100);

/// The server for viewers and its tasks.
pub(super) struct Viewers {
    server: Arc<Server>,
    ends: Arc<AtomicBool>,
    tasks: [JoinHandle<()>; 3],
}

impl Viewers {
    /// Where viewers connect.
    pub(super) fn url(&self) -> String {
        format!("ws://{}", self.server.address())
    }

    /// Ends the server.
    pub(super) async fn stop(self) {
        self.ends.store(true, Ordering::Relaxed);
        let [frames, parameters, requests] = self.tasks;
        frames.abort();
        parameters.abort();
        for task in [frames, parameters, requests] {
            let _ = task.await;
        }
        if let Some(server) = Arc::into_inner(self.server) {
            let _ = tokio::task::spawn_blocking(|| server.stop()).await;
        }
    }
}

/// Starts the server, if it was asked for.
pub(super) fn start(args: &LiveArgs, lab: &Arc<Lab>) -> Result<Option<Viewers>> {
    let Some(address) = args.foxglove else {
        return Ok(None);
    };
    let handle = Handle::current();
    // It starts by blocking, which a thread of the lab may not.
    let started = std::thread::spawn(move || Server::live(address, "northing: the lab")).join();
    let server = Arc::new(started.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?);
    let ends = Arc::new(AtomicBool::new(false));
    let tasks = [
        tokio::spawn(show(Arc::clone(lab), Arc::clone(&server), lab.watch())),
        tokio::spawn(follow_parameters(Arc::clone(lab), Arc::clone(&server))),
        tokio::task::spawn_blocking({
            let (lab, server, ends) = (Arc::clone(lab), Arc::clone(&server), Arc::clone(&ends));
            move || {
                while !ends.load(Ordering::Relaxed) {
                    if let Some(request) = server.next_request(LOOK) {
                        set(&lab, &server, &handle, request);
                    }
                }
            }
        }),
    ];
    Ok(Some(Viewers {
        server,
        ends,
        tasks,
    }))
}

/// The topics of a device: those of each estimator, and under no name those of the device.
type Devices = BTreeMap<(String, &'static str), Topics>;

async fn show(lab: Arc<Lab>, server: Arc<Server>, mut frames: Receiver<Arc<Frame>>) {
    let mut devices = Devices::new();
    loop {
        match frames.recv().await {
            Ok(frame) => show_frame(&server, &mut devices, &frame, lab.now_ns()),
            Err(RecvError::Lagged(_)) => {}
            Err(RecvError::Closed) => return,
        }
    }
}

fn show_frame(server: &Server, devices: &mut Devices, frame: &Frame, now_ns: i64) {
    let device = &frame.device;
    for (name, estimate) in &frame.estimates {
        let topics = devices.entry((device.clone(), name)).or_insert_with(|| {
            server.topics(&format!("/{device}/{name}"), &format!("{device}/{name}"))
        });
        show_estimate(topics, estimate, now_ns);
    }
    let topics = devices
        .entry((device.clone(), ""))
        .or_insert_with(|| server.topics(&format!("/{device}"), device));
    for point in &frame.innovations {
        let told = InnovationTold {
            residual: point.residual,
            std: point.std,
            nis: point.nis,
            degrees_of_freedom: point.dof,
            outcome: point.outcome,
        };
        // Before the newest sample, as in the device's own time.
        let ago_ns = ((frame.t_s - point.t_s).max(0.0) * 1e9) as i64;
        let told = Told::Innovation(point.sensor.name(), told);
        topics.publish(now_ns.saturating_sub(ago_ns), &told, true);
    }
    for lamp in &frame.lamp {
        let told = Told::Lamp {
            sensor: lamp.sensor.name(),
            tone: lamp.tone,
            text: lamp.text.clone(),
            nis: lamp.nis_mean.zip(lamp.nis_expected),
        };
        topics.publish(now_ns, &told, true);
    }
}

fn show_estimate(topics: &mut Topics, estimate: &Estimate, now_ns: i64) {
    let Some(attitude) = rotation::from_wxyz(estimate.q) else {
        return;
    };
    let told = Told::Attitude(attitude, estimate.std_deg);
    topics.publish(now_ns, &told, true);
    if let Some(bias) = estimate.bias_deg_s {
        topics.publish(now_ns, &Told::GyroscopeBias(bias, None), true);
    }
}

/// Tells viewers when parameters of a device are others.
async fn follow_parameters(lab: Arc<Lab>, server: Arc<Server>) {
    let mut interval = tokio::time::interval(PARAMETERS_EVERY);
    let mut before = Vec::new();
    loop {
        interval.tick().await;
        let now = parameters(&lab);
        if now != before {
            server.publish_parameters(&now);
            before = now;
        }
    }
}

/// The parameters that the estimators of each device read.
fn parameters(lab: &Lab) -> Vec<Setting> {
    let of_device = |status: DeviceStatus| {
        let kinds = status.session.estimators.iter();
        let read: Vec<String> = kinds
            .flat_map(|kind| parameters_of(*kind))
            .map(|parameter| parameter.name)
            .collect();
        let values = status.settings.as_object().cloned().unwrap_or_default();
        let values = values
            .into_iter()
            .filter(move |(name, _)| read.contains(name));
        let values = values.map(|(name, value)| (format!("{}.{name}", status.id), value));
        values.collect::<Vec<Setting>>()
    };
    lab.statuses().into_iter().flat_map(of_device).collect()
}

/// Sets parameters of devices, as the page does, and tells what became of it.
fn set(lab: &Lab, server: &Server, handle: &Handle, request: SetRequest) {
    let outcome = of_devices(&request.settings).and_then(|asked| {
        let mut told = Vec::new();
        for (id, settings) in asked {
            let names: Vec<String> = settings.keys().cloned().collect();
            let command = Command::Settings(None, settings);
            let device = lab.find(&id)?;
            handle.block_on(device.command(command, lab.now_ns()))?;
            told.push(format!("{id}: {} set", names.join(", ")));
        }
        Ok(told.join("; "))
    });
    server.publish_outcome(outcome);
    server.publish_parameters(&parameters(lab));
    server.answer(request);
}

/// `DEVICE.PARAMETER`, by device.
fn of_devices(settings: &[Setting]) -> Result<BTreeMap<String, Map<String, Value>>, String> {
    let mut devices: BTreeMap<String, Map<String, Value>> = BTreeMap::new();
    for (name, value) in settings {
        let Some((id, parameter)) = name.rsplit_once('.') else {
            return Err(format!(
                "`{name}` names no device; expected DEVICE.PARAMETER, e.g. phone-1.accelerometer_std"
            ));
        };
        let device = devices.entry(id.to_owned()).or_default();
        device.insert(parameter.to_owned(), value.clone());
    }
    Ok(devices)
}
