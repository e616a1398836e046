//! A session as one file: a zip of the experiments of the table, each with facts and samples.
//!
//! `northing_recording::lab_session` says what is in it, and reads it.

use std::fs::File;
use std::io::{self, Seek as _, Write};

use axum::body::Body;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use northing_evaluation::used_parameters::PROGRAM;
use northing_recording::lab_session::{FORMAT, SAMPLES, SESSION};
use northing_recording::wire::events;
use serde_json::json;
use tokio_util::io::ReaderStream;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipWriter};

use crate::assets::attachment;
use crate::experiments::utc;
use crate::lab::Lab;
use crate::lab_api::LabApi;
use crate::persistence::{FACTS, SavedExperiment};
use crate::to_page::ExperimentRow;

/// The version that this program writes.
const VERSION: u32 = 1;

/// Writes the session of a lab, what is archived left out. Experiments whose samples cannot be had are named with the reason.
///
/// # Errors
/// The session cannot be written.
pub fn write(lab: &Lab, name: &str, output: impl Write + io::Seek) -> io::Result<()> {
    let mut zip = ZipWriter::new(output);
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .large_file(true);
    let (mut written, mut without_samples) = (Vec::new(), Vec::new());
    let shown = |row: &ExperimentRow| !row.is_archived;
    for row in lab.experiment_rows().into_iter().filter(shown) {
        let finished = match lab.experiment(&row.id) {
            Ok(finished) => finished,
            Err(reason) => {
                without_samples.push(json!({"experiment": row, "reason": reason}));
                continue;
            }
        };
        let folder = format!("experiments/{}", row.id);
        zip.start_file(format!("{folder}/{FACTS}"), options)?;
        serde_json::to_writer_pretty(&mut zip, &SavedExperiment::of(&finished))?;
        zip.start_file(format!("{folder}/{SAMPLES}"), options)?;
        zip.write_all(&events::encode(&finished.experiment.events))?;
        written.push(row);
    }
    zip.start_file(SESSION, options)?;
    let session = json!({
        "format": FORMAT, "version": VERSION, "program": PROGRAM, "lab": name,
        "at": utc(lab.now_ns()), "experiments": written, "without_samples": without_samples,
    });
    serde_json::to_writer_pretty(&mut zip, &session)?;
    zip.finish()?;
    Ok(())
}

/// `/api/session.zip`.
pub(crate) async fn download(State(api): State<LabApi>) -> Response {
    let made = tokio::task::spawn_blocking(move || -> io::Result<(File, u64)> {
        // Nobody else opens a file that has no name.
        let mut file = tempfile::tempfile()?;
        write(&api.lab, &api.facts.name, &mut file)?;
        file.rewind()?;
        let bytes = file.metadata()?.len();
        Ok((file, bytes))
    });
    let failed = |text: String| (StatusCode::INTERNAL_SERVER_ERROR, text).into_response();
    match made.await {
        Ok(Ok((file, bytes))) => {
            let headers = attachment("application/zip", "northing-session.zip");
            let length = [(header::CONTENT_LENGTH, bytes.to_string())];
            let file = tokio::fs::File::from_std(file);
            (headers, length, Body::from_stream(ReaderStream::new(file))).into_response()
        }
        Ok(Err(error)) => failed(format!("the session cannot be written: {error}")),
        Err(error) => failed(error.to_string()),
    }
}
