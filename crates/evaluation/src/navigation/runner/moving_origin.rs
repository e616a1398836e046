//! The local frame of a run moves with the vehicle: a tangent plane is right near its origin only.
//!
//! A kilometre is far enough (`docs/derivations/error_state.md`, section 13). The vehicle is where its fixes are, if they agree
//! with each other, whatever the estimator makes of them: so a receiver that is switched on elsewhere takes the frame along,
//! and one wild fix does not. Without fixes the vehicle is where the estimator says.

use nalgebra::{Matrix3, Vector3};
use northing_core::earth::{FrameChange, Geodetic, LocalFrame};
use northing_recording::GnssPosition;

use super::Session;
use super::consensus::Candidate;
use crate::statistics::seconds_between;

/// Further than this from the origin it moves, m.
const FURTHEST_M: f64 = 1000.0;
/// Without a fix for so long (s) the estimator says where the vehicle is, so often.
const ESTIMATED_AFTER_S: f64 = 10.0;

/// The local frame of a run.
#[derive(Debug, Clone, Copy)]
pub(super) struct MovingFrame {
    /// That of the first fix: positions that are told to observers count from there.
    pub(super) first: LocalFrame,
    /// That of now.
    pub(super) now: LocalFrame,
    /// Turns the north, east and down of the last fix into those of now's origin.
    axes: Matrix3<f64>,
    last_fix: Candidate,
    looked_ns: i64,
}

impl MovingFrame {
    pub(super) fn new(frame: LocalFrame, time_ns: i64, fix: &GnssPosition) -> Self {
        Self {
            first: frame,
            now: frame,
            axes: Matrix3::identity(),
            last_fix: Candidate::of(time_ns, fix),
            looked_ns: time_ns,
        }
    }

    /// A position of the frame of now, m, counted from the first origin.
    pub(super) fn seen_from_the_first(&self, ned: &Vector3<f64>) -> Vector3<f64> {
        if self.now.origin() == self.first.origin() {
            *ned
        } else {
            self.first.ned(&self.now.geodetic(ned))
        }
    }

    /// Takes a fix for the place at which velocities are measured from now on.
    pub(super) fn is_at(&mut self, place: &Geodetic) {
        self.axes = self.now.from_axes_at(place);
    }

    /// A velocity of the receiver, which is of the axes of where it is, in those of now's origin.
    pub(super) fn velocity(&self, ned: &Vector3<f64>) -> Vector3<f64> {
        self.axes * ned
    }

    /// Whether a fix that the estimator is to get is far away, and agrees with the one before.
    fn is_left_behind_by(&mut self, time_ns: i64, fix: &GnssPosition) -> bool {
        let fix_now = Candidate::of(time_ns, fix);
        let agrees = self.last_fix.could_reach(&fix_now);
        self.last_fix = fix_now;
        self.looked_ns = time_ns;
        let place = Geodetic {
            height_m: self.now.origin().height_m,
            latitude_rad: fix.latitude_rad,
            longitude_rad: fix.longitude_rad,
        };
        agrees && self.now.ned(&place).norm() > FURTHEST_M
    }
}

impl Session<'_> {
    /// Moves the origin to a fix that the estimator is to get, where it is far away.
    pub(super) fn follow_fix(&mut self, time_ns: i64, fix: &GnssPosition) {
        if let Some(frame) = &mut self.frame
            && frame.is_left_behind_by(time_ns, fix)
        {
            self.move_origin(time_ns, fix.latitude_rad, fix.longitude_rad);
        }
    }

    /// Moves the origin to the estimate, where there are no fixes and it is far away.
    pub(super) fn follow_estimate(&mut self, time_ns: i64) {
        let due = |frame: &&mut MovingFrame| {
            seconds_between(frame.looked_ns, time_ns) >= ESTIMATED_AFTER_S
        };
        let Some(frame) = self.frame.as_mut().filter(due) else {
            return;
        };
        frame.looked_ns = time_ns;
        let Some(estimate) = self.navigator.estimate() else {
            return;
        };
        // What the device says is of the frame in which it was said.
        let position = estimate.in_frame(&frame.now).position;
        if position.xy().norm() > FURTHEST_M && position.norm_squared().is_finite() {
            let place = frame.now.geodetic(&position);
            self.move_origin(time_ns, place.latitude_rad, place.longitude_rad);
        }
    }

    /// Moves the origin, at the height that it has, and tells everybody who counts from it.
    fn move_origin(&mut self, time_ns: i64, latitude_rad: f64, longitude_rad: f64) {
        let Some(frame) = &mut self.frame else {
            return;
        };
        let moved = LocalFrame::new(Geodetic {
            latitude_rad,
            longitude_rad,
            height_m: frame.now.origin().height_m,
        });
        let change = FrameChange::between(&frame.now, &moved);
        frame.now = moved;
        self.navigator.move_origin(&moved, &change, time_ns);
        self.turns.move_origin(&change);
        self.axes.move_origin(&change);
        if let Some(last) = &mut self.last_fix {
            last.ned = change.position(&last.ned);
            last.velocity = change.vector(&last.velocity);
        }
    }
}
