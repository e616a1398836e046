//! The task of one device: it alone touches the device's session, decoder and order of batches.

use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::body::Bytes;
use northing_evaluation::attitude::Parameters;
use northing_recording::wire::{WireError, WireFormat};
use tokio::sync::{mpsc, oneshot};
use tokio::time::MissedTickBehavior;

use crate::engine::DeviceEngine;
use crate::experiments::{self, Finished};
use crate::frames::FrameText;
use crate::lab::{Device, Lab, Queuing, lock};
use crate::messages::{Command, SensorUse, UnderWay};
use crate::persistence::{CalibrationTimes, SavedDevice};
use crate::recorder::Control;
use crate::session::Happening;
use crate::session::experiment::Experiment;
use crate::session::magnetometer::MagnetometerAction;
use crate::silence::Heard;
use crate::to_page::{self, ExperimentState, Magnetometer, MagnetometerState, ToPage};
use northing_evaluation::statistics::lamp::{Lamp, Remark, Tone};

/// No more frames a second than this are made.
const FRAME_INTERVAL: Duration = Duration::from_micros(16_000);
/// How often progress is told.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(200);

/// How often the lamps are judged for the device's own phone.
const LAMPS_INTERVAL: Duration = Duration::from_millis(500);

/// Something for a device to do. Times of arrival are those of [`Lab::now_ns`], or of a recording.
#[derive(Debug)]
pub enum Work {
    /// Bytes as they came; the answer comes when they are taken.
    Payload {
        /// What they are.
        format: WireFormat,
        /// They.
        bytes: Bytes,
        /// When they came, ns.
        arrival_ns: i64,
        /// Who waits for the answer.
        reply: Option<oneshot::Sender<Result<(), WireError>>>,
    },
    /// Time has passed: only of a recording, whose devices do not look at the clock.
    Poll {
        /// The time, ns.
        arrival_ns: i64,
        /// Who waits until everything before is done.
        reply: Option<oneshot::Sender<()>>,
    },
    /// A command.
    Command {
        /// It.
        command: Command,
        /// When it came, ns.
        arrival_ns: i64,
        /// Who waits for the answer.
        reply: oneshot::Sender<Result<(), String>>,
    },
}

struct Task {
    lab: Arc<Lab>,
    device: Arc<Device>,
    engine: DeviceEngine,
    name: String,
    renamed: bool,
    /// The newest time of arrival, ns.
    arrival_ns: i64,
    heard: Heard,
    last_frame: Option<Instant>,
    /// When samples came that no frame has shown yet.
    newest_ns: Option<i64>,
    last_progress: Instant,
    next_lamps: Instant,
    experiment_id: String,
    calibrated: CalibrationTimes,
    /// The parameters that stand in the status: as text they are made only when they change.
    told_parameters: Option<Parameters>,
}

/// Starts the task; it ends when the device is taken away.
pub(crate) fn spawn(
    lab: Arc<Lab>,
    device: Arc<Device>,
    engine: DeviceEngine,
    saved: Option<SavedDevice>,
    mut work: mpsc::Receiver<Queuing>,
) {
    let now = Instant::now();
    let mut task = Task {
        lab,
        device,
        engine,
        name: String::new(),
        renamed: saved.as_ref().is_some_and(|saved| saved.name.is_some()),
        arrival_ns: i64::MIN,
        heard: Heard::new(now),
        last_frame: None,
        newest_ns: None,
        last_progress: now,
        next_lamps: now,
        experiment_id: String::new(),
        calibrated: saved.map(|saved| saved.calibrated).unwrap_or_default(),
        told_parameters: None,
    };
    task.publish();
    let (lab, device) = (task.lab.clone(), task.device.clone());
    let running = async move {
        let mut tick = tokio::time::interval(Duration::from_millis(250));
        tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                next = work.recv() => match next {
                    // The room in the queue is given back when the work is done.
                    Some(next) => task.work(next.work),
                    None => break,
                },
                _ = tick.tick() => {
                    if task.device.is_gone() {
                        break;
                    }
                    task.tick();
                }
            }
        }
    };
    tokio::spawn(supervise(lab, device, running));
}

