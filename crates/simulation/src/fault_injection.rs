//! Fault injection: one fault of the [`CATALOGUE`] laid over a clean stream of samples, so that what it costs is the difference.
//!
//! A fault is a kind, a size, a duration and its sensors. The stream may be simulated or recorded. What the fault does not touch
//! stays as it is, and what is drawn (axis, sign, direction, noise) depends on the seed alone. Values that stay or go are made by
//! [`FaultInjector`]; here are the faults that need the whole stream.

use nalgebra::Vector3;
use northing_recording::{Event, Sample, SensorKind};
use serde::Serialize;

use crate::faults::{Fault, FaultInjector, FaultKind};
use crate::signals::Draws;

mod catalogue;
mod spin;

pub use catalogue::CATALOGUE;

use spin::Spin;

/// Radius of the Earth that turns metres into latitude, m: good enough for a fix that is far off.
const EARTH_RADIUS_M: f64 = 6.371e6;
/// Part of a stream in which faults begin.
const ONSET: [f64; 2] = [0.28, 0.38];
/// So many instants are drawn, of which the one with the fastest motion is taken.
const ONSET_CANDIDATES: usize = 12;
/// The motion of an instant is that of so long after it, s.
const ONSET_MOTION_S: f64 = 1.0;

/// The sensors whose samples a fault changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum InjectionTarget {
    /// The gyroscope.
    Gyroscope,
    /// The accelerometer.
    Accelerometer,
    /// The magnetometer, calibrated and not.
    Magnetometer,
    /// Gyroscope, accelerometer, magnetometer and compass.
    All,
    /// The satellite receiver.
    Receiver,
}

/// What a fault does to samples.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(tag = "what", rename_all = "kebab-case")]
pub enum Effect {
    /// One sample is wrong: one axis, or all, at this value, in the sensor's unit.
    Spike {
        /// Its size.
        value: f64,
        /// Whether on all axes.
        all_axes: bool,
    },
    /// The last value from before is repeated.
    Frozen,
    /// Zeros.
    Zeros,
    /// No axis shows more than this share of the largest value that the motion has meanwhile.
    ClippedShare {
        /// The share.
        share: f64,
    },
    /// The device spins about one axis, and the sensor clips. The truth spins, too.
    ClippedSpin {
        /// Rate of the spin, rad/s.
        rate_rad_s: f64,
        /// Full scale, rad/s.
        full_scale: f64,
    },
    /// The bias steps in a random direction and stays, in the sensor's unit.
    BiasStep {
        /// How far.
        size: f64,
    },
    /// Nothing is delivered.
    Missing,
    /// White noise in place of the samples: standard deviations an axis of rate (rad/s), force (m/s^2) and field (microtesla).
    Garbage {
        /// Of gyroscope, accelerometer, magnetometer.
        std: [f64; 3],
    },
    /// One stamp is ahead.
    StampAhead {
        /// By how much, s.
        by_s: f64,
    },
    /// One fix lies elsewhere.
    FixOff {
        /// How far to the north, m.
        north_m: f64,
    },
}

/// A fault of the catalogue.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct InjectedFault {
    /// Its name on the command line and in tables.
    pub name: &'static str,
    /// Whose samples it changes.
    pub target: InjectionTarget,
    /// What it does to them.
    pub effect: Effect,
    /// How long it acts, s; 0 for one sample, and for a step, which stays.
    pub duration_s: f64,
}

