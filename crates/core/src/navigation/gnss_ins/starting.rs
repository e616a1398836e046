//! The start: what was seen of fixes during alignment, and the state that it makes.

use nalgebra::{SMatrix, Vector3};

use super::alignment::Aligned;
use super::stillness::Quiet;
use super::{Aid, ERRORS, ErrorListener, GnssIns, seconds};
use crate::geometry::trigonometry::wrap;
use crate::navigation::aiding::gnss_position::GnssPosition;
use crate::navigation::aiding::gnss_velocity::GnssVelocity;
use crate::navigation::augmented_states::{
    AugmentedStates, GNSS_OFFSET, MAGNETIC_OFFSET, MOUNT_PITCH, MOUNT_YAW, TIME_OFFSET,
};
use crate::navigation::gauss_markov_bias::BiasAtRest;
use crate::navigation::{
    ACCELEROMETER_BIAS, ATTITUDE, ErrorTransition, GYROSCOPE_BIAS, NavigationState, POSITION,
    VELOCITY,
};
use crate::scalar::{Scalar, lit};

/// A fix is fresh enough to start from for so long, s.
const FRESH_S: f64 = 1.5;
/// A course is a heading when the velocity is so many times its standard deviation, and so fast (m/s).
const COURSE_OVER_STD: f64 = 8.0;
const LEAST_COURSE_SPEED: f64 = 1.0;
/// A chord of two positions is one when it is so many times the standard deviation of a position.
const CHORD_OVER_STD: f64 = 3.0;
/// Two positions make a velocity when they are not further apart than so many seconds ...
const LONGEST_DIFFERENCE_S: f64 = 3.0;
/// ... and a course when not further than so many: on an arc the chord has the course of its middle.
const LONGEST_CHORD_S: f64 = 6.0;
/// Speed (m/s) below which a receiver does not contradict a standstill, and that of a standstill.
const STANDING_SPEED: f64 = 0.5;
const STANDING_STD: f64 = 0.1;
/// A receiver contradicts a standstill when its velocity is so many times its standard deviation: of two normal errors
/// exp(-18) are so large.
const MOTION_OVER_STD: f64 = 6.0;
/// It shows one when its velocity and so many standard deviations are less than the slowest course.
const STANDING_OVER_STD: f64 = 3.0;
/// A magnetic heading that is worse than a course waits for one so long after the first fix, s.
const COURSE_PATIENCE_S: f64 = 5.0;
/// Standard deviation of a velocity of which nothing is known, m/s.
const UNKNOWN_VELOCITY_STD: f64 = 10.0;

/// A fix and when it was taken.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Stamped<T: Scalar> {
    time_ns: i64,
    ned: Vector3<T>,
    std: Vector3<T>,
    /// Heading of the body then, against arbitrary north.
    heading: Option<T>,
}

/// The last fixes.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Seen<T: Scalar> {
    /// Stamp of the first position.
    first_ns: Option<i64>,
    position: Option<Stamped<T>>,
    /// The position from which a chord is drawn: short ones say nothing, so it stays until one is long enough.
    anchor: Option<Stamped<T>>,
    velocity: Option<Stamped<T>>,
    /// Velocity from the last two positions.
    difference: Option<Stamped<T>>,
}

impl<T: Scalar> Seen<T> {
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let fixes = [
            &self.position,
            &self.anchor,
            &self.velocity,
            &self.difference,
        ];
        let fixes = fixes.into_iter().flatten();
        fixes.flat_map(|fix| fix.ned.iter().chain(&fix.std).chain(&fix.heading))
    }
}

impl<T: Scalar> Default for Seen<T> {
    fn default() -> Self {
        Self {
            first_ns: None,
            position: None,
            anchor: None,
            velocity: None,
            difference: None,
        }
    }
}

