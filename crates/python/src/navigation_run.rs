//! What a navigation run gives: the track as arrays, innovations of each aid, the summary, a report and files.

use std::path::PathBuf;
use std::sync::Arc;

use northing_core::earth::wgs84::LocalFrame;
use northing_core::geometry::rotation;
use northing_core::kalman::Innovation;
use northing_evaluation::navigation::trace::NavigationTrace;
use northing_evaluation::navigation::{
    AidKind, NavigationEstimate, NavigationFile, NavigationObserver, NavigationOptions,
    NavigationSummary, run_navigation,
};
use northing_recording::atomic_file::write_whole;
use northing_recording::device_navigation::validity_word;
use northing_recording::{Event, OpenOptions, Recording, SensorKind, WorldFrame};
use northing_report::{NavigationReport, TRACE_CAPACITY};
use numpy::{PyArray1, PyArray2, PyArray3};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::attitude;
use crate::attitude_run::{Innovations, matrices, push_matrix, push_vector, rows};
use crate::errors::{of_file, of_recording, of_run, refused};
use crate::samples;

/// The track as columns, a row for each inertial sample; NaN where there is nothing to say.
#[derive(Default)]
struct Track {
    first: Option<LocalFrame>,
    time_ns: Vec<i64>,
    /// Latitude and longitude, deg, height, m.
    geodetic: Vec<f64>,
    ned: Vec<f64>,
    covariance: Vec<f64>,
    velocity: Vec<f64>,
    quat: Vec<f64>,
    /// Heading and its standard deviation, rad.
    heading: Vec<f64>,
    validity: Vec<&'static str>,
    innovations: Vec<(AidKind, Innovations)>,
}

impl NavigationObserver for Track {
    fn interval_ns(&self) -> i64 {
        0
    }

    fn origin(&mut self, frame: &LocalFrame) {
        self.first = Some(*frame);
    }

    fn estimate(&mut self, estimate: &NavigationEstimate) {
        let Some(first) = &self.first else { return };
        let place = estimate.frame.geodetic(&estimate.position);
        let [latitude, longitude] = place.degrees();
        self.time_ns.push(estimate.time_ns);
        self.geodetic.extend([latitude, longitude, place.height_m]);
        push_vector(&mut self.ned, Some(&estimate.in_frame(first).position));
        push_matrix(&mut self.covariance, Some(&estimate.position_covariance));
        push_vector(&mut self.velocity, Some(&estimate.velocity));
        let quat = estimate.ned_from_body.map(|q| rotation::to_wxyz(&q));
        self.quat.extend(quat.unwrap_or([f64::NAN; 4]));
        let heading = [estimate.heading(), estimate.heading_std];
        self.heading
            .extend(heading.map(|angle| angle.unwrap_or(f64::NAN)));
        self.validity.push(validity_word(estimate.validity));
    }

    fn innovation(&mut self, time_ns: i64, aid: AidKind, innovation: &Innovation<f64>) {
        let known = self.innovations.iter().position(|(kind, _)| *kind == aid);
        let at = known.unwrap_or_else(|| {
            self.innovations.push((aid, Innovations::default()));
            self.innovations.len() - 1
        });
        self.innovations[at].1.push(time_ns, innovation);
    }
}

/// What is run over, as often as it is wanted.
pub(crate) enum Source {
    /// A file or folder.
    File(PathBuf),
    /// Arrays, as the events of a recording of these sensors, in the order of time.
    Arrays(Arc<[Event]>, Vec<SensorKind>),
}

impl Source {
    /// Open, and the name that stands for it in messages.
    fn open(&self, reading: &OpenOptions) -> PyResult<(Recording, String)> {
        match self {
            Self::File(path) => Ok((attitude::open(path, reading)?, path.display().to_string())),
            Self::Arrays(events, sensors) => {
                let events = Arc::clone(events);
                let count = events.len();
                let metadata = samples::metadata(WorldFrame::Ned);
                let events = (0..count).map(move |at| Ok(events[at]));
                let recording = Recording::from_events(metadata, sensors, events, reading);
                Ok((recording, samples::NAME.to_owned()))
            }
        }
    }
}

