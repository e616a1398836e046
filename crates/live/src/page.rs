//! One open lab page: what it is told, and what becomes of what it asks.
//!
//! Commands are carried out one after the other, in the order in which they came. Questions about
//! finished experiments are answered aside; a curve that nobody waits for any more is not made.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use axum::extract::ws::{Message, WebSocket};
use northing_evaluation::Profile;
use northing_recording::SensorKind;
use northing_simulation::VirtualPhoneConfig;
use serde_json::Value;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::mpsc;

use crate::allan;
use crate::audience;
use crate::everyone::{self, WholeClass};
use crate::frames::{PageFrames, Watched};
use crate::inputs::Inputs;
use crate::lab::{Lab, lock};
use crate::lab_api::LabApi;
use crate::messages::{Action, Change, Command, Request};
use crate::permissions;
use crate::pulse::Pulse;
use crate::roles::Role;
use crate::to_page::{self, ToPage};
use crate::tune::{self, Tuned};
use crate::virtual_phones;

/// Frames a second that a page gets unless it asks for others.
const DISPLAY_HZ: f64 = 30.0;
/// A page can ask for frames a second between these.
const DISPLAY_HZ_LIMITS: [f64; 2] = [1.0, 60.0];
/// How often the list of devices is told.
const DEVICES_INTERVAL: Duration = Duration::from_secs(1);
/// How soon it is told after something in it has changed: a slider moves faster.
const CHANGED_INTERVAL: Duration = Duration::from_millis(60);
/// Commands that may wait.
const MOST_WAITING: usize = 256;

/// A command and what its answer is to name.
type Order = (Request, Value);

struct Page {
    role: Role,
    lab: Arc<Lab>,
    inputs: Arc<Inputs>,
    frames: PageFrames,
    answer: mpsc::Sender<ToPage>,
    orders: mpsc::Sender<Order>,
    /// Number of the newest what-if.
    newest: Arc<AtomicU64>,
}

/// Serves a page until it closes.
pub(crate) async fn serve(api: LabApi, role: Role, mut socket: WebSocket) {
    let lab = api.lab.clone();
    let (mut frames, mut messages) = (lab.frames.subscribe(), lab.listen());
    let mut changed = lab.devices_changed.subscribe();
    let (answer, mut answers) = mpsc::channel(64);
    let (orders, waiting) = mpsc::channel(MOST_WAITING);
    tokio::spawn(carry_out_in_order(lab.clone(), waiting, answer.clone()));
    let mut page = Page {
        role: role.clone(),
        lab: lab.clone(),
        inputs: api.facts.inputs.clone(),
        frames: PageFrames::new(DISPLAY_HZ),
        answer,
        orders,
        newest: Arc::default(),
    };
    let mut devices = tokio::time::interval(DEVICES_INTERVAL);
    let mut is_due = false;
    let mut pulse = Pulse::new();
    for message in audience::first(&role, &lab, &api.facts) {
        if send(&mut socket, message.json()).await.is_err() {
            return;
        }
    }
    loop {
        let sent = tokio::select! {
            message = messages.recv() => match message {
                Ok(told) => match audience::heard(&role, &told, &lab, &api.facts) {
                    Some(text) => send(&mut socket, text).await,
                    None => Ok(()),
                },
                // The page was too slow: it gets the tables afresh.
                Err(RecvError::Lagged(_)) => send(&mut socket, audience::experiments(&role, &lab).json()).await,
                Err(RecvError::Closed) => return,
            },
            frame = frames.recv() => match frame {
                Ok(frame) if !role.owns(&frame.device) => Ok(()),
                Ok(frame) => match page.frames.take(&frame, Instant::now()) {
                    Some(text) => {
                        let sent = send(&mut socket, text).await;
                        if let Some(arrival_ns) = frame.arrival_ns {
                            lab.latency.note_ns(lab.now_ns() - arrival_ns);
                        }
                        sent
                    }
                    None => Ok(()),
                },
                Err(RecvError::Lagged(_)) => Ok(()),
                Err(RecvError::Closed) => return,
            },
            Ok(()) = changed.changed() => {
                if !is_due {
                    is_due = true;
                    devices.reset_after(CHANGED_INTERVAL);
                }
                Ok(())
            }
            _ = devices.tick() => {
                is_due = false;
                send(&mut socket, audience::devices(&role, &lab).json()).await
            }
            Some(message) = answers.recv() => send(&mut socket, message.json()).await,
            alive = pulse.beat() => match alive {
                true => socket.send(Message::Ping(Default::default())).await,
                false => return,
            },
            received = socket.recv() => match pulse.felt(received) {
                Some(Ok(Message::Text(text))) => {
                    page.asked(&text);
                    Ok(())
                }
                Some(Ok(Message::Close(_)) | Err(_)) | None => return,
                Some(Ok(_)) => Ok(()),
            },
        };
        if sent.is_err() {
            return;
        }
    }
}

