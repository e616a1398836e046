//! What the lab page talks to: the page, its WebSocket, status, files. On this computer for everybody, elsewhere over TLS for
//! whoever has joined.

use std::sync::Arc;

use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Extension, Path, Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::middleware::{from_fn, from_fn_with_state};
use axum::response::{IntoResponse, Redirect, Response};
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
use crate::credentials::Credentials;
use crate::export;
use crate::hand_in_api::HandInApi;
use crate::inputs::{InputKind, Inputs};
use crate::lab::Lab;
use crate::mine;
use crate::page;
use crate::permissions;
use crate::qr;
use crate::report;
use crate::roles::{self, Role};
use crate::session::aids::{AIDS, Aid};
use crate::session_export;
use crate::to_page::{AidLine, EstimatorLine, Hello, InputKindLine, Parameter, ToPage};

/// What a page can offer beyond the path itself.
const FEATURES: [&str; 5] = ["estimators", "magnetometer", "allan", "remove", "results"];
/// What came out of an experiment, for a page that was opened later.
const RESULT: &str = "result.json";
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
    /// Exercises and what was handed in.
    pub(crate) hand_ins: HandInApi,
}

/// The listener of the lab page on this computer: whoever sits at it is the teacher. `files`: recordings and what was opened,
/// for teachers.
pub fn router(api: LabApi, files: Router) -> Router {
    Router::new()
        .route("/", get(page))
        .route("/assets/{name}", get(asset))
        .with_state(api.clone())
        .merge(answers(api, files))
        .layer(Extension(Role::Teacher))
}

/// The same over TLS, for whoever has a cookie.
pub fn shared_router(api: LabApi, files: Router, credentials: Arc<Credentials>) -> Router {
    Router::new()
        .route("/lab", get(|| async { Redirect::to("/lab/") }))
        .route("/lab/", get(page))
        .route("/lab/assets/{name}", get(asset))
        .with_state(api.clone())
        .merge(answers(api, files))
        .route_layer(from_fn_with_state(credentials, roles::authenticate))
}

/// What a page asks for. What is not given to students by name is the teacher's alone.
fn answers(api: LabApi, files: Router) -> Router {
    let of_students = Router::new()
        .route("/api/experiments/{id}/{file}", get(experiment_file))
        .route(
            "/api/devices/{id}/magnetometer.toml",
            get(magnetometer_file),
        )
        .route("/api/ws", get(socket))
        .with_state(api.clone())
        .merge(api.hand_ins.clone().for_students())
        .merge(mine::router(api.clone()));
    for_teachers(api, files)
        .route_layer(from_fn(roles::for_teachers))
        .merge(of_students)
}

fn for_teachers(api: LabApi, files: Router) -> Router {
    Router::new()
        .route("/api/status", get(status))
        .route("/api/qr.svg", get(qr_svg))
        .route("/api/session.zip", get(session_export::download))
        .with_state(api.clone())
        .merge(api.hand_ins.for_teachers())
        .merge(files)
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

fn not_permitted(text: &str) -> (StatusCode, String) {
    (StatusCode::FORBIDDEN, text.to_owned())
}

async fn experiment_file(
    State(api): State<LabApi>,
    Extension(role): Extension<Role>,
    Path((id, name)): Path<(String, String)>,
) -> Answer {
    permissions::of_experiment(&role, &api.lab, &id).map_err(not_permitted)?;
    let (lab, of, file) = (api.lab.clone(), id.clone(), name.clone());
    let finished = tokio::task::spawn_blocking(move || lab.experiment(&of)).await;
    let finished = finished.map_err(|_| failed(&""))?.map_err(not_found)?;
    if name == RESULT {
        // As the page would have got it when the experiment ended.
        let headers = [(header::CONTENT_TYPE, "application/json")];
        return Ok((headers, finished.message().json()).into_response());
    }
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
async fn magnetometer_file(
    State(api): State<LabApi>,
    Extension(role): Extension<Role>,
    Path(id): Path<String>,
) -> Answer {
    permissions::of_device(&role, &id).map_err(not_permitted)?;
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

async fn socket(
    State(api): State<LabApi>,
    Extension(role): Extension<Role>,
    upgrade: WebSocketUpgrade,
) -> Response {
    upgrade
        .max_message_size(LONGEST_MESSAGE)
        .on_upgrade(move |socket| async move { page::serve(api, role, socket).await })
}

/// What every page is told first, and again when the addresses have changed. A student is told no address that lets a phone
/// in, and no input.
pub(crate) fn hello(facts: &Facts, role: &Role) -> ToPage {
    let is_teacher = *role == Role::Teacher;
    let or_none = |urls: Vec<String>| if is_teacher { urls } else { Vec::new() };
    let phone_urls = or_none(facts.reach.phone_urls());
    let host = phone_urls.first().and_then(|url| url.split('/').nth(2));
    ToPage::Hello(Box::new(Hello {
        version: env!("CARGO_PKG_VERSION"),
        // Another address is another picture.
        qr_svg: format!("/api/qr.svg?url=0&for={}", host.unwrap_or_default()),
        phone_urls,
        named_url: facts.reach.named_url().filter(|_| is_teacher),
        ingest_urls: or_none(facts.reach.ingest_urls()),
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
        role: role.name(),
        input_kinds: InputKind::ALL
            .map(|kind| InputKindLine {
                kind,
                title: kind.title(),
                hint: kind.hint(),
                example: kind.example(),
            })
            .into_iter()
            .filter(|_| is_teacher)
            .collect(),
        inputs: match is_teacher {
            true => facts.inputs.statuses(),
            false => Vec::new(),
        },
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
