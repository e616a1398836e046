//! A local frame that moves with the vehicle: a tangent plane is right near its origin only.
//!
//! A kilometre is far enough (`docs/derivations/error_state.md`, section 13). The vehicle is where its fixes are, if they agree
//! with each other, whatever the estimator makes of them: so a receiver that is switched on elsewhere takes the frame along,
//! and one wild fix does not. Without fixes the vehicle is where the estimator says.

use nalgebra::{Matrix3, Vector3};
use northing_core::earth::{FrameChange, Geodetic, LocalFrame};
use northing_recording::GnssPosition;
use serde::{Deserialize, Serialize};

use super::runner::consensus::Candidate;
use crate::statistics::seconds_between;

/// Further than this from the origin it moves, m.
const FURTHEST_M: f64 = 1000.0;
/// Without a fix for so long (s) the estimator says where the vehicle is, so often.
const ESTIMATED_AFTER_S: f64 = 10.0;

/// The local frame of a run.
#[derive(Debug, Clone, Copy)]
pub struct MovingFrame {
    first: LocalFrame,
    now: LocalFrame,
    /// Turns the north, east and down of the last fix into those of now's origin.
    axes: Matrix3<f64>,
    last_fix: Candidate,
    looked_ns: i64,
}

/// A move of the origin: the frame that counts from now on, and the way there.
#[derive(Debug, Clone, Copy)]
pub struct Move {
    /// The frame of now.
    pub frame: LocalFrame,
    /// From the frame before.
    pub change: FrameChange<f64>,
}

/// Everything that a [`MovingFrame`] remembers: places are latitude and longitude, rad, and height, m.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MovingFrameState {
    first: [f64; 3],
    now: [f64; 3],
    axes: Matrix3<f64>,
    last_fix: Candidate,
    looked_ns: i64,
}

impl MovingFrame {
    /// That of the first fix, which may be one that its frame has its origin at.
    #[must_use]
    pub fn new(frame: LocalFrame, time_ns: i64, fix: &GnssPosition) -> Self {
        Self {
            first: frame,
            now: frame,
            axes: Matrix3::identity(),
            last_fix: Candidate::of(time_ns, fix),
            looked_ns: time_ns,
        }
    }

    /// The frame of the first fix: positions that are told to observers count from there.
    #[must_use]
    pub fn first(&self) -> &LocalFrame {
        &self.first
    }

    /// The frame of now.
    #[must_use]
    pub fn now(&self) -> &LocalFrame {
        &self.now
    }

    /// A position of the frame of now, m, counted from the first origin.
    #[must_use]
    pub fn seen_from_the_first(&self, ned: &Vector3<f64>) -> Vector3<f64> {
        if self.now.origin() == self.first.origin() {
            *ned
        } else {
            self.first.ned(&self.now.geodetic(ned))
        }
    }

    /// Takes a fix for the place at which velocities are measured from now on.
    pub fn is_at(&mut self, place: &Geodetic) {
        self.axes = self.now.from_axes_at(place);
    }

    /// A velocity of the receiver, which is of the axes of where it is, in those of now's origin.
    #[must_use]
    pub fn velocity(&self, ned: &Vector3<f64>) -> Vector3<f64> {
        self.axes * ned
    }

    /// Looks at a fix that the estimator is to get: where it is far away, and agrees with the one before, the origin moves there.
    pub fn follow_fix(&mut self, time_ns: i64, fix: &GnssPosition) -> Option<Move> {
        let fix_now = Candidate::of(time_ns, fix);
        let agrees = self.last_fix.could_reach(&fix_now);
        self.last_fix = fix_now;
        self.looked_ns = time_ns;
        let place = Geodetic {
            height_m: self.now.origin().height_m,
            latitude_rad: fix.latitude_rad,
            longitude_rad: fix.longitude_rad,
        };
        let far = agrees && self.now.ned(&place).norm() > FURTHEST_M;
        far.then(|| self.moved_to(place))
    }

    /// Whether it is time to look at the estimate, because there are no fixes.
    #[must_use]
    pub fn awaits_estimate(&self, time_ns: i64) -> bool {
        seconds_between(self.looked_ns, time_ns) >= ESTIMATED_AFTER_S
    }

    /// Looks at an estimate (m, of the frame of now; `None`: there is none) in place of the fixes that are missing: where it is
    /// far away the origin moves there.
    pub fn follow_estimate(
        &mut self,
        time_ns: i64,
        position: Option<&Vector3<f64>>,
    ) -> Option<Move> {
        self.looked_ns = time_ns;
        let position = position?;
        let far = position.xy().norm() > FURTHEST_M && position.norm_squared().is_finite();
        far.then(|| {
            let place = self.now.geodetic(position);
            self.moved_to(Geodetic {
                height_m: self.now.origin().height_m,
                ..place
            })
        })
    }