async fn send(socket: &mut WebSocket, text: String) -> Result<(), axum::Error> {
    socket.send(Message::Text(text.into())).await
}

fn refusal(text: impl Into<String>, request: Value) -> ToPage {
    ToPage::Error {
        text: text.into(),
        request,
    }
}

impl Page {
    /// Takes one message of the page.
    fn asked(&mut self, text: &str) {
        let message: Value = serde_json::from_str(text).unwrap_or_default();
        let request_id = message.get("request").cloned().unwrap_or_default();
        let request: Request = match serde_json::from_value(message) {
            Ok(request) => request,
            Err(error) => {
                let text = format!("the page sent what the program does not know: {error}");
                return self.refuse(text, request_id);
            }
        };
        match permissions::check(&self.role, &self.lab, &request) {
            Ok(()) => self.permitted(request, request_id),
            Err(text) => self.refuse(text, request_id),
        }
    }

    /// Does what this page may ask for.
    fn permitted(&mut self, request: Request, request_id: Value) {
        match request {
            Request::DisplayRate { hz } => {
                let [least, most] = DISPLAY_HZ_LIMITS;
                let hz = if hz.is_finite() {
                    hz.clamp(least, most)
                } else {
                    DISPLAY_HZ
                };
                self.frames.set_rate(hz);
            }
            Request::Watch { device } => {
                self.frames
                    .watch(device.map_or(Watched::None, Watched::One));
            }
            Request::WhatIf { id, change, curve } => {
                self.what_if(id, *change, curve, request_id);
            }
            Request::Input {
                action,
                kind,
                address,
                id,
            } => {
                let changed = self.inputs.change(action, kind, &address, id.as_deref());
                if let Err(text) = changed {
                    self.refuse(text, request_id);
                }
            }
            Request::Tune {
                id,
                change,
                parameters,
            } => self.tune(id, *change, parameters, request_id),
            Request::Allan { id, sensor } => self.allan(id, sensor, request_id),
            request => {
                if self.orders.try_send((request, request_id.clone())).is_err() {
                    self.refuse("the lab is busy; try again", request_id);
                }
            }
        }
    }

    /// A page that does not read its answers misses this one.
    fn refuse(&self, text: impl Into<String>, request_id: Value) {
        let _ = self.answer.try_send(refusal(text, request_id));
    }

    /// Answers from aside, for it takes a while; the page may have gone by then.
    fn aside(
        &self,
        request_id: Value,
        work: impl FnOnce(&Lab, &dyn Fn(ToPage)) -> Result<(), String> + Send + 'static,
    ) {
        let (lab, answer) = (self.lab.clone(), self.answer.clone());
        tokio::task::spawn_blocking(move || {
            let tell = |message| {
                let _ = answer.blocking_send(message);
            };
            if let Err(text) = work(&lab, &tell) {
                tell(refusal(text, request_id));
            }
        });
    }

    /// The runs first, for somebody moves a slider; then the curve, if no newer question came.
    fn what_if(&self, id: String, change: Change, curve: Option<String>, request: Value) {
        let newest = self.newest.clone();
        let number = newest.fetch_add(1, Ordering::Relaxed) + 1;
        self.aside(request.clone(), move |lab, tell| {
            let finished = lab.experiment(&id)?;
            tell(ToPage::WhatIf(finished.what_if(&change, request.clone())?));
            let Some(parameter) = curve else {
                return Ok(());
            };
            let is_wanted = || newest.load(Ordering::Relaxed) == number;
            if let Some(curve) = finished.curve(&change, &parameter, &is_wanted)? {
                tell(ToPage::Curve(to_page::Curve { request, id, curve }));
            }
            Ok(())
        });
    }

    /// A fit takes many runs: the page hears how far it is, and a newer question ends it.
    fn tune(&self, id: String, change: Change, parameters: Vec<String>, request: Value) {
        let newest = self.newest.clone();
        let number = newest.fetch_add(1, Ordering::Relaxed) + 1;
        let progress = self.answer.clone();
        self.aside(request.clone(), move |lab, tell| {
            let finished = lab.experiment(&id)?;
            let answer = |runs, fit| {
                ToPage::Tuned(Tuned {
                    request: request.clone(),
                    id: id.clone(),
                    runs,
                    fit,
                })
            };
            let told = Mutex::new((Instant::now(), 0));
            let go_on = |runs: usize| {
                let mut told = lock(&told);
                told.1 = told.1.max(runs);
                if told.0.elapsed() > tune::TELL_EVERY {
                    told.0 = Instant::now();
                    let _ = progress.try_send(answer(told.1, None));
                }
                newest.load(Ordering::Relaxed) == number && !progress.is_closed()
            };
            let fit = finished.tuned(&change, parameters, &go_on)?;
            let runs = lock(&told).1;
            if fit.is_some() {
                tell(answer(runs, fit));
            }
            Ok(())
        });
    }