/// A navigation run: its arrays, and what makes report and files: these run over the recording once more.
#[pyclass(frozen, module = "northing._northing")]
pub(crate) struct NavigationRun {
    source: Source,
    reading: OpenOptions,
    options: NavigationOptions,
    /// Stamps, ns.
    #[pyo3(get)]
    time_ns: Py<PyArray1<i64>>,
    /// Latitude and longitude, deg, height above the ellipsoid, m.
    #[pyo3(get)]
    geodetic: Py<PyArray2<f64>>,
    /// North, east, down of the first origin, m.
    #[pyo3(get)]
    ned: Py<PyArray2<f64>>,
    /// Covariance of the position, m^2.
    #[pyo3(get)]
    covariance: Py<PyArray3<f64>>,
    /// North, east, down, m/s.
    #[pyo3(get)]
    velocity: Py<PyArray2<f64>>,
    /// `ned_from_body`, w, x, y, z.
    #[pyo3(get)]
    quat: Py<PyArray2<f64>>,
    /// Heading from true north and its standard deviation, rad.
    #[pyo3(get)]
    heading: Py<PyArray2<f64>>,
    /// What may be done with each position.
    #[pyo3(get)]
    validity: Vec<&'static str>,
    /// By aid.
    #[pyo3(get)]
    innovations: Py<PyDict>,
    summary: NavigationSummary,
}

/// Runs over a recording, as the program does.
fn run_over(
    recording: &mut Recording,
    name: &str,
    options: &NavigationOptions,
    observer: &mut dyn NavigationObserver,
) -> PyResult<NavigationSummary> {
    let world = recording.metadata().frames();
    let summary = run_navigation(recording.by_ref(), name, world, options, observer);
    let mut summary = summary.map_err(|error| of_run(&error, name))?;
    summary.issues.splice(0..0, recording.issues().sentences());
    Ok(summary)
}

impl NavigationRun {
    /// Runs.
    pub(crate) fn new(
        py: Python<'_>,
        source: Source,
        reading: OpenOptions,
        options: NavigationOptions,
    ) -> PyResult<Self> {
        let mut track = Track::default();
        let (mut recording, name) = source.open(&reading)?;
        let summary = py.detach(|| run_over(&mut recording, &name, &options, &mut track))?;
        let innovations = PyDict::new(py);
        for (aid, columns) in track.innovations {
            innovations.set_item(aid.name(), columns.into_dict(py)?)?;
        }
        Ok(Self {
            source,
            reading,
            options,
            time_ns: PyArray1::from_vec(py, track.time_ns).unbind(),
            geodetic: rows(py, track.geodetic, 3)?.unbind(),
            ned: rows(py, track.ned, 3)?.unbind(),
            covariance: matrices(py, track.covariance)?.unbind(),
            velocity: rows(py, track.velocity, 3)?.unbind(),
            quat: rows(py, track.quat, 4)?.unbind(),
            heading: rows(py, track.heading, 2)?.unbind(),
            validity: track.validity,
            innovations: innovations.unbind(),
            summary,
        })
    }

    /// Runs once more, watched by something else; the recording's title comes back.
    fn again(&self, observer: &mut dyn NavigationObserver) -> PyResult<String> {
        let (mut recording, name) = self.source.open(&self.reading)?;
        run_over(&mut recording, &name, &self.options, observer)?;
        Ok(recording.metadata().name.clone())
    }
}

#[pymethods]
impl NavigationRun {
    /// What the program prints with `run --json`.
    fn summary_json(&self) -> PyResult<String> {
        serde_json::to_string(&self.summary).map_err(|error| refused(error.to_string()))
    }

    /// Writes the page of the run, as the program does; `command` says how it was made.
    fn report(&self, py: Python<'_>, path: PathBuf, command: String, force: bool) -> PyResult<()> {
        py.detach(|| {
            let mut trace = NavigationTrace::new(TRACE_CAPACITY);
            let name = self.again(&mut trace)?;
            let page = NavigationReport {
                name,
                summary: &self.summary,
                trace: &trace,
                command: Some(command),
            };
            let html = page.render();
            write_whole(&path, html.as_bytes(), force).map_err(|error| of_recording(&error))
        })
    }

    /// Writes the estimates as the program does, by extension: .csv, .parquet, .kml, .gpx, .geojson, .tum or .mcap.
    fn save(&self, py: Python<'_>, path: PathBuf, force: bool) -> PyResult<()> {
        py.detach(|| {
            let mut file = NavigationFile::create(&path, force).map_err(of_file)?;
            let name = self.again(&mut file)?;
            file.finish(&name).map_err(of_file)
        })
    }
}
