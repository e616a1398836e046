//! How fast the error of the own ship's pose changes, learnt from targets that are seen together.
//!
//! An error of the own ship's heading turns all bearings at once. Noise of the sensor and turns of a target do not: what several targets
//! have in common from one look to the next is the own ship's. How much more it changes over a longer time than over a shorter one tells
//! how long the error lasts ([`PoseErrorCorrelation`]), which nobody tells a tracker that gets a pose and its covariance only.
//!
//! When not: a convoy that manoeuvres in unison, with no other target in sight, looks like an own ship whose position drifts.
//!
//! An error that jumps to and fro from scan to scan about one that stays is not taken for one that drifts: such jitter is no larger
//! over two scans than over one. Equations: `docs/derivations/association.md`, section 10.

use nalgebra::{Matrix2, Matrix2x3, Matrix3, Matrix4, Vector2, Vector3, Vector4};

use super::own_ship::PoseErrorCorrelation;
use super::seen::FARTHEST_APART;
use crate::scalar::{Scalar, lit};

/// Scans that are remembered.
const MEMORY: f64 = 1000.0;
/// Standard deviations of a rate by which it has to differ from the usual one before it is used.
const CONVINCING: f64 = 2.0;
/// Part of its variance that one unknown has to have for itself to be told from the others.
const SINGULAR: f64 = 1e-5;
/// Changes over at most so many scans are looked at.
const GAPS: usize = FARTHEST_APART as usize;

/// Change of what was measured of a target less what was expected, from one look at it to another.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub(super) struct Change<T> {
    /// How much.
    pub(super) by: Vector2<T>,
    /// Scans from one look to the other.
    pub(super) scans: u8,
}

/// What a target shows of the own ship's error in the last two or three looks at it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Changes<T> {
    /// Since the last look.
    pub(super) since_last: Change<T>,
    /// Since the one before.
    pub(super) since_before: Option<Change<T>>,
    /// Of the measured by the own ship's pose.
    pub(super) jacobian: Matrix2x3<T>,
    /// Variance of each component without the own ship's part.
    pub(super) spread: Vector2<T>,
}

/// What is seen, and what of it each unknown would cause (W2): rates of position and heading, 1/s, then jitter of both.
#[derive(Debug, Clone, Copy)]
struct Moments<T> {
    seen: Vector4<T>,
    caused: Matrix4<T>,
}

/// Weighted changes over some number of scans, of one target or of several.
#[derive(Debug, Clone, Copy)]
struct Shown<T> {
    scans: usize,
    targets: u32,
    changes: Vector3<T>,
    weights: Matrix3<T>,
}

/// What the targets of a scan show of the own ship's error together.
#[derive(Debug, Clone, Copy)]
pub(super) struct SeenTogether<T> {
    targets: u32,
    /// Seconds between two scans.
    interval_s: T,
    /// Covariance of the pose: of position and heading.
    pose: [Matrix3<T>; 2],
    all: [Shown<T>; GAPS],
    /// Products of each target with itself.
    own: Moments<T>,
}

impl<T: Scalar> Moments<T> {
    fn none() -> Self {
        Self {
            seen: Vector4::zeros(),
            caused: Matrix4::zeros(),
        }
    }

    /// Adds the products of what two show, which end in the same scan.
    fn add(&mut self, a: &Shown<T>, b: &Shown<T>, together: &SeenTogether<T>) {
        let both = lit::<T>(a.scans.min(b.scans) as f64) * together.interval_s;
        let ends = if a.scans == b.scans { 2.0 } else { 1.0 };
        let by = [both * lit(2.0), lit(ends)];
        for x in 0..4 {
            let pose = &together.pose[x % 2];
            self.seen[x] += by[x / 2] * (b.changes.transpose() * pose * a.changes).trace();
            let weighted = pose * a.weights;
            for y in 0..=x {
                let caused = weighted * together.pose[y % 2] * b.weights;
                let caused = by[x / 2] * by[y / 2] * caused.trace();
                self.caused[(x, y)] += caused;
                if x != y {
                    self.caused[(y, x)] += caused;
                }
            }
        }
    }
}

impl<T: Scalar> SeenTogether<T> {
    /// Nothing yet, with this covariance of the pose and so many seconds between two scans; `None` where the pose is exact.
    pub(super) fn new(pose: &Matrix3<T>, interval_s: T) -> Option<Self> {
        if pose.trace() <= T::zero() {
            return None;
        }
        let mut position = *pose;
        position.fill_column(2, T::zero());
        position.fill_row(2, T::zero());
        let mut heading = Matrix3::zeros();
        heading[(2, 2)] = pose[(2, 2)];
        Some(Self {
            targets: 0,
            interval_s,
            pose: [position, heading],
            all: core::array::from_fn(|at| Shown {
                scans: at + 1,
                targets: 0,
                changes: Vector3::zeros(),
                weights: Matrix3::zeros(),
            }),
            own: Moments::none(),
        })
    }

