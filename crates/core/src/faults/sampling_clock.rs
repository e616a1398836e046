//! Sampling instants of a sensor whose stamps are times of arrival: samples that come in bunches.
//!
//! A FIFO that is read at once, a radio packet, a logger that is busy: several samples are delivered together, with one stamp or with
//! those of their reading, and then comes a pause. The stamps say when samples arrived; when they were taken, the sensor's own
//! clock decides, and that is regular. [`SamplingClock`] sees from the stamps alone that samples come in bunches, follows the clock
//! through the last sample of each bunch (`docs/derivations/faults.md`, F17), and gives the sampling instants. Stamps that are
//! not bunched are passed on as they are.

use crate::scalar::{Scalar, lit, seconds, to_f64};

/// Intervals after which the mean one is known well enough to judge the next.
const FEWEST: u32 = 24;
/// Memory of the mean interval and of the share of bunched samples, samples.
const MEMORY: f64 = 64.0;
/// A sample that comes sooner behind the one before than this share of the mean interval came with it.
const WITH: f64 = 0.25;
/// The pause behind a bunch makes up for its samples: it is as long as they lasted, within this factor.
const MAKES_UP: f64 = 2.0;
/// Samples come in bunches where so large a share of them did, in so many bunches; no longer below the second share. Stamps that
/// merely vary, by up to half an interval, are that close in one of twelve.
const BUNCHED: f64 = 0.25;
const BUNCHES: u8 = 4;
const ENOUGH: u32 = 32;
const REGULAR: f64 = 0.1;
/// Longer than so many mean intervals is a hole and no pause: no bunch is as large. Where so many of them follow one another, it is
/// the interval that has changed.
const HOLE: f64 = 40.0;
const HOLES: u8 = 3;
/// The line through the ends of bunches remembers so many.
const ENDS: u32 = 32;
/// A sample that is late by more than so many times the latest one so far, and intervals, comes behind a hole.
const LATER: f64 = 2.0;
const LATE: f64 = 4.0;
/// An end that is off by more than so many intervals, and by more than usual by this factor, counts only if the next one agrees.
const OFF: f64 = 0.5;
const USUALLY_OFF: f64 = 4.0;
/// Instants follow one another by at least this share of an interval.
const LEAST: f64 = 0.25;

/// Finds the sampling instants of one sensor from the stamps of its samples.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SamplingClock<T: Scalar> {
    arrived_ns: Option<i64>,
    given_ns: i64,
    samples: u32,
    holes: u8,
    /// Mean interval, s.
    interval: T,
    /// Samples since the last pause, that came with one another.
    run: u32,
    /// Share of the samples that came so, of how many, and their bunches.
    share: T,
    judged: u32,
    bunches: u8,
    /// The sensor's clock, while samples come in bunches.
    line: Option<Line<T>>,
}

/// A line through the last samples of the bunches, over the count of samples.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Line<T: Scalar> {
    /// When the last sample was taken; where that is not known, by the next end.
    instant_ns: i64,
    is_lost: bool,
    /// Interval of the sensor's clock, s.
    interval: T,
    /// Ends that the line is through, and samples since the last.
    ends: u32,
    since_end: u32,
    /// How far ends usually are from it, s, and the last that did not count.
    usually_off: T,
    doubted: Option<T>,
    /// How late the first of a bunch comes, s: on average, and the latest.
    late: T,
    latest: T,
}

impl<T: Scalar> Default for SamplingClock<T> {
    fn default() -> Self {
        Self {
            arrived_ns: None,
            given_ns: i64::MIN,
            samples: 0,
            holes: 0,
            interval: T::zero(),
            run: 0,
            share: T::zero(),
            judged: 0,
            bunches: 0,
            line: None,
        }
    }
}

fn to_ns<T: Scalar>(seconds: T) -> i64 {
    // Saturates, and is zero for what is no number.
    let ns = to_f64(seconds) * 1e9;
    (ns + if ns < 0.0 { -0.5 } else { 0.5 }) as i64
}

impl<T: Scalar> SamplingClock<T> {
    /// Whether the samples come in bunches, so that their instants are those of the sensor's clock.
    #[inline]
    #[must_use]
    pub const fn is_bunched(&self) -> bool {
        self.line.is_some()
    }

