//! What the lab page talks to, on this computer alone: the page, its WebSocket, status, files.

use std::sync::Arc;

use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Json, Router};
use northing_evaluation::attitude::own;
use northing_evaluation::attitude::parameters::parameters;
use northing_evaluation::calibration::magnetometer::MagnetometerSource;
use northing_evaluation::calibration::magnetometer::MagnetometerStreamCalibration;
use northing_evaluation::registry::ParameterInfo;
use northing_evaluation::{EstimatorKind, Profile, RunOptions};
use serde::Deserialize;
use serde_json::{Value, json};

use crate::addresses::Reach;
use crate::assets::{Assets, attachment};
use crate::export;
use crate::inputs::{InputKind, Inputs};
use crate::lab::Lab;
use crate::page;
use crate::qr;
use crate::report;
use crate::session::aids::{AIDS, Aid};
use crate::session_export;
use crate::to_page::{AidLine, EstimatorLine, Hello, InputKindLine, Parameter, ToPage};

/// What a page can offer beyond the path itself.
const FEATURES: [&str; 4] = ["estimators", "magnetometer", "allan", "remove"];
/// Longest message of a page, bytes.
const LONGEST_MESSAGE: usize = 64 * 1024;

/// What the lab page is told first.
#[derive(Debug)]
pub struct Facts {
    /// Addresses of the phone page and for native apps.
    pub reach: Arc<Reach>,
    /// SHA-256 of the certificate.
    pub fingerprint: String,
    /// What people call this lab; may be empty.
    pub name: String,
    /// What the lab goes out for or listens for.
    pub inputs: Arc<Inputs>,
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
        .route("/", get(page))
        .route("/assets/{name}", get(asset))
        .route("/api/status", get(status))
        .route("/api/qr.svg", get(qr_svg))
        .route("/api/session.zip", get(session_export::download))
        .route("/api/experiments/{id}/{file}", get(experiment_file))
        .route(
            "/api/devices/{id}/magnetometer.toml",
            get(magnetometer_file),
        )
        .route("/api/ws", get(socket))
        .with_state(api)
}

async fn page(State(api): State<LabApi>, asked: HeaderMap) -> Response {
    let name = &api.facts.name;
    api.assets.answer("lab", "index.html", name, &asked)
}

async fn asset(State(api): State<LabApi>, Path(file): Path<String>, asked: HeaderMap) -> Response {
    api.assets.answer("lab", &file, &api.facts.name, &asked)
}

async fn status(State(api): State<LabApi>) -> Json<Value> {
    Json(json!({
        "version": env!("CARGO_PKG_VERSION"),
        "phone_urls": api.facts.reach.phone_urls(),
        "ingest_urls": api.facts.reach.ingest_urls(),
        "fingerprint": api.facts.fingerprint,
        "recording": api.lab.recording_status(),
        "devices": api.lab.statuses(), "latency": api.lab.latency.summary(),
        "experiments": api.lab.experiment_rows(),
        "name": api.facts.name,
        "inputs": api.facts.inputs.statuses(),
    }))
}

/// Which of the phone page's addresses a code is for.
#[derive(Debug, Default, Deserialize)]
struct Which {
    /// Place in the list of addresses.
    #[serde(default)]
    url: usize,
}

