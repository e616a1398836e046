//! The way of a byte: lines, frames and fixes, filters at 50 Hz, sentences.
//!
//! A frame ends with its line of rates, and with it comes a step; acceleration and field are those
//! that came since the one before. A damaged line costs its sensor this step; a damaged rate costs the
//! frame, and the next step is as long as both. After more than a second without frames everything
//! starts again at rest: an old state is not worth keeping, and never kept over a reset.

use northing_core::faults::{Fault, FaultKind, FaultySensor};
use northing_core::geometry::trigonometry::sin_cos;
use northing_core::nalgebra::Vector3;

use crate::frame_clock::{FrameClock, INTERVAL_US, Passed};
use crate::lines::Lines;
use crate::local_plane::LocalPlane;
use crate::navigator::{Estimate, Inertial, Navigator, Position, REST_FRAMES, Unseen, Validity};
use crate::nmea::{self, Fix};
use crate::razor;
use crate::sample_faults::{SampleFaults, milliseconds};
use crate::sentences::{Sentence, Sink, fixed};

/// Version of the sentences.
const VERSION: u32 = 1;
/// From status to status, microseconds.
const STATUS_US: u32 = 1_000_000;
/// The origin is told again after so many status sentences.
const ORIGIN_EVERY: u32 = 10;

/// Units of the integers: 0.1 mm/s^2, 1e-5 rad/s, 0.01 microtesla; millimetres, thousandths of a degree.
const FORCE: f32 = 1e-4;
const RATE: f32 = 1e-5;
const FIELD: f32 = 1e-2;
const MILLI: f32 = 1e3;
const MILLIDEGREES: f32 = 57_295.78;

/// Why the board has started.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResetCause {
    /// Power, or its button.
    Power,
    /// The watchdog: the program had hung.
    Watchdog,
}

/// Counts of a line's receiver.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Overruns {
    /// Bytes of the IMU that nobody fetched in time, wrapping.
    pub imu: u32,
    /// The same of the GNSS receiver.
    pub gnss: u32,
}

/// What an IMU has said in one frame, in the units of the sentences: forward, right, down.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Frame {
    /// Specific force, 0.1 mm/s^2.
    pub force: Option<[i32; 3]>,
    /// Magnetic field, 0.01 microtesla.
    pub field: Option<[i32; 3]>,
    /// Angular rate, 1e-5 rad/s.
    pub rate: [i32; 3],
}

/// The application of one build.
#[derive(Debug)]
pub struct Application<N> {
    imu_lines: Lines<{ razor::LONGEST_LINE }>,
    gnss_lines: Lines<{ nmea::LONGEST_LINE }>,
    frame: Frame,
    clock: FrameClock,
    faults: SampleFaults,
    receiver: nmea::Receiver,
    phase: Phase<N>,
    plane: Option<LocalPlane>,
    fix: Option<Fix>,
    fixes: u32,
    /// Time of the last frame since the start, ms, wrapping.
    time_ms: u32,
    counts: Counts,
    status_us: u32,
    imu_is_silent: bool,
}

#[derive(Debug)]
enum Phase<N> {
    Resting(Rest),
    Running(N),
}

/// Sums over a rest.
#[derive(Debug, Clone, Copy, Default)]
struct Rest {
    frames: u32,
    force: Sum,
    rate: Sum,
    field: Sum,
}

#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    count: u32,
    sum: Vector3<f32>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    frames: u32,
    imu_damaged: u32,
    gnss_damaged: u32,
    starts: u32,
    statuses: u32,
}

impl<N: Navigator> Application<N> {
    /// A fresh start: nothing is known. Says so.
    pub fn new(cause: ResetCause, now_us: u32, out: &mut impl Sink) -> Self {
        let cause: &[u8] = match cause {
            ResetCause::Power => b"power",
            ResetCause::Watchdog => b"watchdog",
        };
        Sentence::new(out, b'B')
            .unsigned(VERSION)
            .text(N::NAME)
            .text(cause)
            .end();
        Self {
            imu_lines: Lines::new(),
            gnss_lines: Lines::new(),
            frame: Frame::default(),
            clock: FrameClock::default(),
            faults: SampleFaults::default(),
            receiver: nmea::Receiver::default(),
            phase: Phase::Resting(Rest::default()),
            plane: None,
            fix: None,
            fixes: 0,
            time_ms: 0,
            counts: Counts::default(),
            status_us: now_us,
            imu_is_silent: true,
        }
    }