    /// Takes one target.
    pub(super) fn add(&mut self, seen: &Changes<T>) {
        if !seen.spread.iter().all(|variance| *variance > T::zero()) {
            return;
        }
        self.targets += 1;
        let inverse = Matrix2::from_diagonal(&seen.spread.map(|variance| T::one() / variance));
        let gain = seen.jacobian.transpose() * inverse;
        let weights = gain * seen.jacobian;
        let shown = [Some(seen.since_last), seen.since_before].map(|change| {
            change.map(|change| Shown {
                scans: usize::from(change.scans),
                targets: 1,
                changes: gain * change.by,
                weights,
            })
        });
        let mut own = self.own;
        for a in shown.iter().flatten() {
            let Some(all) = a.scans.checked_sub(1).and_then(|at| self.all.get_mut(at)) else {
                continue;
            };
            all.targets += 1;
            all.changes += a.changes;
            all.weights += a.weights;
            for b in shown.iter().flatten().filter(|b| b.scans <= GAPS) {
                own.add(a, b, self);
            }
        }
        self.own = own;
    }

    /// Products of what two different targets show, over all pairs; `None` of fewer than two.
    fn pairs(&self) -> Option<Moments<T>> {
        if self.targets < 2 {
            return None;
        }
        let mut all = Moments::none();
        let shown = || self.all.iter().filter(|shown| shown.targets > 0);
        for a in shown() {
            for b in shown() {
                all.add(a, b, self);
            }
        }
        Some(Moments {
            seen: all.seen - self.own.seen,
            caused: all.caused - self.own.caused,
        })
    }
}

/// How fast errors of the own ship's position and heading change, as learnt so far.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(
    feature = "serde",
    serde(bound(
        serialize = "T: Scalar + serde::Serialize",
        deserialize = "T: Scalar + serde::Deserialize<'de>"
    ))
)]
pub struct PoseErrorMemory<T> {
    /// What was seen, what of it each unknown would cause, and the variance of what was seen: rates of position and heading, then
    /// jitter of both.
    seen: [T; 4],
    caused: [[T; 4]; 4],
    variance: [[T; 4]; 4],
}

impl<T: Scalar> Default for PoseErrorMemory<T> {
    /// Nothing is known.
    fn default() -> Self {
        let zero = T::zero();
        Self {
            seen: [zero; 4],
            caused: [[zero; 4]; 4],
            variance: [[zero; 4]; 4],
        }
    }
}

impl<T: Scalar> PoseErrorMemory<T> {
    /// Takes a scan (W2).
    pub(super) fn learn(&mut self, scan: &SeenTogether<T>) {
        let Some(pairs) = scan.pairs() else { return };
        let mut next = *self;
        let fade = lit::<T>(1.0 - 1.0 / MEMORY);
        for a in 0..4 {
            next.seen[a] = next.seen[a] * fade + pairs.seen[a];
            for b in 0..4 {
                next.caused[a][b] = next.caused[a][b] * fade + pairs.caused[(a, b)];
                next.variance[a][b] = next.variance[a][b] * fade + pairs.seen[a] * pairs.seen[b];
            }
        }
        if next.numbers().all(|number| number.is_finite()) {
            *self = next;
        }
    }

    /// Rate of change, 1/s, of position and heading, with the standard deviation (W3); `None` where nothing is known.
    fn rates(&self) -> [Option<[T; 2]>; 2] {
        // What is exact causes nothing, and stands aside.
        let known = |a: usize| self.caused[a][a] > T::zero();
        if !(0..4).any(known) {
            return [None; 2];
        }
        let unit = Vector4::from_fn(|a, _| match known(a) {
            true => T::one() / self.caused[a][a].sqrt(),
            false => T::zero(),
        });
        let scaled = |rows: &[[T; 4]; 4]| Matrix4::from_fn(|a, b| rows[a][b] * unit[a] * unit[b]);
        let mut caused = scaled(&self.caused);
        for a in 0..4 {
            if !known(a) {
                caused[(a, a)] = T::one();
            }
        }
        let Some(root) = caused.cholesky() else {
            return [None; 2];
        };
        let l = root.l_dirty();
        if (0..4).any(|a| l[(a, a)] * l[(a, a)] < lit(SINGULAR)) {
            return [None; 2];
        }
        let inverse = root.inverse();
        let rate = inverse * Vector4::from(self.seen).component_mul(&unit);
        let variance = inverse * scaled(&self.variance) * inverse;
        core::array::from_fn(|a| {
            let std = variance[(a, a)].max(T::zero()).sqrt();
            known(a).then_some([rate[a] * unit[a], std * unit[a]])
        })
    }

    /// The correlation times, where they are refuted those nearest to them that are likely; a time of 0, of errors that are new in every
    /// scan, stays.
    pub fn correlation(&self, usual: &PoseErrorCorrelation<T>) -> PoseErrorCorrelation<T> {
        let [position, heading] = self.rates();
        PoseErrorCorrelation {
            position_s: likely(usual.position_s, position),
            heading_s: likely(usual.heading_s, heading),
        }
    }

    /// The numbers, for checks of a saved state.
    pub(super) fn numbers(&self) -> impl Iterator<Item = &T> {
        let matrices = self.caused.iter().chain(&self.variance);
        self.seen.iter().chain(matrices.flatten())
    }
}

/// The usual time, unless the rate refutes it: then that of the rate, a standard deviation nearer to the usual one.
fn likely<T: Scalar>(usual: T, rate: Option<[T; 2]>) -> T {
    let Some([rate, std]) = rate.filter(|_| usual > T::zero()) else {
        return usual;
    };
    let other = rate - T::one() / usual;
    let nearer = if other > T::zero() {
        rate - std
    } else {
        rate + std
    };
    if other.abs() > std * lit(CONVINCING) && nearer > T::zero() {
        T::one() / nearer
    } else {
        usual
    }
}

#[cfg(test)]
mod tests;
