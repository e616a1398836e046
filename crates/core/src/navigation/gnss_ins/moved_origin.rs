//! The origin of the local frame moves with the vehicle: everything that is remembered is seen from the new frame.
//!
//! *Read first:* `docs/derivations/error_state.md`, section 13 (E41-E43).

use nalgebra::Vector3;

use super::{ERRORS, ErrorListener, GnssIns};
use crate::earth::FrameChange;
use crate::navigation::aiding::gnss_position::GnssPosition;
use crate::scalar::{Scalar, lit};

/// After a longer move (m) an alignment under way begins again: its window has felt gravity 3 mrad from the new plane's.
const ALIGNMENT_GOES_ON_M: f64 = 2e4;

impl<T: Scalar, const HISTORY: usize, L: ErrorListener<T, ERRORS>> GnssIns<T, HISTORY, L> {
    /// Goes on in another local frame, exactly (E41-E43): position, velocity, attitude, covariance, augmented states, history
    /// and the alignment under way. Positions and velocities that come now are those of the new frame.
    ///
    /// To be called while the vehicle travels: a tangent plane is right near its origin only. A kilometre away it has a
    /// barometer 8 cm off, and north and level 0.01 degrees. A change that is not finite changes nothing.
    ///
    /// The listener's rows are turned along; what it estimates itself, such as the places of targets, is for its owner to move.
    pub fn move_origin(&mut self, change: &FrameChange<T>) {
        if !change.is_finite() {
            return;
        }
        if self.memory.started {
            self.catch_up();
        }
        if self.memory.started {
            let mut state = *self.filter.state();
            state.move_origin(change);
            let gravity = self.config.gravity;
            self.memory.history.move_origin(change, &state, gravity);
            self.memory.side.move_origin(change);
            let _ = self.filter.start(state);
            let (_, mut listener) = self.memory.followed(&mut self.listener);
            listener.propagated(change);
        }
        let earth_rate = Vector3::from(self.config.earth_rate_rad_s);
        self.config.earth_rate_rad_s = change.vector(&earth_rate).into();
        self.move_fixes(change);
        if change.distance() > lit(ALIGNMENT_GOES_ON_M) {
            self.forget_alignment();
        } else {
            self.alignment.move_origin(change);
        }
    }

    fn move_fixes(&mut self, change: &FrameChange<T>) {
        let memory = &mut self.memory;
        memory.level.move_origin(change);
        if let Some((_, velocity)) = &mut memory.held_velocity {
            velocity.ned = change.vector(&velocity.ned);
        }
        if let Some(velocity) = &mut memory.last_velocity {
            *velocity = change.vector(velocity);
        }
        if let Some(position) = &mut memory.last_position {
            // A receiver that repeats itself does so to the bit, and rounding must not hide it.
            let moved = position.norm() + change.distance();
            *position = change.position(position);
            memory.repeated_within = moved * T::default_epsilon() * lit(16.0);
        }
    }

    /// Begins to align anew, if it aligns, with the next position.
    fn forget_alignment(&mut self) {
        self.alignment.forget();
        self.memory.aligned_fix_ns = None;
        self.memory.held_velocity = None;
    }

