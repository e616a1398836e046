//! Propagation of the error covariance between two updates: sums over the samples, then one step of the covariance.
//!
//! Read first: `docs/derivations/bounded_velocity.md`, B3 to B9. The attitude is integrated sample
//! by sample; its error needs only these sums, because in level axes it stays where it is but for
//! what bias and scale do to it.

use nalgebra::{Matrix3, SMatrix, Vector3};

use super::config::ScaleStates;
use super::layout::{ATTITUDE, BIAS, CAPACITY, Covariance, Layout, SCALE, VELOCITY};
use crate::geometry::so3;
use crate::kalman::sparse_update::add_scaled_first;
use crate::scalar::Scalar;

/// What has come together since the covariance was last propagated.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Sums<T: Scalar> {
    /// `sum R dt`, s: what a bias does to the attitude (B5).
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub rotation: Matrix3<T>,
    /// `sum (R_c w_k) dt`, rad: what each element of the scale matrix does to it (B5). With the
    /// diagonal only, the first three columns.
    #[cfg_attr(feature = "serde", serde(with = "crate::serialization::rows"))]
    pub turn: SMatrix<T, 3, 9>,
    /// `sum R f dt`, m/s: what a tilt does to the velocity (B5).
    pub velocity: Vector3<T>,
    /// Time that it covers, s.
    pub time: T,
    /// Variance of the angle noise per axis, rad^2 (B6).
    pub angle_variance: T,
    /// Variance of the velocity noise per axis, (m/s)^2 (B7).
    pub velocity_variance: T,
}

impl<T: Scalar> Default for Sums<T> {
    fn default() -> Self {
        Self {
            rotation: Matrix3::zeros(),
            turn: SMatrix::zeros(),
            velocity: Vector3::zeros(),
            time: T::zero(),
            angle_variance: T::zero(),
            velocity_variance: T::zero(),
        }
    }
}

