//! Property tests of the numerics of every filter: seeded sequences of garbage under extreme settings, in both precisions.
//!
//! Each sequence draws its settings from what validation permits, ends included, and then some hundred operations:
//! plausible samples mixed with numbers that are not finite, zero or up to 1e38, intervals up to 1e9 s and negative, stamps
//! that repeat and go back, standard deviations from 1e-12 to 1e12. After each operation everything must be finite,
//! quaternions of unit length, and covariances symmetric and positive semidefinite within the square root of the rounding
//! unit, as correlations. `NORTHING_SEQUENCES` sets the number of sequences of each filter for a long run, and
//! `NORTHING_FIRST_SEQUENCE` the first of them.

#![allow(clippy::unwrap_used, clippy::panic, unreachable_pub)]

mod attitude;
mod garbage;
mod gnss_ins;
mod harness;
mod navigation;
mod tracking;
