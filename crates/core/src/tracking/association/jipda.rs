//! Joint association of several targets that share detections (JPDA, JIPDA).
//!
//! Read first: Musicki and Evans, *Joint Integrated Probabilistic Data Association*, IEEE TAES 40
//! (2004); Williams and Lau, *Approximate Evaluation of Marginal Association Probabilities with
//! Belief Propagation*, IEEE TAES 50 (2014); `docs/derivations/association.md`, section 5.
//!
//! Targets whose gates share no detection are independent. In every cluster of the others the joint
//! events (each detection from at most one target, each target at most one detection) are summed
//! exactly, depth first, when there are at most [`EXACT_EVENTS`]; larger clusters take belief
//! propagation, which is polynomial and errs by a few per cent. No allocation.
//!
//! Cost: exact, one multiplication an event; fallback, targets x detections x iterations.

use crate::scalar::{Scalar, lit};

/// Joint events that a cluster may have before belief propagation takes over. The bound is on the
/// product of (1 + gated detections) over its targets: at most so many leaves.
pub const EXACT_EVENTS: u64 = 20_000;
/// Detections that one scan may have: bits of the mask.
pub const MOST_DETECTIONS: usize = 128;
/// Targets that one scan may have: bits of the mask.
pub const MOST_TARGETS: usize = 128;

/// A set of targets or of detections.
type Mask = u128;

/// Weights of one target.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Association<T, const D: usize> {
    /// Weight of no detection. In: `1 - P_D r`. Out: the probability.
    pub missed: T,
    /// Weight of each detection. In: `P_D r l / lambda`, zero outside the gate. Out: the
    /// probability.
    pub detections: [T; D],
}

/// How a scan was associated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AssociationEffort {
    /// Clusters summed exactly, single targets included.
    pub exact_clusters: u32,
    /// Clusters beyond [`EXACT_EVENTS`], taken by belief propagation.
    pub approximate_clusters: u32,
}

impl<T: Scalar, const D: usize> Association<T, D> {
    /// A target with no detection in its gate.
    pub fn missed(weight: T) -> Self {
        Self {
            missed: weight,
            detections: [T::zero(); D],
        }
    }

    /// Scales the weights to sum one; a target that nothing explains was missed.
    fn normalize(&mut self) {
        let sum = self.detections.iter().fold(self.missed, |s, w| s + *w);
        if sum > T::zero() && sum.is_finite() {
            self.missed /= sum;
            self.detections.iter_mut().for_each(|w| *w /= sum);
        } else {
            *self = Self::missed(T::one());
        }
    }

    fn gated(&self) -> Mask {
        self.detections
            .iter()
            .enumerate()
            .filter(|(_, w)| **w > T::zero())
            .fold(0, |mask: Mask, (j, _)| mask | (1 << j))
    }
}

/// Marginal probabilities of the weights of a scan's targets, one result a target.
///
/// Targets beyond [`MOST_TARGETS`] (and beyond the shorter slice) are left as they are.
pub fn associate<T: Scalar, const D: usize>(
    weights: &[Association<T, D>],
    marginals: &mut [Association<T, D>],
) -> AssociationEffort {
    const { assert!(D <= MOST_DETECTIONS) };
    let mut effort = AssociationEffort::default();
    let count = weights.len().min(marginals.len()).min(MOST_TARGETS);
    let weights = &weights[..count];
    let mut open = (0..count).fold(0, |mask: Mask, t| mask | (1 << t));
    while open != 0 {
        let cluster = cluster_of(weights, open);
        open &= !cluster;
        let events = members(cluster).fold(1_u64, |product, t| {
            product.saturating_mul(1 + u64::from(weights[t].gated().count_ones()))
        });
        if events <= EXACT_EVENTS {
            effort.exact_clusters += 1;
            exact(weights, marginals, cluster);
        } else {
            effort.approximate_clusters += 1;
            belief_propagation(weights, marginals, cluster);
        }
        members(cluster).for_each(|t| marginals[t].normalize());
    }
    effort
}

