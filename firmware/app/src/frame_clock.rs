//! How many intervals a frame of the IMU stands for, from a counter of microseconds that rolls over.
//!
//! Frames carry no stamps. They come every [`INTERVAL_US`], but a byte may wait and a frame may be
//! lost: one that is late by less than [`LATE_US`] stands for one interval, a later one for those that
//! are missing as well. When a frame was late and not lost, the next follows on its heels and stands
//! for none: time is not gained.

/// From frame to frame, microseconds: 50 Hz.
pub const INTERVAL_US: u32 = 20_000;
/// A frame this late, microseconds, tells that the one before it was lost.
const LATE_US: i32 = 15_000;
/// A frame this early, microseconds, was taken for lost.
const EARLY_US: i32 = -15_000;
/// More intervals than this, one second, are a new start.
pub const MOST_INTERVALS: u32 = 50;

/// The clock of frames.
#[derive(Debug, Clone, Copy, Default)]
pub struct FrameClock {
    /// When the next frame is due, by the counter.
    due_us: Option<u32>,
    /// Intervals that were counted for frames that may still come.
    ahead: u32,
    /// Frames that did not come, wrapping.
    pub missing: u32,
}

/// What a frame means in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Passed {
    /// So many intervals since the frame before; 0 for one that had been taken for lost.
    Intervals(u32),
    /// The first frame, or the first after a pause of more than a second.
    NewStart,
}

impl FrameClock {
    /// A frame has come at `now_us`.
    pub fn frame(&mut self, now_us: u32) -> Passed {
        let Some(due_us) = self.due_us else {
            return self.start(now_us);
        };
        // Right for half the counter's range, 35 minutes: beyond, `is_silent` has made a new start.
        let late_us = now_us.wrapping_sub(due_us) as i32;
        if late_us > (MOST_INTERVALS * INTERVAL_US) as i32 {
            return self.start(now_us);
        }
        let missed = if late_us >= LATE_US {
            let over = late_us.unsigned_abs() + INTERVAL_US / 4;
            over / INTERVAL_US
        } else {
            0
        };
        if missed > 0 {
            self.missing = self.missing.wrapping_add(missed);
            self.ahead = missed;
        }
        let intervals = if missed == 0 && late_us <= EARLY_US && self.ahead > 0 {
            self.ahead -= 1;
            self.missing = self.missing.wrapping_sub(1);
            0
        } else {
            missed + 1
        };
        // The sender's clock is not ours: what is due follows what comes, slowly.
        let rest_us = late_us - (missed * INTERVAL_US) as i32;
        let follow_us = if intervals == 0 {
            0
        } else {
            rest_us.clamp(EARLY_US, LATE_US) / 8
        };
        let due_us = due_us
            .wrapping_add(intervals * INTERVAL_US)
            .wrapping_add_signed(follow_us);
        self.due_us = Some(due_us);
        Passed::Intervals(intervals)
    }

    /// Whether no frame has come for more than a second; the next one is then a new start. To be
    /// asked more often than the counter rolls over.
    pub fn is_silent(&mut self, now_us: u32) -> bool {
        let Some(due_us) = self.due_us else {
            return true;
        };
        let silent = now_us.wrapping_sub(due_us) as i32 > (MOST_INTERVALS * INTERVAL_US) as i32;
        if silent {
            self.due_us = None;
        }
        silent
    }

    fn start(&mut self, now_us: u32) -> Passed {
        self.due_us = Some(now_us.wrapping_add(INTERVAL_US));
        self.ahead = 0;
        Passed::NewStart
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use std::vec::Vec;

    /// What frames at these times (ms) mean, with the counter rolling over at 45 ms.
    fn passed(times_ms: &[u32]) -> (Vec<Passed>, u32) {
        let mut clock = FrameClock::default();
        let origin_us = 0_u32.wrapping_sub(45_000);
        let frames = times_ms
            .iter()
            .map(|ms| clock.frame(origin_us.wrapping_add(ms * 1000)))
            .collect();
        (frames, clock.missing)
    }

    fn intervals(times_ms: &[u32]) -> (Vec<u32>, u32) {
        let (passed, missing) = passed(times_ms);
        assert_eq!(passed[0], Passed::NewStart);
        let after = passed[1..].iter().map(|passed| match passed {
            Passed::Intervals(n) => *n,
            Passed::NewStart => panic!("{times_ms:?}"),
        });
        (after.collect(), missing)
    }

    #[test]
    fn a_counter_that_rolls_over_changes_nothing() {
        assert_eq!(intervals(&[0, 20, 40, 60, 80]), (Vec::from([1; 4]), 0));
    }

    #[test]
    fn a_lost_frame_is_counted_with_the_next() {
        assert_eq!(intervals(&[0, 20, 60, 80]), (Vec::from([1, 2, 1]), 1));
        assert_eq!(intervals(&[0, 20, 520, 540]), (Vec::from([1, 25, 1]), 24));
    }

    #[test]
    fn a_late_frame_gains_no_time() {
        assert_eq!(
            intervals(&[0, 20, 50, 61, 80]),
            (Vec::from([1, 1, 1, 1]), 0)
        );
        // So late that it was taken for lost: the next one, in time, stands for none.
        assert_eq!(
            intervals(&[0, 20, 58, 60, 80, 100]),
            (Vec::from([1, 2, 0, 1, 1]), 0)
        );
    }

    #[test]
    fn a_sender_with_a_clock_of_its_own_is_followed() {
        let fast: Vec<u32> = (0..500).map(|i| i * 197 / 10).collect();
        let slow: Vec<u32> = (0..500).map(|i| i * 203 / 10).collect();
        for times in [fast, slow] {
            assert_eq!(intervals(&times), (Vec::from([1; 499]), 0));
        }
    }

    #[test]
    fn a_pause_of_more_than_a_second_is_a_new_start() {
        let (passed, _) = passed(&[0, 20, 1060, 1080]);
        assert_eq!(passed[2..], [Passed::NewStart, Passed::Intervals(1)]);
        let mut clock = FrameClock::default();
        assert!(clock.is_silent(0));
        clock.frame(0);
        assert!(!clock.is_silent(1_000_000));
        assert!(clock.is_silent(1_100_000));
        // A whole turn of the counter later.
        assert_eq!(clock.frame(20_000), Passed::NewStart);
    }
}