    fn moved_to(&mut self, origin: Geodetic) -> Move {
        let frame = LocalFrame::new(origin);
        let change = FrameChange::between(&self.now, &frame);
        let columns = [0, 1, 2].map(|i| change.vector(&self.axes.column(i).into()));
        self.axes = Matrix3::from_columns(&columns);
        self.now = frame;
        Move { frame, change }
    }

    /// The state as it is now.
    #[must_use]
    pub fn save(&self) -> MovingFrameState {
        let numbers = |place: &Geodetic| [place.latitude_rad, place.longitude_rad, place.height_m];
        MovingFrameState {
            first: numbers(self.first.origin()),
            now: numbers(self.now.origin()),
            axes: self.axes,
            last_fix: self.last_fix,
            looked_ns: self.looked_ns,
        }
    }

    /// Continues from a saved state exactly; `None`: there are numbers in it that are no places.
    #[must_use]
    pub fn restored(state: &MovingFrameState) -> Option<Self> {
        let place = |[latitude_rad, longitude_rad, height_m]: [f64; 3]| {
            let finite = latitude_rad.abs() <= 2.0 && longitude_rad.abs() <= 7.0;
            (finite && height_m.is_finite()).then_some(Geodetic {
                latitude_rad,
                longitude_rad,
                height_m,
            })
        };
        let [first, now] = [state.first, state.now].map(|at| place(at).map(LocalFrame::new));
        let finite = state.axes.norm_squared().is_finite();
        Some(Self {
            first: first.filter(|_| finite)?,
            now: now?,
            axes: state.axes,
            last_fix: state.last_fix,
            looked_ns: state.looked_ns,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fix(latitude_deg: f64) -> GnssPosition {
        GnssPosition {
            latitude_rad: latitude_deg.to_radians(),
            longitude_rad: 0.15,
            height_m: Some(300.0),
            std_m: Some([2.0; 3]),
            ..GnssPosition::default()
        }
    }

    #[test]
    fn it_goes_on_from_what_was_saved_to_the_bit() {
        let origin = Geodetic::from_degrees(48.0, 0.15_f64.to_degrees(), 300.0).unwrap();
        let mut frame = MovingFrame::new(LocalFrame::new(origin), 0, &fix(48.0));
        let text = serde_json::to_string(&frame.save()).unwrap();
        let mut again = MovingFrame::restored(&serde_json::from_str(&text).unwrap()).unwrap();
        let velocity = Vector3::new(1.0, 20.0, 0.3);
        for k in 1..20_i64 {
            let latitude = 48.0 + 0.002 * k as f64;
            let moved = frame.follow_fix(k * 1_000_000_000, &fix(latitude));
            let same = again.follow_fix(k * 1_000_000_000, &fix(latitude));
            assert_eq!(moved.is_some(), same.is_some());
            for one in [&mut frame, &mut again] {
                one.is_at(&Geodetic::from_degrees(latitude, 8.6, 300.0).unwrap());
            }
            assert_eq!(frame.save(), again.save());
            assert_eq!(frame.velocity(&velocity), again.velocity(&velocity));
            again = MovingFrame::restored(&again.save()).unwrap();
        }
        assert!(frame.now().origin() != frame.first().origin());
        assert!(
            frame
                .now()
                .ned(&Geodetic::from_degrees(48.038, 8.594, 300.0).unwrap())
                .norm()
                < 1100.0
        );
    }

    #[test]
    fn axes_of_velocities_turn_along_when_the_estimate_moves_the_origin() {
        let origin = Geodetic::from_degrees(60.0, 10.0, 0.0).unwrap();
        let mut frame = MovingFrame::new(LocalFrame::new(origin), 0, &fix(60.0));
        assert!(!frame.awaits_estimate(9_000_000_000) && frame.awaits_estimate(10_000_000_000));
        assert!(frame.follow_estimate(0, None).is_none());
        let moved = frame.follow_estimate(0, Some(&Vector3::new(0.0, 20_000.0, 0.0)));
        let expected = moved.unwrap().change.vector(&Vector3::x());
        assert!((frame.velocity(&Vector3::x()) - expected).norm() < 1e-15);
        assert!((expected - Vector3::x()).norm() > 1e-3);
    }
}
