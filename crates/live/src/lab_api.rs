//! What the lab page talks to, on this computer alone: the page, its WebSocket, status, files.

use std::collections::HashMap;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Path, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Json, Router};
use northing_evaluation::parameters::parameters;
use northing_evaluation::{EstimatorKind, Profile};
use serde_json::{Value, json};
use tokio::sync::broadcast::error::RecvError;

use crate::assets::Assets;
use crate::export;
use crate::lab::{FrameText, Lab};
use crate::messages::{Action, Command, Request};
use crate::qr;
use crate::virtual_phones::{self, VirtualPhoneRequest};

/// Frames a second that a page gets unless it asks for others.
const DISPLAY_HZ: f64 = 30.0;
/// A page can ask for frames a second between these.
const DISPLAY_HZ_LIMITS: [f64; 2] = [1.0, 60.0];
/// How often the list of devices is told.
const DEVICES_INTERVAL: Duration = Duration::from_secs(1);
/// Longest message of a page, bytes.
const LONGEST_MESSAGE: usize = 64 * 1024;

/// What the lab page is told first.
#[derive(Debug, Clone)]
pub struct Facts {
    /// Addresses of the phone page, token included.
    pub phone_urls: Vec<String>,
    /// Addresses for native apps, token included.
    pub ingest_urls: Vec<String>,
    /// SHA-256 of the certificate.
    pub fingerprint: String,
}

/// What the handlers share.
#[derive(Debug, Clone)]
pub struct LabApi {
    /// The lab.
    pub lab: Arc<Lab>,
    /// What the page is told first.
    pub facts: Arc<Facts>,
    /// The pages.
    pub assets: Arc<Assets>,
}

/// The listener of the lab page.
pub fn router(api: LabApi) -> Router {
    Router::new()
        .route(
            "/",
            get(|State(api): State<LabApi>| async move { file(&api, "index.html") }),
        )
        .route("/assets/{name}", get(asset))
        .route("/api/status", get(status))
        .route("/api/qr.svg", get(qr_svg))
        .route("/api/experiments/{id}/{file}", get(experiment_file))
        .route("/api/ws", get(socket))
        .with_state(api)
}

async fn asset(State(api): State<LabApi>, Path(name): Path<String>) -> Response {
    file(&api, &name)
}

