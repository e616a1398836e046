//! The task of one device: it alone touches the device's session, decoder and order of batches.

use std::sync::Arc;
use std::time::{Duration, Instant};

use northing_core::calibration::RestCalibration;
use northing_recording::Event;
use northing_recording::wire::phone_page::{Batch, PhonePage};
use northing_recording::wire::sensor_logger_push::{Push, SensorLoggerPush};
use northing_recording::wire::{Decoded, Placed, Resequencer, Tone as WireTone};
use serde_json::json;
use tokio::sync::{mpsc, oneshot};
use tokio::time::MissedTickBehavior;

use crate::experiments::{self, Finished};
use crate::lab::{Device, FrameText, Lab, lock};
use crate::messages::{Command, SensorUse};
use crate::session::calibration::CalibrationRun;
use crate::session::experiment::Experiment;
use crate::session::lamp::{Remark, Tone};
use crate::session::{DeviceSession, Happening};

/// A batch that is missing is waited for this long, ns, while no more than [`MOST_HELD`] others wait.
const WAIT_NS: i64 = 1_000_000_000;
const MOST_HELD: usize = 40;
/// No more frames a second than this are made.
const FRAME_INTERVAL: Duration = Duration::from_micros(16_000);
/// How often progress is told.
const PROGRESS_INTERVAL: Duration = Duration::from_millis(200);
/// Without anything for so long a device counts as gone.
const SILENCE: Duration = Duration::from_secs(3);
/// Remarks of decoders that are kept for the list of devices.
const MOST_REMARKS: usize = 8;

/// Something for a device to do.
#[derive(Debug)]
pub enum Work {
    /// A batch of the phone page; the answer comes when it is taken.
    Page(Box<Batch>, oneshot::Sender<()>),
    /// A message of Sensor Logger; the answer comes when it is taken.
    Push(Box<Push>, oneshot::Sender<()>),
    /// Events that need no decoding.
    Events(Vec<Event>),
    /// A command.
    Command(Command, oneshot::Sender<Result<(), String>>),
}

/// How batches become events.
enum Decoder {
    Events,
    Page(Box<PageDecoder>),
    Push(Box<SensorLoggerPush>),
}

struct PageDecoder {
    session: String,
    decoder: PhonePage,
    order: Resequencer<Batch>,
}

struct Task {
    lab: Arc<Lab>,
    device: Arc<Device>,
    session: DeviceSession,
    decoder: Decoder,
    started: Instant,
    last_work: Instant,
    last_frame: Option<Instant>,
    last_progress: Instant,
    lost_before: [u64; 2],
    remarks: Vec<Remark>,
    experiment_id: String,
}

