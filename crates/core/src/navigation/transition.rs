//! The transition of the 15 navigation errors over an interval, as the few blocks that it has.
//!
//! *Read first:* `docs/derivations/error_state.md`, E5-E9.
//!
//! The inertial samples of an interval are multiplied exactly into one transition. Products of
//! such transitions keep their shape, so it is stored as two vectors and four 3 by 3 blocks
//! instead of 225 numbers, and applied to a covariance by blocks, in place:
//!
//! ```text
//!         dpsi     dv   dp  db_a   db_g
//! dpsi     I       0    0    0      B
//! dv     [a]x      I    0    B      D          t: length of the interval
//! dp     [e]x     t I   I    F      E          B, D, E, F: 3 by 3
//! db_a     0       0    0    I      0
//! db_g     0       0    0    0      I
//! ```
//!
//! Cost: mapping one column is 60 multiplications where the dense product has 225.

mod propagation;

use nalgebra::{Matrix3, SMatrix, Vector3};

pub(super) use propagation::ProcessNoise;

use super::{ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS, POSITION, STATES, VELOCITY};
use crate::kalman::ErrorPropagation;
use crate::kalman::shear::{Takes, Triple, cross, plus, times};
use crate::scalar::{Scalar, lit};

/// How the errors of `[attitude, velocity, position, accelerometer bias, gyroscope bias]` carry on
/// over an interval.
#[must_use = "who is correlated with this filter's error has to follow it"]
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ErrorTransition<T: Scalar> {
    duration: T,
    /// Whether it is that of one sample, whose position is the trapezoid of the velocity.
    is_one_sample: bool,
    /// `a`: velocity from attitude is `[a]x`.
    velocity_from_attitude: Vector3<T>,
    /// `e`: position from attitude is `[e]x`.
    position_from_attitude: Vector3<T>,
    /// `B`: attitude from gyroscope bias, and velocity from accelerometer bias.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    integrated_axes: Matrix3<T>,
    /// `D`: velocity from gyroscope bias.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    velocity_from_gyroscope_bias: Matrix3<T>,
    /// `F`: position from accelerometer bias.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    position_from_accelerometer_bias: Matrix3<T>,
    /// `E`: position from gyroscope bias.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    position_from_gyroscope_bias: Matrix3<T>,
}

impl<T: Scalar> Default for ErrorTransition<T> {
    /// No time has passed.
    fn default() -> Self {
        Self {
            duration: T::zero(),
            is_one_sample: false,
            velocity_from_attitude: Vector3::zeros(),
            position_from_attitude: Vector3::zeros(),
            integrated_axes: Matrix3::zeros(),
            velocity_from_gyroscope_bias: Matrix3::zeros(),
            position_from_accelerometer_bias: Matrix3::zeros(),
            position_from_gyroscope_bias: Matrix3::zeros(),
        }
    }
}

/// `[v]x m`: the cross product of `v` with each column.
#[inline]
fn cross_columns<T: Scalar>(v: &Vector3<T>, m: &Matrix3<T>) -> Matrix3<T> {
    Matrix3::from_columns(&[
        v.cross(&m.column(0)),
        v.cross(&m.column(1)),
        v.cross(&m.column(2)),
    ])
}

