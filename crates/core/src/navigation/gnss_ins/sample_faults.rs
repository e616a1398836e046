//! Faults of inertial samples: what a GNSS/INS uses instead of a false one, and what noise it then expects.

use nalgebra::Vector3;

use crate::faults::clipping::Clipping;
use crate::faults::sample_check::{Checked, SampleCheck};
use crate::faults::unseen_rotation::UnseenRotation;
use crate::faults::{Fault, FaultKind, FaultLog, FaultySensor};
use crate::scalar::{Scalar, lit, seconds};

/// A spike is worth an event where it would have turned (rad) or pushed (m/s) by so much.
const NOTABLE_TURN: f64 = 0.0175;
const NOTABLE_PUSH: f64 = 0.3;
/// Less of a turn is not doubted, rad.
const LEAST_TURN: f64 = 0.004;
/// White noise below is vibration, whose strength the filter learns: rad/sqrt(s), m/s/sqrt(s).
const LEAST_WALK: [f64; 2] = [0.1, 1.0];

/// What the checks of one sensor remember.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Sensor<T: Scalar> {
    check: SampleCheck<T>,
    /// The last good sample.
    good: Option<(i64, Vector3<T>)>,
    /// What was used last, and the integral of what was used since the last good one.
    used: Vector3<T>,
    given: Vector3<T>,
    /// Since when it is at the end of its range.
    saturated_since_ns: Option<i64>,
}

impl<T: Scalar> Default for Sensor<T> {
    fn default() -> Self {
        Self {
            check: SampleCheck::default(),
            good: None,
            used: Vector3::zeros(),
            given: Vector3::zeros(),
            saturated_since_ns: None,
        }
    }
}

/// The checks of both sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct SampleFaults<T: Scalar> {
    sensors: [Sensor<T>; 2],
    /// Of the gyroscope.
    clipping: Clipping<T>,
    motion: UnseenRotation<T>,
    pub(super) log: FaultLog<T>,
}

impl<T: Scalar> SampleFaults<T> {
    pub(super) fn new(angle_random_walk: T) -> Self {
        Self {
            // A bump of the road is no fault; a turn is remembered for longer.
            sensors: [(LEAST_TURN, LEAST_WALK[0]), (NOTABLE_PUSH, LEAST_WALK[1])].map(|least| {
                Sensor {
                    check: SampleCheck::new(lit(least.0), lit(least.1)),
                    ..Sensor::default()
                }
            }),
            clipping: Clipping::default(),
            motion: UnseenRotation::new(angle_random_walk),
            log: FaultLog::default(),
        }
    }

    /// The numbers, for checks of a saved state.
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let sensors = self.sensors.iter().flat_map(|sensor| {
            let good = sensor.good.iter().flat_map(|(_, good)| good);
            let used = sensor.used.iter().chain(&sensor.given);
            sensor.check.numbers().chain(good).chain(used)
        });
        sensors
            .chain(self.clipping.numbers())
            .chain(self.motion.numbers())
            .chain(self.log.numbers())
    }
}

/// What to use of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Usable<T: Scalar> {
    /// The sample, or what stands for it.
    pub(super) value: Vector3<T>,
    /// What the samples before it missed, to be made good in this interval (unit times s).
    pub(super) owed: Vector3<T>,
    /// Whether it is a measurement.
    pub(super) is_measured: bool,
    /// Since when it is not one, or is clipped.
    pub(super) faulty_since_ns: Option<i64>,
    /// The end of the range, where it is there.
    pub(super) full_scale: Option<T>,
}

impl<T: Scalar> SampleFaults<T> {
    /// Looks at an angular rate; `dt` (s) after the last. Where it is unknown it relaxes to `still`.
    pub(super) fn rate(
        &mut self,
        time_ns: i64,
        sample: &Vector3<T>,
        still: &Vector3<T>,
        dt: T,
    ) -> Usable<T> {
        let last = self.sensors[0].good;
        let mut usable = self.look(FaultySensor::Gyroscope, time_ns, sample, dt, NOTABLE_TURN);
        if let (false, Some(since_ns), Some((_, good))) =
            (usable.is_measured, usable.faulty_since_ns, last)
        {
            usable.value = self.relaxed(seconds(since_ns, time_ns), &good, still, dt);
            self.sensors[0].used = usable.value;
        } else if let (true, Some((last_ns, good))) = (usable.is_measured, last) {
            self.motion.learn(&good, sample, seconds(last_ns, time_ns));
        }
        usable
    }

    /// Stands for an angular rate of an instant at which the gyroscope delivers nothing; `last` is the rate used last.
    pub(super) fn missing_rate(
        &mut self,
        time_ns: i64,
        last: &Vector3<T>,
        still: &Vector3<T>,
        dt: T,
    ) -> Usable<T> {
        let unseen = self.unseen_rate(time_ns, last, still, dt);
        let since_ns = unseen.faulty_since_ns.unwrap_or(time_ns);
        self.log.lasts(Fault {
            sensor: FaultySensor::Gyroscope,
            kind: FaultKind::Missing,
            from_ns: since_ns,
            until_ns: time_ns,
            is_over: false,
            size: seconds(since_ns, time_ns),
        });
        unseen
    }

