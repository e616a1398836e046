//! Tests of runs, calibrations and verdicts, in one program. `cargo test -p northing-evaluation --test integration MODULE::`.

#![allow(clippy::unwrap_used)] // helpers of tests unwrap like tests

mod allan;
mod bounded_velocity;
mod bounded_velocity_inputs;
mod compass;
mod faults;
mod in_motion_alignment_data;
mod lab_script;
mod magnetometer_calibration;
mod mekf_consistency;
mod navigation_benchmark_data;
mod navigation_data;
mod navigation_latency;
mod navigation_origin;
mod navigation_start_data;
mod navigation_travel;
mod positions;
mod reference_data;
mod tracking_data;
mod tracking_scale;
mod uniform;
mod vehicle_axes;
mod verdicts;
