//! The start without an inertial unit: the body is taken to be level, a compass or the course tells the heading.

use nalgebra::{SMatrix, UnitQuaternion, Vector3};

use super::{ERRORS, ErrorListener, GnssIns, seconds};
use crate::earth::FrameChange;
use crate::geometry::so3;
use crate::navigation::aiding::gnss_position::GnssPosition;
use crate::navigation::aiding::gnss_velocity::GnssVelocity;
use crate::navigation::augmented_states::{GNSS_OFFSET, MAGNETIC_OFFSET};
use crate::navigation::{
    ACCELEROMETER_BIAS, ATTITUDE, ErrorTransition, GYROSCOPE_BIAS, NavigationState, POSITION,
    VELOCITY,
};
use crate::scalar::{Scalar, lit};

/// Tilt of a body that is taken to be level, rad.
pub(super) const TILT_STD_ASSUMED: f64 = 0.05;
/// A fix is fresh enough to start from for so long, s.
const FRESH_S: f64 = 1.5;
/// A velocity has a course when it is so many times its standard deviation, and so fast (m/s).
const COURSE_OVER_STD: f64 = 8.0;
const LEAST_COURSE_SPEED: f64 = 1.0;
/// Two positions make a velocity when they are not further apart than so many seconds ...
const LONGEST_DIFFERENCE_S: f64 = 3.0;
/// ... and a course when not further than so many: on an arc the chord has the course of its middle.
const LONGEST_CHORD_S: f64 = 6.0;
/// A magnetic heading that is worse than a course waits for one so long after the first fix, s.
const COURSE_PATIENCE_S: f64 = 5.0;
/// Standard deviation of a velocity of which nothing is known, m/s.
const UNKNOWN_VELOCITY_STD: f64 = 10.0;
/// What comes to the standard deviation of a velocity, m/s.
const LEAST_VELOCITY_STD: f64 = 0.1;
/// Square of the horizontal share of a direction below which it has no heading.
const LEAST_HORIZONTAL: f64 = 0.01;

/// A fix and when it was taken.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Stamped<T: Scalar> {
    time_ns: i64,
    ned: Vector3<T>,
    std: Vector3<T>,
}

/// A magnetic heading.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct MagneticHeading<T: Scalar> {
    /// From magnetic north, rad.
    heading: T,
    std: T,
    /// What has to be added to it for the iron around the magnetometer, rad for a microtesla of each body axis.
    iron: Vector3<T>,
}

/// What is known so far.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct LevelStart<T: Scalar> {
    /// Stamp of the first position.
    first_ns: Option<i64>,
    position: Option<Stamped<T>>,
    /// The position from which a chord is drawn: short ones say nothing, so it stays until one is long enough.
    anchor: Option<Stamped<T>>,
    velocity: Option<Stamped<T>>,
    /// Velocity from the last two positions.
    difference: Option<Stamped<T>>,
    /// True heading and its standard deviation, rad.
    heading: Option<[T; 2]>,
    magnetic: Option<MagneticHeading<T>>,
}

impl<T: Scalar> Default for LevelStart<T> {
    fn default() -> Self {
        Self {
            first_ns: None,
            position: None,
            anchor: None,
            velocity: None,
            difference: None,
            heading: None,
            magnetic: None,
        }
    }
}