fn file(api: &LabApi, name: &str) -> Response {
    match api.assets.get("lab", name) {
        Some((bytes, kind)) => {
            let headers = [
                (header::CONTENT_TYPE, kind),
                (header::CACHE_CONTROL, "no-cache"),
            ];
            (headers, bytes.into_owned()).into_response()
        }
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn status(State(api): State<LabApi>) -> Json<Value> {
    Json(json!({
        "version": env!("CARGO_PKG_VERSION"),
        "phone_urls": api.facts.phone_urls,
        "ingest_urls": api.facts.ingest_urls,
        "fingerprint": api.facts.fingerprint,
        "devices": api.lab.statuses(),
        "experiments": api.lab.experiments_message()["rows"],
    }))
}

async fn qr_svg(State(api): State<LabApi>) -> Response {
    match api.facts.phone_urls.first().and_then(|url| qr::svg(url)) {
        Some(image) => ([(header::CONTENT_TYPE, "image/svg+xml")], image).into_response(),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn experiment_file(
    State(api): State<LabApi>,
    Path((id, name)): Path<(String, String)>,
) -> Response {
    let finished = match api.lab.experiment(&id) {
        Ok(finished) => finished,
        Err(text) => return (StatusCode::NOT_FOUND, text).into_response(),
    };
    let made = tokio::task::spawn_blocking(move || {
        let made = export::export(&finished, &name);
        made.map(|export| export.map(|export| (export, name)))
    });
    match made.await {
        Ok(Ok(Some((export, name)))) => {
            let shown = if name == "report.html" {
                "inline"
            } else {
                "attachment"
            };
            let disposition = format!("{shown}; filename=\"{id}-{name}\"");
            let headers = [
                (header::CONTENT_TYPE, export.content_type.to_owned()),
                (header::CONTENT_DISPOSITION, disposition),
                // The report has its style sheet and pictures within itself.
                (
                    header::CONTENT_SECURITY_POLICY,
                    "default-src 'none'; style-src 'unsafe-inline'; img-src data:".to_owned(),
                ),
            ];
            (headers, export.bytes).into_response()
        }
        Ok(Ok(None)) => (StatusCode::NOT_FOUND, "there is no such file").into_response(),
        Ok(Err(text)) => (StatusCode::INTERNAL_SERVER_ERROR, text).into_response(),
        Err(_) => StatusCode::INTERNAL_SERVER_ERROR.into_response(),
    }
}

async fn socket(State(api): State<LabApi>, upgrade: WebSocketUpgrade) -> Response {
    upgrade
        .max_message_size(LONGEST_MESSAGE)
        .on_upgrade(move |socket| async move {
            Page::new(api).serve(socket).await;
        })
}

fn hello(facts: &Facts) -> Value {
    let estimators: Vec<Value> = EstimatorKind::ALL
        .map(EstimatorKind::info)
        .iter()
        .map(|info| json!({"name": info.name, "summary": info.summary}))
        .collect();
    let parameters: Vec<Value> = parameters()
        .into_iter()
        .map(|parameter| {
            let defaults: HashMap<&str, Value> = parameter
                .defaults
                .into_iter()
                .map(|(profile, value)| (profile.name(), value))
                .collect();
            json!({
                "name": parameter.name, "unit": parameter.unit,
                "meaning": parameter.meaning, "default": defaults,
            })
        })
        .collect();
    json!({
        "type": "hello", "version": env!("CARGO_PKG_VERSION"),
        "phone_urls": facts.phone_urls, "ingest_urls": facts.ingest_urls,
        "qr_svg": "/api/qr.svg", "estimators": estimators, "parameters": parameters,
        "fingerprint": facts.fingerprint,
    })
}

/// One open lab page.
struct Page {
    api: LabApi,
    interval: Duration,
    last_frame: HashMap<String, Instant>,
}

impl Page {
    fn new(api: LabApi) -> Self {
        Self {
            api,
            interval: Duration::from_secs_f64(1.0 / DISPLAY_HZ),
            last_frame: HashMap::new(),
        }
    }

    async fn serve(mut self, mut socket: WebSocket) {
        let lab = self.api.lab.clone();
        let (mut frames, mut messages) = (lab.frames.subscribe(), lab.listen());
        let (answer, mut answers) = tokio::sync::mpsc::channel::<Value>(64);
        let mut devices = tokio::time::interval(DEVICES_INTERVAL);
        let first = [
            hello(&self.api.facts),
            lab.devices_message(),
            lab.experiments_message(),
        ];
        for message in first {
            if send(&mut socket, message.to_string()).await.is_err() {
                return;
            }
        }
        loop {
            let sent = tokio::select! {
                message = messages.recv() => match message {
                    Ok(text) => send(&mut socket, text.to_string()).await,
                    // The page was too slow: it gets the tables afresh.
                    Err(RecvError::Lagged(_)) => send(&mut socket, lab.experiments_message().to_string()).await,
                    Err(RecvError::Closed) => return,
                },
                frame = frames.recv() => match frame {
                    Ok(frame) if self.is_due(&frame) => send(&mut socket, frame.text.clone()).await,
                    Ok(_) | Err(RecvError::Lagged(_)) => Ok(()),
                    Err(RecvError::Closed) => return,
                },
                _ = devices.tick() => send(&mut socket, lab.devices_message().to_string()).await,
                Some(value) = answers.recv() => send(&mut socket, value.to_string()).await,
                received = socket.recv() => match received {
                    Some(Ok(Message::Text(text))) => {
                        self.asked(&text, &answer);
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

    /// Whether this page wants another frame of that device already.
    fn is_due(&mut self, frame: &FrameText) -> bool {
        let now = Instant::now();
        // A little early is in time: frames come in steps of their own.
        let wait = self.interval.mul_f64(0.8);
        if let Some(last) = self.last_frame.get_mut(&frame.device) {
            if now.duration_since(*last) < wait {
                return false;
            }
            *last = now;
            return true;
        }
        self.last_frame.insert(frame.device.clone(), now);
        true
    }

    /// Answers one message; what takes long is done aside.
    fn asked(&mut self, text: &str, answer: &tokio::sync::mpsc::Sender<Value>) {
        let message: Value = serde_json::from_str(text).unwrap_or_default();
        let request_id = message.get("request").cloned().unwrap_or_default();
        let request: Request = match serde_json::from_value(message) {
            Ok(request) => request,
            Err(error) => {
                let text = format!("the page sent what the program does not know: {error}");
                // A page that does not read its answers misses this one.
                let _ = answer.try_send(error_message(&text, &request_id));
                return;
            }
        };
        if let Request::DisplayRate { hz } = request {
            let [least, most] = DISPLAY_HZ_LIMITS;
            let hz = if hz.is_finite() {
                hz.clamp(least, most)
            } else {
                DISPLAY_HZ
            };
            self.interval = Duration::from_secs_f64(1.0 / hz);
            return;
        }
        let (lab, answer) = (self.api.lab.clone(), answer.clone());
        tokio::spawn(async move {
            let message = match carry_out(&lab, request, &request_id).await {
                Ok(None) => return,
                Ok(Some(message)) => message,
                Err(text) => error_message(&text, &request_id),
            };
            // The page may have gone.
            let _ = answer.send(message).await;
        });
    }
}

fn error_message(text: &str, request: &Value) -> Value {
    json!({"type": "error", "text": text, "request": request})
}

async fn send(socket: &mut WebSocket, text: String) -> Result<(), axum::Error> {
    socket.send(Message::Text(text.into())).await
}

/// Does what a page asked for; some requests have an answer of their own.
async fn carry_out(
    lab: &Arc<Lab>,
    request: Request,
    request_id: &Value,
) -> Result<Option<Value>, String> {
    let (device, command) = match request {
        Request::VirtualPhone {
            action: Action::Add,
            motion,
            disturbance,
            seed,
            ..
        } => {
            let request = VirtualPhoneRequest {
                motion,
                disturbance,
                seed,
            };
            virtual_phones::add(lab, request)?;
            return Ok(None);
        }
        Request::VirtualPhone { device, .. } => {
            let id = device.or_else(|| lab.newest_virtual());
            lab.remove(&id.ok_or("there is no virtual phone to remove")?);
            return Ok(None);
        }
        Request::WhatIf {
            id,
            settings,
            curve,
        } => {
            let finished = lab.experiment(&id)?;
            let runs = move || finished.what_if(None, &settings, curve.as_deref());
            let runs = tokio::task::spawn_blocking(runs).await;
            let result = runs.map_err(|_| "the run broke off".to_owned())??;
            return Ok(Some(json!({
                "type": "what_if", "request": request_id, "id": id,
                "elapsed_ms": result.elapsed_ms, "results": result.summaries,
                "trace": result.trace, "curve": result.curve,
            })));
        }
        Request::DisplayRate { .. } => return Ok(None),
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
        Request::Estimators { device, used } => (device, Command::Estimators(used)),
        Request::Rename { device, name } => (device, Command::Rename(name)),
    };
    lab.find(&device)?.command(command, lab.now_ns()).await?;
    Ok(None)
}