    /// Remembers a position; whether it has the very same digits as the one before.
    pub(super) fn is_repeated(&mut self, fix: &GnssPosition<T>) -> bool {
        let within = core::mem::replace(&mut self.memory.repeated_within, T::zero());
        let last = self.memory.last_position.replace(fix.ned);
        last.is_some_and(|last| (last - fix.ned).norm_squared() <= within * within)
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::{Motion, config};
    use super::*;
    use crate::earth::{Geodetic, LocalFrame};
    use crate::geometry::rotation;
    use crate::navigation::aiding::gnss_velocity::GnssVelocity;
    use crate::navigation::augmented_states::GNSS_OFFSET;
    use crate::navigation::gnss_ins::GnssInsConfig;

    /// Two filters on one drive with late fixes; one of them moves its origin by 1.2 km after so many seconds.
    fn drive(moved_after: usize, seconds: usize) -> ([GnssIns<f64, 64>; 2], FrameChange<f64>) {
        let home = LocalFrame::new(Geodetic::from_degrees(63.0, 10.0, 40.0).unwrap());
        let there = LocalFrame::new(home.geodetic(&Vector3::new(700.0, 950.0, -30.0)));
        let change = FrameChange::between(&home, &there);
        let config = GnssInsConfig {
            position_latency_s: 0.2,
            earth_rate_rad_s: [3e-5, 0.0, -6e-5],
            ..config()
        };
        let mut both = [(); 2].map(|()| GnssIns::<f64, 64>::new(config).unwrap());
        let mut motion = Motion::start();
        let mut past = std::vec![motion; 30];
        for k in 1..=seconds * 100 {
            motion.step(k as f64 * 0.01, 0.01);
            past.push(motion);
            let time_ns = k as i64 * 10_000_000;
            for (i, ins) in both.iter_mut().enumerate() {
                // In the middle of a second: samples of the history are older and newer than the move.
                if i == 1 && k == moved_after * 100 + 90 {
                    ins.move_origin(&change);
                }
                ins.imu(time_ns, &motion.rate(), &motion.force()).unwrap();
                if k % 100 != 0 {
                    continue;
                }
                let mut ned = past[past.len() - 21].position;
                let mut velocity = motion.velocity();
                if i == 1 && k > moved_after * 100 + 90 {
                    (ned, velocity) = (change.position(&ned), change.vector(&velocity));
                }
                let std = Vector3::repeat(0.5);
                ins.gnss_position(time_ns, &GnssPosition::new(ned, std));
                let std = Vector3::repeat(0.1);
                ins.gnss_velocity(time_ns, &GnssVelocity::new(velocity, std));
            }
        }
        (both, change)
    }

    #[test]
    fn a_filter_that_takes_its_origin_along_says_the_same() {
        // While it aligns, while its alignment is watched, and alone.
        for (moved_after, seconds) in [(3, 12), (12, 40), (90, 91), (90, 130)] {
            let ([stays, moves], change) = drive(moved_after, seconds);
            let mut there = *stays.state().unwrap();
            let mut side = *stays.augmented_states();
            // The covariance of both is that of the last fix.
            there.move_origin(&change);
            side.move_origin(&change);
            let state = moves.state().unwrap();
            let off = (state.position - there.position).norm();
            assert!(off < 2e-3, "{moved_after}: {off} m");
            assert!((state.velocity - there.velocity).norm() < 2e-3);
            let turned = rotation::angle_between(&state.ned_from_body, &there.ned_from_body);
            let heading_std = there.covariance[(2, 2)].sqrt();
            assert!(
                turned < 1e-4 + 0.02 * heading_std,
                "{moved_after}: {turned} rad"
            );
            for i in 0..15 {
                let [a, b] = [state, &there].map(|s| s.covariance[(i, i)]);
                assert!((a / b - 1.0).abs() < 0.01, "{moved_after}, {i}: {a} {b}");
            }
            let slow = moves.augmented_states().values - side.values;
            assert!(slow.fixed_rows::<3>(GNSS_OFFSET).norm() < 2e-3);
            assert_eq!(moves.validity(), stays.validity());
        }
    }

    #[test]
    fn a_move_there_and_back_changes_nothing_but_the_last_digits() {
        let ([mut ins, _], change) = drive(20, 20);
        let before = *ins.state().unwrap();
        let side = *ins.augmented_states();
        ins.move_origin(&change);
        assert!((ins.state().unwrap().position - before.position).norm() > 1000.0);
        ins.move_origin(&change.inverse());
        let after = ins.state().unwrap();
        assert!((after.position - before.position).norm() < 1e-9);
        assert!((after.covariance - before.covariance).norm() < 1e-9);
        assert!((ins.augmented_states().cross - side.cross).norm() < 1e-9);
        assert!((ins.augmented_states().covariance - side.covariance).norm() < 1e-9);
        let same = *ins.state().unwrap();
        let nowhere = LocalFrame::new(Geodetic {
            latitude_rad: f64::NAN,
            longitude_rad: 0.0,
            height_m: 0.0,
        });
        ins.move_origin(&FrameChange::between(&nowhere, &nowhere));
        assert_eq!(ins.state(), Some(&same));
    }
}
