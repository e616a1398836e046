//! Tests of the readers and writers, in one program. `cargo test -p northing-recording --test integration MODULE::`.

#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

mod bad_bags;
mod bag_containers;
mod bag_topics;
mod csv;
mod describe;
mod docs;
mod fuzz_seeds;
mod manifest;
mod manifest_navigation;
mod mcap;
mod mcap_bag;
mod navigation_data;
mod parquet_columns;
mod parquet_data;
mod phyphox;
mod plausibility;
mod plausible_fixes;
#[path = "../support/ros.rs"]
mod ros;
mod round_trip;
mod sensor_logger;
#[path = "../support/mod.rs"]
mod support;
#[path = "../support/tables.rs"]
mod tables;
mod tracking;
mod wire_fixtures;
mod wire_truth;