    /// Takes a byte of the IMU that came at `now_us`, the board's counter.
    pub fn imu_byte(&mut self, byte: u8, now_us: u32, out: &mut impl Sink) {
        let Some(line) = self.imu_lines.push(byte) else {
            return;
        };
        match razor::read(line) {
            Some(razor::Line::Force(force)) => self.frame.force = Some(force),
            Some(razor::Line::Field(field)) => self.frame.field = Some(field),
            Some(razor::Line::Rate(rate)) => {
                let frame = Frame {
                    rate,
                    ..core::mem::take(&mut self.frame)
                };
                self.take_frame(&frame, now_us, out);
            }
            Some(razor::Line::Other) => {}
            None => self.counts.imu_damaged = self.counts.imu_damaged.wrapping_add(1),
        }
    }

    /// Takes a byte of the GNSS receiver that came at `now_us`.
    pub fn gnss_byte(&mut self, byte: u8, now_us: u32) {
        let Some(line) = self.gnss_lines.push(byte) else {
            return;
        };
        match nmea::read(line) {
            Some(sentence) => {
                let fix = self.receiver.take(&sentence, now_us);
                self.fix = fix.or(self.fix);
            }
            None => self.counts.gnss_damaged = self.counts.gnss_damaged.wrapping_add(1),
        }
    }

    /// What happens by itself with time; to be called at least every few milliseconds.
    pub fn poll(&mut self, now_us: u32, overruns: Overruns, out: &mut impl Sink) {
        self.fix = self.receiver.poll(now_us).or(self.fix);
        self.imu_is_silent = self.clock.is_silent(now_us);
        if self.imu_is_silent {
            // A position without motion between is soon an old one.
            self.fix = None;
        }
        if now_us.wrapping_sub(self.status_us) >= STATUS_US {
            self.status_us = self.status_us.wrapping_add(STATUS_US);
            self.say_status(overruns, out);
        }
    }

    /// Takes a frame as a whole, from an IMU that sends no lines.
    pub fn take_frame(&mut self, frame: &Frame, now_us: u32, out: &mut impl Sink) {
        let intervals = match self.clock.frame(now_us) {
            Passed::Intervals(intervals) => Some(intervals),
            Passed::NewStart => {
                self.phase = Phase::Resting(Rest::default());
                self.faults.interrupt();
                self.fix = None;
                self.counts.starts = self.counts.starts.wrapping_add(1);
                None
            }
        };
        let dt_ms = intervals.map(|n| n.wrapping_mul(INTERVAL_US / 1000));
        self.time_ms = self.time_ms.wrapping_add(dt_ms.unwrap_or(0));
        self.counts.frames = self.counts.frames.wrapping_add(1);
        self.say_frame(frame, dt_ms, out);
        let mut inertial = frame.inertial(dt_ms.unwrap_or(0));
        let still = match &self.phase {
            Phase::Resting(_) => Vector3::zeros(),
            Phase::Running(navigator) => navigator.gyroscope_bias(),
        };
        let time_ms = self.time_ms;
        self.faults.usable(&mut inertial, &still, &mut |fault| {
            say_fault(time_ms, fault, out);
        });
        match &mut self.phase {
            Phase::Resting(rest) => {
                rest.add(&inertial);
                if rest.frames >= REST_FRAMES {
                    // A start that fails is tried again with the next second.
                    self.phase = N::start(&rest.mean())
                        .map_or_else(|| Phase::Resting(Rest::default()), Phase::Running);
                }
            }
            Phase::Running(_) => self.navigate(&inertial, out),
        }
    }

