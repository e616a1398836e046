//! Step of a gyroscope's bias, found because gravity and the magnetic field begin to turn in the frame that the gyroscope
//! integrates.
//!
//! Read first: `docs/derivations/faults.md`, section 9 (F10)-(F15); Gustafsson (2000), chapter 3, for tests of a change
//! against what was usual before it.
//!
//! A frame that is carried along by the measured rate drifts by the bias alone. The specific force, averaged over half a
//! second, and the field turn in that frame as the bias says, by least squares over six seconds. Whether that is a
//! step is judged by comparison: with the bias of the minutes before, with what the sensors' own residuals let expect, and with how
//! far both were apart when nothing happened.
//!
//! Model: constant bias over the window, a velocity without drift (a mean force is off by a change of velocity), a field that
//! is constant but for a hard iron that turns with the device. Without a magnetometer a bias about the vertical is not seen.
//! Cost: a few additions a sample, a rotation every 20 ms, some 10 000 operations twice a second. About 650 numbers of memory.
//!
//! | symbol | here | unit |
//! |---|---|---|
//! | $C_k$ | `frame_from_body` | |
//! | $G_k = \int C\,dt$ | `drift` | s |
//! | $\bar f_k, \bar m_k$ | `force`, `field`, means of a block in the carried frame | m/s^2, microtesla |
//! | $b$ | bias | rad/s |

mod least_squares;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

use crate::geometry::rotation;
use crate::scalar::{Scalar, lit};
use least_squares::{Change, Evidence};

/// Samples are summed over so long before they are turned into the carried frame, s: a turn of a few degrees.
const STRIDE_S: f64 = 0.02;
/// Length of a block, s, and blocks of a window: a hand's velocity averages out, and a step of 3 deg/s is 17 deg.
const BLOCK_S: f64 = 0.5;
const BLOCKS: usize = 12;
/// A step is one where so many windows in a row say so, of the same direction.
const AGREEING: usize = 5;
const ALIKE: f64 = 0.8;
/// Square of the distance from the bias before, as a multiple of its usual mean.
const UNUSUAL: f64 = 16.0;
/// And as one of the largest in the minute before.
const LARGER: f64 = 2.0;
/// The usual mean is no less than this share of three, a perfect model's, is at first one, is learnt over so many blocks, and from
/// no more than so many times itself.
const LEAST_USUAL: f64 = 0.3;
const MEMORY_BLOCKS: f64 = 60.0;
const OUTLIER: f64 = 5.0;
/// A step below this is nothing to tell and harms nobody for long, rad/s: a degree a second.
const NOTABLE_RAD_S: f64 = 0.0175;
/// Prior of the bias before, rad/s; it is forgotten over so long, s, and windows count for this share: their errors overlap.
const PRIOR_RAD_S: f64 = 0.3;
const FORGET_S: f64 = 60.0;
/// A step needs a before: so many windows that have no block in common.
const LEAST_WINDOWS: u32 = 4;
const WINDOW_SHARE: f64 = 0.25;
/// Errors that are no bias: a walk of the bias, rad/s, and of the turn in a window this share (scale, axes).
const WALK_RAD_S: f64 = 0.003;
const SCALE_ERROR: f64 = 0.015;
/// The step is known to so many of the last blocks, and to this share of itself.
const FEWEST: usize = 5;
const DILUTED: f64 = 0.1;

/// Longer samples are no measurements (m/s^2, microtesla).
const LONGEST_SAMPLE: f64 = 1e6;

fn is_measured<T: Scalar>(sample: &Vector3<T>) -> bool {
    sample.norm_squared() <= lit(LONGEST_SAMPLE * LONGEST_SAMPLE)
}

/// A bias that stepped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BiasStep<T: Scalar> {
    /// The bias now, rad/s, body axes.
    pub bias: Vector3<T>,
    /// Standard deviation of each component, rad/s.
    pub std: T,
    /// How far it stepped, rad/s.
    pub size: T,
    /// How long ago the window began that shows it, s.
    pub window_s: T,
    /// What the window says of the attitude.
    pub mean: WindowMean<T>,
    /// The attitude as it was known before the step, carried on to now with the new bias.
    pub resumed: Resumed<T>,
}

