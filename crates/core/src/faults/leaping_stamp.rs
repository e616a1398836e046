//! Stamps that leap ahead: the first one is doubted until another sample goes on from it.
//!
//! A clock that stood, or a sensor that paused, goes on behind its leap. One false stamp does not: the sample after it
//! is back at the time before, and shows it.

use super::{Fault, FaultKind, FaultySensor};
use crate::scalar::{Scalar, seconds};

/// Where samples are rare: a stamp that is ahead by less than so many of their intervals is no leap.
const INTERVALS: i64 = 10;

/// The one stamp that is doubted.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct LeapingStamp {
    doubted: Option<Doubted>,
    /// The longest of the last intervals between samples, ns.
    interval_ns: i64,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Doubted {
    /// Whose it is; `None` for one that [`FaultySensor`] does not name.
    sensor: Option<FaultySensor>,
    time_ns: i64,
    /// The time before it.
    before_ns: i64,
}

/// What a stamp is taken for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stamp<T> {
    /// It goes on from those before it, and proves nothing false.
    GoesOn,
    /// It leaps ahead by more than the limit: not to be used unless the next one goes on from it.
    Doubted,
    /// It goes on from those before the doubted one, which was false.
    Refutes(Option<Fault<T>>),
}

impl LeapingStamp {
    /// Looks at a stamp beside the time of the samples so far; `limit` (s) ahead is no leap, nor are ten of the last
    /// intervals.
    pub fn look<T: Scalar>(
        &mut self,
        sensor: Option<FaultySensor>,
        now_ns: Option<i64>,
        time_ns: i64,
        limit: T,
    ) -> Stamp<T> {
        let Some(before_ns) = now_ns else {
            return Stamp::GoesOn;
        };
        let ahead_ns = time_ns.saturating_sub(before_ns);
        let is_rare = ahead_ns <= self.interval_ns.saturating_mul(INTERVALS);
        if !is_rare && seconds::<T>(before_ns, time_ns) > limit {
            let goes_on = |doubted: Doubted| seconds::<T>(time_ns, doubted.time_ns) <= limit;
            if self.doubted.take().is_some_and(goes_on) {
                self.interval_ns = ahead_ns;
                return Stamp::GoesOn;
            }
            self.doubted = Some(Doubted {
                sensor,
                time_ns,
                before_ns,
            });
            return Stamp::Doubted;
        }
        // What was on its way for longer says nothing of those that came before it.
        if time_ns <= before_ns {
            return Stamp::GoesOn;
        }
        // A pause is forgotten within a hundred samples.
        self.interval_ns = ahead_ns.max(self.interval_ns - self.interval_ns / 8);
        match self.doubted.take() {
            Some(doubted) => Stamp::Refutes(doubted.sensor.map(|sensor| Fault {
                sensor,
                kind: FaultKind::Stamp,
                from_ns: doubted.before_ns,
                until_ns: time_ns,
                is_over: true,
                size: seconds(doubted.before_ns, doubted.time_ns),
            })),
            None => Stamp::GoesOn,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const S: i64 = 1_000_000_000;
    const GYROSCOPE: Option<FaultySensor> = Some(FaultySensor::Gyroscope);

    fn look(stamps: &mut LeapingStamp, now: i64, at: i64) -> Stamp<f64> {
        stamps.look(GYROSCOPE, Some(now * S), at * S, 5.0)
    }

    #[test]
    fn one_stamp_ahead_is_refuted_by_the_next_and_told() {
        let mut stamps = LeapingStamp::default();
        assert_eq!(look(&mut stamps, 10, 15), Stamp::GoesOn);
        assert_eq!(look(&mut stamps, 15, 3615), Stamp::Doubted);
        // A sample that is late proves nothing.
        assert_eq!(look(&mut stamps, 15, 14), Stamp::GoesOn);
        let Stamp::Refutes(Some(fault)) = look(&mut stamps, 15, 16) else {
            panic!("refuted");
        };
        assert_eq!((fault.kind, fault.size), (FaultKind::Stamp, 3600.0));
        assert_eq!((fault.from_ns, fault.until_ns), (15 * S, 16 * S));
        assert_eq!(look(&mut stamps, 16, 17), Stamp::GoesOn);
    }

    #[test]
    fn behind_a_pause_the_second_sample_goes_on() {
        let mut stamps = LeapingStamp::default();
        assert_eq!(look(&mut stamps, 10, 100), Stamp::Doubted);
        // Another sensor may have looked a little earlier.
        assert_eq!(look(&mut stamps, 10, 99), Stamp::GoesOn);
        assert_eq!(look(&mut stamps, 99, 101), Stamp::GoesOn);
    }

    /// A sample each ten seconds, of two sensors that are read one after the other.
    #[test]
    fn rare_samples_are_no_leaps() {
        let mut stamps = LeapingStamp::default();
        let (mut now, mut doubted) = (0, 0);
        for k in 1..50_i64 {
            for time_ns in [10 * k * S, 10 * k * S + 3_000_000] {
                match stamps.look(GYROSCOPE, Some(now), time_ns, 5.0) {
                    Stamp::Doubted => doubted += 1,
                    Stamp::GoesOn => now = time_ns,
                    refuted @ Stamp::Refutes(_) => panic!("{refuted:?}"),
                }
            }
        }
        assert_eq!(doubted, 1);
        assert!(matches!(look(&mut stamps, 490, 4000), Stamp::Doubted));
    }

    #[test]
    fn two_false_stamps_that_do_not_agree_are_both_doubted() {
        let mut stamps = LeapingStamp::default();
        assert_eq!(look(&mut stamps, 10, 5000), Stamp::Doubted);
        assert_eq!(look(&mut stamps, 10, 1000), Stamp::Doubted);
        assert!(matches!(
            look(&mut stamps, 10, 11),
            Stamp::Refutes(Some(fault)) if (fault.size - 990.0).abs() < 1e-9
        ));
        assert_eq!(
            LeapingStamp::default().look(None, None, i64::MAX, 5.0),
            Stamp::GoesOn
        );
        assert_eq!(
            LeapingStamp::default().look(None, Some(i64::MIN), i64::MAX, 5.0),
            Stamp::Doubted
        );
    }
}
