//! What phones talk to: the phone page over TLS, and plain uploads of native apps.
//!
//! The phone page sends its token in a header, apps that can only be given an address have it in the path.

use std::sync::Arc;
use std::time::Duration;

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{ConnectInfo, Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use northing_recording::wire::phone_page::Batch;
use northing_recording::wire::sensor_logger_push::Push;
use northing_recording::wire::{LONGEST_BATCH_BYTES, WireError, WireFormat};
use serde_json::{Value, json};
use tokio::sync::oneshot;
use tokio::time::timeout;

use crate::assets::Assets;
use crate::device::Work;
use crate::lab::{Device, Lab, is_own_name, lock};
use crate::limits::{Addresses, Peer};
use crate::phone_hints;
use crate::pulse::Pulse;
use crate::token::Token;

/// The header with the token.
pub(crate) const TOKEN_HEADER: &str = "x-northing-token";
/// A body must have arrived after so long.
const BODY_TIMEOUT: Duration = Duration::from_secs(10);
/// A WebSocket must say its token within so long.
const TOKEN_TIMEOUT: Duration = Duration::from_secs(5);
/// Sensor Logger shows the text of an answer with this status to the person.
const SHOWN_TO_PERSON: u16 = 499;

/// What the listeners of phones share.
#[derive(Debug, Clone)]
pub struct Ingest {
    /// The lab.
    pub lab: Arc<Lab>,
    /// What phones must know.
    pub token: Arc<Token>,
    /// The phone page.
    pub assets: Arc<Assets>,
    /// How much each address has sent.
    pub addresses: Arc<Addresses>,
    /// What people call this lab; may be empty.
    pub name: Arc<str>,
}

/// A refusal: status and one line.
pub(crate) struct Refusal(StatusCode, String);

impl Refusal {
    pub(crate) fn new(status: StatusCode, text: impl Into<String>) -> Self {
        Self(status, text.into())
    }
}

impl IntoResponse for Refusal {
    fn into_response(self) -> Response {
        (self.0, axum::Json(json!({"error": self.1}))).into_response()
    }
}

/// The listener of the phone page.
pub fn phone_router(ingest: Ingest) -> Router {
    Router::new()
        .route("/p", get(page))
        .route("/assets/{name}", get(asset))
        .route("/in", post(page_upload))
        .route("/in/ws", get(socket))
        .with_state(ingest)
}

/// The listener of native apps.
pub fn app_router(ingest: Ingest) -> Router {
    Router::new()
        .route("/in/{token}", post(app_upload))
        .with_state(ingest)
}

async fn page(State(ingest): State<Ingest>, asked: HeaderMap) -> Response {
    let name = &ingest.name;
    ingest.assets.answer("phone", "index.html", name, &asked)
}

async fn asset(
    State(ingest): State<Ingest>,
    Path(file): Path<String>,
    asked: HeaderMap,
) -> Response {
    ingest.assets.answer("phone", &file, &ingest.name, &asked)
}

/// Whether this connection and its address may send so many bytes more.
fn admitted(ingest: &Ingest, peer: &Peer, bytes: usize) -> Result<(), Refusal> {
    if peer.admits(&ingest.addresses, bytes) {
        return Ok(());
    }
    let text = "too much at once from this address: send it again later";
    Err(Refusal::new(StatusCode::TOO_MANY_REQUESTS, text))
}

/// The length that a request announces; one that announces none may be as long as any.
fn announced(headers: &HeaderMap) -> usize {
    let length = headers.get(header::CONTENT_LENGTH);
    let length = length.and_then(|l| l.to_str().ok()?.parse().ok());
    // No more is read of any.
    length.map_or(LONGEST_BATCH_BYTES, |l: usize| l.min(LONGEST_BATCH_BYTES))
}

/// The body, if it may come, comes in time and is not too large. A sender of too much is refused
/// before anything is read.
pub(crate) async fn body(
    ingest: &Ingest,
    peer: &Peer,
    headers: &HeaderMap,
    body: Body,
) -> Result<Bytes, Refusal> {
    admitted(ingest, peer, announced(headers))?;
    let read = timeout(
        BODY_TIMEOUT,
        axum::body::to_bytes(body, LONGEST_BATCH_BYTES),
    )
    .await;
    match read {
        Ok(Ok(bytes)) => Ok(bytes),
        Ok(Err(_)) => Err(Refusal::new(
            StatusCode::PAYLOAD_TOO_LARGE,
            format!("a batch has at most {LONGEST_BATCH_BYTES} bytes"),
        )),
        Err(_) => Err(Refusal::new(
            StatusCode::REQUEST_TIMEOUT,
            "the batch did not arrive in time",
        )),
    }
}

async fn page_upload(
    State(ingest): State<Ingest>,
    ConnectInfo(peer): ConnectInfo<Peer>,
    headers: HeaderMap,
    content: Body,
) -> Result<axum::Json<Value>, Refusal> {
    let token = headers.get(TOKEN_HEADER).and_then(|t| t.to_str().ok());
    if !token.is_some_and(|token| ingest.token.matches(token)) {
        return Err(wrong_token());
    }
    let bytes = body(&ingest, &peer, &headers, content).await?;
    take_page(&ingest.lab, bytes).await.map(axum::Json)
}

fn wrong_token() -> Refusal {
    Refusal::new(
        StatusCode::UNAUTHORIZED,
        "wrong token: scan the QR code of the lab again",
    )
}

/// A batch of the phone page; the answer is made when the lab has taken it.
async fn take_page(lab: &Arc<Lab>, bytes: Bytes) -> Result<Value, Refusal> {
    let batch = Batch::parse(&bytes).map_err(|error| {
        lab.refused(bytes.clone());
        malformed(&error)
    })?;
    let own = lab.identity(&batch.device, &batch.session);
    let device = device(lab, &own, &batch.name, "page")?;
    give(lab, &device, WireFormat::PhonePage, bytes).await?;
    let commands = phone_hints::commands(&lock(&device.status), own != batch.device);
    Ok(json!({
        "ack": batch.seq, "recv_ns": lab.now_ns(), "commands": commands, "device": own,
    }))
}

fn malformed(error: &WireError) -> Refusal {
    Refusal::new(StatusCode::BAD_REQUEST, error.to_string())
}

fn device(
    lab: &Arc<Lab>,
    id: &str,
    name: &str,
    source: &'static str,
) -> Result<Arc<Device>, Refusal> {
    if is_own_name(id) {
        let text = format!("the name `{id}` is kept for the lab's own devices; choose another");
        return Err(Refusal::new(StatusCode::BAD_REQUEST, text));
    }
    let device = lab
        .device(id, name, source)
        .map_err(|full| Refusal::new(StatusCode::SERVICE_UNAVAILABLE, full))?;
    if device.source == source {
        return Ok(device);
    }
    let text = format!("the name `{id}` is taken by another kind of device");
    Err(Refusal::new(StatusCode::BAD_REQUEST, text))
}

async fn give(lab: &Lab, device: &Device, format: WireFormat, bytes: Bytes) -> Result<(), Refusal> {
    let busy = |text: String| Refusal::new(StatusCode::TOO_MANY_REQUESTS, text);
    if !device.admits(bytes.len()) {
        return Err(busy("too fast: send it again later".to_owned()));
    }
    let (reply, taken) = oneshot::channel();
    let length = bytes.len();
    let work = Work::Payload {
        format,
        bytes,
        arrival_ns: lab.now_ns(),
        reply: Some(reply),
    };
    device.try_give(work, length).map_err(busy)?;
    let taken = taken
        .await
        .map_err(|_| busy("the device has been taken away".to_owned()))?;
    taken.map_err(|error| malformed(&error))
}

/// Uploads of native apps: Sensor Logger's push, or batches as the phone page sends them.
async fn app_upload(
    State(ingest): State<Ingest>,
    Path(token): Path<String>,
    ConnectInfo(peer): ConnectInfo<Peer>,
    headers: HeaderMap,
    content: Body,
) -> Result<Response, Refusal> {
    if !ingest.token.matches(&token) {
        let text = "wrong token: copy the address from the lab's page again";
        return Ok(shown(text));
    }
    let bytes = body(&ingest, &peer, &headers, content).await?;
    let answer = match Push::parse(&bytes) {
        Ok(push) => match take_push(&ingest.lab, &peer, &push, bytes).await {
            Err(Refusal(StatusCode::SERVICE_UNAVAILABLE, text)) => return Ok(shown(&text)),
            answer => answer?,
        },
        Err(_) => take_page(&ingest.lab, bytes).await?,
    };
    Ok(axum::Json(answer).into_response())
}

async fn take_push(
    lab: &Arc<Lab>,
    peer: &Peer,
    push: &Push,
    bytes: Bytes,
) -> Result<Value, Refusal> {
    // Phones that do not say who they are are told apart by their addresses.
    let (id, short) = match push.device_id.as_str() {
        "" => (
            format!("sensor-logger-{}", peer.address),
            peer.address.to_string(),
        ),
        id => (id.to_owned(), id.chars().take(6).collect()),
    };
    let device = device(lab, &id, &format!("Sensor Logger {short}"), "sensor-logger")?;
    give(lab, &device, WireFormat::SensorLogger, bytes).await?;
    Ok(json!({"ack": push.message_id}))
}

fn shown(text: &str) -> Response {
    let status = StatusCode::from_u16(SHOWN_TO_PERSON).unwrap_or(StatusCode::UNAUTHORIZED);
    (status, text.to_owned()).into_response()
}

async fn socket(
    State(ingest): State<Ingest>,
    ConnectInfo(peer): ConnectInfo<Peer>,
    upgrade: WebSocketUpgrade,
) -> Response {
    upgrade
        .max_message_size(LONGEST_BATCH_BYTES)
        .max_frame_size(LONGEST_BATCH_BYTES)
        .on_upgrade(move |socket| serve_socket(ingest, peer, socket))
}

/// First the token, then batches, each answered as a post would be.
async fn serve_socket(ingest: Ingest, peer: Peer, mut socket: WebSocket) {
    let first = timeout(TOKEN_TIMEOUT, socket.recv()).await;
    let Ok(Some(Ok(Message::Text(hello)))) = first else {
        return;
    };
    let hello: Value = serde_json::from_str(&hello).unwrap_or_default();
    let token = hello
        .get("token")
        .and_then(Value::as_str)
        .unwrap_or_default();
    if !ingest.token.matches(token) {
        let text = json!({"error": wrong_token().1}).to_string();
        let _ = socket.send(Message::Text(text.into())).await;
        return;
    }
    let mut pulse = Pulse::new();
    loop {
        let answer = tokio::select! {
            alive = pulse.beat() => match alive {
                true => Message::Ping(Bytes::new()),
                false => return,
            },
            received = socket.recv() => match pulse.felt(received) {
                Some(Ok(Message::Text(text))) => batch_answer(&ingest, &peer, text.into()).await,
                Some(Ok(Message::Binary(bytes))) => batch_answer(&ingest, &peer, bytes).await,
                Some(Ok(Message::Ping(_) | Message::Pong(_))) => continue,
                Some(Ok(Message::Close(_)) | Err(_)) | None => return,
            },
        };
        if socket.send(answer).await.is_err() {
            return;
        }
    }
}

async fn batch_answer(ingest: &Ingest, peer: &Peer, bytes: Bytes) -> Message {
    let answer = match admitted(ingest, peer, bytes.len()) {
        Ok(()) => take_page(&ingest.lab, bytes).await,
        Err(refusal) => Err(refusal),
    };
    let answer = answer.unwrap_or_else(|refusal| json!({"error": refusal.1}));
    Message::Text(answer.to_string().into())
}
