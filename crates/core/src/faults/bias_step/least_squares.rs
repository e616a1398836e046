//! Least squares of a window: what the turning of force and field in the carried frame says of the bias.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use super::{BLOCKS, Before, Block, Resumed, WindowMean};
use crate::geometry::{rotation, so3};
use crate::scalar::{Scalar, lit};

/// A mean force is off by this in any case, m/s^2, and a field by this share of itself.
const FORCE_FLOOR: f64 = 0.05;
const FIELD_FLOOR: f64 = 0.01;
/// A hard iron is seldom stronger than this share of the field.
const IRON_SHARE: f64 = 0.3;
/// Largest correlation of the field's errors from block to block that is reckoned with.
const MOST_CORRELATED: f64 = 0.8;
/// When a step began is known to so many blocks, a standard deviation.
const BEGAN_WITHIN: f64 = 0.5;
/// Keeps inverses of what is not seen finite.
const TINY: f64 = 1e-6;

/// Information about a bias: the matrix $S$, s^2, and the vector $S b$, s.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub(super) struct Evidence<T: Scalar> {
    matrix: Matrix3<T>,
    vector: Vector3<T>,
}

impl<T: Scalar> Evidence<T> {
    fn none() -> Self {
        Self {
            matrix: Matrix3::zeros(),
            vector: Vector3::zeros(),
        }
    }

    /// A bias that is known with a standard deviation, rad/s.
    pub(super) fn prior(bias: &Vector3<T>, std: T) -> Self {
        let information = T::one() / (std * std);
        Self {
            matrix: Matrix3::identity() * information,
            vector: bias * information,
        }
    }

    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        self.matrix.iter().chain(&self.vector)
    }

    /// The bias and its covariance; `None` where the information is singular.
    pub(super) fn solve(&self) -> Option<(Vector3<T>, Matrix3<T>)> {
        let covariance = self.matrix.cholesky()?.inverse();
        Some((covariance * self.vector, covariance))
    }

    /// Covariance of a vector that is not longer than `size`.
    pub(super) fn covariance_within(&self, size: T) -> Matrix3<T> {
        let prior = Matrix3::identity() * (T::one() / (size * size));
        let covariance = (self.matrix + prior).cholesky().map(|root| root.inverse());
        covariance.unwrap_or(Matrix3::identity() * (size * size))
    }

    /// The same of information that may be singular: what is not seen is zero, with a large variance.
    pub(super) fn solve_weakly(&self) -> (Vector3<T>, Matrix3<T>) {
        let nudge = self.matrix.trace() * lit(TINY) + lit(1e-3);
        let nudged = Self {
            matrix: self.matrix + Matrix3::identity() * nudge,
            ..*self
        };
        nudged
            .solve()
            .unwrap_or((Vector3::zeros(), Matrix3::identity() * lit::<T>(1e6)))
    }

    /// Keeps a share of what it knows, returns to the prior for the rest, and adds a share of a window's evidence, which counts from
    /// the bias `before`.
    pub(super) fn learn(&mut self, window: &Self, before: &Vector3<T>, kept: T, share: T, std: T) {
        let prior = (T::one() - kept) / (std * std);
        self.matrix = self.matrix * kept + window.matrix * share + Matrix3::identity() * prior;
        // The prior pulls towards the bias as it is, not towards zero.
        self.vector =
            self.vector * kept + (window.vector + window.matrix * before) * share + before * prior;
    }

    /// The sum of squares that a difference explains, in variances.
    pub(super) fn explains(&self, difference: &Vector3<T>) -> T {
        difference.dot(&self.vector)
    }

    fn add(&mut self, other: &Self) {
        self.matrix += other.matrix;
        self.vector += other.vector;
    }
}

/// What may have happened in a window at the beginning of a block.
#[derive(Debug, Clone, Copy)]
pub(super) enum Change {
    /// The bias is another one from there on, rad/s, body axes.
    Bias(usize),
    /// A turn was not measured, rad, carried frame.
    Turn(usize),
}

/// What a whole window says of such a change, beside the bias `before`.
pub(super) fn of_window<T: Scalar>(
    blocks: &[Block<T>; BLOCKS],
    before: &Vector3<T>,
    change: Change,
) -> Evidence<T> {
    let carried = carried(blocks);
    let whole = drifts(&carried, 0);
    let drifts = match change {
        Change::Bias(since) => drifts(&carried, since),
        Change::Turn(at) => turns(at),
    };
    let mut evidence = of_force(blocks, &whole, &drifts, before);
    if blocks.iter().all(|block| block.field_count > T::zero()) {
        evidence.add(&of_field(blocks, &whole, &drifts, before));
    }
    evidence
}