impl<T: Scalar, const HISTORY: usize, L: ErrorListener<T, ERRORS>> GnssIns<T, HISTORY, L> {
    /// Sees a position during alignment; two of them make a velocity and a course.
    pub(super) fn see_position(&mut self, time_ns: i64, fix: &GnssPosition<T>) {
        let heading = self
            .memory
            .aligning
            .as_ref()
            .and_then(|a| a.arbitrary_heading());
        let fresh = Stamped {
            time_ns,
            ned: fix.ned,
            std: fix.std,
            heading,
        };
        self.memory.seen.first_ns.get_or_insert(time_ns);
        self.memory.seen.position = Some(fresh);
        let anchor = *self.memory.seen.anchor.get_or_insert(fresh);
        let passed: T = seconds(anchor.time_ns, time_ns);
        let drawn = passed > lit(0.05) && self.see_chord(&anchor, &fresh, passed);
        let backwards = passed < T::zero();
        if drawn || backwards || passed >= lit(LONGEST_CHORD_S) || anchor.heading.is_none() {
            self.memory.seen.anchor = Some(fresh);
        }
    }

    /// Sees the way from one position to another, `dt` later; whether it was long enough for a course.
    fn see_chord(&mut self, before: &Stamped<T>, after: &Stamped<T>, dt: T) -> bool {
        let chord = after.ned - before.ned;
        let std = (before.std + after.std) * lit::<T>(core::f64::consts::FRAC_1_SQRT_2);
        if dt < lit(LONGEST_DIFFERENCE_S) {
            self.memory.seen.difference = Some(Stamped {
                time_ns: after.time_ns,
                ned: chord / dt,
                // Twice: the vehicle may also have changed its speed.
                std: std / dt + Vector3::repeat(T::one()),
                heading: None,
            });
        }
        let length = chord.xy().norm();
        let across = std.x.max(std.y);
        self.see_motion(length / dt, across / dt);
        let Some((from, to)) = before.heading.zip(after.heading) else {
            return false;
        };
        let is_long =
            length > across * lit(CHORD_OVER_STD) && length > dt * lit(LEAST_COURSE_SPEED);
        if is_long {
            // The chord has the course of mid-interval.
            let turned = wrap(to - from);
            let course = chord.y.atan2(chord.x);
            self.see_course(course, from + turned * lit(0.5), across / length);
        }
        is_long
    }

    /// Sees a velocity during alignment.
    pub(super) fn see_velocity(&mut self, time_ns: i64, fix: &GnssVelocity<T>) {
        let heading = self
            .memory
            .aligning
            .as_ref()
            .and_then(|a| a.arbitrary_heading());
        let mut std = fix.std;
        let mut ned = fix.ned;
        if !fix.has_vertical {
            (ned.z, std.z) = (T::zero(), T::one());
        }
        self.memory.seen.velocity = Some(Stamped {
            time_ns,
            ned,
            std,
            heading,
        });
        let speed = ned.xy().norm();
        let across = std.x.max(std.y);
        self.see_motion(speed, across);
        let enough = (across * lit(COURSE_OVER_STD)).max(lit(LEAST_COURSE_SPEED));
        if let Some(heading) = heading.filter(|_| speed > enough) {
            self.see_course(ned.y.atan2(ned.x), heading, across / speed);
        }
    }

    /// Sees a speed and its standard deviation (m/s) during alignment. One that shows neither motion nor standstill, as
    /// that of two coarse positions, leaves what a better one has shown.
    fn see_motion(&mut self, speed: T, std: T) {
        let moves = speed > (std * lit(MOTION_OVER_STD)).max(lit(STANDING_SPEED));
        let stands = speed + std * lit(STANDING_OVER_STD) < lit(LEAST_COURSE_SPEED);
        if !moves && !stands {
            return;
        }
        let alignment = self.memory.aligning.as_mut();
        if alignment.is_some_and(|alignment| alignment.receiver_moves(moves)) {
            self.memory.quiet = Quiet::default();
            self.memory.still_windows = 0;
        }
    }

    /// Takes a course for the heading `arbitrary` of the body.
    fn see_course(&mut self, course: T, arbitrary: T, std: T) {
        let slip = self.config.course_std;
        let std = (std * std + slip * slip).sqrt();
        if let Some(alignment) = &mut self.memory.aligning {
            alignment.offset(course - arbitrary, std);
        }
    }

