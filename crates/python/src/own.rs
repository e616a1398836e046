//! Estimators that somebody brings along: classes of this interpreter, or of a file in a process of its own.

use std::path::PathBuf;

use northing_core::attitude::StartUncertainty;
use northing_evaluation::attitude::own::{self, Answer, Channel, OwnEstimator, Remote, Request};
use northing_evaluation::attitude::{EstimatorKind, Parameters};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::errors::refused;

/// An estimator in this interpreter, behind an object that answers requests.
#[derive(Debug)]
struct Here(Result<Py<PyAny>, String>);

impl Channel for Here {
    fn ask(&mut self, request: &Request) -> Result<Answer, String> {
        let served = self.0.as_ref().map_err(Clone::clone)?;
        Python::attach(|py| {
            let request = PyBytes::new(py, &request.bytes());
            let answer = served.call_method1(py, "answer", (request,));
            let answer = answer.and_then(|answer| answer.extract::<Vec<u8>>(py));
            Answer::parse(&answer.map_err(|error| format!("raises {error}"))?)
        })
    }
}

/// Gives a class a name; `make` makes an object with a method `answer(bytes) -> bytes` for each run.
#[pyfunction]
pub(crate) fn register_class(name: &str, make: Py<PyAny>) -> PyResult<()> {
    if EstimatorKind::ALL.iter().any(|kind| kind.name() == name) {
        return Err(refused(format!(
            "an estimator of the project is called `{name}`; give yours another name"
        )));
    }
    let called = name.to_owned();
    own::register(
        name,
        "a class of Python",
        move |parameters: &Parameters, _| {
            let made = Python::attach(|py| {
                make.call0(py)
                    .map_err(|error| format!("cannot be made: {error}"))
            });
            let uncertainty = StartUncertainty::of(&parameters.attitude);
            let remote = Remote::new(Here(made), &called, uncertainty);
            Ok(Box::new(remote) as Box<dyn OwnEstimator>)
        },
    );
    Ok(())
}

/// Gives a class in a file, `mine.py:Mine`, its name; it runs by this interpreter.
#[pyfunction]
pub(crate) fn register_file(text: &str, python: PathBuf) -> PyResult<()> {
    own::register_python_with(text, python)
        .map(|_| ())
        .map_err(|error| refused(error.to_string()))
}