    fn allan(&self, id: String, sensor: String, request: Value) {
        self.aside(request.clone(), move |lab, tell| {
            let kind = SensorKind::ALL.into_iter().find(|k| k.name() == sensor);
            let kind = kind.ok_or_else(|| format!("there is no sensor `{sensor}`"))?;
            let answer = allan::analysis(&*lab.experiment(&id)?, kind, request);
            tell(ToPage::Allan(Box::new(answer)));
            Ok(())
        });
    }
}

async fn carry_out_in_order(
    lab: Arc<Lab>,
    mut waiting: mpsc::Receiver<Order>,
    answer: mpsc::Sender<ToPage>,
) {
    while let Some((request, request_id)) = waiting.recv().await {
        if let Some(what) = WholeClass::of(&request) {
            let told = everyone::ask(&lab, what, request_id).await;
            let _ = answer.send(ToPage::Everyone(told)).await;
        } else if let Err(text) = carry_out(&lab, request).await {
            // The page may have gone; what it had asked for is still done.
            let _ = answer.send(refusal(text, request_id)).await;
        }
    }
}

/// Does what a page asked for.
pub(crate) async fn carry_out(lab: &Arc<Lab>, request: Request) -> Result<(), String> {
    let (device, command) = match request {
        Request::VirtualPhone {
            action: Action::Add,
            motion,
            disturbance,
            seed,
            hard_iron_ut,
            ..
        } => {
            let mut config = VirtualPhoneConfig {
                motion,
                disturbance,
                ..VirtualPhoneConfig::default()
            };
            config.magnetometer.bias_ut = hard_iron_ut;
            virtual_phones::add(lab, config, seed)?;
            return Ok(());
        }
        Request::VirtualPhone { device, .. } => {
            let id = device.or_else(|| lab.newest_virtual());
            lab.remove(&id.ok_or("there is no virtual phone to remove")?);
            return Ok(());
        }
        Request::DeleteExperiment { id } => {
            let of = lab.clone();
            let deleted = tokio::task::spawn_blocking(move || of.delete_experiment(&id)).await;
            deleted.map_err(|error| error.to_string())??;
            lab.tell(&lab.experiments_message());
            return Ok(());
        }
        Request::ArchiveExperiment { id, archived } => {
            let of = lab.clone();
            let done = move || of.archive_experiment(&id, archived);
            let done = tokio::task::spawn_blocking(done).await;
            done.map_err(|error| error.to_string())??;
            lab.tell(&lab.experiments_message());
            return Ok(());
        }
        Request::Remove { device } => {
            lab.remove_gone(&device)?;
            return Ok(());
        }
        // Of every device, and questions: both are answered elsewhere.
        Request::CalibrateAll { .. }
        | Request::ExperimentAll { .. }
        | Request::StopAll
        | Request::DisplayRate { .. }
        | Request::Watch { .. }
        | Request::WhatIf { .. }
        | Request::Tune { .. }
        | Request::Allan { .. }
        | Request::Input { .. } => {
            return Ok(());
        }
        Request::Calibrate { device, seconds } => (device, Command::Calibrate(seconds)),
        Request::Experiment {
            device,
            seconds,
            name,
        } => (device, Command::Experiment(seconds, name)),
        Request::Stop { device } => (device, Command::Stop),
        Request::Settings {
            device,
            settings,
            profile,
        } => {
            let profile: Option<Profile> = match profile {
                Some(name) => Some(name.parse().map_err(|e| format!("{e}"))?),
                None => None,
            };
            (device, Command::Settings(profile, settings))
        }
        Request::Sensors { device, used } => (device, Command::Sensors(used.selection()?)),
        Request::CalibrateMagnetometer { device, action } => {
            (device, Command::CalibrateMagnetometer(action))
        }
        Request::Estimators { device, used } => (device, Command::Estimators(used)),
        Request::Subject { device, estimator } => (device, Command::Subject(estimator)),
        Request::Rename { device, name } => (device, Command::Rename(name)),
    };
    lab.find(&device)?.command(command, lab.now_ns()).await
}