/// Force and field of a window without the drift of the bias `before` and of the step since a block (F16).
pub(super) fn mean_of<T: Scalar>(
    blocks: &[Block<T>; BLOCKS],
    carried_from_body: &UnitQuaternion<T>,
    [before, step]: [&Vector3<T>; 2],
    since: usize,
) -> WindowMean<T> {
    let carried = carried(blocks);
    let (whole, late) = (drifts(&carried, 0), drifts(&carried, since));
    // What is left at the end of the window, where the last block ends.
    let half = |block: &Block<T>| block.whole - block.drift;
    let rest = blocks.last().map_or(Matrix3::zeros(), half);
    let turn = |whole: &Matrix3<T>, late: &Matrix3<T>| -(whole * before + late * step);
    let mut at_end = Vector3::zeros();
    let (mut force, mut field, mut axes) = (Vector3::zeros(), Vector3::zeros(), Matrix3::zeros());
    for (block, (whole, late)) in blocks.iter().zip(whole.iter().zip(&late)) {
        at_end = turn(whole, late);
        let steady = so3::exp(&at_end);
        force += steady * block.force;
        field += steady * block.field;
        axes += steady.to_rotation_matrix().matrix() * (block.whole / block.length_s);
    }
    let count: T = lit(BLOCKS as f64);
    let last = at_end + turn(&rest, &rest);
    let has_field = blocks.iter().all(|block| block.field_count > T::zero());
    WindowMean {
        frame_from_body: rotation::renormalize(&(so3::exp(&last) * carried_from_body)),
        force: force / count,
        field: has_field.then(|| field / count),
        axes: axes / count,
    }
}

/// The attitude as it was known at the beginning of block `since`, carried on to now with the bias `before` plus a step, whose
/// covariance is given (F16b, F16c).
pub(super) fn resumed<T: Scalar>(
    blocks: &[Block<T>; BLOCKS],
    carried_from_body: &UnitQuaternion<T>,
    [before, step]: [&Vector3<T>; 2],
    since: usize,
    bias_covariance: &Matrix3<T>,
) -> Resumed<T> {
    let late = || blocks.iter().skip(since);
    let known = late().next().map_or(Before::nothing(), |first| first.known);
    let mut ref_from_carried = known.ref_from_carried;
    let mut covariance = Matrix3::from_diagonal(&known.variances);
    let mut drift = Matrix3::zeros();
    for (k, block) in late().enumerate() {
        let half = so3::exp(&(block.whole * (before + step) * lit::<T>(-0.5)));
        let middle = ref_from_carried * half;
        let turned = middle.to_rotation_matrix() * block.whole;
        if k == 0 {
            // It stepped somewhat earlier, or later.
            let uncertain = turned * step * lit::<T>(BEGAN_WITHIN);
            covariance += uncertain * uncertain.transpose();
        }
        drift += turned;
        ref_from_carried = middle * half;
    }
    let attitude = rotation::renormalize(&(ref_from_carried * carried_from_body));
    covariance += drift * bias_covariance * drift.transpose();
    let axes = attitude.inverse().to_rotation_matrix();
    Resumed {
        attitude,
        attitude_covariance: axes * covariance * axes.transpose(),
        bias_covariance: *bias_covariance,
        drift: axes * drift,
        learnt: known.learnt,
    }
}

fn mean<T: Scalar>(of: impl Iterator<Item = Vector3<T>>) -> Vector3<T> {
    of.fold(Vector3::zeros(), |sum, v| sum + v) / lit::<T>(BLOCKS as f64)
}

/// $G_k$: the integral of the frame's rotation to the middle of each block, s, and before it where the block begins.
fn carried<T: Scalar>(blocks: &[Block<T>; BLOCKS]) -> [[Matrix3<T>; 2]; BLOCKS] {
    let mut begin = Matrix3::zeros();
    blocks.map(|block| {
        let before = begin;
        begin += block.whole;
        [before, before + block.drift]
    })
}

/// $G_k - \bar G$: how far each block's frame drifts with a bias that acts from the beginning of block `since` on, s.
fn drifts<T: Scalar>(carried: &[[Matrix3<T>; 2]; BLOCKS], since: usize) -> [Matrix3<T>; BLOCKS] {
    let start = carried
        .get(since)
        .map_or(Matrix3::zeros(), |[begin, _]| *begin);
    let mut all = carried.map(|[_, drift]| drift - start);
    for early in all.iter_mut().take(since) {
        *early = Matrix3::zeros();
    }
    let sum = all.iter().fold(Matrix3::zeros(), |sum, drift| sum + drift);
    let mean = sum / lit::<T>(BLOCKS as f64);
    all.map(|drift| drift - mean)
}

/// The same of a turn of one radian about each axis at the beginning of block `at`.
fn turns<T: Scalar>(at: usize) -> [Matrix3<T>; BLOCKS] {
    let mean = lit::<T>((BLOCKS - at.min(BLOCKS)) as f64 / BLOCKS as f64);
    core::array::from_fn(|k| {
        let turned = if k < at { T::zero() } else { T::one() };
        Matrix3::identity() * (turned - mean)
    })
}

