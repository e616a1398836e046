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

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::{ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS, POSITION, STATES, VELOCITY};
use crate::geometry::so3::skew;
use crate::kalman::ErrorPropagation;
use crate::scalar::{Scalar, lit};

/// How the errors of `[attitude, velocity, position, accelerometer bias, gyroscope bias]` carry on
/// over an interval.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ErrorTransition<T: Scalar> {
    duration: T,
    /// `a`: velocity from attitude is `[a]x`.
    velocity_from_attitude: Vector3<T>,
    /// `e`: position from attitude is `[e]x`.
    position_from_attitude: Vector3<T>,
    /// `B`: attitude from gyroscope bias, and velocity from accelerometer bias.
    integrated_axes: Matrix3<T>,
    /// `D`: velocity from gyroscope bias.
    velocity_from_gyroscope_bias: Matrix3<T>,
    /// `F`: position from accelerometer bias.
    position_from_accelerometer_bias: Matrix3<T>,
    /// `E`: position from gyroscope bias.
    position_from_gyroscope_bias: Matrix3<T>,
}

/// White noises that drive the errors, as variances for each second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct ProcessNoise<T> {
    /// Gyroscope, rad^2/s.
    pub(super) gyroscope: T,
    /// Accelerometer, (m/s)^2/s.
    pub(super) accelerometer: T,
    /// Walk of the gyroscope bias, (rad/s)^2/s.
    pub(super) gyroscope_bias: T,
    /// Walk of the accelerometer bias, (m/s^2)^2/s.
    pub(super) accelerometer_bias: T,
}

