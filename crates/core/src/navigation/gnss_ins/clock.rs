//! A clock that goes back: a counter that ran over or was set, a board whose unit restarted.
//!
//! One stamp of a time long past is refused like any other. Several in a row mean that the clock itself is another one
//! now: without a new start every sample would be refused for ever, and the last position called good.

use super::stillness::StillnessWindow;
use super::{Aid, ERRORS, ErrorListener, GAP_LIMIT_S, GnssIns, seconds};
use crate::scalar::{Scalar, lit};

/// So many stamps in a row of a time long past are a clock that went back.
const MOST_BEHIND: u8 = 8;

impl<T: Scalar, const HISTORY: usize, L: ErrorListener<T, ERRORS>> GnssIns<T, HISTORY, L> {
    /// Counts a stamp that is not newer than `last_ns`; those that come late by less than a gap are stragglers.
    pub(super) fn note_stamp_behind(&mut self, time_ns: i64, last_ns: i64) {
        if seconds::<T>(time_ns, last_ns) <= lit(GAP_LIMIT_S) {
            return;
        }
        self.memory.behind += 1;
        if self.memory.behind >= MOST_BEHIND {
            self.forget_time();
        }
    }

    /// Starts again with a clock of which nothing is known.
    fn forget_time(&mut self) {
        self.restart();
        self.memory.behind = 0;
        self.memory.now_ns = None;
        self.memory.last_imu = None;
        self.memory.stands_until_ns = None;
        self.memory.stamps = [None; Aid::ALL.len()];
        self.memory.window = StillnessWindow::default();
        self.memory.still_windows = 0;
    }
}
