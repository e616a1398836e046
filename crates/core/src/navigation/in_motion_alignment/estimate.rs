//! What a hypothesis estimates, with its covariance, and how both go on over an interval.
//!
//! *Read first:* `docs/derivations/in_motion_alignment.md`, section 2 (W7-W9).

use nalgebra::{Matrix3, SMatrix, UnitQuaternion, Vector3};

use super::{ALIGNMENT_ERRORS, CORRELATED, Covariance, ErrorVector, InMotionAlignmentConfig, LATE};
use crate::geometry::{rotation, so3};
use crate::kalman::shear::add_mirrored;
use crate::navigation::preintegration::Preintegration;
use crate::navigation::{ACCELEROMETER_BIAS, ATTITUDE, GYROSCOPE_BIAS, POSITION, STATES, VELOCITY};
use crate::restorable::{InvalidState, covariance, finite, unit};
use crate::scalar::{Scalar, lit};

/// Elements of a lower triangle.
const TRIANGLE: usize = ALIGNMENT_ERRORS * (ALIGNMENT_ERRORS + 1) / 2;

/// The states.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Mean<T: Scalar> {
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    pub(super) ned_from_body: UnitQuaternion<T>,
    pub(super) velocity: Vector3<T>,
    /// From the origin of the bank.
    pub(super) position: Vector3<T>,
    pub(super) accelerometer_bias: Vector3<T>,
    pub(super) gyroscope_bias: Vector3<T>,
    /// Correlated error of the receiver's positions.
    pub(super) gnss_offset: Vector3<T>,
    /// How much earlier than its stamp a position was valid, s.
    pub(super) lateness: T,
}

/// A covariance as its lower triangle: half the memory.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: serde::Serialize",
        deserialize = "T: Copy + serde::Deserialize<'de>"
    ))
)]
pub(super) struct Triangle<T>(
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::array"))] [T; TRIANGLE],
);

/// States with their covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Estimate<T: Scalar> {
    pub(super) mean: Mean<T>,
    #[cfg_attr(
        feature = "serde",
        serde(bound(
            serialize = "T: serde::Serialize",
            deserialize = "T: Scalar + serde::Deserialize<'de>"
        ))
    )]
    pub(super) covariance: Triangle<T>,
}

impl<T: Scalar> Triangle<T> {
    pub(super) fn of(full: &Covariance<T>) -> Self {
        let mut out = Self([T::zero(); TRIANGLE]);
        let columns = full.data.0.iter().enumerate();
        let lower = columns.flat_map(|(j, column)| column.iter().skip(j));
        for (place, value) in out.0.iter_mut().zip(lower) {
            *place = *value;
        }
        out
    }

    pub(super) fn full(&self) -> Covariance<T> {
        let mut full = Covariance::<T>::zeros();
        let mut values = self.0.iter();
        for j in 0..ALIGNMENT_ERRORS {
            for (i, value) in (j..ALIGNMENT_ERRORS).zip(&mut values) {
                full[(i, j)] = *value;
                full[(j, i)] = *value;
            }
        }
        full
    }

    /// A variance.
    pub(super) fn variance(&self, state: usize) -> T {
        let place = (0..state).map(|j| ALIGNMENT_ERRORS - j).sum::<usize>();
        self.0.get(place).copied().unwrap_or_else(T::zero)
    }
}

impl<T: Scalar> Mean<T> {
    /// The states that are off by `error`.
    pub(super) fn corrected(&self, error: &ErrorVector<T>) -> Self {
        let part = |first: usize| error.fixed_rows::<3>(first).into_owned();
        let turned = so3::exp(&part(ATTITUDE)) * self.ned_from_body;
        Self {
            ned_from_body: rotation::renormalize(&turned),
            velocity: self.velocity + part(VELOCITY),
            position: self.position + part(POSITION),
            accelerometer_bias: self.accelerometer_bias + part(ACCELEROMETER_BIAS),
            gyroscope_bias: self.gyroscope_bias + part(GYROSCOPE_BIAS),
            gnss_offset: self.gnss_offset + part(CORRELATED),
            lateness: self.lateness + error[LATE],
        }
    }

    /// The error of `other` with which it would be this one.
    pub(super) fn less(&self, other: &Self) -> ErrorVector<T> {
        let mut error = ErrorVector::<T>::zeros();
        let turned = so3::log(&(self.ned_from_body * other.ned_from_body.inverse()));
        for (first, part) in [
            (ATTITUDE, turned),
            (VELOCITY, self.velocity - other.velocity),
            (POSITION, self.position - other.position),
            (
                ACCELEROMETER_BIAS,
                self.accelerometer_bias - other.accelerometer_bias,
            ),
            (GYROSCOPE_BIAS, self.gyroscope_bias - other.gyroscope_bias),
            (CORRELATED, self.gnss_offset - other.gnss_offset),
        ] {
            error.fixed_rows_mut::<3>(first).copy_from(&part);
        }
        error[LATE] = self.lateness - other.lateness;
        error
    }

