//! Files of an experiment: the recording as CSV and Parquet, the estimates as TUM, the report.

use nalgebra::Vector3;
use northing_evaluation::{EstimateRecord, EstimatorKind, RunObserver, TraceObserver};
use northing_recording::{Metadata, RecordingError, TumWriter, create};

use crate::experiments::{Finished, TRACE_POINTS, run_over};
use crate::report;

/// A file to download.
#[derive(Debug)]
pub struct Export {
    /// What is in it.
    pub bytes: Vec<u8>,
    /// Its content type.
    pub content_type: &'static str,
}

/// Makes the file of this name; `None` when there is none of this name.
///
/// # Errors
/// It cannot be made, in a sentence.
pub fn export(finished: &Finished, file: &str) -> Result<Option<Export>, String> {
    let (bytes, content_type) = match file {
        "report.html" => (
            report_page(finished)?.into_bytes(),
            "text/html; charset=utf-8",
        ),
        "recording.csv" => (recording(finished, file)?, "text/csv; charset=utf-8"),
        "recording.parquet" => (recording(finished, file)?, "application/vnd.apache.parquet"),
        "estimates.tum" => (estimates(finished)?, "text/plain; charset=utf-8"),
        _ => return Ok(None),
    };
    Ok(Some(Export {
        bytes,
        content_type,
    }))
}

fn drawn(finished: &Finished) -> Result<EstimatorKind, String> {
    let has_mekf = finished.estimators.contains(&EstimatorKind::Mekf);
    let chosen = if has_mekf {
        Some(EstimatorKind::Mekf)
    } else {
        finished.estimators.first().copied()
    };
    chosen.ok_or_else(|| "no estimator ran".to_owned())
}

fn report_page(finished: &Finished) -> Result<String, String> {
    let mut trace = TraceObserver::new(TRACE_POINTS, finished.options.world_frame);
    let kind = drawn(finished)?;
    let summary = run_over(&finished.experiment, &finished.options, kind, &mut trace)
        .map_err(|e| e.to_string())?;
    Ok(report::render(finished, &summary, trace.trace()))
}

/// Writes a file in a folder of its own and hands out its content.
fn written(
    file: &str,
    write: impl FnOnce(&std::path::Path) -> Result<(), RecordingError>,
) -> Result<Vec<u8>, String> {
    let folder = tempfile::tempdir().map_err(|error| format!("a temporary folder: {error}"))?;
    let path = folder.path().join(file);
    write(&path).map_err(|error| error.to_string())?;
    std::fs::read(&path).map_err(|error| format!("{file}: {error}"))
}

fn recording(finished: &Finished, file: &str) -> Result<Vec<u8>, String> {
    let experiment = &finished.experiment;
    let metadata = Metadata {
        name: finished.title().to_owned(),
        format: "live".to_owned(),
        world_frame: finished.options.world_frame,
        device: Some(finished.device_name.clone()),
        extra: [("sha256".to_owned(), finished.hash.clone())].into(),
    };
    written(file, |path| {
        let mut writer = create(path, &metadata, &experiment.sensors(), false)?;
        for event in &experiment.events {
            writer.write(event)?;
        }
        writer.finish()
    })
}

fn estimates(finished: &Finished) -> Result<Vec<u8>, String> {
    let kind = drawn(finished)?;
    let mut poses = Poses::default();
    run_over(&finished.experiment, &finished.options, kind, &mut poses)
        .map_err(|e| e.to_string())?;
    written("estimates.tum", |path| {
        let mut writer = TumWriter::create(path, false)?;
        for record in &poses.0 {
            writer.write(record.time_ns, &Vector3::zeros(), &record.attitude)?;
        }
        writer.finish()
    })
}

#[derive(Default)]
struct Poses(Vec<EstimateRecord>);

impl RunObserver for Poses {
    fn estimate(&mut self, record: &EstimateRecord) {
        self.0.push(*record);
    }
}
