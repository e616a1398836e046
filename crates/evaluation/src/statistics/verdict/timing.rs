//! Holes, jitter and bursts in the stamps of one sensor, in constant memory.
//!
//! A hole has lost samples. A burst has not: a pause is followed by the samples that were late, with stamps close together.

/// Intervals after which the mean interval is known well enough to judge the next one.
const ENOUGH: u64 = 20;
/// An interval this many times the mean one is a pause.
const PAUSE: f64 = 5.0;
/// A sample this much sooner than the mean interval after a pause is one that was late.
const LATE: f64 = 1.0 / 3.0;
/// Share of the missing samples that must not have come late for a pause to be a hole.
const LOST: f64 = 0.5;
/// Weight of the newest interval in the mean one.
const NEWEST: f64 = 1.0 / 50.0;
/// So many pauses of one length in a row, this much alike, are a new rate.
const NEW_RATE: u32 = 3;
const ALIKE: f64 = 0.3;
/// Samples closer to the one before than this share of the mean interval came with it, ...
const WITH: f64 = 0.1;
/// ... and where so large a share of the samples did, they come in bunches: stamps that merely vary, by up to half an interval, are
/// that close in one of thirty.
const BUNCHED: f64 = 0.25;
/// Where so large a share of the samples was put back where it was taken, it is said that they were.
const MOST: f64 = 0.25;
/// So many pauses that are made up for afterwards may be a busy computer.
const FEW_BURSTS: u64 = 3;
/// Intervals that vary by less than this share of the mean one are regular: timers are no better.
const REGULAR: f64 = 0.1;

/// A pause that has lost samples.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hole {
    /// The last sample before it, ns.
    pub start_ns: i64,
    /// How long, s.
    pub seconds: f64,
}

/// What the stamps of a sensor say.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct TimingSummary {
    /// Mean interval without the holes, s.
    pub interval_s: f64,
    /// Standard deviation of the interval, holes and bursts left out, s.
    pub jitter_s: f64,
    /// Pauses that have lost samples.
    pub holes: u64,
    /// Pauses whose samples came late.
    pub bursts: u64,
    /// Intervals.
    pub intervals: u64,
    /// Samples that came together with the one before, at the same instant or nearly.
    pub together: u64,
    /// Samples whose stamp was not taken for the time of measurement: that follows from the sensor's clock.
    pub restored: u64,
}

impl TimingSummary {
    /// Whether the intervals vary by more than a timer's share.
    #[must_use]
    pub fn is_irregular(&self) -> bool {
        self.jitter_s > REGULAR * self.interval_s
    }

    /// Whether samples come in bunches.
    #[must_use]
    pub fn is_bunched(&self) -> bool {
        self.together as f64 > BUNCHED * self.intervals as f64 || self.bursts > FEW_BURSTS
    }

    /// What a gyroscope's stamps look like where they are no times of measurement, and what that does; `None` where nothing is
    /// wrong with them.
    #[must_use]
    pub fn in_words(&self) -> Option<String> {
        if self.is_bunched() {
            let cure = if self.restored as f64 > MOST * self.intervals as f64 {
                "They were used as those of a regular clock; the sensor's own time is surer."
            } else {
                "Take the sensor's own time."
            };
            return Some(format!(
                "The gyroscope's samples come in bunches ({} of {} come with the one before, or make up for a \
                 pause): their stamps look like times of arrival. {cure}",
                self.bursts.max(self.together),
                self.intervals,
            ));
        }
        self.is_irregular().then(|| {
            format!(
                "The intervals between gyroscope samples vary by {:.1} ms about {:.1} ms: if these are times of arrival, \
                 a turn of 100 deg/s is off by {:.2} deg with each.",
                1e3 * self.jitter_s,
                1e3 * self.interval_s,
                100.0 * self.jitter_s,
            )
        })
    }
}

/// Watches the stamps of one sensor.
#[derive(Debug, Clone, Default)]
pub struct Timing {
    last_ns: Option<i64>,
    interval_s: f64,
    pause: Option<Pause>,
    summary: TimingSummary,
    /// Intervals that were not zero.
    stamps: u64,
    regular: u64,
    squares: f64,
}

/// A pause of which it is not known yet whether its samples come late.
#[derive(Debug, Clone, Copy)]
struct Pause {
    hole: Hole,
    missing: f64,
    late: f64,
    /// Pauses as long as this one just before it.
    alike: u32,
}

impl Timing {
    /// Takes so many samples that had the very stamp of the one before.
    pub const fn add_same(&mut self, samples: u64) {
        self.summary.intervals += samples;
        self.summary.together += samples;
    }

    /// Notes whether the last sample was used at another time than its stamp.
    pub fn add_restored(&mut self, restored: bool) {
        self.summary.restored += u64::from(restored);
    }