/// What an estimator knows at an instant, for whom finds out later that something happened then.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Known<T: Scalar> {
    /// `ref_from_body`.
    pub attitude: UnitQuaternion<T>,
    /// Covariance (rad^2) of the local attitude error, body axes.
    pub covariance: Matrix3<T>,
    /// What else it would lose to a wrong bias.
    pub learnt: Learnt<T>,
}

/// What an estimator has learnt of motion and sensors and unlearns while its bias is wrong: numbers whose meaning only it
/// knows. Zeros, where it learns nothing.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Learnt<T>(pub [T; LEARNT]);

/// Most numbers that an estimator learns so.
pub const LEARNT: usize = 11;

impl<T: Scalar> Learnt<T> {
    /// Nothing.
    pub fn nothing() -> Self {
        Self([T::zero(); LEARNT])
    }
}

/// An attitude of before a step of the bias, carried on with the new bias (F16b), and how its error hangs on the error of the bias.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resumed<T: Scalar> {
    /// `ref_from_body` now.
    pub attitude: UnitQuaternion<T>,
    /// Covariance (rad^2) of the local attitude error, body axes now, with what the error of the bias has added.
    pub attitude_covariance: Matrix3<T>,
    /// Covariance of the bias, (rad/s)^2, body axes.
    pub bias_covariance: Matrix3<T>,
    /// How far the attitude has turned for each unit of the bias, s, body axes now: its error is minus this times that of the bias.
    pub drift: Matrix3<T>,
    /// What the estimator had learnt before.
    pub learnt: Learnt<T>,
}

impl<T: Scalar> Resumed<T> {
    /// Cross-covariance of the errors of attitude and bias, rad^2/s, body axes (F16c).
    pub fn cross_covariance(&self) -> Matrix3<T> {
        -self.drift * self.bias_covariance
    }
}

/// Means of a window, in a frame that does not turn: the carried one, freed of its drift.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WindowMean<T: Scalar> {
    /// From body axes now.
    pub frame_from_body: UnitQuaternion<T>,
    /// Specific force, m/s^2.
    pub force: Vector3<T>,
    /// Magnetic field, microtesla, where there was one all the time.
    pub field: Option<Vector3<T>>,
    /// Body axes: a hard iron shows in the field with them.
    pub axes: Matrix3<T>,
}

/// What was known where a block begins, in terms of the carried frame.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Before<T: Scalar> {
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    ref_from_carried: UnitQuaternion<T>,
    /// Of the attitude, reference axes, rad^2: a third of the memory of its covariance.
    variances: Vector3<T>,
    learnt: Learnt<T>,
}

impl<T: Scalar> Before<T> {
    fn nothing() -> Self {
        Self {
            ref_from_carried: UnitQuaternion::identity(),
            variances: Vector3::zeros(),
            learnt: Learnt::nothing(),
        }
    }

    fn of(known: &Known<T>, carried_from_body: &UnitQuaternion<T>) -> Self {
        let axes = known.attitude.to_rotation_matrix();
        Self {
            ref_from_carried: known.attitude * carried_from_body.inverse(),
            variances: (axes * known.covariance * axes.transpose()).diagonal(),
            learnt: known.learnt,
        }
    }

    fn numbers(&self) -> impl Iterator<Item = &T> {
        let turned = self.ref_from_carried.coords.iter();
        turned.chain(&self.variances).chain(&self.learnt.0)
    }
}

/// Means over half a second, in the frame that the measured rate carries along.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Block<T: Scalar> {
    force: Vector3<T>,
    field: Vector3<T>,
    force_count: T,
    field_count: T,
    /// Integral of the frame's rotation over the block, and its mean over the block, from the block's beginning, s.
    whole: Matrix3<T>,
    drift: Matrix3<T>,
    /// Turn as measured, carried frame, rad.
    turn: Vector3<T>,
    length_s: T,
    /// What was known of the attitude where the block begins.
    known: Before<T>,
}

impl<T: Scalar> Block<T> {
    fn empty() -> Self {
        Self {
            known: Before::nothing(),
            force: Vector3::zeros(),
            field: Vector3::zeros(),
            force_count: T::zero(),
            field_count: T::zero(),
            whole: Matrix3::zeros(),
            drift: Matrix3::zeros(),
            turn: Vector3::zeros(),
            length_s: T::zero(),
        }
    }

