//! What a student's phone page reads and asks by plain requests: Safari refuses WebSockets on a self-made certificate.

use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Extension, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use northing_evaluation::EstimatorKind;
use northing_evaluation::attitude::final_test::FinalVerdict;
use northing_evaluation::statistics::lamp::{Lamp, Remark, Tone};
use northing_recording::SensorKind;
use serde::Serialize;
use serde_json::{Value, json};

use crate::lab::{Lab, lock};
use crate::lab_api::LabApi;
use crate::messages::{Request, UnderWay};
use crate::page::carry_out;
use crate::permissions;
use crate::roles::{Role, RoleName, refused};
use crate::session::waiting::nothing_received;
use crate::to_page::{ExperimentRow, RestNumbers};

/// Longest request, bytes.
const LONGEST: usize = 16 * 1024;

/// What a device keeps for the page of its own phone, beside its status.
#[derive(Debug, Clone, Default)]
pub(crate) struct ForOwner {
    /// The lamps of the last half second.
    pub(crate) lamps: Vec<Lamp>,
    /// What became of the last calibration at rest.
    pub(crate) calibration: Option<Remark>,
    /// Why what was under way was given up.
    pub(crate) gave_up: Option<String>,
    /// The profile that its parameters started from.
    pub(crate) profile: &'static str,
}

/// What a phone page shows.
#[derive(Debug, Serialize)]
struct Mine {
    device: String,
    name: String,
    delivers: bool,
    silence: String,
    subject: Option<EstimatorKind>,
    /// Yaw, pitch, roll of the subject, deg.
    angles_deg: Option<[f64; 3]>,
    std_deg: Option<[f64; 3]>,
    lamps: Vec<LampLine>,
    under_way: Option<UnderWay>,
    calibration: Option<Remark>,
    gave_up: Option<String>,
    rest: Option<RestNumbers>,
    profile: &'static str,
    /// How many experiments of this device there are.
    experiments: usize,
    result: Option<MyResult>,
}

/// A lamp in numbers.
#[derive(Debug, Serialize)]
struct LampLine {
    sensor: SensorKind,
    tone: Tone,
    nis_mean: Option<f64>,
    nis_expected: Option<u8>,
}

/// The newest experiment of the device.
#[derive(Debug, Serialize)]
struct MyResult {
    id: String,
    name: String,
    duration_s: f64,
    /// How long it was meant to be, s.
    asked_s: f64,
    subject: String,
    calculated_error_deg: Option<f64>,
    estimated_error_deg: Option<f64>,
    /// With two the tilt alone is judged.
    degrees_of_freedom: Option<u8>,
    calculated_tilt_deg: Option<f64>,
    estimated_tilt_deg: Option<f64>,
    verdict: Option<FinalVerdict>,
    /// The calculated errors of integration and of the device's own orientation.
    integration_deg: Option<f64>,
    device_deg: Option<f64>,
    /// Their parts about horizontal axes.
    integration_tilt_deg: Option<f64>,
    device_tilt_deg: Option<f64>,
    has_samples: bool,
}

/// `/api/role`, `/api/mine` and `/api/ask`.
pub(crate) fn router(api: LabApi) -> Router {
    Router::new()
        .route("/api/role", get(role))
        .route("/api/mine", get(mine))
        .route("/api/ask", post(ask))
        .layer(DefaultBodyLimit::max(LONGEST))
        .with_state(api)
}

/// Who asks, for a page that wants to know whether it may stay.
async fn role(Extension(role): Extension<Role>) -> Json<Value> {
    let name: RoleName = role.name();
    Json(json!({"role": name, "device": role.device()}))
}

async fn mine(State(api): State<LabApi>, Extension(role): Extension<Role>) -> Response {
    let Some(id) = role.device() else {
        let text = "this is for students: the teacher's page shows every phone";
        return refused(StatusCode::NOT_FOUND, text);
    };
    match Mine::of(&api.lab, id) {
        Ok(mine) => ([(header::CACHE_CONTROL, "no-store")], Json(mine)).into_response(),
        Err(text) => refused(StatusCode::NOT_FOUND, &text),
    }
}