    /// Whether no frame has come for more than a second: a Razor board may have to be told to send.
    pub const fn imu_is_silent(&self) -> bool {
        self.imu_is_silent
    }

    fn navigate(&mut self, inertial: &Inertial, out: &mut impl Sink) {
        let fix = self.fix.take();
        let position = fix.map(|fix| self.position(&fix, out));
        let Phase::Running(navigator) = &mut self.phase else {
            return;
        };
        navigator.step(inertial, position.as_ref());
        if !navigator.is_sound() {
            self.phase = Phase::Resting(Rest::default());
            self.counts.starts = self.counts.starts.wrapping_add(1);
            return;
        }
        let estimate = navigator.estimate();
        let fingerprint = navigator.fingerprint();
        if matches!(
            estimate.validity,
            Validity::DeadReckoning | Validity::Invalid
        ) {
            self.receiver.say_lost();
        }
        say_estimate(self.time_ms, &estimate, fingerprint, out);
    }

    /// A fix in the plane of the first one.
    fn position(&mut self, fix: &Fix, out: &mut impl Sink) -> Position {
        let plane = match self.plane {
            Some(plane) => plane,
            None => {
                let plane = LocalPlane::at(fix);
                self.plane = Some(plane);
                say_origin(&plane, out);
                plane
            }
        };
        self.fixes = self.fixes.wrapping_add(1);
        say_fix(self.time_ms, fix, out);
        Position {
            number: self.fixes,
            ned: plane.ned(fix),
            velocity: fix.speed_course.map(|(mm_s, course)| {
                let speed = mm_s as f32 * 1e-3;
                let (sin, cos) = sin_cos(course as f32 * 1.745_329_3e-4);
                [speed * cos, speed * sin]
            }),
            hdop: f32::from(fix.hdop_hundredths) * 1e-2,
        }
    }

    fn say_frame(&self, frame: &Frame, dt_ms: Option<u32>, out: &mut impl Sink) {
        let sentence = Sentence::new(out, b'I').unsigned(self.time_ms);
        let sentence = match dt_ms {
            Some(dt_ms) => sentence.unsigned(dt_ms),
            None => sentence.empty(),
        };
        sentence
            .vector(frame.force)
            .vector(Some(frame.rate))
            .vector(frame.field)
            .end();
    }

    fn say_status(&mut self, overruns: Overruns, out: &mut impl Sink) {
        let counts = &mut self.counts;
        Sentence::new(out, b'S')
            .unsigned(self.time_ms)
            .unsigned(counts.starts)
            .unsigned(counts.frames)
            .unsigned(self.clock.missing)
            .unsigned(counts.imu_damaged.wrapping_add(self.imu_lines.too_long))
            .unsigned(overruns.imu)
            .unsigned(self.fixes)
            .unsigned(self.receiver.refused)
            .unsigned(counts.gnss_damaged.wrapping_add(self.gnss_lines.too_long))
            .unsigned(overruns.gnss)
            .end();
        if let Some(plane) = &self.plane
            && counts.statuses.is_multiple_of(ORIGIN_EVERY)
        {
            say_origin(plane, out);
        }
        counts.statuses = counts.statuses.wrapping_add(1);
    }
}

fn say_origin(plane: &LocalPlane, out: &mut impl Sink) {
    let [latitude, longitude, height] = plane.origin();
    Sentence::new(out, b'O')
        .integer(latitude)
        .integer(longitude)
        .integer(height)
        .end();
}

fn say_fix(time_ms: u32, fix: &Fix, out: &mut impl Sink) {
    let sentence = Sentence::new(out, b'G')
        .unsigned(time_ms)
        .unsigned(fix.utc_ms)
        .integer(fix.latitude_e7)
        .integer(fix.longitude_e7)
        .integer(fix.height_mm)
        .unsigned(u32::from(fix.satellites))
        .unsigned(u32::from(fix.hdop_hundredths));
    match fix.speed_course {
        Some((speed, course)) => sentence.unsigned(speed).unsigned(course),
        None => sentence.empty().empty(),
    }
    .end();
}

