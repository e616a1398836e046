//! One device in the lab: its events in, estimates, innovations, calibration and experiment out.
//!
//! Everything here runs on sensor time and on nothing else: the same events and the same settings
//! in the same order give the same numbers to the bit, whenever and however fast they arrive.

pub mod aids;
mod aside;
pub mod bounded_velocity;
pub mod calibration;
pub mod experiment;
pub mod field;
pub mod frame;
pub mod health;
pub mod intake;
pub mod magnetometer;
pub mod raw;
mod resume;
pub mod span;
pub mod subject;
pub mod track;
pub mod waiting;

use nalgebra::{UnitQuaternion, Vector3};
use northing_core::attitude::driver::DriverConfig;
use northing_core::calibration::RestCalibration;
use northing_core::calibration::magnetometer::MagnetometerCalibration;
use northing_core::faults::FaultKind;
use northing_core::geometry::frames::TangentFrame;
use northing_evaluation::attitude::calibrated_start::{calibrated_driver, state_at_rest};
use northing_evaluation::attitude::kinds::EstimatorKind;
use northing_evaluation::attitude::options::{RunOptions, SensorSelection};
use northing_evaluation::attitude::own;
use northing_evaluation::attitude::parameters::Parameters;
use northing_evaluation::statistics::faults::sentence_now;
use northing_evaluation::{EvaluationError, Profile};
use northing_recording::{Event, Sample, SensorKind, WorldFrame};
use serde_json::{Map, Value};

use aids::AIDS;
use calibration::{BROWSER_STEPS, CalibrationRun};
use experiment::{Experiment, ExperimentRun};
use intake::{Admission, Intake};
use magnetometer::{MagnetometerAction, MagnetometerRun};
use northing_evaluation::statistics::lamp::{Remark, Tone};
use raw::Raw;
use subject::Judged;
use track::Track;
use waiting::Waiting;

/// A pause of the gyroscope after which a filter starts again rather than guesses, ns.
const RESTART_GAP_NS: i64 = 2_000_000_000;
/// Faults of the samples are told no more often than this, ns.
const FAULT_NOTE_NS: i64 = 5_000_000_000;

/// Something that came to its end while events were taken.
#[derive(Debug)]
pub enum Happening {
    /// The calibration is made, or was refused with this reason.
    Calibrated(
        Box<CalibrationRun>,
        Result<Box<RestCalibration<f64>>, String>,
    ),
    /// The experiment has all its samples.
    Experimented(Box<Experiment>),
    /// The magnetometer calibration was begun, ended, dropped or taken back.
    Magnetometer(MagnetometerAction, Remark),
    /// What was under way ended for want of samples, with the reason in sentences.
    GaveUp(String),
    /// Something to tell people.
    Note(Remark),
    /// A note of this text is not true any more.
    Over(String),
}

/// One device. See the [module](self).
#[derive(Debug)]
pub struct DeviceSession {
    options: RunOptions,
    tracks: Vec<Track>,
    intake: Intake,
    first_ns: Option<i64>,
    now_ns: i64,
    last_gyroscope_ns: Option<i64>,
    /// When a fault of the samples was told last.
    last_fault_ns: Option<i64>,
    /// The time that the estimates are of.
    estimate_ns: i64,
    rate_rad_s: Vector3<f64>,
    device: Option<UnitQuaternion<f64>>,
    truth: Option<UnitQuaternion<f64>>,
    judged: Judged,
    raw: Raw,
    waiting: Waiting,
    calibration: Option<CalibrationRun>,
    experiment: Option<ExperimentRun>,
    magnetometer_run: Option<MagnetometerRun>,
    magnetometer: Option<MagnetometerCalibration<f64>>,
    /// Whether a browser reads the sensors.
    browser: bool,
}

impl DeviceSession {
    /// A device nothing has come from yet, with integration and `mekf` running.
    ///
    /// # Errors
    /// The options are invalid.
    pub fn new(options: RunOptions) -> Result<Self, EvaluationError> {
        options.check()?;
        let mut session = Self {
            judged: Judged::new(&options.config),
            raw: Raw::default(),
            waiting: Waiting::default(),
            options,
            tracks: Vec::new(),
            intake: Intake::default(),
            first_ns: None,
            now_ns: i64::MIN,
            last_gyroscope_ns: None,
            last_fault_ns: None,
            estimate_ns: i64::MIN,
            rate_rad_s: Vector3::zeros(),
            device: None,
            truth: None,
            calibration: None,
            experiment: None,
            magnetometer_run: None,
            magnetometer: None,
            browser: false,
        };
        let mut kinds = vec![EstimatorKind::Integration, EstimatorKind::Mekf];
        kinds.extend(own::registered());
        session.use_estimators(&kinds)?;
        Ok(session)
    }