    /// Interval between samples (s): that of the sensor's clock where they come in bunches, else the mean one. None before there
    /// were a few.
    #[must_use]
    pub fn interval_s(&self) -> Option<T> {
        let mean = (self.samples >= FEWEST).then_some(self.interval);
        self.line.as_ref().map(|line| line.interval).or(mean)
    }

    /// Stamp of the last sample.
    #[inline]
    #[must_use]
    pub const fn arrived_ns(&self) -> Option<i64> {
        self.arrived_ns
    }

    /// No later sample gets an instant before this one (ns), where all that come arrive at `now_ns` or later and the sensor does not
    /// stay away for longer than it has before.
    #[must_use]
    pub fn earliest_next_ns(&self, now_ns: i64) -> i64 {
        let Some(line) = &self.line else {
            return now_ns;
        };
        let longest = line.longest_wait() + line.interval;
        let Some(arrived_ns) = self.arrived_ns else {
            return now_ns.saturating_sub(to_ns(longest));
        };
        if seconds::<T>(arrived_ns, now_ns) > longest {
            return now_ns;
        }
        let least_ns = to_ns(line.interval * lit(LEAST)).max(1);
        self.given_ns.saturating_add(least_ns).min(now_ns)
    }

    /// The same clock before the first sample, with what was learnt of it: for those who can look at the first samples of a
    /// recording before they use them.
    #[must_use]
    pub fn rewound(&self) -> Self {
        Self {
            arrived_ns: None,
            given_ns: i64::MIN,
            run: 0,
            line: self.line.map(|line| Line {
                is_lost: true,
                since_end: 0,
                doubted: None,
                ..line
            }),
            ..*self
        }
    }

    /// The instant (ns) at which a sample was taken that arrived with a stamp (ns). Instants increase. None for a stamp that is older
    /// than the last, or equal to it while samples do not come in bunches.
    #[inline]
    pub fn arrived(&mut self, time_ns: i64) -> Option<i64> {
        let Some(last_ns) = self.arrived_ns else {
            self.arrived_ns = Some(time_ns);
            let begins = |line: &mut Line<T>| {
                line.instant_ns = time_ns.saturating_sub(to_ns(line.late));
                line.instant_ns
            };
            let instant_ns = self.line.as_mut().map_or(time_ns, begins);
            return Some(self.give(instant_ns, T::zero()));
        };
        if time_ns < last_ns {
            return None;
        }
        self.arrived_ns = Some(time_ns);
        let dt = seconds(last_ns, time_ns);
        let came_with = self.look(dt);
        let Some(line) = &mut self.line else {
            // What was given for the last bunch may lie ahead of its arrival.
            return (time_ns > last_ns).then(|| self.give(time_ns, T::zero()));
        };
        if !came_with {
            line.ends_at(last_ns);
        }
        line.step(time_ns, !came_with);
        let (instant_ns, interval) = (line.instant_ns, line.interval);
        Some(self.give(instant_ns, interval))
    }

    fn give(&mut self, instant_ns: i64, interval: T) -> i64 {
        let least_ns = to_ns(interval * lit(LEAST)).max(1);
        self.given_ns = instant_ns.max(self.given_ns.saturating_add(least_ns));
        self.given_ns
    }

    /// Learns how samples come; whether this one came with the one before.
    #[inline]
    fn look(&mut self, dt: T) -> bool {
        if self.samples < FEWEST {
            self.samples += 1;
            self.interval += (dt - self.interval) / lit(f64::from(self.samples));
            return false;
        }
        let mean = self.interval;
        if dt > mean * lit(HOLE) {
            self.run = 0;
            self.holes = self.holes.saturating_add(1);
            if self.holes >= HOLES {
                *self = Self {
                    arrived_ns: self.arrived_ns,
                    given_ns: self.given_ns,
                    ..Self::default()
                };
            }
            return false;
        }
        self.holes = 0;
        let weight = lit::<T>(1.0 / MEMORY);
        self.interval += (dt - mean) * weight;
        if dt < mean * lit(WITH) {
            self.run = self.run.saturating_add(1);
            return true;
        }
        self.pause(dt);
        false
    }

