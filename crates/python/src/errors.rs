//! What is refused, as Python's exceptions, in the words of the module where the program speaks of its options.

use std::error::Error;
use std::io::ErrorKind;

use northing_evaluation::EvaluationError;
use northing_recording::RecordingError;
use pyo3::exceptions::{PyFileExistsError, PyFileNotFoundError, PyOSError, PyValueError};
use pyo3::{PyErr, pyfunction};

/// Options of the program that stand alone.
const SWITCHES: [&str; 4] = ["force", "smooth", "align-reference", "ignore-reference"];

/// A sentence of the program with its options as arguments of the module: `--gyroscope-unit deg-per-s` becomes
/// `gyroscope_unit="deg-per-s"`.
#[pyfunction]
pub(crate) fn in_words_of_the_module(sentence: &str) -> String {
    let mut said = String::new();
    let mut rest = sentence;
    while let Some(start) = rest.find("--") {
        said.push_str(&rest[..start]);
        let after = &rest[start + 2..];
        let is_of_name = |c: char| c.is_ascii_lowercase() || c == '-';
        let end = after.find(|c| !is_of_name(c)).unwrap_or(after.len());
        let (name, tail) = after.split_at(end);
        rest = tail;
        if name.is_empty() {
            said.push_str("--");
            continue;
        }
        said.push_str(&name.replace('-', "_"));
        if SWITCHES.contains(&name) {
            said.push_str("=True");
            continue;
        }
        let Some(value) = tail.strip_prefix(' ') else {
            continue;
        };
        let is_of_value = |c: char| c.is_ascii_alphanumeric() || "-_=:.,".contains(c);
        let end = value.find(|c| !is_of_value(c)).unwrap_or(value.len());
        let word = value[..end].trim_end_matches(['.', ':', ',']);
        said.push_str(&format!("=\"{word}\""));
        rest = &value[word.len()..];
    }
    said.push_str(rest);
    said
}

/// A refusal as `ValueError`.
pub(crate) fn refused(sentence: impl AsRef<str>) -> PyErr {
    PyValueError::new_err(in_words_of_the_module(sentence.as_ref()))
}

/// What a reader or writer says.
pub(crate) fn of_recording(error: &RecordingError) -> PyErr {
    let said = in_words_of_the_module(&error.to_string());
    match error {
        RecordingError::Io { source, .. } if source.kind() == ErrorKind::NotFound => {
            PyFileNotFoundError::new_err(said)
        }
        RecordingError::Io { .. } => PyOSError::new_err(said),
        RecordingError::Exists { .. } => PyFileExistsError::new_err(said),
        _ => PyValueError::new_err(said),
    }
}

/// What a run says; `name` stands for the recording.
pub(crate) fn of_run(error: &EvaluationError, name: &str) -> PyErr {
    match error {
        // Its message begins with the name already.
        EvaluationError::Recording(source) => {
            let source: &(dyn Error + 'static) = source.as_ref();
            match source.downcast_ref::<RecordingError>() {
                Some(error) => of_recording(error),
                None => refused(error.to_string()),
            }
        }
        error => refused(format!("{name}: {error}")),
    }
}

/// What a writer of files says.
pub(crate) fn of_file(error: impl Into<anyhow::Error>) -> PyErr {
    let error = error.into();
    let mut causes = error.chain();
    match causes.find_map(|cause| cause.downcast_ref::<RecordingError>()) {
        Some(error) => of_recording(error),
        None => refused(error.to_string()),
    }
}
