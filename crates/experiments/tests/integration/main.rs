//! Tests of experiments and random worlds, in one program. `cargo test -p northing-experiments --test integration MODULE::`.

#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

mod attitude_worlds;
mod faults;
mod ground;
mod navigation_worlds;
mod observers;
mod tracking;
mod tracking_expected;
mod tracking_ranges;
mod tracking_worlds;