    /// Whether a pause makes up for the samples that came together before it.
    fn pause(&mut self, dt: T) {
        let together = core::mem::take(&mut self.run);
        if together == 0 && self.share <= T::zero() && self.judged >= ENOUGH {
            // The usual case: as regular as ever.
            return;
        }
        let due = self.interval * lit(f64::from(together) + 1.0);
        let makes_up = together > 0 && dt * lit(MAKES_UP) > due && dt < due * lit(MAKES_UP);
        self.bunches = self.bunches.saturating_add(u8::from(makes_up));
        let came_with = if makes_up { T::one() } else { T::zero() };
        for k in 0..=together.min(MEMORY as u32) {
            // All but one of a bunch came with another.
            let one = if k == 0 { T::zero() } else { came_with };
            self.judged = (self.judged + 1).min(MEMORY as u32);
            self.share += (one - self.share) / lit(f64::from(self.judged));
        }
        if self.share < lit(REGULAR) {
            self.line = None;
            self.bunches = self.bunches.min(BUNCHES - 1);
        } else if self.line.is_none()
            && self.judged >= ENOUGH
            && self.share > lit(BUNCHED)
            && self.bunches >= BUNCHES
        {
            self.line = Some(Line::new(self.interval, dt - self.interval));
        }
    }
}

impl<T: Scalar> Line<T> {
    /// Of a sensor whose last sample ended a bunch, and whose next one came so late (s).
    fn new(interval: T, late: T) -> Self {
        Self {
            instant_ns: 0,
            is_lost: true,
            interval,
            ends: 0,
            since_end: 0,
            usually_off: T::zero(),
            doubted: None,
            late,
            latest: late,
        }
    }

    /// The last sample was the last of its bunch, and arrived as it was taken (F17).
    fn ends_at(&mut self, arrived_ns: i64) {
        let samples = core::mem::take(&mut self.since_end);
        if core::mem::take(&mut self.is_lost) {
            self.instant_ns = arrived_ns;
            self.ends = self.ends.max(1);
            return;
        }
        let off: T = seconds(self.instant_ns, arrived_ns);
        let far = self.usually_off * lit(USUALLY_OFF) + self.interval * lit(OFF);
        if self.ends > 2 && off.abs() > far {
            // As far, or further on the same side: another rate drifts away.
            let agrees = |doubted: T| doubted * off > T::zero() && off.abs() > doubted.abs() - far;
            if !self.doubted.take().is_some_and(agrees) {
                self.doubted = Some(off);
                self.since_end = samples;
                return;
            }
            // The clock has jumped, or runs at another rate: the line begins here.
            self.instant_ns = arrived_ns;
            self.ends = 1;
            return;
        }
        self.doubted = None;
        self.ends = (self.ends + 1).min(ENDS);
        // Gains of the line of least squares through so many points.
        let n = lit::<T>(f64::from(self.ends));
        let per_pair = T::one() / (n * (n + T::one()));
        let phase = (n * lit(4.0) - lit(2.0)) * per_pair;
        let rate = lit::<T>(6.0) * per_pair;
        if self.ends > 2 {
            self.usually_off += (off.abs() - self.usually_off) / n;
        }
        self.instant_ns = self.instant_ns.saturating_add(to_ns(off * phase));
        if samples > 0 {
            self.interval += off * rate / lit(f64::from(samples));
        }
    }

    /// So late a sample comes behind a hole, s (F18).
    fn longest_wait(&self) -> T {
        self.latest * lit(LATER) + self.interval * lit(LATE)
    }

    /// Goes on to a sample that arrived, by itself or as the first of a bunch.
    fn step(&mut self, arrived_ns: i64, is_first: bool) {
        self.instant_ns = self.instant_ns.saturating_add(to_ns(self.interval));
        self.since_end = self.since_end.saturating_add(1);
        if !is_first {
            return;
        }
        let late: T = seconds(self.instant_ns, arrived_ns);
        if late > self.longest_wait() {
            self.instant_ns = arrived_ns.saturating_sub(to_ns(self.late));
            self.is_lost = true;
            return;
        }
        // The interval is known from the second end on.
        let known = self.ends.saturating_sub(1).max(1);
        self.late += (late - self.late) / lit(f64::from(known));
        self.latest = late.max(self.latest - self.latest * lit(1.0 / MEMORY));
    }
}

#[cfg(test)]
mod tests;
