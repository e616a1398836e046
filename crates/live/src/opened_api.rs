//! Opening recordings of elsewhere from the lab page: a file is sent, kept, listed, played and run; on the listener of this computer.

use std::path::PathBuf;
use std::sync::Arc;

use axum::body::Body;
use axum::extract::{Path, Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::routing::{get, post};
use axum::{Json, Router};
use futures_util::StreamExt as _;
use serde::Deserialize;
use tokio::io::AsyncWriteExt as _;

use crate::lab::Lab;
use crate::opened::{self, Contents, LARGEST, Made, OpenedFile};
use crate::recorder::{self, RecordingState};
use crate::to_page::ToPage;

/// A folder with files, and the lab in which they are played and run.
#[derive(Debug, Clone)]
struct Files {
    lab: Arc<Lab>,
    /// None where nothing is kept.
    folder: Option<Arc<PathBuf>>,
    /// Whether it is the lab that writes there.
    is_recorded: bool,
}

/// An answer, or the reason why there is none.
type Answer<T> = Result<T, (StatusCode, String)>;

/// `/api/opened`, and what can be done with each file there and with each recording of the lab.
pub(crate) fn router(lab: &Arc<Lab>, opened: Option<PathBuf>, recorded: Option<PathBuf>) -> Router {
    let files = |folder: Option<PathBuf>, is_recorded| Files {
        lab: lab.clone(),
        folder: folder.map(Arc::new),
        is_recorded,
    };
    let taken = Router::new()
        .route("/api/opened", get(all).post(take))
        .route("/api/opened/{name}", axum::routing::delete(delete))
        .route("/api/opened/{name}/play", post(play))
        .route("/api/opened/{name}/experiments", post(experiments))
        .with_state(files(opened, false));
    let recorded = Router::new()
        .route("/api/recordings/{name}/play", post(play))
        .route("/api/recordings/{name}/experiments", post(experiments))
        .with_state(files(recorded, true));
    taken.merge(recorded)
}

fn failed(error: &impl ToString) -> (StatusCode, String) {
    (StatusCode::INTERNAL_SERVER_ERROR, error.to_string())
}

fn refused(text: String) -> (StatusCode, String) {
    (StatusCode::UNPROCESSABLE_ENTITY, text)
}

/// Does work that waits for the disk.
async fn aside<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Answer<T> {
    let done = tokio::task::spawn_blocking(work).await;
    done.map_err(|error| failed(&error))
}

async fn all(State(api): State<Files>) -> Answer<Json<Vec<OpenedFile>>> {
    let list = move || api.folder.as_ref().map(|folder| opened::list(folder));
    Ok(Json(aside(list).await?.unwrap_or_default()))
}

/// What a file is called where it comes from.
#[derive(Debug, Deserialize)]
struct Called {
    name: String,
}

/// Takes a file piece by piece: it is never whole in memory.
async fn take(
    State(api): State<Files>,
    Query(called): Query<Called>,
    headers: HeaderMap,
    body: Body,
) -> Answer<Json<Contents>> {
    let Some(folder) = api.folder.clone() else {
        let text = "this lab keeps nothing: it was started with --no-recording";
        return Err((StatusCode::CONFLICT, text.to_owned()));
    };
    let name = opened::safe_name(&called.name).map_err(refused)?;
    let length = headers.get(header::CONTENT_LENGTH);
    let length: Option<u64> = length.and_then(|l| l.to_str().ok()?.parse().ok());
    if length.is_some_and(|length| length > LARGEST) {
        return Err(too_large(&name));
    }
    let (of, called) = (folder.clone(), name.clone());
    let begun = aside(move || opened::begin(&of, &called)).await?;
    let (aside_folder, file) = begun.map_err(|error| failed(&error))?;
    let mut file = tokio::fs::File::from_std(file);
    let (mut pieces, mut taken) = (body.into_data_stream(), 0_u64);
    while let Some(piece) = pieces.next().await {
        let piece = piece.map_err(|error| refused(format!("{name} broke off: {error}")))?;
        taken += piece.len() as u64;
        if taken > LARGEST {
            return Err(too_large(&name));
        }
        file.write_all(&piece)
            .await
            .map_err(|error| failed(&error))?;
    }
    file.sync_all().await.map_err(|error| failed(&error))?;
    let kept = aside(move || opened::keep(&folder, aside_folder, &name)).await?;
    kept.map(Json).map_err(refused)
}

fn too_large(name: &str) -> (StatusCode, String) {
    let text = format!(
        "{name} is larger than {} MiB, which the lab does not take; use `northing run`",
        LARGEST >> 20
    );
    (StatusCode::PAYLOAD_TOO_LARGE, text)
}

async fn delete(State(api): State<Files>, Path(name): Path<String>) -> Answer<StatusCode> {
    let path = api.path(&name).await?;
    let deleted = tokio::fs::remove_file(path).await;
    deleted.map_err(|error| failed(&error))?;
    Ok(StatusCode::NO_CONTENT)
}

async fn play(State(api): State<Files>, Path(name): Path<String>) -> Answer<StatusCode> {
    let path = api.path(&name).await?;
    let lab = api.lab.clone();
    tokio::spawn(async move {
        if let Err(text) = opened::play(&lab, &path).await {
            lab.tell(&ToPage::error(format!("{name}: {text}")));
        }
    });
    Ok(StatusCode::ACCEPTED)
}

async fn experiments(State(api): State<Files>, Path(name): Path<String>) -> Answer<Json<Made>> {
    let path = api.path(&name).await?;
    let lab = api.lab.clone();
    let made = aside(move || opened::experiments(&lab, &path, &name)).await?;
    made.map(Json).map_err(refused)
}

impl Files {
    /// The file of this name, once it is complete.
    async fn path(&self, name: &str) -> Answer<PathBuf> {
        let (of, called) = (self.clone(), name.to_owned());
        let found = aside(move || {
            let folder = of.folder.as_deref()?;
            match of.is_recorded {
                true => recorder::path_of(folder, &called),
                false => opened::path_of(folder, &called),
            }
        });
        let none = || {
            (
                StatusCode::NOT_FOUND,
                format!("there is no recording `{name}`"),
            )
        };
        let path = found.await?.ok_or_else(none)?;
        // The one that is being written grows while it is read.
        let status = self.lab.recording_status();
        let is_written = status.state == RecordingState::On && status.file.as_deref() == Some(name);
        if is_written && self.is_recorded {
            let text = format!("{name} is still being written: use it after the lab has ended");
            return Err((StatusCode::CONFLICT, text));
        }
        Ok(path)
    }
}
