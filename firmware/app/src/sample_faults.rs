//! Fault detection in front of the filters of both builds: what a step uses of its samples, and the events.
//!
//! Read first: [`northing_core::faults`]. The checks and the events are those that a host's GNSS/INS has, with the same
//! settings. A sample that waits for the next one is replaced by the last good one, and what was missed is made good when it was
//! a step. Through a fault that lasts the rate relaxes to that of a body at rest, and there is no force; the filters are told
//! that neither was seen.

use northing_core::faults::sample_check::{Checked, SampleCheck};
use northing_core::faults::{Fault, FaultKind, FaultySensor};
use northing_core::nalgebra::Vector3;

use crate::navigator::Inertial;

/// A jump below (unit times s) is not doubted, and white noise below (unit times sqrt(s)) is vibration: rate, force.
const LEAST: [[f32; 2]; 2] = [[0.004, 0.1], [0.3, 1.0]];
/// A spike is worth an event where it would have turned (rad) or pushed (m/s) by so much.
const NOTABLE: [f32; 2] = [0.0175, 0.3];
/// So long (s) after the last good sample nothing is left of its rate. A turn is remembered for half of it.
const FORGOTTEN_S: f32 = 0.4;
const NS_PER_MS: i64 = 1_000_000;

/// The checks of gyroscope and accelerometer.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleFaults {
    gyroscope: Sensor,
    accelerometer: Sensor,
    /// Since the first frame; less than the board's where it was interrupted.
    time_ns: i64,
}

/// What the check of a sensor remembers.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Sensor {
    sensor: FaultySensor,
    check: SampleCheck<f32>,
    /// Size of a spike, times the interval, that is an event.
    notable: f32,
    /// The last measurement and its time.
    good: Option<(i64, Vector3<f32>)>,
    /// How long it has stood for samples that wait, s.
    held_s: f32,
    /// Since when a component is at the end of the range.
    saturated_since_ns: Option<i64>,
    /// The fault that is not over.
    open: Option<Fault<f32>>,
}

/// What to use of a sample.
struct Usable {
    /// Whether it is a measurement.
    is_measured: bool,
    /// Since when it is not one for longer, or is clipped: seconds.
    faulty_for_s: Option<f32>,
    /// What those before it missed, unit times s.
    owed: Option<Vector3<f32>>,
}

impl Default for SampleFaults {
    fn default() -> Self {
        let sensor = |sensor, [jump, walk]: [f32; 2], notable| Sensor {
            sensor,
            check: SampleCheck::new(jump, walk),
            notable,
            good: None,
            held_s: 0.0,
            saturated_since_ns: None,
            open: None,
        };
        let [rate, force] = LEAST;
        let [turn, push] = NOTABLE;
        Self {
            gyroscope: sensor(FaultySensor::Gyroscope, rate, turn),
            accelerometer: sensor(FaultySensor::Accelerometer, force, push),
            time_ns: 0,
        }
    }
}

impl SampleFaults {
    /// What a step may use of its samples. A body at rest has the angular rate `still` (rad/s), the gyroscope's bias.
    /// `event` is given each fault that begins or ends with these samples, in their order.
    pub fn usable(
        &mut self,
        inertial: &mut Inertial,
        still: &Vector3<f32>,
        event: &mut dyn FnMut(&Fault<f32>),
    ) {
        let dt_s = inertial.dt_s();
        if inertial.dt_ms == 0 && self.gyroscope.check.last_ns() == Some(self.time_ns) {
            // It stands for no time: there is nothing to move on, and nothing to compare it with.
            inertial.specific_force = None;
            return;
        }
        self.time_ns += i64::from(inertial.dt_ms) * NS_PER_MS;
        let held = self.gyroscope.good;
        let rate = self
            .gyroscope
            .look(self.time_ns, &inertial.angular_rate, dt_s, event);
        if let (false, Some((_, good))) = (rate.is_measured, held) {
            let left = (1.0 - rate.faulty_for_s.unwrap_or(0.0) / FORGOTTEN_S).max(0.0);
            inertial.angular_rate = still + (good - still) * left;
        }
        if let Some(turn) = rate.owed {
            inertial.angular_rate += turn / dt_s;
        }
        inertial.unseen.rate = rate.faulty_for_s.is_some();
        let Some(sample) = &inertial.specific_force else {
            return;
        };
        let force = self.accelerometer.look(self.time_ns, sample, dt_s, event);
        if !force.is_measured {
            inertial.specific_force = None;
        }
        inertial.unseen.force = force.faulty_for_s.is_some();
        inertial.push = force.owed;
    }