impl<T: Scalar> Sums<T> {
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let scalars = [&self.time, &self.angle_variance, &self.velocity_variance];
        self.rotation
            .iter()
            .chain(&self.turn)
            .chain(&self.velocity)
            .chain(scalars)
    }

    /// Adds an interval: `level_from_body` in its middle, the rate (rad/s) as measured, seconds, and
    /// the density of the angle noise.
    #[inline]
    pub fn add_rate(
        &mut self,
        scale: ScaleStates,
        level_from_body: &Matrix3<T>,
        measured: &Vector3<T>,
        dt: T,
        angle_noise_psd: T,
    ) {
        let r = level_from_body * dt;
        self.rotation += r;
        match scale {
            ScaleStates::Off => {}
            ScaleStates::Diagonal => {
                for c in 0..3 {
                    for row in 0..3 {
                        self.turn[(row, c)] += r[(row, c)] * measured[c];
                    }
                }
            }
            ScaleStates::Full => {
                for c in 0..3 {
                    for k in 0..3 {
                        for row in 0..3 {
                            self.turn[(row, 3 * c + k)] += r[(row, c)] * measured[k];
                        }
                    }
                }
            }
        }
        self.time += dt;
        self.angle_variance += angle_noise_psd * dt;
    }

    /// Adds a specific force (m/s^2, level axes) that stood for `dt` seconds, and the density of the
    /// velocity noise.
    #[inline]
    pub fn add_force(&mut self, level: &Vector3<T>, dt: T, velocity_noise_psd: T) {
        self.velocity += level * dt;
        self.velocity_variance += velocity_noise_psd * dt;
    }

    /// `P <- Phi P Phi^T + Q` for what was summed (B8), in place. Only the rows of attitude and
    /// velocity of `Phi` differ from the identity: five rows and columns of `P` change.
    ///
    /// `bias_variance`, `field_variance` and `hard_iron_variance` are those of the random walks over
    /// the same time.
    #[inline]
    pub fn propagate_covariance(
        &self,
        p: &mut Covariance<T>,
        layout: &Layout,
        [bias_variance, field_variance, hard_iron_variance]: [T; 3],
    ) {
        let moved = self.moved_rows(p, layout);
        let corner = self.corner(&moved, layout);
        for (a, row) in moved.iter().enumerate() {
            for (j, value) in row.iter().enumerate().take(layout.len()).skip(BIAS) {
                p[(j, a)] = *value;
                p[(a, j)] = *value;
            }
        }
        p.fixed_view_mut::<5, 5>(0, 0).copy_from(&corner);
        for i in 0..3 {
            p[(ATTITUDE + i, ATTITUDE + i)] += self.angle_variance;
            p[(BIAS + i, BIAS + i)] += bias_variance;
        }
        for i in 0..2 {
            p[(VELOCITY + i, VELOCITY + i)] += self.velocity_variance;
        }
        add_to_diagonal(p, layout.field(), 2, field_variance);
        add_to_diagonal(p, layout.hard_iron(), 3, hard_iron_variance);
    }

    /// `Phi` in full (B8): for a smoother and for tests, the filter never forms it.
    pub fn transition(&self, layout: &Layout) -> Covariance<T> {
        let mut phi = Covariance::identity();
        for r in 0..3 {
            for c in 0..3 {
                phi[(ATTITUDE + r, BIAS + c)] = -self.rotation[(r, c)];
            }
            for k in 0..layout.scale_len().min(9) {
                phi[(ATTITUDE + r, SCALE + k)] = self.turn[(r, k)];
            }
        }
        let tilt = -so3::skew(&self.velocity);
        phi.fixed_view_mut::<2, 3>(VELOCITY, ATTITUDE)
            .copy_from(&tilt.fixed_rows::<2>(0));
        phi
    }

    /// The first five rows of `Phi P`. `P` is symmetric: its rows are its columns.
    #[inline]
    fn moved_rows(&self, p: &Covariance<T>, layout: &Layout) -> [[T; CAPACITY]; 5] {
        let n = layout.len();
        let mut moved = [[T::zero(); CAPACITY]; 5];
        for (row, out) in moved.iter_mut().enumerate() {
            add_column(out, n, p, row, T::one());
        }
        let [x, y, z, ..] = &mut moved;
        let mut attitude = [x, y, z];
        add_columns(&mut attitude, n, p, BIAS, &-self.rotation);
        for k in (0..layout.scale_len().min(9)).step_by(3) {
            let turn = self.turn.fixed_columns::<3>(k).into_owned();
            add_columns(&mut attitude, n, p, SCALE + k, &turn);
        }
        let s = &self.velocity;
        add_column(&mut moved[VELOCITY], n, p, ATTITUDE + 1, s.z);
        add_column(&mut moved[VELOCITY], n, p, ATTITUDE + 2, -s.y);
        add_column(&mut moved[VELOCITY + 1], n, p, ATTITUDE, -s.z);
        add_column(&mut moved[VELOCITY + 1], n, p, ATTITUDE + 2, s.x);
        moved
    }

    /// The block of attitude and velocity of `(Phi P) Phi^T`.
    #[inline]
    fn corner(&self, moved: &[[T; CAPACITY]; 5], layout: &Layout) -> SMatrix<T, 5, 5> {
        let mut corner = SMatrix::<T, 5, 5>::zeros();
        let s = &self.velocity;
        for (a, row) in moved.iter().enumerate() {
            let velocity = [
                row[VELOCITY] + s.z * row[ATTITUDE + 1] - s.y * row[ATTITUDE + 2],
                row[VELOCITY + 1] - s.z * row[ATTITUDE] + s.x * row[ATTITUDE + 2],
            ];
            for b in a..5 {
                let value = if b < VELOCITY {
                    self.attitude_element(row, b, layout)
                } else {
                    velocity[b - VELOCITY]
                };
                corner[(a, b)] = value;
                corner[(b, a)] = value;
            }
        }
        corner
    }

    /// Row `b` of `Phi` times a row of `Phi P`, for an attitude state.
    #[inline]
    fn attitude_element(&self, row: &[T; CAPACITY], b: usize, layout: &Layout) -> T {
        let mut value = row[ATTITUDE + b];
        for c in 0..3 {
            value -= self.rotation[(b, c)] * row[BIAS + c];
        }
        for k in 0..layout.scale_len().min(9) {
            value += self.turn[(b, k)] * row[SCALE + k];
        }
        value
    }
}

/// `out[r] += factors[r, c] * P[.., first + c]` for three rows and three columns, over the first `n` states, in one pass: what
/// they share is read once.
#[inline(always)]
fn add_columns<T: Scalar>(
    out: &mut [&mut [T; CAPACITY]; 3],
    n: usize,
    p: &Covariance<T>,
    first: usize,
    factors: &Matrix3<T>,
) {
    let columns = p.as_slice().as_chunks::<CAPACITY>().0;
    let Some([a, b, c, ..]) = columns.get(first..) else {
        return;
    };
    for i in 0..n.min(CAPACITY) {
        for (r, out) in out.iter_mut().enumerate() {
            out[i] += factors[(r, 0)] * a[i];
            out[i] += factors[(r, 1)] * b[i];
            out[i] += factors[(r, 2)] * c[i];
        }
    }
}

/// `out += factor * P[.., column]`, over the first `n` states.
#[inline(always)]
fn add_column<T: Scalar>(
    out: &mut [T; CAPACITY],
    n: usize,
    p: &Covariance<T>,
    column: usize,
    factor: T,
) {
    if let Some(column) = p.as_slice().as_chunks::<CAPACITY>().0.get(column) {
        add_scaled_first(out, column, factor, n);
    }
}

#[inline]
fn add_to_diagonal<T: Scalar>(
    p: &mut Covariance<T>,
    first: Option<usize>,
    size: usize,
    variance: T,
) {
    let Some(first) = first else {
        return;
    };
    for i in first..first + size {
        if let Some(value) = p.get_mut((i, i)) {
            *value += variance;
        }
    }
}