    /// Sees a magnetic field during alignment: it tells the heading as well as its iron is known.
    pub(super) fn see_magnetic_field(&mut self, field: &Vector3<T>) {
        let std = self.config.magnetic_heading_std;
        let iron_std = self.config.magnetic_offset_std_ut;
        if let Some(alignment) = &mut self.memory.aligning {
            alignment.magnetic_field(field, std, iron_std);
        }
    }

    /// Starts when level, heading and position are known.
    pub(super) fn try_to_start(&mut self) {
        let (Some(alignment), Some(now)) = (&mut self.memory.aligning, self.memory.now_ns) else {
            return;
        };
        if let Some([heading, std]) = self.config.initial_heading {
            alignment.heading(heading, std);
        }
        let fresh = |seen: Option<Stamped<T>>| {
            seen.filter(|seen| seconds::<T>(seen.time_ns, now) < lit(FRESH_S))
        };
        let first = self.memory.seen.first_ns;
        let waits = first.is_none_or(|first| seconds::<T>(first, now) < lit(COURSE_PATIENCE_S));
        let trusted = waits.then_some(self.config.course_std);
        let declination = self.config.declination.unwrap_or(self.memory.declination);
        let aligned = alignment.finish(declination, trusted);
        let Some((aligned, position)) = aligned.zip(fresh(self.memory.seen.position)) else {
            return;
        };
        let standing = Stamped {
            time_ns: now,
            ned: Vector3::zeros(),
            std: Vector3::repeat(lit(STANDING_STD)),
            heading: None,
        };
        let unknown = Stamped {
            std: Vector3::repeat(lit(UNKNOWN_VELOCITY_STD)),
            ..standing
        };
        let receiver = fresh(self.memory.seen.velocity).or(fresh(self.memory.seen.difference));
        let moves = receiver.is_some_and(|seen| {
            seen.ned.norm() > (seen.std.norm() + seen.std.norm()).max(lit(STANDING_SPEED))
        });
        let velocity = match receiver {
            _ if alignment.is_still && !moves => standing,
            Some(seen) => seen,
            None => unknown,
        };
        let age = seconds::<T>(position.time_ns, now) + self.config.position_latency_s;
        let state = NavigationState {
            ned_from_body: aligned.ned_from_body,
            velocity: velocity.ned,
            position: position.ned + velocity.ned * age
                - aligned.ned_from_body * Vector3::from(self.config.lever_arm_m),
            accelerometer_bias: Vector3::zeros(),
            gyroscope_bias: aligned.gyroscope_bias,
            covariance: SMatrix::zeros(),
            pending: ErrorTransition::default(),
            skipped: self.filter.state().skipped,
        };
        let gyroscope_std = aligned
            .gyroscope_bias_std
            .unwrap_or(self.config.gyroscope_bias_std);
        let tilt = aligned.tilt_std;
        let groups = [
            (ATTITUDE, Vector3::new(tilt, tilt, aligned.heading_std)),
            (VELOCITY, velocity.std + Vector3::repeat(lit(STANDING_STD))),
            (POSITION, position.std + velocity.std * age.abs()),
            (
                ACCELEROMETER_BIAS,
                Vector3::repeat(self.config.accelerometer_bias_std),
            ),
            (GYROSCOPE_BIAS, Vector3::repeat(gyroscope_std)),
        ];
        self.start_from(state, &groups, &position.std, &aligned);
    }