    fn numbers(&self) -> impl Iterator<Item = &T> {
        let vectors = [
            &self.velocity,
            &self.position,
            &self.accelerometer_bias,
            &self.gyroscope_bias,
            &self.gnss_offset,
        ];
        vectors.into_iter().flatten().chain([&self.lateness])
    }

    pub(super) fn is_finite(&self) -> bool {
        let norm = self.ned_from_body.as_ref().norm_squared();
        self.numbers().chain([&norm]).all(|x| x.is_finite())
    }
}

impl<T: Scalar> Estimate<T> {
    /// Whether a saved one can be continued from.
    pub(super) fn check(&self) -> Result<(), InvalidState> {
        unit("attitude", &self.mean.ned_from_body)?;
        finite("states", self.mean.numbers())?;
        covariance("covariance", &self.covariance.full())
    }

    /// Variance of a component of the horizontal acceleration at a known heading, (m/s^2)^2: what tilt and accelerometer bias
    /// are off by feigns one (W22).
    pub(super) fn feigned_acceleration(&self, gravity: T) -> T {
        let axes = rotation::to_matrix(&self.mean.ned_from_body);
        let p = self.covariance.full();
        let sum = [(ATTITUDE + 1, -gravity), (ATTITUDE, gravity)]
            .into_iter()
            .enumerate()
            .fold(T::zero(), |sum, (axis, (tilt, gained))| {
                let mut row = ErrorVector::<T>::zeros();
                row[tilt] = gained;
                for i in 0..3 {
                    row[ACCELEROMETER_BIAS + i] = -axes[(axis, i)];
                }
                let column = p * row;
                let with_heading = column[ATTITUDE + 2];
                sum + row.dot(&column)
                    - with_heading * with_heading / p[(ATTITUDE + 2, ATTITUDE + 2)]
            });
        sum.max(T::zero()) * lit(0.5)
    }

    /// The same with a heading that is `offset` (rad) further and has a standard deviation of its own, correlated with nothing
    /// (W24).
    pub(super) fn with_heading(&self, offset: T, std: T) -> Self {
        let turn = so3::exp(&(Vector3::z() * offset));
        let axes = rotation::to_matrix(&turn);
        let mut p = self.covariance.full();
        for first in [ATTITUDE, VELOCITY, POSITION, CORRELATED] {
            let rows = axes * p.fixed_rows::<3>(first);
            p.fixed_rows_mut::<3>(first).copy_from(&rows);
            let columns = p.fixed_columns::<3>(first) * axes.transpose();
            p.fixed_columns_mut::<3>(first).copy_from(&columns);
        }
        p.row_mut(ATTITUDE + 2).fill(T::zero());
        p.column_mut(ATTITUDE + 2).fill(T::zero());
        p[(ATTITUDE + 2, ATTITUDE + 2)] = std * std;
        Self {
            mean: Mean {
                ned_from_body: rotation::renormalize(&(turn * self.mean.ned_from_body)),
                ..self.mean
            },
            covariance: Triangle::of(&p),
        }
    }

    /// Whether every number is finite, and every variance one: zero only of what is not estimated.
    pub(super) fn is_usable(&self) -> bool {
        let variance = |i| self.covariance.variance(i);
        let estimated = (0..STATES).all(|i| variance(i) > T::zero());
        let rest = (STATES..ALIGNMENT_ERRORS).all(|i| variance(i) >= T::zero());
        let finite = self.covariance.0.iter().all(|x| x.is_finite());
        estimated && rest && finite && self.mean.is_finite()
    }
}

