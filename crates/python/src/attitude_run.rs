//! What an attitude run gives: arrays of estimates and innovations, the summary, a report and files.

use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use northing_core::geometry::rotation;
use northing_core::kalman::Outcome;
use northing_evaluation::attitude::{
    EstimateFile, EstimateRecord, EstimatorKind, InnovationRecord, RunObserver,
};
use northing_recording::SensorKind;
use northing_recording::atomic_file::write_whole;
use northing_report::run_page;
use numpy::{PyArray1, PyArray2, PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::attitude_told::Telling;
use crate::errors::{of_file, of_recording, refused};

/// Estimates as columns, a row each, NaN where there is nothing to say.
#[derive(Default)]
struct Estimates {
    time_ns: Vec<i64>,
    quat: Vec<f64>,
    covariance: Vec<f64>,
    bias: Vec<f64>,
    bias_covariance: Vec<f64>,
}

impl Estimates {
    /// With room for so many rows.
    fn with_capacity(rows: usize) -> Self {
        Self {
            time_ns: Vec::with_capacity(rows),
            quat: Vec::with_capacity(4 * rows),
            covariance: Vec::with_capacity(9 * rows),
            bias: Vec::with_capacity(3 * rows),
            bias_covariance: Vec::with_capacity(9 * rows),
        }
    }

    fn push(&mut self, record: &EstimateRecord) {
        self.time_ns.push(record.time_ns);
        self.quat.extend(rotation::to_wxyz(&record.attitude));
        push_matrix(&mut self.covariance, record.attitude_covariance.as_ref());
        let bias = record.gyroscope_bias.as_ref();
        push_vector(&mut self.bias, bias.map(|(bias, _)| bias));
        push_matrix(&mut self.bias_covariance, bias.map(|(_, p)| p));
    }

    fn push_nothing(&mut self, time_ns: i64) {
        self.time_ns.push(time_ns);
        self.quat.extend([f64::NAN; 4]);
        push_matrix(&mut self.covariance, None);
        push_vector(&mut self.bias, None);
        push_matrix(&mut self.bias_covariance, None);
    }
}

/// What most callers do not ask for: places, and the innovations by sensor.
#[derive(Default)]
struct Details {
    position: Vec<f64>,
    velocity: Vec<f64>,
    innovations: Vec<(SensorKind, Innovations)>,
}

impl Details {
    fn push(&mut self, record: &EstimateRecord) {
        push_vector(&mut self.position, record.position.as_ref());
        push_vector(&mut self.velocity, record.velocity.as_ref());
    }

    fn push_nothing(&mut self) {
        push_vector(&mut self.position, None);
        push_vector(&mut self.velocity, None);
    }

    fn innovation(&mut self, record: &InnovationRecord) {
        let mut known = self.innovations.iter();
        let known = known.position(|(sensor, _)| *sensor == record.sensor);
        let at = known.unwrap_or_else(|| {
            self.innovations
                .push((record.sensor, Innovations::default()));
            self.innovations.len() - 1
        });
        self.innovations[at]
            .1
            .push(record.time_ns, &record.innovation);
    }
}

pub(crate) fn push_vector(column: &mut Vec<f64>, vector: Option<&Vector3<f64>>) {
    match vector {
        Some(v) => column.extend([v.x, v.y, v.z]),
        None => column.extend([f64::NAN; 3]),
    }
}

/// Row by row.
pub(crate) fn push_matrix(column: &mut Vec<f64>, matrix: Option<&Matrix3<f64>>) {
    match matrix {
        // Nine at once: an iterator asks for room for each.
        Some(m) => column.extend_from_slice(m.transpose().as_slice()),
        None => column.extend([f64::NAN; 9]),
    }
}

/// Innovations of one sensor as columns, a row each, NaN where the estimator states nothing.
#[derive(Default)]
pub(crate) struct Innovations {
    time_ns: Vec<i64>,
    residual: Vec<f64>,
    covariance: Vec<f64>,
    nis: Vec<f64>,
    degrees_of_freedom: Vec<u8>,
    outcome: Vec<u8>,
}

/// The outcomes in the order of their numbers; reasons of what was skipped are counted in the summary.
pub(crate) const OUTCOMES: [&str; 4] = ["fused", "inflated", "gated", "skipped"];

pub(crate) fn outcome_number(outcome: Outcome) -> u8 {
    match outcome {
        Outcome::Fused => 0,
        Outcome::Inflated => 1,
        Outcome::Gated => 2,
        Outcome::Skipped(_) => 3,
    }
}

impl Innovations {
    /// Adds one.
    pub(crate) fn push(
        &mut self,
        time_ns: i64,
        innovation: &northing_core::kalman::Innovation<f64>,
    ) {
        self.time_ns.push(time_ns);
        let looked_at = !matches!(innovation.outcome, Outcome::Skipped(_));
        let stated = innovation.degrees_of_freedom > 0;
        push_vector(
            &mut self.residual,
            Some(&innovation.residual).filter(|_| looked_at),
        );
        push_matrix(
            &mut self.covariance,
            Some(&innovation.covariance).filter(|_| stated),
        );
        self.nis
            .push(if stated { innovation.nis } else { f64::NAN });
        self.degrees_of_freedom.push(innovation.degrees_of_freedom);
        self.outcome.push(outcome_number(innovation.outcome));
    }

    /// As a dictionary of arrays.
    pub(crate) fn into_dict(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let dict = PyDict::new(py);
        dict.set_item("time_ns", PyArray1::from_vec(py, self.time_ns))?;
        dict.set_item("residual", rows(py, self.residual, 3)?)?;
        dict.set_item("covariance", matrices(py, self.covariance)?)?;
        dict.set_item("nis", PyArray1::from_vec(py, self.nis))?;
        dict.set_item(
            "degrees_of_freedom",
            PyArray1::from_vec(py, self.degrees_of_freedom),
        )?;
        dict.set_item("outcome", PyArray1::from_vec(py, self.outcome))?;
        Ok(dict)
    }
}

/// Watches a run and keeps what is asked for.
pub(crate) struct Collector {
    estimates: Estimates,
    details: Option<Details>,
    /// Whether there is a position or velocity.
    has_places: bool,
    /// Stamps of the rows that are wanted.
    wanted: Option<Arc<[i64]>>,
}

impl Collector {
    /// Of a recording: everything, with a row for each estimate.
    pub(crate) fn of_recording() -> Self {
        Self {
            estimates: Estimates::default(),
            details: Some(Details::default()),
            has_places: false,
            wanted: None,
        }
    }

    /// Of arrays: with a row for each of these stamps; with details, where they are asked for.
    pub(crate) fn of_arrays(wanted: Arc<[i64]>, has_details: bool) -> Self {
        Self {
            estimates: Estimates::with_capacity(wanted.len()),
            details: has_details.then(Details::default),
            has_places: false,
            wanted: Some(wanted),
        }
    }

    /// Fills rows before this stamp, for which there is no estimate.
    fn fill_before(&mut self, time_ns: i64) {
        let Some(wanted) = &self.wanted else { return };
        let filled = self.estimates.time_ns.len();
        let missing = wanted[filled.min(wanted.len())..].iter();
        for row_ns in missing.take_while(|row_ns| **row_ns < time_ns) {
            self.estimates.push_nothing(*row_ns);
            if let Some(details) = &mut self.details {
                details.push_nothing();
            }
        }
    }

    /// The details, which were asked for.
    fn into_details(mut self, py: Python<'_>) -> PyResult<DetailArrays> {
        self.fill_before(i64::MAX);
        let details = self.details.unwrap_or_default();
        let innovations = PyDict::new(py);
        for (sensor, columns) in details.innovations {
            innovations.set_item(sensor.name(), columns.into_dict(py)?)?;
        }
        Ok(DetailArrays {
            position: rows(py, details.position, 3)?.unbind(),
            velocity: rows(py, details.velocity, 3)?.unbind(),
            innovations: innovations.unbind(),
        })
    }
}

impl RunObserver for Collector {
    fn estimate(&mut self, record: &EstimateRecord) {
        self.fill_before(record.time_ns);
        self.estimates.push(record);
        self.has_places |= record.position.is_some() || record.velocity.is_some();
        if let Some(details) = &mut self.details {
            details.push(record);
        }
    }

    fn innovation(&mut self, record: &InnovationRecord) {
        if let Some(details) = &mut self.details {
            details.innovation(record);
        }
    }
}

/// An array of rows.
pub(crate) fn rows(
    py: Python<'_>,
    column: Vec<f64>,
    width: usize,
) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let count = column.len() / width;
    PyArray1::from_vec(py, column).reshape([count, width])
}