    fn start_from(
        &mut self,
        mut state: NavigationState<T>,
        groups: &[(usize, Vector3<T>); 5],
        position_std: &Vector3<T>,
        aligned: &Aligned<T>,
    ) {
        for (first, std) in groups {
            for i in 0..3 {
                state.covariance[(first + i, first + i)] = std[i] * std[i];
            }
        }
        if aligned.level_by_force {
            self.tie_tilt_to_bias(&mut state);
        }
        if !self.begin(&state) {
            return;
        }
        let square = |x: T| x * x;
        let slow = self.config.position_correlated_fraction;
        for i in 0..3 {
            let variance = square(slow * position_std[i]);
            self.memory.slow_variance[i] = variance;
            if variance > T::zero() {
                self.memory.side.start(GNSS_OFFSET + i, T::zero(), variance);
                // The position was taken from the receiver: what that is off by, this is too.
                self.memory.side.cross[(POSITION + i, GNSS_OFFSET + i)] = -variance;
            }
        }
        if let Some(turned_by) = aligned.heading_from_iron {
            let iron_variance = square(self.config.magnetic_offset_std_ut);
            for i in 0..3 {
                self.memory.side.cross[(ATTITUDE + 2, MAGNETIC_OFFSET + i)] =
                    turned_by[i] * iron_variance;
            }
        }
        self.memory.last_fix_ns = self.memory.seen.position.map(|seen| seen.time_ns);
    }

    /// Starts, or starts again, at `time_ns` from a state that is known otherwise: kept from before, or another system's.
    /// Nothing is aligned then. A state that is not [usable](NavigationState::is_usable) changes nothing and gives `false`.
    pub fn start_at(&mut self, time_ns: i64, state: &NavigationState<T>) -> bool {
        let started = self.begin(state);
        if started {
            self.memory.now_ns = Some(time_ns);
            self.memory.last_imu = None;
            self.memory.last_fix_ns = None;
        }
        started
    }

    /// Goes on from a state of which the augmented states know nothing yet; those who listen begin with it.
    fn begin(&mut self, state: &NavigationState<T>) -> bool {
        if !self.filter.start(*state) {
            return false;
        }
        self.memory.side = AugmentedStates::default();
        self.memory.slow_variance.fill(T::zero());
        let square = |x: T| x * x;
        let time_variance = square(self.config.time_offset_std_s);
        self.memory
            .side
            .start(TIME_OFFSET, T::zero(), time_variance);
        let iron_variance = square(self.config.magnetic_offset_std_ut);
        for i in 0..3 {
            self.memory
                .side
                .start(MAGNETIC_OFFSET + i, T::zero(), iron_variance);
        }
        if self.config.non_holonomic || self.memory.counts[Aid::Speed as usize].skipped > 0 {
            let variance = square(self.config.mount_std);
            self.memory.side.start(MOUNT_PITCH, T::zero(), variance);
            self.memory.side.start(MOUNT_YAW, T::zero(), variance);
        }
        let variances = |first: usize| {
            let diagonal = state.covariance.diagonal();
            diagonal.fixed_rows::<3>(first).into_owned()
        };
        let (force, rate) = (state.accelerometer_bias, state.gyroscope_bias);
        self.memory.at_rest = [
            BiasAtRest::new(force, variances(ACCELEROMETER_BIAS)),
            BiasAtRest::new(rate, variances(GYROSCOPE_BIAS)),
        ];
        self.memory.history.clear();
        self.memory.aligning = None;
        self.listener.restarted();
        true
    }

    /// What levels is the measured force, bias and all: `g e = (b_y, -b_x)` in level axes (E32).
    fn tie_tilt_to_bias(&self, state: &mut NavigationState<T>) {
        let axes = state.ned_from_body.to_rotation_matrix().into_inner();
        let variance = self.config.accelerometer_bias_std * self.config.accelerometer_bias_std;
        let gravity = self.config.gravity.max(T::one());
        for j in 0..3 {
            let rows = [axes[(1, j)] / gravity, -axes[(0, j)] / gravity];
            for (tilt, row) in rows.into_iter().enumerate() {
                let shared = row * variance;
                state.covariance[(ATTITUDE + tilt, ACCELEROMETER_BIAS + j)] = shared;
                state.covariance[(ACCELEROMETER_BIAS + j, ATTITUDE + tilt)] = shared;
            }
            for a in 0..2 {
                for b in 0..2 {
                    state.covariance[(ATTITUDE + a, ATTITUDE + b)] += rows[a] * rows[b] * variance;
                }
            }
        }
    }
}
