//! Alignment: level from the standstill, heading from whatever tells it first.
//!
//! From the first sample on, the attitude against an arbitrary heading is kept by integrating the gyroscope, and
//! levelled whenever the unit stands. What tells the heading (a setting, a magnetometer, a compass, the course
//! once it moves) fixes the one angle between that arbitrary north and the true one: it holds for the time before
//! as well as after. Without a standstill the mean force of the first seconds has to do.

use nalgebra::{UnitQuaternion, Vector3};

use super::stillness::Window;
use crate::geometry::trigonometry::wrap;
use crate::geometry::{rotation, so3};
use crate::restorable::{InvalidState, finite, unit};
use crate::scalar::{Scalar, lit};

/// Tilt after levelling at rest (rad), beside what the accelerometer's bias does to it: noise, and a vehicle that sways.
const TILT_STD_AT_REST: f64 = 0.003;
/// Tilt after levelling in motion (rad): 1 m/s^2 of acceleration.
const TILT_STD_MOVING: f64 = 0.1;
/// Tilt of a body that is taken to be level (rad).
pub(super) const TILT_STD_ASSUMED: f64 = 0.05;
/// Seconds that are averaged for levelling in motion.
const MOVING_AVERAGE_S: f64 = 2.0;
/// Once levelled, gravity does not tilt without a turn: by more (rad) it is an acceleration ...
const LARGEST_TILT_CHANGE: f64 = 0.03;
/// ... unless it lasts for more windows than a vehicle pulls away.
const PULLING_WINDOWS: u32 = 20;
/// Share of a window in the average of the gyroscope bias at rest.
const LEAST_SHARE: f64 = 0.05;
/// Square of the horizontal share of a direction below which it has no heading.
const LEAST_HORIZONTAL: f64 = 0.01;
/// How far a gyroscope bias may be from its average at rest, rad/s.
const BIAS_STD_AT_REST: f64 = 0.002;

/// The attitude on the way to a start.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Alignment<T: Scalar> {
    /// Attitude against level axes of arbitrary heading.
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    level_from_body: UnitQuaternion<T>,
    /// Standard deviation of its tilt; `None` until levelled.
    tilt_std: Option<T>,
    bias: Vector3<T>,
    still_windows: u32,
    /// Windows in a row in which gravity seemed to tilt without a turn: a steady pull, not a standstill.
    tilted_windows: u32,
    /// Whether the last window was still.
    pub(super) is_still: bool,
    /// Whether the receiver's last velocity was none of a vehicle that stands.
    moves: bool,
    /// Specific force summed in level axes, and for how long.
    force_sum: Vector3<T>,
    force_time: T,
    /// Angle from arbitrary to true north, and its standard deviation.
    heading: Option<[T; 2]>,
    magnetic: Option<MagneticNorth<T>>,
}

/// What a magnetometer tells of the heading.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct MagneticNorth<T: Scalar> {
    /// Angle from arbitrary to magnetic north, rad.
    angle: T,
    std: T,
    /// What has to be added to it for the iron around the magnetometer, rad for a microtesla of each body axis.
    iron: Vector3<T>,
}

impl<T: Scalar> Default for Alignment<T> {
    fn default() -> Self {
        Self {
            level_from_body: UnitQuaternion::identity(),
            tilt_std: None,
            bias: Vector3::zeros(),
            still_windows: 0,
            tilted_windows: 0,
            is_still: false,
            moves: false,
            force_sum: Vector3::zeros(),
            force_time: T::zero(),
            heading: None,
            magnetic: None,
        }
    }
}

/// What to start from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Aligned<T: Scalar> {
    pub(super) ned_from_body: UnitQuaternion<T>,
    pub(super) tilt_std: T,
    pub(super) heading_std: T,
    /// What the heading is off by for a microtesla of iron in each body axis, where it is a magnetometer's.
    pub(super) heading_from_iron: Option<Vector3<T>>,
    /// Whether the accelerometer at rest told the tilt: what its bias is, the tilt is off by.
    pub(super) level_by_force: bool,
    pub(super) gyroscope_bias: Vector3<T>,
    /// `None` when it never stood.
    pub(super) gyroscope_bias_std: Option<T>,
}

