//! Calibrations at rest, of the magnetometer, Allan deviations, and the fit of noise parameters, each as JSON.

use northing_core::calibration::MagnetometerLimits;
use northing_evaluation::calibration::allan::{AllanConfig, RestSamples, analyze};
use northing_evaluation::calibration::magnetometer::FieldSamples;
use northing_evaluation::calibration::rest::{self, Span};
use northing_evaluation::navigation::{NavigationKind, NavigationOptions};
use northing_evaluation::tune::{
    TuneOptions, attitude as fit_attitude, navigation as fit_navigation,
};
use northing_evaluation::{EvaluationError, Profile, RunEstimator, RunOptions};
use northing_recording::{Event, Recording, RecordingError, SensorKind};
use pyo3::prelude::*;
use serde::Serialize;
use serde_json::json;

use crate::attitude::magnetometer;
use crate::errors::{of_recording, of_run, refused};
use crate::recordings::RecordingFile;

/// Seconds after the first sample.
type Seconds = Option<f64>;

fn check_span(start: Seconds, stop: Seconds) -> PyResult<()> {
    for (name, seconds) in [("start", start), ("stop", stop)] {
        if seconds.is_some_and(|s| !(s >= 0.0 && s.is_finite())) {
            return Err(refused(format!(
                "{name}: expected seconds after the first sample, 0 or above"
            )));
        }
    }
    match (start, stop) {
        (Some(start), Some(stop)) if start >= stop => {
            Err(refused(format!("start={start} is not before stop={stop}")))
        }
        _ => Ok(()),
    }
}

/// Hands over the events of a span.
fn of_span(
    recording: &mut Recording,
    (start, stop): (Seconds, Seconds),
    mut take: impl FnMut(&Event),
) -> Result<(), RecordingError> {
    let (mut first_ns, span) = (None, start.unwrap_or(0.0)..=stop.unwrap_or(f64::INFINITY));
    for event in recording {
        let event = event?;
        let first_ns = *first_ns.get_or_insert(event.time_ns);
        if span.contains(&(event.time_ns.saturating_sub(first_ns) as f64 * 1e-9)) {
            take(&event);
        }
    }
    Ok(())
}

fn text(value: impl Serialize) -> PyResult<String> {
    serde_json::to_string(&value).map_err(|error| refused(error.to_string()))
}

/// Bias, noise and references of a device that lies still; without a span, from its beginning for as long as it rests.
#[pyfunction]
pub(crate) fn calibrate_rest(
    py: Python<'_>,
    file: &RecordingFile,
    which: Option<&str>,
    start: Seconds,
    stop: Seconds,
) -> PyResult<String> {
    check_span(start, stop)?;
    let source = which.map(magnetometer).transpose()?;
    let (mut recording, name) = file.opened()?;
    let span = Span {
        from_s: start,
        to_s: stop,
    };
    let made = py.detach(|| rest::calibrate(recording.by_ref(), span, source));
    let made = made.map_err(|error| of_run(&error, &format!("{name}: no calibration")))?;
    let [from_s, to_s] = made.span_s;
    text(
        json!({"recording": name, "from_s": from_s, "to_s": to_s, "calibration": made.calibration}),
    )
}

/// Hard and soft iron of a device that is turned in all directions.
#[pyfunction]
pub(crate) fn calibrate_magnetometer(
    py: Python<'_>,
    file: &RecordingFile,
    which: Option<&str>,
    field_strength_ut: Option<f64>,
    start: Seconds,
    stop: Seconds,
) -> PyResult<String> {
    check_span(start, stop)?;
    let source = which.map(magnetometer).transpose()?;
    let (mut recording, name) = file.opened()?;
    let mut samples = FieldSamples::default();
    let read = py.detach(|| of_span(&mut recording, (start, stop), |event| samples.add(event)));
    read.map_err(|error| of_recording(&error))?;
    let limits = MagnetometerLimits {
        field_strength_ut,
        ..MagnetometerLimits::default()
    };
    let report = py.detach(|| samples.calibrate(source, &limits));
    let report = report.map_err(|error| of_run(&error, &name))?;
    text(json!({
        "recording": name,
        "duration_s": report.duration_s,
        "sentences": report.sentences,
        "issues": recording.issues().sentences(),
        "calibration": report.field,
    }))
}