    /// Takes a batch of events of any order; it is put in the order of time.
    pub fn take(&mut self, events: &mut [Event]) -> Vec<Happening> {
        events.sort_by_key(Event::place);
        let mut happenings = Vec::new();
        let mut admitted = Vec::new();
        for event in events.iter() {
            self.intake.admit(event, &mut admitted);
            for (admission, event) in admitted.drain(..) {
                self.admitted(admission, &event, &mut happenings);
            }
        }
        self.let_failed_go(&mut happenings);
        happenings
    }

    /// Lets estimators go that somebody brought along and that have failed; the others go on as if they had never been.
    fn let_failed_go(&mut self, happenings: &mut Vec<Happening>) {
        let failed: Vec<String> = self.tracks.iter().filter_map(Track::failure).collect();
        if failed.is_empty() {
            return;
        }
        self.tracks.retain(|track| track.failure().is_none());
        self.renew_subject();
        let told = failed.into_iter().map(|sentence| {
            let text = format!("{sentence}. It is left out from here on.");
            Happening::Note(Remark::new(Tone::Bad, &text))
        });
        happenings.extend(told);
    }

    fn admitted(&mut self, admission: Admission, event: &Event, happenings: &mut Vec<Happening>) {
        match admission {
            Admission::Taken => self.take_one(event, happenings),
            // Good for the recording, which is put in order at its end.
            Admission::Late => self.record_late(&self.calibrated(event)),
            Admission::Duplicate | Admission::Refused => {}
            Admission::Unbelieved => happenings.push(note(
                "Readings stamped seconds ahead of all others were left out: check the device's clock.",
            )),
            Admission::NewStart => {
                // What an experiment has so far is worth keeping.
                happenings.extend(self.end_experiment());
                self.start_again();
                happenings.push(note("The device's clock went back: its estimates start anew."));
            }
        }
    }

    /// The device's clock may begin anew with the next event: a page was loaded, an app started.
    pub fn expect_new_clock(&mut self) {
        self.intake.expect_new_clock();
    }

    /// Says whether a browser reads the sensors: browsers round.
    pub fn read_by_browser(&mut self, browser: bool) {
        self.browser = browser;
    }

    /// Takes events of messages that had been given up: for an experiment, not for the estimates,
    /// which have gone on without them.
    pub fn take_late(&mut self, events: &[Event]) {
        for event in events {
            if self.intake.admit_late(event) {
                self.record_late(&self.calibrated(event));
            }
        }
    }

    fn take_one(&mut self, event: &Event, happenings: &mut Vec<Happening>) {
        self.first_ns.get_or_insert(event.time_ns);
        self.now_ns = self.now_ns.max(event.time_ns);
        self.raw
            .add(seconds_since(self.first_ns, event.time_ns), event);
        self.gather(event);
        let event = &self.calibrated(event);
        match event.sample {
            Sample::AngularRate(rate) => self.take_rate(event.time_ns, rate, happenings),
            Sample::SpecificForce(_) | Sample::MagneticField(_) | Sample::CompassHeading(_) => {
                self.update(event);
            }
            Sample::MagneticFieldUncalibrated(_) => self.expect_hard_iron(),
            Sample::DeviceOrientation(q) => self.device = Some(q),
            Sample::Reference(reference) => {
                self.truth = Some(reference.attitude);
                self.compare_with_truth(event.time_ns, &reference.attitude);
            }
            _ => {}
        }
        self.calibrate_with(event, happenings);
        self.record(event, happenings);
    }