impl<T: Scalar> ErrorTransition<T> {
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let vectors = self.velocity_from_attitude.iter();
        let blocks = [
            &self.integrated_axes,
            &self.velocity_from_gyroscope_bias,
            &self.position_from_accelerometer_bias,
            &self.position_from_gyroscope_bias,
        ];
        let vectors = vectors.chain(&self.position_from_attitude);
        let blocks = blocks.into_iter().flatten();
        vectors.chain(blocks).chain([&self.duration])
    }

    /// Length of the interval, s.
    #[inline]
    pub fn duration_s(&self) -> T {
        self.duration
    }

    /// An interval of which nothing is known but its length: the velocity goes on, and attitude and force stay out.
    pub fn without_samples(duration: T) -> Self {
        Self {
            duration,
            ..Self::default()
        }
    }

    /// Multiplies one inertial sample of `dt` seconds into the transition (E6), given body axes
    /// and specific force in NED at its middle. Integrals are trapezoids, which is exact for what
    /// is constant over a sample.
    #[inline]
    pub(super) fn accumulate(&mut self, ned_from_body: &Matrix3<T>, force_ned: &Vector3<T>, dt: T) {
        if self.duration <= T::zero() {
            *self = Self::of_sample(ned_from_body, force_ned, dt);
            return;
        }
        let half = dt * lit::<T>(0.5);
        let (half_axes, gained) = (ned_from_body * half, force_ned * dt);
        let axes_middle = self.integrated_axes - half_axes;
        self.is_one_sample = false;

        let before = self.velocity_from_attitude;
        self.velocity_from_attitude -= gained;
        self.position_from_attitude += (before + self.velocity_from_attitude) * half;

        let before = self.velocity_from_gyroscope_bias;
        self.velocity_from_gyroscope_bias -= cross_columns(&gained, &axes_middle);
        self.position_from_gyroscope_bias += (before + self.velocity_from_gyroscope_bias) * half;

        self.position_from_accelerometer_bias += axes_middle * dt;
        self.integrated_axes = axes_middle - half_axes;
        self.duration += dt;
    }

    /// That of one sample: what (E6) makes of the identity.
    fn of_sample(ned_from_body: &Matrix3<T>, force_ned: &Vector3<T>, dt: T) -> Self {
        let half = dt * lit::<T>(0.5);
        let velocity_from_attitude = force_ned * -dt;
        let axes_middle = ned_from_body * -half;
        let position_from_accelerometer_bias = axes_middle * dt;
        let velocity_from_gyroscope_bias = cross_columns(&velocity_from_attitude, &axes_middle);
        Self {
            duration: dt,
            is_one_sample: true,
            velocity_from_attitude,
            position_from_attitude: velocity_from_attitude * half,
            integrated_axes: ned_from_body * -dt,
            velocity_from_gyroscope_bias,
            position_from_accelerometer_bias,
            position_from_gyroscope_bias: velocity_from_gyroscope_bias * half,
        }
    }

    /// This transition followed by `next`: the product `next * self`, which has the same shape
    /// (E7).
    pub fn then(&self, next: &Self) -> Self {
        Self {
            duration: self.duration + next.duration,
            is_one_sample: false,
            velocity_from_attitude: self.velocity_from_attitude + next.velocity_from_attitude,
            position_from_attitude: self.position_from_attitude
                + next.position_from_attitude
                + self.velocity_from_attitude * next.duration,
            integrated_axes: self.integrated_axes + next.integrated_axes,
            velocity_from_gyroscope_bias: self.velocity_from_gyroscope_bias
                + next.velocity_from_gyroscope_bias
                + cross_columns(&next.velocity_from_attitude, &self.integrated_axes),
            position_from_accelerometer_bias: self.position_from_accelerometer_bias
                + next.position_from_accelerometer_bias
                + self.integrated_axes * next.duration,
            position_from_gyroscope_bias: self.position_from_gyroscope_bias
                + next.position_from_gyroscope_bias
                + self.velocity_from_gyroscope_bias * next.duration
                + cross_columns(&next.position_from_attitude, &self.integrated_axes),
        }
    }

    /// The blocks `B`, `D`, `F`, `E`.
    pub(super) fn bias_blocks(&self) -> [&Matrix3<T>; 4] {
        [
            &self.integrated_axes,
            &self.velocity_from_gyroscope_bias,
            &self.position_from_accelerometer_bias,
            &self.position_from_gyroscope_bias,
        ]
    }

    /// Velocity and position that the specific force has brought about: `-a` and `-e`.
    pub(super) fn increments(&self) -> [Vector3<T>; 2] {
        [-self.velocity_from_attitude, -self.position_from_attitude]
    }

    /// The same transition in axes that `axes` turns into, for these increments of velocity and position in those.
    pub(super) fn turned(&self, axes: &Matrix3<T>, [velocity, position]: &[Vector3<T>; 2]) -> Self {
        Self {
            duration: self.duration,
            is_one_sample: false,
            velocity_from_attitude: -velocity,
            position_from_attitude: -position,
            integrated_axes: axes * self.integrated_axes,
            velocity_from_gyroscope_bias: axes * self.velocity_from_gyroscope_bias,
            position_from_accelerometer_bias: axes * self.position_from_accelerometer_bias,
            position_from_gyroscope_bias: axes * self.position_from_gyroscope_bias,
        }
    }

    /// The full matrix, for those who need one.
    pub fn to_matrix(&self) -> SMatrix<T, STATES, STATES> {
        let mut phi = SMatrix::<T, STATES, STATES>::identity();
        self.map_rows(&mut phi);
        phi
    }
}