/// (F11): a mean force is gravity, turned, plus a change of velocity over the block.
fn of_force<T: Scalar>(
    blocks: &[Block<T>; BLOCKS],
    whole: &[Matrix3<T>; BLOCKS],
    drifts: &[Matrix3<T>; BLOCKS],
    before: &Vector3<T>,
) -> Evidence<T> {
    let gravity = mean(blocks.iter().map(|block| block.force));
    let turning = -gravity.cross_matrix();
    let rows = |drift: &Matrix3<T>| turning * drift;
    let seen: [(Matrix3<T>, Vector3<T>); BLOCKS] = core::array::from_fn(|k| {
        let y = blocks[k].force - gravity - rows(&whole[k]) * before;
        (rows(&drifts[k]), y)
    });
    let mut plain = Evidence::none();
    for (a, y) in &seen {
        plain.matrix += a.transpose() * a;
        plain.vector += a.transpose() * y;
    }
    let (bias, _) = plain.solve_weakly();
    // Velocities are what the residuals add up to.
    let (mut velocity, mut sum, mut squares) = (Vector3::zeros(), Vector3::zeros(), T::zero());
    // Their part in the sums: each velocity ends one block and begins the next.
    let (mut last, mut spread) = (Matrix3::zeros(), Matrix3::zeros());
    for ((a, y), block) in seen.iter().zip(blocks) {
        velocity += (y - a * bias) * block.length_s;
        sum += velocity;
        squares += velocity.norm_squared();
        let ends = a / block.length_s;
        let difference = ends - last;
        spread += difference.transpose() * difference;
        last = ends;
    }
    spread += last.transpose() * last;
    let instants: T = lit(BLOCKS as f64 + 1.0);
    let scatter = (squares - sum.norm_squared() / instants).max(T::zero());
    let velocity_variance = scatter / lit(3.0 * (BLOCKS as f64 + 1.0) - 9.0);
    let floor: T = lit(FORCE_FLOOR);
    let noise = spread * velocity_variance + plain.matrix * (floor * floor);
    let nudge = noise.trace() * lit(TINY) + lit(1e-12);
    let Some(root) = (noise + Matrix3::identity() * nudge).cholesky() else {
        return Evidence::none();
    };
    Evidence {
        matrix: plain.matrix * root.solve(&plain.matrix),
        vector: plain.matrix * root.solve(&plain.vector),
    }
}

/// (F12): a mean field is that of the place, turned, plus a hard iron that turns with the device.
fn of_field<T: Scalar>(
    blocks: &[Block<T>; BLOCKS],
    whole: &[Matrix3<T>; BLOCKS],
    drifts: &[Matrix3<T>; BLOCKS],
    before: &Vector3<T>,
) -> Evidence<T> {
    let count: T = lit(BLOCKS as f64);
    let place = mean(blocks.iter().map(|block| block.field));
    let turning = -place.cross_matrix();
    let axes = |block: &Block<T>| block.whole / block.length_s;
    let mean_axes = blocks.iter().fold(Matrix3::zeros(), |s, b| s + axes(b)) / count;
    let rows: [(Matrix3<T>, Matrix3<T>, Vector3<T>); BLOCKS] = core::array::from_fn(|k| {
        let y = blocks[k].field - place - turning * whole[k] * before;
        (turning * drifts[k], axes(&blocks[k]) - mean_axes, y)
    });
    let (mut bias, mut iron) = (Evidence::none(), Evidence::none());
    let mut crossed = Matrix3::zeros();
    for (a, h, y) in &rows {
        bias.matrix += a.transpose() * a;
        bias.vector += a.transpose() * y;
        crossed += a.transpose() * h;
        iron.matrix += h.transpose() * h;
        iron.vector += h.transpose() * y;
    }
    let share: T = lit(FIELD_FLOOR * FIELD_FLOOR);
    let bounded = Matrix3::identity() * (share * lit(1.0 / (IRON_SHARE * IRON_SHARE)));
    let Some(root) = (iron.matrix + bounded).cholesky() else {
        return Evidence::none();
    };
    let mut seen = Evidence {
        matrix: bias.matrix - crossed * root.solve(&crossed.transpose()),
        vector: bias.vector - crossed * root.solve(&iron.vector),
    };
    let (step, _) = seen.solve_weakly();
    let hard_iron = root.solve(&(iron.vector - crossed.transpose() * step));
    let (mut squares, mut products, mut last) = (T::zero(), T::zero(), Vector3::zeros());
    for (a, h, y) in &rows {
        let error = y - a * step - h * hard_iron;
        squares += error.norm_squared();
        products += error.dot(&last);
        last = error;
    }
    let floor2 = place.norm_squared() * share;
    let variance = squares / lit(3.0 * BLOCKS as f64 - 9.0) + floor2;
    let correlated = products / squares.max(floor2 * lit(TINY)) + T::one() / count;
    let correlated = correlated.max(T::zero()).min(lit(MOST_CORRELATED));
    let variance = variance * (T::one() + correlated) / (T::one() - correlated);
    if variance <= T::zero() {
        return Evidence::none();
    }
    seen.matrix /= variance;
    seen.vector /= variance;
    seen
}