/// An array of 3 by 3 matrices.
pub(crate) fn matrices(py: Python<'_>, column: Vec<f64>) -> PyResult<Bound<'_, PyArray3<f64>>> {
    let count = column.len() / 9;
    PyArray1::from_vec(py, column).reshape([count, 3, 3])
}

/// An attitude run: its arrays, and what report and files are made of.
#[pyclass(frozen, module = "northing._northing")]
pub(crate) struct AttitudeRun {
    /// Stamps, ns.
    #[pyo3(get)]
    time_ns: Py<PyArray1<i64>>,
    /// `world_from_body`, w, x, y, z.
    #[pyo3(get)]
    quat: Py<PyArray2<f64>>,
    /// Of the local attitude error in body axes, rad^2.
    #[pyo3(get)]
    covariance: Py<PyArray3<f64>>,
    /// Gyroscope bias, rad/s.
    #[pyo3(get)]
    gyro_bias: Py<PyArray2<f64>>,
    /// Its covariance, (rad/s)^2.
    #[pyo3(get)]
    gyro_bias_covariance: Py<PyArray3<f64>>,
    has_places: bool,
    details: OnceLock<DetailArrays>,
    estimator: EstimatorKind,
    telling: Telling,
}

/// What most callers do not ask for.
struct DetailArrays {
    /// World frame, m.
    position: Py<PyArray2<f64>>,
    /// World frame, m/s.
    velocity: Py<PyArray2<f64>>,
    /// By sensor.
    innovations: Py<PyDict>,
}

impl AttitudeRun {
    /// Of what a run of an estimator gave, and what tells the rest.
    pub(crate) fn new(
        py: Python<'_>,
        mut collected: Collector,
        estimator: EstimatorKind,
        telling: Telling,
    ) -> PyResult<Self> {
        collected.fill_before(i64::MAX);
        let has_places = collected.has_places;
        let estimates = std::mem::take(&mut collected.estimates);
        let details = OnceLock::new();
        if collected.details.is_some() {
            // Nobody else has it yet.
            let _ = details.set(collected.into_details(py)?);
        }
        Ok(Self {
            time_ns: PyArray1::from_vec(py, estimates.time_ns).unbind(),
            quat: rows(py, estimates.quat, 4)?.unbind(),
            covariance: matrices(py, estimates.covariance)?.unbind(),
            gyro_bias: rows(py, estimates.bias, 3)?.unbind(),
            gyro_bias_covariance: matrices(py, estimates.bias_covariance)?.unbind(),
            has_places,
            details,
            estimator,
            telling,
        })
    }

    /// Made when they are first asked for, where the run has not kept them.
    fn details(&self, py: Python<'_>) -> PyResult<&DetailArrays> {
        if let Some(details) = self.details.get() {
            return Ok(details);
        }
        let details = self.telling.again(py)?.into_details(py)?;
        // Of two threads that ask at once the first counts; both have the same.
        Ok(self.details.get_or_init(|| details))
    }
}

#[pymethods]
impl AttitudeRun {
    /// World frame, m.
    #[getter]
    fn position(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        Ok(self.details(py)?.position.clone_ref(py))
    }

    /// World frame, m/s.
    #[getter]
    fn velocity(&self, py: Python<'_>) -> PyResult<Py<PyArray2<f64>>> {
        Ok(self.details(py)?.velocity.clone_ref(py))
    }

    /// By sensor.
    #[getter]
    fn innovations(&self, py: Python<'_>) -> PyResult<Py<PyDict>> {
        Ok(self.details(py)?.innovations.clone_ref(py))
    }

    /// What the program prints with `run --json`.
    fn summary_json(&self, py: Python<'_>) -> PyResult<String> {
        serde_json::to_string(&self.telling.told(py)?.summary)
            .map_err(|error| refused(error.to_string()))
    }

    /// The page of the run, as the program writes it; `command` says how it was made.
    fn report_html(&self, py: Python<'_>, command: String) -> PyResult<String> {
        let told = self.telling.told(py)?;
        Ok(py.detach(|| run_page::render(&told.summary, &told.metadata, &told.trace, command)))
    }

    /// Writes that page.
    fn report(&self, py: Python<'_>, path: PathBuf, command: String, force: bool) -> PyResult<()> {
        let html = self.report_html(py, command)?;
        write_whole(&path, html.as_bytes(), force).map_err(|error| of_recording(&error))
    }

    /// Writes the estimates as the program does, by extension: .csv, .parquet, .tum or .mcap.
    fn save(&self, py: Python<'_>, path: PathBuf, force: bool) -> PyResult<()> {
        let file = EstimateFile::create(&path, self.estimator, force);
        let mut file = file.map_err(of_file)?;
        file.set_world(self.telling.world());
        let time_ns = self.time_ns.bind(py).readonly();
        let [quat, bias] = [&self.quat, &self.gyro_bias].map(|array| array.bind(py).readonly());
        let places = self.has_places.then(|| self.details(py)).transpose()?;
        let places = places.map(|places| [&places.position, &places.velocity]);
        let places = places.map(|places| places.map(|array| array.bind(py).readonly()));
        let [covariance, bias_covariance] =
            [&self.covariance, &self.gyro_bias_covariance].map(|array| array.bind(py).readonly());
        for (row, time_ns) in time_ns.as_slice()?.iter().enumerate() {
            let [w, x, y, z] = cells(quat.as_slice()?, row);
            if w.is_nan() {
                continue;
            }
            let place = |which: usize| -> PyResult<Option<Vector3<f64>>> {
                let Some(places) = &places else {
                    return Ok(None);
                };
                Ok(vector(cells(places[which].as_slice()?, row)))
            };
            file.estimate(&EstimateRecord {
                time_ns: *time_ns,
                time_s: 0.0,
                attitude: UnitQuaternion::new_unchecked(Quaternion::new(w, x, y, z)),
                attitude_covariance: matrix(cells(covariance.as_slice()?, row)),
                gyroscope_bias: vector(cells(bias.as_slice()?, row))
                    .zip(matrix(cells(bias_covariance.as_slice()?, row))),
                position: place(0)?,
                velocity: place(1)?,
                reference: None,
                device: None,
            });
        }
        file.finish().map_err(of_file)
    }

    fn __len__(&self, py: Python<'_>) -> usize {
        self.time_ns.bind(py).len()
    }
}

/// The numbers of a row.
fn cells<const N: usize>(column: &[f64], row: usize) -> [f64; N] {
    std::array::from_fn(|i| column.get(row * N + i).copied().unwrap_or(f64::NAN))
}

fn vector(row: [f64; 3]) -> Option<Vector3<f64>> {
    (!row[0].is_nan()).then(|| row.into())
}

fn matrix(row: [f64; 9]) -> Option<Matrix3<f64>> {
    (!row[0].is_nan()).then(|| Matrix3::from_row_slice(&row))
}