    fn take_rate(&mut self, time_ns: i64, rate: Vector3<f64>, happenings: &mut Vec<Happening>) {
        if let Some(last) = self.last_gyroscope_ns
            && time_ns.saturating_sub(last) > RESTART_GAP_NS
        {
            let seconds = time_ns.saturating_sub(last) as f64 * 1e-9;
            // Samples may have been lost, or the device's clock was set: stamps do not tell.
            let text = format!(
                "The gyroscope's time stamps leap by {seconds:.1} s: the estimates start anew."
            );
            happenings.push(Happening::Note(Remark::new(Tone::Warn, text)));
            // Options were checked when they were set.
            let _ = self.restart_tracks();
        }
        self.last_gyroscope_ns = Some(time_ns);
        self.estimate_ns = time_ns;
        self.rate_rad_s = rate;
        for track in &mut self.tracks {
            track.driver.gyroscope(time_ns, &rate);
        }
        self.note_faults(time_ns, happenings);
        self.begin_experiment(time_ns, &rate);
    }

    /// Tells of faults that the subject's driver has found, no more often than a reader can follow.
    fn note_faults(&mut self, time_ns: i64, happenings: &mut Vec<Happening>) {
        let subject = self.subject();
        for track in &mut self.tracks {
            while let Some(fault) = track.driver.take_fault() {
                let is_new = !fault.is_over || fault.kind == FaultKind::Spike;
                let last_ns = self.last_fault_ns.unwrap_or(i64::MIN);
                let is_due = time_ns.saturating_sub(last_ns) > FAULT_NOTE_NS;
                let lasted = matches!(
                    fault.kind,
                    FaultKind::Stuck | FaultKind::Noise | FaultKind::Saturated
                );
                if Some(track.kind) == subject && fault.is_over && lasted {
                    happenings.push(Happening::Over(sentence_now(&fault)));
                }
                if Some(track.kind) == subject && is_new && is_due {
                    self.last_fault_ns = Some(time_ns);
                    let remark = Remark::new(Tone::Warn, sentence_now(&fault));
                    happenings.push(Happening::Note(remark));
                }
            }
        }
    }

    /// An experiment begins with a gyroscope sample: every estimator starts anew from the state it
    /// has then, as it will when the experiment is run again, so that both give the same numbers.
    fn begin_experiment(&mut self, time_ns: i64, rate: &Vector3<f64>) {
        let (config, driver) = (self.config(), self.driver());
        let Some(run) = self.experiment.as_mut().filter(|run| !run.has_begun()) else {
            return;
        };
        let mut starts = Vec::new();
        for track in &mut self.tracks {
            // Options were checked when they were set.
            if let Ok(Some(mut anew)) = Track::new(track.kind, &config, driver) {
                if let Some(state) = track.state() {
                    anew.driver.start_from(&state);
                    anew.has_field = track.has_field;
                    starts.push((track.kind, state));
                }
                anew.driver.gyroscope(time_ns, rate);
                *track = anew;
            }
        }
        run.begin(time_ns, starts);
    }

    fn update(&mut self, event: &Event) {
        let (time_ns, sensor) = (event.time_ns, event.sample.kind());
        let aid = AIDS.iter().find(|aid| aid.sensor == sensor);
        if !aid.is_some_and(|aid| self.uses(aid)) {
            return;
        }
        self.estimate_ns = self.estimate_ns.max(time_ns);
        let subject = self.subject();
        let mut judged = None;
        for track in &mut self.tracks {
            let driver = &mut track.driver;
            let innovation = match &event.sample {
                Sample::SpecificForce(v) => driver.accelerometer(time_ns, v),
                Sample::MagneticField(v) => {
                    track.has_field = true;
                    driver.magnetometer(time_ns, v)
                }
                Sample::CompassHeading(c) => driver.compass(time_ns, c.heading_rad, c.std_rad),
                _ => continue,
            };
            if Some(track.kind) == subject {
                judged = Some(innovation);
            }
        }
        if let Some(innovation) = judged {
            self.judge(event, &innovation);
        }
    }

    fn calibrate_with(&mut self, event: &Event, happenings: &mut Vec<Happening>) {
        let Some(run) = &mut self.calibration else {
            return;
        };
        if !run.add(event) {
            return;
        }
        let Some(mut run) = self.calibration.take() else {
            return;
        };
        run.know_resolutions(&self.resolutions());
        let made = run.finish();
        if let Ok(calibration) = &made {
            self.start_from(calibration);
        }
        happenings.push(Happening::Calibrated(Box::new(run), made.map(Box::new)));
    }