/// Starts the task; it ends when the device is taken away.
pub(crate) fn spawn(
    lab: Arc<Lab>,
    device: Arc<Device>,
    session: DeviceSession,
    mut work: mpsc::Receiver<Work>,
) {
    let now = Instant::now();
    let mut task = Task {
        lab,
        device,
        session,
        decoder: Decoder::Events,
        started: now,
        last_work: now,
        last_frame: None,
        last_progress: now,
        lost_before: [0; 2],
        remarks: Vec::new(),
        experiment_id: String::new(),
    };
    task.publish();
    tokio::spawn(async move {
        let mut tick = tokio::time::interval(Duration::from_millis(250));
        tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                next = work.recv() => match next {
                    Some(next) => task.work(next),
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
    });
}

impl Task {
    fn work(&mut self, work: Work) {
        match work {
            Work::Command(command, reply) => {
                let done = self.command(command);
                self.publish();
                self.lab.tell_devices();
                // Whoever asked may have gone.
                let _ = reply.send(done);
                return;
            }
            Work::Events(events) => self.take(events),
            Work::Page(batch, reply) => {
                self.page(*batch);
                let _ = reply.send(());
            }
            Work::Push(push, reply) => {
                self.push(*push);
                let _ = reply.send(());
            }
        }
        self.last_work = Instant::now();
        self.frame();
        self.progress();
        self.publish();
    }

    fn tick(&mut self) {
        let now = self.now_ns();
        let ready = match &mut self.decoder {
            Decoder::Page(page) => page.order.poll(now),
            _ => Vec::new(),
        };
        if !ready.is_empty() {
            self.decode(ready);
            self.frame();
        }
        self.progress();
        self.publish();
    }

    /// A batch of a page: put in order, decoded, taken.
    fn page(&mut self, batch: Batch) {
        let now = self.now_ns();
        let seq = batch.seq;
        let page = match &mut self.decoder {
            Decoder::Page(page) if page.session == batch.session => page,
            other => {
                // A page load has its own clock and its own numbers.
                if let Decoder::Page(old) = other {
                    self.lost_before[0] += old.order.lost();
                    self.lost_before[1] += old.order.duplicated();
                }
                let fresh = PageDecoder {
                    session: batch.session.clone(),
                    decoder: PhonePage::new(),
                    order: Resequencer::new(WAIT_NS, MOST_HELD),
                };
                *other = Decoder::Page(Box::new(fresh));
                let Decoder::Page(page) = other else { return };
                page
            }
        };
        let ready = match page.order.push(seq, now, batch) {
            Placed::Ready(ready) => ready,
            Placed::Late(late) => vec![late],
            Placed::Duplicate => Vec::new(),
        };
        self.decode(ready);
    }

    fn decode(&mut self, batches: Vec<Batch>) {
        for batch in batches {
            if !batch.name.is_empty() {
                batch.name.clone_into(&mut lock(&self.device.status).name);
            }
            for event in &batch.page_events {
                let remark = match event.kind.as_str() {
                    "hidden" => "The page on the phone is hidden: its sensors pause.",
                    _ => continue,
                };
                self.remark(Remark::new(Tone::Warn, remark));
            }
            let Decoder::Page(page) = &mut self.decoder else {
                return;
            };
            let decoded = page.decoder.decode(batch);
            self.take_decoded(decoded);
        }
    }

    fn push(&mut self, push: Push) {
        if !matches!(self.decoder, Decoder::Push(_)) {
            self.decoder = Decoder::Push(Box::new(SensorLoggerPush::new()));
        }
        if let Decoder::Push(decoder) = &mut self.decoder {
            let decoded = decoder.accept(push);
            self.take_decoded(decoded);
        }
    }

    fn take_decoded(&mut self, decoded: Decoded) {
        for notice in decoded.notices {
            let tone = match notice.tone {
                WireTone::Info => continue,
                WireTone::Warning => Tone::Warn,
                WireTone::Bad => Tone::Bad,
            };
            self.remark(Remark::new(tone, notice.text));
        }
        self.take(decoded.events);
    }

    fn take(&mut self, mut events: Vec<Event>) {
        let happenings = self.session.take(&mut events);
        self.happened(happenings);
    }

    fn happened(&mut self, happenings: impl IntoIterator<Item = Happening>) {
        for happening in happenings {
            match happening {
                Happening::Note(remark) => self.remark(remark),
                Happening::Calibrated(run, made) => self.calibrated(&run, made),
                Happening::Experimented(experiment) => self.experimented(*experiment),
            }
        }
    }

    fn remark(&mut self, remark: Remark) {
        if self.remarks.contains(&remark) {
            return;
        }
        if self.remarks.len() >= MOST_REMARKS {
            self.remarks.remove(0);
        }
        self.remarks.push(remark);
    }

    fn calibrated(
        &mut self,
        run: &CalibrationRun,
        made: Result<Box<RestCalibration<f64>>, String>,
    ) {
        let (state, verdict) = match &made {
            Ok(calibration) => ("done", accepted(calibration)),
            Err(reason) => ("refused", Remark::new(Tone::Bad, reason.as_str())),
        };
        self.lab.tell(&json!({
            "type": "calibration", "device": self.device.id, "state": state,
            "progress": 1.0, "remaining_s": 0.0, "verdict": verdict,
            "result": made.ok(), "samples": run.samples(),
        }));
    }

    /// Evaluates a finished experiment aside, so that this device goes on.
    fn experimented(&mut self, experiment: Experiment) {
        let lab = self.lab.clone();
        let name = lock(&self.device.status).name.clone();
        let finished = Finished {
            id: std::mem::take(&mut self.experiment_id),
            device: self.device.id.clone(),
            device_name: name,
            at: experiments::now(),
            options: self.session.options().clone(),
            settings: self.session.config(),
            estimators: self.session.estimators(),
            summaries: Default::default(),
            hash: String::new(),
            experiment,
        };
        tokio::task::spawn_blocking(move || match finished.evaluated() {
            Ok(finished) => {
                let finished = lab.keep(finished);
                lab.tell(&finished.message());
                lab.tell(&lab.experiments_message());
            }
            Err(text) => lab.tell(&json!({"type": "error", "text": text})),
        });
    }

    fn command(&mut self, command: Command) -> Result<(), String> {
        let text = |error: northing_evaluation::EvaluationError| error.to_string();
        match command {
            Command::Calibrate(seconds) => self.session.calibrate(seconds),
            Command::Experiment(seconds, name) => {
                self.session.start_experiment(seconds, &name)?;
                self.experiment_id = self.lab.next_experiment();
                Ok(())
            }
            Command::Stop => {
                let ended = self.session.stop();
                self.happened(ended);
                Ok(())
            }
            Command::Settings(profile, settings) => {
                self.session.set(profile, &settings).map_err(text)
            }
            Command::Sensors(selection) => {
                self.session.use_sensors(selection);
                Ok(())
            }
            Command::Estimators(kinds) => self.session.use_estimators(&kinds).map_err(text),
            Command::Rename(name) => {
                let name: String = name.chars().take(60).collect();
                lock(&self.device.status).name = name;
                Ok(())
            }
        }
    }

    /// Sends a frame, unless one has just been sent or nobody looks.
    fn frame(&mut self) {
        let now = Instant::now();
        let soon = self
            .last_frame
            .is_some_and(|last| now - last < FRAME_INTERVAL);
        if soon || self.lab.frames.receiver_count() == 0 {
            return;
        }
        self.last_frame = Some(now);
        let frame = self.session.frame(&self.device.id);
        if let Ok(text) = serde_json::to_string(&frame) {
            let device = self.device.id.clone();
            // Pages that lag behind miss frames: that is what frames are for.
            let _ = self.lab.frames.send(Arc::new(FrameText { device, text }));
        }
    }

    fn progress(&mut self) {
        if self.last_progress.elapsed() < PROGRESS_INTERVAL {
            return;
        }
        self.last_progress = Instant::now();
        if let Some(run) = self.session.calibration() {
            self.lab.tell(&json!({
                "type": "calibration", "device": self.device.id, "state": "running",
                "progress": run.progress(), "remaining_s": run.remaining_s(),
                "verdict": null, "result": null, "samples": null,
            }));
        }
        if let Some(run) = self.session.experiment() {
            self.lab.tell(&json!({
                "type": "experiment", "device": self.device.id, "id": self.experiment_id,
                "state": "running", "progress": run.progress(),
                "remaining_s": run.remaining_s(), "result": null,
            }));
        }
    }

    /// Writes down how the device is.
    fn publish(&mut self) {
        let [mut lost, mut again] = self.lost_before;
        if let Decoder::Page(page) = &self.decoder {
            lost += page.order.lost();
            again += page.order.duplicated();
        }
        let mut session = self.session.status(lost);
        session.health.splice(0..0, self.remarks.iter().cloned());
        let mut status = lock(&self.device.status);
        status.session = session;
        status.lost = lost;
        status.duplicated_batches = again;
        status.connected = self.last_work.elapsed() < SILENCE;
        status.settings = serde_json::to_value(self.session.config()).unwrap_or_default();
        status.used = Some(SensorUse::of(&self.session.options().sensors));
        status.estimates = self.session.estimates();
    }

    /// Time of arrival, for batches that wait.
    fn now_ns(&self) -> i64 {
        i64::try_from(self.started.elapsed().as_nanos()).unwrap_or(i64::MAX)
    }
}

fn accepted(calibration: &RestCalibration<f64>) -> Remark {
    let bias = calibration.gyroscope_bias().map(f64::to_degrees);
    let std = calibration.gyroscope_bias_std().to_degrees();
    Remark::new(
        Tone::Good,
        format!(
            "Accepted: the device was at rest. Gyroscope bias {:.3}, {:.3}, {:.3} deg/s, known to {std:.4} deg/s.",
            bias.x, bias.y, bias.z
        ),
    )
}
