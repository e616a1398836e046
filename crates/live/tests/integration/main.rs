//! Tests of the lab over real sockets, in one program: `cargo test -p northing-live --all-features --test integration MODULE::`.

#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

mod bad_input;
mod hand_in;
mod inputs;
mod lab_page;
mod opened;
mod recording;
mod restart;
mod robustness;
mod roles;
#[path = "../support/mod.rs"]
mod support;
mod uploads;
mod what_if;
