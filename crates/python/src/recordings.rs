//! Recordings in files: what they hold, their samples as arrays, and runs over them.

use std::path::PathBuf;

use northing_core::geometry::rotation;
use northing_evaluation::RunEstimator;
use northing_evaluation::attitude::reference::{self, ReferenceUse};
use northing_evaluation::navigation::NavigationOptions;
use northing_evaluation::{Origin, navigation};
use northing_recording::{Metadata, OpenOptions, Recording, RecordingError, Sample, SensorKind};
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;

use crate::attitude::{self, Asked, Reading, word};
use crate::attitude_run::{AttitudeRun, rows};
use crate::errors::{of_recording, of_run, refused};
use crate::navigation_run::{NavigationRun, Source};

/// A recording: a file or folder, and how it is read. It is read anew for everything that is asked of it.
#[pyclass(frozen, module = "northing._northing")]
pub(crate) struct RecordingFile {
    path: PathBuf,
    options: OpenOptions,
    metadata: Metadata,
    sensors: Vec<SensorKind>,
}

impl RecordingFile {
    /// Open, and the name that stands for it in messages.
    pub(crate) fn opened(&self) -> PyResult<(Recording, String)> {
        let recording = attitude::open(&self.path, &self.options)?;
        Ok((recording, self.path.display().to_string()))
    }
}

/// What is asked of a navigation run; as the program's options about navigation.
#[derive(FromPyObject)]
pub(crate) struct AskedNavigation {
    gnss_every: Option<u32>,
    outages: Vec<String>,
    without: Vec<String>,
    score_from_s: Option<f64>,
}

impl AskedNavigation {
    /// As options of a run over a recording.
    ///
    /// # Errors
    /// A setting or a combination that is invalid.
    pub(crate) fn options(
        &self,
        estimator: &str,
        smooth: bool,
        settings: &[String],
        metadata: &Metadata,
    ) -> PyResult<NavigationOptions> {
        let kind = estimator
            .parse()
            .map_err(|e: northing_evaluation::EvaluationError| refused(e.to_string()))?;
        let mut options = NavigationOptions::of_recording(kind, metadata);
        options.smooth = smooth;
        for setting in settings {
            let set = options.set_from(setting, Origin::Set);
            set.map_err(|error| refused(error.to_string()))?;
        }
        let usual = NavigationOptions::default();
        options.gnss_every = self.gnss_every.unwrap_or(usual.gnss_every);
        options.score_from_s = self.score_from_s.unwrap_or(usual.score_from_s);
        options.outages = parsed(&self.outages)?;
        options.without = parsed::<navigation::AidKind>(&self.without)?;
        options
            .check()
            .map_err(|error| refused(error.to_string()))?;
        Ok(options)
    }
}

/// Stamps, rows, and what stands in each column.
type Arrays<'py> = (
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray2<f64>>,
    Vec<&'static str>,
);

#[pymethods]
impl RecordingFile {
    /// Opens it and looks at its head.
    #[new]
    fn new(path: PathBuf, reading: Reading) -> PyResult<Self> {
        let options = reading.options()?;
        let recording = attitude::open(&path, &options)?;
        Ok(Self {
            metadata: recording.metadata().clone(),
            sensors: recording.sensors().to_vec(),
            path,
            options,
        })
    }

    /// Its name.
    #[getter]
    fn name(&self) -> &str {
        &self.metadata.name
    }

    /// Its format.
    #[getter]
    fn format(&self) -> &str {
        &self.metadata.format
    }

    /// `enu` or `ned`.
    #[getter]
    fn frame(&self) -> String {
        self.metadata.world_frame.name().to_lowercase()
    }

    /// The sensors that its columns promise.
    #[getter]
    fn sensors(&self) -> Vec<&'static str> {
        self.sensors.iter().map(|sensor| sensor.name()).collect()
    }

    /// The kind of estimator that runs: `attitude` or `navigation`, and its name where it is decided.
    fn estimator_for(&self, asked: Option<String>) -> PyResult<(&'static str, Option<String>)> {
        let asked = word::<RunEstimator>(asked, "estimator")?;
        Ok(match RunEstimator::of_recording(asked, &self.sensors) {
            Some(RunEstimator::Navigation(kind)) => ("navigation", Some(kind.name().to_owned())),
            Some(RunEstimator::Attitude(kind)) => ("attitude", Some(kind.name().to_owned())),
            None => ("attitude", None),
        })
    }

    /// Every sample of one sensor, and what was odd about the recording.
    fn arrays<'py>(&self, py: Python<'py>, sensor: &str) -> PyResult<(Arrays<'py>, Vec<String>)> {
        let kind = SensorKind::ALL
            .into_iter()
            .find(|kind| kind.name() == sensor);
        let kind = kind.filter(|kind| self.sensors.contains(kind));
        let kind = kind.ok_or_else(|| {
            let names = self.sensors().join(", ");
            refused(format!(
                "{}: no sensor `{sensor}`; it has {names}",
                self.metadata.name
            ))
        })?;
        let mut recording = attitude::open(&self.path, &self.options)?;
        let read = py.detach(|| {
            let (mut time_ns, mut columns) = (Vec::new(), Vec::new());
            for event in recording.by_ref() {
                let event = event?;
                if event.sample.kind() == kind {
                    time_ns.push(event.time_ns);
                    columns.extend(numbers(&event.sample));
                }
            }
            Ok((time_ns, columns))
        });
        let (time_ns, values) = read.map_err(|error: RecordingError| of_recording(&error))?;
        let names = columns_of(kind);
        let arrays = (
            PyArray1::from_vec(py, time_ns),
            rows(py, values, names.len())?,
            names.to_vec(),
        );
        Ok((arrays, recording.issues().sentences()))
    }

    /// Runs an attitude estimator.
    fn run_attitude(&self, py: Python<'_>, asked: Asked) -> PyResult<AttitudeRun> {
        let named = asked.estimator().map(str::to_owned);
        let kind = match RunEstimator::of_recording(word(named, "estimator")?, &self.sensors) {
            Some(RunEstimator::Attitude(kind)) => Some(kind),
            _ => None,
        };
        let aligns_reference = asked.aligns_reference();
        let mut options = asked.options_of_one(kind, &self.options)?;
        let name = self.path.display().to_string();
        if aligns_reference {
            let recording = attitude::open(&self.path, &self.options)?;
            let found = py.detach(|| reference::fit(recording));
            options.reference =
                ReferenceUse::Aligned(found.map_err(|error| of_run(&error, &name))?);
        }
        let recording = attitude::open(&self.path, &self.options)?;
        attitude::run(py, recording, &name, &options)
    }

    /// Runs a navigation estimator.
    fn run_navigation(
        &self,
        py: Python<'_>,
        estimator: &str,
        smooth: bool,
        settings: Vec<String>,
        asked: AskedNavigation,
    ) -> PyResult<NavigationRun> {
        let options = asked.options(estimator, smooth, &settings, &self.metadata)?;
        let source = Source::File(self.path.clone());
        NavigationRun::new(py, source, self.options.clone(), options)
    }
}

