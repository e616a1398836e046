//! Which detection came from which target: gates, PDA, IPDA, JIPDA.
//!
//! | file | what is in it |
//! |---|---|
//! | [`gate`] | how far a detection may lie from a target, and the probability inside |
//! | [`pda`] | probabilistic data association: weights of one target, update with all of them |
//! | [`ipda`] | whether the target exists, and whether the sensor can see it |
//! | [`candidates`] | the detections in one target's gate, with their weights |
//! | [`clusters`] | which targets share detections |
//! | [`jipda`] | weights of several targets that share detections |
//!
//! Derivation: `docs/derivations/association.md`.

pub mod candidates;
pub mod clusters;
pub mod gate;
pub mod ipda;
pub mod jipda;
pub mod pda;