async fn qr_svg(State(api): State<LabApi>, Query(which): Query<Which>) -> Response {
    let urls = api.facts.reach.phone_urls();
    match urls.get(which.url).and_then(|url| qr::svg(url)) {
        Some(image) => {
            // Addresses change while the lab runs.
            let headers = [
                (header::CONTENT_TYPE, "image/svg+xml"),
                (header::CACHE_CONTROL, "no-store"),
            ];
            (headers, image).into_response()
        }
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

/// An answer, or the reason why there is none.
type Answer = Result<Response, (StatusCode, String)>;

fn not_found(text: impl Into<String>) -> (StatusCode, String) {
    (StatusCode::NOT_FOUND, text.into())
}

fn failed(error: &impl ToString) -> (StatusCode, String) {
    (StatusCode::INTERNAL_SERVER_ERROR, error.to_string())
}

async fn experiment_file(
    State(api): State<LabApi>,
    Path((id, name)): Path<(String, String)>,
) -> Answer {
    let (lab, of, file) = (api.lab.clone(), id.clone(), name.clone());
    let finished = tokio::task::spawn_blocking(move || lab.experiment(&of)).await;
    let finished = finished.map_err(|_| failed(&""))?.map_err(not_found)?;
    let made = tokio::task::spawn_blocking(move || export::export(&finished, &file));
    let made = made
        .await
        .map_err(|_| failed(&""))?
        .map_err(|error| failed(&error))?;
    let export = made.ok_or_else(|| not_found("there is no such file"))?;
    let shown = if name == "report.html" {
        "inline"
    } else {
        "attachment"
    };
    let headers = [
        (header::CONTENT_TYPE, export.content_type.to_owned()),
        (
            header::CONTENT_DISPOSITION,
            format!("{shown}; filename=\"{id}-{name}\""),
        ),
        (header::CONTENT_SECURITY_POLICY, report::policy()),
    ];
    Ok((headers, export.bytes).into_response())
}

/// The magnetometer calibration in force, to be used elsewhere.
async fn magnetometer_file(State(api): State<LabApi>, Path(id): Path<String>) -> Answer {
    let calibration = api.lab.find(&id).map_err(not_found)?.magnetometer();
    let none = || not_found("this device has no magnetometer calibration in force");
    // As `northing run --magnetometer-calibration` reads it; the lab uses the device's own stream.
    let field = MagnetometerStreamCalibration {
        magnetometer: MagnetometerSource::Device,
        calibration: calibration.ok_or_else(none)?,
    };
    let text = toml::to_string(&field).map_err(|error| failed(&error))?;
    Ok((attachment("application/toml", "magnetometer.toml"), text).into_response())
}

async fn socket(State(api): State<LabApi>, upgrade: WebSocketUpgrade) -> Response {
    upgrade
        .max_message_size(LONGEST_MESSAGE)
        .on_upgrade(move |socket| async move { page::serve(api, socket).await })
}

/// What every page is told first, and again when the addresses have changed.
pub(crate) fn hello(facts: &Facts) -> ToPage {
    let phone_urls = facts.reach.phone_urls();
    let host = phone_urls.first().and_then(|url| url.split('/').nth(2));
    ToPage::Hello(Box::new(Hello {
        version: env!("CARGO_PKG_VERSION"),
        // Another address is another picture.
        qr_svg: format!("/api/qr.svg?url=0&for={}", host.unwrap_or_default()),
        phone_urls,
        ingest_urls: facts.reach.ingest_urls(),
        estimators: EstimatorKind::ALL
            .into_iter()
            .chain(own::registered())
            .map(|name| EstimatorLine {
                name,
                summary: name.info().summary,
                reads: reads(name),
            })
            .collect(),
        parameters: parameters().into_iter().map(parameter).collect(),
        aids: AIDS.iter().map(aid).collect(),
        fingerprint: facts.fingerprint.clone(),
        features: &FEATURES,
        name: facts.name.clone(),
        input_kinds: InputKind::ALL
            .map(|kind| InputKindLine {
                kind,
                title: kind.title(),
                hint: kind.hint(),
                example: kind.example(),
            })
            .into(),
        inputs: facts.inputs.statuses(),
    }))
}

/// The parameters that an estimator reads.
fn reads(estimator: EstimatorKind) -> Vec<String> {
    let options = RunOptions::new(estimator, Profile::Lab);
    options.parameters().into_iter().map(|p| p.name).collect()
}

fn aid(aid: &Aid) -> AidLine {
    AidLine {
        sensor: aid.sensor,
        title: aid.title,
        switch: aid.switch,
        noise: aid.noise,
        gate: aid.gate,
        unit: aid.unit,
        is_usual: aid.is_usual,
    }
}

fn parameter(info: ParameterInfo) -> Parameter {
    Parameter {
        name: info.name,
        unit: info.unit,
        range: info.range,
        meaning: info.meaning,
        default: info.defaults.into_iter().collect(),
    }
}