fn parsed<T: std::str::FromStr<Err = String>>(words: &[String]) -> PyResult<Vec<T>> {
    words
        .iter()
        .map(|text| text.parse().map_err(refused))
        .collect()
}

/// What stands in the columns of a sensor's arrays.
fn columns_of(kind: SensorKind) -> &'static [&'static str] {
    match kind {
        SensorKind::Gyroscope | SensorKind::DeviceGyroscopeBias => {
            &["x_rad_s", "y_rad_s", "z_rad_s"]
        }
        SensorKind::Accelerometer => &["x_m_s2", "y_m_s2", "z_m_s2"],
        SensorKind::Magnetometer | SensorKind::MagnetometerUncalibrated => {
            &["x_ut", "y_ut", "z_ut"]
        }
        SensorKind::DeviceOrientation => &["w", "x", "y", "z"],
        SensorKind::Reference => &["w", "x", "y", "z", "scored"],
        SensorKind::Position => &["x_m", "y_m", "z_m"],
        SensorKind::Velocity => &["x_m_s", "y_m_s", "z_m_s"],
        SensorKind::ReferenceVelocity => &["north_m_s", "east_m_s", "down_m_s"],
        SensorKind::Pressure => &["pa"],
        SensorKind::ForwardSpeed => &["m_s"],
        SensorKind::CompassHeading | SensorKind::TrueHeading => &["heading_rad", "std_rad"],
        SensorKind::WaterVelocity => &["forward_m_s", "starboard_m_s"],
        SensorKind::GnssPosition | SensorKind::ReferencePosition => &[
            "latitude_rad",
            "longitude_rad",
            "height_m",
            "north_std_m",
            "east_std_m",
            "down_std_m",
        ],
        SensorKind::GnssVelocity => &[
            "north_m_s",
            "east_m_s",
            "down_m_s",
            "north_std_m_s",
            "east_std_m_s",
            "down_std_m_s",
        ],
        _ => &["latitude_rad", "longitude_rad", "height_m"],
    }
}

/// The numbers of a sample, in the order of [`columns_of`]; NaN for what is not known.
fn numbers(sample: &Sample) -> Vec<f64> {
    let nan = f64::NAN;
    let three = |values: Option<[f64; 3]>| values.unwrap_or([nan; 3]);
    match sample {
        Sample::DeviceOrientation(q) => rotation::to_wxyz(q).to_vec(),
        Sample::Reference(reference) => {
            let scored = f64::from(u8::from(reference.scored));
            [&rotation::to_wxyz(&reference.attitude)[..], &[scored]].concat()
        }
        Sample::Pressure(x) | Sample::ForwardSpeed(x) => vec![*x],
        Sample::CompassHeading(heading) => vec![heading.heading_rad, heading.std_rad],
        Sample::TrueHeading(heading) => vec![heading.heading_rad, heading.std_rad.unwrap_or(nan)],
        Sample::WaterVelocity(water) => vec![water.forward_m_s, water.starboard_m_s.unwrap_or(nan)],
        Sample::GnssPosition(fix) | Sample::ReferencePosition(fix) => {
            let place = [
                fix.latitude_rad,
                fix.longitude_rad,
                fix.height_m.unwrap_or(nan),
            ];
            [place, three(fix.std_m)].concat()
        }
        Sample::GnssVelocity(v) => [
            [v.north_m_s, v.east_m_s, v.down_m_s.unwrap_or(nan)],
            three(v.std_m_s),
        ]
        .concat(),
        Sample::DeviceNavigation(said) => {
            vec![said.latitude_rad, said.longitude_rad, said.height_m]
        }
        vector => vector
            .vector()
            .map_or(vec![nan; 3], |v| vec![v.x, v.y, v.z]),
    }
}
