//! Runs one estimator over a stream of events and says how good it was.
//!
//! Events of one instant are taken together, gyroscope first, and the estimate is scored after all
//! of them. Memory does not grow with the recording, unless smoothing asks for it.

mod position_observer;

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::attitude::bounded_velocity::BoundedVelocity;
use northing_core::attitude::driver::AttitudeDriver;
use northing_core::attitude::{AttitudeEstimator, Propagation};
use northing_core::calibration::RestCalibration;
use northing_recording::{Event, Recording, SensorKind};

use crate::attitude::calibrated_start::{self, CalibrationPhase};
use crate::attitude::device;
use crate::attitude::first_look::FirstLook;
use crate::attitude::reference::{Aligned, ReferenceUse};
use crate::attitude::rts_smoother::bounded_velocity::Steps;
use crate::attitude::rts_smoother::{Recorder, Smoother};
use crate::attitude::tally::Tally;
use crate::attitude::{
    AnyEstimator, CascadeRotation, EstimateRecord, EstimatorKind, InnovationRecord, Instant,
    InstantSource, Instants, Parameters, PositionRecord, RunObserver, RunOptions, RunSummary,
};
use crate::error::EvaluationError;
use crate::events::{Events, of_one_error};
use position_observer::PositionObserver;

/// Runs the estimator of `options` over `events`, which must be in time order.
///
/// # Errors
/// The options are invalid, the events end in an error, a calibration is refused, or there was
/// nothing to estimate: see [`EvaluationError`].
pub fn run<I, X>(
    events: I,
    options: &RunOptions,
    observer: &mut dyn RunObserver,
) -> Result<RunSummary, EvaluationError>
where
    I: IntoIterator<Item = Result<Event, X>>,
    X: std::error::Error + Send + Sync + 'static,
{
    run_whole(&mut of_one_error(events), options, observer)
}

fn run_whole(
    events: &mut Events<'_>,
    options: &RunOptions,
    observer: &mut dyn RunObserver,
) -> Result<RunSummary, EvaluationError> {
    let summary = run_with(events, options, observer, Tally::new)?;
    if summary.estimates == 0 {
        return Err(nothing_estimated(&summary, options));
    }
    Ok(summary)
}

/// Runs over a recording and takes name, world frame and issues from it.
///
/// # Errors
/// As [`run`].
pub fn run_recording(
    recording: &mut Recording,
    options: &RunOptions,
    observer: &mut dyn RunObserver,
) -> Result<RunSummary, EvaluationError> {
    let options = options_for(recording, options);
    let mut summary = run(&mut *recording, &options, observer)?;
    summary.issues.splice(0..0, recording.issues().sentences());
    Ok(summary)
}

/// Runs the estimator of `options` as [`run`] does and tells the observer the same estimates and innovations, but counts, scores and
/// judges nothing: how many estimates there were, in less than half of the time.
///
/// # Errors
/// The options are invalid, the events end in an error, or a calibration is refused.
pub fn estimate<I, X>(
    events: I,
    options: &RunOptions,
    observer: &mut dyn RunObserver,
) -> Result<u64, EvaluationError>
where
    I: IntoIterator<Item = Result<Event, X>>,
    X: std::error::Error + Send + Sync + 'static,
{
    let events = &mut of_one_error(events);
    Ok(run_with(events, options, observer, Tally::idle)?.estimates)
}

/// As [`estimate`], over instants that somebody has gathered and checked already.
///
/// # Errors
/// As [`estimate`].
pub fn estimate_instants(
    instants: &mut dyn InstantSource,
    options: &RunOptions,
    observer: &mut dyn RunObserver,
) -> Result<u64, EvaluationError> {
    Ok(over_instants(instants, options, observer, Tally::idle)?.estimates)
}