    fn numbers(&self) -> impl Iterator<Item = &T> {
        let vectors = self.force.iter().chain(&self.field).chain(&self.turn);
        let matrices = self.whole.iter().chain(&self.drift);
        let scalars = [&self.force_count, &self.field_count, &self.length_s];
        vectors
            .chain(matrices)
            .chain(scalars)
            .chain(self.known.numbers())
    }
}

/// Sums of what came since the last stride, body axes.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Stride<T: Scalar> {
    turn: Vector3<T>,
    force: Vector3<T>,
    field: Vector3<T>,
    force_count: T,
    field_count: T,
    length_s: T,
}

impl<T: Scalar> Stride<T> {
    fn empty() -> Self {
        Self {
            turn: Vector3::zeros(),
            force: Vector3::zeros(),
            field: Vector3::zeros(),
            force_count: T::zero(),
            field_count: T::zero(),
            length_s: T::zero(),
        }
    }

    fn numbers(&self) -> impl Iterator<Item = &T> {
        let vectors = self.turn.iter().chain(&self.force).chain(&self.field);
        vectors.chain([&self.force_count, &self.field_count, &self.length_s])
    }
}

/// What a window said: distance from the bias before, squared, and the difference, rad/s.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
struct Verdict<T: Scalar> {
    distance2: T,
    step: Vector3<T>,
}

/// A change in a window that explains what was seen.
#[derive(Debug, Clone, Copy)]
struct Explanation<T: Scalar> {
    since: usize,
    evidence: Evidence<T>,
    change: Vector3<T>,
    explained: T,
}

/// Watches samples for a step of the gyroscope's bias.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BiasWatch<T: Scalar> {
    #[cfg_attr(feature = "serde", serde(with = "crate::geometry::rotation::wxyz"))]
    frame_from_body: UnitQuaternion<T>,
    stride: Stride<T>,
    now: Block<T>,
    /// The oldest first; `count` of them at the end are filled.
    blocks: [Block<T>; BLOCKS],
    count: u32,
    /// Blocks since a window was last learnt from, and windows that were.
    since_learnt: u32,
    windows: u32,
    /// The bias before, as information: matrix, s^2, and vector, s.
    known: Evidence<T>,
    verdicts: [Option<Verdict<T>>; AGREEING],
    usual: T,
    /// The largest distance, squared, in which windows agreed and that was no step: fading; of the window before; of this one.
    largest: T,
    largest_before: T,
    largest_now: T,
}

impl<T: Scalar> Default for BiasWatch<T> {
    fn default() -> Self {
        Self {
            frame_from_body: UnitQuaternion::identity(),
            stride: Stride::empty(),
            now: Block::empty(),
            blocks: [Block::empty(); BLOCKS],
            count: 0,
            since_learnt: 0,
            windows: 0,
            known: Evidence::prior(&Vector3::zeros(), lit(PRIOR_RAD_S)),
            verdicts: [None; AGREEING],
            usual: T::one(),
            largest: T::zero(),
            largest_before: T::zero(),
            largest_now: T::zero(),
        }
    }
}