impl InjectedFault {
    /// The fault of that name.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Self> {
        CATALOGUE.iter().find(|fault| fault.name == name)
    }

    /// All names, for messages.
    #[must_use]
    pub fn names() -> String {
        let names: Vec<_> = CATALOGUE.iter().map(|fault| fault.name).collect();
        names.join(", ")
    }

    /// Whether one sample is wrong.
    #[must_use]
    pub const fn is_one_sample(&self) -> bool {
        matches!(
            self.effect,
            Effect::Spike { .. } | Effect::StampAhead { .. } | Effect::FixOff { .. }
        )
    }

    /// Whether it stays to the end.
    #[must_use]
    pub const fn stays(&self) -> bool {
        matches!(self.effect, Effect::BiasStep { .. })
    }

    /// Whether it needs a motion that can be changed, which a recording is not.
    #[must_use]
    pub const fn needs_simulation(&self) -> bool {
        matches!(self.effect, Effect::ClippedSpin { .. })
    }

    /// Whether a sensor's samples are changed.
    #[must_use]
    pub const fn touches(&self, kind: SensorKind) -> bool {
        let gyroscope = matches!(kind, SensorKind::Gyroscope);
        let accelerometer = matches!(kind, SensorKind::Accelerometer);
        let magnetometer = matches!(
            kind,
            SensorKind::Magnetometer | SensorKind::MagnetometerUncalibrated
        );
        match self.target {
            InjectionTarget::Gyroscope => gyroscope,
            InjectionTarget::Accelerometer => accelerometer,
            InjectionTarget::Magnetometer => magnetometer,
            InjectionTarget::All => {
                let compass = matches!(kind, SensorKind::CompassHeading);
                gyroscope || accelerometer || magnetometer || compass
            }
            InjectionTarget::Receiver => {
                matches!(kind, SensorKind::GnssPosition | SensorKind::GnssVelocity)
            }
        }
    }

    /// The stream with this fault from an instant on, and when the fault was over: from then on samples are normal, or
    /// for a step as they will stay.
    #[must_use]
    pub fn inject(&self, events: &[Event], from_ns: i64, seed: u64) -> (Vec<Event>, i64) {
        let until_ns = from_ns + nanoseconds(self.duration_s);
        let span = [from_ns, until_ns];
        let mut draws = Draws::new(seed, "injected-fault");
        let events = match self.effect {
            Effect::Spike { value, all_axes } => {
                self.spiked(events, from_ns, value, all_axes, &mut draws)
            }
            Effect::StampAhead { by_s } => self.one(events, from_ns, |event| {
                event.time_ns += nanoseconds(by_s);
            }),
            Effect::FixOff { north_m } => self.one(events, from_ns, |event| {
                if let Sample::GnssPosition(fix) = &mut event.sample {
                    fix.latitude_rad += north_m / EARTH_RADIUS_M;
                }
            }),
            Effect::Missing => without(events, span, |kind| self.touches(kind)),
            Effect::Frozen if self.target == InjectionTarget::Receiver => {
                frozen_fixes(events, span)
            }
            Effect::Frozen => self.wrapped(events, span, &FaultKind::Freeze),
            Effect::Zeros => self.wrapped(events, span, &FaultKind::Scale { factor: 0.0 }),
            Effect::BiasStep { size } => {
                let step = draws.direction() * size;
                let value = step.iter().copied().collect();
                self.wrapped(events, [from_ns, i64::MAX], &FaultKind::Offset { value })
            }
            Effect::ClippedShare { share } => {
                self.clipped(events, span, share * self.largest(events, span))
            }
            Effect::ClippedSpin {
                rate_rad_s,
                full_scale,
            } => {
                let spin = Spin::new(draws.one_of(&[0, 1, 2]), rate_rad_s, span);
                let spun: Vec<_> = events.iter().map(|event| spin.of(event)).collect();
                self.clipped(&spun, span, full_scale)
            }
            Effect::Garbage { std } => {
                let kept = without(events, span, |kind| kind == SensorKind::CompassHeading);
                self.changed(&kept, span, |v, kind| {
                    *v = draws.normals() * std[kind.order().min(2)];
                })
            }
        };
        (events, until_ns)
    }

    /// A stream with each vector of the sensor changed within a span.
    fn changed(
        &self,
        events: &[Event],
        span: [i64; 2],
        mut change: impl FnMut(&mut Vector3<f64>, SensorKind),
    ) -> Vec<Event> {
        let one = |event: &Event| {
            let kind = event.sample.kind();
            match event.sample.vector() {
                Some(mut vector) if within(span, event) && self.touches(kind) => {
                    change(&mut vector, kind);
                    with_vector(event, vector)
                }
                _ => *event,
            }
        };
        events.iter().map(one).collect()
    }

    /// A stream whose sensor is wrapped in a fault.
    fn wrapped(&self, events: &[Event], [from, until]: [i64; 2], kind: &FaultKind) -> Vec<Event> {
        let seconds = |ns: i64| ns.saturating_sub(from) as f64 * 1e-9;
        let mut injectors: [Option<FaultInjector<3>>; SensorKind::ALL.len()] =
            [const { None }; SensorKind::ALL.len()];
        let one = |event: &Event| {
            let sensor = event.sample.kind();
            let vector = event.sample.vector().filter(|_| self.touches(sensor));
            let (Some(vector), Some(slot)) = (vector, injectors.get_mut(sensor.order())) else {
                return Some(*event);
            };
            let injector = slot.get_or_insert_with(|| {
                FaultInjector::new(vec![Fault {
                    kind: kind.clone(),
                    from_s: 0.0,
                    until_s: seconds(until),
                }])
            });
            let applied = injector.apply(seconds(event.time_ns), vector.into())?;
            Some(with_vector(event, applied.into()))
        };
        events.iter().filter_map(one).collect()
    }

    /// A stream whose first sample of the sensor at or after an instant is changed.
    fn one(&self, events: &[Event], from_ns: i64, change: impl FnOnce(&mut Event)) -> Vec<Event> {
        let mut changed = events.to_vec();
        let meant = |e: &&mut Event| {
            let kind = e.sample.kind();
            let position =
                self.target != InjectionTarget::Receiver || kind == SensorKind::GnssPosition;
            e.time_ns >= from_ns && self.touches(kind) && position
        };
        if let Some(event) = changed.iter_mut().find(meant) {
            change(event);
        }
        changed
    }

    /// A stream with one sample of which one axis, or each, has this value with a random sign.
    fn spiked(
        &self,
        events: &[Event],
        from_ns: i64,
        value: f64,
        all_axes: bool,
        draws: &mut Draws,
    ) -> Vec<Event> {
        self.one(events, from_ns, |event| {
            if let Some(mut vector) = event.sample.vector() {
                let axis = draws.one_of(&[0, 1, 2]);
                for k in 0..3 {
                    let sign = draws.sign();
                    if all_axes || k == axis {
                        vector[k] = sign * value;
                    }
                }
                *event = with_vector(event, vector);
            }
        })
    }

    /// The largest value of an axis of the sensor within a span.
    fn largest(&self, events: &[Event], span: [i64; 2]) -> f64 {
        let of_span = events.iter().filter(|event| within(span, event));
        let touched = of_span.filter(|event| self.touches(event.sample.kind()));
        let sizes = touched.filter_map(|event| event.sample.vector().map(|v| v.amax()));
        sizes.fold(0.0, f64::max)
    }

    /// A stream in which no axis of the sensor shows more than a limit within a span.
    fn clipped(&self, events: &[Event], span: [i64; 2], limit: f64) -> Vec<Event> {
        self.changed(events, span, |v, _| {
            v.apply(|x| *x = x.clamp(-limit, limit));
        })
    }
}

