//! The detections that one target may have caused, with their weights: a short list, whatever the length of the scan.
//!
//! Equations: `docs/derivations/association.md`, section 5 (J1).

use crate::scalar::{Scalar, lit};

/// A detection in a target's gate.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate<T> {
    /// Index of the detection in its scan.
    pub detection: u32,
    /// In: `P_D r l / lambda` (J1). Out: the probability that the target caused it.
    pub weight: T,
}

/// Weights of one target: of no detection, and of at most `D` detections, in the order of the scan.
#[derive(Debug, Clone, Copy)]
pub struct Association<T, const D: usize> {
    /// Weight of no detection. In: `1 - P_D r`. Out: the probability.
    pub missed: T,
    len: usize,
    candidates: [Candidate<T>; D],
}

impl<T: Scalar, const D: usize> Association<T, D> {
    /// A target with no detection in its gate.
    pub fn missed(weight: T) -> Self {
        let nothing = Candidate {
            detection: 0,
            weight: T::zero(),
        };
        Self {
            missed: weight,
            len: 0,
            candidates: [nothing; D],
        }
    }

    /// As [`Self::missed`], in place.
    pub(in crate::tracking) fn reset(&mut self, missed: T) {
        self.missed = missed;
        self.len = 0;
    }

    /// The detections in the gate, in the order of the scan.
    pub fn candidates(&self) -> &[Candidate<T>] {
        &self.candidates[..self.len]
    }

    /// Whether the target probably caused one of them. Out only.
    pub(in crate::tracking) fn is_seen(&self) -> bool {
        self.missed < lit(0.5)
    }

    pub(super) fn candidates_mut(&mut self) -> &mut [Candidate<T>] {
        &mut self.candidates[..self.len]
    }

    /// Adds a detection; detections come in the order of the scan. Without room the one with the least weight goes, perhaps
    /// this one: then the answer is false. Weights that are not positive are left out.
    pub fn add(&mut self, detection: u32, weight: T) -> bool {
        let counts = weight > T::zero();
        if !counts || D == 0 {
            return true;
        }
        let candidate = Candidate { detection, weight };
        if self.len < D {
            self.candidates[self.len] = candidate;
            self.len += 1;
            return true;
        }
        let mut lightest = 0;
        for (i, other) in self.candidates.iter().enumerate() {
            if other.weight < self.candidates[lightest].weight {
                lightest = i;
            }
        }
        if self.candidates[lightest].weight < weight {
            self.candidates[lightest..].rotate_left(1);
            self.candidates[D - 1] = candidate;
        }
        false
    }

    /// The same detections with weight zero, and `missed` of no detection.
    pub(super) fn emptied(&self, missed: T) -> Self {
        let mut out = *self;
        out.missed = missed;
        for candidate in out.candidates_mut() {
            candidate.weight = T::zero();
        }
        out
    }

    /// Scales the weights to sum one; a target that nothing explains was missed.
    pub(super) fn normalize(&mut self) {
        let each = self.candidates().iter();
        let sum = each.fold(self.missed, |sum, candidate| sum + candidate.weight);
        if sum > T::zero() && sum.is_finite() {
            self.missed /= sum;
            for candidate in self.candidates_mut() {
                candidate.weight /= sum;
            }
        } else {
            *self = Self::missed(T::one());
        }
    }
}

/// The same weights of the same detections.
impl<T: Scalar, const D: usize> PartialEq for Association<T, D> {
    fn eq(&self, other: &Self) -> bool {
        self.missed == other.missed && self.candidates() == other.candidates()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_room_the_least_weight_goes_and_the_order_stays() {
        let mut target = Association::<f64, 3>::missed(0.1);
        for (detection, weight) in [(0, 0.5), (2, 0.1), (3, 0.0), (5, 0.7)] {
            assert!(target.add(detection, weight));
        }
        assert!(!target.add(6, 0.05), "lighter than all: left out");
        assert!(!target.add(7, 0.6), "one was left out for it");
        assert!(target.add(8, f64::NAN), "no weight is no candidate");
        let kept: std::vec::Vec<_> = target.candidates().iter().map(|c| c.detection).collect();
        assert_eq!(kept, [0, 5, 7]);
    }

    #[test]
    fn nothing_explains_a_target_without_weights() {
        let mut target = Association::<f64, 2>::missed(0.0);
        target.normalize();
        assert_eq!(target, Association::missed(1.0));
    }
}