impl<T: Scalar> LevelStart<T> {
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let fixes = [
            &self.position,
            &self.anchor,
            &self.velocity,
            &self.difference,
        ];
        let fixes = fixes.into_iter().flatten();
        let magnetic = self.magnetic.iter();
        let magnetic = magnetic.flat_map(|m| m.iron.iter().chain([&m.heading, &m.std]));
        fixes
            .flat_map(|fix| fix.ned.iter().chain(&fix.std))
            .chain(self.heading.iter().flatten())
            .chain(magnetic)
    }

    /// Goes on in another local frame.
    pub(super) fn move_origin(&mut self, change: &FrameChange<T>) {
        for position in [&mut self.position, &mut self.anchor].into_iter().flatten() {
            position.ned = change.position(&position.ned);
        }
        for velocity in [&mut self.velocity, &mut self.difference]
            .into_iter()
            .flatten()
        {
            velocity.ned = change.vector(&velocity.ned);
        }
        if let Some([heading, _]) = &mut self.heading {
            *heading += change.heading();
        }
    }

    /// Sees a position; two of them make a velocity, and far enough apart a course.
    pub(super) fn position(&mut self, time_ns: i64, fix: &GnssPosition<T>, course_std: T) {
        let fresh = Stamped {
            time_ns,
            ned: fix.ned,
            std: fix.std,
        };
        self.first_ns.get_or_insert(time_ns);
        self.position = Some(fresh);
        let anchor = *self.anchor.get_or_insert(fresh);
        let passed: T = seconds(anchor.time_ns, time_ns);
        let drawn = passed > lit(0.05) && self.chord(&anchor, &fresh, passed, course_std);
        if drawn || passed < T::zero() || passed >= lit(LONGEST_CHORD_S) {
            self.anchor = Some(fresh);
        }
    }

    /// Sees the way from one position to another, `dt` later; whether it was long enough for a course.
    fn chord(&mut self, from: &Stamped<T>, to: &Stamped<T>, dt: T, course_std: T) -> bool {
        let chord = to.ned - from.ned;
        let std = (from.std + to.std) * lit::<T>(core::f64::consts::FRAC_1_SQRT_2);
        if dt < lit(LONGEST_DIFFERENCE_S) {
            self.difference = Some(Stamped {
                time_ns: to.time_ns,
                ned: chord / dt,
                // Twice: the vehicle may also have changed its speed.
                std: std / dt + Vector3::repeat(T::one()),
            });
        }
        self.course(&(chord / dt), std.x.max(std.y) / dt, course_std)
    }

    /// Sees a velocity.
    pub(super) fn velocity(&mut self, time_ns: i64, fix: &GnssVelocity<T>, course_std: T) {
        let (mut ned, mut std) = (fix.ned, fix.std);
        if !fix.has_vertical {
            (ned.z, std.z) = (T::zero(), T::one());
        }
        self.velocity = Some(Stamped { time_ns, ned, std });
        self.course(&ned, std.x.max(std.y), course_std);
    }

    /// Takes the course of a velocity for the heading, where there is one: where noise is most of it there is none.
    fn course(&mut self, velocity: &Vector3<T>, std: T, course_std: T) -> bool {
        let speed = velocity.xy().norm();
        let is_one = speed > (std * lit(COURSE_OVER_STD)).max(lit(LEAST_COURSE_SPEED));
        if is_one {
            let across = std / speed;
            let std = (across * across + course_std * course_std).sqrt();
            self.heading(velocity.y.atan2(velocity.x), std);
        }
        is_one
    }

    /// Takes a true heading (rad), unless a better one is known.
    pub(super) fn heading(&mut self, heading: T, std: T) {
        if self.heading.is_none_or(|[_, known]| std < known) && heading.is_finite() {
            self.heading = Some([heading, std]);
        }
    }

    /// Takes a magnetic field (body axes) whose heading is off by `std` (rad), and by more for its iron, of
    /// `iron_std` in the field's unit: the last one counts.
    pub(super) fn magnetic_field(&mut self, field: &Vector3<T>, std: T, iron_std: T) {
        let horizontal = field.xy().norm_squared();
        if horizontal <= field.norm_squared() * lit(LEAST_HORIZONTAL) {
            return;
        }
        self.magnetic = Some(MagneticHeading {
            heading: -field.y.atan2(field.x),
            std: (std * std + iron_std * iron_std / horizontal).sqrt(),
            iron: Vector3::new(-field.y, field.x, T::zero()) / horizontal,
        });
    }

    /// Heading, its standard deviation, and what iron turns it by: the better of magnetic and other ones. A magnetic one of
    /// more than `trusted` (rad) has to wait: a course may come.
    fn best_heading(
        &self,
        declination: T,
        trusted: Option<T>,
    ) -> Option<([T; 2], Option<Vector3<T>>)> {
        let other = self.heading.map(|heading| (heading, None));
        let Some(magnetic) = self.magnetic else {
            return other;
        };
        let better = other.is_none_or(|([_, std], _)| magnetic.std < std);
        let waits = trusted.is_some_and(|trusted| magnetic.std > trusted);
        if !better || waits {
            return other;
        }
        let heading = declination + magnetic.heading;
        Some(([heading, magnetic.std], Some(magnetic.iron)))
    }
}