    /// Frames have paused: the next one is compared with none.
    pub fn interrupt(&mut self) {
        for sensor in [&mut self.gyroscope, &mut self.accelerometer] {
            sensor.check.interrupt();
            sensor.good = None;
            sensor.held_s = 0.0;
            sensor.saturated_since_ns = None;
        }
    }
}

impl Sensor {
    /// One copy for all sensors.
    #[inline(never)]
    fn look(
        &mut self,
        time_ns: i64,
        sample: &Vector3<f32>,
        dt_s: f32,
        event: &mut dyn FnMut(&Fault<f32>),
    ) -> Usable {
        let checked = self.check.check(time_ns, sample);
        let (good_ns, good) = self.good.unwrap_or((time_ns, *sample));
        let mut usable = Usable {
            is_measured: checked.is_measured(),
            faulty_for_s: None,
            owed: None,
        };
        let used = good * self.held_s + sample * dt_s;
        let mut saturated_since_ns = None;
        let mut fault = Fault {
            sensor: self.sensor,
            kind: FaultKind::Spike,
            from_ns: good_ns,
            until_ns: time_ns,
            is_over: true,
            size: 0.0,
        };
        match checked {
            Checked::Good => {
                if let Some(open) = &self.open.take() {
                    event(&over(open, time_ns));
                }
            }
            Checked::Suspect => {}
            Checked::Step(integral) => usable.owed = Some(integral - used),
            Checked::Spike { from_ns, size } => {
                usable.owed = Some((good + sample) * ((self.held_s + dt_s) * 0.5) - used);
                (fault.from_ns, fault.size) = (from_ns, size);
                if size * dt_s > self.notable {
                    event(&fault);
                }
            }
            Checked::Stuck { from_ns } => (fault.kind, fault.from_ns) = (FaultKind::Stuck, from_ns),
            Checked::Noise { from_ns } => (fault.kind, fault.from_ns) = (FaultKind::Noise, from_ns),
            Checked::Saturated { full_scale } => {
                fault.kind = FaultKind::Saturated;
                fault.from_ns = self.saturated_since_ns.unwrap_or(good_ns);
                fault.size = full_scale;
                saturated_since_ns = Some(fault.from_ns);
            }
        }
        if fault.kind != FaultKind::Spike {
            fault.is_over = false;
            usable.faulty_for_s = Some(seconds(fault.from_ns, time_ns));
            self.lasts(&fault, event);
        }
        self.saturated_since_ns = saturated_since_ns;
        self.held_s = match checked {
            Checked::Suspect => self.held_s + dt_s,
            _ => 0.0,
        };
        if usable.is_measured {
            self.good = Some((time_ns, *sample));
        }
        usable
    }

    /// A fault that goes on or has just been found.
    fn lasts(&mut self, fault: &Fault<f32>, event: &mut dyn FnMut(&Fault<f32>)) {
        let before = self.open.replace(*fault);
        if before.is_some_and(|open| (open.kind, open.from_ns) == (fault.kind, fault.from_ns)) {
            return;
        }
        if let Some(before) = &before {
            event(&over(before, fault.until_ns));
        }
        event(fault);
    }
}

/// The same, ended by the sample of a time.
fn over(fault: &Fault<f32>, until_ns: i64) -> Fault<f32> {
    Fault {
        until_ns,
        is_over: true,
        ..*fault
    }
}

fn seconds(from_ns: i64, to_ns: i64) -> f32 {
    (to_ns - from_ns) as f32 * 1e-9
}

/// Milliseconds from one time of the frames to another, wrapping.
#[must_use]
pub const fn milliseconds(from_ns: i64, to_ns: i64) -> u32 {
    // Both are whole milliseconds, 2^6 * 15625 ns, so the quotient is a product with the inverse of 15625 modulo 2^32.
    (((to_ns - from_ns) >> 6) as u32).wrapping_mul(1_757_569_337)
}
