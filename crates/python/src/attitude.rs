//! Attitude runs: what can be asked for, and the run over arrays.

use std::path::PathBuf;
use std::sync::Arc;

use northing_evaluation::attitude::parameters::parameters_of;
use northing_evaluation::attitude::reference::ReferenceUse;
use northing_evaluation::attitude::{EstimatorKind, Profile, RunOptions, SensorSelection};
use northing_evaluation::calibration::magnetometer::{
    MagnetometerSource, MagnetometerStreamCalibration,
};
use northing_evaluation::navigation::NavigationKind;
use northing_evaluation::registry::listed;
use northing_recording::{OpenOptions, Recording, WorldFrame};
use numpy::{PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use crate::attitude_run::{AttitudeRun, Collector};
use crate::attitude_told::{Telling, Told};
use crate::errors::{of_recording, of_run, refused};
use crate::samples::{self, Arrays, Stream};

/// What is asked of the reader; as the program's options about the recording.
#[derive(FromPyObject)]
pub(crate) struct Reading {
    format: Option<String>,
    device: Option<String>,
    manifest: Option<PathBuf>,
    data: Option<PathBuf>,
    gyroscope_unit: Option<String>,
    accelerometer_unit: Option<String>,
    magnetometer_unit: Option<String>,
    gap_limit_s: f64,
    describe: bool,
    reference: Option<PathBuf>,
}

impl Reading {
    /// As options of the readers.
    ///
    /// # Errors
    /// A word that is none of those expected.
    pub(crate) fn options(self) -> PyResult<OpenOptions> {
        if !(self.gap_limit_s > 0.0 && self.gap_limit_s.is_finite()) {
            return Err(refused(format!(
                "gap_limit={}: expected seconds above 0, e.g. 0.5",
                self.gap_limit_s
            )));
        }
        Ok(OpenOptions {
            format: word(self.format, "format")?,
            device: self.device,
            manifest: self.manifest,
            data: self.data,
            gyroscope_unit: word(self.gyroscope_unit, "gyroscope_unit")?,
            accelerometer_unit: word(self.accelerometer_unit, "accelerometer_unit")?,
            magnetometer_unit: word(self.magnetometer_unit, "magnetometer_unit")?,
            gap_limit_s: self.gap_limit_s,
            describe: self.describe,
            reference: self.reference,
            ..OpenOptions::default()
        })
    }
}

/// One of some words.
pub(crate) fn word<T: std::str::FromStr>(text: Option<String>, name: &str) -> PyResult<Option<T>>
where
    T::Err: std::fmt::Display,
{
    let read = |text: String| {
        text.parse()
            .map_err(|problem| refused(format!("{name}=\"{text}\": {problem}")))
    };
    text.map(read).transpose()
}

/// What is asked of an attitude run; as the program's options about the estimation.
#[derive(FromPyObject)]
pub(crate) struct Asked {
    estimator: Option<String>,
    profile: Option<String>,
    smooth: bool,
    sensors: Option<String>,
    magnetometer: Option<String>,
    calibrate_first_s: Option<f64>,
    /// Of [`RecordingFile`](crate::recordings::RecordingFile), as JSON.
    calibration: Option<String>,
    magnetometer_calibration: Option<String>,
    ignore_reference: bool,
    align_reference: bool,
    /// `NAME=VALUE`.
    settings: Vec<String>,
}

impl Asked {
    /// As options of a run of one estimator, which must have a use for every setting.
    ///
    /// # Errors
    /// As [`Self::options`], and a setting without effect.
    pub(crate) fn options_of_one(
        self,
        estimator: Option<EstimatorKind>,
        open: &OpenOptions,
    ) -> PyResult<RunOptions> {
        let settings = self.settings.clone();
        let options = self.options(estimator, open)?;
        check_effect(&settings, options.estimator)?;
        Ok(options)
    }

    /// As options of a run.
    ///
    /// # Errors
    /// A setting or a combination that is invalid.
    pub(crate) fn options(
        self,
        estimator: Option<EstimatorKind>,
        open: &OpenOptions,
    ) -> PyResult<RunOptions> {
        let named = word(self.estimator, "estimator")?;
        let profile: Profile = word(self.profile, "profile")?.unwrap_or_default();
        let estimator = named.or(estimator).unwrap_or(profile.estimator());
        let mut options = RunOptions::new(estimator, profile);
        for setting in &self.settings {
            options.set(setting).map_err(|e| refused(e.to_string()))?;
        }
        options.driver.gap_limit_s = open.gap_limit_s;
        options.choose_magnetometer = self.magnetometer.is_none() && self.sensors.is_none();
        if let Some(sensors) = word::<SensorSelection>(self.sensors, "sensors")? {
            options.sensors = sensors;
        }
        if let Some(which) = self.magnetometer {
            options.sensors.magnetometer_source = magnetometer(&which)?;
        }
        options.calibrate_first_s = self.calibrate_first_s;
        options.calibration = self.calibration.as_deref().map(calibration).transpose()?;
        if let Some(text) = &self.magnetometer_calibration {
            let made: MagnetometerStreamCalibration = calibration(text)?;
            options.choose_magnetometer = false;
            options.sensors.magnetometer_source = made.magnetometer;
            options.magnetometer_calibration = Some(made);
        }
        options.smooth = self.smooth;
        if self.ignore_reference {
            if self.align_reference {
                return Err(refused(
                    "ignore_reference and align_reference contradict each other; give one",
                ));
            }
            options.reference = ReferenceUse::Ignored;
        }
        options.check().map_err(|e| refused(e.to_string()))?;
        Ok(options)
    }

    /// Whether the reference is put on the sensors' clock and into their axes first.
    pub(crate) fn aligns_reference(&self) -> bool {
        self.align_reference
    }

    /// The estimator that is named, whatever it estimates.
    pub(crate) fn estimator(&self) -> Option<&str> {
        self.estimator.as_deref()
    }
}

pub(crate) fn magnetometer(which: &str) -> PyResult<MagnetometerSource> {
    match which {
        "device" => Ok(MagnetometerSource::Device),
        "uncalibrated" => Ok(MagnetometerSource::Uncalibrated),
        _ => Err(refused(format!(
            "magnetometer=\"{which}\": expected device or uncalibrated"
        ))),
    }
}

/// A calibration that the module has made.
fn calibration<C: serde::de::DeserializeOwned>(text: &str) -> PyResult<C> {
    serde_json::from_str(text)
        .map_err(|error| refused(format!("the calibration: {error}; calibrate again")))
}

/// Refuses a parameter that the estimator has no use for.
fn check_effect(settings: &[String], estimator: EstimatorKind) -> PyResult<()> {
    let known = parameters_of(estimator);
    let names: Vec<&str> = known.iter().map(|p| p.name.as_str()).collect();
    let of = |setting: &String| {
        setting
            .split('=')
            .next()
            .unwrap_or_default()
            .trim()
            .to_owned()
    };
    let Some(name) = settings
        .iter()
        .map(of)
        .find(|name| !names.contains(&name.as_str()))
    else {
        return Ok(());
    };
    let has = match names.is_empty() {
        true => "it has no parameters".to_owned(),
        false => format!("it has {}", names.join(", ")),
    };
    Err(refused(format!(
        "`{name}` has no effect on `{estimator}`: {has}"
    )))
}

/// Runs an attitude estimator over a recording, without the interpreter; `name` stands for it in summary and messages.
pub(crate) fn run(
    py: Python<'_>,
    mut recording: Recording,
    name: &str,
    options: &RunOptions,
) -> PyResult<AttitudeRun> {
    let told = py.detach(|| Told::of(&mut recording, name, options, Collector::of_recording()));
    let (told, collected) = told.map_err(|error| of_run(&error, name))?;
    AttitudeRun::new(
        py,
        collected,
        options.estimator,
        Telling::Told(Box::new(told)),
    )
}

/// Runs an attitude estimator over arrays: stamps in ns, vectors of the sensors, rows of the result as those of the gyroscope.
///
/// # Errors
/// What is refused of arrays and options, as `ValueError`.
#[pyfunction]
#[pyo3(signature = (gyroscope, accelerometer, magnetometer, frame, asked, reading))]
pub(crate) fn attitude(
    py: Python<'_>,
    gyroscope: Samples<'_>,
    accelerometer: Option<Samples<'_>>,
    magnetometer: Option<Samples<'_>>,
    frame: &str,
    asked: Asked,
    reading: Reading,
) -> PyResult<AttitudeRun> {
    let open = reading.options()?;
    let options = asked.options_of_one(None, &open)?;
    let frame = match frame {
        "enu" => WorldFrame::Enu,
        "ned" => WorldFrame::Ned,
        other => return Err(refused(format!("frame=\"{other}\": expected enu or ned"))),
    };
    let (rate_stamps, rates) = gyroscope;
    let time_ns = samples::stamps(&rate_stamps);
    let beside = |(stamps, vectors): Samples<'_>| {
        let are_own = !stamps.is(&*rate_stamps);
        let stamps = are_own.then(|| samples::stamps(&stamps));
        Stream::of(stamps.unwrap_or_else(|| Arc::clone(&time_ns)), &vectors)
    };
    let [accelerometer, magnetometer] =
        [accelerometer, magnetometer].map(|samples| samples.map(beside));
    let gyroscope = Stream::of(Arc::clone(&time_ns), &rates);
    let arrays = Arrays::new(gyroscope, accelerometer, magnetometer, frame, open);
    let of_arrays = RunOptions {
        recording: samples::NAME.to_owned(),
        world_frame: frame,
        ..options
    };
    // An estimator that somebody brought along is not run once more: it need not repeat itself.
    let is_own = matches!(of_arrays.estimator, EstimatorKind::Own(_));
    let mut collected = Collector::of_arrays(arrays.stamps(), is_own);
    let estimates = py.detach(|| arrays.estimate(&of_arrays, &mut collected));
    let estimates = estimates.map_err(|error| of_run(&error, samples::NAME))?;
    let estimator = of_arrays.estimator;
    let telling = Telling::of_arrays(arrays, of_arrays);
    if estimates == 0 {
        // The whole run says why.
        telling.told(py)?;
    }
    AttitudeRun::new(py, collected, estimator, telling)
}

/// Stamps in ns, and a row of three numbers for each.
pub(crate) type Samples<'py> = (PyReadonlyArray1<'py, i64>, PyReadonlyArray2<'py, f64>);

/// The estimators of attitude and navigation with their parameters, as JSON.
#[pyfunction]
pub(crate) fn estimators() -> PyResult<String> {
    let listed: Vec<_> = listed::<EstimatorKind>()
        .chain(listed::<NavigationKind>())
        .collect();
    serde_json::to_string(&listed).map_err(|error| refused(error.to_string()))
}

/// Opens a recording of a file.
pub(crate) fn open(path: &std::path::Path, options: &OpenOptions) -> PyResult<Recording> {
    northing_recording::open(path, options).map_err(|error| of_recording(&error))
}