/// Runs a device's task; should it panic, the device is taken away, so that it can begin anew.
async fn supervise(
    lab: Arc<Lab>,
    device: Arc<Device>,
    running: impl Future<Output = ()> + Send + 'static,
) {
    let ended = tokio::spawn(running).await;
    if ended.is_err_and(|error| error.is_panic()) {
        lab.broke_off(&device);
    }
}

impl Task {
    fn work(&mut self, work: Work) {
        match work {
            Work::Command {
                command,
                arrival_ns,
                reply,
            } => {
                let done = self.command(&command, arrival_ns);
                self.publish();
                self.lab.tell_devices();
                // Whoever asked may have gone.
                let _ = reply.send(done);
                return;
            }
            Work::Payload {
                format,
                bytes,
                arrival_ns,
                reply,
            } => {
                let taken = self.payload(format, &bytes, arrival_ns);
                self.newest_ns = (!self.device.replayed).then_some(arrival_ns);
                if let Some(reply) = reply {
                    let _ = reply.send(taken);
                }
            }
            Work::Poll { arrival_ns, reply } => {
                self.poll(arrival_ns);
                self.publish();
                if let Some(reply) = reply {
                    let _ = reply.send(());
                }
            }
        }
        let received = self.engine.session().intake().received();
        self.heard.note(received, Instant::now());
        self.device.heard();
        self.frame();
        self.progress();
        self.publish();
    }

    fn tick(&mut self) {
        if !self.device.replayed {
            self.poll(self.lab.now_ns());
            self.frame();
        }
        self.progress();
        self.publish();
    }

    fn payload(
        &mut self,
        format: WireFormat,
        bytes: &Bytes,
        arrival_ns: i64,
    ) -> Result<(), WireError> {
        let arrival_ns = self.later(arrival_ns);
        self.lab
            .recorder
            .payload(&self.device.key, format, arrival_ns, bytes.clone());
        let happenings = self.engine.payload(format, bytes, arrival_ns)?;
        if self.engine.name() != self.name {
            self.engine.name().clone_into(&mut self.name);
            // A name that was given in the lab stays.
            if !self.renamed {
                self.name.clone_into(&mut lock(&self.device.status).name);
            }
        }
        self.happened(happenings, arrival_ns);
        Ok(())
    }

    /// Uploads that come at once may be handed over in another order than they were stamped in.
    fn later(&mut self, arrival_ns: i64) -> i64 {
        self.arrival_ns = self.arrival_ns.max(arrival_ns);
        self.arrival_ns
    }

    fn poll(&mut self, now_ns: i64) {
        let now_ns = self.later(now_ns);
        if let Some(happenings) = self.engine.poll(now_ns) {
            self.lab
                .recorder
                .control(&self.device.key, now_ns, &Control::Poll);
            self.happened(happenings, now_ns);
        }
    }

    fn happened(&mut self, happenings: Vec<Happening>, arrival_ns: i64) {
        for happening in happenings {
            match happening {
                // The engine keeps these.
                Happening::Note(_) | Happening::Over(_) => {}
                Happening::GaveUp(reason) => {
                    let name = lock(&self.device.status).name.clone();
                    let text = format!("{name}: {reason}");
                    self.lab.tell_about(&self.device.id, &ToPage::error(text));
                    lock(&self.device.for_owner).gave_up = Some(reason);
                }
                Happening::Calibrated(run, made) => {
                    let message = run.message(&self.device.id, Some(&made));
                    self.lab.tell(&message);
                    lock(&self.device.for_owner).calibration = Some(match &made {
                        Ok(rest) => run.accepted(rest),
                        Err(reason) => Remark::new(Tone::Bad, reason.as_str()),
                    });
                    if made.is_ok() {
                        self.calibrated.rest = Some(experiments::utc(arrival_ns));
                        self.save();
                    }
                }
                Happening::Magnetometer(action, remark) => {
                    match action {
                        MagnetometerAction::Finish => {
                            self.calibrated.magnetometer = Some(experiments::utc(arrival_ns));
                        }
                        MagnetometerAction::Discard => self.calibrated.magnetometer = None,
                        MagnetometerAction::Start | MagnetometerAction::Cancel => {}
                    }
                    self.save();
                    self.magnetometer_changed(action, &remark);
                }
                Happening::Experimented(experiment) => self.experimented(*experiment, arrival_ns),
            }
        }
    }