    /// Takes the next stamp. Returns the hole that it ends, which is known as soon as samples come regularly again.
    pub fn add(&mut self, time_ns: i64) -> Option<Hole> {
        let last_ns = self.last_ns.replace(time_ns)?;
        let dt = time_ns.saturating_sub(last_ns) as f64 * 1e-9;
        if dt < 0.0 {
            return None;
        }
        self.summary.intervals += 1;
        self.stamps += 1;
        if self.stamps <= ENOUGH {
            let n = self.stamps as f64;
            self.interval_s += (dt - self.interval_s) / n;
            return None;
        }
        let mean = self.interval_s;
        self.summary.together += u64::from(dt < WITH * mean);
        if dt > PAUSE * mean {
            return self.begin_pause(last_ns, dt);
        }
        if let Some(pause) = &mut self.pause
            && dt < LATE * mean
        {
            pause.late += 1.0;
            return None;
        }
        let ended = self.end_pause();
        self.regular += 1;
        self.squares += (dt - mean) * (dt - mean);
        self.interval_s += (dt - mean) * NEWEST;
        ended
    }

    fn begin_pause(&mut self, start_ns: i64, seconds: f64) -> Option<Hole> {
        let before = self
            .pause
            .filter(|p| p.late == 0.0 && (p.hole.seconds - seconds).abs() < ALIKE * seconds);
        let alike = before.map_or(0, |pause| pause.alike + 1);
        if alike >= NEW_RATE {
            // The sensor has another rate now: what was taken for holes were none.
            self.summary.holes -= u64::from(alike - 1).min(self.summary.holes);
            self.interval_s = seconds;
            self.pause = None;
            return None;
        }
        let ended = self.end_pause();
        self.pause = Some(Pause {
            hole: Hole { start_ns, seconds },
            missing: seconds / self.interval_s - 1.0,
            late: 0.0,
            alike,
        });
        ended
    }

    fn end_pause(&mut self) -> Option<Hole> {
        let pause = self.pause.take()?;
        if pause.late > (1.0 - LOST) * pause.missing {
            self.summary.bursts += 1;
            return None;
        }
        self.summary.holes += 1;
        Some(pause.hole)
    }

    /// What the stamps say so far.
    #[must_use]
    pub fn summary(&self) -> TimingSummary {
        TimingSummary {
            interval_s: self.interval_s,
            jitter_s: (self.squares / self.regular.max(1) as f64).sqrt(),
            ..self.summary
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use northing_simulation::random::{standard_normal, stream};

    fn fed(stamps_ms: impl Iterator<Item = f64>) -> (Timing, Vec<Hole>) {
        let mut timing = Timing::default();
        let holes = stamps_ms
            .filter_map(|t| timing.add((t * 1e6) as i64))
            .collect();
        (timing, holes)
    }

    #[test]
    fn a_hole_is_found_where_it_is_and_as_long_as_it_is() {
        let stamps = (0..500).filter(|k| !(200..223).contains(k));
        let (timing, holes) = fed(stamps.map(|k| f64::from(k) * 10.0));
        assert_eq!(holes.len(), 1);
        assert_eq!(holes[0].start_ns, 1_990_000_000);
        assert!((holes[0].seconds - 0.24).abs() < 1e-9);
        let summary = timing.summary();
        assert_eq!((summary.holes, summary.bursts), (1, 0));
        assert!(!summary.is_irregular() && (summary.interval_s - 0.01).abs() < 1e-6);
    }

    #[test]
    fn samples_that_come_in_bunches_are_bursts_and_no_holes() {
        // Ten at a time, 0.5 ms apart, every 100 ms.
        let stamps = (0..1000).map(|k| f64::from(k / 10) * 100.0 + f64::from(k % 10) * 0.5);
        let (timing, holes) = fed(stamps);
        assert_eq!(holes, []);
        assert!(timing.summary().bursts > 80, "{:?}", timing.summary());
    }

    #[test]
    fn jitter_is_measured_and_a_change_of_the_rate_is_no_series_of_holes() {
        let mut noise = stream(3, "jitter");
        let jittered = (0..2000).map(|k| f64::from(k) * 10.0 + 2.0 * standard_normal(&mut noise));
        let mut stamps: Vec<f64> = jittered.collect();
        stamps.sort_by(f64::total_cmp);
        let (timing, _) = fed(stamps.into_iter());
        let summary = timing.summary();
        // Two stamps have their own jitter each.
        assert!(
            (summary.jitter_s - 0.0028).abs() < 3e-4 && summary.is_irregular(),
            "{summary:?}"
        );
        let slower = (0..300)
            .map(|k| f64::from(k) * 10.0)
            .chain((0..300).map(|k| 3000.0 + f64::from(k) * 40.0));
        assert_eq!(fed(slower).1, []);
        let much_slower = (0..300)
            .map(|k| f64::from(k) * 10.0)
            .chain((0..300).map(|k| 3000.0 + f64::from(k) * 100.0));
        let (timing, holes) = fed(much_slower);
        assert!(holes.len() <= 2, "{holes:?}");
        assert_eq!(timing.summary().holes, 0);
    }
}
