//! A run's local frame follows the vehicle, and everybody who counts from its origin is told.

use northing_recording::GnssPosition;

use super::Session;
use crate::navigation::moving_frame::Move;

impl Session<'_> {
    /// Moves the origin to a fix that the estimator is to get, where it is far away.
    pub(super) fn follow_fix(&mut self, time_ns: i64, fix: &GnssPosition) {
        let frame = self.frame.as_mut();
        if let Some(moved) = frame.and_then(|frame| frame.follow_fix(time_ns, fix)) {
            self.tell_move(time_ns, &moved);
        }
    }

    /// Moves the origin to the estimate, where there are no fixes and it is far away.
    pub(super) fn follow_estimate(&mut self, time_ns: i64) {
        let Some(frame) = self.frame.as_mut().filter(|f| f.awaits_estimate(time_ns)) else {
            return;
        };
        // What the device says is of the frame in which it was said.
        let estimate = self.navigator.estimate();
        let position = estimate.map(|estimate| estimate.in_frame(frame.now()).position);
        if let Some(moved) = frame.follow_estimate(time_ns, position.as_ref()) {
            self.tell_move(time_ns, &moved);
        }
    }

    fn tell_move(&mut self, time_ns: i64, moved: &Move) {
        let change = &moved.change;
        self.navigator.move_origin(&moved.frame, change, time_ns);
        self.turns.move_origin(change);
        self.axes.move_origin(change);
        if let Some(last) = &mut self.last_fix {
            last.ned = change.position(&last.ned);
            last.velocity = change.vector(&last.velocity);
        }
    }
}