/// The options with what the recording says about itself.
pub(crate) fn options_for(recording: &Recording, options: &RunOptions) -> RunOptions {
    RunOptions {
        recording: recording.metadata().name.clone(),
        world_frame: recording.metadata().world_frame,
        ..options.clone()
    }
}

/// As [`run`], but a recording in which there is nothing to estimate is no error.
pub(crate) fn run_leniently(
    recording: &mut Recording,
    options: &RunOptions,
    observer: &mut dyn RunObserver,
) -> Result<RunSummary, EvaluationError> {
    run_with(&mut of_one_error(recording), options, observer, Tally::new)
}

/// What counts, scores and judges a run.
type MakeTally = fn(&RunOptions) -> Tally;

fn run_with(
    events: &mut Events<'_>,
    options: &RunOptions,
    observer: &mut dyn RunObserver,
    tally: MakeTally,
) -> Result<RunSummary, EvaluationError> {
    let ignored = options.reference == ReferenceUse::Ignored;
    // A loop, where `filter` and `map` would hand every event on by value twice more.
    let events = std::iter::from_fn(|| {
        loop {
            match events.next()? {
                Ok(event) if ignored && is_reference(&event) => {}
                event => return Some(event.map(|event| options.calibrated(event))),
            }
        }
    });
    let events = Aligned::new(events, options.reference.alignment());
    over_instants(&mut Instants::new(events), options, observer, tally)
}

/// Runs over messages as they come: the events of each have one stamp and are taken at once. An estimate does not wait for
/// the sample behind it, as those of [`run`] must, which cannot know that an instant is whole. A run that estimates nothing
/// is no error.
///
/// # Errors
/// The options are invalid, or the messages end in an error.
pub fn run_live<M, X>(
    messages: impl IntoIterator<Item = Result<M, X>>,
    options: &RunOptions,
    observer: &mut dyn RunObserver,
) -> Result<RunSummary, EvaluationError>
where
    M: IntoIterator<Item = Event>,
    X: std::error::Error + Send + Sync + 'static,
{
    let mut instants = messages.into_iter().map(|message| {
        let events = message.map_err(|error| EvaluationError::Recording(Box::new(error)))?;
        let calibrated = events.into_iter().map(|event| options.calibrated(event));
        Ok(Instant::of(calibrated))
    });
    over_instants(&mut instants, options, observer, Tally::new)
}

fn over_instants(
    instants: &mut dyn InstantSource,
    options: &RunOptions,
    observer: &mut dyn RunObserver,
    tally: MakeTally,
) -> Result<RunSummary, EvaluationError> {
    options.check()?;
    let mut instants = FirstLook::new(instants, options);
    let options = &instants.options(options);
    let said = instants.sentence();
    let mut summary = match options.estimator {
        EstimatorKind::Device => device::run(&mut instants, options, observer),
        EstimatorKind::Mekf if options.smooth => {
            let make = |config: &Parameters| Ok(Recorder::new(config.attitude)?);
            run_smoothed(&mut instants, options, observer, (&make, tally))
        }
        EstimatorKind::BoundedVelocity if options.smooth => {
            let make = |config: &Parameters| {
                let steps = Steps::default();
                Ok(BoundedVelocity::observed(config.bounded_velocity, steps)?)
            };
            run_smoothed(&mut instants, options, observer, (&make, tally))
        }
        kind => run_filter(&mut instants, options, observer, (kind, tally)),
    }?;
    if let Some(problem) = summary.reference.as_ref().and_then(|r| r.problem) {
        return Err(EvaluationError::Reference(Box::new(problem)));
    }
    summary.issues.extend(said);
    Ok(summary)
}

fn is_reference(event: &Event) -> bool {
    event.sample.kind() == SensorKind::Reference
}

