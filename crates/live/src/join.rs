//! How a browser elsewhere comes to its cookie: a phone by its own secret, a laptop by a code, a teacher by a link.
//!
//! Secrets come in the bodies of posts, never in an address that is sent: addresses end up in histories and logs.

use std::net::IpAddr;
use std::sync::Arc;
use std::time::Instant;

use axum::body::Body;
use axum::extract::{ConnectInfo, Extension, Path, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::from_fn_with_state;
use axum::response::{IntoResponse, Redirect, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::json;

use crate::credentials::{CODE_LIFE, Credentials, Denied};
use crate::ingest::{Ingest, Refusal, TOKEN_HEADER, body};
use crate::lab::lock;
use crate::limits::Peer;
use crate::roles::{self, JOIN, Role, set_cookie};
use crate::token::Token;

/// What the handlers share.
#[derive(Debug, Clone)]
pub struct Joining {
    /// The secrets.
    pub credentials: Arc<Credentials>,
    /// What phones talk to.
    pub ingest: Ingest,
}

/// `/join` and what is below it.
pub fn router(joining: Joining) -> Router {
    let known = from_fn_with_state(joining.credentials.clone(), roles::authenticate);
    let code = post(code).layer(known);
    Router::new()
        .route("/", get(|| async { Redirect::to("/lab/") }))
        .route(JOIN, get(page))
        .route("/join/assets/{name}", get(asset))
        .route("/join/phone", post(phone))
        .route("/join/code", code)
        .route("/join/laptop", post(laptop))
        .route("/join/teacher", post(teacher))
        .with_state(joining)
}

async fn page(State(joining): State<Joining>, asked: HeaderMap) -> Response {
    let Ingest { assets, name, .. } = &joining.ingest;
    assets.answer("join", "index.html", name, &asked)
}

async fn asset(
    State(joining): State<Joining>,
    Path(file): Path<String>,
    asked: HeaderMap,
) -> Response {
    let Ingest { assets, name, .. } = &joining.ingest;
    assets.answer("join", &file, name, &asked)
}

type Answer = Result<Response, Refusal>;

fn refusal(status: StatusCode, text: &str) -> Refusal {
    Refusal::new(status, text)
}

/// Why somebody is not let in, in words for whoever tries.
fn denied(denied: Denied, wrong: &str) -> Refusal {
    match denied {
        Denied::Wrong => refusal(StatusCode::FORBIDDEN, wrong),
        Denied::TooMany => refusal(
            StatusCode::TOO_MANY_REQUESTS,
            "too many wrong ones were tried of late: wait a minute",
        ),
        Denied::Taken => refusal(
            StatusCode::CONFLICT,
            "this device belongs to another page: only the one that joined first steers it",
        ),
        Denied::NoRandom => refusal(
            StatusCode::INTERNAL_SERVER_ERROR,
            "the system gives no random numbers",
        ),
    }
}

/// Lets in: a cookie, and what the page is to know.
fn welcome(key: &Token, told: serde_json::Value) -> Response {
    let fresh = [(header::CACHE_CONTROL, "no-store")];
    (set_cookie(key), fresh, Json(told)).into_response()
}

/// The JSON of a post, if it may come.
async fn read<T: DeserializeOwned>(
    joining: &Joining,
    peer: &Peer,
    headers: &HeaderMap,
    content: Body,
) -> Result<T, Refusal> {
    let bytes = body(&joining.ingest, peer, headers, content).await?;
    serde_json::from_slice(&bytes)
        .map_err(|error| refusal(StatusCode::BAD_REQUEST, &format!("the request: {error}")))
}

/// Does what ends with a write to the disk.
async fn aside<T: Send + 'static>(
    joining: &Joining,
    work: impl FnOnce(&Credentials) -> T + Send + 'static,
) -> Result<T, Refusal> {
    let credentials = joining.credentials.clone();
    let done = tokio::task::spawn_blocking(move || work(&credentials)).await;
    done.map_err(|error| refusal(StatusCode::INTERNAL_SERVER_ERROR, &error.to_string()))
}

/// The page of a phone that delivers.
#[derive(Deserialize)]
struct PhonePage {
    /// Its identifier.
    device: String,
    /// Its page load: known to this page and to the lab.
    session: String,
    /// What it alone knows.
    secret: String,
}

/// The first secret that tells identifier and session of a page that delivers samples keeps the device.
async fn phone(
    State(joining): State<Joining>,
    ConnectInfo(peer): ConnectInfo<Peer>,
    headers: HeaderMap,
    content: Body,
) -> Answer {
    let token = headers.get(TOKEN_HEADER).and_then(|t| t.to_str().ok());
    let known = joining
        .credentials
        .is_lab(token.unwrap_or_default(), peer.address, Instant::now());
    known.map_err(|no| denied(no, "wrong token: scan the QR code of the lab again"))?;
    let page: PhonePage = read(&joining, &peer, &headers, content).await?;
    let lab = &joining.ingest.lab;
    let unknown = || {
        let text = "this page delivers no samples yet: start sending first";
        refusal(StatusCode::NOT_FOUND, text)
    };
    let device = lab.identified(&page.device, &page.session);
    let device = device.and_then(|id| lab.find(&id).ok());
    let device = device.filter(|device| lock(&device.status).session.received > 0);
    let id = device.ok_or_else(unknown)?.id.clone();
    let of = id.clone();
    let key = aside(&joining, move |known| known.claim(&of, &page.secret)).await?;
    let key = key.map_err(|no| denied(no, "this is no secret: load the page again"))?;
    Ok(welcome(&key, json!({"device": id})))
}

/// A code with which a laptop sees and steers the phone of whoever asks.
async fn code(State(joining): State<Joining>, Extension(role): Extension<Role>) -> Answer {
    let device = role.device().ok_or_else(|| {
        refusal(
            StatusCode::BAD_REQUEST,
            "codes are for students: a phone asks for one",
        )
    })?;
    let code = joining.credentials.code(device, Instant::now());
    let code = code.map_err(|no| denied(no, ""))?;
    let told = json!({"code": code, "seconds": CODE_LIFE.as_secs()});
    let fresh = [(header::CACHE_CONTROL, "no-store")];
    Ok((fresh, Json(told)).into_response())
}

/// A code, as somebody typed it.
#[derive(Deserialize)]
struct Typed {
    code: String,
}

async fn laptop(
    State(joining): State<Joining>,
    ConnectInfo(peer): ConnectInfo<Peer>,
    headers: HeaderMap,
    content: Body,
) -> Answer {
    let typed: Typed = read(&joining, &peer, &headers, content).await?;
    let address: IpAddr = peer.address;
    let key = aside(&joining, move |known| {
        known.use_code(&typed.code, address, Instant::now())
    });
    let wrong =
        "there is no such code: it is good once and for five minutes; ask the phone for another";
    let key = key.await?.map_err(|no| denied(no, wrong))?;
    Ok(welcome(&key, json!({})))
}

/// The token of a teacher's link.
#[derive(Deserialize)]
struct Link {
    token: String,
}

async fn teacher(
    State(joining): State<Joining>,
    ConnectInfo(peer): ConnectInfo<Peer>,
    headers: HeaderMap,
    content: Body,
) -> Answer {
    let link: Link = read(&joining, &peer, &headers, content).await?;
    let address: IpAddr = peer.address;
    let key = aside(&joining, move |known| {
        known.use_link(&link.token, address, Instant::now())
    });
    let wrong =
        "this link is not of this lab: take the one that `northing live --teacher-link` prints";
    let key = key.await?.map_err(|no| denied(no, wrong))?;
    Ok(welcome(&key, json!({})))
}
