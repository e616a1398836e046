//! Tests of the lab over real sockets, in one program: `cargo test -p northing-live --all-features --test integration MODULE::`.

mod bad_input;
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