/// The targets that share detections with the first open one, directly or through others.
fn cluster_of<T: Scalar, const D: usize>(weights: &[Association<T, D>], open: Mask) -> Mask {
    let first = open.trailing_zeros() as usize;
    let mut cluster = 1 << first;
    let mut detections = weights[first].gated();
    loop {
        let before = cluster;
        for t in members(open & !before) {
            let gated = weights[t].gated();
            if gated & detections != 0 {
                cluster |= 1 << t;
                detections |= gated;
            }
        }
        if cluster == before {
            return cluster;
        }
    }
}

/// The indices of the bits that are set.
fn members(mut mask: Mask) -> impl Iterator<Item = usize> {
    core::iter::from_fn(move || {
        let next = mask.trailing_zeros() as usize;
        mask &= mask.checked_sub(1)?;
        Some(next)
    })
}

/// Sums every joint event of a cluster (J3).
fn exact<T: Scalar, const D: usize>(
    weights: &[Association<T, D>],
    sums: &mut [Association<T, D>],
    cluster: Mask,
) {
    members(cluster).for_each(|t| sums[t] = Association::missed(T::zero()));
    walk(weights, sums, cluster, 0, T::one());
}

/// Adds the events of the targets in `open` to the sums, given the detections already `taken` and the
/// weight `above` of the choices so far. Returns the sum over the events below.
fn walk<T: Scalar, const D: usize>(
    weights: &[Association<T, D>],
    sums: &mut [Association<T, D>],
    open: Mask,
    taken: Mask,
    above: T,
) -> T {
    if open == 0 {
        return T::one();
    }
    let t = open.trailing_zeros() as usize;
    let rest = open & (open - 1);
    let missed = weights[t].missed;
    let mut total = missed * walk(weights, sums, rest, taken, above * missed);
    sums[t].missed += above * total;
    for j in members(weights[t].gated() & !taken) {
        let weight = weights[t].detections[j];
        let below = weight * walk(weights, sums, rest, taken | (1 << j), above * weight);
        sums[t].detections[j] += above * below;
        total += below;
    }
    total
}

/// Iterations of belief propagation: its error falls geometrically, most clusters need ten.
const ITERATIONS: usize = 50;

/// Approximate marginals of a large cluster (J4); the messages of targets to detections live in the
/// result.
fn belief_propagation<T: Scalar, const D: usize>(
    weights: &[Association<T, D>],
    messages: &mut [Association<T, D>],
    cluster: Mask,
) {
    members(cluster).for_each(|t| messages[t] = Association::missed(T::one()));
    let ratio = |t: usize, j: usize| weights[t].detections[j] / weights[t].missed.max(lit(1e-30));
    let mut columns = [T::one(); D];
    for _ in 0..ITERATIONS {
        for t in members(cluster) {
            let gated = weights[t].gated();
            let from =
                |j: usize| T::one() / (columns[j] - messages[t].detections[j]).max(lit(1e-30));
            let sum = members(gated).fold(T::one(), |s, j| s + ratio(t, j) * from(j));
            let next: [T; D] = core::array::from_fn(|j| {
                if gated & (1 << j) == 0 {
                    return T::zero();
                }
                ratio(t, j) / (sum - ratio(t, j) * from(j)).max(lit(1e-30))
            });
            for j in members(gated) {
                columns[j] += next[j] - messages[t].detections[j];
            }
            messages[t].detections = next;
        }
    }
    for t in members(cluster) {
        for j in members(weights[t].gated()) {
            let from = T::one() / (columns[j] - messages[t].detections[j]).max(lit(1e-30));
            messages[t].detections[j] = ratio(t, j) * from;
        }
        messages[t].missed = T::one();
    }
}

#[cfg(test)]
mod tests;
