//! Exercises of the course on the lab page: the cards, handing in, the file of a hand-in, and the table of the class.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Extension, Path, Query, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use northing_evaluation::exercises::words::Language;
use northing_evaluation::exercises::{Card, Class, Judgement, Question};
use serde::{Deserialize, Serialize};
use tokio::sync::Semaphore;

use crate::assets::attachment;
use crate::experiments::utc;
use crate::hand_ins::{HandInRequest, HandIns, Taken};
use crate::lab::{Lab, lock};
use crate::permissions;
use crate::roles::{Role, refused};

/// Longest request, bytes.
const LONGEST: usize = 16 * 1024;
/// Hand-ins that are judged at once: a check runs an estimator several times, and phones go on sending.
const AT_ONCE: usize = 2;

/// What the handlers share.
#[derive(Debug, Clone)]
pub(crate) struct HandInApi {
    lab: Arc<Lab>,
    hand_ins: Arc<HandIns>,
    /// Devices of which a hand-in is being judged.
    busy: Arc<Mutex<BTreeSet<String>>>,
    places: Arc<Semaphore>,
}

/// A card as a page needs it; its texts are in the catalogue.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct CardLine {
    /// Its name.
    pub(crate) card: Card,
    /// The minutes to plan for it.
    pub(crate) minutes: u32,
    /// What is to be answered.
    pub(crate) questions: &'static [Question],
}

/// What became of a hand-in.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct HandedIn {
    /// Where its file is.
    pub(crate) url: String,
    /// The name of its file.
    pub(crate) file: String,
    /// Whether it passes, and why.
    pub(crate) judgement: Judgement,
    /// Whether the lab keeps the file.
    pub(crate) kept: bool,
    /// Why it does not.
    pub(crate) problem: Option<String>,
}

/// The hand-ins of a lab, for the teacher.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct ClassTable {
    /// The cards that somebody handed in.
    pub(crate) cards: Vec<Card>,
    /// In the order of their names.
    pub(crate) students: Vec<StudentLine>,
    /// Every hand-in, in the same order.
    pub(crate) hand_ins: Vec<HandInLine>,
    /// Names under which one and the same recording was handed in.
    pub(crate) shared: Vec<Vec<String>>,
    /// Files that cannot be judged, with the reason.
    pub(crate) not_judged: Vec<(String, String)>,
}

/// A student.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct StudentLine {
    /// The name.
    pub(crate) student: String,
    /// Whether one of the hand-ins of a card passes.
    pub(crate) passed: BTreeMap<Card, bool>,
}

/// A hand-in.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(ts_rs::TS))]
pub(crate) struct HandInLine {
    /// The name of its file.
    pub(crate) file: String,
    /// Who handed it in.
    pub(crate) student: String,
    /// The exercise.
    pub(crate) card: Card,
    /// When, UTC.
    pub(crate) at: String,
    /// Whether it passes, and why.
    pub(crate) judgement: Judgement,
}

impl From<&Class> for ClassTable {
    fn from(class: &Class) -> Self {
        let students = class.students().into_iter();
        let hand_ins = class.hand_ins.iter();
        Self {
            cards: class.cards(),
            students: students
                .map(|(student, passed)| StudentLine {
                    student: student.to_owned(),
                    passed,
                })
                .collect(),
            hand_ins: hand_ins
                .map(|one| HandInLine {
                    file: one.file.clone(),
                    student: one.student().to_owned(),
                    card: one.judged.card,
                    at: one.judged.at.clone(),
                    judgement: one.judged.judgement.clone(),
                })
                .collect(),
            shared: class.shared(),
            not_judged: class.not_judged.clone(),
        }
    }
}

impl HandInApi {
    pub(crate) fn new(lab: Arc<Lab>, hand_ins: HandIns) -> Self {
        Self {
            lab,
            hand_ins: Arc::new(hand_ins),
            busy: Arc::default(),
            places: Arc::new(Semaphore::new(AT_ONCE)),
        }
    }

    /// The cards, handing in, and the files of one's own.
    pub(crate) fn for_students(self) -> Router {
        Router::new()
            .route("/api/exercises", get(cards))
            .route("/api/experiments/{id}/hand-in", post(take))
            .route("/api/experiments/{id}/hand-ins/{file}", get(file))
            .layer(DefaultBodyLimit::max(LONGEST))
            .with_state(self)
    }

    /// The table of the class.
    pub(crate) fn for_teachers(self) -> Router {
        Router::new()
            .route("/api/class", get(class))
            .route("/api/class.csv", get(class_csv))
            .with_state(self)
    }

    /// A place for one hand-in of a device; `None` while another of it is judged.
    fn begin(&self, device: String) -> Option<Place> {
        let is_free = lock(&self.busy).insert(device.clone());
        is_free.then(|| Place {
            device,
            busy: self.busy.clone(),
        })
    }
}