pub(crate) fn nothing_estimated(summary: &RunSummary, options: &RunOptions) -> EvaluationError {
    if options.estimator == EstimatorKind::Device {
        return EvaluationError::NoDeviceOrientation;
    }
    if !summary
        .samples_per_sensor
        .contains_key(&SensorKind::Gyroscope)
    {
        return EvaluationError::NoGyroscope;
    }
    // Without an accelerometer the driver waits four times as long for one.
    let patience = if summary.unobservable.is_empty() {
        1.0
    } else {
        4.0
    };
    let needed = options
        .calibrate_first_s
        .unwrap_or(options.driver.alignment_s * patience);
    EvaluationError::TooShort {
        seconds: summary.duration_s,
        needed,
    }
}

fn run_filter(
    instants: &mut dyn InstantSource,
    options: &RunOptions,
    observer: &mut dyn RunObserver,
    (kind, tally): (EstimatorKind, MakeTally),
) -> Result<RunSummary, EvaluationError> {
    let make = |config: &Parameters| {
        AnyEstimator::new(kind, config)?.ok_or(EvaluationError::NoDeviceOrientation)
    };
    let mut session = Session::new(options, &make, tally)?;
    if kind.uses_positions() {
        let rotation = match options.config.rotation {
            CascadeRotation::Estimated => AnyEstimator::attitude,
            CascadeRotation::Reconstructed => AnyEstimator::reconstructed,
        };
        session.positions = Some(PositionObserver::new(options, rotation)?);
    }
    let mut instant = Instant::default();
    while instants.read(&mut instant)? {
        let has_estimate = session.step(&instant, observer)?;
        let Phase::Running(driver) = &session.phase else {
            continue;
        };
        if let Some(sentence) = driver.estimator.failure() {
            return Err(EvaluationError::OwnEstimator { sentence });
        }
        if has_estimate {
            let record = session.record(&instant, &driver.estimator);
            session.tally.estimated(&record, observer);
        }
    }
    let mut summary = session.summary();
    if let Some(positions) = &session.positions {
        positions.conclude(&mut summary);
    }
    Ok(summary)
}

/// Forward with a filter that remembers, then backward; the estimates told and scored are smoothed.
fn run_smoothed<S: Smoother>(
    instants: &mut dyn InstantSource,
    options: &RunOptions,
    observer: &mut dyn RunObserver,
    (make, tally): (Make<'_, S>, MakeTally),
) -> Result<RunSummary, EvaluationError> {
    let mut session = Session::new(options, make, tally)?;
    let mut records: Vec<(EstimateRecord, usize)> = Vec::new();
    let mut instant = Instant::default();
    while instants.read(&mut instant)? {
        let has_estimate = session.step(&instant, observer)?;
        if let Phase::Running(driver) = &session.phase
            && has_estimate
        {
            let record = session.record(&instant, &driver.estimator);
            records.push((record, driver.estimator.node()));
        }
    }
    let smoothed = match &session.phase {
        Phase::Running(driver) => driver.estimator.smooth(),
        Phase::Calibrating(_) => Vec::new(),
    };
    for (mut record, node) in records {
        let known = S::smoothed_estimate(&smoothed[node], &record.attitude);
        record.attitude = known.attitude;
        record.attitude_covariance = Some(known.attitude_covariance);
        record.gyroscope_bias = Some((known.gyroscope_bias, known.bias_covariance));
        session.tally.estimated(&record, observer);
    }
    Ok(session.summary())
}

/// Makes an estimator once its parameters are known.
type Make<'a, E> = &'a dyn Fn(&Parameters) -> Result<E, EvaluationError>;

/// One estimator on its way through one recording.
struct Session<'a, E> {
    options: &'a RunOptions,
    make: Make<'a, E>,
    phase: Phase<E>,
    /// What is behind the attitude, for estimators that use positions.
    positions: Option<PositionObserver<E>>,
    tally: Tally,
    device: Option<UnitQuaternion<f64>>,
    has_magnetometer: bool,
    /// Since when a hard iron is estimated that the settings did not expect, s.
    iron_from_s: Option<f64>,
}