    /// Stands for an angular rate of an instant of which there is no sample.
    pub(super) fn unseen_rate(
        &mut self,
        time_ns: i64,
        last: &Vector3<T>,
        still: &Vector3<T>,
        dt: T,
    ) -> Usable<T> {
        let memory = &mut self.sensors[0];
        let (since_ns, good) = memory.good.unwrap_or((time_ns, *last));
        memory.saturated_since_ns = None;
        memory.given = Vector3::zeros();
        memory.check.interrupt();
        let value = self.relaxed(seconds(since_ns, time_ns), &good, still, dt);
        self.sensors[0].used = value;
        Usable {
            value,
            owed: Vector3::zeros(),
            is_measured: false,
            faulty_since_ns: Some(since_ns),
            full_scale: None,
        }
    }

    /// Mean rate in the last `dt` (s) of an age (s), of a rate that was `good` and relaxes to `still` (F4).
    fn relaxed(&self, age: T, good: &Vector3<T>, still: &Vector3<T>, dt: T) -> Vector3<T> {
        let held = |age: T| self.motion.since(&(good - still), age).held_s;
        let mean = (held(age) - held((age - dt).max(T::zero()))) / dt;
        still + (good - still) * mean
    }

    /// Variance of the angle (rad^2) that a rate which was not measured, or is clipped, adds in the last `dt` (s).
    pub(super) fn unseen_turn(&self, usable: &Usable<T>, time_ns: i64, dt: T) -> T {
        let Some(since_ns) = usable.faulty_since_ns else {
            return T::zero();
        };
        let age: T = seconds(since_ns, time_ns);
        let before = (age - dt).max(T::zero());
        let variance = |age| match usable.full_scale {
            Some(end) => {
                let end = Vector3::repeat(end);
                self.motion.between(&end, &end, age).variance
            }
            None => self.motion.since(&self.sensors[0].used, age).variance,
        };
        (variance(age) - variance(before)).max(T::zero())
    }

    /// Looks at a specific force; where it is unknown it is that of a body at `rest`.
    pub(super) fn force(
        &mut self,
        time_ns: i64,
        sample: &Vector3<T>,
        rest: &Vector3<T>,
        dt: T,
    ) -> Usable<T> {
        let sensor = FaultySensor::Accelerometer;
        let mut usable = self.look(sensor, time_ns, sample, dt, NOTABLE_PUSH);
        if !usable.is_measured && usable.faulty_since_ns.is_some() {
            usable.value = *rest;
            self.sensors[1].used = *rest;
        }
        usable
    }

    fn look(
        &mut self,
        sensor: FaultySensor,
        time_ns: i64,
        sample: &Vector3<T>,
        dt: T,
        notable: f64,
    ) -> Usable<T> {
        let memory = match sensor {
            FaultySensor::Gyroscope => &mut self.sensors[0],
            _ => &mut self.sensors[1],
        };
        let mut checked = memory.check.check(time_ns, sample);
        let (good_ns, good) = memory.good.unwrap_or((time_ns, *sample));
        let mut clipped_from_ns = good_ns;
        if matches!((sensor, checked), (FaultySensor::Gyroscope, Checked::Good))
            && let Some(clipped) = self.clipping.look(&memory.check, time_ns, sample)
        {
            clipped_from_ns = clipped.from_ns;
            checked = Checked::Saturated {
                full_scale: clipped.level,
            };
        }
        let mut fault = Fault {
            sensor,
            kind: FaultKind::Spike,
            from_ns: good_ns,
            until_ns: time_ns,
            is_over: false,
            size: T::zero(),
        };
        let mut usable = Usable {
            value: *sample,
            owed: Vector3::zeros(),
            is_measured: true,
            faulty_since_ns: None,
            full_scale: None,
        };
        let half = lit::<T>(0.5);
        let stepped = memory.given + (memory.used + sample) * (dt * half);
        match checked {
            Checked::Good => self.log.ends(sensor, time_ns),
            Checked::Suspect => {
                usable.value = good;
                usable.is_measured = false;
            }
            Checked::Step(integral) => usable.owed = integral - stepped,
            Checked::Spike { from_ns, size } => {
                let whole: T = seconds(good_ns, time_ns);
                usable.owed = (good + sample) * (whole * half) - stepped;
                (fault.from_ns, fault.size) = (from_ns, size);
                if size * dt > lit(notable) {
                    self.log.happened(fault);
                }
            }
            Checked::Stuck { from_ns } | Checked::Noise { from_ns } => {
                fault.kind = match checked {
                    Checked::Stuck { .. } => FaultKind::Stuck,
                    _ => FaultKind::Noise,
                };
                (fault.from_ns, fault.size) = (from_ns, seconds(from_ns, time_ns));
                self.log.lasts(fault);
                usable.is_measured = false;
                usable.faulty_since_ns = Some(from_ns);
            }
            Checked::Saturated { full_scale } => {
                let since_ns = *memory.saturated_since_ns.get_or_insert(clipped_from_ns);
                fault.kind = FaultKind::Saturated;
                (fault.from_ns, fault.size) = (since_ns, full_scale);
                self.log.lasts(fault);
                usable.faulty_since_ns = Some(since_ns);
                usable.full_scale = Some(full_scale);
            }
        }
        if !matches!(checked, Checked::Saturated { .. }) {
            memory.saturated_since_ns = None;
        }
        if usable.is_measured {
            memory.good = Some((time_ns, *sample));
            memory.given = Vector3::zeros();
        } else {
            memory.given += (memory.used + usable.value) * (dt * half);
        }
        memory.used = usable.value;
        usable
    }
}
