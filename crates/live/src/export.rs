//! Files of an experiment: the recording as CSV, Parquet and MCAP, the estimates as TUM, the report.

use std::io::Cursor;

use nalgebra::Vector3;
use northing_evaluation::{EstimateRecord, RunObserver, TraceObserver};
use northing_recording::mcap::RosWriter;
use northing_recording::{Metadata, RecordingError, SensorKind, TumWriter, create};

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
        "recording.mcap" => (messages(finished, file)?, "application/octet-stream"),
        "estimates.tum" => (estimates(finished)?, "text/plain; charset=utf-8"),
        _ => return Ok(None),
    };
    Ok(Some(Export {
        bytes,
        content_type,
    }))
}

fn report_page(finished: &Finished) -> Result<String, String> {
    let mut trace = TraceObserver::new(TRACE_POINTS, finished.options.world_frame);
    let (experiment, options) = (&finished.experiment, &finished.options);
    let summary =
        run_over(experiment, options, finished.subject, &mut trace).map_err(|e| e.to_string())?;
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
    let metadata = metadata(finished);
    written(file, |path| {
        let mut writer = create(path, &metadata, &experiment.sensors(), false)?;
        for event in &experiment.events {
            writer.write(event)?;
        }
        writer.finish()
    })
}

fn metadata(finished: &Finished) -> Metadata {
    Metadata {
        name: finished.title().to_owned(),
        format: "live".to_owned(),
        world_frame: finished.options.world_frame,
        device: Some(finished.device_name.clone()),
        extra: [("sha256".to_owned(), finished.hash.clone())].into(),
        ..Metadata::default()
    }
}

/// Messages of ROS 2: what was measured, and beside it what was estimated.
fn messages(finished: &Finished, file: &str) -> Result<Vec<u8>, String> {
    let text = |error: RecordingError| error.to_string();
    let poses = poses(finished)?;
    let mut poses = poses.0.iter().peekable();
    let memory = Cursor::new(Vec::new());
    let mut writer = RosWriter::new(memory, &metadata(finished), file).map_err(text)?;
    let instants = finished
        .experiment
        .events
        .chunk_by(|a, b| a.time_ns == b.time_ns);
    for instant in instants {
        for event in instant {
            writer.add(event).map_err(text)?;
        }
        let of = |kind: SensorKind| {
            let samples = instant.iter().map(|event| &event.sample);
            samples.clone().find(|sample| sample.kind() == kind)
        };
        let measured = [of(SensorKind::Gyroscope), of(SensorKind::Accelerometer)];
        while let Some(pose) = poses.next_if(|pose| pose.time_ns <= instant[0].time_ns) {
            let covariance = pose.attitude_covariance.as_ref();
            writer
                .estimate(pose.time_ns, &pose.attitude, covariance, measured)
                .map_err(text)?;
        }
    }
    Ok(writer.complete().map_err(text)?.into_inner())
}

/// The estimates of the subject.
fn poses(finished: &Finished) -> Result<Poses, String> {
    let mut poses = Poses::default();
    let (experiment, options) = (&finished.experiment, &finished.options);
    run_over(experiment, options, finished.subject, &mut poses).map_err(|e| e.to_string())?;
    Ok(poses)
}

fn estimates(finished: &Finished) -> Result<Vec<u8>, String> {
    let poses = poses(finished)?;
    written("estimates.tum", |path| {
        let world = finished.options.world_frame;
        let mut writer = TumWriter::create(path, world, false)?;
        for record in &poses.0 {
            let position = record.position.unwrap_or_else(Vector3::zeros);
            writer.write(record.time_ns, &position, &record.attitude)?;
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