enum Phase<E> {
    /// The device rests; nothing is estimated.
    Calibrating(Box<CalibrationPhase>),
    /// The estimator aligns itself and runs.
    Running(Box<AttitudeDriver<f64, E>>),
}

impl<'a, E: AttitudeEstimator<f64>> Session<'a, E> {
    fn new(
        options: &'a RunOptions,
        make: Make<'a, E>,
        tally: MakeTally,
    ) -> Result<Self, EvaluationError> {
        let in_force = options.in_force();
        let mut tally = tally(options);
        tally.configured(&in_force, options.calibration.as_ref());
        let phase = match options.calibrate_first_s {
            Some(seconds) => {
                Phase::Calibrating(Box::new(CalibrationPhase::new(seconds, options.sensors)))
            }
            None => begun(&in_force, make)?,
        };
        Ok(Self {
            options,
            make,
            phase,
            positions: None,
            tally,
            device: None,
            // A state that is taken over knows whether there was one.
            has_magnetometer: options
                .start
                .as_ref()
                .is_some_and(|start| start.references.magnetic_field.is_some()),
            iron_from_s: None,
        })
    }

    /// Takes one instant; whether it has a gyroscope sample and there is an estimate.
    fn step(
        &mut self,
        instant: &Instant,
        observer: &mut dyn RunObserver,
    ) -> Result<bool, EvaluationError> {
        let sensors = &self.options.sensors;
        let force = instant.specific_force.filter(|_| sensors.accelerometer);
        let field = calibrated_start::chosen_field(instant, sensors);
        self.has_magnetometer |=
            instant.magnetic_field.is_some() || instant.magnetic_field_uncalibrated.is_some();
        let compass = instant
            .compass
            .filter(|_| sensors.compass.applies(self.has_magnetometer));
        self.tally.read(instant, force, field);
        if instant.device.is_some() {
            self.device = instant.device;
        }
        if self.calibrates(instant, force, field)? {
            return Ok(false);
        }
        let Phase::Running(driver) = &mut self.phase else {
            return Ok(false);
        };
        let time_ns = instant.time_ns;
        let time_s = self.tally.time_s(time_ns);
        let rate = instant.angular_rate;
        let propagation = rate.map(|rate| driver.gyroscope(time_ns, &rate));
        let mut tell = |sensor, innovation| {
            let record = InnovationRecord {
                time_ns,
                time_s,
                sensor,
                innovation,
            };
            self.tally.updated(&record);
            observer.innovation(&record);
        };
        if let Some(force) = &force {
            let innovation = driver.accelerometer(time_ns, force);
            tell(SensorKind::Accelerometer, innovation);
        }
        if let Some(field) = &field {
            let innovation = driver.magnetometer(time_ns, field);
            tell(SensorKind::Magnetometer, innovation);
            if self.iron_from_s.is_none() && driver.estimator.unexpected_hard_iron_std().is_some() {
                self.iron_from_s = Some(time_s);
            }
        }
        if let Some(compass) = &compass {
            let innovation = driver.compass(time_ns, compass.heading_rad, compass.std_rad);
            tell(SensorKind::CompassHeading, innovation);
        }
        while let Some(fault) = driver.take_fault() {
            self.tally.faulted(&fault);
        }
        if let Some(propagation) = propagation {
            self.tally.propagated(propagation);
        }
        let turned = propagation == Some(Propagation::Done);
        if let Some(positions) = &mut self.positions
            && let Some((measured, innovation)) = positions.step(instant, force, turned, driver)
        {
            observer.position(&PositionRecord {
                time_ns,
                time_s,
                measured,
                innovation,
            });
        }
        if let Some(start) = driver.start() {
            self.tally.started(start);
        }
        Ok(turned && driver.is_started())
    }

