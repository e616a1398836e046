//! Several attitude estimators over several recordings, on all processors.

use std::path::PathBuf;

use northing_evaluation::EvaluationError;
use northing_evaluation::attitude::compare::{self as over_recordings, CompareOptions};
use northing_evaluation::attitude::{Calibrations, EstimatorKind};
use pyo3::prelude::*;
use serde_json::json;

use crate::attitude::{Asked, Reading, word};
use crate::errors::{of_run, refused};

/// Runs every estimator (without names: all of them) over every recording; the summaries as JSON, in order.
///
/// # Errors
/// The first recording that could not be run; an estimator that somebody brought along fails alone.
#[pyfunction]
pub(crate) fn compare(
    py: Python<'_>,
    paths: Vec<PathBuf>,
    estimators: Vec<String>,
    asked: Asked,
    reading: Reading,
) -> PyResult<Vec<String>> {
    let open = reading.options()?;
    let mut named = Vec::new();
    for name in estimators {
        named.extend(word::<EstimatorKind>(Some(name), "estimators")?);
    }
    if named.is_empty() {
        named = EstimatorKind::ALL.to_vec();
    }
    let options = CompareOptions {
        estimators: named,
        // As the program: the settings of all are those of one with every setting.
        run: asked.options(Some(EstimatorKind::Mekf), &open)?,
        calibrations: Calibrations::default(),
        align_reference: false,
        open,
    };
    let compared = py.detach(|| over_recordings::compare(&paths, &options, &|| ()));
    let summary = |one: over_recordings::Compared| {
        let path = one.path.display().to_string();
        if let Err(error @ EvaluationError::OwnEstimator { .. }) = &one.outcome {
            let failed = json!({
                "recording": path, "estimator": one.estimator.name(), "failure": error.to_string(),
            });
            return Ok(failed.to_string());
        }
        let mut summary = one.outcome.map_err(|error| of_run(&error, &path))?;
        summary.recording = path;
        serde_json::to_string(&summary).map_err(|error| refused(error.to_string()))
    };
    compared.into_iter().map(summary).collect()
}
