//! The recordings for the lab page: their list, and each as a file.

use std::path::PathBuf;
use std::sync::Arc;

use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use axum::{Json, Router};
use tokio_util::io::ReaderStream;

use crate::assets::attachment;
use crate::recorder::{Listed, list, path_of};

/// The folder, if there is one.
type Folder = Arc<Option<PathBuf>>;

/// `/api/recordings` and `/api/recordings/NAME`.
pub(crate) fn router(folder: Option<PathBuf>) -> Router {
    Router::new()
        .route("/api/recordings", get(all))
        .route("/api/recordings/{name}", get(one))
        .with_state(Arc::new(folder))
}

async fn all(State(folder): State<Folder>) -> Json<Vec<Listed>> {
    let found = tokio::task::spawn_blocking(move || folder.as_deref().map(list));
    Json(found.await.ok().flatten().unwrap_or_default())
}

async fn one(State(folder): State<Folder>, Path(name): Path<String>) -> Response {
    let path = folder.as_deref().and_then(|folder| path_of(folder, &name));
    let Some(path) = path else {
        return (StatusCode::NOT_FOUND, "there is no such recording").into_response();
    };
    match tokio::fs::File::open(path).await {
        Ok(file) => {
            let headers = attachment("application/octet-stream", &name);
            (headers, Body::from_stream(ReaderStream::new(file))).into_response()
        }
        Err(error) => (StatusCode::INTERNAL_SERVER_ERROR, error.to_string()).into_response(),
    }
}