/// What the attitude error takes up.
pub(super) struct ToAttitude<'a, T: Scalar> {
    /// `B`.
    pub(super) axes: &'a Matrix3<T>,
}

impl<T: Scalar> Takes<T> for ToAttitude<'_, T> {
    #[inline(always)]
    fn takes<const L: usize>(&self, part: impl Fn(usize) -> Triple<T, L>) -> Triple<T, L> {
        times(self.axes, part(GYROSCOPE_BIAS))
    }
}

/// What the velocity error takes up.
struct ToVelocity<'a, T: Scalar>(&'a ErrorTransition<T>);

impl<T: Scalar> Takes<T> for ToVelocity<'_, T> {
    #[inline(always)]
    fn takes<const L: usize>(&self, part: impl Fn(usize) -> Triple<T, L>) -> Triple<T, L> {
        let turned = cross(&self.0.velocity_from_attitude, part(ATTITUDE));
        let forced = times(&self.0.integrated_axes, part(ACCELEROMETER_BIAS));
        let rate = &self.0.velocity_from_gyroscope_bias;
        plus(plus(turned, forced), times(rate, part(GYROSCOPE_BIAS)))
    }
}

/// What the position error takes up.
struct ToPosition<'a, T: Scalar>(&'a ErrorTransition<T>);

impl<T: Scalar> Takes<T> for ToPosition<'_, T> {
    #[inline(always)]
    fn takes<const L: usize>(&self, part: impl Fn(usize) -> Triple<T, L>) -> Triple<T, L> {
        let turned = cross(&self.0.position_from_attitude, part(ATTITUDE));
        let moved = part(VELOCITY).map(|rows| rows.map(|v| v * self.0.duration));
        let force = &self.0.position_from_accelerometer_bias;
        let rate = &self.0.position_from_gyroscope_bias;
        let moved = plus(turned, moved);
        let forced = plus(moved, times(force, part(ACCELEROMETER_BIAS)));
        plus(forced, times(rate, part(GYROSCOPE_BIAS)))
    }
}

/// Adds to three elements of a column what their states take up.
#[inline(always)]
fn add<T: Scalar>(column: &mut [T; STATES], first: usize, x: &impl Takes<T>) {
    let [[x], [y], [z]] =
        x.takes(|state| [[column[state]], [column[state + 1]], [column[state + 2]]]);
    column[first] += x;
    column[first + 1] += y;
    column[first + 2] += z;
}

impl<T: Scalar> ErrorTransition<T> {
    /// `column <- Phi column`.
    #[inline]
    pub(super) fn map_column(&self, column: &mut [T; STATES]) {
        let axes = &self.integrated_axes;
        // Each needs the others as they were.
        add(column, POSITION, &ToPosition(self));
        add(column, VELOCITY, &ToVelocity(self));
        add(column, ATTITUDE, &ToAttitude { axes });
    }
}

impl<T: Scalar> ErrorPropagation<T, STATES> for ErrorTransition<T> {
    #[inline]
    fn map_rows<const C: usize>(&self, rows: &mut SMatrix<T, STATES, C>) {
        for column in &mut rows.data.0 {
            self.map_column(column);
        }
    }
}
