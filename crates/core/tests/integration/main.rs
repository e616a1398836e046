//! Tests of the filters from outside, in one program: what they share is compiled once. `cargo test -p northing-core --test integration MODULE::`.

#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

mod attitude_variance_limit;
mod examples;
mod gnss_ins_schmidt;
mod in_motion_alignment;
mod numerical_robustness;
mod polar;
#[cfg(feature = "serde")]
mod save_restore;
mod schmidt_kalman;