/// When a fault begins: of a few instants around a third of a stream the one at which it turns fastest. `None` for a stream
/// without samples of the gyroscope there.
#[must_use]
pub fn onset(events: &[Event], seed: u64) -> Option<i64> {
    let (first, last) = (events.first()?.time_ns, events.last()?.time_ns);
    let mut draws = Draws::new(seed, "fault-onset");
    let rates: Vec<(i64, f64)> = events
        .iter()
        .filter_map(|event| match event.sample {
            Sample::AngularRate(rate) => Some((event.time_ns, rate.norm_squared())),
            _ => None,
        })
        .collect();
    let motion = |from: i64| {
        let begin = rates.partition_point(|(time, _)| *time < from);
        let after = rates[begin..].iter();
        let soon = after.take_while(|(time, _)| *time < from + nanoseconds(ONSET_MOTION_S));
        let (count, sum) = soon.fold((0_u32, 0.0), |(n, sum), (_, x)| (n + 1, sum + x));
        (count > 0).then(|| sum / f64::from(count))
    };
    (0..ONSET_CANDIDATES)
        .map(|_| first + ((last - first) as f64 * draws.uniform(ONSET[0], ONSET[1])) as i64)
        .filter_map(|from| motion(from).map(|size| (from, size)))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(from, _)| from)
}

fn nanoseconds(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}

fn within([from, until]: [i64; 2], event: &Event) -> bool {
    (from..until).contains(&event.time_ns)
}

/// A stream without what some sensors deliver within a span.
fn without(events: &[Event], span: [i64; 2], is_gone: impl Fn(SensorKind) -> bool) -> Vec<Event> {
    let kept = |event: &&Event| !(within(span, event) && is_gone(event.sample.kind()));
    events.iter().filter(kept).copied().collect()
}

/// The event with another vector.
fn with_vector(event: &Event, vector: Vector3<f64>) -> Event {
    let sample = match event.sample {
        Sample::AngularRate(_) => Sample::AngularRate(vector),
        Sample::SpecificForce(_) => Sample::SpecificForce(vector),
        Sample::MagneticField(_) => Sample::MagneticField(vector),
        Sample::MagneticFieldUncalibrated(_) => Sample::MagneticFieldUncalibrated(vector),
        other => other,
    };
    Event { sample, ..*event }
}

/// Fixes of a receiver that repeats its last position and velocity.
fn frozen_fixes(events: &[Event], span: [i64; 2]) -> Vec<Event> {
    let (mut position, mut velocity) = (None, None);
    let one = |event: &Event| {
        let last = match event.sample {
            Sample::GnssPosition(_) => &mut position,
            Sample::GnssVelocity(_) => &mut velocity,
            _ => return *event,
        };
        if within(span, event) {
            let sample = last.unwrap_or(event.sample);
            return Event { sample, ..*event };
        }
        *last = Some(event.sample);
        *event
    };
    events.iter().map(one).collect()
}

#[cfg(test)]
mod tests;