/// Allan deviation of a sensor at rest, and the noise that its slopes show.
#[pyfunction]
pub(crate) fn calibrate_allan(
    py: Python<'_>,
    file: &RecordingFile,
    sensor: &str,
    start: Seconds,
    stop: Seconds,
) -> PyResult<String> {
    check_span(start, stop)?;
    let sensors = [
        SensorKind::Gyroscope,
        SensorKind::Accelerometer,
        SensorKind::Magnetometer,
        SensorKind::MagnetometerUncalibrated,
    ];
    let kind = sensors
        .into_iter()
        .find(|kind| kind.name() == sensor)
        .ok_or_else(|| {
            let names = sensors.map(SensorKind::name).join(", ");
            refused(format!("sensor=\"{sensor}\": expected one of: {names}"))
        })?;
    let (mut recording, name) = file.opened()?;
    let mut samples = RestSamples::new(kind);
    let read = py.detach(|| {
        of_span(&mut recording, (start, stop), |event| {
            samples.add_event(event);
        })
    });
    read.map_err(|error| of_recording(&error))?;
    let config = AllanConfig {
        sensor: kind,
        ..AllanConfig::default()
    };
    let report = py.detach(|| analyze(&samples, &config));
    let mut report =
        report.map_err(|error| refused(format!("{name}: Allan deviation: {error}")))?;
    report.sentences.extend(recording.issues().sentences());
    text(report)
}

/// Noise parameters of an estimator by the likelihood of its innovations, a part held out.
#[pyfunction]
pub(crate) fn tune(
    py: Python<'_>,
    file: &RecordingFile,
    estimator: Option<&str>,
    profile: Option<&str>,
    parameters: Vec<String>,
    fitted_share: f64,
) -> PyResult<String> {
    if !(0.1..=0.9).contains(&fitted_share) {
        return Err(refused(format!(
            "fit={fitted_share}: expected a share from 0.1 to 0.9, e.g. 0.6"
        )));
    }
    let unusable = |error: EvaluationError| refused(error.to_string());
    let named = estimator.map(str::parse::<RunEstimator>).transpose();
    let named = named.map_err(refused)?;
    let profile = profile.map(str::parse::<Profile>).transpose();
    let profile = profile.map_err(unusable)?;
    let (mut recording, name) = file.opened()?;
    let asked = TuneOptions {
        parameters,
        fitted_share,
        ..TuneOptions::default()
    };
    let events: Result<Vec<Event>, _> = py.detach(|| recording.by_ref().collect());
    let events = events.map_err(|error| of_recording(&error))?;
    let metadata = recording.metadata();
    let has_fixes = recording.sensors().contains(&SensorKind::GnssPosition);
    let by_default = has_fixes.then_some(RunEstimator::Navigation(NavigationKind::ErrorState));
    let outcome = match named.or(by_default) {
        Some(RunEstimator::Navigation(kind)) => {
            if profile.is_some() {
                return Err(refused(format!(
                    "profile=: `{kind}` has no profiles; leave it out"
                )));
            }
            let options = NavigationOptions::of_recording(kind, metadata);
            let world = metadata.frames();
            py.detach(|| fit_navigation::tune(&events, world, &options, &asked, &|| true))
        }
        attitude => {
            let kind = match attitude {
                Some(RunEstimator::Attitude(kind)) => Some(kind),
                _ => None,
            };
            let profile = profile.unwrap_or_default();
            let mut options = RunOptions::new(kind.unwrap_or(profile.estimator()), profile);
            options.choose_magnetometer = true;
            options.world_frame = metadata.world_frame;
            py.detach(|| fit_attitude::tune(&events, &options, &asked, &|| true))
        }
    };
    text(outcome.map_err(|error| of_run(&error, &name))?)
}