    /// Whether the device still rests for the calibration, which takes the instant then; where that is over the estimator starts.
    fn calibrates(
        &mut self,
        instant: &Instant,
        force: Option<Vector3<f64>>,
        field: Option<Vector3<f64>>,
    ) -> Result<bool, EvaluationError> {
        let Phase::Calibrating(phase) = &mut self.phase else {
            return Ok(false);
        };
        if self.tally.time_s(instant.time_ns) < phase.seconds() {
            phase.add(instant);
            let rate = instant.angular_rate.is_some();
            self.tally
                .calibrated_with(rate, force.is_some(), field.is_some());
            if let Some(positions) = &mut self.positions {
                positions.wait(instant);
            }
            return Ok(true);
        }
        let calibration = phase.finish()?;
        let in_force = self.options.calibrated_by(&calibration);
        self.phase = started(&in_force, &calibration, self.make)?;
        self.tally.configured(&in_force, Some(&calibration));
        if let (Some(positions), Some(gravity)) = (&mut self.positions, calibration.gravity()) {
            positions.measured_gravity(gravity)?;
        }
        Ok(false)
    }

    /// How it went.
    fn summary(&self) -> RunSummary {
        let mut summary = self.tally.summary(self.options, true);
        summary.issues.extend(self.hard_iron_in_words());
        summary
    }

    /// What the estimator has found of the magnetometer that its settings did not expect.
    fn hard_iron_in_words(&self) -> Option<String> {
        let (from_s, Phase::Running(driver)) = (self.iron_from_s?, &self.phase) else {
            return None;
        };
        let iron = driver.estimator.hard_iron();
        let along = iron.try_normalize(0.0)?;
        let std = along.component_mul(&driver.estimator.unexpected_hard_iron_std()?);
        Some(format!(
            "From {from_s:.0} s on `{}` estimates a hard iron of the magnetometer that its settings do not expect: {:.1} uT \
             (± {:.1}) at the end. A calibration tells it from the start: northing calibrate magnetometer.",
            self.options.estimator.name(),
            iron.norm(),
            std.norm(),
        ))
    }

    /// The estimate at an instant, after its step.
    fn record(&self, instant: &Instant, estimator: &E) -> EstimateRecord {
        let place = self.positions.as_ref().and_then(PositionObserver::state);
        EstimateRecord {
            time_ns: instant.time_ns,
            time_s: self.tally.time_s(instant.time_ns),
            attitude: estimator.attitude(),
            attitude_covariance: estimator.attitude_covariance(),
            gyroscope_bias: estimator.gyroscope_bias(),
            position: place.map(|state| state.position),
            velocity: place.map(|state| state.velocity),
            reference: instant.reference,
            device: self.device,
        }
    }
}

/// An estimator at the first sample: in the state that is known, or about to align itself. `options` are in force.
fn begun<E: AttitudeEstimator<f64>>(
    options: &RunOptions,
    make: Make<'_, E>,
) -> Result<Phase<E>, EvaluationError> {
    let settings = match &options.calibration {
        Some(calibration) => calibrated_start::calibrated_driver(options, calibration),
        None => options.driver_config(),
    };
    let mut driver = AttitudeDriver::new(make(&options.config)?, settings);
    if let Some(start) = &options.start {
        driver.start_from(start);
    }
    Ok(Phase::Running(Box::new(driver)))
}

/// An estimator that starts from the rest that has just ended. `options` are in force.
fn started<E: AttitudeEstimator<f64>>(
    options: &RunOptions,
    calibration: &RestCalibration<f64>,
    make: Make<'_, E>,
) -> Result<Phase<E>, EvaluationError> {
    let settings = calibrated_start::calibrated_driver(options, calibration);
    let mut driver = AttitudeDriver::new(make(&options.config)?, settings);
    let noise = &options.config.attitude;
    driver.start_from(&calibrated_start::state_at_rest(
        calibration,
        noise,
        &settings,
    ));
    Ok(Phase::Running(Box::new(driver)))
}

#[cfg(test)]
mod tests;