impl<T: Scalar> Default for ErrorTransition<T> {
    /// No time has passed.
    fn default() -> Self {
        Self {
            duration: T::zero(),
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

/// `m [v]x^T`: the cross product of `v` with each row.
#[inline]
fn cross_rows<T: Scalar>(v: &Vector3<T>, m: &Matrix3<T>) -> Matrix3<T> {
    cross_columns(v, &m.transpose()).transpose()
}

/// The block that begins at a row and a column. Without a panic where the optimiser does not see that
/// it lies within.
#[inline]
fn block<T: Scalar>(p: &SMatrix<T, STATES, STATES>, row: usize, column: usize) -> Matrix3<T> {
    Matrix3::from_fn(|i, j| {
        let element = p.get((row + i, column + j));
        element.copied().unwrap_or_else(T::zero)
    })
}

/// Puts a block in its place.
#[inline]
fn set_block<T: Scalar>(
    p: &mut SMatrix<T, STATES, STATES>,
    row: usize,
    column: usize,
    block: &Matrix3<T>,
) {
    for ((i, j), value) in (0..9).map(|k| (k % 3, k / 3)).zip(block.iter()) {
        if let Some(element) = p.get_mut((row + i, column + j)) {
            *element = *value;
        }
    }
}

/// The lower half mirrored into the upper.
#[inline]
fn mirror_lower<T: Scalar>(p: &mut SMatrix<T, STATES, STATES>) {
    for j in 1..STATES {
        for i in 0..j {
            p[(i, j)] = p[(j, i)];
        }
    }
}

impl<T: Scalar> ErrorTransition<T> {
    /// Length of the interval, s.
    #[inline]
    pub fn duration_s(&self) -> T {
        self.duration
    }

    /// An interval of which nothing is known but its length: the velocity goes on, and attitude and force stay out.
    pub(super) fn without_samples(duration: T) -> Self {
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
        let half = dt * lit::<T>(0.5);
        let axes_middle = self.integrated_axes - ned_from_body * half;

        let before = self.velocity_from_attitude;
        self.velocity_from_attitude -= force_ned * dt;
        self.position_from_attitude += (before + self.velocity_from_attitude) * half;

        let before = self.velocity_from_gyroscope_bias;
        self.velocity_from_gyroscope_bias -= cross_columns(force_ned, &axes_middle) * dt;
        self.position_from_gyroscope_bias += (before + self.velocity_from_gyroscope_bias) * half;

        self.position_from_accelerometer_bias += axes_middle * dt;
        self.integrated_axes -= ned_from_body * dt;
        self.duration += dt;
    }

    /// This transition followed by `next`: the product `next * self`, which has the same shape
    /// (E7).
    #[must_use]
    pub fn then(&self, next: &Self) -> Self {
        Self {
            duration: self.duration + next.duration,
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

    /// The full matrix, for those who need one.
    pub fn to_matrix(&self) -> SMatrix<T, STATES, STATES> {
        let mut phi = SMatrix::<T, STATES, STATES>::identity();
        self.map_rows(&mut phi);
        phi
    }

    /// `P <- Phi P Phi^T + Q`, in place (E8, E9).
    #[inline]
    pub(super) fn propagate_covariance(
        &self,
        p: &mut SMatrix<T, STATES, STATES>,
        noise: &ProcessNoise<T>,
    ) {
        self.map_rows(p);
        self.map_lower_columns(p);
        self.add_noise(p, noise);
        mirror_lower(p);
    }

    /// `M <- M Phi^T`, of which only the blocks on and below the diagonal are made: the product is
    /// symmetric. The columns of the biases stay as they are.
    fn map_lower_columns(&self, p: &mut SMatrix<T, STATES, STATES>) {
        let b = self.integrated_axes.transpose();
        let d = self.velocity_from_gyroscope_bias.transpose();
        let e = self.position_from_gyroscope_bias.transpose();
        let f = self.position_from_accelerometer_bias.transpose();
        // Position first, attitude last: each needs the others as they were.
        let row = POSITION;
        let [attitude, velocity, force_bias, rate_bias] =
            [ATTITUDE, VELOCITY, ACCELEROMETER_BIAS, GYROSCOPE_BIAS]
                .map(|column| block(p, row, column));
        let position = block(p, row, POSITION)
            + cross_rows(&self.position_from_attitude, &attitude)
            + velocity * self.duration
            + force_bias * f
            + rate_bias * e;
        set_block(p, row, POSITION, &position);
        for row in [POSITION, VELOCITY] {
            let [attitude, force_bias, rate_bias] =
                [ATTITUDE, ACCELEROMETER_BIAS, GYROSCOPE_BIAS].map(|column| block(p, row, column));
            let velocity = block(p, row, VELOCITY)
                + cross_rows(&self.velocity_from_attitude, &attitude)
                + force_bias * b
                + rate_bias * d;
            set_block(p, row, VELOCITY, &velocity);
        }
        for row in [POSITION, VELOCITY, ATTITUDE] {
            let attitude = block(p, row, ATTITUDE) + block(p, row, GYROSCOPE_BIAS) * b;
            set_block(p, row, ATTITUDE, &attitude);
        }
        // Below the mapped rows those of the biases, whose mirror images are above.
        for row in [ACCELEROMETER_BIAS, GYROSCOPE_BIAS] {
            for column in [ATTITUDE, VELOCITY, POSITION] {
                let mirrored = block(p, column, row).transpose();
                set_block(p, row, column, &mirrored);
            }
        }
    }

    /// Adds `Q` for white noise and a specific force that is constant over the interval (E9). The
    /// walks of the biases enter their own variance only; over one aiding interval their effect on
    /// velocity and attitude is beyond the digits that matter.
    fn add_noise(&self, p: &mut SMatrix<T, STATES, STATES>, noise: &ProcessNoise<T>) {
        let t = self.duration;
        if t <= T::zero() {
            return;
        }
        // A t = [-a]x with the mean specific force in A = [f]x.
        let at = skew(&(-self.velocity_from_attitude));
        let aat = at * at.transpose();
        let (g, a) = (noise.gyroscope, noise.accelerometer);
        let eye = Matrix3::<T>::identity();
        let velocity_attitude = at * (-g * t * lit(0.5));
        let position_attitude = at * (-g * t * t * lit(1.0 / 6.0));
        let velocity = eye * (a * t) + aat * (g * t * lit(1.0 / 3.0));
        let position_velocity = eye * (a * t * t * lit(0.5)) + aat * (g * t * t * lit(0.125));
        let position = eye * (a * t * t * t * lit(1.0 / 3.0)) + aat * (g * t * t * t * lit(0.05));
        add_block(p, ATTITUDE, ATTITUDE, &(eye * (g * t)));
        add_pair(p, VELOCITY, ATTITUDE, &velocity_attitude);
        add_pair(p, POSITION, ATTITUDE, &position_attitude);
        add_block(p, VELOCITY, VELOCITY, &velocity);
        add_pair(p, POSITION, VELOCITY, &position_velocity);
        add_block(p, POSITION, POSITION, &position);
        let bias = |variance| eye * (variance * t);
        add_block(
            p,
            ACCELEROMETER_BIAS,
            ACCELEROMETER_BIAS,
            &bias(noise.accelerometer_bias),
        );
        add_block(
            p,
            GYROSCOPE_BIAS,
            GYROSCOPE_BIAS,
            &bias(noise.gyroscope_bias),
        );
    }
}

#[inline]
fn add_block<T: Scalar>(
    p: &mut SMatrix<T, STATES, STATES>,
    row: usize,
    column: usize,
    block: &Matrix3<T>,
) {
    for j in 0..3 {
        for i in 0..3 {
            p[(row + i, column + j)] += block[(i, j)];
        }
    }
}

/// A block and its mirror image.
#[inline]
fn add_pair<T: Scalar>(
    p: &mut SMatrix<T, STATES, STATES>,
    row: usize,
    column: usize,
    block: &Matrix3<T>,
) {
    add_block(p, row, column, block);
    add_block(p, column, row, &block.transpose());
}

impl<T: Scalar> ErrorPropagation<T, STATES> for ErrorTransition<T> {
    #[inline]
    fn map_rows<const C: usize>(&self, rows: &mut SMatrix<T, STATES, C>) {
        for mut column in rows.column_iter_mut() {
            let part =
                |first: usize| Vector3::new(column[first], column[first + 1], column[first + 2]);
            let (attitude, velocity) = (part(ATTITUDE), part(VELOCITY));
            let (force_bias, rate_bias) = (part(ACCELEROMETER_BIAS), part(GYROSCOPE_BIAS));
            let to_attitude = self.integrated_axes * rate_bias;
            let to_velocity = self.velocity_from_attitude.cross(&attitude)
                + self.integrated_axes * force_bias
                + self.velocity_from_gyroscope_bias * rate_bias;
            let to_position = self.position_from_attitude.cross(&attitude)
                + velocity * self.duration
                + self.position_from_accelerometer_bias * force_bias
                + self.position_from_gyroscope_bias * rate_bias;
            for i in 0..3 {
                column[ATTITUDE + i] += to_attitude[i];
                column[VELOCITY + i] += to_velocity[i];
                column[POSITION + i] += to_position[i];
            }
        }
    }
}