impl<T: Scalar> BiasWatch<T> {
    /// The numbers, for checks of a saved state.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = &T> {
        let blocks = self.blocks.iter().chain([&self.now]);
        let verdicts = self.verdicts.iter().flatten();
        let verdicts = verdicts.flat_map(|v| v.step.iter().chain([&v.distance2]));
        blocks
            .flat_map(Block::numbers)
            .chain(self.stride.numbers())
            .chain(self.known.numbers())
            .chain(verdicts)
            .chain([
                &self.usual,
                &self.largest,
                &self.largest_before,
                &self.largest_now,
            ])
    }

    /// Takes a specific force, m/s^2, body axes now.
    #[inline]
    pub fn force(&mut self, force: &Vector3<T>) {
        if is_measured(force) {
            self.stride.force += force;
            self.stride.force_count += T::one();
        }
    }

    /// Takes a magnetic field, microtesla, body axes now.
    #[inline]
    pub fn field(&mut self, field: &Vector3<T>) {
        if is_measured(field) {
            self.stride.field += field;
            self.stride.field_count += T::one();
        }
    }

    /// Takes a rotation: the rate (rad/s, as measured) over `dt` seconds, and what is `known` behind it, which is asked for twice a
    /// second. A step that it finds is told once; the bias that it has then is the one before the next.
    #[inline]
    pub fn rotate(
        &mut self,
        rate: &Vector3<T>,
        dt: T,
        known: impl FnOnce() -> Known<T>,
    ) -> Option<BiasStep<T>> {
        self.stride.turn += rate * dt;
        self.stride.length_s += dt;
        if self.stride.length_s < lit(STRIDE_S) {
            return None;
        }
        self.carry();
        if self.now.length_s < lit(BLOCK_S) {
            return None;
        }
        self.close(&known())
    }

    /// Something was not seen: the windows begin anew. What is known of the bias stays.
    pub fn interrupt(&mut self) {
        self.stride = Stride::empty();
        self.now = Block::empty();
        self.count = 0;
        self.verdicts = [None; AGREEING];
    }

    /// Turns the sums of a stride into the carried frame, by the attitude in its middle.
    fn carry(&mut self) {
        let stride = self.stride;
        self.stride = Stride::empty();
        let half = stride.turn * lit::<T>(0.5);
        let middle = rotation::turned(&self.frame_from_body, &half);
        self.frame_from_body = rotation::turned(&middle, &half);
        let axes = middle.to_rotation_matrix();
        let block = &mut self.now;
        block.force += axes * stride.force;
        block.field += axes * stride.field;
        block.turn += axes * stride.turn;
        block.force_count += stride.force_count;
        block.field_count += stride.field_count;
        block.whole += axes.matrix() * stride.length_s;
        block.drift += block.whole * stride.length_s;
        block.length_s += stride.length_s;
    }

    /// Ends a block, and looks at the window that it completes.
    fn close(&mut self, known: &Known<T>) -> Option<BiasStep<T>> {
        let mut block = self.now;
        self.now = Block::empty();
        self.now.known = Before::of(known, &self.frame_from_body);
        let is_sound = block.numbers().all(|x| x.is_finite());
        if !is_sound || block.force_count <= T::zero() || block.length_s > lit(2.0 * BLOCK_S) {
            self.interrupt();
            if !is_sound {
                self.frame_from_body = UnitQuaternion::identity();
            }
            return None;
        }
        block.force /= block.force_count;
        block.field /= block.field_count.max(T::one());
        block.drift /= block.length_s;
        self.blocks.rotate_left(1);
        if let Some(last) = self.blocks.last_mut() {
            *last = block;
        }
        self.count = (self.count + 1).min(BLOCKS as u32);
        if self.count < BLOCKS as u32 {
            return None;
        }
        self.judge()
    }

    /// Compares the window with the bias before (F13), and learns from it what is usual, and the bias.
    fn judge(&mut self) -> Option<BiasStep<T>> {
        let (before, before_covariance) = self.known.solve()?;
        let evidence = least_squares::of_window(&self.blocks, &before, Change::Bias(0));
        let (step, covariance) = evidence.solve_weakly();
        let window_s = self
            .blocks
            .iter()
            .fold(T::zero(), |sum, b| sum + b.length_s);
        let turn = self
            .blocks
            .iter()
            .fold(Vector3::zeros(), |sum, b| sum + b.turn);
        let scale = turn.norm() / window_s * lit(SCALE_ERROR);
        let walk: T = lit(WALK_RAD_S);
        let both =
            covariance + before_covariance + Matrix3::identity() * (walk * walk + scale * scale);
        let distance2 = both.cholesky().map(|root| step.dot(&root.solve(&step)));
        let distance2 = distance2.filter(|d2| d2.is_finite())?;
        self.verdicts.rotate_left(1);
        if let Some(last) = self.verdicts.last_mut() {
            *last = Some(Verdict { distance2, step });
        }
        if self.is_step() {
            // A turn that the gyroscope missed stays as it is; what a bias turns grows.
            let step = self.likeliest(&before, Change::Bias);
            let turn = self.likeliest(&before, Change::Turn);
            if step.explained > turn.explained {
                return Some(self.stepped(&before, window_s, &step));
            }
        }
        self.learn(&evidence, &before, window_s);
        None
    }

    /// Whether the last windows agree that the bias is another one (F14).
    fn is_step(&mut self) -> bool {
        let agreed = self.agreed();
        let is_step = self.windows >= LEAST_WINDOWS
            && agreed > self.usual * lit(UNUSUAL)
            && agreed > self.largest * lit(LARGER);
        self.largest_now = self.largest_now.max(agreed);
        is_step
    }

    /// The least distance in which the last windows agree, squared; zero where they are not of one direction, or too small to tell.
    fn agreed(&self) -> T {
        let (mut sum, mut squares) = (Vector3::zeros(), T::zero());
        let mut least: Option<T> = None;
        for verdict in &self.verdicts {
            let Some(verdict) = verdict else {
                return T::zero();
            };
            least = Some(least.map_or(verdict.distance2, |least| least.min(verdict.distance2)));
            sum += verdict.step;
            squares += verdict.step.norm_squared();
        }
        let count: T = lit(AGREEING as f64);
        let notable = lit::<T>(NOTABLE_RAD_S * NOTABLE_RAD_S) * count;
        let alike = sum.norm_squared() > squares * count * lit(ALIKE);
        least
            .filter(|_| alike && squares > notable)
            .unwrap_or(T::zero())
    }

    /// The change of a kind that explains most of the window: the block with which it begins, its evidence, itself, and how much of
    /// the sum of squares it explains, in variances.
    fn likeliest(&self, before: &Vector3<T>, kind: fn(usize) -> Change) -> Explanation<T> {
        let mut best = Explanation {
            since: 0,
            evidence: Evidence::prior(before, T::one()),
            change: Vector3::zeros(),
            explained: -T::one(),
        };
        for since in 0..=BLOCKS - FEWEST {
            let evidence = least_squares::of_window(&self.blocks, before, kind(since));
            let (change, _) = evidence.solve_weakly();
            let explained = evidence.explains(&change);
            if explained > best.explained {
                best = Explanation {
                    since,
                    evidence,
                    change,
                    explained,
                };
            }
        }
        best
    }

    /// Takes over a step of the bias.
    fn stepped(&mut self, before: &Vector3<T>, window_s: T, found: &Explanation<T>) -> BiasStep<T> {
        let (step, evidence, began) = (found.change, &found.evidence, found.since);
        let (bias, size) = (before + step, step.norm());
        let diluted = size * lit(DILUTED);
        let covariance =
            evidence.covariance_within(size) + Matrix3::identity() * (diluted * diluted);
        let std = covariance.diagonal().max().max(T::zero()).sqrt();
        self.known = Evidence::prior(&bias, std);
        self.largest_now = T::zero();
        let mean =
            least_squares::mean_of(&self.blocks, &self.frame_from_body, [before, &step], began);
        let resumed = least_squares::resumed(
            &self.blocks,
            &self.frame_from_body,
            [before, &step],
            began,
            &covariance,
        );
        self.interrupt();
        BiasStep {
            resumed,
            mean,
            bias,
            std,
            size,
            window_s,
        }
    }

    /// Learns what is usual from the verdict before those that are looked at, and the bias from a window that has nothing in common
    /// with the last one (F15).
    fn learn(&mut self, evidence: &Evidence<T>, before: &Vector3<T>, window_s: T) {
        if let Some(Some(oldest)) = self.verdicts.first() {
            let seen = oldest.distance2.min(self.usual * lit(OUTLIER));
            let seen = seen.max(lit(LEAST_USUAL));
            self.usual += (seen - self.usual) * lit(1.0 / MEMORY_BLOCKS);
        }
        self.since_learnt += 1;
        if self.since_learnt < BLOCKS as u32 {
            return;
        }
        self.since_learnt = 0;
        self.windows = self.windows.saturating_add(1);
        let kept = (-window_s / lit(FORGET_S)).exp();
        // Not that of the window just ended: a step that is being found is in it.
        self.largest = (self.largest * kept).max(self.largest_before);
        self.largest_before = self.largest_now;
        self.largest_now = T::zero();
        self.known
            .learn(evidence, before, kept, lit(WINDOW_SHARE), lit(PRIOR_RAD_S));
    }
}

#[cfg(test)]
mod tests;
