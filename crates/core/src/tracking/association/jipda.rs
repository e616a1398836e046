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
//! Cost: exact, one multiplication an event; fallback, detections in gates x iterations.

use super::candidates::Association;
use super::clusters::Clusters;
use crate::scalar::{Scalar, lit};

/// Joint events that a cluster may have before belief propagation takes over. The bound is on the
/// product of (1 + gated detections) over its targets: at most so many leaves.
pub const EXACT_EVENTS: u64 = 20_000;

/// How a scan was associated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AssociationEffort {
    /// Clusters summed exactly, single targets included.
    pub exact_clusters: u32,
    /// Clusters beyond [`EXACT_EVENTS`], taken by belief propagation.
    pub approximate_clusters: u32,
}

/// Marginal probabilities of the weights of a scan's targets, one result a target: as many as the shortest of `weights`, `marginals` and `N`.
pub fn associate<T: Scalar, const N: usize, const D: usize>(
    weights: &[Association<T, D>],
    marginals: &mut [Association<T, D>],
    clusters: &mut Clusters<T, N, D>,
) -> AssociationEffort {
    let mut effort = AssociationEffort::default();
    let targets = weights.len().min(marginals.len()).min(N);
    let weights = &weights[..targets];
    clusters.find(weights);
    for first in 0..targets {
        if !clusters.leads(first) {
            continue;
        }
        let events = clusters.from(first).fold(1_u64, |product, t| {
            product.saturating_mul(1 + weights[t].candidates().len() as u64)
        });
        if events <= EXACT_EVENTS {
            effort.exact_clusters += 1;
            exact(weights, marginals, clusters, first);
        } else {
            effort.approximate_clusters += 1;
            belief_propagation(weights, marginals, clusters, first);
        }
        clusters.from(first).for_each(|t| marginals[t].normalize());
    }
    effort
}

/// Sums every joint event of a cluster (J3).
fn exact<T: Scalar, const N: usize, const D: usize>(
    weights: &[Association<T, D>],
    sums: &mut [Association<T, D>],
    clusters: &Clusters<T, N, D>,
    first: usize,
) {
    for t in clusters.from(first) {
        sums[t] = weights[t].emptied(T::zero());
    }
    Walk { weights, clusters }.on(sums, Some(first), None, T::one());
}

/// A detection that a target before has taken, and those that were taken before it.
struct Taken<'a> {
    detection: u32,
    before: Option<&'a Self>,
}

/// Whether a detection is among them: as many comparisons as there are targets before.
fn is_taken(taken: Option<&Taken<'_>>, detection: u32) -> bool {
    core::iter::successors(taken, |t| t.before).any(|t| t.detection == detection)
}

/// What every step of the walk looks at.
struct Walk<'a, T, const N: usize, const D: usize> {
    weights: &'a [Association<T, D>],
    clusters: &'a Clusters<T, N, D>,
}

impl<T: Scalar, const N: usize, const D: usize> Walk<'_, T, N, D> {
    /// Adds the events of the target `t` and those after it to the sums, given the detections `taken` and the
    /// weight `above` of the choices so far. Returns the sum over the events below. As deep as the cluster has targets, which
    /// [`EXACT_EVENTS`] keeps below 15.
    fn on(
        &self,
        sums: &mut [Association<T, D>],
        t: Option<usize>,
        taken: Option<&Taken<'_>>,
        above: T,
    ) -> T {
        let Some(t) = t else { return T::one() };
        let next = self.clusters.after(t);
        let missed = self.weights[t].missed;
        let mut total = missed * self.on(sums, next, taken, above * missed);
        sums[t].missed += above * total;
        for (place, candidate) in self.weights[t].candidates().iter().enumerate() {
            if is_taken(taken, candidate.detection) {
                continue;
            }
            let chosen = Taken {
                detection: candidate.detection,
                before: taken,
            };
            let weight = candidate.weight;
            let below = weight * self.on(sums, next, Some(&chosen), above * weight);
            sums[t].candidates_mut()[place].weight += above * below;
            total += below;
        }
        total
    }
}

/// Iterations of belief propagation: its error falls geometrically, most clusters need ten.
const ITERATIONS: usize = 50;

/// Approximate marginals of a large cluster (J4); the messages of targets to detections live in the
/// result, their sums for each detection in the clusters' columns.
fn belief_propagation<T: Scalar, const N: usize, const D: usize>(
    weights: &[Association<T, D>],
    messages: &mut [Association<T, D>],
    clusters: &mut Clusters<T, N, D>,
    first: usize,
) {
    let least = lit::<T>(1e-30);
    let mut at = Some(first);
    while let Some(t) = at {
        messages[t] = weights[t].emptied(T::one());
        at = clusters.after(t);
    }
    for _ in 0..ITERATIONS {
        let mut at = Some(first);
        while let Some(t) = at {
            at = clusters.after(t);
            send(&weights[t], &mut messages[t], clusters, t);
        }
    }
    let columns = clusters.columns.as_flattened();
    for t in clusters.from(first) {
        let missed = weights[t].missed.max(least);
        let pairs = weights[t].candidates().iter().zip(clusters.column[t]);
        for ((candidate, column), message) in pairs.zip(messages[t].candidates_mut()) {
            let from = T::one() / (columns[column as usize] - message.weight).max(least);
            message.weight = candidate.weight / missed * from;
        }
    }
}

/// The messages of one target, given those of the others.
fn send<T: Scalar, const N: usize, const D: usize>(
    weights: &Association<T, D>,
    messages: &mut Association<T, D>,
    clusters: &mut Clusters<T, N, D>,
    t: usize,
) {
    let least = lit::<T>(1e-30);
    let missed = weights.missed.max(least);
    let columns = clusters.columns.as_flattened_mut();
    let column = &clusters.column[t];
    let mut shares = [T::zero(); D];
    let mut sum = T::one();
    let each = weights.candidates().iter().zip(messages.candidates());
    for (share, ((candidate, message), column)) in shares.iter_mut().zip(each.zip(column)) {
        let from = T::one() / (columns[*column as usize] - message.weight).max(least);
        *share = candidate.weight / missed * from;
        sum += *share;
    }
    let each = weights.candidates().iter().zip(messages.candidates_mut());
    for ((candidate, message), (share, column)) in each.zip(shares.iter().zip(column)) {
        let next = candidate.weight / missed / (sum - *share).max(least);
        columns[*column as usize] += next - message.weight;
        message.weight = next;
    }
}

#[cfg(test)]
mod tests;