/// Given back when it is dropped.
struct Place {
    device: String,
    busy: Arc<Mutex<BTreeSet<String>>>,
}

impl Drop for Place {
    fn drop(&mut self) {
        lock(&self.busy).remove(&self.device);
    }
}

async fn cards() -> Json<Vec<CardLine>> {
    let line = |card: Card| CardLine {
        card,
        minutes: card.minutes(),
        questions: card.questions(),
    };
    Json(Card::ALL.map(line).into())
}

/// What went wrong on this side.
fn failed(error: &impl ToString) -> Response {
    refused(StatusCode::INTERNAL_SERVER_ERROR, &error.to_string())
}

async fn take(
    State(api): State<HandInApi>,
    Extension(role): Extension<Role>,
    Path(id): Path<String>,
    body: Bytes,
) -> Response {
    if let Err(text) = permissions::of_experiment(&role, &api.lab, &id) {
        return refused(StatusCode::FORBIDDEN, text);
    }
    let request: HandInRequest = match serde_json::from_slice(&body) {
        Ok(request) => request,
        Err(error) => {
            let text = format!("the page sent what the program does not know: {error}");
            return refused(StatusCode::BAD_REQUEST, &text);
        }
    };
    let Some(device) = api.lab.experiments.device_of(&id) else {
        let text = format!("there is no experiment `{id}`");
        return refused(StatusCode::NOT_FOUND, &text);
    };
    let Some(place) = api.begin(device) else {
        let text = "another hand-in of this device is being judged; try again when it is done";
        return refused(StatusCode::TOO_MANY_REQUESTS, text);
    };
    let Ok(turn) = api.places.clone().acquire_owned().await else {
        return failed(&"the lab ends");
    };
    let of = id.clone();
    let work = move || -> Result<Taken, String> {
        let _until_done = (place, turn);
        let finished = api.lab.experiment(&of)?;
        let hand_in = finished.hand_in(&request, utc(api.lab.now_ns()))?;
        api.hand_ins.take(&finished, &hand_in)
    };
    match tokio::task::spawn_blocking(work).await {
        Ok(Ok(taken)) => Json(HandedIn {
            url: format!("/api/experiments/{id}/hand-ins/{}", taken.file),
            file: taken.file,
            judgement: taken.judged.judgement,
            kept: taken.not_kept.is_none(),
            problem: taken.not_kept,
        })
        .into_response(),
        Ok(Err(text)) => refused(StatusCode::UNPROCESSABLE_ENTITY, &text),
        Err(error) => failed(&error),
    }
}

async fn file(
    State(api): State<HandInApi>,
    Extension(role): Extension<Role>,
    Path((id, name)): Path<(String, String)>,
) -> Response {
    if let Err(text) = permissions::of_experiment(&role, &api.lab, &id) {
        return refused(StatusCode::FORBIDDEN, text);
    }
    let called = name.clone();
    let read = move || -> Result<Option<Vec<u8>>, String> {
        let finished = api.lab.experiment(&id)?;
        Ok(api.hand_ins.file(&finished, &called))
    };
    match tokio::task::spawn_blocking(read).await {
        Ok(Ok(Some(bytes))) => (attachment("application/zip", &name), bytes).into_response(),
        Ok(Ok(None)) => refused(StatusCode::NOT_FOUND, "there is no such hand-in"),
        Ok(Err(text)) => refused(StatusCode::NOT_FOUND, &text),
        Err(error) => failed(&error),
    }
}

/// An answer, or the reason why there is none.
type Answer<T> = Result<T, (StatusCode, String)>;

fn problem(error: &impl ToString) -> (StatusCode, String) {
    (StatusCode::INTERNAL_SERVER_ERROR, error.to_string())
}

async fn judged(api: HandInApi) -> Answer<Class> {
    let class = tokio::task::spawn_blocking(move || api.hand_ins.class()).await;
    class.map_err(|error| problem(&error))
}

async fn class(State(api): State<HandInApi>) -> Answer<Response> {
    let table = ClassTable::from(&judged(api).await?);
    Ok(([(header::CACHE_CONTROL, "no-store")], Json(table)).into_response())
}

/// In which language the reasons are.
#[derive(Debug, Deserialize)]
struct Spoken {
    #[serde(default)]
    language: String,
}

async fn class_csv(State(api): State<HandInApi>, Query(spoken): Query<Spoken>) -> Answer<Response> {
    let language = Language::named(&spoken.language).unwrap_or_default();
    let table = judged(api).await?.csv(language);
    let table = table.map_err(|error| problem(&error))?;
    let headers = attachment("text/csv; charset=utf-8", "class.csv");
    Ok((headers, table).into_response())
}