    /// The steps to which the sensors are known to be rounded.
    fn resolutions(&self) -> Vec<(SensorKind, f64)> {
        let browser = BROWSER_STEPS.into_iter().filter(|_| self.browser);
        self.intake.resolutions().chain(browser).collect()
    }

    fn record(&mut self, event: &Event, happenings: &mut Vec<Happening>) {
        let Some(run) = &mut self.experiment else {
            return;
        };
        if run.add(event) {
            happenings.extend(self.end_experiment());
        }
    }

    fn record_late(&mut self, event: &Event) {
        if let Some(run) = &mut self.experiment {
            run.add_late(event);
        }
    }

    fn end_experiment(&mut self) -> Option<Happening> {
        let experiment = self.experiment.take()?.finish();
        Some(Happening::Experimented(Box::new(experiment)))
    }

    /// Every estimator starts from the rest that has just ended.
    fn start_from(&mut self, calibration: &RestCalibration<f64>) {
        self.options.calibration = Some(*calibration);
        if self.restart_tracks().is_err() {
            return;
        }
        let (config, driver) = (self.config(), self.driver());
        let initial = state_at_rest(calibration, &config.attitude, &driver);
        for track in &mut self.tracks {
            track.driver.start_from(&initial);
            track.has_field = calibration.magnetic_field_ut().is_some();
        }
    }

    fn start_again(&mut self) {
        self.first_ns = None;
        self.raw.clear();
        self.now_ns = i64::MIN;
        self.last_gyroscope_ns = None;
        self.estimate_ns = i64::MIN;
        self.calibration = None;
        self.experiment = None;
        self.magnetometer_run = None;
        (self.device, self.truth) = (None, None);
        // Options were checked when they were set.
        let _ = self.restart_tracks();
    }

    fn restart_tracks(&mut self) -> Result<(), EvaluationError> {
        let (config, driver) = (self.config(), self.driver());
        let kinds = self.tracks.iter().map(|track| track.kind);
        let tracks: Result<Vec<_>, _> = kinds
            .map(|kind| Track::new(kind, &config, driver))
            .collect();
        self.tracks = tracks?.into_iter().flatten().collect();
        self.judged.reset(&config);
        Ok(())
    }

    /// Chooses the estimators that run; those already running go on undisturbed.
    ///
    /// # Errors
    /// A parameter is invalid.
    pub fn use_estimators(&mut self, kinds: &[EstimatorKind]) -> Result<(), EvaluationError> {
        let (config, driver) = (self.config(), self.driver());
        let runs = |kind: &EstimatorKind| self.tracks.iter().any(|track| track.kind == *kind);
        let new = kinds.iter().filter(|kind| !runs(kind));
        let made: Result<Vec<_>, _> = new.map(|kind| Track::new(*kind, &config, driver)).collect();
        let mut all = std::mem::take(&mut self.tracks);
        match made {
            Ok(made) => all.extend(made.into_iter().flatten()),
            Err(error) => {
                self.tracks = all;
                return Err(error);
            }
        }
        for kind in kinds {
            let place = all.iter().position(|track| track.kind == *kind);
            self.tracks.extend(place.map(|place| all.remove(place)));
        }
        self.renew_subject();
        self.note_change("the choice of estimators");
        Ok(())
    }

    /// Changes profile and parameters; the estimates go on from where they are.
    ///
    /// # Errors
    /// A name or value does not fit; nothing has changed then.
    pub fn set(
        &mut self,
        profile: Option<Profile>,
        settings: &Map<String, Value>,
    ) -> Result<(), EvaluationError> {
        let changed = with_settings(&self.options, profile, settings)?;
        let before = std::mem::replace(&mut self.options, changed);
        self.expect_hard_iron();
        let config = self.config();
        let retuned: Result<Vec<_>, _> = self.tracks.iter().map(|t| t.retuned(&config)).collect();
        match retuned {
            Ok(retuned) => {
                for (track, estimator) in self.tracks.iter_mut().zip(retuned) {
                    if let Some(estimator) = estimator {
                        track.driver.replace_estimator(estimator);
                    }
                }
            }
            Err(error) => {
                self.options = before;
                return Err(error);
            }
        }
        self.judged.reset(&self.config());
        self.note_change("Q, R or another parameter");
        Ok(())
    }