    fn experimented(&mut self, experiment: Experiment, arrival_ns: i64) {
        let lab = self.lab.clone();
        let name = lock(&self.device.status).name.clone();
        let Some(subject) = self.engine.session().subject() else {
            let text = "no estimator ran: choose one and repeat";
            return lab.tell_about(&self.device.id, &ToPage::error(text));
        };
        let finished = Finished {
            id: std::mem::take(&mut self.experiment_id),
            device: self.device.id.clone(),
            device_name: name,
            at: experiments::utc(arrival_ns),
            options: self.engine.session().options().clone(),
            estimators: self.engine.session().estimators(),
            subject,
            summaries: Default::default(),
            hash: String::new(),
            originals: Default::default(),
            experiment,
        };
        let of = finished.device.clone();
        tokio::task::spawn_blocking(move || match finished.evaluated() {
            Ok(finished) => {
                let finished = lab.experiments.add(finished);
                lab.tell(&finished.message());
                lab.tell(&lab.experiments_message());
                lab.experiments.save(&finished);
            }
            Err(text) => lab.tell_about(&of, &ToPage::error(text)),
        });
    }

    fn command(&mut self, command: &Command, arrival_ns: i64) -> Result<(), String> {
        let arrival_ns = self.later(arrival_ns);
        if let Some(command) = command.recorded() {
            let recorded = Control::Command { command };
            let (recorder, key) = (&self.lab.recorder, &self.device.key);
            recorder.control(key, arrival_ns, &recorded);
        }
        let happenings = self.engine.command(command, arrival_ns)?;
        if matches!(command, Command::Calibrate(_) | Command::Experiment(..)) {
            lock(&self.device.for_owner).gave_up = None;
        }
        match command {
            Command::Experiment(..) => self.experiment_id = self.lab.experiments.next_id(),
            Command::Rename(name) => {
                self.renamed = true;
                lock(&self.device.status).name = name.chars().take(60).collect();
            }
            _ => {}
        }
        self.happened(happenings, arrival_ns);
        if matches!(
            command,
            Command::Settings(..)
                | Command::Sensors(_)
                | Command::Estimators(_)
                | Command::Subject(_)
                | Command::Rename(_)
        ) {
            self.save();
        }
        Ok(())
    }

    /// Hands over what is to be found again at the next start.
    fn save(&self) {
        self.lab.save_device(&self.device, || {
            let given = || lock(&self.device.status).name.clone();
            let name = self.renamed.then(given);
            let session = self.engine.session();
            SavedDevice::of(&self.device.id, name, session, self.calibrated.clone())
        });
    }

    /// Sends a frame, unless one has just been sent or nobody looks.
    fn frame(&mut self) {
        let now = Instant::now();
        let soon = self
            .last_frame
            .is_some_and(|last| now - last < FRAME_INTERVAL);
        let lab = &self.lab;
        if soon || lab.frames.receiver_count() + lab.watched.receiver_count() == 0 {
            return;
        }
        self.last_frame = Some(now);
        let mut frame = self.engine.session_mut().frame(&self.device.id);
        if !self.heard.delivers(now) {
            for lamp in &mut frame.lamp {
                *lamp = Lamp::idle(lamp.sensor, "Nothing is received: nothing to judge.");
            }
        }
        if self.lab.watched.receiver_count() > 0 {
            let _ = self.lab.watched.send(Arc::new(frame.clone()));
        }
        if let Ok(text) = FrameText::new(frame, self.newest_ns.take()) {
            // Pages that lag behind miss frames: that is what frames are for.
            let _ = self.lab.frames.send(Arc::new(text));
        }
    }