impl<T: Scalar> Alignment<T> {
    /// Whether a saved one can be continued from.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        unit("alignment", &self.level_from_body)?;
        let magnetic = self.magnetic.iter();
        let magnetic = magnetic.flat_map(|m| m.iron.iter().chain([&m.angle, &m.std]));
        let vectors = self
            .bias
            .iter()
            .chain(&self.force_sum)
            .chain([&self.force_time]);
        let angles = self.heading.iter().flatten().chain(&self.tilt_std);
        finite("alignment", vectors.chain(angles).chain(magnetic))
    }

    /// Takes a sample that held over `dt`.
    pub(super) fn propagate(&mut self, rate: &Vector3<T>, force: &Vector3<T>, dt: T) {
        let turn = so3::exp(&((rate - self.bias) * dt));
        self.level_from_body = rotation::renormalize(&(self.level_from_body * turn));
        if self.tilt_std.is_none() {
            self.force_sum += self.level_from_body * force * dt;
            self.force_time += dt;
            if self.force_time >= lit(MOVING_AVERAGE_S) {
                self.level(&self.force_sum.clone_owned());
                self.tilt_std = Some(lit(TILT_STD_MOVING));
            }
        }
    }

    /// Takes a finished window.
    pub(super) fn window(&mut self, window: &Window<T>) {
        let force = self.level_from_body * window.mean_force;
        let tilted = force.xy().norm() > force.norm() * lit(LARGEST_TILT_CHANGE);
        self.tilted_windows = if window.may_be_still && tilted && self.still_windows > 0 {
            self.tilted_windows.saturating_add(1)
        } else {
            0
        };
        let pulling = (1..=PULLING_WINDOWS).contains(&self.tilted_windows);
        self.is_still = window.may_be_still && !pulling && !self.moves;
        if !self.is_still {
            return;
        }
        self.still_windows = self.still_windows.saturating_add(1);
        let share = T::one() / lit(f64::from(self.still_windows));
        self.bias += (window.mean_rate - self.bias) * share.max(lit(LEAST_SHARE));
        self.level(&force);
        self.tilt_std = Some(lit(TILT_STD_AT_REST));
    }

    /// Takes whether the receiver's velocity is that of a vehicle in motion. A vehicle that rolls smoothly looks to its
    /// inertial sensors as if it stood, and a steady turn is then no bias: what was learnt as at rest is given up.
    /// Whether it was.
    pub(super) fn receiver_moves(&mut self, moves: bool) -> bool {
        self.moves = moves;
        let mistaken = moves && self.is_still;
        if mistaken {
            self.is_still = false;
            self.still_windows = 0;
            self.bias = Vector3::zeros();
            self.tilt_std = self.tilt_std.map(|_| lit(TILT_STD_MOVING));
        }
        mistaken
    }

    /// Takes the body to be level: there is no accelerometer.
    pub(super) fn assume_level(&mut self) {
        self.tilt_std = Some(lit(TILT_STD_ASSUMED));
    }

    /// Turns the shortest way until `force` (level axes) points up; the heading stays as arbitrary as it was.
    fn level(&mut self, force: &Vector3<T>) {
        let up = -Vector3::z();
        let axis = force.cross(&up);
        let angle = axis.norm().atan2(force.dot(&up));
        let length = axis.norm();
        let turn = if length > lit(1e-9) {
            axis * (angle / length)
        } else if force.z > T::zero() {
            Vector3::x() * T::pi()
        } else {
            Vector3::zeros()
        };
        self.level_from_body = rotation::renormalize(&(so3::exp(&turn) * self.level_from_body));
    }

    /// Heading of the forward axis against arbitrary north, once levelled.
    pub(super) fn arbitrary_heading(&self) -> Option<T> {
        self.tilt_std?;
        let forward = self.level_from_body * Vector3::x();
        let horizontal = forward.x * forward.x + forward.y * forward.y;
        (horizontal > lit(LEAST_HORIZONTAL)).then(|| forward.y.atan2(forward.x))
    }

    /// Takes the true heading (rad) of the forward axis now, unless a better one is known.
    pub(super) fn heading(&mut self, heading: T, std: T) {
        if let Some(arbitrary) = self.arbitrary_heading() {
            self.offset(heading - arbitrary, std);
        }
    }

    /// Takes the angle (rad) from arbitrary to true north, unless a better one is known.
    pub(super) fn offset(&mut self, angle: T, std: T) {
        if self.heading.is_none_or(|[_, known]| std < known) && angle.is_finite() {
            self.heading = Some([wrap(angle), std]);
        }
    }

    /// Takes a magnetic field (body axes) whose heading is off by `std` (rad), and by more for its iron, of
    /// `iron_std` in the field's unit: the last one counts.
    pub(super) fn magnetic_field(&mut self, field: &Vector3<T>, std: T, iron_std: T) {
        if self.tilt_std.is_none() {
            return;
        }
        let field = self.level_from_body * field;
        let horizontal = field.xy().norm_squared();
        if horizontal <= field.norm_squared() * lit(LEAST_HORIZONTAL) {
            return;
        }
        let across = Vector3::new(-field.y, field.x, T::zero()) / horizontal;
        let iron = self.level_from_body.inverse() * across;
        self.magnetic = Some(MagneticNorth {
            angle: -field.y.atan2(field.x),
            std: (std * std + iron_std * iron_std / horizontal).sqrt(),
            iron,
        });
    }

    /// Angle from arbitrary to true north, its standard deviation, and what iron turns it by: the better of magnetic and
    /// other headings. A magnetic one of more than `trusted` (rad) has to wait: a course may come.
    fn north(&self, declination: T, trusted: Option<T>) -> Option<([T; 2], Option<Vector3<T>>)> {
        let other = self.heading.map(|heading| (heading, None));
        let Some(magnetic) = self.magnetic else {
            return other;
        };
        let better = other.is_none_or(|([_, std], _)| magnetic.std < std);
        let waits = trusted.is_some_and(|trusted| magnetic.std > trusted);
        if !better || waits {
            return other;
        }
        let angle = wrap(declination + magnetic.angle);
        Some(([angle, magnetic.std], Some(magnetic.iron)))
    }

    /// What to start from, once level and heading are known; for the arguments see [`Self::north`].
    pub(super) fn finish(&self, declination: T, trusted: Option<T>) -> Option<Aligned<T>> {
        let ([angle, heading_std], heading_from_iron) = self.north(declination, trusted)?;
        let tilt_std = self.tilt_std?;
        let stood = self.still_windows > 0;
        Some(Aligned {
            ned_from_body: so3::exp(&(Vector3::z() * angle)) * self.level_from_body,
            tilt_std,
            heading_std,
            heading_from_iron,
            level_by_force: stood,
            gyroscope_bias: self.bias,
            gyroscope_bias_std: stood.then(|| lit(BIAS_STD_AT_REST)),
        })
    }
}