impl<T: Scalar, const HISTORY: usize, L: ErrorListener<T, ERRORS>> GnssIns<T, HISTORY, L> {
    /// Starts, without inertial samples, when heading and position are known.
    pub(super) fn try_to_start_level(&mut self) {
        let Some(now) = self.memory.now_ns else {
            return;
        };
        if let Some([heading, std]) = self.config.initial_heading {
            self.memory.level.heading(heading, std);
        }
        let level = self.memory.level;
        let fresh = |seen: Option<Stamped<T>>| {
            seen.filter(|seen| seconds::<T>(seen.time_ns, now) < lit(FRESH_S))
        };
        let waits = level
            .first_ns
            .is_none_or(|first| seconds::<T>(first, now) < lit(COURSE_PATIENCE_S));
        let trusted = waits.then_some(self.config.course_std);
        let declination = self.config.declination.unwrap_or(self.memory.declination);
        let heading = level.best_heading(declination, trusted);
        let Some((([heading, heading_std], iron), position)) = heading.zip(fresh(level.position))
        else {
            return;
        };
        let unknown = Stamped {
            time_ns: now,
            ned: Vector3::zeros(),
            std: Vector3::repeat(lit(UNKNOWN_VELOCITY_STD)),
        };
        let receiver = fresh(level.velocity).or(fresh(level.difference));
        let velocity = receiver.unwrap_or(unknown);
        let age = seconds::<T>(position.time_ns, now) + self.config.position_latency_s;
        let ned_from_body: UnitQuaternion<T> = so3::exp(&(Vector3::z() * heading));
        let mut state = NavigationState {
            ned_from_body,
            velocity: velocity.ned,
            position: position.ned + velocity.ned * age
                - ned_from_body * Vector3::from(self.config.lever_arm_m),
            accelerometer_bias: Vector3::zeros(),
            gyroscope_bias: Vector3::zeros(),
            covariance: SMatrix::zeros(),
            pending: ErrorTransition::default(),
            skipped: self.filter.state().skipped,
        };
        let tilt = lit(TILT_STD_ASSUMED);
        let groups = [
            (ATTITUDE, Vector3::new(tilt, tilt, heading_std)),
            (
                VELOCITY,
                velocity.std + Vector3::repeat(lit(LEAST_VELOCITY_STD)),
            ),
            (POSITION, position.std + velocity.std * age.abs()),
            (
                ACCELEROMETER_BIAS,
                Vector3::repeat(self.config.accelerometer_bias_std),
            ),
            (
                GYROSCOPE_BIAS,
                Vector3::repeat(self.config.gyroscope_bias_std),
            ),
        ];
        for (first, std) in groups {
            for i in 0..3 {
                state.covariance[(first + i, first + i)] = std[i] * std[i];
            }
        }
        self.start_level(position.time_ns, &state, &position.std, iron);
    }

    fn start_level(
        &mut self,
        fix_ns: i64,
        state: &NavigationState<T>,
        position_std: &Vector3<T>,
        iron: Option<Vector3<T>>,
    ) {
        let square = |x: T| x * x;
        let slow = self.config.position_correlated_fraction;
        let mut state = *state;
        for i in 0..3 {
            // What is correlated is part of it.
            let own = &mut state.covariance[(POSITION + i, POSITION + i)];
            *own = own.max(square(slow * position_std[i]) * lit(1.001));
        }
        if !self.begin(&state) {
            return;
        }
        self.memory.aligning = false;
        for i in 0..3 {
            let variance = square(slow * position_std[i]);
            self.memory.slow_variance[i] = variance;
            if variance > T::zero() {
                self.memory.side.start(GNSS_OFFSET + i, T::zero(), variance);
                // The position was taken from the receiver: what that is off by, this is too.
                self.memory.side.cross[(POSITION + i, GNSS_OFFSET + i)] = -variance;
            }
        }
        if let Some(turned_by) = iron {
            let iron_variance = square(self.config.magnetic_offset_std_ut);
            for i in 0..3 {
                self.memory.side.cross[(ATTITUDE + 2, MAGNETIC_OFFSET + i)] =
                    turned_by[i] * iron_variance;
            }
        }
        self.memory.last_fix_ns = Some(fix_ns);
    }
}
