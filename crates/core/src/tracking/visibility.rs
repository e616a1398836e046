//! How often targets of this scene hide, learnt from tracks: the longer they are seen without a break, the rarer.
//!
//! A target that has left and one that hides are both silent. Which of the two it is depends on how often targets hide
//! ([`ExistenceModel::visible_s`]), which differs from scene to scene by more than a hundred: off a coast never, in a crowd all the time.
//! Equation: `docs/derivations/association.md`, section 4, (E6).

use super::association::ipda::{Existence, ExistenceModel};
use crate::scalar::Scalar;

/// What confirmed tracks showed so far.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct VisibilityMemory<T> {
    /// Seconds that targets were seen without hiding, of all tracks together.
    seen_s: T,
    /// Targets that were seen again after they had been hidden, each by the probability that it had been.
    returned: T,
}

impl<T: Scalar> Default for VisibilityMemory<T> {
    fn default() -> Self {
        Self {
            seen_s: T::zero(),
            returned: T::zero(),
        }
    }
}

impl<T: Scalar> VisibilityMemory<T> {
    /// Takes in that a confirmed target is seen again after `silent_s` seconds, with what was thought of it just before.
    pub(super) fn seen(&mut self, silent_s: T, before: &Existence<T>) {
        let visible = before.was_visible();
        self.seen_s += visible * silent_s;
        self.returned += T::one() - visible;
    }

    /// The model with the mean time that targets stay visible as learnt (E6). Where they never hide nothing is learnt.
    pub(super) fn model(&self, usual: &ExistenceModel<T>) -> ExistenceModel<T> {
        if usual.hidden_s <= T::zero() {
            return *usual;
        }
        ExistenceModel {
            visible_s: (usual.visible_s + self.seen_s) / (T::one() + self.returned),
            ..*usual
        }
    }

    /// The numbers, for checks of a saved state.
    pub(super) fn numbers(&self) -> [&T; 2] {
        [&self.seen_s, &self.returned]
    }
}

#[cfg(test)]
mod tests;