impl Mine {
    fn of(lab: &Arc<Lab>, id: &str) -> Result<Self, String> {
        let device = lab.find(id)?;
        let status = lock(&device.status).clone();
        let own = lock(&device.for_owner).clone();
        let subject = status.session.subject;
        let estimate = subject.and_then(|kind| status.estimates.get(kind.name()));
        let lamp = |lamp: &Lamp| LampLine {
            sensor: lamp.sensor,
            // What is old says nothing of now.
            tone: if status.delivers {
                lamp.tone
            } else {
                Tone::Idle
            },
            nis_mean: lamp.nis_mean,
            nis_expected: lamp.nis_expected,
        };
        Ok(Self {
            delivers: status.delivers,
            silence: status.silence.clone(),
            subject,
            angles_deg: estimate.map(|estimate| estimate.angles_deg),
            std_deg: estimate.and_then(|estimate| estimate.std_deg),
            lamps: own.lamps.iter().map(lamp).collect(),
            under_way: status.under_way,
            calibration: own.calibration,
            gave_up: own.gave_up,
            rest: status.rest,
            profile: own.profile,
            experiments: lab.experiments.count_of(id),
            result: lab.experiments.newest_of(id).map(MyResult::of),
            device: status.id,
            name: status.name,
        })
    }
}

impl MyResult {
    fn of(row: ExperimentRow) -> Self {
        let of = |name: &str| row.results.get(name).copied();
        let calculated = |name: &str| of(name)?.calculated_error_deg;
        let tilt = |name: &str| of(name)?.calculated_tilt_deg;
        let own = of(&row.subject);
        Self {
            calculated_error_deg: calculated(&row.subject),
            estimated_error_deg: own.and_then(|cell| cell.estimated_error_deg),
            degrees_of_freedom: own.and_then(|cell| cell.degrees_of_freedom),
            calculated_tilt_deg: tilt(&row.subject),
            estimated_tilt_deg: own.and_then(|cell| cell.estimated_tilt_deg),
            verdict: own.and_then(|cell| cell.verdict),
            integration_deg: calculated("integration"),
            device_deg: calculated("device"),
            integration_tilt_deg: tilt("integration"),
            device_tilt_deg: tilt("device"),
            id: row.id,
            name: row.name,
            duration_s: row.duration_s,
            asked_s: row.asked_s,
            subject: row.subject,
            has_samples: row.has_samples,
        }
    }
}

/// A request as over the WebSocket; a student need not say its device.
async fn ask(State(api): State<LabApi>, Extension(role): Extension<Role>, body: Bytes) -> Response {
    let mut asked: Value = serde_json::from_slice(&body).unwrap_or_default();
    if let (Some(object), Some(own)) = (asked.as_object_mut(), role.device()) {
        object.entry("device").or_insert_with(|| own.into());
    }
    let request: Request = match serde_json::from_value(asked) {
        Ok(request) => request,
        Err(error) => {
            let text = format!("the page sent what the program does not know: {error}");
            return refused(StatusCode::BAD_REQUEST, &text);
        }
    };
    if let Err(text) = permissions::check(&role, &api.lab, &request) {
        return refused(StatusCode::FORBIDDEN, text);
    }
    if request.needs_socket() {
        let text = "this is asked over the WebSocket of the lab page";
        return refused(StatusCode::BAD_REQUEST, text);
    }
    if let Some(why) = role
        .device()
        .and_then(|own| not_yet(&api.lab, own, &request))
    {
        return refused(StatusCode::SERVICE_UNAVAILABLE, &why);
    }
    match carry_out(&api.lab, request).await {
        Ok(()) => Json(json!({})).into_response(),
        Err(text) => refused(StatusCode::CONFLICT, &text),
    }
}

/// Why a request of a phone cannot be carried out before its next samples: the page asks again. After a start the lab
/// knows keys, but a device only from its next batch on; so it is with one that was taken away.
fn not_yet(lab: &Arc<Lab>, own: &str, request: &Request) -> Option<String> {
    let Ok(device) = lab.find(own) else {
        let text = "the lab does not hear this phone now: it is there again with its next samples";
        return Some(text.into());
    };
    let status = lock(&device.status);
    if !request.needs_samples()
        || status
            .session
            .rates_hz
            .contains_key(SensorKind::Gyroscope.name())
    {
        return None;
    }
    Some(nothing_received())
}