    fn progress(&mut self) {
        if self.last_progress.elapsed() < PROGRESS_INTERVAL {
            return;
        }
        self.last_progress = Instant::now();
        if let Some(run) = self.engine.session().calibration() {
            self.lab.tell(&run.message(&self.device.id, None));
        }
        if let Some(run) = self.engine.session().magnetometer_run() {
            let message = run.progress(&self.device.id);
            self.lab.tell(&ToPage::Magnetometer(Box::new(message)));
        }
        if let Some(run) = self.engine.session().experiment() {
            self.lab
                .tell(&ToPage::Experiment(Box::new(to_page::Experiment {
                    device: self.device.id.clone(),
                    id: self.experiment_id.clone(),
                    state: ExperimentState::Running,
                    progress: run.span.progress(),
                    remaining_s: run.span.remaining_s(),
                    result: None,
                })));
        }
    }

    fn magnetometer_changed(&self, action: MagnetometerAction, remark: &Remark) {
        let state = match action {
            MagnetometerAction::Start => MagnetometerState::Running,
            MagnetometerAction::Finish => MagnetometerState::Done,
            MagnetometerAction::Cancel | MagnetometerAction::Discard => MagnetometerState::Idle,
        };
        let fit = self.engine.session().magnetometer();
        self.lab.tell(&ToPage::Magnetometer(Box::new(Magnetometer {
            device: self.device.id.clone(),
            state,
            verdict: Some(remark.clone()),
            fit: fit.map(Into::into),
            coverage: None,
            points: None,
            samples: None,
            hint: None,
        })));
    }

    /// Writes down what the device's own phone shows.
    fn publish_for_owner(&mut self, now: Instant) {
        let session = self.engine.session();
        let mut own = lock(&self.device.for_owner);
        own.profile = session.options().profile.name();
        if self.next_lamps <= now {
            self.next_lamps = now + LAMPS_INTERVAL;
            own.lamps = session.lamps();
        }
    }

    /// Writes down how the device is.
    fn publish(&mut self) {
        let now = Instant::now();
        self.publish_for_owner(now);
        let (lost, again) = (self.engine.lost(), self.engine.duplicated());
        let session = self.engine.session();
        let mut told = session.status(lost);
        told.health
            .splice(0..0, self.engine.remarks().iter().cloned());
        let calibration = session.calibration().map(|run| UnderWay::Calibration {
            remaining_s: run.span.remaining_s(),
        });
        let experiment = session.experiment().map(|run| UnderWay::Experiment {
            remaining_s: run.span.remaining_s(),
        });
        let mut status = lock(&self.device.status);
        status.under_way = calibration.or(experiment);
        status.session = told;
        status.lost = lost;
        status.duplicated_batches = again;
        status.connected = self.heard.is_connected(now);
        status.delivers = self.heard.delivers(now);
        status.silence = self.heard.in_words(self.device.source, now);
        status.silent_s = self.heard.silent_s(now);
        let parameters = session.config();
        if self.told_parameters.replace(parameters) != Some(parameters) {
            status.settings = serde_json::to_value(parameters).unwrap_or_default();
        }
        status.used = Some(SensorUse::of(&session.options().sensors));
        let rest = &session.options().calibration;
        status.rest = rest.as_ref().map(Into::into);
        status.calibrated.clone_from(&self.calibrated);
        status.estimates = session.estimates();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_evaluation::RunOptions;

    #[tokio::test]
    async fn a_device_whose_task_panics_is_taken_away_and_said_and_can_come_again() {
        let lab = Lab::new(RunOptions::default());
        let mut told = lab.listen();
        let device = lab.device("anna", "Anna", "page").unwrap();
        supervise(lab.clone(), device.clone(), async {
            panic!("a fault, as a test")
        })
        .await;
        assert!(device.is_gone() && lab.find("anna").is_err());
        let mut words = String::new();
        while let Ok(text) = told.try_recv() {
            words.push_str(&text);
        }
        assert!(words.contains("`Anna` met a fault"), "{words}");
        let again = lab.device("anna", "Anna", "page").unwrap();
        assert!(!again.is_gone());
        // A late end of the old one does not take the new one away.
        lab.broke_off(&device);
        assert!(lab.find("anna").is_ok());
    }
}