    /// Chooses the sensors that the filters use.
    pub fn use_sensors(&mut self, sensors: SensorSelection) {
        self.options.sensors = sensors;
        self.judged.reset(&self.config());
        self.note_change("the sensors in use");
    }

    /// The result of an experiment is made with what is in force at its end.
    fn note_change(&mut self, what: &'static str) {
        if let Some(run) = &mut self.experiment {
            run.note_change(what);
        }
    }

    /// Begins a calibration with the next sample; one under way is dropped.
    ///
    /// # Errors
    /// The time is no time one can rest for, or an experiment is under way, in a sentence.
    pub fn calibrate(&mut self, seconds: f64) -> Result<(), String> {
        if self.experiment.is_some() {
            return Err("an experiment is under way; stop it first".to_owned());
        }
        let [shortest, longest] = calibration::SECONDS;
        if !(shortest..=longest).contains(&seconds) {
            return Err(format!(
                "calibration of {seconds} s: expected {shortest} to {longest} s"
            ));
        }
        self.calibration = Some(CalibrationRun::new(seconds, self.options.sensors));
        Ok(())
    }

    /// Begins an experiment with the next gyroscope sample.
    ///
    /// # Errors
    /// One is under way, or the time is invalid, in a sentence.
    pub fn start_experiment(&mut self, seconds: f64, name: &str) -> Result<(), String> {
        if self.experiment.is_some() {
            return Err("an experiment is under way; stop it first".to_owned());
        }
        let run = ExperimentRun::new(seconds, name)?;
        self.experiment = Some(run);
        Ok(())
    }

    /// Ends an experiment early, drops one that has not begun, and drops a calibration.
    pub fn stop(&mut self) -> Option<Happening> {
        self.calibration = None;
        if self.experiment.as_ref().is_some_and(|run| !run.has_begun()) {
            self.experiment = None;
        }
        self.end_experiment()
    }

    /// The options in force: what an experiment is run with.
    #[must_use]
    pub fn options(&self) -> &RunOptions {
        &self.options
    }

    /// The estimators that run, in order.
    #[must_use]
    pub fn estimators(&self) -> Vec<EstimatorKind> {
        self.tracks.iter().map(|track| track.kind).collect()
    }

    /// The calibration under way.
    #[must_use]
    pub fn calibration(&self) -> Option<&CalibrationRun> {
        self.calibration.as_ref()
    }

    /// The experiment under way.
    #[must_use]
    pub fn experiment(&self) -> Option<&ExperimentRun> {
        self.experiment.as_ref()
    }

    /// What has arrived.
    #[must_use]
    pub fn intake(&self) -> &Intake {
        &self.intake
    }

    /// Seconds of samples since the start.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        seconds_since(self.first_ns, self.now_ns)
    }

    /// The parameters in force: the profile's, the calibration's, the user's.
    #[must_use]
    pub fn config(&self) -> Parameters {
        self.options.in_force().config
    }

    fn driver(&self) -> DriverConfig<f64> {
        if let Some(calibration) = &self.options.calibration {
            return calibrated_driver(&self.options, calibration);
        }
        let mut driver = self.options.driver;
        driver.prior.frame = match self.options.world_frame {
            WorldFrame::Enu => TangentFrame::Enu,
            WorldFrame::Ned => TangentFrame::Ned,
        };
        driver
    }
}

/// Options with another profile and other parameters.
///
/// # Errors
/// A name or value does not fit.
pub fn with_settings(
    options: &RunOptions,
    profile: Option<Profile>,
    settings: &Map<String, Value>,
) -> Result<RunOptions, EvaluationError> {
    let mut changed = options.clone();
    if let Some(profile) = profile {
        changed.profile = profile;
        changed.config = profile.config();
        changed.origins.clear();
    }
    for (name, value) in settings {
        let text = value
            .as_str()
            .map_or_else(|| value.to_string(), str::to_owned);
        changed.set(&format!("{name}={text}"))?;
    }
    Ok(changed)
}

fn note(text: &str) -> Happening {
    Happening::Note(Remark::new(Tone::Warn, text))
}

fn seconds_since(first_ns: Option<i64>, time_ns: i64) -> f64 {
    first_ns.map_or(0.0, |first| time_ns.saturating_sub(first) as f64 * 1e-9)
}

#[cfg(test)]
mod tests;
#[cfg(test)]
mod truth_tests;
