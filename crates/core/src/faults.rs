//! Fault detection on samples, before any filter sees them: spikes, stuck values, noise, saturation, holes.
//!
//! Read first: `docs/derivations/faults.md`, whose equation numbers (F..) stand at the lines of this folder.
//!
//! One false number must not cost more than itself. A check looks at each sample beside those before it and says what a
//! filter may use; what was not seen is made good by a statistical model of the motion and becomes variance. Every fault is
//! an event: which sensor, what, from when to when, and how large. [`AttitudeDriver`](crate::attitude::AttitudeDriver) and
//! [`GnssIns`](crate::navigation::GnssIns) have it in front of them; nothing has to be set.
//!
//! | question | file |
//! |---|---|
//! | is this sample a spike, a stuck value, noise, clipped? | [`sample_check`] |
//! | is this rate clipped below the largest that was seen? | [`clipping`] |
//! | how far did it turn while nobody looked? | [`unseen_rotation`] |
//! | can this stamp be? | [`leaping_stamp`] |
//! | did the bias of the gyroscope step? | [`bias_step`] |
//! | how much white noise has the gyroscope? | [`rate_noise`] |
//! | when were samples taken that came in bunches? | [`sampling_clock`] |

pub mod bias_step;
pub mod clipping;
pub mod leaping_stamp;
pub mod rate_noise;
pub mod sample_check;
pub mod sampling_clock;
pub mod unseen_rotation;

use crate::scalar::{Scalar, seconds};

/// Events that wait to be taken; the oldest is lost to a ninth.
const CAPACITY: usize = 8;

/// The sensor that a fault is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum FaultySensor {
    /// Angular rate, rad/s.
    Gyroscope,
    /// Specific force, m/s^2.
    Accelerometer,
    /// Magnetic field, microtesla.
    Magnetometer,
}

/// What is wrong with the samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "kebab-case"))]
pub enum FaultKind {
    /// Samples far from those before and after them: left out.
    Spike,
    /// The same numbers again and again while the sensor was in motion: not measured.
    Stuck,
    /// White noise many times stronger than the changes before: not a measurement.
    Noise,
    /// A component at the end of the sensor's range, or at a limit below: what lies beyond was not seen.
    Saturated,
    /// No samples for longer than usual.
    Missing,
    /// A stamp far ahead of those before and after it: the sample was left out.
    Stamp,
    /// Its bias is another one than before, and stays so: the new one is removed.
    BiasStep,
}

/// A fault that was found in the samples.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Fault<T> {
    /// Whose samples.
    pub sensor: FaultySensor,
    /// What is wrong with them.
    pub kind: FaultKind,
    /// Stamp of the last good sample before.
    pub from_ns: i64,
    /// Stamp of the sample that showed it, or that ended it where it is over.
    pub until_ns: i64,
    /// Whether good samples have come since. A fault that lasts is told when it is found and when it is over, with the
    /// same `from_ns`.
    pub is_over: bool,
    /// How large: the jump of a spike, the level of a saturation (unit of the sensor); how far a stamp was ahead (s), how far a bias
    /// stepped (unit of the sensor); the seconds without a measurement of the others.
    pub size: T,
}

impl<T: Scalar> Fault<T> {
    /// The same, ended by the sample of a stamp.
    fn over(self, time_ns: i64) -> Self {
        let size = if self.kind == FaultKind::Saturated {
            self.size
        } else {
            seconds(self.from_ns, time_ns)
        };
        Self {
            until_ns: time_ns,
            is_over: true,
            size,
            ..self
        }
    }
}

/// Faults that nobody has asked for yet.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FaultQueue<T> {
    waiting: [Option<Fault<T>>; CAPACITY],
}

impl<T: Scalar> Default for FaultQueue<T> {
    fn default() -> Self {
        Self {
            waiting: [None; CAPACITY],
        }
    }
}

impl<T: Scalar> FaultQueue<T> {
    /// Adds a fault behind the others.
    pub fn push(&mut self, fault: Fault<T>) {
        if self.waiting.iter().all(Option::is_some) {
            self.waiting.rotate_left(1);
            if let Some(last) = self.waiting.last_mut() {
                *last = Some(fault);
            }
        } else if let Some(free) = self.waiting.iter_mut().find(|slot| slot.is_none()) {
            *free = Some(fault);
        }
    }

    /// The oldest, which is then forgotten.
    pub fn take(&mut self) -> Option<Fault<T>> {
        let [first, ..] = &mut self.waiting;
        let oldest = first.take()?;
        self.waiting.rotate_left(1);
        Some(oldest)
    }

    /// The sizes, for checks of a saved state.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = &T> {
        self.waiting.iter().flatten().map(|fault| &fault.size)
    }
}

/// Faults that were found, and those that are not over.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct FaultLog<T> {
    found: FaultQueue<T>,
    /// By sensor.
    open: [Option<Fault<T>>; 3],
}

impl<T: Scalar> Default for FaultLog<T> {
    fn default() -> Self {
        Self {
            found: FaultQueue::default(),
            open: [None; 3],
        }
    }
}

impl<T: Scalar> FaultLog<T> {
    /// The oldest event that was not taken yet.
    pub fn take(&mut self) -> Option<Fault<T>> {
        self.found.take()
    }

    /// The fault of a sensor under way.
    pub fn now(&self, sensor: FaultySensor) -> Option<&Fault<T>> {
        self.open.get(sensor as usize)?.as_ref()
    }

    /// A fault that began and ended.
    pub(crate) fn happened(&mut self, fault: Fault<T>) {
        self.found.push(Fault {
            is_over: true,
            ..fault
        });
    }

    /// A fault that goes on or has just been found: told once.
    pub(crate) fn lasts(&mut self, fault: Fault<T>) {
        let Some(open) = self.open.get_mut(fault.sensor as usize) else {
            return;
        };
        let is_new = open.is_none_or(|o| (o.kind, o.from_ns) != (fault.kind, fault.from_ns));
        let before = open.replace(fault);
        if is_new {
            if let Some(before) = before {
                self.found.push(before.over(fault.until_ns));
            }
            self.found.push(fault);
        }
    }

    /// A good sample of a sensor: a fault under way is over.
    #[inline]
    pub(crate) fn ends(&mut self, sensor: FaultySensor, time_ns: i64) {
        // Nearly always there is none: nothing is moved then.
        if let Some(open) = self.open.get_mut(sensor as usize)
            && open.is_some()
            && let Some(fault) = open.take()
        {
            self.found.push(fault.over(time_ns));
        }
    }

    /// The sizes, for checks of a saved state.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = &T> {
        let open = self.open.iter().flatten().map(|fault| &fault.size);
        self.found.numbers().chain(open)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_taken_in_their_order_and_the_oldest_give_way() {
        let mut queue = FaultQueue::default();
        let fault = |from_ns| Fault {
            sensor: FaultySensor::Gyroscope,
            kind: FaultKind::Spike,
            from_ns,
            until_ns: from_ns + 1,
            is_over: true,
            size: 1.0_f32,
        };
        (0..10).for_each(|k| queue.push(fault(k)));
        let taken: std::vec::Vec<i64> =
            core::iter::from_fn(|| queue.take().map(|f| f.from_ns)).collect();
        assert_eq!(taken, [2, 3, 4, 5, 6, 7, 8, 9]);
        queue.push(fault(11));
        assert_eq!(queue.take(), Some(fault(11)));
        assert_eq!(queue.take(), None);
    }
}