/// The size is in the unit of the sensor's samples, or in milliseconds.
fn say_fault(time_ms: u32, fault: &Fault<f32>, out: &mut impl Sink) {
    let (sensor, unit): (&[u8], f32) = match fault.sensor {
        FaultySensor::Gyroscope => (b"gyroscope", RATE),
        FaultySensor::Accelerometer => (b"accelerometer", FORCE),
        FaultySensor::Magnetometer => (b"magnetometer", FIELD),
    };
    let lasted_ms = milliseconds(fault.from_ns, fault.until_ns);
    let (kind, unit): (&[u8], _) = match fault.kind {
        FaultKind::Spike => (b"spike", Some(unit)),
        FaultKind::Saturated => (b"saturated", Some(unit)),
        FaultKind::Stuck => (b"stuck", None),
        FaultKind::Noise => (b"noise", None),
        FaultKind::Missing => (b"missing", None),
        FaultKind::Stamp => (b"stamp", None),
        FaultKind::BiasStep => (b"bias-step", Some(unit)),
    };
    let sentence = Sentence::new(out, b'F')
        .unsigned(time_ms)
        .text(sensor)
        .text(kind)
        .text(if fault.is_over { b"over" } else { b"found" })
        .unsigned(time_ms.wrapping_sub(lasted_ms));
    match unit {
        Some(unit) => sentence.integer(fixed(fault.size / unit, 1.0)),
        None => sentence.unsigned(lasted_ms),
    }
    .end();
}

fn say_estimate(time_ms: u32, estimate: &Estimate, fingerprint: u32, out: &mut impl Sink) {
    let scaled = |v: Vector3<f32>, scale: f32| [v.x, v.y, v.z].map(|x| fixed(x, scale));
    let attitude = estimate.attitude;
    let motion = estimate.motion;
    let validity = match estimate.validity {
        Validity::Aligning => 0,
        Validity::Aided => 1,
        Validity::DeadReckoning => 2,
        Validity::Invalid => 3,
        Validity::HeadingUnknown => 4,
    };
    Sentence::new(out, b'E')
        .unsigned(time_ms)
        .vector(attitude.map(|a| scaled(a.angles, MILLIDEGREES)))
        .vector(attitude.map(|a| scaled(a.std, MILLIDEGREES)))
        .unsigned(validity)
        .vector(motion.map(|m| scaled(m.position, MILLI)))
        .vector(motion.map(|m| scaled(m.velocity, MILLI)))
        .vector(motion.map(|m| scaled(m.position_std, MILLI)))
        .bits(fingerprint)
        .end();
}

impl Frame {
    fn inertial(&self, dt_ms: u32) -> Inertial {
        let si = |v: [i32; 3], unit: f32| Vector3::from(v.map(|x| x as f32 * unit));
        Inertial {
            dt_ms,
            angular_rate: si(self.rate, RATE),
            specific_force: self.force.map(|v| si(v, FORCE)),
            magnetic_field: self.field.map(|v| si(v, FIELD)),
            push: None,
            unseen: Unseen::default(),
        }
    }
}

impl Rest {
    fn add(&mut self, inertial: &Inertial) {
        self.frames += 1;
        self.rate.add(Some(&inertial.angular_rate));
        self.force.add(inertial.specific_force.as_ref());
        self.field.add(inertial.magnetic_field.as_ref());
    }

    fn mean(&self) -> Inertial {
        Inertial {
            dt_ms: 0,
            angular_rate: self.rate.mean().unwrap_or_default(),
            specific_force: self.force.mean(),
            magnetic_field: self.field.mean(),
            push: None,
            unseen: Unseen::default(),
        }
    }
}

impl Sum {
    fn add(&mut self, v: Option<&Vector3<f32>>) {
        if let Some(v) = v {
            self.count += 1;
            self.sum += v;
        }
    }

    fn mean(&self) -> Option<Vector3<f32>> {
        (self.count > 0).then(|| self.sum / self.count as f32)
    }
}
