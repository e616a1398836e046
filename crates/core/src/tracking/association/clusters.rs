//! Which targets share detections: the clusters that joint association has to look at together.
//!
//! Every pair of a target and a detection in its gate is an edge; edges sorted by detection show who shares one. Targets are joined by
//! union-find. Cost: edges times their logarithm. No allocation, no limit but the numbers of targets and of detections in a gate.

use super::candidates::Association;
use crate::scalar::Scalar;

/// No target: the end of a list.
const NONE: u32 = u32::MAX;

/// A detection in the gate of a target.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default)]
pub(in crate::tracking) struct Edge {
    /// Index of the detection in its scan.
    pub detection: u32,
    /// The target.
    pub target: u32,
    /// Place among the target's candidates.
    pub place: u32,
}

/// Work space of an association: `N` targets, `D` detections in each gate.
#[derive(Debug, Clone)]
pub struct Clusters<T, const N: usize, const D: usize> {
    edges: [[Edge; D]; N],
    count: usize,
    parent: [u32; N],
    next: [u32; N],
    /// For each target and candidate the number of its detection among all that lie in gates.
    pub(super) column: [[u32; D]; N],
    /// A number for each detection that lies in a gate.
    pub(super) columns: [[T; D]; N],
}

impl<T: Scalar, const N: usize, const D: usize> Default for Clusters<T, N, D> {
    fn default() -> Self {
        Self {
            edges: [[Edge::default(); D]; N],
            count: 0,
            parent: [0; N],
            next: [NONE; N],
            column: [[0; D]; N],
            columns: [[T::one(); D]; N],
        }
    }
}

impl<T: Scalar, const N: usize, const D: usize> Clusters<T, N, D> {
    /// Finds who shares detections; at most `N` targets.
    pub(super) fn find(&mut self, weights: &[Association<T, D>]) {
        self.gather(weights);
        for (target, parent) in (0..).zip(&mut self.parent[..weights.len()]) {
            *parent = target;
        }
        let mut column = 0;
        for i in 0..self.count {
            let edge = self.edges.as_flattened()[i];
            if let Some(before) = i.checked_sub(1).map(|i| self.edges.as_flattened()[i]) {
                if before.detection == edge.detection {
                    self.join(before.target, edge.target);
                } else {
                    column += 1;
                }
            }
            self.column[edge.target as usize][edge.place as usize] = column;
        }
        self.columns.as_flattened_mut()[..self.count].fill(T::one());
        self.next[..weights.len()].fill(NONE);
        for target in (0..weights.len()).rev() {
            let root = self.root(target as u32);
            if root as usize != target {
                self.next[target] = self.next[root as usize];
                self.next[root as usize] = target as u32;
            }
        }
    }

    /// All edges, by detection, then target.
    pub(in crate::tracking) fn edges(&self) -> &[Edge] {
        &self.edges.as_flattened()[..self.count]
    }

    /// Whether a target is the first of its cluster.
    pub(super) fn leads(&self, target: usize) -> bool {
        self.parent[target] as usize == target
    }

    /// The target after this one in its cluster.
    pub(super) fn after(&self, target: usize) -> Option<usize> {
        Some(self.next[target])
            .filter(|next| *next != NONE)
            .map(|next| next as usize)
    }

    /// A cluster's targets in rising order, from its first.
    pub(super) fn from(&self, first: usize) -> impl Iterator<Item = usize> {
        core::iter::successors(Some(first), |target| self.after(*target))
    }

    fn gather(&mut self, weights: &[Association<T, D>]) {
        let room = self.edges.as_flattened_mut();
        let mut count = 0;
        for (target, weights) in (0..).zip(weights) {
            for (place, candidate) in (0..).zip(weights.candidates()) {
                room[count] = Edge {
                    detection: candidate.detection,
                    target,
                    place,
                };
                count += 1;
            }
        }
        room[..count].sort_unstable();
        self.count = count;
    }

    /// First target of the cluster so far; the way there is halved for the next who asks.
    fn root(&mut self, target: u32) -> u32 {
        let mut at = target as usize;
        while self.parent[at] as usize != at {
            self.parent[at] = self.parent[self.parent[at] as usize];
            at = self.parent[at] as usize;
        }
        at as u32
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }
}