/// Moves states (W7), the error that is estimated against them, and its covariance (W8, W9) over an interval whose
/// receiver states the correlated standard deviations `slow`; `feigned` is the variance of a component of the acceleration that
/// tilt and biases feign (W22).
// Not inlined: on a chip its memory is then free again for what follows.
#[inline(never)]
pub(super) fn propagate<T: Scalar>(
    mean: &mut Mean<T>,
    error: &mut ErrorVector<T>,
    p: &mut Covariance<T>,
    inertial: &Preintegration<T>,
    slow: &Vector3<T>,
    feigned: T,
    config: &InMotionAlignmentConfig<T>,
) {
    let t = inertial.duration_s();
    let axes = rotation::to_matrix(&mean.ned_from_body);
    let increment = inertial.corrected(&mean.accelerometer_bias, &mean.gyroscope_bias);

    // (W7)
    let fallen = Vector3::z() * (config.gravity * t);
    let gained = fallen + axes * increment.velocity;
    let shows_heading = is_acceleration(&gained, inertial, feigned);
    let transition = inertial.transition(&axes, &increment, shows_heading);
    mean.position += mean.velocity * t + fallen * (t * lit(0.5)) + axes * increment.position;
    mean.velocity += gained;
    mean.ned_from_body = rotation::renormalize(&(mean.ned_from_body * increment.rotation));

    // (W8)
    let kept = (-t / config.position_correlation_time_s).exp();
    for column in &mut error.data.0 {
        if let Some(errors) = column.first_chunk_mut::<STATES>() {
            transition.map_column(errors);
        }
    }
    transition.shear_samples::<ALIGNMENT_ERRORS, 10, 13, 16>(&mut p.data.0);
    for i in CORRELATED..LATE {
        error[i] *= kept;
        for j in 0..ALIGNMENT_ERRORS {
            p[(i, j)] *= kept;
            p[(j, i)] *= kept;
        }
    }
    mean.gnss_offset *= kept;
    add_noise(p, inertial, &axes, slow, kept, config);
}

/// Whether a horizontal change of velocity is more than tilt and biases, with this variance of an acceleration that they
/// feign, and the samples' noise bring about (W22).
fn is_acceleration<T: Scalar>(
    gained: &Vector3<T>,
    inertial: &Preintegration<T>,
    feigned: T,
) -> bool {
    let t = inertial.duration_s();
    let noise = inertial.increment_covariance().velocity.trace() / lit(3.0);
    gained.x * gained.x + gained.y * gained.y > (feigned * t * t + noise) * lit(2.0)
}

/// (W9).
fn add_noise<T: Scalar>(
    p: &mut Covariance<T>,
    inertial: &Preintegration<T>,
    axes: &Matrix3<T>,
    slow: &Vector3<T>,
    kept: T,
    config: &InMotionAlignmentConfig<T>,
) {
    let c = inertial.increment_covariance();
    let turned = |block: &Matrix3<T>| axes * block * axes.transpose();
    let columns = &mut p.data.0;
    for (row, vector) in [
        (VELOCITY, &c.velocity_attitude),
        (POSITION, &c.position_attitude),
    ] {
        let block = so3::skew(&(axes * vector));
        add_block(columns, row, ATTITUDE, &block);
    }
    add_block(columns, POSITION, VELOCITY, &turned(&c.position_velocity));
    for (first, block) in [(VELOCITY, &c.velocity), (POSITION, &c.position)] {
        let block = turned(block);
        for (i, j) in [(0, 0), (1, 0), (1, 1), (2, 0), (2, 1), (2, 2)] {
            add_mirrored(columns, first + i, first + j, block[(i, j)]);
        }
    }
    let t = inertial.duration_s();
    let force = config.accelerometer_bias_random_walk;
    let rate = config.gyroscope_bias_random_walk;
    for i in 0..3 {
        p[(ATTITUDE + i, ATTITUDE + i)] += c.attitude;
        p[(ACCELEROMETER_BIAS + i, ACCELEROMETER_BIAS + i)] += force * force * t;
        p[(GYROSCOPE_BIAS + i, GYROSCOPE_BIAS + i)] += rate * rate * t;
        p[(CORRELATED + i, CORRELATED + i)] += slow[i] * slow[i] * (T::one() - kept * kept);
    }
}

/// Adds a block beside the diagonal, and its mirror image.
fn add_block<T: Scalar>(
    columns: &mut [[T; ALIGNMENT_ERRORS]; ALIGNMENT_ERRORS],
    row: usize,
    column: usize,
    block: &Matrix3<T>,
) {
    for (i, j) in (0..3).flat_map(|i| (0..3).map(move |j| (i, j))) {
        add_mirrored(columns, row + i, column + j, block[(i, j)]);
    }
}

/// Position at the receiver's time, with covariance (W16): `latency` is what its stamps are known to be late by.
pub(super) fn at_receiver_time<T: Scalar>(
    mean: &Mean<T>,
    p: &Covariance<T>,
    latency: T,
) -> (Vector3<T>, Matrix3<T>) {
    let late = mean.lateness - latency;
    let mut rows = SMatrix::<T, 3, ALIGNMENT_ERRORS>::zeros();
    for i in 0..3 {
        rows[(i, POSITION + i)] = T::one();
        rows[(i, VELOCITY + i)] = -late;
        rows[(i, LATE)] = -mean.velocity[i];
    }
    let position = mean.position - mean.velocity * late;
    (position, rows * p * rows.transpose())
}
